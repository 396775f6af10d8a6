"""Measurements of the simulation: cost of plans and film, determinism, speed by workers, and perturbed rollouts.

    python -m benchmarks.physics              all parts, then perturbed rollouts with development and reporting seeds
    python -m benchmarks.physics plans        the cost of rollouts of shipped scenes compared with PyBullet's steps
    python -m benchmarks.physics film         the cost of filming
    python -m benchmarks.physics same         equal results of a seed in several processes and with several workers
    python -m benchmarks.physics speed        rollouts per minute by workers, and on a Ray cluster
    python -m benchmarks.physics perception   perception compared with the truth in thirty random scenes
    python -m benchmarks.physics 5000 5020    perturbed rollouts of the beverage-serving plan, one per seed
    python -m benchmarks.physics 5000 5020 three-cups    perturbed rollouts of another scene

Seeds from 5000 are for development: code may be changed because of their failures. Seeds from 9000 are for reporting only.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet

import confab
from benchmarks.perception import perception
from confab.sim.rollouts import Trial, rollouts, wilson
from confab.sim.staging import Perturbation
from confab.sim.verify import Rollout, expectations
from confab.sim.world import PhysicsWorld

WORKERS = 2
"""Number of processes that share perturbed rollouts."""


def case(name: str, perturb: Perturbation | None = None, beads: bool = True) -> Trial:
    """Return the trial of a shipped scene's plan."""
    scene = confab.load(name)
    steps = scene.plan().plan.primitives
    return Trial(scene.embodiment, scene.problem.initial, steps, expectations(scene.problem, steps), perturb, beads)


def line(rollout: Rollout) -> str:
    clock, failure = rollout.clock, rollout.failure
    poured = ", ".join(f"{share:.2f}" for share in rollout.poured)
    told = (
        f"{len(rollout.steps)} steps, poured {poured or '-'}"
        if failure is None
        else f"{failure.step}: {failure.verdict}"
    )
    return (
        f"{'verified' if rollout.ok else 'FAILED'}  {rollout.simulated_seconds:5.1f} s simulated  {rollout.cpu_seconds:5.1f} CPU s"
        f" (planning {clock.planning:.2f}, stepping {clock.stepping:.2f})  {told}"
    )


def floor_of(trial: Trial) -> tuple[Rollout, float]:
    """Return a rollout, and the CPU seconds that it spent in PyBullet's simulation steps."""
    bare, spent = pybullet.stepSimulation, 0.0

    def step(**options: int) -> None:
        nonlocal spent
        begin = time.process_time()
        bare(**options)
        spent += time.process_time() - begin

    pybullet.stepSimulation = step
    try:
        return trial.run(0), spent
    finally:
        pybullet.stepSimulation = bare


def plans() -> None:
    """Print the rollouts of shipped scenes, and the ratio of their CPU time to the time of PyBullet's steps."""
    for name in ("beverage-serving", "beverage-serving-moved", "one-arm-serving", "two-cups"):
        for beads in (True, False):
            rollout, floor = floor_of(case(name, beads=beads))
            ratio = rollout.cpu_seconds / floor
            print(
                f"{name:24} {'beads' if beads else 'none ':5}  {line(rollout)}; {ratio:.2f} x stepping alone",
                flush=True,
            )


def film() -> None:
    """Print the CPU time of filming the paper's plan."""
    with TemporaryDirectory() as folder:
        scene = confab.load("beverage-serving")
        (rollout,) = scene.plan().verify(video=Path(folder) / "run.mp4").rollouts
    print(f"film: {rollout.clock.rendering:.1f} CPU s beside {rollout.cpu_seconds:.1f} CPU s for the rollout")


