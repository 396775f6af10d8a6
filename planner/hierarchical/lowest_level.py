"""The lowest level as a whole: grounded, and searched in turns with planning goal by goal; a plan of it is an answer, too.

A search of the lowest level stops planning goal by goal if it proves that there is no plan, or if it finds a cheapest plan of steps
of the first level. Any other plan is the answer if planning goal by goal finds none with a little more work.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from confab.planner.hierarchical.call import Call, as_refined
from confab.planner.hierarchical.regrouping import regroupings
from confab.planner.plan import OUT_OF_MEMORY, Plan, Reason, Status, UngroundableError, UnsolvableError
from confab.planner.plan_costs import cost_of
from confab.planner.validation import validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact

if TYPE_CHECKING:
    from confab.planner.grounded.best_first import Search
    from confab.planner.grounded.reachability import Reached
    from confab.planner.grounded.task import Task

LOOKING = 1_800_000
"""Work that is always allowed for the examination of all states; the unit is one relaxed operator in one state."""
TURNS = 4
"""The search of the lowest level as a whole has cost at most the effort of planning goal by goal, divided by this number."""
MOST_ROWS, MOST_CHANGES = 2_000_000, 10_000_000
"""Maximum number of rows of a join of relaxed reachability (about 200 MB), and maximum number of changes of a grounded level
(about 600 MB)."""


class CheapestPlanFoundError(Exception):
    """Planning goal by goal ends, since the plan of the lowest level is a cheapest plan of steps of the first level."""


class LowestLevel:
    """The lowest level of a call, and the plan that its search has found.

    Parameters
    ----------
    call : Call
    end : float, optional
        Time until which planning goal by goal may go on after a plan was found.
    searched : bool
        Whether the level is searched for a plan.
    """

    def __init__(self, call: Call, end: float | None = None, searched: bool = True) -> None:
        self.call, self.end, self.searched = call, end, searched
        self.plan: Plan | None = None
        self.cheapest = False
        self._task: Task | Reason | None = None
        self._tasks = self._with_rest_values()
        self._search: Search | None = None

    @property
    def too_large(self) -> Reason | None:
        """The reason why grounding of the level failed, or None before such a failure."""
        return self._task if isinstance(self._task, Reason) else None

    def task(self) -> Task | Reason:
        """Return the grounded level, or the reason why it can't be grounded."""
        if self._task is None:
            self._task = proved(self.call.problem, self.call.program.levels[-1], self.call.space.deadline)
        return self._task

    def _with_rest_values(self) -> Iterator[Task]:
        """Yield the grounded level, and then the level with more goals: the rest values that don't hold initially."""
        from confab.planner.grounded.grounding import ground

        lowest, problem = self.task(), self.call.problem
        if isinstance(lowest, Reason):
            return
        yield lowest
        level = lowest.level
        rests = {symbol: problem.domain.situations[symbol.situation].rest for symbol in problem.initial}
        goal = problem.goal_on(level)
        more = {s: rest for s, rest in rests.items() if rest and s not in goal and problem.first_level(s) <= level}
        if more:
            with suppress(UngroundableError, MemoryError):
                task = ground(problem, level, goal={**goal, **more}, deadline=self.call.space.deadline)
                if not isinstance(task, Reason):
                    yield task

    def search(self, most_work: float, expansions: float = math.inf) -> Reason:
        """Search the level until this has cost `most_work` or a number of expansions, or until a plan is found.

        Raise `UnsolvableError` if there is a proof; otherwise return why the search ends.
        """
        from confab.planner.grounded.best_first import Search

        space = self.call.space
        while self.searched and self.plan is None:
            if self._search is None:
                task = next(self._tasks, None)
                if task is None:
                    return self.too_large or Reason("each plan that was found leaves a changed symbol not at rest")
                self._search = Search(task, space.deadline, space.counts[task.level])
            flat, task = self._search.go_on(most_work, expansions), self._search.task
            if flat.status is Status.GAVE_UP and flat.reason is not None:
                return flat.reason
            if flat.status is Status.UNSOLVABLE and flat.reason is not None and task is self._task:
                raise UnsolvableError(flat.reason)
            self._search = None
            if flat.status is Status.SOLVED:
                self.offer(Plan(task.steps(flat.plan)), False)
        return Reason("a plan was found")

    def offer(self, plan: Plan, cheapest: bool) -> None:
        """Group a plan of the level under steps of the levels above and keep it, if it is a plan of the call's problem.

        Planning goal by goal ends at once if the plan is a cheapest plan, and all its steps have been grouped under single steps of
        the first level. Otherwise it goes on with as much work as it has done, and at least with the work `LOOKING`; with `TURNS`
        times as much if the plan leaves a level.

        Raises
        ------
        CheapestPlanFoundError
            Planning goal by goal ends at once, since the plan is the answer.
        """
        call, space, first = self.call, self.call.space, self.call.program.levels[0]
        plans = regroupings(call.problem, plan, call.program.levels[-1], call.using) if self.searched else ()
        found = next((one for one in plans if not validate(call.problem, one)), None)
        if found is None:
            return
        self.plan, self.cheapest, space.deadline = found, cheapest, self.end
        stays = all(step.level == first for step in found.steps)
        space.most_work = min(space.most_work, space.worked + max(space.worked, LOOKING) * (1 if stays else TURNS))
        if cheapest and stays and not any(step.joined for step in found.steps):
            raise CheapestPlanFoundError

    def adopt(self) -> None:
        """Replace the steps of the call by the plan."""
        call, (first, *lower) = self.call, self.call.program.levels
        assert self.plan is not None
        call.steps, call.given_up, call.achieved = as_refined(call, self.plan.steps), [], dict(call.goal)
        if self.cheapest:
            call.bound = cost_of(call.problem, self.plan)
        if any(step.level != first for step in self.plan.steps):
            left, were = [first, *lower[:-1]], "were" if lower[1:] else "was"
            call.given_up.append(
                f"level{'s' * (len(left) > 1)} {', '.join(map(str, left))} {were} given up for the whole task"
            )


