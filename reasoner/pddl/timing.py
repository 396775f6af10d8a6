"""Translation of durative actions to behaviours with a duration, and of timed initial literals to behaviours at fixed times."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Protocol

from confab.reasoner.amounts import Expression
from confab.reasoner.pddl.declarations import Action, Pddl
from confab.reasoner.pddl.durative import Durative
from confab.reasoner.pddl.forms import NumericEffect, PddlEffect, conjuncts, effects_of, numeric_of, words_of
from confab.reasoner.pddl.words import Form, PddlWord
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    Behavior,
    Condition,
    SituationType,
    Span,
    Symbol,
    Times,
    Timing,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.symbols import Effect as AnyEffect

SPANS = {"start": Span.START, "all": Span.THROUGHOUT, "end": Span.END}
MOMENT, PASSED = "Moment", "Passed"  # no names of PDDL, which have no capital letters


class QuantifiedVariables(Protocol):
    """Protocol for the quantified variables of one behaviour, which `confab.reasoner.pddl.importing` implements."""

    def condition(
        self, form: Form, named: Mapping[str, str] | None = None, negated: bool = False
    ) -> Iterator[Condition]:
        """Yield conditions whose conjunction is equivalent to a PDDL formula, or to its negation if `negated`."""


class TimedNames(Protocol):
    """Protocol for the names and translations of a problem, which `confab.reasoner.pddl.importing` implements."""

    pddl: Pddl
    level: int

    def name(self, kind: str, pddl_name: str, wanted: str | None = None) -> str:
        """Return the problem's name for a PDDL name of the given kind."""

    def simplified(self, conditions: Iterable[Condition]) -> tuple[Condition, ...] | None:
        """Return a conjunction without the conjuncts that always hold; return None if the conjunction never holds."""

    def number(self, item: PddlWord | Form, named: Mapping[str, str]) -> Expression:
        """Return the translation of a number, a function or an arithmetic expression."""

    def value_effects(
        self, effects: Sequence[PddlEffect], variables: QuantifiedVariables, conditions: Sequence[Condition]
    ) -> tuple[ValueEffect, ...]:
        """Return the effects on values that are equivalent to PDDL effects on atoms."""

    def amount_effects(
        self,
        effects: Sequence[NumericEffect],
        variables: QuantifiedVariables,
        conditions: Sequence[Condition],
    ) -> tuple[AmountEffect, ...]:
        """Return the effects on amounts that are equivalent to PDDL effects on functions."""


def timing(table: TimedNames, parts: Durative, variables: QuantifiedVariables) -> Timing | None:
    """Return the duration, conditions and effects of a durative action; return None if the action is never applicable."""
    asked: list[tuple[Span, Condition]] = []
    made: list[tuple[Span, AnyEffect]] = []
    for span, at in SPANS.items():
        forms = [one for its, form in parts.conditions if its == span for one in conjuncts(form)]
        found = table.simplified(c for form in forms for c in variables.condition(form))
        if found is None:
            return None
        asked += [(at, one) for one in found]
    for span in ("start", "end"):
        forms = [form for at, form in parts.effects if at == span]
        values = tuple(effect for form in forms for effect in effects_of(form))
        numbers = tuple(effect for form in forms for effect in numeric_of(form))
        own = tuple(c for at, c in asked if at is SPANS[span] or (at is Span.THROUGHOUT and span == "end"))
        made += [(SPANS[span], one) for one in table.value_effects(values, variables, own)]
        made += [(SPANS[span], one) for one in table.amount_effects(numbers, variables, own)]
    return Timing(table.number(parts.duration, {}), (), tuple(dict.fromkeys(asked)), tuple(made))


def snapped(pddl: Pddl, effects: Mapping[str, Sequence[PddlEffect]]) -> tuple[Pddl, dict[str, tuple[PddlEffect, ...]]]:
    """Return a domain with a start action and an end action for each durative action; also return the effects of all actions.

    Invariant synthesis works on the returned domain. The synthesis recognises a deletion only if the same action requires the
    deleted fact. If the start of an action adds no fact, its deletions and their conditions are moved to the end of the action. The
    end may then add a fact in place of a deleted fact.
    """
    actions: dict[str, Action] = {}
    found: dict[str, tuple[PddlEffect, ...]] = {}
    for name, action in pddl.actions.items():
        parts = action.durative
        if parts is None:
            actions[name], found[name] = action, tuple(effects[name])
            continue
        asked = {
            span: [one for at, form in parts.conditions if at in its for one in conjuncts(form)]
            for span, its in (("start", ("start",)), ("end", ("all", "end")))
        }
        made = {
            span: [one for at, form in parts.effects if at == span for one in effects_of(form)]
            for span in ("start", "end")
        }
        taken = [e for e in made["start"] if not e.true]
        kept = [] if any(e.true for e in made["start"]) else taken
        held = [form for form in asked["start"] if words_of(form) in {e.atom for e in kept}]
        for span, forms, own in (
            ("start", asked["start"], made["start"]),
            ("end", [*asked["end"], *held], [*made["end"], *kept]),
        ):
            key = f"{name} {span}"
            actions[key] = replace(action, name=key, precondition=_all(forms, action.place), durative=None)
            found[key] = tuple(own)
    return replace(pddl, actions=actions), found


def _all(forms: Sequence[Form], place: PddlWord) -> Form | None:
    return Form((PddlWord("and", place.line, place.column), *forms), place.line, place.column) if forms else None


def happenings(
    table: TimedNames,
    variables: QuantifiedVariables,
    situations: dict[str, SituationType],
    classes: dict[str, tuple[str, ...]],
) -> tuple[list[Behavior], dict[Symbol, str], Times | None]:
    """Return the behaviours for timed initial literals, a goal, and the times of the behaviours.

    The behaviours are in the order of their times. The goal for timed initial literals states that the last of their behaviours
    has happened.
    """
    pddl = table.pddl
    moments = sorted({time for time, _, _ in pddl.timed})
    if not moments:
        return [], {}, None
    kind = table.name("type", MOMENT, MOMENT)
    passed = table.name("situation", PASSED, PASSED.upper())
    names = [table.name("object", f"moment {i}", f"moment_{i}") for i in range(1, len(moments) + 1)]
    classes[kind] = tuple(names)
    situations[passed] = SituationType(passed, (kind,), "Truth", default=FALSE, boolean=True)
    behaviors, times, before = [], dict[str, Fraction](), dict[str, ValueCondition]()
    for number, (time, name) in enumerate(zip(moments, names, strict=True), start=1):
        its = tuple(PddlEffect(atom, true) for at, atom, true in pddl.timed if at == time)
        effects = (*table.value_effects(its, variables, ()), ValueEffect(passed, (name,), TRUE))
        asked = (*before.values(), ValueCondition(passed, (name,), FALSE))
        action = table.name("action", f"happening {number}", f"HAPPENING_{number}")
        spans = tuple((Span.END, effect) for effect in effects)
        lies = Timing(Fraction(0), (), tuple((Span.START, condition) for condition in asked), spans)
        behaviors.append(Behavior(action, table.level, (), (), asked, effects, 0.0, timing=lies))
        times[action] = time
        before = {passed: ValueCondition(passed, (name,), TRUE)}
    goal = {Symbol(passed, (name,)): TRUE for name in names[-1:]}
    return behaviors, goal, Times(events=times)
