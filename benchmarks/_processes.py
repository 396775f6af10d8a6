"""Separate processes of benchmarks, and their CPU time."""

from __future__ import annotations

import os
import resource
import warnings
from collections.abc import Callable


def fork(run: Callable[[], int | None]) -> int:
    """Call a function in a separate process, which ends with the returned exit code; return the number of the process."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns about forks with threads
        child = os.fork()
    if child == 0:
        code = 1
        try:
            code = run() or 0
        finally:
            os._exit(code)
    return child


def silence() -> None:
    """Discard all further output of this process."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


def seconds_of_children() -> float:
    """Return the CPU seconds of the ended child processes."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
