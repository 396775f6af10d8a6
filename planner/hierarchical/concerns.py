"""What each step of a plan concerns, and whether any of them only puts something aside: else there is hardly a step too many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from confab.planner.hierarchical.refinement_cache import RefinedStep, Refiner
from confab.planner.transitions import Cell, arguments_of, key_of
from confab.reasoner.symbols import ValueCondition


@dataclass(frozen=True)
class Concern:
    """A step with the individuals that it moved, and the symbols of its own level that it changed and that it asked for.

    `after` has what is otherwise after it than before, on all levels.
    """

    step: RefinedStep
    after: Mapping[Cell, str]
    moved: frozenset[str]
    touched: frozenset[Cell]
    asked: frozenset[Cell]


def put_aside(steps: Sequence[Concern]) -> dict[int, None]:
    """Return the positions of steps that give a symbol a value that nobody asks for before a later step overwrites it.

    Only then can a level below save something that a level must do: elsewhere every step serves another one or the goal.
    """
    idle: dict[Cell, int] = {}
    found: dict[int, None] = {}
    for position, step in enumerate(steps):
        found.update((idle[cell], None) for cell in step.touched if cell in idle)
        for cell in step.asked:
            idle.pop(cell, None)
        idle.update(dict.fromkeys(step.touched, position))
    return found


def concerns(refiner: Refiner, steps: Sequence[RefinedStep]) -> list[Concern]:
    """Return what each of the steps that were done concerns; the table is left in the initial state."""
    refiner.table.undo(0)
    found = []
    for step in steps:
        refiner.segments.check_time()
        mark = len(refiner.table.trail)
        refiner.redo(step)
        found.append(concern(refiner, step, mark))
    refiner.table.undo(0)
    return found


def concern(refiner: Refiner, step: RefinedStep, mark: int) -> Concern:
    """Return what a step has moved since a mark, what it has touched, and what it asked."""
    level, name, arguments, bindings, _ = step
    moved: set[str] = set()
    touched: set[Cell] = set()
    for situation, key, old in refiner.table.trail[mark:]:
        if refiner.segments.program.domain.situations[situation].level <= level:
            moved.update((old, refiner.table.now[situation][key]), arguments_of(key))
            touched.add((situation, key))
    behavior = refiner.segments.program.domain.behaviors[name]
    terms = dict(zip((p.name for p in behavior.parameters), arguments, strict=True))
    names = refiner.segments.program.variables[name]
    terms |= dict(zip((f"?{variable}" for variable in names), bindings, strict=True))
    asked = frozenset(
        (c.situation, key_of(tuple(terms.get(a, a) for a in c.arguments)))
        for c in behavior.preconditions
        if isinstance(c, ValueCondition) and not c.negated
    )
    return Concern(
        step, refiner.table.since(mark), frozenset(moved & {*arguments, *bindings}), frozenset(touched), asked
    )
