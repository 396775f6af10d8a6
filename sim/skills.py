"""What a hand can do: each skill plans a motion, carries it out, and checks in the world that it did what it should.

A skill is a function of (world, roles, numbers): `roles` are the individuals that take part (`hand`, `target`, `object`,
`place`, `source`), `numbers` its settings from the ontology in metres, radians, seconds and newtons. It returns what it measured, or
raises `SkillError`. Nothing here knows a domain. Skills of other packages register as entry points of the group
`confab.skills`.

============== =============================================================== =======================================
skill          motion                                                          checked in the world
============== =============================================================== =======================================
reach          to an object: open, before it, 9 cm line; with something in     the hand is where it should be; nothing
               the hand: over a vessel, ready to pour; to a place: above it    else moved
grasp          close                                                           both fingers press for a while
lift           line up; an empty hand goes home                                raised, upright, not slipped
put_down       line down, open, line back                                      stands at the place, upright
tilt           roll about the lip until a serving has left, then hold it back  a serving arrived; little spilled
stand_upright  roll back                                                       upright, not slipped
============== =============================================================== =======================================
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

import numpy as np

from sim.bodies import height_of, outer_radius
from sim.kinematics import hand_frames
from sim.motion import Limits, Reacher, comfort, connect, line, polyline, rotations, smooth, timed
from sim.perception import tilt_of
from sim.robot import Manipulator
from sim.urdf import Array
from sim.verdict import SkillError

if TYPE_CHECKING:
    from sim.world import World

Roles = Mapping[str, str]
Numbers = Mapping[str, float]
Skill = Callable[["World", Roles, Numbers], Mapping[str, float]]

YAWS = np.linspace(-np.pi, np.pi, 48, endpoint=False)
SWIVELS = np.linspace(-1.6, 1.6, 17)
CONTROL = 1 / 240.0
CLOSE = 0.002
"""Metres kept off things on short lines whose ends were chosen with the full margin: what grips may have slipped since."""


# ----------------------------------------------------------------------------------------------- common ground


@dataclass(frozen=True)
class Scene:
    """What a skill has at hand: the world, the hand, what it holds, and where everything was when the skill began."""

    world: World
    hand: Manipulator
    held: str | None
    before: Mapping[str, Array]
    stray: int

    def reacher(self, *ignored: str, margin: float = 0.008) -> Reacher:
        """Return the arm, with what it holds, among its surroundings less the `ignored` things."""
        mover = self.hand.mover()
        if self.held is not None:
            mover = mover.holding(self.world.load_spheres(self.hand, self.held))
        around = self.world.surroundings(self.hand.hand.name, self.held).without(*ignored)
        return Reacher(mover, around, margin)

    @property
    def limits(self) -> Limits:
        """How fast the hand moves: gently with something in it."""
        limits = self.hand.limits
        return limits if self.held is None else replace(limits, hand_velocity=0.9, hand_acceleration=3.0)

    def move(self, poses: Array, q: Array | None = None) -> None:
        """Follow sampled poses."""
        begin = time.process_time()
        q = Reacher(self.hand.mover(), self.world.surroundings(self.hand.hand.name)).solve(poses)[0] if q is None else q
        q = np.concatenate([self.hand.posture[None], q[1:]])
        positions, velocities = timed(self.hand.arm, smooth(q), self.limits, 1 / CONTROL)
        self.world.clock.planning += time.process_time() - begin
        self.world.follow(self.hand, positions, velocities)

    def check_others(self, numbers: Numbers, *moved: str) -> None:
        """Raise if something other than the `moved` objects was disturbed or toppled."""
        for name, position in self.before.items():
            if name in moved or name == self.held:
                continue
            rotation, now = self.world.truth(name)
            shift = float(np.linalg.norm(now - position))
            if tilt_of(rotation) > 0.5:
                raise SkillError("toppled", (name,), tilt_rad=tilt_of(rotation))
            if shift > numbers["disturbance"]:
                raise SkillError("object disturbed", (name,), moved_m=shift)

    def check_grip(self, numbers: Numbers) -> dict[str, float]:
        """Return how far the held object slipped in the hand since it was grasped; raise if too far or if it's lost."""
        if self.held is None or self.hand.grasp is None:
            return {}
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


