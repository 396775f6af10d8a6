"""Behaviours made executable: which are applicable in a state, and what they make of it.

A state is a tuple of values, one per symbol, in the order of `Model.symbols`. Conditions are compiled once into closures
``test(values, bindings) -> bool``; a value condition whose value is an unbound variable binds it (it is determined by the
state), so conditions are put in an order in which everything that they need is bound before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from planner.language import DomainError, mentions, needs, nothing_determines
from reasoner.symbols import (
    FALSE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    GroundBehavior,
    Parameter,
    Problem,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

Values = tuple[str, ...]
Bindings = dict[str, str]
Test = Callable[[Values, Bindings], bool]


@dataclass(frozen=True)
class Applied:
    """A ground behaviour that is applicable, the individuals of its variables, and the state that it leads to."""

    ground: GroundBehavior
    bindings: Mapping[str, str]
    after: Values


class Model:
    """The compiled behaviours of one problem.

    Parameters
    ----------
    problem : Problem
        Its `initial` gives the symbols; boolean symbols are completed.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.symbols = _symbols(problem)
        self.first_levels = tuple(map(problem.first_level, self.symbols))
        self.index = {(s.situation, s.arguments): i for i, s in enumerate(self.symbols)}
        self._compiled = {name: self._compile(b) for name, b in problem.domain.behaviors.items()}

    def values(self, state: State) -> Values:
        """Return a state as the tuple that search works on."""
        return tuple(state.get(symbol, FALSE) for symbol in self.symbols)

    def state(self, values: Values) -> dict[Symbol, str]:
        """Return a tuple of values as a state."""
        return dict(zip(self.symbols, values, strict=True))

    def apply(self, ground: GroundBehavior, values: Values) -> Applied | None:
        """Return what a ground behaviour does in a state, or None if it isn't applicable there."""
        parameters, tests, effects = self._compiled[ground.behavior]
        bindings = dict(zip(parameters, ground.arguments, strict=True))
        if not all(test(values, bindings) for test in tests):
            return None
        after = list(values)
        for effect in effects:
            effect(values, bindings, after)
        variables = {name: value for name, value in bindings.items() if name not in parameters}
        return Applied(ground, {name[1:]: value for name, value in sorted(variables.items())}, tuple(after))

    def successors(self, grounds: Sequence[GroundBehavior], values: Values) -> Iterator[Applied]:
        """Yield what each applicable one of the ground behaviours does, in their order."""
        for ground in grounds:
            applied = self.apply(ground, values)
            if applied is not None and applied.after != values:
                yield applied

    # ------------------------------------------------------------------------------------------------------- compiling

    def _compile(self, behavior: Behavior) -> tuple[tuple[str, ...], list[Test], list[Callable[..., None]]]:
        kinds = behavior.kinds
        parameters = tuple(parameter.name for parameter in behavior.parameters)
        bound = set(parameters)
        tests = self._conjunction(behavior.preconditions, bound, kinds, behavior.name)
        effects = [self._effect(effect, set(bound), kinds, behavior.name) for effect in behavior.effects]
        return parameters, tests, effects

    def _conjunction(
        self, conditions: Sequence[Condition], bound: set[str], kinds: Mapping[str, str], where: str
    ) -> list[Test]:
        """Compile conditions in an order that binds before it uses; `bound` grows by what they determine."""
        tests, waiting = [], list(conditions)
        while waiting:
            # A nested condition waits for every variable that another one may still determine; else it determines its own.
            ready = next(
                (c for c in waiting if not (mentions(c) if isinstance(c, Witness | AnyOf) else needs(c)) - bound), None
            )
            ready = ready or next((c for c in waiting if not needs(c) - bound), None)
            if ready is None:
                raise nothing_determines(where, waiting, bound)
            waiting.remove(ready)
            tests.append(self._condition(ready, bound, kinds, where))
        return tests

    def _condition(self, condition: Condition, bound: set[str], kinds: Mapping[str, str], where: str) -> Test:
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                if value.startswith("?") and value not in bound:
                    bound.add(value)
                    return self._binding(situation, arguments, value, self._members(kinds[value]))
                return self._value(situation, arguments, value, negated)
            case RelationCondition(relation, arguments, negated):
                tuples = self.problem.relations.get(relation, frozenset())
                return lambda _, b: (tuple(b.get(a, a) for a in arguments) in tuples) is not negated
            case ClassCondition(term, kind, negated):
                instances = self._members(kind)
                return lambda _, b: (b.get(term, term) in instances) is not negated
            case EqualityCondition(left, right, negated):
                return lambda _, b: (b.get(left, left) == b.get(right, right)) is not negated
            case Witness(variable, kind, conditions, negated):
                inner = self._conjunction(conditions, bound | {variable}, {**kinds, variable: kind}, where)
                members = self.problem.classes.get(kind, ())
                return lambda v, b: (
                    any(all(test(v, trial) for test in inner) for trial in ({**b, variable: m} for m in members))
                    is not negated
                )
            case AnyOf(alternatives, negated):
                groups = [self._conjunction(group, set(bound), kinds, where) for group in alternatives]
                return lambda v, b: (
                    any(all(test(v, trial) for test in group) for group in groups for trial in [dict(b)]) is not negated
                )

    def _value(self, situation: str, arguments: tuple[str, ...], value: str, negated: bool) -> Test:
        index = self.index

        def test(values: Values, b: Bindings) -> bool:
            i = index.get((situation, tuple(b.get(a, a) for a in arguments)))
            return (i is not None and values[i] == b.get(value, value)) is not negated

        return test

    def _binding(self, situation: str, arguments: tuple[str, ...], variable: str, members: frozenset[str]) -> Test:
        index = self.index

        def test(values: Values, b: Bindings) -> bool:
            i = index.get((situation, tuple(b.get(a, a) for a in arguments)))
            if i is None or values[i] not in members:
                return False
            b[variable] = values[i]
            return True

        return test

    def _effect(
        self, effect: ValueEffect, bound: set[str], kinds: Mapping[str, str], where: str
    ) -> Callable[[Values, Bindings, list[str]], None]:
        when = self._conjunction(effect.when, bound, kinds, where)
        unbound = {t for t in (*effect.arguments, effect.value) if t.startswith("?")} - bound
        if unbound:
            raise DomainError(f"{where}: nothing determines {', '.join(sorted(unbound))}, which an effect names")

        def change(values: Values, b: Bindings, after: list[str]) -> None:
            trial = dict(b) if when else b
            if all(test(values, trial) for test in when):
                i = self.index.get((effect.situation, tuple(trial.get(a, a) for a in effect.arguments)))
                if i is not None:
                    after[i] = trial.get(effect.value, effect.value)

        return change

    def _members(self, kind: str) -> frozenset[str]:
        return frozenset(self.problem.classes.get(kind, ()))


def _symbols(problem: Problem) -> tuple[Symbol, ...]:
    """Return every symbol of the problem, in a fixed order."""
    found = set(problem.initial)
    for situation in problem.domain.situations.values():
        if situation.boolean:
            kinds = (problem.classes.get(kind, ()) for kind in situation.arguments)
            found |= {Symbol(situation.name, arguments) for arguments in product(*kinds)}
    return tuple(sorted(found))


def ground(problem: Problem, level: int) -> tuple[GroundBehavior, ...]:
    """Return all quantified behaviours of a level in the order of their IDs.

    The same set as the SPARQL queries of `reasoner.reading.quantification` yield, from the classes read once (tested equal).
    """
    found: list[GroundBehavior] = []
    number = problem.domain.first_ids.get(level, 0)
    for behavior in problem.domain.at_level(level):
        for arguments in product(*(_of(problem, parameter) for parameter in behavior.parameters)):
            found.append(GroundBehavior(number + len(found), behavior.name, arguments))
    return tuple(found)


def _of(problem: Problem, parameter: Parameter) -> tuple[str, ...]:
    return problem.classes.get(parameter.kind, ())
