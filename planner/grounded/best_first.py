"""Search of one level of a problem, or of any grounded task, without refinement.

This search solves domains with one level, such as imported domains. The search also solves grounded parts of a level, and whole
levels if hierarchical planning fails.

Two search orders take turns in one loop (`confab.planner.grounded.exploring`). The first order uses the heuristic h_FF, preferred
operators and lookahead, and is directed to the goals (`confab.planner.grounded.greedy`). The second order uses novelty, is fast,
and escapes plateaus of the heuristic (`confab.planner.grounded.novelty`). Goals that have to be achieved before others are
preconditions in both orders (`confab.planner.grounded.goal_order`). The plan is shortened afterwards
(`confab.planner.grounded.plan_windows`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import perf_counter

from confab.planner.grounded.exploring import SearchOrder, explore, path_to
from confab.planner.grounded.goal_order import ordered
from confab.planner.grounded.greedy import Greedy
from confab.planner.grounded.grounding import MOST_ROWS, ground
from confab.planner.grounded.hff import heuristic
from confab.planner.grounded.landmarks import landmarks
from confab.planner.grounded.lookahead import lookahead
from confab.planner.grounded.novelty import Novelty
from confab.planner.grounded.plan_windows import shorter
from confab.planner.grounded.shortest import least
from confab.planner.grounded.task import Task
from confab.planner.plan import OUT_OF_MEMORY, Counts, Limits, Outcome, Plan, Reason, Status, UngroundableError
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.problem import Problem

BASE_WORK, STEP_WORK, STEPS_COUNTED, SEARCH_SHARE = 200_000, 1_000, 400, 50
"""Constants that determine the maximum work of shortening a plan; the unit is one examined operator.

