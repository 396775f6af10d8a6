"""Faults that tests plant in a world to check that verification detects faults.

Pass a fault to `confab.sim.verify.verify` as its argument `prepare`.

Each function of the table below returns a `PlantedFault`, which can be sent to another process. The time of a fault during a
task is given by `step`, the number of a primitive, and `seconds` after the beginning of the primitive.

==================================================== ============================================================
`hidden_wall`, `stranger`                            an unexpected obstacle, not perceived or perceived
`displaced`, `knocked`, `gone`, `lying`              an object in another pose
`heavy`, `slippery`, `sealed`, `drained`             an object with other properties
`place_displaced`, `settings`                        wrong knowledge
`lets_go`, `arm_at`, `jammed`, `joint_range`         a defect of the robot
`weak_arm`, `slow_arm`, `weak_grip`, `shut`          a weakness of the robot
`noisy`, `misaligned`, `misread`                     a defect of perception
`stiff`, `stopped`, `swung`, `sprung`                a defective joint of furniture
`unlatched`, `greasy`                                a button without a latch, a slippery handle
==================================================== ============================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, Concatenate, ParamSpec

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Shape
from confab.sim.bodies import KINDS, center_height
from confab.sim.engine import Engine, SimulatedBody
from confab.sim.kinematics import inverse
from confab.sim.motion import SWIVELS, poses_at, rotations
from confab.sim.urdf import Array

P = ParamSpec("P")
UPRIGHT = (0.0, 0.0, 0.0, 1.0)

PLANTS: dict[str, Callable[..., None]] = {}
"""The functions that plant the faults, by name."""


@dataclass(frozen=True)
class PlantedFault:
    """A fault with its arguments. A call with a world plants the fault in the world."""

    kind: str
    arguments: tuple[Any, ...]
    options: tuple[tuple[str, Any], ...] = ()

    def __call__(self, world: Engine) -> None:
        """Plant the fault in a world."""
        PLANTS[self.kind](world, *self.arguments, **dict(self.options))

    def __str__(self) -> str:
        """Return the fault as a Python expression."""
        options = [f"{name}={value!r}" for name, value in self.options]
        return f"{self.kind}({', '.join([*map(repr, self.arguments), *options])})"


def fault(plant: Callable[Concatenate[Engine, P], None]) -> Callable[P, PlantedFault]:
    """Register a function that plants a fault; return a function that makes a `PlantedFault` from the same arguments."""
    PLANTS[plant.__name__] = plant

    @wraps(plant)
    def choose(*arguments: P.args, **options: P.kwargs) -> PlantedFault:
        return PlantedFault(plant.__name__, arguments, tuple(options.items()))

    return choose


def later(world: Engine, step: int, seconds: float, act: Callable[[Engine], None]) -> None:
    """Call `act` once, `seconds` of simulated time after the beginning of primitive `step`; at once if `step` is negative."""
    if step < 0:
        act(world)
        return
    began: int | None = None
    earlier = world.disturb

    def look(world: Engine) -> None:
        nonlocal began
        if earlier is not None:
            earlier(world)
        if world.current >= step:
            began = world.steps if began is None else began
            if world.steps == began + round(seconds * world.rate):
                act(world)

    world.disturb = look


# ------------------------------------------------------------------------------------------------- obstacles


@fault
def hidden_wall(
    world: Engine, before: str, distance: float = 0.075, size: tuple[float, float, float] = (0.02, 0.12, 0.16)
) -> None:
    """Put up a wall that the robot does not perceive, at `distance` metres from an object or place, on the robot's side.

    `size` is the extent of the wall in metres along the line from robot to object, across the line, and upwards.
    """
    target = world.place(before) if before in world.embodiment.places else world.truth(before)[1]
    base = np.array(world.embodiment.robots[0].position)
    away = (target - base)[:2] / np.linalg.norm((target - base)[:2])
    half = [extent / 2 for extent in size]
    wall = pybullet.createMultiBody(
        0,
        pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=world.client),
        basePosition=[*(target[:2] - distance * away).tolist(), float(target[2]) + half[2]],
        baseOrientation=pybullet.getQuaternionFromEuler([0, 0, float(np.arctan2(away[1], away[0]))]),
        physicsClientId=world.client,
    )
    world.names[wall] = "hidden wall"


@fault
def stranger(
    world: Engine, point: tuple[float, float, float], size: tuple[float, float, float] = (0.06, 0.06, 0.12)
) -> None:
    """Put a box at a point; the robot perceives the box, but no fact mentions the box."""
    numbers = dict(zip(("width", "depth", "height"), size, strict=True))
    shape = Shape("box", mass=1.0, grasp_height=size[2] / 2, numbers=numbers)
    body = KINDS["box"].make(world.client, shape, np.array(point), np.array(UPRIGHT))
    world.bodies["stranger"], world.names[body] = SimulatedBody(body, shape), "stranger"


# ------------------------------------------------------------------------------------------------- objects


def _put(world: Engine, name: str, base: Array, orientation: tuple[float, float, float, float] = UPRIGHT) -> None:
    """Move the base of a body to a position and orientation, and activate the body in PyBullet."""
    thing = world.bodies[name]
    up = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)[:, 2]
    middle = (base + center_height(thing.shape) * up).tolist()
    pybullet.resetBasePositionAndOrientation(thing.body, middle, orientation, physicsClientId=world.client)
    pybullet.changeDynamics(
        thing.body, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=world.client
    )


@fault
def displaced(world: Engine, body: str, by: tuple[float, float], step: int = -1, seconds: float = 0.0) -> None:
    """Shift an object by `by`, in metres along x and y; its contents stay behind."""

    def shift(world: Engine) -> None:
        _put(world, body, world.truth(body)[1] + np.array([*by, 0.0]))

    later(world, step, seconds, shift)


@fault
def knocked(world: Engine, body: str, step: int, seconds: float, speed: float = 1.5) -> None:
    """Hit an object's rim so that the object falls over."""

    def hit(world: Engine) -> None:
        thing = world.bodies[body]
        awake = {"activationState": pybullet.ACTIVATION_STATE_WAKE_UP, "physicsClientId": world.client}
        pybullet.changeDynamics(thing.body, -1, **awake)
        pybullet.resetBaseVelocity(thing.body, [0, speed / 3, 0.2], [-12 * speed, 0, 0], physicsClientId=world.client)

    later(world, step, seconds, hit)


