"""Amounts of a grounded level.

A state is an integer. The low bits of a state represent facts. The high bits of a state are the number of a tuple of amounts.

Each ground comparison has a bit that is derived from the tuple. Therefore conditions, goals and all functions that read
bits are the same with and without amounts. An operator may make a comparison true if the operator changes the
difference of both sides in the right direction (`Push`), or if the change depends on the state.

Comparisons are linear: both sides are sums of amounts times constants. Numbers are exact. Whole numbers are Python integers,
because arithmetic with integers is fast.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, reduce
from math import inf
from operator import or_
from typing import TypeAlias

from confab.planner.plan import UngroundableError
from confab.reasoner.amounts import (
    COMPARING,
    Amount,
    Calculation,
    Expression,
    Measure,
    Quantity,
    simplified,
    situations_in,
    written,
)
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, State, Symbol

Exact: TypeAlias = "int | Fraction"
AmountVector: TypeAlias = "tuple[Exact, ...]"
Push: TypeAlias = "Exact | None"
"""The change of a comparison's difference by an operator, or None if the change depends on the state."""
REMEMBERED = 10_000
"""Number of results that are remembered for operators with equal changes of amounts."""
IMPOSSIBLE = -1
"""Result of changes after which an amount is undefined or out of bounds."""


@dataclass(frozen=True)
class Linear:
    """A linear expression: the sum of amounts times factors, plus a constant; amounts are positions in the tuple."""

    terms: tuple[tuple[int, Exact], ...]
    constant: Exact

    def of(self, vector: AmountVector) -> Exact:
        """Return the value of the expression for a tuple of amounts."""
        total = self.constant
        for place, factor in self.terms:
            total += vector[place] * factor
        return total

    def worth(self, vector: AmountVector) -> float:
        """Return the value of the expression as a floating-point number."""
        return float(self.of(vector))

    def bounds(self, quantities: Sequence[Quantity]) -> tuple[float | Exact, float | Exact]:
        """Return the minimum and the maximum of the expression within the ranges of its amounts."""
        low = high = self.constant
        downward = upward = False
        for place, factor in self.terms:
            quantity = quantities[place]
            least, most = (quantity.least, quantity.most) if factor > 0 else (quantity.most, quantity.least)
            low, downward = (low, True) if least is None else (low + least * factor, downward)
            high, upward = (high, True) if most is None else (high + most * factor, upward)
        return -inf if downward else low, inf if upward else high

    def plus(self, other: Linear, times: Exact = 1) -> Linear:
        """Return the sum of the expression and a multiple of another expression."""
        found = defaultdict[int, Exact](int, self.terms)
        for place, factor in other.terms:
            found[place] += factor * times
        terms = tuple(sorted((place, factor) for place, factor in found.items() if factor))
        return Linear(terms, simplified(self.constant + other.constant * times))

    def times(self, factor: Exact) -> Linear:
        """Return a multiple of the expression."""
        return Linear((), 0).plus(self, factor)


@dataclass(frozen=True)
class Move:
    """A change of one amount by an operator: the operation, the operand `by`, and the required bits `when`.

    `by` is None if the operand is undefined. Changes with the same `position` are alternatives of one effect; the operator
    makes only the first change whose required bits are set.
    """

    position: int
    when: int
    place: int
    operation: str
    by: Linear | None


