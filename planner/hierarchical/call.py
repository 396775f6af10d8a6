"""One planning call: the workspace, the goals, and the applied steps.

`Call.achieve_goal` searches for steps of a level towards a goal, and immediately refines and applies these steps to the table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from confab.planner.hierarchical.methods import Ranked
from confab.planner.hierarchical.operators import Program
from confab.planner.hierarchical.refinement import Advice, RefinedStep, Refiner
from confab.planner.hierarchical.search_budget import REFINING, SearchBudget
from confab.planner.hierarchical.workspace import Keep, Workspace
from confab.planner.plan import Outcome, Plan, Reason, Status, Step
from confab.planner.transitions import Cell, Table, arguments_of, key_of
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import Method
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Fact, Symbol


@dataclass
class Compiled:
    """The parts of a planning call that other problems with the same domain, individuals and static facts can reuse."""

    program: Program
    methods: dict[str, list[Method]] = field(default_factory=dict)


def compiled(problem: Problem) -> Compiled:
    """Return the compiled behaviours of a problem; calls with other initial states and goals can reuse them."""
    return Compiled(Program(problem))


class GoalAdvice(Advice, Protocol):
    """Interface of learned rules that propose steps for goals and for refinements."""

    ranked: Ranked
    """Function that sorts possible assignments of individuals to the roles of a method, the best assignment first."""
    expects: bool
    """Whether there are rules for all open goals."""

    def ready(self) -> bool:
        """Return whether the effort wasted by rules is within its limit."""

    def rank(self, cell: Cell) -> int:
        """Return 1 if one step of a rule achieves a goal, 2 if rules need several steps, and 0 if there is no rule for the goal."""

    def waits(self, cell: Cell) -> bool:
        """Return whether another open goal should be achieved first."""


class Call:
    """One planning call with its workspace, its goals and the applied steps."""

    def __init__(self, problem: Problem, using: Compiled, deadline: float | None, most: int) -> None:
        self.problem = problem
        self.using = using
        self.program = using.program
        self.goal = {(s.situation, key_of(s.arguments)): value for s, value in problem.goal.items()}
        self.table = Table(problem.domain.situations, problem.initial)
        self.space = Workspace(self.program, self.table, self.goal, deadline, most)
        self.refiner = Refiner(self.space, using.methods)
        self.achieved = {cell: value for cell, value in self.goal.items() if self.met(cell)}
        first, rest = self.program.levels[0], self.space.rest
        self.unseen = {
            cell
            for cell, value in self.goal.items()
            if not self.space.visible(first, cell) and rest.get(cell[0]) in (None, value)
        }
        """Goals that the most abstract level doesn't see and no rest value contradicts; additional steps in the refinement of the
        last step achieve these goals."""
        self.advice: GoalAdvice | None = None
        self.steps: list[RefinedStep] = []
        self.given_up: list[str] = []
        self.aim: dict[Cell, str] = {}
        """The goals of the latest attempt."""
        self.failed: dict[Cell, set[tuple[int | SearchBudget, ...]]] = {}
        self.progressed = False
        self.redone = 0
        """Number of times that all steps were undone and replaced by other steps."""
        self.saving: float | None = None
        """The cost that the last round of shortening saved per second; None before shortening."""
        self.bound: float | None = None
        """A lower bound on the cost of every plan, if the primitives have different costs."""
        self.accepts: Callable[[Plan], bool] = lambda plan: True
        """Whether a shorter plan may take the place of the plan."""
        self.brought_to_rest = False
        """Whether the planner has tried to bring to rest the symbols that aren't at rest in the initial state."""

    def advise(self, advice: GoalAdvice) -> None:
        """Set the advice that the planner follows before any search for goals and refinements."""
        self.advice = self.refiner.advice = advice
        self.refiner.methods.ranked = advice.ranked

    def replace_steps(self, steps: Sequence[RefinedStep]) -> None:
        """Undo all steps and apply `steps` from the initial state; earlier marks of the trail become invalid."""
        self.redone += 1
        self.table.undo(0)
        for step in steps:
            self.refiner.replay_checked(step)

    def resume(self, found: Outcome) -> bool:
        """Apply the steps of the plan of another outcome; return whether all steps are applicable and have their refinements."""
        assert found.plan is not None
        steps = [self.refiner.replay_checked(step) for step in as_refined(self, found.plan.steps)]
        applied = [step for step in steps if step is not None]
        if len(applied) < len(steps):
            self.table.undo(0)
            return False
        self.steps, self.given_up = applied, list(found.given_up)
        self.achieved = {cell: value for cell, value in self.goal.items() if self.met(cell)}
        self.space.worked = found.effort
        self.space.most_work += found.effort
        self.count(found)
        return True

    def achieve_goal(self, level: int, cell: Cell, *budgets: SearchBudget) -> bool:
        """Achieve one goal by refined steps of a level and keep the achieved goals; return whether that succeeded."""
        return self.achieve_goals(level, {cell: self.goal[cell]}, *budgets)

    def achieve_goals(self, level: int, targets: dict[Cell, str], *budgets: SearchBudget) -> bool:
        """Apply refined steps of a level so that the targets and all achieved goals hold; return whether that succeeded."""
        first = self.program.levels[0]
        self.aim, self.refiner.unrefined = targets, None
        last = self._last_step(level, targets)
        keep = self._keeping(level) if last is None else self._keeping_in_last_step()
        steps = self.refiner.achieve(level, targets, keep, budgets)
        if steps is None:
            return False
        self.progressed = True
        self.achieved.update(targets)
        if last is not None:
            self.steps[-1] = last._replace(steps=(*last.steps, *steps))
            return True
        self.steps.extend(steps)
        if level != first:
            goals = ", ".join(str(Fact(Symbol(c[0], arguments_of(c[1])), v)) for c, v in targets.items())
            self.given_up.append(
                f"level {first} was given up for {goals}: no steps of it were found that can be refined; "
                f"steps of level {level} replace them"
            )
        return True

    def _last_step(self, level: int, targets: dict[Cell, str]) -> RefinedStep | None:
        """Return the last step if its refinement by steps of a level may achieve goals that the most abstract level doesn't see."""
        if not self.steps or not self.unseen.issuperset(targets):
            return None
        last = self.steps[-1]
        return last if last.level == self.program.levels[0] and last.steps[0].level == level else None

    def _keeping(self, level: int) -> Keep:
        """Return the function `keep` for steps of a level: they keep the achieved goals that the level sees."""
        if level == self.program.levels[0] and self.unseen:
            return self.space.keeping({c: value for c, value in self.achieved.items() if c not in self.unseen})
        return self.space.keeping(self.achieved)

    def _keeping_in_last_step(self) -> Keep:
        """Return the function `keep` for additional steps in the refinement of the last step.

        An amount must keep the value that the step gives it, even if a goal only bounds the amount.
        """
        first, visible = self.program.levels[0], self.space.visible
        above = self.space.refining(first)
        return lambda cell, value: (
            above(cell, value) if visible(first, cell) else self.achieved.get(cell) or above(cell, value)
        )

    def met(self, cell: Cell) -> bool:
        """Return whether a goal holds in the current state."""
        return meets(self.table.now[cell[0]].get(cell[1], FALSE), self.goal[cell])

    def at_rest(self) -> bool:
        """Return whether every symbol that the most abstract level doesn't see is at rest."""
        return not any(self.restless(level) for level in self.program.levels[1:])

    def restless(self, level: int) -> dict[Cell, str]:
        """Return the symbols of a level that aren't at rest, each with its rest value."""
        return {
            (name, key): situation.rest
            for name, situation in self.problem.domain.situations.items()
            if situation.level == level and situation.rest is not None
            for key, value in self.table.now[name].items()
            if value != situation.rest
        }

    def count(self, other: Outcome) -> None:
        """Add the counts of another search to the counts of this call."""
        for level, counts in other.search.items():
            self.space.counts[level].add(counts)

    def outcome(self, status: Status, plan: Plan | None = None, reason: Reason | None = None) -> Outcome:
        """Return the outcome of the call with the counts of its searches."""
        cache, given_up = self.refiner, tuple(self.given_up)
        return Outcome(
            status,
            plan,
            reason,
            self.space.counts,
            len(given_up),
            hits=cache.hits,
            misses=cache.misses,
            given_up=given_up,
            saving=self.saving,
            bound=self.bound if plan is not None else None,
            effort=self.space.effort,
        )

    def tree(self) -> Plan:
        """Return the applied steps as a plan."""
        id_of, variables = self.program.problem.id_of, self.program.variables

        def step(done: RefinedStep, path: tuple[int, ...]) -> Step:
            level, name, arguments, bindings, below, joined = done
            bound = dict(zip(variables[name], bindings, strict=True)) if bindings else {}
            inner = tuple([step(child, (*path, i)) for i, child in enumerate(below)])
            others = tuple([step(other, path) for other in joined])
            return Step(path, id_of(name, arguments), level, name, arguments, bound, None, inner, others)

        return Plan(tuple([step(done, (i,)) for i, done in enumerate(self.steps)]))


