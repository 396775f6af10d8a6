"""Setup of a new world: furniture, robots, and the bodies and beads of a draft."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pybullet

from confab.reasoner.embodiment.solid_checks import DEEP
from confab.reasoner.embodiment.values import Fixture, Mechanism, Shape
from confab.sim.base import read_base
from confab.sim.bodies import KINDS, packed
from confab.sim.driving import update_kinematics
from confab.sim.engine import Bead, Engine, SimulatedBody
from confab.sim.mechanisms import load_mechanism, overlap_of
from confab.sim.perception import Draft
from confab.sim.robot import load_robot
from confab.sim.urdf import Array

SETTLING = 120
"""Number of simulation steps in which bodies and beads come to rest before the first primitive."""

DRAWS = 20
"""Maximum number of draws of an object's random deviation until the object overlaps no other object."""

SPECK = [[0.0, 0.0, 0.0], [1e-5, 0.0, 0.0], [0.0, 1e-5, 0.0]]
"""An invisibly small triangle as the visual shape of beads, since `confab.sim.picture` draws beads faster than PyBullet."""


@dataclass(frozen=True)
class Perturbation:
    """Ranges of random deviations from the nominal world; each deviation is drawn uniformly for each body.

    Mechanisms are shifted by `position` and turned by `turn`. Friction and damping of their joints are multiplied by `resistance`.
    A mobile base misses its goal by at most `stop` metres and radians.
    """

    position: float = 0.010
    yaw: float = np.pi
    friction: tuple[float, float] = (0.6, 1.2)
    mass: tuple[float, float] = (0.7, 1.3)
    fill: tuple[float, float] = (0.95, 1.1)
    turn: float = 0.17
    resistance: tuple[float, float] = (0.5, 2.0)
    stop: float = 0.01


def furnish(engine: Engine, perturb: Perturbation | None) -> None:
    """Put the furniture, mechanisms and robots of the embodiment into an engine."""
    for fixture in engine.embodiment.fixtures:
        engine.names[_make_fixture(engine.client, fixture)] = fixture.name
    for mechanism in engine.embodiment.mechanisms:
        mechanic = load_mechanism(engine.client, _shifted(engine, mechanism, perturb))
        engine.mechanics.append(mechanic)
        engine.names[mechanic.body] = mechanism.name
        engine.links |= dict.fromkeys((mechanism.name, *mechanic.joints), mechanic)
    for robot in engine.embodiment.robots:
        number, hands, still = load_robot(engine.client, robot)
        engine.names[number], engine.standing[robot.name] = robot.name, still
        engine.hands |= {hand.hand.name: hand for hand in hands}
        if robot.driving:
            engine.bases[robot.name] = read_base(engine.client, number, robot, perturb.stop if perturb else 0.0)


def _shifted(engine: Engine, mechanism: Mechanism, perturb: Perturbation | None) -> Mechanism:
    """Return a mechanism with random deviations."""
    if perturb is None:
        return mechanism
    (x, y, z), limit = mechanism.position, perturb.position
    dx, dy = engine.rng.uniform(-limit, limit, 2)
    yaw = mechanism.yaw + float(engine.rng.uniform(-perturb.turn, perturb.turn))
    friction = mechanism.friction * float(engine.rng.uniform(*perturb.friction))
    links = []
    for link in mechanism.links:
        more = float(engine.rng.uniform(*perturb.resistance))
        links.append(replace(link, friction=link.friction * more, damping=link.damping * more))
    return replace(mechanism, position=(x + dx, y + dy, z), yaw=yaw, friction=friction, links=tuple(links))


def stage(engine: Engine, draft: Draft, perturb: Perturbation | None, beads: bool) -> None:
    """Put the bodies of a draft and their contents into an engine, and simulate until they have come to rest."""
    for name, opened in draft.opened.items():
        if name not in engine.links:
            raise ValueError(f"'{name}' is open or shut, but is no e:Link of a mechanism")
        engine.links[name].set(name, opened)
    for robot, stand in draft.stands.items():
        if robot not in engine.bases or stand not in engine.embodiment.stands:
            raise ValueError(
                f"'{robot}' is stated to stand at '{stand}', but doesn't drive (e:drivingSpeed), or that is no e:Stand"
            )
        there = engine.embodiment.stands[stand]
        engine.bases[robot].set(np.array([*there.position[:2], there.yaw]))
        update_kinematics(engine, engine.bases[robot])
    for name, place in draft.places.items():
        if place not in engine.embodiment.places:
            raise ValueError(
                f"'{place}', where {name} is, has no position (places: {', '.join(engine.embodiment.places)})"
            )
        if name not in engine.embodiment.bodies:
            raise ValueError(f"object '{name}' has no shape: give its class one")
        _put(engine, name, place, perturb)
    engine.contents = {name: list(fillings) for name, fillings in draft.contents.items()}
    engine.filled = dict(draft.servings)
    if beads:
        for name, filling in ((name, filling) for name, all_in in draft.contents.items() for filling in all_in):
            pour_in(engine, name, filling, perturb)
    engine.run(SETTLING)
    put_to_sleep(engine)
    engine.steps = 0


