"""Refutations by motion planning: a behaviour is physically impossible while some facts hold.

A refutation becomes a precondition of the behaviour, both in the problem and in the ontology: with the refuted arguments, the
behaviour isn't applicable while all facts hold. Because refutations are preconditions, planning, validation and explanation need
no special treatment of refutations.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, AnyOf, EqualityCondition, Fact, ValueCondition


@dataclass(frozen=True, order=True)
class Refutation:
    """A behaviour with its arguments, the facts that make it impossible, and the reason.

    An empty argument stands for any individual.
    """

    behavior: str
    arguments: tuple[str, ...]
    facts: tuple[Fact, ...]
    why: str = ""

    @property
    def individuals(self) -> frozenset[str]:
        """The individuals in the arguments and facts."""
        return frozenset(
            {*self.arguments, *(part for fact in self.facts for part in (*fact.symbol.arguments, fact.value))}
        )

    def covers(self, other: Refutation) -> bool:
        """Return whether this refutation is at least as general as `other`: it applies in every case in which `other` applies."""
        same = self.behavior == other.behavior and {*self.facts} <= {*other.facts}
        return same and all(mine in ("", its) for mine, its in zip(self.arguments, other.arguments, strict=True))

    def __str__(self) -> str:
        """Return the refutation as text, e.g. ``not OPEN hand door while bottle LOCATION before_door: no path``."""
        facts = ", ".join(map(str, self.facts))
        return f"not {' '.join((self.behavior, *(one or 'any' for one in self.arguments)))} while {facts}" + (
            f": {self.why}" if self.why else ""
        )


def with_refuted(problem: Problem, refutations: Iterable[Refutation]) -> Problem:
    """Return a problem in which each refutation is an additional precondition of its behaviour."""
    behaviors = dict(problem.domain.behaviors)
    for one in refutations:
        behavior = behaviors.get(one.behavior)
        if behavior is None:
            continue
        same = [
            EqualityCondition(parameter.name, argument)
            for parameter, argument in zip(behavior.parameters, one.arguments, strict=True)
            if argument
        ]
        facts = [_condition(fact) for fact in one.facts]
        condition = AnyOf(((*same, *facts),), negated=True)
        if condition not in behavior.preconditions:
            behaviors[one.behavior] = replace(behavior, preconditions=(*behavior.preconditions, condition))
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))


def _condition(fact: Fact) -> ValueCondition:
    """Return the condition that a fact holds; a false fact becomes a negated condition."""
    value = TRUE if fact.value == FALSE else fact.value
    return ValueCondition(fact.symbol.situation, fact.symbol.arguments, value, negated=fact.value == FALSE)
