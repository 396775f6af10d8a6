"""Arms in closed form: where a posture puts the hand, and which posture puts the hand where it should be.

An arm here is spherical-rotary-spherical, as a human's is: three axes through the shoulder, one through the elbow, three
through the wrist. A hand pose then leaves one freedom, the *swivel* of the elbow around the line from shoulder to wrist
(0: the elbow hangs down; positive turns it about that line). Everything is computed for many postures at once.

``q`` postures (n, 7) in radians · ``R`` rotations (n, 3, 3) · ``p`` points (n, 3) in metres · ``a`` axes · S, E, W shoulder,
elbow, wrist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.urdf import Array, Model

DOWN, EYE = np.array([0.0, 0.0, -1.0]), np.eye(3)


@dataclass(frozen=True)
class Arm:
    """A spherical-rotary-spherical arm with its hand, at the zero posture in world coordinates."""

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

    @property
    def upper_length(self) -> float:
        """Metres from shoulder to elbow."""
        return float(np.linalg.norm(self.elbow - self.shoulder))

    @property
    def lower_length(self) -> float:
        """Metres from elbow to wrist."""
        return float(np.linalg.norm(self.wrist - self.elbow))

    @cached_property
    def crosses(self) -> Array:
        """Cross-product matrices (7, 3, 3) of the axes."""
        return np.stack([cross_matrix(axis) for axis in self.axes])


def read_arm(model: Model, joints: Sequence[str], tip: str) -> Arm:
    """Return the arm of `joints` that ends in link `tip`.

    Raises
    ------
    ValueError
        The robot has no such joint or tip; the axes don't meet in a shoulder and a wrist, or neighbouring axes aren't at right
        angles. The message says which.
    """
    if missing := [
        *(f"joint '{name}'" for name in joints if name not in model.joints),
        *([] if tip in model.frames else [f"link '{tip}'"]),
    ]:
        raise ValueError(f"the robot's URDF has no {missing[0]}, which the arm of '{tip}' needs; mend the name")
    chain = [model.joints[name] for name in joints]
    if len(chain) != 7:
        raise ValueError(
            f"arm of '{tip}' has {len(chain)} joints; the closed form needs 7 (3 shoulder, 1 elbow, 3 wrist)"
        )
    origins = np.array([joint.origin for joint in chain])
    axes = np.array([joint.axis for joint in chain])
    for i, j in ((0, 1), (1, 2), (4, 5), (5, 6)):
        if abs(axes[i] @ axes[j]) > 1e-6:
            raise ValueError(f"joints {joints[i]} and {joints[j]} aren't at right angles")
    shoulder = _meeting(origins[:3], axes[:3], "shoulder", joints[:3])
    wrist = _meeting(origins[4:], axes[4:], "wrist", joints[4:])
    elbow = origins[3] + axes[3] * (axes[3] @ (shoulder - origins[3]))
    if abs(axes[3] @ (wrist - elbow)) > 1e-6:
        raise ValueError(f"shoulder, elbow and wrist don't lie in one plane across {joints[3]}")
    return Arm(
        tuple(joints),
        origins,
        axes,
        np.array([joint.lower for joint in chain]),
        np.array([joint.upper for joint in chain]),
        np.array([joint.velocity for joint in chain]),
        *model.frames[tip],
        shoulder,
        elbow,
        wrist,
    )


def _meeting(origins: Array, axes: Array, what: str, joints: Sequence[str]) -> Array:
    """Return the point where three axes meet (least squares), or raise."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    point = np.linalg.solve(across.sum(0), np.einsum("nij,nj->i", across, origins))
    if np.abs(np.einsum("nij,nj->ni", across, point - origins)).max() > 1e-6:
        raise ValueError(f"the axes of {', '.join(joints)} don't meet in one point: no {what}")
    return point


def cross_matrix(axis: Array) -> Array:
    """Return the matrix (3, 3) that takes a vector to its product ``axis x vector``."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Array, b: Array) -> Array:
    """Return vector products (..., 3); `numpy.cross` takes four times as long over a few of them."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], -1)


def turn(axis: Array, angle: Array) -> Array:
    """Return rotation matrices (n, 3, 3) about a unit `axis` (3,) by `angle` (n,) radians."""
    return _turned(cross_matrix(axis), angle)


def _turned(crosses: Array, angle: Array) -> Array:
    """Return rotation matrices (..., 3, 3) by `angle` (...) radians about axes, given by their cross-product matrices."""
    sin, cos = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    matrices: Array = EYE + sin * crosses + (1 - cos) * (crosses @ crosses)
    return matrices


