"""Physics, measured: the paper's plans with and without beads, stepping alone, and perturbed rollouts.

    python -m benchmarks.physics              the plans of the shipped scenes, and the stepping floor
    python -m benchmarks.physics 5000 5020    perturbed rollouts of the beverage-serving plan, one per seed

Seeds from 5000 are for development: what fails there may be mended. Seeds from 9000 are for reporting only.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np
import pybullet

import confab
from sim.rollouts import Trial, rollouts, wilson
from sim.verify import Rollout, expectations
from sim.world import Perturbation, World

WORKERS = 2
"""Processes that share perturbed rollouts."""


def case(name: str, perturb: Perturbation | None = None, beads: bool = True) -> Trial:
    """Return the plan of a shipped scene, to be rolled out."""
    scene = confab.load(name)
    steps = scene.plan(mode="paper").plan.primitives
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


def stepping_floor(one: Trial, steps: int = 960) -> float:
    """Return CPU milliseconds per bare simulation step of the initial world, all asleep that can be."""
    with World(one.embodiment, one.initial, beads=one.beads) as world:
        begin = time.process_time()
        for _ in range(steps):
            pybullet.stepSimulation(physicsClientId=world.client)
        return (time.process_time() - begin) / steps * 1000


def main() -> None:
    """Print the nominal rollouts of the shipped scenes."""
    for name in ("beverage-serving", "beverage-serving-moved"):
        for beads in (True, False):
            one = case(name, beads=beads)
            print(f"{name:24} {'beads' if beads else 'none ':5}  {line(one.run(0))}")
            print(f"{'':24} bare step {stepping_floor(one):.3f} ms")


def perturbed(seeds: Sequence[int], workers: int | str = WORKERS) -> None:
    """Print perturbed rollouts of the beverage-serving plan, and how many were verified."""
    one, begin = case("beverage-serving", Perturbation()), time.perf_counter()
    done = rollouts(one, seeds, workers, lambda rollout: print(rollout.seed, line(rollout), flush=True))
    good, shares = sum(rollout.ok for rollout in done), [share for rollout in done for share in rollout.poured]
    low, high = wilson(good, len(done))
    print(
        f"{good} of {len(done)} verified (95 % confidence: {low:.1%} to {high:.1%}), mean poured {np.mean(shares):.4f}"
    )
    print(f"{len(done) / (time.perf_counter() - begin) * 60:.1f} rollouts per minute with {workers} workers")


if __name__ == "__main__":
    if len(sys.argv) == 3:
        perturbed(range(int(sys.argv[1]), int(sys.argv[2])))
    else:
        main()
