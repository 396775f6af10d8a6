"""Shrinking of worlds: parts are removed one by one, as long as a predicate holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from time import process_time
from typing import Any

from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    Condition,
    Effect,
    Rule,
    SituationType,
    Symbol,
    ValueEffect,
    Witness,
)
from worlds.mixed import RandomWorld


def shrunk(world: RandomWorld, still: Callable[[RandomWorld], bool], seconds: float = 60.0) -> RandomWorld:
    """Return a world from which no part can be removed while `still` holds, or the smallest world found in CPU `seconds`."""
    end = process_time() + seconds
    again = True
    while again:
        again = False
        for smaller in smaller_worlds(world):
            if process_time() > end:
                return world
            if still(smaller):
                world, again = smaller, True
                break
    return world


def smaller_worlds(world: RandomWorld) -> Iterator[RandomWorld]:
    """Yield worlds without one part, with large parts such as behaviours first."""
    problem = world.problem
    domain = problem.domain
    for name in domain.behaviors:
        rest = {other: its for other, its in domain.behaviors.items() if other != name}
        if rest:
            yield replace(world, problem=replace(problem, domain=replace(domain, behaviors=rest)))
    for i in range(len(world.wishes)):
        yield replace(world, wishes=world.wishes[:i] + world.wishes[i + 1 :])
    for symbol in problem.goal if len(problem.goal) > 1 else ():
        yield replace(world, problem=replace(problem, goal={s: v for s, v in problem.goal.items() if s != symbol}))
    for name in domain.situations:
        if not _mentioned(name, world):
            yield _without_situation(world, name)
    for individual in dict.fromkeys((*problem.classes["A"], *problem.classes["B"])):
        if (found := without_individual(world, individual)) is not None:
            yield found
    for relation in problem.relations:
        if not _occurs(relation, (domain, problem.goal)):
            yield replace(
                world, problem=replace(problem, relations={r: s for r, s in problem.relations.items() if r != relation})
            )
    for name, behavior in domain.behaviors.items():
        for smaller in _smaller_behaviors(behavior):
            behaviors = {**domain.behaviors, name: smaller}
            yield replace(world, problem=replace(problem, domain=replace(domain, behaviors=behaviors)))
    for name, rules in domain.rules.items():
        if name in world.axioms:
            continue
        for smaller_rules in _smaller_rules(rules):
            yield replace(
                world, problem=replace(problem, domain=replace(domain, rules={**domain.rules, name: smaller_rules}))
            )
    for name, aggregate in domain.aggregates.items():
        for conditions in _smaller(aggregate.conditions):
            aggregates = {**domain.aggregates, name: replace(aggregate, conditions=conditions)}
            yield replace(world, problem=replace(problem, domain=replace(domain, aggregates=aggregates)))
    for name in domain.constraints:
        constraints = {other: its for other, its in domain.constraints.items() if other != name}
        yield replace(world, problem=replace(problem, domain=replace(domain, constraints=constraints)))
    for name in world.updates:
        yield replace(world, updates=world.updates - {name})
    for symbol, value in problem.initial.items():
        if (kind := domain.situations[symbol.situation]).boolean and value != FALSE:
            others = {s: v for s, v in problem.initial.items() if s != symbol}
            initial = {**others, symbol: FALSE} if kind.default == TRUE else others
            yield replace(world, problem=replace(problem, initial=initial))
    for one in domain.situations.values():
        for simpler in _simpler_situations(one):
            yield replace(
                world,
                problem=replace(problem, domain=replace(domain, situations={**domain.situations, one.name: simpler})),
            )
    for value in problem.value_levels:
        levels = {v: level for v, level in problem.value_levels.items() if v != value}
        yield replace(world, problem=replace(problem, value_levels=levels))
    if len(domain.levels) > 1:
        for level in domain.levels[:-1]:
            if all(domain.situations[s].level <= domain.levels[0] for s in domain.situations):
                break
            situations = {n: replace(s, level=1) if s.level == level else s for n, s in domain.situations.items()}
            if situations != domain.situations:
                yield replace(world, problem=replace(problem, domain=replace(domain, situations=situations)))


def _simpler_situations(one: SituationType) -> Iterator[SituationType]:
    if one.rest is not None and (one.boolean or one.default is None):
        yield replace(one, rest=None)
    if one.quantity is not None:
        for quantity in (replace(one.quantity, least=None), replace(one.quantity, most=None)):
            if quantity != one.quantity:
                yield replace(one, quantity=quantity)
    if one.level != 1:
        yield replace(one, level=1)


def _smaller_behaviors(one: Behavior) -> Iterator[Behavior]:
    many = len(one.effects) + len(one.amounts)
    for i in range(len(one.effects) if many > 1 else 0):
        yield _pruned(replace(one, effects=one.effects[:i] + one.effects[i + 1 :]))
    for i in range(len(one.amounts) if many > 1 else 0):
        yield _pruned(replace(one, amounts=one.amounts[:i] + one.amounts[i + 1 :]))
    for conditions in _smaller(one.preconditions):
        yield _pruned(replace(one, preconditions=conditions))
    for i, effect in enumerate(one.every_effect):
        for when in _smaller(effect.when):
            every: list[Effect] = list(one.every_effect)
            every[i] = replace(effect, when=when)
            values = tuple(e for e in every if isinstance(e, ValueEffect))
            amounts = tuple(e for e in every if not isinstance(e, ValueEffect))
            yield _pruned(replace(one, effects=values, amounts=amounts))
    if one.cost != 1:
        yield replace(one, cost=1.0)


def _pruned(one: Behavior) -> Behavior:
    """Return a behaviour without unused parameters and variables."""
    parts = one.preconditions, one.effects, one.amounts
    parameters = tuple(p for p in one.parameters if _occurs(p.name, parts))
    return replace(one, parameters=parameters, variables=tuple(p for p in one.variables if _occurs(p.name, parts)))


def _smaller(conditions: tuple[Condition, ...]) -> Iterator[tuple[Condition, ...]]:
    for i, one in enumerate(conditions):
        yield conditions[:i] + conditions[i + 1 :]
        if isinstance(one, AnyOf):
            for group in one.alternatives:
                yield (*conditions[:i], *group, *conditions[i + 1 :])
        if isinstance(one, Witness) and len(one.conditions) > 1:
            for j in range(len(one.conditions)):
                inner = one.conditions[:j] + one.conditions[j + 1 :]
                yield (*conditions[:i], replace(one, conditions=inner), *conditions[i + 1 :])


def _smaller_rules(rules: tuple[Rule, ...]) -> Iterator[tuple[Rule, ...]]:
    for i, rule in enumerate(rules):
        if len(rules) > 1:
            yield rules[:i] + rules[i + 1 :]
        for conditions in _smaller(rule.conditions):
            if conditions:
                yield (*rules[:i], replace(rule, conditions=conditions), *rules[i + 1 :])


def _without_situation(world: RandomWorld, name: str) -> RandomWorld:
    problem = world.problem
    domain = Domain(
        {n: s for n, s in problem.domain.situations.items() if n != name}, problem.domain.behaviors,
        rules={n: r for n, r in problem.domain.rules.items() if n != name},
        aggregates={n: a for n, a in problem.domain.aggregates.items() if n != name},
        constraints={n: c for n, c in problem.domain.constraints.items() if c.situation != name},
        remembers={n: s for n, s in problem.domain.remembers.items() if n != name},
    )  # fmt: skip
    values = [v for v in problem.classes.get(name, ()) if v.startswith(name)]
    parents = {kind: tuple(p for p in above if p != name) for kind, above in world.parents.items()}
    smaller = replace(
        problem, domain=domain, parents=parents,
        initial={s: v for s, v in problem.initial.items() if s.situation != name},
        classes={kind: its for kind, its in problem.classes.items() if kind != name},
        value_levels={v: level for v, level in problem.value_levels.items() if v not in values},
    )  # fmt: skip
    return replace(
        world, problem=smaller, parents=parents, owners={n: o for n, o in world.owners.items() if n != name},
        pairs=world.pairs - {name}, axioms={n: a for n, a in world.axioms.items() if n != name},
    )  # fmt: skip


def without_individual(world: RandomWorld, individual: str) -> RandomWorld | None:
    """Return a world without an individual, or None if the domain, the goal or a value refers to the individual."""
    problem = world.problem
    if _occurs(individual, (problem.domain, world.wishes, list(problem.goal), list(problem.goal.values()))):
        return None
    if any(value == individual and individual not in symbol.arguments for symbol, value in problem.initial.items()):
        return None
    smaller = replace(
        problem,
        classes={kind: tuple(one for one in its if one != individual) for kind, its in problem.classes.items()},
        relations={r: frozenset(row for row in rows if individual not in row) for r, rows in problem.relations.items()},
        initial={s: v for s, v in problem.initial.items() if individual not in s.arguments},
    )  # fmt: skip
    return replace(world, problem=smaller)


def _mentioned(name: str, world: RandomWorld) -> bool:
    """Return whether a situation type is used outside of its own definition."""
    problem = world.problem
    domain = problem.domain
    rules: list[Any] = [rule.conditions for other, its in domain.rules.items() if other != name for rule in its]
    rules += [aggregate for other, aggregate in domain.aggregates.items() if other != name]
    rules += [source for other, source in domain.remembers.items() if other != name]
    lines = [line for other, its in world.axioms.items() if other != name for line in its]
    return (
        any(symbol.situation == name for symbol in problem.goal)
        or _occurs(name, (list(domain.behaviors.values()), world.wishes, rules))
        or any(f":{name.lower()} " in line for line in lines)
    )


def _occurs(name: str, part: Any) -> bool:
    """Return whether a text occurs anywhere in a value."""
    if isinstance(part, str):
        return part == name
    if isinstance(part, Mapping):
        return any(_occurs(name, one) for one in part.values())
    if isinstance(part, tuple | list | frozenset):
        return any(_occurs(name, one) for one in part)
    if isinstance(part, SituationType):
        return name in (part.rest, part.default)
    if isinstance(part, Symbol | Problem) or (is_dataclass(part) and not isinstance(part, type)):
        return any(_occurs(name, getattr(part, its.name)) for its in fields(part))
    return False
