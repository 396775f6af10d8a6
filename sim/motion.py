"""Collision-free motion of a hand, planned in the hand's coordinates and timed within the joints' limits.

A *pose* is (x, y, z, yaw, roll, swivel). The point x, y, z of the hand is in metres. In radians, yaw is the heading of the
hand's horizontal pointing direction, roll is the rotation about this direction, and swivel is the angle of the elbow.
`confab.sim.kinematics` maps a pose to a posture. A path with roll 0 keeps a cup upright. The path is a straight line if the
line is free of collisions, otherwise the result of a short RRT-Connect in the same six coordinates.

Arrays have these names: ``poses`` (n, 6), and ``q`` for postures (n, k) of an arm with k joints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from confab.sim.arms import Arm, Flags, hand_frames, turn
from confab.sim.collision import Mover, Obstacles, free
from confab.sim.kinematics import inverse, swivel_of
from confab.sim.urdf import Array

STEP = np.array([0.015, 0.015, 0.015, 0.08, 0.08, 0.08])
"""Maximum distance between checked poses of a path (metres, radians)."""

COARSE = 6
"""Interval between the samples of a path that are checked first; checking these samples first rejects most blocked paths early."""

JUMP = 0.35
"""Maximum motion in radians of a joint between neighbouring poses of a path; a larger motion indicates a singularity."""

APPROACH_TOLERANCE = 0.001
"""Maximum distance in metres by which a hand that is within an obstacle's margin may approach the obstacle on its way out."""

FEWEST = 5
"""Minimum number of samples of a timed path, which has to accelerate and brake between two ends at rest."""

YAWS = np.linspace(-np.pi, np.pi, 48, endpoint=False)
SWIVELS = np.linspace(-1.6, 1.6, 17)
"""Headings of a hand and swivels of an elbow that are tried at a point, in radians."""

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Blocked:
    """The reason why a path is impossible: a code of `confab.sim.verdict`, obstacles, and the smallest clearance in metres."""

    code: str
    objects: tuple[str, ...] = ()
    clearance: float = 0.0


class Traveller(Protocol):
    """A robot part that moves along poses: an arm with its hand, or a mobile base."""

    @property
    def spread(self) -> Array:
        """Distance (6,) by which the search region extends beyond start and goal, in metres and radians."""

    def solve(self, poses: Array) -> tuple[Array, Flags]:
        """Return the joint values at poses, and for each pose whether the pose is within reach."""

    def free(self, q: Array) -> Flags:
        """Return for each row of joint values whether the robot is free of collisions."""

    def follow(self, poses: Array) -> Array | None:
        """Return the joint values along poses, or None if the robot can't follow the poses."""

    def first(self, ways: Sequence[Array]) -> int | None:
        """Return the index of the first path of sampled poses that the robot can follow, or None."""

    def detours(self, start: Array, goal: Array) -> Iterator[Array]:
        """Yield rows of intermediate poses (n, 6) between start and goal, to be tried before a search."""


