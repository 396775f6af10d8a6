"""The features of a random world, and whether each feature changes the cost or the reachability of the goal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations

from confab.reasoner.amounts import Calculation, Expression, inside
from confab.reasoner.derivation import TASK
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Effect,
    EqualityCondition,
    RelationCondition,
    ValueCondition,
    ValueEffect,
    Witness,
)
from worlds.interpreter import Interpreter, TooManyStatesError
from worlds.mixed import RandomWorld
from worlds.phrases import ANYONE, EACH, LOCAL
from worlds.shrinking import without_individual

MOST = 2_000
"""Maximum number of nodes in the search of a world from which a feature is removed."""


def _kept(conditions: tuple[Condition, ...], drop: Callable[[Condition], bool]) -> tuple[Condition, ...]:
    """Return a conjunction without the conditions for which `drop` is true, also inside nested conditions."""

    def inner(one: Condition) -> Condition:
        if isinstance(one, AnyOf):
            return replace(one, alternatives=tuple(_kept(group, drop) for group in one.alternatives))
        return replace(one, conditions=_kept(one.conditions, drop)) if isinstance(one, Witness) else one

    return tuple(inner(one) for one in conditions if not drop(one))


def _behaviors(problem: Problem, change: Callable[[Behavior], Behavior]) -> Problem:
    behaviors = {name: change(one) for name, one in problem.domain.behaviors.items()}
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))


def _effects(problem: Problem, change: Callable[[Effect], Effect | None]) -> Problem:
    def changed(one: Behavior) -> Behavior:
        every = [effect for effect in map(change, one.every_effect) if effect is not None]
        values = tuple(effect for effect in every if isinstance(effect, ValueEffect))
        return replace(one, effects=values, amounts=tuple(e for e in every if isinstance(e, AmountEffect)))

    return _behaviors(problem, changed)


def _without_conditions(drop: Callable[[RandomWorld, Condition], bool]) -> Callable[[RandomWorld], Problem]:
    def changed(world: RandomWorld) -> Problem:
        def dropped(one: Condition) -> bool:
            return drop(world, one)

        def conditional(effect: Effect) -> Effect:
            return replace(effect, when=_kept(effect.when, dropped))

        problem = _effects(world.problem, conditional)
        problem = _behaviors(problem, lambda b: replace(b, preconditions=_kept(b.preconditions, dropped)))
        rules = {
            name: tuple(replace(rule, conditions=_kept(rule.conditions, dropped)) for rule in its)
            for name, its in problem.domain.rules.items()
        }
        return replace(problem, domain=replace(problem.domain, rules=rules))

    return changed


def _without_effects(drop: Callable[[Effect], bool]) -> Callable[[RandomWorld], Problem]:
    return lambda world: _effects(world.problem, lambda effect: None if drop(effect) else effect)


def _without_goals(drop: Callable[[RandomWorld, str, str], bool]) -> Callable[[RandomWorld], Problem]:
    def changed(world: RandomWorld) -> Problem:
        goal = {s: v for s, v in world.problem.goal.items() if not drop(world, s.situation, v)}
        return replace(world.problem, goal=goal)

    return changed


def _without_rules(drop: Callable[[RandomWorld, str], bool]) -> Callable[[RandomWorld], Problem]:
    def changed(world: RandomWorld) -> Problem:
        rules = {name: () if drop(world, name) else its for name, its in world.problem.domain.rules.items()}
        return replace(world.problem, domain=replace(world.problem.domain, rules=rules))

    return changed


def _negative(world: RandomWorld, name: str) -> bool:
    """Return whether a situation type has a rule with a single, negated condition."""
    rules = world.problem.domain.rules[name]
    return name not in world.axioms and any(len(r.conditions) == 1 and r.conditions[0].negated for r in rules)


def _unbounded(world: RandomWorld) -> Problem:
    situations = {
        name: one if one.quantity is None else replace(one, quantity=replace(one.quantity, least=None, most=None))
        for name, one in world.problem.domain.situations.items()
    }
    return replace(world.problem, domain=replace(world.problem.domain, situations=situations))


def _restless(world: RandomWorld) -> Problem:
    situations = {name: replace(one, rest=None) for name, one in world.problem.domain.situations.items()}
    return replace(world.problem, domain=replace(world.problem.domain, situations=situations))


def _different(world: RandomWorld) -> Problem:
    """Return the problem with the condition that all parameters of a behaviour have different individuals."""

    def changed(one: Behavior) -> Behavior:
        pairs = combinations([p.name for p in one.parameters], 2)
        return replace(one, preconditions=(*one.preconditions, *(EqualityCondition(a, b, True) for a, b in pairs)))

    return _behaviors(world.problem, changed)


def _named_only(world: RandomWorld) -> Problem:
    """Return the problem without unused individuals."""
    for one in (*world.problem.classes["A"], *world.problem.classes["B"]):
        world = without_individual(world, one) or world
    return world.problem


def _divides(one: Expression) -> bool:
    return any(isinstance(part, Calculation) and part.operator == "/" for part in inside(one))


def _by_name(one: Condition) -> bool:
    return isinstance(one, ValueCondition) and any(not term.startswith("?") for term in one.arguments)


FEATURES: Mapping[str, Callable[[RandomWorld], Problem]] = {
    "effects on all of a class": _without_effects(lambda effect: effect.each is not None),
    "effects under conditions": lambda world: _effects(world.problem, lambda e: replace(e, when=())),
    "effects on individuals by name": _without_effects(
        lambda effect: any(not term.startswith("?") for term in effect.arguments)
    ),
    "bounds of amounts": _unbounded,
    "conditions on every state": lambda world: replace(
        world.problem, domain=replace(world.problem.domain, constraints={})
    ),
    "increase": _without_effects(lambda e: isinstance(e, AmountEffect) and e.operation == "increase"),
    "decrease": _without_effects(lambda e: isinstance(e, AmountEffect) and e.operation == "decrease"),
    "assign": _without_effects(lambda e: isinstance(e, AmountEffect) and e.operation == "assign"),
    "scale": _without_effects(lambda e: isinstance(e, AmountEffect) and e.operation == "scale"),
    "division in an effect": _without_effects(lambda e: isinstance(e, AmountEffect) and _divides(e.amount)),
    "division in a condition": _without_conditions(
        lambda world, one: isinstance(one, Comparison) and (_divides(one.left) or _divides(one.right))
    ),
    "comparisons": _without_conditions(lambda world, one: isinstance(one, Comparison)),
    "negated conditions": _without_conditions(lambda world, one: one.negated),
    "conditions on individuals by name": _without_conditions(lambda world, one: _by_name(one)),
    "some individual": _without_conditions(
        lambda world, one: isinstance(one, Witness) and one.variable not in (EACH, ANYONE)
    ),
    "variables local to a group": _without_conditions(
        lambda world, one: isinstance(one, Witness) and one.variable.startswith(LOCAL)
    ),
    "no individual": _without_conditions(lambda world, one: isinstance(one, Witness) and one.variable == ANYONE),
    "all of a class": _without_conditions(lambda world, one: isinstance(one, Witness) and one.variable == EACH),
    "any of": _without_conditions(lambda world, one: isinstance(one, AnyOf)),
    "equality": _without_conditions(lambda world, one: isinstance(one, EqualityCondition)),
    "classes": _without_conditions(lambda world, one: isinstance(one, ClassCondition)),
    "static relations": _without_conditions(lambda world, one: isinstance(one, RelationCondition)),
    "situation types with several values": _without_conditions(
        lambda world, one: isinstance(one, ValueCondition) and one.situation in world.pairs
    ),
    "situation types of several arguments": _without_conditions(
        lambda world, one: isinstance(one, ValueCondition) and not world.owners.get(one.situation, True)
    ),
    "rules": _without_rules(lambda world, name: name not in world.axioms),
    "rules of one negated condition": _without_rules(_negative),
    "transitive properties and chains": _without_rules(lambda world, name: name in world.axioms),
    "negated goals": _without_goals(lambda world, name, value: value == FALSE),
    "negated goals on several values": _without_goals(lambda world, name, v: v == FALSE and name in world.pairs),
    "goals that exclude one of several values": _without_goals(
        lambda world, name, _: world.problem.domain.situations[name].arguments == (TASK,) and _negative(world, name)
    ),
    "rest values": _restless,
    "equal arguments": _different,
    "individuals that nothing names": _named_only,
}
"""The functions that remove a feature from a world, by the name of the feature."""


def features(world: RandomWorld, least: float | None) -> Iterator[tuple[str, bool]]:
    """Yield each feature of a world, and whether the least cost differs without the feature."""
    for name, without in FEATURES.items():
        other = without(world)
        if other == world.problem:
            continue
        yield name, _least(other) != least
    if least is None and len(world.problem.goal) > 1:
        alone = [replace(world.problem, goal={s: v}) for s, v in world.problem.goal.items()]
        yield "goals that exclude each other", all(_least(one) is not None for one in alone)


def _least(problem: Problem) -> float | None:
    try:
        return Interpreter(problem).explored(problem.domain.levels[-1], MOST).least
    except TooManyStatesError:
        return -1.0
