"""Scheduling of a plan: the necessary order of its primitives, a schedule, the assignment of actors, and the final check."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from importlib.util import find_spec
from math import inf
from time import perf_counter

import networkx

from confab.planner.plan import Plan, Reason, Step, renumbered
from confab.planner.timed.activities import InapplicableError, StepEvent, activities, in_sequence
from confab.planner.timed.bounds import of_any_plan, too_early
from confab.planner.timed.exchange import choices_of, exchanged
from confab.planner.timed.network import Begins, Network, network_of
from confab.planner.timed.order import END, Order, TurnId, order_in_sequence, order_of
from confab.planner.timed.plan import THESE_STEPS, Slot, TimedPlan
from confab.planner.timed.schedules import (
    ActorChoices,
    CandidateSchedule,
    durations_with,
    least,
    shortest,
    turn_edges,
)
from confab.planner.timed.validation import omitted, validate_timed
from confab.planner.validation import validate
from confab.reasoner.derivation import said_by
from confab.reasoner.limits import LimitError, check, overtime, within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Times
from confab.reasoner.timing import judged_by_events

MOST_PLACES = 50
"""Maximum number of steps before which an external event that a plan doesn't need is tried, after the first place."""
AGAIN, KEPT = 0.2, 0.1
"""The shares of the remaining time that remain after sharing the goals of the given plan, and of the best schedule so far."""


@dataclass(frozen=True)
class Timed:
    """The result of scheduling: a timed plan that the checker accepts, or the reason why no timed plan was found.

    `late` is the time in seconds by which the best schedule misses time windows and deadlines.
    """

    plan: TimedPlan | None = None
    reason: Reason | None = None
    late: Fraction = Fraction(0)


def best_in_time(
    problem: Problem,
    plan: Plan,
    seconds: float | None = None,
    shorten: bool = True,
    separation: Fraction = Fraction(0),
) -> Timed:
    """Return a timed plan for the goals of a plan.

    The timed plan may have other steps than the given plan, other actors, and another order.

    Parameters
    ----------
    problem : Problem
    plan : Plan
        A plan of the problem.
    seconds : float, optional
        Time limit of the search for a short schedule.
    shorten : bool
        Whether to search for a short schedule; otherwise return the first schedule that keeps all time windows and deadlines.
    separation : Fraction
        The minimum time between conflicting events, in seconds (epsilon in PDDL).
    """
    from confab.planner.timed.crews import evenly_shared
    from confab.planner.timed.sharing import shared

    until = None if seconds is None else perf_counter() + seconds

    def left(share: float) -> float | None:
        return None if until is None else max(until - perf_counter(), 0.0) * share

    def enough(one: Timed) -> bool:
        if one.plan is None or not shorten:
            return one.plan is not None
        makespan = makespan_of(problem, one.plan)
        return makespan <= bound or evenly_shared(problem, one.plan.work, makespan)

    try:
        found = in_time(problem, plan, left(0.25 if shorten else 1.0), separation)
    except LimitError as limit:
        return Timed(reason=Reason(str(limit)))
    if found.late and (reason := impossible(problem, left(0.25))) is not None:
        return replace(found, reason=reason)
    bound = Fraction(0)
    if shorten:
        with suppress(LimitError), within(left(0.25)):
            bound = of_any_plan(problem)
    if shorten or found.plan is None:
        found = _spread(problem, plan, found, left(0.33), separation)
    given = plan
    for kept in (AGAIN, KEPT) if shorten else (KEPT,):
        if enough(found):
            break
        end = None if until is None else until - kept * (until - perf_counter())
        other = shared(problem, given, end, shorten, bound)
        if other is not None:
            with suppress(LimitError):
                found = _better(problem, found, in_time(problem, other, left(0.5 if shorten else 1.0), separation))
            if shorten or found.plan is None:
                found = _spread(problem, other, found, left(1.0 if kept == KEPT else 0.5), separation)
        if found.plan is None or found.plan.plan == other:
            break  # sharing the goals of its own result changes nothing
        given = found.plan.plan
    if found.plan is None or not shorten:
        return found
    return replace(found, plan=replace(found.plan, least=bound, bound=max(found.plan.bound, bound)))


def impossible(problem: Problem, seconds: float | None = None) -> Reason | None:
    """Return the reason why no plan keeps a deadline, or None if no such reason is known."""
    with suppress(LimitError), within(seconds):
        found = too_early(problem)
        if found is not None:
            times = problem.times or Times()
            by, least = (f"{float(times.since + at):g}" for at in (times.deadlines[found.goal], found.least))
            goal = f"{said_by(problem, found.goal)} is a goal by {by} s"
            return Reason(f"{goal}, but no plan reaches it in less than {least} s", (*found.goal.arguments,))
    return None


