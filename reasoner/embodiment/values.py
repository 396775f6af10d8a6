"""Dataclasses of the embodiment for `sim/`: robots, fixtures, places, objects, skills and perceivers, without RDF.

Lengths are in metres, masses in kilograms, angles in radians, forces in newtons. Positions are in the world frame with z up,
unless stated otherwise. `confab.reasoner.embodiment.reading` reads the data from the graph, and `sim/` builds a physical world
from the data. `sim/` takes every name of an object, behaviour or situation type from these data or from the plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from confab.reasoner.names import brief, known_as

Vector: TypeAlias = tuple[float, float, float]
Color: TypeAlias = tuple[float, float, float, float]
Flaw: TypeAlias = tuple[str, str, str, str]
"""A fault: IRI or short name of the node, the description, the consequence, and the remedy."""

WIDER = 0.25
"""Share of the range from `opened` to the upper limit; a joint is opened by this share of the range beyond `opened`."""


@dataclass(frozen=True)
class Hand:
    """A hand of a robot, with the hand's fingers and the arm that carries the hand.

    `tip` is a URDF link. The hand's frame is the frame of this link, rotated by `turned` (roll, pitch, yaw). The x axis of the
    hand's frame is the direction of the fingers, y leads from finger to finger, and z is up if the hand is upright.

    `arm` and `fingers` are joint names; the value of a finger joint increases when the hand opens. `home` is the rest posture, one
    angle per arm joint. `opening` is the open position of a finger joint. `grip` is the force of each finger.

    `gripper` is a URDF file that is mounted on the arm's link `flange` at `mounting` (x, y, z, roll, pitch, yaw). Names of the
    gripper's links and joints begin with the hand's name.
    """

    name: str
    tip: str
    arm: tuple[str, ...]
    fingers: tuple[str, ...]
    home: tuple[float, ...]
    opening: float = 0.05
    grip: float = 25.0
    turned: Vector = (0.0, 0.0, 0.0)
    gripper: str = ""
    flange: str = ""
    mounting: tuple[float, ...] = (0.0,) * 6


@dataclass(frozen=True)
class Robot:
    """A robot: its URDF file, the position of its base, the acceleration of its joints in rad/s², and its hands in declared order.

    `driving` is the speed of a mobile base in m/s (0 for a fixed base), and `turning` is the angular speed of the base in rad/s.
    """

    name: str
    urdf: str
    hands: tuple[Hand, ...]
    position: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    acceleration: float = 8.0
    driving: float = 0.0
    turning: float = 1.0


@dataclass(frozen=True)
class Stand:
    """A position and heading (`yaw`) of a mobile robot's base from which the robot reaches some places."""

    name: str
    position: Vector
    yaw: float = 0.0


@dataclass(frozen=True)
class Fixture:
    """Immovable furniture with the shape of a box; `size` is the full extent and `position` the centre of the box."""

    name: str
    size: Vector
    position: Vector
    yaw: float = 0.0
    color: Color = (0.6, 0.6, 0.6, 1.0)
    friction: float = 0.8


@dataclass(frozen=True)
class Place:
    """A point on a supporting surface at which objects can be, in the frame of `carrier` if the place has a carrier.

    A carrier is a link or an object, which moves the place: a place in a drawer moves with the drawer. `stand` is the
    position from which a mobile robot reaches the place. `height` is the grasp height of objects at the place, if the
    scene states a height.
    """

    name: str
    position: Vector
    carrier: str = ""
    stand: str = ""
    height: float | None = None


@dataclass(frozen=True)
class Part:
    """A solid of a link or mechanism: its kind (box, cylinder, sphere or mesh), full extents, and position in the owner's frame.

    `turned` is roll, pitch and yaw. A mesh is read from `file`, which contains convex shapes.
    """

    name: str
    kind: str
    size: Vector
    position: Vector = (0.0, 0.0, 0.0)
    turned: Vector = (0.0, 0.0, 0.0)
    color: Color = (0.8, 0.8, 0.8, 1.0)
    file: str = ""


@dataclass(frozen=True)
class Feature:
    """A frame on a link at which a hand acts: x is the direction of the fingers, y leads from finger to finger, z is along a bar.

    The hand may be rotated about z by an angle between `low` and `high`. `parts` are the solids that the fingers touch.
    """

    name: str
    position: Vector
    turned: Vector = (0.0, 0.0, 0.0)
    low: float = 0.0
    high: float = 0.0
    parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Link:
    """A link of a mechanism: its solids and features, and the joint that connects it to its parent (the base if empty).

    `kind` is the kind of the joint: revolute, prismatic or fixed. `position` and `turned` are the joint's frame in the parent's
    frame. At the joint value 0, the link's frame equals the joint's frame.

    The joint counts as open (or switched on) if its value is at least `opened`, and as shut if its value is at most `shut`.
    `friction` (newtons or newton metres) and `damping` resist a motion. A `spring` pushes the joint towards 0. A joint that
    `latches` stays at `opened` after a push beyond `opened`, until the next push.

    `urdf_link` is the link's name in the mechanism's URDF file.
    """

    name: str
    kind: str
    parts: tuple[Part, ...] = ()
    features: Mapping[str, Feature] = field(default_factory=dict)
    parent: str = ""
    position: Vector = (0.0, 0.0, 0.0)
    turned: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    lower: float = 0.0
    upper: float = 0.0
    mass: float = 1.0
    opened: float = 0.0
    shut: float = 0.0
    friction: float = 0.5
    damping: float = 0.1
    spring: float = 0.0
    latches: bool = False
    urdf_link: str = ""
    touches: tuple[str, ...] = field(default=(), repr=False)

    @property
    def wide(self) -> float:
        """The value to which a hand opens the joint, somewhat above the value from which the joint counts as open.

        >>> Link("lid", "revolute", opened=1.2, upper=1.6).wide
        1.3
        """
        return self.opened + WIDER * (self.upper - self.opened)


