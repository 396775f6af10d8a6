"""The transitive closure of a relation."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import TypeVar

T = TypeVar("T", bound=Hashable)


def closure(first: Iterable[T], following: Callable[[T], Iterable[T]]) -> set[T]:
    """Return some items and all items that follow from them, directly or indirectly.

    >>> sorted(closure([6], lambda n: [n // 2, n // 3]))
    [0, 1, 2, 3, 6]
    """
    found = set(first)
    waiting = [*found]
    while waiting:
        waiting += (more := {*following(waiting.pop())} - found)
        found |= more
    return found
