"""The command ``confab run``: validate a scene, plan, verify the plan in physics, learn, and write a report."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING

from confab.commands.given import with_changes
from confab.history import RECORD, record
from confab.memory import Memory, undisturbed
from confab.planner.plan import Status
from confab.planner.solve import DEFAULT_MODE, Mode
from confab.planning import Result
from confab.progress import announce, progress
from confab.reaching import has_robot, unreached, with_reach
from confab.reasoner.files import check_replaceable, has_content, made_folder, write_whole
from confab.reasoner.kinds import FILM, MEMORY, OBSERVED, PLAN, REPORT, RUN, VERDICTS
from confab.reasoner.reading.observed import assert_observed, save_observed
from confab.reasoner.validation.findings import listing
from confab.reasoner.validation.validate import validate
from confab.refuting import keep, knowing, refuted_in
from confab.scene import Scene, load
from confab.show import show
from confab.terminal import MISUSE, WITHOUT_PHYSICS, remark

if TYPE_CHECKING:
    from confab.physics import Report

YES, NO, GAVE_UP = 0, 1, 3
TOLD = 8
"""Number of primitives between two lines about the progress of execution, if the output shows no progress bar."""


@dataclass(frozen=True)
class Job:
    """The arguments of `run`: a scene, goals, planning options, a target folder, and options for the film.

    `memory` is the memory file that the run reads and writes, or None. `noise` is the standard deviation of perceived positions
    in metres.
    """

    scene: str
    out: Path
    goals: tuple[str, ...] = ()
    memory: Path | None = None
    mode: Mode = DEFAULT_MODE
    seed: int = 0
    noise: float = 0.0
    film: bool = True
    gui: bool = False

    def command(self, changes: tuple[str, ...] = ()) -> str:
        """Return the command line that repeats the run in the changed scene, without options for output."""
        given = {"--mode": self.mode, "--seed": str(self.seed), "--noise": f"{self.noise:g}"}
        first = {"--mode": DEFAULT_MODE, "--seed": "0", "--noise": "0"}
        options = [part for name, value in given.items() if value != first[name] for part in (name, value)]
        memory = [] if self.memory is None else ["--memory", str(self.memory)]
        return join(
            ["confab", "run", self.scene, *changes, *(f"--goal={goal}" for goal in self.goals), *options, *memory]
        )


def run(job: Job) -> int:
    """Validate a scene, plan, verify the plan in physics, learn from the plan, print the results, and write files.

    If the scene has no robot's body, the plan isn't executed in physics. If PyBullet isn't installed, the plan isn't executed
    either; a remark then states the reason, and the exit code is 2.

    Returns
    -------
    int
        The exit code: 0 for a good plan; 1 for an invalid scene, an unsolvable task or a failure in physics; 2 if the plan isn't
        verified because PyBullet is missing; 3 if planning gave up.

    Raises
    ------
    KnowledgeError
        The scene or the memory can't be read.
    """
    kinds = {"plan.json": PLAN, "report.html": REPORT, "verify.json": VERDICTS, "observed.ttl": OBSERVED}
    for file, kind in {**kinds, "run.mp4": FILM, RECORD: RUN}.items():
        check_replaceable(job.out / file, kind)
    if job.memory is not None:
        check_replaceable(job.memory, MEMORY)
    announce("validating")
    with progress("validating") as advance:
        findings = validate([job.scene], done=lambda what: advance(what, 0))
    if findings:
        print(listing(findings))
    if any(finding.serious for finding in findings):
        return NO
    announce("loading the scene")
    scene = with_changes(load(job.scene))
    bodies = has_robot(scene)
    physics = find_spec("pybullet") is not None
    if bodies and not physics:
        remark(f"the plan won't be verified, filmed or learned from: {WITHOUT_PHYSICS}")
    scene = with_reach(scene) if bodies and physics else scene
    announce("planning")
    with progress("planning"):
        memory = job.memory
        remembered = Memory.load(memory, scene) if memory and has_content(memory) else Memory.of(scene)
        used = None if job.mode == "optimal" else remembered  # the optimal search uses no memory
        result = scene.plan(job.goals, used, job.mode)
    report = None
    if result.outcome.plan is not None and bodies and physics:
        replan = partial(Scene.plan, goals=job.goals, memory=used, mode=job.mode)
        scene, result, report = persuaded(scene, result, job, replan)
    show(result if report is None else report)
    if dearer := result.dearer():
        remark(dearer)
    for line in unreached(scene) if result.outcome.plan is None and bodies and physics else ():
        announce(line)
    good = result.outcome.plan is not None and (report is None or report.verified) and (physics or not bodies)
    if job.memory and good:
        with undisturbed(job.memory):
            if has_content(job.memory):  # another process may have changed the file
                remembered = Memory.load(job.memory, scene)
            remembered.learn(scene, result)
            if report is not None:
                remembered.measure(scene.problem, report)
            remembered.save(job.memory)
    files = written(scene, result, report, remembered if job.memory else None, job)
    for what, path in {"memory": job.memory, **files}.items() if job.memory and good else files.items():
        print(f"{what:<9} {path}")
    if result.outcome.plan is None:
        return GAVE_UP if result.outcome.status is Status.GAVE_UP else NO
    if bodies and not physics:
        return MISUSE
    return YES if good else NO


def persuaded(scene: Scene, result: Result, job: Job, plan: Callable[[Scene], Result]) -> tuple[Scene, Result, Report]:
    """Verify a plan in physics. If the verification refutes the plan, plan and verify again.

    Return the scene with all refutations, the last result of planning, and the report of its verification. Refutations are
    saved if the next plan differs from the refuted plan. With perturbed perception, a failure refutes nothing.
    """
    report = verified(scene, result, job)
    while not job.noise and (refuted := refuted_in(scene, report)):
        known = knowing(scene, refuted)
        announce(f"refuted: {refuted[-1]}; planning again")
        another = plan(known)
        if another.outcome.plan is None or another.plan.primitives == result.plan.primitives:
            break
        keep(scene, refuted)
        scene, result = known, another
        report = verified(scene, result, job)
    return scene, result, report


def verified(scene: Scene, result: Result, job: Job) -> Report:
    """Verify a plan in physics, show the progress on stderr, and return the report."""
    steps = result.plan.primitives
    video = made_folder(job.out) / "run.mp4" if job.film else None
    announce(f"carrying out {len(steps)} primitives in physics" + (" and filming them" if video else ""))
    with progress("carrying out", len(steps)) as advance:

        def before(done: int, step: object) -> None:
            advance(str(step), bool(done))
            if done and done % TOLD == 0:
                announce(f"{done} of {len(steps)} primitives done")

        return scene.verify(result, seed=job.seed, video=video, gui=job.gui, noise=job.noise, progress=before)


def written(scene: Scene, result: Result, report: Report | None, learned: Memory | None, job: Job) -> dict[str, Path]:
    """Write the files of a run, and return their paths by kind.

    Each run has a report and a record. The plan, the verdicts and observed facts of a rollout, and the film are written if they
    are available.
    """
    from confab.page.data import page_data
    from confab.page.frozen import write_page

    out, paths = made_folder(job.out), {}
    if result.outcome.plan is not None:
        paths["plan"] = result.save(out / "plan.json")
    data = page_data(scene, result, report, learned=learned, again=job.command(scene.knowledge.changes))
    paths["report"] = write_page(out / "report.html", data)
    how = {"goals": list(job.goals), "mode": job.mode, "seed": job.seed, "noise": job.noise}
    paths["record"] = record(out, data, how, "" if learned is None else learned.said())
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
