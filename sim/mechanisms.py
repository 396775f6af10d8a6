"""Mechanisms, which are furniture with moving links, in a physics world.

Joints have friction and damping, and may have springs and latches. Links collide with each other and with the base of the
mechanism. Exceptions are links that are stated to touch, and links that touch at joint values 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations

import pybullet

from confab.reasoner.embodiment.solid_checks import DEEP
from confab.reasoner.embodiment.values import Link, Mechanism
from confab.sim.bodies import load_written
from confab.sim.collision import Solid
from confab.sim.linkage import HERE, moved, read_mechanism, solids, urdf_name, written
from confab.sim.urdf import Array, UrdfModel

TRIP, STAY = 0.6, 0.3
"""Two shares of the range from `opened` to the upper limit: a latching joint trips at the first, and its latch holds it at the
second."""


SLIGHT = 0.0002
"""Minimum overlap in metres of two links at which their friction would jam the joint."""


@dataclass
class Mechanic:
    """A mechanism in a physics world, with its PyBullet body, its model at the zero posture, and the numbers of its joints."""

    client: int
    body: int
    mechanism: Mechanism
    model: UrdfModel
    joints: Mapping[str, int]
    held: dict[str, bool] = field(default_factory=dict)
    tripped: dict[str, bool] = field(default_factory=dict)

    @property
    def latching(self) -> bool:
        """Whether a joint of the mechanism has a latch."""
        return any(link.latches for link in self.mechanism.links)

    def link(self, name: str) -> Link:
        """Return a link by its name."""
        return next(link for link in self.mechanism.links if link.name == name)

    def values(self) -> dict[str, float]:
        """Return the present joint values by link."""
        return {
            name: pybullet.getJointState(self.body, joint, physicsClientId=self.client)[0]
            for name, joint in self.joints.items()
        }

    def moved(self, name: str, values: Mapping[str, float] | None = None) -> tuple[Array, Array]:
        """Return a link's rotation and shift relative to the zero posture, with joints at their present values or at `values`."""
        return moved(self.mechanism, self.model, name, self.values() if values is None else values)

    def frame(self, name: str, values: Mapping[str, float] | None = None) -> tuple[Array, Array]:
        """Return a link's frame (rotation, origin) in the world; the mechanism's own name denotes its base."""
        turned, shift = self.moved(name, values)
        zero, origin = self.model.frames[urdf_name(self.mechanism, name)]
        return turned @ zero, turned @ origin + shift

    def solids(self, values: Mapping[str, float] | None = None, aside: Array = HERE) -> Iterator[Solid]:
        """Yield the mechanism's solids, with the joints at `values` if given, shifted by `aside` (3,) metres."""
        return solids(self.mechanism, self.model, self.values() if values is None else values, aside)

    def set(self, name: str, opened: bool) -> None:
        """Set a link's joint open or shut, for the initial state and for interventions."""
        link = self.link(name)
        value = link.wide if opened else 0.0
        pybullet.resetJointState(self.body, self.joints[name], value, physicsClientId=self.client)
        if link.latches:
            self.held[name] = opened
            _resist(self.client, self.body, self.joints[name], link, opened)

    def drive(self) -> None:
        """Update the joints with latches: a joint that is pushed far enough changes between its held and its released state."""
        for name, joint in self.joints.items():
            link = self.link(name)
            if not link.latches:
                continue
            value = pybullet.getJointState(self.body, joint, physicsClientId=self.client)[0]
            down = value > link.opened + TRIP * (link.upper - link.opened)
            if down and not self.tripped.get(name, False):
                self.held[name] = not self.held.get(name, False)
                _resist(self.client, self.body, joint, link, self.held[name])
            back = value < link.opened + (TRIP + STAY) / 2 * (link.upper - link.opened)
            self.tripped[name] = down or (self.tripped.get(name, False) and not back)


