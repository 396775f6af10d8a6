"""The deadline of a call, stored in a context variable and therefore not passed as a parameter.

The caller sets the deadline by `within`; loops call `check` or read `left`. In nested blocks the earliest deadline applies, so
that a part of a call can be limited to a share of the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")
ROWS = 4096
"""Number of rows after which `checked` checks the deadline."""


class LimitError(Exception):
    """Raised if a limit was reached; the message names the limit, the work in progress, and how to raise the limit."""


class OutOfTimeError(LimitError):
    """Raised if the deadline has passed."""


@dataclass(frozen=True)
class Deadline:
    """The end of a call on the clock of `time.perf_counter`; `seconds` is the time limit of the call.

    >>> Deadline().left
    >>> Deadline.after(60.0).left > 50.0
    True
    """

    at: float = math.inf
    seconds: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Return the deadline that is a number of seconds from now; return no deadline for None."""
        return cls() if seconds is None else cls(perf_counter() + seconds, seconds)

    @property
    def left(self) -> float | None:
        """Remaining seconds, at least 0; None without a deadline."""
        return None if math.isinf(self.at) else max(0.0, self.at - perf_counter())

    def check(self, doing: str, ahead: float = 0.0) -> None:
        """Raise `OutOfTimeError` if the deadline has passed or is less than `ahead` seconds away.

        In the message, `doing` describes the work in progress.
        """
        if perf_counter() + ahead > self.at:
            raise OutOfTimeError(
                f"gave up after {round(self.seconds, 2) or self.seconds:g} s while {doing}; give more time"
            )


_current: ContextVar[Deadline] = ContextVar("deadline", default=Deadline())  # noqa: B039 - frozen


@contextmanager
def within(limit: Deadline | float | None) -> Iterator[Deadline]:
    """Apply a deadline, or a time limit in seconds, to a ``with`` block; provide the effective deadline.

    The effective deadline is the earlier of the given deadline and the current deadline.

    Examples
    --------
    >>> with within(60.0), within(90.0) as deadline:
    ...     deadline.seconds
    60.0
    """
    if isinstance(limit, str) or limit != limit:  # NaN would be no limit
        raise TypeError(f"within({limit!r}): wanted seconds as a number, e.g. 5, or None for no limit")
    new = limit if isinstance(limit, Deadline) else Deadline.after(limit)
    earliest = min(_current.get(), new, key=lambda one: one.at)
    token = _current.set(earliest)
    try:
        yield earliest
    finally:
        _current.reset(token)


@contextmanager
def overtime() -> Iterator[Deadline]:
    """Extend the deadline by 8 % of the time limit (at least 0.1 s), so that a result that was found in time can be checked.

    The deadline isn't extended further if it has already passed.

    Examples
    --------
    >>> with within(60.0), overtime() as deadline:
    ...     deadline.left > 64.0
    True
    """
    now = _current.get()
    later = now if math.isinf(now.at) else Deadline(now.at + max(0.08 * now.seconds, 0.1), now.seconds)
    token = _current.set(later)
    try:
        yield later
    finally:
        _current.reset(token)


def current() -> Deadline:
    """Return the current deadline."""
    return _current.get()


def checked(rows: Iterable[T], doing: str) -> Iterator[T]:
    """Yield the rows, and check the current deadline before every `ROWS` rows."""
    for count, row in enumerate(rows):
        if not count % ROWS:
            check(doing)
        yield row


MOST_LISTED = 5_000_000
"""Maximum number of items in one list; a million items take about 200 MB."""


def check_listed(count: int, items: str) -> None:
    """Raise `LimitError` if there are too many items for a list; `items` is their name."""
    if count > MOST_LISTED:
        raise LimitError(f"{count} {items} can't be listed, since more than {MOST_LISTED} need too much memory")


def check(doing: str, ahead: float = 0.0) -> None:
    """Raise `OutOfTimeError` if the current deadline has passed or is less than `ahead` seconds away."""
    _current.get().check(doing, ahead)
