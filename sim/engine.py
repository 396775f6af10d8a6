"""PyBullet with the bodies of a scene: simulation steps and perception.

Rule 1: time is counted in steps of ``1 / RATE`` seconds, and every loop has a maximum number of steps.
Rule 2: skills set only targets of motors. `confab.sim.staging` (before the first step), planted faults (`confab.sim.faults`)
and interventions (`confab.sim.live`) may set positions.
Rule 3: every random number comes from `Engine.rng`, so equal arguments give equal worlds, bit by bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pybullet

from confab.reasoner.embodiment.values import Embodiment, Shape
from confab.reasoner.limits import check
from confab.sim.base import Base
from confab.sim.bodies import center_height, height_of, inner_radius, outer_radius, outline, pieces, vessel_height
from confab.sim.collision import Obstacles, Solid, box, clearances, column, rim
from confab.sim.mechanisms import Mechanic
from confab.sim.robot import Manipulator
from confab.sim.sight import Sight, Sought, look, over_the_shoulders
from confab.sim.stages import MARGIN
from confab.sim.urdf import Array, Spheres
from confab.sim.verdict import SkillError

RATE = 240.0
"""Simulation steps per second."""

CONTACT_SHIFT = 0.005
"""Distance in metres that two bodies may shift along each other before Bullet drops their contact and detects it again.

