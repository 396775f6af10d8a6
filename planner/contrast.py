"""Contrastive explanations: plan with an enforced alternative, or name the alternative's failing conditions.

There are two kinds of alternatives: steps and choices. An alternative *step* replaces a step of the plan: the earlier steps are
kept, the alternative step is refined and applied, and the later steps are planned again. An alternative *choice* names an
individual for the changes of a symbol: every behaviour that changes the symbol must take this individual, if the behaviour has a
suitable role. The whole task is then planned again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from operator import eq

from confab.planner.causal_links import on_level
from confab.planner.checked_conditions import Bindings, variables
from confab.planner.levels import failing_conditions
from confab.planner.plan import Outcome, Plan, Reason, Step, renumbered
from confab.planner.plan_costs import cost_of
from confab.planner.solve import Request, solve
from confab.planner.validation import BehaviorReader, LoggedState, followed, successor, validate
from confab.reasoner.amounts import Amount
from confab.reasoner.language import substituted
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    AnyOf,
    Behavior,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    State,
    Symbol,
    ValueCondition,
)

Ask = Callable[[Problem], Outcome]
"""Planning function that calls `confab.planner.solve.solve` with a fixed mode and fixed limits."""


NO_NUMBER = Reason("one of its effects uses a number that isn't stated for these individuals")


class NoChoiceError(ValueError):
    """The requested choice doesn't exist; the message gives the reason."""


@dataclass(frozen=True)
class Contrast:
    """The result of a request for an alternative.

    `behavior` and `arguments` are the requested step, if a step was requested; `instead` is the step of the plan that
    the requested step replaces. `lacks` lists the failing conditions, if the requested step isn't applicable. `plan` is
    the complete plan with the alternative; `cost` is the cost of that plan, and `before` is the cost of the original
    plan. `proved` states whether every complete plan with the alternative costs at least as much. `reason` states why no plan
    with the alternative was found. If `lacks`, `plan` and `reason` are all empty, the original plan already contains the step, as
    `instead`.
    """

    before: float
    behavior: str = ""
    arguments: tuple[str, ...] = ()
    instead: Step | None = None
    lacks: tuple[Condition, ...] = ()
    plan: Plan | None = None
    cost: float | None = None
    proved: bool = False
    reason: Reason | None = None


