"""Regression: translation of a condition after a behaviour to an equivalent condition before the behaviour.

For example, ``IN(parcel) = van`` holds after LOAD(?item, ?into) in two cases: the parcel is ?item and the van is ?into, or the
parcel isn't ?item and is in the van before. Conditions inside disjunctions and witnesses are translated, too. An equality of two
equal terms becomes true, and an equality of terms that can't denote the same individual becomes false.

Source: R. Reiter, "Knowledge in Action" (2001), section 4.5; extended to functional situation types and numeric effects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count, product
from typing import TypeAlias

from confab.reasoner.amounts import Amount, Calculation, Expression, after_effect, put_in, situations_in, terms_of
from confab.reasoner.effects import made_of
from confab.reasoner.language import is_variable, mentions, plain_variables, situations_of, substituted, walk
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Effect,
    EqualityCondition,
    Parameter,
    SituationType,
    ValueCondition,
    ValueEffect,
    Witness,
)

Simplified: TypeAlias = "Condition | bool"
Conjunction: TypeAlias = "tuple[Condition, ...] | None"
"""A conjunction of conditions; None stands for a contradictory conjunction."""
Scaled: TypeAlias = "Callable[[Expression], Expression]"
ScaledAmount: TypeAlias = "tuple[Amount, str, Scaled]"
OPPOSITE: Mapping[str, str] = {"increase": "decrease", "decrease": "increase"}
MOST_CASES = 24
"""Maximum number of combinations of effects that may change one expression."""


class TooManyCasesError(ValueError):
    """Raised if more than `MOST_CASES` combinations of effects may change one expression."""


def both(formulas: Iterable[Simplified]) -> Conjunction:
    """Return the conjunction of formulas without conjuncts that are always true; return None for a contradiction."""
    found: dict[Condition, None] = {}
    for formula in formulas:
        if formula is False:
            return None
        if formula is not True:
            found[formula] = None
    if any(opposite(condition) in found for condition in found):
        return None
    return tuple(found)


def either(alternatives: Iterable[Conjunction]) -> Simplified:
    """Return the disjunction of conjunctions."""
    left = [group for group in dict.fromkeys(alternatives) if group is not None]
    if not left:
        return False
    if () in left:
        return True
    return left[0][0] if len(left) == 1 and len(left[0]) == 1 else AnyOf(tuple(left))


def opposite(formula: Condition) -> Condition:
    """Return the negation of a condition."""
    return replace(formula, negated=not formula.negated)


def negation(formula: Simplified | Conjunction) -> Simplified:
    """Return the negation of a formula or conjunction; variables that it determines are local to the negation."""
    if formula is None or isinstance(formula, bool):
        return not formula
    group = formula if isinstance(formula, tuple) else (formula,)
    if not group:
        return False
    if len(group) == 1 and not _binding(group[0]):
        return opposite(group[0])
    return AnyOf((group,), negated=True)


def _binding(condition: Condition) -> bool:
    """Return whether a condition may determine the value of a variable; its negation then doesn't determine the value."""
    return isinstance(condition, ValueCondition) and not condition.negated and is_variable(condition.value)


