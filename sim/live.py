"""A physical world in which people interfere: the world that the executive acts in (`planner.acting.executive`).

Rule 1: an intervention acts on bodies: a cup that is moved is taken out of the hand, and what is in it goes with it.
Rule 2: a primitive is stopped where it is as soon as something happens to what it concerns.
Rule 3: a hand that stands where no fact names its position, or is empty and lies on its side, stands upright and is lifted
before anything is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pybullet

from planner.acting.episode import Change, Intervention
from planner.plan import Step
from reasoner.embodiment.values import Body, PerceiverUse
from reasoner.symbols import Fact, State, Symbol
from sim.bodies import KINDS, center_height, inner_radius, vessel_height
from sim.engine import Bead, Engine, Thing
from sim.linkage import wide
from sim.perception import tilt_of
from sim.skills import perform
from sim.staging import pour_in
from sim.urdf import Array
from sim.verdict import SkillError, Verdict
from sim.world import World

STOPPED = 0.02
"""Radians by which a joint stays behind its command if something stops it."""

UPRIGHT = 0.1
"""Radians by which a hand that stands upright may be tilted."""

PAUSE = 60
"""Simulation steps in which what was moved comes to rest."""


class LiveWorld:
    """A `World` that can be disturbed.

    Parameters
    ----------
    world : World
    classes : mapping of class to individuals
        To give an object that is added the shape of one of its class.
    """

    def __init__(self, world: World, classes: Mapping[str, Sequence[str]]) -> None:
        self.world, self.classes = world, classes
        self.waiting: list[Intervention] = []
        self.concerned: set[str] = set()
        world.disturb = self._each_step

    @property
    def seconds(self) -> float:
        """Simulated seconds since the world began."""
        return self.world.seconds

    def announce(self, interventions: tuple[Intervention, ...]) -> None:
        """Take note of what shall happen at a time."""
        self.waiting = sorted((i for i in interventions if i.of_world and i.at is not None), key=lambda i: i.at or 0.0)

    def observe(self) -> State:
        """Return the facts that are perceived now."""
        seen = self.world.observe()
        lost = {s.arguments[0] for s in self.world.symbols if s not in seen and s.arguments[0] in self.world.hands}
        lost |= {name for name in self.world.hands if not self._upright(name) and self.world.held(name) is None}
        for hand in sorted(lost):
            self.retreat(hand)
        return self.world.observe() if lost else seen

    def execute(self, step: Step) -> Verdict:
        """Carry out a primitive, or stop it when something happens to what it concerns."""
        self.concerned = {*step.arguments, *step.bindings.values()}
        held = [self.world.held(hand) for hand in step.arguments if hand in self.world.hands]
        self.concerned |= {body for body in held if body is not None}
        try:
            verdict = self.world.execute(step)
        finally:
            self.concerned, self.world.elsewhere = set(), set()
        if not verdict.ok:
            self.take_stock()
        return verdict

    def take_stock(self) -> None:
        """After a failure, begin from how things are.

        An arm that something stopped no longer presses against it, and what slipped in a hand is held the way it is now: the next
        primitive asks if it slips further.
        """
        stopped = [h for h in self.world.hands.values() if float(np.abs(h.measured() - h.posture).max()) > STOPPED]
        for hand in stopped:
            hand.command(hand.measured())
        if stopped:
            self.world.run(PAUSE)
        for name, hand in self.world.hands.items():
            held = self.world.held(name)
            if held is not None and hand.grasp is not None:
                hand.grasp = self.world.in_hand(hand, held)

    def impossible(self, intervention: Intervention) -> str | None:
        """Return why an intervention can't happen in this world, whenever that is; None if it can."""
        if intervention.change is Change.ADD and self._model_of(intervention.kind) is None:
            return f"no {intervention.kind} of this scene has a shape that {intervention.individual} could take"
        if intervention.change is Change.REMOVE and intervention.individual not in self.world.bodies:
            return f"{intervention.individual} is no body on the table (those are {', '.join(self.world.bodies)})"
        if not intervention.of_world:
            return None
        perceivers = self.world.embodiment.perceivers
        for fact in intervention.facts:
            use = perceivers.get(fact.symbol.situation)
            if use is None or use.perceiver not in DISTURBERS:
                able = [name for name, use in perceivers.items() if use.perceiver in DISTURBERS]
                return f"nobody can make {fact} true by hand; people change {' and '.join(able)}"
            if fact.value not in self.world.embodiment.places and DISTURBERS[use.perceiver] is move:
                places = ", ".join(self.world.embodiment.places)
                return (
                    f"{fact.symbol.arguments[0]} can't be put at '{fact.value}', which is no place (those are {places})"
                )
        return None

    def disturb(self, intervention: Intervention) -> None:
        """Let an intervention happen now, and what it moved come to rest."""
        self._interfere(intervention)
        self.world.run(PAUSE)

    def retreat(self, hand: str) -> None:
        """Bring a hand with a load upright and up, as far as that is possible, and an empty one home by whatever way there is."""
        uses = {use.skill: use for use in self.world.embodiment.skills.values()}
        loaded = self.world.held(hand) is not None
        for name in ("lift",) if self._upright(hand) or not loaded else ("stand_upright", "lift"):
            use = uses.get(name)
            if use is None:
                continue
            homewards = tuple(phase for phase in use.phases if phase.motion == "home" and not loaded)
            try:
                perform(self.world, replace(use, phases=homewards or use.phases), {"hand": hand})
            except SkillError:
                return

    def _upright(self, hand: str) -> bool:
        return tilt_of(self.world.hands[hand].frame()[0]) < UPRIGHT

    # ------------------------------------------------------------------------------------------------- interfering

    def _each_step(self, world: Engine) -> None:
        happened = False
        while self.waiting and (self.waiting[0].at or 0.0) <= world.seconds:
            intervention = self.waiting.pop(0)
            self._interfere(intervention)
            self.world.elsewhere = self.world.elsewhere | _named(intervention)  # the hand isn't to blame for that
            happened = happened or not _named(intervention).isdisjoint(self.concerned)
        if happened:
            raise SkillError("interrupted", tuple(sorted(self.concerned)), "somebody interfered with what it concerns")

    def _interfere(self, intervention: Intervention) -> None:
        if intervention.change is Change.REMOVE:
            take_away(self.world, intervention.individual)
        elif intervention.change is Change.ADD:
            self._add(intervention)
        else:
            for fact in intervention.facts:
                if fact.symbol.arguments[0] in (
                    *self.world.bodies,
                    *self.world.links,
                ):  # else somebody has taken it away
                    self._make_true(fact)

    def _make_true(self, fact: Fact) -> None:
        use = self.world.embodiment.perceivers[fact.symbol.situation]
        DISTURBERS[use.perceiver](self.world, use, fact.symbol, fact.value)

    def _add(self, intervention: Intervention) -> None:
        world, name = self.world, intervention.individual
        model = self._model_of(intervention.kind)
        if model is None:
            raise ValueError(f"{name} has no shape")
        bodies = {**world.embodiment.bodies, name: replace(model, name=name)}
        world.embodiment = replace(world.embodiment, bodies=bodies)
        somewhere, upright = np.array([0.0, 0.0, -5.0]), np.array([0.0, 0.0, 0.0, 1.0])
        body = KINDS[model.shape.kind].make(world.client, model.shape, somewhere, upright)
        world.names[body], world.bodies[name] = name, Thing(body, model.shape)
        world.symbols = [*world.symbols, *(fact.symbol for fact in intervention.facts)]
        for fact in intervention.facts:
            self._make_true(fact)

    def _model_of(self, kind: str) -> Body | None:
        """Return what an object of a class looks like: the first of this scene that has a shape."""
        bodies = self.world.embodiment.bodies
        return next((bodies[one] for one in self.classes.get(kind, ()) if one in bodies), None)