def instead_of(
    problem: Problem, plan: Plan, behavior: Behavior, given: Bindings, ask: Ask, place: Step | None = None
) -> Contrast:
    """Return the result of replacing a step of a plan by another step.

    For each parameter that isn't `given`, an individual is chosen that makes the step applicable. Candidates for replacement are
    all steps of the behaviour's level, or with `place`, this step or the steps of the level in or above it. Among the candidates in
    whose place the behaviour is applicable, the step most similar to the requested step is replaced.

    Raises
    ------
    NoChoiceError
        The plan has no step to replace.
    """
    rules, before = BehaviorReader(problem), cost_of(problem, plan)
    course = list(on_level(plan.steps, behavior.level))
    places = [
        i for i, step in enumerate(course) if place is None or all(map(eq, step.path, place.path))
    ]  # a path is above another one if it is the beginning of the other one
    if not places:
        raise NoChoiceError(f"the plan has no step that {behavior.name} could replace")
    states = _states(problem, course)
    for i in places:
        for one in course[i].together:
            if one.behavior == behavior.name and given.items() <= _terms(behavior, one.arguments).items():
                return Contrast(before, behavior.name, one.arguments, course[i])
    possible: list[tuple[int, tuple[str, ...]]] = []
    positive = [
        c for c in behavior.preconditions if isinstance(c, ValueCondition | RelationCondition) and not c.negated
    ]
    known = given.keys() | set[str]().union(*map(variables, positive))
    free = [p for p in behavior.parameters if p.name not in known]  # no condition determines these parameters
    for i in places:
        facts = LoggedState(problem, states[i])
        for chosen in product(*(problem.members(p.kind) for p in free)):
            terms = {**given, **{p.name: one for p, one in zip(free, chosen, strict=True)}}
            found = rules.satisfied(behavior.preconditions, terms, behavior.kinds, facts)
            if found is not None:
                possible.append((i, tuple(found[p.name] for p in behavior.parameters)))
    if not possible:
        return _fewest_failures(rules, behavior, given, [(course[i], states[i]) for i in places], before)
    doable = [(i, a) for i, a in possible if successor(problem, behavior, a, states[i]) is not None]
    if not doable:
        at, arguments = possible[0]
        lacks = _beyond(rules, behavior, arguments, states[at])
        return Contrast(before, behavior.name, arguments, course[at], lacks, reason=None if lacks else NO_NUMBER)
    at, arguments = max(
        doable,
        key=lambda one: (
            len({*course[one[0]].arguments} & {*one[1]}),
            course[one[0]].behavior == behavior.name,
            -one[0],
        ),
    )
    asked = Contrast(before, behavior.name, arguments, course[at])
    step, why = _refined(problem, states[at], behavior, arguments)
    if step is None:
        return replace(asked, reason=why)
    after = followed(problem, Plan((step,)).primitives, states[at]) or states[at]
    later, lowest = _from(problem, behavior.level, after), problem.domain.levels[-1]
    rest = ask(later)
    if rest.plan is None:
        return replace(asked, reason=rest.reason)
    whole = Plan(renumbered((*course[:at], step, *rest.plan.steps)))
    if faults := validate(problem, whole):
        return replace(asked, reason=Reason(faults[0].text))
    same = (
        later.goal_on(lowest).items() <= problem.goal_on(lowest).items()
    )  # the kept steps may have put something at rest
    return replace(asked, plan=whole, cost=cost_of(problem, whole), proved=rest.proved and same and not step.steps)


def with_choice(problem: Problem, plan: Plan, symbol: Symbol, individual: str, ask: Ask) -> Contrast:
    """Return the result of a choice: whenever the individual can take part in a change of the symbol, it must take part.

    Raises
    ------
    NoChoiceError
        No behaviour that changes the symbol has a suitable role for the individual.
    """
    behaviors = {b.name: _bound_to(problem, b, symbol, individual) for b in problem.domain.behaviors.values()}
    if behaviors == problem.domain.behaviors:
        raise NoChoiceError(f"no behaviour that changes {symbol} has a part for {individual}")
    outcome = ask(replace(problem, domain=replace(problem.domain, behaviors=behaviors)))
    before = cost_of(problem, plan)
    if outcome.plan is None:
        return Contrast(before, reason=outcome.reason)
    return Contrast(before, plan=outcome.plan, cost=cost_of(problem, outcome.plan), proved=outcome.proved)


def _beyond(
    rules: BehaviorReader, behavior: Behavior, arguments: tuple[str, ...], state: State
) -> tuple[Condition, ...]:
    """If a behaviour moves an amount beyond its bounds, return the condition that forbids this; otherwise return nothing."""
    found = rules.beyond(behavior, arguments, LoggedState(rules.problem, state))
    if found is None:
        return ()
    symbol, old, new = found[0].symbol, Fraction(found[0].value), Fraction(found[1].value)
    quantity = rules.problem.domain.situations[symbol.situation].quantity
    assert quantity is not None
    sign, bound = ("<=", quantity.most) if quantity.most is not None and new > quantity.most else (">=", quantity.least)
    needed = old if bound is None else old + bound - new
    return (Comparison(Amount(symbol.situation, symbol.arguments), sign, needed),)


