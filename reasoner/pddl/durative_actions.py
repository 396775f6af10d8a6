"""Export of behaviours in time: durative actions of PDDL 2.1, timed initial literals, and the predicates for actors and windows.

==============================  ===============================================================================================
in the scene                    in PDDL
==============================  ===============================================================================================
condition at the start          at start
condition throughout            at start and over all; without over all if an effect throughout may change its situation type,
                                without at start if an effect at the start may change it
condition at the end            at end
effect at the start             at start
effect throughout               what becomes false at start, what becomes true at end, so that no other action finds either value
effect at the end               at end
actor                           predicate ``idle``, false from start to end
window of availability          predicate ``available`` over all, changed by timed initial literals
external event                  timed initial literals
duration of a refinement        the measured duration, or one second
==============================  ===============================================================================================
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

from confab.reasoner.amounts import written
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import is_variable, situations_of, walk
from confab.reasoner.pddl.formulas import FALSE as NEVER
from confab.reasoner.pddl.formulas import (
    TRUE,
    Atom,
    ConditionalEffect,
    Formula,
    Not,
    NumericTerm,
    PddlTerm,
    Same,
    both,
    change_text,
    conjuncts,
    formula_text,
    number_text,
    typed,
)
from confab.reasoner.pddl.lowering import ActionScope, LoweredAction, Lowering
from confab.reasoner.pddl.vocabulary import PddlNames
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    AmountEffect,
    Behavior,
    Condition,
    Effect,
    Span,
    Symbol,
    Times,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.timing import on_each, timing_of, with_fixed

START, ALL, END = "at start", "over all", "at end"
SECOND = Fraction(1)
"""Duration of a behaviour whose duration is neither stated nor measured, in seconds."""


@dataclass(frozen=True)
class TimedEffect:
    """An effect of a durative action with its time, and the time of its condition."""

    asked: str
    at: str
    change: ConditionalEffect

    def text(self) -> str:
        """Return the PDDL text of the effect."""
        text = f"({self.at} {change_text(ConditionalEffect(self.change.what))})"
        if self.change.when != TRUE:
            text = f"(when ({self.asked} {formula_text(self.change.when)}) {text})"
        return f"(forall ({typed(self.change.variables)}) {text})" if self.change.variables else text


@dataclass(frozen=True)
class DurativeAction:
    """A durative action of PDDL: conditions and effects with their times, and a duration in seconds.

    `places` are the positions of the behaviour's parameters in `parameters`.
    """

    behavior: Behavior
    parameters: tuple[PddlTerm, ...]
    places: tuple[int, ...]
    duration: NumericTerm
    conditions: tuple[tuple[str, Formula], ...]
    effects: tuple[TimedEffect, ...]
    cost: NumericTerm = Fraction(1)

    @property
    def needs(self) -> Formula:
        """All conditions without their times."""
        return both(formula for _, formula in self.conditions)

    @property
    def changes(self) -> tuple[ConditionalEffect, ...]:
        """All effects without their times."""
        return tuple(effect.change for effect in self.effects)

    def text(self, name: str) -> str:
        """Return the PDDL text of the action; of two opposite effects at one time, only the positive one is written."""
        inner = "\n      "
        opposite = {
            replace(one, change=replace(one.change, what=Not(one.change.what)))
            for one in self.effects
            if isinstance(one.change.what, Atom)
        }
        conditions = dict.fromkeys(f"({at} {formula_text(one)})" for at, one in self.conditions)
        effects = dict.fromkeys(one.text() for one in self.effects if one not in opposite)
        return (
            f"  (:durative-action {name}\n    :parameters ({typed(self.parameters)})\n"
            f"    :duration (= ?duration {number_text(self.duration)})\n"
            f"    :condition (and{inner}{inner.join(conditions)})\n"
            f"    :effect (and{inner}{inner.join(effects)}))"
        )


@dataclass(frozen=True)
class TimedParts:
    """The parts of a behaviour in time.

    `begin` has the effects at the start, `pending` those throughout, and `end` those at the end. `held` has only the conditions
    throughout that hold between the start and the end.
    """

    behavior: Behavior
    begin: Behavior
    pending: Behavior
    held: Behavior
    end: Behavior

    def __iter__(self) -> Iterator[Behavior]:
        """Yield the parts in their order in time."""
        yield from (self.begin, self.pending, self.held, self.end)


def parts_of(problem: Problem, behavior: Behavior) -> TimedParts:
    """Return the parts of a behaviour; their parameters include the variables that the preconditions determine."""
    timing, own = timing_of(behavior), with_fixed(behavior)

    def part(name: str, conditions: Sequence[Condition], effects: Sequence[Effect] = ()) -> Behavior:
        every = on_each(effects, problem.classes)
        return replace(
            own,
            name=f"{behavior.name}@{name}",
            preconditions=tuple(one for one in conditions if one not in (behavior.lasting, behavior.priced)),
            effects=tuple(one for one in every if isinstance(one, ValueEffect)),
            amounts=tuple(one for one in every if isinstance(one, AmountEffect)),
            price=None,
            timing=None,
        )

    def unchanged(span: Span) -> tuple[Condition, ...]:
        changed = {effect.situation for effect in timing.made(span)}
        throughout = timing.asked(Span.THROUGHOUT)
        return tuple(one for one in throughout if not any(situations_of(inner) & changed for inner in walk(one)))

    before, held = (*timing.asked(Span.START), *unchanged(Span.START)), unchanged(Span.THROUGHOUT)
    passing = list(_passing(problem, behavior))
    unread = [one for one in passing if _is_unread(problem, one)]
    moved = [one for one in timing.made(Span.END) if any(_same(one, other) for other in unread)]
    meanwhile = [ValueCondition(e.situation, e.arguments, e.value) for e in passing if e not in unread]
    return TimedParts(
        behavior,
        part("start", before, [e for e in timing.made(Span.START) if not any(_same(e, one) for one in moved)]),
        part("pending", before, [*timing.made(Span.THROUGHOUT), *moved]),
        part("held", held),
        part(
            "end",
            (*held, *meanwhile, *timing.asked(Span.END)),
            [e for e in timing.made(Span.END) if e not in moved],
        ),
    )


def _passing(problem: Problem, behavior: Behavior) -> Iterator[ValueEffect]:
    """Yield the effects at the start that give symbols a value until the end, when another effect changes the symbols again."""
    timing = timing_of(behavior)
    for one in timing.made(Span.START):
        if isinstance(one, AmountEffect) or one.when or one.each or problem.domain.situations[one.situation].boolean:
            continue
        again = [last for last in timing.made(Span.END) if _same(one, last)]
        if again and not any(last.when or last.each for last in again):
            yield one


def _same(one: Effect, other: Effect) -> bool:
    return (one.situation, one.arguments) == (other.situation, other.arguments)


def _is_unread(problem: Problem, effect: ValueEffect) -> bool:
    """Return whether nothing depends on the value of an effect: no condition, goal or initial fact has this value."""
    facts = (*problem.initial.items(), *problem.goal.items())
    if any(symbol.situation == effect.situation and value == effect.value for symbol, value in facts):
        return False
    rules = (rule.behavior for its in problem.domain.rules.values() for rule in its)
    totals = (one.behavior for one in problem.domain.aggregates.values())
    for behavior in (*problem.domain.behaviors.values(), *rules, *totals):
        timed = (condition for _, condition in timing_of(behavior).conditions)
        for condition in (*behavior.conditions, *timed):
            for part in walk(condition):
                if effect.situation not in situations_of(part):
                    continue
                if not isinstance(part, ValueCondition) or effect.value in _denoted(problem, behavior, part.value):
                    return False
    return True


def _denoted(problem: Problem, behavior: Behavior, term: str) -> frozenset[str]:
    kind = behavior.kinds.get(term)
    return frozenset((term,)) if kind is None else problem.members(kind)


def _once(problem: Problem, event: Behavior) -> Behavior:
    """Return an external event without those preconditions that hold until the event itself, which happens once."""
    others = [one for one in problem.domain.behaviors.values() if one.name != event.name]

    def changed(symbol: Symbol) -> bool:
        about = [e for one in others for e in one.every_effect if e.situation == symbol.situation]
        return any(e.arguments == symbol.arguments or any(map(is_variable, e.arguments)) for e in about)

    def holds(condition: Condition) -> bool:
        if not isinstance(condition, ValueCondition) or any(map(is_variable, (*condition.arguments, condition.value))):
            return False
        symbol = Symbol(condition.situation, condition.arguments)
        value = problem.initial.get(symbol, FALSE)
        return not changed(symbol) and (value == condition.value) is not condition.negated

    left = tuple(one for one in event.preconditions if not holds(one))
    return replace(event, preconditions=left, timing=None)


class TimedExport:
    """The durative actions of behaviours, and the initial facts and timed initial literals that they need.

    `workers` are the individuals that are actors if no behaviour names its actors.
    """

    def __init__(
        self, problem: Problem, behaviors: Sequence[Behavior], words: PddlNames, workers: Collection[str]
    ) -> None:
        self.problem, self.words, self.workers = problem, words, workers
        self.times = problem.times or Times()
        self.parts = [parts_of(problem, one) for one in behaviors if one.name not in self.times.events]
        self.events = [_once(problem, one) for one in behaviors if one.name in self.times.events]
        self.lowering = Lowering(problem, [*(part for parts in self.parts for part in parts), *self.events], words)
        self.actors: dict[str, None] = {}
        self.limited: dict[str, None] = {}

    def actions(self) -> Iterator[DurativeAction]:
        """Yield the durative actions, one for each case of the conditions of a behaviour's effects."""
        for parts in self.parts:
            for begin, pending, end in product(
                *(list(self.lowering.cases_of(part)) for part in (parts.begin, parts.pending, parts.end))
            ):
                found = self.action(replace(parts, begin=begin, pending=pending, end=end))
                if found is not None:
                    yield found

    def action(self, parts: TimedParts) -> DurativeAction | None:
        """Return the durative action of a behaviour, or None if the behaviour is never applicable or has no effect."""
        lowered, taken = list[LoweredAction](), set[str]()
        for part in parts:
            one = self.lowering.lowered(part, taken)
            if one.needs == NEVER or not all(term.members for term in one.parameters):
                return None
            taken.update(term.name for term in one.parameters[len(part.parameters) :])
            lowered.append(one)
        begin, pending, held, end = lowered
        if not any(one.changes for one in lowered):
            return None
        terms = {p.name: begin.parameters[at] for p, at in zip(parts.begin.parameters, begin.places, strict=True)}
        duration, lasting = self.duration(parts.behavior, terms)
        still = conjuncts(held.needs)
        conditions = [(START, one) for one in (*conjuncts(begin.needs), *conjuncts(pending.needs), *lasting)]
        conditions += [(START if self.static(one) else ALL, one) for one in still]
        conditions += [(START if self.static(one) else END, one) for one in conjuncts(end.needs) if one not in still]
        effects = [TimedEffect(START, START, change) for change in begin.changes]
        for change in pending.changes:
            effects.append(TimedEffect(START, START if isinstance(change.what, Not) else END, change))
        effects += [TimedEffect(END, END, change) for change in end.changes]
        acting = self.acting(parts.behavior, terms)
        for idle in map(self.idle, acting):
            conditions.append((START, idle))
            effects += [
                TimedEffect(START, START, ConditionalEffect(Not(idle))),
                TimedEffect(END, END, ConditionalEffect(idle)),
            ]
        limited = (term for term in (*terms.values(), *acting) if not term.members.isdisjoint(self.times.windows))
        conditions += [(ALL, self.available(term)) for term in limited]
        parameters = tuple(dict.fromkeys(term for one in lowered for term in one.parameters))
        names = [term.name for term in parameters]
        places = tuple(names.index(terms[p.name].name) for p in parts.behavior.parameters)
        return DurativeAction(parts.behavior, parameters, places, duration, tuple(conditions), tuple(effects))

    def static(self, formula: Formula) -> bool:
        """Return whether no action changes the truth of a formula: an equality, or an atom of a static predicate."""
        inner = formula.inner if isinstance(formula, Not) else formula
        return isinstance(inner, Same) or (isinstance(inner, Atom) and inner.predicate in self.words.statics)

    def duration(self, behavior: Behavior, terms: dict[str, PddlTerm]) -> tuple[NumericTerm, list[Formula]]:
        """Return the duration of a behaviour, and the conditions that it is a number of at least 0."""
        stated, scope = timing_of(behavior).duration, ActionScope(behavior.kinds)
        if stated is None:
            return self.times.measured.get(behavior.name, SECOND), []
        return self.lowering.not_negative(stated, terms, scope), scope.needs

    def acting(self, behavior: Behavior, terms: dict[str, PddlTerm]) -> list[PddlTerm]:
        """Return the terms of a behaviour's actors: those that it names, or else the first parameter for a worker."""
        stated = timing_of(behavior).actors
        if stated:
            return list(self.words.terms(stated, terms))
        return [terms[p.name] for p in behavior.parameters if not terms[p.name].members.isdisjoint(self.workers)][:1]

    def idle(self, term: PddlTerm) -> Atom:
        """Return the atom which states that an actor takes part in no action."""
        self.actors.update(dict.fromkeys(sorted(term.members)))
        return self.words.atom(self.words.name("predicate", "idle actors", "idle"), (term,))

    def available(self, term: PddlTerm) -> Atom:
        """Return the atom which states that an individual is available."""
        self.limited.update(dict.fromkeys(sorted(term.members)))
        return self.words.atom(self.words.name("predicate", "available individuals", "available"), (term,))

    def facts(self) -> Iterator[Atom]:
        """Yield the initial facts: actors are idle, and individuals are available whose windows have begun."""
        yield from (self.idle(self.words.object(one)) for one in [*self.actors])
        for one in [*self.limited]:
            windows = self.times.windows.get(one, ((Fraction(0), None),))
            if any(begin <= 0 and (end is None or end > 0) for begin, end in windows):
                yield self.available(self.words.object(one))

    def literals(self) -> Iterator[tuple[Fraction, str]]:
        """Yield the times and the texts of the timed initial literals: the windows and the external events.

        Raises
        ------
        KnowledgeError
            An external event depends on the state, which timed initial literals can't.
        """
        for one in self.limited:
            for begin, end in self.times.windows.get(one, ()):
                text = formula_text(self.available(self.words.object(one)))
                if begin > 0:
                    yield begin, text
                if end is not None and end > 0:
                    yield end, f"(not {text})"
        for behavior in self.events:
            found = self.lowering.lowered(behavior)
            if found.parameters or found.needs != TRUE or any(change.when != TRUE for change in found.changes):
                raise KnowledgeError(
                    f"the external event {behavior.name} depends on the state, which a timed initial literal of PDDL can't; "
                    "state an event without conditions, or export without times"
                )
            yield from ((self.times.events[behavior.name], change_text(change)) for change in found.changes)


def literal_text(at: Fraction, text: str) -> str:
    """Return a timed initial literal.

    Raises
    ------
    KnowledgeError
        No decimal number states the time exactly.
    """
    if "/" in (number := written(at)):
        raise KnowledgeError(f"{text} at {number} s, which no decimal number of PDDL states exactly")
    return f"(at {number} {text})"
