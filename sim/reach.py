"""The places within reach of each hand, computed from the geometry of URDF, furniture and shapes, without a physics engine.

Bodies of the scene are grasped at one or more heights. A hand reaches a place if there is a grasp pose at each of these heights. A
height doesn't count if no hand reaches any place of the same kind at this height. Approach, grasp and lift must be within the
joints' limits, and free of contact with furniture and the robot's trunk. Below an obstacle, a hand lifts an object less high. A
hand reaches a place on a movable body if it reaches the place for at least one place of the body. Physics finds whether the hand
reaches the place while the body is at its present place.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from confab.reasoner.embodiment.values import Embodiment, Hand, Place, Robot
from confab.sim.arms import read_arm
from confab.sim.assembly import read_robot
from confab.sim.bodies import height_of, outline
from confab.sim.collision import Obstacles, Solid, box, column, fixed_spheres, read_mover
from confab.sim.linkage import with_open_mechanisms
from confab.sim.motion import Reacher, beyond
from confab.sim.stages import MARGIN, Numbers, grip_stages, rises
from confab.sim.urdf import Spheres, UrdfModel

VERSION = "4"
"""Version of the computation of reach; the fingerprint of the inputs contains the version.

A stored result of another version counts as outdated.
"""

SPARE = 0.01
"""Distance in metres by which an object may stand farther away than its place."""

LAYERS = 3
"""Maximum height of a stack of movable bodies, in bodies; reach of the places on higher bodies isn't computed."""

STAGES = ("when grasping", "when approaching", "when lifting")
"""Names of the stages of a grasp, in the order of `grip_stages`."""


@dataclass(frozen=True)
class Reach:
    """Pairs of a hand and a place within the hand's reach, and a hash of the inputs."""

    pairs: frozenset[tuple[str, str]]
    inputs: str


def reach(embodiment: Embodiment) -> Reach:
    """Return the pairs of a hand and a place within the hand's reach.

    Raises
    ------
    ValueError
        The settings are missing, since no behaviour uses the skill `reach`.
    """
    numbers, heights = _settings(embodiment)
    points, solids = _positions(embodiment)
    found: dict[float, set[tuple[str, str]]] = {height: set() for height in heights}
    for robot in embodiment.robots:
        for stand, model in _standing(robot, embodiment):
            for hand in robot.hands:
                reacher = _reacher(embodiment, robot, hand, model, solids)
                for name, places in points.items():
                    near = [place for place in places if not stand or place.stand in ("", stand)]
                    for height in _heights(embodiment, name, heights):
                        loaded = _loaded(reacher, embodiment, height)
                        if any(_reaches(reacher, loaded, place, height, numbers) for place in near):
                            found.setdefault(height, set()).add((hand.name, name))
    pairs: set[tuple[str, str]] = set()
    for names in _kinds(embodiment):
        usual = [height for height in heights if any(place in names for _, place in found[height])]
        tried = {(hand, place) for reached in found.values() for hand, place in reached if place in names}
        pairs |= {one for one in tried if all(one in found[height] for height in _heights(embodiment, one[1], usual))}
    return Reach(frozenset(pairs), fingerprint(embodiment))


def _kinds(embodiment: Embodiment) -> tuple[set[str], set[str]]:
    """Return the places on movable bodies, and the other places."""
    carried = {place.name for place in embodiment.places.values() if place.carrier in embodiment.bodies}
    return carried, {*embodiment.places} - carried


def _positions(embodiment: Embodiment) -> tuple[dict[str, tuple[Place, ...]], list[Solid]]:
    """Return each place at every position that it can have, and the solids of mechanisms, both with all joints open.

    A place on a movable body can be above every other place, and above places on other movable bodies.
    """
    fixed, solids = with_open_mechanisms(embodiment)
    found: dict[str, tuple[Place, ...]] = {
        name: (replace(place, stand=embodiment.places[name].stand),) for name, place in fixed.items()
    }
    carried = [place for place in embodiment.places.values() if place.carrier in embodiment.bodies]
    for _ in range(min(len(carried), LAYERS)):
        below = dict(found)
        for place in carried:
            others = [spots for name, spots in below.items() if embodiment.places[name].carrier != place.carrier]
            raised = []
            for spot in chain.from_iterable(others):
                x, y, z = (round(a + b, 4) for a, b in zip(spot.position, place.position, strict=True))
                raised.append(replace(place, position=(x, y, z), carrier="", stand=spot.stand))
            found[place.name] = tuple(dict.fromkeys(raised))
    return found, solids


