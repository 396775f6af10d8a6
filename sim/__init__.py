"""Plan in, physical verdict out: the PyBullet world, robot, skills, perception and verification.

=============================================== =====================================================================
`sim.verify.verify(embodiment, initial, …)`     carries out a plan's primitives in a new world: a `Rollout`
`sim.verify.expectations(problem, steps)`       the states that it is held against
`sim.world.World(embodiment, initial, seed=0)`  the world itself, `observe()` and `execute(step)`, for closed loops
`sim.reach.reach(embodiment)`                   which places each hand reaches, by geometry alone
`sim.film.Film(path, steps, titles)`            records a world that it is given to watch
`sim.verdict.CODES`                             how a primitive can fail
=============================================== =====================================================================
"""

from __future__ import annotations

import os
from contextlib import suppress


def _import_pybullet_quietly() -> None:
    """Import PyBullet, if it is there, without the build date that its C code prints to stderr, where errors belong."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        with suppress(ModuleNotFoundError):  # reach is geometry; what needs physics says so itself
            import pybullet  # noqa: F401
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


_import_pybullet_quietly()
