"""Export of a behaviour as the SPARQL update that `confab.reasoner.updates.compiling` compiles to the same behaviour.

The first line of WHERE states the parameters with their types; each further line states one condition. The type of a determined
variable follows the condition that determines the variable. The type is omitted if the variable may have every value of the
situation type.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, written
from confab.reasoner.effects import made_of
from confab.reasoner.language import substituted, walk
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    ValueCondition,
    ValueEffect,
    Witness,
)

CHANGES = {"increase": "+", "decrease": "-", "scale": "*"}
Spell = Callable[[str], str]
"""A function that returns the notation of an individual, class or property."""


@dataclass(frozen=True)
class Situations:
    """Properties of situation types that determine their notation in an update.

    `properties` maps a situation type to its value property, if it has one. `pairs` contains the situation types with several
    values per subject.
    """

    properties: Mapping[str, str]
    pairs: Collection[str]


def update(behavior: Behavior, situations: Situations, spell: Spell, labels: Sequence[str] = ()) -> str:
    """Return a behaviour as a SPARQL update.

    Parameters
    ----------
    behavior : Behavior
    situations : Situations
        Properties of situation types; the keys are the names of situation types in the behaviour.
    spell : callable
        A function that returns the notation of a name, e.g. ``:cup1``.
    labels : sequence of str
        Labels of the preconditions in their order; they become comments.
    """
    writer = _UpdateWriter(behavior, situations, spell)
    behavior = _by_their_class(behavior)
    (_, effects), *conditional = _operations(behavior)
    operations = [writer.main(effects, labels), *(writer.conditional(when, made) for when, made in conditional)]
    return " ;\n".join(operations) + "\n"


def _by_their_class(behavior: Behavior) -> Behavior:
    """Return a behaviour in which effects on all members of a class mention the class itself, as in updates."""
    effects = [effect if effect.each is None else made_of(effect, effect.each.kind) for effect in behavior.every_effect]
    return replace(
        behavior,
        effects=tuple(e for e in effects if isinstance(e, ValueEffect)),
        amounts=tuple(e for e in effects if isinstance(e, AmountEffect)),
    )


def _operations(behavior: Behavior) -> list[tuple[tuple[Condition, ...], list[ValueEffect | AmountEffect]]]:
    """Return the conditions and effects of each operation; the first operation has only the preconditions as conditions.

    Operations are in the order of the effects. An effect that makes a fact false is added to an existing operation that has the
    same conditions.
    """
    found: list[tuple[tuple[Condition, ...], list[ValueEffect | AmountEffect]]] = [((), [])]
    for effect in (e for e in behavior.effects if e.value != FALSE):
        if effect.when != found[-1][0]:
            found.append((effect.when, []))
        found[-1][1].append(effect)
    others: list[ValueEffect | AmountEffect] = [e for e in behavior.effects if e.value == FALSE]
    for other in (*others, *behavior.amounts):
        group = next((effects for when, effects in found if when == other.when), None)
        if group is None:
            group = []
            found.append((other.when, group))
        group.append(other)
    return found


@dataclass
class _UpdateWriter:
    behavior: Behavior
    situations: Situations
    spell: Spell
    names: dict[str, str] = field(default_factory=dict)
    scope: dict[str, bool] = field(default_factory=dict)  # variables of the first WHERE, as in `group`
    given: dict[Expression, str] = field(default_factory=dict)  # variables for the numbers in the first WHERE

    def main(self, effects: Sequence[ValueEffect | AmountEffect], labels: Sequence[str]) -> str:
        """Return the first operation, which contains the parameters and preconditions."""
        behavior = self.behavior
        for term in (*behavior.parameters, *behavior.variables):
            self.put(term.name)
        chosen = " ".join(f"{self.put(p.name)} a {self.spell(p.kind)} ." for p in behavior.parameters)
        self.scope = self.chosen()
        lines = self.group(behavior.asked, self.scope, labels)
        return self.operation(effects, behavior.asked, [chosen, *lines] if chosen else lines)

    def conditional(self, when: tuple[Condition, ...], effects: Sequence[ValueEffect | AmountEffect]) -> str:
        """Return an operation for effects with the conditions `when`."""
        known = self.chosen()
        self.group(self.behavior.asked, known)
        return self.operation(effects, (*self.behavior.asked, *when), self.group(when, known))

    def chosen(self) -> dict[str, bool]:
        return {parameter.name: True for parameter in self.behavior.parameters}

    def operation(
        self, effects: Sequence[ValueEffect | AmountEffect], asked: Sequence[Condition], lines: Sequence[str]
    ) -> str:
        values = [effect for effect in effects if isinstance(effect, ValueEffect)]
        delete = [old for effect in values if (old := self.before(effect, asked)) is not None]
        insert = [self.situation(e.situation, e.arguments, e.value) for e in values if e.value != FALSE]
        more: list[str] = []
        for effect in (effect for effect in effects if isinstance(effect, AmountEffect)):
            before, after, given = self.changed(effect)
            delete.append(before)
            insert.append(after)
            more += given
        head = [f"DELETE {{ {' . '.join(dict.fromkeys(delete))} }}"] if delete else []
        head += [f"INSERT {{ {' . '.join(insert)} }}"] if insert or not delete else []
        return "\n".join([*head, "WHERE {", *(f"  {line}" for line in (*lines, *more)), "}"])

    def changed(self, effect: AmountEffect) -> tuple[str, str, list[str]]:
        """Return the deletion and the insertion of an effect on an amount, and the lines that calculate the new amount."""
        own, lines = Amount(effect.situation, effect.arguments), list[str]()
        given = dict(self.given)
        before = self.number(own, lines, given)
        by = self.number(effect.amount, lines, given)
        if effect.operation == "assign":
            match effect.amount:
                case Calculation(sign, left, _) if left == own and sign in CHANGES.values():
                    raise ValueError("its assignment to an amount would be read as an increase or another change")
            after = by
        else:
            by = f"{before} {CHANGES[effect.operation]} {by}"
        if effect.operation != "assign" or isinstance(effect.amount, Calculation):
            after = self.put(f"?after\0{len(self.names)}")
            lines.append(f"BIND({by} AS {after})")
        said = own.situation, own.arguments
        return self.with_number(*said, before), self.with_number(*said, after), [" ".join(lines)] if lines else []

    def before(self, effect: ValueEffect, asked: Sequence[Condition]) -> str | None:
        """Return the triple that an effect deletes: the fact that becomes false, or the old value in the preconditions."""
        if effect.value == FALSE:
            return self.situation(effect.situation, effect.arguments, TRUE)
        if effect.value == TRUE:
            return None
        for one in asked:
            match one:
                case ValueCondition(effect.situation, effect.arguments, value, False) if value != effect.value:
                    return self.situation(one.situation, one.arguments, value)
        return None

    def put(self, term: str) -> str:
        """Return the notation of a term; names of variables contain only letters, digits and underscores."""
        if term in (TRUE, FALSE):
            return term
        if not term.startswith("?"):
            return self.spell(term)
        if term not in self.names:
            name, number = "?" + re.sub(r"\W", "_", term[1:].partition("\0")[0]), 1
            while name in self.names.values():
                name, number = f"{name.removesuffix(f'_{number}')}_{number + 1}", number + 1
            self.names[term] = name
        return self.names[term]

    def situation(self, situation: str, arguments: Sequence[str], value: str) -> str:
        subject, *rest = map(self.put, arguments)
        prop = self.situations.properties.get(situation)
        if situation in self.situations.pairs:
            return f"{subject} {self.spell(prop or situation)} {rest[0]}"
        if prop and not rest:
            return f"{subject} {self.spell(prop)} {self.put(value)}"
        return f"{subject} {self.spell(situation)} {_listed([*rest, self.put(value)])}"

    def group(self, conditions: Sequence[Condition], known: dict[str, bool], labels: Sequence[str] = ()) -> list[str]:
        """Return one line of the update for each condition.

        The keys of `known` are the variables bound so far; the values tell whether the type of the variable has been written.
        Variables that the conditions determine are added to `known` for all lines, because SPARQL ignores the order of patterns.
        One order matters: a class condition on a determined variable has to follow the condition that determines the variable.
        """
        said = list(_flat(zip(conditions, [*labels, *[""] * len(conditions)], strict=False)))
        for one, _ in said:
            if isinstance(one, ValueCondition) and not one.negated and one.situation not in self.situations.pairs:
                known.setdefault(one.value, False)
        begun = dict(known)

        def later(one: Condition) -> bool:
            return isinstance(one, ClassCondition) and not one.negated and not begun.get(one.term, True)

        said.sort(key=lambda pair: later(pair[0]))
        return [self.line(one, known) + (f"   # {' '.join(label.split())}" if label else "") for one, label in said]

    def line(self, condition: Condition, known: dict[str, bool]) -> str:
        if condition.negated and isinstance(condition, EqualityCondition):
            return f"FILTER({self.put(condition.left)} != {self.put(condition.right)})"
        if condition.negated:
            return f"FILTER NOT EXISTS {{ {self.said(condition, dict.fromkeys(known, True))} }}"
        if isinstance(condition, Witness):
            return f"FILTER EXISTS {{ {self.said(condition, dict.fromkeys(known, True))} }}"
        return self.said(condition, known)

    def said(self, condition: Condition, known: dict[str, bool]) -> str:
        """Return the notation of a condition without its negation."""
        match condition:
            case ValueCondition(situation, arguments, value):
                line = f"{self.situation(situation, arguments, value)} ."
                return " ".join([line, *self.typed(situation, value, known)])
            case RelationCondition(relation, arguments):
                subject, *rest = map(self.put, arguments)
                return f"{subject} {self.spell(relation)} {_listed(rest or ['true'])} ."
            case ClassCondition(term, kind):
                return f"{self.put(term)} a {self.spell(kind)} ."
            case EqualityCondition(left, right):
                return f"FILTER({self.put(left)} = {self.put(right)})"
            case Witness(variable, kind, conditions):
                if variable in known or variable in self.behavior.kinds:  # rename a variable with a used name
                    own = f"{variable}_inside"
                    inner = tuple(substituted(one, {variable: own}) for one in conditions)
                    return self.said(Witness(own, kind, inner), known)
                sought = f"{self.put(variable)} a {self.spell(kind)} ."
                return " ".join([sought, *self.group(conditions, {**dict.fromkeys(known, True), variable: True})])
            case AnyOf(alternatives):
                return self.any_of(alternatives, known)
            case Comparison(left, sign, right):
                patterns, given = list[str](), self.given if known is self.scope else {}
                compared = f"FILTER({self.number(left, patterns, given)} {sign} {self.number(right, patterns, given)})"
                return " ".join([*patterns, compared])

    def number(self, expression: Expression, patterns: list[str], given: dict[Expression, str]) -> str:
        """Return the notation of a numeric expression; append the patterns that bind its variables to amounts."""
        match expression:
            case Fraction():
                said = written(expression)
                if "/" in said:
                    raise ValueError(f"{said} isn't a decimal number")
                return said
            case Calculation(sign, left, right):
                return f"({self.number(left, patterns, given)} {sign} {self.number(right, patterns, given)})"
            case Amount(of, arguments) | Measure(of, arguments):
                if expression in given:
                    return given[expression]
                local = (
                    re.sub(r"\W", "", self.spell(self.situations.properties.get(of, of)).rpartition(":")[2]) or "number"
                )
                name = self.put(f"?{local}\0{len(self.names)}")
                patterns.append(self.with_number(of, arguments, name) + " .")
                given[expression] = name
                return name
        raise TypeError(f"{expression!r} is no expression")

    def with_number(self, of: str, arguments: Sequence[str], number: str) -> str:
        subject, *rest = map(self.put, arguments)
        return f"{subject} {self.spell(self.situations.properties.get(of, of))} {_listed([*rest, number])}"

    def any_of(self, alternatives: Sequence[Sequence[Condition]], known: dict[str, bool]) -> str:
        if chosen := _choice(alternatives):
            return f"VALUES {self.put(chosen[0])} {{ {' '.join(map(self.put, chosen[1]))} }}"
        groups = [" ".join(self.group(group, dict.fromkeys(known, True))) for group in alternatives]
        if len(groups) == 1:
            return groups[0]
        return " UNION ".join(f"{{ {group} }}" for group in groups)

    def typed(self, situation: str, value: str, known: dict[str, bool]) -> Iterator[str]:
        """Yield the type pattern of a determined variable, unless the situation type implies the type."""
        if not value.startswith("?") or known.get(value, True):
            return
        known[value] = True
        kind = self.behavior.kinds.get(value, situation)
        if kind != situation or self.asked_of_class(value):
            yield f"{self.put(value)} a {self.spell(kind)} ."

    def asked_of_class(self, term: str) -> bool:
        """Return whether a class condition on a term exists.

        If the term has no type pattern, the compilation would read such a condition as the type of the term.
        """
        return any(
            isinstance(inner, ClassCondition) and inner.term == term
            for condition in self.behavior.conditions
            for inner in walk(condition)
        )


def _flat(conditions: Iterable[tuple[Condition, str]]) -> Iterator[tuple[Condition, str]]:
    """Yield the labelled conditions; an `AnyOf` with only one alternative is replaced by the conjuncts of this alternative."""
    for condition, label in conditions:
        match condition:
            case AnyOf((group,), False):
                yield from _flat((inner, label) for inner in group)
            case _:
                yield condition, label


def _choice(alternatives: Sequence[Sequence[Condition]]) -> tuple[str, list[str]] | None:
    """Return the variable and the individuals of a disjunction that only lists the individuals of a variable, or None."""
    found: list[str] = []
    name = ""
    for group in alternatives:
        match group:
            case (EqualityCondition(left, right, False),) if left.startswith("?") and not right.startswith("?"):
                if name and left != name:
                    return None
                name = left
                found.append(right)
            case _:
                return None
    return (name, found) if len(found) > 1 else None


def _listed(terms: Sequence[str]) -> str:
    return terms[0] if len(terms) == 1 else f"({' '.join(terms)})"
