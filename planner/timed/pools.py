"""Pools: amounts that steps only increase and decrease, so that the steps may overlap while the amount suffices.

Each step that decreases an amount takes units of it, and each step that increases the amount gives units. A step that requires an
amount without taking it takes units and gives them back at once. If every unit that is taken was in stock at first or was given
before, the amount suffices at all times. The units are taken in the order in which they are given (Policella, Cesta, Oddi and
Smith, "From precedence constraint posting to partial order schedules", AI Communications 20, 2007). Upper bounds of amounts are
treated alike: an increase takes room, and a decrease gives room.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import ceil, floor, gcd, lcm
from typing import TypeAlias

from confab.planner.validation import Cell
from confab.reasoner.amounts import Amount, Quantity, situations_in
from confab.reasoner.language import walk
from confab.reasoner.symbols import Behavior, Comparison

Limit: TypeAlias = "tuple[Fraction, bool]"
"""A least or greatest amount, and whether the amount itself is excluded."""
MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


@dataclass(frozen=True)
class AmountUse:
    """The change of an amount at one moment, which doesn't depend on the state, and the limits of the amount before the change."""

    change: Fraction
    least: tuple[Limit, ...] = ()
    most: tuple[Limit, ...] = ()


@dataclass(frozen=True)
class PoolSide:
    """The units between an amount and its lower bound, or its upper bound: the first stock, and what each event takes and gives."""

    stock: int
    takes: tuple[int, ...]
    gives: tuple[int, ...]

    def pairs(self, line: Sequence[int]) -> Iterator[tuple[int, int]]:
        """Yield pairs of events for an order of all events: the second event takes a unit that the first event gives."""
        given = list(accumulate((self.gives[one] for one in line), initial=self.stock))
        first, taken = 0, 0
        for one in line:
            before, taken = taken, taken + self.takes[one]
            while first < len(line) and given[first] <= before:
                first += 1
            for last in range(first, len(line) + 1) if taken > before else ():
                if last and given[last] > given[last - 1]:
                    yield line[last - 1], one
                if given[last] >= taken:
                    break


@dataclass(frozen=True)
class AmountPool:
    """An amount with lower and upper limits: the change of each event, in units of the pool, and the sides of the amount."""

    changes: tuple[int, ...]
    lower: PoolSide | None
    upper: PoolSide | None

    def pairs(self, line: Sequence[int]) -> Iterator[tuple[int, int]]:
        """Yield pairs of events for an order of all events: the first event must precede the second one."""
        for side in (self.lower, self.upper):
            yield from () if side is None else side.pairs(line)


def counts_of(
    piece: Behavior, terms: Sequence[str], changes: Mapping[Cell, tuple[str, str]], changing: frozenset[str]
) -> dict[Cell, AmountUse]:
    """Return the counts of the amounts that a piece of a step changes or compares with fixed numbers, and uses in no other way.

    `changes` has the values before and after; `changing` has the situation types that some behaviour changes.
    """
    given = dict(zip((p.name for p in piece.parameters), terms, strict=True))
    unfit, limits = set[str](), defaultdict[Cell, tuple[list[Limit], list[Limit]]](lambda: ([], []))
    for effect in piece.every_effect:
        inner = [one for condition in effect.when for one in walk(condition)]
        unfit |= {s for one in inner if isinstance(one, Comparison) for s in _compared(one)}
    for amount in piece.amounts:
        unfit |= situations_in(amount.amount) & changing
        if amount.when or amount.each or amount.operation not in ("increase", "decrease"):
            unfit.add(amount.situation)
    for condition in piece.preconditions:
        if not isinstance(condition, Comparison):
            unfit |= {s for one in walk(condition) if isinstance(one, Comparison) for s in _compared(one)}
            continue
        about, operator, number = condition.left, condition.operator, condition.right
        if isinstance(about, Fraction):
            about, operator, number = number, MIRRORED.get(operator, operator), about
        if (
            condition.negated
            or operator not in MIRRORED
            or not (isinstance(about, Amount) and isinstance(number, Fraction))
        ):
            unfit |= _compared(condition)
            continue
        cell = about.situation, tuple(given.get(a, a) for a in about.arguments)
        limits[cell][operator in ("<", "<=")].append((number, operator in ("<", ">")))
    return {
        cell: AmountUse(
            Fraction(changes[cell][1]) - Fraction(changes[cell][0]) if cell in changes else Fraction(0),
            *map(tuple, limits[cell]),
        )
        for cell in (
            {(e.situation, tuple(given.get(a, a) for a in e.arguments)) for e in piece.amounts} | limits.keys()
        )
        if cell[0] not in unfit
    }


def _compared(condition: Comparison) -> frozenset[str]:
    return situations_in(condition.left) | situations_in(condition.right)


def pool_of(counts: Sequence[AmountUse], first: Fraction, quantity: Quantity) -> AmountPool | None:
    """Return the pool of an amount with its first value and a count for each event, or None if a step may exceed its limits."""
    known = [count.change for count in counts if count.change]
    scale = lcm(*(change.denominator for change in known))
    unit = Fraction(gcd(*(int(change * scale) for change in known)), scale)
    changes = [int(count.change / unit) for count in counts]

    def units(limits: Sequence[Limit], sign: int) -> int | None:
        """Return the least number of units, beyond the first amount, with which the limits are kept."""
        found = [(sign * (number - first) / unit, without) for number, without in limits]
        return max((floor(one) + 1 if without else ceil(one) for one, without in found), default=None)

    sides = list[PoolSide | None]()
    for sign, bound in ((1, quantity.least), (-1, quantity.most)):
        moves = [sign * change for change in changes]
        needs = [units(count.least if sign > 0 else count.most, sign) for count in counts]
        low = units(() if bound is None else ((bound, False),), sign)
        if low is None and all(need is None for need in needs):
            sides.append(None)
            continue
        if low is None and any(need is None and move < 0 for need, move in zip(needs, moves, strict=True)):
            return None
        left = [need + min(move, 0) for need, move in zip(needs, moves, strict=True) if need is not None]
        low = min([0, *left]) if low is None else low
        takes = [max(-move, 0 if need is None else need - low, 0) for need, move in zip(needs, moves, strict=True)]
        sides.append(PoolSide(-low, tuple(takes), tuple(take + move for take, move in zip(takes, moves, strict=True))))
    return AmountPool(tuple(changes), *sides)
