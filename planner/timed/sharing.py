"""Sharing of the work among actors: the goals are planned again, in another order and with other actors, for a better schedule.

A task is a goal, or a step to be executed early, with a crew (`confab.planner.timed.crews`). A stretch consists of the steps that
achieve a task from a state. The default planner finds the steps of a stretch. All goals that were achieved before still hold after
a stretch.

The first sequence of tasks follows the plan, or assigns each goal greedily to the crew that achieves the goal first. Then the
search makes one change at a time, preferably to a task on the critical path. A change concerns the crew or the position of a
task. The search keeps a change that shortens neither the makespan nor the lateness with a certain probability, even if the actors'
work becomes less even. The first sequence and the best sequence are also improved by takeovers
(`confab.planner.timed.takeovers`): an actor takes over single parts of the steps of another actor, whichever goal the steps serve.
Takeovers need no planning, so a late sequence of the plan is improved by takeovers before the greedy sequence is built. If the
makespan is minimised with a time limit, the search goes on in rounds: from the best sequence after a few changes, whatever they
cost, or, after a round without a better schedule, from the greedy sequence of another order of the goals. The search ends if the
schedule reaches a lower bound, if all actors are busy for the whole makespan, or after many changes without a better schedule.
Without a time limit, the work is bounded, too, so that the result is the same on every machine.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, islice
from math import inf
from random import Random
from time import perf_counter
from typing import TypeAlias

from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Call, Compiled, compiled
from confab.planner.plan import Plan, Step, UnsolvableError, renumbered
from confab.planner.timed.activities import Activity, InapplicableError, activities, in_sequence
from confab.planner.timed.crews import Crew, Ground, crews_of, evenly_shared, every_actor, with_crew
from confab.planner.timed.network import earliest, network_of
from confab.planner.timed.order import order_of
from confab.planner.timed.schedules import turn_edges
from confab.planner.timed.takeovers import SharedSteps, Takeover, with_bindings
from confab.planner.validation import BehaviorReader, LoggedState, validate
from confab.reasoner.limits import LimitError, check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol, ValueCondition

MOST_CREWS = 64
"""Maximum number of crews."""
MOST_WORK = 10_000_000
"""Maximum work of sharing; the unit is one operator in one state, about a microsecond."""
PLANNING, SCHEDULING = 2_500, 60
"""Work of planning a stretch without its searches, and work of scheduling a primitive; the unit is one operator in one state."""
BARREN, MOST_BARREN = 10, 150
"""Maximum number of successive changes without a better schedule: for each task, and in all.

A late schedule is changed up to the second number.
"""
DISTURBING, BARREN_ROUNDS = 4, 20
"""Number of changes that begin a further round, whatever they cost, and maximum number of further rounds without a better schedule.

Further rounds follow only if the schedule is late, or if the makespan is minimised with a time limit. Each round begins with the
best sequence.
"""
MOST_TAKEOVERS, MOST_EVEN = 100, 2
"""Maximum number of takeovers of which the best one is chosen, and of successive takeovers after which no schedule is better."""
MOST_KNOWN = 4
"""Maximum number of known sequences of steps that are tried for a stretch."""
MOST_COMPILED = 200
"""Maximum number of crews for which behaviours are compiled; at this number, the search bars no further actors or steps."""
HALF, PREFERRED, EARLY = 0.5, 0.8, 0.25
"""Probabilities of kinds of changes.

