"""Plan in, physical verdict out: the PyBullet world, robot, skills, perception and verification."""

from __future__ import annotations

import os


def _import_pybullet_quietly() -> None:
    """Import PyBullet without the build date that its C code prints to stderr, where progress and errors belong."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        import pybullet  # noqa: F401
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


_import_pybullet_quietly()
