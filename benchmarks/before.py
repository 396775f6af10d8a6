"""Comparison of whole calls with an earlier commit; calls of both commits alternate, so that machine load affects both commits.

python -m benchmarks before
CONFAB_BEFORE=f43f953 …      the commit, whose files are extracted from Git into a temporary folder
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import mean

from confab.reasoner.generate import write_scene

ROOT = Path(__file__).resolve().parents[1]
SEED, LONG, LIMIT = 100, 1.0, 60.0
"""Seed of the problems, CPU seconds after which a call isn't repeated, and time limit of a call in seconds."""
CASES = (
    *(("served", n, 2, 0) for n in (4, 50, 200, 1000)),
    ("served", 4, 2, 20_000),
    *((family, 50, 2, 0) for family in ("handover", "swap", "rotate", "full", "blocked")),
    *((family, 20, 8, 0) for family in ("served", "swap", "rotate")),
)
CALL = """
import json, sys, time
import confab, confab.scene
clock, found = time.process_time, []
confab.load("beverage-serving").plan()
while len(found) < 5 and sum(found) < {long}:
    begin = clock()
    scene = confab.load(sys.argv[1])
    middle = clock()
    result = scene.plan(time_limit={limit})
    found.append(clock() - (begin if sys.argv[2] == "whole" else middle))
print(json.dumps([min(found), len(result.plan.primitives) if result.solved else 0]))
"""


def main() -> None:
    """Print a table of both commits, and the mean ratios of plan lengths and times."""
    commit = os.environ.get("CONFAB_BEFORE", "f43f953")
    with tempfile.TemporaryDirectory() as folder:
        before = Path(folder) / "before"
        before.mkdir()
        files = subprocess.run(["git", "-C", str(ROOT), "archive", commit], stdout=subprocess.PIPE, check=True).stdout
        subprocess.run(["tar", "-x", "-C", str(before)], input=files, check=True)
        print(f"| family | n | hands | irrelevant | primitives at {commit} | now | CPU s at {commit} | now | ÷ |")
        print("|---|---|---|---|---|---|---|---|---|")
        lengths, ratios = [], []
        for family, n, hands, clutter in CASES:
            path = Path(folder) / f"{family}.ttl"
            write_scene(path, family, n, hands, clutter, SEED)
            (old, steps), (new, now) = (call(tree, path, bool(clutter)) for tree in (before, ROOT))
            lengths.append(now / steps if steps and now else 1.0)
            ratios.append(new / old)
            cells = f"{steps or '–'} | {now or '–'} | {old:.3f} | {new:.3f} | {new / old:.2f}"
            print(f"| {family} | {n} | {hands} | {clutter:,} | {cells} |", flush=True)
        print(f"| mean | | | | | {mean(lengths):.3f} of it | | | {mean(ratios):.2f} |")


def call(tree: Path, scene: Path, planning: bool) -> tuple[float, int]:
    """Return the least CPU seconds of repeated whole calls, or of planning alone, and the number of primitives of the plan."""
    script = CALL.format(long=LONG, limit=LIMIT)
    line = [sys.executable, "-c", script, str(scene), "plan" if planning else "whole"]
    done = subprocess.run(
        line, env={**os.environ, "PYTHONPATH": str(tree)}, cwd=tree, stdout=subprocess.PIPE, text=True, check=True
    )
    seconds, steps = json.loads(done.stdout)
    return seconds, steps
