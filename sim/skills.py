"""What a hand can do: each skill plans a motion, carries it out, and checks in the world that it did what it should.

A skill is a function of (world, roles, numbers): `roles` are the individuals that take part (`hand`, `target`, `object`,
`place`, `source`), `numbers` its settings from the ontology in metres, radians, seconds and newtons. It returns what it
measured, or raises `SkillError`. Nothing here knows a domain. Skills of other packages register as entry points of the
group `confab.skills`.

============== =============================================================== =======================================
skill          motion                                                          checked in the world
============== =============================================================== =======================================
reach          to an object: open, go before it, 9 cm line; with something in  the hand is where it should be; nothing
               the hand: over a vessel, ready to pour; to a place: above it    else moved
grasp          close                                                           both fingers press for a while
lift           line up; an empty hand goes home                                raised, upright, not slipped
put_down       line down, open, line back                                      stands at the place, upright
tilt           roll about the lip until a serving has left, then hold back     a serving arrived; little spilled
stand_upright  roll back                                                       upright, not slipped
============== =============================================================== =======================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points

import numpy as np

from sim.attempt import Attempt
from sim.engine import Engine
from sim.motion import pose_of, poses_at, rotations, turned_near
from sim.perception import tilt_of
from sim.pouring import reach_over, stand_upright, tilt
from sim.stages import Numbers, Stage, fan, grip_stages
from sim.verdict import SkillError

Roles = Mapping[str, str]
Skill = Callable[["Engine", Roles, Numbers], Mapping[str, float]]


def reach(world: Engine, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Bring a hand to an object or a place: empty to take, with a vessel over another one to pour, or above a place."""
    attempt = Attempt.begin(world, roles["hand"])
    target = roles["target"]
    if target in world.embodiment.places:
        measured = _reach_place(attempt, target, numbers)
    elif attempt.held is None:
        measured = _reach_object(attempt, attempt.body(target), numbers)
    else:
        measured = reach_over(attempt, attempt.body(target), numbers)
    attempt.check_others(numbers)
    return measured | attempt.check_grip(numbers)


def _reach_object(attempt: Attempt, target: str, numbers: Numbers) -> dict[str, float]:
    """Open, go in front of the object and along a line around it."""
    rotation, base = attempt.world.sense(target)
    leaning = tilt_of(rotation)
    if leaning > numbers["upright_angle"]:
        raise SkillError("toppled", (target,), f"{target} doesn't stand; this skill takes what does", tilt_rad=leaning)
    grip = base + np.array([0.0, 0.0, attempt.world.bodies[target].shape.grasp_height])
    at, before, above = grip_stages(grip, numbers, (target,))
    chosen = attempt.choose([at, before, above], (target,), opened=True)
    attempt.hand.open()
    best = chosen[attempt.go([before.poses[i] for i in chosen], (target,))]
    goal = turned_near(attempt.hand.pose, at.poses[best])
    attempt.straight(goal, (target,), target)
    return attempt.check_arrival(goal, numbers)


def _reach_place(attempt: Attempt, place: str, numbers: Numbers) -> dict[str, float]:
    """Carry what the hand holds above the place, from where it can be let down and the hand drawn back."""
    world = attempt.world
    point = np.array(world.embodiment.places[place].position)
    offset = np.array([0.0, 0.0, -numbers["empty_height"]])
    if attempt.held is not None:
        offset = world.in_hand(attempt.hand, attempt.held)[1]
    yaw, swivel = fan()
    down = poses_at(np.zeros(3), yaw, 0.0, swivel)
    down[:, :3] = point - rotations(down) @ offset
    hover, back, above = down.copy(), down.copy(), down.copy()
    hover[:, 2] += numbers["hover"]
    back[:, :2] -= numbers["approach"] * np.stack([np.cos(yaw), np.sin(yaw)], -1)
    above[:, 2] += numbers["raised"]
    objects = (place,) if attempt.held is None else (place, attempt.held)
    chosen = attempt.choose([Stage(hover), Stage(down), Stage(back), Stage(above)], objects, opened=True)
    best = attempt.go([hover[i] for i in chosen], objects)
    measured = attempt.check_grip(numbers) | attempt.check_arrival(hover[chosen[best]], numbers)
    reached = attempt.hand.frame()[1] if attempt.held is None else world.truth(attempt.held)[1]
    off = float(np.hypot(*(reached - point)[:2]))
    if off > numbers["place_tolerance"]:
        raise SkillError("misplaced", objects, off_place_m=off)
    return measured | {"off_place_m": off}


