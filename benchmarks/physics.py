"""Physics, measured: the paper's plans with and without beads, stepping alone, and perturbed rollouts.

    python -m benchmarks.physics              the plans of the shipped scenes, and the stepping floor
    python -m benchmarks.physics 5000 5020    perturbed rollouts of the beverage-serving plan, one per seed

Seeds from 5000 are for development: what fails there may be mended. Seeds from 9000 are for reporting only.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import pybullet

import confab
from planner.plan import Step
from reasoner.embodiment import Embodiment
from reasoner.symbols import State
from sim.verify import Rollout, expectations, verify
from sim.world import Perturbation, World


@dataclass(frozen=True)
class Case:
    """What `sim.verify.verify` takes."""

    embodiment: Embodiment
    initial: State
    steps: Sequence[Step]
    expected: Sequence[State]

    def rollout(self, seed: int = 0, perturb: Perturbation | None = None, beads: bool = True) -> Rollout:
        """Carry the plan out once."""
        return verify(self.embodiment, self.initial, self.steps, self.expected, seed=seed, perturb=perturb, beads=beads)


def case(name: str) -> Case:
    scene = confab.load(name)
    steps = scene.plan(mode="paper").plan.primitives
    return Case(scene.embodiment, scene.problem.initial, steps, expectations(scene.problem, steps))


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


def stepping_floor(one: Case, beads: bool, steps: int = 960) -> float:
    """Return CPU milliseconds per bare simulation step of the initial world, all asleep that can be."""
    with World(one.embodiment, one.initial, beads=beads) as world:
        begin = time.process_time()
        for _ in range(steps):
            pybullet.stepSimulation(physicsClientId=world.client)
        return (time.process_time() - begin) / steps * 1000


def main() -> None:
    """Print the nominal rollouts of the shipped scenes."""
    for name in ("beverage-serving", "beverage-serving-moved"):
        one = case(name)
        for beads in (True, False):
            print(f"{name:24} {'beads' if beads else 'none ':5}  {line(one.rollout(beads=beads))}")
            print(f"{'':24} bare step {stepping_floor(one, beads):.3f} ms")


def perturbed(seeds: Sequence[int]) -> None:
    one, good = case("beverage-serving"), 0
    shares: list[float] = []
    for seed in seeds:
        rollout = one.rollout(seed, Perturbation())
        good, shares = good + rollout.ok, [*shares, *rollout.poured]
        print(seed, line(rollout), flush=True)
    print(f"{good} of {len(seeds)} verified, mean poured {sum(shares) / max(len(shares), 1):.3f}")


if __name__ == "__main__":
    if len(sys.argv) == 3:
        perturbed(range(int(sys.argv[1]), int(sys.argv[2])))
    else:
        main()
