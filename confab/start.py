"""Where the command `confab` begins: Ctrl-C ends it in one line, too, until all is imported, and changes nothing after the end."""

from __future__ import annotations

import os
import signal
from typing import NoReturn


def main() -> NoReturn:
    """Import the command line and run it."""
    signal.signal(signal.SIGINT, _interrupted)
    from confab.cli import main as answer

    try:
        answer()
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is said and done


def _interrupted(*_: object) -> None:
    """Say what `confab.cli` would say, which may not be there yet."""
    os.write(2, b"confab: interrupted; every file is as it was before, or whole\n")
    os._exit(130)
