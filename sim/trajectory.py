"""Trajectories of a verified plan as data: joint paths with times, gripper commands and grasp frames.

The data have the form of ROS messages. Each primitive and hand has a `control_msgs/FollowJointTrajectory` goal, and
`control_msgs` gripper commands with times. Grasp frames are a position and a quaternion (x, y, z, w). Units are metres,
radians, seconds and newtons. `replay` executes the data in a new world by joint servos, without skills, planning or sense of
touch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.symbols import PrimitiveStep, State
from confab.sim.arms import hand_frames
from confab.sim.engine import LAG, RATE, Engine
from confab.sim.robot import CLOSING, Manipulator
from confab.sim.staging import Perturbation
from confab.sim.urdf import Array
from confab.sim.world import PhysicsWorld

EXACT = 3e-4
"""Maximum deviation in radians of the exported path from the commanded path; the exported path is linear between its points."""

GOAL_TOLERANCE, TIME_TOLERANCE = 0.01, 0.5
"""Tolerance in radians of each joint at the end of a path, and tolerance in seconds of the path's duration."""

LOOKING = 6
"""Simulation steps between two measurements of the tracking error in a replay."""

AFTER = 1.0
"""Seconds that a replay waits after the last primitive."""


@dataclass
class Tape:
    """The commands of one hand.

    `steps` has the number of simulation steps at which each posture was recorded. A gripper command or grasp has the number of
    simulation steps at which it began. A grasp also has the name of the held object, and the object's rotation and base in the
    hand's frame.
    """

    steps: list[int] = field(default_factory=list)
    postures: list[Array] = field(default_factory=list)
    gripper: list[tuple[int, float, float]] = field(default_factory=list)
    grasps: list[tuple[int, str, Array, Array]] = field(default_factory=list)


@dataclass
class Recorder:
    """Records the commands of all hands; to be passed to a world as `watch`."""

    tapes: dict[str, Tape] = field(default_factory=dict)

    def __call__(self, world: Engine) -> None:
        """Record the commands of the simulation step that has just ended."""
        for name, hand in world.hands.items():
            tape = self.tapes.setdefault(name, Tape())
            tape.steps.append(world.steps)
            tape.postures.append(hand.posture)
            fingers = (0.0, hand.hand.grip) if hand.closing else (hand.opened_to, hand.finger_effort)
            if not tape.gripper or tape.gripper[-1][1:] != fingers:
                tape.gripper.append((world.steps - 1, *fingers))
            held = None if hand.grasp is None else world.held(name) if self._new(tape, hand) else None
            if held is not None and hand.grasp is not None:
                tape.grasps.append((world.steps - 1, held, *hand.grasp))

    def _new(self, tape: Tape, hand: Manipulator) -> bool:
        """Return whether the grasp of the hand differs from the last recorded grasp."""
        return not tape.grasps or hand.grasp is None or tape.grasps[-1][3] is not hand.grasp[1]


def exported(
    embodiment: Embodiment, recorder: Recorder, slots: Sequence[tuple[PrimitiveStep, float, float]]
) -> Iterator[dict[str, Any]]:
    """Yield each primitive with the trajectories of its hands; a slot is a primitive with its begin and end in seconds."""
    for step, begin, end in slots:
        roles = {*step.arguments, *step.bindings.values()}
        own = [name for name in recorder.tapes if name in roles]
        yield {
            "path": list(step.path),
            "behavior": step.behavior,
            "arguments": list(step.arguments),
            "begin": round(begin, 6),
            "end": round(end, 6),
            "hands": [
                found
                for name in own
                if (found := _hand(embodiment, name, recorder.tapes[name], round(begin * RATE), round(end * RATE)))
            ],
        }


def _hand(embodiment: Embodiment, name: str, tape: Tape, begin: int, end: int) -> dict[str, Any] | None:
    """Return the commands of a hand between two simulation steps, or None if there are none."""
    joints = list(embodiment.hand(name)[1].arm)
    offset = tape.steps[0] if tape.steps else 0
    postures = np.array(tape.postures[max(begin + 1 - offset, 0) : end + 1 - offset])
    if not len(postures):
        return None
    times = np.arange(len(postures)) / RATE
    velocities = np.gradient(postures, 1 / RATE, axis=0) if len(postures) > 1 else np.zeros_like(postures)
    kept = _corners(postures)
    point = [
        {
            "positions": _rounded(postures[i]),
            "velocities": _rounded(velocities[i]),
            "time_from_start": _duration(float(times[i])),
        }
        for i in kept
    ]
    return {
        "hand": name,
        "follow_joint_trajectory": {
            "trajectory": {"joint_names": joints, "points": point},
            "path_tolerance": [{"name": joint, "position": LAG} for joint in joints],
            "goal_tolerance": [{"name": joint, "position": GOAL_TOLERANCE} for joint in joints],
            "goal_time_tolerance": _duration(TIME_TOLERANCE),
        },
        "gripper": [
            {
                "time_from_start": _duration((at - begin) / RATE),
                "command": {"position": round(position, 6), "max_effort": round(effort, 3)},
            }
            for at, position, effort in tape.gripper
            if begin <= at < end
        ],
        "grasps": [
            {
                "time_from_start": _duration((at - begin) / RATE),
                "object": held,
                "position": _rounded(base),
                "orientation": _rounded(_quaternion(rotation)),
            }
            for at, held, rotation, base in tape.grasps
            if begin < at <= end
        ],
    }


def _corners(q: Array) -> list[int]:
    """Return the indices of the corners of a path, with both ends; between corners the path is straight within `EXACT`."""
    kept, stack = {0, len(q) - 1}, [(0, len(q) - 1)]
    while stack:
        i, j = stack.pop()
        if j - i < 2:
            continue
        share = np.linspace(0.0, 1.0, j - i + 1)[:, None]
        away = np.abs(q[i] * (1 - share) + q[j] * share - q[i : j + 1]).max(1)
        worst = int(away.argmax())
        if away[worst] > EXACT:
            kept.add(i + worst)
            stack += [(i, i + worst), (i + worst, j)]
    return sorted(kept)


def _duration(seconds: float) -> dict[str, int]:
    whole = math.floor(seconds)
    return {"sec": whole, "nanosec": round((seconds - whole) * 1e9)}


def _rounded(numbers: Array) -> list[float]:
    return [round(float(number), 6) for number in numbers]


def _quaternion(rotation: Array) -> Array:
    """Return a rotation matrix as a quaternion (x, y, z, w)."""
    symmetric = np.array(
        [
            [rotation[0, 0] - rotation[1, 1] - rotation[2, 2], 0.0, 0.0, 0.0],
            [rotation[0, 1] + rotation[1, 0], rotation[1, 1] - rotation[0, 0] - rotation[2, 2], 0.0, 0.0],
            [
                rotation[0, 2] + rotation[2, 0],
                rotation[1, 2] + rotation[2, 1],
                rotation[2, 2] - rotation[0, 0] - rotation[1, 1],
                0.0,
            ],
            [
                rotation[2, 1] - rotation[1, 2],
                rotation[0, 2] - rotation[2, 0],
                rotation[1, 0] - rotation[0, 1],
                np.trace(rotation),
            ],
        ]
    )
    vectors: Array = np.linalg.eigh(symmetric)[1]
    found: Array = vectors[:, -1] * (1.0 if vectors[3, -1] >= 0 else -1.0)
    return found


# ----------------------------------------------------------------------------------------------------------- replay


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
