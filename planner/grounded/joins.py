"""Tables of small integers, and joins of these tables; the joins take most of the time of grounding.

Rows are only appended to a `JoinTable`. Therefore the rows known before a round are a prefix of all rows, and semi-naive
evaluation needs no second table. An index contains the rows sorted by several columns; a lookup is a binary search. The table
sorts an index again only after new rows were added.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from confab.planner.plan import UngroundableError
from confab.reasoner.limits import check

Ints = NDArray[np.int64]
PAIR = 1e-7
"""Minimum time per row of a join, in seconds.

A join can't be interrupted. Therefore a join that would exceed the deadline isn't started.
"""


class JoinTable:
    """A table of distinct rows in order of insertion; the entries are integers in [0, radix)."""

    def __init__(self, arity: int, radix: int) -> None:
        self.arity, self.radix = arity, radix
        self.rows: Ints = np.empty((0, arity), np.int64)
        self._indices: dict[tuple[int, ...], tuple[int, NDArray[np.generic], Ints]] = {}

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, rows: Ints) -> None:
        """Append the distinct rows that the table doesn't contain."""
        if not len(rows):
            return
        keys = pack(rows, self.radix)
        _, first = np.unique(keys, return_index=True)
        new = rows[first]
        if len(self):
            new = new[self.find(new) < 0]
        if len(new):
            self.rows = np.concatenate([self.rows, new])

    def find(self, rows: Ints) -> Ints:
        """Return the position of each row in the table, or -1 if the table doesn't contain the row."""
        keys, order = self._index(tuple(range(self.arity)))
        if not len(order):
            return np.full(len(rows), -1)
        wanted = pack(rows, self.radix)
        places = np.minimum(np.searchsorted(keys, wanted), len(order) - 1)
        return np.where(keys[places] == wanted, order[places], -1)

    def match(self, columns: Sequence[int], values: Ints, most: int) -> tuple[Ints, Ints]:
        """Return all pairs of a row of `values` and a row of the table that agree on `columns`.

        Raises
        ------
        UngroundableError
            There are more than `most` pairs.
        """
        check("grounding", PAIR * len(self))
        if not columns:
            if len(values) * len(self) > most:
                raise UngroundableError(f"{len(values) * len(self)} combinations, more than the {most} allowed")
            check("grounding", PAIR * len(values) * len(self))
            left = np.repeat(np.arange(len(values)), len(self))
            return left, np.tile(np.arange(len(self)), len(values))
        keys, order = self._index(tuple(columns))
        wanted = pack(values, self.radix)
        low = np.searchsorted(keys, wanted, "left")
        counts = np.searchsorted(keys, wanted, "right") - low
        total = int(counts.sum())
        if total > most:
            raise UngroundableError(f"{total} combinations, more than the {most} allowed")
        check("grounding", PAIR * total)
        left = np.repeat(np.arange(len(values)), counts)
        ends = np.cumsum(counts)
        places = np.arange(total) - np.repeat(ends - counts, counts) + np.repeat(low, counts)
        return left, order[places]

    def _index(self, columns: tuple[int, ...]) -> tuple[NDArray[np.generic], Ints]:
        """Return the keys of the rows for the given columns in ascending order, and the row of each key."""
        size, keys, order = self._indices.get(columns, (-1, _NONE, _NONE))
        if size != len(self):
            unsorted = pack(self.rows[:, columns], self.radix)
            order = np.argsort(unsorted, kind="stable")
            keys = unsorted[order]
            self._indices[columns] = (len(self), keys, order)
        return keys, order


_NONE: Ints = np.empty(0, np.int64)


def pack(rows: Ints, radix: int) -> NDArray[np.generic]:
    """Return one key per row; the order of the keys is the lexicographic order of the rows.

    A key is an integer if the row fits into 63 bits. Otherwise the key is the bytes of the row, most significant byte first.

    >>> pack(np.array([[1, 2], [0, 3]]), 10).tolist()
    [12, 3]
    """
    arity = rows.shape[1]
    if arity == 0:
        return np.zeros(len(rows), np.int64)
    if radix**arity < 2**63:
        keys = rows[:, 0].astype(np.int64)
        for column in range(1, arity):
            keys = keys * radix + rows[:, column]
        return keys
    return np.ascontiguousarray(rows.astype(">u4")).view(f"S{4 * arity}").ravel()


def ranges(starts: Ints, counts: Ints) -> Ints:
    """Return the concatenated ranges of consecutive numbers; each range has a start and a count."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    result: Ints = np.arange(total) - np.repeat(ends - counts, counts) + np.repeat(starts, counts)
    return result
