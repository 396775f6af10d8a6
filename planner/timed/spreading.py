"""Spreading of turns over values: objects that the plan puts down at one place, one after another, are put down at several places.

A value that is looked up, such as a place, has turns (`confab.planner.timed.order`). Another value takes a turn if the static
conditions allow it, if no symbol has it at first or in the goal, and if it is free between the first and the last step of the turn
in the sequence. The plan checker judges the result.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from confab.planner.plan import Plan, Step
from confab.planner.timed.activities import InapplicableError
from confab.planner.timed.exchange import exchanged, possible
from confab.planner.timed.order import Order, order_in_sequence
from confab.planner.validation import BehaviorReader, LoggedState, validate
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem


@dataclass(frozen=True)
class _ValueTurn:
    """A turn at a value in the sequence: the first and the last step, and the steps that name the value."""

    first: int
    last: int
    naming: tuple[int, ...]

    def meets(self, other: _ValueTurn) -> bool:
        """Return whether two spans have a common part."""
        return self.first <= other.last and other.first <= self.last


def spread(problem: Problem, plan: Plan) -> Plan:
    """Return a plan with the same behaviours, in which the turns at looked-up values are spread over equal values.

    Return the given plan if no turn has another value, or if the checker doesn't accept the result.
    """
    steps = plan.primitives
    try:
        order = order_in_sequence(problem, steps)
    except InapplicableError:
        return plan
    naming = _naming(steps)
    renamed = _renamed(problem, plan, naming, _spans(order, naming))
    if not renamed:
        return plan
    new = exchanged(problem, plan, renamed)
    return plan if validate(problem, new) else new


def _naming(steps: Sequence[Step]) -> Mapping[str, Sequence[int]]:
    """Return the numbers of the steps that name each individual."""
    found: dict[str, list[int]] = defaultdict(list)
    for number, step in enumerate(steps):
        for one in dict.fromkeys((*step.arguments, *step.bindings.values())):
            found[one].append(number)
    return found


def _spans(order: Order, naming: Mapping[str, Sequence[int]]) -> dict[str, list[_ValueTurn]]:
    """Return the spans at each looked-up value that steps name.

    A span begins with the first step that names the value after the turn before.
    """
    found: dict[str, list[_ValueTurn]] = {}
    for resource in order.resources:
        value = resource.value
        if value is None or value not in naming:
            continue
        found[value], before = [], -1
        for turn in resource.turns:
            if not turn.reading:
                last = max(turn.members)
                its = tuple(number for number in naming[value] if before < number <= last)
                found[value].append(_ValueTurn(min(*turn.members, *its), last, its))
                before = last
    return found


def _renamed(
    problem: Problem, plan: Plan, naming: Mapping[str, Sequence[int]], spans: Mapping[str, Sequence[_ValueTurn]]
) -> Mapping[int, Mapping[str, str]]:
    """Return the new value in place of each replaced value, by the number of the step.

    Each span takes the value that has the fewest spans so far, of the values that are possible and free during the span.
    """
    steps = {step.path: step for step in plan.walk()}
    above = [[steps[step.path[:depth]] for depth in range(1, len(step.path) + 1)] for step in plan.primitives]
    rules, facts = BehaviorReader(problem), LoggedState(problem, problem.initial)
    taken: dict[str, list[_ValueTurn]] = defaultdict(list, {value: list(its) for value, its in spans.items()})
    renamed: dict[int, dict[str, str]] = defaultdict(dict)
    for value, its in spans.items():
        equal = [one for one in _equal(problem, value) if one in spans or one not in naming]
        for span in its:
            check("scheduling the plan")
            taken[value].remove(span)
            upper = {step.path: step for number in span.naming for step in above[number]}.values()
            free = (
                other
                for other in sorted(equal, key=lambda one: len(taken[one]))
                if not any(map(span.meets, taken[other]))
                and all(possible(problem, rules, facts, step, {value: other}) is not None for step in upper)
            )
            chosen = next(free, value)
            taken[chosen].append(span)
            if chosen != value:
                for number in span.naming:
                    renamed[number][value] = chosen
    return renamed


def _equal(problem: Problem, value: str) -> list[str]:
    """Return the individuals of the same classes as a value that neither the initial state nor the goal names."""
    facts = (*problem.initial.items(), *problem.goal.items())
    used = {one for symbol, its in facts for one in (its, *symbol.arguments)}
    kinds = [kind for kind in problem.classes if value in problem.members(kind)]
    return [
        one
        for one in problem.classes.get(min(kinds, default=""), ())
        if one not in used and all(one in problem.members(kind) for kind in kinds)
    ]