def fresh_call(call: Call, problem: Problem) -> Call:
    """Return a new call from the initial state of a problem; the new call shares the refinements and nogoods of `call`."""
    other = Call(problem, call.using, call.space.deadline, call.space.most)
    other.refiner.refinements, other.refiner.nogoods.known = call.refiner.refinements, call.refiner.nogoods.known
    return other


def as_refined(call: Call, steps: Sequence[Step]) -> list[RefinedStep]:
    """Return the steps of a plan as instances of `RefinedStep`."""
    names = call.program.variables
    return [
        RefinedStep(
            step.level,
            step.behavior,
            step.arguments,
            tuple(step.bindings.get(name, "") for name in names[step.behavior]) if step.bindings else (),
            tuple(as_refined(call, step.steps)),
            tuple(as_refined(call, step.joined)),
        )
        for step in steps
    ]


def bring_to_rest(call: Call) -> bool:
    """Bring all symbols that the upper levels don't see to rest, the lowest level first; return whether that succeeded.

    A held object is put at its goal if a few steps suffice for this, otherwise at any place.
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
        keep = call.space.keeping(call.achieved)
        for wanted in ({**targets, **hidden}, targets):
            steps = call.refiner.achieve(level, wanted, keep, (REFINING,))
            if steps is not None:
                call.steps.extend(steps)
                break
    return call.at_rest()
