"""One planning call: the table of what holds now, the goals, and the steps done so far.

A goal is achieved by steps of a level, which are refined and done on the table at once (`Call.achieve`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from confab.planner.hierarchical.chains import REFINING, Effort, Segments
from confab.planner.hierarchical.operators import Program
from confab.planner.hierarchical.refinement import Advice, RefinedStep, Refiner, Template
from confab.planner.hierarchical.scope import Width
from confab.planner.plan import Outcome, Plan, Reason, Status, Step
from confab.planner.transitions import Cell, Table, arguments_of, key_of
from confab.reasoner.amounts import meets
from confab.reasoner.symbols import FALSE, Fact, Problem, Symbol

ADVISED = Effort(depth=0)
"""By advice alone."""
Attempt: TypeAlias = "Effort | Sequence[Width]"
"""How hard one goal is tried: by relevant steps, or in parts of the world of growing width."""


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
    """One planning call: the table, what is achieved, and the steps done so far."""

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
        self.redone = 0
        """How often steps were done from the beginning."""
        self.settled = False
        """Whether the first steps bring to rest what isn't in the beginning."""

    def advise(self, advice: GoalAdvice) -> None:
        """Take advice before any search, for goals and for refinements."""
        self.advice = self.refiner.advice = advice

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

    def count(self, other: Outcome) -> None:
        """Count what another search did."""
        for level, counts in other.search.items():
            self.segments.counts[level].add(counts)

    def outcome(self, status: Status, plan: Plan | None = None, reason: Reason | None = None) -> Outcome:
        """Return how the call ended, with what it counted."""
        cache, given_up = self.refiner, tuple(self.given_up)
        return Outcome(
            status,
            plan,
            reason,
            self.segments.counts,
            len(given_up),
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


def fresh_call(call: Call, problem: Problem, settled: bool = False) -> Call:
    """Return a call from the beginning once more, that knows which refinements were found and which weren't.

    If `settled`, what isn't at rest is brought to rest first.
    """
    other = Call(problem, call.using, call.segments.deadline, call.segments.most)
    other.refiner.found, other.refiner.failed = call.refiner.found, call.refiner.failed
    if settled:
        settle(other)
        other.settled = bool(other.steps)
    return other


def settle(call: Call) -> bool:
    """Bring everything that the upper levels don't know of to rest, the lowest level first; whether that succeeded.

    What a hand holds goes where it is wanted if that takes no longer, else to any place.
    """
    for level in reversed(call.program.levels[1:]):
        targets = call.restless(level)
        if not targets:
            continue
        hidden = {
            (name, key): call.goal[name, key]
            for name, cells in call.table.now.items()
            for key, value in cells.items()
            if call.problem.value_levels.get(value, 1) == level and (name, key) in call.goal
        }
        keep = call.segments.keeping({})
        for wanted in ({**targets, **hidden}, targets):
            steps = call.refiner.achieve(level, wanted, keep, REFINING)
            if steps is not None:
                call.steps.extend(steps)
                break
    return call.at_rest()
