"""Plans of about 150 problems, saved as JSON or compared with an earlier run: statuses, lengths and CPU seconds.

python -m benchmarks compared
COMPARED_TO=before.json …       save the results in the file
COMPARED_WITH=before.json …     compare with the results in the file
COMPARED_ONLY=families,scenes   kinds: families, scenes, hierarchies, tables (all by default)
COMPARED_MORE=a.ttl,b.ttl       further scenes
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from functools import partial
from math import exp, log
from pathlib import Path
from statistics import mean
from time import process_time
from typing import Any

import confab
from confab.ontology import scenes
from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Limits
from confab.planner.validation import validate
from confab.reasoner.problem import Problem
from worlds.families import family, random_table
from worlds.hierarchies import hierarchy

LIMIT = Limits(seconds=float(os.environ.get("COMPARED_SECONDS", "10")), shortening="repeated")
FAMILIES = ("served", "handover", "swap", "rotate", "full", "blocked")
LEAST = 0.05
"""Minimum CPU seconds of a call for the comparison of times, since shorter times are too inexact."""
Made = tuple[str, Callable[[], Problem]]


def problems() -> Iterator[Made]:
    """Yield the names of the problems, and functions that make them."""
    kinds = os.environ.get("COMPARED_ONLY", "families,scenes,hierarchies,tables").split(",")
    if "families" in kinds:
        cases = [(name, n, 2) for name in FAMILIES for n in (4, 10, 20, 50)]
        cases += [(name, 20, 8) for name in ("served", "swap", "rotate", "full")]
        cases += [(name, 200, 2) for name in ("served", "rotate")]
        yield from ((f"{name} {n} by {hands}", partial(family, name, n, 100, hands)) for name, n, hands in cases)
    if "scenes" in kinds:
        yield from ((f"scene {name}", partial(scene, name)) for name in sorted(scenes()))
    for path in filter(None, os.environ.get("COMPARED_MORE", "").split(",")):
        yield f"scene {Path(path).stem}", partial(scene, path)
    if "hierarchies" in kinds:
        yield from ((f"hierarchy {seed}", partial(hierarchy, seed)) for seed in range(60))
    if "tables" in kinds:
        yield from ((f"table {seed}", partial(random_table, seed)) for seed in range(20))


def scene(source: str) -> Problem:
    """Return the problem of a scene."""
    return confab.load(source).problem


def measured(problem: Problem) -> list[Any]:
    """Return the status, the number of steps of each level, and CPU seconds of the first plan and of the whole call."""
    begin = process_time()
    first = plan(problem, limits=LIMIT, improve=0)
    middle = process_time()
    outcome = plan(problem, limits=LIMIT)
    end = process_time()
    if outcome.plan is not None and (faults := validate(problem, outcome.plan)):
        return [f"WRONG: {faults[0].text}", [], middle - begin, end - middle]
    lengths = [] if outcome.plan is None else [outcome.plan.length.get(level, 0) for level in problem.domain.levels]
    primitives = len(first.plan.primitives) if first.plan is not None else 0
    return [str(outcome.status.value), lengths, round(middle - begin, 3), round(end - middle, 3), primitives]


def main() -> None:
    """Print the problems whose results differ, and the mean ratios."""
    found: dict[str, list[Any]] = {}
    before = json.loads(Path(path).read_text()) if (path := os.environ.get("COMPARED_WITH")) else {}
    print("| problem | before | now | CPU s before | now |\n|---|---|---|---|---|")
    for name, make in problems():
        found[name] = measured(make())
        old, new = before.get(name, found[name]), found[name]
        slow = max(old[3], new[3]) > 2 * max(min(old[3], new[3]), 0.25)
        if old[:2] != new[:2] or slow:
            print(f"| {name} | {told(old)} | {told(new)} | {old[2]} {old[3]} | {new[2]} {new[3]} |", flush=True)
        if to := os.environ.get("COMPARED_TO"):
            Path(to).write_text(json.dumps(found, indent=0))
    pairs = [(before.get(name, new), new) for name, new in found.items()]
    lengths = [new[1][-1] / old[1][-1] for old, new in pairs if old[1] and new[1] and old[1][-1]]
    print(f"\n{len(pairs)} problems; statuses that differ: {sum(old[0] != new[0] for old, new in pairs)}")
    print(f"mean length ÷ before: {mean(lengths):.4f}; worst {max(lengths):.2f}; best {min(lengths):.2f}")
    for column, what in ((2, "first plan"), (3, "whole call")):
        ratios = [max(new[column], LEAST) / max(old[column], LEAST) for old, new in pairs]
        print(
            f"CPU ÷ before, {what}: {exp(mean(map(log, ratios))):.3f}; in all {sum(n[column] for _, n in pairs):.1f} s"
        )


def told(row: list[Any]) -> str:
    """Return a text of the status and the number of steps of each level."""
    return f"{row[0]} {' / '.join(map(str, row[1]))}"
