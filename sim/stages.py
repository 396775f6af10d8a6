"""Geometry of the candidate poses of a hand at a point, and of the stages of a grasp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from confab.sim.collision import Obstacles
from confab.sim.motion import SWIVELS, YAWS, poses_at
from confab.sim.urdf import Array

Numbers = Mapping[str, float]

RISES = 4
"""Number of heights to which a hand may lift, from the setting `raised` down to `least_raised`."""

MARGIN = 0.008
"""Margin in metres to all obstacles."""


@dataclass(frozen=True)
class Stage:
    """One stage of a motion, with one pose for each of n candidates.

    `poses` (n, 6) are the candidates' poses, and `ignored` are the obstacles that the stage may touch. `around`, if given, has
    the obstacles at this stage. `closed` is true if the fingers are closed around something, and `released` is true if the hand
    has released its load. `near` is true if the hand holds a handle; the margin is then small. `slack` is an additional margin
    in radians to the limits of the joints, and `fold` is the margin in radians to the stretched arm. `joint` is the value of
    the moved joint of furniture. `phase` is the name of the skill's phase.
    """

    poses: Array
    ignored: tuple[str, ...] = ()
    around: Obstacles | None = None
    closed: bool = False
    near: bool = False
    slack: float = 0.0
    fold: float = 0.0
    released: bool = False
    joint: float | None = None
    phase: str = ""


def rises(numbers: Numbers) -> tuple[float, ...]:
    """Return the heights to which a hand may lift, the highest first."""
    return tuple(np.linspace(numbers["raised"], min(numbers["raised"], numbers["least_raised"]), RISES).tolist())


def fan() -> tuple[Array, Array]:
    """Return the yaws and swivels (n,) of all candidate poses at a point."""
    yaw, swivel = np.meshgrid(YAWS, SWIVELS)
    return yaw.ravel(), swivel.ravel()


def grip_stages(grip: Array, numbers: Numbers, ignored: tuple[str, ...] = ()) -> tuple[Stage, Stage, Stage]:
    """Return the stages of a grasp at point `grip` (3,) for all poses of `fan`: the grasp, its approach and its lift."""
    yaw, swivel = fan()
    heading = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    raised = np.array([0.0, 0.0, numbers["raised"]])
    return (
        Stage(poses_at(grip, yaw, 0.0, swivel), ignored),
        Stage(poses_at(grip - numbers["approach"] * heading, yaw, 0.0, swivel)),
        Stage(poses_at(grip + raised, yaw, 0.0, swivel), ignored),
    )
