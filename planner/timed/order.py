"""The necessary order of activities: precedences, and turns that can be exchanged.

Two accesses to the same symbol conflict if at least one access changes the symbol. Conflicting accesses keep the order of the
sequence. Therefore every schedule is equivalent to the sequence. Turns are an exception: their order may change. A *turn* is a
part of the sequence that changes a symbol from its first value and back again. The turns of a symbol can be taken in any order,
one at a time. The turns of an actor include all symbols about the actor. For example, each turn of a hand picks up and puts
down an object. The set of symbols with a value, which a condition looks up, has turns too: the objects at a place leave the place,
and others come, one after another.

The theory is described by Bäckström, "Computational aspects of reordering plans", JAIR 9 (1998). Turns are blocks in the sense of
Siddiqui and Haslum, "Block-structured plan deordering", AI 2012.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise

from confab.planner.plan import Step
from confab.planner.timed.activities import Activity, EventKind, InapplicableError, ReadAccess, StepEvent, in_sequence
from confab.planner.timed.activities import activities as simulated
from confab.planner.timed.pools import AmountPool, AmountUse, pool_of
from confab.planner.validation import Cell
from confab.reasoner.amounts import meets
from confab.reasoner.derivation import deciding
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol, Times, ValueCondition

BEGIN, END = 0, 1
Edge = tuple[int, int, int, int]
"""A precedence: an activity and its begin (0) or end (1), then the later activity and its begin or end."""
TurnId = tuple[int, int]
"""The number of a resource, and the number of a turn of this resource."""


@dataclass(frozen=True)
class Turn:
    """Activities that use a resource without interruption, from the first event in `lows` to the last event in `highs`.

    An event is the begin or the end of an activity. Turns that only read a symbol can be taken at the same time.
    """

    members: tuple[int, ...]
    lows: tuple[tuple[int, int], ...]
    highs: tuple[tuple[int, int], ...]
    reading: bool = False


@dataclass(frozen=True)
class Resource:
    """A symbol, a looked-up set of symbols with a value, or an actor, with turns that exclude each other, as in the sequence.

    `actor` is the name of the actor, or None; `value` is the value of a set of symbols, or None. The turns of a `pool` are events,
    which don't exclude each other.
    """

    turns: tuple[Turn, ...]
    actor: str | None = None
    value: str | None = None
    pool: AmountPool | None = None


@dataclass(frozen=True)
class Order:
    """Activities with the constraints that every schedule of these activities satisfies.

    Attributes
    ----------
    activities : tuple of Activity
    edges : tuple of Edge
    resources : tuple of Resource
    latest : mapping of goal to (activity, begin or end, seconds)
        The event that achieves a goal with a deadline, and the deadline.
    windows : mapping of activity to pairs of seconds
        The time windows of an activity; begin and end must lie within the same time window.
    """

    activities: tuple[Activity, ...]
    edges: tuple[Edge, ...]
    resources: tuple[Resource, ...]
    latest: Mapping[Symbol, tuple[int, int, Fraction]] = field(default_factory=dict)
    windows: Mapping[int, tuple[tuple[Fraction, Fraction | None], ...]] = field(default_factory=dict)

    @property
    def turns(self) -> list[list[TurnId]]:
        """The turns of each resource, in the order of the sequence."""
        return [[(r, t) for t in range(len(one.turns))] for r, one in enumerate(self.resources)]


@dataclass(frozen=True)
class _TimedAccess:
    """An access of an activity to a symbol, from the event `low` to the event `high`; both are the begin or the end."""

    activity: int
    low: int
    high: int
    written: tuple[str, str] | None  # the values before and after, or None for a read access
    position: int  # the position of `low` among the events


def order_of(problem: Problem, activities: Sequence[Activity], events: Iterable[StepEvent]) -> Order:
    """Return the necessary order of activities.

    Parameters
    ----------
    problem : Problem
    activities : sequence of Activity
        The result of `confab.planner.timed.activities.activities` for the same events.
    events : iterable of StepEvent

    Raises
    ------
    InapplicableError
        An activity changes a fact that another, unfinished activity requires throughout.
    """
    events = list(events)
    pools = _pools(problem, activities, events)
    records, touched, starts, ends = _records(activities, events, pools)
    times = problem.times or Times()
    fixed = {(one.situation, one.arguments) for one in _deciding(problem).values()}
    returning = {cell for cell in records if cell not in fixed and _returns(records[cell])}
    actors = dict.fromkeys(actor for one in activities for actor in one.actors)
    owned = {actor: [c for c in returning if actor in c[1] and _sole(c, actors)] for actor in actors}
    resources = [_actor(actor, activities, {c: records[c] for c in owned[actor]}, starts, ends) for actor in actors]
    resources += [Resource((), other) for other in _idle(problem, actors)]
    loose = sorted(cell for cell in returning if not any(actor in cell[1] for actor in actors))
    looked = _looked(records, touched)
    free = {key: groups for key, groups in looked.items() if all(map(_returns, groups))}
    own: dict[Cell | ReadAccess, int] = {c: i for i, actor in enumerate(actors) for c in owned[actor]}
    for one, groups in [*((cell, [records[cell]]) for cell in loose), *free.items()]:
        own[one] = len(resources)
        resources.append(Resource(_turns(groups, ends), value=one[1] if isinstance(one[1], str) else None))
    resources += pools.values()
    turn_of = [{m: t for t, turn in enumerate(r.turns) for m in turn.members} for r in resources]
    edges = dict[Edge, None]()
    for cell, found in records.items():
        check("finding the order that the steps need")
        edges.update(dict.fromkeys(_chained(found, ends, activities, turn_of[own[cell]] if cell in own else None)))
    for key, groups in looked.items():
        edges.update(dict.fromkeys(_touching(groups, ends, turn_of[own[key]] if key in own else None)))
    for resource in resources:
        for turn in resource.turns if resource.actor is not None else ():
            its = [m for m in turn.members if resource.actor in activities[m].actors]
            edges.update(dict.fromkeys((one, END, other, BEGIN) for one, other in pairwise(its)))
    alike: dict[tuple[str, tuple[str, ...]], int] = {}
    for number in sorted(starts, key=starts.__getitem__):
        its_step = activities[number].step.behavior, activities[number].step.arguments
        if not activities[number].actors:  # no step overlaps with itself
            if its_step in alike:
                edges[alike[its_step], END, number, BEGIN] = None
            alike[its_step] = number
    return Order(
        tuple(activities),
        tuple(edges),
        tuple(one for one in resources if one.actor is not None or len(one.turns) > 1),
        _latest(problem, times, records),
        _windows(times, activities),
    )


def order_in_sequence(problem: Problem, steps: Sequence[Step]) -> Order:
    """Return the necessary order of steps that are executed one after another.

    Raises
    ------
    InapplicableError
        A step isn't applicable at its position.
    """
    return order_of(problem, simulated(problem, steps, in_sequence(steps)), in_sequence(steps))


def _pools(problem: Problem, activities: Sequence[Activity], events: Sequence[StepEvent]) -> dict[Cell, Resource]:
    """Return the amounts that all activities only increase, decrease or compare with fixed numbers, as resources."""
    found: dict[Cell, list[tuple[int, int, AmountUse]]] = defaultdict(list)
    for number, moment in events:
        one = activities[number]
        for access, which, other in ((one.begin, BEGIN, EventKind.END), (one.end, END, EventKind.BEGIN)):
            for cell, count in access.counts.items() if moment is not other else ():
                found[cell].append((number, which, count))
    unfit: set[ReadAccess] = {(one.situation, one.arguments) for one in _deciding(problem).values()}
    for access in (access for one in activities if found for access in one.accesses):
        unfit |= (access.reads | access.changes.keys()) - access.counts.keys()
    pools = dict[Cell, Resource]()
    for cell, its in found.items():
        symbol, quantity = Symbol(*cell), problem.domain.situations[cell[0]].quantity
        if cell in unfit or quantity is None or symbol not in problem.initial or not any(c.change for *_, c in its):
            continue
        pool = pool_of([count for *_, count in its], Fraction(problem.initial[symbol]), quantity)
        if pool is not None:
            turns = tuple(Turn((number,), ((number, which),), ((number, which),)) for number, which, _ in its)
            pools[cell] = Resource(turns, pool=pool)
    return pools


def _records(
    activities: Sequence[Activity], events: Iterable[StepEvent], pools: Container[Cell]
) -> tuple[dict[Cell, list[_TimedAccess]], dict[ReadAccess, list[_TimedAccess]], dict[int, int], dict[int, int]]:
    """Return the accesses to each symbol, the look-ups of the symbols with each value, and the positions of begins and of ends.

    Accesses to `pools` are left out.
    """
    cells: dict[Cell, list[_TimedAccess]] = defaultdict(list)
    values: dict[ReadAccess, list[_TimedAccess]] = defaultdict(list)
    starts: dict[int, int] = {}
    ends: dict[int, int] = {}
    position = 0
    for number, moment in events:
        one = activities[number]
        parts = [(one.begin, BEGIN, BEGIN), (one.middle, BEGIN, END)] if moment is not EventKind.END else []
        starts.setdefault(number, position)
        if moment is EventKind.WHOLE:
            position += 1
        if moment is not EventKind.BEGIN:
            ends[number] = position
            parts.append((one.end, END, END))
        for access, low, high in parts:
            at = position - (moment is EventKind.WHOLE and low == BEGIN)
            for key in access.reads:
                if isinstance(key[1], str):
                    values[key].append(_TimedAccess(number, low, high, None, at))
                elif key not in access.changes and key not in pools:
                    cells[key].append(_TimedAccess(number, low, high, None, at))  # type: ignore[index]
            for cell, pair in access.changes.items():
                if cell not in pools:
                    cells[cell].append(_TimedAccess(number, low, high, pair, at))
        position += 1
    return cells, values, starts, ends


def _returns(records: Sequence[_TimedAccess]) -> bool:
    """Return whether some access changes a symbol, and the last change restores the first value."""
    written = [record.written for record in records if record.written is not None]
    return bool(written) and written[-1][1] == written[0][0]


def _sole(cell: Cell, actors: Mapping[str, None]) -> bool:
    """Return whether exactly one argument of a symbol is an actor."""
    return sum(argument in actors for argument in cell[1]) == 1


def _turns(groups: Sequence[Sequence[_TimedAccess]], ends: Mapping[int, int]) -> tuple[Turn, ...]:
    """Return the common turns of several symbols; each group contains the accesses to one symbol."""
    first = [next(r.written[0] for r in records if r.written is not None) for records in groups]
    order = sorted(
        ((record.position, i, record) for i, records in enumerate(groups) for record in records),
        key=lambda entry: (entry[0], entry[2].low),
    )
    now, found, current, until = list(first), list[list[_TimedAccess]](), list[_TimedAccess](), -1
    for position, i, record in order:
        if current and now == first and position > until:
            found.append(current)
            current = []
        current.append(record)
        until = max(until, ends[record.activity])
        if record.written is not None:
            now[i] = record.written[1]
    if current:
        found.append(current)
    return tuple(map(_turn, found))


def _turn(records: Sequence[_TimedAccess]) -> Turn:
    members = tuple(dict.fromkeys(record.activity for record in records))
    lows = tuple(dict.fromkeys((r.activity, r.low) for r in records))
    highs = tuple(dict.fromkeys((r.activity, r.high) for r in records))
    return Turn(members, lows, highs, all(record.written is None for record in records))


def _actor(
    actor: str,
    activities: Sequence[Activity],
    cells: Mapping[Cell, Sequence[_TimedAccess]],
    starts: Mapping[int, int],
    ends: Mapping[int, int],
) -> Resource:
    """Return an actor with its turns.

    During a turn, the actor executes an activity, or some symbol about the actor differs from its first value.
    """
    its = sorted((n for n, one in enumerate(activities) if actor in one.actors), key=lambda n: starts[n])
    busy = [_TimedAccess(n, BEGIN, END, ("", ""), starts[n]) for n in its]
    return Resource(_turns([busy, *cells.values()], ends), actor)


def _idle(problem: Problem, actors: Iterable[str]) -> list[str]:
    """Return the individuals that belong to all classes of an actor and aren't actors of the sequence."""
    known = set(actors)
    kinds = {a: [frozenset(m) for m in problem.classes.values() if a in m] for a in known}
    others = {one for its in kinds.values() if its for one in frozenset.intersection(*its)}
    return sorted(others - known)


