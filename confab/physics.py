"""Verification of plans in physics: rollouts of a plan, and the report on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from confab.accepting import check_noise, check_seconds, named_for, number
from confab.labels import Labels, labels_of
from confab.planner.plan import Plan
from confab.progress import progress
from confab.reasoner.files import check_folder
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import FILM
from confab.reasoner.limits import within
from confab.reasoner.names import RightNames, right_names
from confab.reasoner.symbols import FALSE, Fact, PrimitiveStep, State
from confab.sim.engine import Engine
from confab.sim.rollouts import Done, Trial, wilson
from confab.sim.rollouts import rollouts as roll_out
from confab.sim.staging import Perturbation
from confab.sim.verdict import RolloutJson
from confab.sim.verify import Rollout, expectations
from confab.sim.world import PhysicsWorld
from confab.table import Table

if TYPE_CHECKING:
    from confab.known import Known
    from confab.show import PlanTree


class SuccessJson(TypedDict):
    """The number of verified rollouts, the confidence interval of the success rate, and the mean poured share of a serving."""

    verified: int
    of: int
    interval: list[float]
    poured: float | None


class SeenRolloutJson(RolloutJson):
    """A rollout, with the finally observed values of the symbols that have a goal."""

    seen: list[str]


class ReportJson(TypedDict):
    """The report of a verification of a plan in physics."""

    status: str
    success: SuccessJson
    trusted: dict[str, int]
    perturb: bool
    noise: float
    rollouts: list[SeenRolloutJson]


@right_names("a report", "scene.verify() or scene.read_report(FILE, PLAN)")
@dataclass(frozen=True)
class Report(metaclass=RightNames):
    """The report of a verification: the rollouts (executions in simulation) of a plan, and the film of the first rollout.

    A rollout is good if every primitive had the expected effects and no final observation contradicts a goal. Effects on a
    situation type without a perceiver can't be verified; `trusted` has the numbers of these effects by situation type. `perturb`
    and `noise` are the parameters of `verify`.
    """

    plan: Plan
    goal: State
    rollouts: tuple[Rollout, ...]
    video: Path | None = None
    trusted: Mapping[str, int] = field(default_factory=dict)
    scene: Known | None = field(default=None, repr=False, compare=False)
    perturb: bool = False
    noise: float = 0.0

    @property
    def verified(self) -> bool:
        """Whether every rollout is good."""
        return self.good == len(self.rollouts)

    @property
    def good(self) -> int:
        """The number of good rollouts."""
        return sum(rollout.ok and not self.missed(rollout) for rollout in self.rollouts)

    @property
    def shown(self) -> Rollout:
        """The first rollout that isn't good; if all rollouts are good, the first rollout."""
        return next((r for r in self.rollouts if not r.ok or self.missed(r)), self.rollouts[0])

    @property
    def film_speed(self) -> float:
        """The ratio of simulated time to the film's time."""
        from confab.sim.film import SPEED

        return SPEED

    def missed(self, rollout: Rollout) -> list[Fact]:
        """Return the goals that the final observations of a rollout contradict.

        Goals on symbols without a perceiver are skipped.
        """
        wanted = [Fact(symbol, value) for symbol, value in self.goal.items()]
        return [fact for fact in wanted if rollout.state.get(fact.symbol, fact.value) != fact.value]

    @property
    def poured(self) -> float | None:
        """The mean share of a serving that was poured, over all pours of all rollouts; None if nothing was poured."""
        shares = [share for rollout in self.rollouts for share in rollout.poured]
        return sum(shares) / len(shares) if shares else None

    def json(self) -> ReportJson:
        """Return the report as JSON data (docs/command-line.md)."""
        interval = [round(bound, 6) for bound in wilson(self.good, len(self.rollouts))]
        return {
            "status": "verified" if self.verified else "failed",
            "success": {"verified": self.good, "of": len(self.rollouts), "interval": interval, "poured": self.poured},
            "trusted": dict(self.trusted),
            "perturb": self.perturb,
            "noise": self.noise,
            "rollouts": [{**rollout.as_json(), "seen": self._seen(rollout)} for rollout in self.rollouts],
        }

    def _seen(self, rollout: Rollout) -> list[str]:
        """Return the final observed values of the symbols that have a goal."""
        return [str(Fact(symbol, rollout.state[symbol])) for symbol in sorted(self.goal) if symbol in rollout.state]

    def notes(self) -> dict[tuple[int, ...], str]:
        """Return the verdicts on the primitives in the rollout `shown`, by the step's path."""
        return {report.step.path: "✓" if report.verdict.ok else f"✗ {report.verdict}" for report in self.shown.steps}

    def table(self) -> Table:
        """Return a table of the primitives in the rollout `shown`, with verdicts and measurements."""
        rows = (
            (
                str(report.step),
                "yes" if report.verdict.ok else f"no: {report.verdict}",
                ", ".join(f"{name} {value:.3g}" for name, value in report.verdict.measured.items()),
            )
            for report in self.shown.steps
        )
        return Table(("primitive", "done", "measured"), tuple(rows))

    def summary(self) -> str:
        """Return the result of the verification in one line."""
        first = self.shown
        several = self._on_trust() + (f"; {self.rate()}" if len(self.rollouts) > 1 else "")
        if first.failure is not None:
            step = first.failure.step
            where = f"at step {'.'.join(map(str, step.path))} ({step}), seed {first.seed}"
            return f"failed {where}: {first.failure.verdict}{several}"
        if missed := self.missed(first):
            seen = "; ".join(f"{fact} (seen: {first.state[fact.symbol]})" for fact in missed)
            return (
                f"failed: {len(first.steps)} primitives had their effects, but the goal isn't reached: {seen}{several}"
            )
        poured = " and ".join(f"{share:.0%}" for share in first.poured)
        unseen = [fact for fact in first.believed if fact.symbol in self.goal]
        return (
            f"verified: {len(first.steps)} primitives"
            + (f", poured {poured} of a serving" if poured else "")
            + f", {first.simulated_seconds:.1f} s simulated in {first.cpu_seconds:.1f} CPU s"
            + (f"; not seen in the end, believed: {', '.join(map(str, unseen))}" if unseen else "")
            + several
        )

    def _on_trust(self) -> str:
        """Return, as text, the number of unverified effects on each situation type."""
        effects = ", ".join(f"{count} of {situation}" for situation, count in self.trusted.items())
        return f"; on trust, since no perceiver reads the effects: {effects}" if effects else ""

    def rate(self) -> str:
        """Return the number of verified rollouts, with Wilson's confidence interval and the seeds, as text."""
        low, high = wilson(self.good, len(self.rollouts))
        seeds = f"seeds {self.rollouts[0].seed} to {self.rollouts[-1].seed}"
        poured = "" if self.poured is None else f", poured {self.poured:.1%} on average"
        return f"{self.good} of {len(self.rollouts)} rollouts verified ({seeds}; 95 % confidence: {low:.1%} to {high:.1%}){poured}"

    def __rich__(self) -> PlanTree:
        """Return the plan as a tree for rich, with a verdict on each primitive."""
        from confab.show import plan_tree

        return plan_tree(self.plan, self.summary(), self.notes())

    def __repr__(self) -> str:
        """Return the summary of the verification."""
        return self.summary()

    def _repr_html_(self) -> str:
        from base64 import b64encode

        from confab.page.markup import styled, tag
        from confab.page.pieces import tree

        film = None
        if self.video is not None and self.video.is_file():
            data = b64encode(self.video.read_bytes()).decode()
            film = tag("video", src=f"data:video/mp4;base64,{data}", controls=True, width="640")
        known = self.scene
        labels = None if known is None else labels_of(known.knowledge, known.names, known.problem)
        return styled(tag("p", self.summary()), film, tree(self.plan, labels, self.notes()))


