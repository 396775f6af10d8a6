"""All that the page shows of a scene, a plan, a run or an execution, as one JSON object (docs/page.md)."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol, TypedDict

from confab import ontology
from confab.page.ground import Ground, ground_of
from confab.page.markup import number
from confab.page.timeline import Bar, Timeline, of_episode, of_plan, of_rollout, of_schedule
from confab.planner.causal_links import purposes
from confab.planner.plan import Outcome, Plan, Status, Step
from confab.planner.plan_costs import cost_of
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import local_name
from confab.reasoner.symbols import FALSE, Fact, Problem, Symbol
from confab.show import lengths
from confab.sim.verdict import CODES

if TYPE_CHECKING:
    from confab.known import Known
    from confab.labels import Labels
    from confab.memory import Memory
    from confab.physics import Report
    from confab.planner.acting.episode import Episode
    from confab.planner.timed.plan import TimedPlan
    from confab.reasoner.embodiment.values import Embodiment

FORMAT = 1
"""Version of the JSON object; a page shows the objects of its own version."""
LARGEST_FILM = 40_000_000
"""Maximum size in bytes of a film that is embedded in the page; a larger one is linked."""
LEARNED = 8
"""Maximum number of goals whose learned rules are shown."""
MOST_STEPS = 4000
"""Maximum number of steps of a plan whose purposes are computed for the page."""
MOST_FIXED = 5000
"""Maximum number of rows for static facts that aren't goals; the page states the number of the others."""


class Interval(TypedDict, total=False):
    """A part of a row: from `begin` to `end`, a step or a value, and the meaning of its colour (`tone`).

    `step` is the ID of the step that it shows. `slack` is the time until which its end may be delayed without delaying the last.
    """

    begin: float
    end: float
    label: str
    tone: str  # action, planned, failed; of facts: start, between, wanted
    step: str
    note: str
    slack: float


class Row(TypedDict, total=False):
    """A lane: its `group` is levels, actors, changes, wanted or fixed; `met` says whether its goal holds in the end."""

    group: str
    label: str
    bars: list[Interval]
    met: bool


class StepData(TypedDict, total=False):
    """A step of the plan; `id` is its path, joined by dots, so that its parent's is a prefix."""

    id: str
    number: str
    what: str
    name: str
    ok: bool
    note: str
    begin: float
    end: float
    gives: list[str]
    needs: list[str]
    facts: list[tuple[str, str]]


class Thing(TypedDict):
    """An object on the map: from when on at which place (empty: at none), in words, and the tone of that."""

    id: str
    label: str
    at: list[tuple[float, str, str, str]]


class AreaData(TypedDict):
    """A polygon of the map."""

    label: str
    corners: list[tuple[float, float]]


class Spot(TypedDict):
    """A point of the map."""

    id: str
    label: str
    at: tuple[float, float]


class MapData(TypedDict):
    """The map: x to the right, y down."""

    areas: list[AreaData]
    ways: list[tuple[str, str]]
    places: list[Spot]
    robots: list[Spot]
    things: list[Thing]
    metric: bool
    note: str


class Alarm(TypedDict, total=False):
    """A failure: its text, its position, and the measured numbers."""

    title: str
    step: str
    lines: list[str]
    measured: list[tuple[str, str]]


class Film(TypedDict):
    """A film of the run; `speed` is the ratio of the page's time to the film's."""

    source: str
    kind: str
    speed: float
    caption: str


class Tile(TypedDict):
    """A figure with its name."""

    name: str
    text: str


class GoalData(TypedDict, total=False):
    """A goal, its initial and its final value."""

    label: str
    before: str
    after: str
    met: bool


class Mark(TypedDict):
    """An intervention or a change of plan."""

    at: float
    text: str


class Learned(TypedDict):
    """What memory holds after the run."""

    text: str
    rules: list[tuple[str, list[str]]]


class TurnableRow(TypedDict):
    """A symbol that can be turned: its key, its words, the name of its list of values, its value and the wanted one."""

    key: str
    label: str
    values: str
    now: str
    wanted: str | None


class Turnable(TypedDict):
    """All that can be turned; `values` has each list of values by its name, each value with its words."""

    rows: list[TurnableRow]
    values: dict[str, list[tuple[str, str]]]
    hidden: int