def _scene(world: World, roles: Roles) -> Scene:
    hand = world.hands[roles["hand"]]
    before = {name: world.truth(name)[1] for name in world.bodies}
    return Scene(world, hand, world.held(roles["hand"]), before, world.stray())


def _body(world: World, name: str) -> str:
    """Return the name of a body, or raise if the world has no such body any more."""
    if name not in world.bodies:
        raise SkillError("no grasp", (name,), f"{name} is nowhere to be seen")
    return name


# ----------------------------------------------------------------------------------------------- choosing a pose


def _candidates(pitch: Array = YAWS, swivels: Array = SWIVELS) -> tuple[Array, Array]:
    yaw, swivel = np.meshgrid(pitch, swivels)
    return yaw.ravel(), swivel.ravel()


def _poses(points: Array, yaw: Array, roll: Array | float, swivel: Array) -> Array:
    """Put together poses (n, 6)."""
    return np.concatenate([points, np.stack([yaw, np.broadcast_to(roll, yaw.shape), swivel], -1)], -1)


@dataclass(frozen=True)
class Stage:
    """A pose that a chosen approach must allow: poses (n, 6) of all candidates, and what may be touched there."""

    poses: Array
    ignored: tuple[str, ...] = ()


def _choose(scene: Scene, stages: list[Stage], objects: tuple[str, ...]) -> list[int]:
    """Return the candidates for which every stage is reachable and free, the most comfortable first.

    Raises
    ------
    SkillError
        There is none: `unreachable` with the missing metres, or `goal in collision` with what is in the way.
    """
    arm, reacher = scene.hand.arm, scene.reacher()
    solved = [reacher.solve(stage.poses) for stage in stages]
    valid = np.all([ok for _, ok in solved], axis=0)
    if not valid.any():
        raise SkillError("unreachable", objects, beyond_m=_beyond(scene, stages[0].poses))
    now = scene.hand.pose
    poses = stages[0].poses
    ahead = np.arctan2(*(poses[:, :2] - arm.shoulder[:2]).T[::-1])
    cost = np.sum([comfort(arm, q) for q, _ in solved], axis=0)
    cost += 0.25 * np.abs(np.angle(np.exp(1j * (poses[:, 3] - ahead)))) + 0.3 * np.abs(poses[:, 5] - now[5])
    cost += 0.15 * np.abs(np.angle(np.exp(1j * (poses[:, 3] - now[3]))))
    order = [int(i) for i in np.argsort(np.where(valid, cost, np.inf), kind="stable")[: int(valid.sum())]]
    chosen: list[int] = []
    gaps: dict[str, float] = {}
    for start in range(0, len(order), 24):
        batch = order[start : start + 24]
        free = np.ones(len(batch), dtype=bool)
        for stage, (q, _) in zip(stages, solved, strict=True):
            around = reacher.around.without(*stage.ignored)
            for name, gap in reacher.mover.clearances(q[batch], around).items():
                free &= gap > reacher.margin
                gaps[name] = max(gaps.get(name, -np.inf), float(gap.max()))
        chosen += [i for i, ok in zip(batch, free, strict=True) if ok]
        if len(chosen) >= 6:
            break
    if not chosen:
        blocking = tuple(sorted((name for name, gap in gaps.items() if gap <= reacher.margin), key=gaps.__getitem__))
        blocking = blocking or tuple(sorted(gaps, key=gaps.__getitem__)[:1])
        raise SkillError("goal in collision", _named(*objects, *blocking), clearance_m=gaps[blocking[0]])
    return chosen


def _named(*objects: str) -> tuple[str, ...]:
    """Return each object once, in order."""
    return tuple(dict.fromkeys(objects))


def _beyond(scene: Scene, poses: Array) -> float:
    """Return by how much the nearest candidate is out of the arm's length, in metres; 0 if only joint limits stop it."""
    arm = scene.hand.arm
    wrists = poses[:, :3] + (rotations(poses) @ arm.tip_rotation.T) @ (arm.wrist - arm.tip)
    distance = np.linalg.norm(wrists - arm.shoulder, axis=-1).min()
    return float(max(distance - arm.upper_length - arm.lower_length, 0.0))