The work is the sum of `BASE_WORK`, `STEP_WORK` for each of the first `STEPS_COUNTED` steps, and the work of the search divided by
`SEARCH_SHARE`.
"""


@dataclass(frozen=True)
class Flat:
    """The result of searching a task.

    `plan` contains the operators if `status` is solved. The unit of `work` is one bit of a relaxed plan.
    """

    status: Status
    plan: tuple[int, ...] = ()
    reason: Reason | None = None
    counts: Counts = field(default_factory=Counts)
    work: int = 0


def plan_level(
    problem: Problem,
    level: int | None = None,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    most_work: float = math.inf,
    most_rows: int = MOST_ROWS,
) -> Outcome:
    """Plan one level of a problem, by default the lowest level; symbols that are initially at rest are at rest in the end.

    Parameters
    ----------
    problem : Problem
    level : int, optional
    limits : Limits
        Maximum number of expansions by h_FF, and maximum time in seconds, including grounding.
    most_work : float
        Maximum work, in bits processed by relaxed plans.
    most_rows : int
        Maximum number of rows of one join when the level is grounded.

    Returns
    -------
    Outcome
        The status unsolvable refers to this level only.
    """
    began = perf_counter()
    deadline = limits.end()
    level = problem.domain.levels[-1] if level is None else level
    try:
        task = ground(problem, level, None, problem.goal_on(level), most_rows, deadline)
    except (UngroundableError, OutOfTimeError) as error:
        return Outcome(Status.GAVE_UP, reason=Reason(f"grounding stopped: {error}"), seconds=perf_counter() - began)
    except MemoryError:
        return Outcome(Status.GAVE_UP, reason=OUT_OF_MEMORY, seconds=perf_counter() - began)
    if isinstance(task, Reason):
        return Outcome(Status.UNSOLVABLE, reason=task, search={level: Counts()}, seconds=perf_counter() - began)
    try:
        found = search(task, limits, deadline, most_work=most_work)
    except OutOfTimeError:
        found = Flat(Status.GAVE_UP, (), Reason("the time limit came first"))
    plan = Plan(task.steps(found.plan)) if found.status is Status.SOLVED else None
    bound = least(task) if plan is not None else None
    return Outcome(found.status, plan, found.reason, {level: found.counts}, seconds=perf_counter() - began, bound=bound)


def search(
    task: Task,
    limits: Limits = Limits(),  # noqa: B008 - frozen
    deadline: float | None = None,
    found: Callable[[Sequence[int]], None] | None = None,
    most_work: float = math.inf,
) -> Flat:
    """Search for a plan of a grounded task.

    The search counts work instead of time. Therefore the same limit of expansions always gives the same plan. A deadline can only
    end the search early.

    Parameters
    ----------
    task : Task
    limits : Limits
        Maximum number of expansions by h_FF; the seconds aren't used (see `deadline`).
    deadline : float, optional
        The deadline on the clock of `time.perf_counter`.
    found : function of a plan, optional
        The function is called with the first plan, before the plan is shortened.
    most_work : float
        Maximum work, in bits processed by relaxed plans.
    """
    flat = Search(task, deadline).go_on(most_work, limits.expansions)
    if flat.status is not Status.SOLVED or not flat.plan:
        return flat
    if found:
        found(flat.plan)
    with suppress(MemoryError, OutOfTimeError):  # otherwise the plan isn't shortened
        work = BASE_WORK + STEP_WORK * min(len(flat.plan), STEPS_COUNTED) + flat.work // SEARCH_SHARE
        return replace(flat, plan=tuple(shorter(task, flat.plan, work, deadline)))
    return flat


class Search:
    """A search for a plan of a grounded task that can be interrupted and resumed; its two search orders take turns."""

    def __init__(self, task: Task, deadline: float | None = None, counts: Counts | None = None) -> None:
        self.task, self.deadline, self.work, self.expanded = task, deadline, 0, 0
        self.counts = Counts() if counts is None else counts
        self._turns = self._explored(task)
        self._result: Flat | None = None

    def go_on(self, most_work: float = math.inf, expansions: float = math.inf) -> Flat:
        """Search until there is a result, or until a limit of the work or of the expansions of the whole search is reached."""
        while self._result is None:
            if self.work >= most_work:
                return self._ended(Status.GAVE_UP, "the limit of work came first")
            if self.expanded >= expansions:
                return self._ended(Status.GAVE_UP, f"the limit of {expansions} expansions came first")
            if self.deadline is not None and perf_counter() > self.deadline:
                return self._ended(Status.GAVE_UP, "the time limit came first")
            before = self.counts.expanded
            try:
                self.work += next(self._turns)
                self.expanded += self.counts.expanded - before
            except StopIteration as end:
                self._result = end.value
            except OutOfTimeError:
                self._result = self._ended(Status.GAVE_UP, "the time limit came first")
            except MemoryError:
                self._result = replace(self._ended(Status.GAVE_UP), reason=OUT_OF_MEMORY)
        return self._result

    def _ended(self, status: Status, why: str | None = None, plan: Sequence[int] = ()) -> Flat:
        return Flat(status, tuple(plan), None if why is None else Reason(why), self.counts, self.work)

    def _explored(self, task: Task) -> Generator[int, None, Flat]:
        """Search; yield the work of each turn of a search order, and return the result."""
        if task.initial & task.goal == task.goal:
            return self._ended(Status.SOLVED)
        task = ordered(task, self.deadline)
        evaluate = heuristic(task)
        begun = evaluate(task.initial)
        if begun is None:
            return self._ended(Status.UNSOLVABLE, "the goal can't be reached even if nothing ever ceases to hold")
        novelty = Novelty(task, evaluate, begun.work, landmarks(task, self.deadline), self.counts)
        greedy = Greedy(task, evaluate, lookahead(task, self.deadline), begun.work, self.counts)
        going: dict[SearchOrder, Iterator[int]] = {order: explore(task, order) for order in (novelty, greedy)}
        spent: dict[SearchOrder, int] = dict.fromkeys(going, 0)
        del novelty, greedy  # releases the memory of an order that runs out of memory
        while True:
            order = min(going, key=spent.__getitem__)
            try:
                work = next(going[order])
                spent[order] += work
                yield work
            except MemoryError:
                del going[order], spent[order]
                if not going:
                    return replace(self._ended(Status.GAVE_UP), reason=OUT_OF_MEMORY)
            except StopIteration:
                break
        if order.best is None:
            return self._ended(
                Status.UNSOLVABLE, "all reachable states were searched, and none of them satisfies the goal"
            )
        return self._ended(Status.SOLVED, plan=path_to(order.reached, order.best))
