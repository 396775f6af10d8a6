"""Inverse kinematics: postures for poses of the hand, in closed form if the arm has a closed form, otherwise numerically.

An arm with a closed form has three axes through the shoulder, one at the elbow and three at the wrist. A pose of the hand
leaves the arm one degree of freedom, the *swivel*. If all three axes of the wrist meet (KUKA's iiwa), the swivel is the elbow's
angle about the line from shoulder to wrist. At swivel 0 the elbow hangs down, or points up if the upper arm points up at the
zero posture. If the last axis misses the intersection of the two axes before it (Franka's Panda), the swivel is the angle of
the last joint from the middle of its limits, minus the roll of the hand. For a given swivel, the other six joints have a closed
form. `confab.sim.numeric` solves arms without a closed form. In an arm without a closed form, the swivel is the angle of the
third joint from the middle of its limits (seven joints), or always 0 (six joints).

Arrays have these names: ``q`` are postures (n, k) of k joints in radians, ``R`` are rotations (n, 3, 3), ``p`` are points (n,
3) in metres, and ``a`` are axes. S, E and W are shoulder, elbow and wrist.
"""

from __future__ import annotations

import numpy as np

from confab.sim.arms import Arm, Flags, cross, hand_frames, link_transforms, turn
from confab.sim.numeric import REDUNDANT, solved
from confab.sim.urdf import Array

STRETCHED = 0.9999
"""Maximum cosine of a joint's angle at which the joint's two solutions still differ; the solutions meet at cosine 1."""


def inverse(arm: Arm, r: Array, p: Array, swivel: Array, margin: float = 0.0, fold: float = 0.0) -> tuple[Array, Flags]:
    """Return postures (n, k) with the hand at rotations `r` and points `p` and the arm at `swivel`, and validity flags.

    Parameters
    ----------
    arm : Arm
    r, p, swivel : arrays (n, 3, 3), (n, 3) metres, (n,) radians
    margin : float
        Distance in radians that every joint keeps from its limits.
    fold : float
        Distance in radians that a joint keeps from the angle where its two solutions meet; the arm's reach ends at this angle.

    Returns
    -------
    q : array (n, k), radians
        The postures; they are undefined where `valid` is false.
    valid : array (n,) of bool
        Whether the point is in reach and every joint is within its limits. Only one of the two postures of a spherical joint is
        considered, so that neighbouring poses have neighbouring postures. The middle joint of the considered posture is within
        ±90°. If the outer axes of the spherical joint are parallel, the considered posture is the one farther from the joint's
        limits. Without a closed form, the considered posture is the result of a search that starts from the rest posture.
    """
    if not arm.closed:
        return solved(arm, r, p, swivel, margin, fold)
    most = min(STRETCHED, float(np.cos(fold)))
    q, valid = (_by_elbow if arm.spherical else _by_last_joint)(arm, r, p, swivel, most)
    return q, valid & np.all((q >= arm.lower + margin) & (q <= arm.upper - margin), axis=-1)


def _by_elbow(arm: Arm, r: Array, p: Array, swivel: Array, most: float) -> tuple[Array, Flags]:
    """Return postures with the elbow at `swivel` about the line from shoulder to wrist, and flags of reachable postures."""
    last = r @ arm.tip_rotation.T
    wrist = p + np.einsum("nij,j->ni", last, arm.wrist - arm.tip)
    a, b, zero, bent, side = arm.limbs
    reach = wrist - arm.shoulder
    distance = np.maximum(_length(reach), 1e-9)
    n = reach / distance[:, None]
    cosine = (a * a + distance**2 - b * b) / (2 * a * distance)
    valid = np.abs(cosine) < most
    cosine = np.minimum(np.maximum(cosine, -STRETCHED), STRETCHED)
    hang = arm.hang - (n @ arm.hang)[:, None] * n
    hang = hang / np.maximum(_length(hang), 1e-9)[:, None]
    out = np.cos(swivel)[:, None] * hang + np.sin(swivel)[:, None] * cross(n, hang)
    u = cosine[:, None] * n + np.sqrt(1 - cosine**2)[:, None] * out
    f = (wrist - arm.shoulder - a * u) / b
    normal = cross(u, f)
    normal = side * normal / np.maximum(_length(normal), 1e-9)[:, None]
    upper = np.stack([u, normal, cross(u, normal)], -1) @ zero.T
    elbow = side * _arccos(np.einsum("ni,ni->n", u, f)) - bent
    hand = np.swapaxes(upper @ turn(arm.axes[3], elbow), -1, -2) @ last
    q = np.concatenate(
        [_angles_far_from_limits(arm, upper, 0), elbow[:, None], _angles_far_from_limits(arm, hand, 4)], -1
    )
    return q, valid


