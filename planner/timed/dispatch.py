"""Execution of a timed plan whose primitives take shorter or longer than expected.

A primitive begins when all events that must precede its begin have happened, and the time windows of its individuals allow the
begin. So a delay shifts only the primitives that depend on the late primitive. The end of a primitive isn't controlled. If an end
must follow another event, the primitive begins only if this order holds for all durations within the stated spread; otherwise the
primitive is held back. Before the first begin, and when a primitive ends earlier or later than expected, actors' turns that haven't
begun are exchanged: to keep deadlines, to keep deadlines also with the longest durations within the spread, and to shorten the
makespan.

Networks whose durations are observed, not controlled, are described by Vidal and Fargier, "Handling contingency in temporal
constraint networks", Journal of Experimental and Theoretical Artificial Intelligence 11 (1999).
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, floor, inf

from confab.planner.plan import Step
from confab.planner.timed.activities import EventKind, StepEvent, activities
from confab.planner.timed.call import renamed_by, timed_plan
from confab.planner.timed.exchange import choices_of, exchanged
from confab.planner.timed.network import Begins, Network, earliest, network_of
from confab.planner.timed.order import BEGIN, END, Edge, TurnId, order_of
from confab.planner.timed.plan import Slot, TimedPlan
from confab.planner.timed.schedules import (
    ActorChoices,
    CandidateSchedule,
    durations_with,
    rescheduled,
    turn_edges,
)
from confab.planner.timed.validation import validate_timed
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol, Times

UNIT = Fraction(1, 1000)
"""The unit of observed times, in seconds; observed times are rounded up."""
WORK = 20_000
"""Maximum number of arcs that are processed for the exchange of turns after the end of a primitive."""


@dataclass(frozen=True)
class Late:
    """A goal that is expected after its deadline, in seconds.

    `certain` states whether the goal is late even if all remaining primitives take their shortest durations.
    """

    goal: Symbol
    expected: Fraction
    deadline: Fraction
    certain: bool


class Dispatch:
    """The execution of a timed plan.

    The caller begins the primitives that `ready` returns, and reports each begin and each end.

    Parameters
    ----------
    problem : Problem
    timed : TimedPlan
        A timed plan of the problem that the checker accepts.
    spread : Fraction
        The greatest relative deviation of a duration from the expected duration.
    same_actors : bool
        Whether every primitive keeps its actors; otherwise another actor may take a turn that hasn't begun.
    """

    def __init__(
        self, problem: Problem, timed: TimedPlan, spread: Fraction = Fraction(0), same_actors: bool = False
    ) -> None:
        self.problem, self.plan, self.spread = problem, timed.plan, spread
        steps, events = timed.plan.primitives, list(_events(timed))
        self.order = order_of(problem, activities(problem, steps, events), events)
        self.network = network_of(self.order, more=(UNIT,))
        self.turns = self.order.turns
        every = [*self.network.edges, *turn_edges(self.order, self.turns, self.network.separation > 0)]
        self.controlled = all(low == BEGIN for *_, low in every)
        fixed = same_actors or not self.controlled
        self.choices = ActorChoices() if fixed else choices_of(problem, timed.plan, self.order, self.network)
        times = problem.times or Times()
        self._untimed = replace(problem, times=Times(events=times.events))
        self.begun: dict[int, int] = {}
        self.over: dict[int, int] = {}
        self._settle()
        if self.controlled and self.order.latest and spread:
            self._exchange(0)

    def step(self, number: int) -> Step:
        """Return a primitive with the actors that are assigned to it."""
        renamed = renamed_by(self.order, self.turns)
        return (exchanged(self.problem, self.plan, renamed) if renamed else self.plan).primitives[number]

    def expected(self, number: int) -> Fraction:
        """Return the expected duration of a primitive with the actors that are assigned to it, in seconds."""
        return self.lasts[number] * self.network.unit

    def ready(self, now: Fraction) -> list[int]:
        """Return the numbers of the primitives that can begin now."""
        time = self._units(now)
        safe = self._safe(time)
        return [i for i in self.waiting if self._possible(i, time, safe) <= time]

    def wakes(self, now: Fraction) -> Fraction | None:
        """Return the next time at which the caller acts even if no primitive ends before that time, or None."""
        time = self._units(now)
        safe = self._safe(time)
        later = [at for i in self.waiting if time < (at := self._possible(i, time, safe)) < inf]
        return int(min(later)) * self.network.unit if later else None

    @property
    def waiting(self) -> list[int]:
        """The numbers of the primitives that haven't begun."""
        return [i for i in range(len(self.lasts)) if i not in self.begun]

    def begin(self, number: int, now: Fraction) -> None:
        """Report that a primitive begins."""
        self.begun[number] = self._units(now)

    def end(self, number: int, now: Fraction) -> None:
        """Report the end of a primitive; after an unexpected duration, turns that haven't begun may be exchanged."""
        time = self.over[number] = self._units(now)
        if self.controlled and time - self.begun[number] != self.lasts[number]:
            self._exchange(time)

    def late(self, now: Fraction) -> list[Late]:
        """Return the goals that are expected after their deadlines."""
        if not self.order.latest:
            return []
        time = self._units(now)
        slow, fast = self._expected(time), self._expected(time, -self.spread)
        found = []
        for goal, (i, which, by) in self.order.latest.items():
            at = [one.begins[i] + (lasts[i] if which == END else 0) for lasts, one in (slow, fast)]
            if at[0] * self.network.unit > by:
                found.append(Late(goal, at[0] * self.network.unit, by, at[1] * self.network.unit > by))
        return found

    def misses(self, now: Fraction, before: Fraction) -> Fraction | None:
        """Return the first time between two times at which it becomes certain that a deadline is missed, or None.

        Until the second time, no primitive begins or ends.
        """
        if not self.order.latest:
            return None
        low, high = self._units(now), self._units(before)
        lasts, begins = self._expected(high, -self.spread)
        found = []
        for i, which, by in self.order.latest.values():
            late_by = begins.begins[i] + (lasts[i] if which == END else 0) - floor(by / self.network.unit)
            if late_by > 0 and low < (at := high - late_by + 1) < high:
                found.append(at)
        return min(found) * self.network.unit if found else None

    def timed(self, now: Fraction) -> TimedPlan | None:
        """Return the plan with the times of the begins and ends so far, and with the expected times of the others.

        Return None if the steps of some level have no sequential order.
        """
        lasts, begins = self._expected(self._units(now))
        return self._plan(CandidateSchedule(self.turns, begins), lasts)

    # ------------------------------------------------------------------------------------------------------ conditions

    def _units(self, now: Fraction) -> int:
        return ceil(now / self.network.unit)

    def _settle(self) -> None:
        """Compute the durations, and the edges into and out of each primitive, from the order of the turns of each resource."""
        self.lasts = durations_with(self.network, self.choices, self.turns)
        self.edges = [
            *dict.fromkeys((*self.network.edges, *turn_edges(self.order, self.turns, self.network.separation > 0)))
        ]
        self.into: dict[int, list[Edge]] = defaultdict(list)
        self.out_of: dict[int, list[Edge]] = defaultdict(list)
        for edge in self.edges:
            self.into[edge[2]].append(edge)
            self.out_of[edge[0]].append(edge)

    def _lasting(self, time: int, more: Fraction) -> list[int]:
        """Return the durations of all primitives if the remaining durations deviate by the factor 1 + `more`."""
        found = []
        for i, lasts in enumerate(self.lasts):
            if i in self.over:
                found.append(self.over[i] - self.begun[i])
                continue
            its = ceil(lasts * (1 + more)) if more > 0 else floor(lasts * (1 + more))
            found.append(max(its, time - self.begun.get(i, time)))
        return found

    def _rest(self, time: int, edges: Sequence[Edge]) -> Network:
        """Return the network with the given edges and the begins so far; the other primitives begin now or later."""
        count = range(len(self.lasts))
        return replace(
            self.network,
            edges=tuple(edge for edge in edges if edge[2] not in self.begun),
            at=[None if i in self.begun else self.network.at[i] for i in count],
            windows=[
                ((self.begun[i], None),)
                if i in self.begun
                else tuple(
                    (max(low, time), high) for low, high in self.network.windows[i] if high is None or high > time
                )
                or self.network.windows[i]
                for i in count
            ],
        )

    def _expected(self, time: int, more: Fraction = Fraction(0)) -> tuple[list[int], Begins]:
        """Return durations and begins if the remaining durations deviate by the factor 1 + `more`."""
        lasts = self._lasting(time, more)
        begins = earliest(self._rest(time, self.edges), (), lasts)
        assert begins is not None  # the order of the turns has a schedule
        return lasts, begins

    def _safe(self, time: int) -> Callable[[int], float]:
        """Return a function that maps a primitive to its earliest safe begin.

        With a safe begin, the end follows all events that it must follow.

        The begin is safe for all durations within the spread.
        """
        if self.controlled:
            return lambda i: 0
        most, least = self._lasting(time, self.spread), self._lasting(time, -self.spread)
        begins = earliest(self._rest(time, self.edges), (), most, least)
        if begins is None:  # no begins are safe for all durations
            tied = {i for edge in self.edges if edge[3] == END for i in (edge[0], edge[2])}
            return lambda i: inf if i in tied else 0

        def safe(i: int) -> float:
            for _, high, k, low in self.out_of[i]:
                at = self.network.at[k]
                its = time + (most[i] if high == END else 0) + self.network.least(i, high, k, low)
                begin = at if at is not None else self.begun.get(k, inf) if low == END else inf
                by = begin + (least[k] if low == END else 0)
                if its > by:
                    return inf
            return begins.begins[i]

        return safe

    def _possible(self, i: int, time: int, safe: Callable[[int], float]) -> float:
        """Return the first time at which a primitive can begin even if no primitive ends before; `inf` if there is none."""
        at = self.network.at[i]
        if at is not None:
            return max(at, time)
        if any(k not in (self.over if high == END else self.begun) for k, high, _, low in self.into[i] if low == BEGIN):
            return inf
        first = max(time, safe(i))
        for low, high in self.network.windows[i] if first < inf else ():
            begin = max(first, low)
            if high is None or begin + self.lasts[i] <= high:
                return begin
        return inf

    # ------------------------------------------------------------------------------------------------------- exchanges

    def _exchange(self, time: int) -> None:
        """Exchange turns that haven't begun for less lateness, less lateness with the longest durations, or a shorter makespan."""
        fixed = {
            turn
            for line in self.turns
            for turn in line
            if any(m in self.begun for m in self.order.resources[turn[0]].turns[turn[1]].members)
        }
        known = {m for turn in fixed for m in self.order.resources[turn[0]].turns[turn[1]].members}
        before = CandidateSchedule(self.turns, self._expected(time)[1])
        network, choices = self._open(time, fixed, known)
        slow = None
        if self.spread and (self.order.latest or self.order.windows):
            before.slow, slow = self._expected(time, self.spread)[1], self._open(time, fixed, known, self.spread)
        found = rescheduled(self.order, network, choices, self.turns, fixed, WORK, slow)
        if found is None or found.cost >= before.cost:
            return
        plan = self._plan(found, durations_with(network, choices, found.turns))
        if plan is not None and not validate_timed(self._untimed, plan, executed=True):
            self.turns = found.turns
            self._settle()

    def _open(
        self, time: int, fixed: Container[TurnId], known: Container[int], more: Fraction = Fraction(0)
    ) -> tuple[Network, ActorChoices]:
        """Return the rest of the network and the choices of actors if the remaining durations deviate by the factor 1 + `more`.

        The `known` primitives belong to the `fixed` turns, which keep their actors.
        """
        lasts = self._lasting(time, more)
        base = [lasts[i] if i in known else ceil(its * (1 + more)) for i, its in enumerate(self.network.durations)]
        choices = ActorChoices(
            {turn: able for turn, able in self.choices.of.items() if turn not in fixed},
            {
                key: {} if key[0] in fixed else {i: ceil(each * (1 + more)) for i, each in its.items()}
                for key, its in self.choices.lasts.items()
            },
        )
        return replace(self._rest(time, self.network.edges), durations=base), choices

    def _plan(self, found: CandidateSchedule, lasts: Sequence[int]) -> TimedPlan | None:
        """Return the plan with the begins of a schedule and with the given durations."""
        choices = ActorChoices({}, {key: {} for key in self.choices.lasts})
        return timed_plan(
            self.problem, self.plan, self.order, replace(self.network, durations=list(lasts)), choices, found
        )


