"""Arms read from a URDF, and forward kinematics: the pose of the hand for given postures.

The functions of kinematics compute many postures at once.

Arrays have these names: ``q`` are postures (n, k) of k joints in radians, ``R`` are rotations (n, 3, 3), ``p`` are points (n,
3) in metres, and ``a`` are axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from confab.sim.urdf import Array, UrdfModel, rotation

Flags: TypeAlias = NDArray[np.bool_]

DOWN, EYE = np.array([0.0, 0.0, -1.0]), np.eye(3)


@dataclass(frozen=True)
class Arm:
    """An arm with its hand, at the zero posture in world coordinates, and its rest posture `home`.

    `wrist` is the intersection of the two axes before the last axis. In an arm without a closed form of the inverse
    kinematics, `wrist` is the origin of the last joint.
    """

    joints: tuple[str, ...]
    origins: Array
    axes: Array
    lower: Array
    upper: Array
    velocity: Array
    tip_rotation: Array
    tip: Array
    shoulder: Array
    elbow: Array
    wrist: Array
    home: Array
    closed: bool = True

    @property
    def upper_length(self) -> float:
        """Metres from shoulder to elbow."""
        return float(np.linalg.norm(self.elbow - self.shoulder))

    @property
    def lower_length(self) -> float:
        """Metres from elbow to wrist."""
        return float(np.linalg.norm(self.wrist - self.elbow))

    @cached_property
    def length(self) -> float:
        """Maximum distance in metres from shoulder to wrist."""
        bends = [self.elbow] if self.closed else list(self.origins[1:-1])
        return float(sum(np.linalg.norm(b - a) for a, b in pairwise([self.shoulder, *bends, self.wrist])))

    @cached_property
    def spherical(self) -> bool:
        """Whether the axes of the last three joints meet at the wrist."""
        return bool(np.linalg.norm(np.cross(self.axes[6], self.wrist - self.origins[6])) < 1e-6)

    @property
    def swivels(self) -> bool:
        """Whether the arm is redundant: the elbow can move while the hand keeps its pose."""
        return len(self.joints) > 6

    @cached_property
    def hang(self) -> Array:
        """Direction of the elbow at swivel angle 0: up if the upper arm points up at the zero posture, otherwise down."""
        return -DOWN if self.elbow[2] - self.shoulder[2] > self.upper_length / 2 else DOWN

    @cached_property
    def middle(self) -> Array:
        """The middle (k,) of each joint's limits in radians."""
        return np.asarray((self.lower + self.upper) / 2)

    @cached_property
    def turning(self) -> tuple[Array, Array]:
        """Cross-product matrices (k, 3, 3) of the joints' axes, and the squares of these matrices."""
        crosses = np.stack([cross_matrix(axis) for axis in self.axes])
        return crosses, crosses @ crosses

    @cached_property
    def limbs(self) -> tuple[float, float, Array, float, float]:
        """Lengths of upper arm and forearm, the elbow's frame (3, 3), the elbow's bend in radians and its sign (1 or -1)."""
        a, b, hinge = self.upper_length, self.lower_length, self.axes[3]
        upper, fore = (self.elbow - self.shoulder) / a, (self.wrist - self.elbow) / b
        bent = float(np.arctan2(cross(upper, fore) @ hinge, upper @ fore))
        side = 1.0 if (self.lower[3] + self.upper[3]) / 2 + bent > 0 else -1.0
        return a, b, np.stack([upper, hinge, cross(upper, hinge)], -1), bent, side


