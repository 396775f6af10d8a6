"""The executive's belief: the last observed situation, the goal, the static facts, and the facts in doubt."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from confab.planner.acting.discovery import Discovery
from confab.planner.acting.episode import Surprise
from confab.planner.acting.failure_memory import Static, without_relations
from confab.planner.acting.symbolic_world import met, with_individual, without_individual
from confab.planner.hierarchical.planner import Compiled, compiled
from confab.planner.plan import Reason, Step
from confab.planner.validation import followed
from confab.reasoner.aggregates.totals import following
from confab.reasoner.amounts import DECIMAL
from confab.reasoner.possible import PLACE
from confab.reasoner.problem import Problem
from confab.reasoner.refutations import Refutation, with_refuted
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    Condition,
    EqualityCondition,
    Fact,
    Parameter,
    SituationType,
    State,
    Symbol,
    Times,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.timing import judged_by_events

UNSEEN = "not seen"
"""The value of a symbol of which no value is perceived; no individual has this name."""


@dataclass
class Belief:
    """The planning task according to the executive's belief.

    `problem` contains the situation, the goal, and only the static facts and behaviours that aren't in doubt. `certain` is the same
    problem, but it also contains the static facts and behaviours in doubt. `obstacles` are discovered objects that can't be moved;
    behaviours that would move an obstacle are excluded from `problem` and from `certain`. `withdrawn` and `refuted` contain the
    static facts and the behaviours in doubt. `unseen` are the symbols that the first observation didn't include. `touched` are the
    symbols with rest values that executed steps have changed, each with the number of the first of these steps. `unrestorable`
    are those of them that can't be brought to rest, each with the reason.
    """

    problem: Problem
    withdrawn: set[Static] = field(default_factory=set)
    refuted: dict[Refutation, None] = field(default_factory=dict)
    obstacles: dict[str, Discovery] = field(default_factory=dict)
    unseen: frozenset[Symbol] | None = None
    touched: dict[Symbol, int] = field(default_factory=dict)
    unrestorable: dict[Symbol, Reason] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.certain, self.unobstructed = self.problem, self.problem.domain
        self.times = self.problem.times or Times()

    @cached_property
    def using(self) -> Compiled:
        """The compiled domain; it is compiled at its first use, so that the time counts towards an episode's time limit."""
        return compiled(self.problem)

    @property
    def task(self) -> Problem:
        """The problem from which steps are planned.

        A symbol that had a value at first, and of which no value is perceived, has the value `UNSEEN`. So a behaviour can give it a
        value again, such as lifting a hand that was stopped on its way. Excepted are places, and individuals that have vanished.
        """
        initial, situations = self.problem.initial, self.problem.domain.situations
        there = {symbol.arguments[0] for symbol in initial if symbol.arguments}
        lost = {
            symbol: UNSEEN
            for symbol in self.certain.initial.keys() - initial.keys()
            if symbol.arguments[0] in there and _has_named_values(situations[symbol.situation])
        }
        return replace(self.problem, initial={**initial, **dict(sorted(lost.items()))}) if lost else self.problem

    @property
    def rests(self) -> dict[Symbol, str]:
        """The rest values that executed steps have to restore, except those that can't be restored."""
        return {symbol: rest for symbol, rest in self.restless.items() if symbol not in self.unrestorable}

    @property
    def pursued(self) -> Problem:
        """The task whose goals include the rest values that executed steps have to restore."""
        task, rests = self.task, self.rests
        return replace(task, goal=dict(sorted({**rests, **task.goal}.items()))) if rests else task

    @property
    def restless(self) -> dict[Symbol, str]:
        """The symbols that executed steps have changed and that have to be brought to rest, each with its rest value.

        Left out are symbols that a goal releases, and symbols of which no value is perceived because their object is gone or at no
        perceived place. If steps may overlap by need, a symbol may also have its initial value (docs/levels.md, "In time").
        """
        found, problem = dict[Symbol, str](), self.task
        for symbol in sorted(self.touched):
            rest = problem.domain.situations[symbol.situation].rest or FALSE
            value = problem.initial.get(symbol, FALSE if self.boolean(symbol) else rest)
            back = judged_by_events(problem) and value == self.certain.initial.get(symbol, FALSE)
            if value != rest and not back and not problem.releases(symbol):
                found[symbol] = rest
        return found

    def note_changes(self, number: int, before: State, values: State) -> None:
        """Record the symbols with rest values that step `number` of the executed plan, begun in the situation `before`, changes.

        `values` are the new values of symbols after a primitive of this step. A change inside of a step counts only if it lasts.
        """
        for symbol, value in values.items():
            if self.problem.domain.situations[symbol.situation].rest is None:
                continue
            if value != before.get(symbol, FALSE):
                self.touched.setdefault(symbol, number)
            elif self.touched.get(symbol) == number:
                del self.touched[symbol]

    @property
    def state(self) -> dict[Symbol, str]:
        """The last observed situation."""
        return dict(self.problem.initial)

    @property
    def goal(self) -> dict[Symbol, str]:
        """The current goal."""
        return dict(self.problem.goal)

    @property
    def doubted(self) -> bool:
        """Return whether any fact or behaviour is in doubt."""
        return bool(self.withdrawn or self.refuted)

    def want(self, goal: Mapping[Symbol, str]) -> None:
        """Replace the goal; only wanted goals have deadlines."""
        by = {symbol: seconds for symbol, seconds in self.times.deadlines.items() if symbol in goal}
        times = self.problem.times and replace(self.problem.times, deadlines=by)
        self.problem = replace(self.problem, goal=dict(sorted(goal.items())), times=times)

    def drop_deadlines(self, symbols: Collection[Symbol]) -> None:
        """Forget the deadlines of symbols whose goals get other values."""
        left = {symbol: by for symbol, by in self.times.deadlines.items() if symbol not in symbols}
        self.times = replace(self.times, deadlines=left)

    def boolean(self, symbol: Symbol) -> bool:
        """Return whether a symbol is boolean; a boolean symbol that isn't observed is false."""
        return self.problem.domain.situations[symbol.situation].boolean

    def fault(self, symbol: Symbol, value: str) -> str:
        """Return the reason why an observed value isn't credible, or an empty text if the value is credible."""
        situation = self.problem.domain.situations.get(symbol.situation)
        if situation is None:
            return f"the scene has no situation type {symbol.situation}"
        if len(symbol.arguments) != len(situation.arguments):
            return f"{symbol.situation} is about {len(situation.arguments)} individuals"
        if situation.quantity is not None:
            return "" if DECIMAL.fullmatch(value) else "wanted a number as text"
        if value in (TRUE, FALSE) or value in self.problem.individuals:
            return ""
        values = [TRUE, FALSE] if situation.boolean else sorted(self.problem.members(situation.range))
        listed = ", ".join(values[:8]) + (", …" if len(values) > 8 else "")
        return f"which is no value of {symbol.situation} ({listed})"

    def take_in(self, expected: State, seen: State) -> tuple[Surprise, ...]:
        """Update the belief with an observation, and with the expected values of unobservable symbols; return the differences."""
        if self.unseen is None:
            self.unseen = frozenset(s for s in expected if s not in seen and not self.boolean(s))
        now = {symbol: value for symbol, value in expected.items() if symbol in self.unseen}
        now.update(seen)
        remembers = self.problem.domain.remembers
        now.update((s, v) for s, v in self.problem.initial.items() if s.situation in remembers and v == TRUE)
        now = following(self.problem, now)
        surprises = []
        for symbol in sorted(expected.keys() | now.keys()):
            default = FALSE if self.boolean(symbol) else None
            wanted, found = expected.get(symbol, default), now.get(symbol, default)
            if wanted != found:
                surprises.append(Surprise(symbol, wanted, found))
        self.problem = replace(self.problem, initial=now)
        return tuple(surprises)

    def could_begin(self, step: Step, state: State) -> bool:
        """Return whether a step is applicable in a state; steps that are refined together are applied one after another."""
        return followed(self.problem, step.together, state) is not None

    # ------------------------------------------------------------------------------------------------- knowledge of the scene

    def add(self, individual: str, kind: str) -> None:
        """Add an individual to the belief."""
        self.problem, self.certain = (with_individual(one, individual, kind) for one in (self.problem, self.certain))
        self.using = compiled(self.problem)

    def remove(self, individual: str) -> None:
        """Remove an individual from the belief."""
        self.problem, self.certain = (without_individual(one, individual) for one in (self.problem, self.certain))
        self.using = compiled(self.problem)

    def meet(self, found: Discovery) -> None:
        """Add a discovered individual, and the facts about it, to the belief."""
        self.problem, self.certain = met(self.problem, found), met(self.certain, found)
        if found.fixed:
            self.obstacles[found.individual] = found
            self.certain = _with_obstacle(self.certain, found.individual)
        if found.by is not None:
            self.certain = _without_room(self.certain, found.blocked, found.by)
        self._apply_doubts()

    def without_obstacles(self, goal: Mapping[Symbol, str]) -> Problem:
        """Return the task of reaching a goal, with every obstacle treated as movable."""
        return replace(self.task, domain=self.unobstructed, relations=self.certain.relations, goal=dict(goal))

    # ------------------------------------------------------------------------------------------------- doubts

    def withdraw(self, facts: Iterable[Static] = (), refutations: Iterable[Refutation] = ()) -> None:
        """Put static facts, or the applicability of behaviours, in doubt."""
        self.withdrawn.update(facts)
        self.refuted |= dict.fromkeys(refutations)
        self._apply_doubts()

    def trust_again(self) -> None:
        """Drop all doubts."""
        self.withdrawn.clear()
        self.refuted.clear()
        self._apply_doubts()

    def _apply_doubts(self) -> None:
        known = replace(self.problem, relations=self.certain.relations, domain=self.certain.domain)
        self.problem = with_refuted(without_relations(known, self.withdrawn), self.refuted)
        self.using = compiled(self.problem)


