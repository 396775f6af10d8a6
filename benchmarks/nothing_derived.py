"""The cost of the code for derived situations and amounts in scenes without derived situations and amounts.

python -m benchmarks nothing_derived
CONFAB_PAIRS=10 …            number of calls with and without this code, which alternate in one process

In the calls without this code, the scene isn't queried for definitions, property chains and rules, and no rule is compiled. A
value meets a goal only if it equals the goal value, not if it lies within bounds.
"""

from __future__ import annotations

import gc
import operator
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from statistics import median
from time import process_time
from unittest.mock import patch

import confab
from benchmarks.before import SEED
from confab.reasoner.generate import write_scene
from confab.reasoner.reading import frame, schema

CASES = (("served", 50), ("handover", 50), ("served", 200), ("served", 1000))
"""Families of scenes, and numbers of objects."""
PART = re.compile(
    r"\n  UNION \{(?:(?!\n  UNION ).)*BIND\(\"(?:expression|axiom|swrl|range)\" AS \?part\)(?:(?!\n  UNION |\n\}).)*",
    re.DOTALL,
)
"""Pattern of the parts of the schema query that only derived situations and amounts need."""
COMPARING = (
    "confab.planner.hierarchical.few_steps",
    "confab.planner.hierarchical.refinement",
    "confab.planner.hierarchical.scope",
    "confab.planner.hierarchical.call",
    "confab.planner.hierarchical.planner",
    "confab.planner.validation",
)
"""Modules that compare values with goal values."""


@contextmanager
def without() -> Iterator[None]:
    """Remove the code for derived situations and amounts from the planner until the end of the block."""
    left, parts = PART.subn("", schema.SCHEMA)
    assert parts == 4, f"wanted 4 parts of the query, found {parts}"
    with ExitStack() as stack:
        stack.enter_context(patch.object(schema, "SCHEMA", left))
        stack.enter_context(patch.object(frame, "_rules", lambda *_: {}))
        for name in COMPARING:
            stack.enter_context(patch.object(import_module(name), "meets", operator.eq))
        yield


def call(path: Path) -> tuple[float, int]:
    """Return the CPU seconds of a whole call and the length of its plan."""
    gc.collect()
    begin = process_time()
    found = confab.load(path).plan()
    return process_time() - begin, len(found.plan.primitives)


def main() -> None:
    """Print the table."""
    pairs = int(os.environ.get("CONFAB_PAIRS", "10"))
    print("| family | n | primitives | CPU s | without that code | ratio, median | ratio of least times |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for family, n in CASES:
            path = Path(folder) / f"{family}.ttl"
            write_scene(path, family, n, 2, 0, SEED)
            call(path)
            now, bare = list[float](), list[float]()
            for i in range(pairs):
                for kind in (now, bare) if i % 2 else (bare, now):
                    with ExitStack() as stack:
                        if kind is bare:
                            stack.enter_context(without())
                        seconds, steps = call(path)
                        kind.append(seconds)
            ratio = median(a / b for a, b in zip(now, bare, strict=True))
            cells = f"{median(now):.3f} | {median(bare):.3f} | {ratio:.3f} | {min(now) / min(bare):.3f}"
            print(f"| {family} | {n} | {steps:,} | {cells} |", flush=True)
