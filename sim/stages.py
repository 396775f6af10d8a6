"""The candidate poses of a hand at a point, and the stages of a grasp: geometry alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from confab.sim.collision import Surroundings
from confab.sim.motion import SWIVELS, YAWS, poses_at
from confab.sim.urdf import Array

Numbers = Mapping[str, float]

RISES = 4
"""Number of heights to which a hand may lift, from the raised to the least raised height."""

MARGIN = 0.008
"""Margin in metres to all obstacles."""


@dataclass(frozen=True)
class Stage:
    """One stage of a motion.

    A pose (n, 6) for each candidate, `ignored` obstacles, and the surroundings at that stage if they differ. `closed`: the
    fingers are closed around something. `near`: the hand holds a handle, so its margin is small. `slack` and `fold`: radians
    that every joint keeps from its limits in addition, and from the stretched arm. `released`: the hand has released its load.
    `joint`: the value of the moved joint of furniture.
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


def rises(numbers: Numbers) -> tuple[float, ...]:
    """Return the heights to which a hand may lift, the highest first."""
    return tuple(np.linspace(numbers["raised"], min(numbers["raised"], numbers["least_raised"]), RISES).tolist())


def fan() -> tuple[Array, Array]:
    """Return the yaws and swivels (n,) of all candidate poses at a point."""
    yaw, swivel = np.meshgrid(YAWS, SWIVELS)
    return yaw.ravel(), swivel.ravel()


def grip_stages(grip: Array, numbers: Numbers, ignored: tuple[str, ...] = ()) -> tuple[Stage, Stage, Stage]:
    """Return the stages of a grasp at point `grip` (3,) for the whole `fan`: grasp, approach before it, lift after it."""
    yaw, swivel = fan()
    heading = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    raised = np.array([0.0, 0.0, numbers["raised"]])
    return (
        Stage(poses_at(grip, yaw, 0.0, swivel), ignored),
        Stage(poses_at(grip - numbers["approach"] * heading, yaw, 0.0, swivel)),
        Stage(poses_at(grip + raised, yaw, 0.0, swivel), ignored),
    )
