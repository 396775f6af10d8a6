"""Regrouping: consecutive steps of one level become the refinement of steps of the level above with the same effect.

A run is a sequence of consecutive steps between two positions at which all changed symbols that the upper level doesn't see are at
rest. If no single upper-level step has the effect of a run, the run becomes the joint refinement of several steps
(docs/levels.md). Each of these upper-level steps takes place during the run: it is applicable while the run makes its changes, and
in some state of the run, all facts that the step makes true hold.

The function `grouped` first finds an upper-level step for each run (`runs_of_one_step`). While steps stay ungrouped, it takes
longer and longer runs, and searches for several upper-level steps (`joint_steps`). Finally, it chooses runs that leave as few steps
ungrouped as possible (`best_division`).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from itertools import pairwise, product
from math import prod
from typing import TypeAlias

from confab.planner.hierarchical.call import Call, Compiled, compiled
from confab.planner.hierarchical.workspace import Ground
from confab.planner.plan import Plan, Step, renumbered
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.limits import LimitError
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Behavior, ValueEffect

StepRange: TypeAlias = "tuple[int, int]"
"""The steps between two positions; position n is the position after n steps."""
LevelView: TypeAlias = "tuple[str, ...]"
"""The values of the changed symbols as a level sees them; a value that the level doesn't see is replaced by an empty text."""

LONGEST = 60
"""Maximum number of steps that are grouped under one step of the level above."""
WORK = 100_000
"""Maximum number of upper-level steps that are tried in the search for steps with the same joint effect as a run."""
BRIEFLY = 10
"""Work of the first search for the steps of a run: this number times the square of the number of upper-level steps to try.

Most runs without such steps need much more work, because every subset of the steps leads to another state.
"""
MOST_FILLED = 1_000
"""Maximum number of instances of a behaviour that are tried for one fact.

The instances differ in the individuals that the fact doesn't determine.
"""


def regroupings(problem: Problem, plan: Plan, level: int, using: Compiled) -> tuple[Plan, ...]:
    """Return two versions of a plan of one level: grouped under steps of the upper levels, and ungrouped.

    For a plan of the most abstract level, return only this plan.
    """
    return (plan,) if level == problem.domain.levels[0] else (under_the_levels_above(problem, plan, using), plan)


def under_the_levels_above(problem: Problem, plan: Plan, using: Compiled | None = None) -> Plan:
    """Return a plan in which runs of consecutive steps are grouped under steps of the levels above with the same effect.

    The levels are those above the first step of the plan. As few steps as possible stay ungrouped. The result may be invalid;
    `validate` then rejects the plan.
    """
    steps = list(plan.steps)
    levels = [level for level in problem.domain.levels if steps and level < steps[0].level]
    try:
        call = Call(problem, using or compiled(problem), None, 0) if levels else None
        for level in reversed(levels):
            above = grouped(_Views(call, steps, level)) if call is not None else steps
            if above == steps:
                break
            steps = above
    except LimitError:  # the remaining levels stay ungrouped
        pass
    return Plan(renumbered(steps))


def grouped(views: _Views) -> list[Step]:
    """Return the steps grouped under upper-level steps with the same effects.

    As many steps as possible are grouped, under as few upper-level steps as possible.
    """
    groups = runs_of_one_step(views)
    end = len(views.steps)
    division = best_division(groups, end)
    points = views.changing_positions()
    work, refuted = WORK, set[StepRange]()
    for briefly in (True, False):
        span = 1
        while span < 2 * len(points) and any(run not in groups for run in division):
            ungrouped = {begin for begin, end in division if (begin, end) not in groups}
            for run in zip(points, (*points[span:], *points[-1:] * span), strict=False):
                if work <= 0 or run in groups or run in refuted:
                    continue
                if not views.below(run) or ungrouped.isdisjoint(range(*run)):
                    continue
                most = min(work, BRIEFLY * len(candidates(views, run)) ** 2) if briefly else work
                found, left = joint_steps(views, run, most)
                work -= most - left
                if found and each_takes_place(views, run, found):
                    groups[run] = found
                elif left > 0:
                    refuted.add(run)
            division, span = best_division(groups, end), 2 * span
    return [node(views, run, groups[run]) if run in groups else views.steps[run[0]] for run in division]