def _events(timed: TimedPlan) -> Iterator[StepEvent]:
    """Yield the begins and ends of the primitives in the order of their times; at the same instant, ends come first."""
    found = list[tuple[Fraction, int, int, EventKind]]()
    for number, slot in enumerate(timed.slots):
        if slot.begin == slot.end:
            found.append((slot.begin, 1, number, EventKind.WHOLE))
        else:
            found += [(slot.begin, 1, number, EventKind.BEGIN), (slot.end, 0, number, EventKind.END)]
    yield from ((number, kind) for _, _, number, kind in sorted(found, key=lambda one: one[:3]))


@dataclass(frozen=True)
class DispatchRun:
    """A simulated execution.

    `timed` is the plan with its actual times, or None if primitives remain. `slots` contains the begun primitives in the order
    of the plan. `waiting` contains the primitives that were held back. `said` maps each goal that was late, or expected to be
    late, to the first time at which this was known.
    """

    timed: TimedPlan | None
    slots: tuple[Slot, ...]
    waiting: tuple[Step, ...]
    said: Mapping[Symbol, Fraction]


def simulated(dispatch: Dispatch, actual: Callable[[int, Fraction], Fraction]) -> DispatchRun:
    """Execute a plan in a simulation.

    Parameters
    ----------
    dispatch : Dispatch
        A new execution.
    actual : callable
        Function that returns the actual duration of a primitive, given the number of the primitive and its expected duration.
    """
    now, running = Fraction(0), list[tuple[Fraction, int]]()
    begins: dict[int, tuple[Fraction, Fraction]] = {}
    said: dict[Symbol, Fraction] = {}
    while True:
        while ready := dispatch.ready(now):
            for number in ready:
                end = now + actual(number, dispatch.expected(number))
                begins[number] = now, end
                dispatch.begin(number, now)
                heapq.heappush(running, (end, number))
            while running and running[0][0] == now:
                dispatch.end(heapq.heappop(running)[1], now)
        for one in dispatch.late(now):
            said.setdefault(one.goal, now)
        times = [running[0][0]] if running else []
        times += [at] if (at := dispatch.wakes(now)) is not None else []
        if not times:
            break
        now = dispatch.misses(now, min(times)) or min(times)
        while running and running[0][0] == now:
            dispatch.end(heapq.heappop(running)[1], now)
    slots = tuple(Slot(dispatch.step(i), *begins[i]) for i in sorted(begins))
    waiting = tuple(map(dispatch.step, dispatch.waiting))
    return DispatchRun(None if waiting else dispatch.timed(now), slots, waiting, said)
