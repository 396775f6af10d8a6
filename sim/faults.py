"""Faults that can be planted in a world, to see that verification finds them: give one to `sim.verify.verify` as `prepare`.

Only here is a running world interfered with. A fault of the table below is called with its arguments and returns a `Fault`,
which can be sent to another process. What may happen in the middle of a task takes `step`, the number of the primitive, and
`seconds` after that began.

==================================================== ============================================================
`hidden_wall`, `stranger`                            something in the way, which the robot doesn't, or does, perceive
`displaced`, `knocked`, `gone`, `lying`              an object that isn't as it was
`heavy`, `slippery`, `sealed`, `drained`             an object that isn't as it should be
`place_displaced`, `settings`                        knowledge that is wrong
`lets_go`, `arm_at`, `jammed`, `joint_range`         a robot that isn't as it should be
`weak_arm`, `slow_arm`, `weak_grip`, `shut`          the same, for want of strength
`noisy`, `misaligned`, `misread`                     perception that isn't as it should be
`stiff`, `stopped`, `swung`, `sprung`                a joint of furniture that isn't as it should be
`unlatched`, `greasy`                                a button that doesn't stay in; a handle that slips
==================================================== ============================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, Concatenate, ParamSpec

import numpy as np
import pybullet

from reasoner.embodiment.values import Shape
from sim.bodies import KINDS, center_height
from sim.engine import Engine, Thing
from sim.kinematics import inverse
from sim.motion import SWIVELS, poses_at, rotations
from sim.urdf import Array

P = ParamSpec("P")
UPRIGHT = (0.0, 0.0, 0.0, 1.0)

PLANTS: dict[str, Callable[..., None]] = {}
"""What plants the faults, by name."""


@dataclass(frozen=True)
class Fault:
    """A fault with its arguments; called with a world, it is planted there."""

    kind: str
    arguments: tuple[Any, ...]
    options: tuple[tuple[str, Any], ...] = ()

    def __call__(self, world: Engine) -> None:
        """Plant it."""
        PLANTS[self.kind](world, *self.arguments, **dict(self.options))

    def __str__(self) -> str:
        """Return it as it is written in Python."""
        options = [f"{name}={value!r}" for name, value in self.options]
        return f"{self.kind}({', '.join([*map(repr, self.arguments), *options])})"


def fault(plant: Callable[Concatenate[Engine, P], None]) -> Callable[P, Fault]:
    """Turn a function that plants a fault in a world into one that chooses the fault."""
    PLANTS[plant.__name__] = plant

    @wraps(plant)
    def choose(*arguments: P.args, **options: P.kwargs) -> Fault:
        return Fault(plant.__name__, arguments, tuple(options.items()))

    return choose


def later(world: Engine, step: int, seconds: float, act: Callable[[Engine], None]) -> None:
    """Do something once, some simulated seconds after primitive number `step` began."""
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


# ------------------------------------------------------------------------------------------------- in the way


@fault
def hidden_wall(
    world: Engine, before: str, distance: float = 0.075, size: tuple[float, float, float] = (0.02, 0.12, 0.16)
) -> None:
    """Put up a wall that the robot doesn't perceive, `distance` metres on the robot's side of an object or place.

    `size` is its extent in metres along the line from robot to object, across it, and up.
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
    """Put a box on the table that the robot perceives and that no fact speaks of."""
    numbers = dict(zip(("width", "depth", "height"), size, strict=True))
    shape = Shape("box", mass=1.0, grasp_height=size[2] / 2, numbers=numbers)
    body = KINDS["box"].make(world.client, shape, np.array(point), np.array(UPRIGHT))
    world.bodies["stranger"], world.names[body] = Thing(body, shape), "stranger"


# ------------------------------------------------------------------------------------------------- objects


def _put(world: Engine, name: str, base: Array, orientation: tuple[float, float, float, float] = UPRIGHT) -> None:
    """Put a body somewhere, awake and at rest."""
    thing = world.bodies[name]
    up = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)[:, 2]
    middle = (base + center_height(thing.shape) * up).tolist()
    pybullet.resetBasePositionAndOrientation(thing.body, middle, orientation, physicsClientId=world.client)
    pybullet.changeDynamics(
        thing.body, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=world.client
    )


@fault
def displaced(world: Engine, body: str, by: tuple[float, float], step: int = -1, seconds: float = 0.0) -> None:
    """Shift an object by metres along x and y; what it contains stays behind."""

    def shift(world: Engine) -> None:
        _put(world, body, world.truth(body)[1] + np.array([*by, 0.0]))

    if step < 0:
        shift(world)
    else:
        later(world, step, seconds, shift)


@fault
def knocked(world: Engine, body: str, step: int, seconds: float, speed: float = 1.5) -> None:
    """Hit an object's rim, so that it falls over."""

    def hit(world: Engine) -> None:
        thing = world.bodies[body]
        pybullet.resetBaseVelocity(thing.body, [0, speed / 3, 0.2], [-12 * speed, 0, 0], physicsClientId=world.client)

    later(world, step, seconds, hit)


@fault
def gone(world: Engine, body: str, step: int = -1, seconds: float = 0.0) -> None:
    """Take an object away."""

    def take(world: Engine) -> None:
        thing = world.bodies.pop(body)
        del world.names[thing.body]
        pybullet.removeBody(thing.body, physicsClientId=world.client)

    if step < 0:
        take(world)
    else:
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
    pybullet.changeDynamics(
        world.bodies[body].body,
        -1,
        lateralFriction=friction,
        spinningFriction=0,
        rollingFriction=0,
        physicsClientId=world.client,
    )


