"""Amounts, which are exact numbers as values of symbols, and arithmetic expressions.

A state stores an amount as text, like any other value. Each number has one canonical text: ``3``, ``1.5``, and ``1/3`` for a
number without a finite decimal notation. The goal value of an amount may be bounds such as ``>=2`` or ``>=2,<5``.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from math import ceil, floor, inf
from typing import TypeAlias

Number: TypeAlias = "Fraction | float"
"""A fraction, or `NOTHING`, which is the only allowed float."""
NOTHING = float("nan")
"""Value NaN, which stands for a missing amount: calculations with NaN result in NaN, and comparisons with NaN are false."""


LARGEST = 10**60
"""Maximum numerator and denominator of an amount, so that repeated multiplication can't exhaust the memory."""


def simplified(amount: int | Fraction) -> int | Fraction:
    """Return an amount as an integer if the amount is a whole number."""
    return amount.numerator if amount.denominator == 1 else amount


@dataclass(frozen=True)
class Quantity:
    """Properties of the amounts of a situation type: the unit, whether the amounts are whole numbers, and the bounds."""

    unit: str = ""
    whole: bool = False
    least: Fraction | None = None
    most: Fraction | None = None

    @property
    def bounded(self) -> bool:
        """Whether the amounts have a lower or an upper bound."""
        return self.least is not None or self.most is not None

    @cached_property
    def _bounds(self) -> tuple[Number, Number]:
        """The bounds of the amounts; whole bounds are integers, because integers are compared much faster than fractions."""
        least = -inf if self.least is None else simplified(self.least)
        return least, inf if self.most is None else simplified(self.most)

    def including(self, amount: Fraction) -> Quantity:
        """Return the quantity with bounds that include an amount: an initial amount beyond a bound stays until it is changed."""
        least = None if self.least is None else min(self.least, amount)
        return replace(self, least=least, most=None if self.most is None else max(self.most, amount))

    def allows(self, amount: Number) -> bool:
        """Return whether an amount is a number within the bounds, and a whole number if this is required."""
        if isinstance(amount, float):  # `NOTHING`
            return False
        least, most = self._bounds
        return (
            least <= amount <= most
            and amount.denominator <= (1 if self.whole else LARGEST)
            and abs(amount.numerator) <= LARGEST
        )


@dataclass(frozen=True)
class Amount:
    """The current amount of a symbol."""

    situation: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Measure:
    """The number that a static relation, such as a distance, assigns to some individuals; it is the last element of a row."""

    relation: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Calculation:
    """An arithmetic operation on two expressions: ``+``, ``-``, ``*`` or ``/``."""

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
"""The two directions in which an amount may have to change to satisfy its goal."""
OPERATIONS = ("assign", "scale", "increase", "decrease")
"""Operations of effects on amounts. If several effects of a behaviour change one symbol, their operations are applied in this
order."""


def inside(expression: Expression) -> Iterator[Expression]:
    """Yield an expression and all its subexpressions."""
    yield expression
    if isinstance(expression, Calculation):
        yield from inside(expression.left)
        yield from inside(expression.right)


def terms_of(expression: Expression) -> tuple[str, ...]:
    """Return the terms of all amounts and measures in an expression."""
    return tuple(t for part in inside(expression) if isinstance(part, Amount | Measure) for t in part.arguments)


def amounts_of(expression: Expression) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the amounts that an expression reads: their situation types with their terms."""
    return tuple((part.situation, part.arguments) for part in inside(expression) if isinstance(part, Amount))


def situations_in(expression: Expression) -> frozenset[str]:
    """Return the situation types of the amounts that an expression reads."""
    return frozenset(situation for situation, _ in amounts_of(expression))


def put_in(expression: Expression, terms: Mapping[str, str]) -> Expression:
    """Return an expression in which `terms` maps terms to their replacements."""
    if isinstance(expression, Calculation):
        left, right = put_in(expression.left, terms), put_in(expression.right, terms)
        return Calculation(expression.operator, left, right)
    if isinstance(expression, Amount | Measure):
        return replace(expression, arguments=tuple(terms.get(a, a) for a in expression.arguments))
    return expression


def with_amounts(expression: Expression, values: Mapping[Amount, Expression]) -> Expression:
    """Return an expression in which `values` maps amounts to their replacements."""
    if isinstance(expression, Calculation):
        left, right = with_amounts(expression.left, values), with_amounts(expression.right, values)
        return Calculation(expression.operator, left, right)
    return values.get(expression, expression) if isinstance(expression, Amount) else expression


def after_effect(now: Expression, operation: str, by: Expression) -> Expression:
    """Return the expression for an amount after an effect, given the expression before the effect."""
    sign = {"scale": "*", "increase": "+", "decrease": "-"}.get(operation)
    return by if sign is None else Calculation(sign, now, by)


@lru_cache(maxsize=2**16)
def number(text: str | None) -> Number:
    """Return the number that a text denotes, or `NOTHING` for None."""
    return NOTHING if text is None else Fraction(text)


@lru_cache(maxsize=2**16)
def written(amount: Fraction) -> str:
    """Return the canonical text of a number.

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
    """Return the exact value of a number in decimal notation, or None for a text that isn't a number.

    >>> exact("1.50"), exact("many")
    (Fraction(3, 2), None)
    """
    return Fraction(text) if DECIMAL.fullmatch(text) else None