def _angles_far_from_limits(arm: Arm, r: Array, first: int) -> Array:
    """Return the angles (n, 3) of the spherical joint from joint `first` on, by the solution farther from the limits."""
    axes, part = arm.axes[first : first + 3], slice(first, first + 3)
    three = three_angles(r, axes)
    if abs(axes[0] @ axes[2]) < 0.5:
        return three
    both = np.stack([_wrapped(way - arm.middle[part]) for way in (three, _flipped(three, axes))])
    strain = np.abs(both / (arm.upper[part] - arm.lower[part])).max(-1)
    return np.asarray(arm.middle[part] + both[np.argmin(strain, axis=0), np.arange(len(three))])


def _by_last_joint(arm: Arm, r: Array, p: Array, swivel: Array, most: float) -> tuple[Array, Flags]:
    """Return postures, with the last joint at the sum of its middle, `swivel` and the hand's roll, and flags of reachable ones.

    The last angle determines the wrist (w) and the direction of the sixth axis (e). The distance from shoulder to wrist
    determines the elbow's angle. The angle between the directions of the wrist and of the sixth axis determines the
    angle of the fifth joint. The directions of the wrist and of the sixth axis together determine the shoulder's
    rotation.
    """
    shoulder, fourth, fifth, sixth = arm.shoulder, arm.axes[3], arm.axes[4], arm.axes[5]
    hand = r @ arm.tip_rotation.T
    seventh = arm.middle[6] + swivel + _rolled(arm, r)
    before = hand @ turn(arm.axes[6], -seventh)
    w = p + hand @ (arm.origins[6] - arm.tip) + before @ (arm.wrist - arm.origins[6]) - shoulder
    e = before @ sixth
    upper, lower = arm.origins[3] - shoulder, arm.wrist - arm.origins[3]
    elbow, reached = _angles_of(
        fourth, upper[None], lower, (np.einsum("ni,ni->n", w, w) - upper @ upper - lower @ lower) / 2, most
    )
    elbow = elbow[:, 1 if _wrapped(arm.middle[3] - _phase(fourth, upper, lower)) > 0 else 0]
    bent = turn(fourth, elbow)
    v = np.swapaxes(bent, -1, -2) @ upper + lower  # vector from shoulder to wrist in the forearm's frame
    both, met = _angles_of(fifth, v, sixth, np.einsum("ni,ni->n", w, e), most)
    found = []
    for angle in both.T:
        forearm = bent @ turn(fifth, angle)
        shoulder_turn = _frame(w, e) @ np.swapaxes(_frame(np.einsum("nij,nj->ni", bent, v), forearm @ sixth), -1, -2)
        across = cross(sixth, fifth)
        rest = np.swapaxes(shoulder_turn @ forearm, -1, -2) @ before @ across
        last = np.arctan2(rest @ cross(sixth, across), rest @ across)
        three = three_angles(shoulder_turn, arm.axes[:3])
        others = np.stack([elbow, angle, last, seventh], -1)
        found += [np.concatenate([way, others], -1) for way in (three, _flipped(three, arm.axes[:3]))]
    offsets = _wrapped(np.stack(found) - arm.middle)
    strain = np.abs(offsets / (arm.upper - arm.lower)).max(-1)  # prefer the posture farthest from all limits
    return arm.middle + offsets[np.argmin(strain, axis=0), np.arange(len(p))], reached & met


def _flipped(three: Array, axes: Array) -> Array:
    """Return the second solution (n, 3) of three angles about `axes`, which gives the same rotation."""
    x, y, z = three.T
    return np.stack([x + np.pi, (0.0 if abs(axes[0] @ axes[2]) > 0.5 else np.pi) - y, z + np.pi], -1)


def _rolled(arm: Arm, r: Array) -> Array:
    """Return the roll (n,) of level hands, as an angle of the last joint."""
    along = np.sign(arm.axes[6] @ arm.tip_rotation[:, 0])
    return np.asarray(along * np.arctan2(r[:, 2, 1], r[:, 2, 2]))