def _go(scene: Scene, goals: list[Array], objects: tuple[str, ...], *ignored: str) -> int:
    """Move to the first goal pose that a free path leads to; return its position in the list."""
    begin = time.process_time()
    reacher = scene.reacher(*ignored)
    start = scene.hand.pose
    for attempts in (0, 150):
        for i, goal in enumerate(goals):
            corners = connect(reacher, start, _unwound(start, goal), scene.world.rng, attempts)
            if corners is not None:
                poses = polyline(corners)
                q = reacher.solve(poses)[0]
                scene.world.clock.planning += time.process_time() - begin
                scene.move(poses, q)
                return i
    scene.world.clock.planning += time.process_time() - begin
    blame = reacher.blame(line(start, _unwound(start, goals[0])))
    raise SkillError("no path", _named(*objects, *blame.objects), clearance_m=blame.clearance)


def _unwound(start: Array, goal: Array) -> Array:
    """Return the goal pose with its yaw on the near side of the start's."""
    goal = goal.copy()
    goal[3] = start[3] + np.angle(np.exp(1j * (goal[3] - start[3])))
    return goal


def _straight(scene: Scene, goal: Array, objects: tuple[str, ...], *ignored: str) -> None:
    """Move along the straight line to a pose; raise if it isn't free."""
    poses = line(scene.hand.pose, goal)
    reacher = scene.reacher(*ignored, margin=CLOSE)
    q = reacher.follow(poses)
    if q is None:
        blame = reacher.blame(poses)
        raise SkillError(blame.code, _named(*objects, *blame.objects), clearance_m=blame.clearance)
    scene.move(poses, q)


# ----------------------------------------------------------------------------------------------- reach


