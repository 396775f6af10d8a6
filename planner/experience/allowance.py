"""Limit on wasted effort: unsuccessful rules may use only a bounded share of a call's search effort."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TypeVar

from confab.planner.hierarchical.workspace import Workspace

WASTE, FREE = 10, 500_000
"""Unsuccessful rules may use 1 / `WASTE` of the expansions, and 1 / `WASTE` of the sum of all effort and `FREE`."""
Found = TypeVar("Found")


class OverspentError(Exception):
    """The rules have wasted more effort than the limit allows."""


class Allowance:
    """The count of the effort of rules in a call, with a limit on the effort of unsuccessful rules.

    Attributes
    ----------
    spent : int
        Effort of matching rules; the unit is one operator in one state.
    wasted_effort : float
        Effort of failed attempts, for matching rules and for searches.
    wasted_expansions : int
        Expansions of failed attempts on the most abstract level.
    """

    def __init__(self, space: Workspace) -> None:
        self.space = space
        self.spent, self.limit = 0, inf
        self.wasted_effort, self.wasted_expansions = 0.0, 0

    def left(self) -> float:
        """Return the remaining effort that unsuccessful rules may use."""
        return (self.space.effort + self.spent + FREE) / WASTE - self.wasted_effort

    def ready(self) -> bool:
        """Return whether the limits of effort and of expansions both allow another attempt."""
        return self.wasted_expansions * WASTE <= self.space.expanded and self.left() > 0

    def spend(self, effort: int) -> None:
        """Count the effort of matching rules; raise `OverspentError` at the limit of the current attempt."""
        self.spent += effort
        if self.spent > self.limit:
            raise OverspentError

    def bounded(self, attempt: Callable[[], Found | None]) -> Found | None:
        """Return the result of an attempt, or None if the attempt fails, or if the matching of rules exceeds the limit.

        Attempts may be nested: the effort of an inner attempt doesn't count towards the limit of the outer attempt.
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
