"""Regrouping: runs of steps of one level become refinements of upper-level steps with the same effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.plan import Plan, Step, UngroundableError, renumbered
from confab.planner.validation import successor
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.symbols import FALSE, Problem, State, Symbol

LONGEST = 60
"""Maximum number of steps that are grouped under one step of the level above."""


def under_the_levels_above(problem: Problem, plan: Plan) -> Plan:
    """Return a plan of one level in which runs of steps are grouped under upper-level steps with the same effect.

    As few steps as possible stay ungrouped. The result may be invalid; `validate` then rejects the plan.
    """
    steps = list(plan.steps)
    for level in reversed([level for level in problem.domain.levels if steps and level < steps[0].level]):
        try:
            grouped = _grouped(problem, steps, level)
        except OutOfTimeError:  # the remaining levels stay ungrouped
            break
        if grouped == steps:
            break
        steps = grouped
    return Plan(renumbered(steps))


def _grouped(problem: Problem, steps: list[Step], level: int) -> list[Step]:
    """Return the steps grouped under steps of a level with the same effects.

    As many steps as possible are grouped, in as few groups as possible. At the begin and at the end of a group, all changed symbols
    that the level doesn't see are at rest.
    """
    try:
        task = ground(problem, level, goal={})  # the level may see none of the goals
    except (UngroundableError, OutOfTimeError):
        return steps
    values = _course(problem, steps)
    if not isinstance(task, Task) or values is None:
        return steps
    states = [_state(task, value) for value in values]
    at_rest = list(_at_rest(problem, values, level))
    best: list[tuple[int, int, int, int]] = [(0, 0, -1, -1)]  # ungrouped steps, steps of the level, begin, operator
    best += [(i, 0, i - 1, -1) for i in range(1, len(states))]
    for i, state in enumerate(states[:-1]):
        alone, many = best[i][:2]
        best[i + 1] = min(best[i + 1], (alone + 1, many, i, -1))
        if not at_rest[i]:
            continue
        ways = {task.applied(state, operator): operator for operator in task.applicable(state)[0]}
        for j in range(i + 1, min(i + LONGEST, len(steps)) + 1):
            if at_rest[j] and states[j] != state and states[j] in ways:
                best[j] = min(best[j], (alone, many + 1, i, ways[states[j]]))
    found: list[Step] = []
    end = len(steps)
    while end:
        _, _, begin, operator = best[end]
        run = tuple(steps[begin:end])
        found += run if operator < 0 else [replace(task.steps([operator])[0], steps=run)]
        end = begin
    return found[::-1]


def _course(problem: Problem, steps: Sequence[Step]) -> list[State] | None:
    """Return the initial state and the state after each step, or None if a step isn't applicable."""
    found: list[State] = [dict(problem.initial)]
    for step in steps:
        values = found[-1]
        for one in Plan((step,)).primitives:
            after = successor(problem, problem.domain.behaviors[one.behavior], one.arguments, values)
            if after is None:
                return None
            values = after
        found.append(values)
    return found


def _at_rest(problem: Problem, course: Sequence[State], level: int) -> Iterator[bool]:
    """Yield, for each state, whether all changed symbols that a level doesn't see are at rest."""
    rests = {
        name: kind.rest
        for name, kind in problem.domain.situations.items()
        if kind.rest is not None and kind.level > level
    }
    restless: set[Symbol] = set()
    for before, after in pairwise([course[0], *course]):
        for symbol, value in after.items():
            if symbol.situation in rests and before.get(symbol, FALSE) != value:
                (restless.discard if value == rests[symbol.situation] else restless.add)(symbol)
        yield not restless


def _state(task: Task, values: State) -> int:
    """Return the state of a grounded task in which the symbols have the given values."""
    facts = sum(1 << bit for bit, fact in enumerate(task.facts) if values.get(fact.symbol, FALSE) == fact.value)
    absent = sum(1 << bit for bit, fact in task.complements.items() if values.get(fact.symbol, FALSE) != fact.value)
    state = facts | absent
    return task.derived.completed(state if task.amounts is None else task.amounts.stated(state, values))
