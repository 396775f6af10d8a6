"""The result of a run on the page: verdict, figures, failure, film, goals, and the command that repeats the run."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING, Protocol

from confab import ontology
from confab.page.lanes import id_of
from confab.page.markup import measurement, number, plain
from confab.page.schema import Alarm, FilmData, GoalData, Tile
from confab.page.timeline import Timeline
from confab.planner.plan import Outcome, SoftGoal, Status
from confab.planner.plan_costs import cost_of
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Fact
from confab.show import lengths
from confab.sim.verdict import CODES

if TYPE_CHECKING:
    from confab.known import Known
    from confab.labels import Labels
    from confab.physics import Report
    from confab.planner.acting.episode import Episode
    from confab.planner.timed.plan import TimedPlan

LARGEST_FILM = 40_000_000
"""Maximum size in bytes of a film that the page embeds; larger films are linked."""


class Planned(Protocol):
    """The part of `confab.planning.Result` that the page needs."""

    problem: Problem
    outcome: Outcome
    timed: TimedPlan | None

    @property
    def soft_goals(self) -> tuple[SoftGoal, ...]:
        """The soft goals of the task."""

    def dearer(self) -> str:
        """Return a remark on possible cheaper plans, as `confab.planning.Result.dearer`."""


class ExecutionView(Protocol):
    """The part of `confab.execution.Execution` that the page needs."""

    @property
    def episode(self) -> Episode:
        """The record of the execution."""

    @property
    def reached(self) -> bool:
        """Whether the execution reached all goals."""

    @property
    def soft_goals(self) -> tuple[SoftGoal, ...]:
        """The soft goals of the task."""

    def notes(self) -> dict[tuple[int, ...], str]:
        """Return notes on steps, by the step's path."""

    def summary(self) -> str:
        """Return a summary of the execution in one line."""


def status_of(
    outcome: Outcome | None, report: Report | None, execution: ExecutionView | None
) -> tuple[bool | None, str]:
    """Return whether a run has succeeded (None if unknown), and the result of the run as text."""
    if execution is not None:
        return execution.reached, execution.episode.status.value
    if report is not None:
        return report.verified, "verified in physics" if report.verified else "failed in physics"
    if outcome is not None and outcome.plan is not None:
        return True, "a plan, checked" if outcome.plan.steps else "nothing to do: all goals hold"
    return (False, outcome.status.value) if outcome is not None else (None, "not planned yet")


def tiles_of(
    problem: Problem,
    timeline: Timeline | None,
    outcome: Outcome | None,
    report: Report | None,
    execution: ExecutionView | None,
    soft: Sequence[SoftGoal] = (),
) -> list[Tile]:
    """Return the figures of a run, such as the number of primitives and the planning time."""
    found: list[tuple[str, str]] = []
    if timeline is not None:
        steps = len(timeline.plan.primitives)
        done = sum(bar.ok is not False for bar in timeline.bars)
        found.append(("primitives", f"{steps}" if done >= steps else f"{done} of {steps}"))
        found.append(("plan", f"{lengths(timeline.plan)} steps"))
        if timeline.unit == "s":
            found.append(("simulated", f"{timeline.end:.1f} s"))
    if report is not None:
        shown = report.shown
        if shown.poured:
            found.append(("poured", ", ".join(f"{share:.0%}" for share in shown.poured)))
        if len(report.rollouts) > 1:
            found.append(("rollouts verified", f"{report.good} of {len(report.rollouts)}"))
        found.append(("physics", f"{shown.cpu_seconds:.1f} CPU s"))
    if execution is not None:
        episode = execution.episode
        counted = (
            ("interventions", episode.interventions),
            ("changes of plan", episode.replans),
            ("failures", episode.failures),
        )
        found += [(what, str(len(those))) for what, those in counted if those]
    if outcome is not None:
        expanded = sum(counts.expanded for counts in outcome.search.values())
        found.append(("search", f"{expanded:,} expansions"))
        found.append(
            ("planning", f"{outcome.seconds:.1f} s" if outcome.seconds >= 1 else f"{outcome.seconds * 1000:.0f} ms")
        )
        costly = any(one.price is not None or one.cost != 1 for one in problem.domain.behaviors.values())
        if outcome.plan is not None and costly:
            found.append(("cost", number(cost_of(problem, outcome.plan))))
    if soft and timeline is not None:
        unmet = sum(float(goal.weight) for goal in soft if not goal.met)
        met = f"{sum(goal.met for goal in soft)} of {len(soft)} met"
        found.append(("soft goals", f"{met}, unmet weight {number(unmet)}" if unmet else met))
    return [{"name": name, "text": text} for name, text in found]