def _has_named_values(situation: SituationType) -> bool:
    """Return whether a situation type has values other than numbers, truth values and places."""
    placed = situation.perceived is not None and situation.perceived.by == PLACE
    return not (situation.boolean or situation.quantity or placed)


def _with_obstacle(problem: Problem, individual: str) -> Problem:
    """Return the problem without the behaviours that would grasp an individual or change its place."""
    behaviors = {}
    for behavior in problem.domain.behaviors.values():
        values = [effect for effect in behavior.effects if isinstance(effect, ValueEffect)]
        changed = {term for effect in values for term in (*effect.arguments, effect.value)}
        never: list[tuple[Condition, ...]] = [
            (EqualityCondition(one.name, individual),)
            for one in _terms(behavior)
            if one.name in changed and individual in problem.classes.get(one.kind, ())
        ]
        behaviors[behavior.name] = _excluding(behavior, never)
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))


def _without_room(problem: Problem, places: Iterable[str], by: Fact) -> Problem:
    """Return the problem in which no behaviour may bring another object to any of `places` while the fact `by` holds."""
    occupant, behaviors = by.symbol.arguments[0], {}
    holds = ValueCondition(by.symbol.situation, by.symbol.arguments, by.value)
    for behavior in problem.domain.behaviors.values():
        kinds = {one.name: one.kind for one in _terms(behavior)}
        never: list[tuple[Condition, ...]] = [
            (EqualityCondition(effect.value, place), EqualityCondition(effect.arguments[0], occupant, True), holds)
            for effect in behavior.effects
            for place in places
            if isinstance(effect, ValueEffect) and effect.situation == by.symbol.situation
            if effect.arguments[0] in kinds and place in problem.classes.get(kinds.get(effect.value, ""), ())
        ]
        behaviors[behavior.name] = _excluding(behavior, never)
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))


def _terms(behavior: Behavior) -> Iterable[Parameter]:
    """Return the parameters of a behaviour, and the variables that its preconditions determine."""
    determined = {c.value for c in behavior.preconditions if isinstance(c, ValueCondition) and not c.negated}
    return (*behavior.parameters, *(one for one in behavior.variables if one.name in determined))


def _excluding(behavior: Behavior, never: Iterable[tuple[Condition, ...]]) -> Behavior:
    """Return a behaviour with additional preconditions: none of the conjunctions in `never` may hold."""
    new = [AnyOf((together,), negated=True) for together in never]
    return replace(behavior, preconditions=(*behavior.preconditions, *new)) if new else behavior
