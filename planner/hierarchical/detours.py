"""Detours dropped from a plan: steps of a level that together come to nothing, and that nothing between them needed.

A lid that is shut where a step ends and opened where the next begins, something put down and taken up again. What is left is put
under the steps of the levels above again wherever one of these still does what it says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from confab.planner.hierarchical.refinement import RefinedStep, Refiner
from confab.planner.transitions import Cell, Changes

AGAIN = 30
"""So many times each step is done again, on average, to see what can be done without others."""


@dataclass(eq=False)
class _Done:
    """A step that was done: where it stood among all, itself, its changes, and the mark of the table before it."""

    number: int
    step: RefinedStep
    changes: Changes
    mark: int


def without_detours(refiner: Refiner, steps: Sequence[RefinedStep], level: int) -> list[RefinedStep]:
    """Return steps to the same end without those of a level that come to nothing; the same where there are none.

    Parameters
    ----------
    refiner : Refiner
        Its table is in the initial state before and after.
    steps : sequence of RefinedStep
        Steps that were done from there.
    level : int
        What is left out are steps of this level, with their refinements, or of one below where there are none of it.
    """
    table = refiner.table
    owners = [owner for owner, step in enumerate(steps) for _ in parts(step, level)]
    kept = dict(enumerate(part for step in steps for part in parts(step, level)))
    before, left, fewer = 0, AGAIN * len(kept), kept
    while before != len(fewer):  # what was left out may have been what others were needed for
        before = len(fewer)
        table.undo(0)
        done, left = _lasting(refiner, fewer, owners, left)
        fewer = {one.number: one.step for one in done}
    table.undo(0)
    if len(fewer) == len(kept):
        return list(steps)
    found = _Assembly(refiner, level, fewer).of(steps)
    table.undo(0)
    return found


def parts(step: RefinedStep, level: int) -> Iterator[RefinedStep]:
    """Yield the steps of a level in a step, in order; of one below where there are none of it."""
    if step.level >= level or not step.steps:
        yield step
        return
    for child in step.steps:
        yield from parts(child, level)


def _lasting(
    refiner: Refiner, steps: Mapping[int, RefinedStep], owners: Sequence[int], left: int
) -> tuple[list[_Done], int]:
    """Do steps but for those that come to nothing and can be left out; return what was done.

    Those that one step was refined to (by `owners`) are as they are: its refinement was searched. At most so many are done again as
    are `left`; what is left of these is returned, too.
    """
    table = refiner.table
    done: list[_Done] = []
    latest: dict[Cell, list[_Done]] = {}
    for number, step in steps.items():
        refiner.space.check_time()
        mark = len(table.trail)
        refiner.again(step)
        one = _Done(number, step, table.changes(mark), mark)
        done.append(one)
        for cell in one.changes[0]:
            latest.setdefault(cell, []).append(one)
        circle = _circle(one, latest)
        if circle and owners[circle[0].number] != owners[number]:
            left -= one.number - circle[0].number
            if left > 0 and _left_out(refiner, done, circle):
                for cell in one.changes[0]:
                    del latest[cell][-len(circle) :]
    return done, left


def _circle(last: _Done, latest: Mapping[Cell, list[_Done]]) -> list[_Done]:
    """Return steps that changed the same symbols and nothing else, the last of which brings back what was before the first."""
    cells = last.changes[0].keys()
    its = [latest[cell] for cell in cells]
    for back in range(2, 1 + min(map(len, its), default=0)):
        first = its[0][-back]
        if first.changes[0].keys() != cells or any(other[-back] is not first for other in its):
            break
        if first.changes[0] == last.changes[1]:
            return its[0][-back:]
    return []


def _left_out(refiner: Refiner, done: list[_Done], circle: Sequence[_Done]) -> bool:
    """Take back steps that come to nothing, where what is between them can be done without; whether it can."""
    table, mark = refiner.table, circle[0].mark
    first = next(i for i in reversed(range(len(done))) if done[i] is circle[0])
    ended, gone = table.since(mark), set(map(id, circle))
    between = [one for one in done[first:] if id(one) not in gone]
    table.undo(mark)
    again: list[tuple[RefinedStep, int]] = []
    for one in between:
        begin = len(table.trail)
        step = refiner.again(one.step)
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
        refiner.again(one.step)
    return False


class _Assembly:
    """Steps put together again from their parts that were kept, by their numbers, each done on the table once more.

    A step stands as it stood if none of its parts is gone and it still does what it says; not inside a stretch of a lower
    level, which ends where everything is at rest again that the level of the step doesn't see.
    """

    def __init__(self, refiner: Refiner, level: int, kept: Mapping[int, RefinedStep]) -> None:
        self.refiner, self.level, self.kept = refiner, level, kept
        self.number = 0
        self.restless: set[Cell] = set()

    def of(self, steps: Sequence[RefinedStep]) -> list[RefinedStep]:
        """Return what is left of steps."""
        return [left for step in steps for left in self.one(step)]

    def one(self, step: RefinedStep) -> list[RefinedStep]:
        """Return a step, or what is left of its steps."""
        table, space = self.refiner.table, self.refiner.space
        begin, end = self.number, self.number + len(list(parts(step, self.level)))
        mark = len(table.trail)
        situations = space.program.domain.situations
        part = step.level >= self.level or not step.steps
        at_rest = not any(situations[cell[0]].level > step.level for cell in self.restless)
        if part or (at_rest and all(number in self.kept for number in range(begin, end))):
            gone = part and begin not in self.kept
            again = None if gone else self.refiner.again(self.kept[begin] if part else step)
            if again is not None or gone:
                self.number = end
                for situation, key, _ in table.trail[mark:]:
                    if situation in space.rest:
                        rests = table.now[situation][key] == space.rest[situation]
                        (self.restless.discard if rests else self.restless.add)((situation, key))
                return [] if again is None else [again]
        return self.of(step.steps)
