"""A second reading of `reasoner.symbols`, as slow and as plain as possible: every binding is tried, states are dictionaries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

from reasoner.graph.knowledge import load
from reasoner.reading.problem import read
from reasoner.symbols import (
    FALSE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Problem,
    RelationCondition,
    Symbol,
    ValueCondition,
    Witness,
)

REACH = {"left_hand": (1, 2, 3, 5, 6, 7), "right_hand": (3, 4, 6, 7, 8)}
"""What the hands of the shipped scene reach (PAPER.md section 4), whatever geometry says at the moment."""

Terms = Mapping[str, str]
Facts = dict[Symbol, str]


def complete(problem: Problem) -> Facts:
    """Return the initial state with every boolean symbol in it."""
    state = {
        Symbol(s.name, arguments): FALSE
        for s in problem.domain.situations.values()
        if s.boolean
        for arguments in product(*(problem.classes[kind] for kind in s.arguments))
    }
    return state | dict(problem.initial)


def tabletop() -> Problem:
    """Return the shipped scene with the reach of the paper's plan."""
    problem = read(load("beverage-serving")).problem
    pairs = frozenset((hand, f"location{i}") for hand, places in REACH.items() for i in places)
    return replace(problem, relations={**problem.relations, "canReach": pairs})


def mentioned(conditions: Sequence[Condition]) -> set[str]:
    """Return the variables of conditions, those of a witness left out."""
    found: set[str] = set()
    for c in conditions:
        match c:
            case ValueCondition(_, arguments, value):
                found |= {*arguments, value}
            case RelationCondition(_, arguments):
                found |= {*arguments}
            case ClassCondition(term):
                found |= {term}
            case EqualityCondition(left, right):
                found |= {left, right}
            case Witness(variable, _, inner):
                found |= mentioned(inner) - {variable}
            case AnyOf(alternatives):
                found |= set().union(*(mentioned(group) for group in alternatives))
    return {t for t in found if t.startswith("?")}


def outside(conditions: Sequence[Condition]) -> set[str]:
    """Return the variables that a conjunction itself has to bind: those inside `AnyOf` and `Witness` are their own."""
    return mentioned([c for c in conditions if not isinstance(c, AnyOf | Witness)])


def bindings(problem: Problem, names: set[str], kinds: Terms, terms: Terms) -> Iterator[Terms]:
    free = sorted(names - terms.keys())
    for values in product(*(problem.classes[kinds[name]] for name in free)):
        yield {**terms, **dict(zip(free, values, strict=True))}


def holds(problem: Problem, state: Facts, condition: Condition, terms: Terms, kinds: Terms) -> bool:

    def get(name: str) -> str:
        return terms.get(name, name)

    match condition:
        case ValueCondition(situation, arguments, value, negated):
            symbol = Symbol(situation, tuple(map(get, arguments)))
            return (symbol in state and state[symbol] == get(value)) is not negated
        case RelationCondition(relation, arguments, negated):
            return (tuple(map(get, arguments)) in problem.relations.get(relation, ())) is not negated
        case ClassCondition(term, kind, negated):
            return (get(term) in problem.classes.get(kind, ())) is not negated
        case EqualityCondition(left, right, negated):
            return (get(left) == get(right)) is not negated
        case Witness(variable, kind, inner, negated):
            found = any(
                all(holds(problem, state, c, trial, kinds) for c in inner)
                for m in problem.classes.get(kind, ())
                for trial in bindings(problem, outside(inner), {**kinds, variable: kind}, {**terms, variable: m})
            )
            return found is not negated
        case AnyOf(alternatives, negated):
            found = any(
                all(holds(problem, state, c, trial, kinds) for c in group)
                for group in alternatives
                for trial in bindings(problem, outside(group), kinds, terms)
            )
            return found is not negated


def results(problem: Problem, behavior: Behavior, state: Facts) -> Iterator[tuple[tuple[str, ...], Facts]]:
    """Yield arguments and next state for every way in which a behaviour is applicable."""
    kinds = {t.name: t.kind for t in (*behavior.parameters, *behavior.variables)}
    parameters = [p.name for p in behavior.parameters]
    names = {*parameters, *outside(behavior.preconditions)}
    for terms in bindings(problem, names, kinds, {}):
        if not all(holds(problem, state, c, terms, kinds) for c in behavior.preconditions):
            continue
        after = dict(state)
        for effect in sorted(behavior.effects, key=lambda e: e.value != FALSE):
            for trial in bindings(problem, outside(effect.when), kinds, terms):
                if all(holds(problem, state, c, trial, kinds) for c in effect.when):
                    symbol = Symbol(effect.situation, tuple(trial.get(a, a) for a in effect.arguments))
                    if symbol in state:
                        after[symbol] = trial.get(effect.value, effect.value)
        yield tuple(terms[name] for name in parameters), after


def wanted(problem: Problem, state: Facts) -> bool:
    return all(state.get(symbol, FALSE if value == FALSE else None) == value for symbol, value in problem.goal.items())