def _bound_to(problem: Problem, behavior: Behavior, symbol: Symbol, individual: str) -> Behavior:
    """Return a behaviour that changes a symbol only if an individual has one of its roles; unchanged if no role suits it."""
    parts = [name for name, kind in behavior.kinds.items() if individual in problem.members(kind)]
    if (
        individual not in symbol.arguments[:1]
    ):  # a behaviour with the individual as the changed one changes another symbol
        effects = [effect for effect in behavior.effects if effect.situation == symbol.situation]
        parts = [part for part in parts if not any(part in effect.arguments[:1] for effect in effects)]
    if not parts:
        return behavior
    asks: list[Condition] = []
    for effect in behavior.effects:
        pairs = [
            (t, a) for t, a in zip(effect.arguments, symbol.arguments, strict=False) if t in behavior.kinds or t != a
        ]
        if effect.situation != symbol.situation or any(term not in behavior.kinds for term, _ in pairs):
            continue
        taken = tuple((EqualityCondition(part, individual),) for part in parts)
        inner = tuple(substituted(condition, dict(pairs)) for condition in effect.when)
        if inner:  # the change depends on these conditions, which may determine the terms
            asks.append(AnyOf((*taken, (AnyOf((inner,), negated=True),))))
        else:
            asks.append(AnyOf((*taken, *((EqualityCondition(term, name, negated=True),) for term, name in pairs))))
    return replace(behavior, preconditions=(*behavior.preconditions, *dict.fromkeys(asks)))


def _states(problem: Problem, course: Sequence[Step]) -> list[State]:
    """Return the state before each of some steps."""
    states = [problem.initial]
    for step in course[:-1]:
        states.append(followed(problem, Plan((step,)).primitives, states[-1]) or states[-1])
    return states


def _terms(behavior: Behavior, arguments: Sequence[str]) -> Bindings:
    return {p.name: argument for p, argument in zip(behavior.parameters, arguments, strict=True)}


def _fewest_failures(
    rules: BehaviorReader, behavior: Behavior, given: Bindings, places: Sequence[tuple[Step, State]], before: float
) -> Contrast:
    """Return the place at which the fewest conditions of a behaviour fail, and these conditions."""
    found = []
    for step, state in places:
        facts = (LoggedState(rules.problem, state),)
        bindings, lacks = failing_conditions(rules, behavior.preconditions, given, behavior.kinds, facts)
        arguments = tuple(bindings.get(p.name, p.name) for p in behavior.parameters)
        found.append(Contrast(before, behavior.name, arguments, step, lacks))
    return min(found, key=lambda one: len(one.lacks))


def _refined(
    problem: Problem, state: State, behavior: Behavior, arguments: tuple[str, ...]
) -> tuple[Step | None, Reason | None]:
    """Return a step with its refinement from a state, or the reason why the step has no refinement."""
    step = Step((0,), problem.id_of(behavior.name, arguments), behavior.level, behavior.name, arguments)
    after = successor(problem, behavior, arguments, state)
    if behavior.level == problem.domain.levels[-1] or after is None or after == state:
        return step, None
    only = tuple(EqualityCondition(p.name, a) for p, a in zip(behavior.parameters, arguments, strict=True))
    forced = replace(behavior, preconditions=(*behavior.preconditions, *only))
    lower = {b.name: b for b in problem.domain.behaviors.values() if b.level > behavior.level}
    goal = {symbol: value for symbol, value in after.items() if state.get(symbol) != value}
    domain = replace(problem.domain, behaviors={behavior.name: forced, **lower})
    outcome = solve(Request(replace(problem, domain=domain, initial=state, goal=goal)))
    if outcome.plan is None or [one.behavior for step in outcome.plan.steps for one in step.together] != [
        behavior.name
    ]:
        return None, outcome.reason or Reason(f"no steps of the level below have the effects of {step}")
    return replace(outcome.plan.steps[0], id=step.id), None


def _from(problem: Problem, level: int, state: State) -> Problem:
    """Return the problem whose initial state is a state between two steps of a level, with the behaviours up to that level."""
    behaviors = {b.name: b for b in problem.domain.behaviors.values() if b.level >= level}
    goal = problem.goal_on(level)
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors), initial=state, goal=goal)
