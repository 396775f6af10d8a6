"""The default planner: an agenda of goals, each achieved on its level and refined at once; then the plan is shortened.

======  =========================================================================  =========================================
word    what is done                                                               module
======  =========================================================================  =========================================
agenda  goals one after the other, with more effort where these get stuck          `confab.planner.hierarchical.agenda`
call    achieve a goal: its steps are done on the table and kept                   `confab.planner.hierarchical.call`
chains  what is relevant to a value, and a few relevant steps                      `confab.planner.hierarchical.chains`
scope   a part of the world is cut out, grounded and searched flat                 `confab.planner.hierarchical.scope`
refine  each step is done by steps of the level below: a method, a chain, a scope  `confab.planner.hierarchical.refinement`
prove   where the agenda gets stuck: that there is no plan                         `confab.planner.hierarchical.unsolvability`
shorten other orders of the goals, windows of steps, no detours                    `confab.planner.hierarchical.shortening`
======  =========================================================================  =========================================

What is concluded from a level above the lowest is never that there is no plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Call, Compiled, compiled
from confab.planner.hierarchical.scope import BITS
from confab.planner.hierarchical.shortening import ORDERS, shortened
from confab.planner.hierarchical.windows import regroupings
from confab.planner.plan import Limits, Outcome, Reason, Status, UnsolvableError, paused_collection
from confab.planner.transitions import arguments_of
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError, within
from confab.reasoner.symbols import Problem, Symbol

__all__ = ["ORDERS", "Call", "Compiled", "compiled", "plan"]

FLAT = 50_000_000
"""What a task of one level may cost as a whole before its goals are taken in series, in bits of relaxed plans: some seconds."""
FLAT_ROWS = 30_000
"""The largest join of such a task, on the way to its operators."""
NOT_LEFT = "levels aren't to be left"
SEARCHING = 0.93
"""Of the time limit, the share to search in: giving back what was allocated takes the rest."""


def alone(call: Call) -> None:
    """Take no advice."""


def plan(
    problem: Problem,
    *,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    improve: int = ORDERS,
    using: Compiled | None = None,
    leave_levels: bool = True,
    advised: Callable[[Call], None] = alone,
) -> Outcome:
    """Plan fast: goals in series on one table that is changed in place, steps refined from templates.

    Parameters
    ----------
    problem : Problem
    limits : Limits
    improve : int
        How many other orders of the goals are tried to shorten the first plan, and how much work that is; none leaves it as it is.
    using : Compiled, optional
        From `compiled`, for a problem with the same domain, individuals and static facts; saves compiling again.
    leave_levels : bool
        Whether steps of a lower level may stand where a level has no plan that can be refined.
    advised : function of a call, optional
        Lets advice in.

    Returns
    -------
    Outcome
    """
    begin = perf_counter()
    with within(limits.seconds), paused_collection():
        outcome = _plan(problem, limits, improve, using, leave_levels, advised)
    return replace(outcome, seconds=perf_counter() - begin)


def _plan(
    problem: Problem,
    limits: Limits,
    improve: int,
    using: Compiled | None,
    leave_levels: bool,
    advised: Callable[[Call], None],
) -> Outcome:
    deadline = limits.end(SEARCHING)
    one_level = improve > 0 and len(problem.domain.levels) == 1
    flat = None
    if one_level and advised is alone:
        flat = flat_first(problem, limits, deadline)  # compiling thousands of conditional effects would take longer
        if flat.status is Status.SOLVED:
            return flat
    call = Call(problem, using or compiled(problem), deadline, limits.expansions)
    call.space.most_work = limits.work
    advised(call)
    levels = call.program.levels if leave_levels else call.program.levels[:1]
    agenda = Agenda(call, levels)
    try:
        done = one_level and by_rules_alone(call)
        if one_level and not done:
            flat = flat or flat_first(problem, limits, deadline)
            call.count(flat)
            if flat.status is not Status.GAVE_UP:
                return call.outcome(flat.status, flat.plan, flat.reason)
        if done or agenda.achieve_all():
            call.space.most_work = math.inf
            plan = shortened(call, improve, leave_levels, advised) if improve else call.tree()
            if not leave_levels and any(step.level != levels[0] for step in plan.steps):
                return given_up(call, f"a goal that level {levels[0]} doesn't see takes steps below it: {NOT_LEFT}")
            return call.outcome(Status.SOLVED, plan)
        return last_resort(agenda, limits, leave_levels)
    except UnsolvableError as proof:
        return replace(call.outcome(Status.UNSOLVABLE, reason=proof.reason), certificate=proof.certificate)
    except LimitError as limit:
        return given_up(call, f"stopped at the limit: {limit}")


def last_resort(agenda: Agenda, limits: Limits, leave_levels: bool) -> Outcome:
    """Plan the lowest level alone, flat, unless levels aren't to be left or it is too large."""
    call, problem = agenda.call, agenda.call.problem
    *upper, lowest = call.program.levels
    if upper and not leave_levels:
        return given_up(call, f"no plan of level {upper[0]} was found that can be refined, and {NOT_LEFT}")
    if upper:
        call.given_up.append(
            f"level{'s' * (len(upper) > 1)} {', '.join(map(str, upper))} were given up for the whole task"
        )
    if agenda.too_large is not None:
        return given_up(call, f"goals in series found no plan, and {agenda.too_large.text}")
    flat = lowest_alone(call, limits, BITS * limits.work)
    if flat.status is Status.GAVE_UP and flat.reason is not None:
        return given_up(call, flat.reason.text)
    plans = () if flat.plan is None else regroupings(problem, flat.plan, lowest)
    plan = next((plan for plan in plans if plan is flat.plan or not validate(problem, plan)), None)
    if plan and upper and all(step.level == upper[0] for step in plan.steps):
        call.given_up.clear()  # there are steps of it after all
    return call.outcome(flat.status, plan, flat.reason)