@fault
def sealed(world: Engine, vessel: str, radius: float = 0.0235, height: float = 0.075) -> None:
    """Let a ball swim in a vessel that is too large for its neck: tilted, it closes the neck."""
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
    """Leave only so many beads in a vessel."""
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
    """Let a place be elsewhere than where it was when reach was computed, by metres along x and y."""
    known = world.embodiment.places[place]
    x, y, z = known.position
    moved = replace(known, position=(x + by[0], y + by[1], z))
    world.embodiment = replace(world.embodiment, places={**world.embodiment.places, place: moved})


@fault
def settings(world: Engine, /, behavior: str, **numbers: float) -> None:
    """Carry a behaviour out with other numbers than the ontology's."""
    use = world.embodiment.skills[behavior]
    changed = replace(use, numbers={**use.numbers, **numbers})
    world.embodiment = replace(world.embodiment, skills={**world.embodiment.skills, behavior: changed})


# ------------------------------------------------------------------------------------------------- furniture


@fault
def stiff(world: Engine, link: str, friction: float) -> None:
    """Let a joint resist with so many newtons, or newton metres."""
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
    """Let a joint go no farther than from one value to another, which the robot doesn't know."""
    mechanic = world.links[link]

    def stop(world: Engine) -> None:
        pybullet.changeDynamics(
            mechanic.body,
            mechanic.joints[link],
            jointLowerLimit=lower,
            jointUpperLimit=upper,
            physicsClientId=world.client,
        )

    if step < 0:
        stop(world)
    else:
        later(world, step, seconds, stop)


@fault
def swung(world: Engine, link: str, value: float, step: int, seconds: float) -> None:
    """Move a joint to a value, as a person might."""
    mechanic = world.links[link]

    def swing(world: Engine) -> None:
        pybullet.resetJointState(mechanic.body, mechanic.joints[link], value, physicsClientId=world.client)

    later(world, step, seconds, swing)


@fault
def sprung(world: Engine, link: str, rest: float, force: float, step: int = 0, seconds: float = 0.0) -> None:
    """Let a spring draw a joint to a value."""
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
    """Let a button that should stay in when it is pressed come out again."""
    mechanic = world.links[link]
    links = tuple(replace(one, latches=one.latches and one.name != link) for one in mechanic.mechanism.links)
    mechanic.mechanism = replace(mechanic.mechanism, links=links)


@fault
def greasy(world: Engine, link: str, friction: float = 0.01) -> None:
    """Give a link, its handle included, another coefficient of friction."""
    mechanic = world.links[link]
    pybullet.changeDynamics(
        mechanic.body,
        mechanic.joints[link],
        lateralFriction=friction,
        spinningFriction=0,
        rollingFriction=0,
        physicsClientId=world.client,
    )


# ------------------------------------------------------------------------------------------------- the robot


@fault
def lets_go(world: Engine, hand: str, step: int, seconds: float) -> None:
    """Open a hand in the middle of something."""
    later(world, step, seconds, lambda world: world.hands[hand].open())


@fault
def arm_at(world: Engine, hand: str, point: tuple[float, float, float], yaw: float, step: int) -> None:
    """Let an arm be where nobody sent it: with its hand at a point, pointing along `yaw`."""

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
    """Let a joint of an arm stay where it is from then on, which the robot doesn't know."""

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
    """Give a joint of an arm narrower limits, in radians, which the robot knows."""
    manipulator = world.hands[hand]
    low, high = manipulator.arm.lower.copy(), manipulator.arm.upper.copy()
    low[joint], high[joint] = lower, upper
    manipulator.arm = replace(manipulator.arm, lower=low, upper=high)


@fault
def weak_arm(world: Engine, hand: str, share: float) -> None:
    """Leave the motors of an arm only a share of their torque."""
    manipulator = world.hands[hand]
    manipulator.efforts = tuple(effort * share for effort in manipulator.efforts)


@fault
def slow_arm(world: Engine, hand: str, share: float) -> None:
    """Let an arm move at a share of its speeds only, which the robot knows."""
    world.hands[hand].pace = share


@fault
def weak_grip(world: Engine, hand: str, newtons: float) -> None:
    """Let the fingers of a hand press with less force."""
    manipulator = world.hands[hand]
    manipulator.hand = replace(manipulator.hand, grip=newtons)


@fault
def shut(world: Engine, hand: str) -> None:
    """Let the fingers of a hand stay closed."""
    manipulator = world.hands[hand]
    for finger in manipulator.fingers:
        pybullet.resetJointState(manipulator.body, finger, 0.0, physicsClientId=world.client)
        pybullet.changeDynamics(
            manipulator.body, finger, jointLowerLimit=0.0, jointUpperLimit=1e-3, physicsClientId=world.client
        )


# ------------------------------------------------------------------------------------------------- perception


@fault
def noisy(world: Engine, metres: float) -> None:
    """Let perceived positions scatter with a standard deviation of so many metres."""
    world.noise = metres


@fault
def misaligned(world: Engine, by: tuple[float, float]) -> None:
    """Let everything be perceived off by metres along x and y, as with a camera that was pushed."""
    true_sense = world.sense

    def sense(name: str) -> tuple[Array, Array]:
        rotation, base = true_sense(name)
        return rotation, base + np.array([*by, 0.0])

    world.sense = sense  # type: ignore[method-assign]


@fault
def misread(world: Engine, link: str, by: float) -> None:
    """Let a joint's value be perceived off by metres or radians."""
    mechanic = world.links[link]
    true_values = mechanic.values

    def values() -> dict[str, float]:
        found = true_values()
        return {**found, link: found[link] + by}

    mechanic.values = values  # type: ignore[method-assign]