def closed(problem: Problem, level: int, deadline: float | None) -> Reached:
    """Return the facts of a level that are reachable under delete relaxation."""
    from confab.planner.grounded import reachability

    reached = reachability.Reached(problem, level, problem.initial, MOST_ROWS, deadline)
    reached.close()
    return reached


def refusal(reached: Reached, most: int = MOST_CHANGES) -> Reason | None:
    """Return the reason why grounding a level would need too much memory, or None if the memory suffices.

    An effect leads to a separate change for each value of its symbol.
    """
    values = {}
    for name, situation in reached.situations.items():
        rows = len(reached.tables["situation", name])
        values[name] = 1 if situation.boolean else 1 + rows // max(len(reached.symbols[name]), 1)
    changes = sum(
        len(rows) * sum(values[effect.situation] for _, effect in schema.effects)
        for schema, rows in zip(reached.schemas, reached.rows, strict=True)
    )
    if changes <= most:
        return None
    return Reason(f"level {reached.level} can't be grounded: {changes} changes, more than the {most} allowed")


def proved(problem: Problem, level: int, deadline: float | None = None) -> Task | Reason:
    """Raise `UnsolvableError` if a goal is unreachable on a level under delete relaxation.

    Otherwise return the grounded level, or the reason why the level is too large to be grounded.
    """
    from confab.planner.grounded.grounding import ground

    try:
        reached = closed(problem, level, deadline)
        for symbol, value in sorted(problem.goal.items()):
            if not reached.possible(symbol, value):
                raise UnsolvableError(Reason(f"{Fact(symbol, value)} can't be reached"))
        too_large = refusal(reached)
        if too_large is not None:
            return too_large
        task = ground(problem, level, goal=problem.goal_on(level), deadline=deadline)
    except UngroundableError as error:
        return Reason(f"level {level} can't be grounded: {error}")
    except MemoryError:
        return OUT_OF_MEMORY
    if isinstance(task, Reason):
        raise UnsolvableError(task)
    return task


def exhausted(task: Task, most: int, deadline: float | None = None) -> Reason | Plan | None:
    """Search the states of a task in the order of their costs, at most `most` states.

    Return a cheapest plan, the reason why no reachable state satisfies the goal, or None if the states don't suffice to know.
    """
    from confab.planner.grounded.shortest import shortest

    found = shortest(task, most_expanded=most, deadline=deadline, most_reached=most)
    if found.plan is not None and found.bound >= task.cost_of(found.plan):
        return Plan(task.steps(found.plan))
    if found.bound < math.inf or found.plan is not None:
        return None
    count = len(found.states)
    return Reason(
        f"none of all {count} states of level {task.level} that can be reached fulfils the goal", states=count
    )
