"""Costs of plans, as the plan checker calculates them.

A primitive whose behaviour has a price costs the price in the state before the primitive. Every other primitive costs the cost
of its behaviour.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from confab.planner.plan import Plan, Step
from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.limits import checked
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Times

TRIFLE = 2.0**-20
"""Cost added to each primitive when plans are compared; of two plans with equal costs, the shorter plan is then cheaper."""


class Primitive(Protocol):
    """A step of the lowest level: a behaviour and its arguments."""

    @property
    def behavior(self) -> str:
        """The name of the behaviour."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """The individuals of the behaviour's parameters."""


def cost_of(problem: Problem, plan: Plan) -> float:
    """Return the sum of the costs of a plan's primitives."""
    return sum(costs(problem, plan.primitives))


def stated_cost(problem: Problem, plan: Plan) -> float | None:
    """Return the cost of a plan; None if every primitive of the problem costs 1."""
    behaviors = problem.domain.behaviors.values()
    return cost_of(problem, plan) if any(one.price is not None or one.cost != 1.0 for one in behaviors) else None


def compared(problem: Problem, primitives: Sequence[Primitive]) -> float:
    """Return the quantity that shortening minimises: the cost of primitives and, among equal costs, their number."""
    return sum(costs(problem, primitives)) + TRIFLE * len(primitives)


def costs(problem: Problem, primitives: Sequence[Primitive]) -> list[float]:
    """Return the cost of each primitive of a sequence that starts in the initial state."""
    behaviors = [problem.domain.behaviors[step.behavior] for step in primitives]
    if all(behavior.price is None for behavior in behaviors):
        return [behavior.cost for behavior in behaviors]
    found, rules, facts = [], BehaviorReader(problem), LoggedState(problem, problem.initial)
    for step, behavior in zip(primitives, behaviors, strict=True):
        price = rules.price(behavior, step.arguments, facts)
        found.append(behavior.cost if price is None else float(price))
        for change in rules.changes(behavior, step.arguments, facts) or ():
            facts.put(*change)
    return found


def in_circles(problem: Problem, plan: Plan) -> int:
    """Return the number of superfluous primitives: primitives on a circle that leads from a state back to the same state.

    Only the outermost of nested circles counts. A sequence of primitives that leaves any symbol changed is no circle. External
    events aren't superfluous.
    """
    rules, facts, events = (
        BehaviorReader(problem),
        LoggedState(problem, problem.initial),
        (problem.times or Times()).events,
    )
    values: dict[tuple[str, tuple[str, ...]], str | None] = {}
    now, states = 0, [0]  # a state is represented by the exclusive or of the hashes of its facts
    for step in checked(plan.primitives, "looking for superfluous steps"):
        for situation, key, value in (
            rules.changes(problem.domain.behaviors[step.behavior], step.arguments, facts) or ()
        ):
            cell = situation, key
            now ^= hash((cell, values[cell] if cell in values else facts.value(situation, key))) ^ hash((cell, value))
            values[cell] = value
            facts.put(situation, key, value)
        if step.behavior not in events:
            states.append(now)
    last = {state: number for number, state in enumerate(states)}
    circles, at = 0, 0
    while at < len(states) - 1:
        back = last[states[at]]
        circles += back - at
        at = max(back, at) + 1
    return circles


def costs_of_steps(problem: Problem, steps: Sequence[Step]) -> list[float]:
    """Return the cost of each step: the sum of the costs of the primitives below the step."""
    parts = [Plan((step,)).primitives for step in steps]
    each = iter(costs(problem, [step for part in parts for step in part]))
    return [sum(next(each) for _ in part) for part in parts]
