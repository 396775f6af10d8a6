"""The interpreter of skills: carries out the phases that the ontology describes, one after another.

A phase moves the fingers, then the hand, relative to a feature of a thing; then its checks must hold. A `free` motion chooses among
all ways to be at its feature one that allows every phase up to the next free one, those that are only foreseen included: who opens
a door chooses before the hand moves how the handle will be held when the door is open.

============ ======================================================================================================
motion       how the hand goes
============ ======================================================================================================
free         planned around everything
line         straight
joint        as the thing's joint moves it, with what is felt corrected on the way
rise         straight up to `above` the place below, the elbow turning as it must
home         to the posture of rest
over         with a vessel over another one, to where it can be tilted (`sim.pouring`)
============ ======================================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from reasoner.embodiment.skill_checks import endless, unplayed, unset
from reasoner.embodiment.skills import TERM
from reasoner.embodiment.values import Guard, Phase, SkillUse
from sim.attempt import Attempt, named
from sim.engine import Engine
from sim.features import Frame, Ways, locate, touched, ways
from sim.linkage import wide
from sim.mechanisms import Mechanic
from sim.motion import pose_of, rotations, turned_near
from sim.perception import tilt_of
from sim.pouring import reach_over
from sim.stages import Numbers, Stage
from sim.urdf import Array
from sim.verdict import SkillError

SAMPLES = 9
"""Values of a joint at which its path is foreseen."""

ANCHORS = 8
"""So many times on a joint's path the hand looks where it and the joint have come to."""

CLOSING = 360
"""Steps within which fingers must have got hold of something."""

ASIDE = sorted(
    product((0.0, -0.08), (0.0, -0.1, 0.1, -0.2, 0.2), (0.0, 0.1, 0.2)), key=lambda shift: sum(map(abs, shift))
)
"""Metres by which a hand may rest beside its home, the nearest first."""

SLACK = 0.1
"""Radians kept from the limits of the arm's joints in planning a joint's path, for what will have to be corrected on the way."""

GROPING = 120
"""Steps after which a hand that has met a handle with one finger only takes hold anew."""

NARROW = 0.02
"""Metres by which each finger opens at a handle with little room beside it."""

LOOKING = 6
"""Steps between looks at what the fingers feel."""

TOLD = ("object", "source", "target", "place")
"""The order in which a failure names who takes part."""

FAR = 1e3
"""Metres at which nothing is reached: where a hand that can't be as it should is said to be."""

CENTRED = 0.001
"""Metres by which one finger may be ahead of the other for a hand to be centred on what it holds."""


@dataclass
class Run:
    """One execution of a skill: who takes part, what was measured, the way chosen, what is held and where things were seen."""

    attempt: Attempt
    roles: Mapping[str, str]
    numbers: Numbers
    measured: dict[str, float] = field(default_factory=dict)
    way: Ways | None = None
    gripped: str = ""
    seen: dict[tuple[str, str], Frame] = field(default_factory=dict)

    @property
    def world(self) -> Engine:
        """The world."""
        return self.attempt.world

    @property
    def spread(self) -> float:
        """Metres by which each finger of an open hand is open."""
        return self.numbers.get("spread", self.attempt.hand.hand.opening)

    def who(self, target: str) -> tuple[str, str]:
        """Return the individual and the feature of ``role.feature``."""
        role, _, feature = target.partition(".")
        name = self.roles[role]
        if not (name in self.world.embodiment.places or name in self.world.links):
            self.attempt.body(name)
        return name, feature

    def at(self, target: str, values: Mapping[str, float] | None = None) -> Frame:
        """Return where ``role.feature`` is perceived to be: looked at once in a skill, so that noise doesn't make it jump."""
        name, feature = self.who(target)
        if name in self.world.links:
            frame = locate(self.world, name, feature, values)
            return replace(frame, point=frame.point + self.world.shift(self.world.links[name]))
        if (name, feature) not in self.seen:
            self.seen[name, feature] = locate(self.world, name, feature)
        return self.seen[name, feature]

    def joint(self, target: str) -> tuple[Mechanic, str]:
        """Return the mechanism and the link of ``role.feature``."""
        name, _ = self.who(target)
        if name not in self.world.links or name not in self.world.links[name].joints:
            raise SkillError("no grasp", (name,), f"{name} has no joint that could be moved")
        return self.world.links[name], name

    def number(self, expression: str, link: str = "") -> float:
        """Return the value of an expression: settings, and what is said of the joint of a `link`, with signs between them."""
        known = dict(self.numbers)
        if link:
            one = self.world.links[link].link(link)
            known |= {name: getattr(one, name) for name in ("opened", "shut", "lower", "upper")}
            known["wide"] = wide(one)
        return evaluate(expression, known)

    def things(self) -> tuple[str, ...]:
        """Return what takes part, what is held included and the hand excepted."""
        held = self.attempt.held
        ordered = sorted(self.roles.items(), key=lambda pair: TOLD.index(pair[0]) if pair[0] in TOLD else len(TOLD))
        return named(*(name for role, name in ordered if role != "hand"), *([] if held is None else [held]))

    def free_of(self, phase: Phase) -> tuple[str, ...]:
        """Return the names of what a phase may touch: of a link the parts at the feature, of a place what carries it."""
        found: list[str] = []
        for word in phase.touches:
            if word == "supports":
                found += [fixture.name for fixture in self.world.embodiment.fixtures]
                below = self.world.nearest_place(self.attempt.hand.frame()[1])[0]
                found.append(self.world.embodiment.places[self.roles.get("place", below)].carrier)
            elif "." in word:
                found += touched(self.world, *self.who(word))
            elif word in self.roles:
                found.append(self.roles[word])
        return tuple(found)


