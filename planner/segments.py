"""A few steps towards a few wants: iterative deepening over relevant behaviours, on a state that is changed in place.

targets   the symbols that shall get a value, with it
kept      what must hold again in the end; `None` means that everything else must (a refinement changes nothing else)
off       symbols that haven't the value that they must have in the end: the goal of this search, empty when it is reached
depth     how many steps are left

Only relevant behaviours are tried: those that give a symbol that is off its value, or that give an unmet precondition of such
a behaviour its value, and so on. A chain of k of them takes at least k steps, so that longer chains than `depth` aren't looked
at. The first plan found is a shortest one of those that relevance admits; what it doesn't admit is left to flat search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TypeAlias

from planner.compiling import Program
from planner.plan import Counts
from planner.table import Cell, Table, arguments_of
from planner.wants import Want, Wants
from reasoner.symbols import FALSE

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A quantified behaviour: its name and arguments."""
Advice: TypeAlias = "Callable[[int, Table, Sequence[Ground]], Sequence[Ground]]"
"""Orders what could be done, given the level and the state; may leave nothing out."""


class OutOfTimeError(Exception):
    """The time limit of the planning call has passed."""


@dataclass
class Effort:
    """How hard to try: most steps, and most expansions."""

    depth: int
    expansions: int


@dataclass
class Segments:
    """Searches short segments on one table.

    Parameters
    ----------
    program : Program
    table : Table
    goal : mapping of cell to value
        The task's goal, which proposes values.
    deadline : float, optional
        `perf_counter` at which `OutOfTimeError` is raised.
    advice : Advice, optional
    """

    program: Program
    table: Table
    goal: Mapping[Cell, str]
    deadline: float | None = None
    advice: Advice | None = None
    counts: dict[int, Counts] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.focus: dict[str, None] = {}
        bound = self.program.bind(self.table, self.focus)
        self.forward, self.achieve = bound.forward, bound.achieve
        self.wants = Wants(self.program, self.table, self.goal)
        self.counts = {level: Counts() for level in self.program.levels}
        self.widest = {
            level: max(len(b.effects) for b in self.program.domain.at_level(level)) for level in self.program.levels
        }

    def find(
        self,
        level: int,
        targets: Mapping[Cell, str],
        kept: Mapping[Cell, str] | None,
        effort: Effort,
        forbidden: set[tuple[Ground, frozenset[tuple[Cell, str]]]] = frozenset(),  # type: ignore[assignment]
    ) -> list[Ground] | None:
        """Return the shortest relevant steps that bring all targets about and everything kept back, or None.

        The table is left as it was found.
        """
        table, now, forward = self.table, self.table.now, self.forward
        counts, widest = self.counts[level], self.widest[level]
        origin: dict[Cell, str] = {}
        steps: list[Ground] = []
        left = effort.expansions
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
            counts.expanded += 1
            if counts.expanded % 64 == 0:
                self.check_time()
            mark = len(table.trail)
            for ground in self.ordered(level, off, depth):
                if forbidden and (ground, here) in forbidden:
                    continue
                counts.generated += 1
                name, arguments = ground
                done = forward[name](*arguments)
                if done is None:
                    continue
                still, changes = dict(off), dict(changed)
                for situation, key, value in done[1]:
                    old = now[situation].get(key)
                    if old is None and not self.exists(situation, key):
                        continue
                    old = old or FALSE
                    if old == value:
                        continue
                    table.put(situation, key, value)
                    cell = situation, key
                    first = origin.setdefault(cell, old)
                    if value == first:
                        changes.pop(cell, None)
                    else:
                        changes[cell] = value
                    wanted = targets.get(cell) or (first if kept is None else kept.get(cell))
                    if wanted is None or wanted == value:
                        still.pop(cell, None)
                    else:
                        still[cell] = wanted
                steps.append(ground)
                if deepen(depth - 1, still, changes):
                    return True
                steps.pop()
                table.undo(mark)
            return False

        start = len(table.trail)
        off = {cell: value for cell, value in targets.items() if now[cell[0]].get(cell[1], FALSE) != value}
        for depth in range(1, effort.depth + 1):
            found = deepen(depth, off, {})
            table.undo(start)
            if found:
                return steps
            if left <= 0:
                return None
        return None

    def exists(self, situation: str, key: object) -> bool:
        """Whether a boolean symbol exists that the table doesn't list."""
        kind = self.program.domain.situations[situation]
        return kind.boolean and all(
            argument in self.program.members.get(of, ())
            for argument, of in zip(arguments_of(key), kind.arguments, strict=True)  # type: ignore[arg-type]
        )

    def ordered(self, level: int, off: Mapping[Cell, str], depth: int) -> Iterator[Ground] | Sequence[Ground]:
        """Return the relevant behaviours, in the order that advice gives them if there is any."""
        found = self.relevant(level, off, depth)
        return found if self.advice is None else self.advice(level, self.table, list(found))

    def relevant(self, level: int, off: Mapping[Cell, str], depth: int) -> Iterator[Ground]:
        """Yield each applicable behaviour that starts a chain of at most `depth` towards a symbol that is off, once."""
        asked: dict[tuple[Cell, str], int] = {}
        given: set[Ground] = set()
        for (situation, key), value in off.items():
            yield from self._towards(level, (situation, key, (value,)), depth, asked, given)

    def _towards(
        self, level: int, want: Want, depth: int, asked: dict[tuple[Cell, str], int], given: set[Ground]
    ) -> Iterator[Ground]:
        situation, key, values = want
        for value in values:
            question = (situation, key), value
            if asked.get(question, 0) >= depth:
                continue
            asked[question] = depth
            for achiever in self.program.achievers.get((level, situation), ()):
                achieve = self.achieve[achiever.behavior, achiever.effect]
                deeper = []
                for arguments, unmet, env in achieve(*arguments_of(key), value):
                    if unmet:
                        deeper.append((unmet, env))
                    elif (ground := (achiever.behavior, arguments)) not in given:
                        given.add(ground)
                        yield ground
                if depth > 1:
                    for unmet, env in deeper:
                        for number in unmet:
                            for further in self.wants.of(achiever, achiever.soft[number], env, level):
                                yield from self._towards(level, further, depth - 1, asked, given)

    def waits_for(self, level: int, cell: Cell, value: str) -> list[Cell]:
        """Return the symbols whose change could make a value attainable in one step."""
        found: dict[Cell, None] = {}
        for achiever in self.program.achievers.get((level, cell[0]), ()):
            for _, unmet, env in self.achieve[achiever.behavior, achiever.effect](*arguments_of(cell[1]), value):
                for number in unmet:
                    for situation, key, _ in self.wants.of(achiever, achiever.soft[number], env, level):
                        found[situation, key] = None
        return list(found)

    def check_time(self) -> None:
        """Raise `OutOfTimeError` when the time limit has passed."""
        if self.deadline is not None and perf_counter() > self.deadline:
            raise OutOfTimeError
