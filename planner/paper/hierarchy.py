"""The hierarchical planner: search on the most abstract level, then refine each behaviour on the level below, down to primitives.

The goal of a refinement is the complete state after the behaviour that is refined, with the rest values of the symbols that
the lower level adds (hands empty; hands raised and upright). A behaviour that can't be refined where it stands is forbidden
there, and the level above is searched again. When a level has no plan at all, the level below is given the goal itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter

from planner.hierarchical.operators import Program
from planner.hierarchical.state import Table, key_of
from planner.hierarchical.subplans import Segments
from planner.hierarchical.unsolvability import contested, unattainable
from planner.paper.astar import Found, Goal, a_star
from planner.paper.cogency import PAPER, PaperConstants, cogencies, ranking
from planner.paper.transitions import Applied, Model, Values, ground
from planner.plan import Counts, Limits, Outcome, Plan, Reason, Status, Step
from reasoner.memory.links import Links
from reasoner.symbols import GroundBehavior, Problem

Forbidden = set[tuple[Values, GroundBehavior]]


@dataclass
class Call:
    """One planning call: the compiled problem, what guides it, and what it has counted."""

    model: Model
    grounds: Mapping[int, tuple[GroundBehavior, ...]]
    links: Links
    constants: PaperConstants
    limits: Limits
    deadline: float | None
    counts: dict[int, Counts] = field(default_factory=dict)
    forbidden: Forbidden = field(default_factory=set)
    fallbacks: int = 0
    gave_up: bool = False


def plan(
    problem: Problem,
    links: Links | None = None,
    constants: PaperConstants = PAPER,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    grounds: Mapping[int, tuple[GroundBehavior, ...]] | None = None,
) -> Outcome:
    """Plan in the paper's mode: A* with eq. (5) on each level, refined level by level.

    Parameters
    ----------
    problem : Problem
    links : Links, optional
        The confabulation memory; none learned if left out.
    constants : PaperConstants
    limits : Limits
        Expansions for each search, seconds for the whole call.
    grounds : mapping of level to quantified behaviours, optional
        As `reasoner.reading.quantification` returns them; quantified here from the problem's classes if left out.

    Returns
    -------
    Outcome
    """
    begin = perf_counter()
    levels = problem.domain.levels
    call = _call(problem, levels, links, constants, limits, grounds)
    start, goal = call.model.values(problem.initial), _goal(call.model)
    proof = impossible(problem)
    steps = None
    for level in levels if proof is None else ():
        steps = solve(call, level, start, goal)
        if steps is not None or call.gave_up:
            break
        call.fallbacks += level != levels[-1]
    seconds = perf_counter() - begin
    if steps is not None:
        tree = Plan(tuple(_numbered(steps)))
        return Outcome(Status.SOLVED, tree, None, call.counts, call.fallbacks, seconds)
    status = Status.GAVE_UP if call.gave_up else Status.UNSOLVABLE
    return Outcome(status, None, proof or _reason(status, limits, levels), call.counts, call.fallbacks, seconds)


def flat(
    problem: Problem,
    level: int,
    links: Links | None = None,
    constants: PaperConstants = PAPER,
    limits: Limits = Limits(),  # noqa: B008 - frozen
) -> Outcome:
    """Search one level alone with the same f, without the hierarchy: what the hierarchy is measured against."""
    begin = perf_counter()
    call = _call(problem, (level,), links, constants, limits, None)
    steps = solve(call, level, call.model.values(problem.initial), _goal(call.model))
    seconds = perf_counter() - begin
    if steps is not None:
        return Outcome(Status.SOLVED, Plan(tuple(_numbered(steps))), None, call.counts, 0, seconds)
    status = Status.GAVE_UP if call.gave_up else Status.UNSOLVABLE
    return Outcome(status, None, _reason(status, limits, (level,)), call.counts, 0, seconds)


def _call(
    problem: Problem,
    levels: tuple[int, ...],
    links: Links | None,
    constants: PaperConstants,
    limits: Limits,
    grounds: Mapping[int, tuple[GroundBehavior, ...]] | None,
) -> Call:
    return Call(
        model=Model(problem),
        grounds=grounds or {level: ground(problem, level) for level in levels},
        links=links or Links(),
        constants=constants,
        limits=limits,
        deadline=None if limits.seconds is None else perf_counter() + limits.seconds,
        counts={level: Counts() for level in levels},
    )


def _goal(model: Model) -> Goal:
    return {i: model.problem.goal[symbol] for i, symbol in enumerate(model.symbols) if symbol in model.problem.goal}


def impossible(problem: Problem) -> Reason | None:
    """Return a proof that there is no plan, if one is cheap (`planner.hierarchical.unsolvability`)."""
    goal = {(symbol.situation, key_of(symbol.arguments)): value for symbol, value in problem.goal.items()}
    segments = Segments(Program(problem), Table(problem.domain.situations, problem.initial), goal)
    return unattainable(segments) or contested(segments)


def solve(call: Call, level: int, start: Values, goal: Goal) -> list[Step] | None:
    """Return steps of one level, refined down to primitives, or None if there are none that can all be refined.

    Each pass either succeeds or forbids one behaviour in one state, of which there are finitely many.
    """
    while True:
        found = search(call, level, start, goal)
        if found.status is not Status.SOLVED:
            call.gave_up |= found.status is Status.GAVE_UP
            return None
        steps: list[Step] = []
        state = start
        for applied, rank in zip(found.path, found.ranks, strict=True):
            step = refine(call, level, state, applied)
            if step is None:
                call.forbidden.add((state, applied.ground))
                break
            steps.append(replace(step, rank=rank))
            state = applied.after
        else:
            return steps
        if call.gave_up:
            return None


def refine(call: Call, level: int, state: Values, applied: Applied) -> Step | None:
    """Return a behaviour as a step with its refinement below it, or None if the level below can't do it from this state."""
    below = [other for other in call.grounds if other > level]
    steps: list[Step] | None = []
    if below:
        steps = solve(call, below[0], state, refinement_goal(call.model, level, below[0], applied.after))
    if steps is None:
        return None
    g = applied.ground
    return Step((), g.id, level, g.behavior, g.arguments, applied.bindings, None, tuple(steps))


