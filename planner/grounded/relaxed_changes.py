"""Changes by relaxed operators: effects on facts, changes of amounts, and the bits that the changes may set."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from confab.planner.grounded.amounts import Linear, Move, pushes, settled
from confab.planner.grounded.fact_bits import FactBits
from confab.planner.grounded.formulas import Formulas
from confab.planner.grounded.joins import Ints
from confab.planner.grounded.meanings import SAID_ONCE
from confab.planner.grounded.reachability import Flags, Reached
from confab.planner.grounded.task import Grouped, grouped
from confab.reasoner.amounts import COMPARING
from confab.reasoner.symbols import FALSE, Symbol


class RelaxedChanges:
    """The changes by the relaxed operators of a level."""

    def __init__(self, reached: Reached, formulas: Formulas, bits: FactBits) -> None:
        self.reached, self.formulas, self.bits = reached, formulas, bits

    def effects(self, rows: Mapping[int, Ints], first: Mapping[int, int]) -> Ints:
        """Return an array with a row for each effect on a fact.

        A row contains the relaxed operator, the position of the effect, the symbol, and the bit, or -1 for the value false.
        """
        parts = []
        for i, begin in first.items():
            schema = self.reached.schemas[i]
            if not len(rows[i]):
                continue
            for position, effect in schema.effects:
                name, situation = effect.situation, self.reached.situations[effect.situation]
                table = self.reached.tables["situation", name]
                place = table.find(self.reached.effect_rows(schema, effect, rows[i]))
                at = np.flatnonzero(place >= 0)
                bit = (
                    np.full(len(at), -1)
                    if effect.value == FALSE and situation.boolean
                    else self.bits.fact_bit[name][place[at]]
                )
                live = self.bits.fact_bit[name][place[at]] >= 0
                at, bit, symbol = at[live], bit[live], self.bits.symbol_of[name][place[at]][live]
                parts.append(np.stack([at + begin, np.full(len(at), position), symbol, bit], axis=1))
        return np.concatenate(parts) if parts else np.empty((0, 4), np.int64)

    def moves(self, rows: Mapping[int, Ints], first: Mapping[int, int]) -> dict[int, list[Move]]:
        """Return the changes of amounts by each relaxed operator that changes amounts."""
        names, table = self.reached.individuals, self.reached.amounts
        found = defaultdict[int, list[Move]](list)
        for i, begin in first.items():
            schema = self.reached.schemas[i]
            for number, row in enumerate(rows[i].tolist() if schema.amounts else ()):
                terms = dict(zip(schema.terms, (names[n] for n in row), strict=True))
                for position, effect in schema.amounts:
                    symbol = Symbol(effect.situation, tuple(terms.get(a, a) for a in effect.arguments))
                    if symbol in table.place:
                        by = table.linear(effect.amount, terms)
                        found[begin + number].append(Move(position, 0, table.place[symbol], effect.operation, by))
        return found

    def pushed(self, moves: Mapping[int, Sequence[Move]], owner: Ints) -> tuple[Ints, Ints]:
        """Return pairs of a relaxed operator and the bit of a comparison that the operator may make true."""
        by_place = defaultdict[int, list[tuple[Linear, str]]](list)
        for difference, sign in self.reached.amounts.bits:
            for place, _ in difference.terms:
                by_place[place].append((difference, sign))
        often = Counter((owner[relaxed], move.place) for relaxed, found in moves.items() for move in found)

        def may(found: Sequence[Move], alone: Sequence[Move], difference: Linear, sign: str) -> bool:
            amount, push = settled(alone, difference), pushes(found, difference)
            if amount is not None:
                return COMPARING[sign](Fraction(amount), Fraction(0))
            return push is None or push > 0 or (push != 0 and sign == "=")

        known: dict[tuple[object, ...], list[int]] = {}
        pairs: list[tuple[int, int]] = []
        for relaxed, found in moves.items():
            alone = [often[owner[relaxed], move.place] == 1 for move in found]
            alike = tuple((move.place, move.operation, move.by, only) for move, only in zip(found, alone, strict=True))
            if alike not in known:
                self.reached.check_time()
                asked = dict.fromkeys(key for move in found for key in by_place.get(move.place, ()))
                by_themselves = [move for move, only in zip(found, alone, strict=True) if only]
                known[alike] = [self.reached.amounts.bits[key] for key in asked if may(found, by_themselves, *key)]
            pairs.extend((relaxed, bit) for bit in known[alike])
        both = np.array(pairs, np.int64).reshape(-1, 2)
        return both[:, 0], both[:, 1]

    def adds(
        self,
        effects: Ints,
        need: Grouped,
        symbol_bits: Mapping[int, Sequence[int]],
        count: int,
        pushed: tuple[Ints, Ints],
    ) -> tuple[Grouped, list[tuple[tuple[int, ...], int]]]:
        """Return the bits that each relaxed operator may set, and the bits that auxiliary bits imply.

        An effect sets the complements of the values that its symbol may have had before. An effect with many complements sets one
        auxiliary bit "changed" of the symbol instead. In the relaxed task, the auxiliary bit implies the complements.
        """
        changed: dict[int, int] = {}
        opposites: dict[int, dict[int, int]] = {}
        positive = effects[:, 3] >= 0
        pairs = [(effects[positive, 0], effects[positive, 3]), pushed]
        complements = self.formulas.complements
        if complements:
            symbol_of = np.full(self.formulas.size, -1)
            for symbol, bits in symbol_bits.items():
                symbol_of[list(bits)] = symbol
            owner = np.repeat(np.arange(count), np.diff(need.starts))
            before = symbol_of[need.items]
            stride = self.bits.symbols + 1
            known = dict(zip((owner * stride + before).tolist(), need.items.tolist(), strict=True))
            opposites = {
                symbol: {bit: complements[bit] for bit in bits if bit in complements}
                for symbol, bits in symbol_bits.items()
            }
            lost: list[tuple[int, int, list[int]]] = []
            for number, (relaxed, _, symbol, bit) in enumerate(effects.tolist()):
                if not number % 1000:
                    self.reached.check_time()
                had, of = known.get(relaxed * stride + symbol), opposites[symbol]
                lost.append((relaxed, symbol, [o for value, o in of.items() if value != bit and had in (None, value)]))
            more = sum(len(bits) for _, _, bits in lost) - len(lost)
            if more > SAID_ONCE and not self.reached.amounts.place:  # consumption is counted per bit
                several = dict.fromkeys(symbol for _, symbol, bits in lost if len(bits) > 1)
                changed = {symbol: self.formulas.fresh() for symbol in several}
            lost = [(r, s, [changed[s]] if s in changed and len(bits) > 1 else bits) for r, s, bits in lost]
            extra = [(relaxed, bit) for relaxed, _, bits in lost for bit in bits]
            both = np.array(extra, np.int64).reshape(-1, 2)
            pairs.append((both[:, 0], both[:, 1]))
        add = grouped(np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs]), count)
        return add, [((bit,), o) for symbol, bit in changed.items() for o in opposites[symbol].values()]


def only(groups: Grouped, wanted: Flags) -> Grouped:
    """Return the groups whose flag in `wanted` is set."""
    sizes = np.diff(groups.starts)
    items = groups.items[np.repeat(wanted, sizes)]
    return Grouped(np.concatenate([[0], np.cumsum(sizes[wanted])]), items)


def with_derived(
    need: Grouped, add: Grouped, owner: Ints, cases: Sequence[tuple[tuple[int, ...], int]]
) -> tuple[Grouped, Grouped, Ints]:
    """Return the required bits, the added bits and the owners, with a relaxed operator for each alternative of a derived bit."""
    if not cases:
        return need, add, owner
    more = np.array([bit for group, _ in cases for bit in group], np.int64)
    ends = need.starts[-1] + np.cumsum([len(group) for group, _ in cases])
    need = Grouped(np.concatenate([need.starts, ends]), np.concatenate([need.items, more]))
    ends = add.starts[-1] + np.arange(1, len(cases) + 1)
    add = Grouped(np.concatenate([add.starts, ends]), np.concatenate([add.items, np.array([bit for _, bit in cases])]))
    return need, add, np.concatenate([owner, np.full(len(cases), -1)])
