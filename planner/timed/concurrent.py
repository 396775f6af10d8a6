"""Plans that require concurrency: the begins and the ends of steps are operators of a grounded task.

Some behaviours give a symbol a value only during their execution. The planner splits a behaviour of this kind into a begin and
an end. Other behaviours are split only if the planner finds no plan without these splits. A first search ignores durations, and
its plan is scheduled. If the plan has no schedule, a second search keeps a simple temporal network of events. The network
contains the events since the last time at which no step was running (the *window*). The second search drops nodes in which a
step can't end in time. The heuristic is the length of a relaxed plan plus the number of running steps.

The method follows Coles, Fox, Long and Smith, "Planning with problems requiring temporal coordination", AAAI 2008. The rule that
some behaviours needn't be split is due to Coles et al., "Extending the use of inference in temporal planning as forwards search",
ICAPS 2009.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import lcm
from time import perf_counter
from typing import TypeAlias

from confab.planner.grounded.best_first import search
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.hff import heuristic
from confab.planner.grounded.task import Task
from confab.planner.plan import OUT_OF_MEMORY, Counts, Limits, Outcome, Plan, Reason, Status, Step, UngroundableError
from confab.planner.timed.activities import EventKind, StepEvent
from confab.planner.timed.call import Timed, in_time
from confab.planner.timed.envelopes import dominated, excluding, intersection, oversized
from confab.planner.timed.pieces import duration_of
from confab.planner.timed.plan import TimedOutcome
from confab.planner.validation import Cell, LoggedState
from confab.reasoner.language import walk
from confab.reasoner.limits import OutOfTimeError, check, checked
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    Behavior,
    Effect,
    Fact,
    SituationType,
    Span,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.timing import fixed_at_begin, given_itself, only_during, projected, timing_of, with_fixed

BEGIN, END, RUNNING, HELD, BUSY = "@begin", "@end", "@running", "@held", "@busy"
FIRST = 0.5
"""Share of the remaining time for each search without durations."""
MOST_STATES = 300_000
"""Maximum number of states of the search with durations."""
_StateKey: TypeAlias = "tuple[int, tuple[int, ...]]"


def plan(problem: Problem, limits: Limits, separation: Fraction = Fraction(0)) -> tuple[Outcome, Timed]:
    """Return a timed plan whose steps may have to run concurrently.

    Parameters
    ----------
    problem : Problem
        A problem with one level.
    limits : Limits
    separation : Fraction
        The minimum time between conflicting events, in seconds.

    Returns
    -------
    Outcome
        The outcome with the steps in the order of their begins; the status is never unsolvable.
    Timed
        The timed plan, or the reason why no timed plan was found.
    """
    began = perf_counter()

    def ended(reason: str) -> tuple[Outcome, Timed]:
        said = Reason(reason)
        return Outcome(Status.GAVE_UP, reason=said, seconds=perf_counter() - began), Timed(reason=said)

    if len(problem.domain.levels) > 1:
        return ended(
            "steps that need concurrent steps can be planned only on scenes with one level; this scene has more"
        )
    deadline = limits.end()
    some, every = only_during(problem), frozenset(name for name, b in problem.domain.behaviors.items() if b.timing)
    counts, limited, refused = Counts(), False, None
    try:
        for names, guarded in ((some, True), (some, False), (every, False)):
            cut = _Cut(problem, names, guarded)
            task = ground(cut.problem, deadline=deadline) if names else Reason("nothing is cut")
            if isinstance(task, Reason):
                continue
            finder = _Finder(cut, task, separation, deadline, counts)
            for found in finder.without_durations(limits) if guarded else finder.in_time():
                steps, events = cut.steps(task, found)
                left = None if deadline is None else max(deadline - perf_counter(), 0.0)
                timed = in_time(problem, steps, left, separation, events)
                refused = timed.reason or refused
                if timed.plan is not None:
                    seconds = perf_counter() - began
                    its = TimedOutcome(
                        Status.SOLVED,
                        timed.plan.plan,
                        search={task.level: counts},
                        seconds=seconds,
                        timed=timed.plan,
                    )
                    return its, timed
            limited = limited or finder.limited
    except (UngroundableError, OutOfTimeError) as error:
        return ended(str(error))
    except MemoryError:
        return ended(OUT_OF_MEMORY.text)
    if refused is not None:
        return ended(f"no plan was found whose concurrent steps have a schedule; of the last one tried, {refused.text}")
    return ended(
        f"no plan with concurrent steps was found in {MOST_STATES} states"
        if limited
        else "no plan with concurrent steps was found"
    )


@dataclass(frozen=True)
class _Cut:
    """A problem in which some behaviours are split into a begin and an end.

    If `guarded`, a split behaviour reserves the symbols that it requires throughout its duration. No other behaviour may change
    or reserve a reserved symbol.
    """

    whole: Problem
    behaviors: frozenset[str]
    guarded: bool = False

    @cached_property
    def problem(self) -> Problem:
        """The problem in which begins and ends replace the split behaviours."""
        domain = self.whole.domain
        situations, behaviors = dict(domain.situations), dict[str, Behavior]()
        situations[BUSY] = SituationType(BUSY, (BUSY,), "Truth", default=FALSE, boolean=True)
        for name, behavior in domain.behaviors.items():
            if name not in self.behaviors:
                idle = [ValueCondition(*cell, FALSE) for cell in self.busy(behavior)]
                behaviors[name] = replace(behavior, preconditions=(*behavior.preconditions, *idle), timing=None)
                continue
            kinds = tuple(parameter.kind for parameter in with_fixed(behavior).parameters)
            running = SituationType(name + RUNNING, kinds, "Truth", default=FALSE, boolean=True)
            situations[running.name] = running
            for part in self.parts(behavior, running):
                behaviors[part.name] = part
        if self.guarded:
            for name in sorted(self.held()):
                situations[name + HELD] = replace(
                    domain.situations[name], name=name + HELD, range="Truth", rest=None, default=FALSE, boolean=True
                )
            behaviors = {name: self.guard(behavior) for name, behavior in behaviors.items()}
        every = dict.fromkeys(one for its in self.whole.classes.values() for one in its)
        return replace(
            self.whole,
            domain=replace(domain, situations=situations, behaviors=behaviors, first_ids={}),
            classes={**self.whole.classes, BUSY: tuple(every)},
        )

    def busy(self, behavior: Behavior) -> list[Cell]:
        """Return the symbols that state whether the actors of a behaviour are in a step; actors that are variables are left out."""
        unknown = {variable.name for variable in behavior.variables}
        return [(BUSY, (actor,)) for actor in timing_of(behavior).actors if actor not in unknown]

    def held(self) -> frozenset[str]:
        """Return the situation types that split behaviours require throughout and that other behaviours change."""
        behaviors = self.whole.domain.behaviors
        return frozenset(
            situation
            for name in self.behaviors
            for situation, _ in self.asked(name)
            if any(situation in other.changes for other in behaviors.values() if other.name != name)
        )

    def asked(self, name: str) -> list[tuple[str, tuple[str, ...]]]:
        """Return the symbols that a split behaviour requires throughout its duration."""
        asked = timing_of(self.whole.domain.behaviors[name]).asked(Span.THROUGHOUT)
        return [(c.situation, c.arguments) for c in asked if isinstance(c, ValueCondition)]

    def guard(self, behavior: Behavior) -> Behavior:
        """Return a behaviour with additional preconditions, so that it changes no reserved symbol.

        The begin of a split behaviour reserves symbols, and the end of the behaviour releases these symbols.
        """
        name, _, part = behavior.name.partition("@")
        held = self.held()
        own = [cell for cell in self.asked(name) if cell[0] in held] if part else []
        changed = [(e.situation, e.arguments) for e in behavior.every_effect if e.situation in held and not e.each]
        free = [cell for cell in changed if cell not in own] if f"@{part}" == END else [*changed, *own]
        conditions = [ValueCondition(situation + HELD, arguments, FALSE) for situation, arguments in free]
        value = FALSE if f"@{part}" == END else TRUE
        effects = [ValueEffect(situation + HELD, arguments, value) for situation, arguments in own]
        return replace(
            behavior,
            preconditions=tuple(dict.fromkeys((*behavior.preconditions, *conditions))),
            effects=tuple(dict.fromkeys((*behavior.effects, *effects))),
        )

    def parts(self, behavior: Behavior, running: SituationType) -> Iterator[Behavior]:
        """Yield the begin and the end of a behaviour as two behaviours."""
        timing, own = timing_of(behavior), with_fixed(behavior)
        its = tuple(parameter.name for parameter in own.parameters)
        begun = [(Span.START, e) for e in timing.made(Span.START)]
        asked, _ = projected([one for one in timing.conditions if one[0] is not Span.END], begun)
        asked = given_itself(
            behavior, asked, (Span.START, Span.THROUGHOUT), self.whole.domain.situations, self.whole.classes
        )
        marks = [(running.name, its), *self.busy(behavior)]
        free = [ValueCondition(*cell, FALSE) for cell in marks]
        made = (*timing.made(Span.START), *(ValueEffect(*cell, TRUE) for cell in marks))
        yield _behavior(own, behavior.name + BEGIN, (*asked, *free), made)
        pending = [(Span.THROUGHOUT, e) for e in timing.made(Span.THROUGHOUT)]
        last, _ = projected([(Span.END, c) for c in timing.asked(Span.END)], pending)
        last = given_itself(
            behavior, last, (Span.END,), self.whole.domain.situations, self.whole.classes, since=Span.THROUGHOUT
        )
        held = (*timing.asked(Span.THROUGHOUT), *last)
        made = (*timing.made(Span.THROUGHOUT), *timing.made(Span.END), *(ValueEffect(*cell, FALSE) for cell in marks))
        ended = _behavior(own, behavior.name + END, (*held, replace(free[0], value=TRUE)), made)
        yield replace(ended, cost=0.0, price=None)

    def steps(self, task: Task, operators: Sequence[int]) -> tuple[Plan, list[StepEvent]]:
        """Return the steps of a sequence of operators, in the order of their begins, and the events of the steps."""
        steps: list[Step] = []
        events: list[StepEvent] = []
        open_: dict[tuple[str, tuple[str, ...]], int] = {}
        for operator in operators:
            name, arguments, bindings = task.describe(operator)
            behavior, _, part = name.partition("@")
            if f"@{part}" == END:
                events.append((open_.pop((behavior, arguments)), EventKind.END))
                continue
            number, whole = len(steps), self.whole.domain.behaviors[behavior]
            if part:
                open_[behavior, arguments] = number
                arguments, determined = arguments[: len(whole.parameters)], arguments[len(whole.parameters) :]
                fixed = (variable.name[1:] for variable in fixed_at_begin(whole))
                bindings = {**bindings, **dict(zip(fixed, determined, strict=True))}
            identity = self.whole.id_of(behavior, arguments)
            steps.append(Step((number,), identity, task.level, behavior, arguments, bindings))
            events.append((number, EventKind.BEGIN if part else EventKind.WHOLE))
        return Plan(tuple(steps)), events


def _behavior(behavior: Behavior, name: str, conditions: Sequence[object], effects: Sequence[Effect]) -> Behavior:
    return replace(
        behavior,
        name=name,
        preconditions=tuple(dict.fromkeys(conditions)),  # type: ignore[arg-type]
        effects=tuple(e for e in effects if isinstance(e, ValueEffect)),
        amounts=tuple(e for e in effects if isinstance(e, AmountEffect)),
        timing=None,
    )


def _runs(fact: Fact) -> bool:
    return fact.symbol.situation.endswith(RUNNING)


@dataclass(frozen=True)
class _SnapAction:
    """An event: the number of its step, whether the step begins or ends, and the symbols that are read and changed."""

    step: int
    begins: bool
    ends: bool
    reads: int
    writes: int


@dataclass(frozen=True)
class _SearchNode:
    """A search node: a state, the events of the window, the durations of the steps, and the running steps."""

    state: int
    window: tuple[_SnapAction, ...]
    lasts: tuple[int, ...]
    running: Mapping[tuple[int, ...], int]  # the operators that can end a step, and the step's number in the window
    held: int  # bits that running steps require throughout their durations


@dataclass
class _Finder:
    """The search for sequences of operators of a task with split behaviours."""

    cut: _Cut
    task: Task
    separation: Fraction
    deadline: float | None
    counts: Counts = field(default_factory=Counts)
    limited: bool = False
    """Whether the search with durations has ended at `MOST_STATES`."""
    accesses: dict[int, tuple[int, int]] = field(default_factory=dict)
    """The stored results of `access`, by operator."""
    places: dict[tuple[str, tuple[str, ...]], int] = field(default_factory=dict)
    """The bit of each symbol that an operator reads or sets."""

    def __post_init__(self) -> None:
        operators = range(len(self.task))
        self.named = [self.task.describe(one)[:2] for one in checked(operators, "naming the operators")]
        self.ends_of = defaultdict[tuple[str, tuple[str, ...]], tuple[int, ...]](tuple)
        for operator, (name, arguments) in enumerate(self.named):
            if name.endswith(END):
                self.ends_of[name.partition("@")[0], arguments] += (operator,)
        seconds = [self._seconds(*one) for one in checked(self.named, "finding the durations of the operators")]
        self.unit = Fraction(1, lcm(self.separation.denominator, *(s.denominator for s in seconds)))
        self.lasts = [int(s / self.unit) for s in seconds]
        self.apart = int(self.separation / self.unit)
        self.marks = sum(1 << bit for bit, fact in enumerate(self.task.facts) if _runs(fact) and fact.value == TRUE)
        self.ends = [self.ending(one) if name.endswith(BEGIN) else () for one, (name, _) in enumerate(self.named)]
        self.oversized = oversized(self.task, self.ends, self.lasts, self.apart, self.held)

    def _seconds(self, name: str, arguments: tuple[str, ...]) -> Fraction:
        whole = self.cut.whole
        behavior = whole.domain.behaviors[name.partition("@")[0]]
        found = duration_of(whole, behavior, arguments, self.facts)
        return Fraction(0) if found is None else found

    @cached_property
    def facts(self) -> LoggedState:
        """The facts of the initial state, which determine the durations during the search."""
        return LoggedState(self.cut.whole, self.cut.whole.initial)

    def without_durations(self, limits: Limits) -> Iterator[list[int]]:
        """Yield sequences of operators from searches that ignore durations. No step is running at the end of a sequence.

        The first search uses only the longest of several steps that differ only in their durations. If a step that is
        running in the end can't end, a search with the goal that no step is running follows.
        """
        idle = sum(1 << bit for bit, fact in self.task.complements.items() if _runs(fact))
        shorter = dominated(self.task, self.ends, self.lasts, self.marks | idle)
        for never in (shorter, set[int]()) if shorter else (shorter,):
            task = excluding(self.task, never | self.oversized, self.marks | idle)
            for one in (task, replace(task, goal=task.goal | idle)):
                first = search(one, limits, limits.until(self.deadline).end(FIRST))
                self.counts.add(first.counts)
                whole = self.completed(list(first.plan)) if first.status is Status.SOLVED else None
                if whole is not None:
                    yield whole
                if whole is not None or first.status is not Status.SOLVED:
                    break

    def ending(self, operator: int) -> tuple[int, ...]:
        """Return the operators that can end the step to which an operator belongs.

        There are several if the end has a condition with alternatives, or determines a variable.
        """
        name, arguments = self.named[operator]
        return self.ends_of[name.partition("@")[0], arguments]

    def completed(self, operators: list[int]) -> list[int] | None:
        """Return operators followed by the ends of the running steps, or None if an end is impossible or undoes a goal."""
        state, _ = self.task.carried_out(self.task.initial, operators)
        if not state & self.marks:
            return operators
        open_ = dict.fromkeys(
            self.ending(operator) for operator in operators if self.named[operator][0].endswith(BEGIN)
        )
        for ends in open_:
            afters = ((end, self.task.applied(state, end)) for end in ends)
            made = [(end, after) for end, after in afters if after is not None]
            for end, after in [one for one in made if one[1] & self.task.goal == self.task.goal][:1]:
                state, operators = after, [*operators, end]
        return None if state & self.marks else operators

    def in_time(self) -> Iterator[list[int]]:
        """Yield sequences of operators that a search with durations finds."""
        task, evaluate = self.task, heuristic(self.task)
        root = _SearchNode(task.initial, (), (), {}, 0)
        began = evaluate(task.initial)
        if began is None:
            return
        came_from: dict[_StateKey, tuple[_StateKey, int] | None] = {}
        key = self.key(root)
        came_from[key] = None
        number = 0
        queue: list[tuple[int, int, int, _SearchNode, list[int]]] = [(began.h, 0, 0, root, began.ranked()[0])]
        while queue:
            check("searching for concurrent steps", 0.0)
            if self.deadline is not None and perf_counter() > self.deadline:
                raise OutOfTimeError("the time limit was reached while searching for concurrent steps")
            if len(came_from) >= MOST_STATES:
                self.limited = True
                return
            h, tries, _, node, operators = heapq.heappop(queue)
            for position, operator in enumerate(operators):
                after = self.after(node, operator)
                self.counts.generated += 1
                if after is None or (next_key := self.key(after)) in came_from:
                    continue
                came_from[next_key] = self.key(node), operator
                if after.state & task.goal == task.goal and not after.running:
                    yield self.path(came_from, next_key)
                found = evaluate(after.state)
                self.counts.evaluated += 1
                if found is None:
                    continue
                self.counts.expanded += 1
                number += 1
                rank = found.h + len(after.running)
                heapq.heappush(queue, (rank, 0, -number, after, found.ranked()[0]))
                if rank < h:
                    rest = operators[position + 1 :]
                    if rest:
                        heapq.heappush(queue, (h, tries + 1, -number, node, rest))
                    break

    def key(self, node: _SearchNode) -> _StateKey:
        """Return the identity of a node: the state, and the `waiting` time of each running step."""
        busy = sorted((ends[0], self.waiting(node, step)) for ends, step in node.running.items())
        return node.state, tuple(number for pair in busy for number in pair)

    def waiting(self, node: _SearchNode, step: int) -> int:
        """Return the minimum time from the begin of a running step to the events that its end must wait for."""
        ends = next(ends for ends, its in node.running.items() if its == step)
        times = self.times(node, {ends: step})
        return 0 if times is None else times[-1]

    def after(self, node: _SearchNode, operator: int) -> _SearchNode | None:
        """Return the node after an operator, or None if the node isn't allowed.

        A node isn't allowed if the operator is inapplicable, violates a condition of a running step, or delays the end of a running
        step too long.
        """
        task = self.task
        state = task.applied(node.state, operator)
        if state is None or state == node.state:
            return None
        reads, writes = self.access(operator)
        name = self.named[operator][0]
        running, lasts, window = dict(node.running), node.lasts, node.window
        if name.endswith(END):
            step = running.pop(self.ending(operator))
            window = (*window, _SnapAction(step, False, True, reads, writes))
        else:
            begins = name.endswith(BEGIN)
            step, lasts = len(lasts), (*lasts, self.lasts[operator])
            window = (*window, _SnapAction(step, True, not begins, reads, writes))
            if begins:
                ends = self.ending(operator)
                if not ends:
                    return None
                running[ends] = step
        held = 0
        for ends in running:
            held |= self.held(ends)
        kept = node.held & ~self.held(self.ending(operator)) if name.endswith(END) else node.held
        if kept & ~state:
            return None
        if not running:
            if node.running and self.times(_SearchNode(state, window, lasts, {}, 0), {}) is None:
                return None
            return _SearchNode(state, (), (), {}, 0)
        found = _SearchNode(state, window, lasts, running, held)
        return found if self.times(found, running) is not None else None

    def access(self, operator: int) -> tuple[int, int]:
        """Return the symbols that an operator reads, and the symbols that it sets, as two masks.

        The masks include symbols that the operator sets to their old value.
        """
        if operator not in self.accesses:
            name, arguments = self.named[operator]
            behavior = self.cut.whole.domain.behaviors[name.partition("@")[0]]
            timing, part = timing_of(behavior), name.partition("@")[2]
            left_out = {"begin": Span.END, "end": Span.START}.get(part)
            terms = {p.name: a for p, a in zip(with_fixed(behavior).parameters, arguments, strict=False)}
            terms |= {f"?{name}": value for name, value in self.task.describe(operator)[2].items()}
            effects = [
                e for span, e in timing.effects if span is not left_out and (part != "begin" or span is Span.START)
            ]
            asked = [c for span, c in timing.conditions if span is not left_out]
            every = [one for c in (*asked, *(c for e in effects for c in e.when)) for one in walk(c)]
            read = [(c.situation, c.arguments) for c in every if isinstance(c, ValueCondition)]
            self.accesses[operator] = (
                self.bits(read, terms),
                self.bits([*((e.situation, e.arguments) for e in effects), *self.cut.busy(behavior)], terms),
            )
        return self.accesses[operator]

    def bits(self, cells: Iterable[tuple[str, tuple[str, ...]]], terms: Mapping[str, str]) -> int:
        """Return the mask of the given symbols; in these symbols, the individuals in `terms` replace variables."""
        found = 0
        for situation, arguments in cells:
            cell = situation, tuple(terms.get(a, a) for a in arguments)
            found |= 1 << self.places.setdefault(cell, len(self.places))
        return found

    def held(self, ends: tuple[int, ...]) -> int:
        """Return the bits that every end of a running step requires, or 0 if the behaviour has separate conditions at its end."""
        whole = self.cut.whole.domain.behaviors[self.named[ends[0]][0].partition("@")[0]]
        return 0 if timing_of(whole).asked(Span.END) else intersection(self.task.changes_of(end)[0] for end in ends)

    def times(self, node: _SearchNode, ending: Mapping[tuple[int, ...], int]) -> list[int] | None:
        """Return the earliest begin of each step of a node, given that the running steps in `ending` end in any order.

        The last entry is the time from the begin of the first ending step to the events that its end must wait for. Return None if
        a step would end too late.
        """
        events = list(node.window)
        for ends, step in ending.items():
            reads, writes = map(intersection, zip(*map(self.access, ends), strict=True))
            events.append(_SnapAction(step, False, True, reads, writes))
        arcs: list[tuple[int, int, int]] = []
        lasts = node.lasts
        for j, later in enumerate(events):
            for earlier in node.window[:j]:
                if earlier.step == later.step or not (
                    earlier.writes & (later.reads | later.writes) or earlier.reads & later.writes
                ):
                    continue
                high = lasts[earlier.step] if earlier.ends else 0
                low = 0 if later.begins else lasts[later.step]
                arcs.append((earlier.step, later.step, high - low + self.apart))
        begins = [0] * len(lasts)
        for _ in range(len(lasts) + 1):
            changed = False
            for i, j, least in arcs:
                if begins[i] + least > begins[j]:
                    begins[j] = begins[i] + least
                    changed = True
            if not changed:
                first = next(iter(ending.values()), None)
                waits = [begins[i] + least + lasts[j] - begins[j] for i, j, least in arcs if j == first]
                return [*begins, max(waits, default=0)]
        return None

    def path(
        self,
        came_from: Mapping[_StateKey, tuple[_StateKey, int] | None],
        key: _StateKey,
    ) -> list[int]:
        """Return the operators on the path to a node."""
        found = []
        while (step := came_from[key]) is not None:
            key, operator = step
            found.append(operator)
        return found[::-1]
