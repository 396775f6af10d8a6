"""Costs of plans, as the checker calculates them: each primitive's cost, or its price in the state before it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from confab.planner.plan import Plan, Step
from confab.planner.validation import BehaviorReader, Facts
from confab.reasoner.symbols import Problem

TRIFLE = 2.0**-20
"""Cost added to each step when plans are compared, so that the shorter of two equally cheap plans is the cheaper one."""


class Primitive(Protocol):
    """A step of the lowest level: a behaviour and its arguments."""

    @property
    def behavior(self) -> str:
        """The name of the behaviour."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """The individuals of its parameters."""


def cost_of(problem: Problem, plan: Plan) -> float:
    """Return the cost of a plan's primitives."""
    return sum(costs(problem, plan.primitives))


def compared(problem: Problem, primitives: Sequence[Primitive]) -> float:
    """Return what shortening minimises: the cost of primitives; among equal costs, their number."""
    return sum(costs(problem, primitives)) + TRIFLE * len(primitives)


def costs(problem: Problem, primitives: Sequence[Primitive]) -> list[float]:
    """Return the cost of each primitive of a sequence, executed from the initial state."""
    behaviors = [problem.domain.behaviors[step.behavior] for step in primitives]
    if all(behavior.price is None for behavior in behaviors):
        return [behavior.cost for behavior in behaviors]
    found, rules, facts = [], BehaviorReader(problem), Facts(problem, problem.initial)
    for step, behavior in zip(primitives, behaviors, strict=True):
        price = rules.price(behavior, step.arguments, facts)
        found.append(behavior.cost if price is None else float(price))
        for change in rules.changes(behavior, step.arguments, facts) or ():
            facts.put(*change)
    return found


def in_circles(problem: Problem, plan: Plan) -> int:
    """Return the number of superfluous primitives: those that lead from a state back to the same state.

    Of nested circles only the outermost counts; steps that change more than they undo form no circle.
    """
    rules, facts = BehaviorReader(problem), Facts(problem, problem.initial)
    values: dict[tuple[str, tuple[str, ...]], str | None] = {}
    now, states = 0, [0]  # a state is the exclusive or of its facts' hashes
    for step in plan.primitives:
        for situation, key, value in (
            rules.changes(problem.domain.behaviors[step.behavior], step.arguments, facts) or ()
        ):
            cell = situation, key
            now ^= hash((cell, values[cell] if cell in values else facts.value(situation, key))) ^ hash((cell, value))
            values[cell] = value
            facts.put(situation, key, value)
        states.append(now)
    last = {state: number for number, state in enumerate(states)}
    circles, at = 0, 0
    while at < len(states) - 1:
        back = last[states[at]]
        circles += back - at
        at = max(back, at) + 1
    return circles


def costs_of_steps(problem: Problem, steps: Sequence[Step]) -> list[float]:
    """Return the cost of each step, including all steps below it."""
    parts = [Plan((step,)).primitives for step in steps]
    each = iter(costs(problem, [step for part in parts for step in part]))
    return [sum(next(each) for _ in part) for part in parts]
