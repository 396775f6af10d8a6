"""The interpreter of skills, which executes the phases that the ontology describes one after another.

A phase first moves the fingers, and then the hand relative to a feature of a thing. After the motion, the checks of the phase
must hold. A `free` motion chooses a pose at its feature from which all phases before the next free motion are possible. For
example, the grasp of a door handle is chosen so that the hand can hold the handle until the door is open.

============ ======================================================================================================
motion       path of the hand
============ ======================================================================================================
free         planned around all obstacles
line         straight
yielding     straight, and to the side when a finger touches the object
joint        along the joint's path, with corrections by touch
rise         straight up to `above` the support that the load has left, with the elbow free to turn
home         to the posture at rest
drive        the whole robot to a stand, with the arms at rest
over         with a vessel to a pose above another vessel, from which it can be tilted (`confab.sim.pouring`)
============ ======================================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from itertools import product

import numpy as np

from confab.reasoner.embodiment.skill_checks import endless, unplayed, unset
from confab.reasoner.embodiment.values import Phase, SkillUse
from confab.sim.attempt import Attempt
from confab.sim.driving import drive
from confab.sim.engine import Engine
from confab.sim.features import Ways, ways
from confab.sim.measuring import check, finger_force, until
from confab.sim.motion import pose_of, rotations, turned_near
from confab.sim.pouring import FOLD, reach_over
from confab.sim.running import SkillRun
from confab.sim.stages import Stage, rises
from confab.sim.swings import SAMPLES, check_swing
from confab.sim.touch import FINGERS, ROOM, draw_back, go_around, off_centre, room
from confab.sim.urdf import Array
from confab.sim.verdict import REFUTED, SkillError, named
from confab.sim.whereabouts import arrived, floor_below, stopping

LOOKS = 3
"""Maximum number of attempts at a motion with noisy perception. The robot looks again before each attempt."""

ANCHORS = 8
"""Number of stretches of a joint's path. Each stretch is planned from the present positions of hand and joint."""

ASIDE = sorted(
    product((0.0, -0.08), (0.0, -0.1, 0.1, -0.2, 0.2), (0.0, 0.1, 0.2)), key=lambda shift: sum(map(abs, shift))
)
"""Shifts in metres of the home pose; the shifts are tried one after another, the smallest first."""

SLACK = 0.1
"""Margin in radians between the arm's joints and their limits in the plan of a joint's path.

The margin leaves room for corrections.
"""

TURNED = 0.02
"""Margin in radians to the limits of the arm's joints if noise or a narrow grasp may require corrections."""

NARROW = 0.02
"""Opening in metres of each finger at a handle with little room beside the handle."""

FAR = 1e3
"""Coordinate in metres, far beyond the reach of every arm, that marks a pose as impossible."""


def carry_out(world: Engine, use: SkillUse, roles: Mapping[str, str]) -> Mapping[str, float]:
    """Execute the phases of a skill; return the measured numbers, or raise `SkillError`."""
    for phase, word in (*unplayed(use), *unset(use), *endless(use)):
        raise SkillError(
            "ill-defined",
            (),
            f"phase {phase.name} of the skill {use.skill}: '{word}' is not stated; run confab validate",
        )
    world.look()
    hands = {"hand": world.acting(roles)} | {phase.by: roles[phase.by] for phase in use.phases if phase.by != "hand"}
    runs = {role: SkillRun(Attempt.begin(world, hand), roles, use.numbers) for role, hand in hands.items()}
    phases = [phase for phase in use.phases if all(CONDITIONS[word](runs[phase.by]) for word in phase.when)]
    with ExitStack() as stack:
        for hand in hands.values():
            stack.enter_context(stopping(world, hand))
        for i, phase in enumerate(phases):
            if not phase.foreseen:
                _carry_out(runs[phase.by], phase, [later for later in phases[i + 1 :] if later.by == phase.by])
    if "disturbance" in use.numbers:
        runs["hand"].attempt.check_others(use.numbers, *_handled(runs["hand"], phases))
    return {name: value for run in runs.values() for name, value in run.measured.items()}


def _handled(run: SkillRun, phases: Iterable[Phase]) -> tuple[str, ...]:
    """Return the bodies that a skill may have moved: the object if fingers moved, and all held bodies if the robot drove."""
    carried = [run.world.held(hand) for hand in run.world.hands] if "robot" in run.roles else []
    taken = [run.roles["object"] for phase in phases if phase.fingers and "object" in run.roles]
    return tuple(name for name in (*taken, *carried) if name)