def keeps_times(problem: Problem, plan: Plan) -> bool:
    """Return whether a schedule of the steps of a plan is found that keeps all time windows and deadlines."""
    steps = plan.primitives
    try:
        order = order_in_sequence(problem, steps)
    except InapplicableError:
        return False
    network = network_of(order)
    found = shortest(order, network, choices_of(problem, plan, order, network), inf, inf)
    return found is not None and not found.begins.late


def _spread(problem: Problem, plan: Plan, known: Timed, seconds: float | None, separation: Fraction) -> Timed:
    """Return a result with the turns of a plan spread over equal values if it is better than a known result, else the known one."""
    from confab.planner.timed.spreading import spread

    with suppress(LimitError):
        several = spread(problem, plan)
        return known if several is plan else _better(problem, known, in_time(problem, several, seconds, separation))
    return known


def _better(problem: Problem, one: Timed, other: Timed) -> Timed:
    """Return the second of two results if it is better, else the first.

    A plan with a smaller makespan is better. Without plans, it is better to miss times by less, or to miss times instead of having
    another fault.
    """
    if one.plan is None:
        return other if other.plan is not None or (other.late and not 0 < one.late <= other.late) else one
    return (
        other if other.plan is not None and makespan_of(problem, other.plan) < makespan_of(problem, one.plan) else one
    )


def makespan_of(problem: Problem, timed: TimedPlan) -> Fraction:
    """Return the end of the last primitive of a timed plan that isn't an external event; no schedule changes the events' times."""
    events = (problem.times or Times()).events
    return max((slot.end for slot in timed.slots if slot.step.behavior not in events), default=Fraction(0))


def in_time(
    problem: Problem,
    plan: Plan,
    seconds: float | None = None,
    separation: Fraction = Fraction(0),
    events: Sequence[StepEvent] | None = None,
    same_actors: bool = False,
) -> Timed:
    """Return a timed plan with the steps of a plan, and with the external events that happen before its end.

    Parameters
    ----------
    problem : Problem
    plan : Plan
        A plan of the problem.
    seconds : float, optional
        Time limit of the search for a short schedule; the search also has a limit of work.
    separation : Fraction
        The minimum time between conflicting events, in seconds (epsilon in PDDL).
    events : sequence of StepEvent, optional
        The order of the begins and ends of the primitives; by default the primitives are executed one after another.
    same_actors : bool
        Whether every primitive keeps its actors, as it does if `events` are given.
    """
    until = inf if seconds is None else perf_counter() + seconds

    def left() -> float | None:
        return None if until == inf else max(until - perf_counter(), 0.0)

    steps = plan.primitives
    its_events = list(in_sequence(steps)) if events is None else list(events)
    try:
        order = order_of(problem, activities(problem, steps, its_events), its_events)
    except InapplicableError as error:
        return Timed(reason=Reason(str(error)))
    network = network_of(order, separation)
    choices = ActorChoices() if same_actors or events is not None else choices_of(problem, plan, order, network)
    proved: int | None = None  # the first choices allow the most schedules
    while True:
        bound = least(order, network, choices)
        found = shortest(order, network, choices, until, bound)
        if found is None:
            return Timed(reason=Reason("these steps have no schedule: they exclude each other's order"))
        every = [("exchanges", found)]
        if found.begins.cost > (0, bound) and find_spec("ortools") is not None:
            from confab.planner.timed.cpsat import shorter

            solved, bound = shorter(order, network, choices, found, bound, until - perf_counter())
            if solved is not found:
                every = [("CP-SAT", solved), *(() if found.begins.late else every)]
        proved = bound if proved is None else proved
        for scheduler, found in every:
            if found.begins.late:
                return Timed(
                    reason=_late(problem, plan, order, network, choices, found),
                    late=found.begins.late * network.unit,
                )
            timed = timed_plan(problem, plan, order, network, choices, found)
            if timed is not None:
                timed = replace(timed, bound=proved * network.unit, scheduler=scheduler, bounds=THESE_STEPS)
                with overtime():
                    faults = validate_timed(problem, timed, separation)
                if not faults:
                    return Timed(timed)
                if events is None and omitted(problem, timed):
                    whole = _with_events(problem, timed, separation, same_actors)
                    if whole is not None:
                        complete = in_time(problem, whole, left(), separation, same_actors=same_actors)
                        if complete.plan is not None:
                            return complete
        if not choices.of and until:
            until = 0.0  # no search: the turns keep the plan's order
            continue
        if not choices.of:
            said = faults[0].text if timed is not None else "its steps have no order"
            return Timed(reason=Reason(f"the schedule is no plan in time: {said}"))
        moved = {turn for resource, line in enumerate(found.turns) for turn in line if turn[0] != resource}
        choices = replace(choices, of={turn: able for turn, able in choices.of.items() if moved and turn not in moved})