`HALF` is the probability that an actor is barred instead of a step, that a step is barred instead of its behaviour, and that a
change is kept that only makes the work less even. `PREFERRED`
is the probability that a change concerns a task on the critical path. `EARLY` is the probability that a late step becomes an early
task.
"""
MOST_FAILED = 2
"""Number of failures after which the planner searches no further steps for a task."""
EXPANSIONS, WORK = 500, 200_000
"""Maximum number of expansions for a stretch, and maximum work of its searches; the unit is one operator in one state."""

State: TypeAlias = "dict[Symbol, str]"
Aim: TypeAlias = "Symbol | Ground"
"""The aim of a task: a goal, or a step of the first level that is executed early."""
SharedTask: TypeAlias = "tuple[Aim, Crew]"


@dataclass
class _Stretch:
    """The steps of a task from the state `before` to the state `after`, with their activities as soon as a schedule needs them."""

    steps: tuple[Step, ...]
    before: State
    after: State
    activities: list[Activity] | None = None


@dataclass
class _Sequence:
    """A sequence of tasks with their stretches and the schedule of all steps."""

    tasks: list[SharedTask]
    stretches: list[_Stretch]
    cost: tuple[Fraction, Fraction, Fraction]
    """The value to be minimised: the lateness, the makespan, and the sum of the squares of the actors' work."""
    work: Fraction
    """The sum of the times during which the actors are busy."""
    end: Fraction
    """The end of the last stretch."""
    ends: dict[str, Fraction]
    """The end of the last step that names an individual, by individual."""
    critical: list[tuple[int, Step, tuple[str, ...], Ground]]
    """The steps on the critical path, or on the path to the activity with the greatest lateness.

    Each step comes with the number of its task, with its actors, and with the first-level step that contains it.
    """


def _steps_of(stretches: Sequence[_Stretch]) -> tuple[Step, ...]:
    return renumbered(step for one in stretches for step in one.steps)


def shared(
    problem: Problem, plan: Plan, until: float | None, shorten: bool = True, bound: Fraction = Fraction(0)
) -> Plan | None:
    """Return a plan for the same goals in which several actors share the steps, for a short schedule.

    Return None if no such plan is found.

    Parameters
    ----------
    problem : Problem
    plan : Plan
        A plan of the problem, which determines the first order of the goals.
    until : float, optional
        The end of the search, on the clock of `perf_counter`.
    shorten : bool
        Whether the search continues after it has found a schedule that keeps all time windows and deadlines.
    bound : Fraction
        A lower bound on the makespan in seconds; the search ends when a schedule reaches this bound.
    """
    search = _SharingSearch(problem, plan, until, shorten, bound)
    with suppress(LimitError):
        search.run()
    best = search.best
    if best is None:
        return None
    return Plan(with_bindings(LoggedState(problem, problem.initial, search.rules), _steps_of(best.stretches)))


