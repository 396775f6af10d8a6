"""Tests for unsolvability and the search of the lowest level, which run after failed searches, the cheapest first.

All tests examine only the lowest level. A failed search of an upper level proves nothing, because the level below may have other
steps. The last test examines all states of the lowest level; it may find a cheapest plan instead. Finally, a search of the lowest
level as a whole takes turns with planning goal by goal. A successful test stops planning. `confab.planner.solve` requires a
certificate for each proof, and checks the certificate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.scope import BITS, LEAST
from confab.planner.hierarchical.search_budget import WIDER
from confab.planner.plan import OUT_OF_MEMORY, Plan, Reason, Status, UngroundableError, UnsolvableError
from confab.reasoner.limits import within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, State

if TYPE_CHECKING:
    from confab.planner.grounded.best_first import Search
    from confab.planner.grounded.reachability import Reached
    from confab.planner.grounded.task import Task

LOOKING = 1_800_000
"""Work that is always allowed for the examination of all states; the unit is one relaxed operator in one state."""
EASIER = 5
"""Factor by which the examination of a state is faster than its evaluation during planning, whose work is counted."""
FIRST_TESTS, AT_ONCE, PAIRS = 8_000, 20_000, 500_000
"""Maximum number of conditions that the search for a certificate tests.

The first limit holds before a search, the second for a single attempt, and the third after failed searches.
"""
TEST = 8
"""Work of testing one condition, in the unit of `Workspace.effort`."""
REPEATED, FINALLY = 4, 2
"""Factors by which the limit of tests must have grown before a certificate is searched again: during planning, and at its end."""
STATES_AT_FIRST = 1_000
"""The lowest level is examined when the searches have cost as much as examining this number of its states."""
TURNS = 4
"""The search of the lowest level as a whole has cost at most the effort of planning goal by goal, divided by this number."""
MOST_ROWS, MOST_CHANGES = 2_000_000, 10_000_000
"""Maximum number of rows of a join of relaxed reachability (about 200 MB), and maximum number of changes of a grounded level
(about 600 MB)."""


@dataclass
class Proofs:
    """Attempts to prove that a call's problem has no plan; the attempts so far cost about as much as the searches so far.

    If a proof isn't `wanted`, no attempt is made. `found` is called with a plan of the lowest level, and with whether no plan is
    cheaper; it returns whether this is a plan of the call's problem. Then there is no proof, and no further plan is searched.
    Without `found`, the lowest level isn't searched.
    """

    call: Call
    wanted: bool = True
    found: Callable[[Plan, bool], bool] | None = None
    _lowest: Task | Reason | None = None
    _tests: int = 1
    _states: float = 0
    _search: Search | None = None

    def __post_init__(self) -> None:
        """Begin with the lowest level and its own goals."""
        self._tasks = self.tasks()

    @property
    def too_large(self) -> Reason | None:
        """The reason why grounding of the lowest level failed, or None before such a failure."""
        return self._lowest if isinstance(self._lowest, Reason) else None

    def attempt(self) -> None:
        """Raise `UnsolvableError` if a certificate or the grounded lowest level proves that there is no plan."""
        self.certify()
        self.examine()

    def check(self) -> None:
        """Make those attempts that cost at most as much as the searches so far."""
        space, program = self.call.space, self.call.program
        if space.effort >= TEST * FIRST_TESTS:
            self.certify()
        if space.effort >= STATES_AT_FIRST * program.size(program.levels[-1]):
            self.examine()

    def certify(self, ahead: int = 0, growth: int = REPEATED) -> None:
        """Search for a certificate, and raise `UnsolvableError` if a certificate is found.

        The search is repeated each time that the effort has grown by the factor `growth`, up to a limit. `ahead` is the work of the
        next search.
        """
        space = self.call.space
        tests = max(FIRST_TESTS, min(max(space.effort, ahead) // TEST, PAIRS))
        if self._tests < tests >= min(growth * self._tests, PAIRS) and self._may_succeed():
            self._tests = tests
            if proof := impossible(self.call.problem, tests, space.deadline):
                raise proof

    def examine(self) -> None:
        """Raise `UnsolvableError` if delete relaxation or exhaustive search of the lowest level proves that there is no plan.

        The exhaustive search is repeated each time that the work of the searches suffices for twice as many states, until it finds
        a plan.
        """
        space = self.call.space
        if not self._may_succeed():
            return
        lowest = self.lowest()
        if isinstance(lowest, Reason):
            return
        states = max(LOOKING, EASIER * space.worked) // max(len(lowest.owners), LEAST)
        if states >= 2 * self._states:
            self._states = states
            if isinstance(result := exhausted(lowest, states, space.deadline), Reason):
                raise UnsolvableError(result)
            if result is not None:
                self._states = math.inf
                self.wanted = self.found is None or not self.found(result, True)
        self.search(BITS * space.effort // TURNS, space.effort // (LEAST * TURNS))

    def search(self, most_work: float, expansions: float = math.inf) -> Reason:
        """Search the lowest level as a whole until this has cost `most_work` or a number of expansions.

        Pass each plan to `found`. Raise `UnsolvableError` if there is a proof; otherwise return why the search ends.
        """
        from confab.planner.grounded.best_first import Search

        space = self.call.space
        while self.found is not None and self.wanted:
            if self._search is None:
                task = next(self._tasks, None)
                if task is None:
                    return self.too_large or Reason("each plan that was found leaves a changed symbol not at rest")
                self._search = Search(task, space.deadline, space.counts[task.level])
            flat, task = self._search.go_on(most_work, expansions), self._search.task
            if flat.status is Status.GAVE_UP and flat.reason is not None:
                return flat.reason
            if flat.status is Status.UNSOLVABLE and flat.reason is not None and task is self._lowest:
                raise UnsolvableError(flat.reason)
            self._search = None
            self.wanted = flat.status is not Status.SOLVED or not self.found(Plan(task.steps(flat.plan)), False)
        return Reason("a plan was found")

    def lowest(self) -> Task | Reason:
        """Return the grounded lowest level, or the reason why it can't be grounded."""
        if self._lowest is None:
            self._lowest = proved(self.call.problem, self.call.program.levels[-1], self.call.space.deadline)
        return self._lowest

    def tasks(self) -> Iterator[Task]:
        """Yield the grounded lowest level, and then the level with more goals: the rest values that don't hold initially."""
        from confab.planner.grounded.grounding import ground

        lowest, problem = self.lowest(), self.call.problem
        if isinstance(lowest, Reason):
            return
        yield lowest
        level = lowest.level
        rests = {symbol: problem.domain.situations[symbol.situation].rest for symbol in problem.initial}
        goal = problem.goal_on(level)
        more = {s: rest for s, rest in rests.items() if rest and s not in goal and problem.first_level(s) <= level}
        if more:
            with suppress(UngroundableError, MemoryError):
                task = ground(problem, level, goal={**goal, **more}, deadline=self.call.space.deadline)
                if not isinstance(task, Reason):
                    yield task

    def _may_succeed(self) -> bool:
        """Return whether a proof is wanted, and no advice promises a plan after little work."""
        advice, worked = self.call.advice, self.call.space.worked
        return self.wanted and not (advice is not None and advice.expects and worked < WIDER.work)


