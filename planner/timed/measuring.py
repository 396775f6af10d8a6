"""Durations of primitives, measured in executions: mean, spread and count, for each behaviour and for each of its actors."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import sqrt
from typing import TypeAlias

from confab.planner.plan import Step
from confab.planner.timed.pieces import actors_of, default_actors, pieces_of
from confab.reasoner.symbols import Problem, Times

PARTS = 1000
"""Number of parts of a second to which a mean is rounded."""


@dataclass(frozen=True)
class Measured:
    """The measured durations of a behaviour, in seconds: the mean, the standard deviation, and the number of executions."""

    mean: float
    spread: float
    count: int


Statistics: TypeAlias = "Mapping[tuple[str, str], Measured]"
"""Measured durations by behaviour and actor; an empty name of the actor stands for all actors."""


def measured(problem: Problem, executed: Iterable[tuple[Step, float]]) -> Statistics:
    """Return the statistics of executed primitives.

    Parameters
    ----------
    problem : Problem
    executed : iterable of (Step, float)
        Primitives with their durations in seconds.
    """
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    resting = default_actors(problem)
    for step, seconds in executed:
        behavior = problem.domain.behaviors[step.behavior]
        fixed = pieces_of(problem, behavior).fixed
        terms = (*step.arguments, *(step.bindings.get(v.name[1:], v.name) for v in fixed))
        for actor in ("", *actors_of(problem, behavior, terms, resting)):
            found[step.behavior, actor].append(seconds)
    return {key: _statistics(seconds) for key, seconds in sorted(found.items())}


def _statistics(seconds: list[float]) -> Measured:
    mean = sum(seconds) / len(seconds)
    spread = sqrt(sum((one - mean) ** 2 for one in seconds) / max(len(seconds) - 1, 1))
    return Measured(mean, spread, len(seconds))


def with_durations(problem: Problem, statistics: Statistics) -> Problem:
    """Return a problem whose behaviours without a stated duration take the measured means."""
    means = {key: Fraction(round(one.mean * PARTS), PARTS) for key, one in statistics.items()}
    every = {name: mean for (name, actor), mean in means.items() if not actor}
    own = {key: mean for key, mean in means.items() if key[1]}
    return replace(problem, times=replace(problem.times or Times(), measured=every, of_actors=own))
