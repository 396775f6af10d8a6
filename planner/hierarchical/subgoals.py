"""Subgoals: symbols with alternative values that could satisfy an unmet condition of an achiever.

The method `Subgoals.of` distinguishes the kinds of conditions. For every kind, another value of a symbol that determines a variable
of the condition may also help (`_redetermined`). If a symbol has many possible values, the subgoal contains one value of each
symmetry class, and the values of goals (`confab.planner.hierarchical.candidates`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from confab.planner.hierarchical.candidates import Candidates
from confab.planner.hierarchical.condition_tests import ConditionTests, Env
from confab.planner.hierarchical.operators import FEW, Achiever, Program
from confab.planner.transitions import Cell, Key, Table, arguments_of
from confab.reasoner.amounts import Amount, inside, number
from confab.reasoner.amounts import written as amount_written
from confab.reasoner.derivation import circular
from confab.reasoner.limits import check
from confab.reasoner.symbols import (
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


class Subgoals:
    """Methods that return subgoals for unmet conditions, for one table and goal.

    Parameters
    ----------
    program : Program
    table : Table
    goal : mapping of cell to value
        The goals of the call.
    """

    def __init__(self, program: Program, table: Table, goal: Mapping[Cell, str]) -> None:
        self.program, self.table = program, table
        self.tests = ConditionTests(program, table)
        self.candidates = Candidates(program, table, goal)
        self._circular = circular(program.domain.rules)
        self._entered: dict[tuple[str, Key, bool], int] | None = None  # depth of each entered situation
        self._depth = 0
        self._concern: frozenset[str] = frozenset()
        self._variables: dict[tuple[int, int], tuple[str, ...]] = {}
        self._found: dict[tuple[object, ...], list[Subgoal]] = {}
        self._age = -1

    def towards(self, achiever: Achiever, number: int, env: Env, level: int) -> Sequence[Subgoal]:
        """Return the alternative subgoals for the condition at position `number` of `achiever.soft`.

        The result is cached until the table changes.
        """
        self._forget()
        variables = self._variables.get((id(achiever), number))
        if variables is None:
            variables = self._variables[id(achiever), number] = self._variables_of(achiever, achiever.soft[number])
        key = id(achiever), number, level, *[env.get(term) for term in variables]
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = list(self.of(achiever, achiever.soft[number], env, level))
        return found

    def _forget(self) -> None:
        """Clear the cache if the table has changed."""
        if self._age != self.table.age:
            self._age = self.table.age
            self._found.clear()

    def _variables_of(self, achiever: Achiever, condition: Condition) -> tuple[str, ...]:
        """Return the variables on which the subgoals of a condition depend."""
        found = dict.fromkeys(self.tests.about(condition).terms)
        for term in tuple(found):
            if term in achiever.determined:
                found.update(dict.fromkeys(a for a in achiever.determined[term][1] if a.startswith("?")))
        return tuple(found)

    def of(self, achiever: Achiever, condition: Condition, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield alternative subgoals, each of which may help to satisfy an unmet condition of an achiever."""
        match condition:
            case ValueCondition():
                yield from self._giving(achiever, condition, env, level)
            case Witness(negated=False):
                yield from self._lacking(achiever, condition, env, level)
            case Witness():
                yield from self._violating(achiever, condition, env, level)
            case Comparison():
                yield from self._amounts(condition, env)
            case AnyOf(alternatives, negated):
                for c in (c for group in alternatives for c in group if isinstance(c, ValueCondition | Comparison)):
                    if self.tests.holds(achiever, c, env) is negated:
                        yield from self.of(achiever, self.tests.about(c).negation if negated else c, env, level)
            case RelationCondition() | ClassCondition() | EqualityCondition():
                pass  # only other individuals could satisfy the condition
        yield from self._redetermined(achiever, condition, env, level)

    def _giving(self, achiever: Achiever, condition: ValueCondition, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield the subgoals that give the symbol of a condition a value with which the condition holds."""
        situation, value = condition.situation, condition.value
        key = self.tests.key(condition.arguments, env)
        if key is None:
            return
        if situation in self.program.rules:
            yield from self.defining(situation, key, (value == TRUE) is not condition.negated, level)
            return
        if key not in self.table.now[situation] and not self.program.domain.situations[situation].boolean:
            return
        if value.startswith("?") and achiever.determined.get(value) == (situation, condition.arguments):
            values = self.candidates.values(situation, key, achiever.kinds[value])
        elif condition.negated:
            values = self.candidates.other_values(situation, key, env.get(value, value), level)
        else:
            wanted = env.get(value, value)
            values = () if wanted is None else (wanted,)
        if values:
            yield situation, key, values

    def _violating(self, achiever: Achiever, witness: Witness, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield the subgoals for a negated witness: facts with which no individual would satisfy the witness."""
        for individual in self.tests.satisfying(achiever, witness, env):
            inner = {**env, witness.variable: individual}
            for c in witness.conditions:
                if isinstance(c, ValueCondition | Comparison) or (achiever.deep and isinstance(c, Witness)):
                    yield from self.of(achiever, self.tests.about(c).negation, inner, level)

    def _lacking(self, achiever: Achiever, witness: Witness, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield the subgoals for a witness: facts that would make some individual satisfy the witness."""
        lacking: list[tuple[str, list[Condition]]] = []
        changing = [c for c in witness.conditions if not self.tests.about(c).static]
        for individual in self.candidates.one_of_each(witness.kind, env.values()):
            check("planning")
            inner = {**env, witness.variable: individual}
            if all(self.tests.holds(achiever, c, inner) for c in witness.conditions if c not in changing):
                lacking.append((individual, [c for c in changing if not self.tests.holds(achiever, c, inner)]))
        for individual, unmet in self._nearest(lacking) if achiever.rule else lacking:
            for c in unmet:
                yield from self.of(achiever, c, {**env, witness.variable: individual}, level)

    def _amounts(self, condition: Comparison, env: Env) -> Iterator[Subgoal]:
        """Yield a subgoal for each amount in a comparison: a bound that satisfies the comparison.

        The bound of one amount assumes that all other amounts stay unchanged.
        """
        contrary = {"<": ">=", "<=": ">", ">=": "<", ">": "<="}
        sign = contrary.get(condition.operator, ">") if condition.negated else condition.operator
        for part in dict.fromkeys((*inside(condition.left), *inside(condition.right))):
            key = self.tests.key(part.arguments, env) if isinstance(part, Amount) else None
            if not isinstance(part, Amount) or key not in self.table.now[part.situation]:
                continue
            cells, text = self.table.now[part.situation], self.table.now[part.situation][key]
            now = self.tests.worth(condition, env)
            cells[key] = amount_written(Fraction(text) + 1)
            slope = self.tests.worth(condition, env) - now
            cells[key] = text
            if not isinstance(slope, Fraction) or not slope:
                continue
            limit = number(text) - now / slope
            flipped = sign if slope > 0 else sign.translate(str.maketrans("<>", "><"))
            if isinstance(limit, Fraction):
                yield part.situation, key, (f"{flipped}{amount_written(limit)}".lstrip("="),)

    def _redetermined(self, achiever: Achiever, condition: Condition, env: Env, level: int) -> Iterator[Subgoal]:
        """Yield subgoals for other values of the symbols that determine the variables of a condition.

        The condition must hold with the other value. If the condition is a witness, only its static conditions must hold; the unmet
        conditions of the witness become further subgoals.
        """
        if isinstance(condition, ValueCondition) and condition.value in achiever.determined:
            return
        possible = self.tests.about(condition).possible
        for term in self.tests.about(condition).terms:
            if term in achiever.determined:
                situation, arguments = achiever.determined[term]
                key = self.tests.key(arguments, env)
                if key is None or key not in self.table.now[situation]:
                    continue
                others = self.candidates.values(situation, key, achiever.kinds[term])
                fitting = self.tests.fitting(achiever, possible, env, term, others)
                values = tuple(value for value in fitting if value != env[term])
                if values:
                    yield situation, key, values
                if isinstance(condition, Witness) and possible is not condition:
                    for value in values:
                        yield from self._lacking(achiever, condition, {**env, term: value}, level)

    def defining(self, situation: str, key: Key, wanted: bool, level: int) -> Sequence[Subgoal]:
        """Return alternative subgoals that may make a defined situation true if `wanted`, otherwise false."""
        if self._entered is not None and situation in self._circular:  # the result depends on the rules entered before
            return list(self._defining(situation, key, wanted, level))
        self._forget()
        asked = situation, key, wanted, level
        found = self._found.get(asked)
        if found is None:
            outside, self._entered, self._depth = (self._entered, self._depth), {}, 0
            try:
                found = self._found[asked] = list(dict.fromkeys(self._defining(situation, key, wanted, level)))
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
                dead = any(
                    self.tests.about(c).static and not rule.determined.keys() & self.tests.about(c).terms for c in unmet
                )
                if wanted and not dead:
                    for condition in unmet:
                        yield from self.of(rule, condition, env, level)
                elif not wanted and not unmet:
                    for condition in rule.soft:
                        if not self.tests.about(condition).static and condition not in rule.determining:
                            yield from self.of(rule, self.tests.about(condition).negation, env, level)
        self._depth -= 1

    def _holds_so_far(self, rule: Achiever, condition: Condition, env: dict[str, str | None]) -> bool:
        """Return whether a condition of a rule holds; if the condition determines a variable, bind the variable in `env`."""
        if condition in rule.determining and isinstance(condition, ValueCondition):
            key = self.tests.key(condition.arguments, env)
            found = None if key is None else self.table.now[condition.situation].get(key)
            env[condition.value] = found
            return found in self.program.members.get(rule.kinds[condition.value], ())
        return self.tests.holds(rule, condition, env)

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
            self._found.clear()
