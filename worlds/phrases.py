"""Random conditions and effects over the situation types and individuals of a world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from random import Random

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, situations_in
from confab.reasoner.language import substituted
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

EACH, ANYONE, SELF = "?each", "?anyone", "?self"
"""Variables of conditions that a scene writes as a class in place of an individual (`EACH`), or as an absence (`ANYONE`), and of
the conditions of a described class (`SELF`)."""
LOCAL = "?v"
"""The first letters of variables that a value determines, and that only one group of conditions or one effect mentions. In a
problem, the group is a witness of the variable. A scene writes the conditions of the witness as the group."""


STANDARD = ("A", "B", "A1")
MOST_TERMS = 3
"""An effect without a fitting term may get a new parameter only if the behaviour has fewer terms than this number."""
CONDITIONS = (
    *("value", "value", "value", "binding", "near", "class", "equal", "witness", "absence", "every", "any"),
    *("amount", "amount"),
)


class Vocabulary:
    """The vocabulary of conditions and effects, with the levels of values in `values`, and the classes of relations in `ends`."""

    def __init__(self, rng: Random) -> None:
        self.rng = rng
        self.classes: dict[str, tuple[str, ...]] = {}
        self.parents: dict[str, tuple[str, ...]] = {"A": (), "B": (), "A1": ("A",)}
        self.situations: dict[str, SituationType] = {}
        self.values: dict[str, int] = {}
        self.relations: dict[str, frozenset[tuple[str, ...]]] = {}
        self.ends: dict[str, tuple[str, ...]] = {}
        self.rules: dict[str, tuple[Rule, ...]] = {}
        self.aggregates: dict[str, Aggregate] = {}
        self.remembers: dict[str, str] = {}
        self.objects: tuple[str, ...] = ()
        self.axioms: dict[str, tuple[str, ...]] = {}
        self.owners: dict[str, tuple[str, ...]] = {}
        self.initial: dict[Symbol, str] = {}
        self.partial = False
        """Whether numbers of pairs are drawn, and conditions on individuals that lack the situation type."""
        self.owning: tuple[str, ...] = ()
        self.overlaps: list[str] = []
        """Classes that share individuals with other classes; those in `owning` may have situation types."""
        self.definitions: dict[str, str] = {}
        self.described: dict[str, tuple[Condition, ...]] = {}
        """The OWL expressions of defined classes, and the conditions on a member of a class that situations define."""
        self.repeated = False
        """Whether several effects of a behaviour may change one situation type."""
        self.local = False
        """Whether variables are drawn that are local to a group of conditions or to an effect."""
        self.crowd = 0
        """Number of additional individuals of each class; with such individuals, few effects concern a whole class."""

    def kind(self, kind: str, among: Sequence[str] | None = None) -> str:
        """Return a class; if classes overlap, sometimes another class."""
        among = self.overlaps if among is None else among
        return self.rng.choice(among) if among and self.rng.random() < 0.4 else kind


HIGHEST = 9
"""A level above all levels, for which all situation types are visible."""


class Phrases:
    """Draws the conditions and effects of one behaviour or rule."""

    def __init__(self, draft: Vocabulary, level: int) -> None:
        self.draft, self.rng, self.level = draft, draft.rng, level
        self.kinds: dict[str, str] = {}
        self.witnesses = 0
        self.inner: dict[str, str] = {}  # the classes of quantified variables

    def terms(self) -> tuple[Parameter, ...]:
        """Return the parameters and variables drawn so far."""
        return tuple(Parameter(name, kind) for name, kind in self.kinds.items())

    def fresh(self, kind: str) -> str:
        """Return a new parameter or variable of a class."""
        term = f"?p{len(self.kinds)}"
        self.kinds[term] = self.draft.kind(kind) if kind in STANDARD else kind
        return term

    def seen(self, quantity: bool = False, changeable: bool = False) -> list[SituationType]:
        """Return the situation types that conditions or effects of this level may use; with `quantity`, those with numbers."""
        return [
            one
            for one in self.draft.situations.values()
            if one.level <= self.level and (one.quantity is not None) is quantity
            and not (changeable and any(one.name in its for its in (self.draft.rules, self.draft.aggregates, self.draft.remembers)))
        ]  # fmt: skip

    def term(self, bound: Sequence[str], kind: str) -> str | None:
        """Return a term for an argument of a class, usually a term of the class and sometimes a term of another class."""
        members = self.draft.classes[kind]
        if self.draft.partial and bound and self.rng.random() < 0.1:
            return self.rng.choice(bound)
        fitting = [t for t in bound if set(self.kinds_of(t)) & set(members)]
        if fitting and self.rng.random() < (0.98 if self.draft.crowd else 0.92):
            return self.rng.choice(fitting)
        if members:
            return self.rng.choice(members)
        return self.rng.choice(bound) if bound else None

    def kinds_of(self, term: str) -> tuple[str, ...]:
        """Return the individuals that a term can denote."""
        return self.draft.classes.get(self.inner.get(term) or self.kinds.get(term, ""), ())

    def conditions(self, bound: list[str], most: int, depth: int) -> list[Condition]:
        """Return a random conjunction; the variables that the conjunction determines are added to `bound`."""
        return [self.condition(bound, depth) for _ in range(most)]

    def visible(self, values: Sequence[str]) -> list[str]:
        """Return the values that are visible on this level."""
        return [value for value in values if self.draft.values.get(value, 1) <= self.level]

    def value(self, bound: Sequence[str], about: str | None = None) -> Condition:
        """Return a random condition on a value, with `about` among its arguments if possible."""
        rng = self.rng
        seen = self.seen()
        if not seen:
            return self.same(bound)
        if about is not None:
            mine = set(self.kinds_of(about))
            seen = [s for s in seen if any(mine & set(self.draft.classes[of]) for of in s.arguments)] or seen
        one = rng.choice(seen)
        arguments = [self.term(bound, kind) for kind in one.arguments]
        if about is not None:
            mine = set(self.kinds_of(about))
            places = [i for i, of in enumerate(one.arguments) if mine & set(self.draft.classes[of])]
            arguments[rng.choice(places or [0])] = about
        if None in arguments:
            return self.same(bound)
        terms = tuple(str(a) for a in arguments)
        if one.boolean:
            return ValueCondition(one.name, terms, TRUE, negated=rng.random() < 0.4)
        values = self.visible(self.draft.classes[one.range])
        fitting = [t for t in bound if t not in terms and set(self.kinds_of(t)) & set(values)]
        value = rng.choice(fitting) if fitting and rng.random() < 0.4 else rng.choice(values or [FALSE])
        return ValueCondition(one.name, terms, value, negated=rng.random() < 0.4)

    def described(self, term: str, own: bool = True) -> Condition | None:
        """Return the condition that a term is of a described class, with `own` of a class whose base is the term's class."""
        found = [
            conditions
            for conditions in self.draft.described.values()
            if all(self.draft.situations[name].level <= self.level for name in named(conditions))
            and (not own or ClassCondition(SELF, self.kinds.get(term, "")) in conditions)
        ]
        if not found:
            return None
        return AnyOf((tuple(substituted(one, {SELF: term}) for one in self.rng.choice(found)),))

    def same(self, bound: Sequence[str]) -> Condition:
        """Return the trivial condition that a term equals itself."""
        one = self.rng.choice([*bound, *self.draft.objects])
        return EqualityCondition(one, one)

    def condition(self, bound: list[str], depth: int) -> Condition:
        """Return a random condition; a variable that the condition determines is added to `bound`."""
        rng, draft = self.rng, self.draft
        negated = rng.random() < 0.35
        if draft.local and rng.random() < 0.35 and (grouped := self.local(bound, depth)) is not None:
            return grouped
        kind = rng.choice(CONDITIONS)
        if draft.partial and rng.random() < 0.3:
            kind = "amount"
        if "between" in draft.relations and rng.random() < 0.15:
            terms = tuple(self.term(bound, of) for of in draft.ends["between"])
            if None not in terms:
                return RelationCondition("between", tuple(map(str, terms)), negated)
        if kind == "binding":
            functional = [s for s in self.seen() if not s.boolean]
            if functional and self.level != HIGHEST and depth:
                one = rng.choice(functional)
                arguments = tuple(self.term(bound, of) for of in one.arguments)
                if None not in arguments:
                    bound.append(self.fresh(one.range))
                    return ValueCondition(one.name, tuple(map(str, arguments)), bound[-1])
        if draft.described and bound and rng.random() < 0.2:
            of_class = self.described(rng.choice(bound), rng.random() < 0.5)
            if of_class is not None:
                return contrary(of_class) if negated else of_class
        if kind == "near" and "near" in draft.relations:
            terms = tuple(self.term(bound, of) for of in draft.ends["near"])
            if None not in terms:
                return RelationCondition("near", tuple(map(str, terms)), negated)
        if kind == "class" and bound:
            return ClassCondition(rng.choice(bound), draft.kind(rng.choice(("A1", "A1", "B"))), negated)
        if kind == "equal" and (bound or draft.objects):
            return EqualityCondition(
                rng.choice([*bound, *draft.objects]), rng.choice([*bound, *draft.objects]), rng.random() < 0.6
            )
        if kind == "amount" and (compared := self.comparison(bound, negated)):
            return compared
        if kind == "witness" and depth:
            self.witnesses += 1
            variable, of = f"?w{self.witnesses}_{len(self.kinds)}", draft.kind(rng.choice(("A", "B", "A1")))
            self.inner[variable] = of
            inner = [self.value([*bound, variable], variable)]
            if rng.random() < 0.5:
                more = (EqualityCondition(variable, rng.choice(bound), True) if bound and rng.random() < 0.5
                        else self.value([*bound, variable], variable))  # fmt: skip
                inner.append(more)
            return Witness(variable, of, tuple(inner), negated)
        if kind == "absence":
            found = [s for s in self.seen() if len(s.arguments) == 1]
            if found:
                one = rng.choice(found)
                of = draft.kind(rng.choice([one.arguments[0] if one.arguments[0] in draft.parents else "A", "A"]))
                if one.boolean:
                    inside = ValueCondition(one.name, (ANYONE,), TRUE)
                else:
                    value = self.term(bound, one.range) if rng.random() < 0.5 else None
                    visible = self.visible(draft.classes[one.range])
                    if value is None or (not value.startswith("?") and value not in visible):
                        value = rng.choice(visible or [FALSE])
                    inside = ValueCondition(one.name, (ANYONE,), value)
                return Witness(ANYONE, of, (inside,), rng.random() < 0.7)
        if kind == "every":
            of = draft.kind(rng.choice(("A", "B", "A1")))
            self.inner[EACH] = of
            one_of = self.value([*bound, EACH], EACH)
            if isinstance(one_of, ValueCondition) and one_of.arguments.count(EACH) == 1 and one_of.value != EACH:
                return Witness(EACH, of, (contrary(one_of),), negated=True)
        if kind == "any" and depth:
            groups = tuple(
                tuple(self.conditions(list(bound), rng.choice((1, 1, 2)), 0)) for _ in range(rng.choice((2, 2, 3)))
            )
            return AnyOf(groups, rng.random() < 0.2)
        return self.value(bound)

    def local(self, bound: Sequence[str], depth: int) -> Condition | None:
        """Return a condition with groups of conditions that have local variables, or None if no value determines a variable.

        Different groups may use the same names of variables.
        """
        rng = self.rng
        shape = rng.choice(("some", "none", "neither", "neither", "either"))
        if shape in ("some", "none"):
            variable = rng.choice([name for name in ("?u0", "?u1", "?u2", "?u3") if name not in bound])
            of = self.draft.kind(rng.choice(("A", "B", "A1")))
            self.inner[variable] = of
            inner = self.determining([*bound, variable], variable, depth)
            if inner and rng.random() < 0.4:
                inner.append(self.value([*bound, variable], variable))
            return Witness(variable, of, tuple(inner), shape == "none") if inner else None
        found = [
            self.determining(bound, None, depth) for _ in range(1 if shape == "neither" else rng.choice((2, 2, 3)))
        ]
        groups = [group or [self.value(bound)] for group in found]
        return AnyOf(tuple(map(tuple, groups)), shape == "neither" or rng.random() < 0.2) if any(found) else None

    def determining(self, bound: Sequence[str], about: str | None, depth: int) -> list[Condition]:
        """Return the witness of a local variable with the value of a situation, `about` among its arguments if possible."""
        rng, draft = self.rng, self.draft
        if (drawn := self.determined(bound, about)) is None:
            return []
        variable, kind, first = drawn
        inner, within = [*first], [*bound, variable]
        for _ in range(rng.choice((1, 1, 2)) - (len(first) > 1)):
            draw = rng.random()
            nested = self.local(within, depth - 1) if draw < 0.2 and depth > 0 else None
            if nested is not None:
                inner.append(nested)
            elif draw < 0.4:
                inner.append(
                    EqualityCondition(
                        variable, rng.choice([*bound, *draft.classes[kind]] or [variable]), rng.random() < 0.6
                    )
                )
            elif draw < 0.5:
                inner.append(ClassCondition(variable, draft.kind(rng.choice(("A1", "B"))), rng.random() < 0.4))
            elif draw < 0.6 and (compared := self.comparison(within, False)) is not None:
                inner.append(compared)
            else:
                inner.append(self.value(within, variable))
        return [Witness(variable, kind, tuple(inner))]

    def determined(self, bound: Sequence[str], about: str | None) -> tuple[str, str, tuple[Condition, ...]] | None:
        """Return a local variable, its class and the conditions that determine the variable, or None if no value does."""
        rng, draft = self.rng, self.draft
        functional = [s for s in self.seen() if not s.boolean]
        if about is not None:
            mine = set(self.kinds_of(about))
            functional = [s for s in functional if mine & set(draft.classes[s.arguments[0]])] or functional
        if not functional:
            return None
        one = rng.choice(functional)
        arguments = [self.term(bound, of) for of in one.arguments]
        if about is not None and set(self.kinds_of(about)) & set(draft.classes[one.arguments[0]]):
            arguments[0] = about
        if None in arguments:
            return None
        values = set(draft.classes[one.range])
        kinds = [of for of in ("A", "B", "A1", *draft.overlaps) if values & set(draft.classes[of])]
        kind = rng.choice(kinds) if kinds and rng.random() < 0.5 else one.range
        bases = {
            name: conditions
            for name, conditions in draft.described.items()
            if isinstance(conditions[0], ClassCondition)
            and values & set(draft.classes[conditions[0].kind])
            and all(draft.situations[each].level <= self.level for each in named(conditions))
        }
        name = rng.choice(sorted(bases)) if bases and rng.random() < 0.5 else ""
        variable = rng.choice([one for one in (f"{LOCAL}{n}_{name or kind}" for n in range(4)) if one not in bound])
        of_class: list[Condition] = []
        if name and isinstance(first := bases[name][0], ClassCondition):
            kind = first.kind
            of_class = [AnyOf((tuple(substituted(each, {SELF: variable}) for each in bases[name]),))]
        self.inner[variable] = kind
        return variable, kind, (ValueCondition(one.name, tuple(map(str, arguments)), variable), *of_class)

    def comparison(self, bound: Sequence[str], negated: bool) -> Condition | None:
        """Return a random comparison of numbers, or None if the level has no numbers."""
        left = self.number(bound, 1)
        if not isinstance(left, Amount | Calculation) and not (self.draft.partial and isinstance(left, Measure)):
            return None
        right: Expression = Fraction(self.rng.randint(0, 3))
        if self.rng.random() < 0.3:
            right = self.number(bound, 0) or right
        return Comparison(
            left, self.rng.choice(("<", "<=", "=", ">=", ">")), right, negated and self.rng.random() < 0.5
        )

    def number(self, bound: Sequence[str], depth: int, extrema: bool = True) -> Expression | None:
        """Return a random calculation, or None if the level has no numbers; maxima and minima occur only with `extrema`."""
        rng, aggregates = self.rng, self.draft.aggregates
        seen = [s for s in self.seen(quantity=True) if extrema or s.name not in aggregates or aggregates[s.name].kept]
        if not seen:
            return None
        if depth and rng.random() < 0.2:
            left, sign = self.number(bound, 0, extrema), rng.choice("+-*//")
            right: Expression | None = Fraction(rng.choice((0, 1, 2, 2)))
            if rng.random() < 0.4:
                right = self.number(bound, 0, extrema)
            if sign in "*/" and isinstance(right, Amount) and rng.random() < 0.98:  # no product of two changing amounts
                right = Fraction(2)
            return Calculation(sign, left, right) if left is not None and right is not None else None
        if "size" in self.draft.relations and rng.random() < 0.2:
            one = self.term(bound, "A")
            return None if one is None else Measure("size", (one,))
        if "way" in self.draft.relations and rng.random() < 0.3:
            ends = [self.term(bound, of) for of in self.draft.ends["way"]]
            return None if None in ends else Measure("way", tuple(map(str, ends)))
        situation = rng.choice(seen)
        terms = [self.term(bound, of) for of in situation.arguments]
        return None if None in terms else Amount(situation.name, tuple(map(str, terms)))

    def link(self, bound: Sequence[str], effect: ValueEffect) -> Condition | None:
        """Return the condition that an effect of another behaviour holds, or None if the effect is not visible on this level."""
        situation = self.draft.situations[effect.situation]
        terms = [self.term(bound, kind) for kind in situation.arguments]
        if situation.level > self.level or None in terms or self.draft.values.get(effect.value, 1) > self.level:
            return None
        if situation.boolean:
            return ValueCondition(effect.situation, tuple(map(str, terms)), TRUE, negated=effect.value == FALSE)
        return ValueCondition(effect.situation, tuple(map(str, terms)), effect.value)

    # ----------------------------------------------------------------------------------------------------------- effects

    def effect(self, bound: list[str], values: list[ValueEffect], numbers: list[AmountEffect]) -> None:
        """Draw an effect, and add it to `values` or `numbers`; except in `repeated` worlds, it contradicts no existing effect."""
        rng, draft = self.rng, self.draft
        of_numbers = self.seen(quantity=True, changeable=True)
        of_values = self.seen(changeable=True)
        one = rng.choice([*of_values, *of_numbers] or [None])
        if draft.crowd:  # effects on parameters lead recognition to few individuals
            members = {one for term in bound for one in self.kinds_of(term)}
            known = [s for s in of_values if all(members & {*draft.classes[of]} for of in s.arguments)]
            moving = [s for s in known if members & {*draft.classes[s.range]}]
            one = rng.choice((moving if rng.random() < 0.6 else known) or [one])
        if one is None:
            return
        each, terms = None, list[str | None]()
        for kind in one.arguments:
            if each is None and kind in draft.parents and rng.random() < (0.03 if draft.crowd else 0.25):
                each = Parameter(EACH, draft.kind(rng.choice((kind, kind, "A1"))))
                self.inner[EACH] = each.kind
                terms.append(EACH)
            elif (
                kind in draft.parents and len(self.kinds) < MOST_TERMS and rng.random() < (0.1 if draft.crowd else 0.7)
                and not any(set(self.kinds_of(t)) & set(draft.classes[kind]) for t in bound)
            ):  # fmt: skip
                bound.append(self.fresh(kind))
                terms.append(bound[-1])
            else:
                terms.append(self.term(bound, kind))
        if None in terms:
            return
        arguments, when = tuple(map(str, terms)), tuple[Condition, ...]()
        if rng.random() < 0.3:
            inner = [*bound, EACH] if each else list(bound)
            when = (self.value(inner, EACH if each else None),)
            if each and _mentions_twice(when[0]):
                when = ()
            if (
                each
                and draft.described
                and rng.random() < 0.4
                and (of_class := self.described(EACH, False)) is not None
            ):
                when = (of_class,)
        own: str | None = None
        if draft.local and rng.random() < 0.4:
            drawn = self.determined([EACH] if each else bound, EACH if each else None)
            if drawn is not None and not (each and _mentions_twice(drawn[2][0])):
                own, self.kinds[own] = drawn[0], drawn[1]
                when = drawn[2]
                if rng.random() < 0.5:
                    more = self.value([own], own)
                    when = (*when, more if not isinstance(more, EqualityCondition) else EqualityCondition(own, own))
                places = [i for i, of in enumerate(one.arguments) if set(self.kinds_of(own)) & set(draft.classes[of])]
                if (places := [i for i in places if arguments[i] != EACH]) and rng.random() < 0.5:
                    at = rng.choice(places)
                    arguments = (*arguments[:at], own, *arguments[at + 1 :])
        if one.quantity is not None:
            if not draft.repeated and any(change.situation == one.name for change in numbers):
                return
            by: Expression = Fraction(rng.choice((1, 1, 1, 2)))
            operation = rng.choice(("increase", "increase", "decrease", "decrease", "assign", "scale"))
            if operation == "scale":
                by = rng.choice((Fraction(2), Fraction(0), Fraction(1, 2)))
            elif rng.random() < 0.2:
                by = self.number(bound, 1, extrema=False) or by
            numbers.append(AmountEffect(one.name, arguments, operation, by, when, each))
            return
        if one.boolean:
            value = rng.choice((TRUE, TRUE, FALSE))
        else:
            if not draft.repeated and any(effect.situation == one.name for effect in values):
                return
            visible = self.visible(draft.classes[one.range])
            mine = bound if own is None else [*bound, own]
            fitting = [t for t in mine if set(self.kinds_of(t)) and set(self.kinds_of(t)) <= set(visible)]
            if not visible and not fitting:
                return
            among = fitting if fitting and rng.random() < (0.8 if draft.crowd else 0.5) else visible or fitting
            value = rng.choice(among)
        values.append(ValueEffect(one.name, arguments, value, when, each))


def _mentions_twice(condition: Condition) -> bool:
    """Return whether a scene can't write a condition with a class in place of the variable `EACH`."""
    match condition:
        case ValueCondition(_, arguments, value):
            return (*arguments, value).count(EACH) > 1 or value == EACH
        case _:
            return True


def contrary(condition: Condition) -> Condition:
    """Return the negation of a condition."""
    return replace(condition, negated=not condition.negated)


def named(conditions: Sequence[Condition]) -> set[str]:
    """Return the situation types that occur in conditions."""
    found: set[str] = set()
    for one in conditions:
        match one:
            case ValueCondition(situation):
                found.add(situation)
            case Witness(_, _, inner):
                found |= named(inner)
            case AnyOf(alternatives):
                found |= {name for group in alternatives for name in named(group)}
            case Comparison(left, _, right):
                found |= situations_in(left) | situations_in(right)
            case _:
                pass
    return found
