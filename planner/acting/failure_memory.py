"""Learning from failures: unreliable static facts are counted, and removed from a problem.

If a primitive fails although its preconditions hold, the static facts on which the primitive relied become doubtful
(for instance, the fact that a hand can reach a place). Counts never decrease, so the counts of several robots can be
added. A fact that failed more often than it held is avoided if there is a plan without this fact.

A refutation by motion planning is certain, and more specific than a count: the behaviour is impossible while the objects stay
at their places (`refuted_by`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from confab.planner.acting.episode import Episode
from confab.planner.plan import Limits, Plan, Planner, Status, Step
from confab.reasoner.problem import Problem
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact, RelationCondition

Static: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A static fact: relation and individuals."""

DOUBTFUL = 0.5
"""Maximum probability of failure of a fact on which plans may rely."""


@dataclass(frozen=True)
class Caution:
    """The number of times that plans relied on each static fact, and the number of times that the fact failed.

    >>> reach = ("canReach", ("hand", "shelf"))
    >>> round(Caution({reach: (3, 2)}).failure_probability(reach), 2)
    0.6
    """

    counts: Mapping[Static, tuple[int, int]] = field(default_factory=dict)

    def failure_probability(self, fact: Static) -> float:
        """Return the probability that relying on a fact fails (Laplace's rule of succession)."""
        tried, failed = self.counts.get(fact, (0, 0))
        return (failed + 1) / (tried + 2)

    def learned(self, episode: Episode) -> Caution:
        """Return the counts updated by one more episode."""
        counts = dict(self.counts)
        for event in episode.events:
            if event.code != "interrupted":
                for fact in event.relied_on:
                    tried, failed = counts.get(fact, (0, 0))
                    counts[fact] = tried + 1, failed + (not event.ok)
        return Caution(counts)

    def __add__(self, other: Caution) -> Caution:
        """Return the sum of the counts of two robots."""
        facts = sorted({*self.counts, *other.counts})
        pairs = {fact: (self.counts.get(fact, (0, 0)), other.counts.get(fact, (0, 0))) for fact in facts}
        return Caution({fact: (a[0] + b[0], a[1] + b[1]) for fact, (a, b) in pairs.items()})

    def applied(self, problem: Problem, planner: Planner, limits: Limits = Limits()) -> Problem:  # noqa: B008 - frozen
        """Return the problem without doubtful facts, the most doubtful first, as far as plans without them exist."""
        end = limits.end()
        doubtful = [fact for fact in self.counts if self.failure_probability(fact) > DOUBTFUL]
        for fact in sorted(doubtful, key=lambda fact: (-self.failure_probability(fact), fact)):
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


def refuted_by(
    problem: Problem, chain: Sequence[Step], facts: Sequence[Fact], why: str, likewise: Sequence[Refutation] = ()
) -> tuple[Refutation, ...]:
    """Return refutations after a failed primitive: the primitive and some of its ancestors are impossible while `facts` hold.

    `chain` is the primitive, preceded by its ancestors. `facts` are the places of all participating objects, or empty if unknown. A
    behaviour of an upper level is refuted only if the level sees all `facts`. `likewise` are refutations of similar primitives for
    the same reason, for example with another hand; an ancestor is also refuted if no other behaviour has its effects. Refutations
    that `likewise` implies are left out.
    """
    exact, found = Refutation(chain[-1].behavior, chain[-1].arguments, tuple(facts), why), list[Refutation]()
    steps = chain if facts and not any(one.covers(exact) for one in likewise) else ()
    for step in (one for node in steps for one in node.together):
        if {*exact.arguments} <= {*step.arguments} and _seen(problem, step.behavior, facts):
            found.append(replace(exact, behavior=step.behavior, arguments=step.arguments))
    behaviors = {one.behavior for one in likewise}
    above = (wide for one in likewise for wide in _above(problem, one, behaviors))
    return tuple(dict.fromkeys((*found, *above, *likewise)))


def _seen(problem: Problem, behavior: str, facts: Iterable[Fact]) -> bool:
    """Return whether all symbols of `facts` are visible on the level of a behaviour."""
    level = problem.domain.behaviors[behavior].level
    return all(problem.sees(level, fact.symbol, fact.value) for fact in facts)


def _above(problem: Problem, one: Refutation, likewise: Collection[str]) -> Iterator[Refutation]:
    """Yield refutations of the upper-level behaviours whose effects only the behaviours in `likewise` can make."""
    every, own = problem.domain.behaviors, problem.domain.behaviors[one.behavior]
    bound = {parameter.name: name for parameter, name in zip(own.parameters, one.arguments, strict=True) if name}
    for effect in own.effects:
        made = effect.situation, effect.value
        same = [(other, e) for other in every.values() for e in other.effects if (e.situation, e.value) == made]
        if {*effect.arguments} != {*bound} or not {o.name for o, _ in same if o.level == own.level} <= {*likewise}:
            continue
        for other, e in same:
            if other.level < own.level and _seen(problem, other.name, one.facts):
                renamed = dict(zip(e.arguments, (bound[term] for term in effect.arguments), strict=True))
                arguments = tuple(renamed.get(parameter.name, "") for parameter in other.parameters)
                yield replace(one, behavior=other.name, arguments=arguments)


def chain_to(plan: Plan, path: tuple[int, ...]) -> tuple[Step, ...]:
    """Return the step of a plan at a path, preceded by all its ancestors."""
    return tuple(step for step in plan.walk() if step.path == path[: len(step.path)])


def relied_on_by(problem: Problem, chain: Sequence[Step]) -> list[Static]:
    """Return the static facts on which a primitive relied, or if there are none, its nearest ancestor that relied on any."""
    for step in reversed(chain):
        found = [static for one in step.together for static in _static_of(problem, one)]
        if found:
            return found
    return []


def _static_of(problem: Problem, step: Step) -> Iterator[Static]:
    """Yield the static facts that the preconditions of a step require."""
    behavior = problem.domain.behaviors[step.behavior]
    env = {p.name: argument for p, argument in zip(behavior.parameters, step.arguments, strict=True)}
    env |= {f"?{name}": value for name, value in step.bindings.items()}
    for condition in behavior.preconditions:
        if isinstance(condition, RelationCondition) and not condition.negated:
            row = tuple(env.get(a, a) for a in condition.arguments)
            if row in problem.relations.get(condition.relation, ()):
                yield condition.relation, row