def _carry_out(run: SkillRun, phase: Phase, later: Sequence[Phase]) -> None:
    if phase.motion == "free":
        _with_looks(run, phase, lambda: _lower(run, (phase, *later), lambda: _free(run, phase, later)))
    else:
        FINGERS[phase.fingers](run, phase)
        _with_looks(run, phase, lambda: _lower(run, (phase,), lambda: MOTIONS[phase.motion](run, phase)))
    if phase.motion:
        arrived(run.world, run.attempt.hand.hand.name, phase.motion, run.roles.get(phase.to.partition(".")[0], ""))
    run.world.run(round(run.number(phase.wait) * run.world.rate))
    for guard in phase.checks:
        check(run, phase, guard)


def _lower(run: SkillRun, phases: Iterable[Phase], motion: Callable[[], None]) -> None:
    """Execute a motion; if a lifting motion is blocked, try lower heights in turn.

    The error names the bodies that block the motion at any of the heights, and has the message of the lowest height.
    """
    if "least_raised" not in run.numbers or not any("raised" in phase.above for phase in phases):
        motion()
        return
    given, blocking = run.numbers, list[str]()
    for raised in (heights := rises(given)):
        run.numbers = {**given, "raised": raised}
        try:
            motion()
        except SkillError as failure:
            verdict = failure.verdict
            if verdict.code not in REFUTED:
                raise
            blocking += verdict.objects
            if raised == heights[-1]:
                raise SkillError(verdict.code, named(*blocking), verdict.message, **verdict.measured) from failure
        else:
            return


def _with_looks(run: SkillRun, phase: Phase, motion: Callable[[], None]) -> None:
    """Execute a motion; with noisy perception, look again and repeat a motion that a known body blocked or stopped."""
    world, hand = run.world, run.attempt.hand
    for looks in range(1, LOOKS + 1):
        try:
            motion()
        except SkillError as failure:
            known = {*world.bodies, *world.links, *(fixture.name for fixture in world.embodiment.fixtures)}
            stopped = failure.verdict.code == "tracking error" and phase.motion in WITHDRAWING
            felt = stopped and known.issuperset(failure.verdict.objects)
            if looks == LOOKS or not world.noise or not (felt or failure.verdict.code in REFUTED):
                raise
            world.look(looks)
            hand.deadline = world.steps + hand.limit * world.rate  # each attempt has the skill's full time limit
        else:
            return


# ----------------------------------------------------------------------------------------------------- poses


def _offset(run: SkillRun, phase: Phase, turned: Array) -> Array:
    """Return the offset of a phase as vectors (n, 3), for hands with rotations `turned` (n, 3, 3)."""
    local = np.array([run.number(part) for part in phase.offset])
    if phase.bring == "base":
        attempt = run.attempt
        if attempt.held is not None:
            local = local - attempt.world.in_hand(attempt.hand, attempt.held)[1]
        else:
            local = local + np.array([0.0, 0.0, run.number("empty_height")])
    shift: Array = turned @ local + np.array([0.0, 0.0, run.number(phase.above)])
    return shift


def _poses(run: SkillRun, phase: Phase, previous: Array, way: Ways | None) -> Array:
    """Return the goal poses (n, 6) of a phase for hands at poses `previous` (n, 6); `way` has the hands' grasps, if given."""
    poses = previous.copy()
    if phase.to == "hand":
        poses[:, :3] += _offset(run, phase, rotations(previous))
        return poses
    frame = run.at(phase.to)
    turned = rotations(previous)
    if way is not None:
        cos, sin, zero = np.cos(way.first), np.sin(way.first), np.zeros(len(way.first))
        about = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1], -1).reshape(-1, 3, 3)
        turned = frame.rotation @ about
        poses[:, 3] = np.arctan2(turned[:, 1, 0], turned[:, 0, 0])
        poses[:, 4] = np.arctan2(turned[:, 2, 1], turned[:, 2, 2])
        poses[:, 5] = way.swivel
    poses[:, :3] = frame.point + _offset(run, phase, turned)
    return poses


