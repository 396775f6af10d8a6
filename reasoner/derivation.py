"""Stratification of derived situation types: the order in which these types are computed.

Mutually dependent types are computed together. A situation type may depend on the negation of another type only if the other type
is computed earlier; otherwise, the first type's value would be undefined or ambiguous.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from confab.reasoner.amounts import situations_in
from confab.reasoner.closure import closure
from confab.reasoner.language import groups
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.sentences import plain
from confab.reasoner.symbols import (
    FALSE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    Rule,
    Symbol,
    ValueCondition,
    Witness,
)

TASK = "core:Task"
"""The class of tasks; the argument of a goal's derived situation type is a task. A domain may have its own class *Task*."""


def conditions_of_goal(domain: Domain, symbol: Symbol) -> tuple[Condition, ...]:
    """Return the conditions of a goal with alternatives or quantifiers; the tuple is empty if the symbol isn't such a goal."""
    kind, rules = domain.situations.get(symbol.situation), domain.rules.get(symbol.situation, ())
    return rules[0].conditions if kind is not None and kind.arguments == (TASK,) and len(rules) == 1 else ()


def deciding(problem: Problem, goal: Symbol) -> ValueCondition:
    """Return the condition on one symbol that decides whether a goal with a deadline holds."""
    match conditions_of_goal(problem.domain, goal):
        case (ValueCondition() as wanted,):
            return wanted
        case _:
            return ValueCondition(goal.situation, goal.arguments, problem.goal[goal])


def said_by(problem: Problem, goal: Symbol) -> str:
    """Return a goal with a deadline as text, in the names of the ontology."""
    stated = (ValueCondition(goal.situation, goal.arguments, problem.goal[goal]),)
    return " and ".join(map(plain, conditions_of_goal(problem.domain, goal) or stated))


def needed(conditions: Sequence[Condition], negated: bool = False) -> Iterator[tuple[str, bool]]:
    """Yield the situation types in conditions, each with a flag that tells whether the conditions depend on the type's negation.

    >>> list(needed([Witness("?x", "Cup", (ValueCondition("FULL", ("?x",), "true"),), negated=True)]))
    [('FULL', True)]
    """
    for condition in conditions:
        flipped = negated is not condition.negated
        match condition:
            case ValueCondition(situation, _, value):
                yield situation, flipped is not (value == FALSE)
            case Comparison(left, _, right):
                for situation in sorted(situations_in(left) | situations_in(right)):
                    yield situation, flipped
            case RelationCondition() | ClassCondition() | EqualityCondition() | Witness() | AnyOf():
                for group in groups(condition):
                    yield from needed(group, flipped)


def strata(rules: Mapping[str, Sequence[Rule]]) -> list[tuple[str, ...]]:
    """Return the groups of mutually dependent derived situation types, in order of dependency."""
    below = _below(rules)
    groups = {
        name: tuple(other for other in rules if other == name or (other in below[name] and name in below[other]))
        for name in rules
    }
    return sorted(dict.fromkeys(groups.values()), key=lambda group: len(below[group[0]] | set(group)))


def circular(rules: Mapping[str, Sequence[Rule]]) -> set[str]:
    """Return the situation types that depend on themselves, directly or indirectly."""
    return {name for name, below in _below(rules).items() if name in below}


def _below(rules: Mapping[str, Sequence[Rule]]) -> dict[str, set[str]]:
    """Return the derived situation types on which each derived situation type depends, directly or indirectly."""
    needs = {
        name: {s for rule in its for s, _ in needed(rule.conditions)} & rules.keys() for name, its in rules.items()
    }
    return {name: closure(needs[name], needs.__getitem__) for name in rules}


def circles(rules: Mapping[str, Sequence[Rule]]) -> list[tuple[str, str]]:
    """Return the pairs of mutually dependent situation types of which the first depends on the negation of the second."""
    together = {name: group for group in strata(rules) for name in group}
    return sorted(
        {
            (name, other)
            for name, its in rules.items()
            for rule in its
            for other, negated in needed(rule.conditions)
            if negated and other in together[name]
        }
    )