def _named(intervention: Intervention) -> set[str]:
    """Return what an intervention names: what is moved or changed, and what it becomes."""
    named = {intervention.individual, *(fact.symbol.arguments[0] for fact in intervention.facts)}
    return named | {fact.value for fact in intervention.facts}


def move(world: World, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Put an object, and what is in it, at a place; a hand that holds it lets it go."""
    name = symbol.arguments[0]
    for hand in world.hands:
        if world.held(hand) == name:
            world.hands[hand].open()
    beads = contents(world, name)
    rotation, base = world.truth(name)
    inside = [(world_position(world, bead) - base) @ rotation for bead in beads]
    place = world.place(value)
    thing = world.bodies[name]
    _set(world, thing.body, np.array([*place[:2], place[2] + center_height(thing.shape)]))
    for bead, local in zip(beads, inside, strict=True):
        _set(world, bead.body, place + local)


def fill(world: World, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Empty a vessel, and fill it with something else unless that is nothing."""
    for bead in contents(world, symbol.arguments[0]):
        pybullet.removeBody(bead.body, physicsClientId=world.client)
        world.beads.remove(bead)
    if value != use.values.get("empty"):
        pour_in(world, symbol.arguments[0], value, world.perturb)


def push_joint(world: World, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Open or shut a link with what it carries; a hand that holds it lets it go."""
    name = symbol.arguments[0]
    mechanic = world.links[name]
    for hand in world.hands.values():
        if min(hand.pressing(mechanic.body, mechanic.joints[name])) > 0:
            hand.open()
    opened = value == use.values.get("opened", "true")
    goal = {name: wide(mechanic.link(name)) if opened else 0.0}
    frame, origin = mechanic.frame(name)
    along = {body: frame.T @ (world.truth(body)[1] - origin) for body in world.bodies if world.carried_by(body) == name}
    mechanic.set(name, opened)
    frame, origin = mechanic.frame(name, {**mechanic.values(), **goal})
    for body, local in along.items():
        thing, base = world.bodies[body], origin + frame @ local
        _set(world, thing.body, base + np.array([0.0, 0.0, center_height(thing.shape)]))


def take_away(world: World, name: str) -> None:
    """Take an object, and what is in it, out of the world, unless somebody was faster."""
    if name not in world.bodies:
        return
    for bead in contents(world, name):
        pybullet.removeBody(bead.body, physicsClientId=world.client)
        world.beads.remove(bead)
    for hand in world.hands:
        if world.held(hand) == name:
            world.hands[hand].open()
    thing = world.bodies.pop(name)
    del world.names[thing.body]
    pybullet.removeBody(thing.body, physicsClientId=world.client)


def contents(world: World, vessel: str) -> list[Bead]:
    """Return the beads inside a vessel."""
    shape = world.bodies[vessel].shape
    if shape.kind != "vessel" or not world.beads:
        return []
    rotation, base = world.truth(vessel)
    local = (np.array([world_position(world, bead) for bead in world.beads]) - base) @ rotation
    within = np.hypot(local[:, 0], local[:, 1]) < inner_radius(shape, local[:, 2]) + 0.001
    within &= (local[:, 2] > 0) & (local[:, 2] < vessel_height(shape) + 0.002)
    return [bead for bead, inside in zip(world.beads, within, strict=True) if inside]


def world_position(world: World, bead: Bead) -> Array:
    """Return where a bead is."""
    return np.array(pybullet.getBasePositionAndOrientation(bead.body, physicsClientId=world.client)[0])


def _set(world: World, body: int, position: Array) -> None:
    pybullet.resetBasePositionAndOrientation(body, position.tolist(), [0, 0, 0, 1], physicsClientId=world.client)
    pybullet.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0], physicsClientId=world.client)


DISTURBERS: Mapping[str, Callable[[World, PerceiverUse, Symbol, str], None]] = {
    "perceive_place": move,
    "perceive_content": fill,
    "perceive_joint": push_joint,
}
"""By the perceiver that reads a situation type off the world: how a person makes a value true."""
