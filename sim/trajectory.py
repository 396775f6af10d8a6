"""Trajectories of a verified plan as data: joint paths with times, gripper commands and grasp frames.

The data have the form of ROS messages. Each primitive and hand has a `control_msgs/FollowJointTrajectory` goal, and
`control_msgs` gripper commands with times. Grasp frames are a position and a quaternion (x, y, z, w). Units are metres,
radians, seconds and newtons.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.symbols import PrimitiveStep
from confab.sim.engine import LAG, RATE, Engine
from confab.sim.robot import Manipulator
from confab.sim.urdf import Array

EXACT = 3e-4
"""Maximum deviation in radians of the exported path from the commanded path; the exported path is linear between its points."""

GOAL_TOLERANCE, TIME_TOLERANCE = 0.01, 0.5
"""Tolerance in radians of each joint at the end of a path, and tolerance in seconds of the path's duration."""


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
