"""The report of a run as one self-contained HTML page, without network access or further files."""

from __future__ import annotations

import re
from base64 import b64encode
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Protocol

from confab import ontology
from confab.planner.causal_links import purposes
from confab.planner.plan import Outcome, Status
from confab.planner.plan_costs import cost_of
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import local_name
from confab.reasoner.symbols import Fact, Problem
from confab.report.course import Timeline, of_episode, of_plan, of_rollout
from confab.report.maps import ground_of, place_map
from confab.report.markup import Markup, asset, joined, tag
from confab.report.pieces import Tile, anchor, number, table, tiles, timeline, tree
from confab.show import lengths
from confab.sim.verdict import CODES

if TYPE_CHECKING:
    from confab.known import Known
    from confab.labels import Labels
    from confab.memory import Memory
    from confab.physics import Report
    from confab.planner.acting.episode import Episode
    from confab.reasoner.embodiment.values import Embodiment


class Planned(Protocol):
    """The result of planning, as the page needs it: `confab.planning.Result`."""

    problem: Problem
    outcome: Outcome


class Executed(Protocol):
    """The result of executing a task, as the page needs it: `confab.execution.Execution`."""

    @property
    def episode(self) -> Episode:
        """The episode."""

    @property
    def reached(self) -> bool:
        """Whether the goal was reached."""

    def notes(self) -> dict[tuple[int, ...], str]:
        """Return a note on each step, by its path."""


LARGEST_FILM = 40_000_000
"""Maximum size in bytes of a film that is embedded in the page; a larger one is linked."""
LEARNED = 8
"""Maximum number of sentences about learned rules."""
MOST_STEPS = 4000
"""Maximum number of steps of a plan whose purposes are computed for the page."""


def report_html(
    scene: Known,
    result: Planned | None = None,
    report: Report | None = None,
    execution: Executed | None = None,
    learned: Memory | None = None,
    again: str = "",
) -> str:
    """Return the page as HTML text.

    Parameters
    ----------
    scene : Scene
    result : Result, optional
        The result of planning, with or without a plan.
    report : Report, optional
        The verification of the plan in physics.
    execution : Execution, optional
        The execution of the task; the page then shows it instead of the plan.
    learned : Memory, optional
        The memory after the run.
    again : str, optional
        The command that repeats the run; derived from the other arguments by default.
    """
    from confab.labels import labels_of

    problem = result.problem if result is not None else scene.problem
    labels = labels_of(scene.knowledge, scene.names, problem)
    course = _course(problem, result, report, execution)
    outcome = result.outcome if result is not None else None
    title = labels.words.get(scene.iri) or local_name(scene.iri)
    speed = report.film_speed if report is not None and report.video is not None else None
    parts: list[object] = [
        tag("header", tag("h1", title), tag("p", scene.iri, class_="iri")),
        tiles(_tiles(problem, course, outcome, report, execution)),
        _alarm(course, labels, outcome, report, execution),
        _scene(course, labels, embodiment_of(scene), report),
    ]
    if course is not None:
        parts += [tag("h2", "Timeline"), timeline(course, labels, speed)]
        parts += [tag("h2", "The plan and its reasons"), _plan(course, labels, report, execution)]
    parts += [_wanted(course, problem, labels), _learned(learned)]
    parts += [
        tag("h2", "Again"),
        tag("pre", again or _again(scene, report, execution, course is not None and course.unit == "s")),
        *_small_print(outcome),
    ]
    return Template(asset("page.html")).substitute(
        title=joined(title), style=asset("style.css"), body=joined(parts), script=asset("script.js")
    )


def _course(
    problem: Problem, result: Planned | None, report: Report | None, execution: Executed | None
) -> Timeline | None:
    if execution is not None:
        return of_episode(problem, execution.episode)
    if report is not None:
        return of_rollout(problem, report.plan, report.shown)
    if result is not None and result.outcome.plan is not None:
        return of_plan(problem, result.outcome.plan)
    return None


def embodiment_of(scene: Known) -> Embodiment | None:
    """Return the scene's embodiment, or None if it is missing or incomplete."""
    from confab.reasoner.embodiment.facts import EmbodimentError

    try:
        return scene.embodiment
    except (KnowledgeError, EmbodimentError):
        return None


# ------------------------------------------------------------------------------------------------------------ the parts


