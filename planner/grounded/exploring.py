"""The search loop: states are reached one after another, in a given order, until the goal holds.

order:      selects the next candidate: by h_FF (`confab.planner.grounded.greedy`), by novelty (`confab.planner.grounded.novelty`),
            by cost and a bound (`confab.planner.grounded.shortest`)
candidate:  a successor of a reached state; it is accepted unless the state was reached before at no higher cost
open list:  queues of entries, each ordered by rank; the queues take turns, and a queue may get extra turns
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

from confab.planner.grounded.task import Task
from confab.reasoner.limits import check

MOST_BYTES, STATE_BYTES = 800 * 2**20, 400
"""Maximum size of the states kept by one search, in bytes, and size of a state besides its bits."""
Entry = TypeVar("Entry")


class Candidate(NamedTuple):
    """A state, the operators that lead to it from a reached state, and the cost of its path from the initial state."""

    before: int
    operators: tuple[int, ...]
    state: int
    cost: float


class SearchOrder(Protocol):
    """An order of search. `work` counts the bits processed by relaxed plans; a turn ends when `work` reaches `turn`.

    `reached` maps each state to the candidate that reached it last; `bytes` is the memory used besides these states; `best` is the
    final state of the best plan found, if any.
    """

    reached: dict[int, Candidate]
    work: int
    turn: int
    bytes: int
    best: int | None

    def candidates(self) -> Iterator[Candidate]:
        """Yield candidates until there are none left or a sufficiently good plan has been found."""

    def put(self, candidate: Candidate) -> None:
        """Rank a newly reached state; discard it if the goal is unreachable from it."""


def explore(task: Task, order: SearchOrder) -> Iterator[int]:
    """Explore states until the order has no more candidates; yield the work of each turn.

    Raises
    ------
    MemoryError
        The states need more than `MOST_BYTES`.
    """
    reached, each = order.reached, STATE_BYTES + task.size // 4
    first = Candidate(task.initial, (), task.initial, 0.0)
    reached[task.initial] = first
    order.put(first)
    for candidate in order.candidates():
        if order.work >= order.turn:
            check("searching")
            yield order.work
            order.work = 0
            if len(reached) * each + order.bytes > MOST_BYTES:
                raise MemoryError
        known = reached.get(candidate.state)
        if known is None or candidate.cost < known.cost:
            reached[candidate.state] = candidate
            order.put(candidate)


def path_to(reached: dict[int, Candidate], state: int) -> list[int]:
    """Return the operators that led to a state."""
    parts: list[tuple[int, ...]] = []
    while (candidate := reached[state]).operators:
        parts.append(candidate.operators)
        state = candidate.before
    return [operator for part in reversed(parts) for operator in part]


class OpenList(Generic[Entry]):
    """Entries in some queues that take turns; each queue yields the least rank first, and among equal ranks the oldest entry."""

    def __init__(self, queues: int = 1) -> None:
        self.queues: list[list[tuple[object, int, Entry]]] = [[] for _ in range(queues)]
        self.turns = [0] * queues
        self.number = 0

    def push(self, rank: object, entry: Entry, queue: int = 0) -> None:
        """Add an entry."""
        self.number += 1
        heapq.heappush(self.queues[queue], (rank, self.number, entry))

    def first(self) -> tuple[int, Entry] | None:
        """Return the queue whose turn it is, and its first entry; None if all queues are empty."""
        filled = [which for which, queue in enumerate(self.queues) if queue]
        if not filled:
            return None
        which = min(filled, key=lambda which: (self.turns[which], -which))
        self.turns[which] += 1
        return which, self.queues[which][0][2]

    def drop(self, queue: int) -> None:
        """Remove the first entry of a queue."""
        heapq.heappop(self.queues[queue])
