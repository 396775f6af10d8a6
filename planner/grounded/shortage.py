"""Proof of unsolvability by shortage: a sum that no operator increases is less than the goal requires.

The sum has two kinds of terms. Terms of the first kind are the amounts of a situation type, either of all symbols or of one
symbol. Terms of the second kind are facts that operators set while consuming amounts of the situation type. The worth of a fact
is the least amount that an operator consumes to set the fact. If an operator sets several facts together, the consumed amount
is divided among these facts. An operator that returns an amount doesn't increase the sum if the operator also clears facts of
at least the same worth. For example, the return of a lent book increases the number of books, and clears the fact that a reader
has the book. The goal requires the worth of its facts, plus the amount that must remain because of the goal or the bounds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from confab.planner.grounded.amounts import Amounts, AmountVector, Exact, Move
from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.task import Task, bits_of
from confab.planner.plan import Reason
from confab.reasoner.amounts import written


def shortage(task: Task) -> Reason | None:
    """Return the reason why an amount doesn't suffice for the goal, or None if no sum proves a shortage."""
    amounts = task.amounts
    if amounts is None:
        return None
    vector = amounts.vector(task.initial)
    moves = {o: found for o in range(len(task)) if (found := amounts.made(o))}
    for (difference, sign), bit in amounts.bits.items():
        if (task.goal & ~task.initial) >> bit & 1 and len(difference.terms) == 1:
            place, factor = difference.terms[0]
            wanted = Fraction(-difference.constant) / Fraction(factor)
            low, high = _extent(amounts, place, vector, moves)
            symbol, unit = amounts.symbols[place], amounts.quantities[place].unit
            for what, limit in (("at most", high if factor > 0 else None), ("at least", low if factor < 0 else None)):
                beyond = limit is not None and (limit < wanted if factor > 0 else limit > wanted)
                if limit is not None and (beyond or (limit == wanted and sign == ">")):
                    text = f"{symbol}: {what} {written(limit)}{' ' * bool(unit)}{unit} can be there"
                    more = f"{'more' if factor > 0 else 'less'} than " if sign == ">" else ""
                    return Reason(f"{text}, {more}{written(wanted)} wanted", (symbol.situation, *symbol.arguments))
    return _Sums(task, amounts, vector, moves).short()


