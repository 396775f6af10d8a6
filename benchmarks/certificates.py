"""Certificates of unsolvability: their share and kind, the time to check them, and the rejection of corrupted certificates.

    python -m benchmarks certificates       100 worlds of each kind, and 50 corrupted certificates (docs/figures/promises.md)

CERTIFICATES_FROM and CERTIFICATES_COUNT select other worlds.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import process_time
from typing import TypeVar

import confab
from benchmarks import broken_worlds
from confab.plan_options import NO_ENGINE
from confab.planner.certificate_checks import refusal
from confab.planner.certificates import Certificate
from confab.planner.plan import Limits, Outcome, Status
from confab.planner.solve import Request, solve
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import DomainError
from confab.reasoner.problem import Problem
from worlds.agreement import solvable
from worlds.false_certificates import corrupted
from worlds.families import random_table
from worlds.hierarchies import hierarchy
from worlds.mixed import mixed
from worlds.numbers import jugs, rounds
from worlds.scenes import scene

FIRST, COUNT = 4_000_000, 100
CORRUPTED = 50
"""Number of certificates that are corrupted, drawn from all worlds."""
LIMITS = Limits(expansions=20_000, seconds=20.0)
"""Limits of planning for problems without a scene file."""
SECONDS = 20.0
"""Time limit in seconds of planning for a scene."""
DOORS = ("defined", "amounts", "updates")
"""The doors of `benchmarks.fuzz` that break scenes with derived situations, amounts and SPARQL updates."""
Answer = tuple[Problem, Outcome, float]
"""A problem, its outcome, and the CPU seconds of planning."""
T = TypeVar("T")
VALUES: dict[str, Callable[[int], Problem]] = {
    "levels": hierarchy,
    "tables": random_table,
    "jugs": lambda seed: jugs(Random(seed))[0],
    "rounds": lambda seed: rounds(Random(seed))[0],
}
"""Functions from a seed to a problem, by kind."""


class Scenes:
    """Scenes in files of a folder: random worlds, generated unsolvable tables, and broken scenes of the fuzzer."""

    def __init__(self, folder: Path) -> None:
        self.file, self.given = folder / "world.ttl", folder / "given"
        broken_worlds.sources(self.given)

    def random(self, seed: int) -> Path:
        """Write a random world of one to three levels."""
        self.file.write_text(scene(mixed(seed)), encoding="utf-8")
        return self.file

    def unsolvable(self, seed: int) -> Path:
        """Write a table on which no hand reaches the goal place of one cup."""
        self.file.unlink(missing_ok=True)
        confab.generate("unsolvable", self.file, objects=2 + 2 * (seed % 5), seed=seed)
        return self.file

    def broken(self, seed: int) -> Path:
        """Write a readable scene with definitions, amounts or updates that the fuzzer has broken."""
        draw, case = Random(f"certificates {seed}"), self.given.parent / "case"
        while True:
            door = draw.choice(DOORS)
            shutil.rmtree(case, ignore_errors=True)
            shutil.copytree(self.given / draw.choice(broken_worlds.WORLDS[door]), case)
            broken_worlds.DOORS[door][0](draw, case)
            try:
                if confab.load(case / "scene.ttl").problem.goal:
                    return case / "scene.ttl"
            except (KnowledgeError, DomainError):
                continue


def answers(folder: Path, seeds: Iterable[int]) -> Iterator[tuple[str, Iterator[Answer]]]:
    """Yield the answers for each kind of world."""
    scenes = Scenes(folder)
    for name, make in VALUES.items():
        yield name, map(of_value, map(make, seeds))
    for write in (scenes.random, scenes.unsolvable, scenes.broken):
        yield f"scenes: {write.__name__}", of_scenes(write, seeds)


def of_value(problem: Problem) -> Answer:
    """Plan for a problem, and return the answer."""
    outcome, seconds = timed(lambda: solve(Request(problem, limits=LIMITS)))
    return problem, outcome, seconds


def of_scenes(write: Callable[[int], Path], seeds: Iterable[int]) -> Iterator[Answer]:
    """Plan for each scene, and yield the answers; scenes that confab rejects are left out."""
    for seed in seeds:
        try:
            loaded = confab.load(write(seed))
            result, seconds = timed(partial(loaded.plan, engine=NO_ENGINE, time_limit=SECONDS))
        except (KnowledgeError, DomainError):
            continue
        yield result.problem, result.outcome, seconds


def timed(call: Callable[[], T]) -> tuple[T, float]:
    """Return the result of a call and its CPU seconds."""
    begin = process_time()
    return call(), process_time() - begin


def main() -> int:
    """Print shares, kinds and times of certificates, and the results for corrupted certificates; return 1 on a fault."""
    first, count = int(os.environ.get("CERTIFICATES_FROM", FIRST)), int(os.environ.get("CERTIFICATES_COUNT", COUNT))
    proved: list[tuple[Problem, Certificate]] = []
    wrong = 0
    print(
        "| worlds | planned | unsolvable | certified | by facts, a pair, cases | gave up | of these without a plan "
        "| checking ÷ planning |"
    )
    print("|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory(prefix="confab-certificates-") as folder:
        for name, found in answers(Path(folder), range(first, first + count)):
            kinds, number, unsolvable, gave_up, hopeless, planning, checking = Counter[str](), 0, 0, 0, 0, 0.0, 0.0
            for problem, outcome, seconds in found:
                number += 1
                if outcome.status is Status.GAVE_UP:
                    gave_up += 1
                    hopeless += solvable(problem, most=3_000) is False
                if outcome.status is not Status.UNSOLVABLE:
                    continue
                unsolvable += 1
                if outcome.certificate is None:
                    continue
                said, took = timed(partial(refusal, problem, outcome.certificate))
                if said is None:
                    checking, planning = checking + took, planning + seconds
                    kinds[outcome.certificate.kind] += 1
                    proved.append((problem, outcome.certificate))
            certified = sum(kinds.values())
            wrong += unsolvable - certified
            print(
                f"| {name} | {number} | {unsolvable} | {certified} | {kinds['facts']}, {kinds['pair']}, {kinds['cases']} "
                f"| {gave_up} | {hopeless} | {checking / max(planning, 1e-9):.3f} |",
                flush=True,
            )
    rng, refused, accepted = Random(1), Counter[str](), Counter[str]()
    rng.shuffle(proved)
    for problem, certificate in proved:
        drawn = [*corrupted(problem, certificate, rng)]
        fewest = min((refused[what] + accepted[what], what) for what, _ in drawn)[1]
        bad = dict(drawn)[fewest]
        (accepted if refusal(problem, bad) is None else refused)[fewest] += 1
        if sum(refused.values()) + sum(accepted.values()) == CORRUPTED:
            break
    print("\n| corrupted certificates | refused | accepted |\n|---|---|---|")
    for what in sorted({*refused, *accepted}):
        print(f"| {what} | {refused[what]} | {accepted[what]} |")
    print(f"| **all** | {sum(refused.values())} | {sum(accepted.values())} |")
    return int(bool(wrong or accepted))


if __name__ == "__main__":
    sys.exit(main())
