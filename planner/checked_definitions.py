"""Derived situations (by rules and aggregates) as the checker computes them.

This module shares no code with any search.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from confab.planner.checked_amounts import worth
from confab.planner.checked_conditions import ConditionReader, ReadableState, Source, Values, all_hold, variables
from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.amounts import Amount, inside, written
from confab.reasoner.closure import closure
from confab.reasoner.derivation import strata
from confab.reasoner.language import substituted
from confab.reasoner.symbols import (
    Aggregate,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    Rule,
    ValueCondition,
    Witness,
)

Cell: TypeAlias = "tuple[str, tuple[str, ...]]"


def stratum_of(rules: Mapping[str, Sequence[Rule]]) -> dict[str, tuple[str, ...]]:
    """Return, for each defined situation type, the situation types with which the type is mutually dependent."""
    return {name: group for group in strata(rules) for name in group}


class DefinedValues:
    """Values of defined situations, computed on demand and cached until `forget` is called.

    `strata` is the result of `stratum_of`. `given` returns whether one of the rules derives a symbol; rules read other defined
    situations by calling `follows`.
    """

    def __init__(self, strata: Mapping[str, tuple[str, ...]], given: Callable[[str, tuple[str, ...]], bool]) -> None:
        self._given, self._strata = given, strata
        self._asking: dict[tuple[str, ...], dict[Cell, bool]] = {}
        self._known: dict[Cell, bool] = {}

    def forget(self) -> None:
        """Clear the cache of values after a change on which rules may depend."""
        self._known.clear()

    def follows(self, cell: Cell) -> bool:
        """Return whether a defined situation follows from its rules, which may depend on other defined situations.

        A defined symbol that is read during this evaluation counts as false at first; all such symbols are evaluated
        again until no more become true. Symbols that became true stay true; the remaining symbols are false.
        """
        if cell in self._known:
            return self._known[cell]
        stratum = self._strata[cell[0]]
        asked = self._asking.get(stratum)
        if asked is not None:
            return asked.setdefault(cell, False)
        asked = self._asking[stratum] = {cell: False}
        seen, grown = 0, False
        try:
            while not asked[cell] and (seen < len(asked) or grown):
                fresh = list(asked)[seen:]
                seen, grown = len(asked), bool(fresh) and grown
                for one in fresh or [one for one in reversed(asked) if not asked[one]]:
                    asked[one] = self._given(*one)
                    grown |= asked[one]
            self._known |= {one: holds for one, holds in asked.items() if holds or not asked[cell]}
            return asked[cell]
        finally:
            del self._asking[stratum]


class Total:
    """A sum or count, calculated from its definition on each access."""

    def __init__(self, rules: Source, aggregate: Aggregate) -> None:
        reading = ConditionReader(rules, [p.name for p in aggregate.parameters])
        self._members = [rules.problem.members(p.kind) for p in aggregate.parameters]
        self._names = reading.key([v.name for v in aggregate.variables])
        self._number = worth(aggregate.amount, reading.key, rules.problem.relations)
        asked = [*aggregate.conditions, *(ClassCondition(v.name, v.kind) for v in aggregate.variables)]
        bound = {p.name for p in aggregate.parameters}
        self._found: dict[tuple[str, ...], Fraction] = {}
        self._tests = reading.conjunction(asked, bound, aggregate.kinds, [self._added])
        self._terms = tuple(reading.places)

    def _added(self, facts: ReadableState, values: Values) -> bool:
        """Add the number of one solution to the sum, and return False to request the next solution."""
        number = self._number(facts.value, values)
        if number is not None:
            self._found[self._names(values)] = number
        return False

    def value(self, facts: ReadableState, arguments: tuple[str, ...]) -> str | None:
        """Return the sum for some arguments as text, or None if an argument isn't of the required class."""
        if not all(a in members for a, members in zip(arguments, self._members, strict=True)):
            return None
        self._found = {}
        all_hold(self._tests, facts, [*arguments, *self._terms[len(arguments) :]])
        return written(sum(self._found.values(), Fraction(0)))


