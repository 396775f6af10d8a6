"""Tests for unsolvability, which run after failed searches, the cheapest first.

All tests examine only the lowest level. A failed search of an upper level proves nothing, because the level below may have other
steps. The last test examines all states of the lowest level; it may find a cheapest plan instead. Then the search of the lowest
level as a whole has its turn. A successful test stops planning. `confab.planner.solve` requires a certificate for each proof, and
checks the certificate.
"""

from __future__ import annotations

import math
from time import perf_counter

from confab.planner.hierarchical.lowest_level import LOOKING, TURNS, LowestLevel, exhausted
from confab.planner.hierarchical.scope import BITS, LEAST
from confab.planner.hierarchical.search_budget import WIDER
from confab.planner.plan import Reason, UnsolvableError
from confab.reasoner.limits import within
from confab.reasoner.problem import Problem

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


class Proofs:
    """Attempts to prove that a call's problem has no plan; the attempts so far cost about as much as the searches so far.

    If a proof isn't `wanted`, or a plan of the lowest level was found, no attempt is made.
    """

    def __init__(self, lowest: LowestLevel, wanted: bool = True) -> None:
        self.lowest, self.call, self.wanted = lowest, lowest.call, wanted
        self._tests, self._states = 1, 0.0

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
        task = self.lowest.task()
        if isinstance(task, Reason):
            return
        states = max(LOOKING, EASIER * space.worked) // max(len(task.owners), LEAST)
        if states >= 2 * self._states:
            self._states = states
            if isinstance(result := exhausted(task, states, space.deadline), Reason):
                raise UnsolvableError(result)
            if result is not None:
                self._states = math.inf
                self.lowest.offer(result, True)
        self.lowest.search(BITS * space.effort // TURNS, space.effort // (LEAST * TURNS))

    def _may_succeed(self) -> bool:
        """Return whether a proof is wanted, and no advice promises a plan after little work."""
        advice, worked = self.call.advice, self.call.space.worked
        return (
            self.wanted
            and self.lowest.plan is None
            and not (advice is not None and advice.expects and worked < WIDER.work)
        )


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