def _put(engine: Engine, name: str, place: str, perturb: Perturbation | None) -> None:
    """Make an object at a place; deviations with which the object overlaps another object are drawn again.

    Raise `ValueError` with both names and the overlap in millimetres if the object overlaps an existing object.
    """
    for _ in range(DRAWS if perturb is not None else 1):
        shape, position, yaw = _vary(engine, engine.embodiment.bodies[name].shape, place, perturb)
        orientation = np.array([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
        body = KINDS[shape.kind].make(engine.client, shape, position, orientation)
        depth, inside = _deepest(engine, body)
        if depth <= DEEP:
            engine.names[body] = name
            engine.bodies[name] = SimulatedBody(body, shape)
            return
        pybullet.removeBody(body, physicsClientId=engine.client)
    raise ValueError(
        f"{name} is {depth * 1000:.0f} mm inside {inside} initially, at {place}; move one of the two (confab validate finds "
        "such overlaps)"
    )


def _deepest(engine: Engine, body: int) -> tuple[float, str]:
    """Return the deepest overlap of a body with another body in metres, and the name of the other body."""
    found = [(0.0, "")]
    for other in engine.names:
        for link in range(-1, pybullet.getNumJoints(other, physicsClientId=engine.client)):
            depth = overlap_of(engine.client, (body, -1), (other, link))
            found.append((depth, engine.name_of(other, link)))
    return max(found)


def _vary(engine: Engine, shape: Shape, place: str, perturb: Perturbation | None) -> tuple[Shape, Array, float]:
    """Return shape, position and yaw of a body at a place, with random deviations if `perturb` is given."""
    position, yaw = engine.place(place), 0.0
    if perturb is not None:
        limit = perturb.position
        position[:2] += engine.rng.uniform(-limit, limit, 2)
        yaw = float(engine.rng.uniform(-perturb.yaw, perturb.yaw))
        friction, mass = engine.rng.uniform(*perturb.friction), engine.rng.uniform(*perturb.mass)
        shape = replace(shape, mass=shape.mass * mass, friction=shape.friction * friction)
    return shape, position, yaw


def pour_in(engine: Engine, name: str, filling: str, perturb: Perturbation | None = None) -> None:
    """Fill a vessel with beads, released just above its bottom; PyBullet draws these beads only in its window."""
    kind = engine.embodiment.fillings[filling]
    share = 1.0 if perturb is None else float(engine.rng.uniform(*perturb.fill))
    count = round(kind.serving * engine.filled.get(name, engine.embodiment.bodies[name].servings) * share)
    rotation, base = engine.truth(name)
    collision = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=kind.radius, physicsClientId=engine.client)
    look: dict[str, Any] = {"shapeType": pybullet.GEOM_MESH, "vertices": SPECK, "indices": [0, 1, 2]}
    if engine.gui:
        look = {"shapeType": pybullet.GEOM_SPHERE, "radius": kind.radius, "rgbaColor": kind.color}
    speck = pybullet.createVisualShape(**look, physicsClientId=engine.client)
    for spot in packed(engine.bodies[name].shape, count, kind.radius):
        bead = pybullet.createMultiBody(
            kind.mass,
            collision,
            speck,
            basePosition=(base + rotation @ spot).tolist(),
            useMaximalCoordinates=True,
            physicsClientId=engine.client,
        )
        pybullet.changeDynamics(
            bead,
            -1,
            lateralFriction=kind.friction,
            restitution=0.0,
            linearDamping=0.02,
            angularDamping=0.5,
            physicsClientId=engine.client,
        )
        engine.beads.append(Bead(bead, filling))


def put_to_sleep(engine: Engine) -> None:
    """Let PyBullet deactivate bodies and beads until something touches them, so that beads at rest cost no time."""
    for body in [*[thing.body for thing in engine.bodies.values()], *[bead.body for bead in engine.beads]]:
        for state in (pybullet.ACTIVATION_STATE_ENABLE_SLEEPING, pybullet.ACTIVATION_STATE_SLEEP):
            pybullet.changeDynamics(body, -1, activationState=state, physicsClientId=engine.client)


def _make_fixture(client: int, fixture: Fixture) -> int:
    """Create a fixture as a body that cannot move, and return the body."""
    half = [extent / 2 for extent in fixture.size]
    body = pybullet.createMultiBody(
        0,
        pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client),
        pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=half,
            rgbaColor=fixture.color,
            specularColor=[0.1, 0.1, 0.1],
            physicsClientId=client,
        ),
        basePosition=fixture.position,
        baseOrientation=pybullet.getQuaternionFromEuler([0, 0, fixture.yaw]),
        physicsClientId=client,
    )
    pybullet.changeDynamics(body, -1, lateralFriction=fixture.friction, physicsClientId=client)
    return int(body)
