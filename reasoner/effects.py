"""Effects on all members of a class, and the preconditions that keep amounts within their bounds."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from confab.reasoner.amounts import Amount, Calculation, put_in, situations_in
from confab.reasoner.language import substituted
from confab.reasoner.symbols import (
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    Condition,
    Effect,
    SituationType,
    ValueEffect,
)


def made_of(effect: Effect, one: str) -> Effect:
    """Return, for an effect on all members of a class, the effect on one of the members."""
    if effect.each is None:
        return effect
    terms = {effect.each.name: one}
    arguments = tuple(terms.get(a, a) for a in effect.arguments)
    when = tuple(substituted(condition, terms) for condition in effect.when)
    if isinstance(effect, ValueEffect):
        return ValueEffect(effect.situation, arguments, terms.get(effect.value, effect.value), when)
    return AmountEffect(effect.situation, arguments, effect.operation, put_in(effect.amount, terms), when)


def spread(behavior: Behavior, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour in which each effect on all members of a class is replaced by one effect per member."""
    timing = behavior.timing
    if all(
        effect.each is None
        for effect in (*behavior.every_effect, *(one for _, one in (timing.effects if timing else ())))
    ):
        return behavior

    def single(effect: Effect) -> list[Effect]:
        return [effect] if effect.each is None else [made_of(effect, one) for one in classes.get(effect.each.kind, ())]

    every = [one for effect in behavior.every_effect for one in single(effect)]
    effects = tuple(one for one in every if isinstance(one, ValueEffect))
    amounts = tuple(one for one in every if isinstance(one, AmountEffect))
    replaced = tuple(effect for effect in behavior.every_effect if effect.each is not None)
    kinds = {effect.each.kind for effect in replaced if effect.each is not None}
    all_of = frozenset(one for kind in kinds for one in classes.get(kind, ()))
    by_name = {one for effect in behavior.effects for one in (*effect.arguments, effect.value)}
    by_name |= {one for one in all_of if any(substituted(c, {one: "?"}) != c for c in behavior.conditions)}
    if timing is not None:
        timing = replace(timing, effects=tuple((at, one) for at, effect in timing.effects for one in single(effect)))
    return replace(behavior, effects=effects, amounts=amounts, timing=timing, spread=all_of - by_name, every=replaced)


def spread_to(behavior: Behavior, individual: str, kinds: Collection[str]) -> Behavior:
    """Return a behaviour with the effects on one more member of the classes `kinds`; see `spread`."""
    more = [made_of(one, individual) for one in behavior.every if one.each is not None and one.each.kind in kinds]
    if not more:
        return behavior
    effects = (*behavior.effects, *(one for one in more if isinstance(one, ValueEffect)))
    amounts = (*behavior.amounts, *(one for one in more if isinstance(one, AmountEffect)))
    return replace(behavior, effects=effects, amounts=amounts, spread=behavior.spread | {individual})


def allowed(behavior: Behavior, situations: Mapping[str, SituationType]) -> tuple[Condition, ...]:
    """Return preconditions under which a behaviour keeps amounts within their bounds, as far as conditions can express this.

    Each precondition states that a bound isn't violated. For an amount that doesn't exist, the precondition holds; an effect
    doesn't change an amount that doesn't exist.
    """
    found: list[Condition] = []
    changed = [effect.situation for effect in behavior.amounts]
    for effect in behavior.amounts:
        quantity, before = situations[effect.situation].quantity, Amount(effect.situation, effect.arguments)
        if quantity is None or changed.count(effect.situation) > 1:
            continue
        sign = {"increase": "+", "decrease": "-", "scale": "*"}.get(effect.operation)
        if sign == "*" and situations_in(effect.amount):
            continue
        after = effect.amount if sign is None else Calculation(sign, before, effect.amount)
        there = [Comparison(before, "=", before)] if sign is None else []
        for wrong, limit in (("<", quantity.least), (">", quantity.most)):
            if limit is not None:
                refused = (*effect.when, *there, Comparison(after, wrong, limit))
                found.append(
                    replace(refused[0], negated=True) if len(refused) == 1 else AnyOf((refused,), negated=True)
                )
    return tuple(found)
