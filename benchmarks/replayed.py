"""Exported trajectories, replayed by position servos of PyBullet alone, on bodies with random deviations.

    python -m benchmarks.replayed FROM TO [SCENE …]

A plan is executed with each seed, and its trajectories are exported as JSON. If the rollout is verified, the exported
text is replayed in a new world with the same deviations. The replay reads only the text and the names of joints. The
replay uses neither skills, planners, touch nor the controllers of the folder `sim`. As in ROS, the path between two
points is the cubic with their positions and velocities. The tracking error is the largest distance of a hand's tip from
its position at the commanded posture. PyBullet's kinematics computes both positions.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pybullet

import confab
from confab.scene import Scene
from confab.sim.robot import load_robot
from confab.sim.staging import Perturbation
from confab.sim.trajectory import Recorder, exported
from confab.sim.urdf import Array
from confab.sim.verify import expectations, verify
from confab.sim.world import PhysicsWorld

SCENES = (
    "beverage-serving",
    "beverage-serving-moved",
    "two-cups",
    "three-cups",
    "one-arm-serving",
    "panda-serving",
    "iiwa-serving",
    "kitchen-corner",
    "spice-drawer",
    "centrifuge",
)

GAIN, STEPS_PER_SECOND, AFTER, EVERY = 0.5, 240, 1.0, 4
"""Position gain of the servos, simulation steps per second, seconds after the last command, and steps per measurement."""

CLOSING = 0.12
"""Speed limit of fingers in metres per second."""

WIDE = 0.005
"""Maximum tracking error of a replay in metres."""


def text_of(scene: Scene, seed: int) -> str | None:
    """Return the exported trajectories of a perturbed rollout as JSON, or None if the rollout isn't verified."""
    steps, recorder, slots, now = scene.plan().plan.primitives, Recorder(), [], 0.0
    expected = expectations(scene.problem, steps)
    rollout = verify(
        scene.embodiment, scene.problem.initial, steps, expected, seed=seed, perturb=Perturbation(), watch=recorder
    )
    if not rollout.ok:
        return None
    for report in rollout.steps:
        slots.append((report.step, now, now + report.seconds))
        now += report.seconds
    return json.dumps(list(exported(scene.embodiment, recorder, slots)))


def seconds(duration: Mapping[str, int]) -> float:
    return duration["sec"] + duration["nanosec"] * 1e-9


def replayed(scene: Scene, seed: int, text: str) -> tuple[list[str], float]:
    """Return the unmet goals after a replay, and the tracking error in metres."""
    primitives = sorted(json.loads(text), key=lambda primitive: float(primitive["begin"]))
    end = max(float(primitive["end"]) for primitive in primitives) + AFTER
    with PhysicsWorld(scene.embodiment, scene.problem.initial, seed, Perturbation()) as world:
        servos = [Servo(world, name, primitives) for name in world.hands]
        error = 0.0
        for step in range(round(end * STEPS_PER_SECOND)):
            for servo in servos:
                servo.command(step / STEPS_PER_SECOND)
                if step % EVERY == 0:
                    error = max(error, servo.error())
            world.run(1)
        for name in world.bodies:  # also of hidden bodies, the true positions count
            world.remember(name, *world.truth(name))
        state = world.observe()
        for servo in servos:
            servo.close()
    return [f"{symbol} {value}" for symbol, value in scene.problem.goal.items() if state.get(symbol) != value], error


