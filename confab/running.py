"""The main job, end to end: validate, plan, verify in physics, learn from it, report."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from confab.memory import Memory, undisturbed
from confab.physics import Report, progress_bar
from confab.reaching import with_reach
from confab.scene import Result, Scene, load
from confab.show import show
from planner.plan import Status
from reasoner.files import write_whole
from reasoner.reading.observed import assert_observed, save_observed
from reasoner.validation.validate import validate

YES, NO, GAVE_UP = 0, 1, 3
TOLD = 8
"""After so many primitives it is said how far the plan is, where there is no progress bar."""


def run(name: str, memory: Path | None, mode: str, seed: int, out: Path, film: bool, gui: bool = False) -> int:
    """Do the main job on a scene and say on stdout what came of it; files go to `out`.

    Returns
    -------
    int
        Exit code: 0 verified, 1 invalid, unsolvable or failed in physics, 3 gave up.

    Raises
    ------
    KnowledgeError
        The scene, or the memory, can't be read.
    """
    tell("validating")
    findings = validate([name])
    if findings:
        print("\n".join(map(str, findings)))
    if any(finding.serious for finding in findings):
        return NO
    tell("loading the scene, and computing what the hands reach if that isn't known")
    scene = with_reach(load(name))
    tell("planning")
    remembered = Memory.load(memory, scene) if memory else Memory.of(scene)
    result = scene.plan(memory=remembered, mode=mode)
    if result.outcome.plan is None:
        show(result)
        return GAVE_UP if result.outcome.status is Status.GAVE_UP else NO
    report = verified(scene, result, seed, out / "run.mp4" if film else None, gui)
    show(report)
    assert_observed(scene.knowledge, report.rollouts[0].state, scene.names)
    target = out / "memory.ttl"
    with undisturbed(target):
        if memory and target.exists() and memory.samefile(target):  # others may have learned meanwhile
            remembered = Memory.load(memory, scene)
        if report.verified:
            remembered.learn(scene, result.plan)
        remembered.save(target)
    for what, path in {"memory": target, **written(scene, result, report, out)}.items():
        print(f"{what:<9} {path}")
    return YES if report.verified else NO


def verified(scene: Scene, result: Result, seed: int, video: Path | None, gui: bool = False) -> Report:
    """Return what physics says of a plan, with a progress bar on stderr meanwhile."""
    steps = result.plan.primitives
    tell(f"carrying out {len(steps)} primitives in physics" + (" and filming them" if video else ""))
    with progress_bar() as bar:
        task = bar.add_task("", total=len(steps))

        def progress(done: int, step: object) -> None:
            bar.update(task, completed=done, description=str(step))
            if done and done % TOLD == 0:
                tell(f"{done} of {len(steps)} primitives done")

        return scene.verify(result.plan, seed=seed, video=video, gui=gui, progress=progress)


def tell(what: str) -> None:
    """Say on stderr what goes on, where no progress bar can be shown."""
    if not sys.stderr.isatty():
        print(f"confab: {what}", file=sys.stderr, flush=True)


def written(scene: Scene, result: Result, report: Report, out: Path) -> dict[str, Path]:
    """Write plan, verdicts, observed facts and report, and return what lies where."""
    from confab.report import report_html

    paths = {
        "plan": result.save(out / "plan.json"),
        "verdicts": out / "verify.json",
        "observed": out / "observed.ttl",
        "report": out / "report.html",
    }
    write_whole(paths["verdicts"], json.dumps(report.json(), indent=1) + "\n")
    save_observed(paths["observed"], report.rollouts[0].state, scene.names, scene.iri)
    write_whole(paths["report"], report_html(scene, result, report))
    if report.video is not None:
        paths |= {"video": report.video, "stills": report.video.with_suffix("")}
    return paths