def grasp(world: Engine, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Close the hand until both fingers have pressed the object for a while."""
    attempt = Attempt.begin(world, roles["hand"])
    target, hand = attempt.body(roles["object"]), attempt.hand
    body, tick = world.bodies[target].body, 6
    hand.close()
    pressed, waited = 0, 0
    while pressed < numbers["hold"] * world.rate:
        if waited > numbers["time_limit"] * world.rate:
            force, opening = min(hand.pressing(body)), sum(hand.openings())
            raise SkillError("no grasp", (target,), force_n=force, opening_m=opening)
        world.run(tick)
        waited += tick
        pressed = pressed + tick if min(hand.pressing(body)) >= numbers["force"] else 0
    attempt.check_others(numbers, target)
    hand.grasp = world.in_hand(hand, target)
    return {"force_n": min(hand.pressing(body)), "seconds": waited / world.rate}


def lift(world: Engine, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Raise the hand with what it holds above its place; an empty hand goes on to its rest posture."""
    attempt = Attempt.begin(world, roles["hand"])
    hand, held = attempt.hand, attempt.held
    expected = roles.get("object")
    if expected is not None and held is None:
        raise SkillError("slip or drop", (expected,), "there is nothing in the hand to lift")
    load = hand.frame()[1] if held is None else world.truth(held)[1]
    floor = world.embodiment.places[world.nearest_place(load)[0]].position[2]
    goal = hand.pose
    goal[2] += max(floor + numbers["raised"] - load[2], 0.0)
    if held is None:
        attempt.rise(goal, ())
        hand.open()
        attempt.go([pose_of(hand.arm, np.array(hand.hand.home))], ())
        attempt.check_others(numbers)
        return {}
    attempt.rise(goal, (held,), *_supports(world))
    measured = attempt.check_grip(numbers)
    attempt.check_others(numbers)
    rotation, base = world.truth(held)
    measured |= {"height_m": float(base[2] - floor), "tilt_rad": tilt_of(rotation)}
    if measured["height_m"] < numbers["raised"] - numbers["slip"] or measured["tilt_rad"] > numbers["upright_angle"]:
        raise SkillError("slip or drop", (held,), **measured)
    return measured


def put_down(world: Engine, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Let what the hand holds down at a place, open, and draw the hand back."""
    attempt = Attempt.begin(world, roles["hand"])
    hand, body, place = attempt.hand, roles["object"], roles["place"]
    if attempt.held != body:
        raise SkillError("slip or drop", (body,), "it isn't in the hand")
    point = np.array(world.embodiment.places[place].position)
    goal = hand.pose
    goal[2] -= world.sense(body)[1][2] - point[2]
    attempt.straight(goal, (body, place), *_supports(world))
    slip = attempt.check_grip(numbers)
    hand.open()
    world.run(round(numbers["release"] * world.rate))
    empty = attempt.released()
    back = hand.pose
    back[:2] -= numbers["approach"] * np.array([np.cos(back[3]), np.sin(back[3])])
    empty.straight(back, (body,), body)
    world.run(round(numbers["settle"] * world.rate))
    rotation, base = world.truth(body)
    off, height = float(np.hypot(*(base - point)[:2])), float(base[2] - point[2])
    measured = {"off_place_m": off, "height_m": height, "tilt_rad": tilt_of(rotation)} | slip
    if measured["tilt_rad"] > numbers["upright_angle"]:
        raise SkillError("toppled", (body,), **measured)
    if off > numbers["place_tolerance"] or abs(height) > numbers["height_tolerance"]:
        raise SkillError("misplaced", (body, place), **measured)
    empty.check_others(numbers, body)
    return measured


def _supports(world: Engine) -> list[str]:
    """Return the furniture, which what stands on it touches."""
    return [fixture.name for fixture in world.embodiment.fixtures]


BUILT_IN: Mapping[str, Skill] = {
    "reach": reach,
    "grasp": grasp,
    "lift": lift,
    "put_down": put_down,
    "tilt": tilt,
    "stand_upright": stand_upright,
}


def skill(name: str) -> Skill:
    """Return the skill of that name, from this module or an entry point; raise `KeyError` that lists the built-in ones."""
    if name in BUILT_IN:
        return BUILT_IN[name]
    for point in entry_points(group="confab.skills", name=name):
        found: Skill = point.load()
        return found
    raise KeyError(f"no skill '{name}' (built in: {', '.join(BUILT_IN)}; others register in the group confab.skills)")