Bullet's default of 2 cm suits larger bodies. With the default, a finger that has left a ledge would still press on the ledge.
"""

LAG = 0.08
"""A motion is stopped if a joint lags behind its command by more than this angle in radians."""

LOOKS = 6
"""Number of noisy measurements whose mean is a perceived position."""

STEADY = 5.0
"""A body counts as unmoved if a new measurement is within this number of standard deviations of its perceived position."""

NEAR_PLACE = 0.05
"""Maximum distance in metres between a place and a body at the place."""


STEP_UP = 0.01
"""Distance in metres between neighbouring heights that `clear_height` tries."""


def whole_spheres(shape: Shape) -> Spheres:
    """Return spheres for an upright body down to its lower edge, in the frame of its base."""
    inner, edge = column(*outline(shape), bottom=outer_radius(shape) / 3), rim(*outline(shape))
    return Spheres(np.concatenate([inner.centers, edge.centers]), np.concatenate([inner.radii, edge.radii]))


@dataclass(frozen=True)
class SimulatedBody:
    """A body in the world: its PyBullet number and its shape after perturbation."""

    body: int
    shape: Shape


@dataclass(frozen=True)
class Bead:
    """A small ball that represents a drop of the beverage `filling`."""

    body: int
    filling: str


@dataclass
class Clock:
    """CPU seconds spent on motion planning, simulation steps and rendering."""

    planning: float = 0.0
    stepping: float = 0.0
    rendering: float = 0.0


class Engine:
    """A physics server with bodies, hands and beads, which skills move and perceivers read.

    Parameters
    ----------
    embodiment : Embodiment
    seed : int
        Seed of all random numbers.
    noise : float
        Standard deviation in metres of perceived positions.
    gui : bool
        Open PyBullet's window. Call `confab.sim.screen.require_screen` first, since PyBullet ends the process without a screen.
    """

    def __init__(self, embodiment: Embodiment, seed: int = 0, noise: float = 0.0, gui: bool = False) -> None:
        self.embodiment = embodiment
        self.rng = np.random.default_rng(seed)
        self.noise, self.gui = noise, gui
        self.watch: Callable[[Engine], None] | None = None
        self.disturb: Callable[[Engine], None] | None = None
        self.steps, self.current, self.clock = 0, -1, Clock()
        self.names: dict[int, str] = {}
        self.bodies: dict[str, SimulatedBody] = {}
        self.hands: dict[str, Manipulator] = {}
        self.bases: dict[str, Base] = {}
        self.standing: dict[str, Spheres] = {}
        self.mechanics: list[Mechanic] = []
        self.links: dict[str, Mechanic] = {}  # by the name of the link
        self.shifts: dict[int, Array] = {}  # error of a mechanism's perceived position, by the mechanism's body
        # step of the last look, and error of the perceived position, by body
        self.errors: dict[str, tuple[int, Array]] = {}
        # carrier of a body when it was last seen, and the body's rotation and base in the carrier's frame, by body
        self.known: dict[str, tuple[str, Array, Array]] = {}
        self.last_amounts: dict[tuple[str, str], float] = {}  # servings when last seen, by vessel and filling
        self.sighted: tuple[int, Sight] | None = None
        self.remembered: dict[str, int] = {}
        self.beads: list[Bead] = []
        self.contents: dict[str, list[str]] = {}
        self.filled: dict[str, float] = {}
        self.containers = {  # bodies with a place below their top
            place.carrier
            for place in embodiment.places.values()
            if place.carrier in embodiment.bodies
            and place.position[2] < height_of(embodiment.bodies[place.carrier].shape)
        }
        self.moved_by_others: set[str] = set()  # bodies that other hands or interventions move during the present skill
        self.client = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("PyBullet could not start a physics server")
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / RATE,
            numSolverIterations=50,
            deterministicOverlappingPairs=1,
            contactBreakingThreshold=CONTACT_SHIFT,
            physicsClientId=self.client,
        )

    def close(self) -> None:
        """Free the physics server."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    # ------------------------------------------------------------------------------------------------- stepping

    def run(self, steps: int) -> None:
        """Simulate a number of steps with unchanged targets of the motors."""
        begin, rendering = time.process_time(), self.clock.rendering
        hands = [hand for hand in self.hands.values() if hand.closing]
        latching = [mechanic for mechanic in self.mechanics if mechanic.latching]
        for _ in range(steps):
            check("simulating")
            for hand in hands:
                hand.drive()
            for mechanic in latching:
                mechanic.drive()
            pybullet.stepSimulation(physicsClientId=self.client)
            self.steps += 1
            if self.disturb is not None:
                self.disturb(self)
            if self.watch is not None:
                self.watch(self)
        self.clock.stepping += time.process_time() - begin - (self.clock.rendering - rendering)

    def follow(
        self, hand: Manipulator, positions: Array, velocities: Array, stop: Callable[[], bool] | None = None
    ) -> None:
        """Drive an arm along timed postures, or until `stop` returns true; raise `SkillError` if the arm lags too far behind."""
        for i, (q, v) in enumerate(zip(positions, velocities, strict=True)):
            hand.command(q, v)
            self.run(1)
            if stop is not None and i % 2 == 1 and stop():
                hand.command(hand.measured())
                return
            if i % 6 == 5:
                self.check_course(hand)
        hand.command(positions[-1])
        self.run(6)
        self.check_course(hand)

    def check_course(self, hand: Manipulator) -> None:
        """Raise `SkillError` if the skill's time limit has passed, or if a joint lags too far behind its command.

        If a joint lags, the error names the bodies that the robot touches, or the hand if the robot touches no body.
        """
        if self.steps > hand.deadline:
            raise SkillError("too slow", (hand.hand.name,), seconds=hand.limit)
        lag = float(np.abs(hand.measured() - hand.posture).max())
        if lag > LAG:
            raise SkillError("tracking error", self.touching(hand) or (hand.hand.name,), joint_lag_rad=lag)

    def touching(self, hand: Manipulator) -> tuple[str, ...]:
        """Return the bodies that touch the robot of a hand, its held body, or another body in contact with the robot.

        The held body itself is left out.
        """
        held = self.held(hand.hand.name)
        around = self._contacts(hand.body)
        if held is not None:
            around.add(held)
        furniture = {fixture.name for fixture in self.embodiment.fixtures}
        for name in sorted(around & self.bodies.keys()):
            around |= self._contacts(self.bodies[name].body) - furniture
        return tuple(sorted(around - {held, hand.robot.name}))

    def contacts(self, body: int) -> Sequence[Sequence[Any]]:
        """Return PyBullet's contact points of a body with other bodies."""
        found = pybullet.getContactPoints(body, physicsClientId=self.client)
        return [contact for contact in found if contact[2] != body]

    def _contacts(self, body: int) -> set[str]:
        """Return the names of the bodies and links in contact with a body."""
        found = {self.name_of(contact[2], contact[4]) for contact in self.contacts(body) if contact[9] > 0.5}
        return found - {""}

    def name_of(self, body: int, part: int) -> str:
        """Return the name of a mechanism's moving link `part`, or of the whole body; an empty string if the body has no name."""
        links = (name for name, one in self.links.items() if (one.body, one.joints.get(name)) == (body, part))
        return next(links, self.names.get(body, ""))

    @property
    def rate(self) -> float:
        """Simulation steps per second."""
        return RATE

    @property
    def seconds(self) -> float:
        """Simulated seconds since the world began."""
        return self.steps / RATE

    # ------------------------------------------------------------------------------------------------- sensing

    def truth(self, name: str) -> tuple[Array, Array]:
        """Return a body's rotation (3, 3) and the middle of its base (3,) in metres.

        Raises
        ------
        SkillError
            The body was removed from the world.
        """
        if name not in self.bodies:
            raise SkillError("misplaced", (name,), f"{name} is nowhere to be seen", seen=0.0)
        thing = self.bodies[name]
        position, orientation = pybullet.getBasePositionAndOrientation(thing.body, physicsClientId=self.client)
        rotation = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)
        return rotation, np.array(position) - rotation[:, 2] * center_height(thing.shape)

    def sense(self, name: str) -> tuple[Array, Array]:
        """Return a body's perceived rotation (3, 3) and base (3,): the mean of several noisy measurements.

        The result stays the same until the next simulation step. A hidden body keeps its last perceived pose in the frame of its
        carrier.

        Raises
        ------
        SkillError
            The body is not visible, and no earlier pose of the body is known.
        """
        if name in self.bodies:
            rotation, position = self.truth(name)
            if self.noise:
                if name not in self.errors or self.errors[name][0] != self.steps:
                    self.errors[name] = self.steps, self.rng.normal(0.0, self.noise, (LOOKS, 3)).mean(0)
                position = position + self.errors[name][1]
            if self.perceives(name):
                if self.remembered.get(name) != self.steps:
                    self.remember(name, rotation, position)
                return rotation, position
        if not self.knows(name):
            raise SkillError("misplaced", (name,), f"{name} is nowhere to be seen", seen=0.0)
        return self._believed(name)

    def remember(self, name: str, rotation: Array, position: Array) -> None:
        """Store a body's perceived pose in the frame of its carrier.

        With noise, if a body has not clearly moved, its stored position is only shifted a little towards the new measurement.
        """
        carrier = self.carried_by(name, position)
        frame, origin = self.carrier(carrier)
        if self.noise and name in self.known and self.known[name][0] == carrier:
            before = self._believed(name)[1]
            if float(np.linalg.norm(position - before)) < STEADY * self.blur:
                position = before + (position - before) / LOOKS
        self.known[name] = carrier, frame.T @ rotation, frame.T @ (position - origin)
        self.remembered[name] = self.steps

    def sight(self) -> Sight:
        """Return the observations of the cameras, and forget the poses of bodies that are gone according to the cameras."""
        if self.sighted is None or self.sighted[0] != self.steps:
            self.sighted = self.steps, Sight()
            poses = {name: self._believed(name) for name in self.known}
            things = [
                Sought(name, *self._thing(name), poses.get(name)) for name in dict.fromkeys((*self.bodies, *poses))
            ]
            found = look(self.client, self._cameras(), things)
            for name in found.gone:
                del self.known[name]
            self.sighted = self.steps, found
        return self.sighted[1]

    def look_again(self) -> None:
        """Drop what was seen in this simulation step, after bodies have been moved without a step."""
        self.sighted = None
        self.remembered.clear()

    def _thing(self, name: str) -> tuple[int, Shape, tuple[Array, Array] | None]:
        thing = self.bodies.get(name)
        if thing is None:
            return -1, self.embodiment.bodies[name].shape, None
        return thing.body, thing.shape, self.truth(name)

    def _believed(self, name: str) -> tuple[Array, Array]:
        carrier, turned, base = self.known[name]
        frame, origin = self.carrier(carrier)
        return frame @ turned, origin + frame @ base

    def _cameras(self) -> Array:
        """Return the positions (n, 3) of the scene's cameras, or by default of two cameras over the shoulders of each robot."""
        if self.embodiment.cameras:
            return np.array(self.embodiment.cameras)
        found = []
        for robot in self.embodiment.robots:
            yaw = float(self.bases[robot.name].pose()[2]) if robot.name in self.bases else robot.yaw
            shoulders = np.array([self.hands[hand.name].arm.shoulder for hand in robot.hands])
            found.append(over_the_shoulders(shoulders, yaw))
        return np.concatenate(found)

    def perceives(self, name: str) -> bool:
        """Return whether a body is seen by a camera or felt in a hand."""
        return name in self.bodies and (
            name in self.sight().seen or any(self.held(hand) == name for hand in self.hands)
        )

    def knows(self, name: str) -> bool:
        """Return whether a body is perceived now, or an earlier pose of the body is known."""
        self.sight()
        return name in self.known or self.perceives(name)

    @property
    def blur(self) -> float:
        """Standard deviation in metres of the positions that `sense` returns."""
        return self.noise / float(np.sqrt(LOOKS))

    def look(self, before: int = 0) -> None:
        """Draw new random errors of perception.

        The error of a mechanism holds until the next look, and the error of a body until the next simulation step. An error is the
        mean of several measurements. If the world is unchanged since `before` earlier looks, the error is the mean over these looks
        and the new look.
        """
        seen = {name: error for name, (steps, error) in self.errors.items() if before and steps == self.steps}
        self.errors.clear()
        if self.noise:
            for mechanic in self.mechanics:
                self.shifts[mechanic.body] = self._mean(before, self.shift(mechanic))
            self.errors = {name: (self.steps, self._mean(before, error)) for name, error in seen.items()}

    def _mean(self, before: int, error: Array) -> Array:
        """Return the mean of a new random error and `before` earlier errors, whose mean is `error`."""
        seen = self.rng.normal(0.0, self.noise, (LOOKS, 3)).mean(0)
        mean: Array = (before * error + seen) / (before + 1)
        return mean

    def shift(self, mechanic: Mechanic) -> Array:
        """Return the error (3,) of a mechanism's perceived position."""
        return self.shifts.get(mechanic.body, np.zeros(3))

    def carrier(self, name: str, sensed: bool = False) -> tuple[Array, Array]:
        """Return the true or, with `sensed`, perceived frame of a link or body with places; an empty name means the world."""
        if not name:
            return np.eye(3), np.zeros(3)
        if name not in self.links:
            return self.sense(name) if sensed else self.truth(name)
        turned, origin = self.links[name].frame(name)
        return turned, origin + self.shift(self.links[name]) if sensed else origin

    def place(self, name: str, sensed: bool = False) -> Array:
        """Return a place's present position (3,), given the true or, with `sensed`, the perceived pose of its carrier."""
        place = self.embodiment.places[name]
        turned, origin = self.carrier(place.carrier, sensed)
        point: Array = origin + turned @ np.array(place.position)
        return point

    def carried_by(self, name: str, base: Array | None = None) -> str:
        """Return the link or body that carries the place nearest to a body; an empty string if no such place is near.

        `base` replaces the true position of the body.
        """
        carried = [place for place in self.embodiment.places.values() if place.carrier not in ("", name)]
        base = self.truth(name)[1] if base is None else base
        gaps = {place.name: float(np.linalg.norm(self.place(place.name) - base)) for place in carried}
        best = min(gaps, key=gaps.__getitem__, default="")
        return self.embodiment.places[best].carrier if best and gaps[best] < NEAR_PLACE else ""

    def below(self, place: str) -> tuple[str, ...]:
        """Return the carrier of a place; if it is a mechanism or link, return only its parts that aren't wholly above the place.

        The other parts, such as a board above the place, stay obstacles.
        """
        carrier, point = self.embodiment.places[place].carrier, self.place(place)
        if carrier not in self.links:
            return (carrier,) if carrier else ()
        solids = (solid for solid in self.links[carrier].solids() if solid.name == carrier)
        return tuple(solid.part or carrier for solid in solids if solid.bounds()[0][2] < point[2] + STEP_UP)

    def top(self, name: str) -> Array:
        """Return the perceived middle (3,) of a body's top, such as the mouth of a vessel."""
        rotation, base = self.sense(name)
        return base + rotation[:, 2] * height_of(self.bodies[name].shape)

    def nearest_place(self, point: Array) -> tuple[str, float]:
        """Return the place that is horizontally nearest to a point, and its distance.

        If several places are above one another, the next place below the point is returned.
        """
        points = {name: self.place(name) for name in self.embodiment.places}
        gaps = {name: float(np.hypot(*(point[:2] - where[:2]))) for name, where in points.items()}
        below = {name: float(point[2] - where[2]) for name, where in points.items()}
        best = min(
            gaps, key=lambda name: (below[name] < -NEAR_PLACE, round(gaps[name], 2), max(below[name], 0.0), gaps[name])
        )
        return best, gaps[best]

    def acting(self, roles: Mapping[str, str]) -> str:
        """Return the hand in a skill's roles, otherwise the first hand of the robot in the roles, otherwise an empty string."""
        own = (name for name, hand in self.hands.items() if hand.robot.name == roles.get("robot"))
        return roles.get("hand") or next(own, "")

    def held(self, hand: str, force: float = 1.0) -> str | None:
        """Return the body that both fingers of a hand press with at least `force` newtons, or None."""
        manipulator = self.hands[hand]
        for name, thing in self.bodies.items():
            if min(manipulator.pressing(thing.body)) >= force:
                return name
        return None

    def inside(self, vessel: str, filling: str | None = None, sensed: bool = False) -> list[Bead]:
        """Return the beads, of one filling if given, inside a vessel at the true pose or, with `sensed`, at the perceived pose."""
        shape = self.bodies[vessel].shape
        beads = [bead for bead in self.beads if filling is None or bead.filling == filling]
        if shape.kind != "vessel" or not beads:
            return []
        rotation, base = self.sense(vessel) if sensed else self.truth(vessel)
        local = (self.positions_of(beads) - base) @ rotation
        within = np.hypot(local[:, 0], local[:, 1]) < inner_radius(shape, local[:, 2]) + 0.001
        within &= (local[:, 2] > 0) & (local[:, 2] < vessel_height(shape) + 0.002)
        return [bead for bead, inside in zip(beads, within, strict=True) if inside]

    def positions_of(self, beads: Sequence[Bead]) -> Array:
        """Return the positions (n, 3) of beads."""
        get = pybullet.getBasePositionAndOrientation
        return np.array([get(bead.body, physicsClientId=self.client)[0] for bead in beads])

    def amount(self, vessel: str, filling: str) -> float:
        """Return the perceived number of servings of a filling in a vessel."""
        if not self.beads:
            return float(filling in self.contents.get(vessel, ()))
        seen = self.perceives(vessel)
        if seen or (vessel in self.bodies and (vessel, filling) not in self.last_amounts):
            inside = self.inside(vessel, filling, sensed=seen)
            self.last_amounts[vessel, filling] = len(inside) / self.embodiment.fillings[filling].serving
        return self.last_amounts.get((vessel, filling), 0.0)

    def servings(self, vessel: str) -> Fraction:
        """Return the perceived number of servings in a vessel; in a world without beads, the number that skills have counted."""
        if not self.beads:
            return Fraction(
                self.filled.get(vessel, self.embodiment.bodies[vessel].servings if self.contents.get(vessel) else 0)
            )
        return sum((Fraction(self.amount(vessel, name)) for name in self.embodiment.fillings), Fraction(0))

    def stray(self) -> int:
        """Return the number of beads outside all vessels."""
        return len(self.beads) - sum(len(self.inside(name)) for name in self.bodies)

    # ------------------------------------------------------------------------------------------------- surroundings

    def surroundings(self, mover: str, held: str | None = None, values: Mapping[str, float] | None = None) -> Obstacles:
        """Return the obstacles of a hand: furniture, perceived bodies, the robots' trunks and the other arms.

        The `held` body and the bodies that stand on it are left out. `values` replaces the joint values of some links.
        """
        solids = [box(fixture) for fixture in self.embodiment.fixtures]
        for mechanic in self.mechanics:
            solids += mechanic.solids({**mechanic.values(), **(values or {})}, self.shift(mechanic))
        load = self.load(held)
        for name, thing in self.bodies.items():
            if name not in load and self.knows(name):
                rotation, base = self.taken_along(name, values) if values else self.sense(name)
                for kind, half, middle, turned in pieces(thing.shape, name in self.containers):
                    solids.append(Solid(name, kind, np.array(half), base + rotation @ middle, rotation @ turned))
        around = Obstacles(tuple(solids))
        for name, spheres in self.standing.items():
            around = around.plus(name, spheres)
        for name, other in self.hands.items():
            if name != mover:
                arm = other.mover()  # its load is one of the bodies above
                around = around.plus(name, Spheres(arm.at(other.posture[None])[0], arm.spheres.radii))
        return around

    def taken_along(self, name: str, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the rotation and base of a body after links have moved to `values` and carried the body along."""
        rotation, base = self.sense(name)
        link = self.known[name][0]
        if link not in values:
            return rotation, base
        mechanic = self.links[link]
        before, origin = mechanic.frame(link)
        after, target = mechanic.frame(link, {**mechanic.values(), **values})
        return after @ before.T @ rotation, target + after @ before.T @ (base - origin)

    def in_hand(self, hand: Manipulator, body: str) -> tuple[Array, Array]:
        """Return the perceived rotation and base of a body in the hand's frame."""
        rotation, point = hand.frame()
        turned, base = self.sense(body)
        return rotation.T @ turned, rotation.T @ (base - point)

    def load(self, held: str | None) -> tuple[str, ...]:
        """Return the held body and the bodies that stand on it, directly or on one another; return nothing if no body is held."""
        found = [] if held is None else [held]
        for carrier in found:
            found += [name for name, (by, _, _) in self.known.items() if by == carrier and name in self.bodies]
        return tuple(found)

    def load_spheres(self, hand: Manipulator, body: str, whole: bool = False) -> Spheres:
        """Return spheres for a held body, and for the bodies that stand on it, in the hand's frame.

        Without `whole`, no sphere covers the lowest centimetres of the held body, which may touch a table.
        """
        centers, radii = [], []
        for name in self.load(body):
            rotation, base = self.in_hand(hand, name)
            shape = self.bodies[name].shape
            spheres = whole_spheres(shape) if whole else column(*outline(shape), bottom=min(0.03, height_of(shape) / 3))
            centers.append(spheres.centers @ rotation.T + base)
            radii.append(spheres.radii)
        return Spheres(np.concatenate(centers), np.concatenate(radii))

    def clear_height(self, hand: Manipulator, body: str, point: Array, least: float, most: float) -> float:
        """Return the lowest height above a point, from `least` to `most`, at which an upright load keeps the margin to obstacles.

        A load in a hole has to rise above the rim. The result is `least` if a higher load would be nearer to an obstacle, such as
        the top of a cupboard.
        """
        spheres = whole_spheres(self.bodies[body].shape)
        rises = np.arange(least, max(most, least) + STEP_UP / 2, STEP_UP)
        centers = spheres.centers + point + np.stack([0 * rises, 0 * rises, rises], -1)[:, None]
        gaps = clearances(centers, spheres.radii, self.surroundings(hand.hand.name, body)).values()
        nearest = np.min([np.full(len(rises), np.inf), *gaps], axis=0)
        clear = np.flatnonzero(nearest > MARGIN)
        return float(rises[clear[0]]) if len(clear) and nearest[: clear[0] + 1].argmin() == 0 else least
