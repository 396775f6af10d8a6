"""The deadline of a call: set once around it, asked in every loop inside of it, and not handed down.

A call that shall end in time is made inside of `within`. Whatever loops there calls `check`, or asks for `left`. Blocks nest, and
the earliest deadline counts, so that a part of a call can be given a share of its time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from time import perf_counter


class LimitError(Exception):
    """A limit was reached; the message says which, during which work, and how to raise it."""


class OutOfTimeError(LimitError):
    """The deadline has passed."""


@dataclass(frozen=True)
class Deadline:
    """When a call ends, on the clock of `time.perf_counter`; `seconds` is the time that it was given.

    >>> Deadline().left
    >>> Deadline.after(60.0).left > 50.0
    True
    """

    at: float = math.inf
    seconds: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Return the deadline that many seconds from now; None: there is none."""
        return cls() if seconds is None else cls(perf_counter() + seconds, seconds)

    @property
    def left(self) -> float | None:
        """Seconds until then, not less than 0; None without a deadline."""
        return None if math.isinf(self.at) else max(0.0, self.at - perf_counter())

    def check(self, doing: str, ahead: float = 0.0) -> None:
        """Raise `OutOfTimeError` if the deadline has passed, or will have passed after a step that takes `ahead` seconds.

        `doing` says during which work.
        """
        if perf_counter() + ahead > self.at:
            raise OutOfTimeError(f"gave up after {self.seconds:g} s while {doing}; give more time (--time-limit)")


_current: ContextVar[Deadline] = ContextVar("deadline", default=Deadline())  # noqa: B039 - frozen


@contextmanager
def within(limit: Deadline | float | None) -> Iterator[Deadline]:
    """Let everything that is done in a block end by a deadline, given as such or in seconds from now.

    Yields the deadline that counts: this one, or an earlier one that holds already.

    Examples
    --------
    >>> with within(60.0), within(90.0) as deadline:
    ...     deadline.seconds
    60.0
    """
    new = limit if isinstance(limit, Deadline) else Deadline.after(limit)
    earliest = min(_current.get(), new, key=lambda one: one.at)
    token = _current.set(earliest)
    try:
        yield earliest
    finally:
        _current.reset(token)


@contextmanager
def overtime(share: float = 0.1) -> Iterator[Deadline]:
    """Let a result that was found in time be checked in a share of the time more, and in a tenth of a second at least.

    Examples
    --------
    >>> with within(60.0), overtime() as deadline:
    ...     deadline.left > 65.0
    True
    """
    now = _current.get()
    later = (
        now
        if math.isinf(now.at)
        else Deadline(max(now.at, perf_counter()) + max(share * now.seconds, 0.1), now.seconds)
    )
    token = _current.set(later)
    try:
        yield later
    finally:
        _current.reset(token)


def current() -> Deadline:
    """Return the deadline that holds here."""
    return _current.get()


def check(doing: str, ahead: float = 0.0) -> None:
    """Raise `OutOfTimeError` if the deadline that holds here has passed, or will have passed in `ahead` seconds."""
    _current.get().check(doing, ahead)
