"""The flat core: one level of a problem, grounded and searched without hierarchy.

It plans imported domains that have one level only, and is the last resort where refinement fails.

state       a Python integer, a bit per fact
h           relaxed-plan heuristic of a state (`planner.grounded.hff`)
best        least h so far; a lower one boosts the preferred operators and is followed by a lookahead
open        two queues of expanded nodes, by h: with all of a node's operators, with its preferred ones

Lazy greedy best-first search with preferred operators: Richter and Helmert, "Preferred operators and deferred
evaluation in satisficing planning", ICAPS 2009. Lookahead: Vidal, "A lookahead strategy for heuristic search
planning", ICAPS 2004. What is found is made shorter by `planner.grounded.plan_windows`.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from time import perf_counter

from planner.grounded.grounding import ground
from planner.grounded.hff import Evaluate
from planner.grounded.hff_numba import automatic
from planner.grounded.novelty import OutOfMemoryError, Seen, by_novelty, successors
from planner.grounded.plan_windows import shorter
from planner.grounded.task import Task
from planner.grounded.unreachable import blocked
from planner.plan import Counts, Limits, Outcome, OutOfTimeError, Plan, Reason, Status, TooLargeError
from reasoner.symbols import Problem, State

BOOST = 1000  # turns that the preferred operators get on a new best h
FAR = 1 << 40  # more than any h
SHORTEN, SHORTENING = 200_000, 50  # work on the finished plan: operators, and a fiftieth of the bits of the search's


@dataclass(frozen=True)
class Flat:
    """What a flat search found: `plan`, operators of the task, is there exactly if `status` is solved."""

    status: Status
    plan: tuple[int, ...] = ()
    reason: Reason | None = None
    counts: Counts = field(default_factory=Counts)


def plan_level(
    problem: Problem,
    level: int | None = None,
    initial: State | None = None,
    goal: State | None = None,
    limits: Limits = Limits(),  # noqa: B008 - frozen
) -> Outcome:
    """Plan one level of a problem, the lowest if none is given.

    Parameters
    ----------
    problem : Problem
    level : int, optional
    initial, goal : State, optional
        In place of the problem's own; by default what is at rest in the beginning is wanted to be so in the end.
    limits : Limits
        The time includes grounding.

    Returns
    -------
    Outcome
        Unsolvable is said of this level only.
    """
    began = perf_counter()
    deadline = None if limits.seconds is None else began + limits.seconds
    level = problem.domain.levels[-1] if level is None else level
    goal = problem.goal_on(level) if goal is None else goal
    try:
        task = ground(problem, level, initial, goal, deadline=deadline)
    except (TooLargeError, OutOfTimeError) as error:
        return Outcome(Status.GAVE_UP, reason=Reason(f"grounding: {error}"), seconds=perf_counter() - began)
    if isinstance(task, Reason):
        return Outcome(Status.UNSOLVABLE, reason=task, search={level: Counts()}, seconds=perf_counter() - began)
    found = search(task, limits, deadline)
    plan = Plan(task.steps(found.plan)) if found.status is Status.SOLVED else None
    return Outcome(found.status, plan, found.reason, {level: found.counts}, seconds=perf_counter() - began)


def search(
    task: Task,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    deadline: float | None = None,
    evaluate: Evaluate | None = None,
    found: Callable[[Sequence[int]], None] | None = None,
) -> Flat:
    """Search a plan for a grounded task.

    Five searches share the time: by novelty, broad and deep; by h with lookahead, without it, since it can lead astray, and by
    open goals first. Work is counted and not timed: the same limit of expansions (of those by h) gives the same plan, and a
    deadline can only cut the search short.

    Parameters
    ----------
    task : Task
    limits : Limits
        Their seconds are the caller's to turn into a deadline.
    deadline : float, optional
        On the clock of `time.perf_counter`.
    evaluate : function of a state, optional
        In place of h_FF, plain at first and compiled once the search turns out to be long (`planner.grounded.hff_numba.automatic`).
    found : function of a plan, optional
        Called with the first plan, before it is made shorter.
    """
    counts = Counts()
    if task.initial & task.goal == task.goal:
        return Flat(Status.SOLVED, (), None, counts)
    evaluate = evaluate or automatic(task)
    if evaluate(task.initial) is None:
        return Flat(Status.UNSOLVABLE, (), blocked(task), counts)
    tree = successors(task)
    searches: list[tuple[float, Generator[int, None, tuple[Seen, int] | None]]] = [
        (6, by_novelty(task, tree, evaluate, counts, deep=False)),
        (4, _best_first(task, evaluate, counts, lookahead=True, goals_first=False)),
        (3, by_novelty(task, tree, evaluate, counts, deep=True)),
        (1, _best_first(task, evaluate, counts, lookahead=False, goals_first=False)),
        (1, _best_first(task, evaluate, counts, lookahead=True, goals_first=True)),
    ]
    spent = [0.0] * len(searches)
    total = 0
    while True:
        turn = spent.index(min(spent))
        share, search_ = searches[turn]
        try:
            work = next(search_)
            total += work
            spent[turn] += work / share
        except OutOfMemoryError:
            del searches[turn], spent[turn]
        except StopIteration as done:
            if done.value is None:
                return Flat(
                    Status.UNSOLVABLE,
                    (),
                    Reason("no plan exists: all states that can be reached were searched"),
                    counts,
                )
            plan = _path(*done.value)
            if found:
                found(plan)
            work = SHORTEN + total // SHORTENING
            return Flat(Status.SOLVED, tuple(shorter(task, plan, work, deadline)), None, counts)
        if counts.expanded >= limits.expansions:
            return Flat(Status.GAVE_UP, (), Reason(f"the limit of {limits.expansions} expansions came first"), counts)
        if deadline is not None and perf_counter() > deadline:
            return Flat(Status.GAVE_UP, (), Reason("the time limit came first"), counts)


def _best_first(
    task: Task, evaluate: Evaluate, counts: Counts, lookahead: bool, goals_first: bool
) -> Generator[int, None, tuple[Seen, int] | None]:
    """Search greedily; yield the work of each evaluation, return what was seen and the last state, or None if there is no plan."""
    apply, goal = task.applied, task.goal
    came_from: Seen = {task.initial: (task.initial, ())}
    queues: tuple[list[tuple[int, int, int, list[int]]], ...] = (
        [],
        [],
    )  # (h, number, state, operators still to be tried)
    turns = [0, 0]
    number, best = 0, 1 << 60
    waiting = [task.initial]  # states to be evaluated, the last first
    while True:
        if not waiting:
            if not queues[0] and not queues[1]:
                return None
            which = int(not queues[0] or (bool(queues[1]) and turns[1] <= turns[0]))
            turns[which] += 1
            _, _, state, operators = queues[which][0]
            operator = operators.pop()
            if not operators:
                heapq.heappop(queues[which])
            after = apply(state, operator)
            counts.generated += 1
            if after is None or after in came_from:
                continue
            came_from[after] = (state, (operator,))
            waiting.append(after)
        state = waiting.pop()
        if state & goal == goal:
            return came_from, state
        evaluation = evaluate(state)
        counts.evaluated += 1
        yield task.relaxing
        if evaluation is None:
            continue
        counts.expanded += 1
        h, relaxed_plan, applicable = evaluation
        if goals_first:
            h += FAR * (goal & ~state).bit_count()
        number += 1
        possible = set(applicable)
        preferred = [operator for operator in relaxed_plan if operator in possible]
        if applicable:
            rest = possible.difference(preferred)
            heapq.heappush(queues[0], (h, number, state, [*sorted(rest, reverse=True), *preferred[::-1]]))
        if preferred:
            heapq.heappush(queues[1], (h, number, state, preferred[::-1]))
        if h < best:
            best = h
            turns[1] -= BOOST
            if lookahead:
                after, path = _ahead(task, state, relaxed_plan)
                if len(path) > 1 and after not in came_from:
                    came_from[after] = (state, tuple(path))
                    waiting.append(after)


def _ahead(task: Task, state: int, relaxed_plan: Sequence[int]) -> tuple[int, list[int]]:
    """Apply a relaxed plan as far as it goes; return the state reached and the operators applied."""
    path: list[int] = []
    left = list(relaxed_plan)
    while True:
        stuck = []
        for operator in left:
            after = task.applied(state, operator)
            if after is None:
                stuck.append(operator)
            elif after != state:
                state = after
                path.append(operator)
        if len(stuck) == len(left):
            return state, path
        left = stuck


def _path(came_from: Seen, state: int) -> list[int]:
    parts: list[tuple[int, ...]] = []
    while True:
        before, operators = came_from[state]
        if not operators:
            return [operator for part in reversed(parts) for operator in part]
        parts.append(operators)
        state = before
