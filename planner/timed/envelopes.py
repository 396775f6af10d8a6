"""Envelopes: steps that provide a fact only while they run, and the steps that have to fit into them.

An envelope begins with an event that sets a bit, and its end clears the bit. A step that requires the bit throughout its duration
lies within one envelope: two envelopes in sequence leave a gap, and if two overlap, the first end clears the bit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import replace
from functools import reduce
from math import inf
from operator import and_
from typing import TypeAlias

import numpy as np

from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.task import BitChange, Task, bits_of, grouped

Ends: TypeAlias = "Sequence[tuple[int, ...]]"
"""For each operator, the operators that can end the step if the operator begins a step."""


def intersection(masks: Iterable[int]) -> int:
    """Return the bits that all of one or more masks have."""
    return reduce(and_, masks)


def oversized(
    task: Task, ends: Ends, lasts: Sequence[int], apart: int, held: Callable[[tuple[int, ...]], int]
) -> set[int]:
    """Return the begins of steps that are too long for every envelope of a bit that they require throughout.

    Parameters
    ----------
    task : Task
    ends : sequence of tuple of int
    lasts : sequence of int
        The duration of each operator's step.
    apart : int
        The minimum time between conflicting events.
    held : function of operators
        Function that returns the bits that a step requires throughout its duration, given the step's possible ends.
    """
    longest = defaultdict[int, float](float)
    for operator, its in enumerate(ends):
        changes = [task.changes_of(end)[1] for end in its]
        closed = [union(cleared & ~set_ for when, cleared, set_ in made if not when) for made in changes] or [0]
        for bit in bits_of(task.set_by(operator)):
            longest[bit] = max(longest[bit], lasts[operator] if intersection(closed) >> bit & 1 else inf)
    return {
        operator
        for operator, its in enumerate(ends)
        if its
        for bit in bits_of(held(its) & ~task.initial & ~task.set_by(operator))
        if bit in longest and lasts[operator] + 2 * apart > longest[bit]
    }


def dominated(task: Task, ends: Ends, lasts: Sequence[int], running: int) -> set[int]:
    """Return the begins of steps that differ from a longer step only in their duration.

    What fits into the shorter step also fits into the longer one. `running` has the bits that tell which steps are running.
    """
    alike = defaultdict[object, list[int]](list)
    for operator, its in enumerate(ends):
        if its and not (task.amounts and any(task.amounts.made(one) for one in (operator, *its))):
            alike[tuple(_without(task, one, running) for one in (operator, *its))].append(operator)
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
