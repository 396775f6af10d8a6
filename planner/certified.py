"""The outcome "unsolvable" needs a certificate that an independent checker accepts.

Without such a certificate, the outcome becomes "gave up".
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from confab.planner.plan import Outcome, Reason, Status, UngroundableError
from confab.reasoner.limits import OutOfTimeError, current
from confab.reasoner.problem import Problem
from confab.reasoner.timing import by_events

if TYPE_CHECKING:
    from confab.planner.certificates import Certificate

ADDED_UP = 200_000
"""Maximum number of rows of a join that calculates the missing part of an amount."""


def certified(problem: Problem, outcome: Outcome) -> Outcome:
    """Return an outcome that is "unsolvable" only with a certificate, given or found, that the checker accepts, else "gave up"."""
    if outcome.status is not Status.UNSOLVABLE:
        return outcome
    from confab.planner.certificate_checks import rejection
    from confab.planner.certificate_reasons import told
    from confab.planner.certifying import certify
    from confab.planner.possibilities import NoTimeLeftError, WorkLimitError

    why = ""
    examined = outcome.reason is not None and outcome.reason.states > 0
    events = by_events(problem)
    for given in (True, False):
        if events is None:
            why = "steps that overlap may reach more goals"
            break
        certificate = outcome.certificate if given else certify(events, few_states=examined)
        if certificate is None:
            continue
        try:
            refused = rejection(problem, certificate)
        except NoTimeLeftError:
            why = "too little time was left to check the certificate; raise the time limit (--time-limit, in Python time_limit)"
        except WorkLimitError as error:
            why = f"the certificate wasn't checked, since the check takes {error}"
        else:
            if refused is None:
                reason = _added_up(events, certificate) or told(events, certificate)
                return replace(outcome, certificate=certificate, reason=reason)
            why = f"the checker refuses the certificate: {refused}"
    searched = outcome.reason.text if outcome.reason else "the search found no plan"
    why = why or f"no certificate was found within the {'time' if current().left == 0 else 'work'} limit"
    reason = Reason(f"{searched}; this isn't certified: {why}", outcome.reason.terms if outcome.reason else ())
    return replace(outcome, status=Status.GAVE_UP, reason=reason, certificate=None)


def _added_up(problem: Problem, certificate: Certificate) -> Reason | None:
    """Return the missing amount as the reason; this reason is more specific than combinations of values."""
    if all(problem.domain.situations[symbol.situation].quantity is None for symbol in certificate.told_apart):
        return None
    from confab.planner.grounded.grounding import ground

    with suppress(UngroundableError, MemoryError, OutOfTimeError):
        task = ground(problem, most=ADDED_UP)
        return task if isinstance(task, Reason) and task.terms else None
    return None
