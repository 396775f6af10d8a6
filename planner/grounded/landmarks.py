"""Facts that every plan makes true at some time, and a search that goes from one of them to the next.

Koehler and Hoffmann, "On reasonable and forced goal orderings", JAIR 12 (2000); Hoffmann, Porteous and Sebastia, "Ordered landmarks
in planning", JAIR 22 (2004).
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from functools import reduce
from operator import or_
from time import perf_counter
from typing import TypeAlias

from confab.planner.grounded.hff import Evaluate, EvaluateFor
from confab.planner.grounded.novelty import Seen, path_to
from confab.planner.grounded.task import Task, bits_of

LOOK = 1_000
"""Operators between two looks at the clock."""
MOST_STATES = 300
"""States that are evaluated on the way from one landmark to the next."""
Search: TypeAlias = "Callable[[Task, Evaluate], Generator[int, None, tuple[Seen, int] | None]]"


def behind(task: Task, deadline: float | None = None) -> list[int]:
    """Return for each fact those that are true before on every way to it, -1 if there is none; nothing where time is over.

    Those of an operator are what all its needs have behind them, those of a fact what all ways to it have in common. Thousands of
    ways to each of thousands of facts take seconds.

    Keyder, Richter and Helmert, "Sound and complete landmarks for and/or graphs", ECAI 2010.
    """
    found = [0 if task.initial >> bit & 1 else -1 for bit in range(task.size)]
    ways = list(zip(task.needs.lists(), task.adds.lists(), strict=True))
    before = None
    while before != found:
        before = found[:]
        for number, (needs, adds) in enumerate(ways):
            if number % LOOK == 0 and deadline is not None and perf_counter() > deadline:
                return []
            needed = 0
            for bit in needs:
                if found[bit] < 0:
                    break
                needed |= found[bit] | 1 << bit
            else:
                for bit in adds:
                    found[bit] &= needed
    return found


def landmarks(task: Task, deadline: float | None = None) -> int:
    """Return facts that every plan makes true at some time; none where time is over."""
    known, found = behind(task, deadline), 0
    for bit in bits_of(task.goal) if known else ():
        found |= known[bit] | 1 << bit
    return found


def in_series(
    task: Task, evaluate: EvaluateFor, work: int, search: Search, deadline: float | None = None
) -> Generator[int, None, tuple[Seen, int] | None]:
    """Search from one landmark to the next, of those behind which none is open the one that comes first on a relaxed plan.

    Where a goal is aimed at, those that hold are kept. What leads away from the goal first, and back, is found by short searches.

    Parameters
    ----------
    task : Task
    evaluate : function of a state and bits
        What relaxing bits of a state without amounts tells; `work` is what that takes.
    search : function of a task and what evaluates its states
        Searches it, as `by_novelty` does.
    deadline : float, optional
        On the clock of `time.perf_counter`.

    Yields
    ------
    int
        The work done.

    Returns
    -------
    tuple
        As of `by_novelty`; None where it got stuck, which proves nothing.
    """

    def relaxing(wanted: list[int]) -> Evaluate:
        return lambda state: evaluate(state & low, wanted)

    known, low = behind(task, deadline), (1 << task.size) - 1
    marks = reduce(or_, (known[bit] | 1 << bit for bit in bits_of(task.goal)), 0) if known else 0
    state, met, path = task.initial, task.initial & marks, list[int]()
    while state & task.goal != task.goal:
        evaluation = evaluate(state & low)
        yield work
        if evaluation is None or not marks:
            return None
        there = (set_ & marks & ~met for operator in evaluation[1] for _, _, set_ in task.known(operator)[1])
        following = next((bit for set_ in there for bit in bits_of(set_) if not known[bit] & marks & ~met), None)
        target = task.goal
        if following is not None:
            target = 1 << following | (state & task.goal if task.goal >> following & 1 else 0)
        part = search(replace(task, initial=state, goal=target), relaxing(bits_of(target)))
        try:
            for _ in range(MOST_STATES):
                yield next(part)
            return None
        except StopIteration as end:
            if end.value is None:
                return None
            steps = path_to(*end.value)
        for operator in steps:
            state = task.applied(state, operator) or state
            met |= state & marks
        path += steps
    return {task.initial: (task.initial, ()), state: (task.initial, tuple(path))}, state
