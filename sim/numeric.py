"""Inverse kinematics of arms without a closed form: damped least squares within the joints' limits.

The search starts from the rest posture, turned about the arm's first axis until the arm points to the goal. From this
posture, the hand is led straight to the goal in several stretches. Therefore equal poses have equal postures, and
neighbouring poses have neighbouring postures unless the arm has to reconfigure. If the first search fails, further
searches start from random postures with a fixed seed.
"""

from __future__ import annotations

import numpy as np

from confab.sim.arms import Arm, Flags, cross, hand_frames, link_transforms, turn_about
from confab.sim.urdf import Array

REDUNDANT = 2
"""Index of the joint of a seven-joint arm whose angle from the middle of its limits is the swivel."""

STRETCHES, EACH = 6, 3
"""Number of stretches in which the hand is led to its goal, and number of search steps for each stretch."""

STARTS, AROUND = 6, 1.5
"""Number of random start postures, and maximum deviation in radians of their joints from the rest posture."""

STEPS, STRIDE = 30, 0.6
"""Maximum number of steps of a search, and maximum motion in radians of a joint in one step."""

EXACT, CLOSE = 1e-10, 1e-7
"""Error in metres and radians at which a search ends early, and maximum error of a valid result."""

DAMPING = 1e-6
"""Damping of the normal equations in proportion to the error, in addition to half of the squared error.

With more damping, the search is slower. With less damping, the search is unstable.
"""

SINGULAR = 0.45
"""Ratio of the Jacobian's least singular value to the sine of the angle between the limbs, for an arm of two equal limbs."""


def solved(arm: Arm, r: Array, p: Array, swivel: Array, margin: float, fold: float) -> tuple[Array, Flags]:
    """Return postures (n, k) with the hand at rotations `r` and points `p`, and validity flags; see `kinematics.inverse`."""
    low, high = arm.lower + margin, arm.upper - margin
    found, valid = np.tile(np.clip(arm.home, low, high), (len(p), 1)), np.zeros(len(p), dtype=bool)
    if arm.swivels:
        found[:, REDUNDANT] = arm.middle[REDUNDANT] + swivel
        asked = (found[:, REDUNDANT] >= low[REDUNDANT]) & (found[:, REDUNDANT] <= high[REDUNDANT])
    else:
        asked = np.abs(swivel) < CLOSE
    last = r @ arm.tip_rotation.T
    wrist = p + np.einsum("nij,j->ni", last, arm.wrist - arm.tip)
    left = np.flatnonzero(asked & (np.linalg.norm(wrist - arm.shoulder, axis=-1) < arm.length))
    starts = np.clip(arm.home + np.random.default_rng(0).uniform(-AROUND, AROUND, (STARTS, len(low))), low, high)
    for start in (None, *starts):
        if not len(left):
            break
        q = found[left]
        if start is None:
            q = _led_postures(arm, q, last[left], p[left], low, high)
        else:
            free = _free(arm)
            q[:, free] = start[free]
        q, good = _search(arm, q, last[left], p[left], low, high, STEPS)
        found[left[good]], valid[left[good]] = q[good], True
        left = left[~good]
    if fold and valid.any():
        some = np.flatnonzero(valid)
        valid[some] = _least_singular_value(arm, found[some]) > SINGULAR * np.sin(fold)
    return found, valid


def _free(arm: Arm) -> list[int]:
    """Return the indices of the joints that the swivel does not determine."""
    return [i for i in range(len(arm.joints)) if not (arm.swivels and i == REDUNDANT)]


def _led_postures(arm: Arm, q: Array, last: Array, p: Array, low: Array, high: Array) -> Array:
    """Return the postures (n, k) near the goal poses to which the hand is led in stretches from postures `q`."""
    axis, foot = arm.axes[0], arm.origins[0]
    ahead, wanted = hand_frames(arm, q)[1] - foot, p - foot
    round_it = np.arctan2(cross(ahead, wanted) @ axis, (ahead * wanted).sum(-1) - (ahead @ axis) * (wanted @ axis))
    q = q.copy()
    q[:, 0] = np.clip(q[:, 0] + round_it, low[0], high[0])
    r, begin = hand_frames(arm, q)
    first = r @ arm.tip_rotation.T
    turned = _angle(last @ np.swapaxes(first, -1, -2))
    for share in np.linspace(0.0, 1.0, STRETCHES + 1)[1:]:
        q, _ = _search(arm, q, turn_about(turned * share) @ first, begin + share * (p - begin), low, high, EACH)
    return q


def _search(arm: Arm, q: Array, last: Array, p: Array, low: Array, high: Array, steps: int) -> tuple[Array, Flags]:
    """Return the postures (n, k) at which searches from `q` end, and flags of the searches that reach the goal.

    The goal is the rotation `last` of the last link relative to the zero posture, and the hand's point `p`.
    """
    q, free = q.copy(), _free(arm)
    going, size = np.arange(len(q)), np.full(len(q), np.inf)
    for _ in range(steps):
        error, jacobian = _error(arm, q[going], last[going], p[going])
        size[going] = np.linalg.norm(error, axis=-1)
        more = size[going] > EXACT
        if not more.any():
            break
        going, error, jacobian = going[more], error[more], jacobian[more][..., free]
        square = np.einsum("nij,nik->njk", jacobian, jacobian)
        square[:, range(len(free)), range(len(free))] += (size[going] ** 2 / 2 + DAMPING * size[going])[:, None]
        step = np.linalg.solve(square, np.einsum("nij,ni->nj", jacobian, error)[..., None])[..., 0]
        step *= np.minimum(1.0, STRIDE / np.maximum(np.abs(step).max(-1), 1e-12))[:, None]
        now = q[going]
        now[:, free] = np.clip(now[:, free] + step, low[free], high[free])
        q[going] = now
    return q, size < CLOSE


def _error(arm: Arm, q: Array, last: Array, p: Array) -> tuple[Array, Array]:
    """Return the hand's error (n, 6) in metres and radians, and the Jacobian (n, 6, k)."""
    rotations, shifts = link_transforms(arm, q)
    tip = np.einsum("nij,j->ni", rotations[:, -1], arm.tip) + shifts[:, -1]
    axes = np.einsum("nkij,kj->nki", rotations, arm.axes)
    origins = np.einsum("nkij,kj->nki", rotations, arm.origins) + shifts
    columns = np.concatenate([cross(axes, tip[:, None] - origins), axes], -1)
    missed = _angle(last @ np.swapaxes(rotations[:, -1], -1, -2))
    return np.concatenate([p - tip, missed], -1), np.swapaxes(columns, -1, -2)


def _angle(r: Array) -> Array:
    """Return rotations (n, 3, 3) as rotation vectors (n, 3)."""
    skew = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], -1) / 2
    sine = np.linalg.norm(skew, axis=-1)
    angle = np.arctan2(sine, (np.trace(r, axis1=1, axis2=2) - 1) / 2)
    return np.asarray(skew * (angle / np.maximum(sine, 1e-12))[:, None])


def _least_singular_value(arm: Arm, q: Array) -> Array:
    """Return the least singular values (n,) of the Jacobian, with lengths in units of half the arm's length."""
    jacobian = _error(arm, q, np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3)))[1]
    jacobian[:, :3] /= arm.length / 2
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[:, 5])
