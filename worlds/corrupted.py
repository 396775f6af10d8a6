"""Mostly invalid plans: valid plans with one random change, and random steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random

from confab.planner.plan import Plan, Step, renumbered
from confab.reasoner.problem import Problem
from worlds.interpreter import Interpreter


def corrupted(plan: Plan, problem: Problem, rng: Random) -> Plan:
    """Return a plan with one random change in its tree; a plan without steps stays as it is."""
    if not plan.steps:
        return plan
    path = rng.choice([step.path for step in plan.walk()])
    return Plan(renumbered(_changed(plan.steps, path, problem, rng)))


def _changed(steps: tuple[Step, ...], path: tuple[int, ...], problem: Problem, rng: Random) -> tuple[Step, ...]:
    first, *rest = path
    before, step, after = steps[:first], steps[first], steps[first + 1 :]
    if rest:
        return (*before, replace(step, steps=_changed(step.steps, tuple(rest), problem, rng)), *after)
    how = rng.choice(
        ("drop", "drop", "twice", "swap", "argument", "argument", "behavior", "flatten", "empty", "join", "join")
    )
    if how == "twice":
        return (*before, step, step, *after)
    if how == "swap" and after:
        return (*before, after[0], step, *after[1:])
    if how == "argument" and step.arguments:
        kinds = problem.domain.behaviors[step.behavior].parameters
        place = rng.randrange(len(kinds))
        other = rng.choice(problem.classes[kinds[place].kind])
        return (
            *before,
            replace(step, arguments=(*step.arguments[:place], other, *step.arguments[place + 1 :])),
            *after,
        )
    if how == "behavior":
        one = rng.choice(problem.domain.at_level(step.level))
        members = [problem.classes[p.kind] for p in one.parameters]
        if all(members):
            arguments = tuple(map(rng.choice, members))
            return (*before, replace(step, behavior=one.name, arguments=arguments), *after)
    if how == "join" and step.joined and rng.random() < 0.5:
        joined = list(step.joined) * rng.randint(1, 2)
        rng.shuffle(joined)
        return (*before, replace(step, joined=tuple(joined[rng.randint(0, 1) :])), *after)
    if how == "join" and after:  # often valid
        those = tuple(replace(one, steps=(), joined=()) for one in after[0].together)
        both = replace(step, steps=(*step.steps, *after[0].steps), joined=(*step.joined, *those))
        return (*before, both, *after[1:])
    if how == "flatten":
        return (*before, *step.steps, *after)
    if how == "empty":
        return (*before, replace(step, steps=()), *after)
    return (*before, *after)


def random_steps(meant: Interpreter, rng: Random) -> Plan:
    """Return a few random steps of the lowest level, most of them applicable."""
    level, state, steps = meant.problem.domain.levels[-1], meant.initial, list[Step]()
    actions = meant.actions(level)
    for _ in range(rng.randint(1, 4)):
        possible = [(a, made) for a in actions for outcome in a.outcomes if (made := outcome(state)) is not None]
        if not possible or rng.random() < 0.1:
            possible = [(rng.choice(actions), (0, state))] if actions else []
        if not possible:
            break
        action, (_, state) = rng.choice(possible)
        steps.append(Step((len(steps),), 0, level, action.behavior.name, action.arguments))
    return Plan(tuple(steps))


def numbered(plan: Plan, problem: Problem) -> Plan:
    """Return a plan whose steps have the IDs that the problem determines."""

    def those(steps: tuple[Step, ...]) -> Iterator[Step]:
        for step in steps:
            own = problem.id_of(step.behavior, step.arguments)
            yield replace(step, id=own, steps=tuple(those(step.steps)), joined=tuple(those(step.joined)))

    return Plan(tuple(those(plan.steps)))
