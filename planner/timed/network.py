"""A simple temporal network over the begins of activities, and the earliest begins that satisfy the network.

Times are integers in a unit that divides every duration. Therefore no value is rounded. An arc (i, j, c) means that activity `j`
begins at least `c` units after activity `i` begins. Simple temporal networks are due to Dechter, Meiri and Pearl, "Temporal
constraint networks", Artificial Intelligence 49 (1991).
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import lcm

import networkx

from confab.planner.timed.order import BEGIN, END, Edge, Order

Window = tuple[int, int | None]
ALWAYS: tuple[Window, ...] = ((0, None),)
"""The time windows of an activity that can take place at any time."""


@dataclass(frozen=True)
class Network:
    """A simple temporal network.

    Attributes
    ----------
    unit : Fraction
        The unit of all times, in seconds.
    separation : int
        The minimum time between conflicting events.
    tick : int
        The minimum time between an event and an end that the event must precede. At the same instant, ends come before begins
        and before activities without duration, and ends have the order of the activities.
    durations : list of int
        The duration of each activity with the actors of the plan; other actors may have other durations.
    edges : tuple of Edge
    at : list of int or None
        The fixed begin of each activity, or None for an activity without a fixed begin.
    latest : list of tuple of pairs
        The latest times of the begin (0) or the end (1) of each activity.
    windows : list of tuple of pairs
        The time windows of each activity, sorted by their begins; an activity without windows can't take place.
    """

    unit: Fraction
    separation: int
    tick: int
    durations: list[int]
    edges: tuple[Edge, ...]
    at: list[int | None]
    latest: list[tuple[tuple[int, int], ...]]
    windows: list[tuple[Window, ...]]

    @cached_property
    def limited(self) -> bool:
        """Whether some activity has a latest time, time windows or a fixed time."""
        return any(self.latest) or any(its is not ALWAYS for its in self.windows) or self.at != [None] * len(self.at)

    def least(self, i: int, high: int, j: int, low: int) -> int:
        """Return the minimum time from the begin or end of activity `i` to the begin or end of activity `j`."""
        after_ends = high == BEGIN or self.durations[i] == 0 or i > j
        return self.tick if low == END and after_ends else self.separation

    def ends(self, i: int, begin: int, lasts: int) -> list[int]:
        """Return the latest ends that the latest times, the time window and the fixed time of an activity allow.

        An activity that begins in a time window also ends in this time window.
        """
        fixed = self.at[i]
        found = [by if which == END else by + lasts for which, by in self.latest[i]]
        found += [high for low, high in self.windows[i] if high is not None and low <= begin and begin + lasts <= high]
        return found if fixed is None else [*found, fixed + lasts]

    def arcs(
        self, edges: Iterable[Edge], durations: Sequence[int], shortest: Sequence[int] | None = None
    ) -> list[list[tuple[int, int]]]:
        """Return the successors of each activity, each with the minimum time between the two begins.

        If `shortest` is given, the arcs hold for all durations from `shortest` to `durations`.
        """
        found: list[dict[int, int]] = [{} for _ in durations]
        shortest = durations if shortest is None else shortest
        for i, high, j, low in edges:
            apart = (durations[i] if high == END else 0) - (shortest[j] if low == END else 0)
            apart += self.least(i, high, j, low)
            if found[i].get(j, apart) <= apart:
                found[i][j] = apart
        return [list(after.items()) for after in found]


@dataclass(frozen=True)
class Begins:
    """The earliest begins of activities.

    Attributes
    ----------
    begins : list of int
        The begin of each activity.
    waits_for : list of int
        The activity that determines the begin of each activity; -1 if no activity determines the begin.
    makespan : int
        The end of the last activity without a fixed begin.
    late : int
        The sum of the times by which activities miss their latest times, time windows or fixed times. If the sum is 0, the begins
        satisfy the network.
    latest : int
        The activity with the greatest lateness; -1 if no activity is late.
    """

    begins: list[int]
    waits_for: list[int]
    makespan: int
    late: int = 0
    latest: int = -1

    @property
    def cost(self) -> tuple[int, int]:
        """The value to be minimised: first the lateness, then the makespan."""
        return self.late, self.makespan


def network_of(order: Order, separation: Fraction = Fraction(0), more: Iterable[Fraction] = ()) -> Network:
    """Return the network of an order; the unit of the network also divides the times in `more`."""
    fixed = [one.at for one in order.activities]
    ends = [end for windows in order.windows.values() for window in windows for end in window if end is not None]
    times = [
        separation,
        *(one.duration for one in order.activities),
        *ends,
        *(by for *_, by in order.latest.values()),
        *more,
    ]
    unit = Fraction(1, lcm(*(time.denominator for time in (*times, *(t for t in fixed if t is not None)))))

    def whole(time: Fraction) -> int:
        return int(time / unit)

    count = range(len(order.activities))
    latest: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for i, which, by in order.latest.values():
        latest[i].append((which, whole(by)))
    return Network(
        unit,
        whole(separation),
        max(whole(separation), 1),
        [whole(one.duration) for one in order.activities],
        order.edges,
        [None if time is None else whole(time) for time in fixed],
        [tuple(latest[i]) for i in count],
        [
            tuple((whole(low), None if high is None else whole(high)) for low, high in order.windows[i])
            if i in order.windows
            else ALWAYS
            for i in count
        ],
    )


def earliest(
    network: Network,
    edges: Iterable[Edge] = (),
    durations: Sequence[int] | None = None,
    shortest: Sequence[int] | None = None,
) -> Begins | None:
    """Return the earliest begins that satisfy the edges of a network and additional edges, or None if the edges form a cycle.

    Activities may miss their latest times, time windows or fixed times (`Begins.late`).

    Parameters
    ----------
    network : Network
    edges : iterable of Edge
        Additional edges.
    durations : sequence of int, optional
        Durations that replace the durations of the network.
    shortest : sequence of int, optional
        The least durations; the begins satisfy the edges with all durations from `shortest` to `durations`.
    """
    lasts = network.durations if durations is None else durations
    return begins_after(network, lasts, network.arcs((*network.edges, *edges), lasts, shortest))


def begins_after(network: Network, lasts: Sequence[int], arcs: Sequence[Sequence[tuple[int, int]]]) -> Begins | None:
    """Return the earliest begins that satisfy arcs, or None if the arcs form a cycle; `lasts` are the durations."""
    count = len(lasts)
    begins, waits = [0] * count, [-1] * count
    for i in range(count) if network.limited else ():
        begins[i] = _fitting(network.windows[i], network.at[i] or 0, lasts[i])
    before = [0] * count
    for after in arcs:
        for j, _ in after:
            before[j] += 1
    ready = [i for i in range(count) if not before[i]]
    limited = network.limited
    for i in ready:  # the loop appends activities to the list
        for j, apart in arcs[i]:
            before[j] -= 1
            if not before[j]:
                ready.append(j)
            if limited:
                _move(network, lasts, begins, waits, i, j, apart)
            elif begins[i] + apart > begins[j]:
                begins[j], waits[j] = begins[i] + apart, i
    if len(ready) < count and (
        _excluded(arcs, set(range(count)).difference(ready)) or not _settled(network, lasts, arcs, begins, waits)
    ):
        return None
    makespan = max((b + d for b, d, at in zip(begins, lasts, network.at, strict=True) if at is None), default=0)
    if not network.limited:
        return Begins(begins, waits, makespan)
    late = [_lateness(network, i, begins[i], lasts[i]) for i in range(count)]
    worst = max(range(count), key=late.__getitem__, default=-1)
    return Begins(begins, waits, makespan, sum(late), worst if worst >= 0 and late[worst] else -1)


def _excluded(arcs: Sequence[Sequence[tuple[int, int]]], cyclic: set[int]) -> bool:
    """Return whether some cycle has arcs that require a later begin and none that allows an earlier one; no begins satisfy it.

    `cyclic` contains the activities of cycles and all activities after them.
    """
    graph: networkx.DiGraph[int] = networkx.DiGraph()
    graph.add_edges_from((i, j) for i in cyclic for j, _ in arcs[i])
    for inside in networkx.strongly_connected_components(graph):
        apart = [least for i in inside for j, least in arcs[i] if j in inside]
        if apart and min(apart) >= 0 < max(apart):
            return True
    return False


def _lateness(network: Network, i: int, begin: int, lasts: int) -> int:
    """Return the time by which an activity misses its latest times, time windows or fixed time, or 0 if in time."""
    late, end, fixed = 0, begin + lasts, network.at[i]
    for which, by in network.latest[i]:
        late = max(late, (end if which == END else begin) - by)
    if fixed is not None:
        late = max(late, begin - fixed)
    windows = network.windows[i]
    if windows is ALWAYS or any(low <= begin and (high is None or end <= high) for low, high in windows):
        return late
    return max(late, end - max((high or 0 for _, high in windows), default=0), 1)


def _move(
    network: Network, lasts: Sequence[int], begins: list[int], waits: list[int], i: int, j: int, apart: int
) -> None:
    """Move the begin of activity `j` to a later time if an arc from activity `i` requires this."""
    wanted = begins[i] + apart
    if wanted > begins[j]:
        begins[j], waits[j] = _fitting(network.windows[j], wanted, lasts[j]), i


def _settled(
    network: Network,
    lasts: Sequence[int],
    arcs: Sequence[Sequence[tuple[int, int]]],
    begins: list[int],
    waits: list[int],
) -> bool:
    """Move begins until they satisfy all arcs of a cyclic network; return False if no begins satisfy the arcs."""
    waiting, count = deque(range(len(lasts))), [0] * len(lasts)
    queued = [True] * len(lasts)
    while waiting:
        i = waiting.popleft()
        queued[i] = False
        for j, apart in arcs[i]:
            old = begins[j]
            _move(network, lasts, begins, waits, i, j, apart)
            if begins[j] != old:
                count[j] += 1
                if count[j] > len(lasts):  # a positive cycle
                    return False
                if not queued[j]:
                    queued[j] = True
                    waiting.append(j)
    return True


def _fitting(windows: Sequence[Window], begin: int, lasts: int) -> int:
    """Return the first time, not before `begin`, at which an activity fits into one of its time windows.

    If the activity fits into no time window, return the begin of the last time window, or `begin` if `begin` is later.
    """
    for low, high in windows:
        first = max(low, begin)
        if high is None or first + lasts <= high:
            return first
    return max(begin, windows[-1][0]) if windows else begin
