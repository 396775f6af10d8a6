"""What plans cost, as the checker works it out: each primitive its cost, or what its price comes to where it is done."""

from __future__ import annotations

from collections.abc import Sequence

from confab.planner.plan import Plan, Step
from confab.planner.validation import Facts, Rules
from confab.reasoner.symbols import Problem


def cost_of(problem: Problem, plan: Plan) -> float:
    """Return what the primitives of a plan cost."""
    return sum(costs(problem, plan.primitives))


def costs(problem: Problem, primitives: Sequence[Step]) -> list[float]:
    """Return what each of some primitives costs that are done one after the other, from the initial state."""
    behaviors = [problem.domain.behaviors[step.behavior] for step in primitives]
    if all(behavior.price is None for behavior in behaviors):
        return [behavior.cost for behavior in behaviors]
    found, rules, facts = [], Rules(problem), Facts(problem, problem.initial)
    for step, behavior in zip(primitives, behaviors, strict=True):
        price = rules.price(behavior, step.arguments, facts)
        found.append(behavior.cost if price is None else float(price))
        for change in rules.changes(behavior, step.arguments, facts) or ():
            facts.put(*change)
    return found


def costs_of_steps(problem: Problem, steps: Sequence[Step]) -> list[float]:
    """Return what each of some steps costs, with all that is below it."""
    parts = [Plan((step,)).primitives for step in steps]
    each = iter(costs(problem, [step for part in parts for step in part]))
    return [sum(next(each) for _ in part) for part in parts]
