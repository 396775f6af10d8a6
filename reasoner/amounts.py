"""Amounts: values that are numbers, exact whatever is worked out, and what is worked out from them.

A state keeps an amount as text like any other value, each number in one way only: ``3``, ``1.5``, and ``1/3`` where decimals
have no end. What is wanted of an amount may be bounds, written ``>=2`` or ``>=2,<5``.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import TypeAlias

Number: TypeAlias = "Fraction | float"
"""A fraction, or `NOTHING`; no other binary number ever."""
NOTHING = float("nan")
"""What has no amount: all that is worked out from it is nothing, and it compares with nothing."""


LARGEST = 10**60
"""No amount gets larger than this, nor its denominator: else doubling again and again would fill the memory."""


@dataclass(frozen=True)
class Quantity:
    """What the amounts of a situation type are: of which unit, whether whole numbers only, and between which bounds."""

    unit: str = ""
    whole: bool = False
    least: Fraction | None = None
    most: Fraction | None = None

    def allows(self, amount: Number) -> bool:
        """Whether an amount is one of these."""
        return (
            isinstance(amount, Fraction)  # and not `NOTHING`
            and (self.least is None or amount >= self.least)
            and (self.most is None or amount <= self.most)
            and (not self.whole or amount.denominator == 1)
            and abs(amount.numerator) <= LARGEST
            and amount.denominator <= LARGEST
        )


@dataclass(frozen=True)
class Amount:
    """The amount that a symbol has now."""

    situation: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Measure:
    """The number that a static relation gives for individuals, the last of its tuple: a capacity, a distance."""

    relation: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Calculation:
    """Two amounts added (``+``), subtracted (``-``), multiplied (``*``) or divided (``/``)."""

    operator: str
    left: Expression
    right: Expression


Expression: TypeAlias = "Fraction | Amount | Measure | Calculation"

COMPARING: Mapping[str, Callable[[Number, Number], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    "=": operator.eq,
    ">=": operator.ge,
    ">": operator.gt,
}
MORE, LESS = "more", "less"
"""What an amount must become to be as wanted."""
OPERATIONS = ("assign", "scale", "increase", "decrease")
"""What an effect does to an amount, in the order in which effects of one behaviour on one symbol are made."""


def inside(expression: Expression) -> Iterator[Expression]:
    """Yield an expression and all inside it."""
    yield expression
    if isinstance(expression, Calculation):
        yield from inside(expression.left)
        yield from inside(expression.right)


def terms_of(expression: Expression) -> tuple[str, ...]:
    """Return the terms of all symbols and relations in an expression."""
    return tuple(t for part in inside(expression) if isinstance(part, Amount | Measure) for t in part.arguments)


def situations_in(expression: Expression) -> frozenset[str]:
    """Return the situation types of all symbols in an expression."""
    return frozenset(part.situation for part in inside(expression) if isinstance(part, Amount))


def put_in(expression: Expression, terms: Mapping[str, str]) -> Expression:
    """Return an expression with other terms put in for some."""
    if isinstance(expression, Calculation):
        left, right = put_in(expression.left, terms), put_in(expression.right, terms)
        return Calculation(expression.operator, left, right)
    if isinstance(expression, Amount | Measure):
        return replace(expression, arguments=tuple(terms.get(a, a) for a in expression.arguments))
    return expression


@lru_cache(maxsize=2**16)
def number(text: str | None) -> Number:
    """Return the number that a text says; no text says nothing."""
    return NOTHING if text is None else Fraction(text)


@lru_cache(maxsize=2**16)
def written(amount: Fraction) -> str:
    """Return the one text of a number.

    >>> written(Fraction(3)), written(Fraction(-3, 2)), written(Fraction(1, 3))
    ('3', '-1.5', '1/3')
    """
    rest, places = amount.denominator, 0
    for prime in (2, 5):
        times = 0
        while rest % prime == 0:
            rest, times = rest // prime, times + 1
        places = max(places, times)
    if rest != 1 or not places:
        return str(amount)
    digits = str(abs(amount.numerator) * 10**places // amount.denominator).rjust(places + 1, "0")
    return f"{'-' * (amount < 0)}{digits[:-places]}.{digits[-places:]}"


DECIMAL = re.compile(r"[+-]?(\d{1,30}(\.\d{0,30})?|\.\d{1,30})([eE][+-]?\d{1,2})?")


def exact(text: str) -> Fraction | None:
    """Return the number that somebody wrote, exact; None if it is none.

    >>> exact("1.50"), exact("many")
    (Fraction(3, 2), None)
    """
    return Fraction(text) if DECIMAL.fullmatch(text) else None


def divided(left: Number, right: Number) -> Number:
    """Return a quotient: nothing where it is divided by zero."""
    return left / right if right else NOTHING


def done(operation: str, amount: Number, by: Number) -> Number:
    """Return what an effect makes of an amount; of none, none."""
    match operation:
        case "assign":
            return by if isinstance(amount, Fraction) else NOTHING
        case "scale":
            return amount * by
        case "increase":
            return amount + by
        case _:
            return amount - by


# ------------------------------------------------------------------------------------------------------ what is wanted


@lru_cache(maxsize=2**12)
def bounds(wanted: str) -> tuple[tuple[str, Fraction], ...]:
    """Return what is wanted of an amount, as operators with numbers.

    >>> bounds(">=2,<5"), bounds("3")
    ((('>=', Fraction(2, 1)), ('<', Fraction(5, 1))), (('=', Fraction(3, 1)),))

    Raises
    ------
    ValueError
        It is neither a number nor bounds.
    """
    found = []
    for part in wanted.split(","):
        text = part.strip()
        sign = next((s for s in ("<=", ">=", "<", ">", "=") if text.startswith(s)), "")
        found.append((sign or "=", Fraction(text[len(sign) :])))
    return tuple(found)


def bounds_written(wanted: str) -> str:
    """Return the one text of what is wanted of an amount: a number, or bounds.

    >>> bounds_written("=2.0"), bounds_written("<5, >=2"), bounds_written("=2,<5")
    ('2', '<5,>=2', '<5,<=2,>=2')
    """
    found = set(bounds(wanted))
    if len(found) == 1:
        return "".join(written(limit) if sign == "=" else f"{sign}{written(limit)}" for sign, limit in found)
    both = {(one, limit) for sign, limit in found for one in (("<=", ">=") if sign == "=" else (sign,))}
    return ",".join(f"{sign}{written(limit)}" for sign, limit in sorted(both))


def meets(value: str | None, wanted: str) -> bool:
    """Whether a value is the one that is wanted, or an amount within the bounds that are.

    >>> meets("shelf", "shelf"), meets("1.5", ">=2"), meets("2", ">=2,<5")
    (True, False, True)
    """
    if value == wanted:
        return True
    if wanted[:1] not in ("<", ">") or value is None:
        return False
    return all(COMPARING[sign](number(value), limit) for sign, limit in bounds(wanted))


def towards(amount: str | None, wanted: str) -> str:
    """Return whether an amount must become more or less to be as wanted; what it is, if it is as wanted.

    >>> towards("1.5", ">=2"), towards("3", "2"), towards("2", "2")
    ('more', 'less', '2')
    """
    now = number(amount)
    for sign, limit in bounds(wanted):
        if not COMPARING[sign](now, limit):
            return LESS if sign[0] == "<" or (sign == "=" and now > limit) else MORE
    return wanted


def nearer(before: str | None, after: Number, wanted: str) -> bool:
    """Whether an amount comes nearer to what is wanted of it, or gets there."""
    if before is None or not isinstance(after, Fraction):
        return False
    limits, old = bounds(wanted), number(before)
    if all(COMPARING[sign](after, limit) for sign, limit in limits):
        return True
    return _off(limits, after) < _off(limits, old)


def _off(limits: tuple[tuple[str, Fraction], ...], amount: Number) -> Number:
    total: Number = Fraction(0)
    for sign, limit in limits:
        if not COMPARING[sign](amount, limit):
            total += max(amount - limit, limit - amount)
    return total
