"""Behaviours as actions of PDDL: what they ask and change, as plainly as it can be said.

==============================  ==================================================================
here                            in PDDL
==============================  ==================================================================
effect on a known value         that value is deleted; an unknown one becomes a parameter first
negated value, inequality       parameter for the value that it is instead, which isn't the same
"no such object"                predicate for "free", kept up to date, if it can't hold twice;
                                else one contrary per object
symbol that may not exist       predicate that says for what it does
rule of what is defined         its condition, in place of it; ``:derived`` if it needs itself
two effects on one symbol       the first one under the condition that the second one isn't made
anything else                   as it is, with ``or``, ``exists``, ``when``, ``forall``
==============================  ==================================================================
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from reasoner.amounts import Amount, Calculation, Expression, Measure, bounds, terms_of
from reasoner.derivation import circular
from reasoner.pddl.formulas import FALSE as NEVER
from reasoner.pddl.formulas import TRUE as ALWAYS
from reasoner.pddl.formulas import (
    Assignment,
    Atom,
    Change,
    Compare,
    Formula,
    Not,
    Number,
    Operation,
    Term,
    both,
    either,
    no,
    same,
    some,
)
from reasoner.pddl.vocabulary import Vocabulary
from reasoner.symbols import (
    FALSE,
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
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
    allowed,
)

Terms = Mapping[str, Term]


@dataclass(frozen=True)
class Action:
    """An action: `places` are those of the behaviour's parameters among its own."""

    behavior: Behavior
    parameters: tuple[Term, ...]
    places: tuple[int, ...]
    needs: Formula
    changes: tuple[Change, ...]
    cost: Number


@dataclass
class Scope:
    """The terms of a behaviour or rule: names that are taken, parameters, and the values that symbols are known to have."""

    kinds: Mapping[str, str]
    names: set[str] = field(default_factory=set)
    parameters: list[Term] = field(default_factory=list)
    values: dict[tuple[str, tuple[Term, ...]], Term] = field(default_factory=dict)
    needs: list[Formula] = field(default_factory=list)

    def fresh(self, wanted: str) -> str:
        """Return a name for a variable that no other one has."""
        name = "?" + re.sub(r"[^0-9a-z_-]", "_", wanted.removeprefix("?").lower())
        name = name if re.match(r"\?[a-z]", name) else f"?x{name[1:]}"
        while name in self.names:
            name += "_"
        self.names.add(name)
        return name


@dataclass(frozen=True)
class Cell:
    """What an effect changes: a symbol, where a formula holds for some variables."""

    own: tuple[Term, ...]
    when: Formula
    terms: tuple[Term, ...]
    value: Term | None


