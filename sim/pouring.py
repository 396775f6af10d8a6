"""Pouring: a held vessel is rolled about its lip, which stays over the target vessel, until a serving has left the vessel.

The controller measures the flow. The vessel rolls on slowly while nothing flows, waits while the beverage flows, and rolls back
when enough has left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from confab.sim.attempt import CLOSE, Attempt
from confab.sim.bodies import height_of
from confab.sim.engine import Engine
from confab.sim.motion import poses_at, rotations
from confab.sim.perception import tilt_of
from confab.sim.robot import Manipulator
from confab.sim.stages import Numbers, Stage, fan
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError, named

SIDES = (1.0, -1.0)
"""Directions of roll: to the right and to the left of the hand."""

FOLD = 0.1
"""Margin in radians to the stretched arm, since the load slips a little on the way; the margin is kept only if possible."""

SHARES = (1.0, 0.95, 0.9, 0.8)
"""A shift of the hand keeps the lip in place while the hand rolls back; these shares of the shift are tried in turn."""

MOST_STEPS = 2400
"""Maximum number of simulation steps of one roll."""

LAG_CHECK = 6
"""Steps between checks of the arm's lag."""

LOOK = 4
"""Steps between measurements of the flow."""

FLOWING = 0.1
"""Seconds over which the flow's rate is measured."""

SUFFICIENT = 0.9
"""Share of the wanted amount that suffices when the flow stops."""

SURPLUS = 0.25
"""Fraction of a serving that should stay in the source in addition to whole servings: half of the rounding tolerance.

If too little was poured, another tilt pours the missing amount. If too much was poured, the surplus can't be put back. Beads that
are stuck in a neck leave all at once.
"""

BLEND = 0.1
"""Cosine of the tilt angles around 90° within which the height of the lip is blended; without it, the hand would jerk at 90°."""


