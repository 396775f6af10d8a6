"""One execution of a skill: the state at its beginning, the choice of poses, the motions and the common checks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from confab.sim.collision import Mover, Obstacles, free
from confab.sim.engine import Engine
from confab.sim.motion import (
    SWIVELS,
    MotionLimits,
    Reacher,
    beyond,
    comfort,
    connect,
    leave,
    line,
    polyline,
    smooth,
    timed,
    turned_near,
)
from confab.sim.perception import tilt_of
from confab.sim.robot import Manipulator
from confab.sim.stages import MARGIN, Numbers, Stage
from confab.sim.urdf import Array
from confab.sim.verdict import REFUTED, SkillError, named

CLOSE = 0.002
"""Margin in metres to obstacles on short straight motions; a load that has slipped may be nearer to them than `MARGIN`."""

TOPPLED = 0.5
"""Minimum tilt in radians of a body that counts as toppled."""

NOWHERE = 100.0
"""Fictitious distance in metres beyond the arm's reach, which marks a pose at which the hand would not be level."""

TIGHT = (0.006, 0.004, 0.003)
"""Margins in metres that are tried in turn if the full margin leaves no candidate.

Each margin exceeds `CLOSE`, since the load may slip on the way.
"""

ROUNDED = 3
"""Maximum number of samples on either side of a corner over which the corner of a path is rounded."""

THIN = 0.01
"""Assumed opening in metres of fingers that are closed around a handle."""

WITHDRAWAL_SPEED = 0.5
"""Ratio of the speed at which a stopped hand withdraws to the hand's normal speed."""

SAMPLES = 6000
"""Maximum number of samples in the search for a path to one of the goals."""

LOADED = (3.0, 1.5)
"""Limit of the hand's acceleration in m/s² with a load, and with a load on which other bodies stand by friction alone."""

FINER = 4
"""Factor by which a line that ends on contact is sampled more finely than other lines."""

BATCH, ENOUGH = 24, 6
"""Number of candidates in one collision check, and number of collision-free candidates after which no more are checked."""