class VerifyKeywords(TypedDict, total=False):
    """Further options of `verify`."""

    perturb: bool
    noise: float
    video: str | Path | None
    prepare: Callable[[PhysicsWorld], None] | None
    progress: Callable[[int, PrimitiveStep], None] | None
    workers: int | str
    done: Done | None
    goal: State | None
    gui: bool
    time_limit: float | None


def verify(
    scene: Known,
    plan: Plan,
    rollouts: int = 1,
    seed: int = 0,
    perturb: bool = False,
    noise: float = 0.0,
    video: str | Path | None = None,
    prepare: Callable[[PhysicsWorld], None] | None = None,
    progress: Callable[[int, PrimitiveStep], None] | None = None,
    workers: int | str = 1,
    done: Done | None = None,
    goal: State | None = None,
    gui: bool = False,
    time_limit: float | None = None,
) -> Report:
    """Execute the primitives of a plan in PyBullet, once or with several seeds.

    Parameters
    ----------
    scene, plan
    rollouts, seed
        The number of rollouts, and the seed of the first rollout. The seed grows by 1 with each rollout.
    perturb
        Vary poses, friction, masses and filled amounts at random.
    noise
        Standard deviation of perceived positions, in metres.
    video
        Film the first rollout.
    prepare
        A function that is called with each world before the first step, for instance to inject a fault (`confab.sim.faults`).
    progress
        A function that is called before each step of a single or filmed rollout, with the number of finished steps.
    workers
        Number of processes, or the address of a Ray cluster (`confab.sim.rollouts.rollouts`).
    done
        A function that is called with each finished rollout.
    goal
        The goals that the final observation must confirm; by default the scene's goals.
    gui
        Show the first rollout on the screen, in real time or slower.
    time_limit
        Time limit of the whole call in seconds. At the limit, the call raises `LimitError`.

    Raises
    ------
    KnowledgeError
        The plan isn't applicable in the scene's initial state, the scene has no geometry, or the workers or the screen aren't
        available.
    """
    number("rollouts", rollouts, "how often, e.g. 3")
    number("seed", seed, "an integer")
    check_noise(noise)
    check_seconds("time_limit", time_limit)
    if rollouts < 1 or rollouts != int(rollouts):
        raise KnowledgeError(f"{rollouts} rollouts can't verify a plan; wanted 1 or more")
    video = None if video is None else named_for(FILM, video)
    steps = plan.primitives
    require_skills(scene, [step.behavior for step in steps])
    try:
        expected = expectations(scene.problem, steps)
        trial = Trial(
            scene.embodiment,
            scene.problem.initial,
            steps,
            expected,
            perturb=Perturbation() if perturb else None,
            noise=noise,
            prepare=prepare,
        )
        seeds = list(range(seed, seed + rollouts))
        finished: list[Rollout] = []
        with within(time_limit):
            if video is not None or gui:
                labels = labels_of(scene.knowledge, scene.names, scene.problem)
                finished.append(_shown(trial, seeds.pop(0), video, plan, progress, gui, labels))
            elif rollouts == 1 and str(workers) == "1":
                finished.append(trial.run(seeds.pop(0), progress=progress))
            if finished and done is not None:
                done(finished[0])
            finished += roll_out(trial, seeds, workers, done) if seeds else []
    except (ValueError, RuntimeError) as error:
        raise KnowledgeError(str(error)) from error
    wanted = scene.problem.only(scene.problem.weights).goal if goal is None else goal
    return Report(plan, wanted, tuple(finished), video, on_trust(scene, expected), scene, perturb, noise)


