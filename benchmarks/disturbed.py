"""Twenty interventions in PyBullet's world, such as pushed objects, boxes in the way and shut doors.

``python -m benchmarks.disturbed FROM TO [NUMBER …]`` runs all interventions, or the numbered interventions, with perturbed bodies
and seeds FROM to TO - 1. An episode *recovers* if it reaches its goals. An episode *gives up rightly* if the intervention made
every unreached goal impossible, and a reason names the cause. Every other result is wrong.
"""

from __future__ import annotations

import sys
from collections import Counter
from time import process_time

import confab
from confab.planner.acting.episode import End, Episode

CASES: tuple[tuple[str, tuple[str, ...], str], ...] = (
    # pushed beside its place
    ("beverage-serving", ("at=6 push cup2 -3 9",), ""),
    ("beverage-serving", ("at=16 push bottle2 -4 6",), ""),
    ("one-arm-serving", ("at=4 push cup1 6 -6",), ""),
    ("spice-drawer", ("at=3 push lid -2 7",), ""),
    ("centrifuge", ("at=8 push tube2 2 6",), ""),
    # moved to another place
    ("beverage-serving", ("at=9 cup2 LOCATION location8",), ""),
    ("two-cups", ("at=5 cup2 LOCATION location8",), ""),
    # a foreign box on a target, in the hand's way, and on a place that the plan doesn't use
    ("beverage-serving", ("after=22 box location5",), ""),
    ("beverage-serving", ("at=3 box location7",), ""),
    ("beverage-serving", ("after=22 box location5 8x5x15", "after=22 push cup2 -2 9"), ""),
    ("beverage-serving", ("at=5 box location8 14x14x12",), ""),
    ("one-arm-serving", ("at=8 box place5",), ""),
    ("spice-drawer", ("at=3 box left_spot 7x7x9",), ""),
    # a bystander knocked over or taken away
    ("one-arm-serving", ("at=9 knock cup2",), ""),
    ("one-arm-serving", ("at=9 remove cup2",), ""),
    # a door and a lid shut
    ("spice-drawer", ("at=4 door OPENED false",), ""),
    ("centrifuge", ("at=10 cover OPENED false",), ""),
    # needed and knocked over, needed and taken away, and a box on a target that no hand can take
    ("beverage-serving", ("at=7 knock bottle2",), "bottle2 lies"),
    ("beverage-serving", ("after=22 remove cup2",), "cup2 isn't to be seen"),
    ("beverage-serving", ("after=22 box location5 12x12x20",), "blocked by box1"),
)
"""Scene, interventions, and words of the right reason, which are empty if the goals can be reached."""


def outcome(episode: Episode, words: str) -> str:
    """Return the result of an episode: recovered, gave up rightly, or wrong, with the fault."""
    open_ = [str(symbol) for symbol, value in episode.goal.items() if episode.observed.get(symbol) != value]
    reasons = "; ".join(reason.text for reason in episode.reasons)
    if episode.missed:
        return f"wrong: {', '.join(one.text for one in episode.missed)} never came"
    if open_:
        return f"wrong: {', '.join(open_)} is claimed"
    if episode.status is End.REACHED:
        return "recovered"
    if words and words in reasons:
        return "gave up rightly"
    return f"wrong: {episode.status.value}: {reasons}"


def main() -> None:
    """Print a line for each episode, and the number of episodes by result."""
    begin, end, *numbers = (int(word) for word in sys.argv[1:] or ("0", "1"))
    ends = Counter[str]()
    for number in numbers or range(1, len(CASES) + 1):
        name, interventions, words = CASES[number - 1]
        scene = confab.load(name)
        for seed in range(begin, end):
            cpu = process_time()
            run = scene.execute(interventions=interventions, world="pybullet", seed=seed, perturb=True)
            episode, ended = run.episode, outcome(run.episode, words)
            ends[ended.partition(":")[0]] += 1
            failures = ", ".join(failure.code for failure in episode.failures) or "no failures"
            seconds = f"{episode.seconds['simulated']:.0f} s simulated, {process_time() - cpu:.0f} CPU s"
            print(
                f"{number:2} {name}, {' & '.join(interventions)}, seed {seed}: {ended}; {failures}; {seconds}",
                flush=True,
            )
    print(", ".join(f"{count} {ended}" for ended, count in ends.most_common()))


if __name__ == "__main__":
    main()