def impossible(problem: Problem, most: int = AT_ONCE, deadline: float | None = None) -> UnsolvableError | None:
    """Return an `UnsolvableError` with a certificate if at most `most` tests prove that there is no plan.

    Return None if the tests or the time until the deadline don't suffice.
    """
    if deadline is not None and perf_counter() >= deadline:
        return None
    from confab.planner.certificate_reasons import told
    from confab.planner.certifying import certify

    with within(None if deadline is None else max(0.0, deadline - perf_counter())):
        certificate = certify(problem, most)
        return None if certificate is None else UnsolvableError(told(problem, certificate), certificate)


# ---------------------------------------------------------------------------------------- on the lowest level, grounded


def closed(problem: Problem, level: int, deadline: float | None, initial: State | None = None) -> Reached:
    """Return the facts of a level that are reachable under delete relaxation from `initial`.

    By default, `initial` is the initial state of the problem.
    """
    from confab.planner.grounded import reachability

    reached = reachability.Reached(problem, level, problem.initial if initial is None else initial, MOST_ROWS, deadline)
    reached.close()
    return reached


def refusal(reached: Reached, most: int = MOST_CHANGES) -> Reason | None:
    """Return the reason why grounding a level would need too much memory, or None if the memory suffices.

    An effect leads to a separate change for each value of its symbol.
    """
    values = {}
    for name, situation in reached.situations.items():
        rows = len(reached.tables["situation", name])
        values[name] = 1 if situation.boolean else 1 + rows // max(len(reached.symbols[name]), 1)
    changes = sum(
        len(rows) * sum(values[effect.situation] for _, effect in schema.effects)
        for schema, rows in zip(reached.schemas, reached.rows, strict=True)
    )
    if changes <= most:
        return None
    return Reason(f"level {reached.level} can't be grounded: {changes} changes, more than the {most} allowed")


def proved(problem: Problem, level: int, deadline: float | None = None) -> Task | Reason:
    """Raise `UnsolvableError` if a goal is unreachable on a level under delete relaxation.

    Otherwise return the grounded level, or the reason why the level is too large to be grounded.
    """
    from confab.planner.grounded.grounding import ground

    try:
        reached = closed(problem, level, deadline)
        for symbol, value in sorted(problem.goal.items()):
            if not reached.possible(symbol, value):
                raise UnsolvableError(Reason(f"{Fact(symbol, value)} can't be reached"))
        too_large = refusal(reached)
        if too_large is not None:
            return too_large
        task = ground(problem, level, goal=problem.goal_on(level), deadline=deadline)
    except UngroundableError as error:
        return Reason(f"level {level} can't be grounded: {error}")
    except MemoryError:
        return OUT_OF_MEMORY
    if isinstance(task, Reason):
        raise UnsolvableError(task)
    return task


def exhausted(task: Task, most: int, deadline: float | None = None) -> Reason | Plan | None:
    """Search the states of a task in the order of their costs, at most `most` states.

    Return a cheapest plan, the reason why no reachable state satisfies the goal, or None if the states don't suffice to know.
    """
    from confab.planner.grounded.shortest import shortest

    found = shortest(task, most_expanded=most, deadline=deadline, most_reached=most)
    if found.plan is not None and found.bound >= task.cost_of(found.plan):
        return Plan(task.steps(found.plan))
    if found.bound < math.inf or found.plan is not None:
        return None
    count = len(found.states)
    return Reason(
        f"none of all {count} states of level {task.level} that can be reached fulfils the goal", states=count
    )
