"""A second, slow and plain interpreter of `confab.reasoner.symbols`: it tries every binding, and states are dictionaries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, meets, written
from confab.reasoner.derivation import strata
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    Symbol,
    ValueCondition,
    Witness,
)

REACH = {"left_hand": (1, 2, 3, 5, 6, 7), "right_hand": (3, 4, 6, 7, 8)}
"""The places that the hands of the shipped scene reach (PAPER.md section 4), independently of the computed geometry."""

Terms = Mapping[str, str]
Facts = dict[Symbol, str]


def complete(problem: Problem) -> Facts:
    """Return the initial state with a value for every boolean symbol."""
    state = {
        Symbol(s.name, arguments): FALSE
        for s in problem.domain.situations.values()
        if s.boolean
        for arguments in product(*(problem.classes[kind] for kind in s.arguments))
    }
    return with_derived(problem, state | dict(problem.initial))


def with_derived(problem: Problem, state: Facts) -> Facts:
    """Return a state with all derived facts; each group of mutually dependent definitions starts from the empty set."""
    found = {symbol: FALSE if symbol.situation in problem.domain.rules else value for symbol, value in state.items()}
    for group in strata(problem.domain.rules):
        before = None
        while found != before:
            before = dict(found)
            for rule in (rule for name in group for rule in problem.domain.rules[name]):
                kinds = {t.name: t.kind for t in (*rule.parameters, *rule.variables)}
                names = {*(p.name for p in rule.parameters), *outside(rule.conditions)}
                for terms in bindings(problem, names, kinds, {}):
                    symbol = Symbol(rule.situation, tuple(terms[p.name] for p in rule.parameters))
                    if symbol in found and all(holds(problem, before, c, terms, kinds) for c in rule.conditions):
                        found[symbol] = TRUE
    return found


def tabletop() -> Problem:
    """Return the shipped scene with the reach facts of the paper's plan."""
    problem = read(load("beverage-serving")).problem
    pairs = frozenset((hand, f"location{i}") for hand, places in REACH.items() for i in places)
    return replace(problem, relations={**problem.relations, "canReach": pairs})


def mentioned(conditions: Sequence[Condition]) -> set[str]:
    """Return the variables of conditions, without the variables inside a witness."""
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
            case Comparison(left, _, right):
                found |= named(left) | named(right)
    return {t for t in found if t.startswith("?")}


def named(expression: Expression) -> set[str]:
    match expression:
        case Calculation(_, left, right):
            return named(left) | named(right)
        case Amount(_, arguments) | Measure(_, arguments):
            return {*arguments}
        case Fraction():
            return set()


def worth(problem: Problem, state: Facts, expression: Expression, terms: Terms) -> Fraction | None:
    """Return the value of an expression, or None if the expression or a part of it has no value."""
    match expression:
        case Amount(situation, arguments):
            said = state.get(Symbol(situation, tuple(terms.get(a, a) for a in arguments)))
            return None if said is None else Fraction(said)
        case Measure(relation, arguments):
            key = tuple(terms.get(a, a) for a in arguments)
            return next((Fraction(row[-1]) for row in problem.relations.get(relation, ()) if row[:-1] == key), None)
        case Calculation(sign, left, right):
            a, b = worth(problem, state, left, terms), worth(problem, state, right, terms)
            if a is None or b is None or (sign == "/" and b == 0):
                return None
            return a + b if sign == "+" else a - b if sign == "-" else a * b if sign == "*" else a / b
        case Fraction():
            return expression


def outside(conditions: Sequence[Condition]) -> set[str]:
    """Return the variables that a conjunction must bind; variables inside `AnyOf` and `Witness` are local."""
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
        case Comparison(left, sign, right, negated):
            a, b = worth(problem, state, left, terms), worth(problem, state, right, terms)
            if a is None or b is None:
                return negated
            signs = {"<" if a < b else ">" if a > b else "="}
            return (sign[0] in signs or sign[1:] in signs) is not negated


def results(problem: Problem, behavior: Behavior, state: Facts) -> Iterator[tuple[tuple[str, ...], Facts]]:
    """Yield the arguments and the next state for every binding with which a behaviour is applicable."""
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
        if not amounts(problem, behavior, state, terms, kinds, after):
            continue
        yield tuple(terms[name] for name in parameters), with_derived(problem, after)


def amounts(problem: Problem, behavior: Behavior, state: Facts, terms: Terms, kinds: Terms, after: Facts) -> bool:
    """Change the amounts in `after`; return whether all new amounts are valid."""
    changed: dict[Symbol, Fraction | None] = {}
    for operations in (("assign",), ("scale",), ("increase", "decrease")):
        for effect in behavior.amounts:
            if effect.operation not in operations:
                continue
            for trial in bindings(problem, outside(effect.when), kinds, terms):
                symbol = Symbol(effect.situation, tuple(trial.get(a, a) for a in effect.arguments))
                if symbol not in state or not all(holds(problem, state, c, trial, kinds) for c in effect.when):
                    continue
                old, by = changed.get(symbol, Fraction(state[symbol])), worth(problem, state, effect.amount, trial)
                if old is None or by is None:
                    changed[symbol] = None
                    continue
                new = {"assign": by, "scale": old * by, "increase": old + by, "decrease": old - by}
                changed[symbol] = new[effect.operation]
    for symbol, amount in changed.items():
        limits = problem.domain.situations[symbol.situation].quantity
        if amount is None or limits is None or (limits.whole and amount.denominator != 1):
            return False
        if (limits.least is not None and amount < limits.least) or (limits.most is not None and amount > limits.most):
            return False
        if max(abs(amount.numerator), amount.denominator) > 10**60:
            return False
        after[symbol] = written(amount)
    return True


def wanted(problem: Problem, state: Facts) -> bool:
    return all(
        meets(state.get(symbol, FALSE if value == FALSE else None), value) for symbol, value in problem.goal.items()
    )
