"""Lower bounds on times that hold for every plan, whatever its steps: on the makespan, and on the time of each goal.

The bound on the makespan is the greater of two numbers. The first number is the longest chain: the least time after which a goal
can hold if actors never wait for each other. The second number is the work of any plan, divided by the number of actors. The work
is the sum of durations, counted for each actor of a step; `each_goal_alone` and LM-cut bound the work from below.

The bound on the time of a goal is the longest chain with time windows and external events. If it is later than the deadline of the
goal, no plan keeps the deadline.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from confab.planner.grounded.grounding import ground
from confab.planner.grounded.shortest import each_goal_alone
from confab.planner.grounded.task import Task, bits_of
from confab.planner.hierarchical.bounds import lm_cut
from confab.planner.plan import Reason, UngroundableError
from confab.planner.timed.pieces import actors_of, default_actors, duration_of, pieces_of
from confab.planner.validation import LoggedState
from confab.reasoner.amounts import situations_in
from confab.reasoner.language import situations_of, walk
from confab.reasoner.limits import OutOfTimeError, checked, current
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    Behavior,
    Condition,
    Effect,
    Parameter,
    SituationType,
    Span,
    Symbol,
    Times,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.timing import timing_of, with_fixed

MOST_ROWS = 50_000
"""Maximum number of rows of one join when the lowest level is grounded; larger levels have the bound 0."""
MOST_CUT = 12_000
"""Maximum number of operators for which LM-cut is computed."""
PARTS = 1_000_000
"""Number of parts of a second to which a bound is rounded down."""
RUNNING = "running"
"""The name of the mark between the begin and the end of a step whose begin and end are separate operators."""


class TooEarly(NamedTuple):
    """A goal with a deadline that no plan keeps, and the least time after which the goal can hold, in seconds."""

    goal: Symbol
    least: Fraction


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


def too_early(problem: Problem) -> TooEarly | None:
    """Return a goal that no plan reaches by its deadline, or None if no such goal is known.

    No goal is known if totals have bounds, as constraints on every state do: a bound is compiled to conditions at the begin of a
    step, but a step that ends at the same time may satisfy it.
    """
    quantities = [problem.domain.situations[name].quantity for name in problem.domain.aggregates]
    if any(one is not None and not (one.least is None and one.most is None) for one in quantities):
        return None
    deadlines = problem.times.deadlines if problem.times else {}
    level = problem.domain.levels[-1]
    wanted = {s: v for s, v in problem.goal.items() if s in deadlines and s not in problem.weights}
    wanted = {symbol: value for symbol, value in wanted.items() if problem.initial.get(symbol, FALSE) != value}
    if not wanted:
        return None
    parted = _with_parts(problem, level)
    try:
        task = ground(parted, level, goal=wanted, most=MOST_ROWS, deadline=current().at)
    except (UngroundableError, MemoryError, OutOfTimeError):
        return None
    if isinstance(task, Reason) or not len(task) or not task.goal:
        return None
    lasts, _, _ = _durations(parted, task, problem)
    times = _earliest(task, lasts, _opening(problem, task, lasts), _running(task))
    for bit in bits_of(task.goal):
        fact = task.facts[bit] if bit < len(task.facts) else task.complements.get(bit)
        symbol = fact.symbol if fact is not None and fact.symbol in wanted else max(wanted, key=deadlines.__getitem__)
        least = Fraction(int(times[bit] * PARTS), PARTS) if isfinite(times[bit]) else Fraction(0)
        if least > deadlines[symbol]:
            return TooEarly(symbol, least)
    return None


def _with_parts(problem: Problem, level: int) -> Problem:
    """Return a problem in which the begin and the end of a step are separate if a condition or effect concerns only one of them.

    The problem is a relaxation: a condition that the step may itself achieve or change before is omitted.
    """
    behaviors, situations = dict(problem.domain.behaviors), dict(problem.domain.situations)
    for one in problem.domain.at_level(level):
        timing, its = timing_of(one), with_fixed(one)
        if all(span is Span.THROUGHOUT for span, _ in (*timing.conditions, *timing.effects)):
            continue
        names, mark = tuple(p.name for p in its.parameters), f"{one.name}@{RUNNING}"
        situations[mark] = SituationType(mark, tuple(p.kind for p in its.parameters), "Truth", level, boolean=True)
        own = {effect.situation for effect in timing.made(Span.START)}
        later = own | {effect.situation for effect in timing.made(Span.THROUGHOUT)}
        begin = (*timing.asked(Span.START), *_untouched(problem, timing.asked(Span.THROUGHOUT), own))
        parts: tuple[tuple[str, Sequence[Condition], Sequence[Effect]], ...] = (
            ("begin", begin, (*timing.made(Span.START), ValueEffect(mark, names, TRUE))),
            (
                "end",
                (ValueCondition(mark, names, TRUE), *_untouched(problem, timing.asked(Span.END), later)),
                (*timing.made(Span.THROUGHOUT), *timing.made(Span.END)),
            ),
        )
        del behaviors[one.name]
        for part, asked, made in parts:
            behaviors[f"{one.name}@{part}"] = replace(
                its,
                name=f"{one.name}@{part}",
                preconditions=tuple(c for c in asked if c not in (one.priced, one.lasting)),
                effects=tuple(e for e in made if isinstance(e, ValueEffect)),
                amounts=tuple(e for e in made if isinstance(e, AmountEffect)),
                price=None,
                timing=None,
            )
    return replace(problem, domain=replace(problem.domain, situations=situations, behaviors=behaviors, first_ids={}))


def _untouched(problem: Problem, conditions: Sequence[Condition], changed: set[str]) -> list[Condition]:
    """Return the conditions that changes of some situation types can't make true."""
    derived = frozenset(problem.domain.rules) if changed else frozenset()
    return [one for one in conditions if (changed | derived).isdisjoint(*(situations_of(part) for part in walk(one)))]


