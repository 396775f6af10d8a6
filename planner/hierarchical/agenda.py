"""The agenda: the planner achieves the goals one after another on one table and keeps the achieved goals.

`_open` contains goals that the planner tries to achieve in one step of the most abstract level. `_asleep` contains blocked goals;
`_woken_by` tells which of them wake when a symbol changes. `Call.achieved` contains achieved goals; later steps may violate these
goals temporarily, but must restore them. `_before` contains ordering constraints: a goal waits for other goals that would become
unreachable (a cup is moved before it is filled).

If no goal is achieved in one step, the agenda raises the search budget gradually, on each level from the top. A failed
attempt is repeated only after a symbol on which the goal depends has changed. Each step is refined and applied as soon
as the step is found.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from confab.planner.hierarchical.call import Call, bring_to_rest
from confab.planner.hierarchical.lowest_level import LowestLevel
from confab.planner.hierarchical.operators import Achiever
from confab.planner.hierarchical.relevance import waits_for
from confab.planner.hierarchical.search_budget import (
    BY_RULES,
    FEW_STEPS,
    MOST_OPERATORS,
    ONE_STEP,
    PART,
    WHOLE,
    SearchBudget,
    scope_budgets,
)
from confab.planner.hierarchical.unsolvability import Proofs
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.symbols import Condition


@dataclass
class Agenda:
    """The goals of a call and the attempts to achieve them.

    Attributes
    ----------
    call : Call
    levels : tuple of int, optional
        Levels whose steps may be used, by default all levels. For goals that the first level doesn't see, steps of all
        levels may be used.
    quickly : bool
        Whether the agenda tries only relevant steps and small scopes.
    lowest : LowestLevel, optional
        The lowest level, which is searched for a proof or a plan meanwhile. Without it, the agenda neither restarts from the
        initial state nor attempts to prove that there is no plan.
    """

    call: Call
    levels: tuple[int, ...] | None = None
    quickly: bool = False
    lowest: LowestLevel | None = None
    _open: deque[Cell] = field(default_factory=deque)
    _asleep: dict[Cell, None] = field(default_factory=dict)
    _woken_by: dict[Cell, list[Cell]] = field(default_factory=dict)
    _before: Mapping[Cell, Sequence[Cell]] = field(default_factory=dict)
    _restarted: bool = False
    proofs: Proofs = field(init=False)

    def __post_init__(self) -> None:
        self.proofs = Proofs(self.lowest or LowestLevel(self.call), wanted=self.lowest is not None)

    # ------------------------------------------------------------------------------------------------- one goal after another

    def achieve_all(self) -> bool:
        """Achieve the goals one after another, with larger search budgets for blocked goals; return whether all goals hold."""
        call = self.call
        if self.lowest is not None:
            call.space.meanwhile = self.proofs.check
        self.begin()
        while self._open or self._asleep:
            mark = len(call.table.trail)
            while self._open:
                cell = self._open.popleft()
                call.space.check_time()
                if call.met(cell):
                    call.achieved[cell] = call.goal[cell]
                elif self.by_one_step(cell):
                    self.wake(mark)
                    mark = len(call.table.trail)
            redone, steps = call.redone, len(call.steps)
            if self._asleep and not self.with_larger_budgets():
                return False
            self.wake(mark if call.redone == redone else 0)
            # If no step was applied, the number of sleeping goals must decrease. Therefore the loop ends.
            if self._asleep and not self._open and len(call.steps) == steps:
                there = [cell for cell in self._asleep if call.met(cell)]
                if not there:
                    return False
                for cell in there:
                    del self._asleep[cell]
                    call.achieved[cell] = call.goal[cell]
        self.proofs.wanted = False
        return True

    def begin(self) -> None:
        """Put all goals that don't hold into the queue of open goals, and determine the order of goals."""
        call = self.call
        self._before, self._asleep, self._woken_by = order(call), {}, {}
        call.achieved = {cell: value for cell, value in call.goal.items() if call.met(cell)}
        call.refiner.before_rest = self.may_bring_to_rest()
        self._open = deque(cell for cell in call.goal if cell not in call.achieved)

    def by_one_step(self, cell: Cell) -> bool:
        """Achieve a goal by advice or by one step of the most abstract level; return whether that succeeded.

        If neither the advice nor one step achieves the goal, put the goal to sleep.
        """
        call, first = self.call, self.call.program.levels[0]
        unmet = [other for other in self._before.get(cell, ()) if other not in call.achieved]
        promised = call.advice.rank(cell) if call.advice is not None and not unmet else 0
        if not unmet and promised == 1 and call.achieve_goal(first, cell, BY_RULES):
            return True
        if not unmet and promised < 2 and call.achieve_goal(first, cell, ONE_STEP):
            return True
        self._asleep[cell] = None
        for other in unmet or waits_for(call.space, call.program.levels[0], cell, call.goal[cell]):
            self._woken_by.setdefault(other, []).append(cell)
        return False

    def wake(self, mark: int) -> None:
        """Reopen the goals that were undone since a marked state, and the goals that waited for a symbol which has changed."""
        call, asleep = self.call, self._asleep

        def opened(cell: Cell) -> None:
            asleep.pop(cell, None)
            self._open.append(cell)

        for situation, key, _ in call.table.trail[mark:]:
            cell = situation, key
            for waiting in self._woken_by.pop(cell, ()):
                if waiting in asleep:
                    opened(waiting)
                    call.failed.pop(waiting, None)
            if cell in call.achieved:
                asleep.pop(cell, None)
                if not call.met(cell):
                    del call.achieved[cell]
                    opened(cell)
            elif cell in asleep:
                opened(cell)
        for cell in call.space.defined:
            if cell in call.achieved and not call.met(cell):
                del call.achieved[cell]
                opened(cell)
            elif cell in asleep and call.met(cell):
                opened(cell)

    # ------------------------------------------------------------------------------------------------------- larger budgets

    def with_larger_budgets(self) -> bool:
        """Achieve a sleeping goal with larger budgets, or on a lower level; return whether that succeeded."""
        call = self.call
        self.proofs.certify()
        self.proofs.check()
        if call.advice is not None and self.one_goal(call.program.levels[0], BY_RULES):
            return True
        for level in call.program.levels:
            *small, large = scope_budgets(call.program.size(level))
            if self.one_goal(level, FEW_STEPS) or self.one_goal(level, *small) or self.bring_to_rest():
                return True
            if self.quickly:
                continue
            if self.restart(level) or self.one_goal(level, large) or self.all_goals(level):
                return True
            if self.allowed(level):
                self.proofs.attempt()
        if call.progressed:  # the state has changed since some attempts failed
            call.failed.clear()
            call.progressed = False
            return self.with_larger_budgets()
        return False

    def allowed(self, level: int, cell: Cell | None = None) -> bool:
        """Return whether steps of a level may be used for a goal."""
        return self.levels is None or level in self.levels or cell in self.call.unseen

    def one_goal(self, level: int, *budgets: SearchBudget) -> bool:
        """Achieve a sleeping goal with the given budgets on a level; return whether that succeeded."""
        call = self.call
        last = call.unseen.issuperset(self._asleep)
        for cell in self._ready():
            if self.advised(cell):
                return True
            if not self.allowed(level, cell) or (cell in call.unseen and not last):
                continue
            if budgets == (BY_RULES,) or (level, *budgets) in call.failed.get(cell, ()):
                continue
            if call.achieve_goal(level, cell, *budgets):
                return True
            call.failed.setdefault(cell, set()).add((level, *budgets))
            if not budgets[0].steps:
                self.proofs.attempt()
        return False

    def _ready(self) -> Iterator[Cell]:
        """Yield the sleeping goals that wait for no unachieved goal; if there is no such goal, yield all sleeping goals."""
        call = self.call
        ready = [c for c in self._asleep if all(other in call.achieved for other in self._before.get(c, ()))]
        yield from (sorted(ready, key=call.advice.waits) if call.advice is not None else ready) or self._asleep

    def advised(self, cell: Cell) -> bool:
        """Achieve a goal by advice that wasn't tried before; return whether that succeeded."""
        call, attempt = self.call, (self.call.program.levels[0], BY_RULES)
        if call.advice is None or not call.advice.ready() or attempt in call.failed.get(cell, ()):
            return False
        call.failed.setdefault(cell, set()).add(attempt)
        return call.achieve_goal(attempt[0], cell, BY_RULES)

    def may_bring_to_rest(self) -> bool:
        """Return whether some symbol isn't at rest, and steps of lower levels may still be tried to bring the symbol to rest."""
        call = self.call
        return (
            not (call.brought_to_rest or call.at_rest())
            and len(call.program.levels) > 1
            and self.allowed(call.program.levels[-1])
        )

    def bring_to_rest(self) -> bool:
        """Bring all symbols to rest by steps of lower levels; return whether steps were applied.

        Steps of the first level may become applicable when all symbols are at rest.
        """
        call = self.call
        if not self.may_bring_to_rest():
            return False
        call.brought_to_rest, call.refiner.before_rest, steps = True, False, len(call.steps)
        bring_to_rest(call)
        if len(call.steps) > steps:
            call.given_up.append("steps of a lower level bring symbols to rest that aren't at rest in the beginning")
            return True
        return False

    def restart(self, level: int) -> bool:
        """Achieve all goals together from the initial state, after a dead end; return whether that succeeded.

        If the level sees no sleeping goal, there is no attempt. On failure, restore the previous steps. During the restart,
        refinements avoid changes of symbols that no upper level sees. Otherwise a goal could become unreachable without a visible
        change on an upper level.
        """
        call, refiner = self.call, self.call.refiner
        if not call.steps or self.lowest is None or self._restarted or level != call.program.levels[0]:
            return False
        if not any(call.space.visible(level, cell) for cell in self._asleep):
            return False
        self._restarted = True
        steps, given_up, kept = call.steps, call.given_up, call.achieved
        call.replace_steps(())
        call.steps, call.given_up = [], []
        call.achieved = {cell: value for cell, value in call.goal.items() if call.met(cell)}
        refiner.careful = True
        if self.all_goals(level):
            self.begin()
            return True
        refiner.careful = False
        call.replace_steps(steps)
        call.steps, call.given_up, call.achieved = steps, given_up, kept
        return False

    def all_goals(self, level: int) -> bool:
        """Achieve all goals together on a level from the current state; return whether that succeeded."""
        call = self.call
        if not self.allowed(level) or call.program.size(level) > MOST_OPERATORS:
            return False
        open_ = {c: v for c, v in call.goal.items() if not call.met(c) and call.space.visible(level, c)}
        if not open_ or call.achieve_goals(level, open_, PART):
            return bool(open_)
        self.proofs.certify(WHOLE.work)
        return call.achieve_goals(level, open_, WHOLE)


