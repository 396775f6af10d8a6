"""Inverse kinematics of arms without a closed form: damped least squares, within the joints' limits.

A posture is found by turning the arm at rest about its first axis until it points to where the hand shall be, and leading the hand
straight there, a stretch at a time. So the same
pose always has the same posture, and neighbouring poses have neighbouring ones, but for where the arm has to change over on the
way. What isn't found so is searched for from other postures, which are drawn with a fixed seed.
"""

from __future__ import annotations

import numpy as np

from sim.arms import Arm, Flags, cross, hand_frames, link_transforms, turn_about
from sim.urdf import Array

REDUNDANT = 2
"""The joint of seven that the swivel turns, from the middle of its limits."""

STRETCHES, EACH = 6, 3
"""Stretches in which the hand is led from its pose at rest, and steps for each."""

STARTS, AROUND = 6, 1.5
"""Postures from which is searched for what isn't found so, and radians by which their joints are beside those at rest."""

STEPS, STRIDE = 30, 0.6
"""So many steps a search may take, and radians by which a joint moves in one at most."""

EXACT, CLOSE = 1e-10, 1e-7
"""Metres and radians within which a search ends, and within which a posture that it ends at counts."""

DAMPING = 1e-6
"""What the squares of the Jacobian are damped by beside the error: more is slower, less is wild near singularities."""

SINGULAR = 0.45
"""The least singular value of an arm of two equal limbs at an angle, as a share of the sine of that angle."""


def solved(arm: Arm, r: Array, p: Array, swivel: Array, margin: float, fold: float) -> tuple[Array, Flags]:
    """Return postures (n, k) that put the hand at rotations `r` and points `p`, and which are valid: `sim.kinematics.inverse`."""
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
            q = _led(arm, q, last[left], p[left], low, high)
        else:
            free = _free(arm)
            q[:, free] = start[free]
        q, good = _searched(arm, q, last[left], p[left], low, high, STEPS)
        found[left[good]], valid[left[good]] = q[good], True
        left = left[~good]
    if fold and valid.any():
        some = np.flatnonzero(valid)
        valid[some] = _least(arm, found[some]) > SINGULAR * np.sin(fold)
    return found, valid


def _free(arm: Arm) -> list[int]:
    """Return the numbers of the joints that aren't given by the swivel."""
    return [i for i in range(len(arm.joints)) if not (arm.swivels and i == REDUNDANT)]


def _led(arm: Arm, q: Array, last: Array, p: Array, low: Array, high: Array) -> Array:
    """Return the postures (n, k) in which the arm comes near to the poses when the hand is led there from postures `q`."""
    axis, foot = arm.axes[0], arm.origins[0]
    ahead, wanted = hand_frames(arm, q)[1] - foot, p - foot
    round_it = np.arctan2(cross(ahead, wanted) @ axis, (ahead * wanted).sum(-1) - (ahead @ axis) * (wanted @ axis))
    q = q.copy()
    q[:, 0] = np.clip(q[:, 0] + round_it, low[0], high[0])
    r, begin = hand_frames(arm, q)
    first = r @ arm.tip_rotation.T
    turned = _angle(last @ np.swapaxes(first, -1, -2))
    for share in np.linspace(0.0, 1.0, STRETCHES + 1)[1:]:
        q, _ = _searched(arm, q, turn_about(turned * share) @ first, begin + share * (p - begin), low, high, EACH)
    return q


def _searched(arm: Arm, q: Array, last: Array, p: Array, low: Array, high: Array, steps: int) -> tuple[Array, Flags]:
    """Return the postures (n, k) at which searches from `q` end, and which of them put the hand where it should be.

    `last` is how the last link should be turned against the zero posture.
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
    """Return by how much (n, 6) the hand misses where it should be, and the Jacobian (n, 6, k)."""
    rotations, shifts = link_transforms(arm, q)
    tip = np.einsum("nij,j->ni", rotations[:, -1], arm.tip) + shifts[:, -1]
    axes = np.einsum("nkij,kj->nki", rotations, arm.axes)
    origins = np.einsum("nkij,kj->nki", rotations, arm.origins) + shifts
    columns = np.concatenate([cross(axes, tip[:, None] - origins), axes], -1)
    missed = _angle(last @ np.swapaxes(rotations[:, -1], -1, -2))
    return np.concatenate([p - tip, missed], -1), np.swapaxes(columns, -1, -2)


def _angle(r: Array) -> Array:
    """Return rotations (n, 3, 3) as axes times angles (n, 3)."""
    skew = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], -1) / 2
    sine = np.linalg.norm(skew, axis=-1)
    angle = np.arctan2(sine, (np.trace(r, axis1=1, axis2=2) - 1) / 2)
    return np.asarray(skew * (angle / np.maximum(sine, 1e-12))[:, None])


def _least(arm: Arm, q: Array) -> Array:
    """Return the least singular values (n,) of the Jacobian, lengths as shares of half of the arm's."""
    jacobian = _error(arm, q, np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3)))[1]
    jacobian[:, :3] /= arm.length / 2
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False)[:, 5])
