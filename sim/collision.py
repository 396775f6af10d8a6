"""Distances between an arm and its obstacles, for many postures at once.

The arm and its load are a set of spheres. The obstacles are boxes, cylinders, and the spheres of the robot's body and of other
arms. A distance below zero is a collision. All lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from confab.reasoner.embodiment.values import Fixture
from confab.sim.arms import Arm, Flags, link_transforms, turn
from confab.sim.urdf import Array, Spheres, UrdfModel

EDGE, BETWEEN = 0.004, 0.02
"""Radius of the spheres along the lower edge of a load, and distance between neighbouring spheres, in metres."""

ABOVE = 0.01
"""Height in metres above the base of a load at which the load's spheres begin, since the base touches a table."""

POINTS = 4000
"""Number of points whose distances are computed at once; larger arrays don't fit into the processor's cache."""


@dataclass(frozen=True)
class Solid:
    """A named box (half extents) or cylinder (radius, radius, half height) with its centre and rotation in the world.

    `part` distinguishes several solids of the same name.
    """

    name: str
    kind: str
    half: Array
    center: Array
    rotation: Array
    part: str = ""

    def distance(self, points: Array) -> Array:
        """Return the signed distance of points (..., 3) from the surface."""
        local = np.abs((points - self.center) @ self.rotation)
        if self.kind == "cylinder":
            local = np.stack([np.hypot(local[..., 0], local[..., 1]), local[..., 2]], -1)
            excess = local - np.array([self.half[0], self.half[2]])
        else:
            excess = local - self.half
        distance: Array = np.linalg.norm(np.maximum(excess, 0.0), axis=-1) + np.minimum(excess.max(-1), 0.0)
        return distance

    def bounds(self) -> tuple[Array, Array]:
        """Return the corners of the axis-aligned box around the solid."""
        extent = np.abs(self.rotation) @ self.half
        return self.center - extent, self.center + extent


@dataclass(frozen=True)
class Obstacles:
    """The obstacles of an arm: solids, and the spheres of the robot's body and of other arms with the names of their owners."""

    solids: tuple[Solid, ...] = ()
    centers: Array = field(default_factory=lambda: np.zeros((0, 3)))
    radii: Array = field(default_factory=lambda: np.zeros(0))
    owners: tuple[str, ...] = ()

    def without(self, *names: str) -> Obstacles:
        """Return the surroundings without the solids, parts and sphere owners of the given names."""
        left = replace(self, solids=tuple(s for s in self.solids if s.name not in names and s.part not in names))
        if names and (gone := {*names} & {*self.owners}):
            kept = np.array([owner not in gone for owner in self.owners])
            owners = tuple(owner for owner in self.owners if owner not in gone)
            left = replace(left, centers=self.centers[kept], radii=self.radii[kept], owners=owners)
        return left

    @cached_property
    def packed(self) -> tuple[Array, Array, Array, Array, Array]:
        """The solids as arrays, boxes before cylinders.

        The arrays are axes (s, 3, 3), centres along these axes (s, 3), half extents (s, 3), and lower and upper bounds (s, 3).
        """
        solids = sorted(self.solids, key=lambda solid: solid.kind == "cylinder")
        turned = np.array([solid.rotation for solid in solids]).reshape(-1, 3, 3)
        centers = np.array([solid.center for solid in solids]).reshape(-1, 3)
        half = np.array([solid.half for solid in solids]).reshape(-1, 3)
        extent = np.einsum("sij,sj->si", np.abs(turned), half)
        return turned, np.einsum("sij,si->sj", turned, centers), half, centers - extent, centers + extent

    @cached_property
    def boxes(self) -> int:
        """Number of boxes among the solids."""
        return sum(solid.kind != "cylinder" for solid in self.solids)

    def plus(self, owner: str, spheres: Spheres) -> Obstacles:
        """Return the surroundings with the spheres of `owner` added."""
        return replace(
            self,
            centers=np.concatenate([self.centers, spheres.centers]),
            radii=np.concatenate([self.radii, spheres.radii]),
            owners=(*self.owners, *[owner] * len(spheres.radii)),
        )


