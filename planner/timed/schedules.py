"""Schedules of activities: the order of the turns of each resource, the actor of each turn, and the begins of activities.

The first schedule has the order of the sequence or is made by list scheduling (`confab.planner.timed.listing`). Then a tabu
search exchanges turns on the critical path, together with all turns that must move then (Nowicki and Smutnicki, "A fast taboo
search algorithm for the job shop problem", Management Science 42, 1996). If OR-Tools is installed, CP-SAT improves the result
(`confab.planner.timed.cpsat`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice, pairwise
from math import inf
from time import perf_counter

import networkx

from confab.planner.timed.listing import Listing
from confab.planner.timed.network import Begins, Network, begins_after, earliest
from confab.planner.timed.order import BEGIN, END, Edge, Order, Resource, Turn, TurnId

Exchange = tuple[TurnId, TurnId | int]
"""A turn, and the turn with which it changes places or the number of the actor to which it moves."""
ROUNDS = 100
"""Maximum number of exchanges of turns without a better schedule."""
MOST_ARCS = 400_000
"""Maximum number of arcs that exchanges of turns process."""
MOST_UNIONS = 300
"""Maximum number of sets of exchangeable actors whose work gives a lower bound."""
TABU = 8
"""Number of further exchanges during which the search doesn't undo an exchange."""


@dataclass(frozen=True)
class ActorChoices:
    """The possible actors of turns.

    `of` contains the resources that can take a turn, the resource of the plan first. `lasts` contains the durations of the turn's
    activities for another resource.
    """

    of: Mapping[TurnId, tuple[int, ...]] = field(default_factory=dict)
    lasts: Mapping[tuple[TurnId, int], Mapping[int, int]] = field(default_factory=dict)


@dataclass
class CandidateSchedule:
    """The order of the turns of each resource, and the begins of activities that follow from this order.

    `slow` are the begins with the longest durations, or None if durations are certain.
    """

    turns: list[list[TurnId]]
    begins: Begins
    slow: Begins | None = None

    @property
    def makespan(self) -> int:
        """The end of the last activity."""
        return self.begins.makespan

    @property
    def cost(self) -> tuple[int, int, int]:
        """The value to be minimised: first the lateness, then the lateness with the longest durations, then the makespan."""
        return self.begins.late, 0 if self.slow is None else self.slow.late, self.begins.makespan


def shortest(
    order: Order, network: Network, choices: ActorChoices, until: float, bound: float = 0
) -> CandidateSchedule | None:
    """Return the best schedule that the greedy construction and exchanges of turns find, or None if no schedule is found.

    The schedule may be late (`Begins.late`). The search stops at a schedule that isn't late and whose makespan is the lower bound.

    Parameters
    ----------
    order : Order
    network : Network
        The network of `order`.
    choices : ActorChoices
    until : float
        The end of the search on the clock of `perf_counter`; 0 keeps the order of the sequence.
    bound : float
        A lower bound on the makespan; infinite if any schedule that isn't late is good enough.
    """
    search = _ScheduleSearch(order, network, choices)
    starts = [search.evaluated(turns) for turns in islice(search.starts(), None if until else 1)]
    found = [start for start in starts if start is not None]
    if not found:
        return None
    return search.improved(min(found, key=lambda one: one.cost), until, bound)


def rescheduled(
    order: Order,
    network: Network,
    choices: ActorChoices,
    turns: Sequence[Sequence[TurnId]],
    fixed: Container[TurnId],
    work: int,
    slow: tuple[Network, ActorChoices] | None = None,
) -> CandidateSchedule | None:
    """Return the best schedule that exchanges of turns find from a given order of turns, or None if the order has no schedule.

    Parameters
    ----------
    order : Order
    network : Network
    choices : ActorChoices
    turns : sequence of sequence of (int, int)
        The first order of the turns of each resource.
    fixed : container of (int, int)
        Turns that keep their actors and their places in the order.
    work : int
        Maximum number of arcs that the exchanges process.
    slow : (Network, ActorChoices), optional
        The network and the choices with the longest durations.
    """
    search = _ScheduleSearch(order, network, choices, fixed, work, slow)
    start = search.evaluated([list(line) for line in turns])
    return None if start is None else search.improved(start, inf, 0)


def turn_edges(order: Order, turns: Sequence[Sequence[TurnId]], apart: bool = False) -> Iterator[Edge]:
    """Yield the edges that order the turns of each resource; turns that only read a symbol may overlap.

    Events of a pool are ordered if one of them takes what another one gives, or all of them if `apart` is true.
    """
    for resource, line in enumerate(turns):
        yield from _line_edges(order, resource, line, apart)


