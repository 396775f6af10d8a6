"""What the ontology tells `sim/` about bodies: robots, fixtures, places, objects, skills and perceivers.

Frozen values without RDF. Lengths are in metres, masses in kilograms, angles in radians, forces in newtons; frames are the
world's (z up). `reasoner.embodiment.reading` reads them from the graph; `sim/` turns them into a physical world.
Every name of the domain (an object, a behaviour, a situation type) that `sim/` handles comes from here or from the plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Color: TypeAlias = tuple[float, float, float, float]


@dataclass(frozen=True)
class Hand:
    """A hand of a robot: the arm that carries it and the fingers that close it.

    `tip` is the URDF link whose frame is the hand's: x points where the fingers point, y from finger to finger, z up when the
    hand is upright. `arm` and `fingers` are joint names; a finger joint grows as the hand opens. `home` is the arm's rest
    posture, one angle per arm joint. `opening` is the finger joints' open position and `grip` the force of each finger.
    """

    name: str
    tip: str
    arm: tuple[str, ...]
    fingers: tuple[str, ...]
    home: tuple[float, ...]
    opening: float = 0.05
    grip: float = 25.0


@dataclass(frozen=True)
class Robot:
    """A robot: its URDF file, where its base stands, how fast it accelerates (rad/s²), and its hands in declared order."""

    name: str
    urdf: str
    hands: tuple[Hand, ...]
    position: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    acceleration: float = 8.0


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
    """A location where things stand: the point on the supporting surface."""

    name: str
    position: Vector


@dataclass(frozen=True)
class Shape:
    """How an object looks and weighs.

    `kind` is `vessel` (a wall of revolution around `profile`, open at the top), `cylinder`, `box` or a kind that another
    package registers. `profile` lists (height, inner radius) from the bottom up; `numbers` are the kind's other parameters,
    such as `wall` or `height`. `grasp_height` is where the hand takes it, above its base.
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
    """An object of the scene with its shape. `servings` is how much a filled one is filled with."""

    name: str
    shape: Shape
    servings: float = 1.0


@dataclass(frozen=True)
class Filling:
    """What a vessel is filled with, as beads. `serving` is the number of beads that one serving has."""

    name: str
    serving: int
    radius: float
    mass: float
    friction: float
    color: Color


@dataclass(frozen=True)
class SkillUse:
    """Which skill executes a primitive behaviour.

    `parameters` are the roles that the behaviour's parameters play, in their order; `variables` maps its determined variables
    to theirs. `numbers` are the skill's settings in metres, seconds, radians and newtons.
    """

    behavior: str
    skill: str
    parameters: tuple[str, ...]
    variables: Mapping[str, str] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class PerceiverUse:
    """Which perceiver reads a situation type off the world, with its thresholds and the values that mean something special.

    `choices` are the values that the situation type has, in declared order.
    """

    situation: str
    perceiver: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Embodiment:
    """Everything that a scene's bodies need: each mapping goes from the name to the value, in declared order."""

    robots: tuple[Robot, ...]
    fixtures: tuple[Fixture, ...]
    places: Mapping[str, Place]
    bodies: Mapping[str, Body]
    fillings: Mapping[str, Filling]
    skills: Mapping[str, SkillUse]
    perceivers: Mapping[str, PerceiverUse]

    def hand(self, name: str) -> tuple[Robot, Hand]:
        """Return the hand of that name with its robot; raise `KeyError` that lists the hands there are."""
        for robot in self.robots:
            for hand in robot.hands:
                if hand.name == name:
                    return robot, hand
        raise KeyError(f"no hand '{name}' (hands: {', '.join(h.name for r in self.robots for h in r.hands)})")
