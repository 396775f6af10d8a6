"""Envelopes: steps that provide a fact only while they run, and the steps that have to fit into them.

An envelope begins with an event that sets a bit, and its end clears the bit. A step that requires the bit throughout its duration
lies within one envelope: two envelopes in sequence leave a gap, and if two overlap, the first end clears the bit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence, Set
from dataclasses import replace
from math import inf
from typing import TypeAlias

import numpy as np

from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.task import BitChange, Task, bits_of, grouped

Ends: TypeAlias = "Sequence[int | None]"
"""For each operator, the operator that ends the step if the operator begins a step."""


def oversized(task: Task, ends: Ends, lasts: Sequence[int], apart: int, held: Callable[[int], int]) -> set[int]:
    """Return the begins of steps that are too long for every envelope of a bit that they require throughout.

    Parameters
    ----------
    task : Task
    ends : sequence of int or None
    lasts : sequence of int
        The duration of each operator's step.
    apart : int
        The minimum time between conflicting events.
    held : function of an operator
        Function that returns the bits that a step requires throughout its duration, given the step's end.
    """
    longest = defaultdict[int, float](float)
    for operator, end in enumerate(ends):
        changes = () if end is None else task.changes_of(end)[1]
        closed = union(cleared & ~set_ for when, cleared, set_ in changes if not when)
        for bit in bits_of(task.set_by(operator)):
            longest[bit] = max(longest[bit], lasts[operator] if closed >> bit & 1 else inf)
    return {
        operator
        for operator, end in enumerate(ends)
        if end is not None
        for bit in bits_of(held(end) & ~task.initial & ~task.set_by(operator))
        if bit in longest and lasts[operator] + 2 * apart > longest[bit]
    }


def dominated(task: Task, ends: Ends, lasts: Sequence[int], running: int) -> set[int]:
    """Return the begins of steps that differ from a longer step only in their duration.

    What fits into the shorter step also fits into the longer one. `running` has the bits that tell which steps are running.
    """
    alike = defaultdict[object, list[int]](list)
    for operator, end in enumerate(ends):
        if end is not None and not (task.amounts and (task.amounts.made(operator) or task.amounts.made(end))):
            alike[_without(task, operator, running), _without(task, end, running)].append(operator)
    found = set[int]()
    for group in alike.values():
        longest = max(lasts[one] for one in group)
        found.update(one for one in group if lasts[one] < longest)
    return found


def excluding(task: Task, never: Set[int], running: int) -> Task:
    """Return a task without some begins of steps: they require that their own step is running."""
    if not never:
        return task
    own = {operator: task.set_by(operator) & running & ~task.changes_of(operator)[0] for operator in never}
    needs = [(number, bit) for number, bits in enumerate(task.needs.lists()) for bit in bits]
    needs += [(number, bit) for number, owner in enumerate(task.owners) if owner in own for bit in bits_of(own[owner])]
    pairs = np.array(needs, np.int64).reshape(-1, 2)

    def change(operator: int) -> tuple[int, tuple[BitChange, ...]]:
        precondition, changes = task.changes_of(operator)
        return precondition | own.get(operator, 0), changes

    needed = grouped(pairs[:, 0], pairs[:, 1], len(task.owners))
    return replace(task, needs=needed, change=change, barred=set(), _changes={})


def _without(task: Task, operator: int, bits: int) -> tuple[int, tuple[BitChange, ...]]:
    """Return the precondition and the changes of an operator without some bits."""
    precondition, changes = task.changes_of(operator)
    return precondition & ~bits, tuple((when & ~bits, cleared & ~bits, set_ & ~bits) for when, cleared, set_ in changes)
