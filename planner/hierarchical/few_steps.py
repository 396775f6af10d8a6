"""Search for a few relevant steps that achieve targets, forward from the current state, by iterative deepening on a table.

`targets` are the symbols to be changed, each with its required value. `off` contains the symbols that don't have their required
final value; the search succeeds when no such symbol remains. `changed` contains the symbols that differ from the start, each with
its value; these values identify a state.

The search tries only relevant behaviours (`confab.planner.hierarchical.relevance`). Therefore the result is a shortest sequence of
relevant steps. Longer sequences and other steps require the search of a scope (`confab.planner.hierarchical.scope`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from confab.planner.hierarchical.relevance import relevant
from confab.planner.hierarchical.workspace import Ground, Keep, Workspace
from confab.planner.transitions import Cell
from confab.reasoner.amounts import meets
from confab.reasoner.symbols import FALSE

Barred: TypeAlias = "tuple[Ground, frozenset[tuple[Cell, str]]]"
"""A quantified behaviour that is barred in a state; the state is given by the changes since the start."""
MOST_EXPANSIONS = 150
"""Maximum number of expansions of one search for a few steps."""


class FewSteps:
    """A search for a few relevant steps; the caller repeats the search if one of the steps has no refinement."""

    def __init__(self, space: Workspace, level: int, targets: Mapping[Cell, str], keep: Keep, longest: int) -> None:
        self.space, self.level, self.targets, self.keep, self.longest = space, level, targets, keep, longest
        self.mark = len(space.table.trail)
        self.found: list[Ground] = []
        self.barred: set[Barred] = set()

    def bar(self, position: int) -> None:
        """Exclude the step at `position` of the last result from the next search, in the current state of the table."""
        self.barred.add((self.found[position], frozenset(self.space.table.since(self.mark).items())))

    def search(self) -> list[Ground] | None:
        """Return the shortest sequence of relevant steps that achieves all targets and respects `keep`.

        The table stays unchanged. Return None if no sequence of at most `longest` steps is found.
        """
        space, level, table, now = self.space, self.level, self.space.table, self.space.table.now
        counts, widest = space.counts[level], space.widest[level]
        origin: dict[Cell, str] = {}
        steps: list[Ground] = []
        left = MOST_EXPANSIONS
        seen: dict[frozenset[tuple[Cell, str]], int] = {}

        def deepen(depth: int, off: dict[Cell, str], changed: dict[Cell, str]) -> bool:
            nonlocal left
            if not off:
                return True
            if len(off) > depth * widest or left <= 0:
                return False
            here = frozenset(changed.items())
            if seen.get(here, 0) >= depth:
                return False
            seen[here] = depth
            left -= 1
            space.expand(level)
            mark = len(table.trail)
            for ground in relevant(space, level, off, depth):
                if self.barred and (ground, here) in self.barred:
                    continue
                counts.generated += 1
                done = self._step(ground, off, changed, origin)
                if done is not None:
                    steps.append(ground)
                    if deepen(depth - 1, *done):
                        return True
                    steps.pop()
                    table.undo(mark)
            return False

        self.found = steps
        off = {
            cell: value for cell, value in self.targets.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)
        }
        for depth in range(1, self.longest + 1):
            found = deepen(depth, off, {})
            table.undo(self.mark)
            if found:
                return steps
            if left <= 0:
                break
        return None

    def _step(
        self, ground: Ground, off: Mapping[Cell, str], changed: Mapping[Cell, str], origin: dict[Cell, str]
    ) -> tuple[dict[Cell, str], dict[Cell, str]] | None:
        """Apply a behaviour to the table; return `off` and `changed` afterwards, or None if the behaviour isn't applicable."""
        space, targets, keep, now = self.space, self.targets, self.keep, self.space.table.now
        done = space.forward[ground[0]](*ground[1])
        if done is None:
            return None
        still, changes = dict(off), dict(changed)
        for situation, key, value in done[1]:
            old = now[situation].get(key)
            if old is None:
                if not space.exists(situation, key):
                    continue
                old = FALSE
            if old == value:
                continue
            space.table.put(situation, key, value)
            cell = situation, key
            first = origin.setdefault(cell, old)
            if value == first:
                changes.pop(cell, None)
            else:
                changes[cell] = value
            wanted = targets.get(cell) or keep(cell, first)
            if wanted is None or wanted == value or meets(value, wanted):
                still.pop(cell, None)
            else:
                still[cell] = wanted
        for cell in space.defined:
            wanted = targets.get(cell) or keep(cell, "")
            if wanted and now[cell[0]].get(cell[1]) != wanted:
                still[cell] = wanted
            else:
                still.pop(cell, None)
        return still, changes
