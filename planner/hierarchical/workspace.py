"""The state shared by all searches of one call: the table of current values, the behaviours bound to it, and the budget.

table     the present values of all symbols; it is changed in place and undone
forward   per behaviour, a function of its arguments that returns its changes, or None where it isn't applicable
achieve   per behaviour and effect, a function of a symbol and value that yields the arguments with which the effect gives it
keep      a function of a symbol and its first value: the value that it must have in the end, or None if any will do
budget    everything that is searched counts in one unit, about a microsecond: states times operators, or 100 for an expansion
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TypeAlias

from confab.planner.hierarchical.operators import Program
from confab.planner.hierarchical.subgoals import Wants
from confab.planner.plan import Counts, Limits
from confab.planner.transitions import Cell, Change, Table, arguments_of
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import FALSE

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A quantified behaviour: its name and arguments."""
Keep: TypeAlias = "Callable[[Cell, str], str | None]"
"""Return the value that a touched symbol must have in the end, given its first one; None if any value will do."""
EXPANSION = 100
"""The cost of an expansion in the unit of the budget."""


def trusting() -> None:
    """Doubt nothing."""


@dataclass
class Workspace:
    """The table, the bound behaviours and the budget of one call.

    Parameters
    ----------
    program : Program
    table : Table
    goal : mapping of cell to value
        The task's goal, which proposes values.
    deadline : float, optional
        When `LimitError` is raised, on the clock of `perf_counter`; the deadline that holds (`confab.reasoner.limits`) if left out.
    most : int
        Maximum number of expansions of all searches together, after which `LimitError` is raised.
    most_work : float
        Maximum work in scopes, in states times operators, after which `LimitError` is raised.
    doubt : function
        Called each time that the effort has doubled: it may be in vain.
    """

    program: Program
    table: Table
    goal: Mapping[Cell, str]
    deadline: float | None = None
    most: int = 200_000
    most_work: float = math.inf
    doubt: Callable[[], None] = trusting
    counts: dict[int, Counts] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.expanded = self.worked = self.doubted = self.looked = 0
        self.most_looked = EXPANSION * self.most
        """Maximum number of achievers that are looked at, those that aren't applicable included."""
        if self.deadline is None:
            self.deadline = Limits().end()
        bound = self.program.bind(self.table)
        self.forward, self.achieve = bound.forward, bound.achieve
        self.wants = Wants(self.program, self.table, self.goal)
        self.counts = {level: Counts() for level in self.program.levels}
        self.defined = [cell for cell in self.goal if cell[0] in self.program.rules]
        self.rest = {s.name: s.rest for s in self.program.domain.situations.values() if s.rest is not None}
        self.widest = {
            level: max(len(b.every_effect) for b in self.program.domain.at_level(level))
            for level in self.program.levels
        }

    # ------------------------------------------------------------------------------------------------------------ the table

    def apply(self, changes: Sequence[Change]) -> None:
        """Make changes, as far as the symbols exist."""
        now, put = self.table.now, self.table.put
        for situation, key, value in changes:
            old = now[situation].get(key)
            if old is None and self.exists(situation, key):
                old = FALSE
            if old is not None and old != value:
                put(situation, key, value)

    def exists(self, situation: str, key: object) -> bool:
        """Return whether a boolean symbol exists that the table doesn't list."""
        kind = self.program.domain.situations[situation]
        return kind.boolean and all(
            argument in self.program.members.get(of, ())
            for argument, of in zip(arguments_of(key), kind.arguments, strict=True)  # type: ignore[arg-type]
        )

    def visible(self, level: int, cell: Cell) -> bool:
        """Return whether a level sees a symbol: its situation type and its individuals exist there."""
        levels = self.program.problem.value_levels
        return self.program.domain.situations[cell[0]].level <= level and (
            not levels or all(levels.get(argument, 1) <= level for argument in arguments_of(cell[1]))
        )

    # --------------------------------------------------------------------------------------------------------- what is kept

    def refining(self, level: int, careful: bool = False) -> Keep:
        """Return what the refinement of a step of `level` keeps: all that this level sees as it was, everything else at rest.

        If `careful`, symbols without a rest value, which may have any value otherwise, are kept as they were, too.
        """
        rest = self.rest
        return lambda cell, first: first if self.visible(level, cell) else rest.get(cell[0], first if careful else None)

    def keeping(self, kept: Mapping[Cell, str]) -> Keep:
        """Return what steps towards a goal keep: the goals that were reached before, and everything else at rest."""
        return lambda cell, first: kept.get(cell) or self.rest.get(cell[0])

    # ----------------------------------------------------------------------------------------------------------- the budget

    @property
    def effort(self) -> int:
        """What was searched so far, about in microseconds."""
        return self.worked + EXPANSION * self.expanded

    def expand(self, level: int) -> None:
        """Count an expansion; raise `LimitError` where a limit is reached."""
        self.counts[level].expanded += 1
        self.expanded += 1
        self._limited()

    def spend(self, level: int, counts: Counts, work: int) -> None:
        """Count a search of a scope, and its work in states times operators; raise `LimitError` where a limit is reached."""
        self.counts[level].add(counts)
        self.expanded += counts.expanded
        self.worked += work
        self._limited()
        if self.worked > self.most_work:
            raise LimitError(f"{self.most_work:.0f} states times operators")

    def look(self) -> None:
        """Count an achiever that is looked at; raise `LimitError` where a limit is reached."""
        self.looked += 1
        if self.looked > self.most_looked:
            raise LimitError(f"{self.most_looked:,} ways to achieve values")
        self.check_time()

    def _limited(self) -> None:
        if self.expanded > self.most:
            raise LimitError(f"{self.most} expansions")
        if self.effort > self.doubted:
            self.doubted = 2 * self.effort
            self.doubt()
        self.check_time()

    def check_time(self) -> None:
        """Raise `LimitError` when the time limit has passed."""
        if self.deadline is not None and perf_counter() > self.deadline:
            raise LimitError("the time limit")
