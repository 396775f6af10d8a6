"""Cheapest plans of a grounded task, found by A* with a given estimate of the remaining cost.

`g` is the cost of the operators from the start to a state. `h` is the estimated cost from a state to the goal; it is infinite
if the goal is unreachable. `f` is g + weight · h; the state with the least f is expanded next. `upper` is an upper bound on the
cost of a plan; states with g + cut · h at or above this bound are dropped.

If h is a lower bound and the weight is 1, the search finds a cheapest plan, and no plan is cheaper than the least f of the open
states. The lower bounds are `nothing` (breadth-first search), `each_goal_alone` and LM-cut
(`confab.planner.hierarchical.bounds`).
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

Estimate: TypeAlias = "Callable[[int], float]"
"""Function of a state that returns an estimate of the remaining cost; if it is a lower bound, A* finds cheapest plans."""


@dataclass(frozen=True)
class Shortest:
    """The result of a search for a cheapest plan.

    `bound` is a lower bound on the cost of a plan. `plan` contains the operators of the cheapest plan found. `plan` is None if no
    plan was found. `states` contains the reached states.
    """

    bound: float
    plan: tuple[int, ...] | None
    states: Mapping[int, object]


def nothing(state: int) -> float:
    """Return the trivial lower bound 0."""
    return 0.0


class AStar:
    """The search order of A* by a bound on the remaining cost.

    `lower` is the proved lower bound on the cost of a plan. The search order adds its effort to `counts`.
    """

    def __init__(
        self, task: Task, bound: Estimate, upper: float, counts: Counts, weight: int = 1, cut: float = 1.0
    ) -> None:
        self.task, self.bound, self.upper, self.weight, self.cut, self.counts = task, bound, upper, weight, cut, counts
        self.reached: dict[int, Candidate] = {}
        self.work, self.turn, self.bytes, self.lower = 0, 1, 0, 0.0
        self.open = OpenList[tuple[float, Candidate]]()
        self.best: int | None = None

    def candidates(self) -> Iterator[Candidate]:
        """Yield the successors of the states with the least f, until no cheaper plan is possible."""
        task, costs, priced = self.task, self.task.costs, bool(self.task.prices)
        while (drawn := self.open.draw()) is not None:
            self.open.drop(0)
            h, (_, _, state, cost) = drawn[1]
            if cost > self.reached[state][3] or cost + self.cut * h >= self.upper:
                continue  # a cheaper path to the state or a cheap enough plan was found
            self.lower = max(self.lower, cost + self.weight * h)
            self.work += 1
            self.counts.expanded += 1
            for operator in task.applicable(state)[0]:
                after = task.applied(state, operator)
                if after is not None:
                    self.counts.generated += 1
                    spent = task.spent(state, operator) if priced else costs[operator]
                    yield state, (operator,), after, cost + spent

    def put(self, candidate: Candidate) -> None:
        """Rank a state by f; drop the state if its estimated total cost reaches `upper`; at a goal state, decrease `upper`."""
        _, _, state, cost = candidate
        h = self.bound(state)
        if cost + self.cut * h >= self.upper:
            return
        if state & self.task.goal == self.task.goal:
            self.upper, self.best = cost, state
        else:
            self.open.push((cost + self.weight * h, h), (h, candidate))


def shortest(
    task: Task,
    bound: Estimate = nothing,
    upper: float = math.inf,
    most_expanded: int = 1_000_000,
    deadline: float | None = None,
    counts: Counts | None = None,
    most_reached: float = math.inf,
    weight: int = 1,
    cut: float = 1.0,
) -> Shortest:
    """Search for a cheapest plan among the plans cheaper than `upper`.

    At a limit, return a lower bound and the cheapest plan found so far.

    Parameters
    ----------
    task : Task
    bound : function of a state
    upper : float
    most_expanded : int
        Maximum number of expansions.
    deadline : float, optional
        The deadline on the clock of `time.perf_counter`.
    counts : Counts, optional
        The counts to which the search adds the generated and the expanded states.
    most_reached : float
        Maximum number of states reached.
    weight : int
        Weight of h in f. With a weight above 1, the search is faster, but the plan may cost more and the bound is meaningless.
    cut : float
        Weight of h when states are dropped; below 1 if h may exceed the remaining cost.
    """
    order = AStar(task, bound, upper, counts or Counts(), weight, cut)
    expanded, lower = 0, None
    for work in explore(task, order):
        expanded += work
        if (
            expanded > most_expanded
            or len(order.reached) > most_reached
            or (deadline is not None and perf_counter() > deadline)
        ):
            lower = order.lower
            break
    plan = None if order.best is None else tuple(path_to(order.reached, order.best))
    return Shortest(order.upper if lower is None else lower, plan, order.reached)


def each_goal_alone(task: Task) -> Estimate:
    """Return a lower bound on the cost of a plan: the sum, over all goals, of the least cost of achieving the goal alone.

    Each operator counts for only one symbol. Therefore no plan is cheaper than the bound.
    """
    of_symbol: dict[object, list[int]] = {}
    for bit, fact in enumerate(task.facts):
        of_symbol.setdefault(fact.symbol, []).append(bit)
    wanted = [(bits, at) for bits in of_symbol.values() for at in bits if task.goal >> at & 1]
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
        anyhow = np.full(len(wanted) + 1, np.inf)  # least costs from any value; last: bits of other symbols
        np.minimum.at(anyhow, symbol[after[~stated]], total[~stated])
        np.minimum(least, anyhow[symbol], out=least)
        if np.array_equal(least, old):
            break
    tables = {at: (sum(1 << bit for bit in bits), {1 << bit: float(least[bit]) for bit in bits}) for bits, at in wanted}
    for number, (bits, at) in enumerate(wanted):
        if len(bits) == 1:  # the symbol has another value if the bit isn't set; a derived bit is set by no operator
            tables[at][1][0] = float(anyhow[number]) if np.isfinite(anyhow[number]) else 0.0
    goal = sum(1 << at for at in tables)

    def bound(state: int) -> float:
        total = 0.0
        for at in bits_of(goal & ~state):
            mask, away = tables[at]
            total += away.get(state & mask, math.inf)
        return total

    return bound


def least(task: Task) -> float | None:
    """Return the bound `each_goal_alone` on the cost of every plan, or None if it is 0 or all operators cost the same."""
    return (each_goal_alone(task)(task.initial) if len(set(task.costs)) > 1 else 0.0) or None


def _steps(task: Task, symbol: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return three arrays with an entry for each bit that an operator sets.

    The first array contains the operators. The second array contains the required bits of the same symbols, or -1. The third array
    contains the bits that the operators set.
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
