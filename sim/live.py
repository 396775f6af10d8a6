"""A physical world with interventions, in which the executive acts (`confab.planner.acting.executive`).

Rule 1: an intervention acts on bodies: a cup that is moved leaves the hand and keeps its contents.
Rule 2: an intervention that changes an object of the running primitive stops the primitive.
Rule 3: a hand at a position without a fact, or an empty tilted hand, is brought upright and lifted before facts are observed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pybullet

from confab.planner.acting.episode import Change, Intervention
from confab.planner.acting.symbolic_world import disturbed, with_individual
from confab.planner.acting.world import INTERRUPTED
from confab.planner.plan import Step
from confab.reasoner.embodiment.values import Body, PerceiverUse
from confab.reasoner.possible import refuse_impossible
from confab.reasoner.symbols import Fact, Problem, State, Symbol
from confab.sim.bodies import KINDS, center_height
from confab.sim.engine import Engine, Thing
from confab.sim.linkage import wide
from confab.sim.perception import tilt_of
from confab.sim.skills import perform
from confab.sim.staging import pour_in
from confab.sim.urdf import Array
from confab.sim.verdict import SkillError, Verdict
from confab.sim.world import World

STOPPED = 0.02
"""Lag in radians of a joint behind its command from which on its arm counts as stopped."""

UPRIGHT = 0.1
"""Maximum tilt in radians of an upright hand."""

PAUSE = 60
"""Simulation steps after an intervention in which bodies come to rest."""


class LiveWorld:
    """A `World` with interventions.

    Parameters
    ----------
    world : World
    classes : mapping of class to individuals
        An object that an intervention adds gets the shape of an object of its class.
    problem : Problem, optional
        What an intervention would lead to is checked against it.
    """

    def __init__(self, world: World, classes: Mapping[str, Sequence[str]], problem: Problem | None = None) -> None:
        self.world, self.classes, self.problem = world, classes, problem
        self.waiting: list[Intervention] = []
        self.stopping = False
        self.concerned: set[str] = set()
        world.disturb = self._each_step

    @property
    def seconds(self) -> float:
        """Simulated seconds since the world began."""
        return self.world.seconds

    def announce(self, interventions: tuple[Intervention, ...]) -> None:
        """Schedule the interventions that have a time."""
        self.waiting = sorted((i for i in interventions if i.of_world and i.at is not None), key=lambda i: i.at or 0.0)

    def observe(self) -> State:
        """Return the facts perceived now, after bringing hands without a perceivable position upright and up."""
        seen = self.world.observe()
        lost = {s.arguments[0] for s in self.world.symbols if s not in seen and s.arguments[0] in self.world.hands}
        lost |= {name for name in self.world.hands if not self._upright(name) and self.world.held(name) is None}
        for hand in sorted(lost):
            self.retreat(hand)
        return self.world.observe() if lost else seen

    def execute(self, step: Step) -> Verdict:
        """Execute a primitive; stop it when an intervention changes one of its objects."""
        self.concerned = {*step.arguments, *step.bindings.values()}
        held = [self.world.held(hand) for hand in step.arguments if hand in self.world.hands]
        self.concerned |= {body for body in held if body is not None}
        try:
            verdict = self.world.execute(step)
        finally:
            self.concerned, self.world.moved_by_others, self.stopping = set(), set(), False
        if not verdict.ok:
            self.take_stock()
        return verdict

    def stop(self) -> None:
        """Stop the running primitive at its next simulation step."""
        self.stopping = bool(self.concerned)

    def take_stock(self) -> None:
        """Adopt the present state after a failure.

        A stopped arm is commanded to its present posture, so that it no longer presses. The present grasp of a held object becomes
        the reference for further slip.
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
        """Return why an intervention is impossible in this world at any time, or None if it is possible."""
        if intervention.change is Change.ADD and self._model_of(intervention.kind) is None:
            return f"no {intervention.kind} of this scene has a shape for {intervention.individual}"
        if intervention.change is Change.REMOVE and intervention.individual not in self.world.bodies:
            return f"{intervention.individual} is no body of this world (bodies: {', '.join(self.world.bodies)})"
        if not intervention.of_world:
            return None
        perceivers = self.world.embodiment.perceivers
        for fact in intervention.facts:
            use = perceivers.get(fact.symbol.situation)
            if use is None or use.perceiver not in DISTURBERS:
                able = [name for name, use in perceivers.items() if use.perceiver in DISTURBERS]
                return f"an intervention cannot make {fact} true; interventions change {' and '.join(able)}"
            if fact.value not in self.world.embodiment.places and DISTURBERS[use.perceiver] is move:
                places = ", ".join(self.world.embodiment.places)
                return (
                    f"{fact.symbol.arguments[0]} can't be put at '{fact.value}', which is no place (places: {places})"
                )
        return None

    def disturb(self, intervention: Intervention) -> None:
        """Apply an intervention now, and let the bodies come to rest."""
        self._interfere(intervention)
        self.world.run(PAUSE)

    def retreat(self, hand: str) -> None:
        """Bring a hand with a load upright and up, or an empty one home, as far as that is possible."""
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

    # ------------------------------------------------------------------------------------------------- interventions

    def _each_step(self, world: Engine) -> None:
        if self.stopping:
            self.stopping = False
            raise SkillError(INTERRUPTED, tuple(sorted(self.concerned)), "it was stopped")
        happened = False
        while self.waiting and (self.waiting[0].at or 0.0) <= world.seconds:
            intervention = self.waiting.pop(0)
            self._interfere(intervention)
            named = _named(intervention)
            self.world.moved_by_others = self.world.moved_by_others | named  # the hand didn't disturb these
            happened = happened or not named.isdisjoint(self.concerned)
        if happened:
            raise SkillError(INTERRUPTED, tuple(sorted(self.concerned)), "an intervention changed an object of it")

    def _interfere(self, intervention: Intervention) -> None:
        if self.problem is not None:
            if intervention.change is Change.ADD:
                self.problem = with_individual(self.problem, intervention.individual, intervention.kind)
            now = self.world.observe()
            refuse_impossible(
                self.problem, now, disturbed(self.problem, now, intervention), f"'{intervention.text}' can't happen"
            )
        if intervention.change is Change.REMOVE:
            take_away(self.world, intervention.individual)
        elif intervention.change is Change.ADD:
            self._add(intervention)
        else:
            for fact in intervention.facts:
                if fact.symbol.arguments[0] in (*self.world.bodies, *self.world.links):  # else it has been removed
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
        """Return the body of the first object of a class that has a shape, or None."""
        bodies = self.world.embodiment.bodies
        return next((bodies[one] for one in self.classes.get(kind, ()) if one in bodies), None)


