"""List scheduling: turns are taken in the order in which they can begin, by the actor that ends them first.

A block consists of the activities that are connected by turns of actors or by a step of the first level, and of activities between
them. The schedule appends one block after another, so that the steps of every level could be executed in the order of the blocks.
The next block is the block that can begin first; of several, the block with the longest chain of blocks after it. A block can be
appended if each of its turns finds the resource free. The method is the serial schedule generation scheme
(Kolisch, "Serial and parallel resource-constrained project scheduling methods revisited", EJOR 90, 1996) with blocks.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, product
from typing import TypeVar

import networkx

from confab.planner.timed.network import Network
from confab.planner.timed.order import END, Edge, Order, TurnId
from confab.reasoner.limits import check

Chosen = TypeVar("Chosen")
MOST_CREWS = 64
"""Maximum number of combinations of actors that are compared for a block."""


def combinations(choices: Sequence[Sequence[Chosen]]) -> Iterator[tuple[Chosen, ...]]:
    """Yield all combinations of one element of each sequence, so that every element is in one of the first combinations.

    >>> list(combinations(["ab", "xyz"]))
    [('a', 'x'), ('b', 'y'), ('a', 'z'), ('b', 'x'), ('a', 'y'), ('b', 'z')]
    """
    longest = max(range(len(choices)), key=lambda k: len(choices[k]), default=0)
    for shifts in product(*(range(1 if k == longest else len(its)) for k, its in enumerate(choices))):
        for i in range(len(choices[longest]) if choices else 1):
            yield tuple(its[(i + shift) % len(its)] for its, shift in zip(choices, shifts, strict=True))


@dataclass
class _Line:
    """The turns of a resource: the open turns, the turns taken so far, and the ends that the next turn must follow."""

    taken: list[TurnId] = field(default_factory=list)
    open: dict[TurnId, int] = field(default_factory=dict)  # the number of members that are left
    changed: tuple[tuple[int, int], ...] = ()  # the ends of the last turn that isn't reading
    read: tuple[tuple[int, int], ...] = ()  # the ends of the reading turns after it

    def copy(self) -> _Line:
        return _Line(list(self.taken), dict(self.open), self.changed, self.read)


@dataclass
class _Appended:
    """A block that is appended: the begins and durations of its activities, the lines that change, and the end of the block."""

    begins: dict[int, int]
    durations: dict[int, int]
    lines: dict[int, _Line]
    taking: Mapping[TurnId, int]
    end: int


class Listing:
    """List scheduling of the activities of an order.

    Parameters
    ----------
    order : Order
    network : Network
        The network of `order`.
    of : mapping of turn to sequence of int
        The resources that can take a turn.
    lasts : mapping of (turn, resource) to mapping of int to int
        The durations of a turn's activities for another resource.
    """

    def __init__(
        self,
        order: Order,
        network: Network,
        of: Mapping[TurnId, Sequence[int]],
        lasts: Mapping[tuple[TurnId, int], Mapping[int, int]],
    ) -> None:
        self.order, self.network, self.of, self.lasts = order, network, of, lasts
        self.turns_of: list[list[TurnId]] = [[] for _ in order.activities]
        for resource, its in enumerate(order.resources):
            for number, turn in enumerate(its.turns if its.pool is None else ()):
                for member in turn.members:
                    self.turns_of[member].append((resource, number))
        self.into: dict[int, list[Edge]] = defaultdict(list)
        for edge in network.edges:
            self.into[edge[2]].append(edge)
        self.kept = set[int]()  # the resources whose turns keep the order of the sequence
        self.start()

    def start(self) -> None:
        """Begin an empty schedule."""
        self.lines = [_Line() for _ in self.order.resources]
        self.begins: dict[int, int] = {}
        self.durations = list(self.network.durations)

    def turns(self) -> list[list[TurnId]] | None:
        """Return the turns of each resource in their order, or None if the open turns exclude all remaining blocks.

        If the open turns exclude all remaining blocks, the turns of the resources that they occupy keep the order of the sequence,
        and the schedule begins again.
        """
        blocks = self.blocks()
        graph = self.graph(blocks)
        tails = self.tails(blocks, graph)
        while True:
            self.start()
            occupied = self.listed(blocks, graph, tails)
            if not occupied:
                return [self.line(resource) for resource in range(len(self.lines))]
            if occupied <= self.kept:
                return None
            self.kept |= occupied

    def line(self, resource: int) -> list[TurnId]:
        """Return the turns of a resource in their order; the events of a pool have the order of their times."""
        its = self.order.resources[resource]
        if its.pool is None:
            return self.lines[resource].taken
        times = [
            (self.begins[i] + which * self.durations[i], -which, self.begins[i])
            for ((i, which),) in (t.lows for t in its.turns)
        ]
        return [(resource, number) for number in sorted(range(len(times)), key=times.__getitem__)]

    def listed(self, blocks: Sequence[Sequence[int]], graph: networkx.DiGraph[int], tails: Sequence[int]) -> set[int]:
        """Append all blocks, and return the occupied resources that exclude the remaining blocks."""
        shortest = [sum(self.durations[i] for i in block) for block in blocks]
        left = [graph.in_degree(number) for number in range(len(blocks))]
        queue = [(0, -tails[number], number) for number in range(len(blocks)) if not left[number]]
        heapq.heapify(queue)
        parked: dict[int, set[int]] = {}
        while queue:
            check("scheduling the plan")
            _, _, number = heapq.heappop(queue)
            found = self.tried(blocks[number])
            if isinstance(found, set):
                parked[number] = found
                continue
            entry = found.end - shortest[number], -tails[number], number
            if queue and entry > queue[0]:
                heapq.heappush(queue, entry)
                continue
            self.append(found)
            for after in graph.successors(number):
                left[after] -= 1
            ready = [after for after in graph.successors(number) if not left[after]]
            changed = {*found.lines, *(resource for i in blocks[number] for resource, _ in self.turns_of[i])}
            freed = [one for one, occupied in parked.items() if occupied & changed]
            for one in freed:
                del parked[one]
            for one in (*ready, *freed):
                heapq.heappush(queue, (0, -tails[one], one))
        return set().union(*parked.values())

    def blocks(self) -> list[list[int]]:
        """Return the blocks; the activities of a block have the order of the sequence."""
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        graph.add_nodes_from(range(len(self.order.activities)))
        graph.add_edges_from((i, j) for i, _, j, _ in self.network.edges)
        groups = [turn.members for one in self.order.resources if one.actor is not None for turn in one.turns]
        inside: dict[int, list[int]] = defaultdict(list)
        for i, activity in enumerate(self.order.activities):
            inside[activity.step.path[0]].append(i)
        for its in (*groups, *inside.values()):
            graph.add_edges_from(zip(its, (*its[1:], its[0]), strict=True))
        return sorted(map(sorted, networkx.strongly_connected_components(graph)))

    def graph(self, blocks: Sequence[Sequence[int]]) -> networkx.DiGraph[int]:
        """Return the graph of the blocks that must precede others."""
        block_of = {i: number for number, block in enumerate(blocks) for i in block}
        graph: networkx.DiGraph[int] = networkx.DiGraph()
        graph.add_nodes_from(range(len(blocks)))
        edges = ((block_of[i], block_of[j]) for i, _, j, _ in self.network.edges)
        graph.add_edges_from(edge for edge in edges if edge[0] != edge[1])
        return graph

    def tails(self, blocks: Sequence[Sequence[int]], graph: networkx.DiGraph[int]) -> list[int]:
        """Return the duration of the longest chain of blocks from each block on."""
        tails = [0] * len(blocks)
        for number in reversed(list(networkx.topological_sort(graph))):
            after = max((tails[one] for one in graph.successors(number)), default=0)
            tails[number] = after + sum(self.durations[i] for i in blocks[number])
        return tails

    def crews(self, block: Sequence[int]) -> Iterator[dict[TurnId, int]]:
        """Yield the assignments of resources to those turns of a block that several actors can take."""
        turns = [t for t in dict.fromkeys(t for i in block for t in self.turns_of[i]) if t in self.of]
        for its in islice(combinations([self.of[turn] for turn in turns]), MOST_CREWS):
            yield dict(zip(turns, its, strict=True))

    def tried(self, block: Sequence[int]) -> _Appended | set[int]:
        """Return a block with the actors with which it ends earliest, or for all possible actors a resource that isn't free."""
        best: _Appended | None = None
        occupied = set[int]()
        for taking in self.crews(block):
            found = self.appended(block, taking)
            if isinstance(found, int):
                occupied.add(found)
            elif best is None or found.end < best.end:
                best = found
        return occupied if best is None else best

    def appended(self, block: Sequence[int], taking: Mapping[TurnId, int]) -> _Appended | int:
        """Return a block with the given actors after the blocks so far, or a resource that isn't free."""
        found = _Appended({}, {}, {}, taking, 0)
        for i in block:
            lasts = self.network.durations[i]
            for key in self.turns_of[i]:
                if key in taking and taking[key] != key[0]:
                    lasts = self.lasts[key, taking[key]].get(i, lasts)
            found.durations[i] = lasts
            befores = [edge for edge in self.into[i] if edge[0] in found.begins or edge[0] in self.begins]
            for key in self.turns_of[i]:
                resource = taking.get(key, key[0])
                turn = self.order.resources[key[0]].turns[key[1]]
                line = found.lines.setdefault(resource, self.lines[resource].copy())
                if key not in line.open:
                    if self.early(key, found):
                        return key[0]
                    if line.open and not (turn.reading and all(map(self.reading, line.open))):
                        return resource
                    line.open[key] = len(turn.members)
                    line.taken.append(key)
                ends = (*line.changed, *(() if turn.reading else line.read))
                befores += [(*end, *low) for low in turn.lows if low[0] == i for end in ends if end[0] != i]
            found.begins[i] = self.begin(i, befores, found)
            found.end = max(found.end, found.begins[i] + lasts)
            for key in self.turns_of[i]:
                line = found.lines[taking.get(key, key[0])]
                turn = self.order.resources[key[0]].turns[key[1]]
                line.open[key] -= 1
                if not line.open[key]:
                    del line.open[key]
                    if turn.reading:
                        line.read += turn.highs
                    else:
                        line.changed, line.read = turn.highs, ()
        return found

    def early(self, turn: TurnId, found: _Appended) -> bool:
        """Return whether a turn keeps the order of the sequence, and the turn before it hasn't begun."""
        resource, number = turn
        if resource not in self.kept or not number:
            return False
        before = self.order.resources[resource].turns[number - 1].members
        return not any(i in found.begins or i in self.begins for i in before)

    def reading(self, turn: TurnId) -> bool:
        """Return whether a turn only reads."""
        return self.order.resources[turn[0]].turns[turn[1]].reading

    def begin(self, i: int, befores: Sequence[Edge], found: _Appended) -> int:
        """Return the earliest begin of an activity after the events that must precede it."""
        begin = self.network.at[i] or 0
        for one, high, _, low in befores:
            its = found if one in found.begins else self
            at = its.begins[one] + (its.durations[one] if high == END else 0)
            begin = max(begin, at + self.network.least(one, high, i, low) - (found.durations[i] if low == END else 0))
        opens = [
            max(low, begin)
            for low, high in self.network.windows[i]
            if high is None or max(low, begin) + found.durations[i] <= high
        ]
        return min(opens, default=begin)

    def append(self, found: _Appended) -> None:
        """Append a block."""
        self.begins |= found.begins
        for i, lasts in found.durations.items():
            self.durations[i] = lasts
        for resource, line in found.lines.items():
            self.lines[resource] = line
