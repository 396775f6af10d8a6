"""The physical world in which plans are executed: facts determine its initial scene, and primitives change the scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType

import numpy as np

from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact, PrimitiveStep, State, Symbol
from confab.sim.engine import RATE, Engine
from confab.sim.perception import Draft, perceiver
from confab.sim.skills import perform
from confab.sim.staging import Perturbation, furnish, stage
from confab.sim.swings import refuted
from confab.sim.verdict import REFUTED, SkillError, Verdict


class PhysicsWorld(Engine):
    """A physics world with the objects of a scene; close the world after use, or use a ``with`` statement.

    Parameters
    ----------
    embodiment : Embodiment
        Robots, furniture, places, shapes, skills and perceivers.
    initial : State
        Initial facts. Facts of situation types without a perceiver are ignored.
    seed : int
        Seed of all random numbers, for perturbation, sampling in motion planning and sensor noise.
    perturb : Perturbation, optional
        Random deviations of poses, friction, masses and contents.
    beads : bool
        Whether beverages are simulated as beads. Without beads the simulation is faster, and contents are counted from
        `initial`.
    noise : float
        Standard deviation in metres of perceived positions.
    watch : callable, optional
        Function that is called with the world after every simulation step, for example a `confab.sim.film.Film`.
    gui : bool
        Open PyBullet's window. Call `confab.sim.screen.require_screen` first, since PyBullet ends the process without a screen.
    """

    def __init__(
        self,
        embodiment: Embodiment,
        initial: State,
        seed: int = 0,
        perturb: Perturbation | None = None,
        beads: bool = True,
        noise: float = 0.0,
        watch: Callable[[Engine], None] | None = None,
        gui: bool = False,
    ) -> None:
        super().__init__(embodiment, seed, noise, gui)
        self.symbols = [symbol for symbol in initial if symbol.situation in embodiment.perceivers]
        joints = [Symbol(use.situation, (link,)) for use in embodiment.perceivers.values() for link in use.links]
        measured = [Symbol(use.situation, one) for use in embodiment.perceivers.values() for one in use.asked]
        self.symbols += [symbol for symbol in joints if symbol not in initial]  # joints without a fact are shut
        # measured types without a fact are false
        self.symbols += [symbol for symbol in measured if symbol not in self.symbols]
        self.perturb = perturb
        furnish(self, perturb)
        draft = self._draft(initial)
        stage(self, draft, perturb, beads)
        for name, place in draft.places.items():  # hidden bodies are believed to be at the places that the scene states
            self.remember(name, np.eye(3), self.place(place))
        self.watch = watch

    def __enter__(self) -> PhysicsWorld:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _draft(self, initial: State) -> Draft:
        """Return the layout of the new world that the initial facts state."""
        draft = Draft()
        for symbol in self.symbols:
            use = self.embodiment.perceivers[symbol.situation]
            if symbol in initial:
                perceiver(use.perceiver).arrange(draft, use, symbol.arguments, initial[symbol])
        return draft

    def observe(self) -> State:
        """Return the facts perceived now, without symbols whose value cannot be perceived."""
        state: dict[Symbol, str] = {}
        for symbol in self.symbols:
            use = self.embodiment.perceivers[symbol.situation]
            value = perceiver(use.perceiver).observe(self, use, symbol.arguments)
            if value is not None:
                state[symbol] = value
        return state

    def believed(self, state: State) -> tuple[Fact, ...]:
        """Return the facts of a perceived state about hidden objects; such facts are believed and not perceived."""
        hidden = {name for name in self.known if not self.perceives(name)}
        return tuple(Fact(symbol, value) for symbol, value in state.items() if symbol.arguments[0] in hidden)

    def execute(self, step: PrimitiveStep) -> Verdict:
        """Execute a primitive; return success with the measured numbers, or the skill's failure.

        Raises
        ------
        KeyError
            No skill executes the behaviour. The message names the behaviour.
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
        hands = [self.hands[name] for name in self.hands if name in (self.acting(roles), *roles.values())]
        for hand in hands:
            hand.limit = use.numbers.get("time_limit", math.inf)
            hand.deadline = self.steps + hand.limit * RATE
        try:
            measured = perform(self, use, roles)
        except SkillError as failure:
            return self._with_facts(failure.verdict, step)
        finally:
            for hand in hands:
                hand.deadline = math.inf
        return Verdict(True, measured=measured)

    def _with_facts(self, verdict: Verdict, step: PrimitiveStep) -> Verdict:
        """Return a verdict of failed motion planning with the facts under which the verdict holds: positions of the objects.

        A body that carries one of the places counts as an object, too, because the place may be out of reach where the body
        stands.
        """
        places = [self.embodiment.places[name] for name in verdict.objects if name in self.embodiment.places]
        carriers = {place.carrier for place in places} & self.bodies.keys()
        if verdict.code not in REFUTED and not (verdict.code == "unreachable" and carriers):
            return verdict
        spatial = {name for name, use in self.embodiment.perceivers.items() if perceiver(use.perceiver).spatial}
        objects = {*verdict.objects, *carriers}
        asked = [s for s in self.symbols if s.situation in spatial and s.arguments[0] in objects]
        seen = self.observe() if {s.arguments[0] for s in asked} - {*step.arguments} else {}
        facts = tuple(Fact(symbol, seen[symbol]) for symbol in asked if symbol in seen)
        if not verdict.swings:
            return replace(verdict, facts=facts)
        exact = Refutation(step.behavior, step.arguments, facts)
        likewise = sorted(refuted(self, self.symbols, verdict.swings), key=lambda one: one.covers(exact))
        return replace(verdict, facts=facts, likewise=tuple(likewise))