@dataclass(frozen=True)
class Attempt:
    """One execution of a skill: the world, the hand, the held body, and the bodies and stray beads before the skill.

    `before` maps each body to its carrier, such as a drawer, its position in the carrier's frame, and its tilt in radians.
    """

    world: Engine
    hand: Manipulator
    held: str | None
    before: Mapping[str, tuple[str, Array, float]]
    stray: int

    @classmethod
    def begin(cls, world: Engine, hand: str) -> Attempt:
        """Return a new attempt of a hand, with the present state of the world."""
        before = {}
        for name in world.bodies:
            carrier = world.carried_by(name)
            before[name] = carrier, _position_in(world, carrier, name), tilt_of(world.truth(name)[0])
        return cls(world, world.hands[hand], world.held(hand), before, world.stray())

    def released(self) -> Attempt:
        """Return the attempt with an empty hand, and store the pose of the released body."""
        if self.held in self.world.bodies:
            self.world.remember(self.held, *self.world.truth(self.held))
        return replace(self, held=None)

    def body(self, name: str) -> str:
        """Return `name`; raise `SkillError` if the world has no such body, or if the pose of the body is unknown."""
        if name not in self.world.bodies or not self.world.knows(name):
            raise SkillError("no grasp", (name,), f"{name} is nowhere to be seen", seen=0.0)
        return name

    @contextmanager
    def planning(self) -> Iterator[None]:
        """Count the CPU time of the code in the ``with`` block as motion planning."""
        begin = time.process_time()
        try:
            yield
        finally:
            self.world.clock.planning += time.process_time() - begin

    # ------------------------------------------------------------------------------------------------- choice of poses

    def reacher(
        self, *ignored: str, margin: float = MARGIN, opening: float | None = None, whole: bool = False
    ) -> Reacher:
        """Return the arm with its load among all obstacles except those in `ignored`, with fingers open by `opening` if given."""
        mover = self.hand.mover(opening)
        if self.held is not None:
            mover = mover.holding(self.world.load_spheres(self.hand, self.held, whole))
        around = self.world.surroundings(self.hand.hand.name, self.held).without(*ignored)
        return Reacher(mover, around, margin)

    def choose(
        self, stages: Sequence[Stage], objects: tuple[str, ...], opening: float | None = None, cost: Array | None = None
    ) -> list[int]:
        """Return the indices of the candidate poses that are reachable and collision-free at all stages, the cheapest first.

        `opening` is the assumed opening of the fingers in metres, as after a release. `cost` (n,) is an additional cost
        of each candidate.

        Raises
        ------
        SkillError
            No candidate pose is reachable and collision-free at all stages. The error code is `unreachable` with the distance in
            metres beyond the reach, or `goal in collision` with the obstacles.
        """
        with self.planning():
            reacher = self.reacher(opening=opening)
            left, solved = np.arange(len(stages[0].poses)), list[Array]()
            for stage in stages:
                spare = replace(reacher, joint_margin=reacher.joint_margin + stage.slack, fold=stage.fold)
                q, valid = spare.solve(stage.poses[left])
                left, solved = left[valid], [before[valid] for before in (*solved, q)]
                if not len(left):
                    raise self._unreachable(stages, stage, objects)
            costs = self._discomfort(stages[0].poses[left], solved)
            order = np.argsort(costs if cost is None else costs + cost[left], kind="stable")
            movers = self.hand.mover(THIN), self.hand.mover(opening)
            for least in (reacher.margin, *TIGHT, *([CLOSE - 2 * self.world.blur] if self.world.noise else [])):
                scenes = [
                    _scene(reacher, *movers, stage, min(CLOSE, least) if stage.near else least) for stage in stages
                ]
                found = _free(scenes, solved, order)
                # with noise the last margin is below zero, since an obstacle may be farther away than perceived
                if found:
                    break
            if not found:
                raise _blocked(scenes, [q[order] for q in solved], stages, objects)
            return [int(left[i]) for i in found]

    def _unreachable(self, stages: Sequence[Stage], at: Stage, objects: tuple[str, ...]) -> SkillError:
        """Return the error for an unreachable stage, with the distance beyond the reach and the furniture joint's value."""
        if at.joint is None:
            return SkillError("unreachable", objects, beyond_m=max(beyond(self.hand.arm, one.poses) for one in stages))
        missing = beyond(self.hand.arm, at.poses)
        why = "not within the limits of the arm's joints" if missing <= 0 else "too far"
        why = "not level" if missing > NOWHERE else why
        message = f"where the joint is at {at.joint:.3g}, the hand would be {why}"
        return SkillError(
            "unreachable", objects, message, joint=at.joint, **({"beyond_m": missing} if missing < NOWHERE else {})
        )

    def _discomfort(self, poses: Array, postures: Sequence[Array]) -> Array:
        """Return the costs of candidate poses; cramped postures, hands that point aside and turns of the hand cost more."""
        arm, now = self.hand.arm, self.hand.pose
        ahead = np.arctan2(*(poses[:, :2] - arm.shoulder[:2]).T[::-1])
        cost: Array = np.sum([comfort(arm, q) for q in postures], axis=0)
        cost += 0.25 * np.abs(np.angle(np.exp(1j * (poses[:, 3] - ahead)))) + 0.3 * np.abs(poses[:, 5] - now[5])
        cost += 0.15 * np.abs(np.angle(np.exp(1j * (poses[:, 3] - now[3]))))
        return cost

    # ------------------------------------------------------------------------------------------------- moving

    @property
    def limits(self) -> MotionLimits:
        """The hand's limits of speed and acceleration, which are lower with a load, and with bodies that stand on the load."""
        limits, load = self.hand.limits, self.world.load(self.held)
        return replace(limits, hand_velocity=0.9, hand_acceleration=LOADED[len(load) > 1]) if load else limits

    def follow(
        self, q: Array, speed: float = 1.0, stop: Callable[[], bool] | None = None, corners: int = ROUNDED
    ) -> None:
        """Drive the arm along sampled postures at a share `speed` of the hand's speed, or until `stop` returns true.

        The path begins at the present posture. The corners of the path are rounded over `corners` samples.
        """
        with self.planning():
            q, limits = np.concatenate([self.hand.posture[None], q[1:]]), self.limits
            limits = replace(limits, hand_velocity=limits.hand_velocity * speed)
            positions, velocities = timed(self.hand.arm, smooth(q, corners), limits, self.world.rate)
        try:
            self.world.follow(self.hand, positions, velocities, stop)
        except SkillError as failure:
            if self.held is None or self.world.held(self.hand.hand.name) == self.held:
                raise
            stopped = failure.verdict
            raise SkillError(
                "slip or drop", named(self.held, *stopped.objects), "it was lost on the way", **stopped.measured
            ) from failure

    def move_to_any(
        self, goals: Sequence[Array], objects: tuple[str, ...], *ignored: str, opening: float | None = None
    ) -> int:
        """Move along a collision-free path to the first goal pose, or else to another one; return the index of the reached pose.

        `opening` is the assumed opening of the fingers in metres.
        """
        with self.planning():
            reacher = self.reacher(*ignored, opening=opening, whole=True)
            start = self.hand.pose
            targets = [turned_near(start, goal) for goal in goals]
            q = reacher.solve(np.array(targets))[0]
            for least in (*TIGHT, CLOSE - 2 * self.world.blur):
                if reacher.free(q).any():
                    break
                reacher = replace(reacher, margin=least)
            free = reacher.follow(start[None]) is not None
            left = start if free else leave(reacher, start)
            reached = None if left is None else connect(reacher, left, targets, self.world.rng, SAMPLES)
            if reached is None:
                blame = reacher.blame(line(start, targets[0]))
                raise SkillError("no path", named(*objects, *blame.objects), clearance_m=blame.clearance)
            turns = reached[1] if free else np.concatenate([start[None], reached[1]])
            q = reacher.solve(polyline(turns))[0]
            rounded = rounding(reacher, q)
        try:
            self.follow(q, corners=rounded)
        except SkillError:
            if self.world.noise:
                self._withdraw(q)
            raise
        return reached[0]

    def _withdraw(self, q: Array) -> None:
        """Move back along the postures that the arm passed before the stop."""
        now = self.hand.measured()
        self.hand.command(now)
        passed = q[: int(np.abs(q - now).max(1).argmin()) + 1]
        self.follow(np.concatenate([now[None], passed[::-1]]), WITHDRAWAL_SPEED)

    def straight(
        self,
        goal: Array,
        objects: tuple[str, ...],
        *ignored: str,
        speed: float = 1.0,
        stop: Callable[[], bool] | None = None,
    ) -> None:
        """Move along the straight line to a pose, or until `stop` returns true; raise `SkillError` if the line is blocked.

        With `stop`, only the beginning of the line has to be collision-free. Without `stop`, the elbow may turn on the way.
        """
        start = self.hand.pose
        if stop is not None:
            poses = line(start, goal)
            fine = np.linspace(poses[0], poses[-1], FINER * (len(poses) - 1) + 1)
            self.along(fine, objects, *ignored, speed=speed, stop=stop, partly=True)
            return
        bent = (np.append(goal[:5], goal[5] + turn) for turn in sorted(SWIVELS, key=abs) if turn)
        self.along(line(start, goal), objects, *ignored, speed=speed, others=(line(start, end) for end in bent))

    def along(
        self,
        poses: Array,
        objects: tuple[str, ...],
        *ignored: str,
        speed: float = 1.0,
        stop: Callable[[], bool] | None = None,
        partly: bool = False,
        others: Iterable[Array] = (),
    ) -> None:
        """Move along the first collision-free path, `poses` or one of `others`; end the motion early if `stop` returns true.

        With `partly`, contact ends the motion, so only the beginning of the path has to be collision-free. The margin to obstacles
        is then reduced by the noise of perception. Raise `SkillError` if all paths are blocked.
        """
        with self.planning():
            reacher = self.reacher(*ignored, margin=CLOSE - 2 * self.world.noise if partly else CLOSE)
            blurred = replace(reacher, margin=CLOSE - 2 * self.world.blur)
            ways = [reacher, blurred] if self.world.blur and not partly else [reacher]
            found = (
                way.begin(some) if partly else way.follow(some) for some in chain((poses,), others) for way in ways
            )
            q = next((q for q in found if q is not None), None)
            if q is None:
                blame = reacher.blame(poses)
                raise SkillError(blame.code, named(*objects, *blame.objects), clearance_m=blame.clearance)
        self.follow(q, speed, stop)

    def rise(self, goal: Array, objects: tuple[str, ...], *ignored: str) -> None:
        """Move the hand straight up to a goal pose, or around the obstacles if the line is blocked."""
        if goal[2] - self.hand.pose[2] < 1e-3:
            return
        try:
            self.straight(goal, objects, *ignored)
        except SkillError as failure:
            if failure.verdict.code not in (*REFUTED, "unreachable"):
                raise
            self.move_to_any([goal], objects, *ignored)

    # ------------------------------------------------------------------------------------------------- checks

    def check_others(self, numbers: Numbers, *moved: str) -> None:
        """Raise `SkillError` if a body was shifted or toppled, except for the `moved` body and the held body."""
        for name, (carrier, position, tilt) in self.before.items():
            if name in (*moved, self.held, *self.world.moved_by_others) or name not in self.world.bodies:
                continue
            rotation = self.world.truth(name)[0]
            shift = float(np.linalg.norm(_position_in(self.world, carrier, name) - position))
            if tilt_of(rotation) > TOPPLED > tilt:
                raise SkillError("toppled", (name,), tilt_rad=tilt_of(rotation))
            if shift > numbers["disturbance"]:
                most = f"at most {numbers['disturbance'] * 1000:.0f} mm are allowed"
                message = f"{name} was moved by {shift * 1000:.0f} mm; {most}"
                raise SkillError("object disturbed", (name,), message, moved_m=shift)

    def check_grip(self, numbers: Numbers) -> dict[str, float]:
        """Return the distance and the angle by which the held object has slipped since the grasp.

        Raise `SkillError` if the object slipped too far or was lost.
        """
        if self.held is None or self.hand.grasp is None:
            return {}
        if self.held not in self.world.bodies:
            raise SkillError("slip or drop", (self.held,), f"{self.held} is nowhere to be seen", seen=0.0)
        rotation, base = self.world.in_hand(self.hand, self.held)
        first_rotation, first_base = self.hand.grasp
        slip = float(np.linalg.norm(base - first_base))
        turned = float(np.arccos(np.clip((np.trace(first_rotation.T @ rotation) - 1) / 2, -1, 1)))
        lost, most = self.world.held(self.hand.hand.name) != self.held, numbers["slip"]
        if lost or slip > most:
            slipped = f"slipped by {slip * 1000:.0f} mm, wanted at most {most * 1000:.0f}"
            how = "is pressed by no two fingers" if lost else slipped
            raise SkillError("slip or drop", (self.held,), f"{self.held} {how}", slip_m=slip, turned_rad=turned)
        return {"slip_m": slip, "turned_rad": turned}

    def check_arrival(self, goal: Array, numbers: Numbers) -> dict[str, float]:
        """Return the hand's distance from a goal pose (6,); raise `SkillError` if the distance exceeds the tolerance."""
        error = float(np.linalg.norm(self.hand.frame()[1] - goal[:3]))
        if error > numbers["tolerance"]:
            message = f"the hand stopped {error * 1000:.0f} mm off its goal"
            raise SkillError("tracking error", self.world.touching(self.hand), message, tip_error_m=error)
        return {"tip_error_m": error}


