"""Shortening of a plan, by default with at most half of the effort of finding the plan.

There are four ways, in this order: the goals are planned again in other orders, with the known refinements; steps whose changes
cancel out are removed (`confab.planner.hierarchical.detours`); on the lowest level, the order of all steps is changed
(`confab.planner.grounded.routes`); windows, that is consecutive steps of a level, are replaced by cheaper steps
(`confab.planner.hierarchical.windows`). The primitives after the first state with all goals are always dropped.

Other orders are tried only if the plan moves an object away or has many steps per goal. Windows, which may refine several steps
together, are used only if a shorter plan is likely. The cheapest plan is kept; among equally cheap plans, the plan with the
fewest primitives. Steps of the first level explain the steps below. Therefore steps of the first level are dropped only if the plan
becomes much cheaper.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from math import inf
from random import Random
from time import perf_counter

from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Call, as_refined, fresh_call
from confab.planner.hierarchical.detours import parts, without_detours
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.regrouping import regroupings
from confab.planner.hierarchical.windows import improves, lower_bound, primitives, windowed
from confab.planner.plan import Plan
from confab.planner.plan_costs import compared
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import Symbol, ValueCondition

DEFAULT_WORK = 8
"""Default work of shortening a plan, in sixteenths of the effort of finding the plan: half of the effort."""
SHUFFLES = 3
"""Number of random orders of the goals that are tried before small changes of the best order."""
LEAST_EFFORT = 600_000
"""Minimum effort that is assumed for finding the first plan; the unit is one operator in one state.

Because of this minimum, the planner also shortens plans that were found with little effort.
"""
COMPARED = 2
"""Work of replacing windows in a plan that is compared with plans for other goals, in units of the effort of finding the plan."""
LEAST_ROUNDS = 5
"""Minimum number of rounds of repeated shortening; the first rounds may be too short to improve a plan."""
DOING, BEGINNING = 20, 1_000
"""Work of replaying a primitive, and work of beginning a call; the unit is one operator in one state."""
MANY = 1.25
"""Number of first-level steps per goal above which other orders of the goals are tried."""


def shortened(call: Call, improve: int, leave_levels: bool, advised: Callable[[Call], None]) -> Plan:
    """Return the plan of a call, shortened with work proportional to `improve`."""
    drop_idle_end(call)
    with suppress(LimitError):  # at a limit, the current plan is kept
        shorten(call, improve, leave_levels, advised)
    drop_idle_end(call)
    plan = call.tree()
    if all(step.level == call.program.levels[0] for step in plan.steps):
        call.given_up.clear()  # all steps of the plan are of the first level, so no level was given up
    return plan


def shorten(call: Call, improve: int, leave_levels: bool, advised: Callable[[Call], None]) -> None:
    """Shorten the steps of a call in rounds, each with twice the work of the round before.

    By default, there is one round. Repeated shortening has at least `LEAST_ROUNDS` rounds; if round n was the last round that made
    the plan cheaper, there are at most 2 n rounds. A brief call has one round with little work, or no round if the call has a time
    limit. A plan that is compared with plans for other goals has one round with little work; before that, windows of the lowest
    level are replaced, with more work than the effort of finding the plan.
    """
    how = call.space.shortening
    if how in {"once", "repeated"} and prices(call) > 1 and call.bound is None:
        call.bound = lower_bound(call)
    improve = 1 if how in {"brief", "compared"} else improve
    work, random = max(call.space.effort, LEAST_EFFORT) * improve // (2 * DEFAULT_WORK), Random(0)
    if how == "compared" and leave_levels and COMPARED * call.space.effort > work:
        windowed(call, call.program.levels[-1], COMPARED * call.space.effort)
    rounds = useful = 0
    most = {"none": 0, "brief": int(call.space.deadline is None), "compared": 1, "once": 1, "repeated": inf}[how]
    while rounds < min(most, max(LEAST_ROUNDS, 2 * useful)):
        before, begin = cost(call), perf_counter()
        shorten_once(call, work, leave_levels, advised, random)
        rounds, work, saved = rounds + 1, 2 * work, before - cost(call)
        call.saving = saved / max(perf_counter() - begin, 1e-6)
        useful = rounds if saved else useful


def shorten_once(call: Call, work: int, leave_levels: bool, advised: Callable[[Call], None], random: Random) -> None:
    """Try other orders of the goals, the removal of detours, and cheaper steps of the lower levels, each with bounded work."""
    levels = call.program.levels
    aside = len(levels) > 1 and puts_aside(call)
    if aside or (len(levels) > 1 and len(call.steps) > MANY * len(call.goal)):
        reordered(call, work // 2, advised, random)
    if not leave_levels:
        return
    if aside:
        drop_detours(call, levels[-2])
    detours = drop_detours(call, levels[-1])
    if aside or detours or call.given_up or len(levels) == 1 or costs_depend(call) or restores(call):
        for level in levels[1:] or levels:
            windowed(call, level, work)


def costs_depend(call: Call) -> bool:
    """Return whether the cost of a refinement may depend on earlier steps, or on a choice of primitives with different costs."""
    first, domain = call.program.levels[0], call.problem.domain
    changed = frozenset[str]().union(*(behavior.changes for behavior in domain.behaviors.values()))
    free = (s for s in domain.situations.values() if s.level > first and s.rest is None)
    return prices(call) > 1 or any(situation.name in changed for situation in free)


def prices(call: Call) -> int:
    """Return the number of different costs of a call's primitives."""
    return len({(one.cost, one.price) for one in call.problem.domain.at_level(call.program.levels[-1])})


