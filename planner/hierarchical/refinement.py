"""The recursion: targets are achieved by steps of one level, and each of these is done by achieving its effects on the level below.

achieve   targets, by steps of a level: methods replayed, then a few relevant steps, then scopes; steps that are found are done
do        a step: on the lowest level its changes are made; on another its effects are the targets of the level below, all that its
          own level sees is kept as it was, and what is touched is at rest in the end (docs/levels.md)

A step that can't be done is barred in the state where it was tried, and the search goes on without it. What succeeded for a step is
kept as a method, what failed in a scope as a nogood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from confab.planner.hierarchical.chains import Chain
from confab.planner.hierarchical.effort import REFINING, SMALL, Effort, scopes
from confab.planner.hierarchical.methods import Methods, Roles
from confab.planner.hierarchical.nogoods import Nogoods
from confab.planner.hierarchical.scope import Scope
from confab.planner.hierarchical.workspace import Ground, Keep, Workspace
from confab.planner.transitions import Cell, Change, Changes
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import Method
from confab.reasoner.symbols import FALSE

LONG = 4
"""Minimum number of steps of a method from which on replayed steps that aren't needed here are left out."""
ATTEMPTS, FEW_ATTEMPTS = 40, 4
"""Maximum number of searches for steps that can all be done; and as long as something isn't at rest that may be in the way."""


class RefinedStep(NamedTuple):
    """A step that was done: the individuals of its variables are `bindings`, `steps` refine it."""

    level: int
    behavior: str
    arguments: tuple[str, ...]
    bindings: tuple[str, ...]
    steps: tuple[RefinedStep, ...]


class Task(NamedTuple):
    """A step that is to be refined: its behaviour, its arguments with the individuals of its variables, and how.

    If `careful`, what the level above doesn't see is left as it was.
    """

    behavior: str
    individuals: tuple[str, ...]
    careful: bool


