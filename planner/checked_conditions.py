"""Evaluation of conditions by the checker: a conjunction becomes a list of tests and choices, the most determined condition first.

This module shares no code with any search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Protocol, TypeAlias

from confab.planner.checked_amounts import compares
from confab.reasoner.amounts import terms_of
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
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

Arguments: TypeAlias = "tuple[str, ...]"
Bindings: TypeAlias = "dict[str, str]"
Values: TypeAlias = "list[str]"
"""The individuals of terms, indexed by position."""
Test: TypeAlias = "Callable[[ReadableState, Values], bool]"
Candidates: TypeAlias = "Callable[[ReadableState, Values], Iterable[str]]"
Lookups: TypeAlias = "dict[tuple[Witness, Arguments], set[Arguments]]"
"""Lookups on which the result of a check depends.

The key of a lookup is a `Witness` (the condition that a suitable individual exists) and the individuals of its open terms. The
lookup contains the individuals that satisfy the conditions of the witness in the initial state.
"""


class ReadableState(Protocol):
    """The part of a state that conditions can read."""

    def value(self, situation: str, arguments: Arguments) -> str | None:
        """Return the value of a symbol, or None if the symbol doesn't exist."""

    def holders(self, situation: str, value: str) -> Iterable[Arguments]:
        """Return the arguments of the symbols whose stated value is `value`."""


class Source(Protocol):
    """The context for reading conditions: the problem and the list of lookups."""

    problem: Problem
    lookups: Lookups | None


class ConditionReader:
    """Conditions with shared terms; each term has a position that holds its individual, initially the term itself."""

    def __init__(self, rules: Source, terms: Iterable[str]) -> None:
        self.rules, self.problem = rules, rules.problem
        self.places = {term: i for i, term in enumerate(terms)}

    def place(self, term: str) -> int:
        """Return the position of a term."""
        return self.places.setdefault(term, len(self.places))

    def key(self, terms: Sequence[str]) -> Callable[[Values], Arguments]:
        """Return a function that returns the individuals of some terms."""
        places = [self.place(term) for term in terms]
        if len(places) > 1:
            return itemgetter(*places)
        if not places:
            return lambda values: ()
        (only,) = places
        return lambda values: (values[only],)

    def conjunction(
        self, conditions: Sequence[Condition], bound: set[str], kinds: Mapping[str, str], last: Sequence[Test] = ()
    ) -> list[Test]:
        """Return conditions as tests; the last test may choose individuals and run the remaining tests on the chosen individuals.

        The variables of the conditions are added to `bound`. Variables that occur only in nested conditions (`AnyOf`,
        `Witness`) are local to these conditions. The tests in `last` run after all others.
        """
        waiting = [c for c in conditions if not isinstance(c, AnyOf | Witness)]
        nested = [c for c in conditions if isinstance(c, AnyOf | Witness)]
        tests: list[Test] = []
        while waiting:
            condition = min(waiting, key=lambda c: (len(variables(c) - bound), _breadth(c, bound)))
            unknown = sorted(variables(condition) - bound)
            bound.update(unknown[:1])
            if not unknown:
                waiting.remove(condition)
                tests.append(self.test(condition, bound, kinds))
            elif isinstance(condition, ValueCondition) and _breadth(condition, bound - {unknown[0]}) == 0:
                waiting.remove(condition)
                tests.append(self.given(condition, kinds[condition.value]))
            else:
                candidates = self.candidates(condition, unknown, kinds)
                if self.rules.lookups is not None:
                    candidates = self.noted(candidates, unknown[0], kinds[unknown[0]], waiting, bound)
                rest = self.conjunction([*waiting, *nested], bound, kinds, last)
                return [*tests, self.choice(candidates, unknown[0], kinds[unknown[0]], rest)]
        return [*tests, *(self.test(condition, bound, kinds) for condition in nested), *last]

    def given(self, condition: ValueCondition, kind: str) -> Test:
        """Return a test that binds the variable of a condition to the current value, if the value belongs to a class."""
        key, place, members = self.key(condition.arguments), self.place(condition.value), self.problem.members(kind)

        def given(facts: ReadableState, values: Values) -> bool:
            found = facts.value(condition.situation, key(values))
            if found is None or found not in members:
                return False
            values[place] = found
            return True

        return given

    def choice(self, candidates: Candidates, variable: str, kind: str, rest: Sequence[Test]) -> Test:
        """Return a test that holds if the remaining tests hold with one of the candidates for a variable."""
        place, members = self.place(variable), self.problem.members(kind)

        def some(facts: ReadableState, values: Values) -> bool:
            for candidate in candidates(facts, values):
                if candidate in members:
                    values[place] = candidate
                    if all_hold(rest, facts, values):
                        return True
            return False

        return some

    def noted(
        self, candidates: Candidates, variable: str, kind: str, conditions: Sequence[Condition], bound: set[str]
    ) -> Candidates:
        """Return the candidates for a variable, and record the lookup: the individuals that initially satisfy the known conditions.

        An individual that the problem doesn't contain keeps its values, because no step names the individual.
        """
        asked = tuple(c for c in conditions if variable in variables(c) <= bound)
        known = tuple(sorted(set().union(*map(variables, asked)) - {variable}))
        assert self.rules.lookups is not None
        rows, key = self.rules.lookups.setdefault((Witness(variable, kind, asked), known), set()), self.key(known)

        def noting(facts: ReadableState, values: Values) -> Iterable[str]:
            rows.add(key(values))
            return candidates(facts, values)

        return noting

    def candidates(self, condition: Condition, unknown: Sequence[str], kinds: Mapping[str, str]) -> Candidates:
        """Return the candidates for the first unknown variable of a condition."""
        variable, kind = unknown[0], kinds[unknown[0]]
        match condition:
            case ValueCondition(situation, arguments, value, False) if (
                value not in unknown and situation not in self.problem.domain.rules
            ):
                position, at = arguments.index(variable), self.place(value)

                def having(facts: ReadableState, values: Values) -> Iterable[str]:
                    if values[at] == FALSE:  # the value false is seldom stated
                        return self.problem.classes.get(kind, ())
                    return (found[position] for found in facts.holders(situation, values[at]))

                return having
            case RelationCondition(relation, arguments, False) if len(unknown) < len(set(arguments)):
                position = arguments.index(variable)
                known = next(i for i, a in enumerate(arguments) if a not in unknown)
                at = self.place(arguments[known])

                def related(facts: ReadableState, values: Values) -> Iterable[str]:
                    rows = self.problem.related(relation, known).get(values[at], ())
                    return dict.fromkeys([row[position] for row in rows])

                return related
        return lambda facts, values: self.problem.classes.get(kind, ())

    def test(self, condition: Condition, bound: set[str], kinds: Mapping[str, str]) -> Test:
        """Return a condition as a test; choices inside the condition are local to the condition."""
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                key, at = self.key(arguments), self.place(value)
                return lambda facts, values: (facts.value(situation, key(values)) == values[at]) is not negated
            case RelationCondition(relation, arguments, negated):
                rows, key = self.problem.relations.get(relation, frozenset()), self.key(arguments)
                return lambda facts, values: (key(values) in rows) is not negated
            case ClassCondition(term, kind, negated):
                members, at = self.problem.members(kind), self.place(term)
                return lambda facts, values: (values[at] in members) is not negated
            case EqualityCondition(left, right, negated):
                one, other = self.place(left), self.place(right)
                return lambda facts, values: (values[one] == values[other]) is not negated
            case Witness(variable, kind, conditions, negated):
                wanted = (*conditions, ClassCondition(variable, kind))
                inner = self.conjunction(wanted, bound - {variable}, {**kinds, variable: kind})
                return lambda facts, values: all_hold(inner, facts, values.copy()) is not negated
            case AnyOf(alternatives, negated):
                groups = [self.conjunction(group, set(bound), kinds) for group in alternatives]
                return lambda facts, values: any(all_hold(g, facts, values.copy()) for g in groups) is not negated
            case Comparison():
                comparison = compares(condition, self.key, self.problem.relations)
                return lambda facts, values: comparison(facts.value, values)


