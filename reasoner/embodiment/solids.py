"""Solids of furniture, mechanisms and objects: their positions for given joint values, and the depth of overlaps.

Lengths are in metres, angles in radians. Meshes and mechanisms with their own URDF file are ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from confab.reasoner.embodiment.values import Body, Embodiment, Fixture, Link, Mechanism, Part, Vector

Array = NDArray[np.float64]
Frame = tuple[Array, Array]
"""Rotation matrix (3, 3) and origin (3,)."""

AROUND = np.linspace(0.0, np.pi, 16, endpoint=False)
"""Angles about a cylinder's axis at which directions of separation are tested."""

REFINED = 24
"""Number of steps in which the direction of separation is refined."""


@dataclass(frozen=True)
class PlacedSolid:
    """A box, cylinder or sphere in the world frame, with its `owner`.

    `half` contains the half extents of a box, or the radii of a round solid.
    """

    owner: str
    part: str
    kind: str
    half: Array
    center: Array
    rotation: Array

    @property
    def name(self) -> str:
        """The name of the owner; if the solid has another name, this name precedes the owner's name."""
        return self.owner if self.part in ("", self.owner) else f"{self.part} ({self.owner})"

    def extent(self, directions: Array) -> Array:
        """Return the half widths (n,) of the solid along unit directions (n, 3)."""
        local = np.abs(directions @ self.rotation)
        if self.kind == "sphere":
            return np.full(len(directions), self.half[0])
        if self.kind == "cylinder":
            round_: Array = np.hypot(local[:, 0], local[:, 1]) * self.half[0] + local[:, 2] * self.half[2]
            return round_
        flat: Array = local @ self.half
        return flat

    def farthest(self, direction: Array) -> Array:
        """Return the point (3,) of the solid that is farthest along a direction (3,), relative to its centre."""
        local = direction @ self.rotation
        if self.kind == "sphere":
            ahead: Array = direction * self.half[0]
            return ahead
        point = np.sign(local) * self.half
        if self.kind == "cylinder":
            point[:2] = local[:2] / max(float(np.hypot(local[0], local[1])), 1e-12) * self.half[0]
        turned: Array = self.rotation @ point
        return turned

    def directions(self) -> Array:
        """Return normals (n, 3) of the solid's surface, which are tested as directions of separation."""
        if self.kind != "cylinder":
            normals: Array = self.rotation.T
            return normals
        ring = np.stack([np.cos(AROUND), np.sin(AROUND), 0 * AROUND], -1)
        found: Array = np.concatenate([self.rotation.T[2:], ring @ self.rotation.T])
        return found


def overlap(one: PlacedSolid, other: PlacedSolid) -> float:
    """Return the distance in metres by which a solid must be moved to be separated from another solid.

    The distance is negative if there is a gap between the solids.
    """
    apart = other.center - one.center
    if not apart.any():
        apart = np.array([1e-9, 0.0, 0.0])
    crossed = np.cross(one.rotation.T[:, None], other.rotation.T[None]).reshape(-1, 3)
    tried = [one.directions(), other.directions(), crossed, apart[None]]
    tried += [(apart - (apart @ solid.rotation[:, 2]) * solid.rotation[:, 2])[None] for solid in (one, other)]
    directions = np.concatenate(tried)
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    gaps = np.abs(directions @ apart) - one.extent(directions) - other.extent(directions)
    best, gap = directions[gaps.argmax()], float(gaps.max())
    for i in range(REFINED if gap < 0 else 0):
        towards = best if best @ apart >= 0 else -best
        slope = apart - one.farthest(towards) - other.farthest(towards)
        turned = towards + slope / max(float(np.linalg.norm(slope)), 1e-12) * 0.24 * 0.8**i
        turned /= np.linalg.norm(turned)
        now = float((np.abs(turned @ apart) - one.extent(turned[None]) - other.extent(turned[None]))[0])
        if now > gap:
            best, gap = turned, now
    return -gap


