"""Grasp features of things as frames, and candidate orientations of a hand at the features.

In a feature's frame, x is the direction in which the fingers point, y leads from finger to finger, and z is the axis around
which the fingers close. A hand always points horizontally. If z is vertical, every turn of the hand about z is allowed;
otherwise at most two turns are allowed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from confab.reasoner.embodiment.values import Feature
from confab.sim.arms import turn
from confab.sim.bodies import UP, half_width, height_of
from confab.sim.engine import Engine
from confab.sim.linkage import feature_frame
from confab.sim.motion import SWIVELS, YAWS
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError

AROUND = 2 * np.pi - 0.01
"""Minimum range of angles, in radians, that counts as a full turn."""

SKEWED = 20.0
"""Cost of a candidate per metre of additional width between fingers that don't lie flat on the faces of a box."""

TURNS = 13
"""Number of turns that are tried about a vertical axis with a limited range."""


@dataclass(frozen=True)
class FeatureFrame:
    """A feature in the world: rotation (3, 3), point (3,), and the range in radians of a hand's turn about the feature's z.

    `across` returns half of the width of an object between the fingers, in metres, for turns (n,).
    """

    rotation: Array
    point: Array
    low: float = -np.pi
    high: float = np.pi
    across: Callable[[Array], Array] | None = None

    @property
    def upright(self) -> bool:
        """Whether z is vertical, so that the hand stays level in every turn about z."""
        return bool(np.hypot(self.rotation[2, 0], self.rotation[2, 1]) < 1e-6)

    def turns(self) -> Array:
        """Return the angles (n,) about z that are tried."""
        if self.high - self.low > AROUND:
            around: Array = YAWS
            return around
        if self.upright:
            return np.linspace(self.low, self.high, TURNS if self.high > self.low else 1)
        return np.array([angle for angle in self.level() if self.low - 1e-6 <= angle <= self.high + 1e-6])

    def level(self) -> tuple[float, float]:
        """Return the two angles of a turn about the feature's z axis at which the hand points horizontally, if z isn't vertical."""
        angle = float(np.arctan2(-self.rotation[2, 0], self.rotation[2, 1]))
        return angle, float(np.angle(np.exp(1j * (angle + np.pi))))


@dataclass(frozen=True)
class Ways:
    """Candidates (n,) for a hand at a feature: swivels, and turns about the feature's z axis before and after a joint has moved.

    `cost` (n,) is the cost of a turn at which the fingers don't lie flat on the faces of a box.
    """

    first: Array
    last: Array
    swivel: Array
    cost: Array | None = None

    def pick(self, i: int) -> Ways:
        """Return candidate number `i`."""
        return Ways(self.first[i : i + 1], self.last[i : i + 1], self.swivel[i : i + 1])


def ways(frame: FeatureFrame, moving: bool, opening: float = np.inf) -> Ways:
    """Return all candidates at a feature at which an object fits between fingers that are open by `opening` metres each.

    If the feature's joint is `moving`, the hand may turn during the motion.
    """
    turns = frame.turns()
    if moving and frame.upright and frame.across is None:
        turns = np.linspace(frame.low, frame.high, TURNS if frame.high > frame.low else 1)
        return Ways(*(part.ravel() for part in np.meshgrid(turns, turns, SWIVELS)))
    if frame.across is not None:
        half = frame.across(turns)
        turn, swivel = (part.ravel() for part in np.meshgrid(turns[half < opening], SWIVELS))
        return Ways(turn, turn, swivel, SKEWED * (frame.across(turn) - half.min()))
    turn, swivel = (part.ravel() for part in np.meshgrid(turns, SWIVELS))
    return Ways(turn, turn, swivel)


def locate(engine: Engine, name: str, feature: str, values: Mapping[str, float] | None = None) -> FeatureFrame:
    """Return the frame of a feature: perceived for an object or place, true for a link, with joints at `values` if given.

    Raises
    ------
    SkillError
        The object is not visible, or has no such feature.
    """
    if name in engine.embodiment.places:
        return FeatureFrame(np.eye(3), engine.place(name, sensed=True))
    if name in engine.links:
        mechanic = engine.links[name]
        found = mechanic.link(name).features.get(feature)
        if found is None:
            raise SkillError("ill-defined", (name,), f"{name} has no feature '{feature}'")
        turned, point = feature_frame(mechanic.frame(name, values), found)
        return FeatureFrame(turned, point, found.low, found.high)
    rotation, base = engine.sense(name)
    shape = engine.bodies[name].shape
    height = {"base": 0.0, "grip": shape.grasp_height, "top": height_of(shape)}.get(feature)
    if height is None:
        raise SkillError("ill-defined", (name,), f"{name} has no feature '{feature}'")
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0]) if shape.kind == "box" else 0.0
    frame = FeatureFrame(turn(UP, np.array(yaw)), base + height * UP)
    return replace(frame, across=partial(half_width, shape, height)) if height else frame


def touched(engine: Engine, name: str, feature: str) -> tuple[str, ...]:
    """Return the parts of a link that a hand touches at a feature, or the name of an object or place with the feature."""
    if name in engine.links:
        found: Feature | None = engine.links[name].link(name).features.get(feature)
        return found.parts if found is not None else ()
    return (name,)
