"""The necessary order of permanent goals.

A goal is permanent if no operator makes it false. If a permanent goal holds, some facts can't hold at the same time (a tile that is
painted is never clear again). If each operator that achieves another goal requires such a fact, the other goal has to be achieved
before. A goal that has to come before others also holds when the next one is achieved, so that each order can imply more orders.

The goals that come before a goal become preconditions of the operators that achieve the goal. Every plan of the task satisfies
these preconditions. Therefore the task keeps all its plans, and the search skips states from which the remaining goals are
unreachable.

Pairs of facts that exclude each other are found by a fixed point over pairs (h^2 of Haslum and Geffner, "Admissible heuristics for
optimal planning", AIPS 2000). Orders of goals are described by Koehler and Hoffmann, "On reasonable and forced goal orderings and
their use in an agenda-driven planning algorithm", JAIR 12 (2000).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter

from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.task import BitChange, Grouped, Task, bits_of

MOST_WORK, ROUNDS = 2_000_000, 10
"""Maximum work of the computation of pairs: examined bits of operators, and found pairs; and the expected number of rounds."""
LOOK = 1_000
"""Number of operators between two readings of the clock."""


def ordered(task: Task, deadline: float | None = None) -> Task:
    """Return the task in which the achievers of permanent goals require the goals that have to be achieved before.

    If the computation takes too much work, or the deadline (on the clock of `time.perf_counter`) has passed, return the same task.
    """
    goals = task.goal & ~task.initial & _plain(task)
    pairs = _plain(task).bit_count() ** 2 // 2
    if goals.bit_count() < 2 or max(pairs, ROUNDS * len(task.needs.items)) > MOST_WORK:
        return task
    for operator in range(len(task)):
        if operator % LOOK == 0 and deadline is not None and perf_counter() > deadline:
            return task
        for _, cleared, _ in task.changes_of(operator)[1] if goals else ():
            goals &= ~cleared
    if goals.bit_count() < 2:
        return task
    together = _compatible(task, deadline)
    before = {} if together is None else _orders(task, goals, together)
    required = {
        operator: more for operator in range(len(task)) if before and (more := _required(task, operator, before))
    }
    if not required:
        return task
    needs = task.needs.lists()
    for operator, more in required.items():
        needs[operator] = sorted({*needs[operator], *bits_of(more)})

    def change(operator: int) -> tuple[int, tuple[BitChange, ...]]:
        precondition, changes = task.changes_of(operator)
        return precondition | required.get(operator, 0), changes

    return replace(task, needs=Grouped.of(needs), change=change, _changes={})


def _plain(task: Task) -> int:
    """Return the mask of the bits that only the changes of operators set and clear."""
    return ((1 << len(task.facts)) - 1 | union(1 << bit for bit in task.complements)) & ~task.derived.mask


def _compatible(task: Task, deadline: float | None) -> Sequence[int] | None:
    """Return for each bit the mask of the bits that may hold together with it, or None if this takes too much work or time."""
    plain = _plain(task)
    together = [0] * task.size
    for bit in bits_of(task.initial & plain):
        together[bit] = task.initial & plain
    moves = [_moves(task, operator, plain) for operator in range(len(task))]
    work = sum(len(needed) + len(added) for found in moves for needed, *_, added in found)
    most, changed = MOST_WORK, True
    while changed:
        most -= work
        if most < 0:
            return None
        changed = False
        for number, found in enumerate(moves):
            if number % LOOK == 0 and deadline is not None and perf_counter() > deadline:
                return None
            for needed, precondition, kept, all_added, added in found:
                common = plain
                for bit in needed:
                    common &= together[bit]
                if common & precondition != precondition:
                    continue
                common = (common & kept if needed else plain & kept) | all_added
                for bit in added:
                    new = common & ~together[bit]
                    if new:
                        changed = True
                        most -= new.bit_count()
                        if most < 0:
                            return None
                        together[bit] |= new
                        mine = 1 << bit
                        for other in bits_of(new):
                            together[other] |= mine
    return together


def _moves(task: Task, operator: int, plain: int) -> list[tuple[list[int], int, int, int, list[int]]]:
    """Return for each change of an operator the required bits, their mask, the bits that may stay, and the bits that are set.

    Of the bits that are set, the mask has those of all changes, and the list those of one change.
    """
    precondition, changes = task.changes_of(operator)
    set_ = task.set_by(operator) & plain
    kept = ~union(cleared for when, cleared, _ in changes if not when)
    found = []
    for when, _, added in changes:
        needed = (precondition | when) & plain
        found.append((bits_of(needed), needed, kept, set_, bits_of(added & plain)))
    return found


def _orders(task: Task, goals: int, together: Sequence[int]) -> Mapping[int, int]:
    """Return for goals the mask of the goals that have to be achieved before, or at the same time."""
    plain = _plain(task)
    achievers: dict[int, list[tuple[int, int]]] = {bit: [] for bit in bits_of(goals)}
    for operator in range(len(task)):
        precondition, changes = task.changes_of(operator)
        set_ = task.set_by(operator)
        for when, _, added in changes:
            if not (found := added & goals):
                continue
            common = plain
            for bit in bits_of((precondition | when) & plain):
                common &= together[bit]
            for bit in bits_of(found):
                achievers[bit].append((common, common | set_))
    before = dict.fromkeys(achievers, 0)
    changed = True
    while changed:
        changed = False
        for second, ways in achievers.items():
            earlier = before[second]
            possible = goals & union(common for common, after in ways if after & earlier == earlier)
            for first in bits_of(goals & ~possible & ~(1 << second)):
                new = (earlier | 1 << second) & ~before[first] & ~(1 << first)
                if new:
                    before[first] |= new
                    changed = True
    return {bit: mask for bit, mask in before.items() if mask}


def _required(task: Task, operator: int, before: Mapping[int, int]) -> int:
    """Return the goals that have to hold before an operator, because the operator achieves other goals."""
    precondition, changes = task.changes_of(operator)
    sure = union(added for when, _, added in changes if not when)
    return union(mask for bit, mask in before.items() if sure >> bit & 1) & ~task.set_by(operator) & ~precondition