def rotation(turned: Vector) -> Array:
    """Return the rotation matrix for roll, pitch and yaw about fixed axes."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    found = np.eye(3)
    for axis, angle in zip(axes, turned, strict=True):
        found = _about(axis, angle) @ found
    return found


def _about(axis: Vector, angle: float) -> Array:
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return found


def frames(mechanism: Mechanism, values: Mapping[str, float]) -> dict[str, Frame]:
    """Return the world frames of a mechanism's base and links for given joint values; a joint without a value is at 0."""
    found: dict[str, Frame] = {
        mechanism.name: (rotation((0.0, 0.0, mechanism.yaw)), np.array(mechanism.position, dtype=float))
    }
    for link in mechanism.links:  # parents come before children
        turned, origin = found[link.parent or mechanism.name]
        origin = origin + turned @ np.array(link.position)
        turned = turned @ rotation(link.turned)
        value = values.get(link.name, 0.0)
        if link.kind == "prismatic":
            origin = origin + turned @ (np.array(link.axis) / np.linalg.norm(link.axis)) * value
        elif link.kind == "revolute":
            turned = turned @ _about(link.axis, value)
        found[link.name] = turned, origin
    return found


def blocks_of(mechanism: Mechanism, values: Mapping[str, float]) -> list[PlacedSolid]:
    """Return the solids of a mechanism for given joint values."""
    placed = frames(mechanism, values)
    owners: list[Mechanism | Link] = [mechanism, *mechanism.links]
    return [_placed(part, owner.name, *placed[owner.name]) for owner in owners for part in owner.parts if _solid(part)]


def _solid(part: Part) -> bool:
    return part.kind != "mesh"


def _placed(part: Part, owner: str, turned: Array, origin: Array) -> PlacedSolid:
    center = origin + turned @ np.array(part.position)
    return PlacedSolid(owner, part.name, part.kind, np.array(part.size) / 2, center, turned @ rotation(part.turned))


def fixture_block(fixture: Fixture) -> PlacedSolid:
    """Return the solid of a fixture."""
    turned = rotation((0.0, 0.0, fixture.yaw))
    return PlacedSolid(fixture.name, "", "box", np.array(fixture.size) / 2, np.array(fixture.position), turned)


def body_blocks(body: Body, frame: Frame) -> Iterator[PlacedSolid]:
    """Yield the solids of an object whose base has its centre at the given frame. A vessel is treated as solid throughout."""
    turned, base = frame
    numbers, shape = body.shape.numbers, body.shape
    wall = numbers.get("wall", 0.004) if shape.kind == "vessel" else 0.0
    for (low, below), (high, above) in pairwise(shape.profile):
        radius, half = (below + above) / 2 + wall, (high - low) / 2
        if half > 0.0005:
            center = base + turned[:, 2] * (low + high) / 2
            yield PlacedSolid(body.name, "", "cylinder", np.array([radius, radius, half]), center, turned)
    if not shape.profile and "height" in numbers:
        half = numbers["height"] / 2
        if "radius" in numbers:
            size, kind = np.array([numbers["radius"], numbers["radius"], half]), "cylinder"
        else:
            size, kind = np.array([numbers["width"] / 2, numbers["depth"] / 2, half]), "box"
        yield PlacedSolid(body.name, "", kind, size, base + turned[:, 2] * half, turned)


def place_frame(
    embodiment: Embodiment, name: str, where: Mapping[str, str], values: Mapping[str, float]
) -> Frame | None:
    """Return the world frame of a place for given places of objects (`where`) and joint values, or None.

    The carrier of a place may be an object, which is itself at a place.
    """
    passed: list[str] = []
    shift = np.zeros(3)
    while name in embodiment.places and name not in passed:
        passed.append(name)
        place = embodiment.places[name]
        shift = shift + np.array(place.position)
        if not place.carrier:
            return np.eye(3), shift
        for mechanism in embodiment.mechanisms:
            if not mechanism.urdf and place.carrier in (mechanism.name, *(link.name for link in mechanism.links)):
                turned, origin = frames(mechanism, values)[place.carrier]
                return turned, origin + turned @ shift
        name = where.get(place.carrier, "")
    return None
