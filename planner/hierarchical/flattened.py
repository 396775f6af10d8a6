"""A plan that leaves a level, made shorter as one of the lowest level alone and put under the levels above again.

Where a level is left, goals came one after the other on a level below, and nothing above says what their steps share.
"""

from __future__ import annotations

from collections.abc import Sequence

from confab.planner.grounded.best_first import SHORTEN, STEP, STEPS
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.plan_windows import shorter
from confab.planner.grounded.task import Task
from confab.planner.hierarchical.postoptimization import worth
from confab.planner.hierarchical.refinement_cache import RefinedStep
from confab.planner.hierarchical.regrouping import under_the_levels_above
from confab.planner.levels import levels_left
from confab.planner.plan import Plan, UngroundableError
from confab.planner.validation import validate
from confab.reasoner.symbols import Problem

MOST_ROWS, OF_A_STEP = 20_000, 500
"""The largest level that is searched as a whole, in rows of a join on the way to operators: at all, and for each step of a plan."""

WORK = 1_000_000
"""Operators that are looked at to make a plan of the lowest level shorter."""


def shortened(problem: Problem, plan: Plan, deadline: float | None = None, soon: bool = False) -> Plan:
    """Return a plan that is shorter and breaks no more that a level above asks; the same if none is found.

    Parameters
    ----------
    problem : Problem
    plan : Plan
        One that leaves a level.
    deadline : float, optional
        On the clock of `time.perf_counter`.
    soon : bool
        Whether no more work is worth it than flat search does on a plan that it found.
    """
    old = plan.primitives
    task = small(problem, problem.domain.levels[-1], deadline, OF_A_STEP * len(old))
    operators = task.operators_of([(s.behavior, s.arguments) for s in old]) if task is not None else None
    if task is None or operators is None:
        return plan
    new = shorter(task, operators, SHORTEN + STEP * min(len(old), STEPS) if soon else WORK, deadline)
    if len(new) >= len(old):
        return plan
    flat = Plan(task.steps(new))
    for found in (under_the_levels_above(problem, flat), flat):
        first = problem.domain.levels[0]
        lost = sum(s.level == first for s in plan.steps) - sum(s.level == first for s in found.steps)
        if (
            worth(len(old) - len(new), lost)
            and not validate(problem, found)
            and broken(problem, found) <= broken(problem, plan)
        ):
            return found
    return plan


def regrouped(problem: Problem, plan: Plan) -> Plan:
    """Return a plan of the lowest level under the levels above wherever these say what it does; as it is if that isn't one."""
    found = under_the_levels_above(problem, plan)
    return plan if validate(problem, found) else found


def shortest_known(
    problem: Problem, steps: Sequence[RefinedStep], deadline: float | None = None
) -> list[tuple[str, tuple[str, ...]]]:
    """Return as few steps of the most abstract level as are found in the place of some, not refined.

    Raises
    ------
    OutOfTimeError
        The deadline came before grounding was done.
    """
    level = problem.domain.levels[0]
    known = [(step.behavior, step.arguments) for step in steps]
    task = small(problem, level, deadline) if all(step.level == level for step in steps) else None
    operators = task.operators_of(known) if task is not None else None
    if task is None or operators is None:
        return known
    return [task.describe(operator)[:2] for operator in shorter(task, operators, SHORTEN, deadline)]


def small(problem: Problem, level: int, deadline: float | None, most: int = MOST_ROWS) -> Task | None:
    """Return the task of a level, with what it sees of the goal and of what is at rest; None if it is large."""
    goal = {s: value for s, value in problem.goal_on(level).items() if problem.sees(level, s, value)}
    try:
        task = ground(problem, level, goal=goal, most=min(most, MOST_ROWS), deadline=deadline)
    except UngroundableError:
        return None
    return task if isinstance(task, Task) else None


def broken(problem: Problem, plan: Plan) -> int:
    """Return how many changes of a plan break what a level above asks."""
    return sum(len(left.broken) for left in levels_left(problem, plan))