def load_mechanism(client: int, mechanism: Mechanism) -> Mechanic:
    """Load a mechanism into a physics world, with all joints at 0."""
    position, orientation = mechanism.position, pybullet.getQuaternionFromEuler([0, 0, mechanism.yaw])
    if mechanism.urdf:
        body = pybullet.loadURDF(mechanism.urdf, position, orientation, useFixedBase=True, physicsClientId=client)
    else:
        solid = {"useFixedBase": True, "flags": pybullet.URDF_USE_SELF_COLLISION}
        body = load_written(written(mechanism), position, orientation, **solid, physicsClientId=client)
    numbers = {}
    for i in range(pybullet.getNumJoints(body, physicsClientId=client)):
        numbers[pybullet.getJointInfo(body, i, physicsClientId=client)[12].decode()] = i
        pybullet.changeDynamics(body, i, lateralFriction=mechanism.friction, physicsClientId=client)
    pybullet.changeDynamics(body, -1, lateralFriction=mechanism.friction, physicsClientId=client)
    joints = {link.name: numbers[link.urdf_link or link.name] for link in mechanism.links}
    for link in mechanism.links:
        pybullet.changeDynamics(body, joints[link.name], jointDamping=link.damping, physicsClientId=client)
        _resist(client, body, joints[link.name], link, False)
    mechanic = Mechanic(client, int(body), mechanism, read_mechanism(mechanism), joints)
    if not mechanism.urdf:
        _let_touch(mechanic)
    return mechanic


def _let_touch(mechanic: Mechanic) -> None:
    """Disable collisions of links that are stated to touch, or that touch each other or the base at joint values 0.

    Raise `ValueError` with the names and the overlap in millimetres if two links penetrate each other.
    """
    owners: dict[str, tuple[int, Mechanism | Link]] = {mechanic.mechanism.name: (-1, mechanic.mechanism)}
    owners |= {link.name: (mechanic.joints[link.name], link) for link in mechanic.mechanism.links}
    for (one, (i, first)), (other, (j, second)) in combinations(owners.items(), 2):
        depth = overlap_of(mechanic.client, (mechanic.body, i), (mechanic.body, j))
        stated = _touches(first, second) or _touches(second, first)
        if depth > DEEP and not stated:
            raise ValueError(
                f"{other} is {depth * 1000:.0f} mm inside {one} while the joints of {mechanic.mechanism.name} are at 0; "
                "run confab validate, which names the parts"
            )
        if stated or depth > SLIGHT:
            pybullet.setCollisionFilterPair(mechanic.body, mechanic.body, i, j, 0, physicsClientId=mechanic.client)


def _touches(one: Mechanism | Link, other: Mechanism | Link) -> bool:
    return isinstance(one, Link) and any(part.name in one.touches for part in other.parts)


def overlap_of(client: int, one: tuple[int, int], other: tuple[int, int]) -> float:
    """Return the overlap in metres of two links (body, number) of a physics world; 0 if they don't overlap."""
    (body, i), (second, j) = one, other
    points = pybullet.getClosestPoints(body, second, 0.001, i, j, physicsClientId=client)
    return max((-float(point[8]) for point in points if point[8] < 0), default=0.0)


def _resist(client: int, body: int, joint: int, link: Link, held: bool) -> None:
    """Set a joint's spring or, without a spring, its friction.

    The spring pushes the joint to 0, or with `held` to the value at which the latch holds the joint.

    A motor with target velocity 0 models Coulomb friction, since PyBullet does not read friction from the URDF.
    """
    if link.spring:
        rest = link.opened + STAY * (link.upper - link.opened) if held else 0.0
        control = {"controlMode": pybullet.POSITION_CONTROL, "targetPosition": rest, "force": link.spring}
        gains = {"positionGain": 0.1, "velocityGain": 0.5}
        pybullet.setJointMotorControl2(body, joint, **control, **gains, physicsClientId=client)
    else:
        control = {"controlMode": pybullet.VELOCITY_CONTROL, "targetVelocity": 0.0, "force": link.friction}
        pybullet.setJointMotorControl2(body, joint, **control, physicsClientId=client)
