"""Regrouping: a run of consecutive steps of one level becomes the refinement of an upper-level step with the same effect.

If no single step of the level above has the effect of a run, the run becomes the joint refinement of several steps
(docs/levels.md). Each of these upper-level steps takes place during the run: in some state of the run, all facts that the step
makes true hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from itertools import product
from math import prod
from typing import TypeAlias

from confab.planner.hierarchical.call import Call, Compiled, compiled
from confab.planner.hierarchical.workspace import Ground
from confab.planner.plan import Plan, Step, renumbered
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import FALSE, Behavior, Problem, ValueEffect

Seen: TypeAlias = "tuple[str, ...]"
"""The values of the changed symbols as a level sees them; a value that the level doesn't see is replaced by an empty text."""

LONGEST = 60
"""Maximum number of steps that are grouped under one step of the level above."""
WORK = 100_000
"""Maximum number of upper-level steps that are tried in the search for steps with the same joint effect as a run."""
MOST_FILLED = 1_000
"""Maximum number of instances of a behaviour that are tried for one fact.

The instances differ in the individuals that the fact doesn't determine.
"""


def under_the_levels_above(problem: Problem, plan: Plan, using: Compiled | None = None) -> Plan:
    """Return a plan of one level in which runs of consecutive steps are grouped under upper-level steps with the same effect.

    As few steps as possible stay ungrouped. The result may be invalid; `validate` then rejects the plan.
    """
    steps = list(plan.steps)
    levels = [level for level in problem.domain.levels if steps and level < steps[0].level]
    try:
        call = Call(problem, using or compiled(problem), None, 0) if levels else None
        for level in reversed(levels):
            grouped = _Course(call, steps, level).grouped() if call is not None else steps
            if grouped == steps:
                break
            steps = grouped
    except LimitError:  # the remaining levels stay ungrouped
        pass
    return Plan(renumbered(steps))