def _line_edges(order: Order, resource: int, line: Sequence[TurnId], apart: bool) -> Iterator[Edge]:
    """Yield the edges that order the turns of one resource."""
    one = order.resources[resource]
    if one.pool is not None:
        numbers = [number for _, number in line]
        for before, after in (*one.pool.pairs(numbers), *(pairwise(numbers) if apart else ())):
            (high,), (low,) = one.turns[before].highs, one.turns[after].lows
            if before == after:
                yield high[0], END, low[0], BEGIN  # no event takes what it gives itself
            elif high[0] != low[0] or high[1] == END:
                yield (*high, *low)
        return
    last: Turn | None = None
    readers: list[Turn] = []
    for own, number in line:
        turn = order.resources[own].turns[number]
        for other in (*((last,) if last else ()), *(() if turn.reading else readers)):
            yield from ((i, high, j, low) for i, high in other.highs for j, low in turn.lows if i != j)
        if turn.reading:
            readers.append(turn)
        else:
            last, readers = turn, []


def durations_with(network: Network, choices: ActorChoices, turns: Sequence[Sequence[TurnId]]) -> list[int]:
    """Return the durations of activities if the actors take the given turns."""
    found = list(network.durations)
    for resource, line in enumerate(turns):
        for turn in line:
            if turn[0] != resource:
                for member, lasts in choices.lasts[turn, resource].items():
                    found[member] = lasts
    return found


