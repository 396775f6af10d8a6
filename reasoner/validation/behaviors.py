"""Rules of what behaviours ask and change: what can't be determined, chosen, reached or refined."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence

from reasoner.amounts import terms_of
from reasoner.language import mentions
from reasoner.symbols import (
    FALSE,
    AmountEffect,
    AnyOf,
    Behavior,
    Condition,
    Problem,
    ValueCondition,
    ValueEffect,
    Witness,
)
from reasoner.validation.case import Case, Fault

EVERY_OTHER = re.compile(r"\?each\d")
"""Who a class stands for where another one stands for somebody already (`reasoner.reading.parts`)."""


def undetermined_variables(case: Case) -> Iterator[Fault]:
    """Find variables that an effect or a negated condition names and that nothing determines."""
    if case.reading is None:
        return
    domain = case.reading.problem.domain
    rules = [(name, rule.behavior) for name, its in domain.rules.items() for rule in its]
    for name, behavior in (*domain.behaviors.items(), *rules):
        node = case.reading.names.iri(name)
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
                "a variable gets its individual from the situation: from a value condition that isn't negated",
                f"add a value condition whose value is {variable[1:]}, make it a parameter, or seek it with a witness",
            )


def _undetermined(conditions: Sequence[Condition], bound: set[str]) -> set[str]:
    """Return the variables that stay free in a conjunction; what it determines is added to `bound`."""
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


def other_kinds_in_when(case: Case) -> Iterator[Fault]:
    """Find effects on all of a class whose `when` asks something of all of another one that shares individuals with it."""
    if case.reading is None:
        return
    problem = case.reading.problem
    for name, behavior in problem.domain.behaviors.items():
        for effect in behavior.every_effect:
            for condition in effect.when:
                if not isinstance(condition, Witness) or not EVERY_OTHER.match(condition.variable):
                    continue
                kind = condition.kind
                if problem.members(kind) & {*effect.arguments}:
                    yield (
                        case.reading.names.iri(name),
                        f"{name} changes {effect.situation} of each of a class where something is so of every {kind}",
                        f"in :when only the effect's own class means the same individual; {kind} means all of its individuals",
                        f"name the effect's class there, and ask by a class condition that it is a {kind}",
                    )


def unreachable_behaviors(case: Case) -> Iterator[Fault]:
    """Find behaviours that ask for a value which is neither there at first nor the effect of any behaviour."""
    if case.reading is None or not case.reading.problem.initial:
        return
    problem, names = case.reading.problem, case.reading.names
    there = {(symbol.situation, value) for symbol, value in problem.initial.items()}
    there |= {(s.name, FALSE) for s in problem.domain.situations.values() if s.boolean}
    present = {symbol.situation for symbol in problem.initial}
    changed = frozenset[str]().union(*(behavior.changes for behavior in problem.domain.behaviors.values()))
    for situation in (
        problem.domain.situations.values()
    ):  # what no behaviour changes, somebody else does; what no object of the scene has is no matter here
        if situation.name not in changed or situation.name not in present:
            there |= {(situation.name, value) for value in problem.classes.get(situation.range, ())}
    waiting = dict(problem.domain.behaviors)
    while True:
        ready = [b for b in waiting.values() if all(_possible(c, b, problem, there) for c in b.preconditions)]
        if not ready:
            break
        for behavior in ready:
            del waiting[behavior.name]
            there |= {(e.situation, v) for e in behavior.effects for v in _individuals(e.value, behavior, problem)}
    for name, behavior in waiting.items():
        lacking = [c for c in behavior.preconditions if not _possible(c, behavior, problem, there)]
        said = "; ".join(sorted(_words(c) for c in lacking))
        yield (
            names.iri(name),
            f"{name} can never be chosen: nothing leads to {said}",
            "neither the initial situation nor any behaviour gives what its precondition asks for",
            "add a behaviour with that effect, state it in the scene, or drop the precondition",
        )
    for symbol, value in problem.goal.items():
        if problem.domain.situations[symbol.situation].quantity is not None:
            continue  # what it can come to is for planning to find out
        if problem.initial.get(symbol, FALSE) != value and (symbol.situation, value) not in there:
            yield (
                names.iri(symbol.arguments[0]),
                f"the goal {symbol} = {value} can't be reached: no behaviour leads to it",
                "neither the initial situation nor any behaviour gives what the goal asks for",
                "add a behaviour with that effect, or drop the goal",
            )


def _possible(condition: Condition, behavior: Behavior, problem: Problem, there: set[tuple[str, str]]) -> bool:
    match condition:
        case ValueCondition(situation, _, value, False):
            values = _individuals(value, behavior, problem)
            return not values or any((situation, v) in there for v in values)
        case Witness(_, _, inner, False):
            return all(_possible(c, behavior, problem, there) for c in inner)
        case AnyOf(alternatives, False):
            return any(all(_possible(c, behavior, problem, there) for c in group) for group in alternatives)
        case _:
            return True


def _individuals(term: str, behavior: Behavior, problem: Problem) -> Sequence[str]:
    """Return what a term can stand for; nothing for one that is bound inside a condition."""
    if not term.startswith("?"):
        return (term,)
    kinds = behavior.kinds
    return problem.classes.get(kinds.get(term, ""), ())


def _words(condition: Condition) -> str:
    if isinstance(condition, ValueCondition):
        return f"{condition.situation} = {condition.value.lstrip('?')}"
    return type(condition).__name__


def gaps_of_values(case: Case) -> Iterator[Fault]:
    """Find effects none of whose values a behaviour of the next level leads to."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
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
                    f"{behavior.name} on level {behavior.level} gives {effect.situation} {said}, "
                    f"and no behaviour of level {level} gives that",
                    "a refinement has to reach the same situation with behaviours of the next level; here it can't",
                    f"add a behaviour on level {level} with that effect, or widen the class of a parameter of one that has another",
                )


def crowded_places(case: Case) -> Iterator[Fault]:
    """Find things that have one value together at first, though every behaviour that gives it asks for it to be free."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
    asks: dict[tuple[str, str], set[str]] = {}  # of what is given: the classes of which nobody may have it already
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
            continue  # an error: `reasoner.validation.situations`
        if len(symbol.arguments) == 1 and asks.get((symbol.situation, value)):
            holders[symbol.situation, value].append(symbol.arguments[0])
    for (situation, value), individuals in holders.items():
        for kind in sorted(asks[situation, value]):
            several = [one for one in individuals if one in problem.classes.get(kind, ())]
            if len(several) > 1:
                some = ", ".join(several[:5]) + (", …" if len(several) > 5 else "")
                yield (
                    names.iri(several[1]),
                    f"the {situation} of {some} is {value} at first, though each behaviour giving that asks that no {kind} has it",
                    "no behaviour leads to such a situation, so it is likely not meant",
                    f"state another {situation} of all but one, or let the behaviours take several {kind} there",
                )


def _none_has(condition: Condition, effect: ValueEffect) -> str:
    """Return the class none of which has the value of an effect, if that is what a condition says."""
    match condition:
        case Witness(variable, kind, (ValueCondition(situation, (about,), value, False),), True):
            same = (situation, about, value) == (effect.situation, variable, effect.value)
            return kind if same and value.startswith("?") else ""
        case _:
            return ""
