"""The perceiver of situation types that the ontology defines by bounds on poses, contacts and joint values."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from confab.reasoner.embodiment.skills import evaluate
from confab.reasoner.embodiment.values import PerceiverUse
from confab.reasoner.symbols import FALSE, TRUE
from confab.sim.bodies import height_of, inner_radius
from confab.sim.engine import Engine
from confab.sim.urdf import Array

Measure = Callable[[Engine, str, str], "float | None"]
"""Function of a world and two individuals that returns a quantity, or None if the quantity can't be measured."""


def _pose(world: Engine, name: str) -> tuple[Array, Array] | None:
    """Return the perceived rotation and base of a body, place or link, or None if the pose is unknown."""
    if name in world.embodiment.places:
        return np.eye(3), world.place(name)
    if name in world.links:
        return world.links[name].frame(name)
    return world.sense(name) if name in world.bodies and world.knows(name) else None


def _between(measure: Callable[[Engine, str, tuple[Array, Array], tuple[Array, Array]], float]) -> Measure:
    """Return a function of two individuals that calls `measure` with the world, the second individual's name and both poses."""

    def measured(world: Engine, one: str, other: str) -> float | None:
        poses = _pose(world, one), _pose(world, other)
        return None if poses[0] is None or poses[1] is None else measure(world, other, poses[0], poses[1])

    return measured


def _inside(world: Engine, other: str, inner: tuple[Array, Array], outer: tuple[Array, Array]) -> float:
    """Return 1 if the base of an object is inside the vessel `other`, otherwise 0."""
    shape = world.bodies[other].shape if other in world.bodies else None
    if shape is None or shape.kind != "vessel":
        return 0.0
    x, y, z = outer[0].T @ (inner[1] - outer[1])
    return float(0.0 <= z <= height_of(shape) and np.hypot(x, y) < inner_radius(shape, np.array(z)))


def _top(world: Engine, name: str) -> float:
    return height_of(world.bodies[name].shape) if name in world.bodies else 0.0


def _turned(world: Engine, other: str, one: tuple[Array, Array], two: tuple[Array, Array]) -> float:
    relative = two[0].T @ one[0]
    return float(abs(np.arctan2(relative[1, 0], relative[0, 0])))


def _contact(world: Engine, one: str, other: str) -> float | None:
    if one not in world.bodies:
        return None
    contacts = world.contacts(world.bodies[one].body)
    return float(sum(contact[9] for contact in contacts if world.name_of(contact[2], contact[4]) == other))


def _tilt(world: Engine, one: str, other: str) -> float | None:
    pose = _pose(world, one)
    return None if pose is None else float(np.arccos(np.clip(pose[0][2, 2], -1.0, 1.0)))


def _joint(world: Engine, one: str, other: str) -> float | None:
    return world.links[one].values().get(one) if one in world.links else None


MEASURES: Mapping[str, Measure] = {
    "beside": _between(lambda world, other, one, two: float(np.hypot(*(one[1] - two[1])[:2]))),
    "apart": _between(lambda world, other, one, two: float(np.linalg.norm(one[1] - two[1]))),
    "above": _between(lambda world, other, one, two: float(one[1][2] - two[1][2])),
    "over": _between(lambda world, other, one, two: float(one[1][2] - two[1][2] - _top(world, other))),
    "inside": _between(_inside),
    "turned": _between(_turned),
    "contact": _contact,
    "tilt": _tilt,
    "joint": _joint,
}
"""The function that measures each quantity, given a world and two individuals, in metres, radians and newtons."""


def observe_measured(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> str | None:
    """Return whether the bounds hold; for a situation type with several values, return the first value whose bounds hold.

    If no value fits, return the special value `nothing` of the situation type. Return None if the situation type has no value
    `nothing`, or if a quantity can't be measured.
    """
    if use.asked:
        holds = _hold(world, use, arguments[0], arguments[-1])
        return None if holds is None else TRUE if holds else FALSE
    special = {*use.values.values()}
    candidates = (value for value in use.choices if value not in special and value != arguments[0])
    return next((value for value in candidates if _hold(world, use, arguments[0], value)), use.values.get("nothing"))


def _hold(world: Engine, use: PerceiverUse, one: str, other: str) -> bool | None:
    """Return whether all bounds hold between two individuals, or None if a quantity can't be measured."""
    known = dict(use.numbers)
    if one in world.links and any(guard.quantity == "joint" for guard in use.holds):
        link = world.links[one].link(one)
        known |= {name: getattr(link, name) for name in ("opened", "shut", "lower", "upper")}
    for guard in use.holds:
        value = MEASURES[guard.quantity](world, one, other)
        if value is None:
            return None
        if (value - evaluate(guard.bound, known)) * guard.sign < 0:
            return False
    return True


def measure(world: Engine, use: PerceiverUse, arguments: tuple[str, ...]) -> Mapping[str, float]:
    """Return the measured quantities of all bounds by name, for a situation type without values."""
    found = {g.quantity: MEASURES[g.quantity](world, arguments[0], arguments[-1]) for g in use.holds if use.asked}
    return {name: value for name, value in found.items() if value is not None}
