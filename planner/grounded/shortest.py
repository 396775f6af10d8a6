"""Shortest plans of a grounded task: A* over the bits of its states, with whatever lower bound it is given.

g        cost of the operators from the start to a state
h        a lower bound on the cost from a state to the goal, infinite where there is no way: `nothing`, which makes this a
         breadth-first search, `ways` of the single goals, or LM-cut (`confab.planner.hierarchical.bounds`)
f        g + h, the least of which is expanded next; no plan is cheaper than the least f that is open
upper    what a plan has to be cheaper than; what can't be is dropped
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from confab.planner.grounded.task import Task, bits_of
from confab.planner.plan import Counts

Bound: TypeAlias = "Callable[[int], float]"


@dataclass(frozen=True)
class Shortest:
    """What was found: no plan is cheaper than `bound` or, if that is infinite, there is none cheaper than `upper`.

    `plan` are the operators of a cheapest plan; `states` were reached, each at a cost.
    """

    bound: float
    plan: tuple[int, ...] | None
    states: Mapping[int, float]


def nothing(state: int) -> float:
    """Return the bound that knows nothing."""
    return 0.0


def shortest(
    task: Task,
    bound: Bound = nothing,
    upper: float = math.inf,
    most: int = 1_000_000,
    deadline: float | None = None,
    counts: Counts | None = None,
    known: float = math.inf,
) -> Shortest:
    """Return a cheapest plan cheaper than `upper`, or why none is returned.

    Parameters
    ----------
    task : Task
    bound : function of a state
    upper : float
    most : int
        Expansions after which only a bound is returned, as when the deadline (of `time.perf_counter`) has passed.
    deadline : float, optional
    counts : Counts, optional
        Grows by what is generated and expanded.
    known : float
        States reached after which only a bound is returned: all of them will have to be expanded, if there is no plan.
    """
    counts = counts or Counts()
    goal, costs, priced = task.goal, task.costs, bool(task.prices)
    g = {task.initial: 0.0}
    came_from: dict[int, tuple[int, int]] = {}
    estimate = bound(task.initial)
    queue = [(estimate, estimate, 0, task.initial)]  # f, h, order of generation, state
    lower, number, expanded = estimate, 0, 0
    while queue:
        f, h, _, state = heapq.heappop(queue)
        if f > g[state] + h:
            continue  # reached by a cheaper way since
        if f >= upper:
            break
        lower = max(lower, f)
        if state & goal == goal:
            steps = []
            while state in came_from:
                state, operator = came_from[state]
                steps.append(operator)
            return Shortest(f, tuple(steps[::-1]), g)
        if expanded >= most or len(g) > known or (deadline is not None and perf_counter() > deadline):
            return Shortest(lower, None, g)
        expanded += 1
        counts.expanded += 1
        so_far = g[state]
        for operator in task.applicable(state)[0]:
            after = task.applied(state, operator)
            if after is None:
                continue
            counts.generated += 1
            new = so_far + (task.spent(state, operator) if priced else costs[operator])
            if new < g.get(after, math.inf):
                g[after] = new
                came_from[after] = state, operator
                estimate = bound(after)
                if new + estimate < upper:
                    number += 1
                    heapq.heappush(queue, (new + estimate, estimate, number, after))
    return Shortest(upper, None, g)


def ways(task: Task) -> Bound:
    """Return what it costs to give every goal's symbol its value, each taken alone, in all.

    Every operator counts for one symbol only, so that no plan is cheaper. A goal that isn't a value among several counts
    for nothing.
    """
    of_symbol: dict[object, list[int]] = {}
    for bit, fact in enumerate(task.facts):
        of_symbol.setdefault(fact.symbol, []).append(bit)
    wanted = [(bits, at) for bits in of_symbol.values() if len(bits) > 1 for at in bits if task.goal >> at & 1]
    wanted.sort(key=lambda pair: -len(pair[0]))
    symbol = np.full(task.size, -1)  # of each bit, by its place among those wanted
    for number, (bits, _) in enumerate(wanted):
        symbol[bits] = number
    operator, before, after = _steps(task, symbol)
    counted = np.full(len(task), len(wanted))
    np.minimum.at(counted, operator, symbol[after])
    costs = np.where(counted[operator] == symbol[after], np.array(task.costs)[operator], 0.0)
    least = np.full(task.size, np.inf)
    least[[at for _, at in wanted]] = 0.0
    stated = before >= 0
    while True:
        total, old = least[after] + costs, least.copy()
        np.minimum.at(least, before[stated], total[stated])
        anyhow = np.full(len(wanted) + 1, np.inf)  # from whatever value; the last for bits of no symbol that is wanted
        np.minimum.at(anyhow, symbol[after[~stated]], total[~stated])
        np.minimum(least, anyhow[symbol], out=least)
        if np.array_equal(least, old):
            break
    tables = {at: (sum(1 << bit for bit in bits), {1 << bit: float(least[bit]) for bit in bits}) for bits, at in wanted}
    goal = sum(1 << at for at in tables)

    def bound(state: int) -> float:
        total = 0.0
        for at in bits_of(goal & ~state):
            mask, away = tables[at]
            total += away.get(state & mask, math.inf)
        return total

    return bound


def _steps(task: Task, symbol: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return who sets bits of symbols: the operator, the bit of that symbol that it needs (-1: none), and the one that it sets."""
    owner = np.array(task.owners, np.int64)
    setter = owner[np.repeat(np.arange(len(owner)), np.diff(task.adds.starts))]
    here = (setter >= 0) & (symbol[task.adds.items] >= 0)
    setter, after = setter[here], task.adds.items[here]
    starts = task.needs.starts[: len(task) + 1]
    needed = task.needs.items[: starts[-1]]
    who = np.repeat(np.arange(len(task)), np.diff(starts))
    here = symbol[needed] >= 0
    symbols = int(symbol.max(initial=0)) + 1
    keys, needed = who[here] * symbols + symbol[needed[here]], needed[here]
    order = np.argsort(keys, kind="stable")
    keys, needed = keys[order], needed[order]
    asked = setter * symbols + symbol[after]
    place = np.minimum(np.searchsorted(keys, asked), max(len(keys) - 1, 0))
    before = np.where(keys[place] == asked, needed[place], -1) if len(keys) else np.full(len(asked), -1)
    return setter, before, after
