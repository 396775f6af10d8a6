"""A plan made shorter, while that takes no more than half the effort of finding it.

orders   the agenda again in other orders of the goals, with the refinements that are known: what has to be put aside depends on it
windows  on each level, from the top: steps in a row replaced by fewer (`confab.planner.hierarchical.windows`)
detours  steps that together come to nothing are dropped (`confab.planner.hierarchical.detours`)

Orders, and windows of the first level, are only tried where a plan puts something aside or has many steps for its goals, other
windows where it puts something aside. The shortest plan is kept; steps of the most abstract level, which say what the others are
for, are given up only where that saves enough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from random import Random

from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Call, fresh_call
from confab.planner.hierarchical.detours import without_detours
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.windows import abstract, broken, length, windowed, worth
from confab.planner.plan import Plan
from confab.planner.transitions import Cell, key_of
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import Symbol, ValueCondition

ORDERS = 8
"""Other orders of the goals that are tried by default: length against CPU time."""
LEAST_EFFORT = 200_000
"""The least effort that a first plan counts as, in states times operators: length of plans found at once, against CPU time."""
DOING = 20
"""The effort of doing a primitive once more, in states times operators."""
MANY = 1.25
"""Steps for each goal from which on other orders are tried, too: some may be needless; length against CPU time."""
KEPT = 1.5
"""Level-1 steps are kept as long as primitives that come to nothing make the plan longer by less than this factor."""


def shortened(call: Call, improve: int, leave_levels: bool, advised: Callable[[Call], None]) -> Plan:
    """Return the plan of a call, made shorter by work in proportion to `improve`."""
    with suppress(LimitError):  # then what is found so far is what there is
        shorten(call, improve, leave_levels, advised)
    plan = call.tree()
    if all(step.level == call.program.levels[0] for step in plan.steps):
        call.given_up.clear()  # there are steps of it after all
    return plan


def shorten(call: Call, improve: int, leave_levels: bool, advised: Callable[[Call], None]) -> None:
    """Make the steps of a call shorter."""
    levels = call.program.levels
    work = max(call.segments.effort, LEAST_EFFORT) * improve // (2 * ORDERS)
    aside = len(levels) > 1 and puts_aside(call)
    if aside or (len(levels) > 1 and len(call.steps) > MANY * len(call.goal)):
        reordered(call, improve, work, advised)
        windowed(call, levels[0], work)
    if aside:
        for level in levels[1:-1] if leave_levels else ():
            windowed(call, level, work)
        if leave_levels:
            drop_detours(call, levels[-2])
    if leave_levels and (drop_detours(call, levels[-1], KEPT) or call.given_up or len(levels) == 1):
        windowed(call, levels[-1], work)


def puts_aside(call: Call) -> bool:
    """Whether a step overwrites a value that no step before has asked for: else there is hardly a step too many."""
    table, problem, names = call.table, call.problem, call.program.variables
    idle = set[Cell]()
    table.undo(0)
    for level, name, arguments, bindings, below in call.steps:
        call.segments.check_time()
        mark = len(table.trail)
        call.refiner.redo(RefinedStep(level, name, arguments, bindings, below))
        touched = {
            (situation, key)
            for situation, key, _ in table.trail[mark:]
            if problem.domain.situations[situation].level <= level
        }
        if not idle.isdisjoint(touched):
            table.undo(0)
            return True
        behavior = problem.domain.behaviors[name]
        terms = dict(zip((p.name for p in behavior.parameters), arguments, strict=True))
        terms |= dict(zip((f"?{variable}" for variable in names[name]), bindings, strict=True))
        for asked in behavior.preconditions:
            if isinstance(asked, ValueCondition) and not asked.negated:
                idle.discard((asked.situation, key_of(tuple(terms.get(a, a) for a in asked.arguments))))
        idle |= touched
    table.undo(0)
    return False


def orders(goal: Mapping[Symbol, str], number: int) -> Iterator[dict[Symbol, str]]:
    """Yield other orders of the goals: the reverse one, then shuffled ones."""
    goals = list(goal.items())
    goals.reverse()
    for seed in range(number):
        yield dict(goals)
        Random(seed).shuffle(goals)


def reordered(call: Call, number: int, work: int, advised: Callable[[Call], None]) -> None:
    """Achieve the goals in other orders, by bounded work in all; keep the shortest.

    Only steps of the most abstract level are tried; advice is taken for refinements: for goals it would lead to the same steps.
    """
    for goal in orders(call.problem.goal, number) if len(call.goal) > 1 else ():
        other = fresh_call(call, replace(call.problem, goal=goal), call.settled)
        other.segments.most_work = work
        advised(other)
        other.advice = None
        agenda = Agenda(other, levels=call.program.levels[:1], attempts=2, solvable=True, forward=True)
        with suppress(LimitError):
            if agenda.achieve_all() and length(other.steps) < length(call.steps):
                call.steps = other.steps
        work -= other.segments.effort + DOING * length(other.steps)
        if work <= 0:
            break


def drop_detours(call: Call, level: int, price: float = 1.0) -> bool:
    """Leave out steps of a level that come to nothing, if that breaks no more of what levels above ask; whether some were.

    Steps of the most abstract level are given up for that only if the plan is longer than without by more than a factor.
    """
    steps, old = call.steps, call.tree()
    call.steps = without_detours(call.refiner, steps, level)
    new = call.tree()
    lost = abstract(call.problem, old) - abstract(call.problem, new)
    saved = len(old.primitives) > (price if lost > 0 else 1.0) * len(new.primitives)
    if (
        saved
        and worth(len(old.primitives) - len(new.primitives), lost)
        and broken(call.problem, new) <= broken(call.problem, old)
    ):
        return True
    call.steps = steps
    return False