class Advice(Protocol):
    """Steps that experience proposes before they are searched."""

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do steps that achieve the targets and keep the rest; None, and the table as it was, without any."""


class Refiner:
    """Achieves targets and does steps on the table of a workspace.

    Parameters
    ----------
    space : Workspace
    methods : dict
        From earlier calls over the same program; grows.
    """

    def __init__(self, space: Workspace, methods: dict[str, list[Method]]) -> None:
        self.space = space
        self.table = space.table
        self.levels = space.program.levels
        self.methods = Methods(space, methods)
        self.nogoods = Nogoods(space)
        self.hits = self.misses = 0
        changed = frozenset[str]().union(*(b.changes for b in space.program.domain.behaviors.values()))
        situations = space.program.domain.situations.values()
        self.drifting = any(s.level > self.levels[0] and s.rest is None and s.name in changed for s in situations)
        self.found: dict[object, tuple[RefinedStep, ...]] = {}
        """Refinements by task and state: they are done again where the agenda comes to the same state once more."""
        self.careful = False
        """Whether refinements leave as it was what the level above doesn't see, if they can."""
        self.hasty = False
        """Whether refinements are searched in small scopes only."""
        self.advice: Advice | None = None
        self.at: Ground | None = None
        """The step of the most abstract level that is being refined, or couldn't be."""

    def do(self, level: int, name: str, arguments: tuple[str, ...]) -> RefinedStep | None:
        """Do a step, refined to primitives, and return it so; None, and the table as it was, if that can't be done."""
        done = self.space.forward[name](*arguments)
        if done is None:
            return None
        bindings, changes = done
        if level == self.levels[-1]:
            self.space.apply(changes)
            return RefinedStep(level, name, arguments, bindings, ())
        below = self.levels[self.levels.index(level) + 1]
        efforts = (REFINING, SMALL) if self.hasty else (REFINING, *scopes(self.space.program.size(below)))
        targets = self.targets(changes)
        self.at = (name, arguments) if level == self.levels[0] else self.at
        steps = None
        for careful in (True, False) if self.careful else (False,):
            if steps is None:
                task = Task(name, arguments + bindings, careful)
                steps = self.achieve(below, targets, self.space.refining(level, careful), efforts, task)
        if steps is None:
            return None
        self.at = None if level == self.levels[0] else self.at
        return RefinedStep(level, name, arguments, bindings, tuple(steps))

    def achieve(
        self,
        level: int,
        targets: Mapping[Cell, str],
        keep: Keep,
        efforts: Sequence[Effort],
        task: Task | None = None,
    ) -> Sequence[RefinedStep] | None:
        """Do steps of a level after which the targets hold and the rest is kept; None, and the table as it was, without any.

        Parameters
        ----------
        level : int
        targets : mapping of cell to value
        keep : function of a cell and its first value
        efforts : sequence of Effort
            Tried one after the other.
        task : Task, optional
            The step that is refined; without one the targets are goals.
        """
        here: object = None
        if task is not None:
            for method, roles in self.methods.of(task.behavior, task.individuals):
                steps = self.replay(level, method, roles, targets, keep)
                if steps is not None:
                    self.hits += 1
                    self.methods.prefer(method)
                    return steps
            here = task, frozenset(self.table.since(0).items())
            if here in self.found:
                self.hits += 1
                for step in self.found[here]:
                    self.redo(step)
                return self.found[here]
            self.misses += 1
        found = self.advice.follow(level, targets, keep) if task is not None and self.advice is not None else None
        for effort in efforts if found is None else ():
            found = self.searched(level, targets, keep, effort)
            if found is not None:
                break
        if found is not None and task is not None:
            self.found[here] = tuple(found)
            self.methods.learn(task.behavior, [(step.behavior, step.arguments) for step in found], task.individuals)
        return found

    def searched(self, level: int, targets: Mapping[Cell, str], keep: Keep, effort: Effort) -> list[RefinedStep] | None:
        """Search steps of a level with one effort, and do them; None, and the table as it was, without any.

        Steps that touch something and leave it wrong are searched again with this as a target, too.
        """
        if effort.steps == 0 and self.nogoods.apply(level, targets, keep, effort):
            return None
        table, mark, wanted = self.table, len(self.table.trail), dict(targets)
        search = first_search = begun(self.space, level, wanted, keep, effort)
        for _ in range(FEW_ATTEMPTS if self.hasty else ATTEMPTS):
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
                wrong = self.left_wrong(mark, wanted, keep)
                if wrong is None:
                    return steps
                first = next((old for s, key, old in table.trail[mark:] if (s, key) == wrong), None)
                value = keep(wrong, first) if first is not None else None
                if wrong in wanted or value is None:
                    table.undo(mark)
                    break
                wanted[wrong] = value
                table.undo(mark)
                search = begun(self.space, level, wanted, keep, effort)
            table.undo(mark)
        if isinstance(first_search, Scope):
            self.nogoods.learn(level, targets, keep, effort, first_search.held)
        return None

    # ----------------------------------------------------------------------------------------------------- what must hold

    def targets(self, changes: Sequence[Change]) -> dict[Cell, str]:
        """Return the changes that make a difference in the present state."""
        now = self.table.now
        found: dict[Cell, str] = {}
        for situation, key, value in changes:
            if now[situation].get(key) is not None or self.space.exists(situation, key):
                found[situation, key] = value
        return {cell: value for cell, value in found.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)}

    def left_wrong(self, mark: int, targets: Mapping[Cell, str], keep: Keep) -> Cell | None:
        """Return a symbol touched since a mark, or a target, that hasn't the value that it must have; None if all have."""
        now = self.table.now
        for cell, first in self.table.before(mark).items():
            wanted = targets.get(cell) or keep(cell, first)
            if wanted is not None and not meets(now[cell[0]][cell[1]], wanted):
                return cell
        return next(
            (cell for cell, value in targets.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)), None
        )

    # ---------------------------------------------------------------------------------------------------- steps done again

    def replay(
        self, level: int, method: Method, roles: Roles, targets: Mapping[Cell, str], keep: Keep
    ) -> list[RefinedStep] | None:
        """Do the steps of a method; None, and the table as it was, if one can't be done or something is left wrong."""
        mark, steps = len(self.table.trail), list[RefinedStep]()
        for name, arguments in self.methods.filled(method, roles):
            step = self.do(level, name, arguments)
            if step is None:
                break
            steps.append(step)
        if len(steps) < len(method.steps) or self.left_wrong(mark, targets, keep) is not None:
            self.table.undo(mark)
            return None
        if method.open and (self.drifting or len(steps) >= LONG):
            return self.pruned(steps, mark, targets, keep)
        return steps

    def pruned(self, steps: list[RefinedStep], mark: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep]:
        """Return steps, done since a mark, without those that nothing here needs: one alone, or a pair that comes to nothing."""
        for dropped in self._idle(steps, mark, keep):
            rest = [step for i, step in enumerate(steps) if i not in dropped]
            if self._redone(rest, mark) and self.left_wrong(mark, targets, keep) is None:
                return self.pruned(rest, mark, targets, keep)
        self._redone(steps, mark)
        return steps

    def _redone(self, steps: Sequence[RefinedStep], mark: int) -> bool:
        """Do steps in place of what was done since a mark; return whether all could be done."""
        self.table.undo(mark)
        return all(self.again(step) is not None for step in steps)

    def _idle(self, steps: Sequence[RefinedStep], mark: int, keep: Keep) -> list[set[int]]:
        """Return single steps that change only symbols which may have any value in the end, and pairs that undo each other."""
        self.table.undo(mark)
        changes: list[Changes] = []
        for step in steps:
            begin = len(self.table.trail)
            self.again(step)
            changes.append(self.table.changes(begin))
        alone = [
            {i} for i, (old, _) in enumerate(changes) if all(keep(cell, value) is None for cell, value in old.items())
        ]
        return alone + [{i, j} for j, (old, new) in enumerate(changes) for i in range(j) if changes[i] == (new, old)]

    def again(self, step: RefinedStep) -> RefinedStep | None:
        """Do a step once more by the same sub-steps, and return it with its present bindings; None if it can't be done."""
        level, name, arguments, _, below = step
        done = self.space.forward[name](*arguments)
        if done is None:
            return None
        if not below:
            self.space.apply(done[1])
            return RefinedStep(level, name, arguments, done[0], ())
        mark = len(self.table.trail)
        targets = self.targets(done[1])
        inner = []
        for child in below:
            again = self.again(child)
            if again is None:
                self.table.undo(mark)
                return None
            inner.append(again)
        if self.left_wrong(mark, targets, self.space.refining(level)) is not None:
            self.table.undo(mark)
            return None
        return RefinedStep(level, name, arguments, done[0], tuple(inner))

    def redo(self, step: RefinedStep) -> bool:
        """Do the primitives of a step that was done in this very state before; return whether all could be done."""
        if step.steps:
            return all(self.redo(child) for child in step.steps)
        done = self.space.forward[step.behavior](*step.arguments)
        if done is not None:
            self.space.apply(done[1])
        return done is not None


def begun(space: Workspace, level: int, targets: Mapping[Cell, str], keep: Keep, effort: Effort) -> Chain | Scope:
    """Return the search that an effort stands for."""
    if effort.steps:
        return Chain(space, level, targets, keep, effort.steps)
    return Scope(space, level, targets, keep, effort)
