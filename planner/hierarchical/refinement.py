"""Refinement: steps of one level achieve targets, and the effects of each step are targets of the level below.

`Refiner.achieve` applies steps of a level so that the targets hold. The steps come from methods, learned rules, a search for a few
relevant steps, or searches of scopes, in this order. `Refiner.do` applies a single step. On the lowest level, `do` makes the
changes of the step. On any other level, `do` achieves the effects of the step on the level below. Other symbols that the step's
level sees must end unchanged, and symbols that the level doesn't see must end at rest (docs/levels.md).

If a step has no refinement in a state, the step is barred in this state, and the search continues. A successful refinement is
stored as a method. A failed search of a scope is stored as a nogood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from confab.planner.hierarchical.few_steps import FewSteps
from confab.planner.hierarchical.methods import Methods, Roles
from confab.planner.hierarchical.nogoods import Nogoods
from confab.planner.hierarchical.scope import Scope
from confab.planner.hierarchical.search_budget import BY_RULES, REFINING, SMALL, SearchBudget, scope_budgets
from confab.planner.hierarchical.workspace import Ground, Keep, Workspace
from confab.planner.transitions import Cell, Change
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import Method
from confab.reasoner.symbols import FALSE

ATTEMPTS, FEW_ATTEMPTS = 40, 4
"""Maximum number of searches for steps with refinements: in general, and before all symbols have been brought to rest."""


class RefinedStep(NamedTuple):
    """An applied step; `bindings` are the individuals of its variables, and `steps` are its refinement.

    `joined` are further steps that `steps` refine together with this step; they have no sub-steps of their own.
    """

    level: int
    behavior: str
    arguments: tuple[str, ...]
    bindings: tuple[str, ...]
    steps: tuple[RefinedStep, ...]
    joined: tuple[RefinedStep, ...] = ()

    @property
    def together(self) -> tuple[RefinedStep, ...]:
        """The steps that the sub-steps refine together: this step and `joined`."""
        return (self, *self.joined)


class StepToRefine(NamedTuple):
    """A step to be refined: its behaviour, and the individuals of its parameters and variables.

    If `careful`, symbols that the level of the step doesn't see keep their values.
    """

    behavior: str
    individuals: tuple[str, ...]
    careful: bool


class Advice(Protocol):
    """Interface of learned rules that the planner follows before any search."""

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Apply steps of a level that achieve the targets and respect `keep`.

        On failure, return None and leave the table unchanged.
        """


