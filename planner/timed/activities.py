"""The facts that each step of a sequence reads and changes at its begin, throughout its duration, and at its end.

The sequence consists of whole steps, or of begins and ends of steps if some steps are possible only during other steps. The
sequence is simulated once on symbols, and the simulation records the facts that each condition reads.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import TypeAlias

from confab.planner.checked_conditions import Arguments
from confab.planner.plan import Step
from confab.planner.timed.pieces import Pieces, actors_of, default_actors, duration_of, pieces_of, terms_at
from confab.planner.timed.pools import AmountUse, counts_of
from confab.planner.validation import BehaviorReader, Cell, LoggedState
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Behavior, State, Symbol, Times
from confab.reasoner.timing import judged_by_events

ReadAccess: TypeAlias = "tuple[str, object]"
"""A read access: the value of a symbol (situation type and arguments), or all symbols of a situation type with a given value."""


class EventKind(Enum):
    """The kind of an event in a sequence: a step begins, a step ends, or a whole step is executed."""

    BEGIN = "begin"
    END = "end"
    WHOLE = "whole"


StepEvent: TypeAlias = "tuple[int, EventKind]"
"""The number of a step, and the kind of the event."""


class InapplicableError(Exception):
    """A step isn't applicable at its position in the sequence; the message names the step and the reason."""


@dataclass(frozen=True)
class Access:
    """The facts that a step reads and the symbols that the step changes, at one moment or throughout its duration.

    `writes` maps each changed symbol to the old and the new value. `counts` contains the amounts that the step only increases,
    decreases, or compares with fixed numbers.
    """

    reads: frozenset[ReadAccess] = frozenset()
    writes: Mapping[Cell, tuple[str, str]] | None = None
    counts: Mapping[Cell, AmountUse] = field(default_factory=dict)

    @property
    def changes(self) -> Mapping[Cell, tuple[str, str]]:
        """The symbols that change, each with the values before and after."""
        return self.writes or {}


@dataclass(frozen=True)
class Activity:
    """A step with its duration in seconds, its actors, and its accesses."""

    step: Step
    duration: Fraction
    actors: tuple[str, ...]
    begin: Access
    middle: Access
    end: Access
    at: Fraction | None = None
    """The fixed time of a step that is an external event, in seconds, or None for other steps."""

    @property
    def accesses(self) -> tuple[Access, Access, Access]:
        """The accesses at the begin, throughout the duration, and at the end."""
        return self.begin, self.middle, self.end


class ReadRecorder(LoggedState):
    """A view of facts that records each read access."""

    def __init__(self, problem: Problem, rules: BehaviorReader) -> None:
        super().__init__(problem, problem.initial, rules)
        self.reads: dict[ReadAccess, None] = {}

    def value(self, situation: str, arguments: Arguments) -> str | None:
        """Return the value of a symbol, and record the access."""
        self.reads[situation, arguments] = None
        return super().value(situation, arguments)

    def holders(self, situation: str, value: str) -> Iterable[Arguments]:
        """Return the arguments of the symbols with a value, and record the access."""
        self.reads[situation, value] = None
        return list(super().holders(situation, value))

    def begin(self) -> None:
        """Discard the recorded accesses."""
        self.reads = {}
        self._totals.clear()  # so that the facts from which totals follow are read, too
        if self.problem.domain.rules:  # cached derived facts would be read without their reasons
            self._definitions.forget()

    def state(self) -> dict[Symbol, str]:
        """Return the stated facts of the current state, with the totals that follow from them."""
        found = super().state()
        return found | {
            symbol: self.value(symbol.situation, symbol.arguments) or ""
            for symbol in found
            if symbol.situation in self.rules.totals
        }

    def noted(self) -> frozenset[ReadAccess]:
        """Return the facts that were read."""
        rules = self.problem.domain.rules
        return frozenset(key for key in self.reads if key[0] not in rules) if rules else frozenset(self.reads)


def activities(
    problem: Problem, steps: Sequence[Step], events: Iterable[StepEvent], rules: BehaviorReader | None = None
) -> list[Activity]:
    """Return the activities of steps that are executed in the order of events.

    Parameters
    ----------
    problem : Problem
    steps : sequence of Step
        Steps without sub-steps.
    events : iterable of StepEvent
        The events of each step: either the whole step, or the begin and later the end.
    rules : BehaviorReader, optional
        The compiled behaviours of the problem; by default, the behaviours are compiled.

    Raises
    ------
    InapplicableError
        A step isn't applicable at its position in the events.
    """
    course = StepSimulation(problem, steps, rules)
    for number, moment in events:
        check("finding the order that the steps need")
        if moment is not EventKind.END:
            course.begin(number)
        if moment is not EventKind.BEGIN:
            course.end(number)
    return course.found()


def in_sequence(steps: Sequence[Step]) -> Iterator[StepEvent]:
    """Yield the events of whole steps that are executed one after another."""
    yield from ((number, EventKind.WHOLE) for number in range(len(steps)))


