"""Behaviours that no plan can contain, detected without search (docs/levels.md)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from confab.reasoner.language import situations_of, walk
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, NEVER, AmountEffect, Behavior, ValueEffect


def never_done(problem: Problem) -> Iterator[tuple[Behavior, str]]:
    """Yield each relevant behaviour that no plan can contain in any state, with the reason.

    A behaviour above the lowest level can't be refined if it always has an effect that no behaviour of a lower level can have.

    Every refinement and every plan must restore the rest values of symbols. If no behaviour restores a symbol's rest value, no plan
    contains a behaviour that always changes the symbol from this value.
    """
    domain = problem.domain
    values: dict[str, set[str]] = {}
    for symbol, value in problem.initial.items():
        values.setdefault(symbol.situation, set()).add(value)
    wanted = {symbol.situation for symbol in problem.goal} | problem.read_by_goals.keys()
    for behavior in _needed(problem):
        below = next((level for level in domain.levels if level > behavior.level), None)
        for effect in _sure(problem, behavior):
            situation = effect.situation
            kind = domain.situations[situation]
            if isinstance(effect, AmountEffect):
                if below is not None and not any(situation in b.changes for b in _from(problem, below)):
                    yield behavior, _unrefined(behavior, f"it {effect.operation}s {situation}", below)
                continue
            made = _values(problem, behavior, effect)
            if FALSE in made or made & values.get(situation, set()):
                continue  # the value may already hold
            if below is not None and not made & _given(problem, below, situation):
                yield behavior, _unrefined(behavior, f"it makes {situation} {_said(effect)}", below)
            first = next((level for level in domain.levels if level >= kind.level), behavior.level)
            if kind.rest is None or kind.rest in made or situation in wanted:
                continue
            if kind.rest not in _given(problem, first, situation):
                why = f"it makes {situation} {_said(effect)}, and no behaviour from level {first} on brings it back to {kind.rest}"
                yield (
                    behavior,
                    f"{behavior.name} of level {behavior.level} can be in no plan: {why}, where it rests; add a behaviour of level "
                    f"{first} that does, or remove c:restValue if {situation} may keep any value",
                )


def without(problem: Problem, behaviors: Sequence[Behavior]) -> Problem:
    """Return a problem in which some behaviours are never applicable; the IDs of all behaviours remain the same."""
    never = {one.name: replace(one, preconditions=(*one.preconditions, NEVER)) for one in behaviors}
    return replace(problem, domain=replace(problem.domain, behaviors={**problem.domain.behaviors, **never}))


def _needed(problem: Problem) -> list[Behavior]:
    """Return the behaviours that change a situation type in the goal, or in a part of a needed behaviour or rule."""
    behaviors = [*problem.domain.behaviors.values()]
    doing = [*behaviors, *(rule.behavior for rules in problem.domain.rules.values() for rule in rules)]
    counting, before = {symbol.situation for symbol in problem.goal}, -1
    while before != (before := len(counting)):
        for one in doing:
            if one.changes & counting:
                counting |= one.changes | {s for c in one.conditions for inner in walk(c) for s in situations_of(inner)}
    return [behavior for behavior in behaviors if behavior.changes & counting]


def _unrefined(behavior: Behavior, what: str, below: int) -> str:
    return (
        f"{behavior.name} of level {behavior.level} can never be refined: {what}, and no behaviour from level {below} on does; "
        f"add one of level {below} with that effect, or take the effect out"
    )


def _said(effect: ValueEffect) -> str:
    return effect.value.lstrip("?")


def _from(problem: Problem, level: int) -> list[Behavior]:
    return [behavior for behavior in problem.domain.behaviors.values() if behavior.level >= level]


def _given(problem: Problem, level: int, situation: str) -> set[str]:
    """Return the values that behaviours of a level and of lower levels may give to symbols of a situation type."""
    return {
        value
        for behavior in _from(problem, level)
        for effect in behavior.effects
        if effect.situation == situation
        for value in _values(problem, behavior, effect)
    }


def _values(problem: Problem, behavior: Behavior, effect: ValueEffect) -> set[str]:
    """Return the values that an effect may give."""
    return set(problem.members(behavior.kinds[effect.value])) if effect.value in behavior.kinds else {effect.value}


def _sure(problem: Problem, behavior: Behavior) -> Iterator[ValueEffect | AmountEffect]:
    """Yield the effects that every execution of a behaviour has; yield no effect if a parameter's class is empty."""
    kinds = behavior.kinds
    if not all(problem.members(kind) for kind in kinds.values()):
        return
    for effect in behavior.every_effect:
        about = problem.domain.situations[effect.situation]
        individuals = [problem.members(kinds[a]) if a in kinds else {a} for a in effect.arguments]
        exists = all(one <= problem.members(of) for one, of in zip(individuals, about.arguments, strict=True))
        if isinstance(effect, AmountEffect):
            constant = isinstance(effect.amount, Fraction) and effect.amount != 0
            exists &= constant and effect.operation in ("increase", "decrease") and len(effect.arguments) == 1
            exists &= [e.situation for e in behavior.amounts].count(effect.situation) == 1
        else:
            exists &= all(other is effect or other.situation != effect.situation for other in behavior.effects)
        if exists and not effect.when:
            yield effect