def _chained(
    records: Sequence[_TimedAccess],
    ends: Mapping[int, int],
    activities: Sequence[Activity],
    turn_of: Mapping[int, int] | None,
) -> Iterator[Edge]:
    """Yield the edges between conflicting accesses to a symbol; if the symbol has turns, only edges within a turn."""
    last: _TimedAccess | None = None
    readers: list[_TimedAccess] = []
    turn: int | None = None
    for record in records:
        if turn_of is not None and turn_of[record.activity] != turn:
            turn, last, readers = turn_of[record.activity], None, []
        same = record.written is not None and record.written[0] == record.written[1]
        for other in (*((last,) if last else ()), *(readers if record.written is not None else ())):
            if other.activity == record.activity:
                continue
            if other.high == END and ends[other.activity] > record.position:
                if same and other.written is None:
                    continue
                raise InapplicableError(
                    f"{activities[record.activity].step} overlaps with {activities[other.activity].step}, and one of them "
                    "changes a fact that the other needs or changes"
                )
            yield other.activity, other.high, record.activity, record.low
        if record.written is None:
            readers.append(record)
        else:
            last, readers = record, [r for r in readers if r.activity == record.activity and r.high == END]


def _looked(
    records: Mapping[Cell, Sequence[_TimedAccess]], values: Mapping[ReadAccess, Sequence[_TimedAccess]]
) -> dict[ReadAccess, list[list[_TimedAccess]]]:
    """Return the accesses to each looked-up set of symbols with a value: a group for each symbol that enters or leaves the set.

    A change is represented by whether the symbol has the value before and after. The first group also contains the look-ups.
    """
    found: dict[ReadAccess, dict[Cell, list[_TimedAccess]]] = defaultdict(dict)
    for cell, its in records.items() if values else ():
        for record in its:
            for value in set(record.written or ()) if record.written and record.written[0] != record.written[1] else ():
                if (cell[0], value) in values:
                    before, after = (str(one == value) for one in record.written or ())
                    changed = replace(record, written=(before, after))
                    found[cell[0], value].setdefault(cell, []).append(changed)
    for key, groups in found.items():
        next(iter(groups.values())).extend(values[key])
    return {key: list(groups.values()) for key, groups in found.items()}


