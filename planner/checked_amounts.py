"""Calculation of amounts by the checker; this module shares no code with any search."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from confab.reasoner.amounts import COMPARING, Amount, Calculation, Expression, Measure, Quantity, written
from confab.reasoner.symbols import Comparison

Arguments: TypeAlias = "tuple[str, ...]"
Cell: TypeAlias = "tuple[str, Arguments]"
ValueOf: TypeAlias = "Callable[[str, Arguments], str | None]"
"""Function that returns the value of a symbol, or None if the symbol doesn't exist."""
Values: TypeAlias = "list[str]"
RowSelector: TypeAlias = "Callable[[Sequence[str]], Callable[[Values], Arguments]]"
"""Function that returns a selector: the selector picks the values of some terms from the values of all terms."""
Worth: TypeAlias = "Callable[[ValueOf, Values], Fraction | None]"
"""Function that returns the value of an amount, or None if the amount has no value."""
Relations: TypeAlias = "Mapping[str, frozenset[Arguments]]"


def worth(expression: Expression, key: RowSelector, relations: Relations) -> Worth:
    """Return a function that calculates an arithmetic expression."""
    match expression:
        case Amount(situation, arguments):
            of = key(arguments)

            def has(said: ValueOf, values: Values) -> Fraction | None:
                text = said(situation, of(values))
                return None if text is None else Fraction(text)

            return has
        case Measure(relation, arguments):
            about = key(arguments)
            numbers = {row[:-1]: Fraction(row[-1]) for row in relations.get(relation, ())}
            return lambda said, values: numbers.get(about(values))
        case Calculation(sign, one, other):
            of_left, of_right = worth(one, key, relations), worth(other, key, relations)

            def result(said: ValueOf, values: Values) -> Fraction | None:
                left, right = of_left(said, values), of_right(said, values)
                if left is None or right is None or (sign == "/" and not right):
                    return None
                if sign == "/":
                    return left / right
                return {"+": left + right, "-": left - right, "*": left * right}[sign]

            return result
        case number:
            return lambda said, values: number


def compares(condition: Comparison, key: RowSelector, relations: Relations) -> Callable[[ValueOf, Values], bool]:
    """Return a comparison as a test; the test is false if a value is missing."""
    of_left, of_right = worth(condition.left, key, relations), worth(condition.right, key, relations)
    holds = COMPARING[condition.operator]

    def test(said: ValueOf, values: Values) -> bool:
        left, right = of_left(said, values), of_right(said, values)
        return (left is not None and right is not None and holds(left, right)) is not condition.negated

    return test


def changed(
    effects: Iterable[tuple[Cell, str, Fraction | None]], said: ValueOf, quantities: Mapping[str, Quantity | None]
) -> list[tuple[str, Arguments, str]] | None:
    """Return the amounts after effects, each calculated from the state before, or None if an amount is invalid.

    An effect is a symbol, an operation and a number; an effect on a symbol that doesn't exist is ignored.
    """
    after: dict[Cell, Fraction | None] = {}
    for cell, operation, by in effects:
        text = said(*cell)
        if text is None:
            continue
        old = after.get(cell, Fraction(text))
        if by is None or old is None:
            after[cell] = None
        else:
            new = {"assign": by, "scale": old * by, "increase": old + by, "decrease": old - by}
            after[cell] = new[operation]
    found = []
    for cell, result in after.items():
        quantity = quantities[cell[0]]
        if result is None or quantity is None or not quantity.allows(result):
            return None
        found.append((*cell, written(result)))
    return found
