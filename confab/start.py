"""Start of the command `confab`: Ctrl-C ends it with one line even during imports, and has no effect after the end.

The process ends without freeing its objects one by one, which takes half a second for a large scene.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from contextlib import suppress
from typing import NoReturn


def main() -> None:
    """Import the command line and run it."""
    signal.signal(signal.SIGINT, _interrupted)
    from confab.cli import main as answer

    try:
        answer(ending=os._exit)
    except SystemExit as end:  # whose frames hold all that was read
        _leave(end.code if isinstance(end.code, int) else 1)


def _leave(code: int) -> NoReturn:
    """End the process after everything has been written."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # all output is complete
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _interrupted(*_: object) -> None:
    """Print the message that `confab.cli` would print, which may not be imported yet."""
    os.write(2, b"confab: interrupted; every file is as it was before, or whole\n")
    os._exit(130)
