"""Merging of conditional effects of the same shape into one effect that a single join grounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import groupby

from confab.reasoner.language import is_variable
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Parameter, RelationCondition, SituationType, ValueCondition, ValueEffect


def merged(problem: Problem, level: int) -> Problem:
    """Return a problem in which conditional effects of the same shape are one effect over the rows of an auxiliary relation.

    In a problem, an effect on every member of a class is a separate effect for each individual. The model of a cube
    puzzle has thousands of separate effects, and each effect would need a separate join.
    """
    relations: dict[str, frozenset[tuple[str, ...]]] = {}
    behaviors = dict(problem.domain.behaviors)
    for behavior in problem.domain.at_level(level):
        effects: list[ValueEffect] = []
        variables: list[Parameter] = []
        for _, group in groupby(behavior.effects, _shape):
            alike = list(group)
            rows = [_constants(effect) for effect in alike]
            vary = [i for i, column in enumerate(zip(*rows, strict=True)) if len(set(column)) > 1]
            kinds = [_kinds(alike[0], problem.domain.situations)[i] for i in vary]
            inside = all(row[i] in problem.members(k) for row in rows for i, k in zip(vary, kinds, strict=True))
            if not vary or not inside or not alike[0].when:
                effects += alike
                continue
            name = f"{behavior.name}/{len(effects)}"
            own = [f"?{name}/{i}" for i in vary]
            variables += map(Parameter, own, kinds)
            relations[name] = frozenset(tuple(row[i] for i in vary) for row in rows)
            one = _with_constants(
                alike[0], iter({**dict(enumerate(rows[0])), **dict(zip(vary, own, strict=True))}.values())
            )
            effects.append(replace(one, when=(RelationCondition(name, tuple(own)), *one.when)))
        if variables:
            behaviors[behavior.name] = replace(
                behavior, effects=tuple(effects), variables=(*behavior.variables, *variables)
            )
    if not relations:
        return problem
    return replace(
        problem, domain=replace(problem.domain, behaviors=behaviors), relations={**problem.relations, **relations}
    )


def _parts(effect: ValueEffect) -> list[ValueEffect | ValueCondition]:
    return [effect, *(c for c in effect.when if isinstance(c, ValueCondition))]


def _shape(effect: ValueEffect) -> object:
    """Return the shape of an effect; effects that differ only in individuals have the same shape.

    In the shape, conditions other than value conditions are unchanged.
    """
    values = tuple(
        (type(p), p.situation, tuple(t if is_variable(t) else "" for t in p.arguments), p.value) for p in _parts(effect)
    )
    others = tuple((c.negated, "") if isinstance(c, ValueCondition) else (False, c) for c in effect.when)
    return values, others


def _constants(effect: ValueEffect) -> tuple[str, ...]:
    return tuple(term for part in _parts(effect) for term in part.arguments if not is_variable(term))


def _kinds(effect: ValueEffect, situations: Mapping[str, SituationType]) -> list[str]:
    """Return the class of each constant of an effect."""
    return [
        kind
        for part in _parts(effect)
        for term, kind in zip(part.arguments, situations[part.situation].arguments, strict=True)
        if not is_variable(term)
    ]


def _with_constants(effect: ValueEffect, terms_: Iterator[str]) -> ValueEffect:
    """Return an effect whose constants are replaced by the given terms."""

    def put(arguments: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(term if is_variable(term) else next(terms_) for term in arguments)

    effect = replace(effect, arguments=put(effect.arguments))
    when = (replace(c, arguments=put(c.arguments)) if isinstance(c, ValueCondition) else c for c in effect.when)
    return replace(effect, when=tuple(when))
