"""Derived situations (by rules and aggregates) as the checker computes them.

This module shares no code with any search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from confab.planner.checked_amounts import worth
from confab.planner.checked_conditions import ConditionReader, ReadableState, Source, Values, all_hold
from confab.reasoner.amounts import written
from confab.reasoner.derivation import strata
from confab.reasoner.symbols import Aggregate, ClassCondition, Rule

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
