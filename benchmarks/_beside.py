"""Comparison of whole planning processes with other planners, and of the costs of optimal plans with Fast Downward."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median

from benchmarks.pddl import Run, planners, run
from confab.planner.hierarchical import bounds as optimal
from confab.planner.plan import Limits
from confab.planner.plan_costs import cost_of
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import load
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read

HERE = Path(__file__).parent
SHORT, LONG, PROVING = 60, 300, 20
"""Limits in CPU seconds: of a process, of lama-first on the handwritten encoding from 50 objects on, and of a proof of cost."""
RUNS, QUICK = 3, 5.0
"""Number of runs for a median, and the CPU seconds below which a run is repeated."""

Row = tuple[float | None, int | None, int]
"""CPU seconds and number of steps, both None without a plan, and the time limit in seconds."""


class Rows:
    """Measurements by planner, encoding and size, stored in the file `CONFAB_PEER_ROWS` if this variable is set."""

    def __init__(self) -> None:
        self.file = Path(os.environ["CONFAB_PEER_ROWS"]) if "CONFAB_PEER_ROWS" in os.environ else None
        self.known: dict[str, Row] = {}
        if self.file is not None and self.file.exists():
            self.known = {key: tuple(row) for key, row in map(json.loads, self.file.open())}

    def get(self, key: str, measure: Callable[[], Row]) -> Row:
        """Return the stored row of a key, or measure and store the row."""
        if key not in self.known:
            self.known[key] = measure()
            if self.file is not None:
                with self.file.open("a") as lines:
                    lines.write(json.dumps([key, self.known[key]]) + "\n")
        return self.known[key]


def served(folder: str, n: int, seed: int) -> tuple[Path, Problem]:
    """Write a scene of the family `served`, and return its file and its problem."""
    path = Path(folder) / f"served-{n}.ttl"
    write_scene(path, "served", n, 2, 0, seed)
    return path, read(load(str(path))).problem


def beside_peers(python: str, seed: int) -> None:
    """Print CPU seconds and steps of whole processes, and the ratio of each planner's time to confab's.

    The other planners get two encodings: a handwritten domain, which favours them (see `_tabletop.pddl`), and the output of
    `confab export`. A planner that finds no plan in time at one size isn't tried on larger problems of the same encoding.
    """
    commands, rows = planners(python), Rows()
    print("| n | confab plan | steps | planner | encoding | CPU s | steps | times ours |")
    print("|---|---|---|---|---|---|---|---|")
    failed: set[tuple[str, str]] = set()
    for n in (4, 10, 20, 50, 100):
        with tempfile.TemporaryDirectory() as folder:
            path, problem = served(folder, n, seed)
            ours, length, _ = rows.get(f"confab {n}", lambda: whole_process(path))  # noqa: B023
            exported = to_pddl(problem)
            problem_file, domain_file = Path(folder) / "problem.pddl", Path(folder) / "domain.pddl"
            problem_file.write_text(exported.problem)
            domain_file.write_text(exported.domain)
            for encoding, domain in (("by hand", HERE / "_tabletop.pddl"), ("exported", domain_file)):
                for name in ("lama-first", "pyperplan"):
                    cap = LONG if name == "lama-first" and encoding == "by hand" and n >= 50 else SHORT
                    if (name, encoding) in failed:
                        seconds, steps, said = None, None, "not tried"
                    else:
                        seconds, steps, cap = rows.get(
                            f"{name} {encoding} {n}",
                            lambda: medians(commands[name], domain, problem_file, cap),  # noqa: B023
                        )
                        said = f"> {cap}" if seconds is None else f"{seconds:.2f}"
                    times = (
                        f"{seconds / ours:.1f}"
                        if seconds and ours
                        else f"> {cap / ours:.0f}"
                        if said[0] == ">" and ours
                        else "–"
                    )
                    if seconds is None:
                        failed.add((name, encoding))
                    print(
                        f"| {n} | {ours:.2f} | {length} | {name} | {encoding} | {said} | {steps or '–'} | {times} |",
                        flush=True,
                    )


def medians(command: Sequence[str], domain: Path, problem: Path, cap: int) -> Row:
    """Return the median of one or more runs of a planner; quick runs are repeated."""
    runs = [run(command, domain, problem, cap)]
    while runs[0].plan is not None and runs[0].seconds < QUICK and len(runs) < RUNS:
        runs.append(run(command, domain, problem, cap))
    plan = runs[0].plan
    return (median(r.seconds for r in runs), len(plan), cap) if plan is not None else (None, None, cap)


def whole_process(path: Path) -> Row:
    """Return the median of several runs of `confab plan --json`, each in a new process."""
    command = [str(Path(sys.executable).with_name("confab")), "plan", str(path), "--json"]
    runs: list[Run] = [run(command, path, path, SHORT) for _ in range(RUNS)]
    output = runs[0].output
    steps = json.loads(output[output.index("{") :])["length"]["3"] if "{" in output else None
    return median(r.seconds for r in runs), steps, SHORT


def optimal_costs(python: str, seed: int) -> None:
    """Compare the costs that `confab plan --optimal` proves with Fast Downward's optimal costs; exit if costs differ."""
    commands = planners(python)
    downward = [w for w in commands["lama-first"] if w not in ("--alias", "lama-first")]
    command = [*downward, "--search", "astar(lmcut())"]
    print("| family | n | cost | bound proved | CPU s | astar(lmcut()) | CPU s |")
    print("|---|---|---|---|---|---|---|")
    different = []
    for family, n in ((f, n) for f in ("served", "swap", "rotate", "full", "handover", "blocked") for n in (2, 3, 4)):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{family}-{n}.ttl"
            try:
                write_scene(path, family, n, 2, 0, seed)
                problem = read(load(str(path))).problem
            except ValueError:
                continue  # the family has no table of this size
            exported = to_pddl(problem)
            files = [Path(folder) / name for name in ("domain.pddl", "problem.pddl")]
            for file, text in zip(files, (exported.domain, exported.problem), strict=True):
                file.write_text(text)
            outcome = optimal.plan(problem, limits=Limits(expansions=10**7, seconds=PROVING))
            cost = cost_of(problem, outcome.plan) if outcome.plan is not None else None
            peer = run(command, files[0], files[1], PROVING)
            theirs = len(peer.plan) if peer.plan is not None else None
            print(
                f"| {family} | {n} | {cost or 0:.0f} | {outcome.bound or 0:.0f} | {outcome.seconds:.1f} | "
                f"{theirs or '–'} | {peer.seconds:.1f} |",
                flush=True,
            )
            if theirs is not None and (
                cost is None or (outcome.bound or 0) > theirs or (cost == outcome.bound and cost != theirs)
            ):
                different.append(f"{family} {n}")
    if different:
        sys.exit(f"optimal costs differ: {', '.join(different)}")
