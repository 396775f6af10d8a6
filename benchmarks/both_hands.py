"""Both hands at once in PyBullet, with poured beads: perturbed episodes, and twenty interventions while both hands move.

python -m benchmarks both_hands
CONFAB_COUNT=100 …      perturbed episodes without interventions; each tenth is also executed with one hand at a time
CONFAB_CASES=1,2,3 …    these interventions only, or none
CONFAB_SEED=1 …         the first seed
"""

from __future__ import annotations

import os
from statistics import mean
from time import process_time

import confab
from benchmarks.disturbed import outcome
from confab.execution import Execution
from confab.scene import Scene
from confab.sim.engine import Engine
from confab.sim.together import LOOKING, arms_touch
from confab.sim.world import PhysicsWorld

SCENE, SERIAL = "beverage-serving", 10
CASES: tuple[tuple[str, str], ...] = (
    ("at=1 push cup2 -3 9", ""),
    ("at=1 cup1 LOCATION location8", ""),
    ("at=1 push bottle1 4 -6", ""),
    ("at=1 remove bottle2", "bottle2 isn't to be seen"),
    ("at=1 box location7", ""),
    ("at=1 goal cup2 LOCATION location8", ""),
    ("at=2.2 cup2 LOCATION location8", ""),
    ("at=2.2 box location8 14x14x12", ""),
    ("at=7 push cup2 -3 9", ""),
    ("at=8 cup2 LOCATION location8", ""),
    ("at=8 knock cup2", "cup2 lies"),
    ("at=8 push cup1 4 -6", ""),
    ("at=8 bottle2 LOCATION location8", ""),
    ("at=8 goal cup1 LOCATION location8", ""),
    ("at=9.5 cup2 LOCATION location1", ""),
    ("at=9.5 box location5", ""),
    ("at=10.5 remove cup2", "cup2 isn't to be seen"),
    ("at=10.5 push bottle2 -4 6", ""),
    ("at=12.5 cup1 LOCATION location8", ""),
    ("at=12.5 bottle1 LOCATION location8", ""),
)
"""Interventions at times at which both hands move, and words of the right reason, which are empty if the goals can be reached."""


def main() -> None:
    """Print a line for each intervention and for each failure, and the table of the perturbed episodes."""
    first, count = int(os.environ.get("CONFAB_SEED", 1)), int(os.environ.get("CONFAB_COUNT", 100))
    chosen = os.environ.get("CONFAB_CASES", ",".join(map(str, range(1, len(CASES) + 1))))
    scene = confab.load(SCENE)
    for number in map(int, filter(None, chosen.split(","))):
        _disturbed(scene, number, first)
    if count:
        _perturbed(scene, range(first, first + count))


def _episode(scene: Scene, seed: int, both_hands: bool, *interventions: str) -> tuple[Execution, float]:
    """Return a perturbed execution, and the seconds during which the arms touched each other."""
    touching = 0

    def look(world: Engine) -> None:
        nonlocal touching
        if world.steps % LOOKING == 0 and arms_touch(world):
            touching += LOOKING

    def prepare(world: PhysicsWorld) -> None:
        world.watch, rates[:] = look, [world.rate]

    rates = [1.0]
    run = scene.execute(
        interventions=interventions, world="pybullet", seed=seed, perturb=True, both_hands=both_hands, prepare=prepare
    )
    return run, touching / rates[0]


def _disturbed(scene: Scene, number: int, seed: int) -> None:
    """Print the result of an episode with one intervention."""
    text, words = CASES[number - 1]
    cpu = process_time()
    run, touching = _episode(scene, seed, True, text)
    episode = run.episode
    moving = max(
        (sum(one.begin < at <= one.end for one in episode.events) for _, at in episode.interventions), default=0
    )
    failures = ", ".join(failure.code for failure in episode.failures) or "no failures"
    print(
        f"{number:2} {text}: {outcome(episode, words)}; hands that moved: {moving}; {failures}; arms in contact "
        f"{touching:.2f} s; {episode.seconds['simulated']:.0f} s simulated, {process_time() - cpu:.0f} CPU s",
        flush=True,
    )


def _perturbed(scene: Scene, seeds: range) -> None:
    """Print the number of perturbed episodes that reach the goals, and the makespan with both hands ÷ with one hand at a time."""
    reached, plain, contact, seconds, ratios = 0, 0, 0.0, list[float](), list[float]()
    for seed in seeds:
        run, touching = _episode(scene, seed, True)
        episode = run.episode
        reached += run.reached
        plain += not episode.failures
        contact += touching
        seconds.append(episode.seconds["simulated"])
        if episode.failures or not run.reached:
            print(f"seed {seed}: {run.summary()}", flush=True)
        if (seed - seeds.start) % SERIAL == 0:
            serial, _ = _episode(scene, seed, False)
            ratios.append(seconds[-1] / serial.episode.seconds["simulated"])
    print(
        "\n| episodes | goals reached | without failure | arms in contact | makespan | makespan ÷ one hand at a time |"
        f"\n|---|---|---|---|---|---|\n| {len(seeds)} | {reached} | {plain} | {contact:.2f} s | {mean(seconds):.1f} s, at most "
        f"{max(seconds):.1f} s | {mean(ratios):.2f}, at most {max(ratios):.2f} ({len(ratios)} episodes) |",
        flush=True,
    )


if __name__ == "__main__":
    main()
