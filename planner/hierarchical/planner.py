"""The default planner: it achieves the goals one after another, refines each step at once, and finally shortens the plan.

The modules, in a good order for reading:

=============  =====================================================================================
module         purpose
=============  =====================================================================================
workspace      the table of current values, the compiled behaviours, and the work of one call
call           achieve one goal by steps of a level, and apply these steps to the table
agenda         achieve the goals one after another; with larger budgets if all goals are blocked
refinement     achieve targets on a level: replay a method, or search with one budget after another
methods        stored refinements, with roles in place of individuals
nogoods        stored failures of attempts with a scope
search_budget  the limits of one search
few_steps      search for a few relevant steps
relevance      the steps that begin chains towards wanted values
scope          ground and search a part of the world, on one level
unsolvability  prove that there is no plan, during planning
lowest_level   search the lowest level as a whole, in turns with planning goal by goal
shortening     make the plan cheaper: other orders of the goals, removal of detours, routes, windows
windows        replace consecutive steps of a level by cheaper steps
regrouping     find the upper-level steps that explain steps of a level
=============  =====================================================================================

A failed search of a level above the lowest never proves that there is no plan.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from time import perf_counter

from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Call, Compiled, as_refined, compiled
from confab.planner.hierarchical.lowest_level import CheapestPlanFoundError, LowestLevel
from confab.planner.hierarchical.scope import BITS
from confab.planner.hierarchical.shortening import DEFAULT_WORK, shortened
from confab.planner.hierarchical.unsolvability import FINALLY
from confab.planner.plan import Limits, Outcome, Plan, Reason, Status, UnsolvableError, paused_collection
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError, current, within
from confab.reasoner.problem import Problem

__all__ = ["DEFAULT_WORK", "Call", "Compiled", "compiled", "plan"]

FLAT = 50_000_000
"""Maximum work of searching a problem of one level as a whole, before planning goal by goal; the unit is a bit of a relaxed plan.

The maximum work corresponds to a few seconds.
"""
FLAT_ROWS = 30_000
"""Maximum number of rows of a join when a problem of one level is grounded as a whole."""
VAST = 1_000_000
"""Number of quantified behaviours above which a problem of one level is first searched without grounding."""
TRIALS = 400_000
"""Maximum number of tests of behaviours in states if a level can't be grounded (about four seconds)."""
TRIALS_AT_FIRST = TRIALS // 8
"""Maximum number of these tests for a problem of one level, before planning goal by goal."""
NOT_LEFT = "levels must not be left"
SEARCHING, SHORTENING = 0.93, 0.85
"""Shares of the time limit: the search ends at the first share, and shortening at the second, even if the search ended later.

The remaining time is for checking the plan, and for releasing memory.
"""

CHECKS = 1.5
"""Time that is kept for the checks of a plan, in units of the time of a check of the plan before it is shortened."""


def without_advice(call: Call) -> None:
    """Do nothing: the call gets no advice."""


def plan(
    problem: Problem,
    *,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    improve: int = DEFAULT_WORK,
    using: Compiled | None = None,
    leave_levels: bool = True,
    advised: Callable[[Call], None] = without_advice,
    first: Outcome | None = None,
) -> Outcome:
    """Plan: achieve the goals of a problem one after another, and refine each step at once.

    Parameters
    ----------
    problem : Problem
    limits : Limits
    improve : int
        Work of shortening the first plan, in sixteenths of the effort of finding the plan; 0 for no shortening.
    using : Compiled, optional
        The result of `compiled` for a problem with the same domain, individuals and static facts.
    leave_levels : bool
        Whether steps of a lower level may replace steps of a level that has no plan with refinements.
    advised : function of a call, optional
        Function that attaches advice to the call.
    first : Outcome, optional
        The outcome of an earlier call for the same problem, perhaps with fewer goals. Instead of searching for a first plan, the
        planner extends the plan of this outcome by steps for the other goals; it gives up if a quick search finds none.

    Returns
    -------
    Outcome
    """
    begin = perf_counter()
    with within(limits.seconds), paused_collection():
        outcome = _plan(problem, limits, improve, using, leave_levels, advised, first)
    return replace(outcome, seconds=perf_counter() - begin)