class StepSimulation:
    """The simulation of a sequence of steps on symbols."""

    def __init__(self, problem: Problem, steps: Sequence[Step], rules: BehaviorReader | None = None) -> None:
        self.problem, self.steps = problem, steps
        self.rules = rules or BehaviorReader(problem)
        self.facts = ReadRecorder(problem, self.rules)
        self.pieces: dict[str, Pieces] = {}
        self.resting = default_actors(problem)
        self.times = problem.times or Times()
        self.made: list[dict[str, Access]] = [{} for _ in steps]
        self.terms: dict[int, Arguments] = {}
        self.seconds: dict[int, Fraction] = {}
        by_events = judged_by_events(problem) and any(one.quantity for one in problem.domain.situations.values())
        behaviors = problem.domain.behaviors.values()
        self.changing = frozenset[str]().union(*(one.changes for one in behaviors)) if by_events else None

    def piece(self, number: int) -> Pieces:
        """Return the pieces of a step's behaviour."""
        name = self.steps[number].behavior
        if name not in self.pieces:
            self.pieces[name] = pieces_of(self.problem, self.problem.domain.behaviors[name])
        return self.pieces[name]

    def begin(self, number: int) -> None:
        """Begin a step: test its conditions, make the effects of its begin, and store the effects of its end.

        What the conditions of an effect read is read at the begin only, since the begin determines the effects.
        """
        step, pieces = self.steps[number], self.piece(number)
        terms = self.terms[number] = terms_at(self.rules, pieces, step.arguments, self.facts)
        self.facts.begin()
        seconds = duration_of(self.problem, pieces.whole, terms, self.facts)
        if seconds is None:
            raise InapplicableError(
                f"{step} has no duration in its state: the calculation gives no number of 0 or more"
            )
        self.seconds[number] = seconds
        lasting = self.facts.noted()
        begin = self.done(step, pieces.begin, terms, True)
        middle = self.done(step, pieces.middle, terms, False)
        asked = self.done(step, pieces.held, terms, False).reads
        read = lasting | (middle.reads - asked)
        counts = {cell: count for cell, count in begin.counts.items() if cell not in read}
        self.made[number]["begin"] = replace(begin, reads=begin.reads | read, counts=counts)
        self.made[number]["middle"] = replace(middle, reads=asked, counts={})

    def end(self, number: int) -> None:
        """End a step: make the stored effects, test the conditions of its end, and make the effects of its end."""
        if not self.made[number]:
            raise InapplicableError(f"{self.steps[number]}: it hasn't begun")
        for cell, (_, after) in self.made[number]["middle"].changes.items():
            self.facts.put(*cell, after)
        self.made[number]["end"] = self.done(self.steps[number], self.piece(number).end, self.terms[number], True)

    def lost(self, numbers: Iterable[int]) -> list[int]:
        """Return the begun steps whose conditions throughout don't hold any more."""
        found = []
        for number in numbers:
            held = self.piece(number).held
            if held.preconditions and self.rules.changes(held, self.terms[number], self.facts) is None:
                found.append(number)
        return found

    def changes(self, number: int, *parts: str) -> dict[Symbol, str]:
        """Return the symbols that parts of a step (``begin``, ``middle``, ``end``) change, each with its new value."""
        made = [self.made[number].get(part, Access()) for part in parts]
        return {Symbol(*cell): new for one in made for cell, (old, new) in one.changes.items() if old != new}

    def change(self, state: State) -> set[int]:
        """Continue in another state; return the begun steps that read or change a symbol whose value differs in this state."""
        before, self.facts = self.facts.state(), ReadRecorder(replace(self.problem, initial=state), self.rules)
        keys = set[ReadAccess]()
        for symbol in before.keys() | state.keys():
            if before.get(symbol) != state.get(symbol):
                keys.add((symbol.situation, symbol.arguments))
                keys |= {(symbol.situation, value) for value in (before.get(symbol), state.get(symbol))}
        begun = [number for number, made in enumerate(self.made) if made]
        return {n for n in begun if any(keys & {*one.reads, *one.changes} for one in self.made[n].values())}

    def done(self, step: Step, piece: Behavior, terms: Arguments, put: bool) -> Access:
        """Return the reads and changes of a part of a step; if `put` is true, make the changes."""
        if not piece.preconditions and not piece.effects and not piece.amounts:
            return Access()
        facts = self.facts
        facts.begin()
        changes = self.rules.changes(piece, terms, facts)
        reads = facts.noted()
        if changes is None:
            raise InapplicableError(
                f"{step}: its conditions ({piece.name.rsplit('@')[-1]}) don't hold in the state before it"
            )
        before = {(name, key): LoggedState.value(facts, name, key) or "" for name, key, _ in changes}
        writes = {(name, key): (before[name, key], value) for name, key, value in changes}
        if put:
            for cell, (_, value) in writes.items():
                facts.put(*cell, value)
        if self.changing is None:
            return Access(reads, writes)
        return Access(reads, writes, counts_of(piece, terms, writes, self.changing))

    def found(self) -> list[Activity]:
        """Return the activities of all steps."""
        return [
            Activity(
                step,
                self.seconds[number],
                actors_of(self.problem, self.piece(number).whole, self.terms[number], self.resting),
                self.made[number]["begin"],
                self.made[number]["middle"],
                self.made[number]["end"],
                self.times.events.get(step.behavior),
            )
            for number, step in enumerate(self.steps)
        ]
