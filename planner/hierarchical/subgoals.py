"""Subgoals: symbols with alternative values that could satisfy an unmet condition of an achiever.

If a symbol has many possible values, the subgoal contains one value of each symmetry class, and the values of goals. Therefore a
thousand free places count as one place.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from heapq import nsmallest
from itertools import islice
from typing import Any, TypeAlias

from confab.planner.amount_transitions import amount
from confab.planner.generated import written
from confab.planner.hierarchical.operators import FEW, Achiever, Program
from confab.planner.hierarchical.symmetry import representatives
from confab.planner.transitions import Cell, Key, Table, arguments_of, key_of
from confab.reasoner.amounts import Amount, Calculation, Number, inside, number
from confab.reasoner.amounts import written as amount_written
from confab.reasoner.derivation import circular
from confab.reasoner.language import mentions, needs, walk
from confab.reasoner.limits import check
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    ValueCondition,
    Witness,
)

Subgoal: TypeAlias = "tuple[str, Key, tuple[str, ...]]"
"""A subgoal: a situation type, a key, and alternative values."""
DEEPEST = 8
"""Maximum depth of nested rules that are examined for missing facts."""
Env: TypeAlias = "Mapping[str, str | None]"


class Subgoals:
    """Methods that return subgoals for unmet conditions, for one table and goal.

    Parameters
    ----------
    program : Program
    table : Table
    goal : mapping of cell to value
        The goals of the call. A goal's value is a candidate for the goal's symbol, and doesn't count as free for other symbols.
    """

    def __init__(self, program: Program, table: Table, goal: Mapping[Cell, str]) -> None:
        self.program = program
        self.table = table
        self.goal = goal
        self._cursors: dict[int, int] = {}
        self._known: dict[tuple[object, ...], bool] = {}
        self._conditions: dict[int, tuple[bool, bool, tuple[str, ...], Condition]] = {}
        self._negations: dict[int, tuple[Condition, Condition]] = {}
        self._possibles: dict[int, tuple[Condition, Condition]] = {}
        self._entered: dict[tuple[str, Key, bool], int] | None = None  # depth of each entered situation
        self._depth = 0
        self._scopes: dict[tuple[int, int], tuple[str, ...]] = {}
        self._fresh: dict[tuple[object, ...], list[Subgoal]] = {}
        self._free: dict[tuple[str, str], list[str]] = {}
        self._tests: dict[tuple[int, ...], tuple[Callable[..., Any], Sequence[str]]] = {}
        self._worths: dict[int, Callable[..., Any]] = {}
        self._concern: frozenset[str] = frozenset()
        self._circular = circular(program.domain.rules)
        self._age = -1
        self.wanted: dict[str, dict[str, None]] = {}
        for (situation, _), value in goal.items():
            self.wanted.setdefault(situation, {})[value] = None

    def towards(self, achiever: Achiever, number: int, env: Env, level: int) -> Sequence[Subgoal]:
        """Return the alternative subgoals for the condition at position `number` of `achiever.soft`.

        The result is cached until the table changes.
        """
        self._forget()
        scope = self._scopes.get((id(achiever), number))
        if scope is None:
            scope = self._scopes[id(achiever), number] = self._scope(achiever, achiever.soft[number])
        key = id(achiever), number, level, *[env.get(term) for term in scope]
        found = self._fresh.get(key)
        if found is None:
            found = self._fresh[key] = list(self.of(achiever, achiever.soft[number], env, level))
        return found

    def _forget(self) -> None:
        """Clear the caches if the table has changed."""
        if self._age != self.table.age:
            self._age = self.table.age
            self._fresh.clear()
            self._free.clear()

    def _scope(self, achiever: Achiever, condition: Condition) -> tuple[str, ...]:
        """Return the variables on which the subgoals of a condition depend."""
        found = dict.fromkeys(self._about(condition)[2])
        for term in tuple(found):
            if term in achiever.determined:
                found.update(dict.fromkeys(a for a in achiever.determined[term][1] if a.startswith("?")))
        return tuple(found)

    def of(self, achiever: Achiever, condition: Condition, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield alternative subgoals, each of which may help to satisfy an unmet condition of an achiever."""
        match condition:
            case ValueCondition(situation, arguments, value, negated) if situation in self.program.rules:
                key = self._key(arguments, env)
                if key is not None:
                    yield from self.defining(situation, key, (value == TRUE) is not negated, level)
            case ValueCondition(situation, arguments, value, negated):
                key = self._key(arguments, env)
                if key is not None and (key in self.table.now[situation] or self._boolean(situation)):
                    if value.startswith("?") and achiever.determined.get(value) == (situation, arguments):
                        values = self.candidates(situation, key, achiever.kinds[value])
                    elif negated:
                        avoid = env.get(value, value)
                        values = self._others(situation, key, avoid, level)
                    else:
                        wanted = env.get(value, value)
                        values = () if wanted is None else (wanted,)
                    if values:
                        yield situation, key, values
            case Witness(negated=False):
                yield from self._lacking(achiever, condition, env, level)
            case Witness(variable, _, conditions):
                for individual in self._satisfying(achiever, condition, env):
                    inner = {**env, variable: individual}
                    for c in conditions:
                        if isinstance(c, ValueCondition | Comparison) or (achiever.deep and isinstance(c, Witness)):
                            yield from self.of(achiever, self._negation(c), inner, level)
            case Comparison():
                yield from self._amounts(condition, env)
            case AnyOf(alternatives, negated):
                for group in alternatives:
                    for c in group:
                        if isinstance(c, ValueCondition | Comparison) and self.holds(achiever, c, env) is negated:
                            yield from self.of(achiever, self._negation(c) if negated else c, env, level)
            case (
                RelationCondition() | ClassCondition() | EqualityCondition()
            ):  # only other individuals could satisfy the condition
                pass
        yield from self._redetermined(achiever, condition, env, level)

    def _lacking(self, achiever: Achiever, witness: Witness, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield the subgoals for a witness: facts that would make some individual satisfy the witness."""
        lacking: list[tuple[str, list[Condition]]] = []
        changing = [c for c in witness.conditions if not self._about(c)[0]]
        for individual in self.one_of_each(witness.kind, env.values()):
            check("planning")
            inner = {**env, witness.variable: individual}
            if all(self.holds(achiever, c, inner) for c in witness.conditions if c not in changing):
                lacking.append((individual, [c for c in changing if not self.holds(achiever, c, inner)]))
        for individual, unmet in self._nearest(lacking) if achiever.rule else lacking:
            for c in unmet:
                yield from self.of(achiever, c, {**env, witness.variable: individual}, level)

    def defining(self, situation: str, key: Key, wanted: bool, level: int) -> Sequence[Subgoal]:
        """Return alternative subgoals that may make a defined situation true if `wanted`, otherwise false."""
        if self._entered is not None and situation in self._circular:  # the result depends on the rules entered before
            return list(self._defining(situation, key, wanted, level))
        self._forget()
        asked = situation, key, wanted, level
        found = self._fresh.get(asked)
        if found is None:
            outside, self._entered, self._depth = (self._entered, self._depth), {}, 0
            try:
                found = self._fresh[asked] = list(dict.fromkeys(self._defining(situation, key, wanted, level)))
            finally:
                self._entered, self._depth = outside
        return found

    def _defining(self, situation: str, key: Key, wanted: bool, level: int) -> Iterator[Subgoal]:
        cell = situation, key, wanted
        assert self._entered is not None
        if self._entered.get(cell, DEEPEST) <= self._depth:
            return  # the subgoals of this situation have been found already
        self._entered[cell] = self._depth
        self._depth += 1
        for parameters, rule in self.program.rules[situation]:
            env: dict[str, str | None] = dict(zip(parameters, arguments_of(key), strict=True))
            if all(env[name] in self.program.members.get(rule.kinds[name], ()) for name in parameters):
                unmet = [c for c in rule.soft if not self._holds_so_far(rule, c, env)]
                dead = any(self._about(c)[0] and not rule.determined.keys() & self._about(c)[2] for c in unmet)
                if wanted and not dead:
                    for condition in unmet:
                        yield from self.of(rule, condition, env, level)
                elif not wanted and not unmet:
                    for condition in rule.soft:
                        if not self._about(condition)[0] and condition not in rule.determining:
                            yield from self.of(rule, self._negation(condition), env, level)
        self._depth -= 1

    def _nearest(self, lacking: Sequence[tuple[str, list[Condition]]]) -> Sequence[tuple[str, list[Condition]]]:
        """Return the candidates that are individuals of the current search (`concern`).

        If there are no such candidates, return a few candidates with the fewest unmet conditions.
        """
        found = [pair for pair in lacking if pair[0] in self._concern]
        return found or sorted(lacking, key=lambda pair: len(pair[1]))[:FEW]

    def concern(self, individuals: frozenset[str]) -> None:
        """Set the individuals of the current search; witnesses of rules prefer these individuals."""
        if self.program.rules and individuals != self._concern:
            self._concern = individuals
            self._fresh.clear()

    def _holds_so_far(self, rule: Achiever, condition: Condition, env: dict[str, str | None]) -> bool:
        """Return whether a condition of a rule holds; if the condition determines a variable, bind the variable in `env`."""
        if condition in rule.determining and isinstance(condition, ValueCondition):
            key = self._key(condition.arguments, env)
            found = None if key is None else self.table.now[condition.situation].get(key)
            env[condition.value] = found
            return found in self.program.members.get(rule.kinds[condition.value], ())
        return self.holds(rule, condition, env)

    def _amounts(self, condition: Comparison, env: Env) -> Iterator[Subgoal]:
        """Yield a subgoal for each amount in a comparison: a bound that satisfies the comparison.

        The bound of one amount assumes that all other amounts stay unchanged.
        """
        contrary = {"<": ">=", "<=": ">", ">=": "<", ">": "<="}
        sign = contrary.get(condition.operator, ">") if condition.negated else condition.operator
        for part in dict.fromkeys((*inside(condition.left), *inside(condition.right))):
            key = self._key(part.arguments, env) if isinstance(part, Amount) else None
            if not isinstance(part, Amount) or key not in self.table.now[part.situation]:
                continue
            cells, text = self.table.now[part.situation], self.table.now[part.situation][key]
            now = self.worth(condition, env)
            cells[key] = amount_written(Fraction(text) + 1)
            slope = self.worth(condition, env) - now
            cells[key] = text
            if not isinstance(slope, Fraction) or not slope:
                continue
            limit = number(text) - now / slope
            flipped = sign if slope > 0 else sign.translate(str.maketrans("<>", "><"))
            if isinstance(limit, Fraction):
                yield part.situation, key, (f"{flipped}{amount_written(limit)}".lstrip("="),)

    def worth(self, condition: Comparison, env: Env) -> Number:
        """Return the current difference between the left and the right side of a comparison."""
        names = self._about(condition)[2]
        function = self._worths.get(id(condition))
        if function is None:
            writer = self.program.writer
            difference = Calculation("-", condition.left, condition.right)
            text = amount(difference, self.program.problem.relations, writer.constant)
            bind = writer.function((), f"lambda {', '.join(map(written, names))}: {text}")
            function = self._worths[id(condition)] = bind(self.table.now, self.table.holders)
        found: Number = function(*[env.get(name) for name in names])
        return found

    def _redetermined(self, achiever: Achiever, condition: Condition, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield subgoals for other values of the symbols that determine the variables of a condition.

        The condition must hold with the other value. If the condition is a witness, only its static conditions must hold; the unmet
        conditions of the witness become further subgoals.
        """
        if isinstance(condition, ValueCondition) and condition.value in achiever.determined:
            return
        possible = self._possible(condition)
        for term in self._about(condition)[2]:
            if term in achiever.determined:
                situation, arguments = achiever.determined[term]
                key = self._key(arguments, env)
                if key is None or key not in self.table.now[situation]:
                    continue
                values = tuple(
                    value
                    for value in self.candidates(situation, key, achiever.kinds[term])
                    if value != env[term] and self._would_hold(achiever, possible, env, term, value)
                )
                if values:
                    yield situation, key, values
                if isinstance(condition, Witness) and possible is not condition:
                    for value in values:
                        yield from self._lacking(achiever, condition, {**env, term: value}, level)

    def _possible(self, condition: Condition) -> Condition:
        """Return a positive witness reduced to its static conditions, or any other condition unchanged.

        Repeated calls return the same object.
        """
        if not isinstance(condition, Witness) or condition.negated:
            return condition
        if id(condition) not in self._possibles:
            static = tuple(c for c in condition.conditions if self._about(c)[0])
            found = replace(condition, conditions=static) if 0 < len(static) < len(condition.conditions) else condition
            self._possibles[id(condition)] = found, condition
        return self._possibles[id(condition)][0]

    def _about(self, condition: Condition) -> tuple[bool, bool, tuple[str, ...], Condition]:
        """Return whether a condition is static, whether it compares individuals, the condition's variables, and the condition.

        The cache stores the condition, because Python could otherwise reuse the `id` of the condition.
        """
        found = self._conditions.get(id(condition))
        if found is None:
            parts = list(walk(condition))
            static = not any(isinstance(inner, ValueCondition | Comparison) for inner in parts)
            compares = any(isinstance(inner, EqualityCondition) for inner in parts)
            found = static, compares, tuple(sorted(mentions(condition))), condition
            self._conditions[id(condition)] = found
        return found

    def _negation(self, condition: Condition) -> Condition:
        """Return the negation of a condition; repeated calls return the same object."""
        found = self._negations.get(id(condition))
        if found is None:
            opposite = replace(condition, negated=not condition.negated)
            found = self._negations[id(condition)] = opposite, condition
        return found[0]

    def _would_hold(self, achiever: Achiever, condition: Condition, env: Env, term: str, value: str) -> bool:
        """Return whether a condition would hold if the variable `term` had the given value.

        The result for a static condition is cached for symmetric individuals, unless the condition compares individuals.
        """
        static, compares, others, _ = self._about(condition)
        if not static:
            return self.holds(achiever, condition, {**env, term: value})
        classes = {} if compares else self.program.symmetry.class_of
        bound = [value if other == term else env.get(other) for other in others]
        key = id(condition), *[None if one is None else classes.get(one, one) for one in bound]
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = self.holds(achiever, condition, {**env, term: value})
        return known

    def candidates(self, situation: str, key: Key, kind: str) -> tuple[str, ...]:
        """Return candidates of a class for the value of a symbol.

        The candidates are the goal's value, and one value of each symmetry class, preferably a free value. All members of a small
        class are candidates.
        """
        members = self.program.problem.classes.get(kind, ())
        if len(members) <= FEW:
            return members
        self._forget()
        found = self._free.get((situation, kind))
        if found is None:
            groups, wanted, holders = (
                self.program.symmetry.groups(members),
                self.wanted.get(situation, {}),
                self.table.holders[situation],
            )

            found = representatives(groups, holders, wanted, self._cursors, lambda value: self.burden(situation, value))
            self._free[situation, kind] = found
        goal = self.goal.get((situation, key))
        if goal is not None and goal not in found and goal in self.program.members[kind]:
            return (goal, *found)
        return tuple(found)

    def burden(self, situation: str, value: str) -> int:
        """Return 0 for a value that no object has, 2 if an object with the value is at its goal, and 1 otherwise."""
        keys = self.table.holders[situation].get(value, ())
        return 1 + any(self.goal.get((situation, key)) == value for key in keys) if keys else 0

    def spare(self, excluded: Collection[str], level: int, number: int) -> Iterator[str]:
        """Yield up to `number` additional values of each symmetry class with a member in `excluded`.

        Values with the least burden come first.
        """
        for situation in self.program.changing(level):
            members = self.program.problem.classes.get(situation.range, ())
            if len(members) <= FEW:
                continue
            for group in self.program.symmetry.groups(members):
                if not set(group).isdisjoint(excluded):
                    others = (value for value in group if value not in excluded)
                    yield from nsmallest(number, others, key=lambda value: self.burden(situation.name, value))

    def _others(self, situation: str, key: Key, avoid: str | None, level: int) -> tuple[str, ...]:
        if self._boolean(situation):
            return (FALSE,) if avoid == TRUE else (TRUE,)
        levels = self.program.problem.value_levels
        values = self.candidates(situation, key, self.program.domain.situations[situation].range)
        return tuple(value for value in values if value != avoid and levels.get(value, 1) <= level)

    def one_of_each(self, kind: str, excluded: Collection[str | None] = ()) -> list[str]:
        """Return the individuals of a class; if the class is large, one individual of each symmetry class and state.

        If `excluded` contains one of these individuals, another individual of the same symmetry class is added, because a different
        individual may be required.
        """
        members, symmetry = self.program.problem.classes.get(kind, ()), self.program.symmetry
        if len(members) <= FEW:
            return list(members)
        found = symmetry.unlike(members, (), self.table.now)
        for group in sorted({symmetry.class_of.get(one, -1) for one in excluded if one in found}):
            found += islice((one for one in symmetry.members[group] if one not in excluded and one not in found), 1)
        return found

    def _boolean(self, situation: str) -> bool:
        return self.program.domain.situations[situation].boolean

    def _key(self, arguments: tuple[str, ...], env: Env) -> Key | None:
        found = tuple(env.get(a, a) for a in arguments)
        return None if None in found else key_of(found)  # type: ignore[arg-type]

    def holds(self, achiever: Achiever, condition: Condition, env: Env) -> bool:
        """Return whether a condition of an achiever holds in the current state; terms without a binding have no value."""
        test, names = self._evaluator(achiever, condition, env, False)
        return bool(test(*[env.get(name) for name in names]))

    def _satisfying(self, achiever: Achiever, witness: Witness, env: Env) -> list[str]:
        """Return the individuals that satisfy all conditions of a witness in the current state."""
        test, names = self._evaluator(achiever, witness, env, True)
        found: list[str] = test(*[env.get(name) for name in names])
        return found

    def _evaluator(
        self, achiever: Achiever, condition: Condition, env: Env, individuals: bool
    ) -> tuple[Callable[..., Any], Sequence[str]]:
        """Return a function that tests a condition, and the names of the function's arguments.

        If `individuals`, the function returns the individuals that satisfy a witness.
        """
        key = id(condition), individuals, *[name in env for name in self._about(condition)[2]]
        known = self._tests.get(key)
        if known is None:
            names = tuple(sorted({name for name in self._about(condition)[2] if name in env} | needs(condition)))
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