def same_seed() -> None:
    """Print whether a seed gives equal results in several processes and with several workers."""
    one, seeds = case("beverage-serving-moved", Perturbation()), range(5000, 5003)
    alone = rollouts(one, seeds)
    shared = [rollouts(one, seeds, workers) == alone for workers in (2, 3)]
    script = f"from benchmarks.physics import *; print(case({'beverage-serving-moved'!r}, Perturbation()).run(5000).as_json())"
    prints = set()
    for _ in range(3):
        run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        prints.add(re.sub(r"'cpu_seconds': [0-9.]+", "", run.stdout.splitlines()[-1]))
    print(f"seeds {seeds.start} to {seeds.stop - 1}: 2 workers as 1: {shared[0]}, 3 workers as 1: {shared[1]}")
    print(f"seed {seeds.start} in three new processes: {'identical' if len(prints) == 1 else 'DIFFERENT'}")


def speed() -> None:
    """Print rollouts per minute by number of workers, and on a Ray cluster of two nodes if Ray is installed."""
    one, seeds = case("beverage-serving-moved", Perturbation()), range(5000, 5006)
    begin = time.perf_counter()
    alone = rollouts(one, seeds)
    print(f"{len(seeds)} rollouts of 10 primitives, 1 worker: {_per_minute(seeds, begin):.1f} per minute", flush=True)
    for kill in (False, True):
        _timed(f"{WORKERS} workers", one, seeds, alone, WORKERS, kill)
    try:
        from ray.cluster_utils import Cluster
    except ImportError:
        print("Ray isn't installed: no figures on a cluster")
        return
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        cluster.add_node(num_cpus=1)
        os.environ["RAY_ADDRESS"] = cluster.address
        for kill in (False, True):
            _timed("Ray, two nodes", one, seeds, alone, "ray", kill)
    finally:
        os.environ.pop("RAY_ADDRESS", None)
        cluster.shutdown()


def _per_minute(seeds: Sequence[int], begin: float) -> float:
    return len(seeds) / (time.perf_counter() - begin) * 60


def _timed(name: str, one: Trial, seeds: Sequence[int], alone: list[Rollout], workers: int | str, kill: bool) -> None:
    """Print the speed of several workers, of which one may be killed, and whether their results equal those of one process."""
    with TemporaryDirectory() as folder:
        mark = Path(folder) / "died"
        begin = time.perf_counter()
        done = rollouts(replace(one, prepare=partial(die_once, mark)) if kill else one, seeds, workers)
        rate, killed = _per_minute(seeds, begin), ", one killed" if mark.exists() else ""
    print(f"{name}{killed}: {rate:.1f} per minute, the same seed by seed: {done == alone}", flush=True)


def die_once(mark: Path, world: PhysicsWorld) -> None:
    """Kill the process that builds the first world."""
    del world
    try:
        mark.touch(exist_ok=False)
    except FileExistsError:
        return
    os._exit(9)


def perturbed(seeds: Sequence[int], scene: str = "beverage-serving", workers: int | str = WORKERS) -> None:
    """Print perturbed rollouts of a scene's plan, and the number of verified rollouts."""
    one, begin = case(scene, Perturbation()), time.perf_counter()
    done = rollouts(one, seeds, workers, lambda rollout: print(rollout.seed, line(rollout), flush=True))
    good, shares = sum(rollout.ok for rollout in done), [share for rollout in done for share in rollout.poured]
    low, high = wilson(good, len(done))
    print(
        f"{good} of {len(done)} verified (95 % confidence: {low:.1%} to {high:.1%}), mean poured {np.mean(shares):.4f}"
    )
    print(f"{len(done) / (time.perf_counter() - begin) * 60:.1f} rollouts per minute with {workers} workers")


def main() -> None:
    """Print the results of all parts, with the reporting seeds last."""
    for part in (plans, film, same_seed, speed, perception):
        part()
    for title, seeds in (("development", range(5000, 5022)), ("reporting", range(9000, 9100))):
        print(f"perturbed rollouts, {title} seeds")
        perturbed(seeds)


if __name__ == "__main__":
    if len(sys.argv) >= 3:
        perturbed(range(int(sys.argv[1]), int(sys.argv[2])), *sys.argv[3:])
    elif len(sys.argv) == 2:
        parts: dict[str, Callable[[], object]] = {"plans": plans, "film": film, "same": same_seed, "speed": speed}
        (parts | {"perception": perception})[sys.argv[1]]()
    else:
        main()