class ReadyQuery(TypedDict):
    """A query that ships with Confab, with the question that it answers."""

    name: str
    question: str
    text: str


class PageData(TypedDict, total=False):
    """The data of the page; `problem` is the reason why planning failed after a change on the page."""

    format: int
    title: str
    iri: str
    good: bool | None
    status: str
    headline: str
    tiles: list[Tile]
    alarm: Alarm
    film: Film
    map: MapData
    end: float
    unit: str
    now: float
    marks: list[Mark]
    rows: list[Row]
    hidden: int
    steps: list[StepData]
    goals: list[GoalData]
    learned: Learned
    notes: list[str]
    again: str
    live: bool
    version: int
    turnable: Turnable
    queries: list[ReadyQuery]
    problem: str


class Planned(Protocol):
    """The result of planning, as the page needs it: `confab.planning.Result`."""

    problem: Problem
    outcome: Outcome
    timed: TimedPlan | None

    def dearer(self) -> str:
        """Return the known bounds on a cheaper plan."""


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

    def summary(self) -> str:
        """Return a summary of the result in one line."""


def page_data(
    scene: Known,
    result: Planned | None = None,
    report: Report | None = None,
    execution: Executed | None = None,
    learned: Memory | None = None,
    again: str = "",
) -> PageData:
    """Return the data of the page.

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
    from confab.show import summary

    problem = result.problem if result is not None else scene.problem
    labels = page_labels(scene, problem)
    outcome = result.outcome if result is not None else None
    timed = result.timed if result is not None and report is None and execution is None else None
    planned = execution is not None or report is not None or (outcome is not None and outcome.plan is not None)
    timeline = _timeline(problem, result, report, execution)
    notes = execution.notes() if execution is not None else report.notes() if report is not None else {}
    calm = execution is None or not (execution.episode.interventions or execution.episode.failures)
    data = timeline_data(scene, timeline, labels, notes, reasons=calm)
    good, status = _status(outcome, report, execution)
    data |= {
        "good": good,
        "status": status,
        "headline": execution.summary()
        if execution is not None
        else report.summary()
        if report is not None
        else summary(outcome).splitlines()[0]
        if outcome is not None
        else "",
        "tiles": _tiles(problem, timeline if planned else None, outcome, report, execution),
        "goals": _goals(timeline, labels, planned),
        "notes": [
            *data["notes"],
            *_small_print(outcome),
            *filter(None, [result.dearer() if result is not None else ""]),
        ],
        "again": again or _again(scene, report, execution, timeline.unit == "s"),
    }
    if timed is not None:
        data["tiles"] = [
            {"name": "makespan", "text": f"{float(timed.makespan):.3g} s"},
            {"name": "one after the other", "text": f"{float(timed.serial):.3g} s"},
            {"name": "lower bound", "text": f"{float(timed.bound):.3g} s for {timed.bounds}"},
            *(tile for tile in data["tiles"] if tile["name"] != "simulated"),
        ]
    if alarm := _alarm(timeline, labels, outcome, report, execution):
        data["alarm"] = alarm
    if film := _film(report):
        data["film"] = film
    if learned is not None:
        rules = [(goals, [str(rule) for rule in its]) for goals, its in learned.told(LEARNED)]
        data["learned"] = {"text": learned.said(), "rules": rules}
    return data


def page_labels(scene: Known, problem: Problem) -> Labels:
    """Return the displayed names of all that a problem names, and of furniture and robots."""
    from confab.labels import labels_of

    body = embodiment_of(scene)
    others = [] if body is None else [fixture.name for fixture in body.fixtures]
    others += [] if body is None else [*body.places, *(robot.name for robot in body.robots)]
    return labels_of(scene.knowledge, scene.names, problem, others)


def timeline_data(
    scene: Known, timeline: Timeline, labels: Labels, notes: Mapping[tuple[int, ...], str], reasons: bool = True
) -> PageData:
    """Return the parts of the page that follow from a timeline: title, map, rows and steps.

    Parameters
    ----------
    scene : Scene
    timeline : Timeline
    labels : Labels
    notes : mapping of path to str
        A note on each step.
    reasons : bool
        Whether the plan is one that the checker accepts, so that each step has a purpose.
    """
    rows, hidden = _rows(timeline, labels)
    data: PageData = {
        "format": FORMAT,
        "title": labels.words.get(scene.iri) or local_name(scene.iri),
        "iri": scene.iri,
        "end": _axis_end(timeline),
        "unit": timeline.unit,
        "marks": [{"at": round(at, 3), "text": text} for at, text in timeline.marks],
        "rows": rows,
        "hidden": hidden,
        "steps": _steps(timeline, labels, notes, reasons),
        "notes": [],
    }
    ground = ground_of(timeline.problem, embodiment_of(scene))
    if ground is not None and ground.spots:
        data["map"] = _map(ground, timeline, labels)
    elif ground is not None:
        data["notes"] = [ground.note]
    return data


def _timeline(problem: Problem, result: Planned | None, report: Report | None, execution: Executed | None) -> Timeline:
    if execution is not None:
        return of_episode(problem, execution.episode)
    if report is not None:
        return of_rollout(problem, report.plan, report.shown)
    if result is not None and result.timed is not None:
        return of_schedule(problem, result.timed)
    plan = result.outcome.plan if result is not None else None
    return of_plan(problem, plan or Plan(()))


def embodiment_of(scene: Known) -> Embodiment | None:
    """Return the scene's embodiment, or None if it is missing or incomplete."""
    from confab.reasoner.embodiment.facts import EmbodimentError

    try:
        return scene.embodiment
    except (KnowledgeError, EmbodimentError):
        return None


