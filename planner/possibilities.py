"""Possible and necessary facts of a set of states whose values are only partly known.

Each condition has two bounds. The bound *may* is false only if the condition holds in no state of the set. The bound *must* is
true only if the condition holds in every state of the set. For a single, completely known state, both bounds agree with
`confab.planner.validation`. The checker of certificates uses this module; no search uses it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from time import perf_counter
from typing import NamedTuple, Protocol, TypeAlias

from confab.planner.checked_conditions import variables
from confab.planner.checked_definitions import DefinedValues, stratum_of
from confab.reasoner.amounts import (
    Amount,
    Calculation,
    Expression,
    Measure,
    Quantity,
    bounds,
    number,
    situations_in,
)
from confab.reasoner.limits import current
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
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

Env: TypeAlias = "Mapping[str, str]"
Bound: TypeAlias = "Fraction | float"


class WorkLimitError(Exception):
    """A proof or the check of a certificate needs more work than allowed."""


class NoTimeLeftError(WorkLimitError):
    """The deadline has passed before the end of a proof or a check."""


class Range(NamedTuple):
    """The range of an amount or an expression; if `partial`, the expression may have no value in some state."""

    low: Bound
    high: Bound
    partial: bool = False

    def hull(self, other: Range) -> Range:
        """Return the smallest range that contains both ranges."""
        return Range(min(self.low, other.low), max(self.high, other.high), self.partial or other.partial)


LOOKS = 256
"""Number of tests between two readings of the clock."""
ANYTHING = Range(-math.inf, math.inf, True)


class Knowledge(Protocol):
    """Interface of the knowledge about a set of states: the possible values of symbols that behaviours change."""

    def may(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol may have the given value in some state."""

    def may_not(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol may have a value other than the given value in some state."""

    def between(self, symbol: Symbol) -> Range:
        """Return the range of the amount of a symbol over all states."""


class Lowest:
    """The lowest level of a problem, with its behaviours indexed by the situation types that the behaviours change.

    `work` counts tests. `WorkLimitError` is raised when `work` exceeds `most`. `NoTimeLeftError` is raised when the current
    deadline has passed.
    """

    def __init__(self, problem: Problem, most: float = math.inf) -> None:
        self.problem, self.most, self.deadline, self.work = problem, most, current().at, 0
        domain = problem.domain
        self.level = domain.levels[-1] if domain.levels else 1
        self.behaviors = domain.at_level(self.level)
        self.strata = stratum_of(domain.rules)
        self.changing = frozenset[str]().union(*(behavior.changes for behavior in self.behaviors))
        self.effects: dict[str, list[tuple[Behavior, ValueEffect]]] = {}
        for behavior in self.behaviors:
            for effect in behavior.effects:
                self.effects.setdefault(effect.situation, []).append((behavior, effect))
        self.given: dict[str, dict[str, None]] = {}
        for name, effects in self.effects.items():
            values = self.given.setdefault(name, {})
            for behavior, effect in effects:
                kind = behavior.kinds.get(effect.value)
                values.update(dict.fromkeys([effect.value] if kind is None else problem.classes.get(kind, ())))
        self.holders: dict[str, list[tuple[tuple[str, ...], str]]] = {}
        for symbol, value in problem.initial.items():
            if symbol.situation not in self.changing:
                self.holders.setdefault(symbol.situation, []).append((symbol.arguments, value))
        self._symbols: dict[tuple[str, tuple[str, ...]], Symbol | None] = {}
        self._steps: dict[tuple[int, frozenset[str]], list[tuple[Condition, tuple[str, ...]]]] = {}
        self._conjunctions: dict[tuple[int, ...], tuple[Condition, ...]] = {}
        self._kept: list[object] = []  # keeps objects alive, so that Python reuses no id

    def spend(self, work: int = 1) -> None:
        """Count work; raise `WorkLimitError` at the limit of work, and `NoTimeLeftError` after the deadline."""
        self.work += work
        if self.work > self.most:
            raise WorkLimitError(f"more than {self.most:.0f} tests")
        if self.work % LOOKS < work and perf_counter() > self.deadline:
            raise NoTimeLeftError("more time than is left")

    def exists(self, situation: str, arguments: tuple[str, ...]) -> bool:
        """Return whether a symbol exists: it has an initial value, or is boolean and its arguments belong to the right classes."""
        return self.symbol(situation, arguments) is not None

    def symbol(self, situation: str, arguments: tuple[str, ...]) -> Symbol | None:
        """Return a symbol, or None if it doesn't exist; each symbol is tested only once."""
        key = situation, arguments
        if key not in self._symbols:
            symbol, kind, members = Symbol(*key), self.problem.domain.situations[situation], self.problem.members
            there = symbol in self.problem.initial or (
                kind.boolean
                and len(arguments) == len(kind.arguments)
                and all(argument in members(of) for argument, of in zip(arguments, kind.arguments, strict=True))
            )
            self._symbols[key] = symbol if there else None
        return self._symbols[key]

    def initial(self, symbol: Symbol) -> str:
        """Return the initial value of an existing symbol."""
        return self.problem.initial.get(symbol, FALSE)

    def quantity(self, situation: str) -> Quantity | None:
        """Return the quantity of a situation type, or None if its values aren't amounts."""
        return self.problem.domain.situations[situation].quantity

    def allowed(self, symbol: Symbol) -> Range:
        """Return the range that the situation type of a symbol allows, extended to contain the initial amount."""
        limits, first = self.bounds_of(symbol.situation), number(self.initial(symbol))
        return Range(min(limits.low, first), max(limits.high, first))

    def bounds_of(self, situation: str) -> Range:
        """Return the bounds of the amounts of a situation type."""
        quantity = self.quantity(situation)
        least, most = (None, None) if quantity is None else (quantity.least, quantity.most)
        return Range(-math.inf if least is None else least, math.inf if most is None else most)

    def constant(self, condition: Condition) -> bool:
        """Return whether a condition without nested conditions has the same value in all states."""
        if isinstance(condition, ValueCondition):
            return condition.situation not in self.changing and condition.situation not in self.problem.domain.rules
        if isinstance(condition, Comparison):
            return self.changing.isdisjoint(situations_in(condition.left) | situations_in(condition.right))
        return isinstance(condition, RelationCondition | ClassCondition | EqualityCondition)

    def steps(self, conditions: Sequence[Condition], bound: frozenset[str]) -> list[tuple[Condition, tuple[str, ...]]]:
        """Return conditions in the order of their evaluation, each with the variables that the condition binds."""
        key = id(conditions), bound
        if key not in self._steps:
            self._kept.append(conditions)
            waiting = [c for c in conditions if not isinstance(c, AnyOf | Witness)]
            known, found = set(bound), list[tuple[Condition, tuple[str, ...]]]()
            while waiting:
                ranks = [(self._rank(c, known), i) for i, c in enumerate(waiting)]
                condition = waiting.pop(min(ranks)[1])
                unknown = tuple(sorted(variables(condition) - known))
                found.append((condition, unknown))
                known.update(unknown)
            nested = [c for c in conditions if isinstance(c, AnyOf | Witness)]
            self._steps[key] = found + [(condition, ()) for condition in nested]
        return self._steps[key]

    def _rank(self, condition: Condition, known: set[str]) -> int:
        unknown, constant = variables(condition) - known, self.constant(condition)
        if not unknown:
            return 0 if constant else 2
        if isinstance(condition, EqualityCondition) and len(unknown) == 1 and not condition.negated:
            return 1
        if isinstance(condition, RelationCondition) and not condition.negated:
            return 1 if len(unknown) < len(set(condition.arguments)) else 4
        if isinstance(condition, ValueCondition) and not condition.negated:
            if constant:
                return 1 if len(unknown) < len({*condition.arguments, condition.value}) else 4
            return 3 if unknown == {condition.value} else 5
        return 5 + len(unknown)

    def asked(self, behavior: Behavior, when: tuple[Condition, ...] = ()) -> tuple[Condition, ...]:
        """Return the preconditions of a behaviour, the conditions `when` of an effect, and the classes of the parameters."""
        kinds = (ClassCondition(p.name, p.kind) for p in behavior.parameters)
        return self._once((behavior, when), lambda: (*behavior.preconditions, *when, *kinds))

    def inside(self, witness: Witness) -> tuple[Condition, ...]:
        """Return the conditions of a witness, including the class of its variable."""
        return self._once((witness,), lambda: (ClassCondition(witness.variable, witness.kind), *witness.conditions))

    def over(self, aggregate: Aggregate) -> tuple[Condition, ...]:
        """Return the conditions of an aggregate, including the classes of its variables."""
        kinds = (ClassCondition(variable.name, variable.kind) for variable in aggregate.variables)
        return self._once((aggregate,), lambda: (*aggregate.conditions, *kinds))

    def _once(self, of: tuple[object, ...], made: Callable[[], tuple[Condition, ...]]) -> tuple[Condition, ...]:
        """Return the conjunction that was made for some objects; it is the same object each time, as `steps` requires."""
        key = tuple(map(id, of))
        if key not in self._conjunctions:
            self._kept.append(of)
            self._conjunctions[key] = made()
        return self._conjunctions[key]


@dataclass(frozen=True)
class Beginning:
    """The knowledge of the initial state: the value of each symbol."""

    lowest: Lowest

    def may(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value."""
        return self.lowest.initial(symbol) == value

    def may_not(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has another value."""
        return not self.may(symbol, value)

    def between(self, symbol: Symbol) -> Range:
        """Return the amount of a symbol, as a range."""
        exactly = number(self.lowest.initial(symbol))
        return Range(exactly, exactly)


class FactEvaluation:
    """Evaluation of conditions and effects of the lowest level on a fixed set of states."""

    def __init__(self, lowest: Lowest, knowledge: Knowledge) -> None:
        self.lowest, self.problem, self.knowledge = lowest, lowest.problem, knowledge
        self._definitions: dict[bool, DefinedValues] = {}
        self._totals: dict[tuple[str, tuple[str, ...]], Range] = {}

    # ------------------------------------------------------------------------------------------------------- values

    def value(self, situation: str, arguments: tuple[str, ...], value: str, must: bool) -> bool:
        """Return whether a symbol may have a value; if `must`, return whether the symbol has the value in every state."""
        lowest = self.lowest
        lowest.spend()
        symbol = lowest.symbol(situation, arguments)
        if symbol is None:
            return False
        if situation in self.problem.domain.rules:
            if value == TRUE:
                return self._defined(must).follows((situation, arguments))
            return value == FALSE and not self._defined(not must).follows((situation, arguments))
        if situation not in lowest.changing:
            return lowest.initial(symbol) == value
        if lowest.quantity(situation) is not None:
            return self.amount_meets(symbol, value, must)
        return not self.knowledge.may_not(symbol, value) if must else self.knowledge.may(symbol, value)

    def _defined(self, must: bool) -> DefinedValues:
        if must not in self._definitions:
            self._definitions[must] = DefinedValues(self.lowest.strata, partial(self._given, must=must))
        return self._definitions[must]

    def _given(self, situation: str, arguments: tuple[str, ...], must: bool) -> bool:
        for rule in self.problem.domain.rules[situation]:
            env = {p.name: a for p, a in zip(rule.parameters, arguments, strict=True)}
            if all(env[p.name] in self.problem.members(p.kind) for p in rule.parameters) and any(
                True for _ in self.solutions(rule.conditions, env, rule.behavior.kinds, must)
            ):
                return True
        return False

    def between(self, situation: str, arguments: tuple[str, ...]) -> Range | None:
        """Return the range of the amount of a symbol, or None if the symbol doesn't exist."""
        symbol = self.lowest.symbol(situation, arguments)
        if symbol is None:
            return None
        if situation not in self.lowest.changing:
            exactly = Fraction(self.lowest.initial(symbol))
            return Range(exactly, exactly)
        known = self.knowledge.between(symbol)
        aggregate = self.problem.domain.aggregates.get(situation)
        if aggregate is None or not aggregate.kept or known.low == known.high:
            return known
        total = self.total(aggregate, arguments)
        return Range(max(known.low, total.low), min(known.high, total.high))

    def before(self, symbol: Symbol) -> Range | None:
        """Return the range of an amount before an effect, or None if the symbol doesn't exist.

        For a sum or count without bounds, the range isn't calculated from the definition, since no bound forbids an effect.
        """
        quantity = self.lowest.quantity(symbol.situation)
        free = symbol.situation in self.problem.domain.aggregates and quantity is not None and not quantity.bounded
        if free and self.lowest.exists(symbol.situation, symbol.arguments):
            return self.knowledge.between(symbol)
        return self.between(symbol.situation, symbol.arguments)

    def total(self, aggregate: Aggregate, arguments: tuple[str, ...]) -> Range:
        """Return the range of a sum or a count by its definition.

        If a solution certainly holds, its number is added to both ends of the range. If a solution may hold but need not hold,
        its number can only widen the range.
        """
        key = aggregate.situation, arguments
        if key not in self._totals:
            conditions = self.lowest.over(aggregate)
            env = dict(zip((p.name for p in aggregate.parameters), arguments, strict=True))
            low: Bound = Fraction(0)
            high: Bound = Fraction(0)
            for solution in self.solutions(conditions, env, aggregate.kinds):
                found = self.expression(aggregate.amount, solution)
                if found is not None:
                    certain = all(self.holds(one, solution, aggregate.kinds, must=True) for one in conditions)
                    low = _sum(low, found.low if certain and not found.partial else min(found.low, 0))
                    high = _sum(high, found.high if certain and not found.partial else max(found.high, 0))
            self._totals[key] = Range(low, high)
        return self._totals[key]

    def amount_meets(self, symbol: Symbol, wanted: str, must: bool) -> bool:
        """Return whether an amount may, or if `must` certainly does, satisfy a goal: a number or a pair of bounds."""
        found = self.between(symbol.situation, symbol.arguments)
        try:
            limits = bounds(wanted)
        except ValueError:
            return False
        return found is not None and all(compared(found, sign, Range(at, at), must) for sign, at in limits)

    def goal(self, symbol: Symbol, wanted: str, must: bool = False) -> bool:
        """Return whether a goal may hold, or if `must` holds in every state; a nonexistent symbol counts as false."""
        if not self.lowest.exists(symbol.situation, symbol.arguments):
            return wanted == FALSE
        if self.lowest.quantity(symbol.situation) is not None:
            return self.amount_meets(symbol, wanted, must)
        return self.value(symbol.situation, symbol.arguments, wanted, must)

    # --------------------------------------------------------------------------------------------------- conditions

    def holds(self, condition: Condition, env: Env, kinds: Mapping[str, str], must: bool = False) -> bool:
        """Return whether a condition with the individuals `env` may hold, or if `must`, holds in every state."""
        found: bool
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                key = tuple(env.get(a, a) for a in arguments)
                return self.value(situation, key, env.get(value, value), must is not negated) is not negated
            case RelationCondition(relation, arguments, negated):
                key = tuple(env.get(a, a) for a in arguments)
                return (key in self.problem.relations.get(relation, ())) is not negated
            case ClassCondition(term, kind, negated):
                return (env.get(term, term) in self.problem.members(kind)) is not negated
            case EqualityCondition(left, right, negated):
                return (env.get(left, left) == env.get(right, right)) is not negated
            case Comparison(left, sign, right, negated):
                one, other = self.expression(left, env), self.expression(right, env)
                found = one is not None and other is not None and compared(one, sign, other, must is not negated)
                return found is not negated
            case Witness(variable, kind, _, negated):
                outer = {term: value for term, value in env.items() if term != variable}
                every = self.solutions(
                    self.lowest.inside(condition), outer, {**kinds, variable: kind}, must is not negated
                )
                return any(True for _ in every) is not negated
            case AnyOf(alternatives, negated):
                some = any(
                    any(True for _ in self.solutions(group, env, kinds, must is not negated)) for group in alternatives
                )
                return some is not negated

    def solutions(
        self, conditions: Sequence[Condition], env: Env, kinds: Mapping[str, str], must: bool = False
    ) -> Iterator[dict[str, str]]:
        """Yield the bindings with which conditions may hold; if `must`, only the bindings with which they hold in every state."""
        yield from self._extended(self.lowest.steps(conditions, frozenset(env)), 0, dict(env), kinds, must)

    def _extended(
        self,
        steps: Sequence[tuple[Condition, tuple[str, ...]]],
        at: int,
        env: dict[str, str],
        kinds: Mapping[str, str],
        must: bool,
    ) -> Iterator[dict[str, str]]:
        if at == len(steps):
            yield env
            return
        condition, unknown = steps[at]
        self.lowest.spend()
        if not unknown:
            if self.holds(condition, env, kinds, must):
                yield from self._extended(steps, at + 1, env, kinds, must)
            return
        for more in self._candidates(condition, unknown, env, kinds):
            self.lowest.spend()
            if self.holds(condition, more, kinds, must):
                yield from self._extended(steps, at + 1, more, kinds, must)

    def _candidates(
        self, condition: Condition, unknown: Sequence[str], env: dict[str, str], kinds: Mapping[str, str]
    ) -> Iterator[dict[str, str]]:
        """Yield bindings of the unknown variables; with any other binding, the condition certainly doesn't hold."""
        lowest, members = self.lowest, self.problem.members
        rows: Sequence[tuple[str, ...]] | None = None
        terms: tuple[str, ...] = ()
        match condition:
            case RelationCondition(relation, arguments, False):
                terms = arguments
                known = next((i for i, term in enumerate(terms) if term not in unknown), None)
                if known is None:
                    rows = sorted(self.problem.relations.get(relation, ()))
                else:
                    rows = lowest.problem.related(relation, known).get(env.get(terms[known], terms[known]), ())
            case EqualityCondition(left, right, False) if len(unknown) == 1 and left != right:
                terms, other = (unknown[0],), right if left == unknown[0] else left
                rows = [(env.get(other, other),)]
            case ValueCondition(situation, arguments, value, False):
                boolean = self.problem.domain.situations[situation].boolean
                if lowest.constant(condition) and (not boolean or value == TRUE):
                    terms = (*arguments, value)
                    rows = [(*key, its) for key, its in lowest.holders.get(situation, ())]
                elif tuple(unknown) == (value,) and value not in arguments and not boolean:
                    terms = (value,)
                    symbol = Symbol(situation, tuple(env.get(a, a) for a in arguments))
                    at_first = lowest.initial(symbol)
                    rows = [(v,) for v in dict.fromkeys((at_first, *lowest.given.get(situation, ())))]
            case _:
                pass
        if rows is None:
            yield from self._of_classes(unknown, env, kinds)
            return
        for row in rows:
            more = dict(env)
            fits = all(more.setdefault(term, one) == one if term.startswith("?") else term == one
                       for term, one in zip(terms, row, strict=True))  # fmt: skip
            if fits and all(more[term] in members(kinds[term]) for term in unknown):
                yield more

    def _of_classes(
        self, unknown: Sequence[str], env: dict[str, str], kinds: Mapping[str, str]
    ) -> Iterator[dict[str, str]]:
        if not unknown:
            yield env
            return
        for one in self.problem.classes.get(kinds[unknown[0]], ()):
            self.lowest.spend()
            yield from self._of_classes(unknown[1:], {**env, unknown[0]: one}, kinds)

    # ------------------------------------------------------------------------------------------------------ amounts

    def expression(self, expression: Expression, env: Env) -> Range | None:
        """Return the range of an expression, or None if the expression has no value in any state."""
        match expression:
            case Amount(situation, arguments):
                return self.between(situation, tuple(env.get(a, a) for a in arguments))
            case Measure(relation, arguments):
                key = tuple(env.get(a, a) for a in arguments)
                rows = self.lowest.problem.related(relation, 0).get(key[0], ()) if key else sorted(
                    self.problem.relations.get(relation, ())
                )  # fmt: skip
                found = [Fraction(row[-1]) for row in rows if row[:-1] == key]
                return Range(min(found), max(found)) if found else None
            case Calculation(sign, left, right):
                one, other = self.expression(left, env), self.expression(right, env)
                return None if one is None or other is None else calculated(sign, one, other)
            case number:
                return Range(number, number)

    def amounts(self, behavior: Behavior, env: Env) -> dict[Symbol, tuple[Range, bool]] | None:
        """Return the ranges of the amounts that a behaviour may change, each with a flag that tells whether the change is certain.

        Return None if the behaviour certainly isn't applicable, because an amount would have no value or violate its bounds.

        A range is limited to the bounds, which hold after each effect, and to the old range, for an amount that no effect changes.
        """
        after: dict[Symbol, tuple[Range, bool]] = {}
        for effect in behavior.amounts:
            if effect.when:
                ways = list(self.solutions(effect.when, env, behavior.kinds))
                sure = len(ways) == 1 and any(True for _ in self.solutions(effect.when, env, behavior.kinds, must=True))
            else:
                ways, sure = [dict(env)], True
            for way in ways:
                symbol = Symbol(effect.situation, tuple(way.get(a, a) for a in effect.arguments))
                before = self.before(symbol)
                if before is None:
                    continue
                old, surely = after.get(symbol, (before, True))
                by = self.expression(effect.amount, way)
                if by is None:
                    if sure:
                        return None
                    after[symbol] = old, False
                    continue
                new = by if effect.operation == "assign" else calculated(OPERATORS[effect.operation], old, by)
                if new is None:
                    return None
                after[symbol] = (new if sure else new.hull(old)), surely and sure
        for symbol, (new, surely) in after.items():
            quantity = self.lowest.quantity(symbol.situation)
            if quantity is None:
                return None
            limits = self.lowest.bounds_of(symbol.situation)
            if not surely and (kept := self.before(symbol)) is not None:
                limits = limits.hull(kept)
            low, high = max(new.low, limits.low), min(new.high, limits.high)
            if low > high or (surely and low == high and not quantity.allows(low)):
                return None
            after[symbol] = Range(low, high), surely
        return after


OPERATORS = {"scale": "*", "increase": "+", "decrease": "-"}


def compared(one: Range, sign: str, other: Range, must: bool) -> bool:
    """Return whether a comparison holds for some pair of amounts from two ranges; if `must`, whether it holds for all pairs."""
    if must and (one.partial or other.partial):
        return False
    if sign in (">", ">="):
        one, other, sign = other, one, {">": "<", ">=": "<="}[sign]
    if sign == "=":
        if must:
            return one.low == one.high == other.low == other.high
        return one.low <= other.high and other.low <= one.high
    left, right = (one.high, other.low) if must else (one.low, other.high)
    return left < right or (sign == "<=" and left == right)


def calculated(sign: str, one: Range, other: Range) -> Range | None:
    """Return the range of the results of an arithmetic operation on two ranges, or None if there is no result."""
    partial = one.partial or other.partial
    if sign == "+":
        return Range(_sum(one.low, other.low), _sum(one.high, other.high), partial)
    if sign == "-":
        return Range(_sum(one.low, -other.high), _sum(one.high, -other.low), partial)
    if sign == "/":
        if other.low == other.high == 0:
            return None
        if other.low <= 0 <= other.high:
            return ANYTHING
        ends = [_quotient(a, b) for a in (one.low, one.high) for b in (other.low, other.high)]
    else:
        ends = [_product(a, b) for a in (one.low, one.high) for b in (other.low, other.high)]
    return Range(min(ends), max(ends), partial)


def _sum(a: Bound, b: Bound) -> Bound:
    """Return a sum; an infinite bound absorbs a number, however great the number is."""
    if isinstance(a, float):
        return a
    return b if isinstance(b, float) else a + b


def _product(a: Bound, b: Bound) -> Bound:
    if not a or not b:
        return Fraction(0)
    if isinstance(a, float) or isinstance(b, float):
        return math.inf if (a > 0) is (b > 0) else -math.inf
    return a * b


def _quotient(a: Bound, b: Bound) -> Bound:
    if isinstance(a, float):
        return a if b > 0 else -a
    return Fraction(0) if isinstance(b, float) else a / b
