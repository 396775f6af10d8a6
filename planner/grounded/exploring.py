"""The search loop: the search reaches states one after another until the goal holds.

A search order selects the next candidate. The orders use h_FF (`confab.planner.grounded.greedy`), novelty
(`confab.planner.grounded.novelty`), or cost with a lower bound (`confab.planner.grounded.shortest`). A candidate is a successor of
a reached state. The loop accepts a candidate if its state is new, or if the cost of reaching the state has become smaller. An open
list consists of queues that take turns; the entries of a queue are ordered by rank.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Generic, Protocol, TypeAlias, TypeVar

from confab.planner.grounded.task import Task
from confab.reasoner.limits import check

MOST_BYTES, STATE_BYTES = 800 * 2**20, 400
"""Maximum memory for the states of one search, in bytes, and memory of a state without its bits, in bytes."""
Entry = TypeVar("Entry")


Candidate: TypeAlias = "tuple[int, tuple[int, ...], int, float]"
"""A reached state, the operators that lead from it to a candidate state, the candidate state, and the cost of its path."""


class SearchOrder(Protocol):
    """Interface of a search order.

    `work` is the work of the search order in its own unit (in most orders, the bits processed by relaxed plans); the turn of a
    search order ends when `work` reaches `turn`. `reached` maps each state to the last accepted candidate. `bytes` is the memory of
    the search order without the states in `reached`. `best` is the final state of the best plan. `best` is None if no plan was
    found.
    """

    reached: dict[int, Candidate]
    work: int
    turn: int
    bytes: int
    best: int | None

    def candidates(self) -> Iterator[Candidate]:
        """Yield candidates until no candidate remains or a sufficiently good plan is found."""

    def put(self, candidate: Candidate) -> None:
        """Rank a newly reached state; discard the state if the goal is unreachable from the state."""


def explore(task: Task, order: SearchOrder) -> Iterator[int]:
    """Explore states until the search order has no more candidates; after each turn of the order, yield the work of the turn.

    Raises
    ------
    MemoryError
        The states need more memory than `MOST_BYTES`.
    """
    reached, each = order.reached, STATE_BYTES + task.size // 4
    first = task.initial, (), task.initial, 0.0
    reached[task.initial] = first
    order.put(first)
    for candidate in order.candidates():
        if order.work >= order.turn:
            check("searching")
            yield order.work
            order.work = 0
            if len(reached) * each + order.bytes > MOST_BYTES:
                raise MemoryError
        _, _, state, cost = candidate
        known = reached.get(state)
        if known is None or cost < known[3]:
            reached[state] = candidate
            order.put(candidate)


def path_to(reached: dict[int, Candidate], state: int) -> list[int]:
    """Return the operators on the path from the initial state to a reached state."""
    parts: list[tuple[int, ...]] = []
    while True:
        before, operators, _, _ = reached[state]
        if not operators:
            break
        parts.append(operators)
        state = before
    return [operator for part in reversed(parts) for operator in part]


class OpenList(Generic[Entry]):
    """Entries in queues that take turns.

    The first entry of a queue is the entry with the least rank; among entries with equal ranks, the oldest entry is first.
    """

    def __init__(self, queues: int = 1) -> None:
        self.queues: list[list[tuple[object, int, Entry]]] = [[] for _ in range(queues)]
        self.turns = [0] * queues
        self.number = 0

    def push(self, rank: object, entry: Entry, queue: int = 0) -> None:
        """Add an entry with a rank to a queue."""
        self.number += 1
        heapq.heappush(self.queues[queue], (rank, self.number, entry))

    def draw(self) -> tuple[int, Entry] | None:
        """Return the number of the queue that is next in turn, and the queue's first entry, or None if all queues are empty."""
        which = -1
        for number, queue in enumerate(self.queues):
            if queue and (which < 0 or self.turns[number] <= self.turns[which]):
                which = number
        if which < 0:
            return None
        self.turns[which] += 1
        return which, self.queues[which][0][2]

    def drop(self, queue: int) -> None:
        """Remove the first entry of a queue."""
        heapq.heappop(self.queues[queue])
