"""Start and end of the command `confab`. Ctrl-C ends the command with one line, even during imports.

After the output is complete, the process ignores Ctrl-C. At its end, the process doesn't free its objects one by one; this would
take half a second for a large scene.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys

TYPE_CHECKING = False  # see `confab/__init__.py`
if TYPE_CHECKING:
    from typing import NoReturn


def main() -> None:
    """Import the command line, and run the command."""
    signal.signal(signal.SIGINT, _interrupted)
    from confab.cli import main as answer

    try:
        answer(ending=os._exit)
    except SystemExit as end:  # otherwise the frames of the exception would keep all data of the process
        _leave(end.code if isinstance(end.code, int) else 1)


def _leave(code: int) -> NoReturn:
    """Call exit functions, flush the output, and end the process at once."""
    from contextlib import suppress

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the result is complete
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _interrupted(*_: object) -> None:
    """Print the message about an interrupt, and end the process, without `confab.cli`, whose import may be incomplete."""
    os.write(2, b"confab: interrupted; every file is unchanged or complete\n")
    os._exit(130)