def rounding(reacher: Reacher, q: Array) -> int:
    """Return the largest number of samples over which the corners of a path can be rounded without a collision."""
    return next((n for n in range(ROUNDED, 0, -1) if reacher.free(smooth(q, n)).all()), 0)


def _position_in(world: Engine, carrier: str, body: str) -> Array:
    """Return a body's position in the frame of its carrier."""
    turned, origin = world.carrier(carrier)
    local: Array = (world.truth(body)[1] - origin) @ turned
    return local


Scene = tuple[Mover, Obstacles, float]
"""The moving spheres of the arm at a stage, the obstacles, and the margin in metres."""


def _free(scenes: Sequence[Scene], postures: Sequence[Array], order: NDArray[np.intp]) -> list[int]:
    """Return the first candidate poses, in `order`, that are collision-free at every stage."""
    chosen: list[int] = []
    for start in range(0, len(order), BATCH):
        left = order[start : start + BATCH]
        for (mover, around, margin), q in zip(scenes, postures, strict=True):
            left = left[free(mover.at(q[left]), mover.spheres.radii, around, margin)]
        chosen += [int(i) for i in left]
        if len(chosen) >= ENOUGH:
            break
    return chosen


def _scene(reacher: Reacher, closed: Mover, bare: Mover, stage: Stage, margin: float) -> Scene:
    """Return the arm and the obstacles of a stage."""
    around = reacher.around if stage.around is None else stage.around
    mover = closed if stage.closed else bare if stage.released else reacher.mover
    return mover, around.without(*stage.ignored), margin


