"""The one search loop: states are reached one after the other, in an order, until the goal holds.

order       which candidate comes next: by h_FF (`confab.planner.grounded.greedy`), by novelty (`confab.planner.grounded.novelty`),
            by cost and a bound (`confab.planner.grounded.shortest`)
candidate   a state that operators lead to from one that was reached; it is taken unless it was reached as cheaply before
open list   queues of entries, of each the least rank first; they take turns, and one may be given turns in advance
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

from confab.planner.grounded.task import Task
from confab.reasoner.limits import check

MOST_BYTES, STATE_BYTES = 800 * 2**20, 400
"""Maximum bytes of the states kept by one search, approximately, and bytes of a state besides its bits."""
Entry = TypeVar("Entry")


class Candidate(NamedTuple):
    """A state, the operators that lead to it from a reached state, and the cost of its path from the initial state."""

    before: int
    operators: tuple[int, ...]
    state: int
    cost: float


class Order(Protocol):
    """What is tried next. `work` grows by what that takes, in bits followed by relaxed plans; a turn is over with `turn` of it.

    `reached` holds for each state the candidate by which it was reached last, `bytes` is what is kept besides these states; `best`
    is the state in which a plan ends, if one was found.
    """

    reached: dict[int, Candidate]
    work: int
    turn: int
    bytes: int
    best: int | None

    def candidates(self) -> Iterator[Candidate]:
        """Yield candidates until there are none left, or a good enough plan was found."""

    def put(self, candidate: Candidate) -> None:
        """Rank a state that was just reached; discard it if the goal is out of its reach."""


def explore(task: Task, order: Order) -> Iterator[int]:
    """Reach states until the order has no more candidates; yield the work of each turn.

    Raises
    ------
    MemoryError
        There are more states than may be kept.
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
        """Return the queue whose turn it is, and its first entry; None if all are empty."""
        filled = [which for which, queue in enumerate(self.queues) if queue]
        if not filled:
            return None
        which = min(filled, key=lambda which: (self.turns[which], -which))
        self.turns[which] += 1
        return which, self.queues[which][0][2]

    def drop(self, queue: int) -> None:
        """Take the first entry out of a queue."""
        heapq.heappop(self.queues[queue])
