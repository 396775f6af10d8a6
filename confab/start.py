"""Where the command `confab` begins: until everything is imported, Ctrl-C ends it in one line, too."""

from __future__ import annotations

import os
import signal
from typing import NoReturn


def main() -> NoReturn:
    """Import the command line and run it."""
    signal.signal(signal.SIGINT, _interrupted)
    from confab.cli import main as answer

    signal.signal(signal.SIGINT, signal.default_int_handler)
    answer()


def _interrupted(*_: object) -> None:
    """Say what `confab.cli` would say, which may not be there yet."""
    os.write(2, b"confab: interrupted; every file is as it was before, or whole\n")
    os._exit(130)