def id_of(path: Sequence[int]) -> str:
    """Return the ID of a step."""
    return ".".join(map(str, path))


# ------------------------------------------------------------------------------------------------------------ rows


LAST = 0.04
"""Share of the axis that follows the last primitive, for its effects."""


def _axis_end(timeline: Timeline) -> float:
    late = any(period.begin >= timeline.end for periods in timeline.phases.values() for period in periods[1:])
    return round((timeline.end or 1.0) * (1 + LAST if late else 1), 4)


def _rows(timeline: Timeline, labels: Labels) -> tuple[list[Row], int]:
    """Return the rows, and the number of facts for which there is no row."""
    by_path = timeline.by_path
    rows: list[Row] = []
    for level in sorted({step.level for step in timeline.plan.walk() if step.steps}):
        on = [s for s in timeline.plan.walk() if s.level == level and s.steps and s.path in by_path]
        rows += _lanes("levels", f"level {level}", [by_path[step.path] for step in on], labels)
    for actor, those in timeline.lanes().items():
        label = labels.name(actor) if actor else "primitives"
        rows += _lanes("actors", label, those, labels)
    end, fixed = _axis_end(timeline), 0
    for symbol, periods in sorted(timeline.phases.items()):
        group = "changes" if len(periods) > 1 else "wanted" if symbol in timeline.problem.goal else "fixed"
        fixed += group == "fixed"
        if group == "fixed" and fixed > MOST_FIXED:
            continue
        bars: list[Interval] = [
            {
                "begin": round(period.begin, 3),
                "end": round(end if period.end >= timeline.end and i == len(periods) - 1 else period.end, 3),
                "label": labels.name(period.value),
                "tone": _tone(timeline, symbol, period.value),
            }
            for i, period in enumerate(periods)
            if i == len(periods) - 1 or period.end > period.begin
        ]
        row: Row = {"group": group, "label": labels.about(symbol), "bars": bars}
        if (met := timeline.met(symbol)) is not None:
            row["met"] = met
        rows.append(row)
    return rows, max(0, fixed - MOST_FIXED)


def _lanes(group: str, label: str, bars: Sequence[Bar], labels: Labels) -> list[Row]:
    """Return the smallest number of rows for some bars in which no two overlap."""
    rows: list[list[Bar]] = []
    for bar in sorted(bars, key=lambda bar: (bar.begin, bar.end)):
        free = next((row for row in rows if row[-1].end <= bar.begin + 1e-6), None)
        if free is None:
            rows.append([bar])
        else:
            free.append(bar)
    return [
        {
            "group": group,
            "label": f"{label}, meanwhile" if number else label,
            "bars": [_interval(bar, labels) for bar in row],
        }
        for number, row in enumerate(rows)
    ]


