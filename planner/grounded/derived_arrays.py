"""Calculation of all derived bits of a state by arrays, one layer after another.

The arrays of a layer contain the alternatives of the layer's bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import chain
from operator import or_
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from confab.planner.grounded.joins import Ints

Flags: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Bit:
    """A derived bit, represented by a mask.

    The bit is set if a state has all bits of one alternative. An `opposite` bit is set if a state lacks at least one bit of
    every alternative.
    """

    mask: int
    alternatives: tuple[int, ...]
    opposite: bool = False


def by_arrays(layers: Sequence[Sequence[Bit]]) -> Callable[[int], int]:
    """Return a function that computes all bits of the layers in a state.

    The bits of a layer depend only on bits of earlier layers and of the same layer.
    """
    bits = list(chain(*layers))
    own = union(bit.mask for bit in bits)
    size = (own | union(way for bit in bits for way in bit.alternatives)).bit_length()
    low, length = (1 << size) - 1, size // 8 + 1
    works = [_Layer.of(layer, size) for layer in layers]

    def work(state: int) -> int:
        there = np.frombuffer((state & low & ~own | 1 << size).to_bytes(length, "little"), np.uint8)
        flags: Flags = np.unpackbits(there, bitorder="little").view(np.bool_)
        for layer in works:
            layer.work(flags)
        flags[size] = False
        return state & ~low | int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")

    return work


@dataclass(frozen=True, eq=False)
class _Layer:
    """The alternatives of a layer as arrays.

    `before` contains columns of required bits of earlier layers, and `inside` contains columns of required bits of the same
    layer. `heads` are the resulting bits. `opposites` are the opposite bits of the layer.
    """

    before: Sequence[Ints]
    inside: Sequence[Ints]
    heads: Ints
    opposites: Ints

    @staticmethod
    def of(layer: Sequence[Bit], always: int) -> _Layer:
        """Return the arrays of a layer; short rows are filled with `always`, a bit that is always set."""
        own = union(bit.mask for bit in layer)
        ways = [(way & ~own, way & own, bit.mask.bit_length() - 1) for bit in layer for way in bit.alternatives]
        ways.sort(key=lambda way: -way[0].bit_count())
        first, *others = _columns([before for before, _, _ in ways], always) or [np.full(len(ways), always)]
        return _Layer(
            [first, *(column[column != always] for column in others)],  # the alternatives are sorted by length
            _columns([inside for _, inside, _ in ways], always),
            np.array([head for _, _, head in ways], np.int64),
            np.array([bit.mask.bit_length() - 1 for bit in layer if bit.opposite], np.int64),
        )

    def work(self, flags: Flags) -> None:
        """Set the flags of the layer's bits in rounds, until no flag changes; the flags are initially unset."""
        active = np.flatnonzero(_all_set(flags, self.before))
        lacking, goal = [column[active] for column in self.inside], self.heads[active]
        while lacking and len(goal):
            ready = _all_set(flags, lacking)
            if not ready.any():
                break
            flags[goal[ready]] = True
            left = ~flags[goal]
            lacking, goal = [column[left] for column in lacking], goal[left]
        if not lacking:
            flags[goal] = True
        flags[self.opposites] = ~flags[self.opposites]


def _columns(masks: Sequence[int], always: int) -> list[Ints]:
    """Return an array of the first bits of all masks, an array of the second bits, and so on.

    The arrays are filled with `always` where a mask has fewer bits.
    """
    lists = [[low.bit_length() - 1 for low in single(mask)] for mask in masks]
    found = np.full((max(map(len, lists), default=0), len(lists)), always)
    for which, bits in enumerate(lists):
        found[: len(bits), which] = bits
    return list(found)


def union(masks: Iterable[int]) -> int:
    """Return the mask of the bits that are set in any of the masks."""
    return reduce(or_, masks, 0)


def single(mask: int) -> Iterable[int]:
    """Yield a mask of each bit of a mask."""
    while mask:
        low = mask & -mask
        mask ^= low
        yield low


def _all_set(flags: Flags, columns: Sequence[Ints]) -> Flags:
    """Return, for each row of a table of bits, whether all bits of the row are set in `flags`.

    A column other than the first one may be shorter than the table; its missing bits count as set.
    """
    found: Flags = flags[columns[0]]
    for column in columns[1:]:
        found[: len(column)] &= flags[column]
    return found
