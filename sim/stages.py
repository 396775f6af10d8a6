"""The poses in which a hand can be at a point, and the stages of a grasp: geometry alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sim.collision import Surroundings
from sim.motion import SWIVELS, YAWS, poses_at
from sim.urdf import Array

Numbers = Mapping[str, float]

MARGIN = 0.008
"""Metres kept off everything."""


@dataclass(frozen=True)
class Stage:
    """Poses (n, 6) that all candidates must allow, what may be touched there, and what else there is around by then.

    The fingers have by then `closed` around something, or are as the others' are. At a handle, which is `near` what it is on,
    a hand keeps off other things by little. Every joint keeps `slack` radians more than usual from its limits, and
    `fold` from where the arm would be stretched.
    What the hand holds now is `released` by then. The joint that is moved is at `joint`.
    """

    poses: Array
    ignored: tuple[str, ...] = ()
    around: Surroundings | None = None
    closed: bool = False
    near: bool = False
    slack: float = 0.0
    fold: float = 0.0
    released: bool = False
    joint: float | None = None


def fan() -> tuple[Array, Array]:
    """Return yaws and swivels (n,) of all the ways to be at a point that are considered."""
    yaw, swivel = np.meshgrid(YAWS, SWIVELS)
    return yaw.ravel(), swivel.ravel()


def grip_stages(grip: Array, numbers: Numbers, ignored: tuple[str, ...] = ()) -> tuple[Stage, Stage, Stage]:
    """Return the stages of a grasp at point `grip` (3,): around it, before it, and raised above it, for the whole `fan`."""
    yaw, swivel = fan()
    heading = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    raised = np.array([0.0, 0.0, numbers["raised"]])
    return (
        Stage(poses_at(grip, yaw, 0.0, swivel), ignored),
        Stage(poses_at(grip - numbers["approach"] * heading, yaw, 0.0, swivel)),
        Stage(poses_at(grip + raised, yaw, 0.0, swivel), ignored),
    )
