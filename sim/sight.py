"""What cameras see: a body of which other things leave too little in view is hidden, and only believed to be where it was.

Rays go from each camera to points all over a body; beads don't count as bodies. Furniture, links and robots are always known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pybullet

from reasoner.embodiment.values import Shape
from sim.bodies import outline
from sim.urdf import Array

SHARE = 0.1
"""Share of the points of a body that a camera must see for the body to be seen: less is a crack."""

BARED = 0.5
"""Share of the points at which a body is believed to be that are seen to be empty where it is gone."""

BEHIND, ABOVE, ASIDE = 0.1, 0.8, 0.5
"""Metres from the middle of a robot's shoulders, against its heading, up and to either side, of its cameras if none are stated."""

ROUND = 8
"""Points around a body at each height."""

HEIGHTS = (0.3, 0.65, 0.95)
"""Shares of a body's height at which its points are."""

BEYOND = 0.01
"""Metres by which a ray goes on behind a point on a surface."""

WITHIN = 0.8
"""By how much nearer to a body's middle the points are that are seen to be empty: beside them may be a wall."""


@dataclass(frozen=True)
class Sight:
    """Which bodies are seen, which aren't where they are believed to be, and what is before most of one that isn't seen."""

    seen: frozenset[str] = frozenset()
    gone: frozenset[str] = frozenset()
    covers: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Sought:
    """A body that is looked for: its number (-1 if it is there no more), its shape, where it is, and is believed to be."""

    name: str
    body: int
    shape: Shape
    pose: tuple[Array, Array] | None
    believed: tuple[Array, Array] | None


def over_the_shoulders(shoulders: Array, yaw: float) -> Array:
    """Return the cameras (2, 3) of a robot of which none are stated, from its shoulders (n, 3) and heading."""
    ahead, left = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    middle = np.array([*shoulders[:, :2].mean(0), shoulders[:, 2].max()]) - BEHIND * ahead
    middle[2] += ABOVE
    found: Array = middle + np.array([[ASIDE], [-ASIDE]]) * left
    return found


def look(client: int, cameras: Array, things: Sequence[Sought]) -> Sight:
    """Return what is seen from cameras (n, 3)."""
    seen, gone, covers = set[str](), set[str](), dict[str, int]()
    for thing in things:
        there = thing.pose is not None and _in_view(client, cameras, thing, thing.pose, covers)
        if there:
            seen.add(thing.name)
        elif thing.believed is not None and _bare(client, cameras, thing, thing.believed):
            gone.add(thing.name)
    return Sight(frozenset(seen), frozenset(gone), {name: one for name, one in covers.items() if name not in seen})


def _in_view(client: int, cameras: Array, thing: Sought, pose: tuple[Array, Array], covers: dict[str, int]) -> bool:
    """Tell whether enough of a body is seen, and note what is before most of it."""
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
    """Tell whether a camera sees that nothing is where a body is believed to be."""
    points = pose[1] + _points(thing.shape, WITHIN) @ pose[0].T
    hits = ([hit[0] for hit in _cast(client, camera, points, 0.0)] for camera in cameras)
    return any(each.count(-1) >= BARED * len(points) for each in hits)


def _points(shape: Shape, share: float = 1.0) -> Array:
    """Return points (n, 3) on a body's outline, or nearer to its axis, in its own frame."""
    heights, radii = outline(shape)
    angle = np.linspace(0.0, 2 * np.pi, ROUND, endpoint=False)
    rings = []
    for part in HEIGHTS:
        z = heights[-1] * part
        radius = share * float(np.interp(z, heights, radii))
        rings.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + z], -1))
    return np.concatenate(rings)


def _cast(client: int, camera: Array, points: Array, beyond: float) -> Sequence[tuple[int, ...]]:
    """Return what rays from a camera to points meet first."""
    ways = points - camera
    ends = points + beyond * ways / np.linalg.norm(ways, axis=1)[:, None]
    starts = np.broadcast_to(camera, ends.shape)
    found: Sequence[tuple[int, ...]] = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=client)
    return found
