"""Which places a hand reaches, from geometry alone: URDF, table and shapes, without a physics engine.

A hand reaches a place if, for every height at which the scene's bodies are grasped, some posture takes it there, lets it come
from before and go up, within all joints' limits and without touching furniture or the robot's own trunk.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reasoner.embodiment.values import Embodiment, Hand, Place, Robot
from sim.arms import read_arm
from sim.assembly import read_robot
from sim.collision import Solid, Surroundings, box, fixed_spheres, read_mover
from sim.linkage import with_open_mechanisms
from sim.motion import Reacher
from sim.stages import MARGIN, Numbers, grip_stages
from sim.urdf import Model

VERSION = "1"
"""Counts changes of the method, so that results of an older one aren't taken for current."""


@dataclass(frozen=True)
class Reach:
    """Pairs of hand and place, and a hash of everything that they were computed from."""

    pairs: frozenset[tuple[str, str]]
    inputs: str


def reach(embodiment: Embodiment) -> Reach:
    """Return which places each hand reaches.

    Raises
    ------
    ValueError
        No behaviour uses the skill that reaches, so there are no settings to go by.
    """
    settings = [use.numbers for use in embodiment.skills.values() if use.skill == "reach"]
    if not settings:
        raise ValueError("no behaviour is carried out by the skill 'reach': what a hand reaches isn't defined")
    numbers = {name: max(found[name] for found in settings) for name in ("approach", "raised")}
    heights = sorted({body.shape.grasp_height for body in embodiment.bodies.values()}) or [settings[0]["empty_height"]]
    pairs = set()
    places, solids = with_open_mechanisms(embodiment)
    for robot in embodiment.robots:
        for stand, model in _standing(robot, embodiment):
            near = [p for p in places.values() if not stand or embodiment.places[p.name].stand in ("", stand)]
            for hand in robot.hands:
                reacher = _reacher(embodiment, robot, hand, model, solids)
                found = [
                    place
                    for place in near
                    if all(_reaches(reacher, place, h, numbers) for h in _heights(embodiment, place, heights))
                ]
                pairs |= {(hand.name, place.name) for place in found}
    return Reach(frozenset(pairs), fingerprint(embodiment))


def _standing(robot: Robot, embodiment: Embodiment) -> Iterator[tuple[str, Model]]:
    """Yield the robot at every stand that it can drive to, or where it stands fast."""
    if not robot.driving:
        yield "", read_robot(robot)
        return
    for stand in embodiment.stands.values():
        yield stand.name, read_robot(robot, np.array([*stand.position[:2], stand.yaw]))


def fingerprint(embodiment: Embodiment) -> str:
    """Return a SHA-256 hash of what reach depends on: files by content, numbers by value."""
    parts = [VERSION]
    for robot in embodiment.robots:
        values = _told(asdict(robot), ("driving", "turning") if not robot.driving else ())
        bare = ("gripper", "flange", "mounting")
        values["hands"] = tuple(
            {**hand, "gripper": _content(hand["gripper"])} if hand["gripper"] else _told(hand, bare)
            for hand in values["hands"]
        )
        values["urdf"] = _content(robot.urdf)
        parts.append(repr(values))
    parts += [repr(fixture) for fixture in embodiment.fixtures]
    parts += [f"Place(name={p.name!r}, position={p.position!r})" for _, p in sorted(embodiment.places.items())]
    parts += [repr(stand) for _, stand in sorted(embodiment.stands.items())]
    parts += [repr(place.stand) for _, place in sorted(embodiment.places.items()) if place.stand]
    parts += [repr(place.height) for _, place in sorted(embodiment.places.items()) if place.height is not None]
    parts += [repr(place.carrier) for _, place in sorted(embodiment.places.items()) if place.carrier]
    parts += [repr(mechanism) for mechanism in embodiment.mechanisms]
    parts += sorted({repr(body.shape.grasp_height) for body in embodiment.bodies.values()})
    reaching = [use.numbers for _, use in sorted(embodiment.skills.items()) if use.skill == "reach"]
    parts += [repr(sorted((name, value) for name, value in uses.items() if name != "time_limit")) for uses in reaching]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _heights(embodiment: Embodiment, place: Place, heights: Sequence[float]) -> Sequence[float]:
    """Return the heights above a place at which hands take what stands there."""
    said = embodiment.places[place.name].height
    return heights if said is None else (said,)


def _content(file: Path | str) -> str:
    """Return a hash of what is in a file, wherever that is."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _told(values: dict[str, Any], without: Sequence[str]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if name not in without}


def _reacher(embodiment: Embodiment, robot: Robot, hand: Hand, model: Model, solids: Sequence[Solid]) -> Reacher:
    """Return an open hand among the furniture and the robot's own trunk."""
    arms = [read_arm(model, other.arm, other.tip, other.turned, other.home) for other in robot.hands]
    arm = arms[robot.hands.index(hand)]
    around = Surroundings((*map(box, embodiment.fixtures), *solids))
    around = around.plus(robot.name, fixed_spheres(model, arms))
    return Reacher(read_mover(model, arm, dict.fromkeys(hand.fingers, hand.opening)), around, MARGIN)


def _reaches(reacher: Reacher, place: Place, height: float, numbers: Numbers) -> bool:
    """Tell whether some posture at a grasp height above the place passes all stages."""
    grip = np.array(place.position) + np.array([0.0, 0.0, height])
    solved = [reacher.solve(stage.poses) for stage in grip_stages(grip, numbers)]
    valid = np.all([ok for _, ok in solved], axis=0)
    if not valid.any():
        return False
    return bool(np.any(np.all([reacher.free(q[valid]) for q, _ in solved], axis=0)))
