"""Tests for unsolvability, which run after failed searches, the cheapest test first.

All tests examine only the lowest level. A failed search of an upper level proves nothing, because the level below may have other
steps. A successful test stops planning. `confab.planner.solve` requires a certificate for each proof, and checks the certificate.
"""

from __future__ import annotations

import math
from time import perf_counter
from typing import TYPE_CHECKING

from confab.planner.hierarchical.scope import LEAST
from confab.planner.hierarchical.workspace import Workspace
from confab.planner.plan import OUT_OF_MEMORY, Reason, UngroundableError, UnsolvableError
from confab.reasoner.limits import within
from confab.reasoner.symbols import Fact, Problem, State

if TYPE_CHECKING:
    from confab.planner.grounded.reachability import Reached
    from confab.planner.grounded.task import Task

LOOKING = 1_800_000
"""Work that is always allowed for the examination of all states; the unit is one relaxed operator in one state."""
FIRST_TESTS, AT_ONCE, PAIRS = 8_000, 20_000, 500_000
"""Maximum number of conditions that the search for a certificate tests.

The first limit holds before a search, the second in the paper's mode, and the third after failed searches.
"""
TEST = 8
"""Work of testing one condition, in the unit of `Workspace.effort`."""
MOST_ROWS, MOST_CHANGES = 2_000_000, 10_000_000
"""Maximum number of rows of a join of relaxed reachability (about 200 MB), and maximum number of changes of a grounded level
(about 600 MB)."""


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
        task = ground(problem, level, deadline=deadline)
    except UngroundableError as error:
        return Reason(f"level {level} can't be grounded: {error}")
    except MemoryError:
        return OUT_OF_MEMORY
    if isinstance(task, Reason):
        raise UnsolvableError(task)
    return task


def looked_at(task: Task, space: Workspace, before: int) -> int:
    """Raise `UnsolvableError` if no reachable state satisfies the goal; return the number of examined states.

    The work is limited to the work of the searches so far. If this work doesn't suffice for twice `before` states, the function
    examines no states and returns `before`.
    """
    state = max(len(task.owners), LEAST)
    most = max(LOOKING, space.worked) // state
    if most < 2 * before:
        return before
    if reason := exhausted(task, most, space.deadline):
        raise UnsolvableError(reason)
    return most


def exhausted(task: Task, most: int, deadline: float | None = None) -> Reason | None:
    """Return the reason why no reachable state satisfies the goal, or None if `most` states don't suffice for a proof."""
    from confab.planner.grounded.shortest import shortest

    found = shortest(task, most=most, deadline=deadline, known=most)
    if found.plan is not None or found.bound < math.inf:
        return None
    count = len(found.states)
    return Reason(
        f"none of all {count} states of level {task.level} that can be reached fulfils the goal", states=count
    )