def hindrance(embodiment: Embodiment, place: str) -> tuple[str, ...]:
    """Return a message for each hand that doesn't reach a place: the first impossible stage of a grasp, and the obstacle.

    All links are open.

    Raises
    ------
    ValueError
        No behaviour uses the skill `reach`, or the place has no position.
    """
    numbers, heights = _settings(embodiment)
    points, solids = _positions(embodiment)
    if not points.get(place):
        raise ValueError(f"the position of {place} is unknown: its carrier stands at no place")
    where = points[place][0]
    found = []
    for robot in embodiment.robots:
        for stand, model in _standing(robot, embodiment):
            for hand in robot.hands:
                reacher = _reacher(embodiment, robot, hand, model, solids)
                for height in _heights(embodiment, place, heights):
                    loaded = _loaded(reacher, embodiment, height)
                    if not _reaches(reacher, loaded, where, height, numbers):
                        at = f" at {stand}" if stand else ""
                        load = _taken_at(embodiment, height)
                        found.append(f"{hand.name}{at}: {_why(reacher, loaded, where, height, numbers)}{load}")
                        break
    return tuple(dict.fromkeys(found))


def _why(reacher: Reacher, loaded: Reacher, place: Place, height: float, numbers: Numbers) -> str:
    """Return why no posture passes all stages of a grasp at a height above a place.

    The text names the obstacle of the posture with the most room, and by how many millimetres the room is too small.
    """
    grip = np.array(place.position) + np.array([0.0, 0.0, height])
    stages = grip_stages(grip, _lowest(numbers))
    postures, valid = [], np.ones(1, dtype=bool)
    for name, stage in zip(STAGES, stages, strict=True):
        q, possible = reacher.solve(stage.poses)
        postures.append(q)
        valid = valid & possible
        if not valid.any():
            missing = beyond(reacher.arm, stage.poses)
            return (
                f"{missing * 100:.1f} cm out of reach {name}"
                if missing > 0
                else f"no posture is within all joints' limits {name}"
            )
    around = _by_part(reacher.around)
    rooms = {
        (name, body): gap
        for name, mover, q in zip(STAGES, (reacher, reacher, loaded), postures, strict=True)
        for body, gap in mover.mover.clearances(q[valid], around).items()
    }
    if rooms:
        best = int(np.min(list(rooms.values()), axis=0).argmax())
        (name, body), gap = min(((one, float(gap[best])) for one, gap in rooms.items()), key=lambda room: room[1])
        if gap <= reacher.margin:
            return f"{body} is in the way by {(reacher.margin - gap) * 1000:.0f} mm {name}"
    return f"out of reach for an object that stands {SPARE * 100:.0f} cm farther away than its place"


def _by_part(around: Obstacles) -> Obstacles:
    """Return the obstacles with the part and the owner of each solid as its name."""
    solids = (replace(one, name=f"{one.part} ({one.name})" if one.part else one.name) for one in around.solids)
    return replace(around, solids=tuple(solids))


def _settings(embodiment: Embodiment) -> tuple[Numbers, Sequence[float]]:
    """Return the settings of the skill `reach`, and the heights at which the scene's bodies are grasped."""
    settings = [use.numbers for use in embodiment.skills.values() if use.skill == "reach"]
    if not settings:
        raise ValueError("no behaviour uses the skill 'reach', so reach is undefined; give one behaviour that skill")
    numbers = {name: max(found[name] for found in settings) for name in ("approach", "raised", "least_raised")}
    grasped = sorted({body.shape.grasp_height for body in embodiment.bodies.values()})
    return numbers, grasped or [settings[0]["empty_height"]]


def _standing(robot: Robot, embodiment: Embodiment) -> Iterator[tuple[str, UrdfModel]]:
    """Yield each stand of a mobile robot with the robot's model there; for a fixed robot, yield an empty name and the model."""
    if not robot.driving:
        yield "", read_robot(robot)
        return
    for stand in embodiment.stands.values():
        yield stand.name, read_robot(robot, np.array([*stand.position[:2], stand.yaw]))