def divided(left: Number, right: Number) -> Number:
    """Return a quotient, or `NOTHING` for a division by zero."""
    return left / right if right else NOTHING


def done(operation: str, amount: Number, by: Number) -> Number:
    """Return an amount after an effect; the result is `NOTHING` if the amount was `NOTHING`."""
    match operation:
        case "assign":
            return by if isinstance(amount, Fraction) else NOTHING
        case "scale":
            return amount * by
        case "increase":
            return amount + by
        case _:
            return amount - by


# ------------------------------------------------------------------------------------------------------ goals and bounds


@lru_cache(maxsize=2**12)
def bounds(wanted: str) -> tuple[tuple[str, Fraction], ...]:
    """Return the bounds in the goal value of an amount, as pairs of an operator and a number.

    >>> bounds(">=2,<5"), bounds("3")
    ((('>=', Fraction(2, 1)), ('<', Fraction(5, 1))), (('=', Fraction(3, 1)),))

    Raises
    ------
    ValueError
        The text contains neither a number nor bounds.
    """
    found = []
    for part in wanted.split(","):
        text = part.strip()
        sign = next((s for s in ("<=", ">=", "<", ">", "=") if text.startswith(s)), "")
        found.append((sign or "=", Fraction(text[len(sign) :])))
    return tuple(found)


def bounds_written(wanted: str) -> str:
    """Return the canonical text of the goal value of an amount: a number, or bounds.

    >>> bounds_written("=2.0"), bounds_written("<5, >=2"), bounds_written("=2,<5")
    ('2', '<5,>=2', '<5,<=2,>=2')
    """
    found = set(bounds(wanted))
    if len(found) == 1:
        return "".join(written(limit) if sign == "=" else f"{sign}{written(limit)}" for sign, limit in found)
    both = {(one, limit) for sign, limit in found for one in (("<=", ">=") if sign == "=" else (sign,))}
    return ",".join(f"{sign}{written(limit)}" for sign, limit in sorted(both))


def possible_bounds(wanted: str, quantity: Quantity) -> str:
    """Return a goal value as amounts of a quantity can meet it, or an empty text if no amount within the bounds meets it.

    >>> possible_bounds("<=5/2", Quantity(whole=True)), possible_bounds("<=-1/3", Quantity(least=Fraction(0)))
    ('<=2', '')
    """
    limits = bounds(wanted)
    if quantity.whole:
        nearest = {"<": lambda x: ceil(x) - 1, "<=": floor, "=": Fraction, ">=": ceil, ">": lambda x: floor(x) + 1}
        limits = tuple((sign if "=" in sign else f"{sign}=", Fraction(nearest[sign](limit))) for sign, limit in limits)
    within = (
        *limits,
        *((">=", x) for x in [quantity.least] if x is not None),
        *(("<=", x) for x in [quantity.most] if x is not None),
    )
    low = max(((limit, sign == ">") for sign, limit in within if "<" not in sign), default=(-inf, False))
    high = min(((limit, sign != "<") for sign, limit in within if ">" not in sign), default=(inf, True))
    possible = low[0] < high[0] or (low[0] == high[0] and not low[1] and high[1])
    whole = not quantity.whole or all(limit.denominator == 1 for _, limit in limits)
    return bounds_written(",".join(f"{sign}{limit}" for sign, limit in limits)) if possible and whole else ""


def meets(value: str | None, wanted: str) -> bool:
    """Return whether a value equals the goal value, or is an amount within the bounds of the goal value.

    >>> meets("shelf", "shelf"), meets("1.5", ">=2"), meets("2", ">=2,<5")
    (True, False, True)
    """
    if value == wanted:
        return True
    if wanted[:1] not in ("<", ">") or value is None:
        return False
    return all(COMPARING[sign](number(value), limit) for sign, limit in bounds(wanted))


def towards(amount: str | None, wanted: str) -> str:
    """Return `MORE` or `LESS` if an amount has to change to satisfy its goal; otherwise return the goal value.

    >>> towards("1.5", ">=2"), towards("3", "2"), towards("2", "2")
    ('more', 'less', '2')
    """
    now = number(amount)
    for sign, limit in bounds(wanted):
        if not COMPARING[sign](now, limit):
            return LESS if sign[0] == "<" or (sign == "=" and now > limit) else MORE
    return wanted


def nearer(before: str | None, after: Number, wanted: str) -> bool:
    """Return whether a change brings an amount closer to the bounds of its goal, or within these bounds."""
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
            total += amount - limit if amount > limit else limit - amount
    return total
