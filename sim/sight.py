"""Visibility of bodies from cameras.

A body is hidden if each camera sees too small a share of the body. The robot then assumes the last known position of the body.
Rays are cast from each camera to points on the body's surface. Furniture, links and robots are always known, and beads are not
checked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Shape
from confab.sim.bodies import outline
from confab.sim.urdf import Array

SHARE = 0.1
"""Minimum share of a body's points that a camera has to see for the body to count as seen."""

BARED = 0.5
"""A body counts as gone if a camera sees that at least this share of the points at its believed pose is empty."""

BEHIND, ABOVE, ASIDE = 0.1, 0.8, 0.5
"""Distances in metres of a robot's default cameras from the middle of its shoulders: back, up and to either side."""

ROUND = 8
"""Number of points around a body at each height to which rays are cast."""

HEIGHTS = (0.3, 0.65, 0.95)
"""Heights of the points to which rays are cast, as shares of the body's height."""

BEYOND = 0.01
"""Distance in metres by which a ray continues behind a point on the surface."""

WITHIN = 0.8
"""Share of a body's radius at which points are tested for emptiness.

At the full radius, points could be inside a wall beside the body.
"""


@dataclass(frozen=True)
class Sight:
    """The seen bodies, the bodies gone from their believed pose, and the PyBullet body that covers each hidden body most."""

    seen: frozenset[str] = frozenset()
    gone: frozenset[str] = frozenset()
    covers: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Sought:
    """A body to look for, with its PyBullet number (-1 for a removed body), shape, true pose and believed pose."""

    name: str
    body: int
    shape: Shape
    pose: tuple[Array, Array] | None
    believed: tuple[Array, Array] | None


def over_the_shoulders(shoulders: Array, yaw: float) -> Array:
    """Return the default cameras (2, 3) of a robot, given its shoulders (n, 3) and heading."""
    ahead, left = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    middle = np.array([*shoulders[:, :2].mean(0), shoulders[:, 2].max()]) - BEHIND * ahead
    middle[2] += ABOVE
    found: Array = middle + np.array([[ASIDE], [-ASIDE]]) * left
    return found


def look(client: int, cameras: Array, things: Sequence[Sought]) -> Sight:
    """Return the bodies that are seen, gone or covered from cameras (n, 3)."""
    seen, gone, covers = set[str](), set[str](), dict[str, int]()
    for thing in things:
        there = thing.pose is not None and _in_view(client, cameras, thing, thing.pose, covers)
        if there:
            seen.add(thing.name)
        elif thing.believed is not None and _bare(client, cameras, thing, thing.believed):
            gone.add(thing.name)
    return Sight(frozenset(seen), frozenset(gone), {name: one for name, one in covers.items() if name not in seen})


def _in_view(client: int, cameras: Array, thing: Sought, pose: tuple[Array, Array], covers: dict[str, int]) -> bool:
    """Return whether a camera sees enough of a body; add the body that covers most of a hidden body to `covers`."""
    points = pose[1] + _points(thing.shape) @ pose[0].T
    for camera in cameras:
        hits = [hit[0] for hit in _cast(client, camera, points, BEYOND)]
        if hits.count(thing.body) >= SHARE * len(points):
            return True
        before = [hit for hit in hits if hit >= 0]
        if before:
            covers[thing.name] = max(before, key=before.count)
    return False


def _bare(client: int, cameras: Array, thing: Sought, pose: tuple[Array, Array]) -> bool:
    """Return whether a camera sees that a body's believed pose is empty."""
    points = pose[1] + _points(thing.shape, WITHIN) @ pose[0].T
    hits = ([hit[0] for hit in _cast(client, camera, points, 0.0)] for camera in cameras)
    return any(each.count(-1) >= BARED * len(points) for each in hits)


def _points(shape: Shape, share: float = 1.0) -> Array:
    """Return points (n, 3) in the body's frame at a share of the body's radius."""
    heights, radii = outline(shape)
    angle = np.linspace(0.0, 2 * np.pi, ROUND, endpoint=False)
    rings = []
    for part in HEIGHTS:
        z = heights[-1] * part
        radius = share * float(np.interp(z, heights, radii))
        rings.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + z], -1))
    return np.concatenate(rings)


def _cast(client: int, camera: Array, points: Array, beyond: float) -> Sequence[tuple[int, ...]]:
    """Return PyBullet's first hits of rays from a camera to points."""
    ways = points - camera
    ends = points + beyond * ways / np.linalg.norm(ways, axis=1)[:, None]
    starts = np.broadcast_to(camera, ends.shape)
    found: Sequence[tuple[int, ...]] = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=client)
    return found
