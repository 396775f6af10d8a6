"""The relaxed-plan heuristic of many states at once, by whole arrays.

`confab.planner.grounded.hff` follows what is reached, bit by bit and state by state. Here each layer looks at all that every
operator
needs and sets, of all states in a few calls of NumPy, until no cost falls: ten states take hardly longer than one. For tasks
of which little is reached in many layers that is more work: `effort` counts both at the initial state.

cost      of a bit: of the cheapest operator that sets it, one plus the costs of what that needs; zero where it is set
column    a state; rows are bits or operators, those with the most setters or needs first, so that each step is a slice
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from confab.planner.grounded.hff import Evaluation
from confab.planner.grounded.joins import Ints, ranges
from confab.planner.grounded.task import Grouped, Task

NEVER, MOST = 1 << 24, 1 << 18
"""The cost of a bit that isn't reached, and the highest of one that is: eight of them, added up, are still told apart."""
WIDTH, ELEMENTS = 32, 4_000_000
"""States at once, at most; and numbers of one array, which has to fit into memory."""
AT_ONCE, CALLS, PICKING = 35, 800, 3000
"""In the time in which Python follows one bit, arrays look at so many; the calls of a layer, and of picking plans, in bits."""

Costs: TypeAlias = NDArray[np.int32]
EvaluateMany: TypeAlias = Callable[[Sequence[int]], list[Evaluation]]


@dataclass(frozen=True)
class Effort:
    """The work of relaxing states, in bits: `followed` for one, or by arrays `calls`, and `each` for each of up to `width`."""

    followed: int
    calls: int
    each: int
    width: int

    def by_arrays(self, states: int) -> int:
        """Return the work of relaxing so many states at once."""
        return self.calls + states * self.each


