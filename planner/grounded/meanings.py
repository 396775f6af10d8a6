"""The meanings of derived bits, that is, of defined situation types and of shared conditions.

The meaning of a bit is a conjunction of other bits, or several alternatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Set as AbstractSet

import numpy as np

from confab.planner.grounded.derived import Derived, in_parts
from confab.planner.grounded.derived_arrays import Bit
from confab.planner.grounded.fact_bits import FactBits
from confab.planner.grounded.formulas import Formulas
from confab.planner.grounded.joins import Ints, ranges
from confab.planner.grounded.reachability import Reached
from confab.planner.grounded.task import Grouped, grouped
from confab.reasoner.derivation import circular
from confab.reasoner.symbols import Rule

SAID_ONCE = 20_000
"""Minimum number of conditions, over all operators, that must be saved before a shared condition is evaluated once per state.

A relaxed plan evaluates this number of conditions in a millisecond.
"""


class Meanings:
    """The computation of the meanings of a level's bits."""

    def __init__(self, reached: Reached, formulas: Formulas, bits: FactBits) -> None:
        self.reached, self.formulas, self.bits = reached, formulas, bits

    def of_bits(
        self, rows: Mapping[int, Ints], needs: Mapping[int, tuple[Ints, Ints]]
    ) -> tuple[Derived, list[tuple[tuple[int, ...], int]], Grouped | None]:
        """Return the derived bits, their alternatives for the relaxed task, and the meaning of each bit.

        A bit with one alternative is replaced by the bits of this alternative. The exception is a long alternative that many
        operators require, for example "no object stands in this place".
        """
        formulas = self.formulas
        ways: dict[int, dict[tuple[int, ...], None]] = {}  # alternatives of each bit of a defined situation type
        for name in self.reached.defined:
            ways |= {int(bit): {} for bit in self.bits.fact_bit[name]}
        for i, schema in enumerate(self.reached.schemas):
            if schema.rule:
                effect = schema.effects[0][1]
                table = self.reached.tables["situation", effect.situation]
                places = table.find(self.reached.effect_rows(schema, effect, rows[i]))
                lists = grouped(*needs[i], len(rows[i])).lists()
                for place, found in zip(places.tolist(), lists, strict=True):
                    if place >= 0:
                        ways[int(self.bits.fact_bit[effect.situation][place])][tuple(found)] = None
        if not ways and not formulas.derived:
            return Derived(), [], None
        circular = self._circular()
        self._opposites(ways, circular)
        for groups, bit in formulas.derived.items():
            ways[bit] = dict.fromkeys(groups)
        means: dict[int, tuple[int, ...]] = {}
        none = np.empty(0, np.int64)
        asked = np.bincount(np.concatenate([none, *(bit for _, bit in needs.values())]), minlength=formulas.size)
        only = {bit: len(next(iter(its))) for bit, its in ways.items() if len(its) == 1}
        saved = {bit: int(size * asked[bit] - size - asked[bit]) for bit, size in only.items()}
        if sum(less for less in saved.values() if less > 0) > SAID_ONCE:
            means |= {bit: (bit,) for bit, less in saved.items() if less > 0}
        for bit in ways:
            _meaning(bit, ways, circular, means)
        kept = {
            bit: dict.fromkeys(
                tuple(sorted({one for other in way for one in means.get(other, (other,))})) for way in its
            )
            for bit, its in ways.items()
            if means[bit] == (bit,)
        }
        bits = {bit: Bit(1 << bit, tuple(sum(1 << one for one in found) for found in its)) for bit, its in kept.items()}
        cases = [(found, bit) for bit, its in kept.items() for found in its]
        for bit, opposite in formulas.complements.items():
            if bit in kept and opposite not in ways:
                bits[opposite] = Bit(1 << opposite, (1 << bit,), opposite=True)
                cases.append(((), opposite))
        all_of = [means.get(bit, (bit,)) for bit in range(formulas.size)]
        return in_parts(bits), cases, Grouped.of(all_of)

    def _opposites(self, ways: dict[int, dict[tuple[int, ...], None]], circular: set[int]) -> None:
        """Add the meaning of each negated defined fact that a condition requires, except for recursively defined facts."""
        formulas = self.formulas
        waiting = [bit for bit in formulas.complements if bit in ways]
        for bit in waiting:  # the loop appends bits to the list
            self.reached.check_time()
            if bit in circular:
                continue
            known = len(formulas.complements)
            found = formulas.all_of(formulas.any_of(formulas.opposite(one) for one in way) for way in ways[bit])
            ways[formulas.complements[bit]] = {} if found is None else {found: None}
            waiting += [other for other in list(formulas.complements)[known:] if other in ways]

    def _circular(self) -> set[int]:
        """Return the bits of recursively defined situation types, and of situation types that depend on recursive types."""
        rules: dict[str, list[Rule]] = {name: [] for name in self.reached.defined}
        for schema in self.reached.schemas:
            if schema.rule:
                behavior = schema.behavior
                rules[behavior.effects[0].situation].append(Rule(behavior.name, (), (), behavior.preconditions))
        return {bit for name in circular(rules) for bit in self.bits.fact_bit[name].tolist()}


def _meaning(
    bit: int,
    ways: Mapping[int, Mapping[tuple[int, ...], None]],
    circular: AbstractSet[int],
    means: dict[int, tuple[int, ...]],
) -> None:
    """Enter the meaning of a bit into `means`.

    The meaning of a bit with a single alternative is the bits of this alternative. The meaning of every other bit is the bit
    itself.
    """
    waiting = [bit]
    while waiting:
        one = waiting[-1]
        its = ways.get(one, {})
        if one in means or one in circular or not its or (len(its) > 1 and () not in its):
            means.setdefault(one, (one,))
            waiting.pop()
            continue
        way = () if () in its else next(iter(its))
        missing = [other for other in way if other not in means]
        waiting += missing
        if not missing:
            means[one] = tuple(sorted({found for other in way for found in means[other]}))
            waiting.pop()


def expanded(row: Ints, bit: Ints, means: Grouped) -> tuple[Ints, Ints]:
    """Return pairs of a row and a bit; each bit is replaced by the bits of its meaning."""
    counts = np.diff(means.starts)[bit]
    return np.repeat(row, counts), means.items[ranges(means.starts[bit], counts)]
