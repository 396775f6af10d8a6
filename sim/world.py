"""The physical world: bodies under contact and friction, hands driven by motors, facts perceived from what is there.

Rule 1: time is counted in steps of ``1 / RATE`` seconds, and every loop has a bound in steps.
Rule 2: after the world is built nothing is set but motor targets; only planted faults may interfere (`sim.faults`).
Rule 3: every random number comes from `World.rng`, so the same arguments give the same world, bit by bit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol

import numpy as np
import pybullet

from reasoner.embodiment.values import Embodiment, Fixture, Shape
from reasoner.symbols import State, Symbol
from sim.bodies import KINDS, center_height, height_of, inner_radius, outer_radius, outline, packed, vessel_height
from sim.collision import Solid, Surroundings, box, column
from sim.perception import Draft, perceiver
from sim.robot import Manipulator, load
from sim.skills import skill
from sim.urdf import Array, Spheres
from sim.verdict import SkillError, Verdict

RATE = 240.0
"""Simulation steps per second."""

SETTLING = 120
"""Steps in which bodies and beads come to rest before anything is done."""

SPECK = [[0.0, 0.0, 0.0], [1e-5, 0.0, 0.0], [0.0, 1e-5, 0.0]]
"""A triangle too small to see: `sim.picture` draws the beads, PyBullet would draw them at great cost."""

LAG = 0.08
"""Radians that a joint may stay behind its command."""


class Step(Protocol):
    """A primitive of a plan, as `planner.plan.Step` is one."""

    @property
    def path(self) -> tuple[int, ...]:
        """Position in the plan's tree."""

    @property
    def id(self) -> int:
        """Number of the quantified behaviour."""

    @property
    def behavior(self) -> str:
        """Name of the behaviour."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """Individuals of the parameters, in order."""

    @property
    def bindings(self) -> Mapping[str, str]:
        """Individuals of the determined variables."""


@dataclass(frozen=True)
class Perturbation:
    """How a rollout may differ from the nominal world: each range is drawn from evenly, per body."""

    position: float = 0.010
    yaw: float = np.pi
    friction: tuple[float, float] = (0.6, 1.2)
    mass: tuple[float, float] = (0.7, 1.3)
    fill: tuple[float, float] = (0.95, 1.1)


@dataclass(frozen=True)
class Thing:
    """An object in the world: its PyBullet body and its shape, as perturbed."""

    body: int
    shape: Shape


@dataclass(frozen=True)
class Bead:
    """A drop of a beverage."""

    body: int
    filling: str


@dataclass
class Clock:
    """CPU seconds by what they were spent on."""

    planning: float = 0.0
    stepping: float = 0.0
    rendering: float = 0.0


class World:
    """A physics world with the objects of a scene; close it, or use it in a ``with`` statement.

    Parameters
    ----------
    embodiment : Embodiment
        Robots, furniture, places, shapes, skills and perceivers.
    initial : State
        Facts that the world is set up with, those of situation types that have a perceiver.
    seed : int
        Of everything random: perturbation, sampling in motion planning, sensor noise.
    perturb : Perturbation, optional
        Vary poses, friction, masses and fill.
    beads : bool
        False leaves the beverage out: faster, but nothing can be poured, so contents are taken from `initial` for ever.
    noise : float
        Standard deviation in metres of perceived positions.
    watch : callable, optional
        Called with the world after every step of the simulation, for filming.
    gui : bool
        Open PyBullet's window (`sim.screen.require_screen` first: where there is no screen PyBullet ends the process).
    """

    def __init__(
        self,
        embodiment: Embodiment,
        initial: State,
        seed: int = 0,
        perturb: Perturbation | None = None,
        beads: bool = True,
        noise: float = 0.0,
        watch: Callable[[World], None] | None = None,
        gui: bool = False,
    ) -> None:
        self.embodiment, self.symbols = embodiment, [s for s in initial if s.situation in embodiment.perceivers]
        self.rng = np.random.default_rng(seed)
        self.perturb, self.noise, self.gui = perturb, noise, gui
        self.watch: Callable[[World], None] | None = None
        self.steps, self.current, self.clock = 0, -1, Clock()
        self.bodies: dict[str, Thing] = {}
        self.beads: list[Bead] = []
        self.spilled: set[int] = set()
        self.elsewhere: set[str] = set()  # bodies that other hands see to, while one hand is at work
        self.disturb: Callable[[World], None] | None = None
        self.client = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("PyBullet could not start a physics server")
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / RATE,
            numSolverIterations=50,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )
        self.names: dict[int, str] = {}
        for fixture in embodiment.fixtures:
            self.names[_make_fixture(self.client, fixture)] = fixture.name
        self.hands: dict[str, Manipulator] = {}
        self.standing: dict[str, Spheres] = {}
        for robot in embodiment.robots:
            number, hands, still = load(self.client, robot)
            self.names[number], self.standing[robot.name] = robot.name, still
            self.hands |= {hand.hand.name: hand for hand in hands}
        self._fill(self._draft(initial), beads)
        self.run(SETTLING)
        self._doze()
        self.steps, self.watch = 0, watch

    def __enter__(self) -> World:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the physics server."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    # ------------------------------------------------------------------------------------------------- setting up

    def _draft(self, initial: State) -> Draft:
        """Collect what the facts say about where things are."""
        draft = Draft()
        for symbol in self.symbols:
            use = self.embodiment.perceivers[symbol.situation]
            perceiver(use.perceiver).arrange(draft, use, symbol.arguments, initial[symbol])
        return draft

    def _fill(self, draft: Draft, beads: bool) -> None:
        for name, place in draft.places.items():
            if place not in self.embodiment.places:
                raise ValueError(
                    f"'{place}', where {name} is, has no position (places: {', '.join(self.embodiment.places)})"
                )
            if name not in self.embodiment.bodies:
                raise ValueError(f"object '{name}' has no shape: give its class one")
            shape, position, yaw = self._vary(self.embodiment.bodies[name].shape, place)
            orientation = np.array([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
            body = KINDS[shape.kind].make(self.client, shape, position, orientation)
            self.names[body] = name
            self.bodies[name] = Thing(body, shape)
        self.contents = {name: list(fillings) for name, fillings in draft.contents.items()}
        if beads:
            for name, filling in ((name, filling) for name, all_in in draft.contents.items() for filling in all_in):
                self._pour_in(name, filling)

    def _vary(self, shape: Shape, place: str) -> tuple[Shape, Array, float]:
        """Return shape, position and yaw of a body at a place, perturbed if that is wanted."""
        position, yaw = np.array(self.embodiment.places[place].position), 0.0
        if self.perturb is not None:
            limit = self.perturb.position
            position[:2] += self.rng.uniform(-limit, limit, 2)
            yaw = float(self.rng.uniform(-self.perturb.yaw, self.perturb.yaw))
            friction, mass = self.rng.uniform(*self.perturb.friction), self.rng.uniform(*self.perturb.mass)
            shape = Shape(
                shape.kind,
                shape.mass * mass,
                shape.grasp_height,
                shape.profile,
                shape.numbers,
                shape.color,
                shape.friction * friction,
            )
        return shape, position, yaw

    def _pour_in(self, name: str, filling: str) -> None:
        """Let a vessel's beads go just above its bottom; PyBullet shows them only in a window."""
        kind = self.embodiment.fillings[filling]
        share = 1.0 if self.perturb is None else float(self.rng.uniform(*self.perturb.fill))
        count = round(kind.serving * self.embodiment.bodies[name].servings * share)
        rotation, base = self.truth(name)
        collision = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=kind.radius, physicsClientId=self.client)
        look: dict[str, Any] = {"shapeType": pybullet.GEOM_MESH, "vertices": SPECK, "indices": [0, 1, 2]}
        if self.gui:
            look = {"shapeType": pybullet.GEOM_SPHERE, "radius": kind.radius, "rgbaColor": kind.color}
        speck = pybullet.createVisualShape(**look, physicsClientId=self.client)
        for spot in packed(self.bodies[name].shape, count, kind.radius):
            bead = pybullet.createMultiBody(
                kind.mass,
                collision,
                speck,
                basePosition=(base + rotation @ spot).tolist(),
                useMaximalCoordinates=True,
                physicsClientId=self.client,
            )
            pybullet.changeDynamics(
                bead,
                -1,
                lateralFriction=kind.friction,
                restitution=0.0,
                linearDamping=0.02,
                angularDamping=0.5,
                physicsClientId=self.client,
            )
            self.beads.append(Bead(bead, filling))

    def _doze(self) -> None:
        """Let what has come to rest sleep until something touches it: beads at rest cost nothing then."""
        for body in [*[thing.body for thing in self.bodies.values()], *[bead.body for bead in self.beads]]:
            for state in (pybullet.ACTIVATION_STATE_ENABLE_SLEEPING, pybullet.ACTIVATION_STATE_SLEEP):
                pybullet.changeDynamics(body, -1, activationState=state, physicsClientId=self.client)

    # ------------------------------------------------------------------------------------------------- stepping

    def run(self, steps: int) -> None:
        """Simulate a number of steps with the motors' targets as they are."""
        begin, rendering = time.process_time(), self.clock.rendering
        hands = [hand for hand in self.hands.values() if hand.closing]
        for _ in range(steps):
            for hand in hands:
                hand.drive()
            pybullet.stepSimulation(physicsClientId=self.client)
            self.steps += 1
            if self.disturb is not None:
                self.disturb(self)
            if self.watch is not None:
                self.watch(self)
        self.clock.stepping += time.process_time() - begin - (self.clock.rendering - rendering)

    def follow(self, hand: Manipulator, positions: Array, velocities: Array) -> None:
        """Drive an arm along timed postures; raise `SkillError` if it stays behind its command."""
        for i, (q, v) in enumerate(zip(positions, velocities, strict=True)):
            hand.command(q, v)
            self.run(1)
            if i % 6 == 5:
                self.check_course(hand)
        hand.command(positions[-1])
        self.run(6)
        self.check_course(hand)

    def check_course(self, hand: Manipulator) -> None:
        """Raise `SkillError` if the skill's time is over, or if a joint is too far from its command.

        The latter names what the arm touches, else the hand.
        """
        if self.steps > hand.deadline:
            raise SkillError("too slow", (hand.hand.name,), seconds=hand.limit)
        lag = float(np.abs(hand.measured() - hand.posture).max())
        if lag > LAG:
            raise SkillError("tracking error", self.touching(hand) or (hand.hand.name,), joint_lag_rad=lag)

    def touching(self, hand: Manipulator) -> tuple[str, ...]:
        """Return what a hand's robot, or a body that it touches or holds, is in contact with, the held one excepted."""
        held = self.held(hand.hand.name)
        around = self._contacts(hand.body)
        if held is not None:
            around.add(held)
        furniture = {fixture.name for fixture in self.embodiment.fixtures}
        for name in sorted(around & self.bodies.keys()):
            around |= self._contacts(self.bodies[name].body) - furniture
        return tuple(sorted(around - {held, hand.robot.name}))

    def _contacts(self, body: int) -> set[str]:
        """Return what presses against a body."""
        found = pybullet.getContactPoints(body, physicsClientId=self.client)
        return {self.names[c[2]] for c in found if c[9] > 0.5 and c[2] != body and c[2] in self.names}

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
        """Return where a body is: its rotation (3, 3) and the middle of its base (3,) in metres.

        Raises
        ------
        SkillError
            The world has no such body any more.
        """
        if name not in self.bodies:
            raise SkillError("misplaced", (name,), f"{name} is nowhere to be seen", seen=0.0)
        thing = self.bodies[name]
        position, orientation = pybullet.getBasePositionAndOrientation(thing.body, physicsClientId=self.client)
        rotation = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)
        return rotation, np.array(position) - rotation[:, 2] * center_height(thing.shape)

    def sense(self, name: str) -> tuple[Array, Array]:
        """Return a body's rotation and base as the robot perceives them, noise included."""
        rotation, position = self.truth(name)
        if self.noise:
            position = position + self.rng.normal(0.0, self.noise, 3)
        return rotation, position

    def reading(self, name: str) -> Array:
        """Return a body's perceived position."""
        return self.sense(name)[1]

    def top(self, name: str) -> Array:
        """Return the middle of a body's perceived top: of a vessel, its mouth."""
        rotation, base = self.sense(name)
        return base + rotation[:, 2] * height_of(self.bodies[name].shape)

    def nearest_place(self, point: Array) -> tuple[str, float]:
        """Return the place that is horizontally nearest to a point, and its distance."""
        gaps = {n: float(np.hypot(*(point[:2] - place.position[:2]))) for n, place in self.embodiment.places.items()}
        name = min(gaps, key=gaps.__getitem__)
        return name, gaps[name]

    def held(self, hand: str, force: float = 1.0) -> str | None:
        """Return the body that both fingers of a hand press with at least `force` newtons."""
        manipulator = self.hands[hand]
        for name, thing in self.bodies.items():
            if min(manipulator.pressing(thing.body)) >= force:
                return name
        return None

    def inside(self, vessel: str, filling: str | None = None, sensed: bool = False) -> int:
        """Return how many beads, of one filling or of all, are inside a vessel, where that is or is `sensed`."""
        shape = self.bodies[vessel].shape
        beads = [bead for bead in self.beads if filling is None or bead.filling == filling]
        if shape.kind != "vessel" or not beads:
            return 0
        rotation, base = self.sense(vessel) if sensed else self.truth(vessel)
        local = (self._places_of(beads) - base) @ rotation
        within = np.hypot(local[:, 0], local[:, 1]) < inner_radius(shape, local[:, 2]) + 0.001
        return int(np.sum(within & (local[:, 2] > 0) & (local[:, 2] < vessel_height(shape) + 0.002)))

    def _places_of(self, beads: Sequence[Bead]) -> Array:
        get = pybullet.getBasePositionAndOrientation
        return np.array([get(bead.body, physicsClientId=self.client)[0] for bead in beads])

    def amount(self, vessel: str, filling: str) -> float:
        """Return how many servings of a filling a vessel contains, as the robot perceives it."""
        if not self.beads:
            return float(filling in self.contents.get(vessel, ()))
        return self.inside(vessel, filling, sensed=True) / self.embodiment.fillings[filling].serving

    def stray(self) -> int:
        """Return how many beads are in no vessel."""
        return len(self.beads) - sum(self.inside(name) for name in self.bodies)

    # ------------------------------------------------------------------------------------------------- surroundings

    def surroundings(self, mover: str, held: str | None = None) -> Surroundings:
        """Return what a hand must not touch: furniture, bodies as perceived, the robots' trunks and other arms."""
        solids = [box(fixture) for fixture in self.embodiment.fixtures]
        for name, thing in self.bodies.items():
            if name != held:
                rotation, base = self.sense(name)
                half = height_of(thing.shape) / 2
                radius = outer_radius(thing.shape)
                size, center = np.array([radius, radius, half]), base + rotation[:, 2] * half
                solids.append(Solid(name, "cylinder", size, center, rotation))
        around = Surroundings(tuple(solids))
        for name, spheres in self.standing.items():
            around = around.plus(name, spheres)
        for name, other in self.hands.items():
            if name != mover:
                arm = other.mover()
                load = self.held(name)
                if load is not None:
                    arm = arm.holding(self.load_spheres(other, load))
                around = around.plus(name, Spheres(arm.at(other.posture[None])[0], arm.spheres.radii))
        return around

    def in_hand(self, hand: Manipulator, body: str) -> tuple[Array, Array]:
        """Return a body's rotation and base in the hand's frame."""
        rotation, point = hand.frame()
        turned, base = self.sense(body)
        return rotation.T @ turned, rotation.T @ (base - point)

    def load_spheres(self, hand: Manipulator, body: str) -> Spheres:
        """Return spheres for a held body in the hand's frame; its lowest centimetres, which may touch the table, left out."""
        shape = self.bodies[body].shape
        rotation, base = self.in_hand(hand, body)
        spheres = column(*outline(shape), bottom=min(0.03, height_of(shape) / 3))
        return Spheres(spheres.centers @ rotation.T + base, spheres.radii)

    # ------------------------------------------------------------------------------------------------- the two doors

    def observe(self) -> State:
        """Return the facts that are perceived now; a symbol of which nothing can be perceived is left out."""
        state: dict[Symbol, str] = {}
        for symbol in self.symbols:
            use = self.embodiment.perceivers[symbol.situation]
            value = perceiver(use.perceiver).observe(self, use, symbol.arguments)
            if value is not None:
                state[symbol] = value
        return state

    def execute(self, step: Step) -> Verdict:
        """Let the robot carry out a primitive; return whether its postcondition holds in the world.

        Raises
        ------
        KeyError
            No skill executes the behaviour; the message names it.
        """
        if step.behavior not in self.embodiment.skills:
            raise KeyError(
                f"behaviour '{step.behavior}' names no skill (those that do: {', '.join(self.embodiment.skills)})"
            )
        use = self.embodiment.skills[step.behavior]
        roles = dict(zip(use.parameters, step.arguments, strict=True))
        bound = {name.lstrip("?"): value for name, value in step.bindings.items()}
        roles |= {role: bound[name] for name, role in use.variables.items() if name in bound}
        self.current += 1
        hand = self.hands.get(roles.get("hand", ""))
        if hand is not None:
            hand.limit = use.numbers.get("time_limit", math.inf)
            hand.deadline = self.steps + hand.limit * RATE
        try:
            measured = skill(use.skill)(self, roles, use.numbers)
        except SkillError as failure:
            return failure.verdict
        finally:
            if hand is not None:
                hand.deadline = math.inf
        return Verdict(True, measured=measured)


def _make_fixture(client: int, fixture: Fixture) -> int:
    """Make a piece of furniture that does not move."""
    half = [extent / 2 for extent in fixture.size]
    body = pybullet.createMultiBody(
        0,
        pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client),
        pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=half,
            rgbaColor=fixture.color,
            specularColor=[0.1, 0.1, 0.1],
            physicsClientId=client,
        ),
        basePosition=fixture.position,
        baseOrientation=pybullet.getQuaternionFromEuler([0, 0, fixture.yaw]),
        physicsClientId=client,
    )
    pybullet.changeDynamics(body, -1, lateralFriction=fixture.friction, physicsClientId=client)
    return int(body)
