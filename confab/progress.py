"""Progress on stderr: a bar with the remaining time in a terminal, and occasional lines in other outputs."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from time import perf_counter
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from rich.progress import Progress

log = logging.getLogger(__name__)
PATIENCE = 1.0
"""Seconds before a progress bar appears."""

Advance: TypeAlias = Callable[[str, int], None]
"""A function that receives the present activity and the amount of work done since the last call."""


@contextmanager
def progress(what: str, total: int | None = None) -> Iterator[Advance]:
    """Show a progress bar for work that takes more than `PATIENCE` seconds; yield the function that advances the bar.

    Parameters
    ----------
    what : str
        The activity at the beginning.
    total : int, optional
        The total amount of work. If the amount is unknown, the bar shows only the elapsed time.
    """
    begin = perf_counter()
    if quiet() or not sys.stderr.isatty() or log.isEnabledFor(logging.DEBUG):
        try:
            yield lambda _, __: None
        finally:
            log.debug("confab: %s took %.2f s", what, perf_counter() - begin)
        return
    bar = progress_bar()
    task = bar.add_task(what, total=total)
    timer = Timer(PATIENCE, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda now, more: bar.update(task, description=now, advance=more)
    finally:
        timer.cancel()
        timer.join()
        bar.stop()


def progress_bar() -> Progress:
    """Return a rich progress bar on stderr, which is erased when the bar stops."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    left = TextColumn("left:"), TimeRemainingColumn()
    columns = (TextColumn("{task.description:<44}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), *left)
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=quiet() or not console.is_terminal)


def announce(what: str) -> None:
    """If stderr isn't a terminal, print the present activity as a line on stderr."""
    if not quiet() and not sys.stderr.isatty():
        print(f"confab: {what}", file=sys.stderr, flush=True)


def be_verbose() -> None:
    """Print log messages and the duration of each stage on stderr."""
    spoken = logging.getLogger("confab")
    spoken.setLevel(logging.DEBUG)
    if not spoken.handlers:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(message)s"))
        spoken.addHandler(handler)
        spoken.propagate = False


def quiet() -> bool:
    """Return whether the option ``--quiet`` suppresses all output except results and errors."""
    return not log.isEnabledFor(logging.WARNING)