def fingerprint(embodiment: Embodiment) -> str:
    """Return a SHA-256 hash of all inputs of reach: contents of files, and numbers."""
    parts = [VERSION]
    for robot in embodiment.robots:
        values = _without(asdict(robot), ("driving", "turning") if not robot.driving else ())
        bare = ("gripper", "flange", "mounting")
        values["hands"] = tuple(
            {**hand, "gripper": _content(hand["gripper"])} if hand["gripper"] else _without(hand, bare)
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
    parts += sorted(
        {repr((body.shape.grasp_height, *map(list, outline(body.shape)))) for body in embodiment.bodies.values()}
    )
    reaching = [use.numbers for _, use in sorted(embodiment.skills.items()) if use.skill == "reach"]
    parts += [repr(sorted((name, value) for name, value in uses.items() if name != "time_limit")) for uses in reaching]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _heights(embodiment: Embodiment, place: str, heights: Sequence[float]) -> Sequence[float]:
    """Return the grasp heights above a place."""
    said = embodiment.places[place].height
    return heights if said is None else (said,)


def _taken_at(embodiment: Embodiment, height: float) -> str:
    """Return the end of a message: the first body that is grasped at a height, and this height in millimetres."""
    names = [name for name, body in embodiment.bodies.items() if body.shape.grasp_height == height]
    return f" {names[0]}, {height * 1000:.0f} mm above its base" if names else ""


def _content(file: Path | str) -> str:
    """Return a hash of a file's content."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def _without(values: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Return `values` without the given names."""
    return {name: value for name, value in values.items() if name not in names}


def _reacher(embodiment: Embodiment, robot: Robot, hand: Hand, model: UrdfModel, solids: Sequence[Solid]) -> Reacher:
    """Return an arm with open fingers among furniture, mechanisms and the robot's trunk."""
    arms = [read_arm(model, other.arm, other.tip, other.turned, other.home) for other in robot.hands]
    arm = arms[robot.hands.index(hand)]
    around = Obstacles((*map(box, embodiment.fixtures), *solids))
    around = around.plus(robot.name, fixed_spheres(model, arms))
    return Reacher(read_mover(model, arm, dict.fromkeys(hand.fingers, hand.opening)), around, MARGIN)


def _reaches(reacher: Reacher, loaded: Reacher, place: Place, height: float, numbers: Numbers) -> bool:
    """Return whether some posture passes all stages of a grasp at a height above the place.

    The lift to the setting `least_raised` must be free of collisions. The height `raised` must be within the joints' limits.
    An object that stands `SPARE` farther away must be within reach, too.
    """
    grip = np.array(place.position) + np.array([0.0, 0.0, height])
    away = grip - reacher.arm.shoulder
    farther = grip_stages(grip + SPARE * away / np.linalg.norm(away), numbers)
    if not np.all([reacher.solve(stage.poses)[1] for stage in farther], axis=0).any():
        return False
    solved = [reacher.solve(stage.poses) for stage in grip_stages(grip, _lowest(numbers))]
    above = reacher.solve(grip_stages(grip, numbers)[-1].poses)[1]
    valid = np.all([above, *(ok for _, ok in solved)], axis=0)
    if not valid.any():
        return False
    movers = (reacher, reacher, loaded)
    return bool(np.any(np.all([one.free(q[valid]) for one, (q, _) in zip(movers, solved, strict=True)], axis=0)))


def _lowest(numbers: Numbers) -> Numbers:
    """Return settings in which the hand lifts only to the least raised height."""
    return {**numbers, "raised": rises(numbers)[-1]}


def _loaded(reacher: Reacher, embodiment: Embodiment, height: float) -> Reacher:
    """Return an arm whose hand holds the tallest body of the scene at `height`; the body's lowest third is left out."""
    shapes = [body.shape for body in embodiment.bodies.values()]
    own = [shape for shape in shapes if shape.grasp_height == height] or shapes
    if not own:
        return reacher
    tallest = max(own, key=height_of)
    spheres = column(*outline(tallest), bottom=height_of(tallest) / 3)
    held = Spheres(spheres.centers - np.array([0.0, 0.0, height]), spheres.radii)
    return replace(reacher, mover=reacher.mover.holding(held))
