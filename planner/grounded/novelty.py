"""The search order by novelty: states with a new fact come first.

An open goal is a goal that doesn't hold. A landmark is open if the path to the state hasn't reached the landmark. The progress
of a state is a pair of numbers: the number of open goals and landmarks, and the number of reached facts of the last relaxed
plan. A new relaxed plan is computed after a goal or landmark is reached. A state is novel if it has a fact that no earlier
state with the same progress had. The test for novelty is one operation on two integers. The open list is sorted by novelty,
then by the number of open goals and landmarks. Among states of the same rank, the newest state comes first.

Relaxed plans are computed only for expanded states that reach an open goal or landmark. Therefore the order ranks a hundred
thousand states per second. The order drops only states from which the goal is unreachable. If the open list is empty, there is
no plan.

The method is best-first width search with novelty of width one (Lipovetzky and Geffner, "Best-first width search: exploration
and exploitation in classical planning", AAAI 2017).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.exploring import Candidate, OpenList
from confab.planner.grounded.hff import Evaluate
from confab.planner.grounded.task import Task
from confab.planner.plan import Counts

CHILD, VISIT = 20, 2
"""Time to make a successor, and time to visit a node of the successor tree; the unit is the time in which h_FF processes one bit.
"""


class Node(NamedTuple):
    """A node of the search: a state with its progress.

    `open` is the number of open goals and landmarks, and `unmet` is the mask of open landmarks. `wanted` is the mask of the
    relaxed plan's facts; -1 if the relaxed plan isn't computed. `met` is the mask of the reached facts of the relaxed plan.
    """

    state: int
    open: int
    unmet: int
    wanted: int
    met: int


class Novelty:
    """The search order by novelty for a task.

    `marks` is the mask of the landmarks. `relaxing` is the work of a relaxed plan in bits. The search order adds its effort to
    `counts`.
    """

    def __init__(self, task: Task, evaluate: Evaluate, relaxing: int, marks: int, counts: Counts) -> None:
        self.task, self.evaluate, self.relaxing, self.counts = task, evaluate, relaxing, counts
        self.reached: dict[int, Candidate] = {}
        self.work, self.turn, self.bytes = 0, relaxing, 0
        self.open = OpenList[Node]()
        self.best: int | None = None
        above = -1 << task.size if task.amounts else 0  # bits above the facts, for amounts
        self.seen: defaultdict[tuple[int, int], int] = defaultdict(lambda: above)  # reached facts, by progress
        self.parent = Node(task.initial, task.size + 1, marks & ~task.goal, 0, 0)

    def candidates(self) -> Iterator[Candidate]:
        """Yield the successors of the most novel states."""
        task, plain = self.task, dict[int, "tuple[int, int] | None"]()
        child = CHILD + task.size // 50 + task.derived.effort
        while (drawn := self.open.draw()) is not None:
            self.open.drop(0)
            node = self.relaxed(drawn[1])
            if node is None:
                continue
            self.parent, state = node, node.state
            operators, visited = task.applicable(state)
            self.work += child * len(operators) + VISIT * visited
            self.counts.generated += len(operators)
            for operator in operators:
                if operator not in plain:
                    plain[operator] = _plain(task, operator)
                change = plain[operator]
                after = state & change[0] | change[1] if change else task.applied(state, operator)
                if after is not None:
                    yield state, (operator,), after, 0.0
                    if self.best is not None:
                        return

    def put(self, candidate: Candidate) -> None:
        """Rank a newly reached state by its novel facts."""
        state, parent = candidate[2], self.parent
        missing, unmet = self.task.goal & ~state, parent.unmet & ~state
        if not missing:
            self.best = state
            return
        open_ = missing.bit_count() + unmet.bit_count()
        wanted, met = (-1, 0) if open_ < parent.open else (parent.wanted, parent.met | state & parent.wanted)
        progress = open_, met.bit_count()
        old = self.seen[progress]
        self.seen[progress] = old | state
        self.open.push((not state & ~old, open_, -len(self.reached)), Node(state, open_, unmet, wanted, met))

    def relaxed(self, node: Node) -> Node | None:
        """Return a node with the facts of a relaxed plan, or None if the goal is unreachable."""
        if node.wanted >= 0:
            return node
        evaluation = self.evaluate(node.state)
        self.counts.evaluated += 1
        self.work += self.relaxing
        if evaluation is None:
            return None
        wanted = union(map(self.task.set_by, evaluation.plan))
        return node._replace(wanted=wanted & ~node.state)


def _plain(task: Task, operator: int) -> tuple[int, int] | None:
    """Return the bits that an operator keeps, and the bits that the operator sets, or None if the bits depend on the state."""
    changes = task.changes_of(operator)[1]
    if task.barred or (task.amounts is not None and task.amounts.made(operator)):
        return None
    if task.derived.parts or len(changes) != 1 or changes[0][0]:
        return (-1, 0) if not changes else None
    _, cleared, set_ = changes[0]
    return ~cleared, set_
