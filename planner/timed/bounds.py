"""A lower bound on the makespan of every plan, whatever its steps.

The bound is the greater of two numbers. The first number is the longest chain: the least time after which a goal can hold if
actors never wait for each other. The second number is the work of any plan, divided by the number of actors. The work is the sum of
durations, counted for each actor of a step; `each_goal_alone` and LM-cut bound the work from below.
"""

from __future__ import annotations

from fractions import Fraction
from math import isfinite

import numpy as np

from confab.planner.grounded.grounding import ground
from confab.planner.grounded.shortest import each_goal_alone
from confab.planner.grounded.task import Task, bits_of
from confab.planner.hierarchical.bounds import lm_cut
from confab.planner.plan import Reason, UngroundableError
from confab.planner.timed.pieces import actors_of, default_actors, duration_of, pieces_of
from confab.planner.validation import LoggedState
from confab.reasoner.amounts import situations_in
from confab.reasoner.limits import OutOfTimeError, checked, current
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Parameter, Span
from confab.reasoner.timing import timing_of

MOST_ROWS = 50_000
"""Maximum number of rows of one join when the lowest level is grounded; larger levels have the bound 0."""
MOST_CUT = 12_000
"""Maximum number of operators for which LM-cut is computed."""
PARTS = 1_000_000
"""Number of parts of a second to which a bound is rounded down."""


def of_any_plan(problem: Problem) -> Fraction:
    """Return a lower bound on the makespan of every plan, in seconds, or 0 if no bound is known.

    Problems with effects or conditions only at the begin or at the end of a step have the bound 0.
    """
    level = problem.domain.levels[-1]
    for behavior in problem.domain.at_level(level):
        timing = timing_of(behavior)
        if any(span is not Span.THROUGHOUT for span, _ in (*timing.conditions, *timing.effects)):
            return Fraction(0)
    if problem.weights:
        return Fraction(0)
    wanted = {symbol: value for symbol, value in problem.goal_on(level).items() if problem.initial.get(symbol) != value}
    try:
        task = ground(problem, level, goal=wanted, most=MOST_ROWS, deadline=current().at)
    except (UngroundableError, MemoryError, OutOfTimeError):
        return Fraction(0)
    if isinstance(task, Reason) or not len(task) or not task.goal:
        return Fraction(0)
    lasts, actors, every = _durations(problem, task)
    task.costs[:] = [seconds * many for seconds, many in zip(lasts, actors, strict=True)]
    work = each_goal_alone(task)(task.initial)
    if len(task) <= MOST_CUT:
        work = max(work, lm_cut(task, current().at)(task.initial))
    least = max(_chain(task, lasts), work / every if every else 0.0)
    return Fraction(int(least * PARTS), PARTS) if isfinite(least) else Fraction(0)


def _durations(problem: Problem, task: Task) -> tuple[list[float], list[int], int]:
    """Return the least duration and the number of actors of each operator, and the number of all actors."""
    resting, facts, named = default_actors(problem), LoggedState(problem, problem.initial), set[str]()
    by_actor = problem.times is not None and bool(problem.times.of_actors)
    fixed: dict[str, tuple[Parameter, ...]] = {}
    constant: dict[tuple[str, tuple[str, ...]], float | None] = {}
    lasts, actors = list[float](), list[int]()
    for operator in checked(range(len(task)), "bounding the makespan"):
        name, arguments, bindings = task.describe(operator)
        behavior = problem.domain.behaviors[name]
        given = dict(zip((p.name for p in behavior.parameters), arguments, strict=True))
        given |= {f"?{variable}": value for variable, value in bindings.items()}
        if name not in fixed:
            fixed[name] = pieces_of(problem, behavior).fixed
        terms = tuple(given.get(t.name, t.name) for t in (*behavior.parameters, *fixed[name]))
        acting = actors_of(problem, behavior, terms, resting)
        key = name, acting if by_actor else ()
        if key not in constant:
            stated = timing_of(behavior).duration
            same = stated is None or isinstance(stated, Fraction)
            seconds = duration_of(problem, behavior, terms, facts) if same else None
            constant[key] = None if seconds is None else float(seconds)
            if stated is not None and situations_in(stated):
                constant[key] = 0.0
        its = constant[key]
        if its is None:
            seconds = duration_of(problem, behavior, terms, facts)
            its = 0.0 if seconds is None else float(seconds)
        named.update(acting)
        lasts.append(its)
        actors.append(len(acting))
    return lasts, actors, len(named)


def _chain(task: Task, lasts: list[float]) -> float:
    """Return the least time after which all goals can hold if nothing ever ceases to hold and actors never wait."""
    needs, adds = task.needs, task.adds
    filled = needs.starts[1:] > needs.starts[:-1]
    owned = np.array([0.0 if owner < 0 else lasts[owner] for owner in task.owners])
    setting = np.repeat(np.arange(len(owned)), np.diff(adds.starts))
    times = np.full(task.size, np.inf)
    times[bits_of(task.initial & ((1 << task.size) - 1))] = 0.0
    while True:
        begins = np.zeros(len(owned))
        if filled.any():
            begins[filled] = np.maximum.reduceat(times[needs.items], needs.starts[:-1][filled])
        old = times.copy()
        np.minimum.at(times, adds.items, (begins + owned)[setting])
        if np.array_equal(times, old):
            return float(times[bits_of(task.goal)].max())
