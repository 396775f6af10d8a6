"""What each tuned constant of the planner is worth: halved and doubled, what becomes of lengths, expansions and time.

CONFAB_ROOMS names the rooms in `planner/` whose constants are tried (hierarchical if left out), CONFAB_SEEDS how many random worlds
of levels. Each run is a process of its own on a copy of the planner in which the one number is another, so that nothing is patched.
"""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from planner.hierarchical.planner import plan
from planner.plan import Limits
from worlds.families import FAMILIES, family, random_table
from worlds.hierarchies import hierarchy

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("ontology", "reasoner", "planner", "worlds", "benchmarks")
SIZES = (4, 10, 16)
FIRST = 4_000_000
LENGTH, EFFORT, TIME = 0.002, 0.05, 0.25
"""A change of so much, as a share, counts: of primitives, of expansions, and (which is noisy) of CPU seconds."""


@dataclass(frozen=True)
class Constant:
    """A number in a module: its name, which of the numbers under that name, and where it stands."""

    path: Path
    name: str
    number: int
    node: ast.Constant

    def __str__(self) -> str:
        """Return room, module and name."""
        room = self.path.relative_to(ROOT / "planner")
        return f"{room}: {self.name}" + (f" [{self.number}]" if self.number else "")


def constants(room: Path) -> Iterator[Constant]:
    """Yield the numbers that the modules of a room give names in capitals."""
    for path in sorted(room.glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            for target in targets:
                names = (
                    [ast.unparse(e) for e in target.elts] if isinstance(target, ast.Tuple) else [ast.unparse(target)]
                )
                values = node.value.elts if isinstance(node.value, ast.Tuple) and len(names) > 1 else [node.value]  # type: ignore[attr-defined]
                if not all(name.isupper() for name in names):
                    continue
                for name, value in zip(names, values, strict=False):
                    found = [
                        n for n in ast.walk(value) if isinstance(n, ast.Constant) and type(n.value) in (int, float)
                    ]
                    yield from (Constant(path, name, i, n) for i, n in enumerate(found))


def changed(text: str, node: ast.Constant, factor: float) -> str:
    """Return a module's text with another number; a whole number stays one, and doesn't become nothing."""
    old = node.value
    assert isinstance(old, int | float)
    new = max(1, round(old * factor)) if isinstance(old, int) else old * factor
    lines = text.splitlines(keepends=True)
    line = lines[node.lineno - 1].encode()
    lines[node.lineno - 1] = (line[: node.col_offset] + str(new).encode() + line[node.end_col_offset :]).decode()
    return "".join(lines)


def measured() -> dict[str, float]:
    """Return what planning of all worlds comes to."""
    seeds = int(os.environ.get("CONFAB_SEEDS", "200"))
    problems = [family(name, n) for name in FAMILIES for n in SIZES if name != "packed" or n < 16]
    problems += [random_table(seed) for seed in range(FIRST, FIRST + 20)]
    problems += [hierarchy(seed) for seed in range(FIRST, FIRST + seeds)]
    found = {"solved": 0, "unsolvable": 0, "primitives": 0, "expansions": 0}
    begin = process_time()
    for problem in problems:
        outcome = plan(problem, limits=Limits(expansions=20_000))
        found[outcome.status.value] = found.get(outcome.status.value, 0) + 1
        found["primitives"] += len(outcome.plan.primitives) if outcome.plan else 0
        found["expansions"] += sum(counts.expanded for counts in outcome.search.values())
    return {**found, "seconds": process_time() - begin}


def with_change(constant: Constant | None, factor: float) -> dict[str, float]:
    """Return what is measured with a constant multiplied by a factor."""
    with TemporaryDirectory() as folder:
        for name in COPIED:
            shutil.copytree(ROOT / name, Path(folder, name), ignore=shutil.ignore_patterns("__pycache__"))
        if constant is not None:
            path = Path(folder) / constant.path.relative_to(ROOT)
            path.write_text(changed(path.read_text(encoding="utf-8"), constant.node, factor), encoding="utf-8")
        code = "import json; from benchmarks.constants import measured; print(json.dumps(measured()))"
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": folder},
            capture_output=True,
            text=True,
        )
    if done.returncode:
        return {}
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return result


def verdict(base: dict[str, float], found: dict[str, float]) -> str:
    """Return what a change does, in a few words; nothing if that can't be measured."""
    if not found:
        return "fails"
    said = []
    if (found["solved"], found["unsolvable"]) != (base["solved"], base["unsolvable"]):
        said.append(f"{found['solved']:.0f} solved, {found['unsolvable']:.0f} unsolvable")
    for what, least in (("primitives", LENGTH), ("expansions", EFFORT), ("seconds", TIME)):
        ratio = found[what] / base[what]
        if abs(ratio - 1) > least:
            said.append(f"{what} × {ratio:.3f}" if what == "primitives" else f"{what} × {ratio:.2f}")
    return ", ".join(said)


def main() -> None:
    """Print the table: each constant, and what halving and doubling it changes."""
    base = with_change(None, 1.0)
    print(", ".join(f"{what} {value:.0f}" for what, value in base.items()), "\n")
    print("| constant | value | halved | doubled |\n|---|---|---|---|")
    for room in os.environ.get("CONFAB_ROOMS", "hierarchical").split(","):
        for constant in constants(ROOT / "planner" / room):
            half, double = (verdict(base, with_change(constant, factor)) for factor in (0.5, 2.0))
            print(f"| {constant} | {constant.node.value!r} | {half or 'nothing'} | {double or 'nothing'} |", flush=True)