def effort(task: Task) -> Effort:
    """Return the work of relaxing the initial state."""
    needs, starts = _with_always(task)
    known = np.append(_flags([task.initial], task.size)[0], True)
    goal = np.append(_flags([task.goal], task.size)[0], False)
    sizes = np.diff(task.needs.starts) + np.diff(task.adds.starts)
    layers, ready, before = 2, np.zeros(len(sizes), bool), -1
    if not sizes.sum():  # no operators, or none that need or add anything
        return Effort(1, CALLS, 1, 1)
    while not known[goal].all() and known.sum() != before:
        before = known.sum()
        layers += 1
        ready = np.logical_and.reduceat(known[needs], starts)
        known[task.adds.items[np.repeat(ready, np.diff(task.adds.starts))]] = True
    total = int(sizes.sum())
    width = min(WIDTH, max(1, ELEMENTS // total))
    return Effort(1 + int(sizes[ready].sum()), PICKING + layers * CALLS, layers * (total // AT_ONCE + 1), width)


class _Fold:
    """Combines the values of each group: first of up to eight members at a time, then what came of these, and so on."""

    def __init__(self, groups: Grouped, most: int = 8) -> None:
        self.rounds: list[
            list[Ints]
        ] = []  # of each: the first members of all groups, the second of those that have one, …
        while True:
            sizes = np.diff(groups.starts)
            pieces = -(-sizes // most)
            ends = np.cumsum(pieces)
            if not len(sizes) or pieces.max() <= 1:
                break
            place = np.arange(ends[-1]) - np.repeat(ends - pieces, pieces)
            begin = np.repeat(groups.starts[:-1], pieces) + most * place
            row = self._round(Grouped(np.append(begin, groups.starts[-1]), groups.items))
            groups = Grouped(np.concatenate([[0], ends]), row)
        self.row = self._round(groups)

    def _round(self, groups: Grouped) -> Ints:
        """Add a round that combines all members of groups; return the row in which each group's value comes."""
        sizes = np.diff(groups.starts)
        order = np.argsort(-sizes, kind="stable")
        starts, falling = groups.starts[:-1][order], -sizes[order]
        longest = int(sizes.max()) if len(sizes) else 0
        self.rounds.append([groups.items[starts[: int(np.searchsorted(falling, -j))] + j] for j in range(longest)])
        row = np.empty(len(order), np.int64)
        row[order] = np.arange(len(order))
        return row

    def __call__(self, combine: np.ufunc, values: Costs) -> Costs:
        """Return the combined values of each group, none of which is empty, in the order of `row`."""
        for number, (first, *others) in enumerate(self.rounds):
            if number:
                _bounded(values)
            take = values.take  # np.take takes longer to come there
            values = take(first, 0)
            spare = np.empty_like(values)
            for members in others:
                part, new = values[: len(members)], spare[: len(members)]
                take(members, 0, new, "clip")
                combine(part, new, out=part)
        return values


class _Layers:
    """The arrays of a task: operators by what they need, bits by what sets them, both in rows."""

    def __init__(self, task: Task) -> None:
        needs, begin = _with_always(task)
        self.task, self.size, relaxed = task, task.size, len(task.owners)
        setter = np.repeat(np.arange(relaxed), np.diff(task.adds.starts))
        order = np.argsort(task.adds.items, kind="stable")
        setter, bits = setter[order], task.adds.items[order]
        settable, first = np.unique(bits, return_index=True)
        by_needs = _Fold(Grouped(np.append(begin, len(needs)), np.arange(len(needs))))
        self.row_of_operator = by_needs.row
        setters = Grouped(np.append(first, len(bits)), by_needs.row[setter])
        self.cheapest = _Fold(setters)
        # rows of bits: those that are set by some operator, in the order of their fold, then the others, then what is always true
        others = np.setdiff1d(np.arange(task.size + 1), settable)
        self.bits = np.concatenate([settable[np.argsort(self.cheapest.row)], others])
        self.row_of_bit = np.empty(task.size + 1, np.int64)
        self.row_of_bit[self.bits] = np.arange(task.size + 1)
        self.set = len(settable)
        self.needed = _Fold(Grouped(np.append(begin, len(needs)), self.row_of_bit[needs]))
        operator = np.argsort(by_needs.row)  # of each row
        self.step = np.where(np.array(task.owners)[operator] < 0, 0, 1).astype(np.int32)[:, None]
        self.owner, self.operator = np.array(task.owners)[operator], operator
        self.needs = Grouped(task.needs.starts, self.row_of_bit[task.needs.items])
        by_row = np.argsort(self.cheapest.row)
        sizes = np.diff(setters.starts)[by_row]
        self.setters = Grouped(
            np.concatenate([[0], np.cumsum(sizes)]), setters.items[ranges(setters.starts[by_row], sizes)]
        )
        self.goal = self.row_of_bit[np.flatnonzero(_flags([task.goal], task.size)[0])]

    def relaxed(self, states: Sequence[int]) -> tuple[Costs, Costs, NDArray[np.bool_]]:
        """Return what each bit costs, what each operator costs (both by rows), and by operators and states which are applicable."""
        flags = np.concatenate([_flags(states, self.size), np.ones((len(states), 1), bool)], axis=1)
        costs = np.where(flags.T[self.bits], np.int32(0), np.int32(NEVER))
        applicable: NDArray[np.bool_] | None = None
        settable = costs[: self.set]
        while True:
            spent = self.needed(np.add, costs)
            if applicable is None:
                applicable = spent[self.row_of_operator[: len(self.task)]] == 0
            spent += self.step
            new = self.cheapest(np.minimum, spent) if self.set else settable
            np.minimum(_bounded(new), settable, out=new)
            if np.array_equal(new, settable):
                return costs, spent, applicable
            settable[:] = new

    def plans(self, costs: Costs, spent: Costs) -> tuple[Ints, Ints]:
        """Return the operators of the relaxed plans and whose they are: state by state, the cheapest first."""
        width, found = costs.shape[1], []
        seen = np.zeros(costs.shape, bool).ravel()
        flat = (self.goal[:, None] * width + np.arange(width)).ravel()
        while len(flat):
            flat = flat[(costs.ravel()[flat] > 0) & ~seen[flat]]
            flat = np.unique(flat)
            if not len(flat):
                break
            seen[flat] = True
            rows, columns = np.divmod(flat, width)
            counts = np.diff(self.setters.starts)[rows]
            there = self.setters.items[ranges(self.setters.starts[rows], counts)]
            paid = spent[there, np.repeat(columns, counts)]
            begin = np.cumsum(counts) - counts
            least = np.minimum.reduceat(paid, begin)
            at = np.flatnonzero(paid == np.repeat(least, counts))
            chosen = there[at[np.searchsorted(at, begin)]]
            found.append((chosen, columns, costs[rows, columns]))
            operator = self.operator[chosen]
            counts = np.diff(self.needs.starts)[operator]
            needs = self.needs.items[ranges(self.needs.starts[operator], counts)]
            flat = needs * width + np.repeat(columns, counts)
        if not found:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        chosen, columns, cost = (np.concatenate(parts) for parts in zip(*found, strict=True))
        owner = self.owner[chosen]
        owned = owner >= 0
        owner, columns, cost = owner[owned], columns[owned], cost[owned]
        order = np.lexsort((cost, owner, columns))
        owner, columns, cost = owner[order], columns[order], cost[order]
        new = np.ones(len(owner), bool)
        new[1:] = (owner[1:] != owner[:-1]) | (columns[1:] != columns[:-1])
        owner, columns, cost = owner[new], columns[new], cost[new]
        order = np.lexsort((owner, cost, columns))
        return owner[order], columns[order]


def heuristic(task: Task) -> EvaluateMany:
    """Return h_FF of a task, as a function of states."""
    layers = _Layers(task)

    def evaluate(states: Sequence[int]) -> list[Evaluation]:
        costs, spent, applicable = layers.relaxed(states)
        solvable = (costs[layers.goal] < NEVER).all(axis=0)
        alive = np.flatnonzero(solvable)
        operators, columns = layers.plans(costs[:, alive], spent[:, alive])
        parts = np.split(operators, np.searchsorted(columns, np.arange(1, len(alive))))
        which, possible = np.nonzero(applicable.T)
        there = np.split(possible, np.searchsorted(which, np.arange(1, len(states))))
        found: list[Evaluation] = [None] * len(states)
        for plan, k in zip(parts, alive.tolist(), strict=False):
            found[k] = len(plan), plan.tolist(), there[k].tolist()
        return found

    return evaluate


def _bounded(costs: Costs) -> Costs:
    """Keep costs apart, in place: those of what is reached from those of what isn't."""
    np.minimum(costs, MOST, out=costs, where=costs < NEVER)
    return np.minimum(costs, NEVER, out=costs)


def _flags(states: Sequence[int], size: int) -> NDArray[np.bool_]:
    number = (size + 7) // 8
    packed = np.frombuffer(b"".join(state.to_bytes(number, "little") for state in states), np.uint8)
    return np.unpackbits(packed.reshape(len(states), number), axis=1, count=size, bitorder="little").view(bool)


def _with_always(task: Task) -> tuple[Ints, Ints]:
    """Return what each relaxed operator needs, at least the bit behind all others, which is always true; and where each begins."""
    grouped: Grouped = task.needs
    counts = np.diff(grouped.starts)
    items = np.insert(grouped.items, grouped.starts[:-1][counts == 0], task.size)
    ends = np.cumsum(np.maximum(counts, 1))
    return items, ends - np.maximum(counts, 1)