def _tiles(
    problem: Problem,
    course: Timeline | None,
    outcome: Outcome | None,
    report: Report | None,
    execution: Executed | None,
) -> list[Tile]:
    found: list[Tile] = []
    if execution is not None:
        good = execution.reached
        found.append(("verdict", f"{'✓' if good else '✗'} {execution.episode.status.value}", "good" if good else "bad"))
    elif report is not None:
        good = report.verified
        found.append(("verdict", "✓ verified in physics" if good else "✗ failed in physics", "good" if good else "bad"))
    elif outcome is not None and outcome.plan is not None:
        found.append(("verdict", "✓ a plan, checked", "good"))
    elif outcome is not None:
        found.append(("verdict", f"✗ {outcome.status.value}", "bad"))
    if course is not None:
        steps = len(course.plan.primitives)
        done = sum(bar.ok is not False for bar in course.bars)
        found.append(("primitives", f"{steps}" if done >= steps else f"{done} of {steps}", ""))
        found.append(("plan", f"{lengths(course.plan)} steps", ""))
        if course.unit == "s":
            found.append(("simulated", f"{course.end:.1f} s", ""))
    if report is not None:
        shown = report.shown
        if shown.poured:
            found.append(("poured", ", ".join(f"{share:.0%}" for share in shown.poured), ""))
        if len(report.rollouts) > 1:
            found.append(("rollouts verified", f"{report.good} of {len(report.rollouts)}", ""))
        found.append(("physics", f"{shown.cpu_seconds:.1f} CPU s", ""))
    if execution is not None:
        episode = execution.episode
        found += [
            (what, str(many), "")
            for what, many in (
                ("interventions", len(episode.interventions)),
                ("changes of plan", len(episode.replans)),
                ("failures", len(episode.failures)),
            )
            if many
        ]
    if outcome is not None:
        expanded = sum(counts.expanded for counts in outcome.search.values())
        found.append(("search", f"{expanded:,} expansions", ""))
        found.append(("planning", f"{outcome.seconds * 1000:.0f} ms", ""))
        if outcome.plan is not None:
            cost = cost_of(problem, outcome.plan)
            if cost != len(outcome.plan.primitives):
                found.append(("cost", number(cost), ""))
    return found


def _alarm(
    course: Timeline | None, labels: Labels, outcome: Outcome | None, report: Report | None, execution: Executed | None
) -> Markup | None:
    """Return a section on the failure with its measurements, or None if nothing failed."""
    if execution is not None and execution.reached:
        return None
    failed = course.failed if course is not None else None
    if failed is not None and course is not None:
        where = tag("a", labels.step(failed.step), href=f"#{anchor(failed.step.path)}")
        above = [
            labels.step(step)
            for step in course.plan.walk()
            if step.steps and failed.step.path[: len(step.path)] == step.path
        ]
        pairs = [
            tag("div", tag("dt", name.replace("_", " ")), tag("dd", number(value)))
            for name, value in failed.measured.items()
        ]
        meaning = CODES.get(failed.code or "", "")
        return tag(
            "section",
            tag("h2", "✗ Failed: ", where),
            tag("p", f"after {failed.begin:.1f} {course.unit}", f", in “{' › '.join(above)}”" if above else None),
            tag("p", tag("b", failed.code or ""), f": {meaning}" if meaning else None),
            tag("p", re.sub(r" \(\w+ [-\d.e+]+(, \w+ [-\d.e+]+)*\)$", "", failed.note.removeprefix(f"{failed.code}: "))),
            tag("dl", pairs) if pairs else None,
            _reasons_of(execution),
            class_="alarm",
        )  # fmt: skip
    if report is not None and not report.verified:
        missed = [
            f"{labels.fact(fact)}; seen: {labels.name(report.shown.state[fact.symbol])}"
            for fact in report.missed(report.shown)
        ]
        others = None if missed else tag("p", report.summary())
        return tag(
            "section",
            tag("h2", "✗ The goal isn't reached"),
            tag("ul", [tag("li", each) for each in missed]),
            others,
            class_="alarm",
        )
    if execution is not None:
        return tag("section", tag("h2", f"✗ {execution.episode.status.value}"), _reasons_of(execution), class_="alarm")
    if outcome is not None and outcome.status is not Status.SOLVED:
        why = outcome.reason.text if outcome.reason else ""
        return tag("section", tag("h2", f"✗ No plan: {outcome.status.value}"), tag("p", why), class_="alarm")
    return None


