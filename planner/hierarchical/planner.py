"""The default planner: goals in series, proofs and more effort where these get stuck, then flat search; what is found is shortened.

Each stage is cheaper than the next and hands on only what it can't decide. What is concluded from a level above the lowest is
never that there is no plan.

======================  ==============================================  ==============================
stage                   decides                                         module
======================  ==============================================  ==============================
flat search             of one level alone, a bounded while             `confab.planner.grounded.best_first`
goals in series         most problems, in time linear in their size     `confab.planner.hierarchical.serialization`
static proofs           where these get stuck: that a goal lacks a      `confab.planner.hierarchical.unsolvability`
                        static fact, or two goals want one value
more effort             where nothing is proved                         `confab.planner.hierarchical.recovery`
relaxed reachability    in between, that a goal can't be reached, or    `confab.planner.grounded.reachability`
                        that none of a few states fulfils all
flat search             the rest, solved or unsolvable, until a limit   `confab.planner.grounded.best_first`
======================  ==============================================  ==============================
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

from confab.planner.hierarchical.recovery import Recovery
from confab.planner.hierarchical.refinement_cache import MUCH
from confab.planner.hierarchical.serialization import Call, Compiled, compiled
from confab.planner.hierarchical.settling import fresh_call
from confab.planner.hierarchical.shortening import ORDERS, shortened
from confab.planner.hierarchical.subproblem import BITS
from confab.planner.hierarchical.windows import regroupings
from confab.planner.plan import Limits, Outcome, Plan, Reason, Status, UnsolvableError, paused_collection
from confab.planner.transitions import arguments_of
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError, within
from confab.reasoner.symbols import Problem, Symbol

__all__ = ["ORDERS", "Call", "Compiled", "compiled", "plan"]

FLAT = 50_000_000
"""What a task of one level may cost as a whole before its goals are taken in series, in bits of relaxed plans: some seconds."""
FLAT_ROWS = 30_000
"""The largest join of such a task, on the way to its operators."""
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
    with within(limits.seconds), paused_collection():
        return _plan(problem, limits, improve, using, leave_levels, advised)


def _plan(
    problem: Problem,
    limits: Limits,
    improve: int,
    using: Compiled | None,
    leave_levels: bool,
    advised: Callable[[Call], None],
) -> Outcome:
    begin = perf_counter()
    deadline = limits.end(SEARCHING)
    flat = None
    if improve and len(problem.domain.levels) == 1 and advised is alone:
        flat = flat_first(problem, limits, deadline)  # compiling thousands of conditional effects would take longer
        if flat.status is Status.SOLVED:
            return replace(flat, seconds=perf_counter() - begin)
    using = using or compiled(problem)

    call = Call(problem, using, deadline, limits.expansions)
    call.segments.enough = limits.work
    advised(call)

    def outcome(status: Status, plan: Plan | None = None, reason: Reason | None = None) -> Outcome:
        return call.outcome(status, plan, reason, perf_counter() - begin)

    try:
        levels = call.program.levels if leave_levels else call.program.levels[:1]
        solved = False
        if improve and len(call.program.levels) == 1:
            solved = by_rules_alone(call)
            if not solved:
                flat = flat or flat_first(problem, limits, deadline)
                for level, counts in flat.search.items():
                    call.segments.counts[level].add(counts)
                if flat.status is Status.UNSOLVABLE:
                    return outcome(flat.status, None, flat.reason)
                if flat.status is Status.SOLVED:
                    return outcome(flat.status, flat.plan)
            call = call if solved else rested(call, advised)
        recovery = Recovery(call, levels)
        if len(levels) > 1 and not call.at_rest():
            solved = soon(recovery)
            if not solved:
                call = rested(call, advised)
                recovery = Recovery(call, levels)
        if solved or achieved(recovery):
            call.segments.enough = math.inf
            made = shortened(call, improve, leave_levels, advised) if improve else call.tree()
            if call.settled and made.steps and made.steps[0].level != call.program.levels[0]:
                call.given_up.insert(
                    0, "steps of a lower level come first: they bring to rest what isn't in the beginning"
                )
            return outcome(Status.SOLVED, made)
    except UnsolvableError as proof:
        return replace(outcome(Status.UNSOLVABLE, reason=proof.reason), certificate=proof.certificate)
    except LimitError as limit:
        from confab.planner.hierarchical.stuck import gave_up

        return outcome(Status.GAVE_UP, reason=gave_up(call, f"stopped at the limit: {limit}"))
    from confab.planner.hierarchical.stuck import gave_up

    upper = [level for level in call.program.levels if level != call.program.levels[-1]]
    if not leave_levels and upper:
        text = f"no plan of level {upper[0]} was found that can be refined, and levels aren't to be left"
        return outcome(Status.GAVE_UP, reason=gave_up(call, text))
    if upper:
        call.given_up.append(
            f"level{'s' * (len(upper) > 1)} {', '.join(map(str, upper))} were given up for the whole task"
        )
    if recovery.too_large is not None:
        text = f"goals in series found no plan, and {recovery.too_large.text}"
        return outcome(Status.GAVE_UP, reason=gave_up(call, text))
    flat = lowest_alone(call, limits, BITS * limits.work)
    found = None
    if flat.plan is not None:
        plans = regroupings(problem, flat.plan, call.program.levels[-1])
        found = next(plan for plan in plans if plan is flat.plan or not validate(problem, plan))
    if found and upper and all(step.level == upper[0] for step in found.steps):
        call.given_up.clear()  # there are steps of it after all
    gone = flat.status is Status.GAVE_UP and flat.reason is not None
    return outcome(flat.status, found, gave_up(call, flat.reason.text) if gone and flat.reason else flat.reason)


def by_rules_alone(call: Call) -> bool:
    """Achieve the goals one after the other as rules advise, if they know all kinds of them; whether that succeeded."""
    return call.advice is not None and call.advice.expects and call.serialise(Recovery(call, (), solvable=True).harder)


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

    problem, deadline, lowest = call.problem, call.segments.deadline, call.program.levels[-1]
    call.table.undo(0)
    restless = {cell: value for level in call.program.levels[1:] for cell, value in call.restless(level).items()}
    rests = {Symbol(cell[0], arguments_of(cell[1])): value for cell, value in restless.items()}
    goal = problem.goal_on(lowest)
    for wanted in (goal, {**rests, **goal}):
        left = None if deadline is None else max(deadline - perf_counter(), 0.0)
        flat = plan_level(problem, lowest, None, wanted, Limits(limits.expansions, left), most_work)
        for level, counts in flat.search.items():
            call.segments.counts[level].add(counts)
        if not rests or flat.plan is None or not validate(problem, flat.plan):
            break
    if (
        wanted is not goal and flat.status is Status.UNSOLVABLE
    ):  # a plan may be left that doesn't touch all that doesn't rest
        return replace(
            flat, status=Status.GAVE_UP, reason=Reason("plans were found that leave what they touch not at rest")
        )
    return flat


def achieved(recovery: Recovery) -> bool:
    """Do steps after which all goals hold; whether there are some."""
    call = recovery.call
    call.segments.doubt = recovery.doubt
    done = call.serialise(recovery.harder)
    recovery.solvable = recovery.solvable or done
    return done


def soon(recovery: Recovery) -> bool:
    """Do steps after which all goals hold by no more work than one large world; whether there are some."""
    segments = recovery.call.segments
    segments.most_work = MUCH
    try:
        return achieved(recovery)
    except LimitError:
        return False
    finally:
        segments.most_work = math.inf


def rested(call: Call, advised: Callable[[Call], None]) -> Call:
    """Return a call from the beginning once more that first brings to rest what isn't.

    An object in a hand is at no place that the first level knows, so that none of its steps may begin there.
    """
    other = fresh_call(call, call.problem, settled=True)
    other.segments.expanded += call.segments.expanded
    other.segments.enough = call.segments.enough
    other.aim, other.refiner.at = call.aim, call.refiner.at
    other.segments.counts = call.segments.counts
    advised(other)
    return other
