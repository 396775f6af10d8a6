"""Short functions that create problems and their parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import product

from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Behavior,
    Condition,
    Parameter,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
)


def has(situation: str, *terms: str) -> ValueCondition:
    """Return a condition on a value of a situation type: the last term is the value, and the other terms are the arguments."""
    return ValueCondition(situation, terms[:-1], terms[-1])


def lacks(situation: str, *terms: str) -> ValueCondition:
    """Return the negation of the condition that `has` returns for the same arguments."""
    return ValueCondition(situation, terms[:-1], terms[-1], negated=True)


def becomes(situation: str, *terms: str, when: tuple[Condition, ...] = ()) -> ValueEffect:
    """Return the effect that makes the condition of `has` true if the conditions `when` hold."""
    return ValueEffect(situation, terms[:-1], terms[-1], when)


def behavior(
    name: str,
    level: int,
    terms: str,
    conditions: Iterable[Condition],
    effects: Iterable[ValueEffect],
    variables: str = "",
) -> Behavior:
    """Return a behaviour with terms that are given in the form ``"?b:Book ?p:Place"``."""

    def parameters(text: str) -> tuple[Parameter, ...]:
        return tuple(Parameter(*term.split(":")) for term in text.split())

    return Behavior(name, level, parameters(terms), parameters(variables), tuple(conditions), tuple(effects))


def world(
    situations: Iterable[SituationType],
    behaviors: Iterable[Behavior],
    classes: Mapping[str, tuple[str, ...]],
    initial: Mapping[str, str],
    goal: Mapping[str, str],
    relations: Mapping[str, Iterable[tuple[str, ...]]] = {},
    value_levels: Mapping[str, int] = {},
) -> Problem:
    """Return a problem with facts given as a mapping of texts such as ``AT book`` to values such as ``shelf``."""

    def facts(stated: Mapping[str, str]) -> dict[Symbol, str]:
        return {Symbol(key.split()[0], tuple(key.split()[1:])): value for key, value in stated.items()}

    return Problem(
        scene="world",
        domain=Domain({s.name: s for s in situations}, {b.name: b for b in behaviors}),
        classes={"Truth": (FALSE, TRUE), **classes},
        relations={name: frozenset(rows) for name, rows in relations.items()},
        initial=facts(initial),
        goal=facts(goal),
        value_levels=value_levels,
    )


def quantified(problem: Problem, level: int) -> Iterator[tuple[Behavior, tuple[str, ...]]]:
    """Yield the grounded behaviours of a level."""
    for one in problem.domain.at_level(level):
        for arguments in product(*(problem.classes.get(parameter.kind, ()) for parameter in one.parameters)):
            yield one, arguments