@fault
def gone(world: Engine, body: str, step: int = -1, seconds: float = 0.0) -> None:
    """Remove an object."""

    def take(world: Engine) -> None:
        thing = world.bodies.pop(body)
        del world.names[thing.body]
        pybullet.removeBody(thing.body, physicsClientId=world.client)

    later(world, step, seconds, take)


@fault
def lying(world: Engine, body: str) -> None:
    """Lay an object on its side."""
    shape = world.bodies[body].shape
    side = np.array([0.0, 0.0, KINDS[shape.kind].outer(shape)])
    half = np.array([center_height(shape), 0.0, 0.0])
    _put(world, body, world.truth(body)[1] + side - half, pybullet.getQuaternionFromEuler([0, np.pi / 2, 0]))
    world.run(60)


@fault
def heavy(world: Engine, body: str, mass: float) -> None:
    """Give an object another mass, in kilograms."""
    pybullet.changeDynamics(world.bodies[body].body, -1, mass=mass, physicsClientId=world.client)


@fault
def slippery(world: Engine, body: str, friction: float = 0.022) -> None:
    """Give an object another coefficient of friction."""
    _smooth(world, world.bodies[body].body, -1, friction)


def _smooth(world: Engine, body: int, link: int, friction: float) -> None:
    """Set the coefficient of friction of a link, which doesn't resist spinning and rolling."""
    client = {"physicsClientId": world.client}
    pybullet.changeDynamics(body, link, lateralFriction=friction, spinningFriction=0, rollingFriction=0, **client)


@fault
def sealed(world: Engine, vessel: str, radius: float = 0.0235, height: float = 0.075) -> None:
    """Put a ball that is larger than a vessel's neck into the vessel, where the ball blocks the neck during pouring."""
    rotation, base = world.truth(vessel)
    ball = pybullet.createMultiBody(
        0.01,
        pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius, physicsClientId=world.client),
        basePosition=(base + rotation[:, 2] * height).tolist(),
        useMaximalCoordinates=True,
        physicsClientId=world.client,
    )
    world.names[ball] = "stopper"


