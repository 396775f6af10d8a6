"""Search that experience leads: best-first by how often the path departed from the most cogent choice.

d          rank discrepancies along the path: 0 while always the most cogent candidate was done; expanded next is the node with
           the least sum of `WEIGHT` d and open goals, of equals the deepest
focus      for each open goal, the most cogent candidate that works towards it; kept until something near it changes

Every node that isn't exhausted stays on the heap, so that all relevant behaviours are tried in the end. Nothing is shared with
the search that does without memory.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from planner.experience.choice_points import BROAD, Field, Ground
from planner.experience.scoring import Judge
from planner.transitions import Cell, Key, arguments_of
from reasoner.amounts import meets
from reasoner.symbols import FALSE

WEIGHT = 2  # open goals that one discrepancy weighs
SURE = 0.0  # ln odds: rather chosen than passed over
LOST = 3  # expansions without getting nearer, after which more than the first of its sort is thought of
NEAR, FAR = 3, 6  # steps ahead from which a candidate may work towards a goal; the second if the first gives none

Here: TypeAlias = "frozenset[tuple[Cell, str]]"


@dataclass(eq=False)
class Node:
    """A state, by the behaviour that led to it; `quick` until all its candidates were ranked."""

    above: Node | None
    ground: Ground | None
    depth: int
    quick: bool = True
    tried: set[Ground] = field(default_factory=set)

    def path(self) -> list[Ground]:
        """Return the behaviours that lead here."""
        found, node = [], self
        while node.above is not None and node.ground is not None:
            found.append(node.ground)
            node = node.above
        return found[::-1]


class Stream:
    """A search that can be done expansion by expansion.

    Parameters
    ----------
    field : Field
    judge : Judge
    """

    def __init__(self, field: Field, judge: Judge) -> None:
        self.field, self.judge = field, judge
        schema = field.schema
        field.view.only = {
            name: [i for i, q in enumerate(schema.paths(name)[1]) if q.name in judge.facts[name]]
            for name in judge.facts
        }
        self.expanded = self.generated = self.evaluated = self.pushed = 0
        self.solution: list[Ground] | None = None
        self.best = len(field.unmet())
        self.fruitless = 0
        root = Node(None, None, 0)
        self.heap: list[tuple[int, int, int, Node, Ground | None, int]] = []
        self._push(root, None, 0, self.best)
        self.at, self.start = root, len(field.table.trail)
        self.seen: set[Here] = set()
        self.focus: dict[Cell, tuple[float, Ground]] = {}
        self.stale: set[Cell] = set(field.goal)
        self.touching: dict[str, list[Cell]] = {}
        for cell, value in field.goal.items():
            for individual in {*arguments_of(cell[1]), value}:
                self.touching.setdefault(individual, []).append(cell)
        self._known = {
            name: judge.verdicts.setdefault((name, tuple([schema.paths(name)[1][i].name for i in asked])), {})
            for name, asked in field.view.only.items()
        }
        if not self.best:
            self.solution = []

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left to be tried."""
        return not self.heap

    def expand(self) -> bool:
        """Expand one node; whether the goal was reached on the way there."""
        while self.heap and self.solution is None:
            _, _, _, node, ground, d = heapq.heappop(self.heap)
            if ground is not None:
                child = self._child(node, ground)
                if child is None:
                    continue
                node = child
            elif node is not self.at:
                self._go(node)
            left = len(self.field.unmet())
            if not left:
                self.solution = node.path()
                break
            self.fruitless = 0 if left < self.best else self.fruitless + 1
            self.best = min(self.best, left)
            self.expanded += 1
            self._expand(node, d, left)
            break
        return self.solution is not None

    def forbid(self, path: Sequence[Ground]) -> None:
        """Take back a solution because of its last step, which can't be refined where it stands: search on without it."""
        self.solution = None
        self._rank(self._reached(path), 0, len(self.field.unmet()))

    # ------------------------------------------------------------------------------------------------------- expanding

    def _expand(self, node: Node, d: int, left: int) -> None:
        quick, node.quick = node.quick, False
        while quick and (ground := self._most_cogent(node)) is not None:
            node.tried.add(ground)
            child = self._child(node, ground)
            if child is not None:  # else it leads where the search has been: the next best
                self._push(node, None, d + 1, left)
                self._push(child, None, d, left)
                return
        self._rank(node, d, left)

    def _rank(self, node: Node, d: int, left: int) -> None:
        """Push all candidates of a node that weren't tried, the most cogent with the least discrepancy."""
        scored: dict[Ground, float] = {}
        for reach in (NEAR, FAR):
            for cell in self.field.unmet():
                for ground in self.field.proposals([cell], reach, BROAD):
                    if ground not in scored and ground not in node.tried:
                        scored[ground] = self._odds(ground)
            if scored:
                break
        self.generated += len(scored)
        ranked = sorted(scored, key=lambda ground: (-scored[ground], ground))
        for rank, ground in enumerate(ranked):
            node.tried.add(ground)
            self._push(node, ground, d + rank, left)

    def _most_cogent(self, node: Node) -> Ground | None:
        """Return the most cogent candidate of all goals, looking again only at those near which something changed."""
        now, focus = self.field.table.now, self.focus
        open_goals = [
            cell for cell, value in self.field.goal.items() if not meets(now[cell[0]].get(cell[1], FALSE), value)
        ]
        for cell in open_goals:
            if cell in self.stale or cell not in focus or focus[cell][1] in node.tried:
                self._look(cell, node)
        self.stale.clear()
        fresh: set[Cell] = set()
        while len(fresh) < len(open_goals) or any(cell in focus for cell in open_goals):
            looked = [(*focus[cell], cell) for cell in open_goals if cell in focus]
            odds, ground, cell = max(looked, key=lambda entry: entry[0], default=(SURE, None, open_goals[0]))
            if ground is None or (odds <= SURE and self.fruitless and len(fresh) < len(open_goals)):
                breadth = BROAD if ground is None or self.fruitless >= LOST else 1
                for other in open_goals:
                    self._look(other, node, breadth)
                fresh.update(open_goals)
            elif cell in fresh or (self.field.roles(ground) is not None and abs(self._odds(ground) - odds) < 1e-9):
                return ground
            else:
                self._look(cell, node)
                fresh.add(cell)
        return None

    def _look(self, cell: Cell, node: Node, breadth: int = 1) -> None:
        """Find the most cogent candidate for one goal."""
        self.focus.pop(cell, None)
        found: tuple[float, Ground] | None = None
        for reach in (NEAR, FAR):
            for ground in self.field.proposals([cell], reach, breadth):
                if ground in node.tried:
                    continue
                self.generated += 1
                odds = self._odds(ground)
                if found is None or odds > found[0]:
                    found = odds, ground
            if found is not None:
                self.focus[cell] = found
                return

    def _odds(self, ground: Ground) -> float:
        roles = self.field.roles(ground)
        if roles is None:
            return float("-inf")
        self.evaluated += 1
        name, view = ground[0], self.field.view
        verdicts = self._known.get(name)
        if verdicts is None:
            return 0.0
        values = view.values(name, roles)
        classes = tuple([self.field.schema.classes.get(role, "") for role in roles])
        key = classes, values, roles if (name, classes) in self.judge.liked else ()
        known = verdicts.get(key)
        if known is None:
            known = verdicts[key] = self.judge.cogency(view.candidate(name, roles, values))
        return known

    # --------------------------------------------------------------------------------------------------------- moving

    def _child(self, node: Node, ground: Ground) -> Node | None:
        """Do a behaviour in a node's state; None if that leads where the search has been."""
        if node is not self.at:
            self._go(node)
        mark = len(self.field.table.trail)
        if not self.field.do(ground):
            return None
        here = frozenset(self.field.table.since(self.start).items())
        if here in self.seen:
            self.field.table.undo(mark)
            return None
        self.seen.add(here)
        self._touch(mark)
        self.at = Node(node, ground, node.depth + 1)
        return self.at

    def _touch(self, mark: int) -> None:
        """Note which goals have something to do with what changed."""
        table = self.field.table
        for situation, key, old in table.trail[mark:]:
            near: set[Key] = {*arguments_of(key), old, table.now[situation][key]}
            near.update(cells[key] for cells in table.now.values() if key in cells)
            for individual in near:
                self.stale.update(self.touching.get(individual, ()))  # type: ignore[arg-type]

    def _go(self, node: Node) -> None:
        self.field.table.undo(self.start)
        for ground in node.path():
            self.field.do(ground)
        self.at = node
        self.focus.clear()
        self.stale.update(self.field.goal)

    def _reached(self, path: Sequence[Ground]) -> Node:
        node = Node(None, None, 0, quick=False)
        for ground in path[:-1]:
            node = Node(node, ground, node.depth + 1, quick=False)
        node.tried.add(path[-1])
        self._go(node)
        return node

    def _push(self, node: Node, ground: Ground | None, d: int, left: int) -> None:
        self.pushed += 1
        depth = node.depth + (ground is not None)
        heapq.heappush(self.heap, (WEIGHT * d + left, -depth, -self.pushed, node, ground, d))
