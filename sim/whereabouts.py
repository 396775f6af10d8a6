"""The positions of hands: their own motions determine them, in three dimensions.

A motion ends at a thing or a place, or with the hand raised. The hand stays at this position until its next motion, or until
the thing has moved away. A hand that was stopped on its way is at no named place.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from confab.sim.engine import NEAR_PLACE, Engine
from confab.sim.robot import Whereabouts
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError

RAISED = ("rise", "home")
"""Motions after which a hand is raised."""

LEVEL = 0.01
"""Metres between the heights of a place and of an object that stands on it."""

MOVED = 0.03
"""Minimum distance in metres that a stopped hand has moved to count as lost."""


def point_of(world: Engine, name: str) -> Array:
    """Return the perceived point of a place, or of the base of a body."""
    point: Array = world.place(name) if name in world.embodiment.places else world.sense(name)[1]
    return point


def level_place(world: Engine, point: Array, height: float) -> tuple[str, float]:
    """Return the nearest of the places that are as high as a point, within `height` metres, and its distance sideways."""
    points = {name: world.place(name) for name in world.embodiment.places}
    gaps = {name: float(np.hypot(*(point - at)[:2])) for name, at in points.items() if abs(point[2] - at[2]) < height}
    best = min(gaps, key=gaps.__getitem__, default="")
    return best, gaps.get(best, np.inf)


def arrived(world: Engine, hand: str, motion: str, target: str) -> None:
    """Store the position to which a motion has brought a hand; motions of links, and at the hand itself, don't change it."""
    if motion in RAISED:
        world.hands[hand].at = Whereabouts(floor=world.hands[hand].at.floor)
    elif target in world.embodiment.places or (target in world.bodies and world.knows(target)):
        point = point_of(world, target)
        place, beside = level_place(world, point, LEVEL)
        floor = world.place(place)[2] if beside < NEAR_PLACE else point[2]
        world.hands[hand].at = Whereabouts(target, point, float(floor))


@contextmanager
def stopping(world: Engine, hand: str) -> Iterator[None]:
    """Store that a hand is lost if it fails in the block after it has moved."""
    begin = world.hands[hand].frame()[1]
    try:
        yield
    except SkillError:
        if float(np.linalg.norm(world.hands[hand].frame()[1] - begin)) > MOVED:
            world.hands[hand].at = replace(world.hands[hand].at, lost=True)
        raise


def floor_below(world: Engine, hand: str, point: Array) -> float:
    """Return the height of the support that the load of a hand has left; if unknown, the height of the place below a point."""
    at = world.hands[hand].at
    if at.floor is not None and not at.lost:
        return at.floor
    return float(world.place(world.nearest_place(point)[0])[2])