def _whole(problem: Problem, name: str) -> tuple[Behavior, bool]:
    """Return the behaviour of an operator, and whether the operator is only the begin of a step."""
    if name in problem.domain.behaviors:
        return problem.domain.behaviors[name], False
    whole, part = name.rsplit("@", 1)
    return problem.domain.behaviors[whole], part == "begin"


def _opening(problem: Problem, task: Task, lasts: Sequence[float]) -> dict[int, Callable[[float], float]]:
    """Return, for operators with time windows or a fixed time, the first possible begin at or after a time."""
    times, resting = problem.times or Times(), default_actors(problem)
    found: dict[int, Callable[[float], float]] = {}
    for operator in range(len(task)) if times.windows or times.events else ():
        name, arguments, _ = task.describe(operator)
        behavior, _ = _whole(problem, name)
        if behavior.name in times.events:
            found[operator] = partial(max, float(times.events[behavior.name]))
            continue
        acting = actors_of(problem, behavior, arguments, resting)
        own = [times.windows[one] for one in (*arguments[: len(behavior.parameters)], *acting) if one in times.windows]
        if own and name == behavior.name:
            found[operator] = partial(_fitting, own, lasts[operator])
    return found


def _fitting(windows: Sequence[Sequence[tuple[Fraction, Fraction | None]]], lasts: float, begin: float) -> float:
    """Return a time, not before `begin`, before which a step doesn't fit into time windows of each of several individuals."""
    for its in windows:
        ends = ((max(begin, float(low)), inf if high is None else float(high) + 1 / PARTS) for low, high in its)
        begin = min((at for at, end in ends if at + lasts <= end), default=inf)
    return begin


def _running(task: Task) -> dict[int, int]:
    """Return the mark of the running step that each relaxed operator requires that is the end of a step."""
    marks = {bit for bit, fact in enumerate(task.facts) if fact.symbol.situation.endswith(f"@{RUNNING}")}
    if not marks:
        return {}
    return {i: bit for i in range(len(task.owners)) for bit in task.needs[i] if bit in marks}


def _durations(problem: Problem, task: Task, whole: Problem | None = None) -> tuple[list[float], list[int], int]:
    """Return the least duration and the number of actors of each operator, and the number of all actors.

    An operator that is only the end of a step of the problem `whole` has the duration of the step; its begin has the duration 0.
    """
    parted, problem = problem, problem if whole is None else whole
    resting, facts, named = default_actors(problem), LoggedState(problem, problem.initial), set[str]()
    by_actor = problem.times is not None and bool(problem.times.of_actors)
    fixed: dict[str, tuple[Parameter, ...]] = {}
    constant: dict[tuple[str, tuple[str, ...]], float | None] = {}
    lasts, actors = list[float](), list[int]()
    for operator in checked(range(len(task)), "bounding the makespan"):
        name, arguments, bindings = task.describe(operator)
        behavior, beginning = _whole(problem, name)
        given = dict(zip((p.name for p in parted.domain.behaviors[name].parameters), arguments, strict=True))
        given |= {f"?{variable}": value for variable, value in bindings.items()}
        if behavior.name not in fixed:
            fixed[behavior.name] = pieces_of(problem, behavior).fixed
        terms = tuple(given.get(t.name, t.name) for t in (*behavior.parameters, *fixed[behavior.name]))
        acting = actors_of(problem, behavior, terms, resting)
        key = behavior.name, acting if by_actor else ()
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
        lasts.append(0.0 if beginning else its)
        actors.append(len(acting))
    return lasts, actors, len(named)


def _chain(task: Task, lasts: list[float]) -> float:
    """Return the least time after which all goals can hold if nothing ever ceases to hold and actors never wait."""
    return float(_earliest(task, lasts)[bits_of(task.goal)].max())


def _earliest(
    task: Task,
    lasts: Sequence[float],
    opening: Mapping[int, Callable[[float], float]] | None = None,
    running: Mapping[int, int] | None = None,
) -> npt.NDArray[np.float64]:
    """Return the least time after which each bit can hold if nothing ever ceases to hold and actors never wait.

    `opening` returns the first possible begin of an operator. `running` contains the relaxed operators that are the end of a step,
    each with the bit that holds from the begin of the step; the duration of the operator counts from this begin.
    """
    needs, adds = task.needs, task.adds
    filled = needs.starts[1:] > needs.starts[:-1]
    owned = np.array([0.0 if owner < 0 else lasts[owner] for owner in task.owners])
    delayed = [(i, (opening or {})[owner]) for i, owner in enumerate(task.owners) if owner in (opening or {})]
    ends, marks = (np.array(list(its), np.int64) for its in ((running or {}).keys(), (running or {}).values()))
    after = owned[ends]
    owned[ends] = 0.0
    setting = np.repeat(np.arange(len(owned)), np.diff(adds.starts))
    times = np.full(task.size, np.inf)
    times[bits_of(task.initial & ((1 << task.size) - 1))] = 0.0
    while True:
        begins = np.zeros(len(owned))
        if filled.any():
            begins[filled] = np.maximum.reduceat(times[needs.items], needs.starts[:-1][filled])
        begins[ends] = np.maximum(begins[ends], times[marks] + after)
        for i, first in delayed:
            begins[i] = first(begins[i])
        old = times.copy()
        np.minimum.at(times, adds.items, (begins + owned)[setting])
        if np.array_equal(times, old):
            return times
