"""Bits for the facts of a level that can change, and values of the symbols that never change."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from confab.planner.grounded.formulas import Formulas
from confab.planner.grounded.joins import Ints
from confab.planner.grounded.reachability import Flags, Reached
from confab.reasoner.symbols import FALSE, TRUE, Fact, Symbol


class FactBits:
    """The bits of a level's facts, and the numbers of its symbols.

    Attributes
    ----------
    fact_bit : mapping of situation type to array
        For each row of the situation type's table, the bit of the fact, or -1 if the fact never changes.
    facts : list of Fact
        The fact of each bit.
    constants : mapping of Symbol to value
        The symbols that never change.
    symbol_of : mapping of situation type to array
        For each row of the situation type's table, the number of the symbol.
    symbols : int
        The number of symbols.
    """

    def __init__(self, reached: Reached, formulas: Formulas) -> None:
        self.reached, self.formulas = reached, formulas
        self.fact_bit: dict[str, Ints] = {}
        self.facts: list[Fact] = []
        self.constants: dict[Symbol, str] = {}
        self.symbol_of: dict[str, Ints] = {}
        self.symbols = 0
        self.number()

    def number(self) -> None:
        """Assign a bit to every reachable fact whose symbol can change."""
        reached, names = self.reached, self.reached.individuals
        for name, situation in reached.situations.items():
            reached.check_time()
            if name in reached.defined:
                continue
            table = reached.tables["situation", name]
            if situation.boolean:
                symbols = np.arange(len(table))
                number = len(table)
                changes = self._ever_false(name) | (np.arange(len(table)) >= self._true_at_first(name))
            else:
                symbols = reached.symbols[name].find(table.rows[:, :-1])
                number = len(reached.symbols[name])
                changes = np.bincount(symbols, minlength=number)[symbols] > 1
            self.symbol_of[name] = symbols + self.symbols
            self.symbols += number
            bits = np.full(len(table), -1)
            bits[changes] = np.arange(changes.sum()) + len(self.facts)
            self.fact_bit[name] = bits
            known = self.formulas.bits[name] = {}
            for row, bit in zip(table.rows.tolist(), bits.tolist(), strict=True):
                words = tuple(names[i] for i in row)
                known[words] = bit
                symbol, value = (
                    (Symbol(name, words), TRUE) if situation.boolean else (Symbol(name, words[:-1]), words[-1])
                )
                if bit < 0:
                    self.constants[symbol] = value
                else:
                    self.facts.append(Fact(symbol, value))
        amounts = reached.amounts
        self.constants |= {symbol: amounts.text(symbol) for symbol in amounts.now if symbol not in amounts.place}
        size = len(self.facts)
        for name in sorted(reached.defined):  # the bits of derived facts follow the bits of stated facts
            table = reached.tables["situation", name]
            self.fact_bit[name] = np.arange(size, size + len(table))
            rows = (tuple(names[i] for i in row) for row in table.rows.tolist())
            self.formulas.bits[name] = dict(zip(rows, range(size, size + len(table)), strict=True))
            size += len(table)
        self.formulas.size = size

    def initial(self) -> Iterator[int]:
        """Yield the bits that are set in the initial state."""
        true = set()
        for symbol, value in self.reached.initial.items():
            boolean = self.reached.situations[symbol.situation].boolean
            if boolean and value != TRUE:
                continue
            words = symbol.arguments if boolean else (*symbol.arguments, value)
            bit = self.formulas.bits[symbol.situation][words]
            if bit >= 0:
                true.add(bit)
        yield from true
        yield from (complement for bit, complement in self.formulas.complements.items() if bit not in true)

    def _true_at_first(self, name: str) -> int:
        return sum(v == TRUE for s, v in self.reached.initial.items() if s.situation == name)

    def _ever_false(self, name: str) -> Flags:
        table = self.reached.tables["situation", name]
        found = np.zeros(len(table), bool)
        for schema, rows in zip(self.reached.schemas, self.reached.rows, strict=True):
            for _, effect in schema.effects:
                if effect.situation == name and effect.value == FALSE and len(rows):
                    places = table.find(self.reached.effect_rows(schema, effect, rows))
                    found[places[places >= 0]] = True
        return found
