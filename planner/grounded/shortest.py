"""Cheapest plans of a grounded task: A* with a given estimate of the remaining cost.

g:       cost of the operators from the start to a state
h:       estimated cost from a state to the goal, infinite if the goal is unreachable. If h is a lower bound, the plan is a cheapest
         one. Lower bounds are `nothing` (breadth-first search), `ways` (each goal alone) and LM-cut
         (`confab.planner.hierarchical.bounds`).
f:       g + weight · h; the state with the least f is expanded next. With weight 1, no plan is cheaper than the least open f.
upper:   the cost that a plan must stay below; states with g + cut · h at or above it are dropped
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from confab.planner.grounded.exploring import Candidate, OpenList, explore, path_to
from confab.planner.grounded.task import Task, bits_of
from confab.planner.plan import Counts

Bound: TypeAlias = "Callable[[int], float]"


@dataclass(frozen=True)
class Shortest:
    """The result of a search: no plan is cheaper than `bound`, which is infinite if there is no plan.

    `plan` has the operators of the cheapest plan found; `states` has the states that were reached.
    """

    bound: float
    plan: tuple[int, ...] | None
    states: Mapping[int, object]


def nothing(state: int) -> float:
    """Return the trivial lower bound, 0."""
    return 0.0


class Cheapest:
    """The search order of A* by a bound on the remaining cost; `lower` is the proved lower bound, `counts` is updated."""

    def __init__(
        self, task: Task, bound: Bound, upper: float, counts: Counts, weight: int = 1, cut: float = 1.0
    ) -> None:
        self.task, self.bound, self.upper, self.weight, self.cut, self.counts = task, bound, upper, weight, cut, counts
        self.reached: dict[int, Candidate] = {}
        self.work, self.turn, self.bytes, self.lower = 0, 1, 0, 0.0
        self.open = OpenList[tuple[float, Candidate]]()
        self.best: int | None = None

    def candidates(self) -> Iterator[Candidate]:
        """Yield the successors of the states with the least f, until no cheaper plan is possible."""
        task, costs, priced = self.task, self.task.costs, bool(self.task.prices)
        while (drawn := self.open.first()) is not None:
            self.open.drop(0)
            h, (_, _, state, cost) = drawn[1]
            if cost > self.reached[state].cost or cost + self.cut * h >= self.upper:
                continue  # the state was reached more cheaply since, or a plan of at most this cost was found
            self.lower = max(self.lower, cost + self.weight * h)
            self.work += 1
            self.counts.expanded += 1
            for operator in task.applicable(state)[0]:
                after = task.applied(state, operator)
                if after is not None:
                    self.counts.generated += 1
                    spent = task.spent(state, operator) if priced else costs[operator]
                    yield Candidate(state, (operator,), after, cost + spent)

    def put(self, candidate: Candidate) -> None:
        """Rank a state by f, or drop it if no plan through it is cheaper than `upper`; a goal state lowers `upper`."""
        cost = candidate.cost
        h = self.bound(candidate.state)
        if cost + self.cut * h >= self.upper:
            return
        if candidate.state & self.task.goal == self.task.goal:
            self.upper, self.best = cost, candidate.state
        else:
            self.open.push((cost + self.weight * h, h), (h, candidate))


def shortest(
    task: Task,
    bound: Bound = nothing,
    upper: float = math.inf,
    most: int = 1_000_000,
    deadline: float | None = None,
    counts: Counts | None = None,
    known: float = math.inf,
    weight: int = 1,
    cut: float = 1.0,
) -> Shortest:
    """Return a cheapest plan among the plans cheaper than `upper`; at a limit, a lower bound and the cheapest plan found so far.

    Parameters
    ----------
    task : Task
    bound : function of a state
    upper : float
    most : int
        Maximum number of expansions.
    deadline : float, optional
        On the clock of `time.perf_counter`.
    counts : Counts, optional
        The numbers of generated and expanded states are added.
    known : float
        Maximum number of states reached.
    weight : int
        Weight of h in f. With a weight above 1, a plan is found sooner but may cost more, and the returned bound is meaningless.
    cut : float
        Weight of h when states are dropped; below 1 if h may be too large.
    """
    order = Cheapest(task, bound, upper, counts or Counts(), weight, cut)
    expanded, lower = 0, None
    for work in explore(task, order):
        expanded += work
        if expanded > most or len(order.reached) > known or (deadline is not None and perf_counter() > deadline):
            lower = order.lower
            break
    plan = None if order.best is None else tuple(path_to(order.reached, order.best))
    return Shortest(order.upper if lower is None else lower, plan, order.reached)


def ways(task: Task) -> Bound:
    """Return a lower bound on the cost of a plan: the sum over the goals of the least cost of achieving the goal alone.

    Each operator counts for one symbol only, so no plan is cheaper. A goal on a symbol with a single bit adds 0.
    """
    of_symbol: dict[object, list[int]] = {}
    for bit, fact in enumerate(task.facts):
        of_symbol.setdefault(fact.symbol, []).append(bit)
    wanted = [(bits, at) for bits in of_symbol.values() if len(bits) > 1 for at in bits if task.goal >> at & 1]
    wanted.sort(key=lambda pair: -len(pair[0]))
    symbol = np.full(task.size, -1)  # for each bit, the position of its symbol in `wanted`
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
        anyhow = np.full(len(wanted) + 1, np.inf)  # from any value; the last entry is for bits of other symbols
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
    """Return three arrays with an entry for each bit that an operator sets.

    They are the operator, the bit of the same symbol that the operator requires (-1: none), and the bit that the operator sets.
    """
    owner = np.array(task.owners, np.int64)
    setter = owner[np.repeat(np.arange(len(owner)), np.diff(task.adds.starts))]
    here = (setter >= 0) & (symbol[task.adds.items] >= 0)
    setter, after = setter[here], task.adds.items[here]
    starts = task.needs.starts[: len(task) + 1]
    needed = task.needs.items[: starts[-1]]
    operator = np.repeat(np.arange(len(task)), np.diff(starts))
    here = symbol[needed] >= 0
    symbols = int(symbol.max(initial=0)) + 1
    keys, needed = operator[here] * symbols + symbol[needed[here]], needed[here]
    order = np.argsort(keys, kind="stable")
    keys, needed = keys[order], needed[order]
    asked = setter * symbols + symbol[after]
    place = np.minimum(np.searchsorted(keys, asked), max(len(keys) - 1, 0))
    before = np.where(keys[place] == asked, needed[place], -1) if len(keys) else np.full(len(asked), -1)
    return setter, before, after
