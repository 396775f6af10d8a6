"""Good examples: what is worth learning from.

What a teacher does without need is learned, too: a poor example is worse than none. So the steps of the most abstract level are the
fewest where A* finds them soon, and elsewhere the goal needs each of them.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

from planner.experience.choice_points import BROAD, Field, Ground, single_level
from planner.hierarchical import planner as fast
from planner.hierarchical.operators import Program
from planner.transitions import Cell
from reasoner.symbols import Problem

MOST = 1000  # expansions in search of a shortest plan
SMALL = 12  # open goals; of more, that many expansions hardly find any, and take long


def lesson(problem: Problem, level: int) -> list[Ground]:
    """Return steps of a level to learn from, none where no plan is found.

    Those of the first level are shortest if A* finds them soon; else it is the fast planner's plan, without needless steps.

    Parameters
    ----------
    problem : Problem
    level : int
        Its first level, or a lower one, which is then learned as a problem of its own.
    """
    if level == problem.domain.levels[0]:
        within = single_level(problem, level)
        steps = shortest(Program(within), within, level)
        if steps is not None:
            return steps
    return _planned(problem, level, fast.IMPROVEMENTS)


def example(problem: Problem, level: int) -> list[Ground]:
    """Return a lesson, or where there is none the first plan's steps of a level, as far as the goal needs them.

    Empty where there is no plan, or it does without the level.
    """
    return lesson(problem, level) or _planned(problem, level, 0)


def _planned(problem: Problem, level: int, improve: int) -> list[Ground]:
    """Return the steps of a level that the goal needs in the fast planner's plan, none if part of that is below the level."""
    found = fast.plan(problem, improve=improve).plan
    if found is None or any(step.level > level for step in found.steps):
        return []
    within = single_level(problem, level)
    made = [(step.behavior, step.arguments) for step in found.at_level(level)]
    return shortened(Program(within), within, level, made)


def shortened(program: Program, problem: Problem, level: int, steps: Sequence[Ground]) -> list[Ground]:
    """Return a plan without steps that the goal doesn't need, nor steps that only those need.

    Action elimination: H. Nakhost and M. Müller, "Action elimination and plan neighborhood graph search", ICAPS 2010.
    """
    field = Field(program, problem, level)
    kept = list(steps)
    i = 0
    while i < len(kept):
        mark = len(field.table.trail)
        trial = [step for step in kept[i + 1 :] if field.do(step)]
        reached = not field.unmet()
        field.table.undo(mark)
        if reached:
            kept[i:] = trial
        else:
            field.do(kept[i])
            i += 1
    return kept


def shortest(program: Program, problem: Problem, level: int, most: int = MOST) -> list[Ground] | None:
    """Return a shortest plan of one level, of what works towards its goals: a teacher for small problems.

    A* with the number of goals that are open, over the most that one step changes. None if `most` expansions don't find one;
    with more than `SMALL` goals open none is looked for.
    """
    field = Field(program, problem, level)
    if len(field.unmet()) > SMALL:
        return None
    table, widest = field.table, field.segments.widest[level]
    start = len(table.trail)
    queue: list[tuple[int, int, int, frozenset[tuple[Cell, str]], tuple[Ground, ...]]] = [(0, 0, 0, frozenset(), ())]
    reached = {queue[0][3]: 0}
    expanded = number = 0
    while queue and expanded < most:
        _, _, _, here, steps = heapq.heappop(queue)
        if reached[here] < len(steps):
            continue
        table.undo(start)
        for (situation, key), value in here:
            table.put(situation, key, value)
        unmet = field.unmet()
        if not unmet:
            return list(steps)
        expanded += 1
        mark = len(table.trail)
        for ground in field.proposals(unmet, breadth=BROAD):
            field.do(ground)
            there = frozenset(table.since(start).items())
            left = -(-len(field.unmet()) // widest)
            table.undo(mark)
            if reached.get(there, len(steps) + 2) > len(steps) + 1:
                reached[there] = len(steps) + 1
                number += 1
                heapq.heappush(queue, (len(steps) + 1 + left, left, number, there, (*steps, ground)))
    return None
