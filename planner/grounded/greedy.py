"""The order by h_FF: successors of the state with the least h first, with preferred operators and lookahead.

open list:  two queues of states by h, with operators that haven't been tried: one with all applicable operators, one with the
            preferred operators, which are in the relaxed plan
least:      when a state has a smaller h than all states before, preferred operators get extra turns and a lookahead starts

A state is evaluated when it is reached, and its operators are applied one at a time: Richter and Helmert, "Preferred operators
and deferred evaluation in satisficing planning", ICAPS 2009.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence

from confab.planner.grounded.exploring import Candidate, OpenList
from confab.planner.grounded.hff import Evaluate
from confab.planner.grounded.task import Task
from confab.planner.plan import Counts

BOOST = 1000
"""Number of extra turns for the preferred operators after a new least h."""
ALL, PREFERRED = 0, 1

Lookahead = Callable[[int, Sequence[int]], "tuple[int, list[int]]"]
"""Maps a state and its relaxed plan to a later state, with the operators that lead to the later state."""


class Greedy:
    """The search order by h_FF for a task; `counts` is updated."""

    def __init__(self, task: Task, evaluate: Evaluate, lookahead: Lookahead, counts: Counts) -> None:
        self.task, self.evaluate, self.lookahead, self.counts = task, evaluate, lookahead, counts
        self.reached: dict[int, Candidate] = {}
        self.work, self.turn, self.bytes = 0, 1, 0
        self.open = OpenList[tuple[int, Iterator[int]]](2)
        self.least: int | None = None
        self.ahead: Candidate | None = None
        self.best: int | None = None

    def candidates(self) -> Iterator[Candidate]:
        """Yield states reached by lookaheads, and states reached by one operator from the state with the least h."""
        while self.best is None:
            if self.ahead is not None:
                candidate, self.ahead = self.ahead, None
                yield candidate
                continue
            drawn = self.open.first()
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
                yield Candidate(state, (operator,), after, 0.0)

    def put(self, candidate: Candidate) -> None:
        """Evaluate a state; if the goal is reachable from it, its operators become candidates."""
        state = candidate.state
        if state & self.task.goal == self.task.goal:
            self.best = state
            return
        self.counts.evaluated += 1
        evaluation = self.evaluate(state)
        if evaluation is None:
            self.work += self.turn
            return
        self.counts.expanded += 1
        self.work += evaluation.work
        possible = set(evaluation.applicable)
        preferred = [operator for operator in dict.fromkeys(evaluation.plan) if operator in possible]
        operators = array("q", (*preferred, *sorted(possible.difference(preferred))))
        self.bytes += operators.itemsize * len(operators)
        self.open.push(evaluation.h, (state, iter(operators)), ALL)
        if preferred:
            self.open.push(evaluation.h, (state, iter(operators[: len(preferred)])), PREFERRED)
        if self.least is None or evaluation.h < self.least:
            self.least = evaluation.h
            self.open.turns[PREFERRED] -= BOOST
            after, path = self.lookahead(state, evaluation.plan)
            if len(path) > 1:
                self.ahead = Candidate(state, tuple(path), after, 0.0)