class AmountTable:
    """The amounts of a level during grounding.

    Each changing amount receives a position in the tuple, and each comparison receives a bit.
    """

    def __init__(self, problem: Problem, level: int, initial: State) -> None:
        self.problem = problem
        situations = problem.domain.situations
        changed = {effect.situation for behavior in problem.domain.at_level(level) for effect in behavior.amounts}
        counted = {s.name for s in situations.values() if s.quantity is not None and s.level <= level}
        self.now: dict[Symbol, Exact] = {
            symbol: simplified(Fraction(initial[symbol]))
            for symbol in sorted(symbol for symbol in initial if symbol.situation in counted)
        }
        self.place = {s: i for i, s in enumerate(symbol for symbol in self.now if symbol.situation in changed)}
        self.first = tuple(self.now[symbol] for symbol in self.place)
        self.quantities = [quantity for s in self.place if (quantity := situations[s.situation].quantity) is not None]
        self.ranges = [q.including(Fraction(first)) for q, first in zip(self.quantities, self.first, strict=True)]
        self.bits: dict[tuple[Linear, str], int] = {}
        self._measures: dict[str, Mapping[tuple[str, ...], Exact]] = {}

    def text(self, symbol: Symbol) -> str:
        """Return the initial amount of a symbol as the text of a value."""
        return written(Fraction(self.now[symbol]))

    def linear(self, expression: Expression, terms: Mapping[str, str]) -> Linear | None:
        """Return a linear expression in which individuals replace terms, or None if the expression has no value.

        Raises
        ------
        UngroundableError
            Two changing amounts are multiplied, or a changing amount is a divisor.
        """
        match expression:
            case Amount(situation, arguments):
                symbol = Symbol(situation, tuple(terms.get(a, a) for a in arguments))
                if symbol in self.place:
                    return Linear(((self.place[symbol], 1),), 0)
                return Linear((), self.now[symbol]) if symbol in self.now else None
            case Measure(relation, arguments):
                said = self._measured(relation).get(tuple(terms.get(a, a) for a in arguments))
                return None if said is None else Linear((), said)
            case Calculation(sign, left, right):
                one, other = self.linear(left, terms), self.linear(right, terms)
                if one is None or other is None:
                    return None
                if sign in "+-":
                    return one.plus(other, 1 if sign == "+" else -1)
                if other.terms and (one.terms or sign == "/"):
                    one_of, by = (" and ".join(sorted(situations_in(side))) for side in (left, right))
                    did = f"multiplies {one_of} by {by}, which both" if sign == "*" else f"divides by {by}, which"
                    raise UngroundableError(f"a calculation {did} change; a flat search requires linear calculations")
                if sign == "/":
                    return one.times(simplified(Fraction(1) / other.constant)) if other.constant else None
                return other.times(one.constant) if other.terms else one.times(other.constant)
            case constant:
                return Linear((), simplified(constant))

    def _measured(self, relation: str) -> Mapping[tuple[str, ...], Exact]:
        if relation not in self._measures:
            rows = self.problem.relations.get(relation, ())
            self._measures[relation] = {row[:-1]: simplified(Fraction(row[-1])) for row in rows}
        return self._measures[relation]

    def comparison(
        self, left: Linear | None, sign: str, right: Linear | None, negated: bool, fresh: Callable[[], int]
    ) -> tuple[tuple[int, ...] | None, ...]:
        """Return the alternatives under which a comparison is true, each as literals.

        If `negated`, return the alternatives under which the comparison is false. `fresh` returns the next free bit. Each bit
        means that a difference is at least zero, more than zero, or equal to zero.
        """
        if left is None or right is None:
            return ((),) if negated else (None,)
        contrary = {"<": (">=",), "<=": (">",), "=": ("<", ">"), ">=": ("<",), ">": ("<=",)}
        signs = contrary[sign] if negated else (sign,)
        found: list[tuple[int, ...] | None] = []
        for one in signs:
            difference = right.plus(left, -1) if one[0] == "<" else left.plus(right, -1)
            upward = one.replace("<", ">")
            if not difference.terms:
                found.append(() if COMPARING[upward](Fraction(difference.constant), Fraction(0)) else None)
                continue
            decided = self._decided(difference, upward)
            if decided is not None:
                found.append(() if decided else None)
                continue
            if (difference, upward) not in self.bits:
                self.bits[difference, upward] = fresh()
            found.append((self.bits[difference, upward],))
        return tuple(found)

    def _decided(self, difference: Linear, sign: str) -> bool | None:
        """Return True if a comparison is always true within the ranges of its amounts, False if the comparison is never true.

        Return None if the comparison depends on the amounts.
        """
        least, most = difference.bounds(self.ranges)
        if most < 0 or (most == 0 and sign == ">") or (sign == "=" and least > 0):
            return False
        if sign != "=" and (least > 0 or (least == 0 and sign == ">=")):
            return True
        return None

    def opposite(self, bit: int, fresh: Callable[[], int]) -> list[tuple[int, ...] | None] | None:
        """Return the alternatives under which the comparison of a bit is false, or None if the bit belongs to no comparison."""
        for (difference, sign), its in self.bits.items():
            if its == bit:
                return list(self.comparison(difference, sign, Linear((), 0), True, fresh))
        return None


