"""Derived bits: disjunctions in conditions, and facts of defined situation types.

A derived bit is set if all bits of one of its alternatives are set. An opposite bit is set if the negated bit isn't
set. Bits that depend on each other form a part; most parts consist of one bit. Each part comes after the parts on which
it depends.

After a change, only the parts that depend on a changed bit are recalculated. A part with several bits is recalculated by counting
the missing bits of each alternative (Dowling and Gallier, Journal of Logic Programming 1, 1984). If a change affects many
alternatives, arrays recalculate all derived bits, because arrays are then faster. For example, the reachability of all places in a
large map depends on many alternatives.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

from confab.planner.grounded.derived_arrays import Bit, by_arrays, single, union

AT_ONCE, CALLS = 50, 60
"""Number of alternatives that arrays process while Python processes one, and cost of a layer as a number of alternatives.

The cost of a layer is the cost of the calls to the array library.
"""


@dataclass(frozen=True, eq=False)
class Derived:
    """The derived bits of a task, grouped into parts; each part comes after the parts that it depends on."""

    parts: tuple[tuple[Bit, ...], ...] = ()

    @cached_property
    def mask(self) -> int:
        """Mask of all derived bits."""
        return sum(bit.mask for part in self.parts for bit in part)

    @cached_property
    def ways(self) -> Sequence[tuple[Sequence[int], int]]:
        """The alternatives of all bits, each as the numbers of the required bits and the number of the resulting bit.

        For an alternative of an opposite bit, the list of required bits is empty.
        """
        return [
            ([] if bit.opposite else [low.bit_length() - 1 for low in single(way)], bit.mask.bit_length() - 1)
            for part in self.parts
            for bit in part
            for way in bit.alternatives
        ]

    @cached_property
    def effort(self) -> int:
        """Maximum number of alternatives examined after a change.

        If arrays are never used, alternatives of parts with a single bit don't count.
        """
        return min(sum(_ways(part) for part in self.parts if len(part) > 1 or self._few < self._all), self._few)

    def completed(self, state: int) -> int:
        """Return a state after computing all derived bits."""
        if self._few < self._all:
            return self._by_arrays(state)
        for number in range(len(self.parts)):
            state = self._worked_out(number, state)
        return state

    def after(self, state: int, before: int) -> int:
        """Return `state` after updating its derived bits, given the complete state `before` the changes."""
        users, woken = self._users, self._woken
        waiting: list[int] = []
        seen: set[int] = set()
        changed, left = state ^ before, self._few
        while True:
            changed &= self._needed
            while changed:
                low = changed & -changed
                changed ^= low
                left -= woken[low]
                if left < 0:
                    return self._by_arrays(state)
                came = bool(state & low)
                for number, mask, opposite in users[low]:
                    if mask and bool(state & mask) is (came is not opposite):
                        continue  # the bit already has the value that this change implies
                    if number not in seen:
                        seen.add(number)
                        heapq.heappush(waiting, number)
            if not waiting:
                return state
            new = self._worked_out(heapq.heappop(waiting), state)
            changed, state = new ^ state, new

    def fresh(self, state: int, bits: int) -> int:
        """Return a state after computing the derived bits in `bits`; other derived bits may be outdated."""
        support = self._support(bits & self.mask)
        if len(support) > self._few:
            return self._by_arrays(state)
        for number in support:
            state = self._worked_out(number, state)
        return state

    @cached_property
    def _all(self) -> int:
        """Number of alternatives of all bits."""
        return sum(map(_ways, self.parts))

    @cached_property
    def _few(self) -> int:
        """Maximum number of alternatives whose separate examination is faster than processing all alternatives by arrays."""
        return self._all // AT_ONCE + CALLS * len(self._layers)

    @cached_property
    def _layers(self) -> Sequence[Sequence[Bit]]:
        """The bits grouped into layers; a bit depends only on bits of earlier layers and of its part."""
        height: dict[int, int] = {}  # by bit
        found: list[list[Bit]] = []
        for part in self.parts:
            own = sum(bit.mask for bit in part)
            needed = union(way for bit in part for way in bit.alternatives) & self.mask & ~own
            mine = 1 + max((height[low] for low in single(needed)), default=-1)
            height |= {bit.mask: mine for bit in part}
            found += [[] for _ in range(mine + 1 - len(found))]
            found[mine] += part
        return found

    @cached_property
    def _by_arrays(self) -> Callable[[int], int]:
        return by_arrays(self._layers)

    def _worked_out(self, number: int, state: int) -> int:
        """Return a state after computing the derived bits of one part."""
        work = self._works.get(number)
        if work is None:
            work = self._works[number] = _work(self.parts[number])
        return work(state)

    @cached_property
    def _works(self) -> dict[int, Callable[[int], int]]:
        return {}

    def _support(self, bits: int) -> Sequence[int]:
        """Return the numbers of the parts that the given bits depend on, in ascending order."""
        known = self._supports.get(bits)
        if known is None:
            found: set[int] = set()
            waiting = [self._part_of[low] for low in single(bits)]
            while waiting:
                number = waiting.pop()
                if number not in found:
                    found.add(number)
                    needed = union(way for bit in self.parts[number] for way in bit.alternatives)
                    waiting += [self._part_of[low] for low in single(needed & self.mask)]
            known = self._supports[bits] = tuple(sorted(found))
        return known

    @cached_property
    def _supports(self) -> dict[int, Sequence[int]]:
        return {}

    @cached_property
    def _part_of(self) -> Mapping[int, int]:
        return {bit.mask: number for number, part in enumerate(self.parts) for bit in part}

    @cached_property
    def _users(self) -> Mapping[int, Sequence[tuple[int, int, bool]]]:
        """The parts that require a bit, by the bit.

        A part is represented by its number, its mask, and whether its bit is opposite. The mask is 0 for a part with several bits.
        """
        found: dict[int, dict[tuple[int, int, bool], None]] = defaultdict(dict)
        for number, part in enumerate(self.parts):
            own = sum(bit.mask for bit in part)
            entry = (number, own, part[0].opposite) if len(part) == 1 else (number, 0, False)
            needed = union(wanted for bit in part for wanted in bit.alternatives)
            for low in single(needed & ~own):
                found[low][entry] = None
        return {low: tuple(numbers) for low, numbers in found.items()}

    @cached_property
    def _woken(self) -> Mapping[int, int]:
        """The number of alternatives in the parts that require a bit, by the bit."""
        ways = [_ways(part) for part in self.parts]
        return {low: sum(ways[number] for number, _, _ in users) for low, users in self._users.items()}

    @cached_property
    def _needed(self) -> int:
        return sum(self._users)


def _work(part: tuple[Bit, ...]) -> Callable[[int], int]:
    """Return a function that computes the bits of one part in a state."""
    if len(part) == 1:
        return partial(_alone, part[0])
    return _by_counting(part)


def _ways(part: tuple[Bit, ...]) -> int:
    return sum(len(bit.alternatives) for bit in part)


def _alone(bit: Bit, state: int) -> int:
    for wanted in bit.alternatives:
        if state & wanted == wanted:
            return state & ~bit.mask if bit.opposite else state | bit.mask
    return state | bit.mask if bit.opposite else state & ~bit.mask


def _by_counting(part: tuple[Bit, ...]) -> Callable[[int], int]:
    own = sum(bit.mask for bit in part)
    ways: dict[int, list[tuple[tuple[int, ...], int]]] = defaultdict(list)  # alternatives by bits of other parts
    for bit in part:
        for way in bit.alternatives:
            ways[way & ~own].append((tuple(single(way & own)), bit.mask))

    def work(state: int) -> int:
        state &= ~own
        lacking: dict[int, list[list[int]]] = defaultdict(list)  # by bit: [missing bits, result] of alternatives
        waiting: list[int] = []
        for outside, of_these in ways.items():
            if state & outside == outside:
                for inside, mask in of_these:
                    if not inside:
                        waiting.append(mask)
                        continue
                    entry = [len(inside), mask]
                    for low in inside:
                        lacking[low].append(entry)
        while waiting:
            mask = waiting.pop()
            if state & mask:
                continue
            state |= mask
            for entry in lacking.get(mask, ()):
                entry[0] -= 1
                if not entry[0]:
                    waiting.append(entry[1])
        return state

    return work


def in_parts(bits: Mapping[int, Bit]) -> Derived:
    """Return derived bits grouped into parts, each after its dependencies.

    A part is a strongly connected component of the dependencies (Sharir, Computers & Mathematics with Applications 7, 1981). If an
    alternative of a bit requires the bit itself, the alternative is dropped. Otherwise the bit would stay set forever.
    """
    bits = {number: bit if bit.opposite else _grounded(bit) for number, bit in bits.items()}
    numbers = {bit.mask: number for number, bit in bits.items()}
    needs = {
        number: [numbers[low] for low in single(union(bit.alternatives)) if low in numbers]
        for number, bit in bits.items()
    }
    users: dict[int, list[int]] = {number: [] for number in bits}
    for number, needed in needs.items():
        for other in needed:
            users[other].append(number)
    seen: set[int] = set()
    order = [number for root in bits for number in _postorder(root, users, seen)]
    seen = set()
    parts = (tuple(map(bits.__getitem__, _postorder(root, needs, seen))) for root in reversed(order))
    return Derived(tuple(filter(None, parts)))


def _postorder(root: int, following: Mapping[int, Sequence[int]], seen: set[int]) -> list[int]:
    """Return the unseen numbers that are reached from a number, each after the numbers reached from it; add them to `seen`."""
    found: list[int] = []
    waiting = [(root, False)]
    while waiting:
        number, finished = waiting.pop()
        if finished:
            found.append(number)
        elif number not in seen:
            seen.add(number)
            waiting += [(number, True), *((other, False) for other in following[number])]
    return found


def _grounded(bit: Bit) -> Bit:
    return replace(bit, alternatives=tuple(way for way in bit.alternatives if not way & bit.mask))