def _with_events(problem: Problem, timed: TimedPlan, separation: Fraction, same_actors: bool) -> Plan | None:
    """Return the plan with the external events that happen before its end, or None if no place of an event has a schedule.

    Each event follows all steps of the plan that don't begin after the event. If the steps have no schedule then, the last of these
    steps wait for the event: as few as possible, and at most `MOST_PLACES`. An event without such a place comes immediately before
    the next event, which may happen after the end of the plan.
    """
    times, now, waiting = problem.times or Times(), timed, list[Step]()
    happening = {step.behavior for step in now.plan.walk()}
    for name, at in sorted(times.events.items(), key=lambda one: (one[1], one[0])):
        if name in happening or (at > now.makespan and not waiting):
            continue
        happening.add(name)
        waiting.append(Step((), problem.id_of(name, ()), problem.domain.behaviors[name].level, name, ()))
        asked = replace(problem, times=replace(times, events={n: t for n, t in times.events.items() if n in happening}))
        begin, steps = {slot.step.path: slot.begin for slot in now.slots}, now.plan.steps
        begun = (i for i, step in enumerate(steps, 1) if any(begin.get(one.path, inf) <= at for one in step.walk()))
        last = max(begun, default=0)
        for place in range(last, max(last - MOST_PLACES, 0) - 1, -1):
            plan = replace(now.plan, steps=renumbered((*steps[:place], *waiting, *steps[place:])))
            found = in_time(asked, plan, 0.0, separation, same_actors=same_actors)
            if found.plan is not None:
                now, waiting = found.plan, []
                break
    return None if waiting else now.plan


def _late(
    problem: Problem, plan: Plan, order: Order, network: Network, choices: ActorChoices, found: CandidateSchedule
) -> Reason:
    """Return the reason why a schedule is late.

    The reason names what the activity with the greatest lateness misses: time windows of individuals, deadlines, or a fixed time.
    """
    i, times = found.begins.latest, problem.times or Times()

    def at(seconds: Fraction) -> str:
        return f"{float(times.since + seconds):g}"

    one, renamed = order.activities[i], renamed_by(order, found.turns)
    step = exchanged(problem, plan, renamed).primitives[i]
    begin = found.begins.begins[i] * network.unit
    lasts = durations_with(network, choices, found.turns)[i] * network.unit
    end, missed = begin + lasts, []
    for individual in dict.fromkeys((*step.arguments, *(renamed.get(i, {}).get(a, a) for a in one.actors))):
        windows = times.windows.get(individual)
        if windows is not None and not any(low <= begin and (high is None or end <= high) for low, high in windows):
            missed.append(
                f"{individual} is available only {' and '.join(_window(its, times.since) for its in windows)}"
            )
    for symbol, (changing, which, by) in order.latest.items():
        if changing == i and (end if which == END else begin) > by:
            missed.append(f"{said_by(problem, symbol)} is a goal by {at(by)} s")
    if one.at is not None and begin > one.at:
        missed.append(f"it happens at {at(one.at)} s")
    return Reason(
        f"no schedule was found that keeps all windows and deadlines; in the best one found, {step} "
        f"takes from {at(begin)} to {at(end)} s, but {', and '.join(missed)}",
        (str(step),),
    )


def _window(window: tuple[Fraction, Fraction | None], since: Fraction) -> str:
    """Return a time window, whose times count from `since`, as text."""
    low, high = window
    return (
        f"from {float(since + low):g} s on"
        if high is None
        else f"from {float(since + low):g} to {float(since + high):g} s"
    )


def renamed_by(order: Order, turns: Sequence[Sequence[TurnId]]) -> dict[int, dict[str, str]]:
    """Return, for each activity, the replaced actors, each with the actor that takes its place."""
    renamed: dict[int, dict[str, str]] = {}
    for resource, line in enumerate(turns):
        for own, number in line:
            one, other = order.resources[own].actor, order.resources[resource].actor
            if own != resource and one is not None and other is not None:
                for member in order.resources[own].turns[number].members:
                    renamed.setdefault(member, {})[one] = other
    return renamed


