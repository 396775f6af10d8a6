"""From a plan to decisions: at each step, what was chosen and what else could have been.

The alternatives are what the fast planner would propose for the goals that are open there. One that the same plan does later and
could as well do now isn't passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

from planner.experience.features import Schema, View
from planner.hierarchical.operators import Program
from planner.hierarchical.subplans import Segments
from planner.paper.learning import LearningError
from planner.transitions import Cell, Table, key_of
from reasoner.amounts import meets
from reasoner.memory.counts import Candidate, Decision
from reasoner.symbols import FALSE, Problem

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
REACH = 3  # how many steps ahead alternatives may begin to work towards a goal
BROAD = 12  # so many taken values of a sort are thought of where none is free


class Field:
    """One level of a problem as a table that is changed in place, with what could be done there.

    Parameters
    ----------
    program : Program
    problem : Problem
        Gives the initial state and the goal.
    level : int
    schema : Schema, optional
        Of the same program; made if left out.
    """

    def __init__(self, program: Program, problem: Problem, level: int, schema: Schema | None = None) -> None:
        self.level, self.problem = level, problem
        self.goal: dict[Cell, str] = {(s.situation, key_of(s.arguments)): value for s, value in problem.goal.items()}
        self.table = Table(problem.domain.situations, problem.initial)
        self.segments = Segments(program, self.table, self.goal)
        self.schema = schema or Schema(program)
        self.view = View(self.schema, self.table, self.goal)

    def unmet(self) -> list[Cell]:
        """Return the goals that don't hold, in their order."""
        now = self.table.now
        return [cell for cell, value in self.goal.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)]

    def proposals(self, cells: Sequence[Cell], reach: int = REACH, breadth: int = 1) -> list[Ground]:
        """Return what is applicable now and begins to work towards one of these goals.

        Where no value of a sort is free, `breadth` of the taken ones are thought of.
        """
        self.segments.wants.breadth = breadth
        return list(self.segments.relevant(self.level, {cell: self.goal[cell] for cell in cells}, reach))

    def roles(self, ground: Ground) -> tuple[str, ...] | None:
        """Return the individuals in a behaviour's roles, or None where it isn't applicable."""
        done = self.segments.forward[ground[0]](*ground[1])
        return None if done is None else ground[1] + done[0]

    def candidate(self, ground: Ground) -> Candidate | None:
        """Return a behaviour as memory sees it, or None where it isn't applicable."""
        roles = self.roles(ground)
        return None if roles is None else self.view.candidate(ground[0], roles)

    def do(self, ground: Ground) -> bool:
        """Change the table as the behaviour does; whether it was applicable."""
        done = self.segments.forward[ground[0]](*ground[1])
        if done is None:
            return False
        self.segments.apply(done[1])
        return True

    def works(self, steps: Sequence[Ground]) -> bool:
        """Whether all steps can be done one after the other from here, and lead to the goal; the table stays as it was."""
        mark = len(self.table.trail)
        try:
            return all(self.do(step) for step in steps) and not self.unmet()
        finally:
            self.table.undo(mark)


def decisions(
    program: Program,
    problem: Problem,
    level: int,
    steps: Sequence[Ground],
    failed: int | None = None,
    schema: Schema | None = None,
) -> list[Decision]:
    """Return the decisions that a plan of one level consists of.

    Parameters
    ----------
    program : Program
    problem : Problem
        Its initial state is where the plan begins, its goal what it was for.
    level : int
    steps : sequence of behaviour and arguments
    failed : int, optional
        Position of the step that failed when it was carried out; what comes after it wasn't tried.
    schema : Schema, optional

    Raises
    ------
    LearningError
        A step's preconditions don't hold where it is done.
    """
    field = Field(program, problem, level, schema)
    found = []
    for position, step in enumerate(steps):
        chosen = field.candidate(step)
        if chosen is None:
            raise LearningError(
                f"step {position} ({' '.join((step[0], *step[1]))}): its preconditions don't hold there"
            )
        if position == failed:
            found.append(Decision(chosen, succeeded=False))
            break
        rest = steps[position + 1 :]
        others = []
        for other in field.proposals(field.unmet(), breadth=BROAD):
            if other == step:
                continue
            if other in rest:
                later = rest.index(other)
                if field.works([other, step, *rest[:later], *rest[later + 1 :]]):
                    continue
            described = field.candidate(other)
            if described is not None:
                others.append(described)
        found.append(Decision(chosen, tuple(others)))
        field.do(step)
    return found


def single_level(problem: Problem, level: int) -> Problem:
    """Return a problem whose first level is `level`: the levels above it are left out."""
    behaviors = {name: b for name, b in problem.domain.behaviors.items() if b.level >= level}
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors))
