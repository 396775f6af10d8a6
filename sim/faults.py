"""Faults that can be planted in a world before or while a plan is carried out, to see that verification finds them.

A fault is a function that takes a world that isn't running yet; give it to `verify` as `prepare`. Only here is a running world
interfered with.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pybullet

if TYPE_CHECKING:
    from sim.world import World

Fault = Callable[["World"], None]


def hidden_wall(before: str, distance: float = 0.075, size: tuple[float, float, float] = (0.02, 0.12, 0.16)) -> Fault:
    """Return a fault: a wall that the robot doesn't perceive, `distance` metres on the robot's side of an object.

    `size` is its extent in metres along the line from robot to object, across it, and up.
    """

    def plant(world: World) -> None:
        """Put the wall up."""
        _, target = world.truth(before)
        base = np.array(world.embodiment.robots[0].position)
        away = (target - base)[:2] / np.linalg.norm((target - base)[:2])
        half = [extent / 2 for extent in size]
        wall = pybullet.createMultiBody(
            0,
            pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=world.client),
            basePosition=[*(target[:2] - distance * away).tolist(), float(target[2]) + half[2]],
            baseOrientation=pybullet.getQuaternionFromEuler([0, 0, float(np.arctan2(away[1], away[0]))]),
            physicsClientId=world.client,
        )
        world.names[wall] = "hidden wall"

    return plant
