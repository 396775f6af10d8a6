"""The claims of the paper about its task: expansions with and without hierarchy, search time, and time of the first call."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from statistics import median
from time import perf_counter

from confab.planner.hierarchical.planner import plan as hierarchical_plan
from confab.planner.paper.hierarchy import plan as paper_plan
from confab.planner.plan import Limits, Outcome
from confab.reasoner.graph.knowledge import load
from confab.reasoner.reading.problem import read

FLAT_LIMIT = 100_000
REPEATS = 7


def main() -> None:
    """Print the expansions per level, and the times."""
    problem = read(load("beverage-serving")).problem
    print("| planner | status | expansions per level | in all |\n|---|---|---|---|")
    _row("paper mode, hierarchical", paper_plan(problem))
    _row("default mode", hierarchical_plan(problem))
    lowest = problem.domain.levels[-1]
    begin = perf_counter()
    _row(
        f"flat A* on level {lowest}, same f",
        paper_plan(problem, limits=Limits(expansions=FLAT_LIMIT), levels=[lowest]),
    )
    print(f"\nThe flat search took {perf_counter() - begin:.0f} s to its limit of {FLAT_LIMIT} expansions.\n")

    print("| time | median of 7 |\n|---|---|")
    print(f"| paper mode, search in process | {1e3 * _median(lambda: paper_plan(problem)):.1f} ms |")
    print(
        f"| default mode, search in process, compiling included | {1e3 * _median(lambda: hierarchical_plan(problem)):.1f} ms |"
    )
    for mode in ("guarded", "paper"):
        print(f"| `confab plan beverage-serving --mode {mode}`, cold process | {_median(_cold(mode)):.2f} s |")


def _cold(mode: str) -> Callable[[], object]:
    command = [sys.executable, "-c", "from confab.cli import main; main()", "plan", "beverage-serving", "--mode", mode]
    return lambda: subprocess.run(command, check=True, capture_output=True)


def _row(name: str, outcome: Outcome) -> None:
    expanded = {level: counts.expanded for level, counts in outcome.search.items()}
    print(f"| {name} | {outcome.status.value} | {expanded} | {sum(expanded.values())} |", flush=True)


def _median(call: Callable[[], object]) -> float:
    times = []
    for _ in range(REPEATS):
        begin = perf_counter()
        call()
        times.append(perf_counter() - begin)
    return median(times)