class Lowering:
    """Turns conditions and behaviours of one level into formulas and actions."""

    def __init__(self, problem: Problem, behaviors: Sequence[Behavior], words: Vocabulary) -> None:
        self.problem, self.behaviors, self.words = problem, behaviors, words
        self.rules = problem.domain.rules
        self.recursive = circular(self.rules)
        self.contrary: dict[str, set[str]] = {}  # situation types whose contrary is kept, and of which values
        self.free: dict[tuple[str, str], frozenset[str]] = {}  # class and situation type, and the values asked about
        for behavior in behaviors:
            for condition in behavior.preconditions:
                if absent := self.absent(condition):
                    self.keep(behavior, *absent)

    # ------------------------------------------------------------------------------------------- kept up to date

    def absent(self, condition: Condition) -> tuple[str, str, str] | None:
        """Return class, situation type and value of "no individual of the class has this value"."""
        match condition:
            case Witness(variable, kind, (ValueCondition(situation, (about,), value, False),), True):
                known = situation not in self.rules and not self.words.situations[situation].boolean
                if about == variable != value and known:
                    return kind, situation, value
        return None

    def keep(self, behavior: Behavior, kind: str, situation: str, value: str) -> None:
        """Note what has to be kept up to date so that a behaviour can ask whether nothing has a value."""
        if (kind, situation) not in self.free and self.exclusive(kind, situation):
            self.free[kind, situation] = self.asked(kind, situation)
        if (kind, situation) not in self.free:
            self.contrary.setdefault(situation, set()).update(self.members(behavior, value))

    def members(self, behavior: Behavior, term: str) -> frozenset[str]:
        """Return what a term of a behaviour can stand for."""
        return self.problem.members(behavior.kinds[term]) if term in behavior.kinds else frozenset((term,))

    def asked(self, kind: str, situation: str) -> frozenset[str]:
        """Return the values of which behaviours ask whether no individual of a class has them."""
        found = frozenset[str]()
        for behavior in self.behaviors:
            for absent in map(self.absent, behavior.preconditions):
                if absent and absent[:2] == (kind, situation):
                    found |= self.members(behavior, absent[2])
        return found

    def exclusive(self, kind: str, situation: str) -> bool:
        """Return whether no two individuals of a class can come to have the same value, of those asked about."""
        asked, its = self.asked(kind, situation), self.problem.members(kind)
        held = [v for s, v in self.problem.initial.items() if s.situation == situation and s.arguments[0] in its]
        held = [value for value in held if value in asked]
        if len(held) > len(set(held)):
            return False
        for behavior in self.behaviors:
            empty = {a[2] for a in map(self.absent, behavior.preconditions) if a and a[:2] == (kind, situation)}
            filling = [
                effect
                for effect in behavior.effects
                if effect.situation == situation
                and self.members(behavior, effect.arguments[0]) & its
                and self.members(behavior, effect.value) & asked
            ]
            if len(filling) > 1 or any(effect.when or effect.value not in empty for effect in filling):
                return False
        return True

    def lacks(self, situation: str, terms: tuple[Term, ...], value: Term) -> Atom:
        """Return that a symbol doesn't have a value, as a predicate of its own."""
        words = self.words
        name = words.name("predicate", f"not {situation}", f"not_{situation}")
        return words.atom(name, (*words.about(situation, terms), value))

    def nobody(self, kind: str, situation: str, value: Term) -> Atom:
        """Return that no individual of a class has a value, as a predicate of its own."""
        name = self.words.name("predicate", f"free {kind} {situation}", f"no_{kind}_has_{situation}")
        return self.words.atom(name, (value,))

    def kept(self) -> Iterator[Atom]:
        """Yield what holds at first of what is kept up to date."""
        state = self.problem.initial
        for situation, values in sorted(self.contrary.items()):
            for symbol, has in state.items():
                if symbol.situation == situation:
                    terms = self.words.terms(symbol.arguments, {})
                    yield from (self.lacks(situation, terms, self.words.object(v)) for v in sorted(values - {has}))
        for (kind, situation), values in self.free.items():
            its = self.problem.members(kind)
            held = {has for s, has in state.items() if s.situation == situation and s.arguments[0] in its}
            yield from (self.nobody(kind, situation, self.words.object(v)) for v in sorted(values - held))

    # ------------------------------------------------------------------------------------------------- conditions

    def all_of(self, conditions: Sequence[Condition], terms: Terms, scope: Scope) -> Formula:
        """Return that a conjunction holds, for some objects in place of what isn't bound yet."""
        own, terms = self.bound(conditions, terms, scope)
        parts = [self.words.guard(terms[name], scope.kinds[name]) for name in own]
        parts += [self.formula(condition, terms, scope) for condition in conditions]
        return some((terms[name] for name in own), both(parts))

    def bound(self, conditions: Sequence[Condition], terms: Terms, scope: Scope) -> tuple[list[str], Terms]:
        """Return the variables that a conjunction names and that aren't bound yet, and all terms with them."""
        own = sorted(set().union(*map(named, conditions)) - terms.keys())
        fresh = {name: self.words.variable(scope.fresh(name), scope.kinds[name]) for name in own}
        return own, {**terms, **fresh}

    def formula(self, condition: Condition, terms: Terms, scope: Scope) -> Formula:
        """Return a condition as a formula."""
        words = self.words
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                its = words.terms(arguments, terms)
                if not words.situations[situation].boolean:
                    return no(words.value(situation, its, words.terms((value,), terms)[0]), negated)
                found = self.defined(situation, its, scope)
                if value == FALSE:
                    found = both([no(found), words.exists(situation, its)])
                return no(found, negated)
            case RelationCondition(relation, arguments, negated):
                return no(words.relation(relation, words.terms(arguments, terms)), negated)
            case ClassCondition(term, kind, negated):
                return no(words.is_a(words.terms((term,), terms)[0], kind), negated)
            case EqualityCondition(left, right, negated):
                return no(same(*words.terms((left, right), terms)), negated)
            case Witness(variable, kind, conditions, negated):
                term = words.variable(scope.fresh(variable), kind)
                inner = self.all_of(conditions, {**terms, variable: term}, scope)
                return no(some((term,), both([words.guard(term, kind), inner])), negated)
            case AnyOf(alternatives, negated):
                return no(either(self.all_of(group, terms, scope) for group in alternatives), negated)
            case Comparison(left, sign, right, negated):
                there = both([*words.there(left, terms), *words.there(right, terms)])
                compared = Compare(sign, words.number(left, terms), words.number(right, terms))
                return no(both([there, compared]), negated)

    def defined(self, situation: str, its: tuple[Term, ...], scope: Scope) -> Formula:
        """Return that a boolean symbol is true; of one that is defined, when it is, unless its rules need themselves."""
        if situation not in self.rules or situation in self.recursive:
            return self.words.value(situation, its, None)
        ways = []
        for rule in self.rules[situation]:
            inner = Scope(rule.behavior.kinds, scope.names)
            given = {p.name: term for p, term in zip(rule.parameters, its, strict=True)}
            fits = [self.words.is_a(given[p.name], p.kind) for p in rule.parameters]
            ways.append(both([*fits, self.all_of(rule.conditions, given, inner)]))
        return either(ways)

    def derived(self) -> Iterator[tuple[Atom, tuple[Term, ...], Formula]]:
        """Yield the rules that need themselves: a predicate, its variables, and when it holds."""
        for situation in sorted(self.recursive):
            for rule in self.rules[situation]:
                scope = Scope(rule.behavior.kinds)
                terms = {p.name: self.words.variable(scope.fresh(p.name), p.kind) for p in rule.parameters}
                head = self.words.value(situation, tuple(terms.values()), None)
                guards = [self.words.guard(terms[p.name], p.kind) for p in rule.parameters]
                holds = both([*guards, self.all_of(rule.conditions, terms, scope)])
                if holds != NEVER:
                    inside = {term.name for term in head.terms}
                    left = [term for term in terms.values() if term.name not in inside]  # the world
                    yield head, head.terms, some(left, holds)

    # ---------------------------------------------------------------------------------------------------- actions

    def action(self, behavior: Behavior) -> Action | None:
        """Return a behaviour as an action; nothing for one that can never be done, or that changes nothing."""
        scope, terms = Scope(behavior.kinds), dict[str, Term]()
        used = set().union(*map(named, behavior.preconditions), set(terms_of(behavior.price) if behavior.price else ()))
        for one in (*behavior.parameters, *(v for v in behavior.variables if v.name in used)):
            terms[one.name] = self.words.variable(scope.fresh(one.name), one.kind)
            scope.parameters.append(terms[one.name])
            scope.needs.append(self.words.guard(terms[one.name], one.kind))
        conditions = [*behavior.asked, *allowed(behavior, self.problem.domain.situations)]
        for condition in conditions:
            match condition:
                case ValueCondition(situation, arguments, value, False) if not self.words.situations[situation].boolean:
                    key = situation, self.words.terms(arguments, terms)
                    scope.values.setdefault(key, self.words.terms((value,), terms)[0])
        for condition in conditions:
            self.need(condition, terms, scope)
        cost = self.cost(behavior, terms, scope)
        changes = [*self.value_changes(behavior, terms, scope), *self.amount_changes(behavior, terms, scope)]
        needs = both(scope.needs)
        if needs == NEVER or not changes or not all(term.members for term in scope.parameters):
            return None
        names = [term.name for term in scope.parameters]
        places = tuple(names.index(terms[p.name].name) for p in behavior.parameters)
        return Action(behavior, tuple(scope.parameters), places, needs, tuple(changes), cost)

    def parameter(self, wanted: str, members: Iterable[str], scope: Scope) -> Term:
        """Return a new parameter of an action, for what a condition of it determines."""
        term = Term(scope.fresh(wanted), "object", frozenset(members))
        scope.parameters.append(term)
        return term

    def known(self, situation: str, its: tuple[Term, ...], wanted: str, scope: Scope) -> Term:
        """Return the value of a symbol; if no condition names it, a new parameter."""
        if (situation, its) not in scope.values:
            value = self.parameter(wanted, self.range_of(situation), scope)
            scope.values[situation, its] = value
            scope.needs.append(self.words.value(situation, its, value))
        return scope.values[situation, its]

    def range_of(self, situation: str) -> frozenset[str]:
        """Return the values that symbols of a situation type can have."""
        initial = {value for symbol, value in self.problem.initial.items() if symbol.situation == situation}
        return self.problem.members(self.words.situations[situation].range) | initial

    def need(self, condition: Condition, terms: Terms, scope: Scope) -> None:
        """Add a precondition."""
        words = self.words
        if absent := self.absent(condition):
            kind, situation, said = absent
            value = words.terms((said,), terms)[0]
            if (kind, situation) in self.free:
                scope.needs.append(self.nobody(kind, situation, value))
            else:
                its = [words.object(one) for one in sorted(self.problem.members(kind))]
                there = [one for one in its if words.exists(situation, (one,)) == ALWAYS]
                scope.needs.extend(self.lacks(situation, (one,), value) for one in there)
            return
        match condition:
            case ValueCondition(situation, arguments, said, True):
                its = words.terms(arguments, terms)
                if not words.situations[situation].boolean and words.total(situation, its):
                    value = words.terms((said,), terms)[0]
                    scope.needs.append(no(same(self.known(situation, its, "other", scope), value)))
                    return
            case Witness(variable, kind, conditions, False):
                term = words.variable(scope.fresh(variable), kind)
                own, inside = self.bound(conditions, {**terms, variable: term}, scope)
                scope.parameters += [term, *(inside[name] for name in own)]
                scope.needs.append(words.guard(term, kind))
                scope.needs += [words.guard(inside[name], scope.kinds[name]) for name in own]
                for one in conditions:
                    self.need(one, inside, scope)
                return
        scope.needs.append(self.formula(condition, terms, scope))

    def cost(self, behavior: Behavior, terms: Terms, scope: Scope) -> Number:
        """Return what an action costs; where that is no number, or less than nothing, it can't be done.

        That there is a number is said by a predicate, since planners that know costs needn't know how to compare numbers.
        """
        if behavior.price is None:
            return Fraction(repr(float(behavior.cost)))
        scope.needs += self.words.there(behavior.price, terms)
        price = self.words.number(behavior.price, terms)
        if not self.positive(behavior.price):
            scope.needs.append(Compare(">=", price, Fraction(0)))
        return price

    def positive(self, expression: Expression) -> bool:
        """Return whether a calculation can never be less than nothing."""
        match expression:
            case Measure(relation):
                return all(Fraction(row[-1]) >= 0 for row in self.problem.relations.get(relation, ()))
            case Calculation(sign, left, right):
                return sign != "-" and self.positive(left) and self.positive(right)
            case Amount(situation):
                least = getattr(self.words.situations[situation].quantity, "least", None)
                return least is not None and least >= 0
            case Fraction():
                return expression >= 0

    # ---------------------------------------------------------------------------------------------------- effects

    def cell(self, effect: ValueEffect | AmountEffect, terms: Terms, scope: Scope) -> tuple[Cell, Terms]:
        """Return what an effect changes, and the terms with which it does so."""
        own, inside = self.bound(effect.when, terms, scope)
        its = self.words.terms(effect.arguments, inside)
        when = [self.words.guard(inside[name], scope.kinds[name]) for name in own]
        when += [self.formula(condition, inside, scope) for condition in effect.when]
        when.append(self.words.exists(effect.situation, its))
        value = self.words.terms((effect.value,), inside)[0] if isinstance(effect, ValueEffect) else None
        return Cell(tuple(inside[name] for name in own), both(when), its, value), inside

    def value_changes(self, behavior: Behavior, terms: Terms, scope: Scope) -> Iterator[Change]:
        """Yield what a behaviour's effects on values change, the later one where two change the same symbol."""
        cells = [(effect, *self.cell(effect, terms, scope)) for effect in behavior.effects]
        for number, (effect, cell, inside) in enumerate(cells):
            if self.words.situations[effect.situation].boolean:
                atom = self.words.value(effect.situation, cell.terms, None)
                if cell.when != NEVER:
                    yield Change(Not(atom) if effect.value == FALSE else atom, cell.when, cell.own)
                continue
            later = [
                some(other.own, both([other.when, *map(same, cell.terms, other.terms)]))
                for one, other, _ in cells[number + 1 :]
                if one.situation == effect.situation and other.value != cell.value
            ]
            when = both([cell.when, no(either(later))])
            if when != NEVER:
                yield from self.moved(effect, Cell(cell.own, when, cell.terms, cell.value), inside, scope)

    def moved(self, effect: ValueEffect, cell: Cell, inside: Terms, scope: Scope) -> Iterator[Change]:
        """Yield what changes where a symbol gets a value in place of the one that it has."""
        words, situation, its, new = self.words, effect.situation, cell.terms, cell.value
        assert new is not None
        own, when = cell.own, cell.when
        before = [
            words.terms((c.value,), inside)[0]
            for c in effect.when
            if isinstance(c, ValueCondition) and not c.negated
            and (c.situation, words.terms(c.arguments, inside)) == (situation, its)
        ]  # fmt: skip
        if before:
            old = before[0]
        elif (situation, its) in scope.values or (when == ALWAYS and words.total(situation, its)):
            old = self.known(situation, its, "old", scope)
        else:
            old = Term(scope.fresh("old"), "object", self.range_of(situation))
            yield Change(words.value(situation, its, new), when, own)
            own, when = (*own, old), both([when, words.value(situation, its, old)])
        if old == new:
            return
        yield Change(Not(words.value(situation, its, old)), when, own)
        yield Change(words.value(situation, its, new), when, own)
        other = both([when, no(same(old, new))])
        if asked := self.contrary.get(situation, set()):
            if old.members & asked and other != NEVER:
                yield Change(self.lacks(situation, its, old), other, own)
            if new.members & asked:
                yield Change(Not(self.lacks(situation, its, new)), when, own)
        for (kind, name), asked_of in self.free.items():
            member = words.is_a(its[0], kind) if name == situation else NEVER
            if member == NEVER:
                continue
            if old.members & asked_of and other != NEVER:
                yield Change(self.nobody(kind, situation, old), both([other, member]), own)
            if new.members & asked_of:
                yield Change(Not(self.nobody(kind, situation, new)), both([when, member]), own)

    def amount_changes(self, behavior: Behavior, terms: Terms, scope: Scope) -> Iterator[Change]:
        """Yield what a behaviour's effects on amounts change; it can't be done where one of them would be no number."""
        changed = [effect.situation for effect in behavior.amounts]
        for effect in behavior.amounts:
            cell, inside = self.cell(effect, terms, scope)
            if cell.when == NEVER:
                continue
            there = both(self.words.there(effect.amount, inside))
            scope.needs.append(no(some(cell.own, both([cell.when, no(there)]))))
            at, by = self.words.amount(effect.situation, cell.terms), self.words.number(effect.amount, inside)
            operation = effect.operation
            if operation == "scale":  # which many planners don't read
                alone = changed.count(effect.situation) == 1
                operation, by = ("assign", Operation("*", at, by)) if alone else ("scale-up", by)
            yield Change(Assignment(operation, at, by), cell.when, cell.own)

    # ------------------------------------------------------------------------------------------------------- goals

    def goal(self, symbol: Symbol, wanted: str) -> Formula:
        """Return what is wanted of a symbol."""
        words = self.words
        situation, its = words.situations[symbol.situation], words.terms(symbol.arguments, {})
        if situation.quantity is None:
            return self.formula(ValueCondition(symbol.situation, symbol.arguments, wanted), {}, Scope({}))
        at = words.amount(symbol.situation, its)
        exists = words.exists(symbol.situation, its)
        return both([exists, *(Compare(sign, at, limit) for sign, limit in bounds(wanted))])


def named(condition: Condition) -> set[str]:
    """Return the variables that a condition itself names: those inside `AnyOf` and `Witness` are looked for there."""
    match condition:
        case ValueCondition(_, arguments, value):
            terms = {*arguments, value}
        case RelationCondition(_, arguments):
            terms = set(arguments)
        case ClassCondition(term):
            terms = {term}
        case EqualityCondition(left, right):
            terms = {left, right}
        case Comparison(left, _, right):
            terms = {*terms_of(left), *terms_of(right)}
        case Witness() | AnyOf():
            terms = set()
    return {term for term in terms if term.startswith("?")}