class BoundedTotals:
    """The totals with bounds that a change can affect; `note` adds the individuals that determine these totals to the lookups."""

    def __init__(self, rules: Source, bounded: Iterable[str]) -> None:
        aggregates = rules.problem.domain.aggregates
        self._uses: dict[str, list[_Use]] = defaultdict(list)
        for name in sorted(closure(bounded, lambda name: read_by(aggregates[name]) & aggregates.keys())):
            for situation, use in _uses(rules, aggregates[name]):
                self._uses[situation].append(use)

    def note(self, facts: ReadableState, changes: Mapping[Cell, Iterable[str]]) -> None:
        """Look up everything on which the totals depend that changed symbols affect; `changes` has the old and new values."""
        waiting, seen = list(changes.items()), set(changes)
        while waiting:
            (situation, arguments), values = waiting.pop()
            for use in self._uses.get(situation, ()):
                fresh = use.totals(facts, arguments, values) - seen
                seen |= fresh
                waiting += [(cell, ()) for cell in sorted(fresh)]


class _Use:
    """The place of a changing symbol in the conditions or the number of an aggregate.

    `conditions` are all other conditions, including those around and inside the nested conditions in which the symbol occurs.
    `terms` are the arguments of the symbol, and its value if `valued` is true.
    """

    def __init__(
        self,
        rules: Source,
        aggregate: Aggregate,
        terms: tuple[str, ...],
        valued: bool,
        conditions: Sequence[Condition],
        kinds: Mapping[str, str],
    ) -> None:
        self._terms, self._valued, self._situation = terms, valued, aggregate.situation
        bound = kinds.keys() & {*terms}
        reading = ConditionReader(rules, kinds)
        self._owner = reading.key([p.name for p in aggregate.parameters])
        self._whole = reading.conjunction(aggregate.conditions, {*kinds}, kinds)
        loose = bound | kinds.keys() - set().union(*map(variables, conditions))
        asked = [*conditions, *(ClassCondition(name, kinds[name]) for name in kinds if name in loose)]
        self._found: set[Cell] = set()
        self._tests = reading.conjunction(asked, bound, kinds, [self._added])
        self._places = tuple(reading.places)

    def _added(self, facts: ReadableState, values: Values) -> bool:
        """Add the total of a solution, and return False to request the next solution."""
        all_hold(self._whole, facts, values.copy())
        self._found.add((self._situation, self._owner(values)))
        return False

    def totals(self, facts: ReadableState, arguments: tuple[str, ...], values: Iterable[str]) -> set[Cell]:
        """Return the totals that depend on a symbol in this place, if the symbol has one of the values."""
        self._found = set()
        for words in ((*arguments, value) for value in values) if self._valued else (arguments,):
            given = dict(zip(self._terms, words, strict=True))
            if all(
                given[t] == word and (t.startswith("?") or t == word)
                for t, word in zip(self._terms, words, strict=True)
            ):
                all_hold(self._tests, facts, [given.get(term, term) for term in self._places])
        return self._found


def _uses(rules: Source, aggregate: Aggregate) -> Iterator[tuple[str, _Use]]:
    """Yield each use of a changing symbol in an aggregate, with the situation type of the symbol."""
    counted = Comparison(aggregate.amount, "=", aggregate.amount)
    for leaf, others, kinds in _leaves((counted, *aggregate.conditions), aggregate.kinds):
        if isinstance(leaf, ValueCondition):
            yield leaf.situation, _Use(rules, aggregate, (*leaf.arguments, leaf.value), True, others, kinds)
        elif isinstance(leaf, Comparison):
            for part in dict.fromkeys((*inside(leaf.left), *inside(leaf.right))):
                if isinstance(part, Amount):
                    yield part.situation, _Use(rules, aggregate, part.arguments, False, others, kinds)


def _leaves(
    conditions: Sequence[Condition], kinds: Mapping[str, str]
) -> Iterator[tuple[Condition, tuple[Condition, ...], Mapping[str, str]]]:
    """Yield each simple condition, the conditions with which it is in one conjunction, and the classes of their variables."""
    for i, condition in enumerate(conditions):
        others, groups = (*conditions[:i], *conditions[i + 1 :]), list[Sequence[Condition]]()
        its = dict(kinds)
        match condition:
            case Witness(variable, kind, inner):
                name = variable
                while name in kinds:
                    name += "'"
                its[name] = kind
                groups = [[substituted(c, {variable: name}) for c in inner]]
            case AnyOf(alternatives):
                groups = [*alternatives]
            case _:
                yield condition, others, kinds
        for group in groups:
            for leaf, rest, of in _leaves(group, its):
                yield leaf, (*others, *rest), of
