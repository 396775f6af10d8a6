"""The steps of an episode from which rules are learned: the whole steps that were executed as planned.

An intervention, a failure or an unexpected observation divides an episode into parts. Each part is a valid plan from the situation
that was observed before its first step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from confab.planner.acting.episode import Episode, InterventionKind, situation
from confab.planner.acting.symbolic_world import met, with_individual
from confab.planner.plan import Plan, Step
from confab.planner.validation import carried_out, followed, open_goals
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, State


def as_planned(problem: Problem, episode: Episode) -> Iterator[tuple[Problem, Plan]]:
    """Yield the parts of an episode that were executed as planned, each with its problem.

    If the executed steps are a valid plan from the first to the last observed situation, they are the only part, even if they
    overlapped in time. Otherwise, a part consists of consecutive first-level steps. The plan checker accepts each step in the
    situation that was observed before the step, and no primitive of the step had an unexpected effect. The initial state of the
    problem is the situation that was observed before the part, and the goals of the problem are the goals of the episode that
    held after the part.
    """
    problem = with_newcomers(problem, episode)
    start = replace(problem, initial=episode.initial, goal={})
    if not any(event.surprises for event in episode.events) and not carried_out(start, episode.done):
        expected = after(problem, episode.done, episode.initial)
        if episode.done.steps and equal(expected, episode.observed):
            yield with_reached_goals(start, expected, episode.goal), episode.done
            return
    part, expected, ended = list[Step](), episode.initial, 0.0
    for step in episode.done.steps:
        done = {(low.path, low.behavior, low.arguments) for low in Plan((step,)).primitives}
        events = [e for e in episode.events if (e.step.path, e.step.behavior, e.step.arguments) in done]
        if not events:
            continue  # nothing was observed
        before = situation(episode.initial, episode.course, events[0].begin)
        here = replace(problem, initial=before, goal={})
        alone = events[0].begin >= ended  # otherwise, nothing was observed between the earlier steps and this step
        whole = alone and not any(event.surprises for event in events) and not carried_out(here, Plan((step,)))
        ended = max(ended, events[-1].end)
        if part and not (whole and equal(before, expected)):
            yield with_reached_goals(start, expected, episode.goal), Plan(tuple(part))
            part = []
        if whole:
            start, part, expected = start if part else here, [*part, step], after(problem, Plan((step,)), before)
    if part:
        yield with_reached_goals(start, expected, episode.goal), Plan(tuple(part))


def observed_before(episode: Episode) -> dict[int, State]:
    """Return the situations that were observed before executed primitives, by the primitive's position in the sequence.

    A primitive is left out if it took no time, or if not exactly the earlier primitives of the sequence had ended when it began.
    """
    last = {(event.step.path, event.step.behavior, event.step.arguments): event for event in episode.events}
    events = [last.get((step.path, step.behavior, step.arguments)) for step in episode.done.primitives]
    times = [(math.inf, math.inf) if event is None else (event.begin, event.end) for event in events]
    return {
        position: situation(episode.initial, episode.course, begin)
        for position, (begin, end) in enumerate(times)
        if begin < end
        and all(ended <= begin for _, ended in times[:position])
        and all(begin <= later for later, _ in times[position:])
    }


def after(problem: Problem, plan: Plan, state: State) -> State:
    """Return the state after a valid plan."""
    found = followed(problem, plan.primitives, state)
    assert found is not None, "the plan checker has accepted the plan"
    return found


def with_newcomers(problem: Problem, episode: Episode) -> Problem:
    """Return a problem with the individuals that were added or discovered during an episode."""
    for intervention, _ in episode.interventions:
        if intervention.change is InterventionKind.ADD:
            problem = with_individual(problem, intervention.individual, intervention.kind)
    for found, _ in episode.discovered:
        problem = met(problem, found)
    return problem


def with_reached_goals(problem: Problem, after: State, goal: State) -> Problem:
    """Return a problem with those goals that hold in the state `after`."""
    left = {fact.symbol for fact in open_goals(replace(problem, initial=after, goal=goal))}
    return replace(problem, goal={symbol: value for symbol, value in goal.items() if symbol not in left})


def equal(one: State, other: State) -> bool:
    """Return whether two states have the same facts; a symbol without a value is false."""
    return all(one.get(symbol, FALSE) == other.get(symbol, FALSE) for symbol in one.keys() | other.keys())
