"""Plans in physics, at the front desk: from a scene to rollouts, and what to show of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planner.plan import Plan
from reasoner.graph import KnowledgeError
from sim.verify import Rollout, expectations
from sim.verify import verify as verify_once
from sim.world import Perturbation, World
from sim.world import Step as PrimitiveStep

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.tree import Tree

    from confab.scene import Scene


@dataclass(frozen=True)
class Report:
    """What physics said about a plan: one or more rollouts, and the film of the first."""

    plan: Plan
    rollouts: tuple[Rollout, ...]
    video: Path | None = None

    @property
    def verified(self) -> bool:
        """Whether every rollout did what the plan promises."""
        return all(rollout.ok for rollout in self.rollouts)

    def json(self) -> dict[str, Any]:
        """Return the report as JSON data (docs/command-line.md)."""
        status = "verified" if self.verified else "failed"
        return {"status": status, "rollouts": [rollout.as_json() for rollout in self.rollouts]}

    def notes(self) -> dict[tuple[int, ...], str]:
        """Return what the first rollout that failed, else the first, says of each step, by the step's path."""
        shown = next((r for r in self.rollouts if not r.ok), self.rollouts[0])
        return {report.step.path: "✓" if report.verdict.ok else f"✗ {report.verdict}" for report in shown.steps}

    def summary(self) -> str:
        """Return one line that says how it went."""
        good = sum(rollout.ok for rollout in self.rollouts)
        first = next((r for r in self.rollouts if not r.ok), self.rollouts[0])
        if first.failure is not None:
            step = first.failure.step
            where = f"at step {'.'.join(map(str, step.path))} ({step}), seed {first.seed}: {first.failure.verdict}"
            return f"failed {where}" + (
                f" ({good} of {len(self.rollouts)} rollouts succeeded)" if len(self.rollouts) > 1 else ""
            )
        poured = ", ".join(f"{share:.0%}" for share in first.poured)
        return (
            f"verified: {len(first.steps)} primitives, poured {poured or 'nothing'}, {first.simulated_seconds:.1f} s simulated"
            f" in {first.cpu_seconds:.1f} CPU s" + (f", {good} rollouts" if good > 1 else "")
        )

    def __rich__(self) -> Tree:
        """Return the plan with a verdict behind each primitive, for rich."""
        from confab.show import plan_tree

        return plan_tree(self.plan, self.summary(), self.notes())

    def __repr__(self) -> str:
        """Return the summary."""
        return self.summary()

    def _repr_html_(self) -> str:
        from confab.show import plan_html

        film = f"<video src='{self.video}' controls width='640'></video>" if self.video else ""
        return f"<p>{self.summary()}</p>{film}{plan_html(self.plan, self.notes())}"


def verify(
    scene: Scene,
    plan: Plan,
    rollouts: int = 1,
    seed: int = 0,
    perturb: bool = False,
    video: Path | None = None,
    prepare: Callable[[World], None] | None = None,
    progress: Callable[[int, PrimitiveStep], None] | None = None,
) -> Report:
    """Carry out the primitives of a plan in PyBullet, once or with several seeds.

    Raises
    ------
    KnowledgeError
        The plan can't be done from the scene's situation, or the scene has no geometry.
    """
    steps = plan.primitives
    try:
        expected = expectations(scene.problem, steps)
    except ValueError as error:
        raise KnowledgeError(str(error)) from error
    once = partial(
        verify_once,
        scene.embodiment,
        scene.problem.initial,
        steps,
        expected,
        perturb=Perturbation() if perturb else None,
        prepare=prepare,
        progress=progress,
    )
    done: list[Rollout] = []
    for number in range(rollouts):
        if number == 0 and video is not None:
            done.append(_filmed(once, seed, video, plan))
        else:
            done.append(once(seed=seed + number))
    return Report(plan, tuple(done), video)


def _filmed(once: Callable[..., Rollout], seed: int, video: Path, plan: Plan) -> Rollout:
    from sim.film import Film

    titles = {step.path: str(step) for step in plan.walk() if step.steps}
    video.parent.mkdir(parents=True, exist_ok=True)
    with Film(video, plan.primitives, titles, stills=video.with_suffix("")) as film:
        return once(seed=seed, watch=film)


def progress_bar() -> Progress:
    """Return a rich progress bar on stderr, which goes away when it is done."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<44}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True)
