"""Tests for unsolvability, which run after failed searches, the cheapest test first.

All tests examine only the lowest level. A failed search of an upper level proves nothing, because the level below may have other
steps. The last test examines all states of the lowest level; it may find a cheapest plan instead. A successful test stops planning.
`confab.planner.solve` requires a certificate for each proof, and checks the certificate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.scope import LEAST
from confab.planner.hierarchical.search_budget import WIDER
from confab.planner.plan import OUT_OF_MEMORY, Plan, Reason, UngroundableError, UnsolvableError
from confab.reasoner.limits import within
from confab.reasoner.symbols import Fact, Problem, State

if TYPE_CHECKING:
    from confab.planner.grounded.reachability import Reached
    from confab.planner.grounded.task import Task

LOOKING = 1_800_000
"""Work that is always allowed for the examination of all states; the unit is one relaxed operator in one state."""
EASIER = 5
"""Factor by which the examination of a state is faster than its evaluation during planning, whose work is counted."""
FIRST_TESTS, AT_ONCE, PAIRS = 8_000, 20_000, 500_000
"""Maximum number of conditions that the search for a certificate tests.

The first limit holds before a search, the second in the paper's mode, and the third after failed searches.
"""
TEST = 8
"""Work of testing one condition, in the unit of `Workspace.effort`."""
REPEATED, FINALLY = 4, 2
"""Factors by which the limit of tests must have grown before a certificate is searched again: during planning, and at its end."""
FEW = 1_000
"""The lowest level is examined when the searches have cost as much as examining this number of its states."""
MOST_ROWS, MOST_CHANGES = 2_000_000, 10_000_000
"""Maximum number of rows of a join of relaxed reachability (about 200 MB), and maximum number of changes of a grounded level
(about 600 MB)."""


def ignored(plan: Plan) -> None:
    """Ignore a plan."""


@dataclass
class Proofs:
    """Attempts to prove that a call's problem has no plan; the attempts so far cost about as much as the searches so far.

    If a proof isn't `wanted`, no attempt is made. `found` is called with the first plan that the examination of states finds; this
    is a cheapest plan of the lowest level.
    """

    call: Call
    wanted: bool = True
    found: Callable[[Plan], None] = ignored
    _lowest: Task | Reason | None = None
    _tests: int = 1
    _states: float = 0

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
        if space.effort >= FEW * program.size(program.levels[-1]):
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
        space, program = self.call.space, self.call.program
        if not self._may_succeed():
            return
        if self._lowest is None:
            self._lowest = proved(self.call.problem, program.levels[-1], space.deadline)
        if isinstance(self._lowest, Reason):
            return
        states = max(LOOKING, EASIER * space.worked) // max(len(self._lowest.owners), LEAST)
        if states >= 2 * self._states:
            self._states = states
            if isinstance(result := exhausted(self._lowest, states, space.deadline), Reason):
                raise UnsolvableError(result)
            if result is not None:
                self._states = math.inf
                self.found(result)

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

    found = shortest(task, most=most, deadline=deadline, known=most)
    if found.plan is not None and found.bound >= task.cost_of(found.plan):
        return Plan(task.steps(found.plan))
    if found.bound < math.inf or found.plan is not None:
        return None
    count = len(found.states)
    return Reason(
        f"none of all {count} states of level {task.level} that can be reached fulfils the goal", states=count
    )
