"""Bits that follow from other bits: a disjunction that some condition asks for, a fact of a situation type that is defined.

part          bits that need each other, mostly one; what a part needs besides stands in the parts before it
alternatives  a bit is set where all bits of one of its alternatives are; an opposite where the one bit that it names isn't

After a change only the parts are looked at that need a bit which changed. A part of several bits is worked out from nothing, by
counting what each alternative still lacks: Dowling and Gallier, Journal of Logic Programming 1 (1984).
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache


@dataclass(frozen=True, eq=False)
class Bit:
    """A bit, as a mask, that is set where a state has all bits of one of the masks; `opposite`: where it has none of them."""

    mask: int
    alternatives: tuple[int, ...]
    opposite: bool = False


@dataclass(frozen=True, eq=False)
class Derived:
    """The bits of a task that follow from others, in parts; each comes behind those that it needs."""

    parts: tuple[tuple[Bit, ...], ...] = ()

    @cached_property
    def mask(self) -> int:
        """All bits that follow from others."""
        return sum(bit.mask for part in self.parts for bit in part)

    def completed(self, state: int) -> int:
        """Return a state with all these bits as they have to be."""
        for part in self.parts:
            state = _worked_out(part, state)
        return state

    def after(self, state: int, before: int) -> int:
        """Return a state, made by changes from another one that was complete, with these bits as they have to be."""
        users = self._users
        waiting: list[int] = []
        seen: set[int] = set()

        def wake(changed: int) -> None:
            changed &= self._needed
            while changed:
                low = changed & -changed
                changed ^= low
                came = bool(state & low)
                for number, mask, opposite in users[low]:
                    if mask and bool(state & mask) is (came is not opposite):
                        continue  # it is already what this change could make of it
                    if number not in seen:
                        seen.add(number)
                        heapq.heappush(waiting, number)

        wake(state ^ before)
        while waiting:
            number = heapq.heappop(waiting)
            new = _worked_out(self.parts[number], state)
            if new != state:
                changed, state = new ^ state, new
                wake(changed)
        return state

    def fresh(self, state: int, bits: int) -> int:
        """Return a state with some of these bits as they have to be; the others may be those of another state."""
        for number in self._support(bits & self.mask):
            state = _worked_out(self.parts[number], state)
        return state

    def _support(self, bits: int) -> Sequence[int]:
        """Return the parts on which bits depend, in order."""
        known = self._supports.get(bits)
        if known is None:
            found: set[int] = set()
            waiting = [self._part_of[low] for low in _single(bits)]
            while waiting:
                number = waiting.pop()
                if number not in found:
                    found.add(number)
                    needed = _union(way for bit in self.parts[number] for way in bit.alternatives)
                    waiting += [self._part_of[low] for low in _single(needed & self.mask)]
            known = self._supports[bits] = tuple(sorted(found))
        return known

    @cached_property
    def _supports(self) -> dict[int, Sequence[int]]:
        return {}

    @cached_property
    def _part_of(self) -> Mapping[int, int]:
        return {bit.mask: number for number, part in enumerate(self.parts) for bit in part}

    def renamed(self, small: Callable[[int], int]) -> Derived:
        """Return the same over other bits."""
        return Derived(
            tuple(
                tuple(Bit(small(bit.mask), tuple(map(small, bit.alternatives)), bit.opposite) for bit in part)
                for part in self.parts
            )
        )

    @cached_property
    def _users(self) -> Mapping[int, Sequence[tuple[int, int, bool]]]:
        """For each bit that is needed, the parts that need it and aren't its own: of a part of one bit, that bit and its sense."""
        found: dict[int, dict[tuple[int, int, bool], None]] = defaultdict(dict)
        for number, part in enumerate(self.parts):
            own = sum(bit.mask for bit in part)
            entry = (number, own, part[0].opposite) if len(part) == 1 else (number, 0, False)
            needed = 0
            for bit in part:
                for wanted in bit.alternatives:
                    needed |= wanted
            for low in _single(needed & ~own):
                found[low][entry] = None
        return {low: tuple(numbers) for low, numbers in found.items()}

    @cached_property
    def _needed(self) -> int:
        return sum(self._users)


def _single(mask: int) -> Iterable[int]:
    while mask:
        low = mask & -mask
        mask ^= low
        yield low


def _worked_out(part: tuple[Bit, ...], state: int) -> int:
    """Return a state with the bits of one part as they have to be."""
    if len(part) == 1:
        bit = part[0]
        for wanted in bit.alternatives:
            if state & wanted == wanted:
                return state & ~bit.mask if bit.opposite else state | bit.mask
        return state | bit.mask if bit.opposite else state & ~bit.mask
    own, ways = _circular(part)
    state &= ~own
    lacking: dict[int, list[list[int]]] = defaultdict(list)  # by bit of the part: how many are lacking, and of what
    waiting: list[int] = []
    for outside, inside, mask in ways:
        if state & outside == outside:
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


@lru_cache(maxsize=4096)
def _circular(part: tuple[Bit, ...]) -> tuple[int, list[tuple[int, tuple[int, ...], int]]]:
    """Return the bits of a part, and each alternative as what it needs of other parts, and of this one, for which bit."""
    own = sum(bit.mask for bit in part)
    return own, [(way & ~own, tuple(_single(way & own)), bit.mask) for bit in part for way in bit.alternatives]


def in_parts(bits: Mapping[int, Bit]) -> Derived:
    """Return bits, by number, in parts that need each other, each behind what it needs (Tarjan, SIAM J. Computing 1, 1972)."""
    numbers = {bit.mask: number for number, bit in bits.items()}
    needs = {
        number: [numbers[low] for low in _single(_union(bit.alternatives)) if low in numbers]
        for number, bit in bits.items()
    }
    index: dict[int, int] = {}
    lowest: dict[int, int] = {}
    stack: list[int] = []
    on_stack: set[int] = set()
    parts: list[tuple[Bit, ...]] = []
    for root in bits:
        if root in index:
            continue
        work = [(root, iter(needs[root]))]
        index[root] = lowest[root] = len(index)
        stack.append(root)
        on_stack.add(root)
        while work:
            number, rest = work[-1]
            for other in rest:
                if other not in index:
                    index[other] = lowest[other] = len(index)
                    stack.append(other)
                    on_stack.add(other)
                    work.append((other, iter(needs[other])))
                    break
                if other in on_stack:
                    lowest[number] = min(lowest[number], index[other])
            else:
                work.pop()
                if work:
                    lowest[work[-1][0]] = min(lowest[work[-1][0]], lowest[number])
                if lowest[number] == index[number]:
                    part = []
                    while True:
                        member = stack.pop()
                        on_stack.discard(member)
                        part.append(bits[member])
                        if member == number:
                            break
                    parts.append(tuple(part))
    return Derived(tuple(parts))


def _union(masks: Iterable[int]) -> int:
    found = 0
    for mask in masks:
        found |= mask
    return found
