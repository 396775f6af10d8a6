"""Search by novelty: a state comes first that has a fact which no state before it had at the same distance from the goal.

distance    the goals (and landmarks) that are open, and of the facts of a relaxed plan, made where the last goal was
            reached, those met since
novel       some fact is new among the states of the same distance: one "and" of two integers
open        a queue by novelty, then by open goals (and landmarks), then as they came (or the last first)

A relaxed plan is made only for states that reach a goal and are expanded, so that hundreds of thousands of states a second are
looked at. No state is dropped: where the queue runs empty, there is no plan.

Lipovetzky and Geffner, "Best-first width search: exploration and exploitation in classical planning", AAAI 2017, with novelty
cut off at one.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Generator

from confab.planner.grounded.hff import Evaluate
from confab.planner.grounded.task import Task
from confab.planner.plan import Counts
from confab.reasoner.limits import check

MOST_BYTES, STATE_BYTES = 800 * 2**20, 400
"""What the states kept by one search may take, about, and what one of them takes besides its bits."""
CHILD, VISIT = 20, 2
"""Bits that h_FF looks at in the time in which one successor is made, and a node of the tree visited."""

Seen = dict[int, tuple[int, tuple[int, ...]]]
"""For each state that from which it was reached, and by which operators."""


def by_novelty(
    task: Task,
    evaluate: Evaluate,
    relaxing: int,
    counts: Counts,
    marked: Callable[[], int] | None = None,
) -> Generator[int, None, tuple[Seen, int] | None]:
    """Search by novelty; yield the work done, in bits, when it is that of a relaxed plan; return what was seen and the last state.

    `relaxing` is the work of a relaxed plan. Where there are landmarks (`marked`), those that weren't met yet count like goals, and
    of equal states the last comes first.

    Raises
    ------
    MemoryError
        There are more states than it may keep.
    """
    goal, applied = task.goal, task.applied
    plain: dict[int, tuple[int, int] | None] = {}
    seen: Seen = {task.initial: (task.initial, ())}
    most = MOST_BYTES // (STATE_BYTES + task.size // 4)
    above = -1 << task.size if task.amounts else 0  # where the number of the amounts is, which is no fact
    known: defaultdict[tuple[int, int], int] = defaultdict(lambda: above)  # of each distance, the facts of its states
    marks = marked() & ~(task.initial | goal) if marked else 0
    child = CHILD + task.size // 50 + task.derived.effort
    number, step = 0, -1 if marked else 1
    # (no new fact, distance, number, state, facts of the relaxed plan (-1: not made yet), those met, landmarks left)
    first = (goal & ~task.initial).bit_count() + marks.bit_count()
    queue: list[tuple[bool, int, int, int, int, int, int]] = [(False, first, 0, task.initial, -1, 0, marks)]
    work = 0
    while queue:
        check("searching")
        _, open_, _, state, wanted, met, unmet = heapq.heappop(queue)
        if work >= relaxing:
            yield work
            work = 0
            if len(seen) > most:
                raise MemoryError
        if wanted < 0:
            evaluation = evaluate(state)
            counts.evaluated += 1
            work += relaxing
            if evaluation is None:
                continue
            wanted = 0
            for operator in evaluation[1]:
                for _, _, set_ in task.known(operator)[1]:
                    wanted |= set_
            wanted &= ~state
        operators, visited = task.applicable(state)
        work += child * len(operators) + VISIT * visited
        counts.generated += len(operators)
        for operator in operators:
            if operator not in plain:
                plain[operator] = _plain(task, operator)
            change = plain[operator]
            after = state & change[0] | change[1] if change else applied(state, operator)
            if after is None or after in seen:
                continue
            seen[after] = (state, (operator,))
            missing = goal & ~after
            if not missing:
                return seen, after
            remaining = unmet & ~after
            left = missing.bit_count() + remaining.bit_count()
            if left < open_:
                facts, reached, distance = -1, 0, (left, 0)
            else:
                facts, reached = wanted, met | after & wanted
                distance = (left, reached.bit_count())
            old = known[distance]
            known[distance] = old | after
            number += step
            heapq.heappush(queue, (not after & ~old, left, number, after, facts, reached, remaining))
    return None


def path_to(came_from: Seen, state: int) -> list[int]:
    """Return the operators that led to a state."""
    parts: list[tuple[int, ...]] = []
    while True:
        before, operators = came_from[state]
        if not operators:
            return [operator for part in reversed(parts) for operator in part]
        parts.append(operators)
        state = before


def _plain(task: Task, operator: int) -> tuple[int, int] | None:
    """Return what an operator leaves of a state, and what it sets; None if that depends on the state."""
    changes = task.known(operator)[1]
    if task.barred or (task.amounts is not None and task.amounts.moves(operator)):
        return None
    if task.derived.parts or len(changes) != 1 or changes[0][0]:
        return (-1, 0) if not changes else None
    _, cleared, set_ = changes[0]
    return ~cleared, set_
