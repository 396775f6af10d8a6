"""The named positions of hands, which the hands' own motions determine.

A motion ends at an object or a place, or with the hand raised. The hand stays at this position until its next motion, or until
the object has moved away. A hand that was stopped on its way has no named position.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
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


def level_place(world: Engine, point: Array, height: float, load: Collection[str] = ()) -> tuple[str, float]:
    """Return the nearest place whose height differs by less than `height` metres from a point, and the horizontal distance.

    Places on the bodies of `load` are left out. A place on a body takes precedence over the place at which this body stands.
    """
    places = {name: place for name, place in world.embodiment.places.items() if place.carrier not in load}
    gaps = {name: point - world.place(name) for name in places}
    near = {name: float(np.hypot(*gap[:2])) for name, gap in gaps.items() if abs(gap[2]) < height}
    carriers = {places[name].carrier for name, away in near.items() if away < NEAR_PLACE}
    for carrier in sorted(carriers & world.bodies.keys()):
        if world.knows(carrier):
            near.pop(level_place(world, point_of(world, carrier), height, {*load, carrier})[0], None)
    best = min(near, key=near.__getitem__, default="")
    return best, near.get(best, np.inf)


def arrived(world: Engine, hand: str, motion: str, target: str) -> None:
    """Store the named position of a hand after a motion; motions of links and motions relative to the hand change no position."""
    if motion in RAISED:
        world.hands[hand].at = Whereabouts(floor=world.hands[hand].at.floor)
    elif target in world.embodiment.places or (target in world.bodies and world.knows(target)):
        point = point_of(world, target)
        place, beside = level_place(world, point, LEVEL, world.load(target if target in world.bodies else None))
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
    """Return the height of the support from which a hand has lifted its load; if unknown, the height of the place below `point`."""
    at = world.hands[hand].at
    if at.floor is not None and not at.lost:
        return at.floor
    return float(world.place(world.nearest_place(point)[0])[2])
