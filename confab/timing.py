"""Functions that test whether a plan needs a schedule, and that return schedules as text and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Literal, TypeAlias

from confab.formats import ScheduledStepJson, ScheduleJson
from confab.planner.plan import Outcome, Status
from confab.planner.timed.plan import schedule_of
from confab.reasoner.limits import Deadline
from confab.reasoner.problem import Problem
from confab.reasoner.timing import judged_by_events, only_during

if TYPE_CHECKING:
    from confab.planner.timed.plan import Slot, TimedPlan

Minimise: TypeAlias = Literal["makespan", "cost", "steps"]
"""The quantity that planning minimises."""
MINIMISE: tuple[Minimise, ...] = ("makespan", "cost", "steps")
WIDTH = 72
"""Length of a lane in characters; a lane represents the whole makespan."""
MOST_CRITICAL = 12
"""Maximum number of listed steps of the critical path."""


def with_unit_costs(problem: Problem) -> Problem:
    """Return a copy of a problem in which every step costs 1."""
    domain = problem.domain
    behaviors = {name: replace(one, cost=1.0, price=None) for name, one in domain.behaviors.items()}
    return replace(problem, domain=replace(domain, behaviors=behaviors))


def asks_for_times(problem: Problem, minimise: str | None) -> bool:
    """Return whether a plan needs a schedule: its makespan is minimised, or the task has deadlines, time windows or events."""
    times = problem.times
    return minimise == "makespan" or (times is not None and bool(times.deadlines or times.windows or times.events))


def has_times(problem: Problem) -> bool:
    """Return whether a behaviour has a duration, or the task has deadlines, time windows or events."""
    durations = any(behavior.timing is not None for behavior in problem.domain.behaviors.values())
    return durations or asks_for_times(problem, None)


def scheduled(
    problem: Problem, outcome: Outcome, deadline: Deadline, shorten: bool
) -> tuple[Outcome, TimedPlan | None]:
    """Schedule the plan of an outcome; the cost and the levels left are those of the scheduled plan, which may have other steps.

    A plan whose steps must overlap already has a schedule. If no schedule meets the deadlines and windows of the task, the
    outcome's status becomes "gave up".
    """
    if outcome.plan is None or schedule_of(outcome) is not None:
        return outcome, schedule_of(outcome)
    from confab.planner.levels import levels_left
    from confab.planner.plan_costs import cost_of
    from confab.planner.timed.call import best_in_time

    timed = best_in_time(problem, outcome.plan, deadline.left, shorten)
    if timed.plan is None:
        return replace(outcome, status=Status.GAVE_UP, plan=None, reason=timed.reason, left=(), cost=None), None
    plan = timed.plan.plan
    cost = None if outcome.cost is None else cost_of(problem, plan)
    return replace(outcome, plan=plan, cost=cost, left=tuple(levels_left(problem, plan))), timed.plan


def needs_others_meanwhile(problem: Problem) -> bool:
    """Return whether steps may overlap, and some need a value that another step gives only during its execution."""
    return judged_by_events(problem) and bool(only_during(problem))


# --------------------------------------------------------------------------------------------------------------- forms


def said(seconds: Fraction) -> str:
    """Return a time in seconds as text, rounded to milliseconds.

    >>> said(Fraction(5, 2)), said(Fraction(1, 3))
    ('2.5', '0.333')
    """
    return f"{round(float(seconds), 3):g}"


def headline(timed: TimedPlan) -> str:
    """Return the makespan and its lower bound in one line."""
    these, others = f"schedules of {timed.bounds} take at least {said(timed.bound)} s", "other steps may take less"
    if timed.bound == timed.makespan:
        these = f"no schedule of {timed.bounds} is shorter"
    if timed.least:
        others = f"any plan takes at least {said(timed.least)} s"
    bounds = "no plan is shorter" if timed.least == timed.makespan else f"{these}, but {others}"
    return f"makespan {said(timed.makespan)} s, {said(timed.serial)} s one step after the other; {bounds}; by {timed.scheduler}"


def lanes(timed: TimedPlan) -> Iterator[str]:
    """Yield lines of text that show when each actor is busy on the critical path (█), busy with slack (▒), and idle (·)."""
    yield headline(timed)
    end = timed.makespan
    if not end:
        return
    rows = list(timed.lanes())
    wide = max(len(name or "no actor") for name, _ in rows)
    for name, slots in rows:
        cells = ["·"] * WIDTH
        for slot in slots:
            first = int(slot.begin * WIDTH / end)
            last = max(first + 1, int(-(-slot.end * WIDTH // end)))
            for i in range(first, min(last, WIDTH)):
                cells[i] = "█" if slot.critical or cells[i] == "█" else "▒"
        busy = sum((slot.end - slot.begin for slot in slots), Fraction(0))
        yield f"{name or 'no actor':<{wide}} |{''.join(cells)}| {len(slots)} steps, {said(busy)} s"
    critical = sorted((slot for slot in timed.slots if slot.critical and slot.end > slot.begin), key=_in_order)
    if critical:
        yield "critical:"
        yield from (f"  {said(slot.begin):>8} – {said(slot.end):<8} {slot.step}" for slot in critical[:MOST_CRITICAL])
        if len(critical) > MOST_CRITICAL:
            yield f"  … and {len(critical) - MOST_CRITICAL} more"


def _in_order(slot: Slot) -> tuple[Fraction, Fraction, tuple[int, ...]]:
    return slot.begin, slot.end, slot.step.path


def schedule_json(timed: TimedPlan) -> ScheduleJson:
    """Return a scheduled plan as JSON data, with times in seconds (docs/command-line.md)."""
    intervals = timed.intervals
    of = {slot.step.path: slot for slot in timed.slots}
    steps: list[ScheduledStepJson] = []
    for step in timed.plan.walk():
        begin, end = intervals[step.path]
        one: ScheduledStepJson = {"path": list(step.path), "begin": float(begin), "end": float(end)}
        if (slot := of.get(step.path)) is not None:
            one["actors"], one["slack"] = list(slot.actors), float(slot.slack)
        steps.append(one)
    return {
        "makespan": float(timed.makespan),
        "serial": float(timed.serial),
        "bound": float(timed.bound),
        "bounds": timed.bounds,
        "bound_of_any_plan": float(timed.least),
        "scheduler": timed.scheduler,
        "steps": steps,
    }
