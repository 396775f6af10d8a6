"""The embodiment that the ontology describes for `sim/`: robots, fixtures, places, objects, skills and perceivers.

Frozen values without RDF. Lengths are in metres, masses in kilograms, angles in radians, forces in newtons; frames are the
world's (z up). `confab.reasoner.embodiment.reading` reads them from the graph; `sim/` builds a physical world from them.
Every name of the domain (an object, a behaviour, a situation type) that `sim/` uses comes from here or from the plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Color: TypeAlias = tuple[float, float, float, float]
Flaw: TypeAlias = tuple[str, str, str, str]
"""A finding of validation: IRI or short name of the node, the fault, its effect, and the remedy."""


@dataclass(frozen=True)
class Hand:
    """A hand of a robot: the arm that carries it and the fingers that close it.

    `tip` is the URDF link whose frame, `turned` by roll, pitch and yaw, is the hand's: x points where the fingers point, y from
    finger to finger, z up when the hand is upright. `arm` and `fingers` are joint names; a finger joint grows as the hand
    opens. `home` is the arm's rest posture, one angle per arm joint. `opening` is the finger joints' open position and `grip`
    the force of each finger. A `gripper` is a URDF file that is mounted on the link `flange` of the arm, at `mounting` there
    (x, y, z, roll, pitch, yaw); its names begin with the hand's.
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
    """A robot: its URDF file, the position of its base, the acceleration of its joints (rad/s²), and its hands in declared order.

    A mobile base drives at `driving` metres and turns at `turning` radians per second; `driving` 0 means a fixed base.
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
    """A position and heading (`yaw`) of a mobile robot's base, from which it reaches some places."""

    name: str
    position: Vector
    yaw: float = 0.0


@dataclass(frozen=True)
class Fixture:
    """Furniture: a box that does not move. `size` is its full extent, `position` its centre."""

    name: str
    size: Vector
    position: Vector
    yaw: float = 0.0
    color: Color = (0.6, 0.6, 0.6, 1.0)
    friction: float = 0.8


@dataclass(frozen=True)
class Place:
    """A location for objects: a point on the supporting surface, in the frame of the `carrier` if it has one.

    The carrier is a link or an object: a place in a drawer moves with the drawer. A mobile robot reaches the place from the
    `stand`. `height` is the grasp height of objects at the place, if the scene states one.
    """

    name: str
    position: Vector
    carrier: str = ""
    stand: str = ""
    height: float | None = None


@dataclass(frozen=True)
class Part:
    """A solid of a link: its kind (box, cylinder, sphere or mesh), extent along its axes, and position in the link's frame.

    `turned` is roll, pitch and yaw. A mesh is a `file` with one convex shape per object in it.
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
    """A frame on a link at which a hand acts: x is the fingers' direction, y leads from finger to finger, z along a bar.

    The hand may turn about z from `low` to `high` radians. `parts` are the solids that the fingers touch.
    """

    name: str
    position: Vector
    turned: Vector = (0.0, 0.0, 0.0)
    low: float = 0.0
    high: float = 0.0
    parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Link:
    """A link of a mechanism: its solids, its features, and the joint that connects it to its parent ("": the base).

    `kind` is revolute, prismatic or fixed. `position` and `turned` are the joint's frame in the parent's frame, which is the
    link's own frame when the joint's value is 0. From `opened` on the joint counts as open or switched on, up to `shut` as shut.
    `friction` (newtons or newton metres) and `damping` resist; a `spring` pushes back to 0 with a force. A joint that `latches`
    stays at `opened` after a push beyond it, until the next push. `urdf_link` is the link's name in a URDF of the mechanism.
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


@dataclass(frozen=True)
class Mechanism:
    """Furniture with moving links: its position, the solids of its base, and its links; or a URDF file if `urdf` names one."""

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

    `kind` is `vessel` (a wall of revolution around `profile`, open at the top), `cylinder`, `box` or a kind that another
    package registers. `profile` lists (height, inner radius) from the bottom up; `numbers` are the kind's other parameters,
    such as `wall` or `height`. `grasp_height` is the height above the base at which a hand grasps the object.
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
    """An object of the scene with its shape. `servings` is the initial content of a filled vessel."""

    name: str
    shape: Shape
    servings: float = 1.0


@dataclass(frozen=True)
class Filling:
    """A content of vessels, simulated by beads. `serving` is the number of beads in one serving."""

    name: str
    serving: int
    radius: float
    mass: float
    friction: float
    color: Color


@dataclass(frozen=True)
class Guard:
    """A bound on a measured quantity, ``force >= 30``, that ends a motion or must hold after it.

    If it doesn't hold, the skill fails with `code`.

    `sign` is 1 for ``>=`` and -1 for ``<=``; the bound is an expression (see `Phase`).
    """

    quantity: str
    sign: int
    bound: str
    code: str = ""

    def __str__(self) -> str:
        return f"{self.quantity} {'>=' if self.sign > 0 else '<='} {self.bound}"


@dataclass(frozen=True)
class Phase:
    """One motion of a skill, relative to a feature of a thing.

    `motion` is the kind of path: free (planned around all obstacles), line (straight), joint (along the joint's path), or
    another key of `confab.sim.phases.MOTIONS`. `to` is the goal, a role with a feature, ``target.grip``, for the hand's tip or
    for the point that `bring` names. `offset` is a shift from the goal in the hand's frame, `above` a shift upwards. `offset`,
    `above`, `value`, `speed` and `wait` are expressions: sums of numbers and settings, for example ``raised-slip``.

    `fingers` (open, shut, or grasp) move before the hand does. `touches` are roles or features that the hand may touch. The motion
    ends early when one of the guards in `until` holds; after it all `checks` must hold. A phase is executed only if all conditions
    in `when` hold. A `foreseen` phase is only checked to be feasible before the hand moves.
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


@dataclass(frozen=True)
class SkillUse:
    """The skill that executes a primitive behaviour.

    `parameters` has the roles of the behaviour's parameters, in their order; `variables` those of its determined variables.
    `numbers` are the skill's settings in metres, seconds, radians and newtons. A skill without `phases` is a Python
    function. `links` has for each role the links of the scene that can play it.
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
    """The perceiver that measures a situation type, its thresholds, and the individuals of special values.

    `choices` are the situation type's values in declared order; `links` are the links that have this situation type. A measured
    type holds within the bounds `holds`; `asked` has the arguments of its symbols if these are true or false.
    """

    situation: str
    perceiver: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)
    choices: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    holds: tuple[Guard, ...] = ()
    asked: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Embodiment:
    """The robots, furniture, objects, skills and perceivers of a scene. The mappings are by name, in declared order."""

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
        """Return the robot and the hand of that name; raise `KeyError` with the known hands if there is none."""
        for robot in self.robots:
            for hand in robot.hands:
                if hand.name == name:
                    return robot, hand
        raise KeyError(f"no hand '{name}' (hands: {', '.join(h.name for r in self.robots for h in r.hands)})")
