"""Knowledge links of a confabulation memory: p(situated object instance | quantified behaviour)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from confab.reasoner.symbols import Symbol

Conclusion: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A quantified behaviour: its name and arguments."""


@dataclass
class Links:
    """The probability tables of the paper, section III-C.

    `tables` contains a categorical distribution over values for each learned pair of conclusion and symbol. For each other pair,
    the distribution is uniform.

    >>> Links().probability(("MOVE", ("cup",)), Symbol("LOCATION", ("cup",)), "shelf", ["shelf", "table"])
    0.5
    """

    tables: dict[Conclusion, dict[Symbol, dict[str, float]]] = field(default_factory=dict)

    def probability(self, conclusion: Conclusion, symbol: Symbol, value: str, values: Sequence[str]) -> float:
        """Return p(<o, s> | b) for a value in `values`, the values that the symbol can have."""
        table = self.tables.get(conclusion, {}).get(symbol)
        if table is None:
            return 1.0 / len(values) if values else 1.0
        return table.get(value, 0.0)

    def __len__(self) -> int:
        """Return the number of links."""
        return sum(len(table) for symbols in self.tables.values() for table in symbols.values())