def alarm_of(
    timeline: Timeline, labels: Labels, outcome: Outcome | None, report: Report | None, execution: ExecutionView | None
) -> Alarm | None:
    """Return the failure of a run, or None if the run didn't fail."""
    if execution is not None and execution.reached:
        return None
    reasons = [labels.sentence(reason.text) for reason in (execution.episode.reasons if execution is not None else ())]
    if (failed := timeline.failed) is not None:
        above = [
            labels.step(step)
            for step in timeline.plan.walk()
            if step.steps and failed.step.path[: len(step.path)] == step.path
        ]
        meaning = CODES.get(failed.code or "", "")
        text = labels.sentence(plain(failed.note.removeprefix(f"{failed.code}: ")))
        where = f"at {failed.end:.1f} {timeline.unit}" + (f", in “{' › '.join(above)}”" if above else "")
        code = f"{failed.code}: {meaning}" if meaning else failed.code or ""
        return {
            "title": f"Failed: {labels.step(failed.step)}",
            "step": id_of(failed.step.path),
            "lines": [line for line in (where, code, text, *reasons) if line],
            "measured": [measurement(name, value) for name, value in failed.measured.items()],
        }
    if report is not None and not report.verified:
        missed = [
            f"{labels.fact(fact)}; seen: {labels.name(report.shown.state[fact.symbol])}"
            for fact in report.missed(report.shown)
        ]
        return {"title": "The goal isn't reached", "lines": missed or [report.summary()]}
    if execution is not None:
        return {"title": execution.episode.status.value, "lines": reasons}
    if outcome is not None and outcome.status is not Status.SOLVED:
        why = labels.sentence(outcome.reason.text) if outcome.reason else "no reason given"
        return {"title": f"No plan: {outcome.status.value}", "lines": [why, *_proof(outcome, labels)]}
    return None


def _proof(outcome: Outcome, labels: Labels) -> list[str]:
    from confab.why import proved

    return [] if outcome.certificate is None else list(proved(outcome.certificate, labels))


def film_of(report: Report | None) -> FilmData | None:
    """Return the film of a verification, with the first still picture as its poster; return None if there is no film."""
    if report is None or report.video is None or not report.video.is_file():
        return None
    kind = "image/gif" if report.video.suffix == ".gif" else "video/mp4"
    source = report.video.name
    if report.video.stat().st_size <= LARGEST_FILM:
        source = f"data:{kind};base64,{b64encode(report.video.read_bytes()).decode()}"
    caption = f"{report.film_speed:g} × as fast as simulated, seed {report.rollouts[0].seed}"
    film: FilmData = {"source": source, "kind": kind, "speed": report.film_speed, "caption": caption}
    if still := next(iter(sorted(report.video.with_suffix("").glob("*.png"))), None):
        film["poster"] = f"data:image/jpeg;base64,{b64encode(_jpeg(still)).decode()}"
    return film


def _jpeg(still: Path) -> bytes:
    """Return a picture in the format JPEG, which takes about a tenth of the bytes of PNG."""
    from PIL import Image

    made = BytesIO()
    Image.open(still).convert("RGB").save(made, "jpeg", quality=80)
    return made.getvalue()


WHEN = re.compile(r"^(?:after|at)=\S+ ")


def mark_of(text: str, labels: Labels) -> str:
    """Return the text of an intervention or of a change of the plan as a sentence with labels."""
    what = WHEN.sub("", text)
    if what == text:
        return labels.sentence(text)
    if what.startswith("goal "):
        return f"it is wanted that {labels.sentence(what.removeprefix('goal '))}"
    said = labels.sentence(what)
    return f"it happens that {said}" if len(what.split(" ")) > 2 and said != what else said


def goals_of(timeline: Timeline, labels: Labels, planned: bool) -> list[GoalData]:
    """Return the goals with the initial values of their symbols and, if there is a plan, the final values."""
    found: list[GoalData] = []
    for symbol, value in sorted(timeline.problem.goal.items()):
        goal: GoalData = {
            "label": labels.fact(Fact(symbol, value)),
            "before": labels.name(timeline.problem.initial.get(symbol, FALSE)),
        }
        if planned:
            goal["after"], goal["met"] = labels.name(timeline.final.get(symbol, FALSE)), bool(timeline.met(symbol))
        found.append(goal)
    return found


def called(scene: Known) -> str:
    """Return the name by which commands load a scene: the name of a shipped scene, the path of its file, or its IRI."""
    path = scene.knowledge.path
    return scene.iri if path is None else path.stem if path.is_relative_to(ontology.ROOT) else str(path)


def again_of(
    scene: Known, problem: Problem, report: Report | None, execution: ExecutionView | None, physical: bool
) -> str:
    """Return the command that repeats a planning call, a verification or an execution."""
    changed = [called(scene), *scene.knowledge.changes]
    if execution is not None:
        people = [part for i, _ in execution.episode.interventions for part in ("--intervene", i.text)]
        return join(["confab", "execute", *changed, *(["--world", "pybullet"] if physical else []), *people])
    if report is not None:
        many, seed = len(report.rollouts), report.rollouts[0].seed
        given = {"--rollouts": many * (many > 1), "--seed": seed, "--noise": report.noise}
        options = [part for option, value in given.items() if value for part in (option, str(value))]
        return join(["confab", "verify", *changed, "PLAN.json", *options, *(["--perturb"] if report.perturb else [])])
    first = scene.problem.goal
    goals = [str(Fact(symbol, value)) for symbol, value in sorted(problem.goal.items()) if first.get(symbol) != value]
    return join(["confab", "plan", *changed, *(f"--goal={goal}" for goal in goals)])
