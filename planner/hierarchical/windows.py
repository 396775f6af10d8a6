"""Windows: cheaper steps replace consecutive steps of a level; a search of the grounded level finds the cheaper steps.

The new steps also satisfy preconditions of upper levels (`confab.planner.hierarchical.inherited_preconditions`). The new steps are
refined. Consecutive new steps that together have the effect of an upper-level step are grouped under this step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Call, as_refined, fresh_call
from confab.planner.hierarchical.detours import parts
from confab.planner.hierarchical.inherited_preconditions import binding
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.regrouping import regroupings
from confab.planner.hierarchical.workspace import Ground
from confab.planner.levels import levels_left
from confab.planner.plan import Plan, UngroundableError
from confab.planner.plan_costs import compared
from confab.planner.validation import validate
from confab.reasoner.problem import Problem

if TYPE_CHECKING:
    from confab.planner.grounded.task import Task

PER_PRIMITIVE = 3
"""A shortened plan must lose fewer level-1 steps than this number times the saved cost (in primitives of mean cost)."""
MUCH_CHEAPER = 1.5
"""Factor by which the cost must decrease if primitives replace steps of the most abstract level."""
MOST_ROWS, OF_A_STEP = 20_000, 500
"""Maximum number of rows of a join when a level is grounded for shortening: in total, and for each step of the plan."""


def windowed(call: Call, level: int, work: int) -> None:
    """Replace steps of a level in a call's plan by cheaper steps, if that improves the plan (`improves`).

    On the lowest level, the order of all steps may change. If the new plan isn't better, only windows of steps are replaced.
    """
    for routes in (True, False) if level == call.program.levels[-1] else (False,):
        new = cheaper(call, level, work, routes)
        if new is None or replaced(call, level, new):
            return


def replaced(call: Call, level: int, new: Sequence[Ground]) -> bool:
    """Refine and group new steps of a level; if that improves a call's plan, replace the plan and return True."""
    other = fresh_call(call, call.problem)
    for name, arguments in new:
        step = other.refiner.do(level, name, arguments)
        if step is None:
            return False
        other.steps.append(step)
    if not all(map(other.met, other.goal)):  # goals that the level doesn't see are open
        Agenda(other, call.program.levels[:1], quickly=True).achieve_all()
    problem, old = call.problem, call.tree()
    for plan in regroupings(problem, other.tree(), level, call.using):
        if improves(problem, plan, old, level) and not validate(problem, plan) and call.accepts(plan):
            call.steps = as_refined(call, plan.steps)
            return True
    return False


def cheaper(call: Call, level: int, work: int, routes: bool) -> list[Ground] | None:
    """Return a cheaper sequence of steps of a level for a call's plan, without refinements; `routes` allows another order.

    The new steps also satisfy the preconditions that the upper levels impose on changes. There are two exceptions: the given plan
    violates these preconditions, or the level with these preconditions is too large. Return None if no cheaper sequence is found,
    or if the level is too large.
    """
    steps = [one for step in call.steps for part in parts(step, level) for one in part.together]
    if any(step.level != level for step in steps):
        return None
    from confab.planner.grounded.plan_windows import shorter

    for domain in (binding(call.problem, level), call.problem.domain):
        task = small(call, replace(call.problem, domain=domain), level, OF_A_STEP * len(steps))
        operators = task.operators_of([(step.behavior, step.arguments) for step in steps]) if task is not None else None
        if operators is not None:
            break
    if task is None or operators is None:
        return None
    found = shorter(task, operators, work, call.space.deadline, routes)
    better = (task.cost_of(found), len(found)) < (task.cost_of(operators), len(operators))
    return [task.describe(operator)[:2] for operator in found] if better else None


def lower_bound(call: Call) -> float | None:
    """Return a lower bound on the cost of every plan of a call's problem, or None if the lowest level is too large."""
    from confab.planner.grounded.shortest import least

    task = small(call, call.problem, call.program.levels[-1], MOST_ROWS)
    return None if task is None else least(task)


def small(call: Call, problem: Problem, level: int, most: int) -> Task | None:
    """Return the grounded task of a level with the goals and rest values that the level sees, or None if the level is too large."""
    from confab.planner.grounded.grounding import ground
    from confab.planner.grounded.task import Task

    goal = {s: value for s, value in problem.goal_on(level).items() if problem.sees(level, s, value)}
    try:
        task = ground(problem, level, goal=goal, most=min(most, MOST_ROWS), deadline=call.space.deadline)
    except UngroundableError:
        return None
    return task if isinstance(task, Task) else None


def primitives(steps: Sequence[RefinedStep]) -> list[RefinedStep]:
    """Return the primitives of steps."""
    return [one for step in steps for one in (primitives(step.steps) if step.steps else (step,))]


def improves(problem: Problem, new: Plan, old: Plan, level: int) -> bool:
    """Return whether a new plan is cheaper than the old plan and violates no more conditions of upper levels.

    For each saved primitive, the new plan must lose fewer than `PER_PRIMITIVE` steps of the most abstract level. The number of
    saved primitives is the saved cost divided by the mean cost of a primitive. If the old plan has only steps of the most abstract
    level, and steps of the lowest level replace some of these steps, the new plan must be cheaper by the factor `MUCH_CHEAPER`.
    """
    price, before = compared(problem, new.primitives), compared(problem, old.primitives)
    first, last = problem.domain.levels[0], problem.domain.levels[-1]
    lost = len(old.at_level(first)) - len(new.at_level(first)) if any(step.level > first for step in new.steps) else 0
    dear = lost > 0 and first != level == last and all(step.level == first for step in old.steps)
    return (
        before > price * (MUCH_CHEAPER if dear else 1.0)
        and PER_PRIMITIVE * (before - price) * len(old.primitives) > lost * before
        and broken(problem, new) <= broken(problem, old)
    )


def broken(problem: Problem, plan: Plan) -> int:
    """Return the number of changes of a plan that violate a condition of an upper level."""
    return sum(len(left.broken) for left in levels_left(problem, plan))