def _named(intervention: Intervention) -> set[str]:
    """Return the individuals that an intervention names: the changed ones and their new values."""
    named = {intervention.individual, *(fact.symbol.arguments[0] for fact in intervention.facts)}
    return named | {fact.value for fact in intervention.facts}


def move(world: World, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Put an object with its contents at a place; a hand that holds it opens."""
    name = symbol.arguments[0]
    for hand in world.hands:
        if world.held(hand) == name:
            world.hands[hand].open()
    beads = world.inside(name)
    rotation, base = world.truth(name)
    inside = [(point - base) @ rotation for point in world.positions_of(beads)]
    place = world.place(value)
    thing = world.bodies[name]
    _set(world, thing.body, np.array([*place[:2], place[2] + center_height(thing.shape)]))
    for bead, local in zip(beads, inside, strict=True):
        _set(world, bead.body, place + local)


def fill(world: World, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Empty a vessel, and fill it with the value unless that is `empty`."""
    for bead in world.inside(symbol.arguments[0]):
        pybullet.removeBody(bead.body, physicsClientId=world.client)
        world.beads.remove(bead)
    if value != use.values.get("empty"):
        pour_in(world, symbol.arguments[0], value, world.perturb)


def push_joint(world: World, use: PerceiverUse, symbol: Symbol, value: str) -> None:
    """Open or shut a link with the bodies that it carries; a hand that holds the link opens."""
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
    """Remove an object and its contents from the world, if it is still there."""
    if name not in world.bodies:
        return
    for bead in world.inside(name):
        pybullet.removeBody(bead.body, physicsClientId=world.client)
        world.beads.remove(bead)
    for hand in world.hands:
        if world.held(hand) == name:
            world.hands[hand].open()
    thing = world.bodies.pop(name)
    del world.names[thing.body]
    pybullet.removeBody(thing.body, physicsClientId=world.client)


def _set(world: World, body: int, position: Array) -> None:
    pybullet.resetBasePositionAndOrientation(body, position.tolist(), [0, 0, 0, 1], physicsClientId=world.client)
    pybullet.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0], physicsClientId=world.client)


DISTURBERS: Mapping[str, Callable[[World, PerceiverUse, Symbol, str], None]] = {
    "perceive_place": move,
    "perceive_content": fill,
    "perceive_joint": push_joint,
}
"""By perceiver: the function that makes a value of its situation types true."""