def node(views: _Views, run: StepRange, above: Sequence[Ground]) -> Step:
    """Return the upper-level step, or the upper-level steps that are refined together, with the steps of a run as sub-steps."""
    call = views.call
    views.enter(run[0])
    made: list[Step] = []
    for name, arguments in above:
        done = call.space.forward[name](*arguments)
        assert done is not None
        bindings = dict(zip(call.program.variables[name], done[0], strict=True))
        made.append(Step((), call.problem.id_of(name, arguments), views.level, name, arguments, bindings))
        call.space.apply(done[1])
    return replace(made[0], steps=tuple(views.steps[slice(*run)]), joined=tuple(made[1:]))


def best_division(groups: Mapping[StepRange, Collection[Ground]], length: int) -> list[StepRange]:
    """Return a division of steps into the runs of groups, and runs of one ungrouped step.

    The division has as few ungrouped steps as possible; among such divisions, it has the fewest upper-level steps, and then the
    most groups.
    """
    begins: dict[int, list[int]] = {}
    for begin, end in groups:
        begins.setdefault(end, []).append(begin)
    # for each position: ungrouped steps, upper-level steps, minus the number of groups, and begin of the last run
    best: list[tuple[int, int, int, int]] = [(0, 0, 0, 0)]
    for end in range(1, length + 1):
        ungrouped, above, minus_groups, _ = best[end - 1]
        divisions = [(ungrouped + 1, above, minus_groups, end - 1)]
        for begin in begins.get(end, ()):
            ungrouped, above, minus_groups, _ = best[begin]
            divisions.append((ungrouped, above + len(groups[begin, end]), minus_groups - 1, begin))
        best.append(min(divisions))
    division: list[StepRange] = []
    while length:
        division.append((best[length][-1], length))
        length = best[length][-1]
    return division[::-1]


# ------------------------------------------------------------------------------------------ upper-level steps of a run


def runs_of_one_step(views: _Views) -> dict[StepRange, list[Ground]]:
    """Return the runs that have the effect of a single upper-level step, each with this step."""
    found: dict[StepRange, list[Ground]] = {}
    for begin in views.resting:
        last = min(begin + LONGEST, len(views.steps))
        views.enter(begin)
        step_to = {after: step for step, after in views.successors(candidates(views, (begin, last)))}
        for end in views.resting:
            after = views.at[end]
            if begin < end <= last and after != views.at[begin] and after in step_to and views.below((begin, end)):
                found[begin, end] = [step_to[after]]
    return found


def joint_steps(views: _Views, run: StepRange, work: int) -> tuple[list[Ground], int]:
    """Return upper-level steps that together have the effect of a run, and the remaining work.

    The depth-first search follows the run: the new facts of each step hold where the new facts of the step before hold, or later.
    Steps whose new facts hold early come first. If the search fails, return no steps.
    """
    course, tried = views.course_of(run), candidates(views, run)
    first, last = course[0], course[-1]
    if any(before and not after for before, after in zip(first, last, strict=True)):
        return [], work  # the run hides a value, which no upper-level step does
    holding_at: dict[frozenset[tuple[int, str]], list[int]] = {}  # after how many primitives new facts hold together
    before: dict[LevelView, tuple[LevelView, Ground]] = {}
    waiting = [(0, 0, 0, first)]
    while waiting and work > 0 and last not in before:
        minus_depth, position, _, state = heappop(waiting)
        views.enter(run[0], state)
        work -= len(tried)
        for step, after in views.successors(tried):
            if after == first or after in before:
                continue
            new = views.new_facts(state, after)
            if new not in holding_at:
                work -= len(course)
                holding_at[new] = [at for at, view in enumerate(course) if all(view[i] == value for i, value in new)]
            later = bisect_left(holding_at[new], position)
            if later < len(holding_at[new]):
                before[after] = state, step
                heappush(waiting, (minus_depth - 1, holding_at[new][later], len(before), after))
    found, state = list[Ground](), last
    while state in before:
        state, step = before[state]
        found.append(step)
    return without_needless(views, run, found[::-1], work)


def without_needless(views: _Views, run: StepRange, steps: list[Ground], work: int) -> tuple[list[Ground], int]:
    """Return the steps without which the joint effect isn't the effect of the run, and the remaining work."""
    for position in reversed(range(len(steps))):
        fewer = steps[:position] + steps[position + 1 :]
        work -= len(fewer)
        if work > 0 and views.leads(run, fewer):
            steps = fewer
    return steps, work


