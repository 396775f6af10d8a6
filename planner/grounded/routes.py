"""Reduction of the cost of a plan by other orders of its steps, with other steps between them.

The *stops* of a plan are the steps that change symbols of goals: a box is loaded, a bed is watered. Other steps *connect* the
stops: a cart drives, a door is opened, a can is filled. A *route* is a sequence of stops. It becomes a plan by the cheapest
connecting steps that make each stop applicable, and finally by connecting steps that reach the goal. A connecting step can be a
stop of a route, too, if another step requires it early: a can is filled on the way. Several operators of a stop may differ in a
value that only stops change (the slot for a box); a route takes the first operator that fits.

Simulated annealing varies the route of the given plan: it moves, reverses, removes and inserts stops. Often a stop is moved beside
a stop with the same individual, and all stops of one symbol are moved together. Most connecting steps are known from earlier
routes, so a route costs little work. The stops before the first change of a route, and the stops after its last change, aren't
applied again.

Work is counted as in `confab.planner.grounded.plan_windows`. The search for other routes of deliveries, with moves of this kind, is
described by Ropke and Pisinger, "An adaptive large neighborhood search heuristic for the pickup and delivery problem with time
windows", Transportation Science 40 (2006).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf, log
from random import Random
from time import perf_counter

from confab.planner.grounded.task import Task, bits_of
from confab.reasoner.symbols import Symbol

LEAST_STOPS, FEW = 4, 15
"""A plan with fewer than `LEAST_STOPS` stops is left as it is; a plan with fewer than `FEW` stops is varied with less work."""
LEAST_WORK = 500_000
"""Least work of varying the route of a plan with many stops."""
STATES = 300
"""Maximum number of states that are expanded in the search for the connecting steps before a stop."""
HOT, COLD = 0.5, 0.03
"""The temperature at the begin and at the end of the annealing, in units of the mean cost of a plan for each stop."""
PATIENCE = 2
"""Divisor of the work after which the annealing ends if it has made the plan no cheaper."""
TRIAL, STOP, TESTS = 10, 4, 3
"""Work of a new route, work of one of its stops, and number of operators that are tested in the time of one unit of work."""
WAYS = 20
"""Number of alternatives of derived bits that are processed in the time of one unit of work."""
MOST_MOVED = 8
"""Maximum number of consecutive stops that are moved or reversed together."""


def rerouted(task: Task, plan: Sequence[int], work: int, deadline: float | None = None) -> list[int]:
    """Return a plan that costs at most as much as the given plan.

    Parameters
    ----------
    task : Task
    plan : sequence of int
        Operators that lead from the task's initial state to its goal.
    work : int
        About the maximum work; a plan with few stops requires less work.
    deadline : float, optional
        The deadline on the clock of `time.perf_counter`.
    """
    served = _bits_of_goals(task)
    stops = sum(_changes(task, operator) & served > 0 for operator in plan)
    if stops < LEAST_STOPS:
        return list(plan)
    work = min(max(work * 3 // 4, LEAST_WORK), work * stops // FEW)
    routes = _StopOrders(task, served, work, deadline)
    best = now = routes.fewest_stops(plan)
    moves = _RouteChanges(task, routes.served, plan)
    random, mean = moves.random, now.costs[-1] / max(len(now.stops), 1)
    improved = work
    while not routes.over and now.stops and improved - routes.work < work // PATIENCE:
        heat = mean * HOT * (COLD / HOT) ** (1 - routes.work / work)
        other = routes.changed(now, moves.neighbour(now.stops), now.costs[-1] - heat * log(1 - random.random()))
        now = now if other is None else other
        if now.costs[-1] < best.costs[-1]:
            best, improved = now, routes.work
    return min(list(plan), [operator for steps in best.steps for operator in steps], key=task.cost_of)


def _bits_of_goals(task: Task) -> int:
    """Return the bits of the symbols of the problem's goals."""
    bits = [*enumerate(task.facts), *task.complements.items()]
    return sum(1 << bit for bit, fact in bits if fact.symbol in task.problem.goal)


def _changes(task: Task, operator: int) -> int:
    """Return the bits that an operator may change."""
    found = 0
    for _, cleared, set_ in task.changes_of(operator)[1]:
        found |= cleared | set_
    return found


@dataclass(frozen=True)
class _PlannedRoute:
    """A route; `states` and `costs` contain the state and the cost before each stop, and at the end of the plan.

    `steps` contains the steps up to each stop, including the stop, and finally the steps to the goal.
    """

    stops: list[int]
    steps: list[Sequence[int]]
    states: list[int]
    costs: list[float]


