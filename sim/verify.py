"""Verification of a plan: its primitives are executed in a simulated world, and perceived facts must equal expected facts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from confab.planner.validation import successor
from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.names import brief, known_as
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Fact, PrimitiveStep, State
from confab.sim.engine import Clock, Engine
from confab.sim.perception import perceiver
from confab.sim.staging import Perturbation
from confab.sim.verdict import RolloutJson, StepReportJson, Verdict
from confab.sim.world import PhysicsWorld

LOOKS = 3
"""Number of noisy observations that are averaged before a difference from the expected state counts."""


@known_as("an entry")
@brief
@dataclass(frozen=True)
class StepReport:
    """A primitive, its verdict, and its duration in simulated seconds."""

    step: PrimitiveStep
    verdict: Verdict
    seconds: float

    def as_json(self) -> StepReportJson:
        """Return the report as `confab verify --json` prints it."""
        return {"path": list(self.step.path), "id": self.step.id, **self.verdict.as_json()}


@known_as("a rollout")
@brief
@dataclass(frozen=True)
class Rollout:
    """One execution of a plan.

    `poured` has for each pour the share of a serving that arrived. `state` has the last perceived facts. `believed` has the
    facts of `state` about hidden objects. `cpu_seconds` excludes filming (`clock.rendering`).
    """

    seed: int
    ok: bool
    steps: tuple[StepReport, ...]
    poured: tuple[float, ...]
    cpu_seconds: float = field(compare=False)
    simulated_seconds: float
    state: State = field(default_factory=dict)
    clock: Clock = field(default_factory=Clock, compare=False)
    believed: tuple[Fact, ...] = ()

    @property
    def failure(self) -> StepReport | None:
        """The report of the failed step, or None."""
        return next((report for report in self.steps if not report.verdict.ok), None)

    def as_json(self) -> RolloutJson:
        """Return the rollout as `confab verify --json` prints it."""
        return {
            "seed": self.seed,
            "ok": self.ok,
            "steps": [report.as_json() for report in self.steps],
            "poured": [round(share, 6) for share in self.poured],
            "cpu_seconds": round(self.cpu_seconds, 3),
            "simulated_seconds": round(self.simulated_seconds, 4),
            "believed": [str(fact) for fact in self.believed],
        }


def expectations(problem: Problem, steps: Sequence[PrimitiveStep]) -> list[State]:
    """Return the expected state after each step of a plan, computed from the behaviours' effects.

    Raises
    ------
    ValueError
        The preconditions of a step don't hold in the state before the step. The message names the step.
    """
    state = problem.initial
    states: list[State] = []
    for step in steps:
        after = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state)
        if after is None:
            raise ValueError(
                f"step {step.path}, {step}: its preconditions don't hold; this is no plan from the initial state"
            )
        state = after
        states.append(state)
    return states


def verify(
    embodiment: Embodiment,
    initial: State,
    steps: Sequence[PrimitiveStep],
    expected: Sequence[State],
    *,
    seed: int = 0,
    perturb: Perturbation | None = None,
    beads: bool = True,
    noise: float = 0.0,
    prepare: Callable[[PhysicsWorld], None] | None = None,
    watch: Callable[[Engine], None] | None = None,
    progress: Callable[[int, PrimitiveStep], None] | None = None,
    gui: bool = False,
) -> Rollout:
    """Execute the primitives of a plan in a new world until a primitive fails.

    Parameters
    ----------
    embodiment, initial
        The world's robots, furniture and bodies, and its initial facts.
    steps : sequence of PrimitiveStep
        Primitives in the order of execution.
    expected : sequence of State
        The state after each primitive, as `expectations` computes it. Symbols without a perceiver are not compared.
    seed, perturb, beads, noise
        As in `PhysicsWorld`.
    prepare : callable, optional
        Function that is called with the world before the first step, for example a planted fault (`confab.sim.faults`).
    watch : callable, optional
        Function that is called with the world after every simulation step, for example a `confab.sim.film.Film`.
    progress : callable, optional
        Function that is called before each step with the number of finished steps and the step.
    gui : bool
        Show the world in PyBullet's window.

    Returns
    -------
    Rollout
        Equal arguments give equal rollouts, bit by bit, except for CPU seconds.
    """
    begin = time.process_time()
    reports: list[StepReport] = []
    with PhysicsWorld(embodiment, initial, seed, perturb, beads, noise, watch, gui) as world:
        if prepare is not None:
            prepare(world)
        for number, (step, state) in enumerate(zip(steps, expected, strict=True)):
            if progress is not None:
                progress(number, step)
            started = world.steps
            verdict = world.execute(step)
            if verdict.ok:
                verdict = compare(world, state, verdict)
            reports.append(StepReport(step, verdict, (world.steps - started) / world.rate))
            if not verdict.ok:
                break
        poured = tuple(min(1.0, r.verdict.measured["poured"]) for r in reports if "poured" in r.verdict.measured)
        ok = len(reports) == len(steps) and all(report.verdict.ok for report in reports)
        cpu = time.process_time() - begin - world.clock.rendering
        seen = world.observe()
        hidden = world.believed(seen)
        return Rollout(seed, ok, tuple(reports), poured, cpu, world.seconds, seen, world.clock, hidden)


def compare(world: PhysicsWorld, expected: State, verdict: Verdict) -> Verdict:
    """Return `verdict` if the perceived facts equal the expected facts, otherwise a failure that names the first difference.

    With noisy perception, a difference is measured again, and the mean of all measurements counts.
    """
    for looks in range(1, LOOKS + 1):
        found = _compared(world, expected, verdict)
        if found.ok or not world.noise or looks == LOOKS:
            break
        world.look(looks)
    return found


def _compared(world: PhysicsWorld, expected: State, verdict: Verdict) -> Verdict:
    seen = world.observe()
    for symbol in world.symbols:
        got = seen.get(symbol)
        wanted = expected.get(symbol, FALSE if got in (TRUE, FALSE) else None)
        if wanted is not None and got != wanted:
            use = world.embodiment.perceivers[symbol.situation]
            how = perceiver(use.perceiver)
            measured = {**verdict.measured, **(how.measure(world, use, symbol.arguments) if how.measure else {})}
            objects = tuple(dict.fromkeys((*symbol.arguments, wanted, *([got] if got else []))))
            name = f"{symbol.situation} of {' '.join(symbol.arguments)}"
            message = f"{name}: expected {wanted}, seen {got or 'no value'}"
            return Verdict(False, how.code, objects, measured, message)
    return verdict