@fault
def drained(world: Engine, vessel: str, left: int = 0) -> None:
    """Remove all but `left` beads from a vessel."""
    rotation, base = world.truth(vessel)
    reach = KINDS[world.bodies[vessel].shape.kind].outer(world.bodies[vessel].shape)
    inside, get = [], pybullet.getBasePositionAndOrientation
    for bead in world.beads:
        local = rotation.T @ (np.array(get(bead.body, physicsClientId=world.client)[0]) - base)
        if np.hypot(local[0], local[1]) < reach:
            inside.append(bead)
    for bead in inside[left:]:
        world.beads.remove(bead)
        pybullet.removeBody(bead.body, physicsClientId=world.client)


# ------------------------------------------------------------------------------------------------- knowledge


@fault
def place_displaced(world: Engine, place: str, by: tuple[float, float]) -> None:
    """Shift a place by `by`, in metres along x and y, without an update of the reach facts."""
    known = world.embodiment.places[place]
    x, y, z = known.position
    moved = replace(known, position=(x + by[0], y + by[1], z))
    world.embodiment = replace(world.embodiment, places={**world.embodiment.places, place: moved})


@fault
def settings(world: Engine, /, behavior: str, **numbers: float) -> None:
    """Replace numbers that the ontology states for a behaviour."""
    use = world.embodiment.skills[behavior]
    changed = replace(use, numbers={**use.numbers, **numbers})
    world.embodiment = replace(world.embodiment, skills={**world.embodiment.skills, behavior: changed})


# ------------------------------------------------------------------------------------------------- furniture


@fault
def stiff(world: Engine, link: str, friction: float) -> None:
    """Set the friction of a joint, in newtons or newton metres."""
    mechanic = world.links[link]
    pybullet.setJointMotorControl2(
        mechanic.body,
        mechanic.joints[link],
        pybullet.VELOCITY_CONTROL,
        targetVelocity=0.0,
        force=friction,
        physicsClientId=world.client,
    )


@fault
def stopped(world: Engine, link: str, lower: float, upper: float, step: int = -1, seconds: float = 0.0) -> None:
    """Set the limits of a joint of furniture without the robot's knowledge."""
    mechanic = world.links[link]

    def stop(world: Engine) -> None:
        pybullet.changeDynamics(
            mechanic.body,
            mechanic.joints[link],
            jointLowerLimit=lower,
            jointUpperLimit=upper,
            physicsClientId=world.client,
        )

    later(world, step, seconds, stop)


@fault
def swung(world: Engine, link: str, value: float, step: int, seconds: float) -> None:
    """Set a joint of furniture to a value, as a person might."""
    mechanic = world.links[link]

    def swing(world: Engine) -> None:
        pybullet.resetJointState(mechanic.body, mechanic.joints[link], value, physicsClientId=world.client)

    later(world, step, seconds, swing)


@fault
def sprung(world: Engine, link: str, rest: float, force: float, step: int = 0, seconds: float = 0.0) -> None:
    """Pull a joint to the value `rest` by a spring."""
    mechanic = world.links[link]

    def draw(world: Engine) -> None:
        pybullet.setJointMotorControl2(
            mechanic.body,
            mechanic.joints[link],
            pybullet.POSITION_CONTROL,
            targetPosition=rest,
            force=force,
            physicsClientId=world.client,
        )

    later(world, step, seconds, draw)


@fault
def unlatched(world: Engine, link: str) -> None:
    """Remove the latch of a button, so that it springs back after a press."""
    mechanic = world.links[link]
    links = tuple(replace(one, latches=one.latches and one.name != link) for one in mechanic.mechanism.links)
    mechanic.mechanism = replace(mechanic.mechanism, links=links)


@fault
def greasy(world: Engine, link: str, friction: float = 0.01) -> None:
    """Give a link, including its handle, another coefficient of friction."""
    mechanic = world.links[link]
    _smooth(world, mechanic.body, mechanic.joints[link], friction)


# ------------------------------------------------------------------------------------------------- the robot