def on_trust(scene: Known, expected: Sequence[State]) -> dict[str, int]:
    """Return, by situation type, how many changes between successive states no perceiver observes."""
    changed = (
        symbol.situation
        for before, after in pairwise((scene.problem.initial, *expected))
        for symbol in {*before, *after}
        if before.get(symbol, FALSE) != after.get(symbol, FALSE)
    )
    return dict(sorted(Counter(name for name in changed if name not in scene.embodiment.perceivers).items()))


def require_skills(scene: Known, behaviors: Iterable[str]) -> None:
    """Raise `KnowledgeError` if a behaviour has no skill, or the scene has no robot."""
    skills = scene.embodiment.skills
    for behavior in behaviors:
        if behavior not in skills:
            raise KnowledgeError(
                f"behaviour {behavior} names no skill, so physics can't execute it; give it one (docs/bodies.md), "
                "or act in the symbolic world (confab execute)"
            )
    if not scene.embodiment.robots:
        raise KnowledgeError(
            f"{scene.iri} has no robot with a body, so physics can't execute anything; describe one (docs/bodies.md)"
        )


def _shown(
    trial: Trial,
    seed: int,
    video: Path | None,
    plan: Plan,
    progress: Callable[[int, PrimitiveStep], None] | None,
    gui: bool,
    labels: Labels,
) -> Rollout:
    """Execute the rollout with a given seed. The rollout is filmed, shown on the screen, or both."""
    watching: list[Callable[[Engine], None]] = []

    def watch(world: Engine) -> None:
        for one in watching:
            one(world)

    if gui:
        from confab.sim.screen import Screen, require_screen

        require_screen()
        watching.append(Screen(tuple(str(step) for step in plan.primitives)))
    if video is None:
        return trial.run(seed, watch, progress, gui)

    from confab.sim.film import Film

    titles = {step.path: f"{step.id} {labels.step(step)}" for step in plan.walk()}
    check_folder(video)
    video.parent.mkdir(exist_ok=True)
    with Film(video, plan.primitives, titles, stills=video.with_suffix(""), names=labels.words) as film:
        watching.append(film)
        return trial.run(seed, watch, progress, gui)


@contextmanager
def counted(rollouts: int) -> Iterator[Done]:
    """Show a progress bar on stderr; yield the function to call with each finished rollout."""
    with progress("rollouts", rollouts) as advance:
        good = 0

        def done(rollout: Rollout) -> None:
            nonlocal good
            good += rollout.ok
            advance(f"rollouts, {good} verified", 1)

        yield done
