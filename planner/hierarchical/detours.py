"""Removal of detours from a plan.

A detour consists of steps of a level whose changes cancel out and that no step between them requires. For example, one step shuts a
lid, and the next step opens the lid again. A step of an upper level is kept if its remaining sub-steps still have its effect;
otherwise the sub-steps replace the step.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from confab.planner.hierarchical.refinement import RefinedStep, Refiner
from confab.planner.transitions import Cell, Changes

AGAIN = 30
"""Maximum average number of replays per step; replays test whether steps are applicable without a detour."""


@dataclass(eq=False)
class _AppliedStep:
    """An applied step with its position, its changes, and the mark of the table's trail before the step."""

    number: int
    step: RefinedStep
    changes: Changes
    mark: int


def without_detours(refiner: Refiner, steps: Sequence[RefinedStep], level: int) -> list[RefinedStep]:
    """Return the given steps without detours on a level; the final state is the same.

    Parameters
    ----------
    refiner : Refiner
        A refiner whose table is in the initial state; the function restores this state.
    steps : sequence of RefinedStep
        Steps that are applicable from the initial state.
    level : int
        The level of the steps that are removed with their refinements. Where lower-level steps replace the level, these
        lower-level steps are removed.
    """
    table = refiner.table
    owners = [owner for owner, step in enumerate(steps) for _ in parts(step, level)]
    kept = dict(enumerate(part for step in steps for part in parts(step, level)))
    before, left, fewer = 0, AGAIN * len(kept), kept
    while before != len(fewer):  # some steps may have been required only by removed steps
        before = len(fewer)
        table.undo(0)
        done, left = _without_cycles(refiner, fewer, owners, left)
        fewer = {one.number: one.step for one in done}
    table.undo(0)
    if len(fewer) == len(kept):
        return list(steps)
    found = _Reassembly(refiner, level, fewer).of(steps)
    table.undo(0)
    return found


def parts(step: RefinedStep, level: int) -> Iterator[RefinedStep]:
    """Yield the sub-steps of a step on a level in order, and lower-level sub-steps that replace steps of the level."""
    if step.level >= level or not step.steps:
        yield step
        return
    for child in step.steps:
        yield from parts(child, level)


def _without_cycles(
    refiner: Refiner, steps: Mapping[int, RefinedStep], owners: Sequence[int], left: int
) -> tuple[list[_AppliedStep], int]:
    """Apply the steps that can't be removed; return these steps and the remaining number of replays.

    A detour within a single step of the plan stays; `owners` contains the step of the plan for each position. At most `left` steps
    are replayed.
    """
    table = refiner.table
    done: list[_AppliedStep] = []
    latest: dict[Cell, list[_AppliedStep]] = {}
    for number, step in steps.items():
        refiner.space.check_time()
        mark = len(table.trail)
        refiner.replay_checked(step)
        one = _AppliedStep(number, step, table.changes(mark), mark)
        done.append(one)
        for cell in one.changes[0]:
            latest.setdefault(cell, []).append(one)
        circle = _circle(one, latest)
        if circle and owners[circle[0].number] != owners[number]:
            left -= one.number - circle[0].number
            if left > 0 and _removed(refiner, done, circle):
                for cell in one.changes[0]:
                    del latest[cell][-len(circle) :]
    return done, left


def _circle(last: _AppliedStep, latest: Mapping[Cell, list[_AppliedStep]]) -> list[_AppliedStep]:
    """Return the latest steps that all change the same symbols as `last` and together restore the old values.

    The result ends with `last`; it is empty if there are no such steps.
    """
    cells = last.changes[0].keys()
    its = [latest[cell] for cell in cells]
    for back in range(2, 1 + min(map(len, its), default=0)):
        first = its[0][-back]
        if first.changes[0].keys() != cells or any(other[-back] is not first for other in its):
            break
        if first.changes[0] == last.changes[1]:
            return its[0][-back:]
    return []


def _removed(refiner: Refiner, done: list[_AppliedStep], circle: Sequence[_AppliedStep]) -> bool:
    """Remove the steps of `circle` if the steps between them still lead to the same state; return whether that succeeded."""
    table, mark = refiner.table, circle[0].mark
    first = next(i for i in reversed(range(len(done))) if done[i] is circle[0])
    ended, gone = table.since(mark), set(map(id, circle))
    between = [one for one in done[first:] if id(one) not in gone]
    table.undo(mark)
    again: list[tuple[RefinedStep, int]] = []
    for one in between:
        begin = len(table.trail)
        step = refiner.replay_checked(one.step)
        if step is None:
            break
        again.append((step, begin))
    if len(again) == len(between) and table.since(mark) == ended:
        for one, (step, begin) in zip(between, again, strict=True):
            one.step, one.mark = step, begin
        done[first:] = between
        return True
    table.undo(mark)
    for one in done[first:]:
        refiner.replay_checked(one.step)
    return False


class _Reassembly:
    """Assembly of steps from their remaining parts; each part is replayed on the table.

    A step is kept if three conditions hold: all of its parts remain, the step still has its effect, and all symbols that the step's
    level doesn't see are at rest before the step. Otherwise the remaining parts replace the step.
    """

    def __init__(self, refiner: Refiner, level: int, kept: Mapping[int, RefinedStep]) -> None:
        self.refiner, self.level, self.kept = refiner, level, kept
        self.number = 0
        self.restless: set[Cell] = set()

    def of(self, steps: Sequence[RefinedStep]) -> list[RefinedStep]:
        """Return the given steps, or their remaining parts."""
        return [left for step in steps for left in self.one(step)]

    def one(self, step: RefinedStep) -> list[RefinedStep]:
        """Return a list with the step, or with the remaining parts of the step."""
        table, space = self.refiner.table, self.refiner.space
        begin, end = self.number, self.number + len(list(parts(step, self.level)))
        mark = len(table.trail)
        situations = space.program.domain.situations
        part = step.level >= self.level or not step.steps
        at_rest = not any(situations[cell[0]].level > step.level for cell in self.restless)
        if part or (at_rest and all(number in self.kept for number in range(begin, end))):
            gone = part and begin not in self.kept
            again = None if gone else self.refiner.replay_checked(self.kept[begin] if part else step)
            if again is not None or gone:
                self.number = end
                for situation, key, _ in table.trail[mark:]:
                    if situation in space.rest:
                        rests = table.now[situation][key] == space.rest[situation]
                        (self.restless.discard if rests else self.restless.add)((situation, key))
                return [] if again is None else [again]
        return self.of(step.steps)