class _ScheduleSearch:
    def __init__(
        self,
        order: Order,
        network: Network,
        choices: ActorChoices,
        fixed: Container[TurnId] = (),
        work: int = MOST_ARCS,
        slow: tuple[Network, ActorChoices] | None = None,
    ) -> None:
        self.order, self.network, self.choices, self.fixed, self.work = order, network, choices, fixed, work
        self.slow = slow
        self.listing = Listing(order, network, choices.of, choices.lasts)
        self.arcs_of: dict[tuple[int, tuple[TurnId, ...]], list[tuple[int, int, int]]] = {}

    @cached_property
    def arcs(self) -> list[list[tuple[int, int]]]:
        """The arcs of the network with the durations of the plan's actors."""
        return self.network.arcs(self.network.edges, self.network.durations)

    @cached_property
    def blocks(self) -> list[list[int]]:
        """The activities of each block (`confab.planner.timed.listing`)."""
        return self.listing.blocks()

    @cached_property
    def block_of(self) -> list[int]:
        """The block of each activity."""
        of = {i: number for number, block in enumerate(self.blocks) for i in block}
        return [of[i] for i in range(len(of))]

    @cached_property
    def before(self) -> networkx.DiGraph[int]:
        """The graph of the blocks that must precede others in every schedule."""
        return self.listing.graph(self.blocks)

    def evaluated(self, turns: list[list[TurnId]]) -> CandidateSchedule | None:
        """Return the schedule for an order of turns, or None if the order has no schedule."""
        begins = self.begins(turns, self.network, self.choices)
        slow = None if begins is None or self.slow is None else self.begins(turns, *self.slow)
        return None if begins is None else CandidateSchedule(turns, begins, slow)

    def begins(self, turns: list[list[TurnId]], network: Network, choices: ActorChoices) -> Begins | None:
        """Return the earliest begins for an order of turns, or None if the order has no schedule."""
        durations = durations_with(network, choices, turns)
        if network is not self.network or durations != network.durations:
            return earliest(network, turn_edges(self.order, turns, network.separation > 0), durations)
        arcs = list(self.arcs)
        for resource, line in enumerate(turns):
            for i, j, apart in self.line_arcs(resource, tuple(line)):
                arcs[i] = [*arcs[i], (j, apart)]
        return begins_after(network, durations, arcs)

    def line_arcs(self, resource: int, line: tuple[TurnId, ...]) -> list[tuple[int, int, int]]:
        """Return the arcs that order the turns of one resource, with the durations of the plan's actors."""
        found = self.arcs_of.get((resource, line))
        if found is None:
            edges = _line_edges(self.order, resource, line, self.network.separation > 0)
            its = enumerate(self.network.arcs(edges, self.network.durations))
            found = self.arcs_of[resource, line] = [(i, j, apart) for i, after in its for j, apart in after]
        return found

    def starts(self) -> Iterator[list[list[TurnId]]]:
        """Yield the orders of turns that lead to the first schedules: the order of the sequence, and list scheduling."""
        yield self.order.turns
        listed = self.listing.turns()
        if listed is not None:
            yield listed

    def improved(self, best: CandidateSchedule, until: float, bound: float) -> CandidateSchedule:
        """Return the best schedule after exchanges of turns on the critical path."""
        now, barren = best, 0
        left = (
            self.work // (1 + len(self.network.edges) + len(self.network.durations)) // (1 if self.slow is None else 2)
        )
        tabu: dict[Exchange, int] = {}
        step = 0
        while best.cost > (0, 0, bound) and barren < ROUNDS and left > 0 and perf_counter() < until:
            step += 1
            barren += 1
            options: list[tuple[tuple[int, int, int], int, Exchange, CandidateSchedule]] = []
            for exchange, undoing, turns in self.neighbours(now):
                left -= 1
                if left < 0 or perf_counter() > until:
                    break
                other = self.evaluated(turns)
                if other is None or (tabu.get(exchange, 0) > step and other.cost >= best.cost):
                    continue
                options.append((other.cost, len(options), undoing, other))
            options.sort(key=lambda option: option[:2])
            chosen = next((option for option in options if self.sequential(option[-1])), None)
            if chosen is None:
                break
            *_, undoing, now = chosen
            tabu[undoing] = step + TABU
            if now.cost < best.cost:
                best, barren = now, 0
        return best

    def neighbours(self, now: CandidateSchedule) -> Iterator[tuple[Exchange, Exchange, list[list[TurnId]]]]:
        """Yield the exchanges on the critical path, each with the exchange that undoes it and the orders of turns after it.

        An exchange swaps two neighbouring turns, alone or with the blocks that must move with one of them, or moves a turn to
        another actor.
        """
        tried = list[list[list[TurnId]]]()
        critical, positions = set(self.critical(now)), None if self.fixed else self.positions(now)
        for resource, line in enumerate(now.turns):
            for i, (one, other) in enumerate(pairwise(line)):
                if one in self.fixed or other in self.fixed:
                    continue
                if self.meets(one, critical) and self.meets(other, critical) and not self.precedes(one, other):
                    changes = [] if positions is None else list(self.shifted(now, positions, one, other))
                    for lines in (*changes, {resource: [*line[:i], other, one, *line[i + 2 :]]}):
                        new = self.replaced(now, lines)
                        if new not in tried:
                            tried.append(new)
                            yield (one, other), (other, one), new
            for turn in line:
                able = () if turn in self.fixed else self.choices.of.get(turn, ())
                if able and self.meets(turn, critical):
                    for target in able:
                        if target != resource:
                            for turns in self.moved(now, turn, resource, target):
                                yield (turn, target), (turn, resource), turns

    def precedes(self, one: TurnId, other: TurnId) -> bool:
        """Return whether the network alone requires that a turn precedes another one."""
        then = sum(1 << i for i in set(self.members(other)))
        return any(self.following[i] & then for i in self.members(one))

    @cached_property
    def following(self) -> list[int]:
        """The activities that must follow each activity, as bits; those that must follow through an earlier one may be left out."""
        found = [0] * len(self.arcs)
        for i in reversed(range(len(found))):
            for j, _ in self.arcs[i]:
                found[i] |= 1 << j | found[j]
        return found

    @cached_property
    def after(self) -> list[set[int]]:
        """The blocks that must follow each block."""
        return [networkx.descendants(self.before, block) for block in range(len(self.blocks))]

    @cached_property
    def earlier(self) -> list[set[int]]:
        """The blocks that must precede each block."""
        return [networkx.ancestors(self.before, block) for block in range(len(self.blocks))]

    def blocks_of(self, turn: TurnId) -> set[int]:
        """Return the blocks with activities of a turn."""
        return {self.block_of[i] for i in self.members(turn)}

    def members(self, turn: TurnId) -> tuple[int, ...]:
        """Return the activities of a turn."""
        return self.order.resources[turn[0]].turns[turn[1]].members

    def sequential(self, now: CandidateSchedule) -> bool:
        """Return whether the actors of the plan keep their turns, or the steps of the first level have a sequential order."""
        if all(turn[0] == resource for resource, line in enumerate(now.turns) for turn in line):
            return True
        of = [one.step.path[0] for one in self.order.activities]
        edges = (*self.network.edges, *turn_edges(self.order, now.turns))
        graph = networkx.DiGraph((of[i], of[j]) for i, _, j, _ in edges if of[i] != of[j])
        return networkx.is_directed_acyclic_graph(graph)

    def positions(self, now: CandidateSchedule) -> dict[int, int] | None:
        """Return the position of each block in a sequential order of the blocks, or None if they have no sequential order."""
        begins, graph, of = now.begins.begins, self.before.copy(), self.block_of
        graph.add_edges_from((of[i], of[j]) for i, _, j, _ in turn_edges(self.order, now.turns) if of[i] != of[j])
        first = [min(begins[i] for i in block) for block in self.blocks]
        with suppress(networkx.NetworkXUnfeasible):
            order = networkx.lexicographical_topological_sort(graph, first.__getitem__)
            return {block: place for place, block in enumerate(order)}
        return None

    def shifted(
        self, now: CandidateSchedule, positions: Mapping[int, int], one: TurnId, other: TurnId
    ) -> Iterator[dict[int, list[TurnId]]]:
        """Yield the changed orders if a turn moves before an earlier one, or the earlier one behind it, with all that must move."""
        for sign, bar, moving in ((1, one, other), (-1, other, one)):
            places = {block: sign * place for block, place in positions.items()}
            found = self.carried(now, places, bar, moving, self.earlier if sign > 0 else self.after)
            if found is None:
                continue
            (low, carried), lines = found, dict[int, list[TurnId]]()
            for resource, line in enumerate(now.turns):
                first = [min(self.blocks_of(turn), key=places.__getitem__) for turn in line]
                group = [0 if places[block] < low else sign if block in carried else 2 * sign for block in first]
                order = sorted(range(len(line)), key=group.__getitem__)
                if order != list(range(len(line))):
                    lines[resource] = [line[n] for n in order]
            if lines:
                yield lines

    def carried(
        self,
        now: CandidateSchedule,
        places: Mapping[int, int],
        bar: TurnId,
        moving: TurnId,
        earlier: Sequence[Container[int]],
    ) -> tuple[int, set[int]] | None:
        """Return the place to which a turn moves so that it precedes another one, and the blocks that move with it.

        These are the blocks that must precede its blocks, and the blocks of turns that would overlap with other turns otherwise.
        Return None if the other turn must precede some of these blocks.
        """
        kept, found, new = self.blocks_of(bar), set[int](), self.blocks_of(moving)
        low = min(map(places.__getitem__, kept))
        every = [[sorted(self.blocks_of(turn), key=places.__getitem__) for turn in line] for line in now.turns]
        several = [its for its in every if any(len(blocks) > 1 for blocks in its)]
        while new:
            found |= new
            if not found.isdisjoint(kept):
                return None
            new = {
                b
                for b, at in places.items()
                if at >= low and b not in found and any(b in earlier[one] for one in found)
            }
            for its in () if new else several:
                early = [blocks for blocks in its if blocks[0] in found]
                if not early:
                    continue
                least = min((p for b in its if (p := places[b[0]]) >= low and b[0] not in found), default=inf)
                new.update(b for blocks in early if places[blocks[0]] > least for b in blocks if b not in found)
                for blocks in its:
                    if places[blocks[0]] < low <= places[blocks[-1]] and not found.issuperset(blocks):
                        if kept.isdisjoint(blocks):
                            new.update(b for b in blocks if places[b] >= low and b not in found)
                        else:  # the turn moves before the whole turn that holds the other one
                            kept, low = kept.union(blocks), places[blocks[0]]
                            new = new or set(found)
        return low, found

    def moved(self, now: CandidateSchedule, turn: TurnId, resource: int, target: int) -> Iterator[list[list[TurnId]]]:
        """Yield the orders of turns in which a turn is moved to another actor.

        The turn is inserted at the position that its begin determines, or one position earlier or later.
        """

        def begin(one: TurnId) -> int:
            its = self.order.resources[one[0]].turns[one[1]]
            return min(now.begins.begins[member] for member in its.members)

        there = now.turns[target]
        first = max((i + 1 for i, one in enumerate(there) if one in self.fixed), default=0)
        place = max(sum(begin(one) <= begin(turn) for one in there), first)
        left = [one for one in now.turns[resource] if one != turn]
        for at in range(max(place - 1, first), min(place + 1, len(there)) + 1):
            yield self.replaced(now, {resource: left, target: [*there[:at], turn, *there[at:]]})

    def replaced(self, now: CandidateSchedule, lines: Mapping[int, list[TurnId]]) -> list[list[TurnId]]:
        return [lines.get(i, line) for i, line in enumerate(now.turns)]

    def meets(self, turn: TurnId, critical: set[int]) -> bool:
        """Return whether a turn has an activity on the critical path."""
        return not critical.isdisjoint(self.order.resources[turn[0]].turns[turn[1]].members)

    def critical(self, now: CandidateSchedule) -> list[int]:
        """Return the activities on the critical path, or on the path to the activity with the greatest lateness.

        The last activity comes first.
        """
        begins, network, choices = now.begins, self.network, self.choices
        if not begins.late and now.slow is not None and now.slow.late and self.slow is not None:
            begins, network, choices = now.slow, *self.slow
        durations = durations_with(network, choices, now.turns)
        ends = [b + d for b, d in zip(begins.begins, durations, strict=True)]
        found, current = list[int](), begins.latest
        if current < 0:
            current = max(range(len(ends)), key=lambda i: (network.at[i] is None, ends[i]))
        while current >= 0 and current not in found:
            found.append(current)
            current = begins.waits_for[current]
        return found


