"""Constant folding: removal of the parts of conditions and effects that are always true or always false.

Regression (`confab.reasoner.afterwards`) replaces terms by individuals and numbers, and duplicates conditions. After regression,
some parts don't depend on the state: for example ``a1 = a2``, ``1 < 2``, or a conjunction of a condition and its negation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from confab.reasoner.afterwards import Conjunction, Simplified, either, negation, opposite
from confab.reasoner.amounts import COMPARING, Calculation, Expression
from confab.reasoner.language import groups, is_variable
from confab.reasoner.symbols import (
    AmountEffect,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    ValueCondition,
    Witness,
)


@dataclass(frozen=True)
class Folding:
    """Simplification of conditions.

    Parameters
    ----------
    classes : mapping of class to individuals
    kinds : mapping of term to class
        The class of each variable, except variables that a witness binds.
    known : set of Condition
        The conditions that are known to be true.
    """

    classes: Mapping[str, Sequence[str]]
    kinds: Mapping[str, str]
    known: frozenset[Condition] = frozenset()

    def effects(self, effects: Iterable[AmountEffect]) -> tuple[AmountEffect, ...]:
        """Return the effects on amounts that can occur; equal effects are combined."""
        found = Counter[AmountEffect]()
        for effect in effects:
            when = self.conjunction(effect.when)
            if when is not None:
                found[replace(effect, when=when)] += 1
        return tuple(replace(effect, amount=_times(many, effect.amount)) for effect, many in found.items())

    def conjunction(self, conditions: Iterable[Condition]) -> Conjunction:
        """Return the conjuncts that don't follow from other conjuncts; return None if the conjunction is contradictory."""
        known, found, more = self.known, list[Condition](), False
        for part in sorted(_parts(conditions), key=lambda condition: bool(groups(condition))):
            folded = replace(self, known=known).condition(part)
            if folded is False:
                return None
            if folded is not True:
                found.append(folded)
                known |= {folded}
                more = more or (bool(groups(part)) and any(not groups(one) for one in _parts((folded,))))
        return self.conjunction(found) if more else tuple(found)

    def condition(self, condition: Condition) -> Simplified:
        """Return a simplified condition, or a truth value if the condition doesn't depend on the state."""
        if condition in self.known:
            return True
        if opposite(condition) in self.known:
            return False
        match condition:
            case ValueCondition(situation, arguments, value, negated) if not is_variable(value):
                for other in self.known:
                    match other:
                        case ValueCondition(same, its, has, False) if (same, its) == (situation, arguments):
                            if has != value and not is_variable(has):
                                return negated
                        case _:
                            pass
            case EqualityCondition(left, right, negated):
                if left == right or self.members(left).isdisjoint(self.members(right)):
                    return (left == right) is not negated
            case ClassCondition(term, kind, negated):
                own, others = self.members(term), {*self.classes.get(kind, ())}
                if own <= others or own.isdisjoint(others):
                    return (own <= others) is not negated
            case Comparison(Fraction() as left, sign, Fraction() as right, negated):
                return COMPARING[sign](left, right) is not negated
            case Witness(variable, kind, inner, negated):
                within = replace(self, kinds={**self.kinds, variable: kind}).conjunction(inner)
                if not self.classes.get(kind) or not within:
                    return (bool(self.classes.get(kind)) and within is not None) is not negated
                return replace(condition, conditions=within)
            case AnyOf(alternatives, negated):
                found = either(self._alternatives(alternatives))
                return negation(found) if negated else found
            case _:
                pass
        return condition

    def _alternatives(self, alternatives: Iterable[tuple[Condition, ...]]) -> Iterator[Conjunction]:
        """Yield simplified alternatives; nested disjunctions are flattened."""
        for group in map(self.conjunction, alternatives):
            match group:
                case (AnyOf(inner, False),):
                    yield from inner
                case _:
                    yield group

    def members(self, term: str) -> set[str]:
        """Return the individuals that a term can denote."""
        return {*self.classes.get(self.kinds[term], ())} if is_variable(term) else {term}


def _parts(conditions: Iterable[Condition]) -> Iterator[Condition]:
    """Yield the conjuncts of a conjunction; nested conjunctions are flattened."""
    for condition in conditions:
        match condition:
            case AnyOf((group,), False):
                yield from _parts(group)
            case AnyOf(alternatives, True) if all(len(group) == 1 and groups(group[0]) for group in alternatives):
                yield from _parts(opposite(group[0]) for group in alternatives)
            case _:
                yield condition


def _times(many: int, amount: Expression) -> Expression:
    if many == 1:
        return amount
    return many * amount if isinstance(amount, Fraction) else Calculation("*", Fraction(many), amount)