class Servo:
    """The position servos of one hand, and a second robot that is placed in each commanded posture."""

    def __init__(self, world: PhysicsWorld, name: str, primitives: Sequence[Mapping[str, Any]]) -> None:
        hand = world.hands[name]
        self.client, self.body, self.fingers, self.tip = world.client, hand.body, hand.fingers, hand.tip
        self.joints, self.efforts = hand.joints, hand.efforts
        own = [(float(one["begin"]), used) for one in primitives for used in one["hands"] if used["hand"] == name]
        points = [
            (begin + seconds(point["time_from_start"]), point["positions"], point["velocities"])
            for begin, used in own
            for point in used["follow_joint_trajectory"]["trajectory"]["points"]
        ]
        for _, used in own:
            names = [
                pybullet.getJointInfo(self.body, joint, physicsClientId=self.client)[1].decode()
                for joint in self.joints
            ]
            assert used["follow_joint_trajectory"]["trajectory"]["joint_names"] == names
        home = list(hand.posture)
        points = points or [(0.0, home, [0.0] * len(home))]
        self.times: Array = np.array([time for time, _, _ in points])
        self.positions: Array = np.array([position for _, position, _ in points])
        self.velocities: Array = np.array([velocity for _, _, velocity in points])
        self.gripper = [
            (begin + seconds(one["time_from_start"]), one["command"]) for begin, used in own for one in used["gripper"]
        ]
        self.posture = np.array(home)
        self.shadow = pybullet.connect(pybullet.DIRECT)
        self.other, *_ = load_robot(self.shadow, hand.robot)

    def command(self, now: float) -> None:
        """Command the posture, the velocities and the positions of the fingers for a time."""
        self.posture, velocity = self.cubic(now)
        pybullet.setJointMotorControlArray(
            self.body,
            self.joints,
            pybullet.POSITION_CONTROL,
            targetPositions=self.posture.tolist(),
            targetVelocities=velocity.tolist(),
            forces=self.efforts,
            positionGains=[GAIN] * len(self.joints),
            velocityGains=[1.0] * len(self.joints),
            physicsClientId=self.client,
        )
        while self.gripper and self.gripper[0][0] <= now:
            command = self.gripper.pop(0)[1]
            for joint in self.fingers:
                pybullet.setJointMotorControl2(
                    self.body,
                    joint,
                    pybullet.POSITION_CONTROL,
                    targetPosition=command["position"],
                    force=command["max_effort"],
                    maxVelocity=CLOSING,
                    physicsClientId=self.client,
                )

    def cubic(self, now: float) -> tuple[Array, Array]:
        """Return positions and velocities at a time, from the cubic between two points.

        Before the first point and after the last point, the hand rests.
        """
        after = int(np.searchsorted(self.times, now, side="right"))
        if after in (0, len(self.times)):
            edge = self.positions[min(after, len(self.times) - 1)]
            return edge, np.zeros_like(edge)
        before, span = after - 1, self.times[after] - self.times[after - 1]
        share = (now - self.times[before]) / span
        p, q = self.positions[before], self.positions[after]
        v, w = self.velocities[before] * span, self.velocities[after] * span
        cubic, square = 2 * p - 2 * q + v + w, 3 * q - 3 * p - 2 * v - w
        return ((cubic * share + square) * share + v) * share + p, ((3 * cubic * share + 2 * square) * share + v) / span

    def error(self) -> float:
        """Return the distance in metres of the hand's tip from its position at the commanded posture."""
        for joint, value in zip(self.joints, self.posture, strict=True):
            pybullet.resetJointState(self.other, joint, float(value), physicsClientId=self.shadow)
        reached = pybullet.getLinkState(self.body, self.tip, computeForwardKinematics=1, physicsClientId=self.client)[4]
        wanted = pybullet.getLinkState(self.other, self.tip, computeForwardKinematics=1, physicsClientId=self.shadow)[4]
        return float(np.linalg.norm(np.subtract(reached, wanted)))

    def close(self) -> None:
        """Remove the second robot."""
        pybullet.disconnect(self.shadow)


def main() -> None:
    """Print a line for each replay, and the totals."""
    begin, end, *names = sys.argv[1:]
    same = wide = total = 0
    for name in names or SCENES:
        scene = confab.load(name)
        for seed in range(int(begin), int(end)):
            text = text_of(scene, seed)
            if text is None:
                print(f"{name}, seed {seed}: not verified, so nothing is exported", flush=True)
                continue
            open_, error = replayed(scene, seed, text)
            total, same, wide = total + 1, same + (not open_), wide + (error > WIDE)
            said = f"open: {', '.join(open_)}" if open_ else "the same goals"
            print(f"{name}, seed {seed}: {said}, tracking {error * 1000:.1f} mm", flush=True)
    print(f"the same goals in {same} of {total} replays; tracking above {WIDE * 1000:.0f} mm in {wide}")


if __name__ == "__main__":
    main()