def evaluate(expression: str, known: Mapping[str, float]) -> float:
    """Return the sum that an expression names.

    >>> round(evaluate("raised-0.03", {"raised": 0.19}), 2)
    0.16
    """
    total = 0.0
    for sign, term in TERM.findall(expression):
        total += (-1.0 if sign == "-" else 1.0) * (known[term] if term in known else float(term))
    return total


def carry_out(world: Engine, use: SkillUse, roles: Mapping[str, str]) -> Mapping[str, float]:
    """Carry out the phases of a skill; return what was measured, or raise `SkillError`."""
    for phase, word in (*unplayed(use), *unset(use), *endless(use)):
        raise SkillError(
            "ill-defined", (), f"phase {phase.name} of the skill {use.skill}: '{word}' isn't told (confab validate)"
        )
    world.look()
    run = Run(Attempt.begin(world, roles["hand"]), roles, use.numbers)
    phases = [phase for phase in use.phases if all(CONDITIONS[word](run) for word in phase.when)]
    for i, phase in enumerate(phases):
        if not phase.foreseen:
            _carry_out(run, phase, phases[i + 1 :])
    if "disturbance" in use.numbers:
        run.attempt.check_others(use.numbers, *_handled(run, phases))
    return run.measured


def _handled(run: Run, phases: Iterable[Phase]) -> tuple[str, ...]:
    """Return what the hand has taken or let go: it may have moved."""
    return tuple(run.roles["object"] for phase in phases if phase.fingers and "object" in run.roles)


def _carry_out(run: Run, phase: Phase, later: Sequence[Phase]) -> None:
    if phase.motion == "free":  # whether there is a way is known before the fingers move
        stages = _choose(run, phase, later)
        FINGERS[phase.fingers](run, phase)
        _go(run, phase, *stages)
    else:
        FINGERS[phase.fingers](run, phase)
        MOTIONS[phase.motion](run, phase)
    run.world.run(round(run.number(phase.wait) * run.world.rate))
    for guard in phase.checks:
        _check(run, phase, guard)


# ----------------------------------------------------------------------------------------------------- fingers


def _open(run: Run, phase: Phase) -> None:
    run.attempt.hand.open(run.spread)
    if run.attempt.held is not None or run.gripped:
        run.world.run(round(run.number("release") * run.world.rate))
        run.attempt, run.gripped = run.attempt.released(), ""


