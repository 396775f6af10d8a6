"""A hand with its arm: kinematics and the PyBullet joints that move it."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Hand, Robot
from confab.sim.arms import Arm, hand_frames, read_arm
from confab.sim.assembly import assembled, plain, read_robot
from confab.sim.collision import Mover, fixed_spheres, read_mover
from confab.sim.motion import MotionLimits, pose_of
from confab.sim.urdf import Array, Spheres, UrdfModel

CENTERING = 400.0
"""Stiffness, in newtons per metre, that centres the fingers and simulates the gear of a parallel gripper."""

POSITION_GAIN, VELOCITY_GAIN = 0.4, 1.0
"""Gains of an arm's motors."""

CLOSING = 0.12
"""Speed in metres per second of closing fingers."""


@dataclass(frozen=True)
class Whereabouts:
    """The object or place at which a hand is, and the position of this target when the hand arrived; a raised hand has no target.

    `floor` is the height in metres of the place from which the hand rises. A `lost` hand was stopped during a motion.
    """

    target: str = ""
    point: Array | None = None
    floor: float | None = None
    lost: bool = False


@dataclass
class Manipulator:
    """One hand of a robot in a physics world.

    `posture` is the arm's last command. `grasp` is the rotation and position of the held object in the hand at the grasp, the
    reference for slip. `limit` is the time limit in seconds of the running skill, and `deadline` is the simulation step at
    which the limit expires. `pace` is the share of its maximum speeds that the arm uses. `at` is the object or place to which
    the hand has moved. `opened_to` is the last command of the fingers in metres. `links` are the links that the arm moves.
    """

    client: int
    body: int
    robot: Robot
    hand: Hand
    model: UrdfModel
    arm: Arm
    joints: tuple[int, ...]
    fingers: tuple[int, ...]
    tip: int
    efforts: tuple[float, ...]
    finger_effort: float
    posture: Array
    closing: bool = False
    grasp: tuple[Array, Array] | None = None
    pace: float = 1.0
    limit: float = math.inf
    deadline: float = math.inf
    at: Whereabouts = Whereabouts()
    opened_to: float = 0.0
    links: frozenset[int] = frozenset()

    @property
    def limits(self) -> MotionLimits:
        """Limits of the arm's speed and acceleration without a load."""
        pace = self.pace
        return MotionLimits(self.arm.velocity * pace, self.robot.acceleration * pace**2, 1.6 * pace, 8.0 * pace**2)

    @property
    def pose(self) -> Array:
        """The hand's commanded pose (x, y, z, yaw, roll, swivel)."""
        return pose_of(self.arm, self.posture)

    def frame(self) -> tuple[Array, Array]:
        """Return the hand's measured rotation (3, 3) and position (3,)."""
        r, p = hand_frames(self.arm, self.measured()[None])
        return r[0], p[0]

    def measured(self) -> Array:
        """Return the arm's measured joint angles (k,)."""
        states = pybullet.getJointStates(self.body, self.joints, physicsClientId=self.client)
        return np.array([state[0] for state in states])

    def openings(self) -> tuple[float, ...]:
        """Return the finger joints' positions in metres."""
        states = pybullet.getJointStates(self.body, self.fingers, physicsClientId=self.client)
        return tuple(state[0] for state in states)

    def mover(self, opening: float | None = None) -> Mover:
        """Return the arm as spheres, with fingers at their present opening or open by `opening` metres."""
        openings = self.openings() if opening is None else [opening] * len(self.fingers)
        return read_mover(self.model, self.arm, dict(zip(self.hand.fingers, openings, strict=True)))

    def command(self, q: Array, velocity: Array | None = None) -> None:
        """Set the targets of the motors, which hold until the next command."""
        self.posture = q
        pybullet.setJointMotorControlArray(
            self.body,
            self.joints,
            pybullet.POSITION_CONTROL,
            targetPositions=q.tolist(),
            targetVelocities=[0.0] * len(q) if velocity is None else velocity.tolist(),
            forces=self.efforts,
            positionGains=[POSITION_GAIN] * len(q),
            velocityGains=[VELOCITY_GAIN] * len(q),
            physicsClientId=self.client,
        )

    def open(self, opening: float | None = None) -> None:
        """Command the fingers to their open position, or to `opening` metres."""
        self.closing, self.grasp = False, None
        self._fingers_to(self.hand.opening if opening is None else opening)

    def close(self) -> None:
        """Begin to close the fingers; afterwards `drive` must run in every simulation step."""
        self.closing = True

    def drive(self) -> None:
        """Drive closing fingers for one simulation step with equal forces; the leading finger gives way."""
        if not self.closing:
            return
        (first, *_), (second, *_) = pybullet.getJointStates(self.body, self.fingers, physicsClientId=self.client)
        grip = self.hand.grip
        lead = max(-grip * 0.6, min(grip * 0.6, CENTERING * (first - second)))
        pybullet.setJointMotorControlArray(
            self.body,
            self.fingers,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=(-CLOSING, -CLOSING),
            forces=(grip + lead, grip - lead),
            physicsClientId=self.client,
        )

    def _fingers_to(self, opening: float) -> None:
        self.opened_to = opening
        for joint in self.fingers:
            pybullet.setJointMotorControl2(
                self.body,
                joint,
                pybullet.POSITION_CONTROL,
                targetPosition=opening,
                force=self.finger_effort,
                maxVelocity=0.3,
                physicsClientId=self.client,
            )

    def pressing(self, other: int, part: int = -1) -> tuple[float, ...]:
        """Return the normal force in newtons with which each finger presses a body or the body's link `part`."""
        forces = []
        for link in self.fingers:
            contacts = pybullet.getContactPoints(self.body, other, link, part, physicsClientId=self.client)
            forces.append(sum(contact[9] for contact in contacts))
        return tuple(forces)

    def meets(self, other: int) -> bool:
        """Return whether the arm or the hand touches a body."""
        found = pybullet.getContactPoints(self.body, other, physicsClientId=self.client)
        return any(contact[9] > 0 and contact[3] in self.links for contact in found)

    @property
    def first_finger(self) -> Array:
        """Direction of the first finger's motion as the hand opens, in the hand's frame."""
        axis: Array = self.arm.tip_rotation.T @ self.model.joints[self.hand.fingers[0]].axis
        return axis

    def push(self) -> float:
        """Return the force in newtons with which the fingers press bodies ahead of the hand."""
        ahead = self.frame()[0][:, 0]
        total = 0.0
        for link in self.fingers:
            for contact in pybullet.getContactPoints(self.body, linkIndexA=link, physicsClientId=self.client):
                if contact[2] != self.body:
                    total += contact[9] * abs(float(np.dot(contact[7], ahead)))
        return total


