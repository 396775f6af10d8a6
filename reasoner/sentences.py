"""Conditions and amounts as sentences, in names or in whatever words a caller has for facts and names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from reasoner.amounts import Amount, Calculation, Expression, Measure, written
from reasoner.symbols import (
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Fact,
    RelationCondition,
    Symbol,
    ValueCondition,
    Witness,
    substituted,
)

Words = Callable[[Fact | str], str]
"""How a fact, or the name of an individual, a class or a relation, is written."""


def said(condition: Condition, words: Words = str) -> str:
    """Return a condition as people write it, with their own words for facts and names if they give them.

    >>> said(RelationCondition("canReach", ("left_hand", "location7")))
    'left_hand canReach location7'
    >>> said(Witness("?o", "Cup", (ValueCondition("LOCATION", ("?o",), "location7"),), negated=True))
    'there is no Cup ?o with ?o LOCATION location7'
    """

    def all_(conditions: Sequence[Condition]) -> str:
        return " and ".join(said(inner, words) for inner in conditions)

    match condition:
        case ValueCondition(situation, arguments, value, negated):
            return ("not " if negated else "") + words(Fact(Symbol(situation, arguments), value))
        case RelationCondition(relation, arguments, negated):
            return ("not " if negated else "") + " ".join(map(words, (arguments[0], relation, *arguments[1:])))
        case ClassCondition(term, kind, negated):
            return f"{words(term)} is {'no' if negated else 'a'} {words(kind)}"
        case EqualityCondition(left, right, negated):
            return f"{words(left)} is {'not ' if negated else ''}{words(right)}"
        case Witness(variable, kind, (*others, last), True) if variable.startswith("?each"):
            of = f" with {all_(others)}" if others else ""
            one = substituted(replace(last, negated=not last.negated), {variable: f"the {words(kind)}"})
            return f"of each {words(kind)}{of}: {said(one, words)}"
        case Witness(variable, kind, conditions, negated):
            return f"there is {'no' if negated else 'a'} {words(kind)} {words(variable)} with {all_(conditions)}"
        case AnyOf(alternatives, negated):
            return ("not " if negated else "") + f"({' or '.join(map(all_, alternatives))})"
        case Comparison(left, sign, right, negated):
            return ("not " if negated else "") + f"{counted(left, words)} {sign} {counted(right, words)}"


def counted(expression: Expression, words: Words = str) -> str:
    """Return an amount as people write it.

    >>> from fractions import Fraction
    >>> counted(Calculation("-", Amount("SERVINGS", ("bottle1",)), Fraction(1, 2)))
    '(bottle1 SERVINGS - 0.5)'
    """
    match expression:
        case Amount(situation, arguments):
            return words(Fact(Symbol(situation, arguments), "")).strip()
        case Measure(relation, arguments):
            return " ".join(map(words, (*arguments[:1], relation, *arguments[1:])))
        case Calculation(sign, left, right):
            return f"({counted(left, words)} {sign} {counted(right, words)})"
        case number:
            return written(number)
