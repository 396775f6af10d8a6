"""Interventions on the bodies of a physical world: actions of a person on objects, vessels and links."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pybullet

from confab.planner.acting.episode import InterventionKind
from confab.reasoner.embodiment.values import PerceiverUse, Shape
from confab.reasoner.symbols import Symbol
from confab.sim.bodies import KINDS, center_height, outer_radius
from confab.sim.engine import SimulatedBody
from confab.sim.staging import pour_in
from confab.sim.urdf import Array
from confab.sim.world import PhysicsWorld

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
"""The orientation of an upright object, as a quaternion."""

FALLING = 1.3
"""Initial tilt in radians of an object that a person has knocked over."""


def move(world: PhysicsWorld, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Put an object with its contents at a place."""
    put(world, symbol.arguments[0], world.place(value), UPRIGHT)


def put(world: PhysicsWorld, name: str, base: Array, orientation: Sequence[float]) -> None:
    """Put an object with its contents at a position and an orientation (a quaternion); a hand that holds the object opens."""
    for hand in world.hands:
        if world.held(hand) == name:
            world.hands[hand].open()
    beads = world.inside(name)
    before, origin = world.truth(name)
    inside = [(point - origin) @ before for point in world.positions_of(beads)]
    thing = world.bodies[name]
    rotation = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)
    _set(world, thing.body, base + rotation[:, 2] * center_height(thing.shape), orientation)
    for bead, local in zip(beads, inside, strict=True):
        _set(world, bead.body, base + rotation @ local)


def push(world: PhysicsWorld, name: str, by: Sequence[float]) -> None:
    """Shift a standing object with its contents by `by`, in metres along x and y; a held object is not moved."""
    if name in world.bodies and not any(world.held(hand) == name for hand in world.hands):
        orientation = pybullet.getBasePositionAndOrientation(world.bodies[name].body, physicsClientId=world.client)[1]
        put(world, name, world.truth(name)[1] + np.array([*by, 0.0]), orientation)


def knock(world: PhysicsWorld, name: str, numbers: Sequence[float] = ()) -> None:
    """Tip an object with its contents over, away from its neighbours."""
    if name not in world.bodies:
        return
    base, radius = world.truth(name)[1], outer_radius(world.bodies[name].shape)
    others = [world.truth(other)[1] - base for other in world.bodies if other != name]
    angles = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    ahead = np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1)
    room = [min((float(np.hypot(*(other - 0.1 * way)[:2])) for other in others), default=1.0) for way in ahead]
    axis = np.cross([0.0, 0.0, 1.0], ahead[int(np.argmax(room))])
    orientation = pybullet.getQuaternionFromAxisAngle(axis.tolist(), FALLING)
    put(world, name, base + np.array([0.0, 0.0, radius * np.sin(FALLING)]), orientation)


def put_box(world: PhysicsWorld, name: str, place: str, size: Sequence[float]) -> None:
    """Put a box that no fact mentions at a place, with width, depth and height `size` in metres."""
    numbers = dict(zip(("width", "depth", "height"), size, strict=True))
    shape = Shape("box", 0.2, size[2] / 2, numbers=numbers, color=(0.8, 0.6, 0.4, 1.0))
    body = KINDS["box"].make(world.client, shape, world.place(place), np.array(UPRIGHT))
    world.names[body], world.bodies[name] = name, SimulatedBody(body, shape)


def fill(world: PhysicsWorld, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Empty a vessel, and fill the vessel with `value` unless `value` means empty."""
    for bead in world.inside(symbol.arguments[0]):
        pybullet.removeBody(bead.body, physicsClientId=world.client)
        world.beads.remove(bead)
    if value != use.values.get("empty"):
        pour_in(world, symbol.arguments[0], value, world.perturb)


def push_joint(world: PhysicsWorld, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Open or shut a link with the bodies that it carries; a hand that holds the link opens."""
    name = symbol.arguments[0]
    mechanic = world.links[name]
    for hand in world.hands.values():
        if min(hand.pressing(mechanic.body, mechanic.joints[name])) > 0:
            hand.open()
    opened = value == use.values.get("opened", "true")
    goal = {name: mechanic.link(name).wide if opened else 0.0}
    frame, origin = mechanic.frame(name)
    along = {body: frame.T @ (world.truth(body)[1] - origin) for body in world.bodies if world.carried_by(body) == name}
    mechanic.set(name, opened)
    frame, origin = mechanic.frame(name, {**mechanic.values(), **goal})
    for body, local in along.items():
        thing, base = world.bodies[body], origin + frame @ local
        _set(world, thing.body, base + np.array([0.0, 0.0, center_height(thing.shape)]))


def take_away(world: PhysicsWorld, name: str, numbers: Sequence[float] = ()) -> None:
    """Remove an object and its contents from the world; do nothing if the world has no such object."""
    if name not in world.bodies:
        return
    for bead in world.inside(name):
        pybullet.removeBody(bead.body, physicsClientId=world.client)
        world.beads.remove(bead)
    for hand in world.hands:
        if world.held(hand) == name:
            world.hands[hand].open()
    thing = world.bodies.pop(name)
    del world.names[thing.body]
    pybullet.removeBody(thing.body, physicsClientId=world.client)


def _set(world: PhysicsWorld, body: int, position: Array, orientation: Sequence[float] = UPRIGHT) -> None:
    pybullet.resetBasePositionAndOrientation(body, position.tolist(), orientation, physicsClientId=world.client)
    pybullet.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0], physicsClientId=world.client)
    pybullet.changeDynamics(body, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=world.client)


HANDLED: Mapping[InterventionKind, Callable[[PhysicsWorld, str, Sequence[float]], None]] = {
    InterventionKind.REMOVE: take_away,
    InterventionKind.KNOCK: knock,
    InterventionKind.PUSH: push,
}
"""The function that applies each kind of intervention to an object."""

DISTURBERS: Mapping[str, Callable[[PhysicsWorld, PerceiverUse, Symbol, str], None]] = {
    "perceive_place": move,
    "perceive_content": fill,
    "perceive_joint": push_joint,
}
"""The function that makes a fact of a situation type true, by the type's perceiver."""
