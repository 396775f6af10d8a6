"""What a motion planner has refuted: a behaviour that can't be carried out as long as some facts hold.

A refutation is one more precondition of the behaviour, in a problem as in the ontology: where all of its facts hold at once,
the behaviour isn't done with these arguments. So whatever plans, checks or explains knows of it without being told.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from reasoner.symbols import FALSE, TRUE, AnyOf, EqualityCondition, Fact, Problem, ValueCondition


@dataclass(frozen=True, order=True)
class Refutation:
    """A behaviour with its arguments, the facts as long as which it can't be carried out, and why not.

    An empty argument stands for any.
    """

    behavior: str
    arguments: tuple[str, ...]
    facts: tuple[Fact, ...]
    why: str = ""

    def covers(self, other: Refutation) -> bool:
        """Tell whether it says all that another one says."""
        same = self.behavior == other.behavior and {*self.facts} <= {*other.facts}
        return same and all(mine in ("", its) for mine, its in zip(self.arguments, other.arguments, strict=True))

    def __str__(self) -> str:
        """Return it in words, e.g. ``not OPEN hand door while bottle LOCATION before_door: no path``."""
        facts = ", ".join(map(str, self.facts))
        return f"not {' '.join((self.behavior, *(one or 'any' for one in self.arguments)))} while {facts}" + (
            f": {self.why}" if self.why else ""
        )


def with_refuted(problem: Problem, refutations: Iterable[Refutation]) -> Problem:
    """Return the problem with one more precondition for each refutation of a behaviour that it has."""
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
    """Return the condition that a fact holds; what is false isn't true."""
    value = TRUE if fact.value == FALSE else fact.value
    return ValueCondition(fact.symbol.situation, fact.symbol.arguments, value, negated=fact.value == FALSE)