def _moved(run: SkillRun, phase: Phase, hand: Array, way: Ways, values: Sequence[float]) -> list[Array]:
    """Return, for each joint value, the poses (n, 6) of hands that hold a feature while the feature's joint moves to this value.

    The hand keeps its pose in the feature's frame, except that the hand may turn about the feature's z axis.
    """
    mechanic, link = run.joint(phase.to)
    frames = [run.at(phase.to, {**mechanic.values(), link: value}) for value in values]
    start = frames[0]
    turned, points = start.rotation.T @ rotations(hand), (hand[:, :3] - start.point) @ start.rotation
    found = []
    for share, frame in zip(np.linspace(0.0, 1.0, len(values)), frames, strict=True):
        angle = (way.last - way.first) * share
        if not frame.upright:
            now = np.arctan2(turned[:, 1, 0], turned[:, 0, 0])
            choices = np.angle(np.exp(1j * (np.array(frame.level())[None] - now[:, None])))
            angle = np.take_along_axis(choices, np.abs(choices).argmin(1)[:, None], 1)[:, 0]
        cos, sin, zero = np.cos(angle), np.sin(angle), np.zeros(len(angle))
        about = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1], -1).reshape(-1, 3, 3)
        r = frame.rotation @ about @ turned
        poses = hand.copy()
        poses[:, :3] = frame.point + np.einsum("nij,nj->ni", frame.rotation @ about, points)
        poses[:, 3], poses[:, 4] = np.arctan2(r[:, 1, 0], r[:, 0, 0]), np.arctan2(r[:, 2, 1], r[:, 2, 2])
        poses[np.abs(r[:, 2, 0]) > 0.05, 0] = FAR  # a hand points horizontally
        found.append(poses)
    return found


# ----------------------------------------------------------------------------------------------------- motions


def _choose(run: SkillRun, phase: Phase, later: Sequence[Phase]) -> tuple[Array, Ways, list[int]]:
    """Return candidate goal poses of a free motion, their grasps, and the indices of candidates that allow all later phases."""
    chain = [phase]
    for one in later:
        if one.motion not in ("", "line", "yielding", "joint"):
            break
        chain.append(one)
    frame, swings = run.at(phase.to), any(one.motion == "joint" for one in chain)
    way = ways(frame, swings, run.spread)
    if not len(way.first):
        wide = 2 * (run.spread - room(run, phase.to))
        message = f"{wide * 100:.1f} cm wide; the hand opens to {run.spread * 200:.1f} cm"
        raise SkillError("no grasp", (run.feature_of(phase.to)[0],), message, wide_m=wide)
    poses = np.repeat(run.attempt.hand.pose[None], len(way.first), axis=0)
    stages: list[Stage] = []
    closed, released, around = False, False, None
    for one in chain:
        ignored = run.free_of(one)
        closed, released = closed or one.fingers == "grasp", released or (one is not phase and one.fingers == "open")
        if one.motion == "joint":
            with run.attempt.planning():
                stages += _swing(run, one, poses, way, ignored)
            around = stages[-1].around
        elif one.motion:
            stages.append(
                Stage(
                    _poses(run, one, poses, way),
                    ignored,
                    around,
                    closed,
                    frame.low > -np.pi,
                    released=released,
                    phase=one.name,
                )
            )
        closed = closed and one.fingers != "open"
        poses = stages[-1].poses
    return stages[0].poses, way, _allowed(run, chain, stages, way.cost)


def _allowed(run: SkillRun, chain: Sequence[Phase], stages: Sequence[Stage], cost: Array | None) -> list[int]:
    """Return the candidates that allow all stages, with room for corrections if possible, or with narrower fingers if needed."""
    narrow = any(one.motion == "yielding" and room(run, one.to) < ROOM for one in chain)
    if narrow or run.world.blur:
        with suppress(SkillError):  # corrections on the way are impossible with a stretched arm
            spare = [replace(stage, fold=FOLD, slack=max(stage.slack, TURNED)) for stage in stages]
            return run.attempt.choose(spare, run.things(), run.spread, cost)
    try:
        return run.attempt.choose(stages, run.things(), run.spread, cost)
    except SkillError:
        if run.numbers.get("spread", 0.0) <= NARROW:
            raise
    run.numbers = {**run.numbers, "spread": NARROW}
    return run.attempt.choose(stages, run.things(), run.spread, cost)


def _swing(run: SkillRun, phase: Phase, poses: Array, way: Ways, ignored: tuple[str, ...]) -> list[Stage]:
    """Return one stage for each of several values on a joint's path; raise `SkillError` if a body blocks the link."""
    mechanic, link = run.joint(phase.to)
    values = np.linspace(mechanic.values()[link], run.number(phase.value, link), SAMPLES)
    held, name = run.attempt.held, run.attempt.hand.hand.name
    moved = [run.world.surroundings(name, held, {link: float(value)}) for value in values]
    check_swing(run.world, link, values.tolist())
    found = _moved(run, phase, poses, way, values.tolist())
    return [
        Stage(at, ignored, around, True, True, SLACK, joint=float(value), phase=phase.name)
        for at, around, value in zip(found[1:], moved[1:], values[1:], strict=True)
    ]


def _free(run: SkillRun, phase: Phase, later: Sequence[Phase]) -> None:
    """Move to one of the poses that allow all later phases."""
    goals, way, chosen = _choose(run, phase, later)  # a failure happens before the fingers move
    FINGERS[phase.fingers](run, phase)
    opening = run.spread if phase.fingers == "open" else None
    best = chosen[
        run.attempt.move_to_any([goals[i] for i in chosen], run.things(), *run.free_of(phase), opening=opening)
    ]
    run.way = way.pick(best)
    run.arrived(goals[best])


