"""Behaviours compiled to Python functions.

Each behaviour has a function ``forward`` that returns its changes (`confab.planner.transitions`). Each effect has a function
``achieve(key …, value)``. The function ``achieve`` yields every binding with which the effect would give the value to the symbol,
and the unmet preconditions of the binding.

The candidates for an unbound parameter come from the cheapest source. The sources are a static relation to a bound term, the
objects with a given value that no behaviour can change, and the members of the parameter's class. Terms that only the state
determines are bound last. Conditions that depend on the state are *soft*: a soft condition may be unmet, and subgoals then help to
satisfy it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias, TypeGuard

from confab.planner.amount_transitions import approaches_goal
from confab.planner.derived_facts import CompiledRules
from confab.planner.generated import GeneratorFunction, identifier, tuple_written, written
from confab.planner.hierarchical.symmetry import SymmetryClasses, representatives
from confab.planner.transitions import Forward, Key, PythonWriter, Table, in_binding_order
from confab.reasoner.amounts import Amount, inside, terms_of
from confab.reasoner.effects import allowed
from confab.reasoner.language import measures, mentions, terms, walk
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    SituationType,
    ValueCondition,
    ValueEffect,
    Witness,
)

Arguments: TypeAlias = "tuple[str, ...]"
AnyEffect: TypeAlias = "ValueEffect | AmountEffect"
Determined: TypeAlias = "dict[str, tuple[str, tuple[str, ...]]]"
"""The symbol that determines each variable, as a situation type with argument terms."""
Achieve: TypeAlias = "Callable[..., Iterator[tuple[Arguments, tuple[int, ...], dict[str, str | None]]]]"
"""Function that yields the arguments of a behaviour, the positions of unmet conditions, and a binding.

