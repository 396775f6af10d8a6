"""The relaxed-plan heuristic by whole arrays, for tasks of which a state reaches much in few layers.

`planner.grounded.hff` follows what is reached, bit by bit. Here each layer looks at all that every operator needs and sets, in a
few calls of NumPy, until no cost falls. That is more work, done a few dozen times faster: `effort` counts at the initial state
which of the two is less.

cost      of a bit: of the cheapest operator that sets it, one plus the costs of what that needs; zero where it is set
"""

from __future__ import annotations

import numpy as np

from planner.grounded.hff import Evaluate, Evaluation
from planner.grounded.joins import Ints
from planner.grounded.task import Grouped, Task

NEVER = 1 << 24
"""The cost of a bit that isn't reached; sums of some dozens of them fit into 32 bits."""
AT_ONCE, CALLS = 35, 600
"""In the time in which Python follows one bit, arrays look at so many; and the calls of one layer take the time of so many bits."""


def effort(task: Task) -> tuple[int, int]:
    """Return the work of relaxing the initial state, in bits followed: what is followed, and what arrays take the time of."""
    needs, starts = _with_always(task)
    known = np.append(_flags(task.initial, task.size), True)
    goal = np.append(_flags(task.goal, task.size), False)
    sizes = np.diff(task.needs.starts) + np.diff(task.adds.starts)
    layers, ready, before = 0, np.zeros(len(sizes), bool), -1
    if not len(sizes):
        return 1, CALLS
    while not known[goal].all() and known.sum() != before:
        before = known.sum()
        layers += 1
        ready = np.logical_and.reduceat(known[needs], starts)
        known[task.adds.items[np.repeat(ready, np.diff(task.adds.starts))]] = True
    followed = 1 + int(sizes[ready].sum())
    at_once = (layers + 2) * (int(sizes.sum()) // AT_ONCE + CALLS)
    return followed, at_once


def heuristic(task: Task) -> Evaluate:
    """Return h_FF of a task, as a function of a state."""
    size, operators, owners = task.size, len(task), task.owners
    needs, starts = _with_always(task)
    step = np.where(np.array(owners) < 0, 0, 1).astype(np.int32)
    setters = np.repeat(np.arange(len(owners)), np.diff(task.adds.starts))
    by_bit = np.argsort(task.adds.items, kind="stable")
    setters, bits = setters[by_bit], task.adds.items[by_bit]
    settable, first = np.unique(bits, return_index=True)
    ends = np.append(first, len(bits)).tolist()
    range_of = {bit: (ends[i], ends[i + 1]) for i, bit in enumerate(settable.tolist())}
    lists = task.needs.lists()
    goal = np.flatnonzero(_flags(task.goal, size))
    wanted = goal.tolist()
    unreached = np.full(size + 1, NEVER, np.int32)
    unreached[size] = 0  # always true
    needed_costs, setting_costs = np.empty(len(needs), np.int32), np.empty(len(setters), np.int32)

    def evaluate(state: int) -> Evaluation:
        costs = unreached.copy()
        costs[:size][_flags(state, size)] = 0
        applicable: list[int] | None = None
        while True:
            np.take(costs, needs, out=needed_costs, mode="clip")
            spent = np.add.reduceat(needed_costs, starts)
            if applicable is None:
                applicable = np.flatnonzero(spent[:operators] == 0).tolist()
            spent += step
            np.take(spent, setters, out=setting_costs, mode="clip")
            old = costs[settable]
            new = np.minimum(np.minimum.reduceat(setting_costs, first), old)
            if (new == old).all():
                break
            costs[settable] = new
        if (costs[goal] >= NEVER).any():
            return None
        cost = costs.tolist()
        chosen: dict[int, int] = {}  # operator: least cost of an effect that is wanted of it
        waiting, seen = wanted[:], set(wanted)
        while waiting:
            bit = waiting.pop()
            if not cost[bit]:
                continue
            low, high = range_of[bit]
            there = setters[low:high]
            o = int(there[spent[there].argmin()])
            owner = owners[o]
            if owner >= 0:
                chosen[owner] = min(cost[bit], chosen.get(owner, NEVER))
            for need in lists[o]:
                if need not in seen:
                    seen.add(need)
                    waiting.append(need)
        return len(chosen), sorted(chosen, key=lambda o: (chosen[o], o)), applicable

    return evaluate


def _flags(state: int, size: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    packed = np.frombuffer(state.to_bytes((size + 7) // 8, "little"), np.uint8)
    return np.unpackbits(packed, count=size, bitorder="little").view(bool)


def _with_always(task: Task) -> tuple[Ints, Ints]:
    """Return what each relaxed operator needs, at least the bit behind all others, which is always true; and where each begins."""
    grouped: Grouped = task.needs
    counts = np.diff(grouped.starts)
    items = np.insert(grouped.items, grouped.starts[:-1][counts == 0], task.size)
    ends = np.cumsum(np.maximum(counts, 1))
    return items, ends - np.maximum(counts, 1)