def _plan(
    problem: Problem,
    limits: Limits,
    improve: int,
    using: Compiled | None,
    leave_levels: bool,
    advised: Callable[[Call], None],
    first: Outcome | None,
) -> Outcome:
    deadline, until = limits.end(SEARCHING * limits.finding), limits.end(SHORTENING)
    one_level, flat = improve > 0 and len(problem.domain.levels) == 1, None
    if one_level and not is_vast(problem) and advised is without_advice and first is None:
        flat = flat_first(problem, limits, deadline)  # saves compiling thousands of conditional effects
        if flat.status is Status.SOLVED and deadline is None:
            return flat
    try:
        call = Call(problem, using or compiled(problem), deadline, limits.expansions)
    except LimitError as limit:
        return flat or Outcome(Status.GAVE_UP, reason=Reason(str(limit)))
    call.space.most_work, call.space.shortening = limits.work, limits.shortening
    call.accepts = limits.accepts or call.accepts
    advised(call)
    levels = call.program.levels if leave_levels else call.program.levels[:1]
    lowest = LowestLevel(
        call, limits.end(SEARCHING), searched=leave_levels or len(levels) == len(problem.domain.levels)
    )
    done, why = False, ""
    try:
        if first is not None and call.resume(first):
            done = True
            if call.achieved.keys() != call.goal.keys() and not Agenda(call, levels, quickly=True).achieve_all():
                return call.outcome(Status.GAVE_UP, reason=Reason("a quick search found no steps that extend the plan"))
        elif one_level and as_a_whole(call, limits, deadline, flat):
            done, improve = True, improve if call.bound is None or deadline is not None else 0  # a flat plan is short
        else:
            agenda = Agenda(call, levels, lowest=lowest)
            done = agenda.achieve_all()
            why = "" if done else last_resort(agenda, limits, lowest)
    except UnsolvableError as proof:
        return replace(call.outcome(Status.UNSOLVABLE, reason=proof.reason), certificate=proof.certificate)
    except LimitError as limit:
        done, why = False, f"stopped at the limit: {limit}"
    except CheapestPlanFoundError:
        done = False
    if not done and lowest.plan is None:
        return no_plan(call, why)
    if not done:
        lowest.adopt()
    call.space.most_work, call.space.deadline = math.inf, before_the_check(call, until)
    shorten = improve and (done or not lowest.cheapest)
    plan = shortened(call, improve, leave_levels, advised) if shorten else call.tree()
    if not leave_levels and any(step.level != levels[0] for step in plan.steps):
        return no_plan(call, f"a goal that level {levels[0]} doesn't see requires steps below it, and {NOT_LEFT}")
    return call.outcome(Status.SOLVED, plan)


def before_the_check(call: Call, until: float | None) -> float | None:
    """Return the time until which a plan may be shortened: `until`, or earlier if the checks of the plan need more time."""
    deadline = current()
    if until is None or deadline.left is None:
        return until
    begin = perf_counter()
    with suppress(LimitError):
        validate(call.problem, call.tree())
    return min(until, deadline.at - CHECKS * (perf_counter() - begin))


def last_resort(agenda: Agenda, limits: Limits, lowest: LowestLevel) -> str:
    """Search the lowest level as a whole, unless no level may be left; return the reason why no plan is found."""
    call = agenda.call
    agenda.proofs.certify(growth=FINALLY)
    if not lowest.searched:
        return f"no plan of level {call.program.levels[0]} was found that can be refined, and {NOT_LEFT}"
    reason = lowest.search(BITS * limits.work, limits.expansions)
    if lowest.too_large is None:
        return reason.text
    if without_grounding(call, TRIALS):
        lowest.offer(call.tree(), False)
    return f"planning goal by goal found no plan, and {lowest.too_large.text}"


def is_vast(problem: Problem) -> bool:
    """Return whether a problem of one level has too many quantified behaviours to be grounded first."""
    (level,) = problem.domain.levels
    return problem.quantified(level) > VAST


def without_grounding(call: Call, trials: int) -> bool:
    """Search the lowest level without grounding; return whether the steps of the call are a plan now."""
    from confab.planner.hierarchical.ungrounded import UngroundedSearch

    before, steps = call.steps, UngroundedSearch(call, trials).plan()
    call.steps = steps or before
    if steps is None or left_at_rest(call.problem, call.tree()):
        return steps is not None
    call.steps = before
    return False


def no_plan(call: Call, why: str) -> Outcome:
    """Return the outcome of a call that gave up, with the reason `why`, the current goal and the current step."""
    from confab.planner.hierarchical.stuck import gave_up

    return call.outcome(Status.GAVE_UP, reason=gave_up(call, why))


def as_a_whole(call: Call, limits: Limits, deadline: float | None, flat: Outcome | None) -> bool:
    """Plan a problem of one level as a whole with bounded work; return whether the steps of the call are a plan now.

    If there are rules for all goals, they come first. A grounded search follows (`flat` is its outcome if it has been made), and a
    search without grounding, which precedes the grounded one if the problem is vast.
    """
    if call.advice is not None and call.advice.expects and Agenda(call, ()).achieve_all():
        return True
    vast = is_vast(call.problem)
    if vast and without_grounding(call, TRIALS_AT_FIRST):
        return True
    flat = flat or flat_first(call.problem, limits, deadline)
    call.count(flat)
    if flat.status is Status.UNSOLVABLE and flat.reason is not None:
        raise UnsolvableError(flat.reason)
    if flat.plan is None:
        return not vast and without_grounding(call, TRIALS_AT_FIRST)
    call.steps, call.bound = as_refined(call, flat.plan.steps), flat.bound
    return True


def flat_first(problem: Problem, limits: Limits, deadline: float | None) -> Outcome:
    """Search a problem of one level as a whole with bounded work; give up when the bound is reached.

    A problem of one level has no refinements that guide planning goal by goal. Therefore the planner tries the whole problem first.
    The work is bounded, because the problem may have too many goals, or may be too large for grounding.
    """
    from confab.planner.grounded.best_first import plan_level

    found = plan_level(problem, limits=limits.until(deadline), most_work=FLAT, most_rows=FLAT_ROWS)
    if found.plan is None or left_at_rest(problem, found.plan):
        return found
    return replace(
        found, status=Status.GAVE_UP, plan=None, reason=Reason("the plan leaves a changed symbol not at rest")
    )


def left_at_rest(problem: Problem, plan: Plan) -> bool:
    """Return whether a plan of the lowest level, found by a search of this level alone, leaves all changed symbols at rest.

    Such a search doesn't require that a symbol is at rest in the end if it isn't at rest initially.
    """
    return all(situation.rest is None for situation in problem.domain.situations.values()) or not validate(
        problem, plan
    )