def reach_over(attempt: Attempt, target: str, numbers: Numbers) -> dict[str, float]:
    """Carry the held vessel to a pose from which the vessel can be tilted with its lip over the target's opening."""
    source = attempt.held or ""
    yaw, swivel = (np.tile(part, len(SIDES)) for part in fan())
    side = np.repeat(SIDES, len(yaw) // len(SIDES))
    angles = np.linspace(0.0, numbers["pour_angle"], 5)
    ways = [_poses(attempt, source, target, yaw, side, swivel, np.full(len(yaw), angle), numbers) for angle in angles]
    try:
        chosen = attempt.choose([Stage(poses, fold=FOLD) for poses in ways], (target, source))
    except SkillError:
        chosen = attempt.choose([Stage(poses) for poses in ways], (target, source))
    start = ways[0]
    best = attempt.move_to_any([start[i] for i in chosen], (target, source))
    return attempt.check_arrival(start[chosen[best]], numbers)


def tilt(world: Engine, roles: Mapping[str, str], numbers: Numbers) -> Mapping[str, float]:
    """Pour a serving: roll the source about its lip until the serving has left, then roll back until the flow ends."""
    attempt = Attempt.begin(world, roles["hand"])
    source, target = roles["source"], attempt.body(roles["target"])
    if attempt.held != source:
        raise SkillError("slip or drop", (source,), f"{source} isn't in the hand")
    filling = _filling(world, source)
    serving = world.embodiment.fillings[filling].serving if filling is not None else 1
    servo = _Servo(world, attempt.hand, _plan(attempt, source, target, numbers))
    had, got = len(world.inside(source)), len(world.inside(target))
    enough = numbers["cut_off"] - numbers["early"] * max(had / serving - 2.0, 0.0)
    enough += numbers["along"] * max(had / serving - round(had / serving) - SURPLUS, SUFFICIENT - enough)
    nearly = max(SUFFICIENT * enough, numbers["least_poured"] + 1 / serving)  # one bead may be lost

    def poured() -> float:
        return (had - len(world.inside(source))) / serving

    servo.turn(numbers["hold_back"], numbers["fast"])
    steepest, more = 0.0, True
    while more:
        more = bool(world.beads) and servo.meter(numbers, enough, nearly, poured)
        if not world.beads:
            servo.turn(numbers["pour_angle"], numbers["fast"])
        steepest = max(steepest, servo.angle)
        servo.turn(numbers["hold_back"], numbers["fast"])
        world.run(round(numbers["settle"] * world.rate))
        more = more and poured() < nearly  # fewer beads were in flight than estimated
    measured = {"steepest_rad": steepest, "tilt_rad": tilt_of(attempt.hand.frame()[0])} | attempt.check_grip(numbers)
    if abs(measured["tilt_rad"] - numbers["hold_back"]) > numbers["angle_tolerance"]:
        raise SkillError("tracking error", world.touching(attempt.hand), **measured)
    if world.beads:
        measured["poured"] = (len(world.inside(target)) - got) / serving
        measured["spilled"] = (world.stray() - attempt.stray) / serving
        _check_pour(source, target, measured, numbers)
    elif filling is not None:
        world.contents.setdefault(target, []).append(filling)
        world.filled[source] = float(world.servings(source)) - 1
    attempt.check_others(numbers)
    return measured


def _check_pour(source: str, target: str, measured: Mapping[str, float], numbers: Numbers) -> None:
    """Raise `SkillError` if too little beverage arrived in the target, or if too much was spilled."""
    if measured["spilled"] > numbers["most_spilled"]:
        raise SkillError("spill", (source, target), **measured)
    if measured["poured"] < numbers["least_poured"]:
        raise SkillError("under-pour", (source, target), **measured)


def stand_upright(world: Engine, roles: Mapping[str, str], numbers: Numbers) -> Mapping[str, float]:
    """Roll a tilted hand back about the lip of its load."""
    attempt = Attempt.begin(world, roles["hand"])
    hand, now = attempt.hand, attempt.hand.pose
    side, angle = float(np.sign(now[4])), abs(float(now[4]))
    angles = np.linspace(0.0, angle, 48)
    poses = np.repeat(now[None], len(angles), axis=0)
    poses[:, 4] = side * angles
    shifts = np.zeros((len(angles), 3))
    if attempt.held is not None:
        height, lip = _lip(attempt, attempt.held, np.array([side]))
        tips = rotations(poses) @ lip[0]
        shifts = tips[-1] - tips
        shifts[:, 2] += height * (_upright(angles) - _upright(np.array(angle)))
    servo = _Servo(world, hand, _way_back(attempt, angles, poses, shifts), angle)
    servo.turn(0.0, numbers["fast"])
    world.run(2 * LAG_CHECK)
    measured = {"tilt_rad": tilt_of(hand.frame()[0])} | attempt.check_grip(numbers)
    if measured["tilt_rad"] > numbers["upright_angle"]:
        raise SkillError("tracking error", world.touching(hand), **measured)
    serving = max((filling.serving for filling in world.embodiment.fillings.values()), default=1)
    measured["spilled"] = (world.stray() - attempt.stray) / serving
    if measured["spilled"] > numbers["most_spilled"]:
        raise SkillError("spill", (attempt.held or hand.hand.name,), **measured)
    attempt.check_others(numbers)
    return measured


def _filling(world: Engine, vessel: str) -> str | None:
    """Return the main filling of a vessel, or None if the vessel is empty."""
    amounts = {name: world.amount(vessel, name) for name in world.embodiment.fillings}
    best = max(amounts, key=amounts.__getitem__, default=None)
    return best if best is not None and amounts[best] > 0 else None


# ----------------------------------------------------------------------------------------------- geometry


def _lip(attempt: Attempt, vessel: str, side: Array) -> tuple[float, Array]:
    """Return the height of a held vessel, and the vessel's lip (n, 3) in the hand's frame for each `side` (n,)."""
    shape = attempt.world.bodies[vessel].shape
    rotation, base = attempt.world.in_hand(attempt.hand, vessel)
    height, radius = shape.profile[-1] if shape.profile else (height_of(shape), 0.0)
    return height, base + rotation[:, 2] * height - side[:, None] * np.array([0.0, radius, 0.0])


def _upright(angle: Array) -> Array:
    """Return the share (n,) of a vessel's height by which its lip is raised at tilt angles (n,): smoothly from 0 to the cosine."""
    cosine = np.cos(angle)
    blended = np.maximum(cosine + BLEND, 0.0) ** 2 / (4 * BLEND)
    share: Array = np.where(cosine > BLEND, cosine, blended)
    return share


def _poses(
    attempt: Attempt, source: str, target: str, yaw: Array, side: Array, swivel: Array, angle: Array, numbers: Numbers
) -> Array:
    """Return hand poses (n, 6) that hold the source tilted by `angle` with its lip over the target.

    The lip is at least `clearance` above the rim of the target. While the source is nearly upright, the lip is higher, so that
    the base of the source also clears the rim.
    """
    poses = poses_at(np.zeros(3), yaw, side * angle, swivel)
    height, lip = _lip(attempt, source, side)
    flow = np.stack([np.sin(yaw) * side, -np.cos(yaw) * side, 0 * yaw], -1)
    aim = attempt.world.top(target) - numbers["short"] * flow
    aim[:, 2] += numbers["clearance"] + height * _upright(angle)
    poses[:, :3] = aim - np.einsum("nij,nj->ni", rotations(poses), lip)
    return poses


@dataclass(frozen=True)
class _Way:
    """Postures (n, k) for ascending tilt angles (n,)."""

    angles: Array
    q: Array

    def at(self, angle: float) -> Array:
        """Return the posture at a tilt angle."""
        i = min(max(int(self.angles.searchsorted(angle)) - 1, 0), len(self.angles) - 2)
        low, high = self.angles[i], self.angles[i + 1]
        part = min(max((angle - low) / (high - low), 0.0), 1.0)
        posture: Array = self.q[i] * (1 - part) + self.q[i + 1] * part
        return posture


def _plan(attempt: Attempt, source: str, target: str, numbers: Numbers) -> _Way:
    """Return the path of the roll about the lip from the present pose, to the side on which the lip is nearer to its goal."""
    now, angles = attempt.hand.pose, np.linspace(0.0, numbers["pour_angle"], 64)
    ways = []
    for side in SIDES:
        yaw, sides, swivel = (np.full(len(angles), value) for value in (now[3], side, now[5]))
        poses = _poses(attempt, source, target, yaw, sides, swivel, angles, numbers)
        ways.append((float(np.linalg.norm(poses[0, :3] - now[:3])), side, poses))
    poses = min(ways, key=lambda way: way[0])[2]
    left = np.maximum(1 - angles / numbers["hold_back"], 0.0)
    poses[:, :3] += left[:, None] * (now - poses[0])[:3]  # correct the present error before the flow begins
    return _way(attempt, angles, poses, (source, target))


def _way(attempt: Attempt, angles: Array, poses: Array, objects: tuple[str, ...]) -> _Way:
    """Return the arm's postures for poses at tilt angles; raise `SkillError` if the arm can't follow the poses."""
    with attempt.planning():
        reacher = attempt.reacher(margin=CLOSE)
        q = reacher.follow(poses)
        if q is None:
            blame = reacher.blame(poses)
            raise SkillError(blame.code, named(*objects, *blame.objects), clearance_m=blame.clearance)
    return _Way(angles, q)


def _way_back(attempt: Attempt, angles: Array, poses: Array, shifts: Array) -> _Way:
    """Return a path that rolls back with the lip in place, or nearly in place if the arm can't reach the exact path."""
    for share in SHARES:
        moved = poses.copy()
        moved[:, :3] += share * shifts
        try:
            return _way(attempt, angles, moved, ())
        except SkillError:
            if share == SHARES[-1]:
                raise
    raise AssertionError("unreachable")


# ----------------------------------------------------------------------------------------------- control


class _Servo:
    """Controller that moves a hand along a path of tilt angles with bounded speed and acceleration (radians, seconds)."""

    ACCELERATION = 14.0

    def __init__(self, world: Engine, hand: Manipulator, way: _Way, angle: float = 0.0) -> None:
        self.world, self.hand, self.way, self.angle, self.rate = world, hand, way, angle, 0.0
        self.tick = 1 / world.rate

    def turn(self, goal: float, speed: float) -> None:
        """Roll the hand to a tilt angle."""
        for step in range(MOST_STEPS):
            if self.angle == goal:
                return
            self._approach(goal, speed)
            if step % LAG_CHECK == 0:
                self.world.check_course(self.hand)
        raise SkillError("too slow", (self.hand.hand.name,), seconds=MOST_STEPS * self.tick)

    def meter(self, numbers: Numbers, enough: float, nearly: float, poured: Callable[[], float]) -> bool:
        """Roll on slowly while there is no flow, and wait while beverage flows; return whether the amount `enough` was poured.

        The function `poured` returns the amount so far. To this amount, the controller adds the flow that it expects in the `lag`
        seconds in which the hand rolls back. If the flow stops early, the smaller amount `nearly` suffices. The result is False if
        nothing flows for a while at the steepest angle.
        """
        before, flowing, still = poured(), 0, 0
        looks = [before] * (1 + round(FLOWING / (LOOK * self.tick)))
        for step in range(MOST_STEPS):
            if step % LOOK == LOOK - 1:
                looks = [*looks[1:], poured()]
            now, rate = looks[-1], (looks[-1] - looks[0]) / FLOWING
            flowing = round(numbers["flow"] / self.tick) if now > before else flowing - 1
            before, still = now, still + 1 if flowing <= 0 and self.angle == numbers["pour_angle"] else 0
            if now + numbers["lag"] * rate >= enough or (flowing <= 0 and now >= nearly):
                return True
            if still > numbers["wait"] / self.tick:
                return False
            self._approach(numbers["pour_angle"], numbers["slow"] if flowing <= 0 else 0.0)
            if step % LAG_CHECK == 0:
                self.world.check_course(self.hand)
        raise SkillError("too slow", (self.hand.hand.name,), seconds=MOST_STEPS * self.tick)

    def _approach(self, goal: float, speed: float) -> None:
        """Advance for one simulation step towards an angle, with at most `speed`."""
        gap, most = goal - self.angle, self.ACCELERATION * self.tick
        wanted = math.copysign(min(speed, math.sqrt(2 * self.ACCELERATION * abs(gap))), gap)
        self.rate += max(-most, min(most, wanted - self.rate))
        advance = self.rate * self.tick
        if abs(gap) < 1e-4 or (advance * gap > 0 and abs(advance) >= abs(gap)):
            self.angle, self.rate = goal, 0.0
        else:
            self.angle += advance
        q = self.way.at(self.angle)
        self.hand.command(q, (q - self.hand.posture) / self.tick)
        self.world.run(1)