def refinement_goal(model: Model, level: int, below: int, after: Values) -> Goal:
    """Return the complete state after a behaviour, as its level knows it, and rest in what the level below adds."""
    goal = {}
    for i, symbol in enumerate(model.symbols):
        situation = model.problem.domain.situations[symbol.situation]
        if situation.level <= level:
            goal[i] = after[i]
        elif situation.level <= below and situation.rest is not None:
            goal[i] = situation.rest
    return goal


def search(call: Call, level: int, start: Values, goal: Goal) -> Found:
    """Search one level with eq. (5), over the behaviours that aren't forbidden where they would be done."""
    grounds = call.grounds[level]
    behaviors = call.model.problem.domain.behaviors

    def successors(state: Values) -> Iterable[Applied]:
        for applied in call.model.successors(grounds, state):
            if (state, applied.ground) not in call.forbidden:
                yield applied

    found = a_star(
        start=start,
        goal=goal,
        successors=successors,
        cost=lambda applied: behaviors[applied.ground.behavior].cost,
        rank=ranker(call, level),
        bonus=call.constants.bonus,
        limits=call.limits,
        deadline=call.deadline,
    )
    call.counts[level].add(found.counts)
    return found


def ranker(call: Call, level: int) -> Callable[[Values], Callable[[Applied], float]]:
    """Return a function of a state to the ranking scores c_m (eq. 4) of what can be done there."""
    conclusions = [(g.behavior, g.arguments) for g in call.grounds[level]]
    learned = any(conclusion in call.links.tables for conclusion in conclusions)

    def of_state(values: Values) -> Callable[[Applied], float]:
        if not learned:
            return lambda applied: 1.0 / len(conclusions)  # all tie for the first rank
        among = conclusions
        if call.constants.rank_among == "applicable":
            among = [
                (a.ground.behavior, a.ground.arguments) for a in call.model.successors(call.grounds[level], values)
            ]
        problem = call.model.problem
        ranks = ranking(cogencies(call.links, among, call.model.state(values), problem, level))
        return lambda applied: ranks[applied.ground.behavior, applied.ground.arguments]

    return of_state


def _numbered(steps: Iterable[Step], above: tuple[int, ...] = ()) -> Iterable[Step]:
    """Yield the steps with their paths filled in."""
    for position, step in enumerate(steps):
        path = (*above, position)
        yield replace(step, path=path, steps=tuple(_numbered(step.steps, path)))


def _reason(status: Status, limits: Limits, levels: tuple[int, ...]) -> Reason:
    if status is Status.GAVE_UP:
        limit = f"{limits.expansions} expansions in one search"
        return Reason(f"stopped at the limit of {limit}" + (f" or {limits.seconds} s" if limits.seconds else ""))
    return Reason(f"no state with the goal's facts can be reached; all states of level {levels[-1]} were tried")