@dataclass(eq=False)
class Amounts:
    """The amounts of a grounded task.

    Parameters
    ----------
    symbols : sequence of Symbol
        The symbol of each place of a tuple.
    first : tuple of numbers
        The tuple of the initial state.
    quantities : sequence of Quantity
        The bounds of the amount at each place.
    bits : mapping of (difference, sign) to bit
        The bit is set if the difference is at least, greater than, or equal to 0, as the sign states.
    size : int
        Number of bits of a state for facts and comparisons; the number of the tuple is stored above these bits.
    moves : function of an operator
        Function that returns the changes of amounts that the operator makes.
    """

    symbols: Sequence[Symbol]
    first: AmountVector
    quantities: Sequence[Quantity]
    bits: Mapping[tuple[Linear, str], int]
    size: int
    moves: Callable[[int], tuple[Move, ...]]
    vectors: list[AmountVector] = field(default_factory=list)
    _number: dict[AmountVector, int] = field(default_factory=dict, repr=False)
    _masks: list[int] = field(default_factory=list, repr=False)
    _moves: dict[int, tuple[Move, ...]] = field(default_factory=dict, repr=False)
    _results: dict[int, tuple[int, dict[int, int]]] = field(default_factory=dict, repr=False)
    _alike: dict[tuple[Move, ...], tuple[int, dict[int, int]]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Assign the number 0 to the initial tuple."""
        self.compared = sum(1 << bit for bit in self.bits.values())
        self.keep = ~self.compared & (1 << self.size) - 1
        self.numbered(self.first, 0, range(len(self.symbols)))

    @cached_property
    def at(self) -> Mapping[int, Sequence[tuple[int, Linear, str]]]:
        """The comparisons that contain an amount, by the position of the amount in the tuple."""
        found = defaultdict[int, list[tuple[int, Linear, str]]](list)
        for (difference, sign), bit in self.bits.items():
            for place, _ in difference.terms:
                found[place].append((bit, difference, sign))
        return found

    def numbered(self, vector: AmountVector, mask: int, changed: Iterable[int]) -> int:
        """Return the number of a tuple.

        A new tuple receives the next number. The comparison bits of a new tuple are derived from `mask`, the bits of another
        tuple; only the amounts at the `changed` positions differ.
        """
        number = self._number.get(vector)
        if number is None:
            for place in changed:
                for bit, difference, sign in self.at.get(place, ()):
                    amount = difference.of(vector)
                    holds = amount > 0 or (amount == 0 and sign != ">") if sign != "=" else amount == 0
                    mask = mask | 1 << bit if holds else mask & ~(1 << bit)
            number = self._number[vector] = len(self.vectors)
            self.vectors.append(vector)
            self._masks.append(mask)
        return number

    def vector(self, state: int) -> AmountVector:
        """Return the tuple of amounts of a state."""
        return self.vectors[state >> self.size]

    def begun(self, state: int) -> int:
        """Return a state with the comparison bits of the initial amounts."""
        return state & self.keep | self._masks[0]

    def made(self, operator: int) -> tuple[Move, ...]:
        """Return the changes of amounts by an operator; the changes are computed only once."""
        moves = self._moves.get(operator)
        if moves is None:
            moves = self._moves[operator] = self.moves(operator)
        return moves

    def applied(self, before: int, after: int, operator: int) -> int | None:
        """Return the state `after` with the amounts that an operator produces from the state `before`.

        Return None if a new amount is undefined or out of bounds.
        """
        asked, known = self._results.get(operator) or self._remembered(operator)
        if not asked:
            return after
        key = before & asked
        found = known.get(key)
        if found is None:
            if len(known) >= REMEMBERED:
                known.clear()
            found = known[key] = self._moved(before, self.made(operator))
        return None if found == IMPOSSIBLE else after & self.keep | found

    def _remembered(self, operator: int) -> tuple[int, dict[int, int]]:
        """Return the mask of the bits that new amounts depend on, and the known results of the operators with equal changes.

        The mask is 0 if the operator changes no amount.
        """
        moves = self.made(operator)
        if moves not in self._alike:
            self._alike[moves] = reduce(or_, (move.when for move in moves), -1 << self.size) if moves else 0, {}
        self._results[operator] = self._alike[moves]
        return self._results[operator]

    def _moved(self, before: int, moves: Sequence[Move]) -> int:
        """Return the bits of comparisons and the number of the amounts after changes, or `IMPOSSIBLE`."""
        number = before >> self.size
        vector = self.vectors[number]
        new: dict[int, Exact] = {}
        position = -1
        for move in moves:
            if move.position == position or before & move.when != move.when:
                continue
            position = move.position
            if move.by is None:
                return IMPOSSIBLE
            by, old = move.by.of(vector), new.get(move.place, vector[move.place])
            match move.operation:
                case "assign":
                    new[move.place] = by
                case "scale":
                    new[move.place] = old * by
                case "increase":
                    new[move.place] = old + by
                case _:
                    new[move.place] = old - by
        changed = list(vector)
        for place, amount in new.items():
            changed[place] = simplified(amount)
            if not self.quantities[place].allows(changed[place]):
                return IMPOSSIBLE
        number = self.numbered(tuple(changed), self._masks[number], new)
        return self._masks[number] | number << self.size

    def stated(self, state: int, values: State) -> int:
        """Return a state with the amounts that the mapping `values` contains."""
        vector = tuple(simplified(Fraction(values[symbol])) for symbol in self.symbols)
        number = self.numbered(vector, 0, range(len(vector)))
        return state & self.keep | self._masks[number] | number << self.size

    def facts(self, state: int) -> list[Fact]:
        """Return the amounts of a state as facts."""
        found = zip(self.symbols, self.vector(state), strict=True)
        return [Fact(symbol, written(Fraction(amount))) for symbol, amount in found]


def settled(moves: Sequence[Move], difference: Linear) -> Exact | None:
    """Return the value of a difference after changes that assign constants to all of its amounts.

    Return None if the changes assign no constant to one of the amounts.
    """
    given = {
        move.place: move.by.constant
        for move in moves
        if move.operation == "assign" and move.by is not None and not move.by.terms
    }
    if any(place not in given for place, _ in difference.terms):
        return None
    return simplified(difference.constant + sum(given[place] * factor for place, factor in difference.terms))


def pushes(moves: Sequence[Move], difference: Linear) -> Push | bool:
    """Return the total change of a difference by several changes of amounts.

    Return False if no change concerns the difference, and None if the total change depends on the state.
    """
    factors = dict(difference.terms)
    concerned = [move for move in moves if move.place in factors]
    if not concerned:
        return False
    total: Exact = 0
    for move in concerned:
        if move.operation not in ("increase", "decrease") or move.by is None or move.by.terms:
            return None
        total += factors[move.place] * move.by.constant * (1 if move.operation == "increase" else -1)
    return simplified(total)
