"""The base of a mobile robot in a physics world: joints along x and y and about z."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Robot, Stand
from confab.sim.assembly import DRIVE
from confab.sim.urdf import Array

FORCE = 5000.0
"""Maximum force, in newtons or newton metres, of each motor of a base."""


@dataclass
class Base:
    """The base of a robot in a physics world, on joints along x and y and about z.

    The base stops at most `miss` metres and `miss` radians away from the goal pose.
    """

    client: int
    body: int
    robot: Robot
    joints: tuple[int, ...]
    miss: float = 0.0

    def pose(self) -> Array:
        """Return the base's x, y and yaw."""
        along, across, turned = (
            state[0] for state in pybullet.getJointStates(self.body, self.joints, physicsClientId=self.client)
        )
        (x, y, _), yaw = self.robot.position, self.robot.yaw
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([x + cos * along - sin * across, y + sin * along + cos * across, yaw + turned])

    def _values(self, pose: Array) -> list[float]:
        (x, y, _), yaw = self.robot.position, self.robot.yaw
        dx, dy, cos, sin = pose[0] - x, pose[1] - y, math.cos(yaw), math.sin(yaw)
        return [cos * dx + sin * dy, cos * dy - sin * dx, pose[2] - yaw]

    def set(self, pose: Array) -> None:
        """Place the base at a pose (x, y, yaw) before the first simulation step; afterwards only the motors move the base."""
        for joint, value in zip(self.joints, self._values(pose), strict=True):
            pybullet.resetJointState(self.body, joint, value, physicsClientId=self.client)
        self.command(pose)

    def command(self, pose: Array) -> None:
        """Set the target of the motors to a pose (x, y, yaw); the motors hold the pose until the next command."""
        pybullet.setJointMotorControlArray(
            self.body,
            self.joints,
            pybullet.POSITION_CONTROL,
            targetPositions=self._values(pose),
            forces=[FORCE] * len(self.joints),
            positionGains=[0.8] * len(self.joints),
            velocityGains=[1.0] * len(self.joints),
            physicsClientId=self.client,
        )


def read_base(client: int, body: int, robot: Robot, miss: float) -> Base:
    """Return the base of a mobile robot, with its motors holding the present pose."""
    names = [name for name, _, _ in DRIVE]
    numbers = {}
    for i in range(pybullet.getNumJoints(body, physicsClientId=client)):
        numbers[pybullet.getJointInfo(body, i, physicsClientId=client)[1].decode()] = i
    base = Base(client, body, robot, tuple(numbers[name] for name in names), miss)
    base.command(base.pose())
    return base


def offset_from_stand(base: Base, stand: Stand) -> tuple[float, float]:
    """Return the distance in metres and the angle in radians between a base and a stand."""
    x, y, yaw = base.pose() - np.array([*stand.position[:2], stand.yaw])
    return float(np.hypot(x, y)), abs(float(np.angle(np.exp(1j * yaw))))
