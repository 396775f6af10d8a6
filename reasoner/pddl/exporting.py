"""A level of a scene written as PDDL, as plainly as it can be said, for planners that know little more than STRIPS.

==============================  ==================================================================
here                            in PDDL
==============================  ==================================================================
class of a parameter            type; a class that cuts across others: predicate of one argument
individual, also as a value     object
situation type                  predicate of its arguments and, unless it is boolean, its value
effect on a known value         that value is deleted; an unknown one becomes a parameter first
negated value, inequality       parameter for the value that it is instead, which is ``different``
negated boolean                 predicate for its contrary, kept up to date
"no such object"                predicate for "free", kept up to date, if it can't hold twice;
                                else one contrary per object
conditional effect              an action for either case
rule of what is defined         ``:derived``
anything else                   as it is, with ``or``, ``exists``, ``forall``, ``when``
==============================  ==================================================================
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product

from reasoner.amounts import Amount, Calculation, Expression, Measure, bounds, inside, terms_of, written
from reasoner.language import is_variable, terms, walk
from reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Problem,
    RelationCondition,
    Rule,
    State,
    ValueCondition,
    ValueEffect,
    Witness,
    allowed,
    substituted,
)

WORLD = "World"  # its one individual is what a predicate without arguments is about
RESERVED = {"object", "and", "or", "not", "imply", "exists", "forall", "when", "total-cost", "different", "define"}


@dataclass(frozen=True)
class Exported:
    """A domain and a problem in PDDL, and what leads from a plan of theirs back to behaviours.

    `actions` maps an action's name to its behaviour, and the places of the behaviour's parameters among the action's.
    """

    domain: str
    problem: str
    actions: Mapping[str, tuple[str, tuple[int, ...]]]
    objects: Mapping[str, str]


def to_pddl(
    problem: Problem, level: int | None = None, initial: State | None = None, goal: State | None = None
) -> Exported:
    """Write one level of a problem, the lowest if none is given, as PDDL.

    Parameters
    ----------
    problem : Problem
    level : int, optional
    initial, goal : State, optional
        In place of the problem's own; by default what is at rest in the beginning is wanted to be so in the end.
    """
    level = problem.domain.levels[-1] if level is None else level
    found = replace(
        problem,
        initial=problem.initial if initial is None else initial,
        goal=problem.goal_on(level) if goal is None else goal,
    )
    return _Export(found, level).exported()


def plan_of(exported: Exported, text: str) -> list[tuple[str, tuple[str, ...]]]:
    """Read a plan in the format of the planning competitions: one ``(action object …)`` a line, ``;`` for comments.

    Returns
    -------
    list of (behaviour, arguments)

    Raises
    ------
    ValueError
        A line is no action of the exported domain; the message says which.
    """
    steps = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = re.sub(r"^\s*[\d.]+\s*:", "", line.split(";")[0]).strip().strip("()").lower().split()
        if not words:
            continue
        if words[0] not in exported.actions:
            raise ValueError(f"line {number}: no action '{words[0]}' in the exported domain")
        behavior, places = exported.actions[words[0]]
        unknown = [word for word in words[1:] if word not in exported.objects]
        if unknown or (places and max(places) >= len(words) - 1):
            raise ValueError(
                f"line {number}: {'no object ' + unknown[0] if unknown else 'too few objects'}: {line.strip()}"
            )
        steps.append((behavior, tuple(exported.objects[words[1 + place]] for place in places)))
    return steps


@dataclass
class _Action:
    """An action in the making: its terms with their types, and what it needs and does, as PDDL."""

    behavior: Behavior
    terms: dict[str, str]  # variable to type
    needs: list[str] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)
    begins: list[str] = field(default_factory=list)
    effects: list[str] = field(default_factory=list)  # conditional ones
    price: str = ""


class _Export:
    def __init__(self, problem: Problem, level: int) -> None:
        self.problem, self.level = problem, level
        here = [s for s in problem.domain.situations.values() if s.level <= level]
        self.situations = {s.name: s for s in here if s.quantity is None}
        self.quantities = {s.name for s in here if s.quantity is not None}
        self.functions: dict[str, tuple[str, ...]] = {}  # and the types of their arguments
        self.measured: dict[str, str] = {}  # relations that give a number, and their functions
        self.behaviors = problem.domain.at_level(level)
        self.sets = {kind: frozenset(members) for kind, members in problem.classes.items()}
        self.world = {name for name in problem.classes.get(WORLD, ()) if len(problem.classes[WORLD]) == 1}
        self.names: dict[tuple[str, str], str] = {}
        self.taken: dict[str, set[str]] = {}
        self.statics: dict[str, set[tuple[str, ...]]] = {}  # predicates made for the export
        self.arity: dict[str, int] = {}
        self.contrary: dict[str, set[str]] = {}  # situation types whose contrary is kept, and of which last terms
        self.free: dict[tuple[str, str], None] = {}  # (class, situation type)
        self.asked: dict[tuple[str, str], frozenset[str]] = {}  # for each, the values that anything asks to be free

    def name(self, kind: str, ours: str, wanted: str | None = None) -> str:
        """Return the PDDL name for one of ours; no two of a kind are the same."""
        if (kind, ours) not in self.names:
            text = re.sub(r"[^0-9a-z_-]", "_", (wanted or ours).lower())
            text = text if re.match(r"[a-z]", text) else f"x{text}"
            taken = self.taken.setdefault(kind, set(RESERVED))
            while text in taken:
                text += "_"
            taken.add(text)
            self.names[kind, ours] = text
        return self.names[kind, ours]

    def exported(self) -> Exported:
        self.find_types()
        for _ in "ab":  # the first time finds which contraries have to be kept up to date
            actions = [action for behavior in self.behaviors for action in self.actions(behavior)]
        rules = [rule for name in self.situations for rule in self.problem.domain.rules.get(name, ())]
        texts = [self.axiom(rule) for rule in rules]
        table: dict[str, tuple[str, tuple[int, ...]]] = {}
        for action in actions:
            name = self.name("action", f"{action.behavior.name} {len(table)}", action.behavior.name)
            parameters = [p.name for p in action.behavior.parameters]
            places = list(action.terms)
            table[name] = (action.behavior.name, tuple(places.index(p) for p in parameters))
            texts.append(self.action_text(name, action))
        domain_name = self.name("domain", self.problem.scene.rsplit("/", 2)[-2])
        individuals = self.individuals()
        objects = {self.name("object", o): o for o in individuals}
        for symbol, value in self.problem.goal.items():  # it may name predicates that no action does
            if symbol.situation in self.situations:
                self.predicate(symbol.situation, symbol.arguments, value)
            elif symbol.situation in self.quantities:
                self.function("situation", symbol.situation, symbol.arguments)
        return Exported(
            domain=self.domain_text(domain_name, texts),
            problem=self.problem_text(domain_name, individuals),
            actions=table,
            objects=objects,
        )

    # --------------------------------------------------------------------------------------------------- types

    def find_types(self) -> None:
        """Choose the classes that become types: a family in which any two are nested or disjoint."""
        kinds = [t.kind for b in self.behaviors for t in (*b.parameters, *b.variables)]
        rules = [rule.behavior for its in self.problem.domain.rules.values() for rule in its]
        kinds += [t.kind for b in rules for t in (*b.parameters, *b.variables)]
        kinds += [
            w.kind
            for b in (*self.behaviors, *rules)
            for one in b.conditions
            for c in walk(one)
            for w in [c]
            if isinstance(w, Witness)
        ]
        chosen: dict[frozenset[str], str] = {}
        for kind in sorted(dict.fromkeys(kinds), key=lambda k: (-len(self.sets.get(k, ())), kinds.index(k))):
            members = self.sets.get(kind, frozenset())
            if members and all(not members & other or members <= other for other in chosen):
                chosen.setdefault(members, kind)
        self.types = {kind: self.name("type", kind) for kind in chosen.values()}
        self.type_of = {kind: self.types[chosen[m]] for kind, m in self.sets.items() if m in chosen}
        self.lowest: dict[str, str] = {}
        self.above: dict[str, str] = {}
        for members, kind in chosen.items():  # from large to small
            larger = [k for other, k in chosen.items() if members < other]
            self.above[self.types[kind]] = self.types[larger[-1]] if larger else "object"
            self.lowest |= dict.fromkeys(members, self.types[kind])

    def typed(self, terms: Mapping[str, str]) -> str:
        return " ".join(f"{name} - {kind}" for name, kind in terms.items())

    def is_a(self, term: str, kind: str) -> str:
        """Return a condition for an individual to be of a class."""
        predicate = self.name("predicate", f"is {kind}", f"is_{kind}")
        self.statics[predicate] = {(member,) for member in self.sets.get(kind, ())}
        self.arity[predicate] = 1
        return f"({predicate} {self.term(term)})"

    def term(self, name: str) -> str:
        return (
            "?" + re.sub(r"[^0-9a-z_-]", "_", name[1:].lower()) if name.startswith("?") else self.name("object", name)
        )

    # ----------------------------------------------------------------------------------------------- conditions

    def predicate(self, situation: str, arguments: Sequence[str], value: str, contrary: bool = False) -> str:
        """Return the atom for a symbol having a value, or for a boolean one being false."""
        name = self.name("predicate", situation)
        terms = [*arguments] if self.situations[situation].boolean else [*arguments, value]
        if contrary:
            self.contrary.setdefault(situation, set())
            name = self.name("predicate", f"not {situation}", f"not_{situation}")
        words = [self.term(t) for t in terms if t not in self.world]
        self.arity[name] = len(words)
        return f"({' '.join([name, *words])})"

    def different(self, one: str, other: str, among: Iterable[str], values: Iterable[str]) -> str:
        """Return a condition for two terms not to be the same: the first one of `among`, the second one of `values`."""
        self.arity["different"] = 2
        rows = self.statics.setdefault("different", set())
        others = [other] if not other.startswith("?") else list(values)
        rows |= {(a, b) for a in among for b in others if a != b}
        return f"(different {self.term(one)} {self.term(other)})"

    def range_of(self, situation: str) -> list[str]:
        """Return the values that a symbol of a situation type can have."""
        initial = (v for s, v in self.problem.initial.items() if s.situation == situation)
        return list(dict.fromkeys([*self.problem.classes[self.situations[situation].range], *initial]))

    def condition(self, one: Condition, action: _Action, where: list[str]) -> None:
        """Add a conjunct to `where`, with parameters that it needs."""
        match one:
            case ValueCondition(situation, arguments, value, negated):
                if situation not in self.situations:
                    where.extend([] if negated else ["(or)"])
                    return
                if situation in self.problem.domain.rules:
                    where.append(self.formula(one))
                    return
                boolean = self.situations[situation].boolean
                if boolean and value == FALSE:
                    negated = not negated
                if not negated:
                    where.append(self.predicate(situation, arguments, value))
                elif boolean:
                    where.append(self.predicate(situation, arguments, value, contrary=True))
                else:
                    wanted = self.predicate(situation, arguments, "?")[:-1]
                    known = (n[len(wanted) - 1 : -1] for n in (*where, *action.needs) if n.startswith(wanted))
                    other = next(known, None)  # the value that it has is asked for, too
                    if other is None:
                        other = self.fresh(action, "other")
                        where.append(self.predicate(situation, arguments, other))
                    values = self.range_of(situation)
                    where.append(self.different(other, value, values, values))
            case ClassCondition(term, kind, False):
                where.append(self.is_a(term, kind))
            case RelationCondition(relation, arguments, False):
                where.append(self.relation(relation, arguments))
            case EqualityCondition(left, right, True):
                where.append(self.different(left, right, *(self.possible(action, t) for t in (left, right))))
            case Witness(variable, kind, conditions, False):
                inner = self.fresh(action, variable[1:], self.type_of.get(kind, "object"))
                if kind not in self.type_of:
                    where.append(self.is_a(inner, kind))
                for c in conditions:
                    self.condition(substituted(c, {variable: inner}), action, where)
            case Witness(_, kind, (ValueCondition(situation, (_,), value, False),), True) if _absent(one):
                self.absence(kind, situation, value, action, where)
            case _:
                where.append(self.formula(one))

    def function(self, kind: str, ours: str, arguments: Sequence[str]) -> str:
        """Return the function that is an amount, or what a relation gives."""
        name = self.name("function", f"{kind} {ours}", ours)
        words = [self.term(t) for t in arguments if t not in self.world]
        kinds = self.problem.domain.situations[ours].arguments if kind == "situation" else ("",) * len(arguments)
        types = (
            self.type_of.get(one, "object") for one, t in zip(kinds, arguments, strict=True) if t not in self.world
        )
        self.functions[name] = tuple(types)
        if kind == "relation":
            self.measured[ours] = name
        return f"({' '.join([name, *words])})"

    def amount(self, one: Expression) -> str:
        """Return an amount as PDDL."""
        match one:
            case Amount(situation, arguments):
                return self.function("situation", situation, arguments)
            case Measure(relation, arguments):
                return self.function("relation", relation, arguments)
            case Calculation(sign, left, right):
                return f"({sign} {self.amount(left)} {self.amount(right)})"
            case constant:
                return decimal(constant)

    def absence(self, kind: str, situation: str, value: str, action: _Action, where: list[str]) -> None:
        """Add "no individual of the class has the value"."""
        if self.situations[situation].boolean:
            for member in self.problem.classes[kind]:
                self.condition(ValueCondition(situation, (member,), value, True), action, where)
            return
        if self.exclusive(kind, situation):
            self.free[kind, situation] = None
            where.append(f"({self.free_name(kind, situation)} {self.term(value)})")
            return
        self.contrary.setdefault(situation, set()).update(self.members(action, value))
        name = self.name("predicate", f"not {situation}", f"not_{situation}")
        self.arity[name] = 2
        where.extend(f"({name} {self.term(member)} {self.term(value)})" for member in self.problem.classes[kind])

    def free_name(self, kind: str, situation: str) -> str:
        name = self.name("predicate", f"free {kind} {situation}", f"no_{kind}_has_{situation}")
        self.arity[name] = 1
        return name

    def exclusive(self, kind: str, situation: str) -> bool:
        """Return whether no two individuals of a class can come to have the same value, of those asked about."""
        asked: frozenset[str] = frozenset()
        for behavior in self.behaviors:
            for c in behavior.preconditions:
                if _absent(c) == (kind, situation):
                    asked |= self.members_of(behavior, c.conditions[0].value)  # type: ignore[union-attr]
        self.asked[kind, situation] = asked
        held = [
            v for s, v in self.problem.initial.items() if s.situation == situation and s.arguments[0] in self.sets[kind]
        ]
        if any(v in asked for v in held) and len([v for v in held if v in asked]) > len(
            {v for v in held if v in asked}
        ):
            return False
        return all(
            not self.members_of(behavior, effect.value) & asked
            or (not effect.when and any(
                _absent(c) == (kind, situation) and c.conditions[0].value == effect.value  # type: ignore[union-attr]
                for c in behavior.preconditions
            ))
            for behavior in self.behaviors
            for effect in behavior.effects
            if effect.situation == situation
        )  # fmt: skip

    def members_of(self, behavior: Behavior, term: str) -> frozenset[str]:
        kinds = behavior.kinds
        return self.sets.get(kinds[term], frozenset()) if term in kinds else frozenset({term})

    def members(self, action: _Action, term: str) -> frozenset[str]:
        return self.members_of(action.behavior, term)

    def possible(self, action: _Action, term: str) -> frozenset[str]:
        """Return what a term can stand for, everything where that isn't known."""
        known = self.members(action, term)
        return frozenset().union(*self.sets.values()) - self.world if term in known and term.startswith("?") else known

    def relation(self, relation: str, arguments: Sequence[str]) -> str:
        name = self.name("predicate", f"relation {relation}", relation)
        self.arity[name] = len(arguments)
        self.statics[name] = set(self.problem.relations.get(relation, ()))
        return f"({' '.join([name, *map(self.term, arguments)])})"

    def formula(self, one: Condition) -> str:
        """Return a condition as it is, with every connective that PDDL has."""
        match one:
            case ValueCondition(situation, arguments, value, negated):
                if situation not in self.situations:
                    return "(and)" if negated else "(or)"
                flip = self.situations[situation].boolean and value == FALSE
                text, no = self.predicate(situation, arguments, value), negated is not flip
            case RelationCondition(relation, arguments, negated):
                text, no = self.relation(relation, arguments), negated
            case ClassCondition(term, kind, negated):
                text, no = self.is_a(term, kind), negated
            case EqualityCondition(left, right, negated):
                text, no = f"(= {self.term(left)} {self.term(right)})", negated
            case Witness(variable, kind, conditions, negated):
                parts = [self.formula(c) for c in conditions]
                if kind not in self.type_of:
                    parts.insert(0, self.is_a(variable, kind))
                kind_of = self.type_of.get(kind, "object")
                text, no = f"(exists ({self.term(variable)} - {kind_of}) {_and(parts)})", negated
            case AnyOf(alternatives, negated):
                text = f"(or {' '.join(_and([self.formula(c) for c in group]) for group in alternatives)})"
                no = negated
            case Comparison(left, sign, right, negated):
                text, no = f"({sign} {self.amount(left)} {self.amount(right)})", negated
        return f"(not {text})" if no else text

    def axiom(self, rule: Rule) -> str:
        """Return a rule as a derived predicate; what it determines besides is looked for."""
        parts = [self.is_a(t.name, t.kind) for t in rule.parameters if t.kind not in self.type_of]
        parts += [self.is_a(t.name, t.kind) for t in rule.variables if t.kind not in self.type_of]
        parts += [self.formula(c) for c in rule.conditions]
        text = _and(parts)
        if rule.variables:
            inside = {self.term(t.name): self.type_of.get(t.kind, "object") for t in rule.variables}
            text = f"(exists ({self.typed(inside)}) {text})"
        name = self.name("predicate", rule.situation)
        terms = {self.term(t.name): self.type_of.get(t.kind, "object") for t in rule.parameters if t.kind != WORLD}
        self.arity[name] = len(terms)
        return f"  (:derived ({' '.join([name, self.typed(terms)]).strip()})\n    {text})"

    def fresh(self, action: _Action, wanted: str, kind: str = "object") -> str:
        name = f"?{wanted}"
        while name in action.terms:
            name += "_"
        action.terms[name] = kind
        return name

    # --------------------------------------------------------------------------------------------------- actions

    def actions(self, behavior: Behavior) -> Iterator[_Action]:
        """Yield the actions of a behaviour: one, and another for each case of a conditional effect."""
        for cases in product(*(self.same_or_not(behavior, effect) for effect in behavior.effects)):
            extra = [c for conditions, _, _ in cases for c in conditions]
            declared = {t.name: t for t in behavior.variables}
            used = {t for c in (*behavior.preconditions, *extra) for t in _terms(c)}
            used |= {t for _, effects, _ in cases for e in effects for t in (*e.arguments, e.value)}
            used |= {t for e in behavior.amounts if not e.when for t in (*e.arguments, *terms_of(e.amount))}
            used |= set() if behavior.price is None else {*terms_of(behavior.price)}
            terms = {p.name: self.type_of.get(p.kind, "object") for p in behavior.parameters}
            terms |= {n: self.type_of.get(v.kind, "object") for n, v in declared.items() if n in used}
            action = _Action(behavior, terms)
            for t in (*behavior.parameters, *(v for n, v in declared.items() if n in used)):
                if t.kind not in self.type_of:
                    action.needs.append(self.is_a(t.name, t.kind))
            limits = allowed(behavior, self.problem.domain.situations)
            conditions = list(dict.fromkeys((*behavior.asked, *limits, *extra)))
            for c in conditions:
                self.condition(c, action, action.needs)
            if behavior.price is not None:
                self.price(behavior.price, action)
            for _, effects, conditional in cases:
                for effect in effects:
                    self.effect(effect, conditions, action)
                for effect in conditional:
                    self.conditional(effect, action)
            for change in behavior.amounts:
                self.changed(change, action)
            if "(or)" not in action.needs and (
                action.ends or action.begins or action.effects
            ):  # one that does something
                yield action

    def price(self, price: Expression, action: _Action) -> None:
        """Have an action cost what a price comes to; where a relation gives no number, it can't be done.

        That there is one is said by a predicate, since planners that know costs needn't know how to compare numbers.
        """
        for part in inside(price):
            if isinstance(part, Measure):
                rows = {row[:-1] for row in self.problem.relations.get(part.relation, ())}
                if any(row not in rows for row in product(*(sorted(self.members(action, t)) for t in part.arguments))):
                    name = self.name("predicate", f"has {part.relation}", f"has_{part.relation}")
                    self.arity[name] = len(part.arguments)
                    self.statics[name] = rows
                    action.needs.append(f"({' '.join([name, *map(self.term, part.arguments)])})")
        action.price = self.amount(price)

    def same_or_not(
        self, behavior: Behavior, effect: ValueEffect
    ) -> Iterator[tuple[tuple[Condition, ...], tuple[ValueEffect, ...], tuple[ValueEffect, ...]]]:
        """Yield the cases of an effect, two of one that may leave a value as it is of which the contrary is kept."""
        asked = set(self.contrary.get(effect.situation, ()))
        for _, name in self.free:
            asked |= self.sets[self.situations[name].range] if name == effect.situation else set()
        for conditions, effects, conditional in self.cases(behavior, effect):
            yield conditions, effects, conditional
            situation = self.situations.get(effect.situation)
            if (
                not effects
                or situation is None
                or situation.boolean
                or not self.members_of(behavior, effect.value) & asked
            ):
                continue
            old = {
                c.value
                for c in (*behavior.preconditions, *conditions)
                if isinstance(c, ValueCondition) and not c.negated
                and (c.situation, c.arguments) == (effect.situation, effect.arguments)
            }  # fmt: skip
            possible = [self.members_of(behavior, value) for value in old] or [self.sets[situation.range]]
            if any(members & self.members_of(behavior, effect.value) for members in possible) and old != {effect.value}:
                yield (*conditions, ValueCondition(effect.situation, effect.arguments, effect.value)), (), conditional

    def cases(
        self, behavior: Behavior, effect: ValueEffect
    ) -> list[tuple[tuple[Condition, ...], tuple[ValueEffect, ...], tuple[ValueEffect, ...]]]:
        """Return what a behaviour may need besides, the effects that it then has, and those that stay conditional."""
        if not effect.when:
            return [((), (effect,), ())]
        plain = replace(effect, when=())
        if len(effect.when) == 1 and isinstance(effect.when[0], ValueCondition) and not effect.when[0].negated:
            when = effect.when[0]
            situation = self.situations.get(when.situation)
            own = next((v for v in behavior.variables if v.name == when.value), None)
            bound = {p.name for p in behavior.parameters} | {t for c in behavior.preconditions for t in _terms(c)}
            if situation and not situation.boolean and (own is None or when.value not in bound):
                members = self.sets[own.kind] if own else frozenset({when.value})
                others = [v for v in self.problem.classes[situation.range] if v not in members]
                if len(others) <= 4 and not (own is None and when.value.startswith("?")):
                    rest = [((replace(when, value=v),), (), ()) for v in others]
                    return [((when,), (plain,), ()), *rest]
        return [((), (), (effect,))]

    def effect(self, effect: ValueEffect, conditions: Sequence[Condition], action: _Action) -> None:
        if effect.situation not in self.situations:
            return
        situation, arguments, value = self.situations[effect.situation], effect.arguments, effect.value
        if situation.boolean:
            yes, no = ([action.begins, action.ends], [action.ends, action.begins])[value == FALSE]
            yes.append(self.predicate(situation.name, arguments, TRUE))
            no.append(f"?contrary {situation.name} {' '.join(arguments)}")
            return
        old = next(
            (c.value for c in conditions if isinstance(c, ValueCondition) and not c.negated
             and (c.situation, c.arguments) == (situation.name, arguments)), None,
        )  # fmt: skip
        if old is None:
            wanted = self.predicate(situation.name, arguments, "?other")[:-1].rsplit(" ", 1)[0]
            known = next((n for n in action.needs if n.startswith(f"{wanted} ?other")), None)
            old = known[:-1].rsplit(" ", 1)[1] if known else self.fresh(action, "old")
            if not known:
                action.needs.append(self.predicate(situation.name, arguments, old))
        if old == value:
            return
        free = any(name == situation.name for _, name in self.free)
        asked = self.sets[situation.range] if free else frozenset(self.contrary.get(situation.name, ()))
        news = self.members(action, value)
        if news & asked and (old.startswith(("?other", "?old")) or self.members(action, old) & news):
            action.needs.append(self.different(old, value, self.range_of(situation.name), news))
        action.ends.append(self.predicate(situation.name, arguments, old))
        action.begins.append(self.predicate(situation.name, arguments, value))
        action.begins.append(f"?contrary {situation.name} {' '.join((*arguments, old))}")
        action.ends.append(f"?contrary {situation.name} {' '.join((*arguments, value))}")
        action.begins.append(f"?free {situation.name} {arguments[0] if arguments else ''} {old}")
        action.ends.append(f"?free {situation.name} {arguments[0] if arguments else ''} {value}")

    def conditional(self, effect: ValueEffect, action: _Action) -> None:
        """Add an effect that stays conditional, the value before it put an end to for every value there is."""
        situation = self.situations.get(effect.situation)
        if situation is None:
            return
        own = {
            v.name: self.type_of.get(v.kind, "object") for v in action.behavior.variables if v.name not in action.terms
        }
        inside = {t for c in effect.when for t in _terms(c)} | {*effect.arguments, effect.value}
        own = {name: kind for name, kind in own.items() if name in inside}
        kinds = {v.name: v.kind for v in action.behavior.variables}
        when = [self.is_a(n, kinds[n]) for n in own if kinds[n] not in self.type_of]
        when += [self.formula(c) for c in effect.when]
        after = self.predicate(situation.name, effect.arguments, effect.value)
        changes: list[str]
        if situation.boolean:
            contrary = f"?contrary {situation.name} {' '.join(effect.arguments)}"
            no = effect.value == FALSE
            changes = [f"?not {after}" if no else after, contrary if no else f"?not {contrary}"]
        else:
            members = [v for v in self.problem.classes[situation.range] if v != effect.value]
            changes = [f"?not {self.predicate(situation.name, effect.arguments, v)}" for v in members]
            changes += [after, f"?not ?contrary {situation.name} {' '.join((*effect.arguments, effect.value))}"]
            changes += [f"?contrary {situation.name} {' '.join((*effect.arguments, v))}" for v in members]
        action.effects.append("\n".join([self.typed({self.term(n): k for n, k in own.items()}), _and(when), *changes]))

    def changed(self, change: AmountEffect, action: _Action) -> None:
        """Add an effect on an amount."""
        at = self.function("situation", change.situation, change.arguments)
        head, by = change.operation, self.amount(change.amount)
        alone = [e.situation for e in action.behavior.amounts].count(change.situation) == 1
        if head == "scale":  # which many don't read
            head, by = ("assign", f"(* {at} {by})") if alone else ("scale-up", by)
        text = f"({head} {at} {by})"
        if not change.when:
            action.begins.append(text)
            return
        inside = {t for c in change.when for t in _terms(c)} | {*change.arguments, *terms_of(change.amount)}
        own = {v.name: v.kind for v in action.behavior.variables if v.name not in action.terms and v.name in inside}
        when = [self.is_a(n, kind) for n, kind in own.items() if kind not in self.type_of]
        when += [self.formula(c) for c in change.when]
        typed = self.typed({self.term(n): self.type_of.get(kind, "object") for n, kind in own.items()})
        action.effects.append("\n".join([typed, _and(when), text]))

    # ------------------------------------------------------------------------------------------------------ texts

    def resolve(self, text: str) -> list[str]:
        """Return the atoms behind a note on contraries or freedom, none where the export doesn't need them."""
        words = text.split()
        if words[0] == "?contrary":
            if words[1] not in self.contrary:
                return []
            boolean = self.situations[words[1]].boolean
            if not boolean and not words[-1].startswith("?") and words[-1] not in self.contrary[words[1]]:
                return []
            name = self.name("predicate", f"not {words[1]}", f"not_{words[1]}")
            terms = [self.term(t) for t in words[2:] if t not in self.world]
            self.arity[name] = len(terms)
            return [f"({' '.join([name, *terms])})"]
        if words[0] == "?free":
            return [
                f"({self.free_name(kind, situation)} {self.term(words[-1])})"
                for kind, situation in self.free
                if situation == words[1]
                and len(words) == 4
                and (words[-1].startswith("?") or words[-1] in self.asked[kind, situation])
            ]
        return [text]

    def action_text(self, name: str, action: _Action) -> str:
        begins = [t for note in action.begins for t in self.resolve(note)]
        ends = [f"(not {t})" for note in action.ends for t in self.resolve(note) if t not in begins]
        effects = list(dict.fromkeys([*ends, *begins]))
        for one in action.effects:
            typed, when, *changes = one.split("\n")
            parts = []
            for change in changes:
                no = change.startswith("?not ")
                parts += [f"(not {t})" if no else t for t in self.resolve(change.removeprefix("?not "))]
            text = f"(when {when} {_and(parts)})"
            effects.append(f"(forall ({typed}) {text})" if typed else text)
        if self.costs:
            effects.append(f"(increase (total-cost) {action.price or format(action.behavior.cost, 'g')})")
        terms = {self.term(n): kind for n, kind in action.terms.items()}
        needs = "\n      ".join(dict.fromkeys(action.needs))
        does = "\n      ".join(effects)
        return (
            f"  (:action {name}\n    :parameters ({self.typed(terms)})\n"
            f"    :precondition (and\n      {needs})\n    :effect (and\n      {does}))"
        )

    def counts(self, body: str) -> bool:
        """Whether functions are used otherwise than to say what actions cost."""
        rest = "\n".join(line for line in body.splitlines() if "(increase (total-cost)" not in line)
        asked = any(symbol.situation in self.quantities for symbol in self.problem.goal)
        return asked or any(re.search(rf"\({re.escape(name)}[ )]", rest) for name in self.functions)

    @property
    def costs(self) -> bool:
        return any(b.cost != 1 or b.price is not None for b in self.behaviors)

    def individuals(self) -> list[str]:
        used = [s for s in self.situations.values() if self.name("predicate", s.name) in self.arity]
        kinds = {*self.types, *(k for s in used for k in (*s.arguments, s.range))} - {"Truth", WORLD}
        found = [o for kind, members in self.problem.classes.items() if kind in kinds for o in members]
        found += [o for predicate in sorted(self.statics) for row in sorted(self.statics[predicate]) for o in row]
        amounts = [s for s in self.problem.initial if s.situation in self.quantities]
        found += [o for symbol in amounts for o in symbol.arguments]
        for states in (self.problem.initial, self.problem.goal):
            found += [o for s, v in states.items() if s.situation in self.situations for o in (*s.arguments, v)]
        return [o for o in dict.fromkeys(found) if o not in self.world and o not in (TRUE, FALSE)]

    def domain_text(self, name: str, actions: Sequence[str]) -> str:
        body = "\n".join(actions)
        predicates = [
            f"({predicate}{''.join(f' ?x{i}' for i in range(arity))})"
            for predicate, arity in sorted(self.arity.items())
        ]
        wanted = {
            ":negative-preconditions": any("(not (" in a.split(":effect")[0] for a in actions),
            ":disjunctive-preconditions": "(or " in body,
            ":existential-preconditions": "(exists " in body,
            ":conditional-effects": "(when " in body,
            ":equality": "(= " in body,
            ":derived-predicates": "(:derived " in body,
            ":action-costs": self.costs,
            ":numeric-fluents": self.counts(body),
        }
        requirements = " ".join([":strips", ":typing", *(key for key, needed in wanted.items() if needed)])
        types = "\n    ".join(f"{kind} - {above}" for kind, above in self.above.items())
        constants = [o for o in self.individuals() if self.name("object", o) in self.mentioned(body)]
        said = f"  (:constants\n    {self.objects_text(constants)})\n" if constants else ""
        declared = [
            f"({name}{''.join(f' ?x{i} - {kind}' for i, kind in enumerate(kinds))})"
            for name, kinds in sorted(self.functions.items())
        ]
        declared += ["(total-cost)"] * self.costs
        functions = f"  (:functions {' '.join(declared)} - number)\n" if declared else ""
        return (
            f"(define (domain {name})\n  (:requirements {requirements})\n  (:types\n    {types})\n{said}"
            f"  (:predicates\n    {chr(10).join(predicates).replace(chr(10), chr(10) + '    ')})\n{functions}{body})\n"
        )

    def mentioned(self, text: str) -> set[str]:
        self._mentioned = set(re.findall(r"[^\s()]+", text))
        return self._mentioned

    def objects_text(self, names: Sequence[str]) -> str:
        return "\n    ".join(f"{self.name('object', o)} - {self.lowest.get(o, 'object')}" for o in names)

    def problem_text(self, domain: str, individuals: Sequence[str]) -> str:
        facts: list[str] = []
        true: set[tuple[str, tuple[str, ...]]] = set()
        for symbol, value in self.problem.initial.items():
            if symbol.situation in self.quantities and ("function", f"situation {symbol.situation}") in self.names:
                at = self.function("situation", symbol.situation, symbol.arguments)
                facts.append(f"(= {at} {decimal(Fraction(value), False)})")
            if symbol.situation not in self.situations:
                continue
            if self.situations[symbol.situation].boolean:
                if value != TRUE:
                    continue
                true.add((symbol.situation, symbol.arguments))
            else:
                true.add((symbol.situation, (*symbol.arguments, value)))
            if self.name("predicate", symbol.situation) in self.arity:
                facts.append(self.predicate(symbol.situation, symbol.arguments, value))
        for situation in sorted(self.contrary):
            one = self.situations[situation]
            kinds = [*one.arguments] if one.boolean else [*one.arguments, one.range]
            for row in product(*(self.problem.classes.get(kind, ()) for kind in kinds)):
                if (situation, row) not in true:
                    facts += self.resolve(f"?contrary {situation} {' '.join(row)}")
        for kind, situation in self.free:
            held = {row[1] for name, row in true if name == situation and row[0] in self.sets[kind]}
            values = (
                v for v in self.problem.classes[self.situations[situation].range] if v in self.asked[kind, situation]
            )
            facts += [f"({self.free_name(kind, situation)} {self.term(v)})" for v in values if v not in held]
        for relation in sorted(self.measured):
            for row in sorted(self.problem.relations.get(relation, ())):
                at = self.function("relation", relation, row[:-1])
                facts.append(f"(= {at} {decimal(Fraction(row[-1]), False)})")
        for predicate, rows in sorted(self.statics.items()):
            facts += [f"({' '.join([predicate, *map(self.term, row)])})" for row in sorted(rows)]
        goals = []
        for symbol, value in self.problem.goal.items():
            if symbol.situation in self.quantities:
                at = self.function("situation", symbol.situation, symbol.arguments)
                goals += [f"({sign} {at} {decimal(limit)})" for sign, limit in bounds(value)]
                continue
            atom = self.predicate(symbol.situation, symbol.arguments, value)
            goals.append(f"(not {atom})" if value == FALSE and self.situations[symbol.situation].boolean else atom)
        costs = ["(= (total-cost) 0)"] if self.costs else []
        metric = "  (:metric minimize (total-cost))\n" if self.costs else ""
        others = [o for o in individuals if self.name("object", o) not in self._mentioned]
        rest = "\n    "
        name = self.name("domain", self.problem.scene.rsplit("/", 1)[-1] + " ")
        return (
            f"(define (problem {name})\n  (:domain {domain})\n"
            f"  (:objects\n    {self.objects_text(others)})\n"
            f"  (:init\n    {rest.join([*costs, *facts])})\n"
            f"  (:goal (and\n    {rest.join(goals)}))\n{metric})\n"
        )


def decimal(number: Fraction, calculated: bool = True) -> str:
    """Return a number as PDDL; one without end as a quotient, or where that can't be, cut off behind thirty places."""
    text = written(number)
    if "/" not in text:
        return text
    if calculated:
        return f"(/ {number.numerator} {number.denominator})"
    return written(Fraction(round(number * 10**30), 10**30))


def _and(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"(and {' '.join(parts)})"


def _absent(condition: Condition) -> tuple[str, str] | None:
    """Return class and situation type of "no individual of the class has this value"."""
    match condition:
        case Witness(variable, kind, (ValueCondition(situation, (about,), _, False),), True) if about == variable:
            return kind, situation
    return None


def _terms(condition: Condition) -> set[str]:
    """Return the variables of a condition from outside, those of a disjunction left to it."""
    if isinstance(condition, Witness):
        return {t for c in condition.conditions for t in _terms(c)} - {condition.variable}
    return {t for t in terms(condition) if is_variable(t)}