def _line(run: SkillRun, phase: Phase) -> None:
    hand = run.attempt.hand
    goal = turned_near(hand.pose, _poses(run, phase, hand.pose[None], run.way)[0])
    stop = until(run, phase)
    speed = run.number(phase.speed)
    if stop is not None:  # with noise the object may be farther away
        ahead = goal[:3] - hand.pose[:3]
        goal[:3] += 2 * run.world.noise * ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    run.attempt.straight(goal, run.things(), *run.free_of(phase), speed=speed, stop=stop)
    if stop is None:
        run.arrived(goal)


def _yielding(run: SkillRun, phase: Phase) -> None:
    now = run.attempt.hand.pose
    go_around(run, phase, run.feature_of(phase.to)[0], turned_near(now, _poses(run, phase, now[None], run.way)[0]))


def _joint(run: SkillRun, phase: Phase) -> None:
    """Move a joint along its path in stretches; each stretch is planned from the present positions of hand and joint."""
    mechanic, link = run.joint(phase.to)
    goal, stop, attempt = run.number(phase.value, link), until(run, phase), run.attempt
    way = run.way
    if way is None:
        raise SkillError(
            "no grasp", (link,), f"the skill moves the joint of {link} before the hand has been brought to it"
        )
    for left in range(ANCHORS, 0, -1):
        attempt.hand.command(attempt.hand.measured())
        if run.gripped:
            draw_back(run)
        value = mechanic.values()[link]
        if stop is not None and stop():
            break
        values = np.linspace(value, value + (goal - value) / left, 4)
        share = Ways(way.first, way.first + (way.last - way.first) / ANCHORS, way.swivel)
        poses = np.concatenate(_moved(run, phase, attempt.hand.pose[None], share, values.tolist()))
        poses[:, 3] = np.unwrap(poses[:, 3])
        if run.gripped:
            poses[:, :3] += np.linspace(0.0, 1.0, len(poses))[:, None] * off_centre(run)
        spread = np.linspace(0, len(poses) - 1, 3 * len(poses) - 2)
        poses = np.stack([np.interp(spread, np.arange(len(poses)), part) for part in poses.T], -1)
        attempt.along(
            poses, (link,), mechanic.mechanism.name, *mechanic.joints, speed=run.number(phase.speed), stop=stop
        )
        if run.gripped and finger_force(run, run.gripped) <= 0:
            value = mechanic.values()[link]
            raise SkillError("slip or drop", (link,), f"the hand lost hold of {link}", joint=value)


def _rise(run: SkillRun, phase: Phase) -> None:
    world, hand, held = run.world, run.attempt.hand, run.attempt.held
    load = hand.frame()[1] if held is None else world.truth(held)[1]
    goal = hand.pose
    goal[2] += max(floor_below(world, hand.hand.name, load) + run.number(phase.above) - load[2], 0.0)
    run.attempt.rise(goal, run.things() if held is None else (held,), *run.free_of(phase))


def _home(run: SkillRun, phase: Phase) -> None:
    """Move to the home pose, or to a near pose if an opened link is in the way."""
    hand = run.attempt.hand
    home = pose_of(hand.arm, np.array(hand.hand.home))
    run.attempt.move_to_any(
        [home + np.array([*shift, 0.0, 0.0, 0.0]) for shift in ASIDE],
        (),
        opening=run.spread if phase.fingers == "open" else None,
    )


MOTIONS: Mapping[str, Callable[[SkillRun, Phase], None]] = {
    "": lambda run, phase: None,
    "line": _line,
    "yielding": _yielding,
    "joint": _joint,
    "rise": _rise,
    "home": _home,
    "over": lambda run, phase: run.measured.update(reach_over(run.attempt, run.feature_of(phase.to)[0], run.numbers)),
    "drive": lambda run, phase: drive(run.world, run.roles["robot"], run.roles[phase.to]),
}
"""The function that executes each kind of motion; the function `_free` executes the motion ``free``."""


WITHDRAWING = ("free", "home")
"""Motions from which a stopped hand withdraws."""


CONDITIONS: Mapping[str, Callable[[SkillRun], bool]] = {
    "empty": lambda run: run.attempt.held is None,
    "holding": lambda run: run.attempt.held is not None,
    "place": lambda run: run.roles.get("target", "") in run.world.embodiment.places,
    "thing": lambda run: run.roles.get("target", "") not in run.world.embodiment.places,
}
"""Conditions under which a phase is executed; they depend on the load at the beginning of the skill, or on the skill's target."""
