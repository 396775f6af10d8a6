"""The JSON object with the content of the page about a scene, a plan, a run or an execution (docs/page.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from confab.page.ground import ground_of
from confab.page.lanes import axis_end, id_of, rows_of
from confab.page.markup import measurement, plain, spaced
from confab.page.places import map_of
from confab.page.results import (
    ExecutionView,
    Planned,
    again_of,
    alarm_of,
    film_of,
    goals_of,
    mark_of,
    status_of,
    tiles_of,
)
from confab.page.schema import FORMAT, PageData, StepData
from confab.page.timeline import Bar, Timeline, of_episode, of_plan, of_rollout, of_schedule
from confab.planner.causal_links import purposes
from confab.planner.plan import Plan, Step
from confab.reasoner.graph.knowledge import KnowledgeError, text
from confab.reasoner.problem import Problem

if TYPE_CHECKING:
    from confab.known import Known
    from confab.labels import Labels
    from confab.memory import Memory
    from confab.physics import Report
    from confab.reasoner.embodiment.values import Embodiment

LEARNED = 8
"""Maximum number of learned rules that the page shows."""
MOST_STEPS = 4000
"""Maximum length of a plan, in steps, for which the page states the purpose of each step."""


def page_data(
    scene: Known,
    result: Planned | None = None,
    report: Report | None = None,
    execution: ExecutionView | None = None,
    learned: Memory | None = None,
    again: str = "",
) -> PageData:
    """Return the JSON object with the content of the page.

    Parameters
    ----------
    scene : Scene
    result : Result, optional
        The result of planning.
    report : Report, optional
        The verification of the plan in physics.
    execution : Execution, optional
        The execution of the task; the page shows the execution instead of the plan.
    learned : Memory, optional
        The memory after the run.
    again : str, optional
        The command that repeats the run; by default, a command that fits the other arguments.
    """
    from confab.show import remarks_on_levels, summary

    problem = result.problem if result is not None else scene.problem
    labels = page_labels(scene, problem)
    outcome = result.outcome if result is not None else None
    timed = result.timed if result is not None and report is None and execution is None else None
    planned = execution is not None or report is not None or (outcome is not None and outcome.plan is not None)
    timeline = _timeline(problem, result, report, execution)
    notes = execution.notes() if execution is not None else report.notes() if report is not None else {}
    calm = execution is None or not (execution.episode.interventions or execution.episode.failures)
    data = timeline_data(scene, timeline, labels, notes, reasons=calm)
    ended = execution if execution is not None else result
    soft = () if ended is None else ended.soft_goals
    good, status = status_of(outcome, report, execution)
    shown = report if execution is None else execution
    planning = "" if outcome is None else summary(outcome).splitlines()[0]
    data |= {
        "good": good,
        "status": status,
        "headline": planning if shown is None else shown.summary(),
        "tiles": tiles_of(problem, timeline if planned else None, outcome, report, execution, soft),
        "goals": goals_of(timeline, labels, planned),
        "notes": [
            *data["notes"],
            *(remarks_on_levels(outcome) if outcome is not None else ()),
            *filter(None, [result.dearer() if result is not None else ""]),
        ],
        "again": again or again_of(scene, problem, report, execution, timeline.unit == "s"),
    }
    if timed is not None:
        least = f", {float(timed.least):.3g} s for any plan" if timed.least else ""
        data["tiles"] = [
            {"name": "makespan", "text": f"{float(timed.makespan):.3g} s"},
            {"name": "one after the other", "text": f"{float(timed.serial):.3g} s"},
            {"name": "lower bound", "text": f"{float(timed.bound):.3g} s for {timed.bounds}{least}"},
            *(tile for tile in data["tiles"] if tile["name"] != "simulated"),
        ]
    if alarm := alarm_of(timeline, labels, outcome, report, execution):
        data["alarm"] = alarm
    if film := film_of(report):
        data["film"] = film
    if learned is not None:
        rules = [(goals, [str(rule) for rule in its]) for goals, its in learned.told(LEARNED)]
        data["learned"] = {"text": learned.said(), "rules": rules}
    return data


def page_labels(scene: Known, problem: Problem) -> Labels:
    """Return the labels of a problem's terms, of furniture and of robots."""
    from confab.labels import labels_of

    body = embodiment_of(scene)
    others = [] if body is None else [fixture.name for fixture in body.fixtures]
    others += [] if body is None else [*body.places, *(robot.name for robot in body.robots)]
    return labels_of(scene.knowledge, scene.names, problem, others)


