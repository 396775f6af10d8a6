"""A skill at work: the hand, what it holds, how everything stood when it began; choosing poses, moving, and common checks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from sim.collision import Mover, Surroundings, free
from sim.engine import Engine
from sim.motion import (
    SWIVELS,
    Limits,
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
from sim.perception import tilt_of
from sim.robot import Manipulator
from sim.stages import MARGIN, Numbers, Stage
from sim.urdf import Array
from sim.verdict import REFUTED, SkillError, named

CLOSE = 0.002
"""Metres kept off on short lines whose ends were chosen with the full margin: the load may have slipped a little since."""

NOWHERE = 100.0
"""Metres beyond which no arm is asked for: a pose there stands for one that no hand can have."""

TIGHT = (0.006, 0.004, 0.003)
"""Metres kept off everything where nothing else is left: more than `CLOSE`, since the load may slip before it is put down."""

ROUNDED = 3
"""Samples over which corners of a path are rounded, on either side, if nothing is near them."""

THIN = 0.01
"""Metres by which fingers are open around a handle."""

WARY = 0.5
"""Share of its speed at which a hand that was stopped goes back."""

SAMPLES = 1500
"""Samples of a search for a path to any of the goals."""

FINER = 4
"""By how much denser than others a line is sampled that is followed as far as it is free."""

BATCH, ENOUGH = 24, 6
"""Candidates checked for collisions at a time, and how many good ones end the search."""


@dataclass(frozen=True)
class Attempt:
    """One execution of a skill: the world, the hand, what it holds, and where bodies and stray beads were before it.

    `before` has by body what carried it (a drawer, say), and where it was in its carrier's frame.
    """

    world: Engine
    hand: Manipulator
    held: str | None
    before: Mapping[str, tuple[str, Array]]
    stray: int

    @classmethod
    def begin(cls, world: Engine, hand: str) -> Attempt:
        """Return an attempt that begins now."""
        before = {}
        for name in world.bodies:
            carrier = world.carried_by(name)
            before[name] = carrier, _seen_from(world, carrier, name)
        return cls(world, world.hands[hand], world.held(hand), before, world.stray())

    def released(self) -> Attempt:
        """Return the attempt with nothing in the hand any more; where that is was felt until now."""
        if self.held in self.world.bodies:
            self.world.remember(self.held, *self.world.truth(self.held))
        return replace(self, held=None)

    def body(self, name: str) -> str:
        """Return the name of a body, or raise if the world has no such body any more."""
        if name not in self.world.bodies or not self.world.knows(name):
            raise SkillError("no grasp", (name,), f"{name} is nowhere to be seen", seen=0.0)
        return name

    @contextmanager
    def planning(self) -> Iterator[None]:
        """Count the CPU time inside as planning."""
        begin = time.process_time()
        try:
            yield
        finally:
            self.world.clock.planning += time.process_time() - begin

    # ------------------------------------------------------------------------------------------------- where to

    def reacher(
        self, *ignored: str, margin: float = MARGIN, opening: float | None = None, whole: bool = False
    ) -> Reacher:
        """Return the arm, with what it holds, maybe fingers at another `opening`, among its surroundings less the `ignored`."""
        mover = self.hand.mover(opening)
        if self.held is not None:
            mover = mover.holding(self.world.load_spheres(self.hand, self.held, whole))
        around = self.world.surroundings(self.hand.hand.name, self.held).without(*ignored)
        return Reacher(mover, around, margin)

    def choose(self, stages: Sequence[Stage], objects: tuple[str, ...], opening: float | None = None) -> list[int]:
        """Return candidates for which every stage is reachable and free, the most comfortable first.

        With an `opening`, the fingers are taken to be open so far, as they will be when the hand lets go.

        Raises
        ------
        SkillError
            There is none: `unreachable` with the missing metres, or `goal in collision` with what is in the way.
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
            order = np.argsort(self._discomfort(stages[0].poses[left], solved), kind="stable")
            movers = self.hand.mover(THIN), self.hand.mover(opening)
            for least in (reacher.margin, *TIGHT, *([CLOSE - 2 * self.world.blur] if self.world.noise else [])):
                scenes = [
                    _scene(reacher, *movers, stage, min(CLOSE, least) if stage.near else least) for stage in stages
                ]
                found = _free(scenes, solved, order)
                if found:  # little room is better than none; and what isn't seen well may be farther
                    break
            if not found:
                raise _blocked(scenes, [q[order] for q in solved], objects)
            return [int(left[i]) for i in found]

    def _unreachable(self, stages: Sequence[Stage], at: Stage, objects: tuple[str, ...]) -> SkillError:
        """Return what to raise where no posture is left at a stage: by how much it is too far, and where a joint is by then."""
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
        """Return how little the candidates are liked: cramped, pointing aside, or far from where the hand is now."""
        arm, now = self.hand.arm, self.hand.pose
        ahead = np.arctan2(*(poses[:, :2] - arm.shoulder[:2]).T[::-1])
        cost: Array = np.sum([comfort(arm, q) for q in postures], axis=0)
        cost += 0.25 * np.abs(np.angle(np.exp(1j * (poses[:, 3] - ahead)))) + 0.3 * np.abs(poses[:, 5] - now[5])
        cost += 0.15 * np.abs(np.angle(np.exp(1j * (poses[:, 3] - now[3]))))
        return cost

    # ------------------------------------------------------------------------------------------------- moving

    @property
    def limits(self) -> Limits:
        """How fast the hand moves: gently with something in it."""
        limits = self.hand.limits
        return limits if self.held is None else replace(limits, hand_velocity=0.9, hand_acceleration=3.0)

    def follow(
        self, q: Array, speed: float = 1.0, enough: Callable[[], bool] | None = None, corners: int = ROUNDED
    ) -> None:
        """Drive the arm along sampled postures, from where it is, at a share of its speed, until it is `enough`.

        Corners are rounded over as many samples as `corners` says.
        """
        with self.planning():
            q, limits = np.concatenate([self.hand.posture[None], q[1:]]), self.limits
            limits = replace(limits, hand_velocity=limits.hand_velocity * speed)
            positions, velocities = timed(self.hand.arm, smooth(q, corners), limits, self.world.rate)
        try:
            self.world.follow(self.hand, positions, velocities, enough)
        except SkillError as failure:
            if self.held is None or self.world.held(self.hand.hand.name) == self.held:
                raise
            stopped = failure.verdict
            raise SkillError(
                "slip or drop", named(self.held, *stopped.objects), "it was lost on the way", **stopped.measured
            ) from failure

    def go(self, goals: Sequence[Array], objects: tuple[str, ...], *ignored: str, opening: float | None = None) -> int:
        """Move to the first goal pose that a free path leads to, maybe with fingers that go to an `opening`; return which it is."""
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
        """Go back along the postures that the arm has come along, from where something stopped it."""
        now = self.hand.measured()
        self.hand.command(now)
        passed = q[: int(np.abs(q - now).max(1).argmin()) + 1]
        self.follow(np.concatenate([now[None], passed[::-1]]), WARY)

    def straight(
        self,
        goal: Array,
        objects: tuple[str, ...],
        *ignored: str,
        speed: float = 1.0,
        enough: Callable[[], bool] | None = None,
    ) -> None:
        """Move along the straight line to a pose, or until it is `enough`; raise if it isn't free.

        Where a guard ends it, it is begun as far as it is free; else the elbow turns on the way if it must.
        """
        start = self.hand.pose
        if enough is not None:
            poses = line(start, goal)
            fine = np.linspace(poses[0], poses[-1], FINER * (len(poses) - 1) + 1)
            self.along(fine, objects, *ignored, speed=speed, enough=enough, partly=True)
            return
        bent = (np.append(goal[:5], goal[5] + turn) for turn in sorted(SWIVELS, key=abs) if turn)
        self.along(line(start, goal), objects, *ignored, speed=speed, others=(line(start, end) for end in bent))

    def along(
        self,
        poses: Array,
        objects: tuple[str, ...],
        *ignored: str,
        speed: float = 1.0,
        enough: Callable[[], bool] | None = None,
        partly: bool = False,
        others: Iterable[Array] = (),
    ) -> None:
        """Move along sampled poses, else `others`, or until it is `enough`; raise if none can be followed, or not even `partly`.

        What is followed `partly` ends where something is felt, so what is only seen to be in the way doesn't end it.
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
        self.follow(q, speed, enough)

    def rise(self, goal: Array, objects: tuple[str, ...], *ignored: str) -> None:
        """Go up in a line, the elbow turning as it must, or else around what is in the way."""
        if goal[2] - self.hand.pose[2] < 1e-3:
            return
        try:
            self.straight(goal, objects, *ignored)
        except SkillError as failure:
            if failure.verdict.code not in (*REFUTED, "unreachable"):
                raise
            self.go([goal], objects, *ignored)

    # ------------------------------------------------------------------------------------------------- checks

    def check_others(self, numbers: Numbers, *moved: str) -> None:
        """Raise if something other than the `moved` objects and the held one was disturbed or toppled."""
        for name, (carrier, position) in self.before.items():
            if name in (*moved, self.held, *self.world.elsewhere) or name not in self.world.bodies:
                continue
            rotation = self.world.truth(name)[0]
            shift = float(np.linalg.norm(_seen_from(self.world, carrier, name) - position))
            if tilt_of(rotation) > 0.5:
                raise SkillError("toppled", (name,), tilt_rad=tilt_of(rotation))
            if shift > numbers["disturbance"]:
                raise SkillError("object disturbed", (name,), moved_m=shift)

    def check_grip(self, numbers: Numbers) -> dict[str, float]:
        """Return how far the held object slipped in the hand since it was grasped; raise if too far or if it's lost."""
        if self.held is None or self.hand.grasp is None:
            return {}
        if self.held not in self.world.bodies:
            raise SkillError("slip or drop", (self.held,), f"{self.held} is nowhere to be seen", seen=0.0)
        rotation, base = self.world.in_hand(self.hand, self.held)
        first_rotation, first_base = self.hand.grasp
        slip = float(np.linalg.norm(base - first_base))
        turned = float(np.arccos(np.clip((np.trace(first_rotation.T @ rotation) - 1) / 2, -1, 1)))
        if self.world.held(self.hand.hand.name) != self.held or slip > numbers["slip"]:
            raise SkillError("slip or drop", (self.held,), slip_m=slip, turned_rad=turned)
        return {"slip_m": slip, "turned_rad": turned}

    def check_arrival(self, goal: Array, numbers: Numbers) -> dict[str, float]:
        """Return how far the hand is from a pose (6,) where it should be; raise if too far."""
        error = float(np.linalg.norm(self.hand.frame()[1] - goal[:3]))
        if error > numbers["tolerance"]:
            raise SkillError("tracking error", self.world.touching(self.hand), tip_error_m=error)
        return {"tip_error_m": error}


