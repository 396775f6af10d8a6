"""Motions of a mobile base among obstacles, with the arms at rest in their present postures.

`confab.sim.motion.connect` plans paths of bases as well as of hands. The pose of a base is (x, y, 0, yaw, 0, 0). A pose is free
if no sphere of the robot or its load touches an obstacle. After a drive, the arms' kinematics start from the base's new pose.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from confab.sim.arms import Flags, read_arm
from confab.sim.assembly import read_robot
from confab.sim.base import Base
from confab.sim.collision import Obstacles, clearances, fixed_spheres, free
from confab.sim.engine import Engine
from confab.sim.motion import Blocked, connect, line, polyline, scheduled, turned_near
from confab.sim.urdf import Array, Spheres
from confab.sim.verdict import SkillError, named

BASE = np.array([0, 1, 3])
"""Indices of x, y and yaw in a pose."""

MARGIN = 0.02
"""Margin in metres between a driving robot and its obstacles."""

RAMP_SECONDS = 0.8
"""Seconds in which a base reaches its speed; a faster start lets loads slip and full cups spill."""

STOPPED_LAG = 0.03
"""A base counts as blocked if it lags behind its command by at least this distance in metres, or this angle in radians."""

BACKING = (0.15, 0.3, 0.5, 0.8)
"""Distances in metres by which a robot backs off, tried in turn.

The robot backs off by the distance before it turns, and approaches its goal from the same distance.
"""

SAMPLES = 600
"""Maximum number of samples in the search for a path."""


@dataclass(frozen=True)
class Roller:
    """A mobile robot among its obstacles: spheres (m, 3) of robot, arms and loads in the frame of the base."""

    centers: Array
    radii: Array
    around: Obstacles
    margin: float

    @property
    def spread(self) -> Array:
        """Distance (6,) by which the search region extends beyond start and goal, in metres and radians."""
        return np.array([1.0, 1.0, 0.0, np.pi, 0.0, 0.0])

    def at(self, q: Array) -> Array:
        """Return the spheres' centres (n, m, 3) with the base at x, y, yaw (n, 3)."""
        cos, sin, zero = np.cos(q[:, 2]), np.sin(q[:, 2]), np.zeros(len(q))
        turned = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1], -1).reshape(-1, 3, 3)
        shift = np.stack([q[:, 0], q[:, 1], zero], -1)
        return np.asarray(np.einsum("nij,mj->nmi", turned, self.centers) + shift[:, None])

    def solve(self, poses: Array) -> tuple[Array, Flags]:
        """Return x, y and yaw of the base at poses, and flags of reachable poses, which are all true for a base."""
        return poses[:, BASE], np.ones(len(poses), dtype=bool)

    def free(self, q: Array) -> Flags:
        """Return for each position of the base whether the robot is free of collisions."""
        return free(self.at(q), self.radii, self.around, self.margin)

    def follow(self, poses: Array) -> Array | None:
        """Return x, y and yaw of the base along poses, or None if the robot collides with an obstacle."""
        q = poses[:, BASE]
        return q if self.free(q).all() else None

    def first(self, ways: Sequence[Array]) -> int | None:
        """Return the index of the first collision-free path, or None."""
        return next((i for i, way in enumerate(ways) if self.follow(way) is not None), None)

    def detours(self, start: Array, goal: Array) -> Iterator[Array]:
        """Yield the intermediate poses of detours, on which the robot backs off, turns, and approaches the goal forwards."""
        for back in BACKING:
            ends = []
            for pose in (start, goal):
                before = pose.copy()
                before[:2] -= back * np.array([np.cos(pose[3]), np.sin(pose[3])])
                ends.append(before)
            turned = ends[0].copy()
            turned[3] = goal[3]
            yield np.stack(ends)
            yield np.stack([ends[0], turned, ends[1]])

    def blame(self, poses: Array) -> Blocked:
        """Return the obstacles that the robot touches along poses."""
        gaps = {
            name: float(gap.min()) for name, gap in clearances(self.at(poses[:, BASE]), self.radii, self.around).items()
        }
        touching = tuple(sorted((name for name, gap in gaps.items() if gap <= self.margin), key=gaps.__getitem__))
        return Blocked("no path", touching, min(gaps.values(), default=0.0))


