"""Translation of behaviours to PDDL actions with the simplest possible conditions and effects.

==============================  ==================================================================
in the scene                    in PDDL
==============================  ==================================================================
effect on a value               the old value is deleted; an unknown one becomes a parameter
negated value, inequality       parameter for the actual value, which must be different
"no individual has the value"   extra predicate of the value, or of each individual and the
                                value (`confab.reasoner.pddl.absence`)
symbol that may not exist       static predicate of the arguments for which it exists
defined situation               its definition; ``:derived`` if it is recursive
two effects on one symbol       the first effect if the condition of the second one is false
anything else                   equivalent formula with ``or``, ``exists``, ``when``, ``forall``
==============================  ==================================================================
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import chain, combinations, islice

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, bounds, situations_in, terms_of
from confab.reasoner.amounts import inside as parts
from confab.reasoner.derivation import circular
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import is_variable, mentions, terms
from confab.reasoner.pddl.absence import NegationPredicates
from confab.reasoner.pddl.formulas import FALSE as NEVER
from confab.reasoner.pddl.formulas import TRUE as ALWAYS
from confab.reasoner.pddl.formulas import (
    Arithmetic,
    Assignment,
    Atom,
    Compare,
    ConditionalEffect,
    Formula,
    FunctionTerm,
    Not,
    NumericTerm,
    PddlTerm,
    both,
    either,
    no,
    same,
    some,
)
from confab.reasoner.pddl.vocabulary import PddlNames
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

Terms = Mapping[str, PddlTerm]
CASES = 4
"""A conditional effect on a symbol is split into one action per value only if the symbol has at most this many other values."""
MOST_CASES = 64
"""Maximum number of actions into which a behaviour is split by the values that the conditions of its effects require; and, for each
of these actions, by the individuals that several effects on amounts may concern."""
APART = (
    "the effects may concern the same individual, and PDDL can't combine them; state by inequality conditions which individuals "
    "are different to export the behaviour"
)


@dataclass(frozen=True)
class LoweredAction:
    """A PDDL action with the precondition `needs`; `places` are the positions of the behaviour's parameters in `parameters`."""

    behavior: Behavior
    parameters: tuple[PddlTerm, ...]
    places: tuple[int, ...]
    needs: Formula
    changes: tuple[ConditionalEffect, ...]
    cost: NumericTerm


@dataclass
class ActionScope:
    """The variables of a behaviour or rule during its translation, the known values of symbols, and the preconditions."""

    kinds: Mapping[str, str]
    names: set[str] = field(default_factory=set)
    parameters: list[PddlTerm] = field(default_factory=list)
    values: dict[tuple[str, tuple[PddlTerm, ...]], PddlTerm] = field(default_factory=dict)
    needs: list[Formula] = field(default_factory=list)

    def fresh(self, wanted: str) -> str:
        """Return an unused PDDL variable name that resembles `wanted`."""
        name = "?" + re.sub(r"[^0-9a-z_-]", "_", wanted.removeprefix("?").lower())
        name = name if re.match(r"\?[a-z]", name) else f"?x{name[1:]}"
        while name in self.names:
            name += "_"
        self.names.add(name)
        return name


@dataclass(frozen=True)
class LoweredCondition:
    """The condition of an effect: the condition's own variables, all terms by their names in the scene, and the formula."""

    own: tuple[PddlTerm, ...]
    terms: Terms
    holds: Formula


@dataclass(frozen=True)
class LoweredEffect:
    """An effect on one symbol: the symbol's arguments, the new value, the effect's condition, and the condition's own variables."""

    own: tuple[PddlTerm, ...]
    when: Formula
    terms: tuple[PddlTerm, ...]
    value: PddlTerm | None


