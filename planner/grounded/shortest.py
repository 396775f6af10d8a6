"""Shortest plans of a grounded task: A* over the bits of its states, with whatever lower bound it is given.

g        cost of the operators from the start to a state
h        a lower bound on the cost from a state to the goal, infinite where there is no way: `nothing`, which makes this a
         breadth-first search, `ways` of the single goals, or LM-cut (`planner.hierarchical.bounds`)
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

from planner.grounded.task import Task, bits_of
from planner.plan import Counts

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
    of_symbol: dict[object, int] = {}
    for bit, fact in enumerate(task.facts):
        of_symbol[fact.symbol] = of_symbol.get(fact.symbol, 0) | 1 << bit
    wanted = [(mask, mask & task.goal) for mask in of_symbol.values() if mask & task.goal and mask.bit_count() > 1]
    wanted.sort(key=lambda pair: -pair[0].bit_count())
    which = {bit: i for i, (mask, _) in enumerate(wanted) for bit in bits_of(mask)}
    cheapest: list[dict[tuple[int, int], float]] = [
        {} for _ in wanted
    ]  # (value before, or 0 for any; value after): cost
    for operator in range(len(task)):
        needed, changes = task.known(operator)
        touched = {(which[bit], 1 << bit) for _, _, set_ in changes for bit in bits_of(set_) if bit in which}
        counted = min((i for i, _ in touched), default=0)
        for i, after in touched:
            step = needed & wanted[i][0], after
            cost = task.costs[operator] if i == counted else 0.0
            cheapest[i][step] = min(cost, cheapest[i].get(step, math.inf))
    tables: list[tuple[int, dict[int, float]]] = []
    for (mask, value), steps in zip(wanted, cheapest, strict=True):
        away = {value: 0.0}
        for _ in range(mask.bit_count()):
            old = dict(away)
            for (before, after), cost in steps.items():
                least = away.get(after, math.inf) + cost
                for source in (before,) if before else (1 << bit for bit in bits_of(mask)):
                    if least < away.get(source, math.inf):
                        away[source] = least
            if old == away:
                break
        tables.append((mask, away))

    def bound(state: int) -> float:
        total = 0.0
        for mask, away in tables:
            total += away.get(state & mask, math.inf)
        return total

    return bound