def drive(engine: Engine, robot: str, stand: str) -> None:
    """Drive a robot with its loads to a stand; raise `SkillError` if the drive fails."""
    if robot not in engine.bases or stand not in engine.embodiment.stands:
        raise SkillError("ill-defined", (robot, stand), f"{robot} doesn't drive, or {stand} is no stand")
    base, there = engine.bases[robot], engine.embodiment.stands[stand]
    loads = {hand.hand.name: engine.held(hand.hand.name) for hand in engine.hands.values() if hand.robot == base.robot}
    goal = np.array([*there.position[:2], there.yaw])
    if base.miss:
        goal += engine.rng.uniform(-base.miss, base.miss, 3)
    for pose in _planned(engine, base, goal, loads, (robot, stand)):
        base.command(pose)
        engine.run(1)
        if engine.steps % 6 == 0:
            _check(engine, base, pose, tuple(loads))
    engine.run(round(RAMP_SECONDS * engine.rate / 4))
    update_kinematics(engine, base)
    for hand, load in loads.items():
        if load is not None and engine.held(hand) != load:
            raise SkillError("slip or drop", (load,), f"{load} was lost on the way")


def _planned(engine: Engine, base: Base, goal: Array, loads: dict[str, str | None], things: tuple[str, ...]) -> Array:
    """Return the base's x, y, yaw at each simulation step; raise `SkillError` if there is no free path."""
    begin = time.process_time()
    x, y, yaw = base.pose()
    spheres = [engine.standing[base.robot.name]]
    for name, load in loads.items():
        hand = engine.hands[name]
        mover = hand.mover() if load is None else hand.mover().holding(engine.load_spheres(hand, load, whole=True))
        spheres.append(Spheres(mover.at(hand.posture[None])[0], mover.spheres.radii))
    centers = np.concatenate([one.centers for one in spheres]) - np.array([x, y, 0.0])
    cos, sin = np.cos(yaw), np.sin(yaw)
    centers = centers @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    held = [name for load in loads.values() for name in engine.load(load)]
    around = engine.surroundings("").without(base.robot.name, *loads, *held)
    start = np.array([x, y, 0.0, yaw, 0.0, 0.0])
    end = turned_near(start, np.array([goal[0], goal[1], 0.0, goal[2], 0.0, 0.0]))
    roller = Roller(centers, np.concatenate([one.radii for one in spheres]), around, MARGIN)
    reached = connect(roller, start, [end], engine.rng, SAMPLES)
    if reached is None:
        blame = roller.blame(line(start, end))
        raise SkillError("no path", named(*things, *blame.objects), clearance_m=blame.clearance)
    q = polyline(reached[1])[:, BASE]
    top = np.array([base.robot.driving, base.robot.driving, base.robot.turning])
    found = scheduled(q, q, top, top / RAMP_SECONDS, engine.rate)[0]
    engine.clock.planning += time.process_time() - begin
    return found


def _check(engine: Engine, base: Base, wanted: Array, hands: tuple[str, ...]) -> None:
    """Raise `SkillError` if the skill's time limit has passed, or if the base lags too far behind its command."""
    hand = engine.hands[hands[0]]
    if engine.steps > hand.deadline:
        raise SkillError("too slow", (base.robot.name,), seconds=hand.limit)
    lag = float(np.abs(base.pose() - wanted).max())
    if lag > STOPPED_LAG:
        update_kinematics(engine, base)
        raise SkillError("tracking error", engine.touching(hand) or (base.robot.name,), base_lag_m=lag)


def update_kinematics(engine: Engine, base: Base) -> None:
    """Update the kinematics of a robot's arms to the present pose of its base."""
    robot = base.robot
    model = read_robot(robot, base.pose())
    hands = [hand for hand in engine.hands.values() if hand.robot == robot]
    for hand in hands:
        hand.model, hand.arm = model, read_arm(model, hand.hand.arm, hand.hand.tip, hand.hand.turned, hand.hand.home)
    engine.standing[robot.name] = fixed_spheres(model, [hand.arm for hand in hands])