def reach(world: World, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Bring a hand to an object or a place: empty to take, with a vessel over another one to pour, or above a place."""
    scene = _scene(world, roles)
    target = roles["target"]
    if target in world.embodiment.places:
        measured = _reach_place(scene, target, numbers)
    elif scene.held is None:
        measured = _reach_object(scene, _body(world, target), numbers)
    else:
        measured = _reach_over(scene, _body(world, target), numbers)
    scene.check_others(numbers)
    return measured | scene.check_grip(numbers)


def _reach_object(scene: Scene, target: str, numbers: Numbers) -> dict[str, float]:
    """Open, go in front of the object and along a line around it."""
    world = scene.world
    rotation, base = world.sense(target)
    shape = world.bodies[target].shape
    if tilt_of(rotation) > numbers["upright_angle"]:
        raise SkillError(
            "toppled",
            (target,),
            f"{target} doesn't stand: this skill takes upright objects",
            tilt_rad=tilt_of(rotation),
        )
    yaw, swivel = _candidates()
    heading = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    grip = np.broadcast_to(base + [0.0, 0.0, shape.grasp_height], heading.shape)
    at = _poses(grip, yaw, 0.0, swivel)
    before = _poses(grip - numbers["approach"] * heading, yaw, 0.0, swivel)
    above = _poses(grip + [0.0, 0.0, numbers["raised"]], yaw, 0.0, swivel)
    chosen = _choose(scene, [Stage(at, (target,)), Stage(before), Stage(above, (target,))], (target,))
    scene.hand.open()
    best = chosen[_go(scene, [before[i] for i in chosen], (target,))]
    goal = _unwound(scene.hand.pose, at[best])
    _straight(scene, goal, (target,), target)
    return scene.check_arrival(goal, numbers)


def _reach_place(scene: Scene, place: str, numbers: Numbers) -> dict[str, float]:
    """Carry what the hand holds above the place, from where it can be let down and the hand drawn back."""
    world = scene.world
    point = np.array(world.embodiment.places[place].position)
    yaw, swivel = _candidates()
    offset = np.zeros(3) if scene.held is None else world.in_hand(scene.hand, scene.held)[1]
    if scene.held is None:
        offset[2] = -numbers["empty_height"]
    turned = np.einsum("nij,j->ni", rotations(_poses(np.zeros((len(yaw), 3)), yaw, 0.0, swivel)), offset)
    heading = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    down = _poses(point - turned, yaw, 0.0, swivel)
    hover = _poses(point - turned + [0.0, 0.0, numbers["hover"]], yaw, 0.0, swivel)
    back = _poses(point - turned - numbers["approach"] * heading, yaw, 0.0, swivel)
    above = _poses(point - turned + [0.0, 0.0, numbers["raised"]], yaw, 0.0, swivel)
    objects = (place,) if scene.held is None else (place, scene.held)
    stages = [Stage(hover), Stage(down), Stage(back), Stage(above)]
    chosen = _choose(scene, stages, objects)
    best = _go(scene, [hover[i] for i in chosen], objects)
    measured = scene.check_arrival(hover[chosen[best]], numbers)
    reached = scene.hand.frame()[1] if scene.held is None else world.truth(scene.held)[1]
    off = float(np.hypot(*(reached - point)[:2]))
    if off > numbers["place_tolerance"]:
        raise SkillError("misplaced", objects, off_place_m=off)
    return measured | {"off_place_m": off}


def _reach_over(scene: Scene, target: str, numbers: Numbers) -> dict[str, float]:
    """Carry a vessel over another one, to where it can be tilted with its lip over the other's opening."""
    world, source = scene.world, scene.held or ""
    yaw, swivel = _candidates(YAWS, SWIVELS)
    options = [(side, yaw, swivel) for side in (1.0, -1.0)]
    angles = np.linspace(0.0, numbers["pour_angle"], 5)
    stages = []
    sides = np.concatenate([np.full(len(yaw), side) for side, _, _ in options])
    yaws, swivels = np.concatenate([yaw, yaw]), np.concatenate([swivel, swivel])
    for angle in angles:
        poses = _pour_poses(scene, source, target, yaws, sides, swivels, np.full(len(yaws), angle), numbers)
        stages.append(Stage(poses))
    chosen = _choose(scene, stages, (target, source))
    start = stages[0].poses
    best = _go(scene, [start[i] for i in chosen], (target, source))
    return scene.check_arrival(start[chosen[best]], numbers)


def _pour_poses(
    scene: Scene, source: str, target: str, yaw: Array, side: Array, swivel: Array, angle: Array, numbers: Numbers
) -> Array:
    """Return hand poses (n, 6) that hold the source tilted by `angle` with its lip over the target.

    The lip stays over the target, `clearance` above its rim, and so much higher that the source's base keeps above it as well.
    """
    world = scene.world
    rotation, base = world.in_hand(scene.hand, source)
    turned, below = world.sense(target)
    mouth = world.bodies[source].shape.profile[-1]
    roll = side * angle
    poses = _poses(np.zeros((len(yaw), 3)), yaw, roll, swivel)
    r = rotations(poses)
    axis = rotation[:, 2]
    lip = base + axis * mouth[0] - side[:, None] * np.array([0.0, mouth[1], 0.0])
    flow = np.stack([np.sin(yaw) * side, -np.cos(yaw) * side, 0 * yaw], -1)
    rim = below + turned[:, 2] * height_of(world.bodies[target].shape)
    aim = rim - numbers["short"] * flow
    aim[:, 2] += numbers["clearance"] + mouth[0] * np.maximum(np.cos(angle), 0.0)
    poses[:, :3] = aim - np.einsum("nij,nj->ni", r, lip)
    return poses


# ----------------------------------------------------------------------------------------------- grasp and lift


def grasp(world: World, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Close the hand until both fingers have pressed the object for a while."""
    scene = _scene(world, roles)
    target, hand = _body(world, roles["object"]), scene.hand
    hand.close()
    pressed, waited = 0.0, 0.0
    while pressed < numbers["hold"]:
        if waited > numbers["time_limit"]:
            forces = hand.pressing(world.bodies[target].body)
            raise SkillError("no grasp", (target,), force_n=min(forces), opening_m=sum(hand.openings()))
        world.run(6)
        waited += 6 * CONTROL
        firm = min(hand.pressing(world.bodies[target].body)) >= numbers["force"]
        pressed = pressed + 6 * CONTROL if firm else 0.0
    scene.check_others(numbers, target)
    hand.grasp = world.in_hand(hand, target)
    return {"force_n": min(hand.pressing(world.bodies[target].body)), "seconds": waited}


def lift(world: World, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Raise the hand with what it holds above its place; an empty hand goes on to its rest posture."""
    scene = _scene(world, roles)
    hand = scene.hand
    load = hand.frame()[1] if scene.held is None else world.truth(scene.held)[1]
    floor = world.embodiment.places[world.nearest_place(load)[0]].position[2]
    goal = hand.pose
    goal[2] += max(floor + numbers["raised"] - load[2], 0.0)
    objects = () if scene.held is None else (scene.held,)
    supports = [fixture.name for fixture in world.embodiment.fixtures] if scene.held is not None else []
    expected = roles.get("object")
    if expected is not None and scene.held is None:
        raise SkillError("slip or drop", (expected,), "there is nothing in the hand to lift")
    _rise(scene, goal, objects, *supports)
    if scene.held is None:
        hand.open()
        home = np.concatenate([_home_pose(hand)])
        _go(scene, [home], objects)
    measured = scene.check_grip(numbers)
    scene.check_others(numbers)
    if scene.held is not None:
        rotation, base = world.truth(scene.held)
        measured |= {"height_m": float(base[2] - floor), "tilt_rad": tilt_of(rotation)}
        if base[2] - floor < numbers["raised"] - numbers["slip"]:
            raise SkillError("slip or drop", (scene.held,), **measured)
        if tilt_of(rotation) > numbers["upright_angle"]:
            raise SkillError("slip or drop", (scene.held,), **measured)
    return measured


def _home_pose(hand: Manipulator) -> Array:
    from sim.motion import pose_of

    return pose_of(hand.arm, np.array(hand.hand.home))


def _rise(scene: Scene, goal: Array, objects: tuple[str, ...], *ignored: str) -> None:
    """Go up in a line, the elbow turning as it must."""
    start = scene.hand.pose
    if goal[2] - start[2] < 1e-3:
        return
    reacher = scene.reacher(*ignored, margin=CLOSE)
    for swivel in sorted(SWIVELS + start[5] - SWIVELS[len(SWIVELS) // 2], key=lambda s: abs(s - start[5])):
        bent = goal.copy()
        bent[5] = swivel
        poses = line(start, bent)
        q = reacher.follow(poses)
        if q is not None:
            scene.move(poses, q)
            return
    _go(scene, [goal], objects, *ignored)


# ----------------------------------------------------------------------------------------------- put down


def put_down(world: World, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Let what the hand holds down at a place, open, and draw the hand back."""
    scene = _scene(world, roles)
    hand, body, place = scene.hand, roles["object"], roles["place"]
    if scene.held != body:
        raise SkillError("slip or drop", (body,), "it isn't in the hand")
    point = np.array(world.embodiment.places[place].position)
    supports = [fixture.name for fixture in world.embodiment.fixtures]
    goal = hand.pose
    goal[2] -= world.sense(body)[1][2] - point[2]
    _straight(scene, goal, (body, place), *supports)
    slip = scene.check_grip(numbers)
    world.run(12)
    hand.open()
    world.run(round(numbers["release"] / CONTROL))
    free = replace(scene, held=None)
    back = hand.pose
    back[:2] -= numbers["approach"] * np.array([np.cos(back[3]), np.sin(back[3])])
    _straight(free, back, (body,), body)
    world.run(round(numbers["settle"] / CONTROL))
    rotation, base = world.truth(body)
    off, height = float(np.hypot(*(base - point)[:2])), float(base[2] - point[2])
    measured = {"off_place_m": off, "height_m": height, "tilt_rad": tilt_of(rotation)} | slip
    if tilt_of(rotation) > numbers["upright_angle"]:
        raise SkillError("toppled", (body,), **measured)
    if off > numbers["place_tolerance"] or abs(height) > numbers["height_tolerance"]:
        raise SkillError("misplaced", (body, place), **measured)
    free.check_others(numbers, body)
    return measured


# ----------------------------------------------------------------------------------------------- pour


def tilt(world: World, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Pour a serving: roll about the lip until it has left the source, then roll back so far that no more flows."""
    scene = _scene(world, roles)
    source, target = roles["source"], _body(world, roles["target"])
    if scene.held != source:
        raise SkillError("slip or drop", (source,), "it isn't in the hand")
    filling = _filling(world, source)
    begin = time.process_time()
    way = _PourWay.plan(scene, source, target, numbers)
    world.clock.planning += time.process_time() - begin
    had, got = world.inside(source), world.inside(target)
    serving = world.embodiment.fillings[filling].serving if filling else 0
    servo = _Servo(world, scene.hand, way)
    servo.turn(numbers["hold_back"], numbers["fast"])
    if world.beads:
        servo.meter(numbers, lambda: (had - world.inside(source)) / serving)
    else:
        servo.turn(numbers["pour_angle"], numbers["fast"])
    steepest = servo.angle
    servo.turn(numbers["hold_back"], numbers["fast"])
    world.run(round(numbers["settle"] / CONTROL))
    measured = {"steepest_rad": steepest, "tilt_rad": tilt_of(scene.hand.frame()[0])} | scene.check_grip(numbers)
    if abs(measured["tilt_rad"] - numbers["hold_back"]) > numbers["angle_tolerance"]:
        raise SkillError("tracking error", world.touching(scene.hand), **measured)
    if world.beads:
        arrived, spilled = world.inside(target) - got, world.stray() - scene.stray
        measured |= {"poured": arrived / max(serving, 1), "spilled": spilled / max(serving, 1)}
        if measured["poured"] < numbers["least_poured"]:
            code = "spill" if measured["spilled"] > numbers["most_spilled"] else "under-pour"
            raise SkillError(code, (source, target), **measured)
        if measured["spilled"] > numbers["most_spilled"]:
            raise SkillError("spill", (source, target), **measured)
    elif filling is not None:
        world.contents[target] = filling
    scene.check_others(numbers)
    return measured


def _filling(world: World, vessel: str) -> str | None:
    amounts = {name: world.amount(vessel, name) for name in world.embodiment.fillings}
    best = max(amounts, key=amounts.__getitem__, default=None)
    return best if best is not None and amounts[best] > 0 else None


@dataclass(frozen=True)
class _PourWay:
    """Postures by tilt angle."""

    angles: Array
    q: Array

    @classmethod
    def plan(cls, scene: Scene, source: str, target: str, numbers: Numbers) -> _PourWay:
        """Plan the roll about the lip from where the hand is."""
        now, count = scene.hand.pose, 64
        angles = np.linspace(0.0, numbers["pour_angle"], count)
        blame = None
        ways = []
        for side in (1.0, -1.0):
            whole = (np.full(count, v) for v in (now[3], side, now[5]))
            poses = _pour_poses(scene, source, target, *whole, angles, numbers)
            ways.append((float(np.linalg.norm(poses[0, :3] - now[:3])), side, poses))
        _, _, poses = min(ways, key=lambda way: way[0])
        reacher = scene.reacher(margin=CLOSE)
        q = reacher.follow(poses)
        if q is None:
            blame = reacher.blame(poses)
            raise SkillError(blame.code, _named(source, target, *blame.objects), clearance_m=blame.clearance)
        return cls(angles, q)

    def at(self, angle: float) -> Array:
        """Return the posture at a tilt angle."""
        return np.array([np.interp(angle, self.angles, column) for column in self.q.T])


LONGEST = 2400
"""Steps after which turning gives up."""


class _Servo:
    """Moves along a way of postures by its angle, at a bounded rate and acceleration."""

    ACCELERATION = 14.0

    def __init__(self, world: World, hand: Manipulator, way: _PourWay, angle: float = 0.0) -> None:
        self.world, self.hand, self.way, self.angle, self.rate = world, hand, way, angle, 0.0
        self.start = hand.posture - way.at(angle)

    def turn(self, goal: float, speed: float) -> None:
        """Turn to an angle, braking in time."""
        for step in range(LONGEST):
            if self.angle == goal:
                return
            self._approach(goal, speed)
            if step % 6 == 5:
                self.world.check_lag(self.hand)
        raise SkillError("timeout", (), seconds=LONGEST * CONTROL)

    def meter(self, numbers: Numbers, poured: Callable[[], float]) -> None:
        """Turn on slowly while nothing flows and wait while it does, until a serving is `poured` or patience ends."""
        before, flowing, still = 0.0, 0, 0
        for step in range(LONGEST):
            now = poured() if step % 4 == 3 else before
            flowing = round(numbers["flow"] / CONTROL) if now > before else flowing - 1
            before, still = now, still + 1 if flowing <= 0 and self.angle == numbers["pour_angle"] else 0
            if now >= numbers["cut_off"] or still > numbers["wait"] / CONTROL:
                return
            self._approach(numbers["pour_angle"], numbers["slow"] if flowing <= 0 else 0.0)
            if step % 6 == 5:
                self.world.check_lag(self.hand)
        raise SkillError("timeout", (), seconds=LONGEST * CONTROL)

    def _approach(self, goal: float, speed: float) -> None:
        """Advance for one step towards an angle, at most at `speed` radians per second."""
        gap = goal - self.angle
        wanted = np.sign(gap) * min(speed, np.sqrt(2 * self.ACCELERATION * abs(gap)))
        self.rate += float(np.clip(wanted - self.rate, -self.ACCELERATION * CONTROL, self.ACCELERATION * CONTROL))
        advance = self.rate * CONTROL
        if abs(gap) < 1e-4 or (advance * gap > 0 and abs(advance) >= abs(gap)):
            self.angle, self.rate = goal, 0.0
        else:
            self.angle += advance
        self._command()

    def _command(self) -> None:
        q = self.way.at(np.clip(self.angle, self.way.angles[0], self.way.angles[-1]))
        velocity = (q - self.hand.posture) / CONTROL
        self.hand.command(q, velocity)
        self.world.run(1)


def stand_upright(world: World, roles: Roles, numbers: Numbers) -> Mapping[str, float]:
    """Roll a tilted hand back about the lip of what it holds."""
    scene = _scene(world, roles)
    hand, now = scene.hand, scene.hand.pose
    begin = time.process_time()
    side, angle = float(np.sign(now[4])), abs(float(now[4]))
    angles = np.linspace(0.0, angle, 48)
    poses = np.repeat(now[None], len(angles), axis=0)
    poses[:, 4] = side * angles
    if scene.held is not None:
        height, radius = (
            world.bodies[scene.held].shape.profile[-1] if world.bodies[scene.held].shape.profile else (0.0, 0.0)
        )
        base = world.in_hand(hand, scene.held)[1]
        lip = np.einsum("nij,j->ni", rotations(poses), base + np.array([0.0, -side * radius, height]))
        poses[:, :3] += lip[-1] - lip
        poses[:, 2] += height * (np.maximum(np.cos(angles), 0) - max(np.cos(angle), 0))
    reacher = scene.reacher()
    q = reacher.follow(poses)
    world.clock.planning += time.process_time() - begin
    if q is None:
        blame = reacher.blame(poses)
        raise SkillError(blame.code, blame.objects, clearance_m=blame.clearance)
    servo = _Servo(world, hand, _PourWay(angles, q), angle)
    servo.turn(0.0, numbers["fast"])
    world.run(12)
    measured = {"tilt_rad": tilt_of(hand.frame()[0])} | scene.check_grip(numbers)
    if measured["tilt_rad"] > numbers["upright_angle"]:
        raise SkillError("tracking error", world.touching(hand), **measured)
    spilled = world.stray() - scene.stray
    if spilled > numbers["most_spilled"] * max((f.serving for f in world.embodiment.fillings.values()), default=0):
        raise SkillError("spill", (scene.held or "",), spilled_beads=float(spilled), **measured)
    scene.check_others(numbers)
    return measured


# ----------------------------------------------------------------------------------------------- table

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
