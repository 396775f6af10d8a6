"""What a notebook shows: the pieces of the report, by value. The planner's own values are shown so as well (`register`)."""

from __future__ import annotations

import sys
from base64 import b64encode
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from confab.report import page, pieces
from confab.report.course import of_episode, of_plan, of_rollout
from confab.report.maps import ground_of, place_map
from confab.report.markup import Markup, styled, tag
from confab.show import summary
from planner.plan import Outcome, Plan, Step
from reasoner.symbols import Fact

if TYPE_CHECKING:
    from confab.execution import Execution
    from confab.memory import Memory
    from confab.physics import Report
    from confab.scene import Result, Scene


def of_scene(scene: Scene) -> str:
    """Return a scene: where things are, and what is wanted."""
    from confab.labels import labels_of

    problem = scene.problem
    labels = labels_of(scene.knowledge, scene.names, problem)
    course = of_plan(problem, Plan(()))
    ground = ground_of(problem, page.embodiment_of(scene))
    rows = [
        [labels.fact(Fact(symbol, value)), labels.name(problem.initial.get(symbol, "false"))]
        for symbol, value in sorted(problem.goal.items())
    ]
    return styled(
        tag("p", repr(scene)),
        place_map(ground, course, labels) if ground is not None else None,
        pieces.table(["wanted", "now"], rows) if rows else None,
    )


def of_result(result: Result) -> str:
    """Return what came of planning: how it ended, and the plan with its reasons."""
    if result.outcome.plan is None:
        return styled(tag("p", summary(result.outcome)))
    plan = result.plan
    needed = result.purposes if sum(1 for _ in plan.walk()) <= page.MOST_STEPS else None
    shown = pieces.tree(plan, result.labels, None, needed)
    return styled(
        tag("p", summary(result.outcome)), pieces.timeline(of_plan(result.problem, plan), result.labels), shown
    )


def of_report(report: Report) -> str:
    """Return what physics said, with the film."""
    film: Markup | None = None
    if report.video is not None and report.video.is_file():
        data = b64encode(report.video.read_bytes()).decode()
        film = tag("video", src=f"data:video/mp4;base64,{data}", controls=True, width="640")
    if report.scene is None:
        return styled(tag("p", report.summary()), film, pieces.tree(report.plan, None, report.notes()))
    from confab.labels import labels_of

    scene, problem = report.scene, report.scene.problem
    labels = labels_of(scene.knowledge, scene.names, problem)
    course = of_rollout(problem, report.plan, report.shown)
    tree = pieces.tree(report.plan, labels, report.notes(), None, course)
    return styled(tag("p", report.summary()), film, pieces.timeline(course, labels), tree)


def of_execution(execution: Execution) -> str:
    """Return an episode: what was done when, what people did, how the plan changed."""
    from confab.labels import labels_of

    scene = execution.scene
    labels = labels_of(scene.knowledge, scene.names, scene.problem)
    course = of_episode(scene.problem, execution.episode)
    tree = pieces.tree(course.plan, labels, execution.notes(), None, course)
    return styled(tag("p", execution.summary()), pieces.timeline(course, labels), tree)


def of_memory(memory: Memory) -> str:
    """Return what was learned."""
    shown = [pieces.table(list(t.columns), list(t)) for t in (memory.counts(20), memory.table(20)) if len(t)]
    return styled(tag("p", memory.said()), *shown)


def _of_outcome(outcome: Outcome) -> str:
    plan = pieces.tree(outcome.plan) if outcome.plan is not None else None
    return styled(tag("p", summary(outcome)), plan)


def _of_plan(plan: Plan) -> str:
    return styled(pieces.tree(plan))


def _of_step(step: Step) -> str:
    return styled(pieces.tree(Plan((step,))))


SHOWN: dict[tuple[str, str], Callable[[Any], str]] = {
    ("planner.plan", "Outcome"): _of_outcome,
    ("planner.plan", "Plan"): _of_plan,
    ("planner.plan", "Step"): _of_step,
    ("sim.verdict", "Verdict"): pieces.verdict,
}
"""What the rooms that know no HTML have: shown in a notebook all the same."""


def register() -> None:
    """Let a notebook that runs show the values of `SHOWN`; elsewhere nothing happens."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None:
        return
    formatter = shell.display_formatter.formatters["text/html"]
    for (module, name), shown in SHOWN.items():
        formatter.for_type_by_name(module, name, shown)
