"""Shorter schedules and lower bounds, computed by the constraint solver CP-SAT of OR-Tools (the extra `time`).

In the model of the solver, the turns of a resource are intervals that don't overlap. A turn that several actors could take has an
optional interval on each of these actors; exactly one of the intervals is present. A pool is a reservoir. The solver chooses the
order of the turns and the actor of each turn. The earliest begins of the activities follow from these choices.
"""

from __future__ import annotations

from typing import Any

from confab.planner.timed.network import ALWAYS, Network, earliest
from confab.planner.timed.order import BEGIN, END, Order, Resource, TurnId
from confab.planner.timed.schedules import ActorChoices, CandidateSchedule, durations_with, turn_edges

WORK = 1.0
"""Maximum deterministic time of the solver; the unit is a few seconds."""
LARGEST = 2**40
"""Maximum makespan for which the solver is used, in units of the network."""


def shorter(
    order: Order, network: Network, choices: ActorChoices, found: CandidateSchedule, bound: int, seconds: float
) -> tuple[CandidateSchedule, int]:
    """Return the best schedule that the solver finds, at least as short as the given schedule, and a lower bound.

    Parameters
    ----------
    order : Order
    network : Network
    choices : ActorChoices
        The choices of actors for `order`.
    found : CandidateSchedule
        A schedule for `order`.
    bound : int
        A lower bound on the makespan.
    seconds : float
        Time limit of the solver.
    """
    if seconds <= 0 or found.makespan > LARGEST:
        return found, bound
    from ortools.sat.python import cp_model

    model: Any = cp_model.CpModel()
    solver: Any = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = min(seconds, solver.parameters.max_time_in_seconds)
    solver.parameters.max_deterministic_time = WORK
    solver.parameters.num_workers = 1
    solver.parameters.random_seed = 0
    solver.parameters.use_strong_propagation_in_disjunctive = True
    solver.parameters.linearization_level = 0  # linear relaxations of disjunctive turns are slow and weak
    made = _ScheduleModel(model, order, network, choices, found, bound)
    status = solver.Solve(model)
    best = max(bound, round(solver.BestObjectiveBound()))
    if network.tick > network.separation and any(network.least(*edge) > network.separation for edge in network.edges):
        best = bound  # the model rounds some gaps up to one tick
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return found, bound if status == cp_model.INFEASIBLE else best
    turns = made.turns(solver)
    edges = turn_edges(order, turns, network.separation > 0)
    begins = earliest(network, edges, durations_with(network, choices, turns))
    if begins is None or begins.cost >= found.begins.cost:
        return found, min(best, found.makespan)
    return CandidateSchedule(turns, begins), min(best, begins.makespan)


