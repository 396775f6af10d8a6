"""Landmarks: facts that every plan makes true at some time.

The landmarks of an operator are the bits that the operator requires, and the landmarks of these bits. The landmarks of a fact are
the common landmarks of all operators that set the fact.

The definition is due to Keyder, Richter and Helmert, "Sound and complete landmarks for and/or graphs", ECAI 2010.
"""

from __future__ import annotations

from time import perf_counter

from confab.planner.grounded.task import Task, bits_of

LOOK = 1_000
"""Number of operators between two readings of the clock."""


def landmarks(task: Task, deadline: float | None = None) -> int:
    """Return the mask of facts that every plan makes true at some time, including the goals.

    After the deadline, return only the goals. The deadline is a time on the clock of `time.perf_counter`. The computation takes
    seconds for thousands of facts with thousands of achievers each.
    """
    behind = [
        0 if task.initial >> bit & 1 else -1 for bit in range(task.size)
    ]  # mask of the landmarks of each bit; -1 until the bit is reached
    ways = list(zip(task.needs.lists(), task.adds.lists(), strict=True))
    before = None
    while before != behind:
        before = behind[:]
        for number, (needs, adds) in enumerate(ways):
            if number % LOOK == 0 and deadline is not None and perf_counter() > deadline:
                return task.goal
            needed = 0
            for bit in needs:
                if behind[bit] < 0:
                    break
                needed |= behind[bit] | 1 << bit
            else:
                for bit in adds:
                    behind[bit] &= needed
    found = task.goal
    for bit in bits_of(task.goal):
        found |= behind[bit]
    return found