def timed_plan(
    problem: Problem, plan: Plan, order: Order, network: Network, choices: ActorChoices, found: CandidateSchedule
) -> TimedPlan | None:
    """Return a schedule as a timed plan with the actors that the schedule assigns.

    Return None if the steps of some level have no sequential order.
    """
    renamed = renamed_by(order, found.turns)
    durations = durations_with(network, choices, found.turns)
    edges = (*network.edges, *turn_edges(order, found.turns, network.separation > 0))
    arcs = network.arcs(edges, durations)
    slack = _slack(network, arcs, durations, found.begins)
    new = exchanged(problem, plan, renamed) if renamed else plan
    slots = []
    for i, (step, activity) in enumerate(zip(new.primitives, order.activities, strict=True)):
        begin = found.begins.begins[i]
        actors = tuple(renamed.get(i, {}).get(a, a) for a in activity.actors)
        slots.append(
            Slot(
                step,
                begin * network.unit,
                (begin + durations[i]) * network.unit,
                actors,
                slack[i] * network.unit,
            )
        )
    waits = tuple(sorted({(i, j) for i, after in enumerate(arcs) for j, _ in after}))
    timed = TimedPlan(new, tuple(slots), arcs=waits)
    exchanged_turns = any(line != sorted(line) for line in found.turns)
    return _ordered(problem, timed) if renamed or exchanged_turns else timed


def _slack(
    network: Network, arcs: Sequence[Sequence[tuple[int, int]]], durations: Sequence[int], begins: Begins
) -> list[int]:
    """Return the slack of each activity.

    The slack is the time by which the activity can begin later without a longer makespan and without missing a time limit.
    """
    latest = [
        min([begins.makespan, *network.ends(i, begin, lasts)]) - lasts
        for i, (begin, lasts) in enumerate(zip(begins.begins, durations, strict=True))
    ]
    order = sorted(range(len(latest)), key=lambda i: -begins.begins[i])
    for _ in range(len(latest)):
        check("scheduling the plan")
        changed = False
        for i in order:
            for j, apart in arcs[i]:
                if latest[j] - apart < latest[i]:
                    latest[i] = latest[j] - apart
                    changed = True
        if not changed:
            break
    return [max(last - begin, 0) for last, begin in zip(latest, begins.begins, strict=True)]


def _ordered(problem: Problem, timed: TimedPlan) -> TimedPlan | None:
    """Return a timed plan whose steps are sorted in the order of the schedule, so that they form a valid plan in sequence.

    If the sorted steps aren't a valid plan, return the given timed plan if its steps are a valid plan. If neither is a valid plan,
    return the sorted plan if it exists, or the given plan if its steps needn't be valid in sequence, otherwise None.
    """
    valid = not validate(problem, timed.plan)
    own = timed if valid or judged_by_events(problem) else None
    numbers = {slot.step.path: i for i, slot in enumerate(timed.slots)}
    begins = [slot.begin for slot in timed.slots]
    after: dict[int, list[int]] = {}
    for i, j in timed.arcs:
        after.setdefault(i, []).append(j)

    def sorted_steps(steps: tuple[Step, ...]) -> tuple[Step, ...] | None:
        inside = [[numbers[one.path] for one in step.walk() if not one.steps] for step in steps]
        of = {leaf: k for k, leaves in enumerate(inside) for leaf in leaves}
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        graph.add_nodes_from(range(len(steps)))
        graph.add_edges_from((of[i], of[j]) for i in of for j in after.get(i, ()) if j in of and of[i] != of[j])
        try:
            order = list(networkx.lexicographical_topological_sort(graph, lambda k: min(begins[i] for i in inside[k])))
        except networkx.NetworkXUnfeasible:
            return None
        found = []
        for k in order:
            below = sorted_steps(steps[k].steps) if steps[k].steps else ()
            if below is None:
                return None
            found.append(replace(steps[k], steps=below))
        return tuple(found)

    steps = sorted_steps(timed.plan.steps)
    if steps is None:
        return own
    plan = Plan(renumbered(steps))
    old = [numbers[one.path] for one in Plan(steps).primitives]
    place = {number: i for i, number in enumerate(old)}
    slots = tuple(replace(timed.slots[n], step=new) for n, new in zip(old, plan.primitives, strict=True))
    arcs = tuple(sorted((place[i], place[j]) for i, j in timed.arcs))
    return own if valid and validate(problem, plan) else replace(timed, plan=plan, slots=slots, arcs=arcs)
