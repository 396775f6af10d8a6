"""What is tried where goals in series get stuck: more steps, lower levels, all goals at once.

Each attempt is dearer than the one before; those that nothing has changed for aren't made again. When all are made, no plan was
found, and what is left is the lowest level alone (`confab.planner.hierarchical.planner`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from confab.planner.hierarchical.refinement_cache import MOST_OPERATORS, WHOLE, WIDER
from confab.planner.hierarchical.serialization import ADVISED, LONGER, Asleep, Attempt, Before, Call
from confab.planner.hierarchical.subplans import Effort
from confab.planner.hierarchical.unsolvability import PAIRS, TEST, impossible, looked_at, proved
from confab.planner.plan import Reason
from confab.planner.transitions import Cell

if TYPE_CHECKING:
    from confab.planner.grounded.task import Task

ALL, RESTART = (WHOLE,), Effort(depth=0)
"""All goals at once in the whole world: from where the steps so far end, and from the beginning."""
FEW = 1_000
"""So many states of the lowest level, at least, are worth looking at."""


@dataclass
class Recovery:
    """What was tried in one call to get on where goals in series got stuck.

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
    _doubted: bool = False
    _lowest: Task | Reason | None = None
    _looked: int = 0
    _tested: int = 1
    _finished: int = 0
    _tried: dict[int, int] = field(default_factory=dict)

    @property
    def too_large(self) -> Reason | None:
        """Why the lowest level can't be grounded, if it is and that was asked."""
        return self._lowest if isinstance(self._lowest, Reason) else None

    @cached_property
    def ladder(self) -> list[tuple[int, Attempt]]:
        """The attempts, each with its level."""
        found: list[tuple[int, Attempt]] = []
        if self.call.advice is not None:
            found.append((self.call.program.levels[0], ADVISED))
        for level in self.call.program.levels if self.levels is None else self.levels:
            *small, large = self.call.refiner.worlds(level)
            found += [(level, attempt) for attempt in (LONGER, (*small,), RESTART, (large,), ALL)[: self.attempts]]
        return found

    def harder(self, asleep: Asleep, before: Before) -> bool:
        """Achieve one of the sleeping goals by a longer segment, or by one on a lower level; whether that succeeded."""
        call = self.call

        def candidates() -> Iterator[Cell]:
            none = True
            ready = [cell for cell in asleep if all(other in call.kept for other in before.get(cell, ()))]
            for cell in sorted(ready, key=call.advice.waits) if call.advice is not None else ready:
                none = False
                yield cell
            if none:  # where goals wait for each other, none waits
                yield from asleep

        if not self.solvable:
            self._doubt()
        if call.unseen.keys() >= asleep.keys() and self.finish():
            call.restarts += 1
            return True
        for level, attempt in self.ladder:
            if attempt is RESTART:
                if self.restart(level):
                    return True
                continue
            if attempt is ALL:
                if self.together(level):
                    return True
                if not self.solvable:
                    self._prove()
                continue
            for cell in candidates():
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
            return self.harder(asleep, before)
        return False

    def advised(self, cell: Cell) -> bool:
        """Achieve a goal as advised, if there is advice now that wasn't tried; whether that succeeded."""
        call, attempt = self.call, (self.call.program.levels[0], ADVISED)
        if call.advice is None or not call.advice.ready() or attempt in call.failed.get(cell, ()):
            return False
        call.failed.setdefault(cell, set()).add(attempt)
        return call.achieve(attempt[0], cell, ADVISED)

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
            call.restarts += 1
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
