"""Trajectories of a verified plan as JSON or YAML, for robots and other simulators (docs/physics.md)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from confab.accepting import AnyPlan, plan_of
from confab.physics import require_skills
from confab.reasoner.files import write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import TRAJECTORIES, stamped
from confab.reasoner.symbols import PrimitiveStep
from confab.sim.engine import RATE
from confab.sim.together import perform_together
from confab.sim.trajectory import Recorder, exported
from confab.sim.verdict import Verdict
from confab.sim.verify import expectations, verify
from confab.sim.world import PhysicsWorld

if TYPE_CHECKING:
    from confab.scene import Scene

FORMATS = (".json", ".yaml", ".yml")


def trajectories(scene: Scene, plan: AnyPlan | None = None, seed: int = 0, both_hands: bool = False) -> dict[str, Any]:
    """Execute a plan in PyBullet, and return its trajectories.

    Parameters
    ----------
    scene : Scene
    plan : Plan, Result or name of a file, optional
        The plan; by default a new plan.
    seed : int
        Seed of the rollout.
    both_hands : bool
        Whether to execute the plan with all hands at once; the times of primitives then overlap.

    Returns
    -------
    dict
        A mapping with the keys ``scene``, ``seed``, ``rate`` (in hertz) and ``primitives`` (see
        `confab.sim.trajectory.exported`).

    Raises
    ------
    KnowledgeError
        The plan fails in physics, a robot has a driving base, or the scene has no geometry.
    """
    scene.settle()
    chosen: AnyPlan = scene.plan() if plan is None else plan
    steps = plan_of(chosen, scene.problem).primitives
    require_skills(scene, [step.behavior for step in steps])
    driving = [robot.name for robot in scene.embodiment.robots if robot.driving]
    if driving:
        raise KnowledgeError(
            f"{driving[0]} drives; trajectories are those of arms and hands, without the paths of a base"
        )
    recorder, embodiment, initial = Recorder(), scene.embodiment, scene.problem.initial
    verdicts: list[tuple[PrimitiveStep, Verdict]]
    slots: list[tuple[PrimitiveStep, float, float]]
    try:
        expected = expectations(scene.problem, steps)
        if both_hands:
            with PhysicsWorld(embodiment, initial, seed, watch=recorder) as world:
                done = perform_together(world, scene.problem, steps)
            verdicts = list(zip((slot.step for slot in done.slots), done.verdicts, strict=True))
            slots = [(one.step, one.begin, one.end) for one in done.slots]
        else:
            rollout = verify(embodiment, initial, steps, expected, seed=seed, watch=recorder)
            verdicts, slots, now = [(report.step, report.verdict) for report in rollout.steps], [], 0.0
            for report in rollout.steps:
                slots.append((report.step, now, now + report.seconds))
                now += report.seconds
    except ValueError as error:
        raise KnowledgeError(str(error)) from error
    for step, verdict in verdicts:
        if not verdict.ok:
            raise KnowledgeError(f"the plan fails in physics at {step}: {verdict}; nothing is exported")
    return {"scene": scene.iri, "seed": seed, "rate": RATE, "primitives": list(exported(embodiment, recorder, slots))}


def write_trajectories(path: Path, data: Mapping[str, Any]) -> None:
    """Write trajectories as JSON if the path's suffix is ``.json``, otherwise as YAML."""
    write_whole(path, json.dumps(data) + "\n" if path.suffix == ".json" else stamped(TRAJECTORIES, _yaml(data)))


def _yaml(value: Any, indent: int = 0) -> Iterator[str]:
    """Yield a value as lines of YAML: mappings and sequences of mappings in block style, other values in flow style."""
    space = "  " * indent
    if isinstance(value, Mapping) and _nested(value):
        for key, inner in value.items():
            if _nested(inner):
                yield f"{space}{key}:\n"
                yield from _yaml(inner, indent + 1)
            else:
                yield f"{space}{key}: {_flow(inner)}\n"
    elif isinstance(value, list) and _nested(value):
        for inner in value:
            if _nested(inner):
                first, *rest = _yaml(inner, indent + 1)
                yield f"{space}- {first.lstrip()}"
                yield from rest
            else:
                yield f"{space}- {_flow(inner)}\n"
    else:
        yield f"{space}{_flow(value)}\n"


def _flow(value: Any) -> str:
    """Return a value in YAML's flow style. Numbers are written without exponents, since YAML 1.1 reads 1e-05 as a text."""
    if isinstance(value, float):
        return f"{value:.9f}".rstrip("0") + "0" * value.is_integer()
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_flow(inner)}' for key, inner in value.items())}}}"
    return f"[{', '.join(map(_flow, value))}]" if isinstance(value, list) else json.dumps(value)


def _nested(value: Any) -> bool:
    """Return whether a value is written in YAML's block style."""
    if isinstance(value, Mapping):
        return any(isinstance(inner, Mapping | list) for inner in value.values())
    return isinstance(value, list) and any(isinstance(inner, Mapping) for inner in value)