@dataclass(frozen=True)
class Mover:
    """An arm, its spheres at the zero posture, and the joint that carries each sphere."""

    arm: Arm
    spheres: Spheres
    carrier: Array

    def at(self, q: Array) -> Array:
        """Return sphere centres (n, m, 3) at postures (n, k)."""
        r, t = link_transforms(self.arm, q)
        centers: Array = np.einsum("nmij,mj->nmi", r[:, self.carrier], self.spheres.centers) + t[:, self.carrier]
        return centers

    def holding(self, spheres: Spheres) -> Mover:
        """Return the arm with a load; the spheres of the load are given in the hand's frame."""
        world = spheres.centers @ self.arm.tip_rotation.T + self.arm.tip
        together = Spheres(
            np.concatenate([self.spheres.centers, world]), np.concatenate([self.spheres.radii, spheres.radii])
        )
        return Mover(
            self.arm, together, np.concatenate([self.carrier, np.full(len(spheres.radii), len(self.arm.joints) - 1)])
        )

    def clearances(self, q: Array, around: Obstacles) -> dict[str, Array]:
        """Return the distance (n,) of each nearby obstacle from the arm at each posture."""
        return clearances(self.at(q), self.spheres.radii, around)


def free(centers: Array, radii: Array, around: Obstacles, margin: float) -> Flags:
    """Return for each of n postures whether spheres of `radii` (m,) at `centers` (n, m, 3) keep the margin.

    The function `free` is faster than `clearances`.
    """
    some = max(POINTS // max(len(radii), 1), 1)
    return np.concatenate(
        [_free(centers[i : i + some], radii, around, margin) for i in range(0, max(len(centers), 1), some)]
    )


def _free(centers: Array, radii: Array, around: Obstacles, margin: float) -> Flags:
    keep, found = np.maximum(radii + margin, 0.0), np.ones(len(centers), dtype=bool)
    if not centers.size:
        return found
    low, high = centers.min(0) - keep[:, None], centers.max(0) + keep[:, None]
    turned, middles, half, bottom, top = around.packed
    mine, near = _meeting(low, high, bottom, top)
    if len(near):
        points, kept = centers[:, mine].reshape(-1, 3), np.tile(keep[mine], len(centers))
        axes = turned[near].transpose(1, 0, 2).reshape(3, -1)
        local = np.abs((points @ axes).reshape(len(points), -1, 3) - middles[near])
        split = int(np.searchsorted(near, around.boxes))
        excess = np.maximum(local[:, :split] - half[near[:split]], 0.0)
        outside = [np.einsum("psi,psi->ps", excess, excess)]
        across = np.hypot(local[:, split:, 0], local[:, split:, 1]) - half[near[split:], 0]
        along = local[:, split:, 2] - half[near[split:], 2]
        outside.append(np.maximum(across, 0.0) ** 2 + np.maximum(along, 0.0) ** 2)
        touched = (np.concatenate(outside, 1) <= (kept**2)[:, None]).any(1)
        found &= ~touched.reshape(len(centers), -1).any(1)
    reach = around.radii[:, None]
    mine, near = _meeting(low, high, around.centers - reach, around.centers + reach)
    if len(near):  # |p - o|^2 - (k + r)^2 of all pairs as one product
        points, kept = centers[:, mine].reshape(-1, 3), np.tile(keep[mine], len(centers))
        others, wide = around.centers[near], around.radii[near]
        left = np.column_stack([points, np.einsum("pi,pi->p", points, points) - kept**2, np.ones(len(points)), kept])
        right = np.column_stack([-2 * others, np.ones(len(wide)), (others**2).sum(1) - wide**2, -2 * wide])
        touched = (left @ right.T).min(1) <= 0
        found &= ~touched.reshape(len(centers), -1).any(1)
    return found


def _meeting(low: Array, high: Array, bottom: Array, top: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of boxes that meet a box of the other group, given the boxes' corners (m, 3) and (s, 3).

    The filter saves time, since most spheres of an arm are far from most obstacles.
    """
    near = np.ones((len(low), len(bottom)), dtype=bool)
    for i in range(3):
        near &= (bottom[:, i] <= high[:, i, None]) & (top[:, i] >= low[:, i, None])
    return np.flatnonzero(near.any(1)), np.flatnonzero(near.any(0))


def clearances(centers: Array, radii: Array, around: Obstacles) -> dict[str, Array]:
    """Return the distance (n,) of each nearby obstacle from spheres (m,) at centres (n, m, 3)."""
    low, high = (centers - radii[:, None]).min((0, 1)) - 0.05, (centers + radii[:, None]).max((0, 1)) + 0.05
    found: dict[str, Array] = {}
    for solid in around.solids:
        bottom, top = solid.bounds()
        if np.all(bottom <= high) and np.all(top >= low):
            gap = (solid.distance(centers) - radii).min(1)
            found[solid.name] = np.minimum(gap, found.get(solid.name, np.inf))
    near = np.all(
        (around.centers + around.radii[:, None] >= low) & (around.centers - around.radii[:, None] <= high), -1
    )
    for owner in dict.fromkeys(name for name, close in zip(around.owners, near, strict=True) if close):
        own = near & np.array([name == owner for name in around.owners])
        gaps = np.linalg.norm(centers[:, :, None] - around.centers[own], axis=-1)
        found[owner] = (gaps - radii[:, None] - around.radii[own]).min((1, 2))
    return found


def box(fixture: Fixture) -> Solid:
    """Return the solid of a fixture."""
    turned = turn(np.array([0.0, 0.0, 1.0]), np.array(fixture.yaw))
    return Solid(fixture.name, "box", np.array(fixture.size) / 2, np.array(fixture.position), turned)


def read_mover(model: UrdfModel, arm: Arm, openings: Mapping[str, float]) -> Mover:
    """Return an arm with the spheres of its moving links, with finger joints at `openings` (metres).

    The links between the first and the second joint are left out: these links turn on the spot and touch the mount of the arm.
    """
    centers, radii, carriers = [], [], []
    for link, spheres in model.spheres.items():
        chain = model.chains[link]
        moved = [arm.joints.index(joint.name) for joint in chain if joint.name in arm.joints]
        if moved and moved[-1]:
            slide = sum((joint.axis * openings[joint.name] for joint in chain if joint.name in openings), np.zeros(3))
            centers.append(spheres.centers + slide)
            radii.append(spheres.radii)
            carriers.append(np.full(len(spheres.radii), moved[-1]))
    return Mover(arm, Spheres(np.concatenate(centers), np.concatenate(radii)), np.concatenate(carriers))


def fixed_spheres(model: UrdfModel, arms: Sequence[Arm]) -> Spheres:
    """Return the spheres of the links of a robot that no arm moves."""
    joints = {name for arm in arms for name in arm.joints}
    still = [s for link, s in model.spheres.items() if not joints & {joint.name for joint in model.chains[link]}]
    return Spheres(np.concatenate([s.centers for s in still]), np.concatenate([s.radii for s in still]))


def column(heights: Array, radii: Array, bottom: float) -> Spheres:
    """Return spheres that cover an upright body of revolution above `bottom`, except the body's edges.

    Ascending `heights` and `radii` give the outline of the body. Each sphere is as wide as the body at the sphere's centre. If such
    a sphere would protrude below the body, smaller spheres replace it.

    >>> column(np.array([0.0, 0.1]), np.array([0.03, 0.03]), 0.0).centers[:, 2].round(3).tolist()  # a ring at 0.02
    [0.02, 0.04, 0.06, 0.08, 0.02, 0.02, 0.02, 0.02]
    """
    top = float(heights[-1])
    ends = [min(float(np.interp(z, heights, radii)) * 2 / 3, (top - bottom) / 2) for z in (bottom, top)]
    first, last = bottom + ends[0], max(top - ends[1], bottom + ends[0])
    z = np.linspace(first, last, 1 + int(np.ceil((last - first) / (0.8 * float(np.min(radii))))))
    wide = np.interp(z, heights, radii)
    radius = np.minimum(wide, z - min(bottom, ABOVE))
    rings = [np.stack([0 * z, 0 * z, z], -1)]
    owner = [np.arange(len(z))]
    for i in np.flatnonzero(radius < wide):
        out = wide[i] - radius[i]
        around = np.linspace(0.0, 2 * np.pi, max(int(np.ceil(2 * np.pi * out / radius[i])), 3), endpoint=False)
        rings.append(np.stack([out * np.cos(around), out * np.sin(around), 0 * around + z[i]], -1))
        owner.append(np.full(len(around), i))
    return Spheres(np.concatenate(rings), radius[np.concatenate(owner)])


def rim(heights: Array, radii: Array) -> Spheres:
    """Return small spheres along the lower edge of an upright body of revolution; the spheres of `column` don't cover this edge."""
    wide = float(radii[0]) - EDGE
    around = np.linspace(0.0, 2 * np.pi, max(int(np.ceil(2 * np.pi * wide / BETWEEN)), 3), endpoint=False)
    centers = np.stack([wide * np.cos(around), wide * np.sin(around), 0 * around + heights[0] + EDGE], -1)
    return Spheres(centers, np.full(len(around), EDGE))