def _interval(bar: Bar, labels: Labels) -> Interval:
    tone = "failed" if bar.ok is False else "planned" if bar.planned else "action"
    interval: Interval = {
        "begin": round(bar.begin, 3),
        "end": round(bar.end, 3),
        "label": labels.step(bar.step),
        "tone": tone,
        "step": id_of(bar.step.path),
    }
    if bar.ok is False and bar.note:
        interval["note"] = bar.note
    if bar.slack:
        interval["slack"] = round(bar.slack, 3)
    return interval


def _tone(timeline: Timeline, symbol: Symbol, value: str) -> str:
    """Return the meaning of a value's colour: a goal, an initial goal, or neither."""
    if timeline.problem.goal.get(symbol) == value:
        return "wanted"
    return "start" if timeline.problem.initial.get(symbol, FALSE) == value else "between"


# ------------------------------------------------------------------------------------------------------------ map


def _map(ground: Ground, timeline: Timeline, labels: Labels) -> MapData:
    return {
        "areas": [{"label": labels.name(area.name), "corners": list(area.corners)} for area in ground.areas],
        "ways": list(ground.ways),
        "places": [{"id": name, "label": labels.name(name), "at": at} for name, at in ground.spots.items()],
        "robots": [{"id": name, "label": labels.name(name), "at": at} for name, at in ground.robots],
        "things": _things(ground, timeline, labels),
        "metric": ground.metric,
        "note": ground.note,
    }


def _things(ground: Ground, timeline: Timeline, labels: Labels) -> list[Thing]:
    """Return the objects on the map, each with its places.

    The place of an object is the value of a symbol that begins on the map and whose situation type has no rest value, since a
    hand's position is no place of an object. Of several such symbols, the one that is longest on the map counts.
    """
    situations = timeline.problem.domain.situations
    found: dict[str, tuple[float, Thing]] = {}
    for symbol, periods in sorted(timeline.phases.items()):
        if len(symbol.arguments) != 1 or not periods or periods[0].value not in ground.spots:
            continue
        if situations[symbol.situation].rest is not None:
            continue
        (name,) = symbol.arguments
        long = sum(period.end - period.begin for period in periods if period.value in ground.spots)
        if name not in found or long > found[name][0]:
            at = [
                (
                    round(period.begin, 3),
                    period.value if period.value in ground.spots else "",
                    labels.fact(Fact(symbol, period.value)),
                    _tone(timeline, symbol, period.value),
                )
                for period in periods
            ]
            found[name] = long, {"id": name, "label": labels.name(name), "at": at}
    return [thing for _, (_, thing) in sorted(found.items())]


# ------------------------------------------------------------------------------------------------------------ plan


def _steps(timeline: Timeline, labels: Labels, notes: Mapping[tuple[int, ...], str], reasons: bool) -> list[StepData]:
    from confab.why import account, numbers

    plan = timeline.plan
    steps = list(plan.walk())
    why = {}
    if reasons and steps and len(steps) <= MOST_STEPS:
        why = {step.path: step for step in account(plan, purposes(timeline.problem, plan), labels, "").steps}
    number_of, bars = numbers(plan), timeline.by_path
    found = []
    for step in steps:
        data: StepData = {
            "id": id_of(step.path),
            "number": number_of[step.path],
            "what": labels.step(step),
            "name": f"{step.behavior} #{step.id}",
        }
        if (bar := bars.get(step.path)) is not None:
            data |= {"begin": round(bar.begin, 3), "end": round(bar.end, 3)}
            if bar.ok is not None:
                data["ok"] = bar.ok
        if note := notes.get(step.path, "").strip("✓✗ "):
            data["note"] = note
        if (because := why.get(step.path)) is not None:
            data |= {"gives": list(because.gives), "needs": list(because.needs)}
        if facts := _measured(step, bar, labels):
            data["facts"] = facts
        found.append(data)
    return found


def _measured(step: Step, bar: Bar | None, labels: Labels) -> list[tuple[str, str]]:
    """Return the measurements of a primitive, and the individuals of a step's determined variables."""
    pairs = [(name, number(value)) for name, value in (bar.measured if bar else {}).items()]
    pairs += [(name, labels.name(value)) for name, value in step.bindings.items()]
    return [(name.replace("_", " "), value) for name, value in pairs]


# ------------------------------------------------------------------------------------------------------------ how it ended