# ------------------------------------------------------------------------------------------------------- order of goals


def order(call: Call) -> dict[Cell, list[Cell]]:
    """Return, for each goal, the goals that would become unreachable, and therefore must be achieved earlier.

    One pair of goals represents all pairs with the same two situation types and the same symmetry class of the first goal's first
    individual.
    """
    by_individual: dict[str, list[Cell]] = {}
    for cell in call.goal:
        plain = cell[0] not in call.program.rules and call.problem.domain.situations[cell[0]].quantity is None
        if cell not in call.achieved and plain:
            for individual in {*arguments_of(cell[1]), call.goal[cell]}:
                by_individual.setdefault(individual, []).append(cell)
    before: dict[Cell, list[Cell]] = {}
    known: dict[tuple[str, str, int], bool] = {}
    for cells in by_individual.values():
        for cell in cells:
            call.space.check_time()
            for other in cells:
                if cell is not other:
                    pattern = cell[0], other[0], call.program.symmetry.class_of.get(arguments_of(cell[1])[0], -1)
                    if pattern not in known:
                        known[pattern] = rules_out(call, other, cell)
                    if known[pattern]:
                        before.setdefault(other, []).append(cell)
    return before


def rules_out(call: Call, first: Cell, then: Cell) -> bool:
    """Return whether no behaviour of the first level can achieve the goal `then` after the goal `first` holds."""
    level = call.program.levels[0]
    mark = len(call.table.trail)
    call.table.put(*first, call.goal[first])
    try:
        dead = False
        for achiever in call.program.achievers.get((level, then[0]), ()):
            achieve = call.space.achieving[achiever.behavior, achiever.effect]
            for _, unmet, env in achieve(*arguments_of(then[1]), call.goal[then]):
                if all(attainable(call, level, achiever.soft[number], achiever, env) for number in unmet):
                    return False
                dead = True
        return dead
    finally:
        call.table.undo(mark)


def attainable(call: Call, level: int, condition: Condition, achiever: Achiever, env: Mapping[str, str | None]) -> bool:
    """Return whether some effect of a behaviour of the level could help to satisfy an unmet condition."""
    for situation, key, values in call.space.subgoals.of(achiever, condition, env, level):
        for other in call.program.achievers.get((level, situation), ()):
            for value in values:
                achieve = call.space.achieving[other.behavior, other.effect]
                if next(achieve(*arguments_of(key), value), None) is not None:
                    return True
    return False
