"""Search of one level without grounding, for levels with too many quantified behaviours.

In a state, the applicable behaviours are found by joins (`confab.planner.applicable`).

The states with the fewest unmet goals are expanded first. Among these states, novel states come first, and then the oldest state,
so that plans are short. A state is novel if it has a fact that no earlier state with as many unmet goals had. A successor with
fewer unmet goals is expanded at once. If a state has only one successor, the search goes on to this successor without ranking the
state.

The method is best-first width search without grounding (Corrêa and Seipp, "Best-first width search for lifted classical planning",
ICAPS 2022).
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import reduce
from itertools import islice
from operator import xor
from typing import NamedTuple

from confab.planner.applicable import joins
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.plan import Counts
from confab.planner.transitions import Cell, Change, arguments_of
from confab.reasoner.symbols import Symbol

TRIAL = 10
"""The work of a trial in the unit of the budget."""
STATES_OF_A_TRIAL = 10
"""Number of states of a path whose changes are applied in the time of one trial."""
MOST_FORCED = 1_000
"""Maximum number of states in a row that aren't ranked, since they have only one successor."""


class GroundMove(NamedTuple):
    """An applicable behaviour with its changes."""

    behavior: str
    arguments: tuple[str, ...]
    bindings: tuple[str, ...]
    changes: list[Change]


@dataclass(frozen=True)
class UngroundedState:
    """A reached state: the moves and the changes that lead from the state `before` to this state, and a hash of the state."""

    unmet: int
    hash: int = 0
    changes: Mapping[Cell, str] = field(default_factory=dict)
    moves: tuple[GroundMove, ...] = ()
    before: UngroundedState | None = None


class UngroundedSearch:
    """The search of the lowest level from the initial state of a call.

    `trials` counts the arguments that were tried for behaviours; at most `most` are tried, and fewer if the budget of the call is
    smaller. States with the same hash count as the same state.
    """

    def __init__(self, call: Call, most: int) -> None:
        self.call, self.table, self.space = call, call.table, call.space
        self.most = min(most, (self.space.most_work - self.space.worked) / TRIAL)
        self.level = call.program.levels[-1]
        self.trials, self.counts = 0, Counts()
        self.joins = joins(call.program.writer, call.problem.domain.at_level(self.level), self.table)
        situations = call.problem.domain.situations.values()
        self.amounts = {situation.name for situation in situations if situation.quantity is not None}
        self.facts: dict[tuple[int, Cell], set[str]] = {}
        self.seen: set[int] = set()
        self.open: list[tuple[int, bool, int, UngroundedState, Iterator[GroundMove] | None]] = []

    def plan(self) -> list[RefinedStep] | None:
        """Return steps that achieve the goals and leave the changed symbols at rest, or None if the search finds none."""
        moves = list[GroundMove]()
        try:
            end = self._end()
        finally:
            self.call.replace_steps(self.call.steps)
            self.space.counts[self.level].add(self.counts)
            self.space.expanded += self.counts.expanded
            self.space.worked += TRIAL * self.trials
        while end is not None:
            moves[:0] = end.moves
            end = end.before
        return [RefinedStep(self.level, move.behavior, move.arguments, move.bindings, ()) for move in moves] or None

    def _end(self) -> UngroundedState | None:
        """Return a state that ends a plan, or None."""
        self.table.undo(0)
        self._push(UngroundedState(self._unmet()))
        while self.open and not self._over():
            unmet, _, _, state, successors = heapq.heappop(self.open)
            self._return_to(state)
            if successors is None:
                self.counts.expanded += 1
                successors = iter(list(self._moves()))
            for move in successors:
                if self._over():
                    break
                mark = len(self.table.trail)
                after = self._after(state, move)
                if after is not None:
                    if not after.unmet and self._at_rest():
                        return after
                    self._push(after, after.changes if after.unmet == unmet else self.table.since(0))
                self.table.undo(mark)
                if after is not None and after.unmet < unmet:
                    self._push(state, successors=successors)
                    break
        return None

    def _after(self, state: UngroundedState, move: GroundMove) -> UngroundedState | None:
        """Apply a move, and further moves as long as there is only one; return the new state, or None if it isn't new."""
        mark, moves = len(self.table.trail), [move]
        while True:
            self.space.apply(moves[-1].changes)
            unmet = self._unmet()
            following = list(islice(self._moves(), 2)) if unmet else []
            if len(following) != 1 or len(moves) == MOST_FORCED:
                break
            moves += following
        old, new = self.table.changes(mark)
        key = reduce(xor, map(hash, (*old.items(), *new.items())), state.hash)
        if key in self.seen or (unmet and not following):
            return None
        self.seen.add(key)
        self.counts.generated += 1
        return UngroundedState(unmet, key, new, tuple(moves), state)

    def _moves(self) -> Iterator[GroundMove]:
        """Yield the applicable behaviours that change the current state."""
        now, forward = self.table.now, self.space.forward
        for name, join in self.joins.items():
            for arguments in join():
                self.trials += 1
                if self.trials > self.most:
                    return
                found = forward[name](*arguments)
                if found is not None and any(now[s].get(key) != value for s, key, value in found[1]):
                    yield GroundMove(name, arguments, *found)

    def _over(self) -> bool:
        """Return whether a limit is reached; raise `LimitError` when the time limit has passed."""
        self.space.check_time()
        return self.trials >= self.most or self.space.expanded + self.counts.expanded >= self.space.most

    def _unmet(self) -> int:
        return sum(not self.call.met(cell) for cell in self.call.goal)

    def _at_rest(self) -> bool:
        """Return whether each symbol without a goal has its rest value or its initial value in the current state."""
        releases = self.call.problem.releases
        changed = {cell for cell in self.table.since(0) if not releases(Symbol(cell[0], arguments_of(cell[1])))}
        return all(changed.isdisjoint(self.call.restless(level)) for level in self.call.program.levels)

    def _return_to(self, state: UngroundedState) -> None:
        """Make a state the current state of the table; a long path to the state counts as trials."""
        self.table.undo(0)
        path: list[Mapping[Cell, str]] = []
        one: UngroundedState | None = state
        while one is not None:
            path.append(one.changes)
            one = one.before
        for changes in reversed(path):
            self.table.put_all(changes)
        self.trials += len(path) // STATES_OF_A_TRIAL

    def _push(
        self,
        state: UngroundedState,
        facts: Mapping[Cell, str] | None = None,
        successors: Iterator[GroundMove] | None = None,
    ) -> None:
        """Put a state into the open list.

        The state is novel if one of the facts, except amounts, is new among states with as many unmet goals.
        """
        novel = not facts
        for cell, value in (facts or {}).items():
            if cell[0] in self.amounts:
                continue
            values = self.facts.setdefault((state.unmet, cell), set())
            novel = novel or value not in values
            values.add(value)
        heapq.heappush(self.open, (state.unmet, not novel, len(self.seen), state, successors))
