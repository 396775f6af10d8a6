"""Validation rules on behaviours: undetermined variables, unreachable values, and effects without a refinement."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence, Set

from confab.reasoner.amounts import terms_of
from confab.reasoner.closure import closure
from confab.reasoner.language import mentions, substituted
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import some_of
from confab.reasoner.sentences import plain
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    Condition,
    Span,
    ValueCondition,
    ValueEffect,
    Witness,
)
from confab.reasoner.timing import timing_of
from confab.reasoner.validation.case import Fault, ReadCase
from confab.reasoner.validation.contradictions import dead
from confab.reasoner.validation.quantities import some

EVERY = "?each"
"""Name of the variable that stands for the members of a class in a condition (`confab.reasoner.reading.parts`)."""
EVERY_OTHER = re.compile(r"\?each\d")
"""Pattern of the names of variables that stand for the members of another class in a condition."""


def undetermined_variables(case: ReadCase) -> Iterator[Fault]:
    """Find variables in effects or negated conditions that no positive condition determines."""
    for name, behavior in case.behaviors_and_rules:
        node = case.names.iri(name)
        bound = {parameter.name for parameter in behavior.parameters}
        free = _undetermined(behavior.preconditions, bound)
        for effect in behavior.every_effect:
            inner = set(bound)
            free |= _undetermined(effect.when, inner)
            named = terms_of(effect.amount) if isinstance(effect, AmountEffect) else (effect.value,)
            free |= {term for term in (*effect.arguments, *named) if term.startswith("?")} - inner
        for variable in sorted(free):
            yield (
                node,
                f"nothing determines the variable {variable[1:]} of {name}",
                "a variable gets its individual from a value condition that isn't negated",
                f"add a value condition with the value {variable[1:]}, make {variable[1:]} a parameter, or make it the "
                "variable of an existential condition (c:Witness)",
            )


def _undetermined(conditions: Sequence[Condition], bound: set[str]) -> set[str]:
    """Return the undetermined variables of a conjunction, and add the determined variables to `bound`."""
    waiting = list(conditions)
    progress = True
    while progress:
        progress = False
        for condition in list(waiting):
            if not isinstance(condition, ValueCondition) or condition.negated:
                continue
            if {term for term in condition.arguments if term.startswith("?")} <= bound:
                bound |= {condition.value} if condition.value.startswith("?") else set()
                waiting.remove(condition)
                progress = True
    free: set[str] = set()
    for condition in waiting:
        match condition:
            case Witness(variable, _, inner):
                free |= _undetermined(inner, bound | {variable})
            case AnyOf(alternatives):
                free |= set().union(*(_undetermined(group, set(bound)) for group in alternatives))
            case _:
                free |= mentions(condition) - bound
    return free


def other_kinds_in_when(case: ReadCase) -> Iterator[Fault]:
    """Find effects on all members of one class whose conditions `when` concern all members of another class.

    Only classes that have common members are reported.
    """
    problem = case.problem
    for name, behavior in problem.domain.behaviors.items():
        for effect in behavior.every_effect:
            for condition in effect.when:
                if not isinstance(condition, Witness) or not EVERY_OTHER.match(condition.variable):
                    continue
                kind = condition.kind
                if problem.members(kind) & {*effect.arguments}:
                    yield (
                        case.names.iri(name),
                        f"{name} changes {effect.situation} of all individuals of a class, under a condition on all "
                        f"individuals of {kind}",
                        "in c:when, the effect's class denotes the changed individual, but another class denotes all of its "
                        "individuals",
                        "if the condition is about the changed individual, name the effect's class in the condition, and "
                        f"add a class condition on {kind}",
                    )


def every_member_required(case: ReadCase) -> Iterator[Fault]:
    """Find behaviours that change all members of a class, and have a precondition on all members of the same class."""
    problem = case.problem
    for name, behavior in problem.domain.behaviors.items():
        changed = {argument for effect in behavior.every_effect for argument in effect.arguments}
        for condition in behavior.preconditions:
            if not isinstance(condition, Witness) or condition.variable != EVERY or not condition.negated:
                continue
            members = problem.members(condition.kind)
            if len(members) > 1 and members <= changed:
                yield (
                    case.names.iri(name),
                    f"{name} changes all individuals of {condition.kind}, and is applicable only if a condition holds of all of "
                    "them",
                    "a class in a precondition, or in the WHERE of the first operation of an update, denotes all of its "
                    "individuals; only in the condition of an effect it denotes the changed individual",
                    "if only individuals that satisfy the condition shall change, move the condition to c:when of the effect; "
                    "in an update, move it with the effect to a further operation after a semicolon",
                )


def unreachable_behaviors(case: ReadCase) -> Iterator[Fault]:
    """Find values that behaviours or goals require, although they are neither initial values nor values of an effect.

    If a value is unreachable only because another value is unreachable, one finding reports both values. A behaviour for which
    the scene has no objects isn't reported, because the behaviour belongs to other scenes.
    """
    if not case.problem.initial:
        return
    problem, names = case.problem, case.names
    contradictory = dead(problem)
    there = _there_at_first(problem)
    waiting = {name: b for name, b in problem.domain.behaviors.items() if name not in contradictory}
    given = {name: _given(b, problem) for name, b in problem.domain.behaviors.items()}
    while ready := [b for b in waiting.values() if all(_possible(c, b, problem, there) for c in b.preconditions)]:
        for behavior in ready:
            del waiting[behavior.name]
            there |= given[behavior.name]
    applicable = {name: b for name, b in waiting.items() if all(problem.members(p.kind) for p in b.parameters)}
    lacking = {
        name: [c for c in b.preconditions if not _possible(c, b, problem, there)] for name, b in applicable.items()
    }
    wanted = {
        (symbol.situation, value): symbol
        for symbol, value in problem.goal.items()
        if problem.domain.situations[symbol.situation].quantity is None  # amounts are checked by another rule
        and problem.initial.get(symbol, FALSE) != value
        and (symbol.situation, value) not in there
    }
    needs = {
        name: {
            other
            for condition in conditions
            for other in (*waiting, *contradictory)
            if _possible(condition, problem.domain.behaviors[name], problem, there | given[other])
        }
        for name, conditions in lacking.items()
    }
    why = "neither the initial situation nor any behaviour gives a value that its precondition requires"
    mend = "add a behaviour with that effect, state it in the scene, or drop the precondition"
    for group in _first(needs):
        first, *others = [name for name in problem.domain.behaviors if name in group]
        conditions = dict.fromkeys(
            _words(c, problem.domain.behaviors[name]) for name in (first, *others) for c in lacking[name]
        )
        later = [name for name in waiting if name not in group and not group.isdisjoint(_reached(name, needs))]
        more = f"; so neither can {some([*others, *later])}" if others or later else ""
        yield (
            names.iri(first),
            f"{first} is never applicable: no behaviour achieves {'; '.join(conditions)}{more}",
            why,
            mend,
        )
    for (situation, value), symbol in wanted.items():
        if any((situation, value) in given[name] for name in (*waiting, *contradictory)):
            continue  # the finding on the behaviour reports the value
        yield (
            names.iri(symbol.arguments[0]),
            f"the goal {symbol} = {value} can't be achieved: no behaviour gives this value",
            "neither the initial situation nor any behaviour gives that value",
            "add a behaviour with that effect, or drop the goal",
        )


def _there_at_first(problem: Problem) -> set[tuple[str, str]]:
    """Return the pairs (situation type, value) that hold initially, or that may come to hold without a behaviour."""
    there = {(symbol.situation, value) for symbol, value in problem.initial.items()}
    there |= {(s.name, FALSE) for s in problem.domain.situations.values() if s.boolean}
    changed = frozenset[str]().union(*(behavior.changes for behavior in problem.domain.behaviors.values()))
    for situation in problem.domain.situations.values():
        # Symbols that no behaviour changes may have other causes of change; situation types without objects are
        # ignored.
        present = all(problem.classes.get(kind) for kind in situation.arguments)
        if situation.name not in changed or not present:
            there |= {(situation.name, value) for value in problem.classes.get(situation.range, ())}
            there |= {(situation.name, TRUE)} if situation.boolean else set()
    return there


def _given(behavior: Behavior, problem: Problem) -> set[tuple[str, str]]:
    """Return the (situation type, value) pairs that a behaviour can make true at its start or end."""
    effects = [*behavior.effects, *(e for e in timing_of(behavior).made(Span.START) if isinstance(e, ValueEffect))]
    return {(e.situation, value) for e in effects for value in _individuals(e.value, behavior, problem)}


def _reached(name: str, needs: Mapping[str, Set[str]]) -> set[str]:
    """Return the behaviours that a behaviour needs, directly or indirectly."""
    return closure(needs.get(name, ()), lambda each: needs.get(each, ()))


def _first(needs: Mapping[str, Set[str]]) -> Iterator[set[str]]:
    """Yield each group of behaviours that need only each other; the other findings are consequences of these groups."""
    seen = set[str]()
    for name in needs:
        reached = _reached(name, needs) | {name}
        if name in seen or not reached <= needs.keys():
            continue  # the group needs a behaviour with contradictory conditions, which another rule reports
        if all(name in _reached(other, needs) for other in reached - {name}):
            seen |= reached
            yield reached


def _possible(condition: Condition, behavior: Behavior, problem: Problem, there: set[tuple[str, str]]) -> bool:
    match condition:
        case ValueCondition(situation, _, value, False):
            values = _individuals(value, behavior, problem)
            return not values or any((situation, v) in there for v in values)
        case Witness(_, _, inner, False):
            return all(_possible(c, behavior, problem, there) for c in inner)
        case AnyOf(alternatives, False) if alternatives:
            return any(all(_possible(c, behavior, problem, there) for c in group) for group in alternatives)
        case _:
            return True


def _individuals(term: str, behavior: Behavior, problem: Problem) -> Sequence[str]:
    """Return the individuals that a term can denote; return no individual for a variable bound inside a condition."""
    if not term.startswith("?"):
        return (term,)
    kinds = behavior.kinds
    return problem.classes.get(kinds.get(term, ""), ())


def _words(condition: Condition, behavior: Behavior) -> str:
    """Return a condition in words, with classes substituted for variables."""
    kinds = {term: f"some {kind.replace('|', ' or ')}" for term, kind in behavior.kinds.items()}
    return plain(substituted(condition, kinds))


def gaps_of_values(case: ReadCase) -> Iterator[Fault]:
    """Find effects of a level whose value isn't given by any behaviour of the next level.

    Effects on situation types that the next level never changes aren't reported.
    """
    problem, names = case.problem, case.names
    leads: dict[tuple[int, str], set[str]] = defaultdict(set)
    for behavior in problem.domain.behaviors.values():
        for effect in behavior.effects:
            leads[behavior.level, effect.situation].update(_individuals(effect.value, behavior, problem))
    for behavior in problem.domain.behaviors.values():
        level = behavior.level + 1
        for effect in behavior.effects:
            values, finer = _individuals(effect.value, behavior, problem), leads.get((level, effect.situation))
            if values and finer and finer.isdisjoint(values):
                kind = behavior.kinds.get(effect.value)
                said = f"a {kind}" if kind else effect.value
                yield (
                    names.iri(behavior.name),
                    f"{behavior.name} on level {behavior.level} gives {effect.situation} {said} as its value, "
                    f"but no behaviour of level {level} does so",
                    "a refinement has to reach the same value with behaviours of the next level, so the behaviour can't be refined",
                    f"add a behaviour of level {level} with that effect, or let a parameter of a behaviour with such an "
                    "effect have a wider class",
                )


def crowded_places(case: ReadCase) -> Iterator[Fault]:
    """Find individuals that initially share a value, although behaviours give the value only if no individual has it."""
    problem, names = case.problem, case.names
    asks: dict[tuple[str, str], set[str]] = {}  # for each value, the classes whose members must not have the value
    for behavior in problem.domain.behaviors.values():
        for effect in behavior.effects:
            free = {kind for c in behavior.preconditions if (kind := _none_has(c, effect))}
            for value in _individuals(effect.value, behavior, problem):
                given = effect.situation, value
                asks[given] = asks.get(given, free) & free
    holders: dict[tuple[str, str], list[str]] = defaultdict(list)
    for symbol, value in sorted(problem.initial.items()):
        perceived = problem.domain.situations[symbol.situation].perceived
        if perceived is not None and perceived.exclusive:
            continue  # `confab.reasoner.validation.contradictions` reports an error
        if len(symbol.arguments) == 1 and asks.get((symbol.situation, value)):
            holders[symbol.situation, value].append(symbol.arguments[0])
    for (situation, value), individuals in holders.items():
        for kind in sorted(asks[situation, value]):
            several = [one for one in individuals if one in problem.classes.get(kind, ())]
            if len(several) > 1:
                yield (
                    names.iri(several[1]),
                    f"the initial {situation} of {some_of(several, 5)} is {value}, but behaviours that give this value require "
                    f"that no {kind} has it yet",
                    "no behaviour leads to such a situation, so it is probably unintended",
                    f"state another {situation} for all but one of them, or remove that precondition",
                )


def _none_has(condition: Condition, effect: ValueEffect) -> str:
    """Return the class in a condition "no member of the class has the effect's value", or an empty text for other conditions."""
    match condition:
        case Witness(variable, kind, (ValueCondition(situation, (about,), value, False),), True):
            same = (situation, about, value) == (effect.situation, variable, effect.value)
            return kind if same and value.startswith("?") else ""
        case _:
            return ""