def rounding(reacher: Reacher, q: Array) -> int:
    """Return over how many samples corners of a path may be rounded: only as far as it keeps off everything as it must.

    Spheres leave the edges of a hand out by almost as much as that.
    """
    return next((n for n in range(ROUNDED, 0, -1) if reacher.free(smooth(q, n)).all()), 0)


def _seen_from(world: Engine, carrier: str, body: str) -> Array:
    """Return where a body is in the frame of what carries it."""
    turned, origin = world.carrier(carrier)
    local: Array = (world.truth(body)[1] - origin) @ turned
    return local


Scene = tuple[Mover, Surroundings, float]
"""An arm as it is at a stage, what is around it then, and the metres by which it keeps off that."""


def _free(scenes: Sequence[Scene], postures: Sequence[Array], order: NDArray[np.intp]) -> list[int]:
    """Return the first few candidates, in `order`, that touch nothing at any stage."""
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
    """Return the scene of a stage."""
    around = reacher.around if stage.around is None else stage.around
    mover = closed if stage.closed else bare if stage.released else reacher.mover
    return mover, around.without(*stage.ignored), margin


def _blocked(scenes: Sequence[Scene], postures: Sequence[Array], objects: tuple[str, ...]) -> SkillError:
    """Return what to raise where no candidate is free: it names what blocks most of them."""
    nearest: dict[str, Array] = {}
    for (mover, around, margin), q in zip(scenes, postures, strict=True):
        for name, gap in mover.clearances(q, around).items():
            nearest[name] = np.minimum(gap - margin, nearest.get(name, np.inf))
    count = {name: int(np.sum(gap <= 0)) for name, gap in nearest.items()}
    blocking = sorted(
        (name for name in nearest if count[name] == max(count.values())), key=lambda name: float(nearest[name].max())
    )
    widest = float(np.min(list(nearest.values()), axis=0).max()) + max(margin for _, _, margin in scenes)
    return SkillError("goal in collision", named(*objects, *blocking), clearance_m=widest)