@dataclass
class Afterwards:
    """Translation of conditions and amounts after one behaviour to the state before the behaviour.

    Parameters
    ----------
    behavior : Behavior
        The behaviour, whose effects on all members of a class aren't yet expanded to one effect per member.
    situations : mapping of name to SituationType
    classes : mapping of class to individuals
    kinds : dict of term to class
        The classes of all terms in the behaviour and the conditions. The translation adds the classes of new variables.
    holding : sequence of Condition, optional
        The preconditions that hold when the effects take place; by default, all preconditions.
    """

    behavior: Behavior
    situations: Mapping[str, SituationType]
    classes: Mapping[str, Sequence[str]]
    kinds: dict[str, str]
    holding: Sequence[Condition] | None = None
    _number: Iterator[int] = field(default_factory=lambda: count(1))

    def __post_init__(self) -> None:
        """Record the values that the preconditions determine."""
        preconditions = self.behavior.preconditions
        bound = {p.name for p in self.behavior.parameters}
        self._fixed = frozenset(bound | plain_variables(preconditions))
        preconditions = preconditions if self.holding is None else tuple(self.holding)
        self._known = {
            (c.situation, c.arguments): FALSE if c.negated else c.value
            for c in preconditions
            if isinstance(c, ValueCondition) and (not c.negated or (c.value == TRUE and self.boolean(c)))
        }
        self._different = {
            pair
            for c in preconditions
            if isinstance(c, EqualityCondition) and c.negated
            for pair in ((c.left, c.right), (c.right, c.left))
        }

    def fixed(self, term: str) -> bool:
        """Return whether a term is an individual, or a variable that the preconditions bind."""
        return not is_variable(term) or term in self._fixed

    def boolean(self, condition: ValueCondition) -> bool:
        """Return whether a symbol has either the value true or false, because all its individuals have the situation type."""
        kind = self.situations[condition.situation]
        having = zip(condition.arguments, kind.arguments, strict=True)
        return kind.boolean and all(self.among(term, of) is True for term, of in having)

    @cached_property
    def amounts(self) -> tuple[AmountEffect, ...]:
        """The effects on amounts.

        An effect on each member of a class is replaced by one effect per member, unless the member is an argument of the amount.
        """
        found: list[AmountEffect] = []
        for effect in self.behavior.amounts:
            if effect.each is None or effect.each.name in effect.arguments:
                found.append(effect)
            else:
                every = (made_of(effect, one) for one in self.classes.get(effect.each.kind, ()))
                found += [one for one in every if isinstance(one, AmountEffect)]
        return tuple(found)

    def fresh(self, kind: str) -> str:
        """Return a new variable of a class, with an unused name."""
        name = next(name for n in self._number if (name := f"?kept{n}") not in self.kinds)
        self.kinds[name] = kind
        return name

    def renamed(self, condition: Condition) -> Condition:
        """Return a condition in which new variables replace the variables of witnesses."""
        match condition:
            case Witness(variable, kind, inner):
                terms = {variable: self.fresh(kind)}
                within = tuple(self.renamed(substituted(one, terms)) for one in inner)
                return replace(condition, variable=terms[variable], conditions=within)
            case AnyOf(alternatives):
                return replace(condition, alternatives=tuple(tuple(map(self.renamed, group)) for group in alternatives))
            case _:
                return condition

    def apart(self, effect: Effect) -> Effect:
        """Return a copy of an effect with new names for the effect's own variables."""
        given = (effect.value,) if isinstance(effect, ValueEffect) else terms_of(effect.amount)
        own = {*effect.arguments, *given}.union(*map(mentions, effect.when))
        own = {term for term in own if is_variable(term)} - self._fixed - ({effect.each.name} if effect.each else set())
        terms = {term: self.fresh(self.kinds[term]) for term in sorted(own)}
        if effect.each is not None:
            terms[effect.each.name] = self.fresh(effect.each.kind)
            effect = replace(effect, each=Parameter(terms[effect.each.name], effect.each.kind))
        when = tuple(substituted(condition, terms) for condition in effect.when)
        arguments = tuple(terms.get(a, a) for a in effect.arguments)
        if isinstance(effect, ValueEffect):
            return replace(effect, arguments=arguments, value=terms.get(effect.value, effect.value), when=when)
        return replace(effect, arguments=arguments, amount=put_in(effect.amount, terms), when=when)

    # ---------------------------------------------------------------------------------------------------------- leaves

    def members(self, kind: str) -> set[str]:
        """Return the individuals of a class."""
        return {*self.classes.get(kind, ())}

    def among(self, term: str, kind: str) -> Simplified:
        """Return the condition that a term denotes a member of a class."""
        members = self.members(kind)
        if not is_variable(term):
            return term in members
        own = self.members(self.kinds[term])
        if own <= members:
            return True
        return ClassCondition(term, kind) if own & members else False

    def equal(self, one: str, other: str) -> Simplified:
        """Return the condition that two terms denote the same individual."""
        if one == other:
            return True
        possible = [self.members(self.kinds[term]) if is_variable(term) else {term} for term in (one, other)]
        if possible[0].isdisjoint(possible[1]) or (one, other) in self._different:
            return False
        return EqualityCondition(one, other)

    def before(self, condition: Condition) -> Simplified:
        """Return a condition on the state before the behaviour, simplified by means of the preconditions."""
        if isinstance(condition, ValueCondition):
            found = self.value(condition.situation, condition.arguments, condition.value)
            return self._negated(found, condition) if condition.negated else found
        return condition

    def value(self, situation: str, arguments: tuple[str, ...], value: str) -> Simplified:
        """Return the condition that a symbol has a value before the behaviour."""
        known = self._known.get((situation, arguments))
        return ValueCondition(situation, arguments, value) if known is None else self.equal(known, value)

    def old(self, situation: str, arguments: tuple[str, ...], kind: str) -> tuple[str, Conjunction]:
        """Return a term for the value of a symbol before the behaviour, and the conditions that determine the term."""
        known = self._known.get((situation, arguments))
        if known is not None:
            return known, both([self.among(known, kind)])
        term = self.fresh(kind)
        return term, (ValueCondition(situation, arguments, term),)

    def fires(self, effect: Effect, arguments: Sequence[str]) -> Conjunction:
        """Return the conditions under which an effect changes a symbol; variables of the effect must have unique names."""
        if effect.each is not None:
            at = effect.arguments.index(effect.each.name)
            member = self.among(arguments[at], effect.each.kind)
            effect = made_of(effect, arguments[at])
        else:
            member = True
        there = zip(arguments, self.situations[effect.situation].arguments, strict=True)
        equal = [self.equal(own, other) for own, other in zip(effect.arguments, arguments, strict=True)]
        return both([member, *equal, *effect.when, *(self.among(term, kind) for term, kind in there)])

    # ------------------------------------------------------------------------------------------------------ conditions

    def changed(self, condition: Condition) -> bool:
        """Return whether the behaviour changes a situation type in a condition."""
        return any(situations_of(inner) & self.behavior.changes for inner in walk(condition))

    def condition(self, condition: Condition) -> Simplified:
        """Translate a condition on the state after the behaviour to an equivalent condition on the state before the behaviour.

        All variables of the condition must be bound, by other conditions or by its own witnesses.
        """
        if not self.changed(condition):
            return condition
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                found: Simplified = self.value(situation, arguments, value)
                for effect in (e for e in self.behavior.effects if e.situation == situation):
                    found = self._overwritten(effect, arguments, value, found)
            case Comparison(left, sign, right, negated):
                found = either(
                    both([*one, *other, Comparison(first, sign, second)])
                    for one, first in self.cases(left)
                    for other, second in self.cases(right)
                )
            case Witness(variable, kind, inner, negated):
                self.kinds[variable] = kind
                within = both(map(self.condition, inner))
                found = False if within is None else Witness(variable, kind, within)
            case AnyOf(alternatives, negated):
                found = either(both(map(self.condition, group)) for group in alternatives)
            case _:
                return condition
        return self._negated(found, condition) if negated else found

    def _negated(self, found: Simplified, condition: Condition) -> Simplified:
        """Return the negation of the translation of a condition; other conditions bind the variables of a condition on a value."""
        if isinstance(condition, ValueCondition) and found == replace(condition, negated=False):
            return condition
        return negation(found)

    def _overwritten(
        self, effect: ValueEffect, arguments: tuple[str, ...], value: str, before: Simplified
    ) -> Simplified:
        """Return the condition that a symbol has a value after an effect; `before` is this condition without the effect."""
        apart = self.apart(effect)
        assert isinstance(apart, ValueEffect)
        fires = self.fires(apart, arguments)
        if fires is None:
            return before
        given = apart.value
        if apart.each is not None:
            given = {apart.each.name: arguments[apart.arguments.index(apart.each.name)]}.get(given, given)
        return either([both([*fires, self.equal(given, value)]), both([negation(fires), before])])

    # ---------------------------------------------------------------------------------------------------------- amounts

    def linear(
        self, expression: Expression, operation: str = "increase", scaled: Scaled = lambda by: by
    ) -> list[ScaledAmount] | None:
        """Return the changing amounts in a linear expression, if effects only increase or decrease these amounts.

        Parameters
        ----------
        expression : Expression
        operation : str
            The change of the whole expression if `expression`, a part of it, increases: ``increase`` or ``decrease``.
        scaled : callable
            A function that maps a change of this part to the change of the whole expression.

        Returns
        -------
        list of (Amount, str, callable) or None
            For each changing amount: the amount, its `operation` and its `scaled`. None if the expression isn't linear.
        """
        found: list[list[ScaledAmount] | None]
        match expression:
            case Amount(situation, _):
                operations = {effect.operation for effect in self.amounts if effect.situation == situation}
                if operations:
                    return [(expression, operation, scaled)] if operations <= OPPOSITE.keys() else None
                return []
            case Calculation("+" | "-" as sign, left, right):
                second = operation if sign == "+" else OPPOSITE[operation]
                found = [self.linear(left, operation, scaled), self.linear(right, second, scaled)]
            case Calculation(sign, left, right) if not self.moved(right):
                found = [self.linear(left, operation, lambda by: scaled(Calculation(sign, by, right)))]
            case Calculation("*", left, right) if not self.moved(left):
                found = [self.linear(right, operation, lambda by: scaled(Calculation("*", left, by)))]
            case Calculation():
                return None
            case _:
                return []
        return None if None in found else [term for terms in found if terms for term in terms]

    def moved(self, expression: Expression) -> bool:
        """Return whether an effect changes an amount in an expression."""
        return any(effect.situation in situations_in(expression) for effect in self.amounts)

    def cases(self, expression: Expression) -> list[tuple[tuple[Condition, ...], Expression]]:
        """Return the possible values of an expression after the behaviour, each with its conditions before the behaviour."""
        match expression:
            case Amount(situation, arguments):
                found: list[tuple[Conjunction, Expression]] = [((), expression)]
                for effect in (e for e in self.amounts if e.situation == situation):
                    apart = self.apart(effect)
                    assert isinstance(apart, AmountEffect)
                    fires = self.fires(apart, arguments)
                    if fires is None:
                        continue
                    by = apart.amount
                    if apart.each is not None:
                        by = put_in(by, {apart.each.name: arguments[apart.arguments.index(apart.each.name)]})
                    done = [
                        (both([*when, *fires]), after_effect(now, apart.operation, by))
                        for when, now in found
                        if when is not None
                    ]
                    found = [*done, *((both([*when, negation(fires)]), now) for when, now in found if when is not None)]
                    _bounded(found)
                return [(when, now) for when, now in found if when is not None]
            case Calculation(sign, left, right):
                pairs = product(self.cases(left), self.cases(right))
                combined = [(both([*one, *other]), Calculation(sign, a, b)) for (one, a), (other, b) in pairs]
                _bounded(combined)
                return [(when, now) for when, now in combined if when is not None]
            case _:
                return [((), expression)]


