"""Tests of conditions of achievers in the current state of one table.

Each condition is compiled to a Python function when it is tested for the first time. The caches use the `id` of a condition as
key, because the hash of a nested condition is slow; they also store the condition, so that Python doesn't reuse the `id`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any, NamedTuple, TypeAlias

from confab.planner.amount_transitions import amount
from confab.planner.generated import written
from confab.planner.hierarchical.operators import Achiever, Program
from confab.planner.transitions import Key, Table, key_of
from confab.reasoner.amounts import Calculation, Number
from confab.reasoner.language import mentions, needs, walk
from confab.reasoner.symbols import Comparison, Condition, EqualityCondition, ValueCondition, Witness

Env: TypeAlias = "Mapping[str, str | None]"
"""The individual of each bound term; a term whose symbol has no value is bound to None."""


class About(NamedTuple):
    """The properties of a condition.

    `static` states whether the condition depends on no symbol, and `compares` whether it compares individuals. `possible` contains
    only the static conditions of a positive witness; it is any other condition itself.
    """

    static: bool
    compares: bool
    terms: tuple[str, ...]
    negation: Condition
    possible: Condition
    condition: Condition


class ConditionTests:
    """Functions that test the conditions of achievers and rules, for one table."""

    def __init__(self, program: Program, table: Table) -> None:
        self.program, self.table = program, table
        self._about: dict[int, About] = {}
        self._known: dict[tuple[object, ...], list[bool]] = {}
        self._tests: dict[tuple[int, ...], tuple[Callable[..., Any], Sequence[str]]] = {}
        self._worths: dict[int, Callable[..., Any]] = {}

    def holds(self, achiever: Achiever, condition: Condition, env: Env) -> bool:
        """Return whether a condition of an achiever holds in the current state; terms without a binding have no value."""
        test, names = self._evaluator(achiever, condition, env, False)
        return bool(test(*[env.get(name) for name in names]))

    def satisfying(self, achiever: Achiever, witness: Witness, env: Env) -> list[str]:
        """Return the individuals that satisfy all conditions of a witness in the current state."""
        test, names = self._evaluator(achiever, witness, env, True)
        found: list[str] = test(*[env.get(name) for name in names])
        return found

    def fitting(
        self, achiever: Achiever, condition: Condition, env: Env, term: str, values: Sequence[str]
    ) -> Iterator[str]:
        """Return the values of the variable `term` with which a condition would hold.

        The result for a static condition is cached for symmetric individuals, unless the condition compares individuals.
        """
        static, compares, others, *_ = self.about(condition)
        classes = {} if compares else self.program.symmetry.class_of
        bound = [env.get(other) for other in others if other != term]
        key = id(condition), term, *[None if one is None else classes.get(one, one) for one in (*bound, *values)]
        known = self._known.get(key) if static else None
        if known is None:
            known = [self.holds(achiever, condition, {**env, term: value}) for value in values]
            if static:
                self._known[key] = known
        return compress(values, known)

    def worth(self, condition: Comparison, env: Env) -> Number:
        """Return the current difference between the left and the right side of a comparison."""
        names = self.about(condition).terms
        function = self._worths.get(id(condition))
        if function is None:
            writer = self.program.writer
            difference = Calculation("-", condition.left, condition.right)
            text = amount(difference, self.program.problem.relations, writer.constant)
            bind = writer.function((), f"lambda {', '.join(map(written, names))}: {text}")
            function = self._worths[id(condition)] = bind(self.table.now, self.table.holders)
        found: Number = function(*[env.get(name) for name in names])
        return found

    def about(self, condition: Condition) -> About:
        """Return the properties of a condition; repeated calls return the same objects."""
        found = self._about.get(id(condition))
        if found is None:
            parts = list(walk(condition))
            static = not any(isinstance(inner, ValueCondition | Comparison) for inner in parts)
            compares = any(isinstance(inner, EqualityCondition) for inner in parts)
            negation, possible = replace(condition, negated=not condition.negated), condition
            if isinstance(condition, Witness) and not condition.negated:
                fixed = tuple(c for c in condition.conditions if self.about(c).static)
                if 0 < len(fixed) < len(condition.conditions):
                    possible = replace(condition, conditions=fixed)
            found = About(static, compares, tuple(sorted(mentions(condition))), negation, possible, condition)
            self._about[id(condition)] = found
        return found

    def key(self, arguments: tuple[str, ...], env: Env) -> Key | None:
        """Return the key of bound arguments, or None if an argument has no value."""
        found = tuple(env.get(a, a) for a in arguments)
        return None if None in found else key_of(found)  # type: ignore[arg-type]

    def _evaluator(
        self, achiever: Achiever, condition: Condition, env: Env, individuals: bool
    ) -> tuple[Callable[..., Any], Sequence[str]]:
        """Return a function that tests a condition, and the names of the function's arguments.

        If `individuals`, the function returns the individuals that satisfy a witness.
        """
        key = id(condition), individuals, *[name in env for name in self.about(condition).terms]
        known = self._tests.get(key)
        if known is None:
            names = tuple(sorted({name for name in self.about(condition).terms if name in env} | needs(condition)))
            writer, bound = self.program.writer, set(names)
            if individuals and isinstance(condition, Witness):
                source, tests = writer.satisfying(condition, bound, achiever.kinds, achiever.behavior)
                term = written(condition.variable)
                text = f"[{term} for {term} in {source} if {' and '.join(tests) or 'True'}]"
            else:
                text = writer.expression(condition, bound, achiever.kinds, achiever.behavior)
            function = writer.function((), f"lambda {', '.join(map(written, names))}: {text}")
            known = self._tests[key] = function(self.table.now, self.table.holders), names
        return known