def _shut(run: Run, phase: Phase) -> None:
    run.attempt.hand.close()
    run.world.run(CLOSING // 6)


def _grasp(run: Run, phase: Phase) -> None:
    """Close until both fingers have pressed for a while; then centre the hand on what doesn't give way."""
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


def _grope(run: Run) -> None:
    """Take hold anew of what one finger has met and the other closed beside: around where it was met."""
    hand, shift = run.attempt.hand, _off_centre(run)
    hand.open(run.spread)
    run.world.run(CLOSING // 6)
    _shift(run, shift)
    hand.close()


def _centre(run: Run) -> None:
    """Shift the hand until both fingers have closed equally far: what they hold stands fast, so the hand gives way."""
    hand = run.attempt.hand
    for _ in range(3):
        first, second = hand.openings()
        if abs(first - second) < CENTRED or not _shift(run, _off_centre(run)):
            return
        run.world.run(2 * LOOKING)


def _shift(run: Run, shift: Array) -> bool:
    """Shift the hand by some metres, if the arm allows it."""
    hand = run.attempt.hand
    pose = hand.pose
    pose[:3] += shift
    q, valid = run.attempt.reacher(margin=-np.inf).solve(np.stack([hand.pose, pose]))
    if valid.all():
        run.attempt.follow(q)
    return bool(valid.all())


def _off_centre(run: Run) -> Array:
    """Return by how much the middle of the fingers is beside that of what they hold, which is what they feel of it."""
    hand = run.attempt.hand
    first, second = hand.openings()
    shift: Array = hand.frame()[0] @ hand.first_finger * (first - second) / 2
    return shift


FINGERS: Mapping[str, Callable[[Run, Phase], None]] = {
    "": lambda run, phase: None,
    "open": _open,
    "shut": _shut,
    "grasp": _grasp,
}


# ----------------------------------------------------------------------------------------------------- poses


def _offset(run: Run, phase: Phase, turned: Array) -> Array:
    """Return the shifts (n, 3) that a phase's offset is for hands of rotation (n, 3, 3)."""
    local = np.array([run.number(part) for part in phase.offset])
    if phase.bring == "base":
        attempt = run.attempt
        if attempt.held is not None:
            local = local - attempt.world.in_hand(attempt.hand, attempt.held)[1]
        else:
            local = local + np.array([0.0, 0.0, run.number("empty_height")])
    shift: Array = turned @ local + np.array([0.0, 0.0, run.number(phase.above)])
    return shift


def _poses(run: Run, phase: Phase, previous: Array, way: Ways | None) -> Array:
    """Return the poses (n, 6) to which a phase brings a hand that was at `previous` (n, 6) and holds on in some ways (n)."""
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


def _moved(run: Run, phase: Phase, hand: Array, way: Ways, values: Sequence[float]) -> list[Array]:
    """Return the poses (n, 6) of hands that hold on to a feature while its joint goes from the first to each of the values.

    The hand keeps its place in the feature's frame but for its turn about z: towards `way.last`, or so that it stays level.
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
        poses[np.abs(r[:, 2, 0]) > 0.05, 0] = FAR  # a hand points level
        found.append(poses)
    return found


# ----------------------------------------------------------------------------------------------------- motions


def _choose(run: Run, phase: Phase, later: Sequence[Phase]) -> tuple[Array, Ways, list[int]]:
    """Return the poses of a free motion's goal, the ways to be there, and which of them allow all that follows."""
    chain = [phase]
    for one in later:
        if one.motion not in ("", "line", "joint"):
            break
        chain.append(one)
    frame, swings = run.at(phase.to), any(one.motion == "joint" for one in chain)
    way = ways(frame, swings)
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
                Stage(_poses(run, one, poses, way), ignored, around, closed, frame.low > -np.pi, released=released)
            )
        closed = closed and one.fingers != "open"
        poses = stages[-1].poses
    try:
        return stages[0].poses, way, run.attempt.choose(stages, run.things(), run.spread)
    except SkillError:
        if run.numbers.get("spread", 0.0) <= NARROW:
            raise
    run.numbers = {**run.numbers, "spread": NARROW}
    return stages[0].poses, way, run.attempt.choose(stages, run.things(), run.spread)


def _swing(run: Run, phase: Phase, poses: Array, way: Ways, ignored: tuple[str, ...]) -> list[Stage]:
    """Return the stages of a joint's path, with the link where it is by then; raise if something stands in its way."""
    mechanic, link = run.joint(phase.to)
    values = np.linspace(mechanic.values()[link], run.number(phase.value, link), SAMPLES)
    held, name = run.attempt.held, run.attempt.hand.hand.name
    moved = [run.world.surroundings(name, held, {link: float(value)}) for value in values]
    run.world.check_swing(link, [float(value) for value in values])
    found = _moved(run, phase, poses, way, values.tolist())
    return [Stage(at, ignored, around, True, True, SLACK) for at, around in zip(found[1:], moved[1:], strict=True)]


def _go(run: Run, phase: Phase, goals: Array, way: Ways, chosen: list[int]) -> None:
    """Go to one of the chosen poses."""
    opening = run.spread if phase.fingers == "open" else None
    best = chosen[run.attempt.go([goals[i] for i in chosen], run.things(), *run.free_of(phase), opening=opening)]
    run.way = way.pick(best)
    _arrived(run, goals[best])


def _arrived(run: Run, goal: Array) -> None:
    """Check that the hand is where it should be, if the skill says how exactly."""
    if "tolerance" in run.numbers:
        run.measured |= run.attempt.check_arrival(goal, run.numbers)


def _line(run: Run, phase: Phase) -> None:
    hand = run.attempt.hand
    goal = turned_near(hand.pose, _poses(run, phase, hand.pose[None], run.way)[0])
    enough = _until(run, phase)
    speed = run.number(phase.speed)
    run.attempt.straight(goal, run.things(), *run.free_of(phase), speed=speed, enough=enough)
    if enough is None:
        _arrived(run, goal)


def _joint(run: Run, phase: Phase) -> None:
    """Move a joint along its path, starting anew from where hand and joint have come to several times on the way."""
    mechanic, link = run.joint(phase.to)
    goal, enough, attempt = run.number(phase.value, link), _until(run, phase), run.attempt
    way = run.way
    if way is None:
        raise SkillError(
            "no grasp", (link,), f"a motion of the joint of {link} follows none that brought the hand there"
        )
    for left in range(ANCHORS, 0, -1):
        value = mechanic.values()[link]
        if enough is not None and enough():
            break
        values = np.linspace(value, value + (goal - value) / left, 4)
        attempt.hand.command(attempt.hand.measured())
        share = Ways(way.first, way.first + (way.last - way.first) / ANCHORS, way.swivel)
        poses = np.concatenate(_moved(run, phase, attempt.hand.pose[None], share, values.tolist()))
        poses[:, 3] = np.unwrap(poses[:, 3])
        if run.gripped:
            poses[:, :3] += np.linspace(0.0, 1.0, len(poses))[:, None] * _off_centre(run)
        spread = np.linspace(0, len(poses) - 1, 3 * len(poses) - 2)
        poses = np.stack([np.interp(spread, np.arange(len(poses)), part) for part in poses.T], -1)
        attempt.along(
            poses, (link,), mechanic.mechanism.name, *mechanic.joints, speed=run.number(phase.speed), enough=enough
        )
        if run.gripped and finger_force(run, run.gripped) <= 0:
            value = mechanic.values()[link]
            raise SkillError("slip or drop", (link,), f"the hand lost hold of {link}", joint=value)


def _rise(run: Run, phase: Phase) -> None:
    world, hand, held = run.world, run.attempt.hand, run.attempt.held
    load = hand.frame()[1] if held is None else world.truth(held)[1]
    goal = hand.pose
    goal[2] += max(world.place(world.nearest_place(load)[0])[2] + run.number(phase.above) - load[2], 0.0)
    run.attempt.rise(goal, run.things() if held is None else (held,), *run.free_of(phase))


def _home(run: Run, phase: Phase) -> None:
    """Go to rest: home, or near it if something that has been opened is there."""
    hand = run.attempt.hand
    home = pose_of(hand.arm, np.array(hand.hand.home))
    run.attempt.go(
        [home + np.array([*shift, 0.0, 0.0, 0.0]) for shift in ASIDE],
        (),
        opening=run.spread if phase.fingers == "open" else None,
    )


def _over(run: Run, phase: Phase) -> None:
    run.measured |= reach_over(run.attempt, run.who(phase.to)[0], run.numbers)


MOTIONS: Mapping[str, Callable[[Run, Phase], None]] = {
    "": lambda run, phase: None,
    "line": _line,
    "joint": _joint,
    "rise": _rise,
    "home": _home,
    "over": _over,
}
"""How a hand goes; ``free`` is done by `_choose` and `_go`."""


# ----------------------------------------------------------------------------------------------------- what is measured


def finger_force(run: Run, name: str) -> float:
    """Return the newtons with which the weaker finger presses a body or link."""
    hand, world = run.attempt.hand, run.world
    if name in world.links:
        mechanic = world.links[name]
        return min(hand.pressing(mechanic.body, mechanic.joints[name]))
    return min(hand.pressing(world.bodies[name].body)) if name in world.bodies else 0.0


def _slip(run: Run) -> float | None:
    measured = run.attempt.check_grip({**run.numbers, "slip": np.inf})
    run.measured |= {name: value for name, value in measured.items() if name != "slip_m"}
    return measured.get("slip_m")


def _load(run: Run) -> str:
    """Return what the skill handles: what is in the hand, else its object."""
    return run.attempt.held or run.roles.get("object", "")


def _height(run: Run) -> float:
    base = run.world.truth(_load(run))[1]
    if "place" in run.roles:
        return float(abs(base[2] - run.world.place(run.roles["place"])[2]))
    return float(base[2] - run.world.place(run.world.nearest_place(base)[0])[2])


def _off(run: Run) -> float:
    place = run.roles.get("place", run.roles.get("target", ""))
    held = _load(run)
    reached = run.world.truth(held)[1] if held else run.attempt.hand.frame()[1]
    return float(np.hypot(*(reached - run.world.place(place))[:2]))


def _grip(run: Run) -> float | None:
    name = run.gripped or run.roles.get("object", "") or run.attempt.held
    return finger_force(run, name) if name else None


def _value(run: Run) -> float:
    mechanic, link = run.joint("object")
    return mechanic.values()[link]


@dataclass(frozen=True)
class Quantity:
    """Something that can be measured: how, under which name it is told, and how a skill has failed if it is out of bounds."""

    measure: Callable[[Run], float | None]
    told: str
    code: str


QUANTITIES: Mapping[str, Quantity] = {
    "slip": Quantity(_slip, "slip_m", "slip or drop"),
    "tilt": Quantity(lambda run: tilt_of(run.world.truth(_load(run))[0]), "tilt_rad", "toppled"),
    "height": Quantity(_height, "height_m", "misplaced"),
    "off": Quantity(_off, "off_place_m", "misplaced"),
    "joint": Quantity(_value, "joint", "stuck"),
    "push": Quantity(lambda run: run.attempt.hand.push(), "force_n", "stuck"),
    "grip": Quantity(_grip, "grip_n", "slip or drop"),
    "leaning": Quantity(lambda run: tilt_of(run.world.truth(run.who("target")[0])[0]), "tilt_rad", "toppled"),
}


def _holds(run: Run, guard: Guard) -> tuple[bool, float | None]:
    value = QUANTITIES[guard.quantity].measure(run)
    link = run.roles.get("object", "") if guard.quantity == "joint" else ""
    return value is None or (value - run.number(guard.bound, link)) * guard.sign >= 0, value


def _check(run: Run, phase: Phase, guard: Guard) -> None:
    """Measure, and raise if the guard doesn't hold."""
    holds, value = _holds(run, guard)
    quantity = QUANTITIES[guard.quantity]
    if value is not None:
        run.measured[quantity.told] = value
    if not holds:
        load = _load(run)
        things = (
            run.things() if guard.quantity in ("off", "height", "joint", "push") else (load,) if load else run.things()
        )
        raise SkillError(guard.code or quantity.code, things, **run.measured)


def _until(run: Run, phase: Phase) -> Callable[[], bool] | None:
    """Return what tells whether a motion has come far enough; None if it goes on to its end."""
    if not phase.until:
        return None
    return lambda: any(_holds(run, guard)[0] for guard in phase.until)


CONDITIONS: Mapping[str, Callable[[Run], bool]] = {
    "empty": lambda run: run.attempt.held is None,
    "holding": lambda run: run.attempt.held is not None,
    "place": lambda run: run.roles.get("target", "") in run.world.embodiment.places,
    "thing": lambda run: run.roles.get("target", "") not in run.world.embodiment.places,
}
"""When a phase is done: by what the hand holds when the skill begins, and by what its target is."""
