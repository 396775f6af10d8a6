"""Is this a plan? A checker that shares no code with any search, and reads conditions as they are written.

A behaviour's preconditions hold if *some* individuals, put in for its variables, satisfy them all; the checker tries them
(most-determined condition first) instead of compiling an order as the planners do. States are plain mappings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from planner.plan import Plan, Step
from reasoner.symbols import (
    FALSE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Problem,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
    Witness,
)


@dataclass(frozen=True)
class Fault:
    """What is wrong with a plan: where in the tree (empty for the whole), and what."""

    path: tuple[int, ...]
    text: str


def validate(problem: Problem, plan: Plan) -> list[Fault]:
    """Return what is wrong with a plan; nothing if it is one.

    Checked are: every step's ID; on each level, every step's preconditions in the state in which it is done; that the
    refinement of a step makes exactly the changes of that step, as far as its level knows the symbols; and the goal.
    """
    state = dict(problem.initial)
    faults = list(_steps(problem, plan.steps, state))
    for symbol, wanted in problem.goal.items():
        got = state.get(symbol, FALSE)
        if got != wanted:
            faults.append(Fault((), f"the goal {symbol} = {wanted} isn't reached: it is {got} in the end"))
    return faults


def _steps(problem: Problem, steps: Sequence[Step], state: dict[Symbol, str]) -> Iterator[Fault]:
    """Yield the faults of steps done in order; `state` is changed to what they lead to."""
    for step in steps:
        behavior = problem.domain.behaviors.get(step.behavior)
        if behavior is None or not _fits(problem, behavior, step.arguments):
            yield Fault(step.path, f"{step}: no such behaviour, or its parameters don't take these arguments")
            return
        expected_id = problem.id_of(step.behavior, step.arguments)
        if step.id != expected_id:
            yield Fault(step.path, f"{step}: its ID by the numbering of level {behavior.level} is {expected_id}")
        after = successor(problem, behavior, step.arguments, state)
        if after is None:
            yield Fault(step.path, f"{step}: its preconditions don't hold where it is done")
            return
        if step.steps:
            yield from _steps(problem, step.steps, state)
            for symbol in sorted(after):
                known = problem.domain.situations[symbol.situation].level <= behavior.level
                got = state.get(symbol, FALSE)
                if known and got != after[symbol]:
                    yield Fault(step.path, f"{step}: its refinement leaves {symbol} = {got}, not {after[symbol]}")
        else:
            state.clear()
            state.update(after)


def successor(problem: Problem, behavior: Behavior, arguments: Sequence[str], state: State) -> dict[Symbol, str] | None:
    """Return the state after a behaviour, or None if its preconditions don't hold."""
    bindings = {p.name: a for p, a in zip(behavior.parameters, arguments, strict=True)}
    kinds = {p.name: p.kind for p in (*behavior.parameters, *behavior.variables)}
    if not _fits(problem, behavior, arguments):
        return None
    satisfied = next(_assignments(problem, list(behavior.preconditions), state, bindings, kinds), None)
    if satisfied is None:
        return None
    after = dict(state)
    for effect in sorted(behavior.effects, key=lambda e: e.value != FALSE):  # what becomes true wins, as in PDDL
        for trial in _assignments(problem, list(effect.when), state, satisfied, kinds):
            symbol = Symbol(effect.situation, tuple(trial.get(a, a) for a in effect.arguments))
            value = trial.get(effect.value, effect.value)
            if symbol in after or problem.domain.situations[effect.situation].boolean:
                after[symbol] = value
            break
    return after


def _fits(problem: Problem, behavior: Behavior, arguments: Sequence[str]) -> bool:
    return len(arguments) == len(behavior.parameters) and all(
        argument in problem.classes.get(parameter.kind, ())
        for parameter, argument in zip(behavior.parameters, arguments, strict=True)
    )


def _assignments(
    problem: Problem,
    conditions: list[Condition],
    state: State,
    bindings: Mapping[str, str],
    kinds: Mapping[str, str],
) -> Iterator[dict[str, str]]:
    """Yield the assignments of variables, beyond `bindings`, under which all conditions hold."""
    if not conditions:
        yield dict(bindings)
        return
    condition = min(conditions, key=lambda c: len(_free(c) - bindings.keys()))
    rest = [c for c in conditions if c is not condition]
    unknown = sorted(_free(condition) - bindings.keys())
    if not unknown:
        if _holds(problem, condition, state, bindings, kinds):
            yield from _assignments(problem, rest, state, bindings, kinds)
        return
    variable = unknown[0]
    candidates = problem.classes.get(kinds[variable], ())
    if isinstance(condition, ValueCondition) and not condition.negated and unknown == [condition.value]:
        symbol = Symbol(condition.situation, tuple(bindings.get(a, a) for a in condition.arguments))
        candidates = tuple(value for value in [state.get(symbol)] if value in candidates)  # no other can satisfy it
    for candidate in candidates:
        yield from _assignments(problem, conditions, state, {**bindings, variable: candidate}, kinds)


def _holds(
    problem: Problem, condition: Condition, state: State, bindings: Mapping[str, str], kinds: Mapping[str, str]
) -> bool:
    def of(term: str) -> str:
        return bindings.get(term, term)

    match condition:
        case ValueCondition(situation, arguments, value, negated):
            symbol = Symbol(situation, tuple(map(of, arguments)))
            default = FALSE if problem.domain.situations[situation].boolean else None
            return (state.get(symbol, default) == of(value)) != negated
        case RelationCondition(relation, arguments, negated):
            return (tuple(map(of, arguments)) in problem.relations.get(relation, frozenset())) != negated
        case ClassCondition(term, kind, negated):
            return (of(term) in problem.classes.get(kind, ())) != negated
        case EqualityCondition(left, right, negated):
            return (of(left) == of(right)) != negated
        case Witness(variable, kind, conditions, negated):
            inner_kinds = {**kinds, variable: kind}
            found = any(
                _satisfiable(problem, conditions, state, {**bindings, variable: one}, inner_kinds)
                for one in problem.classes.get(kind, ())
            )
            return found != negated
        case AnyOf(alternatives, negated):
            return any(_satisfiable(problem, group, state, bindings, kinds) for group in alternatives) != negated


def _satisfiable(
    problem: Problem,
    conditions: Sequence[Condition],
    state: State,
    bindings: Mapping[str, str],
    kinds: Mapping[str, str],
) -> bool:
    return next(_assignments(problem, list(conditions), state, bindings, kinds), None) is not None


def _free(condition: Condition) -> set[str]:
    """Return the variables of a condition that a witness inside it doesn't bind; those of alternatives are their own."""
    match condition:
        case ValueCondition(_, arguments, value):
            terms = {*arguments, value}
        case RelationCondition(_, arguments):
            terms = set(arguments)
        case ClassCondition(term):
            terms = {term}
        case EqualityCondition(left, right):
            terms = {left, right}
        case Witness(variable, _, conditions):
            terms = set().union(*(_free(c) for c in conditions)) - {variable}
        case AnyOf(alternatives):
            terms = set().union(*(_free(c) for group in alternatives for c in group))
    return {term for term in terms if term.startswith("?")}
