"""Plans with a proved bound on their distance from the optimum.

The upper bound is the cost of the best plan so far, initially the shortened plan of the default planner. The lower bound is the
least f of A* on the lowest level. The first heuristic of A* is the sum of the costs of achieving each goal alone; the second
heuristic is LM-cut. If both bounds are equal, the plan is optimal. If a limit ends the search earlier, the plan costs at most
upper / lower times the cost of an optimal plan.

LM-cut is due to Helmert and Domshlak, "Landmarks, critical paths and abstractions: what's the difference anyway?", ICAPS 2009. In
this implementation, all relaxed operators of one quantified behaviour share the behaviour's cost. Therefore the heuristic is
admissible even with conditional effects.
"""

from __future__ import annotations

import heapq
import math
from contextlib import suppress
from dataclasses import replace
from time import perf_counter

from confab.planner.grounded.hff import by_bit
from confab.planner.grounded.shortest import Estimate, each_goal_alone, shortest
from confab.planner.grounded.task import Task, bits_of
from confab.planner.hierarchical.lowest_level import proved
from confab.planner.hierarchical.planner import SEARCHING, Compiled, compiled
from confab.planner.hierarchical.planner import plan as hierarchical_plan
from confab.planner.hierarchical.regrouping import under_the_levels_above
from confab.planner.plan import Limits, Outcome, Plan, Reason, Status, UnsolvableError
from confab.planner.plan_costs import cost_of
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError, OutOfTimeError
from confab.reasoner.problem import Problem

WORK = 1_000_000
"""Maximum number of operators that are examined to shorten the best plan on the lowest level."""


def plan(
    problem: Problem,
    *,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    using: Compiled | None = None,
) -> Outcome:
    """Plan, and prove a lower bound on the cost of every lowest-level plan.

    Parameters
    ----------
    problem : Problem
    limits : Limits
        Maximum number of expansions of each A* search, and the time limit. The whole time is used unless optimality is proved, half
        of it for A*.
    using : Compiled, optional

    Returns
    -------
    Outcome
        The plan is optimal if `bound` equals the cost of its primitives.
    """
    begin = perf_counter()
    deadline = limits.end(SEARCHING)
    with suppress(LimitError):
        using = using or compiled(problem)
    half = None if deadline is None else (begin + deadline) / 2
    best = hierarchical_plan(problem, limits=replace(limits.until(half), shortening="repeated"), using=using)
    if best.status is Status.UNSOLVABLE:
        return best
    lower, found = _proved(problem, best, limits, deadline)
    flat = () if found is None else (under_the_levels_above(problem, found, using), found)
    plan = best.plan
    with suppress(LimitError):
        plan = next((one for one in flat if not validate(problem, one)), plan)
    status = Status.SOLVED if plan is not None else best.status
    return replace(
        best,
        status=status,
        plan=plan,
        reason=None if plan is not None else best.reason,
        bound=lower,
        seconds=perf_counter() - begin,
    )


def _proved(problem: Problem, best: Outcome, limits: Limits, deadline: float | None) -> tuple[float, Plan | None]:
    """Return a lower bound on the cost of a plan, and a cheaper plan if the search finds one.

    Symbols that are initially at rest must be at rest in the end. A symbol that is initially not at rest must end at rest if a
    step changes the symbol. The search ignores the condition on symbols that are initially not at rest. Therefore the bound is
    valid, but the plan may be invalid.
    """
    level = problem.domain.levels[-1]
    problem = replace(problem, goal=problem.goal_on(level))
    upper = cost_of(problem, best.plan) if best.plan is not None else math.inf
    try:
        task = proved(problem, level, deadline)
    except UnsolvableError:
        return math.inf, None
    except OutOfTimeError:
        return 0.0, None
    if isinstance(task, Reason):
        return 0.0, None
    lower = 0.0
    half = None if deadline is None else (perf_counter() + deadline) / 2
    for bound, most, until in (
        (each_goal_alone(task), limits.expansions, half),
        (lm_cut(task, deadline), limits.expansions, deadline),
    ):
        found = shortest(task, bound, upper, most, until, best.search.get(level))
        lower = max(lower, min(found.bound, upper))
        if found.plan is not None:
            return found.bound, Plan(task.steps(found.plan))
        if lower >= upper:
            break
    return lower, None


def lm_cut(task: Task, deadline: float | None = None) -> Estimate:
    """Return the LM-cut heuristic of a task as a function of a state.

    After the deadline, the heuristic is the cost of the cuts found so far; this cost is also a lower bound. The computation
    adds two bits to the bits of the task. The bit `always` is the precondition of operators without preconditions. The bit
    `end` is reached from the bits of the goal at no cost.
    """
    always, end = task.size, task.size + 1
    needs = [bits or [always] for bits in task.needs.lists()]
    adds = task.adds.lists()
    owners = list(task.owners)
    needs.append(bits_of(task.goal) or [always])
    adds.append([end])
    owners.append(-1)
    needed_by, added_by = by_bit(needs, task.size + 2), by_bit(adds, task.size + 2)

    def h_max(facts: list[int], price: list[float]) -> tuple[list[float], list[int]]:
        """Return the h_max value of each bit, and the most expensive precondition of each operator, or -1 if unreachable."""
        value = [math.inf] * (task.size + 2)
        missing = [len(bits) for bits in needs]
        support = [-1] * len(needs)
        queue = [(0.0, bit) for bit in facts]
        for bit in facts:
            value[bit] = 0.0
        while queue:
            if deadline is not None and perf_counter() > deadline:
                raise TimeoutError
            reached, bit = heapq.heappop(queue)
            if reached > value[bit]:
                continue
            for o in needed_by[bit]:
                missing[o] -= 1
                if not missing[o]:
                    support[o] = bit
                    total = reached + (price[owners[o]] if owners[o] >= 0 else 0.0)
                    for added in adds[o]:
                        if total < value[added]:
                            value[added] = total
                            heapq.heappush(queue, (total, added))
        return value, support

    def evaluate(state: int) -> float:
        facts = [*bits_of(state & (1 << task.size) - 1), always]
        price = list(task.costs)
        total = 0.0
        while True:
            try:
                value, support = h_max(facts, price)
            except TimeoutError:
                return total
            if math.isinf(value[end]):
                return math.inf
            if value[end] == 0.0:
                return total
            zone, waiting = {end}, [end]  # bits from which operators without cost lead to the goal
            while waiting:
                for o in added_by[waiting.pop()]:
                    bit = support[o]
                    if bit >= 0 and bit not in zone and (owners[o] < 0 or price[owners[o]] == 0.0):
                        zone.add(bit)
                        waiting.append(bit)
            before, waiting, cut = set(facts), list(facts), set()  # bits reached without entering the zone
            while waiting:
                bit = waiting.pop()
                for o in needed_by[bit]:
                    if support[o] == bit:
                        if any(added in zone for added in adds[o]):
                            cut.add(owners[o])
                        else:
                            for added in adds[o]:
                                if added not in before:
                                    before.add(added)
                                    waiting.append(added)
            least = min(price[owner] for owner in cut)
            for owner in cut:
                price[owner] -= least
            total += least

    return evaluate