def link_transforms(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Return rotation (n, 7, 3, 3) and shift (n, 7, 3) of what hangs on each joint, against the zero posture.

    A point x of link i at the zero posture is at ``R[:, i] @ x + t[:, i]``.
    """
    count = len(q)
    rotations, shifts = np.empty((count, 7, 3, 3)), np.empty((count, 7, 3))
    local = _turned(arm.crosses, q)
    offset = arm.origins - np.einsum("nkij,kj->nki", local, arm.origins)
    r, t = local[:, 0], offset[:, 0]
    rotations[:, 0], shifts[:, 0] = r, t
    for i in range(1, 7):
        t = t + np.einsum("nij,nj->ni", r, offset[:, i])
        r = r @ local[:, i]
        rotations[:, i], shifts[:, i] = r, t
    return rotations, shifts


def hand_frames(arm: Arm, q: Array) -> tuple[Array, Array]:
    """Return rotation (n, 3, 3) and position (n, 3) of the hand's tip."""
    r, t = link_transforms(arm, q)
    return r[:, 6] @ arm.tip_rotation, np.einsum("nij,j->ni", r[:, 6], arm.tip) + t[:, 6]


def inverse(arm: Arm, r: Array, p: Array, swivel: Array, margin: float = 0.0) -> tuple[Array, Array]:
    """Return postures (n, 7) that put the hand at rotations `r`, points `p` with elbow `swivel`, and which are valid.

    Parameters
    ----------
    arm : Arm
    r, p, swivel : arrays (n, 3, 3), (n, 3) metres, (n,) radians
    margin : float
        Distance in radians that every joint keeps from its limits.

    Returns
    -------
    q : array (n, 7), radians
        Meaningless where not valid.
    valid : array (n,) of bool
        The point is in reach and every joint within its limits. Of the two postures of a sphere only the one that has the
        middle joint within ±90° is considered, so neighbouring poses give neighbouring postures.
    """
    last = r @ arm.tip_rotation.T
    wrist = p + np.einsum("nij,j->ni", last, arm.wrist - arm.tip)
    a, b = arm.upper_length, arm.lower_length
    reach = wrist - arm.shoulder
    distance = np.maximum(np.linalg.norm(reach, axis=-1), 1e-9)
    n = reach / distance[:, None]
    cosine = (a * a + distance**2 - b * b) / (2 * a * distance)
    valid = np.abs(cosine) < 0.9999
    cosine = np.clip(cosine, -0.9999, 0.9999)
    hang = DOWN - (n @ DOWN)[:, None] * n
    hang = hang / np.maximum(np.linalg.norm(hang, axis=-1), 1e-9)[:, None]
    out = np.cos(swivel)[:, None] * hang + np.sin(swivel)[:, None] * cross(n, hang)
    u = cosine[:, None] * n + np.sqrt(1 - cosine**2)[:, None] * out
    f = (wrist - arm.shoulder - a * u) / b
    u0, f0, hinge = (arm.elbow - arm.shoulder) / a, (arm.wrist - arm.elbow) / b, arm.axes[3]
    bent = np.arctan2(cross(u0, f0) @ hinge, u0 @ f0)
    side = 1.0 if (arm.lower[3] + arm.upper[3]) / 2 + bent > 0 else -1.0
    normal = cross(u, f)
    normal = side * normal / np.maximum(np.linalg.norm(normal, axis=-1), 1e-9)[:, None]
    zero = np.stack([u0, hinge, cross(u0, hinge)], -1)
    upper = np.stack([u, normal, cross(u, normal)], -1) @ zero.T
    elbow = side * np.arccos(np.clip(np.einsum("ni,ni->n", u, f), -1, 1)) - bent
    hand = np.swapaxes(upper @ turn(hinge, elbow), -1, -2) @ last
    q = np.concatenate([three_angles(upper, arm.axes[:3]), elbow[:, None], three_angles(hand, arm.axes[4:])], -1)
    return q, valid & np.all((q >= arm.lower + margin) & (q <= arm.upper - margin), axis=-1)


def three_angles(r: Array, axes: Array) -> Array:
    """Return the angles (n, 3) of ``turn(a1, x) @ turn(a2, y) @ turn(a3, z) = r`` (n, 3, 3); |y| <= 90° or 0 <= y <= 180°.

    Neighbouring axes are at right angles (Davenport's angles): the third is parallel to the first or completes the frame.
    """
    a1, a2, a3 = axes
    c = cross(a1, a2)
    if abs(a1 @ a3) > 0.5:
        v = np.einsum("nij,j->ni", r, a1)
        y = np.arccos(np.clip(v @ a1, -1, 1))
        x = np.arctan2(v @ a2, -(v @ c))
    else:
        v = np.einsum("nij,j->ni", r, a3) * np.sign(c @ a3)
        y = np.arcsin(np.clip(v @ a1, -1, 1))
        x = np.arctan2(-(v @ a2), v @ c)
    rest = np.swapaxes(turn(a1, x) @ turn(a2, y), -1, -2) @ r
    moved = np.einsum("nij,j->ni", rest, a2)
    return np.stack([x, y, np.arctan2(moved @ cross(a3, a2), moved @ a2)], -1)


def swivel_of(arm: Arm, q: Array) -> Array:
    """Return the elbow swivel (n,) of postures: the inverse of what `inverse` was given."""
    r, t = link_transforms(arm, q)
    elbow = np.einsum("nij,j->ni", r[:, 2], arm.elbow) + t[:, 2] - arm.shoulder
    wrist = np.einsum("nij,j->ni", r[:, 3], arm.wrist) + t[:, 3] - arm.shoulder
    n = wrist / np.linalg.norm(wrist, axis=-1, keepdims=True)
    hang = DOWN - (n @ DOWN)[:, None] * n
    swivel: Array = np.arctan2(np.einsum("ni,ni->n", elbow, cross(n, hang)), np.einsum("ni,ni->n", elbow, hang))
    return swivel
