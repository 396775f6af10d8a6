"""Where the command `confab` begins: Ctrl-C ends it in one line, too, until all is imported, and changes nothing after the end.

The end is quick: what a large scene took is given back by the system at once, and not object by object, which takes half a second.
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
    """End the process, with nothing lost that was to be written."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is said and done
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _interrupted(*_: object) -> None:
    """Say what `confab.cli` would say, which may not be there yet."""
    os.write(2, b"confab: interrupted; every file is as it was before, or whole\n")
    os._exit(130)