class Refiner:
    """Achieves targets and applies steps in the current state of a workspace.

    Parameters
    ----------
    space : Workspace
    methods : dict
        Methods of earlier calls with the same program; new methods are added.
    """

    def __init__(self, space: Workspace, methods: dict[str, list[Method]]) -> None:
        self.space = space
        self.table = space.table
        self.levels = space.program.levels
        self.methods = Methods(space, methods)
        self.nogoods = Nogoods(space)
        self.hits = self.misses = 0
        self.refinements: dict[object, tuple[RefinedStep, ...]] = {}
        """The known refinements; a refinement is replayed if the same step is refined in the same state."""
        self.careful = False
        """Whether refinements avoid changes of symbols that the level above doesn't see."""
        self.before_rest = False
        """Whether symbols may still be brought to rest; until then, refinements are searched in small scopes, with few attempts."""
        self.advice: Advice | None = None
        self.unrefined: Ground | None = None
        """The latest step of the most abstract level that has no refinement so far, or none in its state."""

    def do(self, level: int, name: str, arguments: tuple[str, ...]) -> RefinedStep | None:
        """Apply a step with its refinement to primitives, and return the refined step.

        On failure, return None and leave the table unchanged.
        """
        done = self.space.forward[name](*arguments)
        if done is None:
            return None
        bindings, changes = done
        if level == self.levels[-1]:
            self.space.apply(changes)
            return RefinedStep(level, name, arguments, bindings, ())
        below = self.levels[self.levels.index(level) + 1]
        larger = (SMALL,) if self.before_rest else scope_budgets(self.space.program.size(below))
        budgets = (BY_RULES, REFINING, *larger)
        targets = self.targets(level, changes)
        self.unrefined = (name, arguments) if level == self.levels[0] else self.unrefined
        steps = None
        for careful in (True, False) if self.careful else (False,):
            if steps is None:
                refined = StepToRefine(name, arguments + bindings, careful)
                steps = self.achieve(below, targets, self.space.refining(level, careful), budgets, refined)
        if steps is None:
            return None
        self.unrefined = None if level == self.levels[0] else self.unrefined
        return RefinedStep(level, name, arguments, bindings, tuple(steps))

    def achieve(
        self,
        level: int,
        targets: Mapping[Cell, str],
        keep: Keep,
        budgets: Sequence[SearchBudget],
        refined: StepToRefine | None = None,
    ) -> Sequence[RefinedStep] | None:
        """Apply refined steps of a level that achieve the targets and respect `keep`, and return these steps.

        On failure, return None and leave the table unchanged.

        Parameters
        ----------
        level : int
        targets : mapping of cell to value
        keep : function of a cell and its first value
            Function that returns the required final value of the cell, or None if any value is allowed.
        budgets : sequence of SearchBudget
            Budgets that are tried one after another.
        refined : StepToRefine, optional
            The step whose effects are the targets, or None if the targets are goals.
        """
        here: object = None
        if refined is not None:
            for method, roles in self.methods.of(refined.behavior, refined.individuals):
                steps = self.replay_method(level, method, roles, targets, keep)
                if steps is not None:
                    self.hits += 1
                    self.methods.prefer(method)
                    return steps
            here = refined, frozenset(self.table.since(0).items())
            if here in self.refinements:
                self.hits += 1
                for step in self.refinements[here]:
                    self.replay(step)
                return self.refinements[here]
            self.misses += 1
        found = None
        for budget in budgets:
            found = self.searched(level, targets, keep, budget)
            if found is not None:
                break
        if found is not None and refined is not None:
            self.refinements[here] = tuple(found)
            self.methods.learn(refined.behavior, [(one.behavior, one.arguments) for one in found], refined.individuals)
        return found

    def searched(
        self, level: int, targets: Mapping[Cell, str], keep: Keep, budget: SearchBudget
    ) -> list[RefinedStep] | None:
        """Search for steps of a level with one budget, and apply the steps.

        If the steps leave a changed symbol with a wrong value, the search is repeated with this symbol as an additional target. On
        failure, return None and leave the table unchanged.
        """
        if budget.rules:
            return self.advice.follow(level, targets, keep) if self.advice is not None else None
        if budget.steps == 0 and self.nogoods.apply(level, targets, keep, budget):
            return None
        table, mark, wanted = self.table, len(self.table.trail), dict(targets)
        search = first_search = begun(self.space, level, wanted, keep, budget)
        for _ in range(FEW_ATTEMPTS if self.before_rest else ATTEMPTS):
            found = search.search()
            if found is None:
                break
            steps: list[RefinedStep] = []
            for position, (name, arguments) in enumerate(found):
                step = self.do(level, name, arguments)
                if step is None:
                    search.bar(position)
                    break
                steps.append(step)
            if len(steps) == len(found):
                wrong = self.wrong_value(mark, wanted, keep)
                if wrong is None:
                    return steps
                first = next((old for s, key, old in table.trail[mark:] if (s, key) == wrong), None)
                value = keep(wrong, first) if first is not None else None
                if wrong in wanted or value is None:
                    table.undo(mark)
                    break
                wanted[wrong] = value
                table.undo(mark)
                search = begun(self.space, level, wanted, keep, budget)
            table.undo(mark)
        if isinstance(first_search, Scope):
            self.nogoods.learn(level, targets, keep, budget, first_search.held)
        return None

    # ---------------------------------------------------------------------------------------------------- required values

    def targets(self, level: int, changes: Sequence[Change]) -> dict[Cell, str]:
        """Return the symbols that a step changes, each with its new value.

        Remembered symbols are left out, and so are totals that the level doesn't see.
        """
        now, domain = self.table.now, self.space.program.domain
        found: dict[Cell, str] = {}
        for situation, key, value in changes:
            if situation in domain.remembers:
                continue
            if situation in domain.aggregates and not self.space.visible(level, (situation, key)):
                continue
            if now[situation].get(key) is not None or self.space.exists(situation, key):
                found[situation, key] = value
        return {cell: value for cell, value in found.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)}

    def wrong_value(self, mark: int, targets: Mapping[Cell, str], keep: Keep) -> Cell | None:
        """Return a target or a changed symbol whose value isn't the required value, or None if there is no such symbol.

        Changed symbols are symbols that were set since a marked state.
        """
        now = self.table.now
        for cell, first in self.table.before(mark).items():
            wanted = targets.get(cell) or keep(cell, first)
            if wanted is not None and not meets(now[cell[0]][cell[1]], wanted):
                return cell
        return next(
            (cell for cell, value in targets.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)), None
        )

    # ------------------------------------------------------------------------------------------------------ replayed steps

    def replay_method(
        self, level: int, method: Method, roles: Roles, targets: Mapping[Cell, str], keep: Keep
    ) -> list[RefinedStep] | None:
        """Apply the steps of a method.

        If a step fails or a value is wrong, return None and leave the table unchanged.
        """
        mark, steps = len(self.table.trail), list[RefinedStep]()
        for name, arguments in self.methods.filled(method, roles):
            step = self.do(level, name, arguments)
            if step is None:
                break
            steps.append(step)
        if len(steps) < len(method.steps) or self.wrong_value(mark, targets, keep) is not None:
            self.table.undo(mark)
            return None
        return steps

    def replay_checked(self, step: RefinedStep) -> RefinedStep | None:
        """Apply a step with the same sub-steps, and return the step with its current bindings.

        Return None and leave the table unchanged if the step or a sub-step isn't applicable, or if the refinement doesn't have the
        effect of the step.
        """
        mark = len(self.table.trail)
        bound, targets = self.stated(step)
        if bound is None:
            return None
        if not step.steps:
            return bound
        self.table.undo(mark)
        inner = []
        for child in step.steps:
            again = self.replay_checked(child)
            if again is None:
                self.table.undo(mark)
                return None
            inner.append(again)
        if self.wrong_value(mark, targets, self.space.refining(step.level)) is not None:
            self.table.undo(mark)
            return None
        return bound._replace(steps=tuple(inner))

    def stated(self, step: RefinedStep) -> tuple[RefinedStep | None, dict[Cell, str]]:
        """Apply the effects of a step, and of the steps joined to it, without the refinement.

        Return the step with its current bindings and without sub-steps, and the values that it states. If the step isn't
        applicable, return None and leave the table unchanged.
        """
        mark, targets, bound = len(self.table.trail), dict[Cell, str](), list[RefinedStep]()
        for level, name, arguments, *_ in step.together:
            done = self.space.forward[name](*arguments)
            if done is None:
                self.table.undo(mark)
                return None, {}
            targets |= self.targets(level, done[1])
            self.space.apply(done[1])
            bound.append(RefinedStep(level, name, arguments, done[0], ()))
        return bound[0]._replace(joined=tuple(bound[1:])), targets

    def replay(self, step: RefinedStep) -> bool:
        """Apply the primitives of a step without checks of its effect; return whether all primitives were applicable."""
        if step.steps:
            return all(self.replay(child) for child in step.steps)
        done = self.space.forward[step.behavior](*step.arguments)
        if done is not None:
            self.space.apply(done[1])
        return done is not None


def begun(
    space: Workspace, level: int, targets: Mapping[Cell, str], keep: Keep, budget: SearchBudget
) -> FewSteps | Scope:
    """Return a search with a budget: for few steps if the budget limits their number, otherwise in a scope."""
    if budget.steps:
        return FewSteps(space, level, targets, keep, budget.steps)
    return Scope(space, level, targets, keep, budget)
