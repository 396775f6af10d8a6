"""The search order by the heuristic h_FF, with preferred operators and lookahead.

The next candidates are successors of the state with the least h. The open list has two queues of states: one queue with all
applicable operators, and one queue with the preferred operators. A preferred operator is applicable and occurs in the relaxed
plan. A new least h gives extra turns to the preferred operators and starts a lookahead.

The search evaluates each reached state at once, but generates its successors one at a time. The preferred operators and the extra
turns are described by Richter and Helmert, "Preferred operators and deferred evaluation in satisficing planning", ICAPS 2009.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence

from confab.planner.grounded.exploring import Candidate, OpenList
from confab.planner.grounded.hff import Evaluate
from confab.planner.grounded.task import Task
from confab.planner.plan import Counts

BOOST = 1000
"""Number of extra turns for the queue of preferred operators after a new least h."""
ALL, PREFERRED = 0, 1

Lookahead = Callable[[int, Sequence[int]], "tuple[int, list[int]]"]
"""Function of a state and its relaxed plan that returns a later state and the operators on the path to this state."""


class Greedy:
    """The search order by h_FF for a task.

    `relaxing` is the work that counts for a state from which the goal is unreachable. The search order adds its effort to `counts`.
    """

    def __init__(self, task: Task, evaluate: Evaluate, lookahead: Lookahead, relaxing: int, counts: Counts) -> None:
        self.task, self.evaluate, self.lookahead, self.relaxing, self.counts = (
            task,
            evaluate,
            lookahead,
            relaxing,
            counts,
        )
        self.reached: dict[int, Candidate] = {}
        self.work, self.turn, self.bytes = 0, 1, 0
        self.open = OpenList[tuple[int, Iterator[int]]](2)
        self.least: int | None = None
        self.jump: Candidate | None = None
        self.best: int | None = None

    def candidates(self) -> Iterator[Candidate]:
        """Yield states reached by lookaheads, and states reached by one operator from the state with the least h."""
        while self.best is None:
            if self.jump is not None:
                candidate, self.jump = self.jump, None
                yield candidate
                continue
            drawn = self.open.draw()
            if drawn is None:
                return
            queue, (state, operators) = drawn
            operator = next(operators, None)
            if operator is None:
                self.open.drop(queue)
                continue
            self.counts.generated += 1
            after = self.task.applied(state, operator)
            if after is not None:
                yield state, (operator,), after, 0.0

    def put(self, candidate: Candidate) -> None:
        """Evaluate a newly reached state; put the state into the open list if the relaxed goal is reachable."""
        state = candidate[2]
        if state & self.task.goal == self.task.goal:
            self.best = state
            return
        self.counts.evaluated += 1
        evaluation = self.evaluate(state)
        if evaluation is None:
            self.work += self.relaxing
            return
        self.counts.expanded += 1
        self.work += evaluation.work
        ranked, preferred = evaluation.ranked()
        operators = array("q", ranked)
        self.bytes += operators.itemsize * len(operators)
        self.open.push(evaluation.h, (state, iter(operators)), ALL)
        if preferred:
            self.open.push(evaluation.h, (state, iter(operators[:preferred])), PREFERRED)
        if self.least is None or evaluation.h < self.least:
            self.least = evaluation.h
            self.open.turns[PREFERRED] -= BOOST
            after, path = self.lookahead(state, evaluation.plan)
            if len(path) > 1:
                self.jump = state, tuple(path), after, 0.0