class _ScheduleModel:
    """The variables and the constraints of the solver's model of a schedule."""

    def __init__(
        self, model: Any, order: Order, network: Network, choices: ActorChoices, found: CandidateSchedule, bound: int
    ) -> None:
        self.model, self.order, self.network, self.choices, self.found = model, order, network, choices, found
        fixed = [at for at in network.at if at is not None]
        self.lasts = [self.duration(i) for i in range(len(network.durations))]
        most = found.makespan
        if found.begins.late:  # a schedule that isn't late may be longer
            opens = [low for windows in network.windows for low, _ in windows]
            longest = [
                max(network.durations[i], *(m.get(i, 0) for m in choices.lasts.values()), 0)
                for i in range(len(self.lasts))
            ]
            most = max([most, *opens, *fixed]) + sum(longest) + len(longest) * network.tick
        self.horizon = max([most + network.separation, *fixed])
        self.begins = [model.NewIntVar(0, self.horizon, "") for _ in network.durations]
        self.begin_of: dict[TurnId, Any] = {}
        self.present: dict[tuple[TurnId, int], Any] = {}
        self.activities()
        self.resources()
        makespan = model.NewIntVar(min(bound, most), most, "")
        for i, at in enumerate(network.at):
            if at is None:
                model.Add(makespan >= self.begins[i] + self.lasts[i])
        model.Minimize(makespan)
        for variable, hint in zip(self.begins, found.begins.begins, strict=True):
            model.AddHint(variable, hint)

    def duration(self, activity: int) -> Any:
        """Return the duration of an activity as a number, or as a variable if the duration depends on the actor."""
        its = {m[activity] for m in self.choices.lasts.values() if activity in m} | {self.network.durations[activity]}
        return next(iter(its)) if len(its) == 1 else self.model.NewIntVar(min(its), max(its), "")

    def activities(self) -> None:
        model, network = self.model, self.network
        for i, high, j, low in network.edges:
            early = self.begins[i] + (self.lasts[i] if high == END else 0)
            late = self.begins[j] + (self.lasts[j] if low == END else 0)
            model.Add(early + network.least(i, high, j, low) <= late)
        for i, (at, latest, windows) in enumerate(zip(network.at, network.latest, network.windows, strict=True)):
            if at is not None:
                model.Add(self.begins[i] == at)
            for which, by in latest:
                model.Add(self.begins[i] + (self.lasts[i] if which == END else 0) <= by)
            inside = [model.NewBoolVar("") for _ in windows] if windows is not ALWAYS else []
            if windows is not ALWAYS:
                model.AddExactlyOne(inside)
            for one, (opens, closes) in zip(inside, windows, strict=False):
                model.Add(self.begins[i] >= opens).OnlyEnforceIf(one)
                if closes is not None:
                    model.Add(self.begins[i] + self.lasts[i] <= closes).OnlyEnforceIf(one)

    def resources(self) -> None:
        model, apart = self.model, self.network.separation
        takes: list[list[tuple[Any, int]]] = [[] for _ in self.order.resources]
        readers = [sum(turn.reading for turn in one.turns) for one in self.order.resources]
        for resource, one in enumerate(self.order.resources):
            if one.pool is not None:
                self.pool(resource, one)
                continue
            for number, turn in enumerate(one.turns):
                key = (resource, number)
                begin = self.begin_of[key] = model.NewIntVar(0, self.horizon, "")
                end = model.NewIntVar(0, self.horizon + apart, "")
                size = model.NewIntVar(0, self.horizon + apart, "")
                for member, which in turn.lows:
                    model.Add(begin <= self.begins[member] + (0 if which == BEGIN else self.lasts[member]))
                for member, which in turn.highs:
                    model.Add(end >= self.begins[member] + (0 if which == BEGIN else self.lasts[member]) + apart)
                able = self.choices.of.get(key, (resource,))
                if len(able) == 1:
                    demand = 1 if turn.reading else readers[resource]
                    takes[resource].append((model.NewIntervalVar(begin, size, end, ""), demand))
                    continue
                chosen = [model.NewBoolVar("") for _ in able]
                model.AddExactlyOne(chosen)
                for target, is_it in zip(able, chosen, strict=True):
                    self.present[key, target] = is_it
                    takes[target].append((model.NewOptionalIntervalVar(begin, size, end, is_it, ""), readers[target]))
                    for member in turn.members:
                        if not isinstance(self.lasts[member], int):
                            lasts = self.choices.lasts.get((key, target), {})
                            its = lasts.get(member, self.network.durations[member])
                            model.Add(self.lasts[member] == its).OnlyEnforceIf(is_it)
        for resource, intervals in enumerate(takes):
            if readers[resource]:
                model.AddCumulative([i for i, _ in intervals], [d for _, d in intervals], readers[resource])
            elif intervals:
                model.AddNoOverlap([i for i, _ in intervals])

    def pool(self, resource: int, one: Resource) -> None:
        """Add the limits of a pool as a reservoir, and the minimum time between its events."""
        assert one.pool is not None
        times = [
            self.begins[i] + (self.lasts[i] if which == END else 0) for ((i, which),) in (t.lows for t in one.turns)
        ]
        self.begin_of |= {(resource, number): time for number, time in enumerate(times)}
        changes, most = one.pool.changes, sum(map(abs, one.pool.changes))
        low, high = (most if side is None else side.stock for side in (one.pool.lower, one.pool.upper))
        self.model.AddReservoirConstraint(times, changes, -low, high)
        if apart := self.network.separation:
            self.model.AddNoOverlap([self.model.NewFixedSizeIntervalVar(time, apart, "") for time in times])

    def turns(self, solver: Any) -> list[list[TurnId]]:
        """Return the turns of each resource in the order of the solver's solution."""
        found: list[list[TurnId]] = [[] for _ in self.order.resources]
        gives = {
            (r, t)
            for r, one in enumerate(self.order.resources)
            if one.pool
            for t, c in enumerate(one.pool.changes)
            if c > 0
        }
        for key in sorted(self.begin_of, key=lambda one: (solver.Value(self.begin_of[one]), one not in gives, one)):
            able = self.choices.of.get(key, (key[0],))
            taken = [t for t in able if len(able) == 1 or solver.Value(self.present[key, t])]
            found[taken[0]].append(key)
        return found
