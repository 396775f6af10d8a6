"""The order by novelty: states first that have a fact that no earlier state at the same distance from the goal had.

open:       goals that don't hold, and landmarks that haven't been reached
distance:   a pair: the number of open goals and landmarks, and the number of facts of the last relaxed plan that have been reached;
            a relaxed plan is made after a goal or landmark has been reached
novel:      a state is novel if it has a fact that no earlier state of the same distance had: one "and" of two integers
open list:  states by novelty, then by the number of open goals and landmarks; among equal states the newest comes first

Since relaxed plans are made only for expanded states that reach an open goal or landmark, the order ranks a hundred thousand
states a second. No state is dropped: if the open list is exhausted, there is no plan.

Lipovetzky and Geffner, "Best-first width search: exploration and exploitation in classical planning", AAAI 2017, with novelty
restricted to width one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from confab.planner.grounded.exploring import Candidate, OpenList
from confab.planner.grounded.hff import Evaluate
from confab.planner.grounded.task import Task
from confab.planner.plan import Counts

CHILD, VISIT = 20, 2
"""Number of bits that h_FF processes in the time that making a successor takes, and that visiting a tree node takes."""


class Progress(NamedTuple):
    """The progress of a state: number of open goals and landmarks, landmarks ahead, facts of the relaxed plan, and reached facts.

    `wanted`, the facts of the relaxed plan, is -1 until the plan is made.
    """

    state: int
    open: int
    unmet: int
    wanted: int
    met: int


class Novelty:
    """The search order by novelty for a task. `marks` are landmarks; a relaxed plan costs `relaxing` bits; `counts` is updated."""

    def __init__(self, task: Task, evaluate: Evaluate, relaxing: int, marks: int, counts: Counts) -> None:
        self.task, self.evaluate, self.counts = task, evaluate, counts
        self.reached: dict[int, Candidate] = {}
        self.work, self.turn, self.bytes = 0, relaxing, 0
        self.open = OpenList[Progress]()
        self.best: int | None = None
        above = -1 << task.size if task.amounts else 0  # bits above the facts, for amounts
        self.known: defaultdict[tuple[int, int], int] = defaultdict(lambda: above)  # reached facts, by distance
        self.begin = Progress(task.initial, task.size + 1, marks & ~task.goal, 0, 0)

    def candidates(self) -> Iterator[Candidate]:
        """Yield the successors of the most novel states."""
        task, plain = self.task, dict[int, "tuple[int, int] | None"]()
        child = CHILD + task.size // 50 + task.derived.effort
        while (drawn := self.open.first()) is not None:
            self.open.drop(0)
            place = self.relaxed(drawn[1])
            if place is None:
                continue
            self.begin, state = place, place.state
            operators, visited = task.applicable(state)
            self.work += child * len(operators) + VISIT * visited
            self.counts.generated += len(operators)
            for operator in operators:
                if operator not in plain:
                    plain[operator] = _plain(task, operator)
                change = plain[operator]
                after = state & change[0] | change[1] if change else task.applied(state, operator)
                if after is not None:
                    yield Candidate(state, (operator,), after, 0.0)
                    if self.best is not None:
                        return

    def put(self, candidate: Candidate) -> None:
        """Rank a state by its novel facts."""
        state, begin = candidate.state, self.begin
        missing, unmet = self.task.goal & ~state, begin.unmet & ~state
        if not missing:
            self.best = state
            return
        open_ = missing.bit_count() + unmet.bit_count()
        place = Progress(state, open_, unmet, -1, 0)
        if open_ >= begin.open:
            place = Progress(state, open_, unmet, begin.wanted, begin.met | state & begin.wanted)
        distance = open_, place.met.bit_count()
        old = self.known[distance]
        self.known[distance] = old | state
        self.open.push((not state & ~old, open_, -len(self.reached)), place)

    def relaxed(self, place: Progress) -> Progress | None:
        """Return the progress of a state with the facts of its relaxed plan; None if the goal is unreachable."""
        if place.wanted >= 0:
            return place
        evaluation = self.evaluate(place.state)
        self.counts.evaluated += 1
        self.work += self.turn
        if evaluation is None:
            return None
        wanted = 0
        for operator in evaluation.plan:
            for _, _, set_ in self.task.changes_of(operator)[1]:
                wanted |= set_
        return place._replace(wanted=wanted & ~place.state)


def _plain(task: Task, operator: int) -> tuple[int, int] | None:
    """Return the bits that an operator keeps, and the bits that it sets; None if these depend on the state."""
    changes = task.changes_of(operator)[1]
    if task.barred or (task.amounts is not None and task.amounts.made(operator)):
        return None
    if task.derived.parts or len(changes) != 1 or changes[0][0]:
        return (-1, 0) if not changes else None
    _, cleared, set_ = changes[0]
    return ~cleared, set_
