"""Candidates for the values of symbols and for individuals; one of many symmetric individuals represents all of them.

Therefore a thousand free places count as one place.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import islice

from confab.planner.hierarchical.operators import FEW, Program
from confab.planner.hierarchical.symmetry import representatives
from confab.planner.transitions import Cell, Key, Table
from confab.reasoner.symbols import FALSE, TRUE


class Candidates:
    """Candidates in the current state of one table.

    Parameters
    ----------
    program : Program
    table : Table
    goal : mapping of cell to value
        The goals of the call. A goal's value is a candidate for the goal's symbol, and doesn't count as free for other symbols.
    """

    def __init__(self, program: Program, table: Table, goal: Mapping[Cell, str]) -> None:
        self.program, self.table, self.goal = program, table, goal
        self.wanted: dict[str, dict[str, None]] = {}
        """The values that goals require, by situation type."""
        for (situation, _), value in goal.items():
            self.wanted.setdefault(situation, {})[value] = None
        self._cursors: dict[int, int] = {}
        self._free: dict[tuple[str, str], list[str]] = {}
        self._age = -1

    def values(self, situation: str, key: Key, kind: str) -> tuple[str, ...]:
        """Return candidates of a class for the value of a symbol.

        The candidates are the goal's value, and one value of each symmetry class, preferably a free value. All members of a small
        class are candidates.
        """
        members = self.program.problem.classes.get(kind, ())
        if len(members) <= FEW:
            return members
        if self._age != self.table.age:
            self._age = self.table.age
            self._free.clear()
        found = self._free.get((situation, kind))
        if found is None:
            groups, wanted, holders = (
                self.program.symmetry.groups(members),
                self.wanted.get(situation, {}),
                self.table.holders[situation],
            )

            found = representatives(groups, holders, wanted, self._cursors)
            self._free[situation, kind] = found
        goal = self.goal.get((situation, key))
        if goal is not None and goal not in found and goal in self.program.members[kind]:
            return (goal, *found)
        return tuple(found)

    def other_values(self, situation: str, key: Key, avoid: str | None, level: int) -> tuple[str, ...]:
        """Return candidates for another value of a symbol than `avoid`, among the values that a level sees."""
        if self.program.domain.situations[situation].boolean:
            return (FALSE,) if avoid == TRUE else (TRUE,)
        levels = self.program.problem.value_levels
        values = self.values(situation, key, self.program.domain.situations[situation].range)
        return tuple(value for value in values if value != avoid and levels.get(value, 1) <= level)

    def one_of_each(self, kind: str, excluded: Collection[str | None] = ()) -> list[str]:
        """Return the individuals of a class; if the class is large, one individual of each symmetry class and state.

        If `excluded` contains one of these individuals, another individual of the same symmetry class is added, because a different
        individual may be required.
        """
        members, symmetry = self.program.problem.classes.get(kind, ()), self.program.symmetry
        if len(members) <= FEW:
            return list(members)
        found = symmetry.unlike(members, (), self.table.now)
        for group in sorted({symmetry.class_of.get(one, -1) for one in excluded if one in found}):
            found += islice((one for one in symmetry.members[group] if one not in excluded and one not in found), 1)
        return found

    def spare(self, excluded: Collection[str], level: int, number: int) -> Iterator[str]:
        """Yield up to `number` additional values of each symmetry class with a member in `excluded`."""
        for situation in self.program.changing(level):
            members = self.program.problem.classes.get(situation.range, ())
            if len(members) <= FEW:
                continue
            for group in self.program.symmetry.groups(members):
                if not set(group).isdisjoint(excluded):
                    yield from islice((value for value in group if value not in excluded), number)