class Lowering:
    """Translation of the conditions and behaviours of one level to formulas and actions."""

    def __init__(self, problem: Problem, behaviors: Sequence[Behavior], words: PddlNames) -> None:
        self.problem, self.words = problem, words
        self.rules = problem.domain.rules
        self.recursive = circular(self.rules)
        changed = {effect.situation for behavior in behaviors for effect in behavior.amounts}
        scaled = {
            e.situation for one in behaviors for e in one.amounts if e.operation == "scale" and situations_in(e.amount)
        }
        self.judged_later = sorted((changed & problem.domain.aggregates.keys()) | scaled)
        given: dict[str, set[str]] = {}
        for symbol, value in problem.initial.items():
            given.setdefault(symbol.situation, set()).add(value)
        for one, effect in ((behavior, effect) for behavior in behaviors for effect in behavior.effects):
            given.setdefault(effect.situation, set()).update(words.denoted(one, effect.value))
        self.given = {situation: frozenset(values) for situation, values in given.items()}
        self.cases = [case for behavior in behaviors for case in self.cases_of(behavior)]
        self.kept = NegationPredicates(problem, self.cases, words)

    # ------------------------------------------------------------------------------------------------- conditions

    def all_of(self, conditions: Sequence[Condition], terms: Terms, scope: ActionScope) -> Formula:
        """Return the formula of a conjunction of conditions, in which unbound variables are existentially quantified."""
        own, inside = self.bound(conditions, terms, scope)
        parts = [self.words.guard(inside[name], scope.kinds[name]) for name in own]
        parts += [self.formula(condition, inside, scope) for condition in conditions]
        return some((inside[name] for name in own), both(parts))

    def bound(self, conditions: Sequence[Condition], terms: Terms, scope: ActionScope) -> tuple[list[str], Terms]:
        """Return the unbound variables of a conjunction, and the mapping of names to terms extended by these variables."""
        own = sorted(set[str]().union(*map(named, conditions)) - terms.keys())
        fresh = {name: self.words.variable(scope.fresh(name), scope.kinds[name]) for name in own}
        return own, {**terms, **fresh}

    def formula(self, condition: Condition, terms: Terms, scope: ActionScope) -> Formula:
        """Return the PDDL formula of a condition."""
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
            case ClassCondition(of, kind, negated):
                return no(words.is_a(words.terms((of,), terms)[0], kind), negated)
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

    def defined(self, situation: str, its: tuple[PddlTerm, ...], scope: ActionScope) -> Formula:
        """Return the formula that a boolean symbol is true: the conditions of its rules or, if the rules are recursive, an atom."""
        if situation not in self.rules or situation in self.recursive:
            return self.words.value(situation, its, None)
        ways = []
        for rule in self.rules[situation]:
            inner = ActionScope(rule.behavior.kinds, scope.names)
            given = {p.name: term for p, term in zip(rule.parameters, its, strict=True)}
            fits = [self.words.is_a(given[p.name], p.kind) for p in rule.parameters]
            ways.append(both([*fits, self.all_of(rule.conditions, given, inner)]))
        return either(ways)

    def derived(self) -> Iterator[tuple[Atom, tuple[PddlTerm, ...], Formula]]:
        """Yield the atom, the variables and the condition of each recursive rule."""
        for situation in sorted(self.recursive):
            for rule in self.rules[situation]:
                scope = ActionScope(rule.behavior.kinds)
                terms = {p.name: self.words.variable(scope.fresh(p.name), p.kind) for p in rule.parameters}
                head = self.words.value(situation, tuple(terms.values()), None)
                guards = [self.words.guard(terms[p.name], p.kind) for p in rule.parameters]
                holds = both([*guards, self.all_of(rule.conditions, terms, scope)])
                if holds != NEVER:
                    inside = {term.name for term in head.terms}
                    # the atom has no argument for the world
                    left = [term for term in terms.values() if term.name not in inside]
                    yield head, head.terms, some(left, holds)

    # ---------------------------------------------------------------------------------------------------- actions

    def cases_of(self, behavior: Behavior, most: int = MOST_CASES) -> Iterator[Behavior]:
        """Yield behaviours that together are equivalent to a behaviour: one for each case of the behaviour's conditional effects.

        An effect on a value is split only if its condition states the value of a single symbol that has at most `CASES` other
        values, and only into at most `most` cases. For effects on amounts, see `added`.
        """
        for effect in behavior.effects:
            match effect.when:
                case (ValueCondition(situation, arguments, value, False) as when,):
                    words, kinds = self.words.situations[situation], behavior.kinds
                    bound = set[str]().union(*map(named, behavior.preconditions), (p.name for p in behavior.parameters))
                    fits = not words.boolean and bound.issuperset(a for a in arguments if a in kinds)
                    if not fits or value in bound or not self.total(behavior, situation, arguments):
                        continue
                    if is_variable(value) and any(
                        value in mentions(c) for e in behavior.every_effect if when not in e.when for c in e.when
                    ):
                        continue  # another effect has a variable of its own with this name
                    others = sorted(self.range_of(situation) - self.words.denoted(behavior, value))
                    if len(others) <= CASES and len(others) < most:
                        fewer = most // (len(others) + 1)
                        left = tuple(one for one in behavior.effects if when not in one.when)
                        made = tuple(
                            replace(one, when=tuple(c for c in one.when if c != when)) for one in behavior.effects
                        )
                        yield from self.cases_of(replace(_asking(behavior, when), effects=made), fewer)
                        for other in others:
                            asking = _asking(behavior, replace(when, value=other))
                            yield from self.cases_of(replace(asking, effects=left), fewer)
                        return
                case _:
                    continue
        every = list(islice(self.added(behavior), MOST_CASES + 1))
        if len(every) > MOST_CASES:
            raise KnowledgeError(f"{behavior.name} changes one amount by several effects; {APART}")
        yield from every

    def added(self, behavior: Behavior) -> Iterator[Behavior]:
        """Yield behaviours, each of which states for each two effects on amounts whether both change the same amount.

        If bounds limit the sum of the changes, or an effect assigns or multiplies, the terms of these changes must be equal. Other
        effects are added up by every planner.
        """
        outer = [*map(named, behavior.preconditions), {p.name for p in behavior.parameters}]
        bound = set[str]().union(*outer)
        for one, other in combinations(behavior.amounts, 2):
            quantity = self.words.situations[one.situation].quantity
            added = {one.operation, other.operation} <= {"increase", "decrease"}
            summed = one.situation in self.judged_later or not (quantity and quantity.bounded)
            if one.situation != other.situation or (added and summed):
                continue
            differ = [pair for pair in zip(one.arguments, other.arguments, strict=True) if pair[0] != pair[1]]
            if any(self.distinct(behavior, *pair) for pair in differ):
                continue
            whens = [effect.when for effect in (one, other) if effect.when] if one.when != other.when else []
            conditions = [c for when in whens for c in when]
            if not bound.issuperset(t for t in chain(*differ, *map(mentions, conditions)) if is_variable(t)):
                raise KnowledgeError(f"{behavior.name} changes {one.situation} by several effects; {APART}")
            if differ:
                term, known = differ[0] if is_variable(differ[0][0]) else differ[0][::-1]
                equal = EqualityCondition(term, known)
                amounts = tuple(
                    replace(effect, arguments=tuple(known if a == term else a for a in effect.arguments))
                    for effect in behavior.amounts
                )
                yield from self.added(replace(_asking(behavior, equal), amounts=amounts))
                yield from self.added(_asking(behavior, replace(equal, negated=True)))
                return
            if whens:
                made = tuple(replace(e, when=()) if e.when == whens[0] else e for e in behavior.amounts)
                left = tuple(e for e in behavior.amounts if e.when != whens[0])
                yield from self.added(replace(_asking(behavior, *whens[0]), amounts=made))
                yield from self.added(replace(_asking(behavior, AnyOf((whens[0],), negated=True)), amounts=left))
                return
        yield behavior

    def distinct(self, behavior: Behavior, one: str, other: str) -> bool:
        """Return whether two different terms of a behaviour denote different individuals."""
        apart = {EqualityCondition(one, other, True), EqualityCondition(other, one, True)}
        return not apart.isdisjoint(behavior.preconditions) or self.words.denoted(behavior, one).isdisjoint(
            self.words.denoted(behavior, other)
        )

    def total(self, behavior: Behavior, situation: str, arguments: Sequence[str]) -> bool:
        """Return whether the symbols of a situation type exist for all individuals that the arguments can denote."""
        terms = [PddlTerm(argument, "object", self.words.denoted(behavior, argument)) for argument in arguments]
        return self.words.total(situation, terms)

    def action(self, behavior: Behavior) -> LoweredAction | None:
        """Return the PDDL action of a behaviour; return None if the behaviour is never applicable or has no effect."""
        found = self.lowered(behavior)
        possible = found.needs != NEVER and all(term.members for term in found.parameters)
        return found if possible and found.changes else None

    def lowered(self, behavior: Behavior, taken: Collection[str] = ()) -> LoweredAction:
        """Return the PDDL action of a behaviour, whose additional parameters have none of the names in `taken`."""
        scope, terms = ActionScope(behavior.kinds), dict[str, PddlTerm]()
        used = set[str]().union(*map(named, behavior.preconditions), terms_of(behavior.price or Fraction(0)))
        for one in (*behavior.parameters, *(v for v in behavior.variables if v.name in used)):
            terms[one.name] = self.words.variable(scope.fresh(one.name), one.kind)
            scope.parameters.append(terms[one.name])
            scope.needs.append(self.words.guard(terms[one.name], one.kind))
        scope.names.update(taken)
        for condition in behavior.asked:
            match condition:
                case ValueCondition(situation, arguments, value, False) if not self.words.situations[situation].boolean:
                    key = situation, self.words.terms(arguments, terms)
                    scope.values.setdefault(key, self.words.terms((value,), terms)[0])
                case _:
                    pass
        for condition in behavior.asked:
            if absent := self.kept.absent(behavior, condition):
                scope.needs += self.absences(*absent, terms)
            else:
                self.need(condition, terms, scope)
        cost = self.cost(behavior, terms, scope)
        if behavior.lasting in behavior.preconditions and behavior.timing and behavior.timing.duration is not None:
            self.not_negative(behavior.timing.duration, terms, scope)
        changes = [*self.value_changes(behavior, terms, scope), *self.amount_changes(behavior, terms, scope)]
        needs = both([*scope.needs, *self.within_bounds(scope)])
        names = [term.name for term in scope.parameters]
        places = tuple(names.index(terms[p.name].name) for p in behavior.parameters)
        return LoweredAction(behavior, tuple(scope.parameters), places, needs, tuple(changes), cost)

    def parameter(self, wanted: str, members: Iterable[str], scope: ActionScope) -> PddlTerm:
        """Add to an action a parameter for a value that the preconditions determine, and return the parameter."""
        term = PddlTerm(scope.fresh(wanted), "object", frozenset(members))
        scope.parameters.append(term)
        return term

    def known(self, situation: str, its: tuple[PddlTerm, ...], wanted: str, scope: ActionScope) -> PddlTerm:
        """Return the value of a symbol; if no condition states the value, add a parameter and return the parameter."""
        if (situation, its) not in scope.values:
            value = self.parameter(wanted, self.range_of(situation), scope)
            scope.values[situation, its] = value
            scope.needs.append(self.words.value(situation, its, value))
        return scope.values[situation, its]

    def range_of(self, situation: str) -> frozenset[str]:
        """Return the values that symbols of a situation type can have, as initial values or by the effects of the behaviours."""
        return self.problem.members(self.words.situations[situation].range) | self.given.get(situation, frozenset())

    def absences(self, kind: str, situation: str, value: str, terms: Terms) -> Iterator[Formula]:
        """Yield the atoms of the extra predicates for a precondition "no individual of the class has this value"."""
        its = self.words.terms((value,), terms)[0]
        if (kind, situation) in self.kept.free:
            yield self.kept.none_has(kind, situation, its)
            return
        for one in map(self.words.object, sorted(self.problem.members(kind))):
            if self.words.exists(situation, (one,)) == ALWAYS:
                yield self.kept.lacks(situation, (one,), its)

    def need(self, condition: Condition, terms: Terms, scope: ActionScope) -> None:
        """Add the translation of a precondition to `scope`."""
        words = self.words
        match condition:
            case ValueCondition(situation, arguments, said, True):
                its = words.terms(arguments, terms)
                if not words.situations[situation].boolean and words.total(situation, its):
                    value, other = words.terms((said,), terms)[0], self.known(situation, its, "other", scope)
                    scope.needs.append(no(same(other, value)) if value.variable else words.differs(other, value))
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
            case _:
                pass
        scope.needs.append(self.formula(condition, terms, scope))

    def cost(self, behavior: Behavior, terms: Terms, scope: ActionScope) -> NumericTerm:
        """Return the cost of an action, and add the precondition that the cost is a number of at least 0."""
        if behavior.price is None:
            return Fraction(repr(float(behavior.cost)))
        return self.not_negative(behavior.price, terms, scope)

    def not_negative(self, expression: Expression, terms: Terms, scope: ActionScope) -> NumericTerm:
        """Return the PDDL expression for a numeric expression, and add the precondition that it is a number of at least 0.

        A static predicate expresses that the numbers exist, since not every planner with action costs supports numeric
        comparisons.
        """
        scope.needs += self.words.there(expression, terms)
        number = self.words.number(expression, terms)
        if not self.positive(expression):
            scope.needs.append(Compare(">=", number, Fraction(0)))
        return number

    def positive(self, expression: Expression) -> bool:
        """Return whether a numeric expression is never negative."""
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

    def when(self, effect: ValueEffect | AmountEffect, terms: Terms, scope: ActionScope) -> LoweredCondition:
        """Return the condition of an effect."""
        own, inside = self.bound(effect.when, terms, scope)
        parts = [self.words.guard(inside[name], scope.kinds[name]) for name in own]
        parts += [self.formula(condition, inside, scope) for condition in effect.when]
        return LoweredCondition(tuple(inside[name] for name in own), inside, both(parts))

    def cell(self, effect: ValueEffect | AmountEffect, when: LoweredCondition) -> LoweredEffect:
        """Return an effect with the symbol that it changes."""
        its = self.words.terms(effect.arguments, when.terms)
        value = self.words.terms((effect.value,), when.terms)[0] if isinstance(effect, ValueEffect) else None
        return LoweredEffect(when.own, both([when.holds, self.words.exists(effect.situation, its)]), its, value)

    def value_changes(self, behavior: Behavior, terms: Terms, scope: ActionScope) -> Iterator[ConditionalEffect]:
        """Yield the PDDL effects of a behaviour on values; if two effects change one symbol, the later one takes precedence."""
        whens = [self.when(effect, terms, scope) for effect in behavior.effects]
        cells = [(e, self.cell(e, when), when.terms) for e, when in zip(behavior.effects, whens, strict=True)]
        for number, (effect, cell, inside) in enumerate(cells):
            if self.words.situations[effect.situation].boolean:
                atom = self.words.value(effect.situation, cell.terms, None)
                if cell.when != NEVER:
                    yield ConditionalEffect(Not(atom) if effect.value == FALSE else atom, cell.when, cell.own)
                continue
            later = [
                some(other.own, both([other.when, *map(same, cell.terms, other.terms)]))
                for one, other, _ in cells[number + 1 :]
                if one.situation == effect.situation and other.value != cell.value
            ]
            when = both([cell.when, no(either(later))])
            if when != NEVER:
                yield from self.moved(effect, LoweredEffect(cell.own, when, cell.terms, cell.value), inside, scope)

    def moved(
        self, effect: ValueEffect, cell: LoweredEffect, inside: Terms, scope: ActionScope
    ) -> Iterator[ConditionalEffect]:
        """Yield the PDDL effects that replace the old value of a symbol by a new value, and that update the extra predicates."""
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
        elif (situation, its) in scope.values or (when == ALWAYS and not own and words.total(situation, its)):
            old = self.known(situation, its, "old", scope)
        else:
            old = PddlTerm(scope.fresh("old"), "object", self.range_of(situation))
        if old == new:
            return
        yield ConditionalEffect(words.value(situation, its, new), when, own)
        if old.name not in {term.name for term in (*scope.parameters, *own)} and old.variable:
            own, when = (*own, old), both([when, words.value(situation, its, old)])
        yield ConditionalEffect(Not(words.value(situation, its, old)), when, own)
        moves = self.kept.lacks(situation, its, new) in scope.needs if situation in self.kept.contrary else False
        moves |= any(
            self.kept.none_has(kind, situation, new) in scope.needs and words.is_a(its[0], kind) == ALWAYS
            for kind, name in self.kept.free
            if name == situation
        )
        other, both_asked = when if moves else both([when, no(same(old, new))]), old.members & new.members
        if asked := frozenset(self.kept.contrary.get(situation, ())):
            if old.members & asked and other != NEVER:
                yield ConditionalEffect(
                    self.kept.lacks(situation, its, old), other if both_asked & asked else when, own
                )
            if new.members & asked:
                yield ConditionalEffect(Not(self.kept.lacks(situation, its, new)), when, own)
        for (kind, name), asked_of in self.kept.free.items():
            member = words.is_a(its[0], kind) if name == situation else NEVER
            if member == NEVER:
                continue
            if old.members & asked_of and other != NEVER:
                left = other if both_asked & asked_of else when
                yield ConditionalEffect(self.kept.none_has(kind, situation, old), both([left, member]), own)
            if new.members & asked_of:
                yield ConditionalEffect(Not(self.kept.none_has(kind, situation, new)), both([when, member]), own)

    def amount_changes(self, behavior: Behavior, terms: Terms, scope: ActionScope) -> Iterator[ConditionalEffect]:
        """Yield the PDDL effects of a behaviour on amounts, and add preconditions that their results are numbers within bounds.

        If an amount is multiplied or assigned and then increased, both effects become one assignment, because planners don't
        apply several such effects in sequence.
        """
        groups: dict[tuple[str, FunctionTerm, Formula, tuple[PddlTerm, ...]], list[tuple[str, NumericTerm]]] = {}
        whens = dict[tuple[Condition, ...], LoweredCondition]()  # effects with one condition have the same variables
        for effect in behavior.amounts:
            if effect.when not in whens:
                whens[effect.when] = self.when(effect, terms, scope)
            cell, inside = self.cell(effect, whens[effect.when]), whens[effect.when].terms
            if cell.when != NEVER:
                self.check_whole(behavior, effect)
                there = both(self.words.there(effect.amount, inside))
                scope.needs.append(no(some(cell.own, both([cell.when, no(there)]))))
                at = self.words.amount(effect.situation, cell.terms)
                group = groups.setdefault((effect.situation, at, cell.when, cell.own), [])
                group.append((effect.operation, self.words.number(effect.amount, inside)))
        for (situation, at, when, own), changes in groups.items():
            result: NumericTerm = at
            for operation, by in changes:
                sign = {"scale": "*", "increase": "+", "decrease": "-"}.get(operation)
                result = by if sign is None else Arithmetic(sign, result, by)
            # Several effects change a total at once, and a product of amounts isn't linear: `within_bounds` states their bounds.
            quantity = None if situation in self.judged_later else self.words.situations[situation].quantity
            for sign, limit in (("<", quantity.least), (">", quantity.most)) if quantity else ():
                if limit is not None:
                    scope.needs.append(no(some(own, both([when, Compare(sign, result, limit)]))))
            if all(operation in ("increase", "decrease") for operation, _ in changes):
                for (operation, by), times in Counter((operation, by) for operation, by in changes).items():
                    # PDDL planners treat equal effects of one action as one effect.
                    total = _times(by, times)
                    yield ConditionalEffect(Assignment(operation, at, total), when, own)
            else:
                yield ConditionalEffect(Assignment("assign", at, result), when, own)

    def within_bounds(self, scope: ActionScope) -> Iterator[Formula]:
        """Yield the formulas which state that totals, and amounts that effects scale by an amount, are within their bounds.

        These bounds are preconditions of every action, and a part of the goal. A state in which such an amount is out of its bounds
        is therefore a dead end.
        """
        for situation in self.judged_later:
            kind = self.words.situations[situation]
            own = tuple(self.words.variable(scope.fresh(one), one) for one in kind.arguments)
            its = [*map(self.words.guard, own, kind.arguments), self.words.exists(situation, own)]
            for sign, limit in (("<", kind.quantity.least), (">", kind.quantity.most)) if kind.quantity else ():
                if limit is not None:
                    outside = Compare(sign, self.words.amount(situation, own), limit)
                    yield no(some(own, both([*its, outside])))

    def check_whole(self, behavior: Behavior, effect: AmountEffect) -> None:
        """Raise `KnowledgeError` if an effect may give a fraction to an amount of whole numbers, since PDDL can't prevent this."""
        situations = self.words.situations
        quantity = situations[effect.situation].quantity
        if quantity is None or not quantity.whole:
            return
        for part in parts(effect.amount):
            match part:
                case Calculation("/"):
                    fraction = True
                case Amount(situation):
                    fraction = not getattr(situations[situation].quantity, "whole", False)
                case Measure(relation):
                    rows = self.problem.relations.get(relation, frozenset())
                    fraction = any(Fraction(row[-1]).denominator > 1 for row in rows)
                case _:
                    fraction = isinstance(part, Fraction) and part.denominator > 1
            if fraction:
                raise KnowledgeError(
                    f"{behavior.name} may give {effect.situation} a fraction, which its whole numbers forbid and PDDL can't; "
                    "change it by whole numbers to export it"
                )

    # ------------------------------------------------------------------------------------------------------- goals

    def goal(self, symbol: Symbol, wanted: str) -> Formula:
        """Return the goal formula for the wanted value or bounds of a symbol."""
        words = self.words
        situation, its = words.situations[symbol.situation], words.terms(symbol.arguments, {})
        if situation.quantity is None:
            return self.formula(ValueCondition(symbol.situation, symbol.arguments, wanted), {}, ActionScope({}))
        at = words.amount(symbol.situation, its)
        exists = words.exists(symbol.situation, its)
        return both([exists, *(Compare(sign, at, limit) for sign, limit in bounds(wanted))])


def _asking(behavior: Behavior, *conditions: Condition) -> Behavior:
    """Return a behaviour with further preconditions."""
    return replace(behavior, preconditions=(*behavior.preconditions, *conditions))


def named(condition: Condition) -> set[str]:
    """Return the variables in a condition, except variables in a nested `AnyOf` or `Witness`."""
    return set(filter(is_variable, terms(condition)))


def _times(number: NumericTerm, times: int) -> NumericTerm:
    """Return a numeric expression multiplied by a whole number."""
    if isinstance(number, Fraction):
        return number * times
    return number if times == 1 else Arithmetic("*", number, Fraction(times))