def all_hold(tests: Sequence[Test], facts: ReadableState, values: Values) -> bool:
    """Return whether all tests hold; store the first satisfying choices in `values`."""
    for test in tests:  # noqa: SIM110 - a generator takes twice as long
        if not test(facts, values):
            return False
    return True


def _breadth(condition: Condition, bound: set[str]) -> int:
    """Return the number of candidates for an unknown variable: 0 if the state determines the individual, 1 for few, 2 for many."""
    if isinstance(condition, ValueCondition) and not condition.negated:
        return not (variables(condition) - bound == {condition.value} and condition.value not in condition.arguments)
    return 1 if isinstance(condition, RelationCondition) and not condition.negated else 2


def variables(condition: Condition) -> set[str]:
    """Return the variables of a condition without nested conditions."""
    match condition:
        case ValueCondition(_, arguments, value):
            terms = {*arguments, value}
        case RelationCondition(_, arguments):
            terms = set(arguments)
        case ClassCondition(term):
            terms = {term}
        case EqualityCondition(left, right):
            terms = {left, right}
        case Comparison(one, _, other):
            terms = {*terms_of(one), *terms_of(other)}
        case _:
            terms = set()
    return {term for term in terms if term.startswith("?")}


def own_variables(behavior: Behavior) -> frozenset[str]:
    """Return the parameters of a behaviour and the variables that its preconditions determine."""
    found = {parameter.name for parameter in behavior.parameters}
    return frozenset(found.union(*(variables(condition) for condition in behavior.preconditions)))


def undetermined(behavior: Behavior) -> list[str]:
    """Return the variables that effects of a behaviour name although neither its preconditions nor the effect's conditions do."""
    found, own = set[str](), own_variables(behavior)
    for effect in behavior.every_effect:
        named = {effect.value} if isinstance(effect, ValueEffect) else set(terms_of(effect.amount))
        inner = set[str]().union(*map(variables, effect.when))
        found |= {term for term in (*effect.arguments, *named) if term.startswith("?")} - inner
    return sorted(found - own)


def unified(
    problem: Problem,
    behavior: Behavior,
    own: frozenset[str],
    terms: tuple[str | None, ...],
    words: tuple[str | None, ...],
) -> dict[str, str] | None:
    """Return the bindings that make the terms of an effect equal to the words (None fits any term), or None if there are none."""
    found: dict[str, str] = {}
    for term, word in zip(terms, words, strict=True):
        if term is None or word is None:
            continue
        kind = behavior.kinds.get(term)
        if kind is None:
            if term != word:
                return None
        elif word not in problem.members(kind) or (term in own and found.setdefault(term, word) != word):
            return None
    return found