def timeline_data(
    scene: Known, timeline: Timeline, labels: Labels, notes: Mapping[tuple[int, ...], str], reasons: bool = True
) -> PageData:
    """Return the parts of the page's content that depend on a timeline, such as the map, the rows and the steps.

    Parameters
    ----------
    scene : Scene
    timeline : Timeline
    labels : Labels
    notes : mapping of path to str
        Notes on steps, by the step's path.
    reasons : bool
        Whether to state the purpose of each step; this requires a valid plan.
    """
    rows, hidden = rows_of(timeline, labels)
    data: PageData = {
        "format": FORMAT,
        "title": scene.title,
        "iri": scene.iri,
        "end": axis_end(timeline),
        "unit": timeline.unit,
        "marks": [{"at": round(at, 3), "text": mark_of(text, labels)} for at, text in timeline.marks],
        "rows": rows,
        "hidden": hidden,
        "steps": _steps(timeline, labels, notes, reasons),
        "notes": [],
    }
    shapes = scene.knowledge.select("SELECT ?thing ?shape { ?thing :shape ?shape } ORDER BY ?thing ?shape")
    named = [(scene.names.short(text(thing)), text(shape)) for thing, shape in shapes]
    ground = ground_of(timeline.problem, embodiment_of(scene), named)
    if ground is not None and ground.spots:
        data["map"] = map_of(ground, timeline, labels)
    elif ground is not None:
        data["notes"] = [ground.note]
    return data


def _timeline(
    problem: Problem, result: Planned | None, report: Report | None, execution: ExecutionView | None
) -> Timeline:
    if execution is not None:
        return of_episode(problem, execution.episode)
    if report is not None:
        return of_rollout(problem, report.plan, report.shown)
    if result is not None and result.timed is not None:
        return of_schedule(problem, result.timed)
    plan = result.outcome.plan if result is not None else None
    return of_plan(problem, plan or Plan(()))


def embodiment_of(scene: Known) -> Embodiment | None:
    """Return the embodiment of a scene, or None if the scene has no complete embodiment."""
    from confab.reasoner.embodiment.facts import EmbodimentError

    try:
        return scene.embodiment
    except (KnowledgeError, EmbodimentError):
        return None


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
            "name": " + ".join(f"{one.behavior} #{one.id}" for one in step.together),
        }
        if (bar := bars.get(step.path)) is not None:
            data |= {"begin": round(bar.begin, 3), "end": round(bar.end, 3)}
            if bar.ok is not None:
                data["ok"] = bar.ok
        if note := plain(notes.get(step.path, "").strip("✓✗ ")):
            data["note"] = labels.sentence(note)
        if (because := why.get(step.path)) is not None:
            data |= {"gives": list(because.gives), "needs": list(because.needs)}
        if facts := _measured(step, bar, labels):
            data["facts"] = facts
        found.append(data)
    return found


def _measured(step: Step, bar: Bar | None, labels: Labels) -> list[tuple[str, str]]:
    """Return pairs of name and value: the measurements of a step, and the variables that the state determines for the step."""
    pairs = [measurement(name, value) for name, value in (bar.measured if bar else {}).items()]
    return [*pairs, *((spaced(name), labels.name(value)) for name, value in step.bindings.items())]
