"""Failure as experience: which static facts proved unreliable, and what to do about it next time.

A primitive that fails though its preconditions hold casts doubt on the static facts that it relied on: that this hand can
reach that place, for instance. Counts only grow, so that what several robots have seen can be added up. A fact that failed more
often than it held isn't relied on as long as there is a plan without it.

What a planner of motions refutes is known at once, and more exactly: there is no way as long as everything is where it is
(`refuted_by`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from planner.acting.episode import Episode
from planner.plan import Limits, Plan, Planner, Status, Step
from reasoner.refutations import Refutation
from reasoner.symbols import Fact, Problem

Static: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A static fact: relation and individuals."""

DOUBTFUL = 0.5
"""A fact whose probability of failure is above this isn't relied on."""


@dataclass(frozen=True)
class Caution:
    """How often each static fact was relied on, and how often in vain.

    >>> reach = ("canReach", ("hand", "shelf"))
    >>> round(Caution({reach: (3, 2)}).doubt(reach), 2)
    0.6
    """

    counts: Mapping[Static, tuple[int, int]] = field(default_factory=dict)

    def doubt(self, fact: Static) -> float:
        """Return the probability that relying on a fact fails (Laplace's rule of succession)."""
        tried, failed = self.counts.get(fact, (0, 0))
        return (failed + 1) / (tried + 2)

    def learned(self, episode: Episode) -> Caution:
        """Return the counts with those of one more episode."""
        counts = dict(self.counts)
        for event in episode.events:
            if event.code != "interrupted":
                for fact in event.relied_on:
                    tried, failed = counts.get(fact, (0, 0))
                    counts[fact] = tried + 1, failed + (not event.ok)
        return Caution(counts)

    def __add__(self, other: Caution) -> Caution:
        """Return the sum of what two robots have seen."""
        facts = sorted({*self.counts, *other.counts})
        pairs = {fact: (self.counts.get(fact, (0, 0)), other.counts.get(fact, (0, 0))) for fact in facts}
        return Caution({fact: (a[0] + b[0], a[1] + b[1]) for fact, (a, b) in pairs.items()})

    def applied(self, problem: Problem, planner: Planner, limits: Limits = Limits()) -> Problem:  # noqa: B008 - frozen
        """Return the problem without the doubtful facts, the most doubtful first, as long as a plan is left."""
        end = limits.end()
        doubtful = [fact for fact in self.counts if self.doubt(fact) > DOUBTFUL]
        for fact in sorted(doubtful, key=lambda fact: (-self.doubt(fact), fact)):
            without = without_relations(problem, [fact])
            if planner(without, limits=limits.until(end)).status is Status.SOLVED:
                problem = without
        return problem


def without_relations(problem: Problem, gone: Iterable[Static]) -> Problem:
    """Return the problem without some of its static facts."""
    relations: dict[str, frozenset[tuple[str, ...]]] = dict(problem.relations)
    for name, row in gone:
        relations[name] = relations.get(name, frozenset()) - {row}
    return replace(problem, relations=relations)


def refuted_by(problem: Problem, chain: Sequence[Step], facts: Sequence[Fact], why: str) -> tuple[Refutation, ...]:
    """Return what is refuted when a primitive can't be done while some facts hold: it, and what is above it with its arguments.

    Parameters
    ----------
    problem : Problem
    chain : sequence of Step
        The primitive, behind all that is above it.
    facts : sequence of Fact
        Where everything was that took part; none, if nothing can be said. A level above is refuted only if it sees them all.
    why : str
    """
    found, needed = [], {*chain[-1].arguments}
    for step in chain if facts else ():
        level = problem.domain.behaviors[step.behavior].level
        if needed <= {*step.arguments} and all(problem.sees(level, fact.symbol, fact.value) for fact in facts):
            found.append(Refutation(step.behavior, step.arguments, tuple(facts), why))
    return tuple(found)


def chain_to(plan: Plan, path: tuple[int, ...]) -> tuple[Step, ...]:
    """Return the step of a plan at a path, behind all that is above it."""
    return tuple(step for step in plan.walk() if step.path == path[: len(step.path)])
