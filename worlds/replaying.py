"""Replay of exported trajectories in a new world by joint servos, without skills, planning or sense of touch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.symbols import State
from confab.sim.arms import hand_frames
from confab.sim.engine import RATE
from confab.sim.robot import CLOSING, Manipulator
from confab.sim.staging import Perturbation
from confab.sim.urdf import Array
from confab.sim.world import PhysicsWorld

LOOKING = 6
"""Simulation steps between two measurements of the tracking error."""

AFTER = 1.0
"""Seconds that a replay waits after the last primitive."""


@dataclass(frozen=True)
class Replay:
    """The result of replayed trajectories: perceived facts at the end, and largest error in metres of a hand's position."""

    state: State
    tracking: float


def replay(
    embodiment: Embodiment,
    initial: State,
    primitives: Sequence[Mapping[str, Any]],
    seed: int = 0,
    perturb: Perturbation | None = None,
    beads: bool = True,
) -> Replay:
    """Execute exported trajectories in a new world by joint servos; other parameters have the same meaning as in `PhysicsWorld`."""
    with PhysicsWorld(embodiment, initial, seed, perturb, beads) as world:
        paths = {name: _path(primitives, name) for name in world.hands}
        fingers = {name: sorted(_gripper(primitives, name)) for name in world.hands}
        end = max((float(primitive["end"]) for primitive in primitives), default=0.0) + AFTER
        tracking = 0.0
        for number in range(round(end * RATE)):
            now = number / RATE
            for name, hand in world.hands.items():
                times, path = paths[name]
                if not len(times):
                    continue
                goal, velocity = np.array([np.interp(now, times, part) for part in path.T]).reshape(2, -1)
                hand.command(goal, velocity if now < times[-1] else None)
                while fingers[name] and fingers[name][0][0] <= now:
                    _, position, effort = fingers[name].pop(0)
                    _grip(hand, position, effort)
                if number % LOOKING == 0:
                    reached, wanted = hand_frames(hand.arm, np.stack([hand.measured(), goal]))[1]
                    tracking = max(tracking, float(np.linalg.norm(reached - wanted)))
            world.run(1)
        return Replay(world.observe(), tracking)


def _path(primitives: Sequence[Mapping[str, Any]], hand: str) -> tuple[Array, Array]:
    """Return the times (n,) of a hand's samples over all primitives, and its postures with velocities (n, 2 k)."""
    times, path = [], []
    for primitive, own in _of_hand(primitives, hand):
        for point in own["follow_joint_trajectory"]["trajectory"]["points"]:
            times.append(primitive["begin"] + _seconds(point["time_from_start"]))
            path.append([*point["positions"], *point["velocities"]])
    return np.array(times), np.array(path)


def _gripper(primitives: Sequence[Mapping[str, Any]], hand: str) -> Iterator[tuple[float, float, float]]:
    """Yield the time, position and effort of each gripper command of a hand."""
    for primitive, own in _of_hand(primitives, hand):
        for one in own["gripper"]:
            command = one["command"]
            yield primitive["begin"] + _seconds(one["time_from_start"]), command["position"], command["max_effort"]


def _of_hand(
    primitives: Sequence[Mapping[str, Any]], hand: str
) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    ordered = sorted(primitives, key=lambda primitive: float(primitive["begin"]))
    return ((primitive, own) for primitive in ordered for own in primitive["hands"] if own["hand"] == hand)


def _seconds(duration: Mapping[str, int]) -> float:
    return duration["sec"] + duration["nanosec"] * 1e-9


def _grip(hand: Manipulator, position: float, effort: float) -> None:
    for joint in hand.fingers:
        pybullet.setJointMotorControl2(
            hand.body,
            joint,
            pybullet.POSITION_CONTROL,
            targetPosition=position,
            force=effort,
            maxVelocity=CLOSING if position == 0 else 0.3,
            physicsClientId=hand.client,
        )
