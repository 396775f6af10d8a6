"""Motions of the fingers, and corrections of the hand that respond to forces on the fingers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from confab.reasoner.embodiment.values import Phase
from confab.sim.measuring import finger_force, finger_forces
from confab.sim.motion import line
from confab.sim.running import SkillRun
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError

CLOSING = 360
"""Maximum number of simulation steps of a grasp."""

GROPING = 120
"""Number of simulation steps after which a hand grasps again if only one finger touches the handle."""

YIELDS, ASIDE_BY = 6, 0.002
"""Maximum number of times that a hand yields to contact, and distance in metres by which the hand yields each time."""

ROOM = 0.01
"""Distance in metres of an open finger from an object, below which the hand slows down in proportion."""

SLOWEST = 0.1
"""Minimum share of its speed to which the hand slows down."""

LOOKING = 6
"""Number of simulation steps between checks of the forces on the fingers."""

CENTRED = 0.001
"""Maximum difference in metres between the openings of the two fingers of a centred hand."""


def _open(run: SkillRun, phase: Phase) -> None:
    run.attempt.hand.open(run.spread)
    if run.attempt.held is not None or run.gripped:
        run.world.run(round(run.number("release") * run.world.rate))
        run.attempt, run.gripped = run.attempt.released(), ""


def _shut(run: SkillRun, phase: Phase) -> None:
    run.attempt.hand.close()
    run.world.run(CLOSING // 6)


def _grasp(run: SkillRun, phase: Phase) -> None:
    """Close the fingers until both fingers have pressed for a while; centre a hand that holds a link."""
    world, hand, name = run.world, run.attempt.hand, run.roles["object"]
    hand.close()
    pressed, waited = 0, 0
    while pressed < run.numbers["hold"] * world.rate:
        if waited > CLOSING:
            raise SkillError("no grasp", (name,), force_n=finger_force(run, name), opening_m=sum(hand.openings()))
        if name not in world.bodies and waited and waited % GROPING == 0 and not pressed:
            _grope(run)
        world.run(LOOKING)
        waited += LOOKING
        pressed = pressed + LOOKING if finger_force(run, name) >= run.numbers["force"] else 0
    run.gripped = name
    if name in world.bodies:
        run.attempt.check_others(run.numbers, name)
        run.attempt = replace(run.attempt, held=name)
        hand.grasp = world.in_hand(hand, name)
    else:
        _centre(run)
    run.measured |= {"force_n": finger_force(run, name), "seconds": waited / world.rate}


def _grope(run: SkillRun) -> None:
    """Open the hand, centre it on a handle that only one finger has touched, and begin to grasp again."""
    hand, shift = run.attempt.hand, off_centre(run)
    hand.open(run.spread)
    run.world.run(CLOSING // 6)
    _shift(run, shift)
    hand.close()


def _centre(run: SkillRun) -> None:
    """Shift the hand until both fingers are closed equally far, since a held link does not yield."""
    hand = run.attempt.hand
    for _ in range(3):
        first, second = hand.openings()
        if abs(first - second) < CENTRED or not _shift(run, off_centre(run)):
            return
        run.world.run(2 * LOOKING)


def _shift(run: SkillRun, shift: Array) -> bool:
    """Shift the hand by a vector (3,) in metres if the arm can reach the new pose; return whether the arm can."""
    hand = run.attempt.hand
    pose = hand.pose
    pose[:3] += shift
    q, valid = run.attempt.reacher(margin=-np.inf).solve(np.stack([hand.pose, pose]))
    if valid.all():
        run.attempt.follow(q)
    return bool(valid.all())


def off_centre(run: SkillRun) -> Array:
    """Return the shift (3,) of the hand that makes the openings of both fingers equal."""
    hand = run.attempt.hand
    first, second = hand.openings()
    shift: Array = hand.frame()[0] @ hand.first_finger * (first - second) / 2
    return shift


def draw_back(run: SkillRun) -> None:
    """Draw the hand back while its fingers press against a body in front of the hand."""
    hand = run.attempt.hand
    for _ in range(YIELDS):
        if hand.push() < run.numbers["force"] or not _shift(run, -ASIDE_BY * hand.frame()[0][:, 0]):
            return


FINGERS: Mapping[str, Callable[[SkillRun, Phase], None]] = {
    "": lambda run, phase: None,
    "open": _open,
    "shut": _shut,
    "grasp": _grasp,
}


def go_around(run: SkillRun, phase: Phase, name: str, goal: Array) -> None:
    """Move the open fingers around an object; after contact with one finger, shift the hand to the finger's side and continue.

    On contact with the palm, the object is far enough inside the hand, so the hand draws back a little and stops. On its way
    around a handle, the hand also stops on contact with the link, for example with the door behind the handle.
    """
    hand = run.attempt.hand
    still = name in run.world.links
    body = run.world.links[name].body if still else run.world.bodies[name].body
    speed = run.number(phase.speed) * min(max(room(run, phase.to, goal[3]) / ROOM, SLOWEST), 1.0)
    back = -ASIDE_BY * hand.frame()[0][:, 0]
    patience = YIELDS
    while True:
        stop = (lambda: hand.meets(body)) if patience else None
        run.attempt.straight(goal, run.things(), *run.free_of(phase), speed=speed, stop=stop)
        if not patience or not hand.meets(body):
            break
        patience -= 1
        first, second = finger_forces(run, name)
        if still or (not first and not second):
            _shift(run, back)
            goal = hand.pose
            break
        beside = goal.copy()
        beside[:3] += hand.frame()[0] @ hand.first_finger * (ASIDE_BY if first else -ASIDE_BY)
        again = hand.pose + beside - goal
        again[:3] += back
        if (first and second) or not run.attempt.reacher(margin=-np.inf).solve(line(again, beside))[1].all():
            patience = 0  # contact with both fingers leaves no side to shift to
        elif _shift(run, (again - hand.pose)[:3]):
            goal = beside
    run.arrived(goal)


def room(run: SkillRun, target: str, yaw: Array | None = None) -> float:
    """Return the gap in metres between each open finger and the object with a feature; infinite for a feature of another thing.

    The hand has the heading `yaw`, or the heading with the most room.
    """
    frame = run.at(target)
    if frame.across is None:
        return np.inf
    turns = frame.turns() if yaw is None else yaw - np.arctan2(frame.rotation[1, 0], frame.rotation[0, 0])
    return run.spread - float(np.min(frame.across(turns)))