def each_takes_place(views: _Views, run: StepRange, steps: Sequence[Ground]) -> bool:
    """Return whether each of several upper-level steps is applicable while the primitives of a run make its changes.

    A step begins at the first change of one of its symbols after the earlier steps with the same symbol have ended. It ends when
    all facts that it makes true hold. In some state in between, the step has to be applicable if its own symbols still have their
    values from the begin. A passing value is one that the symbol has neither before nor after any of the steps, or that the upper
    level doesn't see. A symbol with a passing value counts with this value, or with its last other value.
    """
    begin, end = views.primitives[run[0]], views.primitives[run[1]]
    course, ended = views.course, dict[int, int]()
    stated = [course[begin]]
    for step in steps:
        views.enter(run[0], stated[-1])
        stated.append(next((after for _, after in views.successors([step])), stated[-1]))
    lasting = [set(values) - {""} for values in zip(*stated, strict=True)]
    settled = {begin: course[begin]}
    for p in range(begin, end):
        pairs = zip(course[p + 1], settled[p], lasting, strict=True)
        settled[p + 1] = tuple(now if now in values else before for now, before, values in pairs)
    for step, view, after in zip(steps, stated, stated[1:], strict=False):
        own = {i for i, _ in views.new_facts(view, after)}
        since = max((ended.get(i, begin) for i in own), default=begin)
        first = next((p for p in range(since, end) if any(course[p][i] != course[p + 1][i] for i in own)), end)
        last = next((p for p in range(first + 1, end) if all(course[p][i] == after[i] for i in own)), end)
        if own and not any(
            views.applicable(p, tuple(settled[first][i] if i in own else v for i, v in enumerate(now)), step)
            for p in range(first, last)
            for now in (course[p], settled[p])
        ):
            return False
        ended.update(dict.fromkeys(own, last))
    return True


def candidates(views: _Views, run: StepRange) -> list[Ground]:
    """Return the upper-level steps that could make one of the facts true that become true during a run."""
    problem, course = views.call.problem, views.course_of(run)
    facts = dict[tuple[Cell, str], None]()
    for before, after in pairwise(course):
        if before != after:
            facts.update(((cell, after[i]), None) for cell, i in views.place.items() if before[i] != after[i])
    found = dict[Ground, None]()
    for cell, value in facts:
        for behavior in problem.domain.at_level(views.level):
            found.update(dict.fromkeys(instances(problem, behavior, cell, value)))
    return list(found)


def instances(problem: Problem, behavior: Behavior, cell: Cell, value: str) -> Iterator[Ground]:
    """Yield the instances of a behaviour whose most specific effect could give a value to a symbol.

    If all effects are conditional, yield the instances with any effect that could do so.
    """
    names = {p.name for p in behavior.parameters}
    always = [effect for effect in behavior.every_effect if not effect.when]
    always.sort(key=lambda effect: len(names & {*effect.arguments, getattr(effect, "value", "")}), reverse=True)
    for effect in always[:1] or behavior.every_effect:
        if effect.situation != cell[0]:
            continue
        pairs = [*zip(effect.arguments, arguments_of(cell[1]), strict=True)]
        pairs += [(effect.value, value)] if isinstance(effect, ValueEffect) else []
        terms: dict[str, str] = {}
        if any(
            terms.setdefault(term, individual) != individual or (term not in behavior.kinds and term != individual)
            for term, individual in pairs
        ):
            continue
        members = problem.members
        choices = [[terms[p.name]] if p.name in terms else sorted(members(p.kind)) for p in behavior.parameters]
        if prod(map(len, choices)) <= MOST_FILLED:
            for arguments in product(*choices):
                if all(one in members(p.kind) for one, p in zip(arguments, behavior.parameters, strict=True)):
                    yield behavior.name, arguments


# ------------------------------------------------------------------------------------------------------------- the states


