"""The share of a call's effort that learned rules may waste: a wrong rule costs a bounded part of the same budget."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TypeVar

from confab.planner.hierarchical.workspace import Workspace

WASTE, FREE = 10, 500_000
"""Inverse of the share of expansions, and of effort, that unsuccessful rules may take, and the effort assumed before the call."""
Found = TypeVar("Found")


class OverspentError(Exception):
    """Following rules has wasted more effort than it may."""


class Allowance:
    """Counts the effort of rules in a call, and limits the part of it that leads to nothing.

    Attributes
    ----------
    spent : int
        Effort of matching rules, in states times operators.
    wasted_effort : float
        Effort of attempts that failed: of matching and of search.
    wasted_expansions : int
        Expansions of failed attempts on the most abstract level.
    """

    def __init__(self, space: Workspace) -> None:
        self.space = space
        self.spent, self.limit = 0, inf
        self.wasted_effort, self.wasted_expansions = 0.0, 0

    def left(self) -> float:
        """Return how much more effort may be wasted."""
        return (self.space.effort + self.spent + FREE) / WASTE - self.wasted_effort

    def ready(self) -> bool:
        """Return whether both more effort and more expansions may be wasted."""
        return self.wasted_expansions * WASTE <= self.space.expanded and self.left() > 0

    def spend(self, effort: int) -> None:
        """Count the effort of matching, and raise `OverspentError` at the limit of the current attempt."""
        self.spent += effort
        if self.spent > self.limit:
            raise OverspentError

    def bounded(self, attempt: Callable[[], Found | None]) -> Found | None:
        """Return the result of an attempt; None if it fails, or exceeds the allowance by matching alone.

        Attempts may be nested: the effort of an inner attempt doesn't count against the limit of the outer one.
        """
        outer, wasted, began = self.limit, self.wasted_effort, self.spent
        self.limit = min(outer, began + self.left())
        try:
            found = attempt()
        except OverspentError:
            found = None
        self.limit = outer + self.spent - began
        if not found:
            self.wasted_effort = max(self.wasted_effort, wasted + self.spent - began)
        return found
