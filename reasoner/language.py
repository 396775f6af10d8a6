"""Traversal of conditions: terms, variables, nested conditions.

Code for a new kind of condition belongs into this module and into the checker.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet

from confab.reasoner.amounts import Measure, amounts_of, inside, put_in, terms_of
from confab.reasoner.symbols import (
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    ValueCondition,
    Witness,
)


class DomainError(ValueError):
    """Raised if a behaviour can't be executed as defined; the message names the behaviour and the faulty term."""


def is_variable(term: str) -> bool:
    """Return whether a term is a parameter or variable and not an individual."""
    return term.startswith("?")


def groups(condition: Condition) -> tuple[tuple[Condition, ...], ...]:
    """Return the conjunctions inside a condition."""
    match condition:
        case Witness(_, _, inner):
            return (inner,)
        case AnyOf(alternatives):
            return alternatives
        case ValueCondition() | RelationCondition() | ClassCondition() | EqualityCondition() | Comparison():
            return ()


def walk(condition: Condition) -> Iterator[Condition]:
    """Yield a condition and all conditions inside it."""
    yield condition
    for group in groups(condition):
        for inner in group:
            yield from walk(inner)


def terms(condition: Condition) -> tuple[str, ...]:
    """Return the terms of a condition, without the terms of nested conditions."""
    match condition:
        case ValueCondition(_, arguments, value):
            return (*arguments, value)
        case RelationCondition(_, arguments):
            return arguments
        case ClassCondition(term):
            return (term,)
        case EqualityCondition(left, right):
            return (left, right)
        case Comparison(one, _, other):
            return (*terms_of(one), *terms_of(other))
        case Witness() | AnyOf():
            return ()


def symbols_of(condition: Condition) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the situation types that a condition reads, each with its terms, without those of nested conditions."""
    match condition:
        case ValueCondition(situation, arguments):
            return ((situation, arguments),)
        case Comparison(one, _, other):
            return (*amounts_of(one), *amounts_of(other))
        case RelationCondition() | ClassCondition() | EqualityCondition() | Witness() | AnyOf():
            return ()


def situations_of(condition: Condition) -> frozenset[str]:
    """Return the situation types of a condition, without the situation types of nested conditions."""
    return frozenset(situation for situation, _ in symbols_of(condition))


def substituted(condition: Condition, terms: Mapping[str, str]) -> Condition:
    """Return a condition in which `terms` maps terms to their replacements."""

    def put(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(terms.get(name, name) for name in names)

    match condition:
        case ValueCondition(situation, arguments, value, negated):
            return ValueCondition(situation, put(arguments), terms.get(value, value), negated)
        case RelationCondition(relation, arguments, negated):
            return RelationCondition(relation, put(arguments), negated)
        case ClassCondition(term, kind, negated):
            return ClassCondition(terms.get(term, term), kind, negated)
        case EqualityCondition(left, right, negated):
            return EqualityCondition(terms.get(left, left), terms.get(right, right), negated)
        case Witness(variable, kind, conditions, negated, comparison):
            own = f"{variable}_inside" if variable in terms.values() else variable  # avoids variable capture
            inner = {**terms, variable: own}
            if comparison is not None:
                sides = put_in(comparison.left, terms), put_in(comparison.right, terms)
                comparison = Comparison(sides[0], comparison.operator, sides[1])
            return Witness(own, kind, tuple(substituted(c, inner) for c in conditions), negated, comparison)
        case AnyOf(alternatives, negated, constraint):
            groups = tuple(tuple(substituted(c, terms) for c in group) for group in alternatives)
            return AnyOf(groups, negated, constraint)
        case Comparison(one, sign, other, negated):
            return Comparison(put_in(one, terms), sign, put_in(other, terms), negated)


def measured(behavior: Behavior) -> Iterator[Measure]:
    """Yield the numbers of static relations, such as distances, that a behaviour reads in its effects and conditions."""
    amounts = [effect.amount for effect in behavior.amounts]
    for condition in behavior.conditions:
        amounts += [side for c in walk(condition) if isinstance(c, Comparison) for side in (c.left, c.right)]
    yield from (part for amount in amounts for part in inside(amount) if isinstance(part, Measure))


def measures(behaviors: Iterable[Behavior]) -> frozenset[str]:
    """Return the relations whose numbers behaviours read."""
    return frozenset(one.relation for behavior in behaviors for one in measured(behavior))


def mentions(condition: Condition) -> set[str]:
    """Return all variables of a condition except those that nested witnesses bind.

    >>> sorted(mentions(Witness("?o", "Cup", (ValueCondition("LOCATION", ("?o",), "?l"),))))
    ['?l']
    """
    found = set(filter(is_variable, terms(condition)))
    inner = found.union(*(mentions(c) for group in groups(condition) for c in group))
    return inner - {condition.variable} if isinstance(condition, Witness) else inner


def plain_variables(conditions: Iterable[Condition]) -> set[str]:
    """Return the variables of a conjunction, except variables that only witnesses and disjunctions inside of it mention."""
    return {term for condition in conditions if not groups(condition) for term in mentions(condition)}


def needs(condition: Condition) -> set[str]:
    """Return the variables that must be bound before a condition can be evaluated; the condition binds its other variables.

    >>> needs(ValueCondition("LOCATION", ("cup1",), "?l")), needs(ValueCondition("LOCATION", ("cup1",), "?l", True))
    (set(), {'?l'})
    """
    if isinstance(condition, ValueCondition) and not condition.negated:
        return set(filter(is_variable, condition.arguments))
    if not isinstance(condition, Witness | AnyOf):
        return mentions(condition)
    own = {condition.variable} if isinstance(condition, Witness) else set()
    return {term for group in groups(condition) for term in _unbound(group)} - own


def _unbound(group: Sequence[Condition]) -> set[str]:
    """Return the variables that must be bound before a conjunction can be evaluated."""
    determined = {c.value for c in group if isinstance(c, ValueCondition) and not c.negated}
    return {term for c in group for term in needs(c)} - determined


def nothing_determines(where: str, waiting: Sequence[Condition], bound: AbstractSet[str]) -> DomainError:
    """Return the error for a behaviour in which no condition determines the value of some variables."""
    unbound = ", ".join(sorted({term for condition in waiting for term in needs(condition)} - bound))
    return DomainError(f"{where}: nothing determines {unbound}; add a value condition that does")
