"""The steps that remain in an episode as a temporal network, and the deadlines that can't be kept (docs/levels.md, "In time")."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from confab.planner.acting.schedule import WorkerSlot
from confab.planner.plan import Plan, Reason, Step, renumbered
from confab.planner.timed.call import Timed, best_in_time, in_time
from confab.planner.timed.dispatch import Dispatch
from confab.planner.timed.plan import TimedPlan
from confab.planner.validation import fitting
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol, Times


@dataclass(frozen=True)
class Concurrency:
    """How several actors execute primitives at once.

    Attributes
    ----------
    schedule : TimedPlan, optional
        The schedule of the first plan; otherwise the first plan is scheduled, too.
    spread : Fraction
        The greatest relative deviation of a duration from the expected duration.
    """

    schedule: TimedPlan | None = None
    spread: Fraction = Fraction(0)


@dataclass(frozen=True)
class Remaining:
    """The dispatch of the remaining primitives.

    Attributes
    ----------
    dispatch : Dispatch
        The dispatch; its clock begins with 0.
    paths : tuple of path
        The path of each primitive of the dispatch in the tree of steps.
    steps : tuple of Step
        The remaining steps, with the external events that happen meanwhile.
    given_up : tuple of Symbol
        The goals whose deadlines can't be kept.
    """

    dispatch: Dispatch
    paths: tuple[tuple[int, ...], ...]
    steps: tuple[Step, ...]
    given_up: tuple[Symbol, ...] = ()


def later(times: Times, seconds: Fraction) -> Times:
    """Return the times of a task in seconds from a later moment; events and windows that are over are left out."""
    return replace(
        times,
        deadlines={goal: by - seconds for goal, by in times.deadlines.items()},
        windows={one: tuple(_open(its, seconds)) for one, its in times.windows.items()},
        events={name: at - seconds for name, at in times.events.items() if at >= seconds},
        since=times.since + seconds,
    )


def _open(
    windows: Iterable[tuple[Fraction, Fraction | None]], seconds: Fraction
) -> Iterator[tuple[Fraction, Fraction | None]]:
    for low, high in windows:
        if high is None or high > seconds:
            yield max(low - seconds, Fraction(0)), None if high is None else high - seconds


def remaining(
    problem: Problem,
    steps: tuple[Step, ...],
    seconds: Fraction,
    together: Concurrency,
    free: int,
    happened: Container[str],
    seconds_for_others: float | None,
) -> Remaining | Reason:
    """Return the dispatch of steps that are applicable one after another, or the reason why they have no schedule.

    If no schedule of the steps keeps all windows and deadlines, other steps for the same goals are sought that have one, for
    example steps with other actors. Only if none are found, deadlines are given up.

    Parameters
    ----------
    problem : Problem
        The task; its initial state is the present situation.
    steps : tuple of Step
    seconds : Fraction
        The time since the beginning of the plan.
    together : Concurrency
        The schedule is used if it is a schedule of the primitives.
    free : int
        The number of the first external event that happens meanwhile and isn't one of the steps.
    happened : container of str
        The behaviours of executed primitives.
    seconds_for_others : float, optional
        Time limit of the search for other steps, on the clock of the computer; 0 if some of the steps have begun.
    """
    primitives, every = Plan(steps).primitives, problem.times or Times()
    times = later(every, seconds)
    times = replace(times, events={name: at for name, at in times.events.items() if name not in happened})
    for step in primitives:
        if step.behavior in every.events.keys() - times.events.keys():
            return Reason(f"{step}: it happens only once, at {float(every.events[step.behavior]):g} s")
    flat = Plan(renumbered(_with_right_id(problem, step) for step in primitives))
    found, given_up = Timed(together.schedule), tuple[Symbol, ...]()
    if together.schedule is None or [*map(_kind, together.schedule.plan.primitives)] != [*map(_kind, primitives)]:
        asked = replace(problem, times=times)
        found = _in_time(asked, flat)
        if found.plan is None and seconds_for_others != 0:
            others = best_in_time(asked, Plan(steps), seconds_for_others, shorten=False).plan
            if others is not None:
                found, steps = Timed(others), renumbered(others.plan.steps, free)
        if found.plan is None:
            found, given_up = _without_deadlines(asked, flat, found)
    if found.plan is None:
        return found.reason or Reason("the remaining steps have no schedule")
    scheduled = found.plan.plan.primitives
    steps = _with_events(steps, scheduled, free)
    kept = replace(times, deadlines={goal: by for goal, by in times.deadlines.items() if goal not in given_up})
    dispatch = Dispatch(replace(problem, times=kept), found.plan, together.spread, same_actors=True)
    return Remaining(dispatch, _paths(scheduled, Plan(steps).primitives), steps, given_up)


def _with_right_id(problem: Problem, step: Step) -> Step:
    """Return a primitive with its ID in the problem; the ID in a plan file may be wrong."""
    return replace(step, id=problem.id_of(step.behavior, step.arguments)) if fitting(problem, step) else step


def _with_events(steps: tuple[Step, ...], scheduled: Sequence[Step], free: int) -> tuple[Step, ...]:
    """Return steps with the scheduled primitives that aren't below them, each after the steps that have begun before it."""
    known = {_kind(step) for step in Plan(steps).primitives}
    for number, event in enumerate(scheduled):
        if _kind(event) not in known:
            earlier = {_kind(step) for step in scheduled[:number]}
            begun = (
                i for i, step in enumerate(steps, 1) if any(_kind(one) in earlier for one in Plan((step,)).primitives)
            )
            place = max(begun, default=0)
            steps = (*steps[:place], replace(event, path=(free,)), *steps[place:])
            free += 1
    return steps


def _in_time(problem: Problem, plan: Plan) -> Timed:
    """Schedule the primitives of a plan; without deadlines and windows, the first schedule suffices."""
    times = problem.times or Times()
    return in_time(problem, plan, None if times.deadlines or times.windows else 0.0, same_actors=True)


def _without_deadlines(problem: Problem, plan: Plan, late: Timed) -> tuple[Timed, tuple[Symbol, ...]]:
    """Schedule the primitives of a plan that are late, and give up one deadline, else all deadlines."""
    times = problem.times or Times()
    for given_up in (*((goal,) for goal in times.deadlines), tuple(times.deadlines)) if times.deadlines else ():
        kept = {goal: by for goal, by in times.deadlines.items() if goal not in given_up}
        found = _in_time(replace(problem, times=replace(times, deadlines=kept)), plan)
        if found.plan is not None:
            return found, given_up
    return late, ()


def in_order(slots: Sequence[WorkerSlot]) -> list[tuple[int, bool]]:
    """Return the begins and ends of primitives in the order of their times: the number of the slot, and whether it's an end.

    At the same instant, ends come before begins.
    """
    begins = [(slot.begin, 1, number, False) for number, slot in enumerate(slots)]
    ends = [(slot.end, int(slot.begin == slot.end), number, True) for number, slot in enumerate(slots)]
    return [(number, is_end) for *_, number, is_end in sorted(begins + ends)]


def _paths(scheduled: Sequence[Step], primitives: Sequence[Step]) -> tuple[tuple[int, ...], ...]:
    """Return the path of each scheduled primitive: equal primitives have the same order in both sequences."""
    places: Mapping[object, list[tuple[int, ...]]] = {_kind(step): [] for step in primitives}
    for step in primitives:
        places[_kind(step)].append(step.path)
    return tuple(places[_kind(step)].pop(0) for step in scheduled)


def _kind(step: Step) -> tuple[str, tuple[str, ...]]:
    return step.behavior, step.arguments
