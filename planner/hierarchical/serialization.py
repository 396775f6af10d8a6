"""Goals in series: each by a few relevant steps on one table, and what was achieved before is kept.

active   goals to try in one step
asleep   goals that something stands in the way of; they wake when a symbol that they wait for changes
kept     goals that are achieved: a segment may undo them, but must restore them
before   goals after which others could no longer be achieved (a full cup isn't moved) wait for those

When no goal is attainable in one step, something harder is tried (`confab.planner.hierarchical.recovery`). Steps are refined and
done
as soon as they are found, so that a step which can't be refined is noticed where it stands, forbidden there, and searched anew.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from confab.planner.hierarchical.operators import Achiever, Program
from confab.planner.hierarchical.refinement_cache import Advice, RefinedStep, Refiner, Template
from confab.planner.hierarchical.subplans import Effort, Segments
from confab.planner.hierarchical.subproblem import Width
from confab.planner.plan import Outcome, Plan, Reason, Status, Step
from confab.planner.transitions import Cell, Table, arguments_of, key_of
from confab.reasoner.amounts import meets
from confab.reasoner.symbols import FALSE, Condition, Fact, Problem, Symbol

EASY, LONGER = Effort(depth=1), Effort(depth=3)
"""For a goal that one step achieves, and for one that a few relevant steps do."""
ADVISED = Effort(depth=0)
"""By advice alone."""
Attempt: TypeAlias = "Effort | Sequence[Width]"
Asleep: TypeAlias = "dict[Cell, None]"
Before: TypeAlias = "Mapping[Cell, Sequence[Cell]]"
"""For each goal those that must come before it."""
Harder: TypeAlias = "Callable[[Asleep, Before], bool]"
"""Achieves one of the goals that are asleep by more effort; whether that succeeded."""


@dataclass
class Compiled:
    """What can be kept between calls on problems with the same domain, individuals and static facts."""

    program: Program
    templates: dict[str, list[Template]] = field(default_factory=dict)


def compiled(problem: Problem) -> Compiled:
    """Compile the behaviours of a problem, for use in any number of calls with other initial states and goals."""
    return Compiled(Program(problem))


class GoalAdvice(Advice, Protocol):
    """What may know steps to goals, too."""

    expects: bool
    """Whether all goals are of kinds that were reached before."""

    def ready(self) -> bool:
        """Whether advice is to be taken now."""

    def rank(self, cell: Cell) -> int:
        """Return 1 if a goal is promised by one step, 2 if by more, 0 if nothing is promised."""

    def waits(self, cell: Cell) -> bool:
        """Whether another open goal should come first."""


class Call:
    """One planning call: the table, what is achieved, what sleeps, and the steps done so far."""

    def __init__(self, problem: Problem, using: Compiled, deadline: float | None, most: int) -> None:
        self.problem = problem
        self.using = using
        self.program = using.program
        self.goal = {(s.situation, key_of(s.arguments)): value for s, value in problem.goal.items()}
        self.table = Table(problem.domain.situations, problem.initial)
        self.segments = Segments(self.program, self.table, self.goal, deadline, most)
        self.refiner = Refiner(self.segments, using.templates)
        self.kept = {cell: value for cell, value in self.goal.items() if self.met(cell)}
        first = self.program.levels[0]
        rests = {s.name: s.rest for s in problem.domain.situations.values()}
        self.unseen = {
            cell: value
            for cell, value in self.goal.items()
            if not self.segments.visible(first, cell) and rests[cell[0]] in (None, value)
        }
        """Goals unknown to the most abstract level, and free of rest values: its last step brings them about."""
        self.advice: GoalAdvice | None = None
        self.steps: list[RefinedStep] = []
        self.given_up: list[str] = []
        self.aim: dict[Cell, str] = {}
        """The goals that were aimed at last."""
        self.failed: dict[Cell, set[tuple[int, Attempt]]] = {}
        self.progressed = False
        self.restarts = 0
        self.redone = 0
        """How often steps were done from the beginning."""
        self.settled = False
        """Whether the first steps bring to rest what isn't in the beginning."""

    def advise(self, advice: GoalAdvice) -> None:
        """Take advice before any search, for goals and for refinements."""
        self.advice = self.refiner.advice = advice

    def serialise(self, harder: Harder) -> bool:
        """Achieve the goals one after the other, with more effort where these get stuck; whether all are."""
        first = self.program.levels[0]
        active: deque[Cell] = deque()
        asleep: Asleep = {}
        waiting: dict[Cell, list[Cell]] = {}
        before = self.order()
        # What level 1 doesn't see may have been undone where all goals were planned at once.
        self.kept = {cell: value for cell, value in self.kept.items() if self.met(cell)}
        active.extend(cell for cell in self.goal if cell not in self.kept)

        def sleep(cell: Cell, until: Sequence[Cell]) -> None:
            asleep[cell] = None
            for other in until:
                waiting.setdefault(other, []).append(cell)

        def wake(mark: int) -> None:
            for situation, key, _ in self.table.trail[mark:]:
                for cell in waiting.pop((situation, key), ()):
                    if cell in asleep:
                        del asleep[cell]
                        active.append(cell)
                        self.failed.pop(cell, None)
                cell = situation, key
                if cell in self.kept:
                    asleep.pop(cell, None)
                    if not self.met(cell):
                        del self.kept[cell]
                        active.append(cell)
                elif cell in asleep:
                    del asleep[cell]
                    active.append(cell)
            for cell in self.segments.defined:
                if cell in self.kept and not self.met(cell):
                    del self.kept[cell]
                    active.append(cell)
                elif cell in asleep and self.met(cell):
                    del asleep[cell]
                    active.append(cell)

        while active or asleep:
            mark = len(self.table.trail)
            while active:
                cell = active.popleft()
                self.segments.check_time()
                if self.met(cell):
                    self.kept[cell] = self.goal[cell]
                    continue
                unmet = [other for other in before.get(cell, ()) if other not in self.kept]
                promised = self.advice.rank(cell) if self.advice is not None and not unmet else 0
                if unmet:
                    sleep(cell, unmet)
                elif (promised == 1 and self.achieve(first, cell, ADVISED)) or (
                    promised < 2 and self.achieve(first, cell, EASY)
                ):
                    wake(mark)
                    mark = len(self.table.trail)
                else:
                    sleep(cell, self.segments.waits_for(first, cell, self.goal[cell]))
            restarts, redone, steps = self.restarts, self.redone, len(self.steps)
            if asleep and not harder(asleep, before):
                return False
            if self.restarts > restarts:
                return self.serialise(harder)
            wake(mark if self.redone == redone else 0)
            # Where no step was done, a pass has to leave fewer goals asleep: so the loop ends.
            if asleep and not active and len(self.steps) == steps:
                there = [cell for cell in asleep if self.met(cell)]
                if not there:
                    return False
                for cell in there:
                    del asleep[cell]
                    self.kept[cell] = self.goal[cell]
        return True

    def redo(self, steps: Sequence[RefinedStep]) -> None:
        """Do steps from the beginning in place of those done so far; marks of the trail from before are void then."""
        self.redone += 1
        self.table.undo(0)
        for step in steps:
            self.refiner.again(step)

    def achieve(self, level: int, cell: Cell, attempt: Attempt) -> bool:
        """Achieve one goal and keep the others, by steps of a level that are refined and done; whether that succeeded."""
        return self.reach(level, {cell: self.goal[cell]}, attempt)

    def reach(self, level: int, targets: dict[Cell, str], attempt: Attempt) -> bool:
        """Do refined steps of a level after which the targets and all goals reached before hold; whether there are some."""
        first = level == self.program.levels[0]
        self.aim, self.refiner.at = targets, None
        hidden = self.unseen if first else {}  # seldom any: no copy of all goals for each of them
        kept = {c: v for c, v in self.kept.items() if c not in hidden} if hidden else self.kept
        keep = self.segments.keeping(kept)
        if attempt is ADVISED:
            steps = self.advice.follow(level, targets, keep) if self.advice is not None else None
        else:
            steps = self.refiner.achieve(level, targets, keep, attempt)
        if steps is None:
            return False
        self.steps.extend(steps)
        self.progressed = True
        self.kept.update(targets)
        if not first:
            goals = ", ".join(str(Fact(Symbol(c[0], arguments_of(c[1])), v)) for c, v in targets.items())
            self.given_up.append(
                f"level {self.program.levels[0]} was given up for {goals}: no steps of it were found that can be refined; "
                f"steps of level {level} stand there"
            )
        return True

    def met(self, cell: Cell) -> bool:
        """Whether a goal holds now."""
        return meets(self.table.now[cell[0]].get(cell[1], FALSE), self.goal[cell])

    def at_rest(self) -> bool:
        """Whether everything that the uppermost level doesn't know of rests."""
        return not any(self.restless(level) for level in self.program.levels[1:])

    def restless(self, level: int) -> dict[Cell, str]:
        """Return the values of rest of what a level knows of and what doesn't rest."""
        return {
            (name, key): situation.rest
            for name, situation in self.problem.domain.situations.items()
            if situation.level == level and situation.rest is not None
            for key, value in self.table.now[name].items()
            if value != situation.rest
        }

    def order(self) -> dict[Cell, list[Cell]]:
        """Return for each goal those that must come before it: once it holds, they couldn't be achieved any more."""
        by_individual: dict[str, list[Cell]] = {}
        for cell in self.goal:
            plain = cell[0] not in self.program.rules and self.problem.domain.situations[cell[0]].quantity is None
            if cell not in self.kept and plain:
                for individual in {*arguments_of(cell[1]), self.goal[cell]}:
                    by_individual.setdefault(individual, []).append(cell)
        before: dict[Cell, list[Cell]] = {}
        known: dict[tuple[str, str, int], bool] = {}
        for cells in by_individual.values():
            for cell in cells:
                self.segments.check_time()
                for other in cells:
                    if cell is not other:
                        pattern = cell[0], other[0], self.program.alike.sort.get(arguments_of(cell[1])[0], -1)
                        if pattern not in known:
                            known[pattern] = self.rules_out(other, cell)
                        if known[pattern]:
                            before.setdefault(other, []).append(cell)
        return before

    def rules_out(self, first: Cell, then: Cell) -> bool:
        """Whether with goal `first` achieved, no behaviour of the first level could achieve goal `then` any more."""
        level = self.program.levels[0]
        mark = len(self.table.trail)
        self.table.put(*first, self.goal[first])
        try:
            dead = False
            for achiever in self.program.achievers.get((level, then[0]), ()):
                achieve = self.segments.achieve[achiever.behavior, achiever.effect]
                for _, unmet, env in achieve(*arguments_of(then[1]), self.goal[then]):
                    if all(self.attainable(level, achiever.soft[number], achiever, env) for number in unmet):
                        return False
                    dead = True
            return dead
        finally:
            self.table.undo(mark)

    def attainable(self, level: int, condition: Condition, achiever: Achiever, env: Mapping[str, str | None]) -> bool:
        """Whether some behaviour of a level has an effect that could bring an unmet condition about."""
        for situation, key, values in self.segments.wants.of(achiever, condition, env, level):
            for other in self.program.achievers.get((level, situation), ()):
                for value in values:
                    achieve = self.segments.achieve[other.behavior, other.effect]
                    if next(achieve(*arguments_of(key), value), None) is not None:
                        return True
        return False

    def outcome(self, status: Status, plan: Plan | None, reason: Reason | None, seconds: float) -> Outcome:
        """Return how the call ended, with what it counted."""
        cache, given_up = self.refiner, tuple(self.given_up)
        return Outcome(
            status,
            plan,
            reason,
            self.segments.counts,
            len(given_up),
            seconds,
            hits=cache.hits,
            misses=cache.misses,
            given_up=given_up,
        )

    def tree(self) -> Plan:
        """Return the steps done as a plan."""
        id_of, variables = self.program.problem.id_of, self.program.variables

        def step(done: RefinedStep, path: tuple[int, ...]) -> Step:
            level, name, arguments, bindings, below = done
            bound = dict(zip(variables[name], bindings, strict=True)) if bindings else {}
            inner = tuple([step(child, (*path, i)) for i, child in enumerate(below)])
            return Step(path, id_of(name, arguments), level, name, arguments, bound, None, inner)

        return Plan(tuple([step(done, (i,)) for i, done in enumerate(self.steps)]))