@dataclass
class _SharingSearch:
    problem: Problem
    plan: Plan
    until: float | None
    shorten: bool
    bound: Fraction
    best: _Sequence | None = None
    stretches: dict[object, _Stretch | None] = field(default_factory=dict)
    work: int = 0
    most: float = MOST_WORK
    half: float = 0.0
    """The time from which the maximum work applies, on the clock of `perf_counter`."""
    known: dict[tuple[SharedTask, frozenset[Aim]], list[tuple[Step, ...]]] = field(default_factory=dict)
    """Known sequences of steps for each task after the same early steps; the planner tries these sequences before it searches."""
    failed: Counter[SharedTask] = field(default_factory=Counter)
    """The number of times that no steps were found for a task, by task."""
    compiled: dict[Crew, tuple[Problem, Compiled]] = field(default_factory=dict)

    @cached_property
    def rules(self) -> BehaviorReader:
        """The compiled behaviours of the plan checker."""
        return BehaviorReader(self.problem)

    @cached_property
    def actors(self) -> list[str]:
        """The individuals that may be actors."""
        return every_actor(self.problem)

    @cached_property
    def crews(self) -> list[Crew]:
        """The crews that the search may assign to tasks."""
        return list(islice(crews_of(self.problem), MOST_CREWS))

    @cached_property
    def last(self) -> dict[Symbol, int]:
        """The position of the last primitive of the plan that changes a symbol, by symbol."""
        rules, facts = self.rules, LoggedState(self.problem, self.problem.initial, self.rules)
        last: dict[Symbol, int] = {}
        for number, step in enumerate(self.plan.primitives):
            behavior = self.problem.domain.behaviors[step.behavior]
            for situation, key, value in rules.changes(behavior, step.arguments, facts) or ():
                last[Symbol(situation, key)] = number
                facts.put(situation, key, value)
        return last

    @cached_property
    def goals(self) -> list[Symbol]:
        """The goals that the plan achieves.

        Goals with deadlines come first, sorted by deadline. The other goals are sorted by their last changes.
        """
        last = self.last
        deadlines = self.problem.times.deadlines if self.problem.times else {}
        count = len(self.plan.primitives)
        open_ = [
            symbol for symbol in self.problem.goal if symbol in last or symbol.situation in self.problem.domain.rules
        ]
        return sorted(open_, key=lambda s: (s not in deadlines, deadlines.get(s, 0), last.get(s, count)))

    def run(self) -> None:
        """Build the sequence of the plan and the greedy sequence, and improve the better sequence by changes."""
        own, until = self.own(), self.until
        self.best, starts, late = own, [] if own is None else [own], own is not None and own.cost[0] > 0
        if own is not None and late:
            self.until = self.half_time()
            self.limit(MOST_WORK // 4)
            with suppress(LimitError):
                self.eased(own)
        self.until = until
        self.limit(inf if self.shorten and until is not None else MOST_WORK)
        for start in starts if not any(step.joined for step in self.plan.steps) else ():
            self.remember(start)  # no single goal needs all steps of a joint refinement
        with suppress(LimitError):
            greedy = self.greedy(self.goals, until if self.best is not None and self.best.cost[0] else self.half_time())
            starts += [] if greedy is None else [greedy]
        if not starts:
            return
        now, random, barren = min(starts, key=lambda one: one.cost), Random(0), 0
        self.best = min(now, self.best or now, key=lambda one: one.cost)
        for start in sorted(starts, key=lambda one: one.cost):
            self.remember(start)
            if (start is now or self.best.cost[0]) and not (late and start is own):
                self.eased(start)
        self.improve(now, random)
        self.eased(self.best)
        while barren < BARREN_ROUNDS and not self.enough(self.best):
            if not self.best.cost[0] and (not self.shorten or self.until is None):
                break
            cost = self.best.cost
            other = self.in_other_order(random) if barren % 2 else self.disturbed(self.best, random)
            self.improve(other or self.best, random)
            self.eased(self.best)
            barren = 0 if self.best.cost < cost else barren + 1

    def enough(self, now: _Sequence) -> bool:
        """Return whether a sequence needn't be improved."""
        late, makespan, _ = now.cost
        return not late and (
            not self.shorten or makespan <= self.bound or evenly_shared(self.problem, now.work, makespan)
        )

    def eased(self, now: _Sequence) -> None:
        """Improve a sequence by takeovers on the critical path, always by the best one, and keep the best sequence."""
        left, seen = MOST_EVEN, set[object]()
        while True:
            self.best = min(now, self.best or now, key=lambda one: one.cost)
            seen.add(now.cost)
            if self.enough(now) or not left:
                break
            shared = SharedSteps(self.problem, _steps_of(now.stretches), self.rules)
            its = dict.fromkeys(one for _, step, _, _ in now.critical for one in shared.takeovers(step, self.actors))
            found = (self.taken_over(now, shared, change) for change in islice(its, MOST_TAKEOVERS))
            others = [one for one in found if one is not None and one.cost not in seen]
            if not others:
                break
            other = min(others, key=lambda one: one.cost)
            left = MOST_EVEN if other.cost[:2] < now.cost[:2] else left - 1
            now = other

    def remember(self, now: _Sequence) -> None:
        """Note the steps of each task of a sequence, so that they are tried for this task in other states."""
        for number, (task, one) in enumerate(zip(now.tasks, now.stretches, strict=True)):
            early = frozenset(aim for aim, _ in now.tasks[:number] if not isinstance(aim, Symbol))
            known = self.known.setdefault((task, early), [])
            known += [] if one.steps in known else [one.steps]

    def taken_over(self, now: _Sequence, shared: SharedSteps, change: Takeover) -> _Sequence | None:
        """Return a sequence after a takeover, or None if it is longer or later, or isn't a plan."""
        self.spend(2 * SCHEDULING * len(shared.primitives))
        parts = shared.after(change, list(accumulate(len(one.steps) for one in now.stretches)))
        if parts is None:
            return None
        stretches, state = list[_Stretch](), dict(self.problem.initial)
        for part, one in zip(parts, now.stretches, strict=True):
            same = one.steps == part and one.before == state
            stretches.append(one if same else _Stretch(part, state, self.after(state, part)))
            state = stretches[-1].after
        found = self.scheduled(now.tasks, stretches)
        if found is None or found.cost[:2] > now.cost[:2] or validate(self.problem, Plan(_steps_of(stretches))):
            return None
        return found

    def disturbed(self, now: _Sequence, random: Random) -> _Sequence:
        """Return a sequence after a few changes, whatever they cost."""
        for _ in range(DISTURBING):
            self.spend(0)
            now = (self.built(self.changed(now, random), now) if now.critical else None) or now
        return now

    def improve(self, now: _Sequence, random: Random) -> None:
        """Improve a sequence by changes that don't make it worse; keep the best sequence."""
        assert self.best is not None
        changes = better = 0
        while now.critical and changes - better < self.most_barren(now, better) and not self.enough(self.best):
            self.spend(0)
            other = self.built(self.changed(now, random), now)
            changes += 1
            if other is None or other.cost[:2] > now.cost[:2] or (other.cost > now.cost and random.random() < HALF):
                continue
            better = changes if other.cost < now.cost else better
            now = other
            self.best = min(now, self.best, key=lambda one: one.cost)

    def most_barren(self, now: _Sequence, better: int) -> int:
        """Return the maximum number of successive changes without a better schedule after `better` changes.

        With a time limit, it is at least the number of changes until the last better schedule.
        """
        least = MOST_BARREN if now.cost[0] else min(BARREN * len(now.tasks), MOST_BARREN)
        return least if self.until is None else max(least, better)

    def own(self) -> _Sequence | None:
        """Return the sequence of tasks that follows the plan.

        The goals have the order of their last changes. The stretch of a goal contains the steps up to its last change.
        """
        numbers = iter(range(len(self.plan.primitives)))
        ends = [[next(numbers) for one in step.walk() if not one.steps][-1] for step in self.plan.steps]
        goals = sorted(self.goals, key=lambda goal: self.last.get(goal, ends[-1] if ends else 0))
        stretches, state, at = list[_Stretch](), dict(self.problem.initial), 0
        for goal in goals:
            check("sharing the goals among the actors")
            upto = next((k for k, end in enumerate(ends) if end >= self.last.get(goal, ends[-1])), len(ends) - 1) + 1
            upto = len(ends) if goal == goals[-1] else max(upto, at)
            steps = renumbered(self.plan.steps[at:upto])
            before, state, at = state, self.after(state, steps), upto
            stretches.append(_Stretch(steps, before, state))
        return self.scheduled([(goal, Crew()) for goal in goals], stretches) if goals else None

    def half_time(self) -> float | None:
        """Return the end of the first half of the remaining time, or None without a time limit."""
        return None if self.until is None else (perf_counter() + self.until) / 2

    def in_other_order(self, random: Random) -> _Sequence | None:
        """Return the greedy sequence for the goals in a random order; goals with deadlines come first, sorted by deadline."""
        deadlines = self.problem.times.deadlines if self.problem.times else {}
        goals = random.sample(self.goals, len(self.goals))
        return self.greedy(
            sorted(goals, key=lambda goal: (goal not in deadlines, deadlines.get(goal, 0))), self.half_time()
        )

    def greedy(self, goals: Sequence[Symbol], until: float | None) -> _Sequence | None:
        """Return the greedy sequence of tasks: each goal is assigned to the crew that achieves the goal first.

        For each goal, as many crews are tried as its share of the time until `until` allows, or without a time limit its share of
        half of the work. If no crew achieves a goal, the goal is tried again after the next goal. Return None if no crew achieves a
        remaining goal.
        """
        now: _Sequence | None = None
        waiting = list(goals)
        while waiting:
            tasks = [] if now is None else now.tasks
            found: list[_Sequence] = []
            for goal in waiting:
                work, end = self.work + (MOST_WORK // 2 - self.work) / len(waiting), inf
                if until is not None:
                    work, end = inf, perf_counter() + (until - perf_counter()) / len(waiting)
                found = self.by_each_crew(tasks, goal, now, work, end)
                if found:
                    waiting.remove(goal)
                    break
            if not found:
                return None
            now = min(found, key=lambda one: (one.cost[0], one.end, *one.cost[1:]))
        return now

    def by_each_crew(
        self, tasks: Sequence[SharedTask], goal: Symbol, like: _Sequence | None, work: float, until: float
    ) -> list[_Sequence]:
        """Return sequences of tasks with a further goal for each crew that achieves it.

        Crews whose individuals have been free for longer come first. When the work is `work`, or at the time `until`, no further
        crew is tried if a sequence was found.
        """
        ends = {} if like is None else like.ends
        crews = sorted(
            self.crews, key=lambda crew: max((ends.get(one, Fraction(0)) for _, one in crew.chosen), default=-1)
        )
        found = list[_Sequence]()
        try:
            for crew in crews:
                if found and (self.work > work or perf_counter() > until):
                    break
                if (one := self.built([*tasks, (goal, crew)], like)) is not None:
                    found.append(one)
        except LimitError:
            if not found:
                raise
        return found

    def changed(self, now: _Sequence, random: Random) -> list[SharedTask]:
        """Return the tasks of a sequence after one random change.

        The change assigns another crew to a task, exchanges the crews of two tasks, bars an actor, a step or a behaviour of a task,
        or moves a task to another position. If the schedule is late, the change may also add a late step as an early task, or drop
        an early task.
        """
        tasks = list(now.tasks)
        late = now.cost[0] and random.random() < HALF
        i, step, actors, above = now.critical[0] if late else random.choice(now.critical)
        if now.cost[0] and random.random() < EARLY:
            if isinstance(tasks[i][0], Symbol):
                tasks.insert(random.randrange(i + 1), (above, Crew()))
            else:
                del tasks[i]
            return tasks
        at, i = i, i if random.random() < PREFERRED else random.randrange(len(tasks))
        j, kind = random.randrange(len(tasks)), random.randrange(4)
        goal, crew = tasks[i]
        if kind == 0 and len(self.crews) > 1:
            tasks[i] = goal, random.choice([one for one in self.crews if one != crew])
        elif kind == 1 and crew != tasks[j][1]:
            tasks[i], tasks[j] = (goal, tasks[j][1]), (tasks[j][0], crew)
        elif kind == 2 and i == at and len(self.compiled) < MOST_COMPILED:
            if actors and random.random() < HALF:
                tasks[i] = goal, replace(crew, chosen=(), without=crew.without.union(actors[:1]))
            else:
                one = step.behavior, step.arguments if random.random() < HALF else ()
                tasks[i] = goal, replace(crew, barred=crew.barred | {one})
        else:
            tasks.insert(j, tasks.pop(i))
        return tasks

    def built(self, tasks: Sequence[SharedTask], like: _Sequence | None) -> _Sequence | None:
        """Return the sequence of tasks with stretches and schedule, or None if a task isn't achieved.

        The sequence reuses the stretches of the first tasks that it has in common with the sequence `like`.
        """
        same = 0
        if like is not None:
            while same < min(len(tasks), len(like.tasks)) and tasks[same] == like.tasks[same]:
                same += 1
        stretches = [] if like is None else like.stretches[:same]
        state = stretches[-1].after if stretches else dict(self.problem.initial)
        for number in range(same, len(tasks)):
            stretch = self.stretch(state, [goal for goal, _ in tasks[: number + 1]], tasks[number][1])
            if stretch is None:
                return None
            stretches.append(stretch)
            state = stretch.after
        return self.scheduled(list(tasks), stretches)

    def stretch(self, state: State, aims: Sequence[Aim], crew: Crew) -> _Stretch | None:
        """Return the steps by which a crew achieves the last of several aims and keeps the goals among the other aims.

        Return None if no such steps are found.
        """
        early, aim = frozenset(one for one in aims[:-1] if not isinstance(one, Symbol)), aims[-1]
        key = frozenset(state.items()), frozenset(aims), aim, crew
        if key not in self.stretches:
            problem = replace(self.problem, initial=state, goal=self.wanted(aims))
            known = self.known.setdefault(((aim, crew), early), [])
            again = (steps for steps in reversed(known[-MOST_KNOWN:]) if not validate(problem, Plan(steps)))
            steps = next(again, None)
            if steps is None and self.failed[aim, crew] < MOST_FAILED:
                steps = self.planned(problem, crew, aim)
            if steps is None:
                self.failed[aim, crew] += 1
            elif steps not in known:
                known.append(steps)
            self.stretches[key] = None if steps is None else _Stretch(steps, state, self.after(state, steps))
        return self.stretches[key]

    def wanted(self, aims: Sequence[Aim]) -> State:
        """Return the goals among the given aims, and the goals that the plan doesn't change, with their values."""
        return {s: v for s, v in self.problem.goal.items() if s in aims or s not in self._open}

    def asked(self, aim: Aim) -> State:
        """Return the values that the step of an aim requires for the symbols of its arguments."""
        if isinstance(aim, Symbol):
            return {}
        behavior = self.problem.domain.behaviors[aim[0]]
        terms = {p.name: argument for p, argument in zip(behavior.parameters, aim[1], strict=True)}
        found = {}
        for one in behavior.preconditions:
            if isinstance(one, ValueCondition) and not one.negated:
                *arguments, value = (terms.get(term, term) for term in (*one.arguments, one.value))
                if not any(term.startswith("?") for term in (*arguments, value)):
                    found[Symbol(one.situation, tuple(arguments))] = value
        return found

    def after(self, state: State, steps: tuple[Step, ...]) -> State:
        """Return the state after the given steps."""
        facts = LoggedState(self.problem, state, self.rules)
        for step in Plan(steps).primitives:
            for change in self.rules.changes(self.problem.domain.behaviors[step.behavior], step.arguments, facts) or ():
                facts.put(*change)
        return facts.state()

    def planned(self, problem: Problem, crew: Crew, aim: Aim) -> tuple[Step, ...] | None:
        """Return the steps that the default planner finds for a problem with the actors of a crew.

        If the aim is a step, this step comes last. Return None if no such steps are found.
        """
        if crew not in self.compiled:
            allowed = with_crew(self.problem, crew) if crew != Crew() else self.problem
            self.compiled[crew] = allowed, compiled(allowed)
        allowed, using = self.compiled[crew]
        goal = {**problem.goal, **self.asked(aim)}
        call = Call(replace(allowed, initial=problem.initial, goal=goal), using, self.until, EXPANSIONS)
        call.space.most_work = WORK
        self.spend(PLANNING)
        levels = problem.domain.levels
        leaves = any(step.level != levels[0] for step in self.plan.steps)
        agenda = Agenda(call, levels if leaves else levels[:1], quickly=True)
        found = None
        with suppress(LimitError, UnsolvableError):
            if agenda.achieve_all():
                found = self.with_last(problem, call, aim)
        self.spend(call.space.effort)
        return found

    def with_last(self, problem: Problem, call: Call, aim: Aim) -> tuple[Step, ...] | None:
        """Return the steps of a call, followed by the step of the aim if the aim is a step.

        Return None if the step of the aim isn't possible, or is refined by no steps.
        """
        if not isinstance(aim, Symbol):
            level = problem.domain.behaviors[aim[0]].level
            last = call.refiner.do(level, *aim)
            if last is None or not (last.steps or level == problem.domain.levels[-1]):
                return None
            call.steps.append(last)
        steps = call.tree().steps
        return None if not isinstance(aim, Symbol) and validate(problem, Plan(steps)) else steps

    def limit(self, work: float) -> None:
        """Set the maximum work; with a time limit, more work is allowed in the first half of the remaining time."""
        now = perf_counter()
        self.most, self.half = work, now if self.until is None else (now + self.until) / 2

    def spend(self, work: int) -> None:
        """Count work; raise `LimitError` at the limit of work or at the time limit."""
        self.work += work
        now = perf_counter()
        if self.work > self.most and now > self.half:
            raise LimitError(f"{self.most} states times operators")
        if self.until is not None and now > self.until:
            raise LimitError("the time limit")

    @cached_property
    def _open(self) -> frozenset[Symbol]:
        return frozenset(self.goals)

    def activities(self, stretch: _Stretch) -> list[Activity]:
        """Return the activities of a stretch, which depend only on the state before it."""
        if stretch.activities is None:
            problem, steps = replace(self.problem, initial=stretch.before), Plan(stretch.steps).primitives
            stretch.activities = activities(problem, steps, in_sequence(steps), self.rules)
        return stretch.activities

    def scheduled(self, tasks: list[SharedTask], stretches: list[_Stretch]) -> _Sequence | None:
        """Return the sequence of tasks with the earliest schedule of their steps in the given order."""
        plan = Plan(_steps_of(stretches))
        steps = plan.primitives
        self.spend(SCHEDULING * len(steps))
        try:
            its = [one for stretch in stretches for one in self.activities(stretch)]
        except InapplicableError:
            return None
        its = [replace(one, step=step) for one, step in zip(its, steps, strict=True)]
        order = order_of(self.problem, its, in_sequence(steps))
        network = network_of(order)
        begins = earliest(network, turn_edges(order, order.turns))
        if begins is None:
            return None
        if not steps:
            return _Sequence(
                tasks, stretches, (Fraction(0), Fraction(0), Fraction(0)), Fraction(0), Fraction(0), {}, []
            )
        of = [k for k, one in enumerate(stretches) for _ in Plan(one.steps).primitives]
        ends = [begin + lasts for begin, lasts in zip(begins.begins, network.durations, strict=True)]
        critical, at = list[tuple[int, Step, tuple[str, ...], Ground]](), begins.latest
        if at < 0:
            at = max(range(len(of)), key=ends.__getitem__)
        passed = set[int]()
        while at >= 0 and at not in passed:
            passed.add(at)
            above = plan.steps[steps[at].path[0]]
            critical.append((of[at], steps[at], order.activities[at].actors, (above.behavior, above.arguments)))
            at = begins.waits_for[at]
        work: dict[str, Fraction] = defaultdict(Fraction)
        acting = set(self.actors)
        for one in order.activities:
            for actor in one.actors or acting.intersection(one.step.arguments):
                work[actor] += one.duration
        last: dict[str, Fraction] = defaultdict(Fraction)
        for step, when in zip(steps, ends, strict=True):
            for argument in step.arguments:
                last[argument] = max(last[argument], when * network.unit)
        late, makespan = (cost * network.unit for cost in begins.cost)
        end = max((end for end, k in zip(ends, of, strict=True) if k == len(tasks) - 1), default=0) * network.unit
        cost = late, makespan, sum((its**2 for its in work.values()), Fraction(0))
        busy = sum((one.duration * len(one.actors) for one in order.activities), Fraction(0))
        return _Sequence(tasks, stretches, cost, busy, end, last, critical)