The binding is None if all conditions are met.
"""


@dataclass(frozen=True)
class Achiever:
    """An effect of a behaviour, as an achiever of the effect's value.

    `soft` contains the conditions that depend on the state. `determined` maps each variable that stands for the value of a symbol
    to this symbol, that is, to a situation type with argument terms. For a rule, `determining` contains the conditions that
    determine variables. If `deep`, the subgoals of a negated condition include the facts inside nested witnesses.
    """

    behavior: str
    effect: int
    soft: tuple[Condition, ...]
    determined: Mapping[str, tuple[str, tuple[str, ...]]]
    kinds: Mapping[str, str]
    determining: Sequence[Condition] = ()
    rule: bool = False
    deep: bool = False


def determines(condition: Condition, bound: AbstractSet[str]) -> TypeGuard[ValueCondition]:
    """Return whether a condition gives an unbound variable the value of a symbol."""
    return isinstance(condition, ValueCondition) and condition.value.startswith("?") and condition.value not in bound


@dataclass
class BoundProgram:
    """The compiled functions of a program, bound to one table."""

    forward: dict[str, Forward]
    achieving: dict[tuple[str, int], Achieve]


FEW = 8
"""Maximum number of candidates that are all tried; if there are more, one candidate of each symmetry class is tried."""


class Program:
    """The compiled behaviours of one problem, for any table with the same individuals and static facts.

    Parameters
    ----------
    problem : Problem
        The problem; its initial state and goal aren't used.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.domain = problem.domain
        self.members = {kind: frozenset(members) for kind, members in problem.classes.items()}
        self.levels = problem.domain.levels
        self.achievers: dict[tuple[int, str], list[Achiever]] = {}
        self.rules = {name: [self._rule(rule.behavior) for rule in its] for name, its in self.domain.rules.items()}
        self.named = named(problem)
        rules = [rule.behavior for its in self.domain.rules.values() for rule in its]
        self.measures = measures([*self.domain.behaviors.values(), *rules])
        self.symmetry = SymmetryClasses(problem, self.named)
        self.writer = PythonWriter(problem)
        self.variables = self.writer.variables
        self.writer.constants |= {"pick": self._picked}
        self._rules = CompiledRules(self.writer) if self.domain.rules else None
        self._bind = self.writer.function(self._lines(), "forward, achieve", ", few")

    def bind(self, table: Table, few: int = FEW) -> BoundProgram:
        """Return the functions bound to a table.

        If a term has more than `few` candidates, the functions try one candidate of each symmetry class.
        """
        if self._rules is not None:
            self._rules.define(table)
        return BoundProgram(*self._bind(table.now, table.holders, few))

    def _picked(
        self,
        candidates: tuple[str, ...],
        holders: Mapping[str, Mapping[Key, None]],
        few: int,
        now: Mapping[str, Mapping[Key, str]],
    ) -> Sequence[str]:
        if len(candidates) <= few:
            return candidates
        groups = self.symmetry.groups(candidates)
        if len(groups) == len(candidates):
            return candidates  # no two candidates are symmetric
        return self.symmetry.unlike(candidates, representatives(groups, holders, {}), now)

    def size(self, level: int) -> int:
        """Return an upper bound on the number of quantified behaviours of a level."""
        return self.problem.quantified(level)

    def changing(self, level: int) -> list[SituationType]:
        """Return the situation types that effects of a level change, except boolean situation types."""
        situations = self.domain.situations
        names = dict.fromkeys(e.situation for behavior in self.domain.at_level(level) for e in behavior.effects)
        return [situations[name] for name in names if not situations[name].boolean]

    @cached_property
    def rows_of(self) -> Mapping[str, Mapping[str, list[tuple[str, ...]]]]:
        """The tuples of each static relation, indexed by the individuals in the tuple."""
        found: dict[str, dict[str, list[tuple[str, ...]]]] = {}
        for relation, rows in self.problem.relations.items():
            index = found.setdefault(relation, {})
            for row in sorted(rows):
                for individual in dict.fromkeys(row):
                    index.setdefault(individual, []).append(row)
        return found

    # ---------------------------------------------------------------------------------------------------------- source

    def _lines(self) -> Iterator[str]:
        yield "forward, achieve = {}, {}"
        for behavior in self.domain.behaviors.values():
            yield from self.writer.forward(behavior)
            for number in range(len(behavior.every_effect)):
                yield from self._achieve(behavior, number)

    def _achieve(self, behavior: Behavior, number: int) -> Iterator[str]:
        """Yield the lines of the function `achieve` of an effect, and add the effect to the achievers."""
        effect = behavior.every_effect[number]
        name = f"{identifier('achieve', behavior.name)}_{number}"
        inputs = [f"i{i}" for i in range(len(effect.arguments) + 1)]
        waiting = [*effect.when, *behavior.preconditions, *allowed(behavior, self.domain.situations)]
        block = GeneratorFunction(name, inputs)
        bound = self._enumerated(behavior, effect, inputs, waiting, block)
        block.add("unmet = ()")
        soft, determined = self._tested(behavior, waiting, bound, block)
        if isinstance(effect, AmountEffect):
            block.open(f"if {approaches_goal(effect, inputs[-1], self.problem.relations, self.writer.constant)}:")
        names = ", ".join(f"{term!r}: {written(term)}" for term in sorted(bound))
        arguments = tuple_written(written(p.name) for p in behavior.parameters)
        block.add(f"yield {arguments}, unmet, {{{names}}} if unmet else None")
        yield from block.lines
        yield f"achieve[{behavior.name!r}, {number}] = {name}"
        achiever = Achiever(behavior.name, number, tuple(soft), determined, behavior.kinds)
        self.achievers.setdefault((behavior.level, effect.situation), []).append(achiever)

    def _enumerated(
        self,
        behavior: Behavior,
        effect: AnyEffect,
        inputs: Sequence[str],
        waiting: list[Condition],
        block: GeneratorFunction,
    ) -> set[str]:
        """Write loops over the candidates of unbound parameters, with tests on bound terms; return the bound terms.

        The conditions that no behaviour of the level can change are tested, and removed from `waiting`.
        """
        bound: set[str] = set()
        tests: list[str] = []
        outputs = effect.arguments if isinstance(effect, AmountEffect) else (*effect.arguments, effect.value)
        for term, given in zip(outputs, inputs, strict=False):  # the wanted value of an amount is the last input
            if term.startswith("?") and term not in bound:
                bound.add(term)
                block.add(f"{written(term)} = {given}")
                tests.append(self.writer.member(term, behavior.kinds[term]))
            else:
                tests.append(f"{given} == {written(term)}")
        free = [p.name for p in behavior.parameters if p.name not in bound]
        while True:
            for condition in [
                c for c in waiting if self._static(c, behavior.kinds, behavior) and not mentions(c) - bound
            ]:
                waiting.remove(condition)
                tests.append(self.writer.expression(condition, bound, behavior.kinds, behavior.name))
            generator = self._generator(waiting, bound, behavior.kinds, behavior, free)
            if tests:
                block.open(f"if {' and '.join(tests)}:")
            if generator is None:
                return bound
            term, candidates = generator
            block.loop(f"for {written(term)} in {candidates}:", [*inputs, *map(written, sorted(bound))])
            bound.add(term)
            free = [one for one in free if one != term]
            tests = [self.writer.member(term, behavior.kinds[term])]

    def _tested(
        self, behavior: Behavior, waiting: Sequence[Condition], bound: set[str], block: GeneratorFunction
    ) -> tuple[list[Condition], Determined]:
        """Write tests that add the unmet conditions to `unmet`; bind the variables that the state determines.

        Return the conditions in the order of the tests, and the symbol that determines each variable.
        """
        soft: list[Condition] = []
        determined: Determined = {}
        for condition in in_binding_order(waiting, bound, behavior.name):
            if determines(condition, bound):
                # The variable is bound even if the value isn't a member of its class, because later tests use the variable.
                bound.add(condition.value)
                determined[condition.value] = condition.situation, condition.arguments
                block.add(f"{written(condition.value)} = {self.writer.look(condition)}")
                test = self.writer.member(condition.value, behavior.kinds[condition.value])
            else:
                test = self.writer.expression(condition, bound, behavior.kinds, behavior.name)
            block.add(f"if not ({test}): unmet += ({len(soft)},)")
            soft.append(condition)
        return soft, determined

    @staticmethod
    def _rule(rule: Behavior) -> tuple[tuple[str, ...], Achiever]:
        """Return the parameters of a rule, and the rule as an achiever of its situation type.

        The conditions of the achiever are in binding order.
        """
        parameters = tuple(p.name for p in rule.parameters)
        bound, soft = set(parameters), list[Condition]()
        determined: Determined = {}
        determining: list[Condition] = []
        for condition in in_binding_order(rule.preconditions, bound, rule.name):
            soft.append(condition)
            if determines(condition, bound):
                bound.add(condition.value)
                determined[condition.value] = condition.situation, condition.arguments
                determining.append(condition)
        return parameters, Achiever(rule.name, 0, tuple(soft), determined, rule.kinds, determining, True)

    def _generator(
        self,
        waiting: Sequence[Condition],
        hard: set[str],
        kinds: Mapping[str, str],
        behavior: Behavior,
        free: Sequence[str],
    ) -> tuple[str, str] | None:
        """Return the unbound term with the cheapest source of candidates, and an expression for the candidates.

        Return None if no parameter is unbound.
        """
        found: list[tuple[float, str, str]] = []
        for condition in waiting:
            match condition:
                case RelationCondition(relation, arguments, False):
                    unbound = {a for a in arguments if a.startswith("?")} - hard
                    for term in free if len(unbound) == 1 or len(unbound) < len(arguments) else ():
                        if term in unbound and arguments.count(term) == 1:
                            text, fan = self.writer.adjacent(relation, arguments, term, unbound)
                            found.append((fan, term, self._pick(text, term, behavior)))
                case ValueCondition(situation, (term,), value, False) if term.startswith("?") and term not in hard:
                    constant = self.writer.listed(situation, value) and (not value.startswith("?") or value in hard)
                    if constant and not self.changeable(situation, (term,), kinds, behavior):
                        holders = f"{identifier('holders', situation)}.get({written(value)}, ())"
                        found.append((4.0, term, f"list({holders})"))
        for term in free:
            members = self.writer.constant(("members", kinds[term]), self.problem.classes.get(kinds[term], ()))
            found.append((len(self.problem.members(kinds[term])) + 1.0, term, self._pick(members, term, behavior)))
        if not found:
            return None
        _, term, text = min(found, key=lambda entry: entry[0])
        return term, text

    def _pick(self, candidates: str, term: str, behavior: Behavior) -> str:
        """Return an expression for the candidates of a term; many candidates are reduced to a free one of each symmetry class."""
        taken = next((identifier("holders", e.situation) for e in behavior.effects if e.value == term), "{}")
        return f"pick({candidates}, {taken}, few, now)"

    def _static(self, condition: Condition, kinds: Mapping[str, str], behavior: Behavior) -> bool:
        """Return whether no behaviour on the level of `behavior` can change the truth of a condition."""
        match condition:
            case ValueCondition(situation, arguments, _, _):
                return not self.changeable(situation, arguments, kinds, behavior)
            case Witness(variable, kind, conditions):
                return all(self._static(c, {**kinds, variable: kind}, behavior) for c in conditions)
            case Comparison(left, _, right):
                parts = [part for part in (*inside(left), *inside(right)) if isinstance(part, Amount)]
                return not any(self.changeable(part.situation, part.arguments, kinds, behavior) for part in parts)
            case AnyOf(alternatives):
                return all(self._static(c, kinds, behavior) for group in alternatives for c in group)
            case RelationCondition() | ClassCondition() | EqualityCondition():
                return True

    def changeable(
        self, situation: str, arguments: Sequence[str], kinds: Mapping[str, str], behavior: Behavior
    ) -> bool:
        """Return whether an effect on the level of `behavior` can change a symbol whose arguments are the given terms."""
        if situation in self.domain.rules:
            return True  # the rules may depend on a symbol that changes
        here = [self._possible(term, kinds, behavior) for term in arguments]
        for other in self.domain.at_level(behavior.level):
            others = other.kinds
            for effect in other.every_effect:
                if effect.situation == situation:
                    there = [self._possible(term, others, other) for term in effect.arguments]
                    if all(not a.isdisjoint(b) for a, b in zip(here, there, strict=True)):
                        return True
        return False

    def _possible(self, term: str, kinds: Mapping[str, str], behavior: Behavior) -> frozenset[str]:
        """Return the individuals that a term of a behaviour can denote."""
        if not term.startswith("?"):
            return frozenset((term,))
        found = self.problem.members(kinds[term])
        for condition in behavior.preconditions:
            if isinstance(condition, ClassCondition) and condition.term == term:
                kind = self.problem.members(condition.kind)
                found = found - kind if condition.negated else found & kind
        return found


def named(problem: Problem, rests: bool = True) -> list[str]:
    """Return the individuals that behaviours and rules name; if `rests`, also the default values and rest values."""
    every: set[str] = set()
    rules = (rule.behavior for its in problem.domain.rules.values() for rule in its)
    for behavior in (*problem.domain.behaviors.values(), *rules):
        found: dict[str, None] = {}
        for condition in behavior.conditions:
            found.update(dict.fromkeys(term for inner in walk(condition) for term in terms(inner)))
        for effect in behavior.effects:
            found.update(dict.fromkeys((*effect.arguments, effect.value)))
        for change in behavior.amounts:
            found.update(dict.fromkeys((*change.arguments, *terms_of(change.amount))))
        every |= found.keys() - behavior.spread
    for situation in problem.domain.situations.values() if rests else ():
        every |= {value for value in (situation.rest, situation.default) if value is not None}
    return sorted(term for term in every if not term.startswith("?"))
