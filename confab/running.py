"""The main job, end to end: validate, plan, verify in physics where there are bodies, learn from it, report."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from confab.memory import Memory, undisturbed
from confab.planner.plan import Status
from confab.planner.solve import Mode
from confab.planning import Result
from confab.progress import progress, tell
from confab.reaching import has_robot, unreached, with_reach
from confab.reasoner.files import check_replaceable, has_content, write_whole
from confab.reasoner.kinds import FILM, MEMORY, OBSERVED, PLAN, REPORT, VERDICTS
from confab.reasoner.reading.observed import assert_observed, save_observed
from confab.reasoner.validation.findings import listing
from confab.reasoner.validation.validate import validate
from confab.refuting import keep, knowing, refuted_in
from confab.scene import Scene, load
from confab.show import show

if TYPE_CHECKING:
    from confab.physics import Report

YES, NO, GAVE_UP = 0, 1, 3
TOLD = 8
"""After so many primitives it is said how far the plan is, where there is no progress bar."""


def run(name: str, memory: Path | None, mode: Mode, seed: int, out: Path, film: bool, gui: bool = False) -> int:
    """Do the main job on a scene and say on stdout what came of it; files go to `out`, what was learned to `memory` alone.

    A scene without a robot's body is planned in, and the plan is checked; physics has no say then.

    Returns
    -------
    int
        Exit code: 0 verified, 1 invalid, unsolvable or failed in physics, 3 gave up.

    Raises
    ------
    KnowledgeError
        The scene, or the memory, can't be read.
    """
    kinds = {
        "plan.json": PLAN,
        "report.html": REPORT,
        "verify.json": VERDICTS,
        "observed.ttl": OBSERVED,
        "run.mp4": FILM,
    }
    for file, kind in kinds.items():
        check_replaceable(out / file, kind)
    if memory is not None:
        check_replaceable(memory, MEMORY)
    tell("validating")
    with progress("validating") as advance:
        findings = validate([name], done=lambda what: advance(what, 0))
    if findings:
        print(listing(findings))
    if any(finding.serious for finding in findings):
        return NO
    tell("loading the scene")
    scene = load(name)
    bodies = has_robot(scene)
    scene = with_reach(scene) if bodies else scene
    tell("planning")
    with progress("planning"):
        remembered = Memory.load(memory, scene) if memory and has_content(memory) else Memory.of(scene)
        result = scene.plan(memory=remembered, mode=mode)
    if result.outcome.plan is None:
        show(result)
        for line in unreached(scene) if bodies else ():
            tell(line)
        print(f"report    {reported(scene, result, None, None, out)}")
        return GAVE_UP if result.outcome.status is Status.GAVE_UP else NO
    report = None
    if bodies:
        video = out / "run.mp4" if film else None
        scene, result, report = persuaded(
            scene, result, seed, video, gui, partial(Scene.plan, memory=remembered, mode=mode)
        )
    show(result if report is None else report)
    if memory and (report is None or report.verified):
        with undisturbed(memory):
            if has_content(memory):  # others may have learned meanwhile
                remembered = Memory.load(memory, scene)
            remembered.learn(scene, result)
            remembered.save(memory)
    files = written(scene, result, report, remembered if memory else None, out)
    for what, path in {"memory": memory, **files}.items() if memory else files.items():
        print(f"{what:<9} {path}")
    return YES if report is None or report.verified else NO


def persuaded(
    scene: Scene, result: Result, seed: int, video: Path | None, gui: bool, plan: Callable[[Scene], Result]
) -> tuple[Scene, Result, Report]:
    """Return the first plan that physics doesn't refute, with what is known by then, and what physics says of it.

    What a planner of motions refutes is known to the next plan, and kept if there is one.
    """
    report = verified(scene, result, seed, video, gui)
    while refuted := refuted_in(scene, report):
        known = knowing(scene, refuted)
        tell(f"refuted: {refuted[-1]}; planning anew")
        another = plan(known)
        if another.outcome.plan is None or another.plan.primitives == result.plan.primitives:
            break
        keep(scene, refuted)
        scene, result = known, another
        report = verified(scene, result, seed, video, gui)
    return scene, result, report


def verified(scene: Scene, result: Result, seed: int, video: Path | None, gui: bool = False) -> Report:
    """Return what physics says of a plan, with a progress bar on stderr meanwhile."""
    steps = result.plan.primitives
    tell(f"carrying out {len(steps)} primitives in physics" + (" and filming them" if video else ""))
    with progress("carrying out", len(steps)) as advance:

        def before(done: int, step: object) -> None:
            advance(str(step), bool(done))
            if done and done % TOLD == 0:
                tell(f"{done} of {len(steps)} primitives done")

        return scene.verify(result, seed=seed, video=video, gui=gui, progress=before)


def reported(scene: Scene, result: Result, report: Report | None, learned: Memory | None, out: Path) -> Path:
    """Write the report of a run, and return where it lies."""
    from confab.page.data import page_data
    from confab.page.frozen import write_page

    return write_page(out / "report.html", page_data(scene, result, report, learned=learned))


def written(scene: Scene, result: Result, report: Report | None, learned: Memory | None, out: Path) -> dict[str, Path]:
    """Write plan and report, of what was carried out verdicts and observed facts too, and return what lies where."""
    paths = {"plan": result.save(out / "plan.json"), "report": reported(scene, result, report, learned, out)}
    if report is None:
        return paths
    paths |= {"verdicts": out / "verify.json", "observed": out / "observed.ttl"}
    write_whole(paths["verdicts"], json.dumps(report.json(), indent=1) + "\n")
    seen = report.rollouts[0].state
    assert_observed(scene.knowledge, seen, scene.names)
    save_observed(paths["observed"], seen, scene.names, scene.iri)
    if report.video is not None:
        paths |= {"video": report.video, "stills": report.video.with_suffix("")}
    return paths
