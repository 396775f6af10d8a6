"""A physical world with interventions, in which the executive acts (`confab.planner.acting.executive`).

Rule 1: an intervention acts on bodies. A cup that is moved leaves the hand and keeps its contents.
Rule 2: an intervention on an object of the running primitive stops the primitive.
Rule 3: before an observation, a hand at an unknown position, and a tilted empty hand, is turned upright and lifted.
Rule 4: an object that stands at no place of the scene gets a new place, a spot (`confab.sim.lookout`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np

from confab.planner.acting.discovery import Discovery
from confab.planner.acting.episode import Intervention, InterventionKind
from confab.planner.acting.schedule import WorkerSlot
from confab.planner.acting.symbolic_world import disturbed, with_individual
from confab.planner.acting.world import INTERRUPTED
from confab.planner.plan import Step
from confab.planner.timed.dispatch import Dispatch
from confab.reasoner.embodiment.values import Body
from confab.reasoner.possible import refuse_impossible
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, State
from confab.sim.bodies import KINDS
from confab.sim.engine import Engine, SimulatedBody
from confab.sim.interventions import DISTURBERS, HANDLED, move, put_box
from confab.sim.lookout import Lookout
from confab.sim.perception import tilt_of
from confab.sim.skills import perform
from confab.sim.together import perform_together
from confab.sim.verdict import SkillError, Verdict
from confab.sim.world import PhysicsWorld

STOPPED = 0.02
"""The arm counts as blocked if a joint lags behind its command by more than this angle in radians."""

UPRIGHT = 0.1
"""Maximum tilt in radians of an upright hand."""

PAUSE = 60
"""Number of simulation steps after an intervention in which bodies come to rest."""


class LiveWorld:
    """A `PhysicsWorld` with interventions.

    Parameters
    ----------
    world : PhysicsWorld
    classes : mapping of class to individuals
        An object that an intervention adds gets the shape of another object of its class.
    problem : Problem, optional
        The problem against which interventions are checked. Without a problem, nothing is discovered.
    reaching : str
        The relation of reach facts, used for discovered spots.
    """

    def __init__(
        self,
        world: PhysicsWorld,
        classes: Mapping[str, Sequence[str]],
        problem: Problem | None = None,
        reaching: str = "",
    ) -> None:
        self.world, self.classes = world, classes
        self.lookout = None if problem is None else Lookout(world, problem, reaching)
        self.waiting: list[Intervention] = []
        self.stopping = False
        self.concerned: set[str] = set()
        self.changed: set[str] | None = None  # while several hands work: the individuals that interventions changed
        self.planted = world.disturb  # a fault that was planted earlier
        world.disturb = self._each_step

    @property
    def seconds(self) -> float:
        """Simulated seconds since the world began."""
        return self.world.seconds

    def announce(self, interventions: tuple[Intervention, ...]) -> None:
        """Schedule the interventions that have a time."""
        self.waiting = sorted((i for i in interventions if i.of_world and i.at is not None), key=lambda i: i.at or 0.0)

    def observe(self) -> State:
        """Raise empty tilted hands and hands whose position can't be perceived; return the facts that are perceived afterwards."""
        seen = self.world.observe()
        lost = {s.arguments[0] for s in self.world.symbols if s not in seen and s.arguments[0] in self.world.hands}
        lost |= {name for name in self.world.hands if not self._upright(name) and self.world.held(name) is None}
        for hand in sorted(lost):
            self.retreat(hand)
        news = self.lookout is not None and self.lookout.look()
        return self.world.observe() if lost or news else seen

    def discoveries(self) -> tuple[Discovery, ...]:
        """Return the things and spots discovered since the last call."""
        if self.lookout is None:
            return ()
        news, self.lookout.news = tuple(self.lookout.news), []
        return news

    def free_spots(self) -> Sequence[Discovery]:
        """Return spots on the furniture at which an object can be put down."""
        return () if self.lookout is None else self.lookout.free_spots()

    def why_unplaced(self, individual: str) -> str:
        """Return why an object has no perceived place."""
        return "" if self.lookout is None else self.lookout.why_unplaced(individual)

    def execute(self, step: Step) -> Verdict:
        """Execute a primitive; stop the primitive when an intervention changes one of the primitive's objects."""
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

    def execute_together(
        self, dispatch: Dispatch, may_begin: Callable[[Set[int]], bool]
    ) -> list[tuple[WorkerSlot, Verdict]]:
        """Execute the primitives of a dispatch with all hands at once; return those that ended, in the order of their begins.

        A primitive begins when its predecessors have ended and no other hand works too near.
        An intervention stops the running primitives of the objects that it changes; the other running primitives end.
        """
        self.changed = set()

        def changed() -> set[str]:
            now, self.changed = self.changed or set(), set()
            return now

        try:
            steps = [replace(dispatch.step(number), path=(number,)) for number in dispatch.waiting]
            done = perform_together(
                self.world,
                dispatch.problem,
                steps,
                may_begin=lambda paths: may_begin({path[0] for path in paths}),
                changed=changed,
            )
        finally:
            self.changed = None
        if not done.ok:
            self.take_stock()
        return list(zip(done.slots, done.verdicts, strict=True))

    def stop(self) -> None:
        """Stop the running primitive at its next simulation step."""
        self.stopping = bool(self.concerned)

    def take_stock(self) -> None:
        """After a failure, take the present postures and grasps as the reference for later checks.

        The present posture of a blocked arm becomes its command, so that the arm stops pressing. The present grasp of a held
        object becomes the reference from which slip is measured.
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
        """Return why an intervention is never possible in this world, or None if the intervention may be possible."""
        if intervention.change is InterventionKind.ADD and self._model_of(intervention.kind) is None:
            return f"no {intervention.kind} of this scene has a shape for {intervention.individual}"
        handled = (InterventionKind.REMOVE, InterventionKind.KNOCK, InterventionKind.PUSH)
        if intervention.change in handled and intervention.individual not in self.world.bodies:
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
        """Apply an intervention now, and simulate until the bodies have come to rest."""
        self._interfere(intervention)
        self.world.run(PAUSE)

    def retreat(self, hand: str) -> None:
        """Turn a loaded hand upright and raise the hand, or move an empty hand to the rest posture, as far as possible."""
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
        if self.planted is not None:
            self.planted(world)
        if self.stopping:
            self.stopping = False
            raise SkillError(INTERRUPTED, tuple(sorted(self.concerned)), "it was stopped")
        happened = False
        while self.waiting and (self.waiting[0].at or 0.0) <= world.seconds:
            intervention = self.waiting.pop(0)
            self._interfere(intervention)
            named = _named(intervention)
            self.world.moved_by_others = self.world.moved_by_others | named  # these objects were not moved by the hand
            happened = happened or not named.isdisjoint(self.concerned)
            if self.changed is not None:
                self.changed |= named
        if happened:
            raise SkillError(INTERRUPTED, tuple(sorted(self.concerned)), "an intervention changed an object of it")

    def _interfere(self, intervention: Intervention) -> None:
        name, change = intervention.individual, intervention.change
        if self.lookout is not None:
            if change is InterventionKind.ADD:
                self.lookout.problem = with_individual(self.lookout.problem, name, intervention.kind)
            problem = self.lookout.problem
            if change is InterventionKind.BOX:
                problem = with_individual(problem, name, intervention.kind)
            now = self.world.observe()
            refuse_impossible(
                problem, now, disturbed(problem, now, intervention), f"'{intervention.text}' can't happen"
            )
        if change is InterventionKind.ADD:
            self._add(intervention)
        elif change is InterventionKind.BOX:
            put_box(self.world, name, intervention.facts[0].value, intervention.numbers)
        elif name:
            HANDLED[change](self.world, name, intervention.numbers)
        else:
            for fact in intervention.facts:
                if fact.symbol.arguments[0] in (*self.world.bodies, *self.world.links):  # the object may be gone
                    self._make_true(fact)
        self.world.look_again()

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
        world.names[body], world.bodies[name] = name, SimulatedBody(body, model.shape)
        world.symbols = [*world.symbols, *(fact.symbol for fact in intervention.facts)]
        for fact in intervention.facts:
            self._make_true(fact)

    def _model_of(self, kind: str) -> Body | None:
        """Return the body of the first object of a class that has a shape, or None."""
        bodies = self.world.embodiment.bodies
        return next((bodies[one] for one in self.classes.get(kind, ()) if one in bodies), None)


def _named(intervention: Intervention) -> set[str]:
    """Return the individuals that an intervention names: the changed individuals and their new values."""
    named = {intervention.individual, *(fact.symbol.arguments[0] for fact in intervention.facts)}
    return named | {fact.value for fact in intervention.facts}