def read_arm(
    model: UrdfModel,
    joints: Sequence[str],
    tip: str,
    turned: Sequence[float] = (0.0, 0.0, 0.0),
    home: Sequence[float] | None = None,
) -> Arm:
    """Return the arm of `joints` with its hand at link `tip`; `turned` is the hand's roll, pitch and yaw relative to the link.

    The rest posture of the arm is `home`, or the middle of the joints' limits if `home` is None.

    Raises
    ------
    ValueError
        The URDF lacks a named joint or link, the number of joints is neither 6 nor 7, or a joint is unsuitable. The message names
        the fault.
    """
    if missing := [
        *(f"joint '{name}'" for name in joints if name not in model.joints),
        *([] if tip in model.frames else [f"link '{tip}'"]),
    ]:
        raise ValueError(f"the robot's URDF has no {missing[0]}, which the arm of '{tip}' needs; correct the name")
    chain = [model.joints[name] for name in joints]
    if len(chain) not in (6, 7):
        raise ValueError(f"arm of '{tip}' has {len(chain)} joints; an arm needs 6 or 7")
    for joint in chain:
        if joint.kind not in ("revolute", "continuous"):
            raise ValueError(f"joint '{joint.name}' of the arm is {joint.kind}; wanted a revolute or continuous joint")
        if joint.lower > joint.upper:
            raise ValueError(
                f"joint '{joint.name}' turns from {joint.lower:g} to {joint.upper:g}; wanted the lower limit first"
            )
    origins, axes = np.array([joint.origin for joint in chain]), np.array([joint.axis for joint in chain])
    closed = _closed(origins, axes)
    shoulder, elbow, wrist = closed or (origins[1], origins[len(chain) // 2], origins[-1])
    lower, upper = np.array([joint.lower for joint in chain]), np.array([joint.upper for joint in chain])
    frame, point = model.frames[tip]
    return Arm(
        tuple(joints),
        origins,
        axes,
        lower,
        upper,
        np.array([joint.velocity for joint in chain]),
        frame @ rotation(*turned),
        point,
        shoulder,
        elbow,
        wrist,
        (lower + upper) / 2 if home is None else np.array(home),
        closed is not None,
    )


def _closed(origins: Array, axes: Array) -> tuple[Array, Array, Array] | None:
    """Return shoulder, elbow and wrist of an arm with a closed form of the inverse kinematics, otherwise None."""
    if len(axes) != 7 or any(abs(axes[i] @ axes[j]) > 1e-6 for i, j in ((0, 1), (1, 2), (4, 5), (5, 6))):
        return None
    shoulder, wrist = _meeting(origins[:3], axes[:3]), _meeting(origins[4:6], axes[4:6])
    if shoulder is None or wrist is None:
        return None
    elbow = origins[3] + axes[3] * (axes[3] @ (shoulder - origins[3]))
    return (shoulder, elbow, wrist) if abs(axes[3] @ (wrist - elbow)) < 1e-6 else None


def _meeting(origins: Array, axes: Array) -> Array | None:
    """Return the point where axes meet (least squares), or None if they don't meet."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    point = np.linalg.solve(across.sum(0), np.einsum("nij,nj->i", across, origins))
    gap = np.abs(np.einsum("nij,nj->ni", across, point - origins)).max()
    return point if gap < 1e-6 else None


def cross_matrix(axis: Array) -> Array:
    """Return the matrix (3, 3) that maps a vector to the product ``axis x vector``."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Array, b: Array) -> Array:
    """Return vector products (..., 3); for a few vectors, this function takes a quarter of the time of `numpy.cross`."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty((*np.broadcast(x, u).shape, 3))
    product[..., 0], product[..., 1], product[..., 2] = y * w - z * v, z * u - x * w, x * v - y * u
    return product


def turn(axis: Array, angle: Array) -> Array:
    """Return rotation matrices (n, 3, 3) about a unit `axis` (3,) by `angle` (n,) radians."""
    return _turned(*_turning(axis.tobytes()), angle)


@lru_cache(maxsize=64)
def _turning(axis: bytes) -> tuple[Array, Array]:
    """Return the cross-product matrix (3, 3) of an axis, and the square of the matrix. The result is cached."""
    crosses = cross_matrix(np.frombuffer(axis))
    return crosses, crosses @ crosses


def turn_about(vectors: Array) -> Array:
    """Return rotation matrices (n, 3, 3) for rotation vectors (n, 3): unit axis times angle in radians."""
    angle = np.linalg.norm(vectors, axis=-1)
    x, y, z = (vectors / np.maximum(angle, 1e-12)[:, None]).T
    zero = np.zeros(len(angle))
    crosses = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(-1, 3, 3)
    return _turned(crosses, crosses @ crosses, angle)


def _turned(crosses: Array, squares: Array, angle: Array) -> Array:
    """Return rotation matrices (..., 3, 3) by `angle` (...) radians about axes with given cross-product matrices and squares."""
    sin, cos = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    matrices: Array = EYE + sin * crosses + (1 - cos) * squares
    return matrices


def link_transforms(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Return the rotation (n, k, 3, 3) and shift (n, k, 3) of each joint's child link, relative to the zero posture.

    A point x of link i at the zero posture is at ``R[:, i] @ x + t[:, i]``.
    """
    rotations, shifts = np.empty((*q.shape, 3, 3)), np.empty((*q.shape, 3))
    local = _turned(*arm.turning, q)
    offset = arm.origins - np.einsum("nkij,kj->nki", local, arm.origins)
    r, t = local[:, 0], offset[:, 0]
    rotations[:, 0], shifts[:, 0] = r, t
    for i in range(1, q.shape[1]):
        t = t + np.einsum("nij,nj->ni", r, offset[:, i])
        r = r @ local[:, i]
        rotations[:, i], shifts[:, i] = r, t
    return rotations, shifts


def hand_frames(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Return rotation (n, 3, 3) and position (n, 3) of the hand's tip."""
    r, t = link_transforms(arm, q)
    return r[:, -1] @ arm.tip_rotation, np.einsum("nij,j->ni", r[:, -1], arm.tip) + t[:, -1]