class _Course:
    """The states before and after some steps, as the level above the steps sees them.

    `values` contains the values that differ from the initial state, and `seen` the values that the level sees.
    """

    def __init__(self, call: Call, steps: Sequence[Step], level: int) -> None:
        self.call, self.steps, self.level = call, steps, level
        self.problem, self.table = call.problem, call.table
        self.values: list[dict[Cell, str]] = [{}]
        self.resting, restless = [0], set[Cell]()
        situations = self.problem.domain.situations
        touched = dict[Cell, None]()
        self.table.undo(0)
        for number, step in enumerate(steps, 1):
            call.space.check_time()
            mark = len(self.table.trail)
            for one in Plan((step,)).primitives:
                done = call.space.forward[one.behavior](*one.arguments)
                if done is not None:
                    call.space.apply(done[1])
            for cell in self.table.before(mark):
                touched[cell] = None
                if situations[cell[0]].level > level and cell[0] in call.space.rest:
                    rests = self.table.now[cell[0]][cell[1]] == call.space.rest[cell[0]]
                    (restless.discard if rests else restless.add)(cell)
            self.values.append(self.table.since(0))
            if not restless:
                self.resting.append(number)
        self.place = {cell: i for i, cell in enumerate(cell for cell in touched if call.space.visible(level, cell))}
        self.counted = {i for cell, i in self.place.items() if situations[cell[0]].quantity is not None}
        self.seen: list[Seen] = []
        for values in self.values:
            self.table.undo(0)
            self.table.put_all(values)
            self.seen.append(self.now())
        self.table.undo(0)

    def now(self) -> Seen:
        """Return the values of the table that the level sees."""
        now, levels = self.table.now, self.problem.value_levels
        values = (now[cell[0]].get(cell[1], FALSE) for cell in self.place)
        return tuple("" if levels.get(value, 1) > self.level else value for value in values)

    # ---------------------------------------------------------------------------------------------------------- groups

    def grouped(self) -> list[Step]:
        """Return the steps grouped under steps of the level with the same effects.

        As many steps as possible are grouped, under as few steps of the level as possible. At the begin and at the end of a group,
        all changed symbols that the level doesn't see are at rest.
        """
        seen, resting, end = self.seen, self.resting, len(self.steps)
        # for two positions, the steps of the upper level under which the steps between the positions are grouped
        groups: dict[tuple[int, int], list[Ground]] = {}
        for i in resting:
            self.enter(i)
            last = min(i + LONGEST, end)
            ways = {after: ground for ground, after in self.successors(self.candidates(i, last))}
            for j in resting:
                if i < j <= last and seen[j] != seen[i] and seen[j] in ways:
                    groups[i, j] = [ways[seen[j]]]
        best = _fewest(groups, end)
        points = [i for k, i in enumerate(resting) if k == 0 or i == end or seen[i] != seen[resting[k - 1]]]
        span, work = 1, WORK
        while span < 2 * len(points) and any(pair not in groups for pair in best):
            alone = {i for i, j in best if (i, j) not in groups}
            for i, j in zip(points, (*points[span:], *points[-1:] * span), strict=False):
                if (i, j) not in groups and not alone.isdisjoint(range(i, j)):
                    found, work = self.leading(i, j, work)
                    if found:
                        groups[i, j] = found
            best, span = _fewest(groups, end), 2 * span
        return [self.node(i, j, groups.get((i, j))) for i, j in best]

    def node(self, begin: int, end: int, grounds: Sequence[Ground] | None) -> Step:
        """Return the upper-level step, or the steps that are refined together, above the steps between two positions."""
        if grounds is None:
            return self.steps[begin]
        self.enter(begin)
        made: list[Step] = []
        for name, arguments in grounds:
            done = self.call.space.forward[name](*arguments)
            assert done is not None
            bindings = dict(zip(self.call.program.variables[name], done[0], strict=True))
            made.append(Step((), self.problem.id_of(name, arguments), self.level, name, arguments, bindings))
            self.call.space.apply(done[1])
        return replace(made[0], steps=tuple(self.steps[begin:end]), joined=tuple(made[1:]))

    def leading(self, begin: int, end: int, left: int) -> tuple[list[Ground], int]:
        """Return steps of the level that lead from one position to another, and the remaining work.

        The search prefers states with few wrong values. Among these, it prefers states whose new facts hold early in the sequence
        of the given steps. If the search fails, return no steps.
        """
        course, candidates = self.seen[begin : end + 1], self.candidates(begin, end)
        first, last = course[0], course[-1]
        made: dict[frozenset[tuple[int, str]], int | None] = {}  # the first position at which new facts hold together
        before: dict[Seen, tuple[Seen, Ground]] = {}
        waiting = [(0, 0, 0, first)]
        while waiting and left > 0 and last not in before:
            *_, state = heappop(waiting)
            self.enter(begin, state)
            left -= len(candidates)
            for ground, after in self.successors(candidates):
                if after == first or after in before:
                    continue
                facts = enumerate(zip(state, after, strict=True))
                new = frozenset((i, value) for i, (old, value) in facts if value != old and i not in self.counted)
                if new not in made:
                    left -= len(course)
                    holding = (at for at, other in enumerate(course) if all(other[i] == value for i, value in new))
                    made[new] = next(holding, None)
                if (at := made[new]) is not None:
                    before[after] = state, ground
                    wrong = sum(value != wanted for value, wanted in zip(after, last, strict=True))
                    heappush(waiting, (wrong, at, len(before), after))
        found, state = list[Ground](), last
        while state in before:
            state, ground = before[state]
            found.append(ground)
        found.reverse()
        for position in reversed(range(len(found))):
            fewer = found[:position] + found[position + 1 :]
            left -= len(fewer)
            if left > 0 and self.leads(begin, fewer, last):
                found = fewer
        return found, left

    def leads(self, begin: int, grounds: Iterable[Ground], last: Seen) -> bool:
        """Return whether steps of the level are applicable from a position, and lead to a state."""
        self.enter(begin)
        for name, arguments in grounds:
            done = self.call.space.forward[name](*arguments)
            if done is None:
                return False
            self.call.space.apply(done[1])
        return self.now() == last

    # --------------------------------------------------------------------------------------------- steps of the level

    def enter(self, position: int, seen: Seen | None = None) -> None:
        """Bring the table to the state at a position; the level then sees the values `seen`, if given."""
        self.table.undo(0)
        self.table.put_all(self.values[position])
        if seen is not None and seen != self.seen[position]:
            there = self.seen[position]
            self.table.put_all({cell: seen[i] for cell, i in self.place.items() if seen[i] != there[i]})

    def successors(self, candidates: Iterable[Ground]) -> Iterator[tuple[Ground, Seen]]:
        """Yield the applicable candidates, each with the values that the level sees afterwards.

        Candidates that change a symbol that the steps don't change are left out.
        """
        self.call.space.check_time()
        state, levels = self.now(), self.problem.value_levels
        for name, arguments in candidates:
            done = self.call.space.forward[name](*arguments)
            if done is None:
                continue
            after = list(state)
            for situation, key, value in done[1]:
                place = self.place.get((situation, key))
                if place is not None:
                    after[place] = "" if levels.get(value, 1) > self.level else value
                elif self.table.now[situation].get(key, FALSE) != value:
                    break
            else:
                yield (name, arguments), tuple(after)

    def candidates(self, begin: int, end: int) -> list[Ground]:
        """For all facts that become true between two positions, return the steps of the level that could make one of them true."""
        found = dict[Ground, None]()
        facts = dict[tuple[Cell, str], None]()
        for before, after in zip(self.seen[begin:end], self.seen[begin + 1 : end + 1], strict=True):
            if before != after:
                facts.update(((cell, after[i]), None) for cell, i in self.place.items() if before[i] != after[i])
        for cell, value in facts:
            for behavior in self.problem.domain.at_level(self.level):
                found.update(dict.fromkeys(self.filled(behavior, cell, value)))
        return list(found)

    def filled(self, behavior: Behavior, cell: Cell, value: str) -> Iterator[Ground]:
        """Yield the instances of a behaviour whose most specific effect could give a value to a symbol."""
        names = {p.name for p in behavior.parameters}
        effect = max(
            (effect for effect in behavior.every_effect if not effect.when),
            key=lambda effect: len(names & {*effect.arguments, getattr(effect, "value", "")}),
            default=None,
        )
        if effect is None or effect.situation != cell[0]:
            return
        pairs = [*zip(effect.arguments, arguments_of(cell[1]), strict=True)]
        pairs += [(effect.value, value)] if isinstance(effect, ValueEffect) else []
        terms: dict[str, str] = {}
        for term, individual in pairs:
            if terms.setdefault(term, individual) != individual or (term not in behavior.kinds and term != individual):
                return
        members = self.problem.members
        choices = [[terms[p.name]] if p.name in terms else sorted(members(p.kind)) for p in behavior.parameters]
        if prod(map(len, choices)) <= MOST_FILLED:
            for arguments in product(*choices):
                if all(one in members(p.kind) for one, p in zip(arguments, behavior.parameters, strict=True)):
                    yield behavior.name, arguments


def _fewest(groups: Mapping[tuple[int, int], Sequence[Ground]], length: int) -> list[tuple[int, int]]:
    """Return a division of steps into groups and single steps, each as its begin and its end.

    The division has as few single steps as possible; among such divisions, it has the fewest upper-level steps, and then the
    most groups.
    """
    best: list[tuple[int, int, int, int]] = [
        (0, 0, 0, 0)
    ]  # single steps, upper steps, minus groups, begin of the last part
    of_end: dict[int, list[int]] = {}
    for begin, end in groups:
        of_end.setdefault(end, []).append(begin)
    for end in range(1, length + 1):
        alone, many, fewer, _ = best[end - 1]
        ways = [(alone + 1, many, fewer, end - 1)]
        for begin in of_end.get(end, ()):
            alone, many, fewer, _ = best[begin]
            ways.append((alone, many + len(groups[begin, end]), fewer - 1, begin))
        best.append(min(ways))
    found: list[tuple[int, int]] = []
    end = length
    while end:
        found.append((best[end][-1], end))
        end = best[end][-1]
    return found[::-1]
