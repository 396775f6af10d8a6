"""Preconditions that a lower level inherits from the behaviours of the upper levels.

A search of a lower level alone finds steps that refine no step of an upper level. Steps that refine no upper-level step
may violate conditions of an upper level, such as "a filled cup isn't moved". Therefore the behaviours of a level that
is planned alone inherit preconditions. A behaviour may change a symbol that an upper level sees only if some behaviour
of the upper level could make the same change. The conditions of the upper behaviour on the changed individuals become
preconditions.

Conditions on other individuals of the upper behaviour, such as the second vessel of pouring, aren't inherited. Conditions on the
old value of the changed symbol aren't inherited if the upper level doesn't see all values of the symbol.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from confab.reasoner.language import mentions, substituted
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    ValueCondition,
    ValueEffect,
    Witness,
)


def binding(problem: Problem, level: int) -> Domain:
    """Return the domain in which the behaviours of a level inherit preconditions from the levels above.

    Parameters
    ----------
    problem : Problem
    level : int
        The level that is planned without the levels above.

    Returns
    -------
    Domain
        A domain whose plans on the level are also plans of the original domain.
    """
    domain = problem.domain
    above = [behavior for behavior in domain.behaviors.values() if behavior.level < level]
    bound = {}
    for name, behavior in domain.behaviors.items():
        if behavior.level == level:
            asked = [guard for effect in behavior.effects for guard in _inherited(problem, behavior, effect, above)]
            behavior = replace(behavior, preconditions=(*behavior.preconditions, *asked))
        bound[name] = behavior
    return replace(domain, behaviors=bound)


def _inherited(
    problem: Problem, behavior: Behavior, effect: ValueEffect, above: Sequence[Behavior]
) -> Iterator[Condition]:
    """Yield the conditions that the levels above impose on an effect, at most one condition for each level."""
    for level in sorted({upper.level for upper in above}):
        if problem.domain.situations[effect.situation].level > level or effect.situation in problem.domain.remembers:
            continue
        makers = [(upper, e) for upper in above if upper.level == level for e in upper.effects]
        makers = [(upper, e) for upper, e in makers if e.situation == effect.situation]
        if not makers:
            continue  # no behaviour of the level changes the symbol; the level imposes no condition
        alternatives = [*_unseen_values(problem, behavior, effect, level)]
        alternatives += [
            group for maker in makers for group in _conditions_for(problem, behavior, effect, *maker, level)
        ]
        alternatives += [(AnyOf((effect.when,), negated=True),)] if effect.when else []
        if () not in alternatives:
            yield AnyOf(tuple(alternatives))


def _unseen_values(
    problem: Problem, behavior: Behavior, effect: ValueEffect, level: int
) -> Iterator[tuple[Condition, ...]]:
    """For each possible value of an effect, if the level doesn't see the value, yield an alternative that allows it."""
    kinds = behavior.kinds
    values = problem.classes.get(kinds[effect.value], ()) if effect.value in kinds else (effect.value,)
    unknown = [value for value in values if problem.value_levels.get(value, 1) > level]
    if len(unknown) == len(values):
        yield ()
    for value in unknown:
        yield (EqualityCondition(effect.value, value),)


def _conditions_for(
    problem: Problem, lower: Behavior, effect: ValueEffect, upper: Behavior, its: ValueEffect, level: int
) -> Iterator[tuple[Condition, ...]]:
    """Yield the conditions under which an upper behaviour could have the given effect; yield nothing if none exist."""
    terms = upper.kinds
    here = lower.kinds
    names: dict[str, str] = {}
    asked: list[Condition] = []
    for mine, other in zip((*effect.arguments, effect.value), (*its.arguments, its.value), strict=True):
        if other not in terms:
            if mine not in here and mine != other:
                return
            asked += [EqualityCondition(mine, other)] if mine != other else []
        elif other in names:
            asked += [EqualityCondition(mine, names[other])] if mine != names[other] else []
        else:
            names[other] = mine
            asked += [ClassCondition(mine, terms[other])] if here.get(mine) != terms[other] else []
    kind = problem.domain.situations[effect.situation].range
    unsettled = any(problem.value_levels.get(value, 1) > level for value in problem.classes.get(kind, ()))
    found = {(c.situation, c.arguments): c.value for c in lower.preconditions if isinstance(c, ValueCondition)}
    own: list[Condition] = []
    for condition in upper.preconditions:
        if isinstance(condition, ValueCondition) and not mentions(replace(condition, value="")) - names.keys():
            symbol = (condition.situation, tuple(names.get(a, a) for a in condition.arguments))
            if unsettled and symbol == (effect.situation, effect.arguments):
                continue
            if (
                condition.value in terms.keys() - names.keys()
                and here.get(found.get(symbol, "")) == terms[condition.value]
            ):
                names[condition.value] = found[symbol]
        own.append(condition)
    closed = [substituted(condition, names) for condition in _closed(own, set(names), terms)]
    yield (*asked, *(condition for condition in closed if condition not in lower.preconditions))


def _closed(conditions: Sequence[Condition], known: set[str], terms: Mapping[str, str]) -> Iterator[Condition]:
    """Yield the conditions that mention only known terms.

    For each variable that known terms determine, also yield a witness: the condition that a suitable individual exists.
    """
    yield from (condition for condition in conditions if mentions(condition) <= known)
    for condition in conditions:
        if isinstance(condition, ValueCondition) and mentions(condition) - known == {condition.value}:
            variable = condition.value
            about = [c for c in conditions if variable in mentions(c) and mentions(c) <= {*known, variable}]
            yield Witness(variable, terms[variable], tuple(about))
