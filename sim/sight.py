"""Visibility: a body is hidden if the cameras see too small a share of it; its last known position is then believed.

Rays are cast from each camera to points on the body's surface. Beads are not checked; furniture, links and robots are always known.
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
"""Minimum share of empty points at the believed pose of a body that a camera has to see for the body to count as gone."""

BEHIND, ABOVE, ASIDE = 0.1, 0.8, 0.5
"""Position in metres of a robot's default cameras relative to the middle of its shoulders: back, up and to either side."""

ROUND = 8
"""Number of points around a body at each height."""

HEIGHTS = (0.3, 0.65, 0.95)
"""Heights of the points, as shares of the body's height."""

BEYOND = 0.01
"""Metres by which a ray continues behind a point on the surface."""

WITHIN = 0.8
"""Share of the radius at which points must be empty for a body to count as gone.

At the full radius, points could be inside a wall beside the body.
"""


@dataclass(frozen=True)
class Sight:
    """The seen bodies, the bodies gone from their believed pose, and the number of the body that covers each hidden body most."""

    seen: frozenset[str] = frozenset()
    gone: frozenset[str] = frozenset()
    covers: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Sought:
    """A body to look for: its number (-1 if it was removed), its shape, its true pose and its believed pose."""

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
    """Return which bodies are seen, gone or covered from cameras (n, 3)."""
    seen, gone, covers = set[str](), set[str](), dict[str, int]()
    for thing in things:
        there = thing.pose is not None and _in_view(client, cameras, thing, thing.pose, covers)
        if there:
            seen.add(thing.name)
        elif thing.believed is not None and _bare(client, cameras, thing, thing.believed):
            gone.add(thing.name)
    return Sight(frozenset(seen), frozenset(gone), {name: one for name, one in covers.items() if name not in seen})


def _in_view(client: int, cameras: Array, thing: Sought, pose: tuple[Array, Array], covers: dict[str, int]) -> bool:
    """Return whether enough of a body is seen; add the body that covers most of it to `covers`."""
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
    """Return points (n, 3) at a share of the radius of a body, in its own frame."""
    heights, radii = outline(shape)
    angle = np.linspace(0.0, 2 * np.pi, ROUND, endpoint=False)
    rings = []
    for part in HEIGHTS:
        z = heights[-1] * part
        radius = share * float(np.interp(z, heights, radii))
        rings.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + z], -1))
    return np.concatenate(rings)


def _cast(client: int, camera: Array, points: Array, beyond: float) -> Sequence[tuple[int, ...]]:
    """Return the first hits of rays from a camera to points."""
    ways = points - camera
    ends = points + beyond * ways / np.linalg.norm(ways, axis=1)[:, None]
    starts = np.broadcast_to(camera, ends.shape)
    found: Sequence[tuple[int, ...]] = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=client)
    return found
