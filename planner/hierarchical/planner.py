"""The default planner: an agenda of goals, each achieved on its level and refined at once; then the plan is shortened.

======  =========================================================================  =========================================
word    meaning                                                                    module
======  =========================================================================  =========================================
agenda  goals one after another, with larger budgets where goals get stuck         `confab.planner.hierarchical.agenda`
call    achieve a goal: its steps are applied to the table and kept                `confab.planner.hierarchical.call`
chains  relevant achievers of a value, and a few relevant steps                    `confab.planner.hierarchical.chains`
scope   a part of the world is cut out, grounded and searched without levels       `confab.planner.hierarchical.scope`
refine  replace a step by lower-level steps: a method, a chain, a scope            `confab.planner.hierarchical.refinement`
prove   when the agenda gets stuck: test whether there is no plan                  `confab.planner.hierarchical.unsolvability`
shorten other orders of the goals, windows of steps, removal of detours            `confab.planner.hierarchical.shortening`
======  =========================================================================  =========================================

A failed search of a level above the lowest never proves that there is no plan.
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
"""Maximum work of planning a task of one level as a whole before goals in series, in bits of relaxed plans: some seconds."""
FLAT_ROWS = 30_000
"""Maximum number of rows of a join when such a task is grounded."""
NOT_LEFT = "levels aren't to be left"
SEARCHING = 0.93
"""Share of the time limit that is used for search; the rest is for releasing memory."""


def alone(call: Call) -> None:
    """Follow no advice."""


def plan(
    problem: Problem,
    *,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    improve: int = ORDERS,
    using: Compiled | None = None,
    leave_levels: bool = True,
    advised: Callable[[Call], None] = alone,
) -> Outcome:
    """Plan with goals in series on a mutable state table, refining each step at once.

    Parameters
    ----------
    problem : Problem
    limits : Limits
    improve : int
        Work for shortening the first plan, by other orders of the goals and other means; 0 leaves it as it is.
    using : Compiled, optional
        From `compiled`, for a problem with the same domain, individuals and static facts; saves the compilation.
    leave_levels : bool
        Whether steps of a lower level may take the place of a level that has no refinable plan.
    advised : function of a call, optional
        Attaches advice to the call.

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
        flat = flat_first(problem, limits, deadline)  # saves compiling thousands of conditional effects
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
    """Plan the lowest level as a whole, unless levels must not be left or the level is too large."""
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
        call.given_up.clear()  # the plan has steps of that level after all
    return call.outcome(flat.status, plan, flat.reason)


def given_up(call: Call, why: str) -> Outcome:
    """Return an outcome that says that planning gave up, and at which point."""
    from confab.planner.hierarchical.stuck import gave_up

    return call.outcome(Status.GAVE_UP, reason=gave_up(call, why))


def by_rules_alone(call: Call) -> bool:
    """Achieve the goals one after another by rules, if rules exist for all of their kinds; return whether that succeeded."""
    return call.advice is not None and call.advice.expects and Agenda(call, (), solvable=True).achieve_all()


def flat_first(problem: Problem, limits: Limits, deadline: float | None) -> Outcome:
    """Plan a task of one level as a whole with bounded work; give up where that isn't enough.

    A task of one level has no refinements that could guide goals in series, and may be too large to be grounded, or have too many
    goals.
    """
    from confab.planner.grounded.best_first import plan_level

    left = None if deadline is None else max(deadline - perf_counter(), 0.0)
    within = Limits(limits.expansions, left)
    return plan_level(problem, None, None, problem.goal_on(problem.domain.levels[0]), within, FLAT, FLAT_ROWS)


def lowest_alone(call: Call, limits: Limits, most_work: float) -> Outcome:
    """Plan the lowest level from the initial state; if a plan leaves a touched symbol not at rest, require rest of all."""
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
    if wanted is not goal and flat.status is Status.UNSOLVABLE:  # a plan that touches fewer symbols may still exist
        return replace(
            flat, status=Status.GAVE_UP, reason=Reason("plans were found that leave what they touch not at rest")
        )
    return flat
