"""The named positions of hands, which the hands' own motions determine.

A motion ends at an object or a place, or with the hand raised. The hand stays at this position until its next motion, or until
the object has moved away. A hand that was stopped on its way has no named position.
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
"""Maximum difference in metres between the height of a place and the base of an object that stands at the place."""

MOVED = 0.03
"""A stopped hand counts as lost if its motion was longer than this distance in metres."""


def point_of(world: Engine, name: str) -> Array:
    """Return the perceived position (3,) of a place, or of the base of a body."""
    point: Array = world.place(name) if name in world.embodiment.places else world.sense(name)[1]
    return point


def level_place(world: Engine, point: Array, height: float) -> tuple[str, float]:
    """Return the nearest place whose height differs by less than `height` metres from a point, and the horizontal distance."""
    points = {name: world.place(name) for name in world.embodiment.places}
    gaps = {name: float(np.hypot(*(point - at)[:2])) for name, at in points.items() if abs(point[2] - at[2]) < height}
    best = min(gaps, key=gaps.__getitem__, default="")
    return best, gaps.get(best, np.inf)


def arrived(world: Engine, hand: str, motion: str, target: str) -> None:
    """Store the named position of a hand after a motion; motions of links and motions relative to the hand change no position."""
    if motion in RAISED:
        world.hands[hand].at = Whereabouts(floor=world.hands[hand].at.floor)
    elif target in world.embodiment.places or (target in world.bodies and world.knows(target)):
        point = point_of(world, target)
        place, beside = level_place(world, point, LEVEL)
        floor = world.place(place)[2] if beside < NEAR_PLACE else point[2]
        world.hands[hand].at = Whereabouts(target, point, float(floor))


@contextmanager
def stopping(world: Engine, hand: str) -> Iterator[None]:
    """Mark a hand as lost if the ``with`` block raises `SkillError` after the hand has moved."""
    begin = world.hands[hand].frame()[1]
    try:
        yield
    except SkillError:
        if float(np.linalg.norm(world.hands[hand].frame()[1] - begin)) > MOVED:
            world.hands[hand].at = replace(world.hands[hand].at, lost=True)
        raise


def floor_below(world: Engine, hand: str, point: Array) -> float:
    """Return the height of the support that a hand's load has left; if unknown, the height of the place below `point`."""
    at = world.hands[hand].at
    if at.floor is not None and not at.lost:
        return at.floor
    return float(world.place(world.nearest_place(point)[0])[2])