def _reasons_of(execution: Executed | None) -> Markup | None:
    reasons = execution.episode.reasons if execution is not None else ()
    return tag("ul", [tag("li", reason.text) for reason in reasons]) if reasons else None


def _scene(
    course: Timeline | None, labels: Labels, embodiment: Embodiment | None, report: Report | None
) -> Markup | None:
    """Return the film and the map side by side, or whichever exists."""
    film = _film(report)
    ground = ground_of(course.problem, embodiment) if course is not None else None
    drawn = place_map(ground, course, labels) if ground is not None and course is not None else None
    if film is None and drawn is None:
        return None
    return tag("section", film, drawn, class_="scene" if film is not None and drawn is not None else "scene single")


def _film(report: Report | None) -> Markup | None:
    if report is None or report.video is None or not report.video.is_file():
        return None
    kind = "image/gif" if report.video.suffix == ".gif" else "video/mp4"
    source = report.video.name
    if report.video.stat().st_size <= LARGEST_FILM:
        source = f"data:{kind};base64,{b64encode(report.video.read_bytes()).decode()}"
    shown = (
        tag("img", src=source, alt="film of the run")
        if kind == "image/gif"
        else tag("video", src=source, controls=True, muted=True, playsinline=True)
    )
    return tag(
        "figure",
        shown,
        tag("figcaption", f"{report.film_speed:g} × as fast as simulated, seed {report.rollouts[0].seed}"),
        class_="film",
    )


def _plan(course: Timeline, labels: Labels, report: Report | None, execution: Executed | None) -> Markup:
    steps = sum(1 for _ in course.plan.walk())
    notes = execution.notes() if execution is not None else report.notes() if report is not None else {}
    calm = execution is None or not (execution.episode.interventions or execution.episode.failures)
    needed = purposes(course.problem, course.plan) if steps <= MOST_STEPS and calm else None
    return tree(course.plan, labels, notes, needed, course)


def _wanted(course: Timeline | None, problem: Problem, labels: Labels) -> Markup | None:
    """Return a table of the goals with their initial and final values."""
    goal = course.problem.goal if course is not None else problem.goal
    if not goal:
        return None
    rows: list[list[object]] = []
    for symbol, value in sorted(goal.items()):
        row: list[object] = [labels.fact(Fact(symbol, value)), labels.name(problem.initial.get(symbol, "false"))]
        if course is not None:
            met = course.met(symbol)
            end = labels.name(course.final.get(symbol, "false"))
            row.append(tag("span", f"{'✓' if met else '✗'} {end}", class_="ok" if met else "bad"))
        rows.append(row)
    columns = ["goal", "before", *(["in the end"] if course is not None else [])]
    return joined(tag("h2", "Goals"), table(columns, rows))


def _learned(memory: Memory | None) -> Markup | None:
    if memory is None:
        return None
    rules = [
        joined(tag("h3", goals), tag("ul", joined(*(tag("li", rule) for rule in its))))
        for goals, its in memory.told(LEARNED)
    ]
    return joined(tag("h2", "What was learned"), tag("p", memory.said()), *rules)


def _again(scene: Known, report: Report | None, execution: Executed | None, physical: bool) -> str:
    path = scene.knowledge.path
    name = scene.iri if path is None else path.stem if path.is_relative_to(ontology.ROOT) else str(path)
    if execution is not None:
        people = "".join(f" --intervene '{i.text}'" for i, _ in execution.episode.interventions)
        return f"confab execute {name}{' --world pybullet' if physical else ''}{people}"
    seed = f" --seed {report.rollouts[0].seed}" if report is not None and report.rollouts[0].seed else ""
    return f"confab run {name}{seed}" if report is not None else f"confab run {name}"


def _small_print(outcome: Outcome | None) -> list[Markup]:
    """Return notes on the levels that were given up, and on the conditions that the plan violates therefore."""
    said = [tag("p", text, class_="note") for text in (outcome.given_up if outcome is not None else ())]
    for left in outcome.left if outcome is not None else ():
        for broken in left.broken:
            said.append(tag("p", f"the plan violates a condition of the level above: {broken.text}", class_="note"))
    return said


def write_report(path: str | Path, page: str) -> Path:
    """Write a page atomically; return its path."""
    from confab.reasoner.files import write_whole

    write_whole(Path(path), page)
    return Path(path)


__all__ = ["report_html", "write_report"]