def cost(call: Call) -> float:
    """Return the quantity that shortening minimises: the cost of a call's primitives and, among equal costs, their number."""
    return compared(call.problem, primitives(call.steps))


def restores(call: Call) -> bool:
    """Return whether a refinement begins with the inverse of the last change of an earlier refinement.

    Several steps that are refined together can do without both changes.
    """
    table, situations = call.table, call.problem.domain.situations
    last = dict[Cell, tuple[str, str]]()
    table.undo(0)
    for step in call.steps:
        call.space.check_time()
        mark = len(table.trail)
        call.refiner.replay(step)
        values = dict[Cell, list[str]]()
        for situation, key, old in table.trail[mark:]:
            if situations[situation].level > step.level:
                values.setdefault((situation, key), []).append(old)
        for (situation, key), found in values.items():
            changes = [(old, new) for old, new in pairwise((*found, table.now[situation][key])) if old != new]
            if changes and last.get((situation, key)) == changes[0][::-1]:
                table.undo(0)
                return True
            if changes:
                last[situation, key] = changes[-1]
    table.undo(0)
    return False


def puts_aside(call: Call) -> bool:
    """Return whether a step overwrites a value that no step has required; only in this case, superfluous steps are likely."""
    table, problem, names = call.table, call.problem, call.program.variables
    idle = set[Cell]()
    table.undo(0)
    for step in call.steps:
        call.space.check_time()
        mark = len(table.trail)
        call.refiner.replay(step)
        touched = {
            (situation, key)
            for situation, key, _ in table.trail[mark:]
            if problem.domain.situations[situation].level <= step.level
        }
        if not idle.isdisjoint(touched):
            table.undo(0)
            return True
        for _, name, arguments, bindings, *_ in step.together:
            behavior = problem.domain.behaviors[name]
            terms = dict(zip((p.name for p in behavior.parameters), arguments, strict=True))
            terms |= dict(zip((f"?{variable}" for variable in names[name]), bindings, strict=True))
            for asked in behavior.preconditions:
                if isinstance(asked, ValueCondition) and not asked.negated:
                    idle.discard((asked.situation, key_of(tuple(terms.get(a, a) for a in asked.arguments))))
        idle |= touched
    table.undo(0)
    return False


