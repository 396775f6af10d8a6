"""The agenda: goals one after the other on one table, the easiest first, and what was achieved before is kept.

open     goals to try in one step of the most abstract level
asleep   goals that something stands in the way of; they wake when a symbol that they wait for changes
kept     goals that are achieved: later steps may undo them, but must restore them
before   goals after which others could no longer be achieved (a full cup isn't moved) wait for those

Where no goal is achieved in one step, more effort is spent, each attempt dearer than the one before, on each level from the top;
one that nothing has changed for isn't made again. Steps are refined and done as soon as they are found.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from confab.planner.hierarchical.call import ADVISED, Attempt, Call
from confab.planner.hierarchical.chains import CHAIN, ONE_STEP, Effort
from confab.planner.hierarchical.operators import Achiever
from confab.planner.hierarchical.refinement import MOST_OPERATORS, WHOLE, WIDER
from confab.planner.hierarchical.unsolvability import PAIRS, TEST, impossible, looked_at, proved
from confab.planner.plan import Reason
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.symbols import Condition

if TYPE_CHECKING:
    from confab.planner.grounded.task import Task

ALL, RESTART = (WHOLE,), Effort(depth=0)
"""All goals at once in the whole world: from where the steps so far end, and from the beginning."""
FEW = 1_000
"""States of the lowest level, at least, that are worth looking at for a proof: proofs of small tasks against time to search."""


@dataclass
class Agenda:
    """The goals of a call, and what was tried to achieve them.

    Attributes
    ----------
    call : Call
    levels : tuple of int, optional
        The levels whose steps may be done; all if left out.
    attempts : int, optional
        How many of the attempts on each level are made; all if left out.
    solvable : bool
        Whether it is known that there is a plan, so that nothing is to be proved.
    forward : bool
        Whether what was done stays done: nothing is begun again.
    """

    call: Call
    levels: tuple[int, ...] | None = None
    attempts: int | None = None
    solvable: bool = False
    forward: bool = False
    _asleep: dict[Cell, None] = field(default_factory=dict)
    _before: Mapping[Cell, Sequence[Cell]] = field(default_factory=dict)
    _doubted: bool = False
    _lowest: Task | Reason | None = None
    _looked: int = 0
    _tested: int = 1
    _finished: int = 0
    _restarts: int = 0
    _tried: dict[int, int] = field(default_factory=dict)

    @property
    def too_large(self) -> Reason | None:
        """Why the lowest level can't be grounded, if it is and that was asked."""
        return self._lowest if isinstance(self._lowest, Reason) else None

    # ------------------------------------------------------------------------------------------------- one after the other

    def achieve_all(self) -> bool:
        """Achieve the goals one after the other, with more effort where these get stuck; whether all are."""
        call, segments = self.call, self.call.segments
        if not self.solvable:
            segments.doubt = self.doubt
        first = call.program.levels[0]
        waiting: dict[Cell, list[Cell]] = {}
        before, asleep = self._before, self._asleep = order(call), dict[Cell, None]()
        # What level 1 doesn't see may have been undone where all goals were planned at once.
        call.kept = {cell: value for cell, value in call.kept.items() if call.met(cell)}
        open_ = deque(cell for cell in call.goal if cell not in call.kept)

        def sleep(cell: Cell, until: Sequence[Cell]) -> None:
            asleep[cell] = None
            for other in until:
                waiting.setdefault(other, []).append(cell)

        def wake(mark: int) -> None:
            for situation, key, _ in call.table.trail[mark:]:
                for cell in waiting.pop((situation, key), ()):
                    if cell in asleep:
                        del asleep[cell]
                        open_.append(cell)
                        call.failed.pop(cell, None)
                cell = situation, key
                if cell in call.kept:
                    asleep.pop(cell, None)
                    if not call.met(cell):
                        del call.kept[cell]
                        open_.append(cell)
                elif cell in asleep:
                    del asleep[cell]
                    open_.append(cell)
            for cell in segments.defined:
                if cell in call.kept and not call.met(cell):
                    del call.kept[cell]
                    open_.append(cell)
                elif cell in asleep and call.met(cell):
                    del asleep[cell]
                    open_.append(cell)

        while open_ or asleep:
            mark = len(call.table.trail)
            while open_:
                cell = open_.popleft()
                segments.check_time()
                if call.met(cell):
                    call.kept[cell] = call.goal[cell]
                    continue
                unmet = [other for other in before.get(cell, ()) if other not in call.kept]
                promised = call.advice.rank(cell) if call.advice is not None and not unmet else 0
                if unmet:
                    sleep(cell, unmet)
                elif (promised == 1 and call.achieve(first, cell, ADVISED)) or (
                    promised < 2 and call.achieve(first, cell, ONE_STEP)
                ):
                    wake(mark)
                    mark = len(call.table.trail)
                else:
                    sleep(cell, segments.waits_for(first, cell, call.goal[cell]))
            restarts, redone, steps = self._restarts, call.redone, len(call.steps)
            if asleep and not self.harder():
                return False
            if self._restarts > restarts:
                return self.achieve_all()
            wake(mark if call.redone == redone else 0)
            # Where no step was done, a pass has to leave fewer goals asleep: so the loop ends.
            if asleep and not open_ and len(call.steps) == steps:
                there = [cell for cell in asleep if call.met(cell)]
                if not there:
                    return False
                for cell in there:
                    del asleep[cell]
                    call.kept[cell] = call.goal[cell]
        self.solvable = True
        return True

    # ------------------------------------------------------------------------------------------------------- more effort

    @cached_property
    def ladder(self) -> list[tuple[int, Attempt]]:
        """The attempts, each with its level."""
        found: list[tuple[int, Attempt]] = []
        if self.call.advice is not None:
            found.append((self.call.program.levels[0], ADVISED))
        for level in self.call.program.levels if self.levels is None else self.levels:
            *small, large = self.call.refiner.scopes(level)
            found += [(level, attempt) for attempt in (CHAIN, (*small,), RESTART, (large,), ALL)[: self.attempts]]
        return found

    def harder(self) -> bool:
        """Achieve one of the sleeping goals by more effort, or on a lower level; whether that succeeded."""
        call = self.call
        if not self.solvable:
            self._doubt()
        if call.unseen.keys() >= self._asleep.keys() and self.finish():
            self._restarts += 1
            return True
        for level, attempt in self.ladder:
            if attempt is RESTART or attempt is ALL:
                if self.restart(level) if attempt is RESTART else self.together(level):
                    return True
                if attempt is ALL and not self.solvable:
                    self._prove()
                continue
            for cell in self._ready():
                if self.advised(cell):
                    return True
                if attempt is ADVISED or (level, attempt) in call.failed.get(cell, ()):
                    continue
                if call.achieve(level, cell, attempt):
                    return True
                call.failed.setdefault(cell, set()).add((level, attempt))
                if not isinstance(attempt, Effort) and not self.solvable:
                    self._prove()
        if call.progressed:  # something was done since some of these attempts failed
            call.failed.clear()
            call.progressed = False
            return self.harder()
        return False

    def _ready(self) -> Iterator[Cell]:
        """Yield the sleeping goals that no other has to come before; all, where they wait for each other."""
        call = self.call
        ready = [c for c in self._asleep if all(other in call.kept for other in self._before.get(c, ()))]
        yield from (sorted(ready, key=call.advice.waits) if call.advice is not None else ready) or self._asleep

    def advised(self, cell: Cell) -> bool:
        """Achieve a goal as advised, if there is advice now that wasn't tried; whether that succeeded."""
        call, attempt = self.call, (self.call.program.levels[0], ADVISED)
        if call.advice is None or not call.advice.ready() or attempt in call.failed.get(cell, ()):
            return False
        call.failed.setdefault(cell, set()).add(attempt)
        return call.achieve(attempt[0], cell, ADVISED)

    def finish(self) -> bool:
        """Do the last step again so that it brings about what its level doesn't see, too; else all is as it was."""
        call = self.call
        steps = call.steps
        if not steps or steps[-1].level != call.program.levels[0] or self._finished > len(call.goal):
            return False
        self._finished += 1  # what is done after that may undo it, but not for ever
        call.redo(steps[:-1])
        call.refiner.besides = call.unseen
        last = call.refiner.do(*steps[-1][:3])
        call.refiner.besides = {}
        if last is None:
            call.redo(steps)
            return False
        call.steps = [*steps[:-1], last]
        call.kept.update(call.unseen)
        return True

    def restart(self, level: int) -> bool:
        """Achieve all goals at once from the beginning, where taking them in series has led astray; else all is as it was.

        Refinements then leave as it was what no level above sees, if they can: so that no goal gets out of reach unseen.
        """
        call, refiner = self.call, self.call.refiner
        if not call.steps or self.forward or level != call.program.levels[0]:
            return False
        self.forward = True
        steps, given_up, kept = call.steps, call.given_up, call.kept
        call.redo(())
        call.steps, call.given_up = [], []
        call.kept = {cell: value for cell, value in call.goal.items() if call.met(cell)}
        refiner.careful = True
        if self.together(level):
            self._restarts += 1
            return True
        refiner.careful = False
        call.redo(steps)
        call.steps, call.given_up, call.kept = steps, given_up, kept
        return False

    def together(self, level: int) -> bool:
        """Achieve all goals at once on a level, from here; whether that succeeded, and not tried twice from one state."""
        call = self.call
        if call.program.size(level) > MOST_OPERATORS or self._tried.get(level) == len(call.steps):
            return False
        self._tried[level] = len(call.steps)
        return call.reach(level, {c: v for c, v in call.goal.items() if not call.met(c)}, ALL)

    # ------------------------------------------------------------------------------------------------------------ proofs

    def _doubt(self) -> None:
        """Raise `UnsolvableError` if it can be shown at once that there is no plan."""
        if not self._doubted:
            self._doubted = True
            if proof := impossible(self.call.problem, deadline=self.call.segments.deadline):
                raise proof

    def doubt(self) -> None:
        """Raise `UnsolvableError` if there is no plan and the lowest level is so small that looking at its states is no work."""
        call = self.call
        if not self.solvable and FEW * call.program.size(call.program.levels[-1]) <= call.segments.effort:
            self._prove()

    def _prove(self) -> None:
        """Raise `UnsolvableError` if the lowest level shows that there is no plan.

        What is expected is searched first, with as much work as one small world may cost.
        """
        call = self.call
        if call.advice is not None and call.advice.expects and call.segments.worked < WIDER.work:
            return
        tests = min(call.segments.effort // TEST, PAIRS)
        if tests >= 2 * self._tested:
            self._tested = tests
            if proof := impossible(call.problem, tests, call.segments.deadline):
                raise proof
        if self._lowest is None:
            self._lowest = proved(call.problem, call.program.levels[-1], call.segments.deadline)
        if not isinstance(self._lowest, Reason):
            self._looked = looked_at(self._lowest, call.segments, self._looked)


# ------------------------------------------------------------------------------------------------------- order of goals


def order(call: Call) -> dict[Cell, list[Cell]]:
    """Return for each goal those that must come before it: once it holds, they couldn't be achieved any more."""
    by_individual: dict[str, list[Cell]] = {}
    for cell in call.goal:
        plain = cell[0] not in call.program.rules and call.problem.domain.situations[cell[0]].quantity is None
        if cell not in call.kept and plain:
            for individual in {*arguments_of(cell[1]), call.goal[cell]}:
                by_individual.setdefault(individual, []).append(cell)
    before: dict[Cell, list[Cell]] = {}
    known: dict[tuple[str, str, int], bool] = {}
    for cells in by_individual.values():
        for cell in cells:
            call.segments.check_time()
            for other in cells:
                if cell is not other:
                    pattern = cell[0], other[0], call.program.alike.sort.get(arguments_of(cell[1])[0], -1)
                    if pattern not in known:
                        known[pattern] = rules_out(call, other, cell)
                    if known[pattern]:
                        before.setdefault(other, []).append(cell)
    return before


def rules_out(call: Call, first: Cell, then: Cell) -> bool:
    """Whether with goal `first` achieved, no behaviour of the first level could achieve goal `then` any more."""
    level = call.program.levels[0]
    mark = len(call.table.trail)
    call.table.put(*first, call.goal[first])
    try:
        dead = False
        for achiever in call.program.achievers.get((level, then[0]), ()):
            achieve = call.segments.achieve[achiever.behavior, achiever.effect]
            for _, unmet, env in achieve(*arguments_of(then[1]), call.goal[then]):
                if all(attainable(call, level, achiever.soft[number], achiever, env) for number in unmet):
                    return False
                dead = True
        return dead
    finally:
        call.table.undo(mark)


def attainable(call: Call, level: int, condition: Condition, achiever: Achiever, env: Mapping[str, str | None]) -> bool:
    """Whether some behaviour of a level has an effect that could bring an unmet condition about."""
    for situation, key, values in call.segments.wants.of(achiever, condition, env, level):
        for other in call.program.achievers.get((level, situation), ()):
            for value in values:
                achieve = call.segments.achieve[other.behavior, other.effect]
                if next(achieve(*arguments_of(key), value), None) is not None:
                    return True
    return False
