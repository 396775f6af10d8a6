"""Applicable operators of a state, found by a decision tree over symbols.

The tree is the successor generator of Helmert, "The Fast Downward planning system", JAIR 26 (2006), section 5.3.1. A
branch is created when a state first reaches the branch, because a search visits only few branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.joins import Ints
from confab.reasoner.limits import check

Waiting = tuple[int, list[int], int]
"""An operator, its required bits in the order of the tests, and the number of bits that were tested."""


class SuccessorTree:
    """A node of a decision tree that tests symbols one after another.

    `tests` is the number of tested symbols, and `mask` contains the bits of their tested values. `by_bit` maps each such bit to the
    position of its test and a subtree. `operators` are the operators that need no further test. `waiting` contains operators that
    aren't in a subtree yet.
    """

    __slots__ = ("by_bit", "mask", "masks", "operators", "tests", "waiting")

    def __init__(self, masks: Sequence[int], waiting: list[Waiting]) -> None:
        self.masks, self.waiting = masks, waiting
        self.mask, self.tests = 0, 0
        self.by_bit: dict[int, tuple[int, SuccessorTree]] = {}
        self.operators: list[int] = []

    def of(self, state: int) -> tuple[list[int], int]:
        """Return the applicable operators of a state, and the number of tests."""
        found: list[int] = []
        tests = 0
        nodes = [self]
        for node in nodes:  # the loop appends nodes to the list
            if node.waiting:
                check("searching")
                node._branch()
            found += node.operators
            tests += node.tests or 1
            fitting = state & node.mask
            if fitting:
                by_bit, subtrees = node.by_bit, []
                while fitting:
                    bit = fitting & -fitting
                    fitting ^= bit
                    subtrees.append(by_bit[bit])
                subtrees.sort(key=itemgetter(0))
                nodes += [subtree for _, subtree in subtrees]
        return found, tests

    def _branch(self) -> None:
        """Distribute the waiting operators over subtrees; an operator waits for the symbol that it requires next."""
        tests: dict[int, dict[int, list[Waiting]]] = {}
        for operator, bits, asked in self.waiting:
            if asked == len(bits):
                self.operators.append(operator)
            else:
                bit = bits[asked]
                tests.setdefault(self.masks[bit], {}).setdefault(bit, []).append((operator, bits, asked + 1))
        self.waiting, self.tests = [], len(tests)
        for position, by_bit in enumerate(tests.values()):
            for bit, waiting in by_bit.items():
                self.by_bit[1 << bit] = position, SuccessorTree(self.masks, waiting)
        self.mask = union(self.by_bit)


def tree(starts: Ints, items: Ints, masks: Sequence[int]) -> SuccessorTree:
    """Return the decision tree of operators; symbols that many operators require are tested first.

    Parameters
    ----------
    starts, items : array of int
        Operator `i` requires the bits ``items[starts[i]:starts[i + 1]]``.
    masks : sequence of int
        For each bit, the mask of all bits of the same symbol.
    """
    numbers = {mask: i for i, mask in enumerate(dict.fromkeys(masks))}
    symbol_of = np.array([numbers[mask] for mask in masks], np.int64)
    items = items[: starts[-1]]
    often = np.bincount(symbol_of[items], minlength=len(numbers)).tolist()
    first = sorted(numbers, key=lambda mask: (-often[numbers[mask]], mask))
    place = np.empty(len(numbers), np.int64)
    place[[numbers[mask] for mask in first]] = np.arange(len(first))
    owners = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    bits = items[np.lexsort((place[symbol_of[items]], owners))].tolist()
    ends = starts.tolist()
    return SuccessorTree(masks, [(i, bits[ends[i] : ends[i + 1]], 0) for i in range(len(ends) - 1)])
