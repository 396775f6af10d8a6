"""Amounts in generated Python: comparisons, changes by behaviours, and tests of progress towards a goal.

A table stores amounts as text; generated code converts the text to numbers and calls the functions of this module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TypeAlias

from confab.planner.generated import identifier, key_written, tuple_written, written
from confab.reasoner.amounts import (
    NOTHING,
    Amount,
    Calculation,
    Expression,
    Measure,
    Number,
    Quantity,
    divided,
    done,
    nearer,
    number,
)
from confab.reasoner.amounts import written as amount_written
from confab.reasoner.symbols import AmountEffect, Comparison

Rows: TypeAlias = "frozenset[tuple[str, ...]]"
Constant: TypeAlias = "Callable[[tuple[str, str], object], str]"
"""Function that makes a value available to generated code and returns the value's name there."""


def amount(expression: Expression, relations: Mapping[str, Rows], constant: Constant) -> str:
    """Return an arithmetic expression as a Python expression; an amount without a value is `NOTHING`."""
    match expression:
        case Amount(situation, arguments):
            return _now(situation, key_written(arguments), constant)
        case Measure(relation, arguments):
            table = constant(("measure", relation), _measured(relations.get(relation, frozenset())))
            return f"{table}.get({tuple_written(map(written, arguments))}, {constant(('no', 'amount'), NOTHING)})"
        case Calculation(sign, one, other):
            left, right = amount(one, relations, constant), amount(other, relations, constant)
            if sign == "/":
                return f"{constant(('amounts', 'divided'), divided)}({left}, {right})"
            return f"({left} {sign} {right})"
        case exact:
            return constant(("number", amount_written(exact)), exact)


def comparison(condition: Comparison, relations: Mapping[str, Rows], constant: Constant) -> str:
    """Return a comparison as a Python expression."""
    left, right = amount(condition.left, relations, constant), amount(condition.right, relations, constant)
    test = f"({left} {'==' if condition.operator == '=' else condition.operator} {right})"
    return f"not {test}" if condition.negated else test


def change(effect: AmountEffect, relations: Mapping[str, Rows], constant: Constant) -> str:
    """Return the Python call that changes the amount of an existing symbol in `amounts`."""
    key, by = key_written(effect.arguments), amount(effect.amount, relations, constant)
    old = f"{identifier('now', effect.situation)}[{key}]"
    function = constant(("amounts", "changed"), changed)
    return f"{function}(amounts, {effect.situation!r}, {key}, {old}, {effect.operation!r}, {by})"


def approaches_goal(effect: AmountEffect, wanted: str, relations: Mapping[str, Rows], constant: Constant) -> str:
    """Return a Python test of whether an effect brings its amount nearer to the goal in the variable `wanted`."""
    key, by = key_written(effect.arguments), amount(effect.amount, relations, constant)
    after = (
        f"{constant(('amounts', 'done'), done)}({effect.operation!r}, {_now(effect.situation, key, constant)}, {by})"
    )
    old = f"{identifier('now', effect.situation)}.get({key})"
    return f"{constant(('amounts', 'nearer'), nearer)}({old}, {after}, {wanted})"


def _now(situation: str, key: str, constant: Constant) -> str:
    return f"{constant(('amounts', 'number'), number)}({identifier('now', situation)}.get({key}))"


@lru_cache(maxsize=64)
def _measured(rows: Rows) -> Mapping[tuple[str, ...], Number]:
    """Return the number in the last place of each tuple of a relation, by the other arguments of the tuple."""
    return {row[:-1]: number(row[-1]) for row in rows}


# ------------------------------------------------------------------------------------ functions called by generated code


def changed(
    amounts: dict[tuple[str, object], Number], situation: str, key: object, old: str, operation: str, by: Number
) -> None:
    """Change an amount that earlier effects of the same behaviour may have changed already."""
    cell = situation, key
    amounts[cell] = done(operation, amounts[cell] if cell in amounts else number(old), by)


def settled(
    amounts: Mapping[tuple[str, object], Number],
    quantities: Mapping[str, Quantity],
    changes: list[tuple[str, object, str]],
) -> bool:
    """Add new amounts to the changes; return whether all amounts are valid."""
    for (situation, key), found in amounts.items():
        if not quantities[situation].allows(found):
            return False
        changes.append((situation, key, amount_written(found)))
    return True
