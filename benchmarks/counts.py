"""Plan lengths, expansions and fallbacks, which are equal on every machine, and CPU seconds.

python -m benchmarks counts
CONFAB_COUNTS=worlds …       tables: families, worlds (both by default)
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from statistics import median
from time import process_time

import confab
from confab.ontology import scenes
from confab.planner.plan import Outcome
from confab.reasoner.generate import write_scene
from confab.reasoner.problem import Problem

FAMILIES = ("served", "handover", "swap", "rotate", "full", "blocked")
SIZES, SEED = (4, 10, 20, 50), 100
REPEATS, LONG = 3, 1.0  # a longer call is measured once


def main() -> None:
    """Print the tables."""
    for name in os.environ.get("CONFAB_COUNTS", "families,worlds").split(","):
        print(flush=True)
        {"families": families, "worlds": worlds}[name]()


def families() -> None:
    """Plan several times for tables of all families, and print a row for each table."""
    print("| family | n | status | steps per level | expansions per level | fallbacks | CPU s of `scene.plan()` |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for family in FAMILIES:
            for n in SIZES:
                path = Path(folder) / f"{family}-{n}.ttl"
                write_scene(path, family, n, 2, 0, SEED)
                print(f"| {family} | {n} | {measured(str(path))} |", flush=True)


def worlds() -> None:
    """Print a table of plans for the shipped worlds of `docs/worlds.md`."""
    print("| scene | status | steps per level | expansions per level | fallbacks | CPU s of `scene.plan()` |")
    print("|---|---|---|---|---|---|")
    for small in sorted(name for name in scenes() if name.endswith("-small")):
        for name in (small, small.replace("-small", "-large")):
            print(f"| {name} | {measured(name)} |", flush=True)


def measured(source: str) -> str:
    """Return the table cells of one scene, which is loaded again before each call."""
    seconds: list[float] = []
    while len(seconds) < REPEATS and sum(seconds) < LONG:
        scene = confab.load(source)
        begin = process_time()
        result = scene.plan()
        seconds.append(process_time() - begin)
    return f"{row(result.problem, result.outcome)} | {median(seconds):.2f}"


def row(problem: Problem, outcome: Outcome) -> str:
    """Return the table cells of an outcome: status, steps and expansions of each level, and fallbacks."""
    steps = outcome.plan.length if outcome.plan else {}
    lengths = " / ".join(str(steps.get(level, 0)) for level in problem.domain.levels) if outcome.plan else "–"
    expanded = " / ".join(str(count.expanded) for _, count in sorted(outcome.search.items())) or "–"
    return f"{outcome.status.value} | {lengths} | {expanded} | {outcome.fallbacks}"