@dataclass(frozen=True)
class Mechanism:
    """Furniture with moving links: its position, the solids of its base, and its links, or a URDF file."""

    name: str
    position: Vector
    yaw: float
    parts: tuple[Part, ...]
    links: tuple[Link, ...]
    friction: float = 0.8
    urdf: str = ""


@dataclass(frozen=True)
class Shape:
    """The shape, mass and colour of an object.

    `kind` is `cylinder`, `box`, `vessel` (a wall of revolution around `profile`, open at the top) or a kind that another package
    registers. `profile` lists (height, inner radius) from the bottom to the top. `numbers` contains further parameters such as
    `wall` or `height`. `grasp_height` is the height above the base at which a hand grasps the object.
    """

    kind: str
    mass: float
    grasp_height: float
    profile: tuple[tuple[float, float], ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    color: Color = (0.8, 0.8, 0.8, 1.0)
    friction: float = 0.8


@dataclass(frozen=True)
class Body:
    """An object with its shape; `servings` is the initial content of a filled vessel."""

    name: str
    shape: Shape
    servings: float = 1.0


@dataclass(frozen=True)
class Filling:
    """A content of vessels that is simulated by beads; `serving` is the number of beads in one serving."""

    name: str
    serving: int
    radius: float
    mass: float
    friction: float
    color: Color


@dataclass(frozen=True)
class Guard:
    """A bound on a measured quantity, such as ``force >= 30``, that ends a motion or must hold after a motion.

    `sign` is 1 for ``>=`` and -1 for ``<=``. `bound` is an expression (see `Phase`). If the bound is required and doesn't hold,
    the skill fails with `code`.
    """

    quantity: str
    sign: int
    bound: str
    code: str = ""

    def __str__(self) -> str:
        return f"{self.quantity} {'>=' if self.sign > 0 else '<='} {self.bound}"


@dataclass(frozen=True)
class Phase:
    """One motion of a skill, relative to a feature of an object or link.

    `motion` is the kind of path: free (planned around all obstacles), line (straight), joint (along the joint's path), or another
    key of `confab.sim.phases.MOTIONS`. `to` is the goal, a role with a feature such as ``target.grip``. The hand's tip, or the
    point that `bring` names, moves to the goal. `offset` is a shift of the goal in the hand's frame. `above` is an upward shift.
    `offset`, `above`, `value`, `speed` and `wait` are expressions: sums of numbers and settings, such as ``raised-slip``.

    `by` is the role of the hand that executes the phase. `fingers` (open, shut or grasp) states what the fingers do before the hand
    moves. `touches` contains roles or features that the hand may touch.

    The motion ends early if a guard in `until` holds. After the motion, all guards in `checks` must hold. The phase is executed
    only if all conditions in `when` hold. A `foreseen` phase isn't executed; its feasibility is checked in advance.
    """

    name: str
    motion: str = ""
    to: str = ""
    bring: str = ""
    offset: tuple[str, str, str] = ("0", "0", "0")
    above: str = "0"
    value: str = ""
    speed: str = "1"
    fingers: str = ""
    wait: str = "0"
    touches: tuple[str, ...] = ()
    when: tuple[str, ...] = ()
    foreseen: bool = False
    until: tuple[Guard, ...] = ()
    checks: tuple[Guard, ...] = ()
    iri: str = ""
    by: str = "hand"


@dataclass(frozen=True)
class SkillUse:
    """The skill that executes a primitive behaviour.

    `parameters` contains the roles of the behaviour's parameters in order, and `variables` contains the roles of the determined
    variables. `numbers` are the skill's settings in metres, seconds, radians and newtons. A skill without `phases` is a Python
    function. `links` maps each role to the links (such as drawers) that can play this role.
    """

    behavior: str
    skill: str
    parameters: tuple[str, ...]
    variables: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)
    phases: tuple[Phase, ...] = ()
    links: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class PerceiverUse:
    """The perceiver that measures a situation type, with its thresholds and special values.

    `choices` are the situation type's values in declared order, and `links` are the links that have the situation type. A
    measured situation type is true if its quantities are within the bounds `holds`; `asked` contains the arguments of all boolean
    symbols.
    """

    situation: str
    perceiver: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)
    choices: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    holds: tuple[Guard, ...] = ()
    asked: tuple[tuple[str, ...], ...] = ()


@known_as("an embodiment")
@brief
@dataclass(frozen=True)
class Embodiment:
    """The robots, furniture, objects, skills and perceivers of a scene; the keys of mappings are names in declared order."""

    robots: tuple[Robot, ...]
    fixtures: tuple[Fixture, ...]
    places: Mapping[str, Place]
    bodies: Mapping[str, Body]
    fillings: Mapping[str, Filling]
    skills: Mapping[str, SkillUse]
    perceivers: Mapping[str, PerceiverUse]
    mechanisms: tuple[Mechanism, ...] = ()
    stands: Mapping[str, Stand] = field(default_factory=dict)
    cameras: tuple[Vector, ...] = ()

    def hand(self, name: str) -> tuple[Robot, Hand]:
        """Return the robot and the hand with a name; raise `KeyError` if there is no such hand."""
        for robot in self.robots:
            for hand in robot.hands:
                if hand.name == name:
                    return robot, hand
        raise KeyError(f"no hand '{name}' (hands: {', '.join(h.name for r in self.robots for h in r.hands)})")