def _blocked(
    scenes: Sequence[Scene], postures: Sequence[Array], stages: Sequence[Stage], objects: tuple[str, ...]
) -> SkillError:
    """Return the error for stages without a collision-free candidate.

    The error names the bodies that block most candidates. The message names the phase in which the hand has the least room.
    """
    nearest: dict[str, Array] = {}
    rooms: list[tuple[float, float, str, Stage]] = []
    for (mover, around, margin), q, stage in zip(scenes, postures, stages, strict=True):
        gaps = mover.clearances(q, around)
        for name, gap in gaps.items():
            nearest[name] = np.minimum(gap - margin, nearest.get(name, np.inf))
        if gaps:
            worst = np.min(list(gaps.values()), axis=0)
            best = int(worst.argmax())
            rooms.append((float(worst[best]) - margin, margin, min(gaps, key=lambda name: gaps[name][best]), stage))
    count = {name: int(np.sum(gap <= 0)) for name, gap in nearest.items()}
    blocking = sorted(
        (name for name in nearest if count[name] == max(count.values())), key=lambda name: float(nearest[name].max())
    )
    widest = float(np.min(list(nearest.values()), axis=0).max()) + max(margin for _, _, margin in scenes)
    spare, margin, body, stage = min(rooms, key=lambda room: room[0])
    phase = f" in {stage.phase}" if stage.phase else ""
    at = "" if stage.joint is None else f", where the joint is at {stage.joint:.3g}"
    message = (
        f"{room_of(spare + margin)} {body}{phase}{at}, wanted {margin * 1000:.0f} mm"
        if spare <= 0
        else f"no pose has {margin * 1000:.0f} mm of room in all phases"
    )
    return SkillError("goal in collision", named(*objects, *blocking), message, clearance_m=widest)


def room_of(distance: float) -> str:
    """Return the distance of the hand or its load from a body in words, as the beginning of a message.

    >>> room_of(0.0012), room_of(-0.004)
    ('1 mm from', '4 mm inside')
    """
    return f"{abs(distance) * 1000:.0f} mm {'from' if distance >= 0 else 'inside'}"
