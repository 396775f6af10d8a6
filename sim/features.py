"""Where a hand can take hold: the features of things as frames, and the ways to bring a hand to them.

A frame has x where the fingers point, y from finger to finger, and z along what they close around. A hand points level, so of the
ways to turn about z those are left in which it does: all of them if z is upright, else at most two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reasoner.embodiment.values import Feature
from sim.bodies import height_of
from sim.engine import Engine
from sim.linkage import feature_frame
from sim.motion import SWIVELS, YAWS
from sim.urdf import Array
from sim.verdict import SkillError

AROUND = 2 * np.pi - 0.01
"""Who may turn by more than that may turn all the way round."""

TURNS = 13
"""So many ways to turn about an upright bar are tried."""


@dataclass(frozen=True)
class Frame:
    """A feature in the world: rotation (3, 3), point (3,), and from where to where a hand may turn about its z (radians)."""

    rotation: Array
    point: Array
    low: float = -np.pi
    high: float = np.pi

    @property
    def upright(self) -> bool:
        """Whether z is vertical, so that a hand is level however it turns."""
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
        """Return the two angles about a z that isn't upright at which x is level."""
        angle = float(np.arctan2(-self.rotation[2, 0], self.rotation[2, 1]))
        return angle, float(np.angle(np.exp(1j * (angle + np.pi))))


@dataclass(frozen=True)
class Ways:
    """How a hand may be at a feature: turned about its z by `first` radians, after the joint has moved by `last`; elbow swivels."""

    first: Array
    last: Array
    swivel: Array

    def pick(self, i: int) -> Ways:
        """Return one of the ways."""
        return Ways(self.first[i : i + 1], self.last[i : i + 1], self.swivel[i : i + 1])


def ways(frame: Frame, moving: bool) -> Ways:
    """Return all ways to be at a feature that are tried; with a joint that is `moving` the hand may turn on the way."""
    turns = frame.turns()
    if not moving or not frame.upright or len(turns) == len(YAWS):
        turn, swivel = (part.ravel() for part in np.meshgrid(turns, SWIVELS))
        return Ways(turn, turn, swivel)
    return Ways(*(part.ravel() for part in np.meshgrid(turns, turns, SWIVELS)))


def locate(engine: Engine, name: str, feature: str, values: Mapping[str, float] | None = None) -> Frame:
    """Return where a feature of a place or object is perceived to be, or that of a link is, maybe with joints at other `values`.

    Raises
    ------
    SkillError
        The thing is nowhere to be seen, or has no such feature.
    """
    if name in engine.embodiment.places:
        return Frame(np.eye(3), engine.place(name))
    if name in engine.links:
        mechanic = engine.links[name]
        found = mechanic.link(name).features.get(feature)
        if found is None:
            raise SkillError("ill-defined", (name,), f"{name} has no feature '{feature}'")
        turned, point = feature_frame(mechanic.frame(name, values), found)
        return Frame(turned, point, found.low, found.high)
    base = engine.sense(name)[1]
    shape = engine.bodies[name].shape
    height = {"base": 0.0, "grip": shape.grasp_height, "top": height_of(shape)}.get(feature)
    if height is None:
        raise SkillError("ill-defined", (name,), f"{name} has no feature '{feature}'")
    return Frame(np.eye(3), base + np.array([0.0, 0.0, height]))


def touched(engine: Engine, name: str, feature: str) -> tuple[str, ...]:
    """Return the parts of a link that a hand touches at a feature, or the thing itself."""
    if name in engine.links:
        found: Feature | None = engine.links[name].link(name).features.get(feature)
        return found.parts if found is not None else ()
    return (name,)
