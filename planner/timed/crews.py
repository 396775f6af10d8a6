"""Crews: which actors may execute the steps towards a goal.

If a problem names no actors and has no rest values, such as an imported problem, the actors are the individuals of the *acting
classes*: the smallest set of individuals with a changing state such that each primitive names one of them, such as all trucks and
all drivers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations, islice
from typing import TypeAlias

from confab.planner.timed.listing import combinations as listed
from confab.planner.timed.pieces import default_actors
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import AnyOf, Behavior, Condition, EqualityCondition
from confab.reasoner.timing import timing_of

MOST_CLASSES = 3
"""Maximum number of acting classes."""
BUSY = Fraction(103, 100)
"""A schedule isn't improved further if the makespan times the number of actors is at most this number times the actors' work."""

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A behaviour with its arguments."""


@dataclass(frozen=True)
class Crew:
    """A crew: a chosen individual for each class of actors, the barred actors `without`, and the barred steps.

    A barred step is a behaviour with its arguments; no arguments bar all steps of the behaviour.
    """

    chosen: tuple[tuple[str, str], ...] = ()
    without: frozenset[str] = frozenset()
    barred: frozenset[Ground] = frozenset()


def crews_of(problem: Problem) -> Iterator[Crew]:
    """Yield the crews of a problem; the first crew allows all individuals.

    No individual is chosen for a class that contains another class of actors, such as machines for washers and dryers.
    """
    kinds = dict.fromkeys(
        problem.domain.behaviors[name].kinds[term] for name, terms in acting_terms(problem).items() for term in terms
    )
    classes = {kind: problem.classes.get(kind, ()) for kind in kinds}
    general = {
        kind for kind, its in classes.items() if any(set(other) < set(its) for other in classes.values() if other)
    }
    several = {kind: its for kind, its in classes.items() if len(its) > 1 and kind not in general}
    yield Crew()
    for its in listed(list(several.values())) if several else ():
        yield Crew(tuple(zip(several, its, strict=True)))


def evenly_shared(problem: Problem, work: Fraction, makespan: Fraction) -> bool:
    """Return whether all actors of a problem are busy for almost the whole makespan of a plan.

    `work` is the sum of the times during which the actors are busy.
    """
    actors = every_actor(problem)
    return bool(actors) and makespan * len(actors) <= work * BUSY


def every_actor(problem: Problem) -> list[str]:
    """Return the individuals that may be actors of a behaviour."""
    actors = set[str]()
    for behavior in problem.domain.behaviors.values():
        actors.update(term for term in timing_of(behavior).actors if term not in behavior.kinds)
    for name, terms in acting_terms(problem).items():
        for term in terms:
            actors.update(problem.members(problem.domain.behaviors[name].kinds[term]))
    return sorted(actors)


def acting_terms(problem: Problem) -> dict[str, tuple[str, ...]]:
    """Return those parameters and variables of each behaviour that denote actors."""
    resting, every = default_actors(problem), problem.domain.behaviors.values()
    named = bool(resting) or any(timing_of(behavior).actors for behavior in every)
    acting = frozenset[str]() if named else acting_classes(problem)

    def terms(behavior: Behavior) -> Iterator[str]:
        yield from (term for term in timing_of(behavior).actors if term in behavior.kinds)
        its = (p.name for p in behavior.parameters if not resting.isdisjoint(problem.classes.get(p.kind, ())))
        yield from islice(its, 1)
        yield from (p.name for p in behavior.parameters if p.kind in acting)

    return {behavior.name: tuple(terms(behavior)) for behavior in every}


def acting_classes(problem: Problem) -> frozenset[str]:
    """Return the acting classes: those with the fewest individuals, if some classes are named by each primitive."""
    domain = problem.domain
    primitives = domain.at_level(domain.levels[-1])
    named = [{p.kind for p in one.parameters} for one in primitives]
    changing = {
        p.kind
        for one in primitives
        for p in one.parameters
        if any(p.name in effect.arguments for effect in one.every_effect)
    }
    covering = (
        some
        for many in range(1, MOST_CLASSES + 1)
        for some in combinations(sorted(changing), many)
        if not any(its.isdisjoint(some) for its in named)
    )
    members = problem.classes
    return frozenset(min(covering, key=lambda some: sum(len(members.get(kind, ())) for kind in some), default=()))


def with_crew(problem: Problem, crew: Crew) -> Problem:
    """Return a problem in which only the actors and the steps that a crew allows are possible."""
    lowest, terms, chosen = problem.domain.levels[-1], acting_terms(problem), dict(crew.chosen)

    def asked(behavior: Behavior) -> Behavior:
        acting = terms[behavior.name] if behavior.level == lowest else tuple(behavior.kinds)
        own: list[Condition] = [EqualityCondition(t, one, negated=True) for t in acting for one in sorted(crew.without)]
        for kind in sorted({behavior.kinds[t] for t in acting} & chosen.keys()):
            takes_part = [EqualityCondition(t, chosen[kind]) for t in acting if behavior.kinds[t] == kind]
            own += takes_part if len(takes_part) == 1 else [AnyOf(tuple((one,) for one in takes_part))]
        barred = tuple(
            tuple(EqualityCondition(p.name, a) for p, a in zip(behavior.parameters, arguments, strict=bool(arguments)))
            for name, arguments in sorted(crew.barred)
            if name == behavior.name
        )
        others = [AnyOf(barred, negated=True)] if barred else []
        return replace(behavior, preconditions=(*behavior.preconditions, *own, *others))

    behaviors = {name: asked(behavior) for name, behavior in problem.domain.behaviors.items()}
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))
