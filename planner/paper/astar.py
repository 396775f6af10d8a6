"""A* as intended by Algorithm 1 of the paper; the function f contains the cogency ranking score of equations (3) and (5).

`g` is the cost of the behaviours from the start to a node. `h` is the estimated cost from a node to the goal: the number of
situated object symbols that don't match the goal. `c` is the cogency term of the behaviour that led to a node, computed in the
state before the behaviour; it isn't accumulated. `f` is g + h + c; the node with the least f is expanded next, and among nodes
with equal f, the node that was generated first. `n` is the depth of a node.

Algorithm 1 as printed never puts the start into the open set, has no closed set, and overwrites parents without comparing g.
This implementation puts a state into the open set again only if the new g is smaller. The goal test compares only the symbols
of the goal, because the goal in Table I of the paper is partial.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from confab.planner.paper.transitions import Applied, Values
from confab.planner.plan import Counts, Limits, Status
from confab.reasoner.amounts import meets
from confab.reasoner.limits import OutOfTimeError

Goal = Mapping[int, str]
"""The goal of a search: the required values of symbols, by the position of the symbol in the state."""


@dataclass(frozen=True)
class SearchResult:
    """The result of a search; the path is empty unless the status is solved."""

    status: Status
    path: tuple[Applied, ...]
    ranks: tuple[float | None, ...]
    counts: Counts


def mismatches(values: Values, goal: Goal) -> int:
    """Return h: the number of symbols whose value differs from the goal (section IV-A of the paper)."""
    return sum(not meets(values[i], wanted) for i, wanted in goal.items())


def a_star(
    start: Values,
    goal: Goal,
    successors: Callable[[Values], Iterable[Applied]],
    cost: Callable[[Values, Applied], float],
    rank: Callable[[Values], Callable[[Applied], float]] | None = None,
    bonus: Callable[[float, int], float] = lambda c, n: 0.0,
    limits: Limits = Limits(),  # noqa: B008 - frozen
) -> SearchResult:
    """Search for a path from `start` to a state with the values of `goal`.

    Parameters
    ----------
    start : Values
    goal : Goal
    successors : function from a state to the behaviours applied in the state; raises `OutOfTimeError` to end the search
    cost : function from a state and a behaviour applied in the state to the behaviour's cost
    rank : function from a state to the ranking scores (eq. 4), in [0, 1], of the applied behaviours; without `rank`, c is 0
    bonus : function from ranking score and depth to the term c of eq. (3)
    limits : Limits

    Returns
    -------
    SearchResult
        The status unsolvable means that no state reachable by `successors` has the goal's values.
    """
    counts = Counts(generated=1, evaluated=1)
    g = {start: 0.0}
    depth = {start: 0}
    came_from: dict[Values, tuple[Values, Applied, float | None]] = {}
    open_set = [(float(mismatches(start, goal)), 0, start, 0.0)]  # f, order of generation, state, g
    while open_set:
        _, _, state, g_state = heapq.heappop(open_set)
        if g_state > g[state]:
            continue  # the search has found a cheaper path to the state
        if not mismatches(state, goal):
            return _reconstruct(came_from, state, counts)
        if counts.expanded >= limits.expansions:
            return SearchResult(Status.GAVE_UP, (), (), counts)
        counts.expanded += 1
        n = depth[state] + 1
        score = rank(state) if rank else None
        try:
            for applied in successors(state):
                counts.generated += 1
                next_state, next_g = applied.after, g_state + cost(state, applied)
                if next_g >= g.get(next_state, float("inf")):
                    continue
                counts.evaluated += 1
                c_m = score(applied) if score else None
                c = bonus(c_m, n) if c_m is not None else 0.0
                g[next_state], depth[next_state] = next_g, n
                came_from[next_state] = (state, applied, c_m)
                heapq.heappush(
                    open_set, (next_g + mismatches(next_state, goal) + c, counts.generated, next_state, next_g)
                )
        except OutOfTimeError:
            return SearchResult(Status.GAVE_UP, (), (), counts)
    return SearchResult(Status.UNSOLVABLE, (), (), counts)


def _reconstruct(
    came_from: Mapping[Values, tuple[Values, Applied, float | None]], state: Values, counts: Counts
) -> SearchResult:
    path, ranks = [], []
    while state in came_from:
        state, applied, c_m = came_from[state]
        path.append(applied)
        ranks.append(c_m)
    return SearchResult(Status.SOLVED, tuple(reversed(path)), tuple(reversed(ranks)), counts)
