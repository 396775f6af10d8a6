"""By how much an amount falls short: a proof that there is no plan, found by adding up.

What is there of a situation type, over all symbols, is at most what there is now if no operator makes the sum larger. What is
wanted is at least what the goals take: each goal that doesn't hold yet, the least that any operator uses up that brings it about
(divided among the goals that one operator brings about at once); and what has to be left, by the goal or by the bounds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from fractions import Fraction

from planner.grounded.amounts import Amounts, Exact, Move, Vector
from planner.grounded.task import Task, bits_of
from planner.plan import Reason
from reasoner.amounts import written


def shortage(task: Task) -> Reason | None:
    """Return which amount doesn't suffice for the goal, and by how much, if adding up shows that."""
    amounts = task.amounts
    if amounts is None:
        return None
    vector = amounts.vector(task.initial)
    moves = {o: found for o in range(len(task)) if (found := amounts.moves(o))}
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
    places = defaultdict[str, list[int]](list)
    for place, symbol in enumerate(amounts.symbols):
        places[symbol.situation].append(place)
    unmet = [bit for bit in bits_of(task.goal & ~task.initial) if not amounts.compared >> bit & 1]
    makers = _makers(task, unmet)
    for situation, its in places.items():
        left = _left(task, amounts, its, vector, moves)
        if left is None or any(_change(found, its, True) != 0 for found in moves.values()):
            continue
        used = {o: -(_change(found, its, False) or 0) for o, found in moves.items()}
        wanted = left + sum(
            min((Fraction(used.get(o, 0)) / shared for o, shared in makers[bit].items()), default=Fraction(0))
            for bit in unmet
        )
        there = sum((Fraction(vector[place]) for place in its), Fraction(0))
        if wanted > there:
            unit = amounts.quantities[its[0]].unit
            what = f"{written(there)}{' ' * bool(unit)}{unit}"
            about = ", ".join(str(amounts.symbols[place].arguments[0]) for place in its[:5]) + ", …" * (len(its) > 5)
            text = f"{situation} of {about}: {what} are there, {written(wanted)} are wanted, and nothing gives more"
            terms = (situation, *(argument for place in its for argument in amounts.symbols[place].arguments))
            return Reason(text, tuple(dict.fromkeys(terms)))
    return None


def _extent(
    amounts: Amounts, place: int, vector: Vector, moves: Mapping[int, Sequence[Move]]
) -> tuple[Fraction | None, Fraction | None]:
    """Return between what an amount stays, whatever is done; None for no bound."""
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


def _makers(task: Task, unmet: Sequence[int]) -> Mapping[int, Mapping[int, int]]:
    """Return for each bit the operators that may set it, with how many of the bits such a one may set."""
    wanted = set(unmet)
    sets = defaultdict[int, set[int]](set)
    for bits, owner in zip(task.adds.lists(), task.owners, strict=True):
        if found := wanted.intersection(bits):
            sets[owner] |= found
    return {bit: {o: len(bits) for o, bits in sets.items() if bit in bits} for bit in unmet}


def _change(moves: Sequence[Move], places: Sequence[int], most: bool) -> Exact | None:
    """Return what an operator makes of a sum: at most, if that is more than nothing, else what it surely uses up.

    None where that depends on the state.
    """
    total: Exact = 0
    for move in moves:
        if move.place not in places:
            continue
        if move.operation not in ("increase", "decrease") or move.by is None or move.by.terms:
            return None if most else 0
        by = move.by.constant if move.operation == "increase" else -move.by.constant
        if not move.when or (by > 0) is most:
            total += by
    return max(total, 0) if most else min(total, 0)


def _left(
    task: Task, amounts: Amounts, places: Sequence[int], vector: Vector, moves: Mapping[int, Sequence[Move]]
) -> Fraction | None:
    """Return what is left of a sum in any state in which the goal holds, at least; None if that has no bound."""
    limits = {bit: (difference, sign) for (difference, sign), bit in amounts.bits.items()}
    needs = task.needs.lists()

    def asked(bits: Sequence[int], place: int) -> Fraction | None:
        """Return what comparisons of one amount with a number ask of it, at least."""
        found = [
            Fraction(-difference.constant) / Fraction(difference.terms[0][1])
            for bit in bits
            for difference, _ in [limits.get(bit, (None, ""))]
            if difference is not None and [p for p, _ in difference.terms] == [place] and difference.terms[0][1] > 0
        ]
        return max(found, default=None)

    def kept(place: int) -> Fraction | None:
        """Return what no operator takes of an amount, as far as each asks for more than it takes."""
        least = Fraction(vector[place])
        for o, its in moves.items():
            for move in its:
                if move.place == place:
                    before = asked(needs[o], place)
                    if before is None or move.by is None or move.by.terms or move.operation != "decrease":
                        return None
                    least = min(least, before - Fraction(move.by.constant))
        return least

    total = Fraction(0)
    for place in places:
        floor = [limit for limit in (amounts.quantities[place].least, kept(place)) if limit is not None]
        wanted = asked(bits_of(task.goal), place)
        if not floor:
            return None
        total += max(floor) if wanted is None else max(*floor, wanted)
    return total