def load_robot(client: int, robot: Robot) -> tuple[int, list[Manipulator], Spheres]:
    """Load a robot with its arms at home; return its body, its hands and the spheres of the links that no arm moves."""
    body = _load(client, robot)
    model = read_robot(robot)
    numbers, links, efforts = {}, {-1: robot.name}, {}
    for i in range(pybullet.getNumJoints(body, physicsClientId=client)):
        info = pybullet.getJointInfo(body, i, physicsClientId=client)
        numbers[info[1].decode()], links[i], efforts[info[1].decode()] = i, info[12].decode(), info[10]
    hands = [_manipulator(client, body, robot, hand, model, numbers, links, efforts) for hand in robot.hands]
    for hand in hands:
        _go_home(hand)
    return body, hands, fixed_spheres(model, [hand.arm for hand in hands])


def _load(client: int, robot: Robot) -> int:
    """Load a robot's body into a physics world."""
    flags = pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS
    place = {
        "basePosition": robot.position,
        "baseOrientation": pybullet.getQuaternionFromEuler([0, 0, robot.yaw]),
        "useFixedBase": True,
        "flags": flags | pybullet.URDF_USE_MATERIAL_COLORS_FROM_MTL,
        "physicsClientId": client,
    }
    if plain(robot):
        return int(pybullet.loadURDF(robot.urdf, **place))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(assembled(robot), encoding="utf-8")
        return int(pybullet.loadURDF(str(file), **place))


def _manipulator(
    client: int,
    body: int,
    robot: Robot,
    hand: Hand,
    model: UrdfModel,
    numbers: Mapping[str, int],
    links: Mapping[int, str],
    efforts: Mapping[str, float],
) -> Manipulator:
    arm = read_arm(model, hand.arm, hand.tip, hand.turned, hand.home)
    tip = next(number for number, link in links.items() if link == hand.tip)
    return Manipulator(
        client,
        body,
        robot,
        hand,
        model,
        arm,
        _look_up(numbers, hand.arm),
        _look_up(numbers, hand.fingers),
        tip,
        tuple(efforts[name] for name in hand.arm),
        efforts[hand.fingers[0]],
        np.array(hand.home),
        links=frozenset(
            i for i, link in links.items() if {joint.name for joint in model.chains.get(link, ())} & {*hand.arm}
        ),
    )


def _look_up(numbers: Mapping[str, int], names: Sequence[str]) -> tuple[int, ...]:
    return tuple(numbers[name] for name in names)


def _go_home(manipulator: Manipulator) -> None:
    """Set the arm's joints to the home posture before the first simulation step."""
    values = (*manipulator.hand.home, *[manipulator.hand.opening] * len(manipulator.fingers))
    for joint, value in zip((*manipulator.joints, *manipulator.fingers), values, strict=True):
        pybullet.resetJointState(manipulator.body, joint, value, physicsClientId=manipulator.client)
    manipulator.command(np.array(manipulator.hand.home))
    manipulator.open()