def _bounded(cases: Sequence[object]) -> None:
    if len(cases) > MOST_CASES:
        raise TooManyCasesError


def closed(conditions: Iterable[Condition], bound: frozenset[str], kinds: Mapping[str, str]) -> tuple[Condition, ...]:
    """Return conditions with an explicit witness for each variable that occurs only inside a disjunction or another witness.

    >>> (found,) = closed([AnyOf(((ValueCondition("ON", ("?a",), "?b"),),))], frozenset({"?a"}), {"?b": "Shelf"})
    >>> found.alternatives[0][0].variable
    '?b'
    """

    def group(conditions: Sequence[Condition], bound: frozenset[str]) -> tuple[Condition, ...]:
        own = sorted(plain_variables(conditions) - bound)
        found = tuple(one(condition, bound | {*own}) for condition in conditions)
        for variable in own:
            found = (Witness(variable, kinds[variable], found),)
        return found

    def one(condition: Condition, bound: frozenset[str]) -> Condition:
        match condition:
            case AnyOf(alternatives):
                return replace(condition, alternatives=tuple(group(inner, bound) for inner in alternatives))
            case Witness(variable, _, inner):
                return replace(condition, conditions=group(inner, bound | {variable}))
            case _:
                return condition

    return tuple(one(condition, bound) for condition in conditions)