def given_up(call: Call, why: str) -> Outcome:
    """Return that planning gave up, with where it was."""
    from confab.planner.hierarchical.stuck import gave_up

    return call.outcome(Status.GAVE_UP, reason=gave_up(call, why))


def by_rules_alone(call: Call) -> bool:
    """Achieve the goals one after the other as rules advise, if they know all kinds of them; whether that succeeded."""
    return call.advice is not None and call.advice.expects and Agenda(call, (), solvable=True).achieve_all()


def flat_first(problem: Problem, limits: Limits, deadline: float | None) -> Outcome:
    """Plan a task of one level as a whole by bounded work; it is given up where that isn't enough.

    One level has no refinements for goals in series to go by, and may be too large to be grounded, or its goals too many.
    """
    from confab.planner.grounded.best_first import plan_level

    left = None if deadline is None else max(deadline - perf_counter(), 0.0)
    within = Limits(limits.expansions, left)
    return plan_level(problem, None, None, problem.goal_on(problem.domain.levels[0]), within, FLAT, FLAT_ROWS)


def lowest_alone(call: Call, limits: Limits, most_work: float) -> Outcome:
    """Plan the lowest level from the beginning; so that all comes to rest, if else something is touched and left not at rest."""
    from confab.planner.grounded.best_first import plan_level

    problem, deadline, lowest = call.problem, call.space.deadline, call.program.levels[-1]
    call.table.undo(0)
    restless = {cell: value for level in call.program.levels[1:] for cell, value in call.restless(level).items()}
    rests = {Symbol(cell[0], arguments_of(cell[1])): value for cell, value in restless.items()}
    goal = problem.goal_on(lowest)
    for wanted in (goal, {**rests, **goal}):
        left = None if deadline is None else max(deadline - perf_counter(), 0.0)
        flat = plan_level(problem, lowest, None, wanted, Limits(limits.expansions, left), most_work)
        call.count(flat)
        if not rests or flat.plan is None or not validate(problem, flat.plan):
            break
    if (
        wanted is not goal and flat.status is Status.UNSOLVABLE
    ):  # a plan may be left that doesn't touch all that doesn't rest
        return replace(
            flat, status=Status.GAVE_UP, reason=Reason("plans were found that leave what they touch not at rest")
        )
    return flat
