"""Replacement of maxima and minima in conditions by a witness that no other individual exceeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from confab.reasoner.aggregates.dependencies import existing
from confab.reasoner.amounts import Amount, Calculation, Expression, inside, put_in
from confab.reasoner.language import DomainError, mentions, substituted
from confab.reasoner.problem import Domain
from confab.reasoner.symbols import (
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Effect,
    Parameter,
    Timing,
    ValueEffect,
    Witness,
)


def with_extrema(conditions: Sequence[Condition], aggregates: Mapping[str, Aggregate]) -> tuple[Condition, ...]:
    """Return equivalent conditions in which witnesses express the comparisons with maxima and minima."""
    return tuple(_with_extremum(condition, aggregates) for condition in conditions)


def _with_extremum(condition: Condition, aggregates: Mapping[str, Aggregate]) -> Condition:
    if isinstance(condition, Comparison):
        read = [a for side in (condition.left, condition.right) for a in _extrema(side, aggregates)]
        if not read:
            return condition
        return _of_extremum(condition, read[0], aggregates)
    if isinstance(condition, Witness):
        return replace(condition, conditions=with_extrema(condition.conditions, aggregates))
    if isinstance(condition, AnyOf):
        return replace(
            condition, alternatives=tuple(with_extrema(group, aggregates) for group in condition.alternatives)
        )
    return condition


def _extrema(expression: Expression, aggregates: Mapping[str, Aggregate]) -> list[Amount]:
    """Return the maxima and minima that an expression reads."""
    amounts = [part for part in inside(expression) if isinstance(part, Amount)]
    return [part for part in amounts if part.situation in aggregates and not aggregates[part.situation].kept]


def _of_extremum(condition: Comparison, read: Amount, aggregates: Mapping[str, Aggregate]) -> Condition:
    """Return a witness that is equivalent to a comparison with a maximum or minimum."""
    aggregate = aggregates[read.situation]
    taken = {*mentions(condition), *read.arguments}
    best, other = (_solution(aggregate, read.arguments, suffix, taken) for suffix in ("", "_other"))
    sign = ">" if aggregate.function == "max" else "<"
    conditions, amount, variables = best
    exceeding = (*other[0], Comparison(other[1], sign, amount))
    compared = replace(
        condition, left=_in_place(condition.left, read, amount), right=_in_place(condition.right, read, amount)
    )
    inner = with_extrema(
        [*conditions, _sought(other[2], exceeding, True), replace(compared, negated=False)], aggregates
    )
    return replace(_sought(variables, inner, condition.negated), comparison=replace(condition, negated=False))


def _solution(
    aggregate: Aggregate, arguments: Sequence[str], suffix: str, taken: set[str]
) -> tuple[tuple[Condition, ...], Expression, tuple[Parameter, ...]]:
    """Return the conditions, the number and the variables of an aggregate for given arguments; new variables have unused names."""
    terms = dict(zip((p.name for p in aggregate.parameters), arguments, strict=True))
    variables = []
    for one in aggregate.variables:
        name = f"{one.name}{suffix}"
        while name in taken:
            name += "_"
        terms[one.name] = name
        variables.append(Parameter(name, one.kind))
    members = (ClassCondition(p.name, p.kind) for p in aggregate.parameters)  # only members have this amount
    asked = (*members, *aggregate.conditions, *existing(aggregate))
    conditions = tuple(substituted(condition, terms) for condition in asked)
    return conditions, put_in(aggregate.amount, terms), tuple(variables)


def _sought(variables: Sequence[Parameter], conditions: tuple[Condition, ...], negated: bool) -> Witness:
    """Return the condition that some individuals satisfy conditions or, if `negated`, that no individuals do."""
    found: Witness | None = None
    for variable in reversed(variables):
        found = Witness(variable.name, variable.kind, conditions if found is None else (found,))
    assert found is not None
    return replace(found, negated=negated)


def _in_place(expression: Expression, old: Expression, new: Expression) -> Expression:
    if expression == old:
        return new
    if isinstance(expression, Calculation):
        return replace(
            expression, left=_in_place(expression.left, old, new), right=_in_place(expression.right, old, new)
        )
    return expression


def extrema_replaced(domain: Domain) -> Domain:
    """Return an equivalent domain in which no condition reads a maximum or minimum.

    Raises
    ------
    DomainError
        A maximum or minimum occurs in an effect, a price, a duration or a sum; the message names the place and the amount.
    """
    aggregates = domain.aggregates
    if all(one.kept for one in aggregates.values()):
        return domain

    def effect(behavior: Behavior, one: Effect) -> Effect:
        if isinstance(one, AmountEffect):
            _refuse(f"an effect of {behavior.name}", one.amount)
        return replace(one, when=with_extrema(one.when, aggregates))

    def _refuse(what: str, expression: Expression) -> None:
        for read in _extrema(expression, aggregates):
            raise DomainError(
                f"{what} is calculated from {read.situation}, a {aggregates[read.situation].function}, which only conditions "
                "and goals can name; use a variable for the individual that has it"
            )

    def timed(behavior: Behavior) -> Timing | None:
        timing = behavior.timing
        if timing is None:
            return None
        if timing.duration is not None:
            _refuse(f"the duration of {behavior.name}", timing.duration)
        asked = tuple((span, _with_extremum(condition, aggregates)) for span, condition in timing.conditions)
        return replace(timing, conditions=asked, effects=tuple((s, effect(behavior, e)) for s, e in timing.effects))

    behaviors = {}
    for name, one in domain.behaviors.items():
        if one.price is not None:
            _refuse(f"the price of {name}", one.price)
        behaviors[name] = replace(
            one,
            preconditions=with_extrema(one.preconditions, aggregates),
            effects=tuple(e for e in (effect(one, e) for e in one.effects) if isinstance(e, ValueEffect)),
            amounts=tuple(e for e in (effect(one, e) for e in one.amounts) if isinstance(e, AmountEffect)),
            timing=timed(one),
        )
    rules = {
        name: tuple(replace(rule, conditions=with_extrema(rule.conditions, aggregates)) for rule in its)
        for name, its in domain.rules.items()
    }
    found = {}
    for name, aggregate in aggregates.items():
        _refuse(name, aggregate.amount)
        found[name] = replace(aggregate, conditions=with_extrema(aggregate.conditions, aggregates))
    return replace(domain, behaviors=behaviors, rules=rules, aggregates=found)
