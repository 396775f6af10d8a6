"""Physical verification of plans: the PyBullet world, robot, skills and perception.

====================================================== ==============================================================
`confab.sim.verify.verify(embodiment, initial, …)`     executes a plan's primitives in a new world; returns a `Rollout`
`confab.sim.verify.expectations(problem, steps)`       the states that the rollout is compared with
`confab.sim.world.PhysicsWorld(embodiment, initial, seed=0)`  the world itself, `observe()` and `execute(step)`, for closed loops
`confab.sim.reach.reach(embodiment)`                   the places within reach of each hand, by geometry alone
`confab.sim.film.Film(path, steps, titles)`            records a rollout as a film
`confab.sim.verdict.CODES`                             the failure codes of a primitive
====================================================== ==============================================================
"""

from __future__ import annotations

import os
from contextlib import suppress


def _import_pybullet_quietly() -> None:
    """Import PyBullet, if it is installed, and suppress the build date that its C code prints to stderr."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        with suppress(ModuleNotFoundError):  # `sim.reach` works without PyBullet; most other modules don't
            import pybullet  # noqa: F401
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


_import_pybullet_quietly()
