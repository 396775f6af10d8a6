"""Plan in, physical verdict out: the PyBullet world, robot, skills, perception and verification."""

from __future__ import annotations

import ctypes
import os
import sys


def _import_pybullet_quietly() -> None:
    """Import PyBullet without the build date that it prints to stdout, where results belong (JSON among them).

    It is C's stdout, which has a buffer of its own: that is emptied while the file descriptor leads nowhere.
    """
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        import pybullet  # noqa: F401

        ctypes.CDLL(None).fflush(None)
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


_import_pybullet_quietly()
