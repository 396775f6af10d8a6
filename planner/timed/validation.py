"""The checker of timed plans; it shares `pieces.py` and the reading of facts with the scheduler (docs/levels.md, "In time").

The checker simulates the primitives on symbols at their times. At each instant, ends come before begins. Every condition is
evaluated at the times that its span requires. A condition with the span `throughout` is evaluated again after every event. A value
is pending while a running step is changing it. If another step reads or changes a pending value, the plan has a fault.

If overlapping steps may reach more goals, these events alone determine whether the plan is valid. Otherwise the steps also have
to be a valid plan in sequence, with the same effects.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from confab.planner.checked_conditions import Arguments
from confab.planner.plan import Plan, Step
from confab.planner.timed.pieces import Pieces, actors_of_step, default_actors, duration_of, pieces_of, terms_at
from confab.planner.timed.plan import Slot, TimedPlan
from confab.planner.validation import (
    BehaviorReader,
    Cell,
    Fault,
    LoggedState,
    NewValue,
    exceptions_of,
    fitting,
    validate,
    violation,
    wrong_ids,
)
from confab.reasoner.amounts import meets
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Behavior, Symbol, Times
from confab.reasoner.timing import judged_by_events


def validate_timed(
    problem: Problem, timed: TimedPlan, separation: Fraction = Fraction(0), executed: bool = False
) -> list[Fault]:
    """Return the faults of a timed plan; the list is empty for a valid plan.

    Parameters
    ----------
    problem : Problem
    timed : TimedPlan
    separation : Fraction
        The minimum time between conflicting events, in seconds (epsilon in PDDL).
    executed : bool
        Whether the times come from an execution, so that durations may differ from the stated durations.
    """
    sequence = None
    if judged_by_events(problem):
        faults = wrong_ids(problem, timed.plan)
        for step in timed.plan.steps:
            if step.steps or step.joined or not fitting(problem, step):
                faults.append(
                    Fault(step.path, f"{step}: no such behaviour, or its parameters don't take these arguments")
                )
    else:
        faults = validate(problem, timed.plan)
        sequence = _in_sequence(problem, timed.plan.primitives)
    if [slot.step for slot in timed.slots] != list(timed.plan.primitives):
        faults.append(Fault((), "the schedule isn't of the plan's primitives"))
    return faults or list(_TimedExecution(problem, timed, separation, sequence, executed).run())


def omitted(problem: Problem, timed: TimedPlan) -> dict[str, Fraction]:
    """Return the external events that a timed plan omits although it lasts until their times, in the order of the times."""
    events = (problem.times or Times()).events
    its = {slot.step.behavior for slot in timed.slots}
    missing = {name: at for name, at in events.items() if name not in its and at <= timed.makespan}
    return dict(sorted(missing.items(), key=lambda one: one[1]))


def validate_in_sequence(problem: Problem, plan: Plan) -> list[Fault]:
    """Return the faults of a plan if its primitives begin and end one after another, without regard to times."""
    slots = tuple(Slot(step, Fraction(i), Fraction(i + 1)) for i, step in enumerate(plan.primitives))
    return validate_timed(replace(problem, times=None), TimedPlan(plan, slots), executed=True)


@dataclass
class _Running:
    """A running step: its slot, its pieces, the terms of the pieces, and the pending values."""

    slot: Slot
    pieces: Pieces
    terms: Arguments
    making: list[NewValue]
    number: int


class _Watched(LoggedState):
    """A view of facts that records two kinds of reads: the value of a symbol, and all symbols with a given value."""

    def __init__(self, problem: Problem, rules: BehaviorReader) -> None:
        super().__init__(problem, problem.initial, rules)
        self.cells: set[Cell] = set()
        self.values: set[tuple[str, str]] = set()

    def value(self, situation: str, arguments: Arguments) -> str | None:
        self.cells.add((situation, arguments))
        return super().value(situation, arguments)

    def holders(self, situation: str, value: str) -> Iterable[Arguments]:
        self.values.add((situation, value))
        return list(super().holders(situation, value))

    def clear(self) -> None:
        self.cells, self.values = set(), set()
        self._totals.clear()  # so that the facts from which totals follow are read, too
        if self.problem.domain.rules:
            self._definitions.forget()


Effects = tuple[tuple[Cell, str], ...]


def _in_sequence(problem: Problem, steps: Sequence[Step]) -> tuple[list[Effects], dict[Cell, int]]:
    """Return the changes of each step of a sequence, and the last step that changes each symbol.

    Derived amounts are left out, because they follow from the other changes.
    """
    rules, facts = BehaviorReader(problem), LoggedState(problem, problem.initial)
    found, last, derived = list[Effects](), dict[Cell, int](), problem.domain.aggregates.keys()
    for number, step in enumerate(steps):
        changes = rules.changes(problem.domain.behaviors[step.behavior], step.arguments, facts) or []
        net = {(situation, key): value for situation, key, value in changes}
        for cell, value in net.items():
            facts.put(*cell, value)
            if cell[0] not in derived:
                last[cell] = number
        found.append(tuple(sorted((cell, value) for cell, value in net.items() if cell[0] not in derived)))
    return found, last


class _TimedExecution:
    """The simulation of a timed plan on symbols."""

    def __init__(
        self,
        problem: Problem,
        timed: TimedPlan,
        separation: Fraction,
        sequence: tuple[list[Effects], dict[Cell, int]] | None,
        executed: bool,
    ) -> None:
        self.problem, self.timed, self.separation, self.sequence = problem, timed, separation, sequence
        self.executed = executed
        self.rules = BehaviorReader(problem)
        self.facts = _Watched(problem, self.rules)
        self.exceptions = exceptions_of(problem, self.facts)
        self.times = problem.times or Times()
        self.resting = default_actors(problem)
        self.running: dict[int, _Running] = {}
        self.pieces: dict[str, Pieces] = {}
        self.made: dict[int, dict[Cell, str]] = {}
        self.last: dict[Cell, int] = {}
        self.since: dict[Cell, Fraction] = {}  # time at which a step last set a symbol
        self.met: dict[Symbol, Fraction] = {}  # time from which a goal with a deadline holds
        self.asked: dict[Cell, Fraction] = {}  # time at which a step last read a symbol
        self.read_by: dict[Cell, int] = {}

    def run(self) -> Iterator[Fault]:
        """Yield the faults, until a step is inapplicable."""
        yield from self.actors()
        yield from self.happenings()
        slots = self.timed.slots
        # At the same instant, ends come before begins. Steps without duration begin and end at once, in the plan's order.
        events = sorted(
            [(s.begin, 1, n, 0) for n, s in enumerate(slots)]
            + [(s.end, 1 if s.begin == s.end else 0, n, 1) for n, s in enumerate(slots)]
        )
        self.look(Fraction(0))
        for time, _, number, which in events:
            check("checking the plan in time")
            faults = list(self.ended(number, time) if which else self.begun(number, slots[number], time))
            yield from faults
            if faults:
                return
            self.look(time)
            broken = [f for one in self.running.values() if one.number != number for f in self.holds(one)]
            if self.sequence is None and (found := violation(self.rules, self.facts, self.exceptions)) is not None:
                broken.append(Fault(slots[number].step.path, f"{slots[number].step}: {found}"))
            yield from broken
            if broken:
                return
        yield from self.in_the_end()

    def said(self, seconds: Fraction) -> str:
        """Return a time, counted from the beginning of the plan of the whole task, as text."""
        return f"{float(self.times.since + seconds):g}"

    def piece(self, name: str) -> Pieces:
        if name not in self.pieces:
            self.pieces[name] = pieces_of(self.problem, self.problem.domain.behaviors[name])
        return self.pieces[name]

    def actors(self) -> Iterator[Fault]:
        """Yield the actors in two steps at once, the steps that overlap with themselves, and the unavailable individuals."""
        lanes: dict[str, list[Slot]] = {}
        for slot in self.timed.slots:
            its = actors_of_step(self.problem, slot.step, self.resting)
            for one in its or (str(slot.step),):
                lanes.setdefault(one, []).append(slot)
            for one in dict.fromkeys((*slot.step.arguments, *its)):
                windows = self.times.windows.get(one)
                if windows is not None and not any(
                    low <= slot.begin and (high is None or slot.end <= high) for low, high in windows
                ):
                    yield Fault(
                        slot.step.path,
                        f"{slot.step}: {one} isn't available from {self.said(slot.begin)} to {self.said(slot.end)} s",
                    )
        for actor, its_slots in sorted(lanes.items()):
            busy: Slot | None = None
            for slot in sorted(its_slots, key=lambda s: (s.begin, s.end)):
                if busy is not None and slot.begin < busy.end:
                    yield Fault(slot.step.path, f"{slot.step}: {actor} is in {busy.step} until {self.said(busy.end)} s")
                busy = slot if busy is None or slot.end >= busy.end else busy

    def happenings(self) -> Iterator[Fault]:
        """Yield the external events that the plan repeats, or that it omits although it lasts until their times."""
        its = defaultdict[str, list[Step]](list)
        for slot in self.timed.slots:
            its[slot.step.behavior].append(slot.step)
        for name, at in self.times.events.items():
            for again in its[name][1:]:
                yield Fault(again.path, f"{again}: it happens only once, at {self.said(at)} s")
        for name, at in omitted(self.problem, self.timed).items():
            yield Fault((), f"{name} happens at {self.said(at)} s, before the plan ends, and isn't in the plan")

    def begun(self, number: int, slot: Slot, time: Fraction) -> Iterator[Fault]:
        """Begin a step; yield its faults."""
        step, pieces, facts = slot.step, self.piece(slot.step.behavior), self.facts
        fixed = self.times.events.get(step.behavior)
        if fixed is not None and fixed != time:
            yield Fault(step.path, f"{step}: it happens at {self.said(fixed)} s, not at {self.said(time)} s")
        terms = terms_at(self.rules, pieces, step.arguments, facts)
        facts.clear()
        seconds = duration_of(self.problem, pieces.whole, terms, facts)
        if seconds is None or (slot.end - slot.begin != seconds and not self.executed):
            yield Fault(step.path, f"{step}: it takes {slot.end - slot.begin} s here; its duration is {seconds} s")
            return
        one = _Running(slot, pieces, terms, [], number)
        self.made[number] = {}
        yield from self.foreign(one, [], time)
        yield from self.done(one, pieces.begin, time)
        facts.clear()
        making = self.rules.changes(pieces.middle, terms, facts)
        if making is None:
            yield Fault(
                step.path, f"{step}: a condition throughout the step doesn't hold at its begin ({self.said(time)} s)"
            )
            return
        yield from self.foreign(one, [(name, key) for name, key, _ in making], time)
        one.making = making
        self.running[number] = one

    def ended(self, number: int, time: Fraction) -> Iterator[Fault]:
        """End a step; yield its faults."""
        one = self.running.pop(number)
        self.facts.clear()
        for name, key, value in one.making:
            self.put(one, (name, key), value, time)
        yield from self.done(one, one.pieces.end, time)
        if self.sequence is not None:
            wanted = dict(self.sequence[0][number])
            if self.made[number] != wanted:
                cells = sorted({c for c, _ in self.made[number].items() ^ wanted.items()})
                yield Fault(
                    one.slot.step.path, f"{one.slot.step}: it changes {cells[0][0]} in another way than in sequence"
                )

    def done(self, one: _Running, piece: Behavior, time: Fraction) -> Iterator[Fault]:
        """Execute the begin or the end of a step; yield its faults."""
        if not piece.preconditions and not piece.effects and not piece.amounts:
            return
        self.facts.clear()
        changes = self.rules.changes(piece, one.terms, self.facts)
        if changes is None:
            what = piece.name.rsplit("@")[-1]
            yield Fault(
                one.slot.step.path, f"{one.slot.step}: a condition ({what}) doesn't hold at {self.said(time)} s"
            )
            return
        yield from self.foreign(one, [(name, key) for name, key, _ in changes], time)
        for name, key, value in changes:
            self.put(one, (name, key), value, time)

    def put(self, one: _Running, cell: Cell, value: str, time: Fraction) -> None:
        """Set the value of a symbol, and record the step and the time."""
        self.facts.put(*cell, value)
        if cell[0] not in self.problem.domain.aggregates:
            self.made[one.number][cell] = value
        self.last[cell] = one.number
        self.since[cell] = time

    def look(self, time: Fraction) -> None:
        """Record from which time on each goal with a deadline holds."""
        for goal in self.times.deadlines:
            if goal in self.problem.goal:
                if not meets(self.value_of(goal), self.problem.goal[goal]):
                    self.met.pop(goal, None)
                else:
                    self.met.setdefault(goal, time)

    def value_of(self, goal: Symbol) -> str:
        self.facts.clear()
        return self.facts.value(goal.situation, goal.arguments) or FALSE

    def foreign(self, one: _Running, changed: Sequence[Cell], time: Fraction) -> Iterator[Fault]:
        """Yield a fault if a step conflicts with another step.

        A step conflicts with another step if the step reads or changes a pending value of the other step. A step also conflicts if
        another step has accessed the same symbol less than the minimum separation ago.
        """
        read, values = set(self.facts.cells), set(self.facts.values)
        for other in self.running.values():
            if other.number == one.number:
                continue
            for name, key, value in other.making:
                old = LoggedState.value(self.facts, name, key)
                if (name, key) in read or (name, key) in changed or {(name, old), (name, value)} & values:
                    yield Fault(
                        one.slot.step.path,
                        f"{one.slot.step}: {other.slot.step} is changing {name} of {', '.join(key)} at {self.said(time)} s",
                    )
                    return
        for cell in (read | set(changed)) if self.separation else ():
            if cell in self.since and self.last.get(cell) != one.number and time - self.since[cell] < self.separation:
                yield Fault(
                    one.slot.step.path, f"{one.slot.step}: {cell[0]} of {', '.join(cell[1])} changed immediately before"
                )
                return
            asked_by_another = cell in changed and self.read_by.get(cell, one.number) != one.number
            if asked_by_another and time - self.asked[cell] < self.separation:
                yield Fault(one.slot.step.path, f"{one.slot.step}: {cell[0]} was read immediately before")
                return
        for cell in read if self.separation else ():
            self.asked[cell], self.read_by[cell] = time, one.number

    def holds(self, one: _Running) -> Iterator[Fault]:
        """Yield a fault if a condition that a running step requires throughout no longer holds."""
        if one.pieces.middle.preconditions:
            self.facts.clear()
            if self.rules.changes(one.pieces.middle, one.terms, self.facts) is None:
                yield Fault(one.slot.step.path, f"{one.slot.step}: a condition throughout the step ceases to hold")

    def in_the_end(self) -> Iterator[Fault]:
        """Yield a fault for each goal that isn't reached in time.

        Also yield a fault for each symbol whose last change comes from another step than in the sequential plan. Without a
        sequential plan, yield a fault for each changed symbol that has neither its rest value nor its initial value.
        """
        for symbol, wanted in self.problem.goal.items():
            got = self.value_of(symbol)
            if not meets(got, wanted):
                yield Fault((), f"the goal {symbol} = {wanted} isn't reached: it is {got} in the end")
            latest, since = self.times.deadlines.get(symbol), self.met.get(symbol)
            if latest is not None and since is not None and since > latest:
                yield Fault(
                    (),
                    f"the goal {symbol} = {wanted} is reached at {self.said(since)} s; it has to be by {self.said(latest)} s",
                )
        if self.sequence is not None:
            for cell, number in sorted(self.sequence[1].items()):
                if self.last.get(cell) != number:
                    yield Fault((), f"{cell[0]} of {', '.join(cell[1])} gets its last value from another step")
            return
        for situation, arguments in sorted(self.last):
            symbol, rest = Symbol(situation, arguments), self.problem.domain.situations[situation].rest
            value = self.facts.value(situation, arguments)
            sees = self.problem.first_level(symbol) <= self.problem.domain.levels[0]
            if (
                sees
                and not self.problem.releases(symbol)
                and value not in (rest or value, self.problem.initial.get(symbol, FALSE))
            ):
                yield Fault((), f"the plan touches {symbol} and leaves it {value}; at rest it is {rest}")
