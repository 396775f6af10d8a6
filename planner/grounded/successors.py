"""Applicable operators of a state, found by a decision tree over symbols.

The tree is the successor generator of Helmert, "The Fast Downward planning system", JAIR 26 (2006), section 5.3.1. A
branch is created when a state first reaches the branch, because a search visits only few branches.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from confab.planner.grounded.joins import Ints
from confab.reasoner.limits import check

Waiting = tuple[int, list[int], int]
"""An operator, its required bits in the order of the tests, and the number of bits that were tested."""


class SuccessorTree:
    """A node of a decision tree that tests one symbol.

    `mask` contains the bits of the symbol. `by_value` maps each value of the symbol to a subtree. `otherwise` is the
    subtree of operators without a test of the symbol. `operators` are the operators that need no further test.
    `waiting` contains operators that aren't in a subtree yet.
    """

    __slots__ = ("by_value", "mask", "masks", "operators", "otherwise", "waiting")

    def __init__(self, masks: Sequence[int], waiting: list[Waiting]) -> None:
        self.masks, self.waiting = masks, waiting
        self.mask = 0
        self.by_value: dict[int, SuccessorTree] = {}
        self.otherwise: SuccessorTree | None = None
        self.operators: list[int] = []

    def of(self, state: int) -> tuple[list[int], int]:
        """Return the applicable operators of a state, and the number of visited nodes."""
        found: list[int] = []
        visited = 0
        heads = [self]
        for head in heads:  # the loop appends nodes to the list
            node: SuccessorTree | None = head
            while node is not None:
                visited += 1
                if node.waiting:
                    check("searching")
                    node._branch()
                if node.operators:
                    found += node.operators
                if not node.mask:
                    break
                fitting = node.by_value.get(state & node.mask)
                if fitting is not None:
                    heads.append(fitting)
                node = node.otherwise
        return found, visited

    def _branch(self) -> None:
        """Distribute the waiting operators over subtrees.

        The node tests the symbol that the first waiting operator tests next. A chain of further nodes tests the next symbols of
        the other operators.
        """
        masks = self.masks
        tests: dict[int, dict[int, list[Waiting]]] = {}
        for operator, bits, asked in self.waiting:
            if asked == len(bits):
                self.operators.append(operator)
            else:
                bit = bits[asked]
                tests.setdefault(masks[bit], {}).setdefault(bit, []).append((operator, bits, asked + 1))
        self.waiting = []
        node = self
        for mask, by_bit in tests.items():
            if node.mask:
                node.otherwise = node = SuccessorTree(masks, [])
            node.mask = mask
            node.by_value = {1 << bit: SuccessorTree(masks, waiting) for bit, waiting in by_bit.items()}


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