@dataclass(frozen=True)
class _Sums:
    """The sums of a task: amounts of one situation type, plus facts that represent consumed amounts."""

    task: Task
    amounts: Amounts
    vector: AmountVector
    moves: Mapping[int, Sequence[Move]]

    def short(self) -> Reason | None:
        """Return the reason why the goal is unreachable if some sum is less than the goal requires, otherwise None."""
        places = defaultdict[str, list[int]](list)
        for place, symbol in enumerate(self.amounts.symbols):
            places[symbol.situation].append(place)
        for its in places.values():
            for some in (its, *([place] for place in its if len(its) > 1)):
                left = [self.left(place) for place in some]
                floor = sum((one for one in left if one is not None), Fraction(0))
                if None not in left and (reason := self.wanted_of(some, floor)):
                    return reason
        return None

    def wanted_of(self, places: Sequence[int], left: Fraction) -> Reason | None:
        """Return the reason why the goal is unreachable if the sum for the amounts at `places` is too small, otherwise None.

        `left` is the amount that must remain in the goal state.
        """
        touched = {o for place in places for o, _ in self.of[place]}
        most = {o: _change(self.moves[o], places) for o in touched}
        used = {o: -change for o, change in most.items() if change is not None and change < 0}
        gains = {o: change for o, change in most.items() if change is None or change > 0}
        for bits in self.counted(used):
            worth = self.worth(bits, used)
            if any(gain is None or gain > self.undone(o, worth) for o, gain in gains.items()):
                continue
            taken = sum((value for bit, value in worth.items() if self.task.initial >> bit & 1), Fraction(0))
            there = sum((Fraction(self.vector[place]) for place in places), taken)
            wanted = left + self.least(worth)
            if wanted > there:
                return self.said(places, there, taken, wanted)
        return None

    @cached_property
    def of(self) -> Mapping[int, Sequence[tuple[int, Move]]]:
        """The operators that change an amount, each with its change, by the position of the amount."""
        found = defaultdict[int, list[tuple[int, Move]]](list)
        for o, its in self.moves.items():
            for move in its:
                found[move.place].append((o, move))
        return found

    @cached_property
    def sets(self) -> Mapping[int, Set[int]]:
        """The bits that an operator may set, by the operator."""
        found = defaultdict[int, set[int]](set)
        for bits, owner in zip(self.task.adds.lists(), self.task.owners, strict=True):
            found[owner].update(bits)
        return found

    @cached_property
    def makers(self) -> Mapping[int, Sequence[int]]:
        """The operators that may set a bit, by the bit."""
        found = defaultdict[int, list[int]](list)
        for o, bits in self.sets.items():
            for bit in bits:
                found[bit].append(o)
        return found

    def counted(self, used: Mapping[int, Exact]) -> Iterator[Set[int]]:
        """Yield sets of facts that may represent consumed amounts: the open goals, then the facts of each situation type."""
        task = self.task
        yield {bit for bit in bits_of(task.goal & ~task.initial) if not self.amounts.compared >> bit & 1}
        kinds = {task.facts[bit].symbol.situation for o in used for bit in self.sets[o] if bit < len(task.facts)}
        for kind in sorted(kinds):
            yield self.facts[kind]

    @cached_property
    def facts(self) -> Mapping[str, Set[int]]:
        """The bits of the facts of each situation type."""
        found = defaultdict[str, set[int]](set)
        for bit, fact in enumerate(self.task.facts):
            found[fact.symbol.situation].add(bit)
        return found

    def worth(self, bits: Set[int], used: Mapping[int, Exact]) -> Mapping[int, Fraction]:
        """Return the worth of each bit: the least amount that an operator consumes to set the bit.

        The amount is divided among the bits that the operator sets together.
        """
        found = dict[int, Fraction]()
        for bit in bits:
            makers = self.makers.get(bit, ())
            if makers and all(o in used for o in makers):
                found[bit] = min(Fraction(used[o]) / len(self.sets[o] & bits) for o in makers)
        return found

    def undone(self, operator: int, worth: Mapping[int, Fraction]) -> Fraction:
        """Return the worth of the bits that an operator certainly clears."""
        asked, changes = self.task.changes_of(operator)
        cleared = union(bits for when, bits, _ in changes if not when & ~asked)
        kept = self.task.set_by(operator)
        return sum((worth.get(bit, Fraction(0)) for bit in bits_of(asked & cleared & ~kept)), Fraction(0))

    def least(self, worth: Mapping[int, Fraction]) -> Fraction:
        """Return the least worth of the facts that the goals require; a fact that can satisfy several goals counts once."""
        least, serving = dict(worth), {bit: 1 << bit for bit in worth}
        for part in self.task.derived.parts:
            for one in part if len(part) == 1 and not part[0].opposite else ():
                bit, ways = one.mask.bit_length() - 1, [bits_of(way) for way in one.alternatives]
                least[bit] = min(
                    (max((least.get(b, Fraction(0)) for b in way), default=Fraction(0)) for way in ways),
                    default=Fraction(0),
                )
                serving[bit] = union(serving.get(b, 0) for way in ways for b in way)
        groups: list[tuple[int, Fraction]] = []
        for bit in bits_of(self.task.goal):
            if value := least.get(bit, Fraction(0)):
                bits = serving[bit]
                for group in [group for group in groups if group[0] & bits]:
                    groups.remove(group)
                    bits, value = bits | group[0], max(value, group[1])
                groups.append((bits, value))
        return sum((value for _, value in groups), Fraction(0))

    def said(self, places: Sequence[int], there: Fraction, taken: Fraction, wanted: Fraction) -> Reason:
        symbols = [self.amounts.symbols[place] for place in places]
        unit = self.amounts.quantities[places[0]].unit
        about = ", ".join("".join(symbol.arguments[:1]) for symbol in symbols[:5]) + ", …" * (len(symbols) > 5)
        what = f"{written(there)}{' ' * bool(unit)}{unit} are there"
        of_it = f" ({written(taken)} of them in use)" if taken else ""
        text = f"{symbols[0].situation} of {about}: {what}{of_it}, {written(wanted)} are wanted, and nothing gives more"
        terms = (symbols[0].situation, *(argument for symbol in symbols for argument in symbol.arguments))
        return Reason(text, tuple(dict.fromkeys(terms)))

    @cached_property
    def limits(self) -> Mapping[int, tuple[int, Fraction]]:
        """The bits of comparisons that bound a single amount from below, each with the position of the amount and the bound."""
        return {
            bit: (difference.terms[0][0], Fraction(-difference.constant) / Fraction(difference.terms[0][1]))
            for (difference, _), bit in self.amounts.bits.items()
            if len(difference.terms) == 1 and difference.terms[0][1] > 0
        }

    def asked(self, bits: Iterable[int], place: int) -> Fraction | None:
        """Return the greatest lower bound on an amount among the comparisons in `bits`, or None if there is no such bound."""
        found = (self.limits[bit] for bit in bits if bit in self.limits)
        return max((wanted for of, wanted in found if of == place), default=None)

    def kept(self, place: int) -> Fraction | None:
        """Return the part of an amount that no operator can consume, or None if unknown.

        A part of the amount can't be consumed if every consuming operator requires a greater amount than it consumes.
        """
        least = Fraction(self.vector[place])
        for o, move in self.of[place]:
            if move.operation == "increase" and move.by is not None and not move.by.terms and move.by.constant >= 0:
                continue
            before = self.asked(self.task.needs[o], place)
            if before is None or move.by is None or move.by.terms or move.operation != "decrease":
                return None
            least = min(least, before - Fraction(move.by.constant))
        return least

    def left(self, place: int) -> Fraction | None:
        """Return a lower bound on an amount in every goal state, or None if there is no bound.

        An amount that is below its minimum at first may stay there.
        """
        wanted = self.asked(bits_of(self.task.goal), place)
        least = self.amounts.quantities[place].including(Fraction(self.vector[place])).least
        found = (least, self.kept(place), wanted)
        floor = [limit for limit in found if limit is not None]
        return max(floor, default=None)


