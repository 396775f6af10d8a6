"""The cost of derived situations: a scene with three definitions, compared with the same scene with handwritten effects.

python -m benchmarks following
CONFAB_SIZES=66,333 …   numbers of cups; each scene has two places for each cup, and two rooms

Cups stand at places of rooms. Three situations are derived: the room of a cup, whether a place is taken, and whether a cup is
servable (clean and in the hall). Either a property chain and two classes define these situations, or the effects of each
behaviour update them. A tenth of the cups must become servable. Calls with derived situations and calls with handwritten
effects alternate.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from statistics import median
from time import process_time

import confab
from worlds.cups import scene


def main() -> None:
    """Print the table."""
    print(
        "| objects | whole call, defined, CPU s | by hand | ratio | steps, defined | by hand |\n|---|---|---|---|---|---|"
    )
    for cups in map(int, os.environ.get("CONFAB_SIZES", "66,333").split(",")):
        seconds: dict[bool, list[float]] = {True: [], False: []}
        length = {}
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(5 if cups <= 200 else 3):
                for defined in seconds:
                    path = Path(folder) / "cups.ttl"
                    path.write_text(scene(cups, defined), encoding="utf-8")
                    begin = process_time()
                    found = confab.load(path).plan()
                    seconds[defined].append(process_time() - begin)
                    length[defined] = len(found.plan.steps) if found.plan else found.outcome.status.value
        one, other = (median(seconds[defined]) for defined in (True, False))
        print(
            f"| {3 * cups + 2:,} | {one:.2f} | {other:.2f} | {one / other:.2f} | {length[True]} | {length[False]} |",
            flush=True,
        )