def _touching(
    groups: Sequence[Sequence[_TimedAccess]], ends: Mapping[int, int], turn_of: Mapping[int, int] | None
) -> Iterator[Edge]:
    """Yield the edges between look-ups of a set and its changes; if the set has turns, only edges within a turn."""
    every = [record for its in groups for record in its]
    for look in (record for record in every if record.written is None):
        for touch in (record for record in every if record.written is not None):
            apart = turn_of is not None and turn_of[touch.activity] != turn_of[look.activity]
            if apart or touch.activity == look.activity:
                continue
            one, other = (touch, look) if touch.position < look.position else (look, touch)
            if one.high == END and ends[one.activity] > other.position:
                raise InapplicableError("a step reads a value that another step is still changing")
            yield one.activity, one.high, other.activity, other.low


def _latest(
    problem: Problem, times: Times, records: Mapping[Cell, Sequence[_TimedAccess]]
) -> dict[Symbol, tuple[int, int, Fraction]]:
    """Return the last change that decides whether a goal with a deadline holds, and the deadline, for each such goal."""
    found = {}
    for goal, wanted in _deciding(problem).items():
        for record in records.get((wanted.situation, wanted.arguments), ()):
            if record.written is not None and len({meets(value, wanted.value) for value in record.written}) > 1:
                found[goal] = record.activity, record.high, times.deadlines[goal]
    return found