@dataclass(frozen=True)
class Reacher:
    """An arm among obstacles, with tests of whether paths are possible.

    The arm keeps `margin` metres from the obstacles. Every joint keeps `joint_margin` radians from its limits, and the elbow
    keeps `fold` radians from the stretched arm.
    """

    mover: Mover
    around: Obstacles
    margin: float = 0.008
    joint_margin: float = 0.03
    fold: float = 0.0

    @property
    def arm(self) -> Arm:
        """The arm that moves."""
        return self.mover.arm

    @property
    def spread(self) -> Array:
        """Distance (6,) by which the search region extends beyond start and goal, in metres and radians."""
        return np.array([0.25, 0.25, 0.2, 1.0, 0.0, 0.8 if self.arm.swivels else 0.0])

    def solve(self, poses: Array) -> tuple[Array, Flags]:
        """Return the postures at poses, and for each pose whether the pose is within reach and joint limits."""
        return inverse(self.arm, rotations(poses), poses[:, :3], poses[:, 5], self.joint_margin, self.fold)

    def free(self, q: Array) -> Flags:
        """Return for each posture whether the arm keeps the margin to all obstacles."""
        return free(self.mover.at(q), self.mover.spheres.radii, self.around, self.margin)

    def follow(self, poses: Array) -> Array | None:
        """Return the postures along sampled poses, or None if a pose is out of reach, in collision or past a singularity."""
        q, valid = self.solve(poses)
        return q if self._feasible(q, valid) else None

    def first(self, ways: Sequence[Array]) -> int | None:
        """Return the index of the first path that the arm can follow, or None; all paths are solved at once."""
        q, valid = self.solve(np.concatenate(ways))
        ends = np.cumsum([len(way) for way in ways])[:-1]
        pairs = zip(np.split(q, ends), np.split(valid, ends), strict=True)
        return next((i for i, pair in enumerate(pairs) if self._feasible(*pair)), None)

    def _feasible(self, q: Array, valid: Flags) -> bool:
        """Return whether postures are within reach, continuous and free of collisions."""
        if not valid.all() or (len(q) > 1 and np.abs(np.diff(q, axis=0)).max() > JUMP):
            return False
        return bool(self.free(q[COARSE // 2 :: COARSE]).all() and self.free(q).all())

    def begin(self, poses: Array) -> Array | None:
        """Return the postures of the longest beginning of sampled poses that the arm can follow, or None if there is none."""
        q, valid = self.solve(poses)
        smooth = np.abs(np.diff(q, axis=0, prepend=q[:1])).max(1) <= JUMP
        end = _first(np.all([valid, self.free(q), smooth], axis=0))
        return q[:end] if end else None

    def detours(self, start: Array, goal: Array) -> Iterator[Array]:
        """Yield intermediate poses that are higher, or closer to the robot's body, than the middle of start and goal."""
        for back, up in ((0.0, 0.12), (0.12, 0.0), (0.12, 0.12), (0.0, 0.25), (0.2, 0.2)):
            middle = (start + goal) / 2
            heading = np.array([np.cos(middle[3]), np.sin(middle[3])])
            middle[:2] -= back * heading
            middle[2] = max(start[2], goal[2]) + up
            yield middle[None]

    def blame(self, poses: Array) -> Blocked:
        """Return why `follow` rejects the poses."""
        q, valid = self.solve(poses)
        if not valid.all():
            return Blocked("unreachable")
        gaps = {name: float(gap.min()) for name, gap in self.mover.clearances(q, self.around).items()}
        touching = tuple(sorted((name for name, gap in gaps.items() if gap <= self.margin), key=gaps.__getitem__))
        return Blocked("goal in collision" if touching else "no path", touching, min(gaps.values(), default=0.0))


def rotations(poses: Array) -> Array:
    """Return the hand's rotation matrices (n, 3, 3) of poses."""
    return turn(Z, poses[:, 3]) @ turn(X, poses[:, 4])


def poses_at(points: Array, yaw: Array, roll: Array | float, swivel: Array) -> Array:
    """Return poses (n, 6) at points (n, 3), or at one point (3,)."""
    columns = [
        np.broadcast_to(part, yaw.shape) for part in (*np.broadcast_to(points, (len(yaw), 3)).T, yaw, roll, swivel)
    ]
    return np.stack(columns, -1)


def turned_near(start: Array, goal: Array) -> Array:
    """Return the goal pose with the equivalent yaw (modulo a full turn) nearest to the start's yaw."""
    near = goal.copy()
    near[3] = start[3] + np.angle(np.exp(1j * (goal[3] - start[3])))
    return near


def beyond(arm: Arm, poses: Array) -> float:
    """Return the metres by which the nearest pose exceeds the arm's length; 0 if the pose is near enough."""
    wrists = poses[:, :3] + (rotations(poses) @ arm.tip_rotation.T) @ (arm.wrist - arm.tip)
    distance = float(np.linalg.norm(wrists - arm.shoulder, axis=-1).min())
    return max(distance - arm.length, 0.0)


def pose_of(arm: Arm, q: Array) -> Array:
    """Return the pose (6,) of a posture (k,) whose hand points horizontally."""
    r, p = hand_frames(arm, q[None])
    yaw = np.arctan2(r[0, 1, 0], r[0, 0, 0])
    roll = np.arctan2(r[0, 2, 1], r[0, 2, 2])
    return np.concatenate([p[0], [yaw, roll, swivel_of(arm, q[None])[0]]])


def line(start: Array, end: Array) -> Array:
    """Return poses along the straight line from `start` to `end`, both included."""
    count = 1 + max(1, int(np.ceil(np.max(np.abs(end - start) / STEP))))
    return np.linspace(start, end, count)


def polyline(corners: Array) -> Array:
    """Return poses along straight lines through `corners` (k, 6)."""
    pieces = [line(a, b)[1:] for a, b in pairwise(corners)]
    return np.concatenate([corners[:1], *pieces])


# ----------------------------------------------------------------------------------------------------- search


def connect(
    reacher: Traveller, start: Array, goals: Sequence[Array], rng: np.random.Generator, attempts: int = 400
) -> tuple[int, Array] | None:
    """Return the index of a goal and the corner poses of a collision-free path to the goal, or None if no path is found.

    The path is a line, a detour, or the result of RRT-Connect.

    Parameters
    ----------
    goals : sequence of array (6,)
        The goal poses in order of preference. The search tree grows from all goals at once.
    attempts : int
        Maximum number of samples.
    """
    q, valid = reacher.solve(np.array(goals))
    within = np.flatnonzero(valid & reacher.free(q)).tolist()  # other goals can't end the search
    if within and reacher.follow(line(start, goals[within[0]])) is not None:
        return within[0], np.stack([start, goals[within[0]]])
    for i in within:
        ends = start, goals[i]
        ways = [np.stack(ends), *(np.stack([start, *middle, goals[i]]) for middle in reacher.detours(*ends))]
        chosen = reacher.first([polyline(corners) for corners in ways])
        if chosen is not None:
            return i, ways[chosen]
    found = _rrt_connect(reacher, start, [goals[i] for i in within], rng, attempts) if within else None
    if found is None:
        return None
    reached = next(i for i in within if np.array_equal(goals[i], found[-1]))
    return reached, _shortcut(reacher, found, rng)


def leave(reacher: Reacher, start: Array) -> Array | None:
    """Return a collision-free pose, to which a line from `start` leads without approach to an obstacle, or None."""
    ahead = np.array([np.cos(start[3]), np.sin(start[3]), 0.0])
    aside = np.array([-ahead[1], ahead[0], 0.0])
    for metres in (0.03, 0.06, 0.1, 0.15):
        for way in (-ahead, Z, Z - ahead, aside, -aside, aside - ahead, -aside - ahead):
            goal = start.copy()
            goal[:3] += metres * way / np.linalg.norm(way)
            q, valid = reacher.solve(line(start, goal))
            gaps = reacher.mover.clearances(q, reacher.around).values()
            rising = all((gap >= min(gap[0], reacher.margin) - APPROACH_TOLERANCE).all() for gap in gaps)
            if valid.all() and rising and all(gap[-1] > reacher.margin for gap in gaps):
                return goal
    return None


def _rrt_connect(
    reacher: Traveller, start: Array, goals: Sequence[Array], rng: np.random.Generator, attempts: int
) -> Array | None:
    """Grow a tree of poses from the start and a tree from every goal towards each other (Kuffner and LaValle 2000)."""
    ends = np.stack([start, *goals])
    low, high = ends.min(0) - reacher.spread, ends.max(0) + reacher.spread
    trees: list[tuple[list[Array], list[int]]] = [([start], [-1]), (list(goals), [-1] * len(goals))]
    for turn_of in range(attempts):
        (here, back), (there, _) = trees[turn_of % 2], trees[1 - turn_of % 2]
        target = there[rng.integers(len(there))] if rng.random() < 0.2 else rng.uniform(low, high)
        new = _extend(reacher, here, back, target)
        if new is None:
            continue
        other, other_back = trees[1 - turn_of % 2]
        meeting = _extend(reacher, other, other_back, new, greedy=True)
        if meeting is not None and np.allclose(meeting, new):
            ways = [_branch(*tree, met=new) for tree in trees]
            return np.concatenate([ways[0], ways[1][::-1][1:]])
    return None


def _extend(
    reacher: Traveller, nodes: list[Array], back: list[int], target: Array, greedy: bool = False
) -> Array | None:
    """Extend a tree towards `target` while the line is free, only a little without `greedy`; return the new pose or None."""
    nearest = int(np.abs((np.array(nodes) - target) / STEP).max(1).argmin())
    way = line(nodes[nearest], target)[1:]
    if not greedy:
        way = way[:14]
    q, valid = reacher.solve(np.concatenate([nodes[nearest][None], way]))
    reached = _first(valid[1:] & (np.abs(np.diff(q, axis=0)).max(1) <= JUMP))
    if reached:
        reached = _first(reacher.free(q[1 : reached + 1]))
    if not reached:
        return None
    nodes.append(way[reached - 1])
    back.append(nearest)
    new: Array = way[reached - 1]
    return new


def _first(good: Flags) -> int:
    """Return the number of true values before the first false value."""
    return len(good) if good.all() else int(np.argmin(good))


def _branch(nodes: list[Array], back: list[int], met: Array) -> Array:
    """Return the poses from a tree's root to its last node `met`, at which both trees meet."""
    way, i = [met], back[-1]
    while i >= 0:
        way.append(nodes[i])
        i = back[i]
    return np.array(way[::-1])


def _shortcut(reacher: Traveller, corners: Array, rng: np.random.Generator, attempts: int = 40) -> Array:
    """Replace the part of a path between two random points by a straight line if the line is free; try `attempts` times."""
    for _ in range(attempts):
        if len(corners) < 3:
            break
        first, last = np.sort(rng.uniform(0, len(corners) - 1, 2))
        i, j = int(first), int(last)
        if i == j:
            continue
        a = corners[i] + (first - i) * (corners[i + 1] - corners[i])
        b = corners[j] + (last - j) * (corners[j + 1] - corners[j])
        if reacher.follow(line(a, b)) is not None:
            corners = np.concatenate([corners[: i + 1], [a, b], corners[j + 1 :]])
    i = 1
    while i < len(corners) - 1:  # leave out unnecessary corners
        if reacher.follow(line(corners[i - 1], corners[i + 1])) is not None:
            corners = np.delete(corners, i, axis=0)
        else:
            i += 1
    return corners


# ----------------------------------------------------------------------------------------------------- timing


@dataclass(frozen=True)
class MotionLimits:
    """Limits of speed and acceleration: of the joints in radians, and of the hand in metres."""

    velocity: Array
    acceleration: float
    hand_velocity: float
    hand_acceleration: float


def smooth(q: Array, window: int = 3) -> Array:
    """Return postures whose corners are rounded by a moving average; both ends are kept."""
    out = q.copy()
    for i in range(1, len(q) - 1):
        half = min(window, i, len(q) - 1 - i)
        out[i] = q[i - half : i + half + 1].mean(0)
    return out


def timed(arm: Arm, q: Array, limits: MotionLimits, rate: float) -> tuple[Array, Array]:
    """Return positions and velocities (m, k) at `rate` hertz along postures (n, k), as fast as the limits allow.

    The timing along the path is optimal except for one simplification: half of a joint's acceleration is reserved for the
    path's curvature and half for the change of speed, so that both can be bounded separately.
    """
    if len(q) < 2 or np.abs(q - q[0]).max() < 1e-9:
        return q[-1:], np.zeros((1, q.shape[1]))
    if len(q) < FEWEST:  # a path of two samples would be at rest at both
        spread = np.linspace(0, len(q) - 1, FEWEST)
        q = np.stack([np.interp(spread, np.arange(len(q)), joint) for joint in q.T], -1)
    rows = np.concatenate([q, hand_frames(arm, q)[1]], -1)
    top = np.concatenate([limits.velocity, np.full(3, limits.hand_velocity)])
    push = np.concatenate([np.full(q.shape[1], limits.acceleration), np.full(3, limits.hand_acceleration)])
    return scheduled(q, rows, top, push, rate)


def scheduled(q: Array, rows: Array, top: Array, most: Array, rate: float) -> tuple[Array, Array]:
    """Return positions and velocities at `rate` hertz along samples `q`; the limits hold for the coordinates `rows`."""
    first, second = np.gradient(rows, axis=0), np.zeros_like(rows)
    second[1:-1] = np.diff(rows, 2, axis=0)
    push = most / 2
    square = np.min((top / np.maximum(np.abs(first), 1e-9)) ** 2, -1)
    square = np.minimum(square, np.min(push / np.maximum(np.abs(second), 1e-9), -1))
    gain = np.min(push / np.maximum(np.abs(first), 1e-9), -1)
    square[0] = square[-1] = 0.0
    for i in range(1, len(q)):
        square[i] = min(square[i], square[i - 1] + 2 * min(gain[i - 1], gain[i]))
    for i in range(len(q) - 2, -1, -1):
        square[i] = min(square[i], square[i + 1] + 2 * min(gain[i], gain[i + 1]))
    speed = np.sqrt(square)
    clock = np.concatenate([[0.0], np.cumsum(2.0 / np.maximum(speed[1:] + speed[:-1], 1e-6))])
    return _sampled(q, speed, clock, rate)


def _sampled(q: Array, speed: Array, clock: Array, rate: float) -> tuple[Array, Array]:
    """Resample a path at `rate` hertz; the path parameter has constant acceleration between its samples."""
    times = np.arange(1, int(np.ceil(clock[-1] * rate)) + 1) / rate
    times = np.minimum(times, clock[-1])
    i = np.minimum(np.searchsorted(clock, times, side="right") - 1, len(q) - 2)
    span, since = clock[i + 1] - clock[i], times - clock[i]
    s = speed[i] * since + (speed[i + 1] - speed[i]) / span * since**2 / 2
    part = np.clip(s, 0.0, 1.0)[:, None]
    position = q[i] * (1 - part) + q[i + 1] * part
    velocity = np.gradient(position, axis=0) * rate if len(position) > 1 else np.zeros_like(position)
    velocity[-1] = 0.0
    return position, velocity


def comfort(arm: Arm, q: Array) -> Array:
    """Return the costs (n,) of postures (n, k), which grow steeply as joints approach their limits."""
    middle, half = (arm.lower + arm.upper) / 2, (arm.upper - arm.lower) / 2
    cost: Array = np.sum(((q - middle) / half) ** 8, -1)
    return cost
