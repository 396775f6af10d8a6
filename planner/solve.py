"""A planning call: a mode searches for a plan or a proof, and a checker validates the result.

=========  ==========================================================  ================================
mode       how it plans                                                module
=========  ==========================================================  ================================
guarded    goals in series; rules with a good record propose steps     `confab.planner.hierarchical.planner`
leading    goals in series; all rules propose steps                    `confab.planner.hierarchical.planner`
strict     goals in series; rules propose no steps                     `confab.planner.hierarchical.planner`
optimal    shortened until a lower bound is met, without memory         `confab.planner.hierarchical.bounds`
paper      A* with eq. (5) on each level                                `confab.planner.paper.hierarchy`
=========  ==========================================================  ================================

If there is a memory, `confab.planner.experience.advice` attaches its rules to the first three modes. A checker has accepted every
returned plan: `confab.planner.validation`, or `confab.planner.timed.validation` if steps overlap. The checker
`confab.planner.certificate_checks` has accepted the certificate of every unsolvable outcome. The checkers share no code with any
search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from confab.planner.certified import certified
from confab.planner.levels import levels_left
from confab.planner.plan import OUT_OF_MEMORY, Limits, Outcome, Reason, Status, UnsolvableError
from confab.planner.plan_costs import stated_cost
from confab.planner.timed.plan import schedule_of
from confab.planner.validation import validate
from confab.reasoner.limits import Deadline, OutOfTimeError, overtime, within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import GroundBehavior
from confab.reasoner.timing import by_events, judged_by_events, may_overlap_by_need, only_during

if TYPE_CHECKING:
    from confab.planner.experience.advice import Advisor
    from confab.reasoner.memory.links import Links

Mode: TypeAlias = Literal["guarded", "leading", "strict", "optimal", "paper"]
"""The keys of `MODES`."""
DEFAULT_MODE: Mode = "guarded"
IN_SEQUENCE = 0.75
"""Share of the time limit for plans whose steps are executed one after another if overlapping steps may reach more goals."""


class RejectedPlanError(Exception):
    """The plan checker rejects a plan that a search returned: an internal error that names the step and the mode."""


@dataclass(frozen=True)
class Request:
    """The request of one planning call.

    Attributes
    ----------
    problem : Problem
        A plan meets all goals; soft goals count as hard. `confab.planner.preferences.preferred` chooses among soft goals.
    mode : str
        A key of `MODES`.
    limits : Limits
    memory : Memory, optional
        The experience for the modes guarded, leading and strict.
    links : Links, optional
        The confabulation memory for the paper's mode.
    grounds : mapping of level to quantified behaviours, optional
        The quantified behaviours for the paper's mode; by default the arguments are computed from the problem's classes.
    leave_levels : bool
        Whether steps of a lower level may replace steps of a level that has no plan with refinements.
    first : Outcome, optional
        The outcome of an earlier request for the same problem; the modes guarded, leading and strict shorten its plan.
    """

    problem: Problem
    mode: str = DEFAULT_MODE
    limits: Limits = field(default_factory=Limits)
    memory: Advisor | None = None
    links: Links | None = None
    grounds: Mapping[int, tuple[GroundBehavior, ...]] | None = None
    leave_levels: bool = True
    first: Outcome | None = None


def solve(request: Request) -> Outcome:
    """Return the outcome of a planning call after a check of the plan or the certificate.

    Raises
    ------
    ValueError
        The mode doesn't exist, or the problem has no behaviours.
    RejectedPlanError
        The plan checker rejects the steps that a search found; this is an internal error.
    """
    if request.mode not in MODES:
        raise ValueError(f"unknown mode '{request.mode}'; wanted one of {', '.join(MODES)}")
    if not request.problem.domain.behaviors:
        raise ValueError("the problem has no behaviours, of which a plan could consist; import or write some")
    if request.problem.weights:
        request = replace(request, problem=replace(request.problem, weights={}))
    deadline, overlaps = Deadline.after(request.limits.seconds), may_overlap_by_need(request.problem)
    try:
        with within(deadline):
            outcome = _overlapping(request, deadline) if overlaps else MODES[request.mode](request)
    except MemoryError:
        return Outcome(Status.GAVE_UP, reason=OUT_OF_MEMORY)
    except OutOfTimeError as error:
        return Outcome(Status.GAVE_UP, reason=Reason(str(error)))
    if outcome.status is Status.GAVE_UP and (proof := _last_proof(request.problem, deadline, request.limits.finding)):
        outcome = replace(outcome, status=Status.UNSOLVABLE, reason=proof.reason, certificate=proof.certificate)
    if outcome.plan is None or schedule_of(outcome) is not None:
        with within(deadline):
            return certified(request.problem, outcome)
    try:
        with within(deadline), overtime():
            faults = validate(request.problem, outcome.plan)
    except OutOfTimeError as error:
        return unchecked(outcome, error)
    if faults:
        raise RejectedPlanError(
            f"mode {request.mode} returned steps that are no plan: {faults[0].text} (step {list(faults[0].path)}); "
            "this is a fault of the planner, not of the scene: please report it with the scene's files"
        )
    plan = outcome.plan
    outcome = replace(outcome, cost=stated_cost(request.problem, plan))
    first = request.problem.domain.levels[0]
    if all(step.level == first for step in plan.steps):
        return outcome  # no run of lower-level steps to report
    return replace(outcome, left=tuple(levels_left(request.problem, plan)))


def _overlapping(request: Request, deadline: Deadline) -> Outcome:
    """Return a plan whose steps are executed one after another, or a timed plan whose steps must overlap."""
    from confab.planner.timed.concurrent import plan
    from confab.planner.timed.validation import validate_in_sequence

    problem, first = request.problem, request.first
    by_event = judged_by_events(problem)
    if first is not None and schedule_of(first) is not None:
        return Outcome(Status.GAVE_UP, reason=Reason("a plan whose steps must overlap isn't changed"))
    outcome = Outcome(Status.GAVE_UP, reason=Reason("some steps need other steps meanwhile"))
    if not (by_event and only_during(problem)):
        seconds = None if deadline.left is None else IN_SEQUENCE * deadline.left
        outcome = MODES[request.mode](replace(request, limits=replace(request.limits, seconds=seconds)))
        if outcome.plan is not None:
            with overtime():
                faults = validate_in_sequence(problem, outcome.plan)
            if not faults:
                return replace(outcome, bound=None) if by_event else outcome  # overlapping steps may cost less
            reason = Reason(f"the steps of the found plan can't be executed one after another: {faults[0].text}")
            outcome = replace(outcome, status=Status.GAVE_UP, plan=None, reason=reason, left=(), forgone=(), cost=None)
    proof = _last_proof(problem, deadline)
    if proof is not None:
        return replace(outcome, status=Status.UNSOLVABLE, plan=None, reason=proof.reason, certificate=proof.certificate)
    found = plan(problem, Limits(seconds=deadline.left))[0]
    if found.plan is not None:
        return found
    said = " and ".join(one.reason.text for one in (outcome, found) if one.reason is not None)
    states = 0 if outcome.reason is None else outcome.reason.states
    return replace(outcome, plan=None, reason=Reason(said, states=states), bound=None)


def unchecked(outcome: Outcome, error: OutOfTimeError) -> Outcome:
    """Return the outcome "gave up" in place of an outcome whose plan couldn't be checked in time."""
    reason = Reason(f"a plan was found, but its check didn't end in time: {error}")
    return replace(outcome, status=Status.GAVE_UP, plan=None, reason=reason, left=(), forgone=(), cost=None)