@fault
def lets_go(world: Engine, hand: str, step: int, seconds: float) -> None:
    """Open a hand during a primitive."""
    later(world, step, seconds, lambda world: world.hands[hand].open())


@fault
def arm_at(world: Engine, hand: str, point: tuple[float, float, float], yaw: float, step: int) -> None:
    """Set an arm's joints directly, so that the hand is at a point and points along `yaw`."""

    def go(world: Engine) -> None:
        arm = world.hands[hand].arm
        poses = poses_at(np.array(point), np.full(len(SWIVELS), yaw), 0.0, np.array(SWIVELS))
        q, valid = inverse(arm, rotations(poses), poses[:, :3], poses[:, 5], 0.03)
        posture = q[int(np.flatnonzero(valid)[0])]
        for joint, value in zip(world.hands[hand].joints, posture, strict=True):
            pybullet.resetJointState(world.hands[hand].body, joint, value, physicsClientId=world.client)
        world.hands[hand].command(posture)

    later(world, step, 0.0, go)


@fault
def jammed(world: Engine, hand: str, joint: int, step: int, seconds: float) -> None:
    """Lock a joint of an arm at its present angle without the robot's knowledge."""

    def jam(world: Engine) -> None:
        manipulator = world.hands[hand]
        number, angle = manipulator.joints[joint], float(manipulator.measured()[joint])
        pybullet.changeDynamics(
            manipulator.body,
            number,
            jointLowerLimit=angle - 1e-3,
            jointUpperLimit=angle + 1e-3,
            physicsClientId=world.client,
        )

    later(world, step, seconds, jam)


@fault
def joint_range(world: Engine, hand: str, joint: int, lower: float, upper: float) -> None:
    """Give a joint of an arm other limits, in radians, with the robot's knowledge."""
    manipulator = world.hands[hand]
    low, high = manipulator.arm.lower.copy(), manipulator.arm.upper.copy()
    low[joint], high[joint] = lower, upper
    manipulator.arm = replace(manipulator.arm, lower=low, upper=high)


@fault
def weak_arm(world: Engine, hand: str, share: float) -> None:
    """Multiply the torques of an arm's motors by `share`."""
    manipulator = world.hands[hand]
    manipulator.efforts = tuple(effort * share for effort in manipulator.efforts)


@fault
def slow_arm(world: Engine, hand: str, share: float) -> None:
    """Multiply the speeds of an arm by `share`, with the robot's knowledge."""
    world.hands[hand].pace = share


@fault
def weak_grip(world: Engine, hand: str, newtons: float) -> None:
    """Set the force in newtons with which the fingers of a hand press."""
    manipulator = world.hands[hand]
    manipulator.hand = replace(manipulator.hand, grip=newtons)


@fault
def shut(world: Engine, hand: str) -> None:
    """Lock the fingers of a hand in the closed position."""
    manipulator = world.hands[hand]
    for finger in manipulator.fingers:
        pybullet.resetJointState(manipulator.body, finger, 0.0, physicsClientId=world.client)
        pybullet.changeDynamics(
            manipulator.body, finger, jointLowerLimit=0.0, jointUpperLimit=1e-3, physicsClientId=world.client
        )


# ------------------------------------------------------------------------------------------------- perception


@fault
def noisy(world: Engine, metres: float) -> None:
    """Set the standard deviation of perceived positions, in metres."""
    world.noise = metres


@fault
def misaligned(world: Engine, by: tuple[float, float]) -> None:
    """Shift the perceived positions of all bodies by `by`, in metres along x and y, like a displaced camera."""
    true_sense = world.sense

    def sense(name: str) -> tuple[Array, Array]:
        rotation, base = true_sense(name)
        return rotation, base + np.array([*by, 0.0])

    world.sense = sense  # type: ignore[method-assign]


@fault
def misread(world: Engine, link: str, by: float) -> None:
    """Shift the perceived value of a furniture joint by metres or radians."""
    mechanic = world.links[link]
    true_values = mechanic.values

    def values() -> dict[str, float]:
        found = true_values()
        return {**found, link: found[link] + by}

    mechanic.values = values  # type: ignore[method-assign]