def reordered(call: Call, work: int, advised: Callable[[Call], None], random: Random) -> None:
    """Achieve the goals in other orders with bounded work; keep the cheapest steps, and vary the order that led to them.

    Only steps of the most abstract level are tried. Advice is used only for refinements, because advice for goals would lead to the
    same steps.
    """
    order = list(call.achieved)
    tried = {tuple(order)}
    for other_order in neighbours(order, random) if len(order) > 1 else ():
        call.space.check_time()
        work -= BEGINNING
        if work <= 0:
            break
        if tuple(other_order) in tried:
            continue
        tried.add(tuple(other_order))
        goal = {Symbol(cell[0], arguments_of(cell[1])): call.goal[cell] for cell in other_order}
        other = fresh_call(call, replace(call.problem, goal=goal))
        other.space.most_work = work
        advised(other)
        other.advice = None
        agenda = Agenda(other, levels=call.program.levels[:1], quickly=True)
        with suppress(LimitError):
            if agenda.achieve_all() and cost(other) <= cost(call):
                order[:] = other.achieved
                call.steps = other.steps if cost(other) < cost(call) and call.accepts(other.tree()) else call.steps
        work -= other.space.effort + DOING * len(primitives(other.steps))


def neighbours(order: list[Cell], random: Random) -> Iterator[list[Cell]]:
    """Yield the reversed order, a few random orders, and then endlessly the current `order` with a few goals moved."""
    yield order[::-1]
    for _ in range(SHUFFLES):
        yield random.sample(order, len(order))
    while True:
        other = list(order)
        begin, many = random.randrange(len(other)), random.choice((1, 1, 2, 3))
        moved = other[begin : begin + many]
        del other[begin : begin + many]
        to = random.randrange(len(other) + 1)
        other[to:to] = moved
        yield other


def drop_idle_end(call: Call) -> None:
    """Drop the primitives after the first state in which all goals hold and all changed symbols are at rest, if the steps remain.

    The search may leave such primitives if the steps of a goal also achieve a later goal. A step without its last primitives
    remains if it still has its effect.
    """
    table, level = call.table, call.program.levels[-1]

    def ended() -> bool:
        changed = {(situation, key) for situation, key, _ in table.trail}
        return all(map(call.met, call.goal)) and all(
            changed.isdisjoint(call.restless(each)) for each in call.program.levels
        )

    table.undo(0)
    all_parts, many = [part for step in call.steps for part in parts(step, level)], 0
    while many < len(all_parts) and not ended():
        call.refiner.replay(all_parts[many])
        many += 1
    table.undo(0)
    if many < len(all_parts):
        steps = [call.refiner.replay_checked(step) for step in _first(call.steps, many, level)]
        if None not in steps and ended():
            call.steps = [step for step in steps if step is not None]
        table.undo(0)


def _first(steps: Sequence[RefinedStep], many: int, level: int) -> list[RefinedStep]:
    """Return the first steps, with a number of parts on a level in all; the last step may lose parts."""
    found = list[RefinedStep]()
    for step in steps:
        own = len([*parts(step, level)])
        if many <= 0:
            break
        found.append(step if own <= many else step._replace(steps=tuple(_first(step.steps, many, level))))
        many -= own
    return found


def drop_detours(call: Call, level: int) -> bool:
    """Drop steps of a level that cancel out if this improves the plan; return whether steps were dropped.

    If an upper-level step loses steps, the remaining steps are grouped under upper-level steps with the same effect.
    """
    steps, old = call.steps, call.tree()
    call.steps = without_detours(call.refiner, steps, level)
    new = call.tree()
    if not improves(call.problem, new, old, level) or not call.accepts(new):
        call.steps = steps
        return False
    if len(new.at_level(call.program.levels[0])) < len(old.at_level(call.program.levels[0])):
        grouped = regroupings(call.problem, Plan(new.at_level(level)), level, call.using)[0]
        if improves(call.problem, grouped, old, level) and not validate(call.problem, grouped):
            call.steps = as_refined(call, grouped.steps)
    return True
