"""Durations of primitives, measured in executions: mean, spread and count, for each behaviour and for each of its actors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

from confab.planner.timed.pieces import actors_of, default_actors, pieces_of
from confab.reasoner.memory.experience import MeasuredDuration, Statistics
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import PrimitiveStep, Times

PARTS = 1000
"""Number of parts of a second to which a mean is rounded."""


def measured(problem: Problem, executed: Iterable[tuple[PrimitiveStep, float]]) -> Statistics:
    """Return the statistics of executed primitives; behaviours that the problem doesn't have are left out.

    Parameters
    ----------
    problem : Problem
    executed : iterable of (step, float)
        Primitives with their durations in seconds.
    """
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    resting = default_actors(problem)
    for step, seconds in executed:
        behavior = problem.domain.behaviors.get(step.behavior)
        if behavior is None:
            continue
        fixed = pieces_of(problem, behavior).fixed
        terms = (*step.arguments, *(step.bindings.get(v.name[1:], v.name) for v in fixed))
        for actor in ("", *actors_of(problem, behavior, terms, resting)):
            found[step.behavior, actor].append(seconds)
    return {key: MeasuredDuration.of(seconds) for key, seconds in sorted(found.items())}


def with_durations(problem: Problem, statistics: Statistics) -> Problem:
    """Return a problem whose behaviours without a stated duration take the measured means."""
    if not statistics:
        return problem
    means = {key: Fraction(round(one.mean * PARTS), PARTS) for key, one in statistics.items()}
    every = {name: mean for (name, actor), mean in means.items() if not actor}
    own = {key: mean for key, mean in means.items() if key[1]}
    return replace(problem, times=replace(problem.times or Times(), measured=every, of_actors=own))