def _with_experience(request: Request) -> Outcome:
    if request.memory is None:
        from confab.planner.hierarchical.planner import plan as plan_without_memory

        return plan_without_memory(
            request.problem, limits=request.limits, leave_levels=request.leave_levels, first=request.first
        )
    from confab.planner.experience.advice import plan

    return plan(
        request.problem,
        request.memory,
        request.mode,
        request.limits,
        leave_levels=request.leave_levels,
        first=request.first,
    )


def _optimal(request: Request) -> Outcome:
    from confab.planner.hierarchical.bounds import plan

    return plan(request.problem, limits=request.limits)


def _paper(request: Request) -> Outcome:
    from confab.planner.paper.hierarchy import plan

    return plan(
        request.problem,
        request.links,
        limits=request.limits,
        grounds=request.grounds,
        leave_levels=request.leave_levels,
        proof=_proof,
    )


def _last_proof(problem: Problem, deadline: Deadline, finding: float = 1.0) -> UnsolvableError | None:
    """Search briefly for a proof of unsolvability, unless the search ended because its share `finding` of the time had passed."""
    from confab.planner.hierarchical.planner import SEARCHING
    from confab.planner.hierarchical.unsolvability import AT_ONCE, impossible

    if deadline.left is not None and deadline.left < (1 - SEARCHING * finding) * deadline.seconds:
        return None
    events = by_events(problem)
    with suppress(OutOfTimeError):
        return None if events is None else impossible(events, AT_ONCE, deadline.at)
    return None


def _proof(problem: Problem, states: int, deadline: float | None) -> UnsolvableError | None:
    from confab.planner.hierarchical.lowest_level import exhausted, proved
    from confab.planner.hierarchical.unsolvability import AT_ONCE, PAIRS, impossible

    proof = impossible(problem, PAIRS if states else AT_ONCE, deadline)
    if proof is not None or not states:
        return proof
    with suppress(OutOfTimeError):  # no proof within the deadline
        try:
            task = proved(problem, problem.domain.levels[-1], deadline)
        except UnsolvableError as proof:
            return proof
        result = None if isinstance(task, Reason) else exhausted(task, states, deadline)
        return UnsolvableError(result) if isinstance(result, Reason) else None
    return None


MODES: Mapping[str, Callable[[Request], Outcome]] = {
    "guarded": _with_experience,
    "leading": _with_experience,
    "strict": _with_experience,
    "optimal": _optimal,
    "paper": _paper,
}