def least(order: Order, network: Network, choices: ActorChoices) -> int:
    """Return a lower bound on the makespan of any schedule of the activities with any possible actors.

    The bound is the greatest of three numbers: the longest chain of precedences, the work that only some actors can do divided by
    the number of these actors, after the earliest begin of this work, and the work that uses a pool divided by its stock.
    """
    lasts = list(network.durations)
    for its in choices.lasts.values():
        for member, other in its.items():
            lasts[member] = min(lasts[member], other)
    edges = network.edges
    if lasts != network.durations:  # a shorter activity could begin later and still end in order
        edges = tuple(edge for edge in edges if edge[3] == BEGIN)
    free = replace(network, edges=edges, tick=network.separation, latest=[()] * len(lasts))
    begins = earliest(free, (), lasts)
    bound = begins.makespan if begins is not None else 0
    work: dict[frozenset[int], int] = defaultdict(int)
    first: dict[frozenset[int], int] = {}
    for turn in chain.from_iterable(order.turns):
        able, seconds = frozenset(choices.of.get(turn, turn[:1])), _work(order, lasts, turn)
        if seconds and begins is not None:
            work[able] += seconds
            begin = min(begins.begins[m] for m in order.resources[turn[0]].turns[turn[1]].members)
            first[able] = min(first.get(able, begin), begin)
    bound = max([bound, *(_shared_work(order, lasts, one) for one in order.resources)])
    unions = list(work)
    for able in unions:  # the loop appends unions to the list
        within = [other for other in work if other <= able]
        bound = max(bound, min(first[one] for one in within) - (-sum(work[one] for one in within) // len(able)))
        more = dict.fromkeys(able | other for other in work if len(able) > 1 < len(other) and able & other)
        unions += [one for one in more if one not in unions][: max(MOST_UNIONS - len(unions), 0)]
    return bound


def _shared_work(order: Order, lasts: Sequence[int], resource: Resource) -> int:
    """Return the work of the activities that take units of a pool at their begin, divided by the stock.

    Return 0 if some activities give more units than they have taken, or keep units.
    """
    bounds = [0]
    for side in () if resource.pool is None else filter(None, (resource.pool.lower, resource.pool.upper)):
        taken, work = dict[int, int](), 0
        for turn, takes, gives in zip(resource.turns, side.takes, side.gives, strict=True):
            ((i, which),) = turn.lows
            if which == BEGIN and not gives:
                taken[i], work = takes, work + takes * lasts[i]
            elif which == BEGIN or gives - takes > taken.pop(i, 0):
                break
        else:
            bounds.append(-(-work // side.stock) if side.stock and not any(taken.values()) else 0)
    return max(bounds)


def _work(order: Order, lasts: Sequence[int], turn: TurnId) -> int:
    """Return the minimum duration of a turn.

    For an actor, the result is the sum of the durations of the actor's activities. For a symbol, the result is the longest duration
    of an activity that occupies the symbol throughout.
    """
    resource = order.resources[turn[0]]
    its = resource.turns[turn[1]]
    if resource.pool is not None:
        return 0
    if resource.actor is not None:
        return sum(lasts[m] for m in its.members if resource.actor in order.activities[m].actors)
    free = [m for m in its.members if order.activities[m].at is None]
    whole = [m for m in free if (m, BEGIN) in its.lows and (m, END) in its.highs]
    return 0 if its.reading else max((lasts[m] for m in whole), default=0)
