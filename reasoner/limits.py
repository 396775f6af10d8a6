"""Limits that end what would take too long: one deadline for a whole command, and the error that says which limit came first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import monotonic


class LimitError(RuntimeError):
    """A limit came first; the message says which, at what, and how to raise it."""


@dataclass(frozen=True)
class Deadline:
    """When a call ends, from its first step to its last.

    >>> Deadline().left
    >>> Deadline.after(60.0).left > 50.0
    True
    """

    at: float = math.inf
    seconds: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Return the deadline so many seconds from now; None: there is none."""
        return cls() if seconds is None else cls(monotonic() + seconds, seconds)

    @property
    def left(self) -> float | None:
        """Seconds until then, not less than 0; None without a deadline."""
        return None if math.isinf(self.at) else max(0.0, self.at - monotonic())

    def check(self, doing: str) -> None:
        """Raise `LimitError` if the time is over; `doing` says at what it was."""
        if monotonic() > self.at:
            raise LimitError(f"gave up after {self.seconds:g} s while {doing}; give more time (--time-limit)")
