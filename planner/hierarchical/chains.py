"""A few steps towards a few wants: search over relevant behaviours, on a state that is changed in place.

targets   the symbols that shall get a value, with it
keep      what any other symbol that was touched must be in the end (docs/levels.md), None if it may be anything
off       symbols that haven't the value that they must have in the end: the goal of this search, empty when it is reached
depth     how many steps are left
changed   the symbols that differ from the start of the segment, with their values: this names a state

Only relevant behaviours are tried: those that give a symbol that is off its value, or that give an unmet precondition of such
a behaviour its value, and so on. A chain of k of them takes at least k steps, so that longer chains than `depth` aren't looked
at. `find` deepens iteratively and returns a shortest segment of those that relevance admits. What relevance doesn't admit, and
what is too long for that, is left to a search over a small world (`confab.planner.hierarchical.scope`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from time import perf_counter
from typing import TypeAlias

from confab.planner.hierarchical.operators import Achiever, Program
from confab.planner.hierarchical.subgoals import Env, Want, Wants
from confab.planner.plan import Counts, Limits
from confab.planner.transitions import Cell, Change, Key, Table, arguments_of
from confab.reasoner.amounts import meets
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import FALSE, TRUE

Ground: TypeAlias = "tuple[str, tuple[str, ...]]"
"""A quantified behaviour: its name and arguments."""
Forbidden: TypeAlias = "tuple[Ground, frozenset[tuple[Cell, str]]]"
"""A quantified behaviour, and the changes since the segment began after which it is forbidden."""
MOST_EXPANSIONS = 150
"""The most expansions of one search for a few steps."""
EXPANSION = 100
"""An expansion takes about as long as so many states times operators of a small world: a microsecond each."""
Asked: TypeAlias = "set[tuple[str, Key, str]]"
"""Values of symbols that were asked for on the way to others."""
Keep: TypeAlias = "Callable[[Cell, str], str | None]"
"""Says what a touched symbol must be in the end, given what it was in the beginning; None: whatever it came to be."""


def trusting() -> None:
    """Doubt nothing."""


@dataclass(frozen=True)
class Effort:
    """How hard to try: `depth` is the most steps of a segment or a chain."""

    depth: int


ONE_STEP, CHAIN, REFINING = Effort(depth=1), Effort(depth=3), Effort(depth=4)
"""One step, and the longest chains towards goals and in refinements: what longer ones cost against searches of scopes."""


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
        When `LimitError` is raised, on the clock of `perf_counter`; the deadline that holds (`confab.reasoner.limits`) if left out.
    doubt : function, optional
        Called whenever the work of small worlds has doubled: it may be in vain.
    most : int
        Expansions of all searches together, after which `LimitError` is raised.
    most_work : float
        The same for the work of small worlds, in states times operators: of one attempt.
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
        """The most ways to achieve a value that chains look at before `LimitError` is raised, those not applicable included."""
        if self.deadline is None:
            self.deadline = Limits().end()
        self.enough = math.inf
        """The work of all attempts to find a first plan."""
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

    def find(
        self,
        level: int,
        targets: Mapping[Cell, str],
        keep: Keep,
        effort: Effort,
        forbidden: AbstractSet[Forbidden] = frozenset(),
    ) -> list[Ground] | None:
        """Return the shortest relevant steps that bring all targets about and keep the rest as `keep` says, or None.

        The table is left as it was found.
        """
        table, now = self.table, self.table.now
        counts, widest = self.counts[level], self.widest[level]
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
            self.expand(level)
            mark = len(table.trail)
            for ground in self.relevant(level, off, depth):
                if forbidden and (ground, here) in forbidden:
                    continue
                counts.generated += 1
                done = self.step(ground, off, changed, origin, targets, keep)
                if done is not None:
                    steps.append(ground)
                    if deepen(depth - 1, *done):
                        return True
                    steps.pop()
                    table.undo(mark)
            return False

        start = len(table.trail)
        off = {cell: value for cell, value in targets.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)}
        for depth in range(1, effort.depth + 1):
            found = deepen(depth, off, {})
            table.undo(start)
            if found:
                return steps
            if left <= 0:
                return None
        return None

    def step(
        self,
        ground: Ground,
        off: Mapping[Cell, str],
        changed: Mapping[Cell, str],
        origin: dict[Cell, str],
        targets: Mapping[Cell, str],
        keep: Keep,
    ) -> tuple[dict[Cell, str], dict[Cell, str]] | None:
        """Do a behaviour on the table and return what is off and changed after it, or None if it isn't applicable."""
        now = self.table.now
        done = self.forward[ground[0]](*ground[1])
        if done is None:
            return None
        still, changes = dict(off), dict(changed)
        for situation, key, value in done[1]:
            old = now[situation].get(key)
            if old is None:
                if not self.exists(situation, key):
                    continue
                old = FALSE
            if old == value:
                continue
            self.table.put(situation, key, value)
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
        for cell in self.defined:
            wanted = targets.get(cell) or keep(cell, "")
            if wanted and now[cell[0]].get(cell[1]) != wanted:
                still[cell] = wanted
            else:
                still.pop(cell, None)
        return still, changes

    def apply(self, changes: Sequence[Change]) -> None:
        """Make changes, as far as the symbols exist."""
        now, put = self.table.now, self.table.put
        for situation, key, value in changes:
            old = now[situation].get(key)
            if old is None and self.exists(situation, key):
                old = FALSE
            if old is not None and old != value:
                put(situation, key, value)

    def expand(self, level: int) -> None:
        """Count an expansion, and look at the clock now and then."""
        counts = self.counts[level]
        counts.expanded += 1
        self.expanded += 1
        if self.expanded > self.most:
            raise LimitError(f"{self.most} expansions")
        self._ask()
        self.check_time()

    def _ask(self) -> None:
        """Ask whether there is a plan at all, each time that the effort has doubled."""
        if self.effort > self.doubted:
            self.doubted = 2 * self.effort
            self.doubt()

    def spend(self, level: int, counts: Counts, work: int) -> None:
        """Count what a search elsewhere did, and its work in states times operators."""
        self.counts[level].add(counts)
        self.expanded += counts.expanded
        self.worked += work
        if self.expanded > self.most:
            raise LimitError(f"{self.most} expansions")
        self._ask()
        if self.worked > min(self.most_work, self.enough):
            raise LimitError(f"{min(self.most_work, self.enough):.0f} states times operators")
        self.check_time()

    @property
    def effort(self) -> int:
        """How much was searched so far, about in microseconds."""
        return self.worked + EXPANSION * self.expanded

    def visible(self, level: int, cell: Cell) -> bool:
        """Whether a level knows a symbol: its situation type and its individuals exist there."""
        levels = self.program.problem.value_levels
        return self.program.domain.situations[cell[0]].level <= level and (
            not levels or all(levels.get(argument, 1) <= level for argument in arguments_of(cell[1]))
        )

    def refining(self, level: int, careful: bool = False) -> Keep:
        """Return what refining a behaviour of `level` keeps: all that this level knows as it was, the rest at rest.

        If `careful`, also as it was what has no rest value, so that it might be anything.
        """
        rest = self.rest
        return lambda cell, first: first if self.visible(level, cell) else rest.get(cell[0], first if careful else None)

    def keeping(self, kept: Mapping[Cell, str]) -> Keep:
        """Return what steps towards a goal keep: the goals reached before, the rest at rest."""
        return lambda cell, first: kept.get(cell) or self.rest.get(cell[0])

    def exists(self, situation: str, key: object) -> bool:
        """Whether a boolean symbol exists that the table doesn't list."""
        kind = self.program.domain.situations[situation]
        return kind.boolean and all(
            argument in self.program.members.get(of, ())
            for argument, of in zip(arguments_of(key), kind.arguments, strict=True)  # type: ignore[arg-type]
        )

    def relevant(self, level: int, off: Mapping[Cell, str], depth: int) -> Iterator[Ground]:
        """Yield each applicable behaviour that starts a chain of at most `depth` towards a symbol that is off, once."""
        given: set[Ground] = set()
        for cell, value in off.items():
            for length, ground in self.chains(level, cell, value):
                if length > depth:
                    break
                if ground is not None and ground not in given:
                    given.add(ground)
                    yield ground

    def chains(
        self,
        level: int,
        cell: Cell,
        value: str,
        questions: int = 1000,
        met: dict[str, None] | None = None,
        asked: Asked | None = None,
    ) -> Iterator[tuple[int, Ground | None]]:
        """Yield the applicable behaviours that start chains towards a value, with the chains' length, shortest first.

        Layer by layer from what achieves the value, through what achieves its unmet conditions; None begins a layer. All
        individuals that came up on the way are added to `met`, all values to `asked`.
        """
        asked = set() if asked is None else asked
        self.wants.concern(frozenset((*arguments_of(cell[1]), value)))
        wants: Iterable[Want] = [(*cell, (value,))]
        if cell[0] in self.program.rules:
            wants = self.wants.defining(*cell, value == TRUE, level)
        blocked: list[tuple[Achiever, tuple[int, ...], Env]] = []
        length = 0
        while (blocked or not length) and len(asked) < questions:
            length += 1
            yield length, None
            if blocked:  # worked out only now: who wants no longer chains has gone
                found: list[Want] = []
                for achiever, unmet, env in blocked:
                    self.check_time()
                    for number in unmet:
                        found += self.wants.towards(achiever, number, env, level)
                wants = found
            blocked = []
            for situation, key, values in wants:
                for wanted in values:
                    if (question := (situation, key, wanted)) in asked:
                        continue
                    asked.add(question)
                    for achiever in self.program.achievers.get((level, situation), ()):
                        achieve = self.achieve[achiever.behavior, achiever.effect]
                        for arguments, unmet, env in achieve(*arguments_of(key), wanted):
                            self.look()
                            if met is not None:
                                met.update(dict.fromkeys((*arguments_of(key), wanted, *arguments)))
                                met.update((found, None) for found in env.values() if found) if env else None
                            if unmet:
                                blocked.append((achiever, unmet, env))
                            else:
                                yield length, (achiever.behavior, arguments)

    def waits_for(self, level: int, cell: Cell, value: str) -> list[Cell]:
        """Return the symbols whose change could make a value attainable in one step."""
        found: dict[Cell, None] = {}
        self.wants.concern(frozenset((*arguments_of(cell[1]), value)))
        if cell[0] in self.program.rules:
            return [want[:2] for want in self.wants.defining(*cell, value == TRUE, level)]
        for achiever in self.program.achievers.get((level, cell[0]), ()):
            for _, unmet, env in self.achieve[achiever.behavior, achiever.effect](*arguments_of(cell[1]), value):
                self.look()
                for number in unmet:
                    for situation, key, _ in self.wants.towards(achiever, number, env, level):
                        found[situation, key] = None
        return list(found)

    def look(self) -> None:
        """Count a way to achieve a value that is looked at, and look at the clock."""
        self.looked += 1
        if self.looked > self.most_looked:
            raise LimitError(f"{self.most_looked:,} ways to achieve values")
        self.check_time()

    def check_time(self) -> None:
        """Raise `LimitError` when the time limit has passed."""
        if self.deadline is not None and perf_counter() > self.deadline:
            raise LimitError("the time limit")


class Chain:
    """A search for a few relevant steps, repeated as often as steps turn out not to be refinable."""

    def __init__(self, segments: Segments, level: int, targets: Mapping[Cell, str], keep: Keep, effort: Effort) -> None:
        self.segments, self.level, self.targets, self.keep, self.effort = segments, level, targets, keep, effort
        self.mark = len(segments.table.trail)
        self.found: list[Ground] = []
        self.forbidden: set[Forbidden] = set()

    def search(self) -> list[Ground] | None:
        """Return steps, or None if none were found; `forbid` takes one of them back."""
        found = self.segments.find(self.level, self.targets, self.keep, self.effort, self.forbidden)
        self.found = found or []
        return found

    def forbid(self, position: int) -> None:
        """Take back a step of those found last, which can't be refined where it stands: as the table is now."""
        self.forbidden.add((self.found[position], frozenset(self.segments.table.since(self.mark).items())))
