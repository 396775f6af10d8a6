"""A plan of one level put under behaviours of the levels above, wherever a run of its steps does what one of them says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from planner.grounded.grounding import ground
from planner.grounded.task import Task
from planner.plan import OutOfTimeError, Plan, Step, TooLargeError, renumbered
from planner.validation import successor
from reasoner.symbols import FALSE, Problem, State

LONGEST = 60
"""Steps that may stand under one of the level above."""


def under_the_levels_above(problem: Problem, plan: Plan) -> Plan:
    """Return a plan of one level with its steps under those of the levels above, as far up as every step finds a place."""
    steps = list(plan.steps)
    for level in reversed([level for level in problem.domain.levels if steps and level < steps[0].level]):
        grouped = _grouped(problem, steps, level)
        if grouped is None:
            break
        steps = grouped
    return Plan(renumbered(steps))


def _grouped(problem: Problem, steps: Sequence[Step], level: int) -> list[Step] | None:
    """Return as few steps of a level as have all these steps under them, each run doing what its step says; None if none have."""
    try:
        task = ground(problem, level)
    except (TooLargeError, OutOfTimeError):
        return None
    if not isinstance(task, Task):
        return None
    values: list[State] = [dict(problem.initial)]
    for step in steps:
        after = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, values[-1])
        if after is None:
            return None
        values.append(after)
    states = [_state(task, value) for value in values]
    situations = problem.domain.situations
    best: list[tuple[int, int, int] | None] = [(0, 0, -1), *[None] * len(steps)]  # number of steps, begin, operator
    for i, state in enumerate(states[:-1]):
        here = best[i]
        if here is None:
            continue
        ways = {task.applied(state, operator): operator for operator in task.applicable(state)[0]}
        touched: set[object] = set()
        for j in range(i + 1, min(i + LONGEST, len(steps)) + 1):
            touched |= {s for s, value in values[j].items() if values[j - 1].get(s, FALSE) != value}
            there = best[j]
            if states[j] == state or states[j] not in ways or (there is not None and there[0] <= here[0] + 1):
                continue
            at_rest = all(
                value == situations[s.situation].rest
                for s, value in values[j].items()
                if s in touched and situations[s.situation].level > level and situations[s.situation].rest is not None
            )
            if at_rest:
                best[j] = (here[0] + 1, i, ways[states[j]])
    found: list[Step] = []
    end = len(steps)
    while end:
        entry = best[end]
        if entry is None:
            return None
        _, begin, operator = entry
        found.append(replace(task.steps([operator])[0], steps=tuple(steps[begin:end])))
        end = begin
    return found[::-1]


def _state(task: Task, values: State) -> int:
    """Return the state of a level's task in which the symbols have some values."""
    facts = sum(1 << bit for bit, fact in enumerate(task.facts) if values.get(fact.symbol, FALSE) == fact.value)
    absent = sum(1 << bit for bit, fact in task.complements.items() if values.get(fact.symbol, FALSE) != fact.value)
    return task.derived.completed(facts | absent)