def _extent(
    amounts: Amounts, place: int, vector: AmountVector, moves: Mapping[int, Sequence[Move]]
) -> tuple[Fraction | None, Fraction | None]:
    """Return the minimum and the maximum that operators can give to an amount, with None for no limit."""
    low: Fraction | None = Fraction(vector[place])
    high: Fraction | None = Fraction(vector[place])
    for move in (move for its in moves.values() for move in its if move.place == place):
        if move.by is None or move.by.terms or move.operation == "scale":
            low = high = None
            break
        by = Fraction(move.by.constant)
        if move.operation == "assign":
            low, high = low if low is None else min(low, by), high if high is None else max(high, by)
        elif by:
            up = (by > 0) is (move.operation == "increase")
            low, high = (low, None) if up else (None, high)
    quantity = amounts.quantities[place]
    limits = [limit for limit in (low, quantity.least) if limit is not None]
    most = [limit for limit in (high, quantity.most) if limit is not None]
    return max(limits, default=None), min(most, default=None)


def _change(moves: Sequence[Move], places: Sequence[int]) -> Exact | None:
    """Return the maximum by which an operator increases a sum: conditional increases count, conditional decreases don't.

    Return None if the increase depends on the state.
    """
    total: Exact = 0
    for move in moves:
        if move.place not in places:
            continue
        if move.operation not in ("increase", "decrease") or move.by is None or move.by.terms:
            return None
        by = move.by.constant if move.operation == "increase" else -move.by.constant
        if by > 0 or not move.when:
            total += by
    return total
