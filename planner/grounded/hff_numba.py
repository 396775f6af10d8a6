"""`planner.grounded.hff.heuristic` compiled by numba: the same function of a state, several times as fast once it is compiled.

numba comes with the extra ``fast``. Compiling takes seconds, so that a search begins with the plain function and changes
over after a stated amount of work (`automatic`). The two are tested equal: which one is used changes no plan.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np

from planner.grounded import hff as relaxed
from planner.grounded.hff import Evaluate, Evaluation
from planner.grounded.task import Grouped, Task

PLAIN = 4_000_000
"""Operators looked at by the plain heuristic, about two seconds, before it is compiled."""


def automatic(task: Task) -> Evaluate:
    """Return h_FF of a task, compiled by numba once the search turns out to be long, if numba is installed."""
    use, work = relaxed.heuristic(task), 0

    def evaluate(state: int) -> Evaluation:
        nonlocal use, work
        work += cost
        if work > PLAIN >= work - cost:
            with suppress(ImportError):
                use = heuristic(task)
        return use(state)

    cost = len(task.owners)
    return evaluate


def heuristic(task: Task) -> Evaluate:
    """Return h_FF of a task, as a function of a state; raises `ImportError` without numba."""
    relax = _compiled()
    operators, size = len(task), task.size
    owners = np.array(task.owners, np.int64)
    needs, adds = task.needs, task.adds
    missing = np.diff(needs.starts)
    order = np.argsort(needs.items, kind="stable")
    rows = np.repeat(np.arange(len(missing)), missing)[order]
    needed_by = Grouped(np.searchsorted(needs.items[order], np.arange(size + 1)), rows)
    always = np.flatnonzero(missing == 0)
    goal = np.array([bit for bit in range(size) if task.goal >> bit & 1], np.int64)
    step = np.where(owners < 0, 0, 1)
    number_of_bytes = (size + 7) // 8
    arrays = (needs.starts, needs.items, adds.starts, adds.items, needed_by.starts, needed_by.items)

    def evaluate(state: int) -> Evaluation:
        packed = np.frombuffer(state.to_bytes(number_of_bytes, "little"), np.uint8)
        bits = np.flatnonzero(np.unpackbits(packed, bitorder="little"))
        found, layers, applicable, solved = relax(bits, missing, step, owners, always, goal, operators, size, *arrays)
        if not solved:
            return None
        chosen = sorted(zip(layers.tolist(), found.tolist(), strict=True))
        return len(chosen), [o for _, o in chosen], np.sort(applicable).tolist()

    return evaluate


@cache
def _compiled() -> Callable[..., Any]:
    """Compile the kernel; numba is imported here, since that alone takes a third of a second."""
    from numba import njit

    compiled: Callable[..., Any] = njit(cache=True)(_relax)
    return compiled


def _relax(  # type: ignore[no-untyped-def]
    bits,
    missing,
    step,
    owners,
    always,
    goal,
    operators,
    size,
    need_at,
    need,
    add_at,
    add,
    by_at,
    by,
):
    """Return the relaxed plan's operators with their layers, the applicable operators, and whether the goal is reached."""
    left = missing.copy()
    cost, layer_of, supporter = np.full(size, -1), np.full(size, -1), np.full(size, -1)
    layer, after = np.empty(size, np.int64), np.empty(size, np.int64)
    reached = np.empty(len(missing), np.int64)
    count = len(bits)
    layer[:count] = bits
    cost[bits] = 0
    layer_of[bits] = 0
    number = len(always)
    reached[:number] = always
    applicable = reached[:0].copy()
    depth = 0
    while True:
        for i in range(count):
            for j in range(by_at[layer[i]], by_at[layer[i] + 1]):
                o = by[j]
                left[o] -= 1
                if left[o] == 0:
                    reached[number] = o
                    number += 1
        if depth == 0:
            applicable = reached[:number][reached[:number] < operators].copy()
        depth += 1
        count = 0
        for i in range(number):
            o = reached[i]
            total = step[o]
            for j in range(need_at[o], need_at[o + 1]):
                total += cost[need[j]]
            for j in range(add_at[o], add_at[o + 1]):
                bit = add[j]
                if cost[bit] < 0:
                    cost[bit], supporter[bit], layer_of[bit] = total, o, depth
                    after[count] = bit
                    count += 1
                elif total < cost[bit]:
                    cost[bit], supporter[bit] = total, o
        layer, after = after, layer
        number = 0
        solved = True
        for bit in goal:
            if cost[bit] < 0:
                solved = False
                break
        if solved or count == 0:
            break
    when = np.full(operators, -1)
    chosen = np.empty(operators, np.int64)
    taken = 0
    if solved:
        seen = np.zeros(size, np.bool_)
        top = 0
        for bit in goal:
            if not seen[bit]:
                seen[bit] = True
                layer[top] = bit
                top += 1
        while top:
            top -= 1
            bit = layer[top]
            o = supporter[bit]
            if o < 0:
                continue
            owner = owners[o]
            if owner >= 0:
                if when[owner] < 0:
                    chosen[taken] = owner
                    taken += 1
                    when[owner] = layer_of[bit]
                elif layer_of[bit] < when[owner]:
                    when[owner] = layer_of[bit]
            for j in range(need_at[o], need_at[o + 1]):
                if not seen[need[j]]:
                    seen[need[j]] = True
                    layer[top] = need[j]
                    top += 1
    return chosen[:taken], when[chosen[:taken]], applicable, solved