def _status(outcome: Outcome | None, report: Report | None, execution: Executed | None) -> tuple[bool | None, str]:
    if execution is not None:
        return execution.reached, execution.episode.status.value
    if report is not None:
        return report.verified, "verified in physics" if report.verified else "failed in physics"
    if outcome is not None and outcome.plan is not None:
        return True, "a plan, checked" if outcome.plan.steps else "nothing to do: all goals hold"
    return (False, outcome.status.value) if outcome is not None else (None, "not planned yet")


def _tiles(
    problem: Problem,
    timeline: Timeline | None,
    outcome: Outcome | None,
    report: Report | None,
    execution: Executed | None,
) -> list[Tile]:
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
        found.append(("planning", f"{outcome.seconds * 1000:.0f} ms"))
        if outcome.plan is not None:
            cost = cost_of(problem, outcome.plan)
            if cost != len(outcome.plan.primitives):
                found.append(("cost", number(cost)))
    return [{"name": name, "text": text} for name, text in found]


def _alarm(
    timeline: Timeline, labels: Labels, outcome: Outcome | None, report: Report | None, execution: Executed | None
) -> Alarm | None:
    """Return the failure, or None if there was none."""
    if execution is not None and execution.reached:
        return None
    reasons = [reason.text for reason in (execution.episode.reasons if execution is not None else ())]
    if (failed := timeline.failed) is not None:
        above = [
            labels.step(step)
            for step in timeline.plan.walk()
            if step.steps and failed.step.path[: len(step.path)] == step.path
        ]
        meaning = CODES.get(failed.code or "", "")
        text = re.sub(r" \(\w+ [-\d.e+]+(, \w+ [-\d.e+]+)*\)$", "", failed.note.removeprefix(f"{failed.code}: "))
        where = f"after {failed.begin:.1f} {timeline.unit}" + (f", in “{' › '.join(above)}”" if above else "")
        code = f"{failed.code}: {meaning}" if meaning else failed.code or ""
        return {
            "title": f"Failed: {labels.step(failed.step)}",
            "step": id_of(failed.step.path),
            "lines": [line for line in (where, code, text, *reasons) if line],
            "measured": [(name.replace("_", " "), number(value)) for name, value in failed.measured.items()],
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
        why = outcome.reason.text if outcome.reason else "no reason given"
        return {"title": f"No plan: {outcome.status.value}", "lines": [why, *_proof(outcome, labels)]}
    return None


def _proof(outcome: Outcome, labels: Labels) -> list[str]:
    from confab.why import proved

    return [] if outcome.certificate is None else list(proved(outcome.certificate, labels))


def _film(report: Report | None) -> Film | None:
    if report is None or report.video is None or not report.video.is_file():
        return None
    kind = "image/gif" if report.video.suffix == ".gif" else "video/mp4"
    source = report.video.name
    if report.video.stat().st_size <= LARGEST_FILM:
        source = f"data:{kind};base64,{b64encode(report.video.read_bytes()).decode()}"
    caption = f"{report.film_speed:g} × as fast as simulated, seed {report.rollouts[0].seed}"
    return {"source": source, "kind": kind, "speed": report.film_speed, "caption": caption}


def _goals(timeline: Timeline, labels: Labels, planned: bool) -> list[GoalData]:
    """Return the goals with their initial values, and their final ones if anything was planned."""
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


def _again(scene: Known, report: Report | None, execution: Executed | None, physical: bool) -> str:
    path = scene.knowledge.path
    name = scene.iri if path is None else path.stem if path.is_relative_to(ontology.ROOT) else str(path)
    if execution is not None:
        people = "".join(f" --intervene '{i.text}'" for i, _ in execution.episode.interventions)
        return f"confab execute {name}{' --world pybullet' if physical else ''}{people}"
    seed = f" --seed {report.rollouts[0].seed}" if report is not None and report.rollouts[0].seed else ""
    return f"confab run {name}{seed}" if report is not None else f"confab run {name}"


def _small_print(outcome: Outcome | None) -> list[str]:
    """Return notes on the levels that were given up, and on the conditions that the plan violates therefore."""
    if outcome is None:
        return []
    broken = [broken.text for left in outcome.left for broken in left.broken]
    return [*outcome.given_up, *(f"the plan violates a condition of the level above: {text}" for text in broken)]
