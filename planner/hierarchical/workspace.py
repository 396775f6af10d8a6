"""The common data of all searches of one call: the table of current values, the compiled behaviours, and the limits of the work.

`table` contains the current values of all symbols; changes are made in place and can be undone. `forward` contains a function for
each behaviour; given the arguments, it returns the changes, or None if the behaviour isn't applicable. `achieving` contains a
function for each effect; given a symbol and a value, it yields the arguments with which the effect achieves the value. `keep` is a
function of a symbol and its first value; it returns the required final value, or None if any value is allowed. The work of all
searches is counted in units of about a microsecond. The unit is one operator in one state; an expansion of the search for few steps
costs 100.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TypeAlias

from confab.planner.hierarchical.operators import Program
from confab.planner.hierarchical.subgoals import Subgoals
from confab.planner.plan import Counts, Limits, Shortening
from confab.planner.transitions import Cell, Change, Table, arguments_of
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import FALSE

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A quantified behaviour: its name and arguments."""
Keep: TypeAlias = "Callable[[Cell, str], str | None]"
"""Function of a changed symbol and its first value that returns the required final value, or None if any value is allowed."""
EXPANSION = 100
"""The work of an expansion."""


def no_check() -> None:
    """Do nothing; this is the default of `Workspace.meanwhile`."""


@dataclass
class Workspace:
    """The table, the compiled behaviours and the limits of one call.

    Parameters
    ----------
    program : Program
    table : Table
    goal : mapping of cell to value
        The goal of the task; its values are candidates for subgoals.
    deadline : float, optional
        Time at which `LimitError` is raised, on the clock of `perf_counter`; by default the deadline of `confab.reasoner.limits`.
    most : int
        Maximum number of expansions of all searches together; `LimitError` is raised above this number.
    most_work : float
        Maximum work in scopes (number of states times number of operators); `LimitError` is raised above this work.
    shortening : str
        Work for a shorter plan: "none", "brief", "compared", "once" or "repeated" (`Limits.shortening`).
    meanwhile : function
        Function that looks for a proof of unsolvability or for a plan of the lowest level; it is called each time that the effort
        has doubled.
    """

    program: Program
    table: Table
    goal: Mapping[Cell, str]
    deadline: float | None = None
    most: int = 200_000
    most_work: float = math.inf
    shortening: Shortening = "once"
    meanwhile: Callable[[], None] = no_check
    counts: dict[int, Counts] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.expanded = self.worked = self.checked_at = self.looked = 0
        self.most_looked = EXPANSION * self.most
        """Maximum number of examined achievers, including inapplicable achievers."""
        if self.deadline is None:
            self.deadline = Limits().end()
        bound = self.program.bind(self.table)
        self.forward, self.achieving = bound.forward, bound.achieving
        self.subgoals = Subgoals(self.program, self.table, self.goal)
        self.candidates = self.subgoals.candidates
        self.counts = {level: Counts() for level in self.program.levels}
        self.defined = [cell for cell in self.goal if cell[0] in self.program.rules]
        self.rest = {s.name: s.rest for s in self.program.domain.situations.values() if s.rest is not None}
        self.widest = {
            level: max(len(b.every_effect) for b in self.program.domain.at_level(level))
            for level in self.program.levels
        }

    # ------------------------------------------------------------------------------------------------------------ the table

    def apply(self, changes: Sequence[Change]) -> None:
        """Apply changes to the symbols that exist."""
        now, put = self.table.now, self.table.put
        for situation, key, value in changes:
            old = now[situation].get(key)
            if old is None and self.exists(situation, key):
                old = FALSE
            if old is not None and old != value:
                put(situation, key, value)

    def exists(self, situation: str, key: object) -> bool:
        """Return whether a symbol without a value exists.

        The symbol exists if its situation type is boolean and its arguments belong to the right classes.
        """
        kind = self.program.domain.situations[situation]
        return kind.boolean and all(
            argument in self.program.members.get(of, ())
            for argument, of in zip(arguments_of(key), kind.arguments, strict=True)  # type: ignore[arg-type]
        )

    def visible(self, level: int, cell: Cell) -> bool:
        """Return whether a level sees a symbol, that is, whether the situation type and the individuals exist on the level."""
        levels = self.program.problem.value_levels
        return self.program.domain.situations[cell[0]].level <= level and (
            not levels or all(levels.get(argument, 1) <= level for argument in arguments_of(cell[1]))
        )

    # ---------------------------------------------------------------------------------------------------- required values

    def refining(self, level: int, careful: bool = False) -> Keep:
        """Return the function `keep` for the refinement of a step of a level; it gives the required final values of symbols.

        Symbols that the level sees must be unchanged. All other symbols must be at rest. A symbol without a rest value
        may have any final value; if `careful`, the symbol must be unchanged. A remembered symbol may become true.
        """
        rest, remembers = self.rest, self.program.domain.remembers

        def keep(cell: Cell, first: str) -> str | None:
            if cell[0] in remembers:
                return None
            return first if self.visible(level, cell) else rest.get(cell[0], first if careful else None)

        return keep

    def keeping(self, kept: Mapping[Cell, str]) -> Keep:
        """Return the function `keep` for steps towards a goal; it gives the required final values of symbols.

        Achieved goals must hold, and all other symbols must be at rest.
        """
        return lambda cell, first: kept.get(cell) or self.rest.get(cell[0])

    # ----------------------------------------------------------------------------------------------------------- the budget

    @property
    def effort(self) -> int:
        """The effort of the searches so far, in units of about a microsecond."""
        return self.worked + EXPANSION * self.expanded

    def expand(self, level: int) -> None:
        """Count an expansion; raise `LimitError` if a limit is reached."""
        self.counts[level].expanded += 1
        self.expanded += 1
        self._limited()

    def spend(self, level: int, counts: Counts, work: int) -> None:
        """Count the work of searching a scope (states times operators); raise `LimitError` if a limit is reached."""
        self.counts[level].add(counts)
        self.expanded += counts.expanded
        self.worked += work
        self._limited()
        if self.worked > self.most_work:
            raise LimitError(f"{self.most_work:.0f} states times operators")

    def look(self) -> None:
        """Count an examined achiever; raise `LimitError` if a limit is reached."""
        self.looked += 1
        if self.looked > self.most_looked:
            raise LimitError(f"{self.most_looked:,} ways to achieve values")
        self.check_time()

    def _limited(self) -> None:
        if self.expanded > self.most:
            raise LimitError(f"{self.most} expansions")
        if self.effort > self.checked_at:
            self.checked_at = 2 * self.effort
            self.meanwhile()
        self.check_time()

    def check_time(self) -> None:
        """Raise `LimitError` when the time limit has passed."""
        if self.deadline is not None and perf_counter() > self.deadline:
            raise LimitError("the time limit")
