"""Validation rules on times: time windows that are too short for a behaviour, and durations that aren't in seconds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from fractions import Fraction

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Behavior, Timing
from confab.reasoner.timing import timing_of
from confab.reasoner.validation.case import Fault, ReadCase

SECONDS = ("", "s", "sec", "second", "seconds")
"""Notations of the unit of a duration; durations may have no unit."""


def windows_too_short(case: ReadCase) -> Iterator[Fault]:
    """Find individuals whose time windows are all shorter than a behaviour in which the individual takes part."""
    if case.problem.times is None:
        return
    problem, names = case.problem, case.names
    for individual, windows in case.problem.times.windows.items():
        closed = [high - low for low, high in windows if high is not None]
        if len(closed) < len(windows):
            continue
        longest = max(closed)
        for behavior in problem.domain.behaviors.values():
            lasts = (behavior.timing or Timing()).duration
            if isinstance(lasts, Fraction) and lasts > longest and _names(problem, behavior, individual):
                yield (
                    names.iri(individual),
                    f"{individual} is available for {float(longest):g} s at most; {behavior.name} takes {float(lasts):g} s",
                    f"no plan contains {behavior.name} with {individual}",
                    f"make a c:Window of {individual} longer, or the c:duration of {behavior.name} shorter",
                )


def _names(problem: Problem, behavior: Behavior, individual: str) -> bool:
    """Return whether a step of a behaviour can have an individual as an argument or actor."""
    actors = () if behavior.timing is None else behavior.timing.actors
    kinds = [p.kind for p in behavior.parameters] + [
        behavior.kinds[actor] for actor in actors if actor in behavior.kinds
    ]
    return individual in actors or any(individual in problem.members(kind) for kind in kinds)


def actors_left_out(case: ReadCase) -> Iterator[Fault]:
    """Find primitives that name no actor, but have a term of a class whose individuals are actors of another primitive."""
    domain = case.problem.domain
    primitives = domain.at_level(domain.levels[-1]) if domain.levels else ()
    acting = [(one, one.kinds[actor]) for one in primitives for actor in timing_of(one).actors if actor in one.kinds]
    for behavior in primitives:
        if timing_of(behavior).actors:
            continue
        for other, kind in acting:
            terms = [term for term, its in behavior.kinds.items() if case.problem.below(its, kind)]
            if terms:
                term = terms[0].removeprefix("?")
                yield (
                    case.names.iri(behavior.name),
                    f"{behavior.name} names no actor, but has a term of {kind} ({term}), of which {other.name} names a c:actor",
                    f"only an actor does one step at a time; {behavior.name} may overlap other steps of the same individual",
                    f"state the c:actor of {behavior.name}, as in c:actor :{behavior.name}.{term}; if it needs no actor, nothing",
                )
                break


def durations_in_other_units(case: ReadCase) -> Iterator[Fault]:
    """Find calculated durations whose unit isn't the second."""
    for name, behavior in case.problem.domain.behaviors.items():
        duration = (behavior.timing or Timing()).duration
        unit = None if duration is None else unit_of(duration, case.units)
        if unit is not None and unit not in SECONDS:
            yield (
                case.names.iri(name),
                f"the duration of {name} is calculated in {unit}",
                "durations are read as seconds",
                f"multiply by a factor that converts {unit} to seconds, or correct a c:unit",
            )


def unit_of(expression: Expression, units: Mapping[str, str]) -> str | None:
    """Return the unit of an expression. Return None if a unit isn't stated, or if a number in the expression may convert units.

    >>> unit_of(Calculation("/", Measure("way", ()), Measure("speed", ())), {"way": "m", "speed": "m/min"})
    'min'
    """
    powers = _powers(expression, units)
    if powers is None:
        return None
    over, under = ("·".join(sorted(u for u, n in powers.items() for _ in range(sign * n))) for sign in (1, -1))
    return f"{over or 1}/{under}" if under else over


def _powers(expression: Expression, units: Mapping[str, str]) -> Mapping[str, int] | None:
    """Return the power of each basic unit in the unit of an expression; return None if the unit is unknown."""
    match expression:
        case Calculation(sign, left, right):
            one, other = _powers(left, units), _powers(right, units)
            if sign in "+-":
                return one if other is None else other
            if one is None or other is None:
                return None
            found = Counter(one)
            for unit, power in other.items():
                found[unit] += power if sign == "*" else -power
            return {unit: power for unit, power in found.items() if power}
        case Amount(name) | Measure(name):
            stated = units.get(name, "")
            if not stated:
                return None
            found = Counter[str]()
            for place, part in enumerate(stated.split("/")):
                for unit in filter(None, re.split(r"[*·\s]", part)):
                    found[unit] += -1 if place else 1
            return {unit: power for unit, power in found.items() if power and unit != "1"}
        case Fraction():
            return None