def _deciding(problem: Problem) -> dict[Symbol, ValueCondition]:
    """Return the condition that decides whether a goal with a deadline holds, for each such goal."""
    deadlines = problem.times.deadlines if problem.times is not None else ()
    return {goal: deciding(problem, goal) for goal in deadlines if goal in problem.goal}


def _windows(times: Times, activities: Sequence[Activity]) -> dict[int, tuple[tuple[Fraction, Fraction | None], ...]]:
    """Return the time windows of activities that name individuals with time windows.

    An activity must lie within a time window of each individual that the activity names.
    """
    found: dict[int, tuple[tuple[Fraction, Fraction | None], ...]] = {}
    for number, one in enumerate(activities):
        for individual in dict.fromkeys((*one.step.arguments, *one.actors)):
            if individual in times.windows:
                its = times.windows[individual]
                found[number] = its if number not in found else common(found[number], its)
    return found


def common(
    one: Sequence[tuple[Fraction, Fraction | None]], other: Sequence[tuple[Fraction, Fraction | None]]
) -> tuple[tuple[Fraction, Fraction | None], ...]:
    """Return the intersections of two sets of time windows.

    >>> common([(Fraction(0), Fraction(9))], [(Fraction(5), None)])
    ((Fraction(5, 1), Fraction(9, 1)),)
    """
    found = []
    for low, high in one:
        for from_, until in other:
            bounds = [end for end in (high, until) if end is not None]
            both = (max(low, from_), min(bounds) if bounds else None)
            if both[1] is None or both[0] <= both[1]:
                found.append(both)
    return tuple(sorted(found, key=lambda window: window[0]))