class _StopOrders:
    """The routes of a task; `work` is the remaining work, and `served` contains the bits of the goals' symbols.

    `makers` contains, for each bit, the relaxed operators of connecting steps that may set the bit, and `least` the least cost of
    such an operator.
    """

    def __init__(self, task: Task, served: int, work: int, deadline: float | None) -> None:
        self.task, self.served, self.work, self.deadline = task, served, work, deadline
        self.is_stop = [_changes(task, operator) & served > 0 for operator in range(len(task))]
        self.needs = task.needs.lists()
        self.makers, self.least = defaultdict[int, list[int]](list), defaultdict[int, float](lambda: inf)
        self.makeable, self.asked = 0, 0
        self._add_makers(task.adds.lists())
        self.siblings = self._siblings()
        self.known = dict[tuple[int, int], list[int]]()
        """Connecting steps, by the bits of a state that are told apart, and the stop."""
        self.exact = dict[tuple[int, int], "list[int] | None"]()
        """Results of searches for connecting steps, by the state and the stop."""
        self.factor = 1 + task.derived.effort // WAYS

    @property
    def over(self) -> bool:
        """Whether the work is used up or the deadline has passed."""
        return self.work <= 0 or (self.deadline is not None and perf_counter() > self.deadline)

    def _add_makers(self, adds: Sequence[list[int]]) -> None:
        """Store the connecting operators by the bits that they may set, and the alternatives of derived bits that these allow."""
        task, derived = self.task, list[int]()
        for row, owner in enumerate(task.owners):
            if owner < 0:
                derived.append(row)
            elif not self.is_stop[owner]:
                self._add(row, adds[row], task.costs[owner])
                required, changes = task.changes_of(owner)
                self.asked |= required | _changes(task, owner)
                for when, _, _ in changes:
                    self.asked |= when
        while True:
            new = {row for row in derived if any(self.makeable >> bit & 1 for bit in self.needs[row])}
            if not new:
                return
            for row in sorted(new):
                self._add(row, adds[row], 0.0)
            derived = [row for row in derived if row not in new]

    def _add(self, row: int, bits: Iterable[int], cost: float) -> None:
        for bit in bits:
            self.makers[bit].append(row)
            self.least[bit] = min(self.least[bit], cost)
            self.makeable |= 1 << bit

    def _siblings(self) -> dict[int, list[int]]:
        """Return, for each stop, the stops that differ only in values of goals' symbols that have no symbols of their own."""
        task, facts = self.task, [*self.task.facts, *self.task.complements.values()]
        values = {fact.value for bit, fact in enumerate(task.facts) if self.served >> bit & 1}
        values -= {one for fact in facts for one in fact.symbol.arguments} | set(task.problem.goal.values())
        alike = defaultdict[object, list[int]](list)
        for operator in (operator for operator, stop in enumerate(self.is_stop) if stop and values):
            behavior, arguments, bindings = task.describe(operator)
            individuals = (*arguments, *bindings.values())
            alike[behavior, tuple("" if one in values else one for one in individuals)].append(operator)
        return {operator: group for group in alike.values() if len(group) > 1 for operator in group}

    def fewest_stops(self, plan: Sequence[int]) -> _PlannedRoute:
        """Return the route of a plan; its stops include connecting steps without which it would cost more than the plan."""
        start = _PlannedRoute([], [()], [self.task.initial, self.task.initial], [0.0, 0.0])
        now = self.changed(start, list(plan), inf)
        assert now is not None
        at = 0
        while at < len(now.stops) and not self.over:
            fewer = None
            if not self.is_stop[now.stops[at]]:
                fewer = self.changed(now, now.stops[:at] + now.stops[at + 1 :], now.costs[-1])
            now, at = (now, at + 1) if fewer is None else (fewer, at)
        return now

    def changed(self, old: _PlannedRoute, stops: list[int], most: float) -> _PlannedRoute | None:
        """Return the route with other stops, or None if it is impossible or costs more than `most`."""
        task, begin, same = self.task, 0, 0
        shorter = min(len(stops), len(old.stops))
        while begin < shorter and stops[begin] == old.stops[begin]:
            begin += 1
        while same < shorter - begin and stops[-1 - same] == old.stops[-1 - same]:
            same += 1
        self.work -= TRIAL
        states, costs, steps = old.states[: begin + 1], old.costs[: begin + 1], old.steps[:begin]
        state, cost = states[-1], costs[-1]
        for at in range(begin, len(stops) + 1):
            there = at + len(old.stops) - len(stops)
            if (
                len(stops) - at <= same and there > 0 and old.states[there] == state
            ):  # the rest of the old route follows
                more = cost - old.costs[there]
                costs += [later + more for later in old.costs[there + 1 :]]
                if costs[-1] > most:
                    return None
                return _PlannedRoute(stops, steps + old.steps[there:], states + old.states[there + 1 :], costs)
            stop = self.fitting(state, stops[at]) if at < len(stops) else None
            way = self.connection(state, stop)
            if way is None:
                return None
            way = way if stop is None else [*way, stop]
            self.work -= STOP + 2 * len(way) * self.factor
            for operator in way:
                cost += task.spent(state, operator)
                after = task.applied(state, operator)
                if after is None or cost > most:
                    return None
                state = after
            steps.append(way)
            states.append(state)
            costs.append(cost)
        if (state & task.goal) != task.goal:  # known connecting steps don't tell all derived facts apart
            return None
        return _PlannedRoute(stops, steps, states, costs)

    def fitting(self, state: int, stop: int) -> int:
        """Return a stop, or a sibling of the stop if connecting steps can't make the stop applicable."""
        siblings = self.siblings.get(stop, [])
        fitting = (one for one in (stop, *siblings) if not self.task.changes_of(one)[0] & ~state & ~self.makeable)
        return next(fitting, stop)

    def connection(self, state: int, stop: int | None) -> list[int] | None:
        """Return connecting steps to a state in which a stop is applicable, or to the goal, or None if none are found."""
        task = self.task
        wanted = task.goal if stop is None else task.changes_of(stop)[0]
        if wanted & ~state & ~self.makeable:
            return None
        if self.arrived(state, wanted, stop):
            return []
        checked = task.amounts is not None or bool(
            task.derived.parts
        )  # the bits that are told apart don't determine all others
        number = -1 if stop is None else stop
        seen = state & (self.asked | wanted) & (1 << task.size) - 1
        found = self.known.get((seen, number))
        if found is not None and (not checked or self.leads(state, found, wanted, stop)):
            return found
        exactly = (state if checked else seen, number)
        if exactly not in self.exact:
            found = self.exact[exactly] = self.searched(state, wanted, stop)
            if found is not None:
                self.known.setdefault((seen, number), found)
        return self.exact[exactly]

    def arrived(self, state: int, wanted: int, stop: int | None) -> bool:
        """Return whether a state has the required bits, and a stop is applicable within the bounds of amounts."""
        task = self.task
        return (state & wanted) == wanted and (
            stop is None or task.amounts is None or task.applied(state, stop) is not None
        )

    def leads(self, state: int, steps: Iterable[int], wanted: int, stop: int | None) -> bool:
        """Return whether steps are applicable, and lead to the required bits."""
        for operator in steps:
            after = self.task.applied(state, operator)
            if after is None:
                return False
            state = after
        return self.arrived(state, wanted, stop)

    def searched(self, state: int, wanted: int, stop: int | None) -> list[int] | None:
        """Search the cheapest connecting steps to the required bits by A*; h is the least cost of one step for a missing bit."""
        task, usable = self.task, [(o, self.task.changes_of(o)[0]) for o in self.usable(state, wanted)]
        reached: dict[int, tuple[float, int, int]] = {state: (0.0, state, -1)}
        queue, done = [(0.0, 0, state)], set[int]()
        while queue and len(done) < STATES:
            now = heappop(queue)[2]
            if now in done:
                continue
            done.add(now)
            if self.arrived(now, wanted, stop):
                steps = []
                while now != state:
                    _, now, operator = reached[now]
                    steps.append(operator)
                return steps[::-1]
            self.work -= len(usable) * self.factor // TESTS
            for operator, asked in usable:
                after = task.applied(now, operator) if now & asked == asked else None
                if after is None or after in done:
                    continue
                cost = reached[now][0] + task.spent(now, operator)
                if after not in reached or cost < reached[after][0]:
                    reached[after] = cost, now, operator
                    left = max((self.least[bit] for bit in bits_of(wanted & ~after)), default=0.0)
                    heappush(queue, (cost + left, len(reached), after))
        return None

    def usable(self, state: int, wanted: int) -> list[int]:
        """Return the connecting operators on the chains that lead backward from the required bits that a state lacks."""
        missing = bits_of(wanted & ~state)
        seen, rows = set(missing), set[int]()
        for bit in missing:
            for row in self.makers[bit]:
                if row not in rows:
                    rows.add(row)
                    new = [need for need in self.needs[row] if need not in seen and not state >> need & 1]
                    seen.update(new)
                    missing.extend(new)
        self.work -= len(rows) // TESTS
        return sorted({self.task.owners[row] for row in rows} - {-1})