class _Views:
    """The states before and after some steps, as the level above the steps sees them.

    `course` contains the view after each number of primitives, and `at` the view at each position; `primitives` contains the number
    of primitives before each position, and `place` the place of each changed symbol in a view. At the positions in `resting`, all
    changed symbols that the level doesn't see are at rest.
    """

    def __init__(self, call: Call, steps: Sequence[Step], level: int) -> None:
        self.call, self.steps, self.level = call, steps, level
        self.resting, self.primitives = [0], [0]
        self._values: list[dict[Cell, str]] = [
            {}
        ]  # the values that differ from the initial state, after each primitive
        touched = self._apply_all()
        situations = call.problem.domain.situations
        self.place = {cell: i for i, cell in enumerate(cell for cell in touched if call.space.visible(level, cell))}
        self._amounts = {i for cell, i in self.place.items() if situations[cell[0]].quantity is not None}
        self.course: list[LevelView] = []
        for values in self._values:
            call.table.undo(0)
            call.table.put_all(values)
            self.course.append(self._now())
        self.at = [self.course[number] for number in self.primitives]
        call.table.undo(0)

    def _apply_all(self) -> dict[Cell, None]:
        """Apply the primitives of all steps, record the states between them, and return the changed symbols."""
        table, space = self.call.table, self.call.space
        situations = self.call.problem.domain.situations
        touched, restless = dict[Cell, None](), set[Cell]()
        table.undo(0)
        for position, step in enumerate(self.steps, 1):
            space.check_time()
            mark = len(table.trail)
            for one in Plan((step,)).primitives:
                done = space.forward[one.behavior](*one.arguments)
                if done is not None:
                    space.apply(done[1])
                self._values.append(table.since(0))
            for cell in table.before(mark):
                touched[cell] = None
                if situations[cell[0]].level > self.level and cell[0] in space.rest:
                    rests = table.now[cell[0]][cell[1]] == space.rest[cell[0]]
                    (restless.discard if rests else restless.add)(cell)
            self.primitives.append(len(self._values) - 1)
            if not restless:
                self.resting.append(position)
        return touched

    def course_of(self, run: StepRange) -> Sequence[LevelView]:
        """Return the views after each number of primitives of a run."""
        return self.course[self.primitives[run[0]] : self.primitives[run[1]] + 1]

    def below(self, run: StepRange) -> bool:
        """Return whether all steps of a run are of levels below the upper level."""
        return all(step.level > self.level for step in self.steps[slice(*run)])

    def changing_positions(self) -> list[int]:
        """Return the positions at rest whose view differs from the previous one, with the first and the last position."""
        pairs = zip(self.resting, self.resting[1:], strict=False)
        return [0, *(i for before, i in pairs if i == len(self.steps) or self.at[i] != self.at[before])]

    def new_facts(self, before: LevelView, after: LevelView) -> frozenset[tuple[int, str]]:
        """Return the places and values in which a view differs from the view before; amounts are left out."""
        pairs = enumerate(zip(before, after, strict=True))
        return frozenset((i, value) for i, (old, value) in pairs if value != old and i not in self._amounts)

    def enter(self, position: int, view: LevelView | None = None) -> None:
        """Bring the table to the state at a position; the level then sees the values of `view`, if given."""
        self._put(self.primitives[position], self.at[position] if view is None else view)

    def _put(self, number: int, view: LevelView) -> None:
        table, there = self.call.table, self.course[number]
        table.undo(0)
        table.put_all(self._values[number])
        if view != there:
            table.put_all({cell: view[i] for cell, i in self.place.items() if view[i] != there[i]})

    def applicable(self, number: int, view: LevelView, step: Ground) -> bool:
        """Return whether an upper-level step is applicable after a number of primitives if the level sees the values of `view`."""
        self._put(number, view)
        return self.call.space.forward[step[0]](*step[1]) is not None

    def successors(self, steps: Iterable[Ground]) -> Iterator[tuple[Ground, LevelView]]:
        """Yield the upper-level steps that are applicable in the table, each with the view afterwards.

        Steps that change other symbols than the steps below are left out.
        """
        now, space = self.call.table.now, self.call.space
        space.check_time()
        view = self._now()
        for name, arguments in steps:
            done = space.forward[name](*arguments)
            if done is None:
                continue
            after = list(view)
            for situation, key, value in done[1]:
                place = self.place.get((situation, key))
                if place is not None:
                    after[place] = self._seen(value)
                elif now[situation].get(key, FALSE) != value:
                    break
            else:
                yield (name, arguments), tuple(after)

    def leads(self, run: StepRange, steps: Iterable[Ground]) -> bool:
        """Return whether upper-level steps are applicable at the begin of a run, and lead to the view at its end."""
        self.enter(run[0])
        for name, arguments in steps:
            done = self.call.space.forward[name](*arguments)
            if done is None:
                return False
            self.call.space.apply(done[1])
        return self._now() == self.at[run[1]]

    def _now(self) -> LevelView:
        now = self.call.table.now
        return tuple(self._seen(now[cell[0]].get(cell[1], FALSE)) for cell in self.place)

    def _seen(self, value: str) -> str:
        return "" if self.call.problem.value_levels.get(value, 1) > self.level else value
