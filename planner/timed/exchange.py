"""Alternative actors for the turns of a plan; a turn is a part in which an actor leaves its first state and returns to it.

An alternative actor belongs to the same classes as the actor of the plan, their symbols have the same initial values, and they are
available in the same time windows. The static facts allow the steps of the alternative actor. The plan checker decides whether the
result is a plan.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from confab.planner.plan import Plan, Step
from confab.planner.timed.network import Network
from confab.planner.timed.order import Order, TurnId
from confab.planner.timed.pieces import duration_of, pieces_of
from confab.planner.timed.schedules import ActorChoices
from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.amounts import situations_in
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import ClassCondition, Comparison, Condition, EqualityCondition, RelationCondition, Times


def choices_of(problem: Problem, plan: Plan, order: Order, network: Network) -> ActorChoices:
    """Return, for each turn in an order of activities, the actors that could take the turn.

    Parameters
    ----------
    problem : Problem
    plan : Plan
        A plan whose primitives are the steps of the order's activities.
    order : Order
    network : Network
        The network of `order`.
    """
    actors = {one.actor: i for i, one in enumerate(order.resources) if one.actor is not None}
    every = _alike(problem, actors)
    if not any(every.values()):
        return ActorChoices()
    rules, facts = BehaviorReader(problem), LoggedState(problem, problem.initial)
    whole = _whole_steps(plan, order)
    steps = {step.path: step for step in plan.walk()}
    above = [[steps[step.path[:depth]] for depth in range(1, len(step.path))] for step in plan.primitives]
    of: dict[TurnId, tuple[int, ...]] = {}
    lasts: dict[tuple[TurnId, int], dict[int, int]] = {}
    for actor, resource in actors.items():
        for number, turn in enumerate(order.resources[resource].turns):
            check("scheduling the plan")
            if turn.reading or not whole(actor, turn.members):
                continue
            able = [resource]
            upper = {step.path: step for member in turn.members for step in above[member]}
            for other in every[actor]:
                names = {actor: other}
                durations = _durations(problem, rules, facts, order, network, turn.members, names)
                if durations is not None and all(
                    possible(problem, rules, facts, step, names) is not None for step in upper.values()
                ):
                    able.append(actors[other])
                    lasts[(resource, number), actors[other]] = durations
            if len(able) > 1:
                of[resource, number] = tuple(able)
    return ActorChoices(of, lasts)


def exchanged(problem: Problem, plan: Plan, renamed: Mapping[int, Mapping[str, str]]) -> Plan:
    """Return a plan in which other actors execute the primitives, and in which the steps above name these actors.

    Parameters
    ----------
    problem : Problem
    plan : Plan
    renamed : mapping of int to mapping of str to str
        The new actor in place of each replaced actor, by the number of the primitive.
    """
    numbers = {step.path: i for i, step in enumerate(plan.primitives)}

    def other(step: Step) -> Step:
        inside = tuple(map(other, step.steps))
        names: dict[str, str] = {}
        for one in step.walk():
            if not one.steps:
                names |= renamed.get(numbers[one.path], {})
        if not names:
            return step
        new, *joined = (named(one, names) for one in step.together)
        return replace(new, steps=inside, joined=tuple(joined))

    def named(step: Step, names: Mapping[str, str]) -> Step:
        arguments = tuple(names.get(a, a) for a in step.arguments)
        bindings = {variable: names.get(value, value) for variable, value in step.bindings.items()}
        return replace(step, id=problem.id_of(step.behavior, arguments), arguments=arguments, bindings=bindings)

    return Plan(tuple(map(other, plan.steps)))


def _alike(problem: Problem, actors: Iterable[str]) -> dict[str, list[str]]:
    """Return, for each actor, the other actors of the same classes with the same time windows and the same initial values.

    An actor that the goal names has no alternatives.
    """
    actors, windows = list(actors), (problem.times or Times()).windows
    kinds: dict[str, set[str]] = {
        a: {kind for kind, members in problem.classes.items() if a in members} for a in actors
    }
    about: dict[str, set[tuple[str, tuple[str, ...], str]]] = defaultdict(set)
    for symbol, value in problem.initial.items():
        for actor in actors:
            if actor in symbol.arguments or value == actor:
                put = tuple("" if a == actor else a for a in symbol.arguments)
                about[actor].add((symbol.situation, put, "" if value == actor else value))
    wanted = {a for symbol, value in problem.goal.items() for a in (*symbol.arguments, value)}
    return {
        one: [
            other
            for other in actors
            if other != one
            and not {one, other} & wanted
            and all(of.get(one) == of.get(other) for of in (kinds, about, windows))
        ]
        for one in actors
    }


def _whole_steps(plan: Plan, order: Order) -> Callable[[str, Sequence[int]], bool]:
    """Return a function that tests whether another actor can take a turn.

    For each step that names the actor, either all of the actor's primitives in the step belong to the turn, or none of
    these primitives does.
    """
    numbers = {step.path: i for i, step in enumerate(plan.primitives)}
    naming: dict[str, list[set[int]]] = defaultdict(list)
    for step in plan.walk():
        if step.steps:
            inside = {numbers[one.path] for one in step.walk() if not one.steps}
            for argument in dict.fromkeys(argument for one in step.together for argument in one.arguments):
                naming[argument].append(inside)
    involved = {
        actor: {i for i, one in enumerate(order.activities) if actor in one.step.arguments or actor in one.actors}
        for actor in {a for one in order.activities for a in one.actors}
    }

    def whole(actor: str, members: Sequence[int]) -> bool:
        its = set(members)
        if any(i in its and actor not in order.activities[i].step.arguments for i in its & involved[actor]):
            return False  # the actor takes part in a step that doesn't name the actor
        return all(not (inside & its & involved[actor]) or inside & involved[actor] <= its for inside in naming[actor])

    return whole


def possible(
    problem: Problem, rules: BehaviorReader, facts: LoggedState, step: Step, names: Mapping[str, str]
) -> dict[str, str] | None:
    """Return the individuals of a step after some are replaced, or None if static facts don't allow the new individuals."""
    behavior = problem.domain.behaviors[step.behavior]
    arguments = tuple(names.get(a, a) for a in step.arguments)
    given = {p.name: a for p, a in zip(behavior.parameters, arguments, strict=True)}
    given |= {f"?{v}": names.get(value, value) for v, value in step.bindings.items()}
    static = [c for c in behavior.preconditions if _static(c)]
    if not rules.fits(behavior, arguments):
        return None
    return None if static and rules.satisfied(static, given, behavior.kinds, facts) is None else given


def _durations(
    problem: Problem,
    rules: BehaviorReader,
    facts: LoggedState,
    order: Order,
    network: Network,
    members: Sequence[int],
    names: Mapping[str, str],
) -> dict[int, int] | None:
    """Return the durations of activities after an exchange of their actors, or None if static facts don't allow the exchange."""
    found = {}
    for member in members:
        step = order.activities[member].step
        arguments = tuple(names.get(a, a) for a in step.arguments)
        if arguments == step.arguments:
            continue
        behavior = problem.domain.behaviors[step.behavior]
        given = possible(problem, rules, facts, step, names)
        if given is None:
            return None
        terms = (*arguments, *(given.get(v.name, v.name) for v in pieces_of(problem, behavior).fixed))
        seconds = duration_of(problem, behavior, terms, facts)
        if seconds is None or (seconds / network.unit).denominator != 1:
            return None
        found[member] = int(seconds / network.unit)
    return found


def _static(condition: Condition) -> bool:
    """Return whether a condition is static."""
    if isinstance(condition, RelationCondition | ClassCondition | EqualityCondition):
        return True
    return isinstance(condition, Comparison) and not (situations_in(condition.left) | situations_in(condition.right))
