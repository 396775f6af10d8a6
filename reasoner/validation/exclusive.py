"""Validation rule on exclusive values: no behaviour may give an exclusive value to a second individual.

The ontology declares exclusive values by ``e:exclusive`` of a perceiver, for example that at most one hand holds an
object. A behaviour that gives an exclusive value to an individual must ensure, by one of three alternatives, that no other
individual has the value. Each level is checked separately.

- *free*: The preconditions require that no individual has the value.
- *handed over*: The same behaviour takes the value from the individual that has the value.
- *taken*: The value is an object in a state in which no individual has the object, and the same behaviour ends this state. For
  example, a cup at a place is in no hand. The behaviour that gives the cup to a hand also takes the cup from its place, and each
  behaviour that brings a cup to a place takes the cup from a hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Behavior,
    Condition,
    EqualityCondition,
    ValueCondition,
    ValueEffect,
    Witness,
)
from confab.reasoner.validation.case import Fault, ReadCase


def values_not_kept_exclusive(case: ReadCase) -> Iterator[Fault]:
    """Find behaviours that can give an exclusive value to a second individual."""
    problem, names = case.problem, case.names
    for situation in problem.domain.situations.values():
        if situation.perceived is None or not situation.perceived.exclusive or len(situation.arguments) != 1:
            continue
        (kind,) = situation.arguments
        if problem.initial and len(problem.classes.get(kind, ())) < 2:
            continue  # the class has no second individual
        checked = _Exclusive(problem, situation.name, kind, frozenset(v for _, v in situation.perceived.special))
        for level in problem.domain.levels:
            for behavior, what, remedy in checked.broken(problem.domain.at_level(level)):
                yield (
                    names.iri(behavior.name),
                    what,
                    f"physics gives each value of {situation.name} to one {kind} at a time (e:{situation.perceived.by} is "
                    "e:exclusive), so that such a plan fails when it is carried out",
                    remedy,
                )


@dataclass(frozen=True)
class _Taken:
    """A state of an object in which no individual has the object as its value, such as a cup at a place.

    In this state, the symbol of type `situation` of the object has a value in the class `kind`, or the value `value`.
    """

    situation: str
    kind: str
    value: str


@dataclass(frozen=True)
class _Exclusive:
    """A situation type whose values belong to at most one individual of `kind` at a time, except the values in `shared`."""

    problem: Problem
    situation: str
    kind: str
    shared: frozenset[str]

    def broken(self, behaviors: Sequence[Behavior]) -> Iterator[tuple[Behavior, str, str]]:
        """Yield the behaviours of a level that may give a value to a second individual, each with the effect and a remedy."""
        open_: list[tuple[Behavior, ValueEffect]] = [
            (behavior, effect)
            for behavior in behaviors
            for effect in self.given(behavior)
            if not self.free(behavior, effect.when, effect.value, effect.arguments[0])
            and not self.handed_over(behavior, effect)
        ]
        for behavior, effect in open_:
            alternatives = [*self.taken(behavior, effect)]
            if any(not [*self.breaking(excluding, behaviors)] for excluding in alternatives):
                continue
            if len(alternatives) == 1 and behavior.name not in {
                other.name for other, _ in self.breaking(alternatives[0], behaviors)
            }:
                for other, does in self.breaking(alternatives[0], behaviors):
                    yield (
                        other,
                        f"{other.name} {does} while a {self.kind} may have the same {self.situation}; "
                        f"{behavior.name} then gives this value to a second {self.kind}",
                        f"add a value condition to {other.name} that names the {self.kind} with this value, and an effect "
                        f"that changes its {self.situation}",
                    )
                continue
            value = effect.value.lstrip("?")
            yield (
                behavior,
                f"after {behavior.name}, two individuals of {self.kind} can have the same {self.situation} ({value})",
                f"add the precondition that no {self.kind} has this value: a c:AbsenceCondition with c:ofClass {self.kind}, "
                f"c:situationType {self.situation} and c:value {value}",
            )

    def given(self, behavior: Behavior) -> Iterator[ValueEffect]:
        """Yield the effects of a behaviour that give an exclusive value."""
        for effect in behavior.effects:
            if effect.situation == self.situation and effect.value not in self.shared:
                yield effect

    def free(self, behavior: Behavior, when: Sequence[Condition], value: str, own: str = "") -> bool:
        """Return whether the conditions require that no individual, except possibly `own`, has a value."""
        return any(self._none_has(c, value, own) for c in (*behavior.preconditions, *when))

    def _none_has(self, condition: Condition, value: str, own: str) -> bool:
        rules = self.problem.domain.rules
        match condition:
            case Witness(variable, kind, inner, True):
                has = ValueCondition(self.situation, (variable,), value)
                other = {EqualityCondition(variable, own, True), EqualityCondition(own, variable, True)}
                return self.problem.below(self.kind, kind) and has in inner and {*inner} <= {has, *other}
            case ValueCondition(situation, (about,), truth, negated):
                return (about, truth, negated) in ((value, TRUE, True), (value, FALSE, False)) and any(
                    any(self._has(c, rule.parameters[0].name) for c in rule.conditions) and len(rule.conditions) == 1
                    for rule in rules.get(situation, ())
                )
            case _:
                return False

    def _has(self, condition: Condition, value: str) -> bool:
        match condition:
            case ValueCondition(self.situation, (_,), of, False):
                return of == value
            case Witness(variable, kind, (ValueCondition(self.situation, (about,), of, False),), False):
                return about == variable and of == value and self.problem.below(self.kind, kind)
            case _:
                return False

    def handed_over(self, behavior: Behavior, effect: ValueEffect) -> bool:
        """Return whether the individual with an effect's value loses the value, or is the individual that gets the value."""
        (own,) = effect.arguments
        return any(
            holder == own or self.releases(behavior, effect.when, holder, effect.value)
            for holder in self.holders(behavior, effect.when, effect.value)
        )

    def holders(self, behavior: Behavior, when: Sequence[Condition], value: str) -> Iterator[str]:
        """Yield the terms that, according to the conditions, have a given value."""
        for condition in (*behavior.preconditions, *when):
            match condition:
                case ValueCondition(self.situation, (holder,), of, False) if of == value:
                    yield holder
                case _:
                    pass

    def releases(self, behavior: Behavior, when: Sequence[Condition], holder: str, value: str) -> bool:
        """Return whether a behaviour gives `holder` a value other than `value` whenever the conditions `when` hold."""
        return any(
            (effect.situation, effect.arguments) == (self.situation, (holder,))
            and effect.value != value
            and {*effect.when} <= {*when}
            for effect in behavior.effects
        )

    def taken(self, behavior: Behavior, effect: ValueEffect) -> Iterator[_Taken]:
        """Yield the states of an effect's value (`_Taken`) that the behaviour ends."""
        for condition in (*behavior.preconditions, *effect.when):
            match condition:
                case ValueCondition(situation, (about,), before, False) if about == effect.value:
                    excluding = _Taken(situation, behavior.kinds.get(before, ""), before if before[:1] != "?" else "")
                    if situation != self.situation and self.leaves(excluding, behavior, effect):
                        yield excluding
                case _:
                    pass

    def leaves(self, excluding: _Taken, behavior: Behavior, effect: ValueEffect) -> bool:
        """Return whether an effect's value is in the state `excluding` before the behaviour and not after the behaviour."""
        return self.before(excluding, effect.value, behavior, effect) and any(
            (e.situation, e.arguments) == (excluding.situation, (effect.value,))
            and {*e.when} <= {*effect.when}
            and not self.may_be_inside(excluding, e.value, behavior)
            for e in behavior.effects
        )

    def before(self, excluding: _Taken, about: str, behavior: Behavior, effect: ValueEffect) -> bool:
        """Return whether the conditions of an effect require that an object is in the state `excluding`."""
        return any(
            isinstance(c, ValueCondition)
            and (c.situation, c.arguments, c.negated) == (excluding.situation, (about,), False)
            and self.inside(excluding, c.value, behavior)
            for c in (*behavior.preconditions, *effect.when)
        )

    def breaking(self, excluding: _Taken, behaviors: Sequence[Behavior]) -> Iterator[tuple[Behavior, str]]:
        """Yield behaviours after which an individual may have a value in the state `excluding`, each with its effect in words."""
        for behavior in behaviors:
            for effect in self.given(behavior):
                if not self.handed_over(behavior, effect) and not self.leaves(excluding, behavior, effect):
                    yield behavior, f"gives {self.situation} the value {effect.value.lstrip('?')}"
            for effect in behavior.effects:
                if effect.situation != excluding.situation or len(effect.arguments) != 1:
                    continue
                if not self.may_be_inside(excluding, effect.value, behavior):
                    continue
                (about,) = effect.arguments
                stays = self.before(excluding, about, behavior, effect)
                let_go = any(
                    self.releases(behavior, effect.when, holder, about)
                    for holder in self.holders(behavior, effect.when, about)
                )
                if not stays and not let_go and not self.free(behavior, effect.when, about):
                    said = f"{excluding.situation} of {about.lstrip('?')} the value {effect.value.lstrip('?')}"
                    yield behavior, f"gives {said}"

    def inside(self, excluding: _Taken, term: str, behavior: Behavior) -> bool:
        """Return whether a term certainly denotes one of the values that define the state `excluding`."""
        if term[:1] == "?":
            return bool(excluding.kind) and self.problem.below(behavior.kinds.get(term, ""), excluding.kind)
        return term == excluding.value or term in self.problem.classes.get(excluding.kind, ())

    def may_be_inside(self, excluding: _Taken, term: str, behavior: Behavior) -> bool:
        """Return whether a term may denote one of the values that define the state `excluding`."""
        if term[:1] != "?":
            return self.inside(excluding, term, behavior)
        kind = behavior.kinds.get(term, "")
        members = {*self.problem.classes.get(kind, ())}
        if excluding.value:
            return excluding.value in members
        both = self.problem.below(kind, excluding.kind) or self.problem.below(excluding.kind, kind)
        return both or not members.isdisjoint(self.problem.classes.get(excluding.kind, ()))