class _RouteChanges:
    """Random changes of the stops of a route.

    `names` contains the individuals of each step of the given plan, and `symbols` the symbol of a goal that a stop changes.
    """

    def __init__(self, task: Task, served: int, plan: Sequence[int]) -> None:
        self.random, self.steps = Random(0), list(dict.fromkeys(plan))
        self.names = {operator: task.describe(operator)[1] for operator in self.steps}
        self.symbols: dict[int, Symbol | int] = {}
        served &= (1 << len(task.facts)) - 1
        for operator in self.steps:
            changed = _changes(task, operator) & served
            lowest = (changed & -changed).bit_length() - 1
            self.symbols[operator] = task.facts[lowest].symbol if changed else operator
        self.weighted: dict[Callable[[list[int]], None], int] = {
            self.removed: 7, self.inserted: 5, self.beside: 14, self.pair_beside: 14,
            self.moved: 10, self.several_moved: 25, self.symbol_moved: 17, self.reversed: 8,
        }  # fmt: skip

    def neighbour(self, stops: list[int]) -> list[int]:
        """Return the stops after a random change."""
        new = list(stops)
        self.random.choices(list(self.weighted), list(self.weighted.values()))[0](new)
        return new

    def taken(self, stops: list[int]) -> int:
        """Remove a random stop, and return the stop."""
        return stops.pop(self.random.randrange(len(stops)))

    def removed(self, stops: list[int]) -> None:
        """Remove a stop."""
        self.taken(stops)

    def inserted(self, stops: list[int]) -> None:
        """Insert a step of the given plan."""
        stops.insert(self.random.randint(0, len(stops)), self.random.choice(self.steps))

    def moved(self, stops: list[int]) -> None:
        """Move a stop anywhere."""
        stop = self.taken(stops)
        stops.insert(self.random.randint(0, len(stops)), stop)

    def beside(self, stops: list[int]) -> None:
        """Move a stop beside a stop with the same individual."""
        stop = self.taken(stops)
        stops.insert(self.place_for(stop, stops, 0, len(stops)), stop)

    def pair_beside(self, stops: list[int]) -> None:
        """Move two stops of one symbol beside stops with the same individuals, in the same order."""
        stop = self.random.choice(stops)
        pair = [one for one in stops if self.symbols[one] == self.symbols[stop]][:2]
        for one in pair:
            stops.remove(one)
        at = 0
        for one in pair:
            at = self.place_for(one, stops, at, len(stops))
            stops.insert(at, one)
            at += 1

    def several_moved(self, stops: list[int]) -> None:
        """Move consecutive stops anywhere."""
        begin, many = self.random.randrange(len(stops)), self.random.randint(1, MOST_MOVED)
        part = stops[begin : begin + many]
        del stops[begin : begin + many]
        to = self.random.randint(0, len(stops))
        stops[to:to] = part

    def symbol_moved(self, stops: list[int]) -> None:
        """Move all stops of one symbol anywhere, in the same order."""
        symbol = self.symbols[self.random.choice(stops)]
        its = [one for one in stops if self.symbols[one] == symbol]
        stops[:] = [one for one in stops if self.symbols[one] != symbol]
        places = sorted(self.random.randint(0, len(stops)) for _ in its)
        for earlier, (at, one) in enumerate(zip(places, its, strict=True)):
            stops.insert(at + earlier, one)

    def reversed(self, stops: list[int]) -> None:
        """Reverse the order of consecutive stops."""
        begin, many = self.random.randrange(len(stops)), self.random.randint(2, MOST_MOVED)
        stops[begin : begin + many] = stops[begin : begin + many][::-1]

    def place_for(self, stop: int, stops: Sequence[int], begin: int, end: int) -> int:
        """Return a random position between two positions beside a stop with an individual of the given stop, or any position."""
        names = self.names[stop]
        name = self.random.choice(names) if names else ""
        places = [at for at in range(begin, end) if name in self.names[stops[at]]]
        if not places:
            return self.random.randint(begin, end)
        return self.random.choice(places) + self.random.randint(0, 1)