def _phase(axis: Array, a: Array, b: Array) -> float:
    """Return the angle in radians about an axis that turns `b` nearest to `a`."""
    return float(np.arctan2(a @ cross(axis, b), a @ b - (a @ axis) * (b @ axis)))


def _angles_of(axis: Array, a: Array, b: Array, product: Array, most: float) -> tuple[Array, Flags]:
    """Return the two angles (n, 2) by which `b` (3,) turns about an axis to a given dot product with `a` (n, 3), and flags.

    The flag of two angles is true if the absolute cosine that determines the angles is below `most`.
    """
    cosine, sine = a @ b - (a @ axis) * (b @ axis), a @ cross(axis, b)
    reach = np.maximum(np.hypot(cosine, sine), 1e-9)
    share = (product - (a @ axis) * (b @ axis)) / reach
    half = _arccos(share)
    middle = np.arctan2(sine, cosine)
    return _wrapped(np.stack([middle - half, middle + half], -1)), np.abs(share) < most


def _frame(a: Array, b: Array) -> Array:
    """Return right-handed frames (n, 3, 3) with the first axis along `a`, and the second axis in the plane of `a` and `b`."""
    first = a / np.maximum(_length(a), 1e-9)[:, None]
    across = b - np.einsum("ni,ni->n", first, b)[:, None] * first
    second = across / np.maximum(_length(across), 1e-9)[:, None]
    return np.stack([first, second, cross(first, second)], -1)


def _length(vectors: Array) -> Array:
    """Return the lengths (n,) of vectors (n, 3); for a few vectors, in half of the time of `numpy.linalg.norm`."""
    return np.asarray(np.sqrt(np.add.reduce(vectors * vectors, axis=-1)))


def _arccos(cosine: Array) -> Array:
    return np.asarray(np.arccos(np.minimum(np.maximum(cosine, -1), 1)))


def _wrapped(angle: Array) -> Array:
    """Return equivalent angles within ±180°, in radians."""
    return np.asarray((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)


def three_angles(r: Array, axes: Array) -> Array:
    """Return the angles x, y, z (n, 3) that solve ``turn(a1, x) @ turn(a2, y) @ turn(a3, z) = r`` (Davenport's angles).

    Neighbouring axes are at right angles. The third axis is parallel to the first (then 0 <= y <= 180°), or the three axes
    form a frame (then |y| <= 90°).
    """
    a1, a2, a3 = axes
    c = cross(a1, a2)
    if abs(a1 @ a3) > 0.5:
        v = np.einsum("nij,j->ni", r, a1)
        y = _arccos(v @ a1)
        x = np.arctan2(v @ a2, -(v @ c))
    else:
        v = np.einsum("nij,j->ni", r, a3) * np.sign(c @ a3)
        y = np.arcsin(np.minimum(np.maximum(v @ a1, -1), 1))
        x = np.arctan2(-(v @ a2), v @ c)
    rest = np.swapaxes(turn(a1, x) @ turn(a2, y), -1, -2) @ r
    moved = np.einsum("nij,j->ni", rest, a2)
    return np.stack([x, y, np.arctan2(moved @ cross(a3, a2), moved @ a2)], -1)


def swivel_of(arm: Arm, q: Array) -> Array:
    """Return the swivels (n,) of postures (n, k)."""
    if not arm.closed:
        return q[:, REDUNDANT] - arm.middle[REDUNDANT] if arm.swivels else np.zeros(len(q))
    if not arm.spherical:
        return _wrapped(q[:, 6] - arm.middle[6] - _rolled(arm, hand_frames(arm, q)[0]))
    r, t = link_transforms(arm, q)
    elbow = np.einsum("nij,j->ni", r[:, 2], arm.elbow) + t[:, 2] - arm.shoulder
    wrist = np.einsum("nij,j->ni", r[:, 3], arm.wrist) + t[:, 3] - arm.shoulder
    n = wrist / np.linalg.norm(wrist, axis=-1, keepdims=True)
    hang = arm.hang - (n @ arm.hang)[:, None] * n
    swivel: Array = np.arctan2(np.einsum("ni,ni->n", elbow, cross(n, hang)), np.einsum("ni,ni->n", elbow, hang))
    return swivel
