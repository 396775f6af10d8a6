"""The effects of halving and doubling each constant of the planner on plan lengths, expansions and time.

Each run is a separate process on a copy of the planner with one changed number. The problems of a run depend on the folder of the
constant (`INSTRUMENTS`). CONFAB_ROOMS names the folders in `planner/` that are measured, all by default. With CONFAB_ROWS=FILE,
results are stored in the file, and stored results aren't measured again.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from shutil import copytree, ignore_patterns
from tempfile import TemporaryDirectory
from time import process_time
from typing import TypeAlias

from benchmarks.execution import KINDS, after_intervention, random_intervention, served
from confab.planner.acting.repair import repair_or_replan
from confab.planner.experience import advice
from confab.planner.grounded.best_first import plan_level
from confab.planner.hierarchical.call import compiled
from confab.planner.hierarchical.planner import plan
from confab.planner.hierarchical.unsolvability import impossible
from confab.planner.paper.hierarchy import plan as paper_plan
from confab.planner.plan import Limits, Outcome
from worlds.families import FAMILIES, family, random_table
from worlds.hierarchies import hierarchy
from worlds.lessons import taught
from worlds.trials import Trial, rest_after

ROOT = Path(__file__).resolve().parents[1]
SIZES = (4, 10, 16, 40)
FIRST = 4_000_000
LENGTH, EFFORT, TIME = 0.002, 0.05, 0.4
"""Minimum relative changes that count: of primitives, of expansions, and of CPU seconds, which are noisy."""


@dataclass(frozen=True)
class Constant:
    """A constant in a module: name, index among the numbers of the name, syntax node and description."""

    path: Path
    name: str
    number: int
    node: ast.Constant
    said: str

    def __str__(self) -> str:
        """Return the name of the constant, with an index if the name stands for several numbers."""
        return self.name + (f" [{self.number}]" if self.number else "")

    def times(self, factor: float) -> float:
        """Return the number multiplied by a factor; a whole number is rounded, and is at least 1."""
        old = self.node.value
        assert isinstance(old, int | float)
        return max(1, round(old * factor)) if isinstance(old, int) and old else old * factor


def constants(room: Path) -> Iterator[Constant]:
    """Yield the numeric constants, with names in capitals, of the modules of a folder."""
    for path in sorted(room.glob("*.py")):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for node, following in zip(body, [*body[1:], ast.Pass()], strict=True):
            if not isinstance(node, ast.Assign):
                continue
            for target in node.targets:
                names = (
                    [ast.unparse(e) for e in target.elts] if isinstance(target, ast.Tuple) else [ast.unparse(target)]
                )
                value = node.value
                values = value.elts if isinstance(value, ast.Tuple) and len(names) > 1 else [value]
                if not all(name.isupper() for name in names):
                    continue
                for name, given in zip(names, values, strict=False):
                    found = [
                        n for n in ast.walk(given) if isinstance(n, ast.Constant) and type(n.value) in (int, float)
                    ]
                    yield from (Constant(path, name, i, n, comment(following)) for i, n in enumerate(found))


def comment(node: ast.stmt) -> str:
    """Return the docstring of an assignment in one line."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return " ".join(node.value.value.split())
    return ""


def changed(text: str, constant: Constant, factor: float) -> str:
    """Return a module's text with the constant multiplied by a factor."""
    lines, node = text.splitlines(keepends=True), constant.node
    line = lines[node.lineno - 1].encode()
    new = str(constant.times(factor)).encode()
    lines[node.lineno - 1] = (line[: node.col_offset] + new + line[node.end_col_offset :]).decode()
    return "".join(lines)


# ---------------------------------------------------------------------------------------------------------- what is planned

Row: TypeAlias = "tuple[str, int, int]"
"""Status of a call, and numbers of primitives and expansions."""


def row(outcome: Outcome) -> Row:
    """Return the status, primitives and expansions of an outcome."""
    primitives = len(outcome.plan.primitives) if outcome.plan else 0
    return outcome.status.value, primitives, sum(counts.expanded for counts in outcome.search.values())


def planned() -> Iterator[Row]:
    """Plan for families, tables and hierarchical worlds in the default mode."""
    problems = [family(name, n) for name in FAMILIES for n in SIZES if name != "packed" or n < 16]
    problems += [random_table(seed) for seed in range(FIRST, FIRST + 20)]
    problems += [hierarchy(seed) for seed in range(FIRST, FIRST + 200)]
    for problem in problems:
        yield row(plan(problem, limits=Limits(expansions=20_000)))


def flat() -> Iterator[Row]:
    """Plan for the lowest level alone of families and hierarchical worlds."""
    problems = [family(name, 4) for name in FAMILIES if name != "packed"]
    problems += [hierarchy(seed) for seed in range(FIRST, FIRST + 40)]
    for problem in problems:
        yield row(plan_level(problem, limits=Limits(expansions=3_000)))


def led() -> Iterator[Row]:
    """Plan for tables with a memory of smaller tables."""
    memory = taught(("served", "swap", "handover"))
    for name in ("served", "swap", "handover", "full", "blocked"):
        for n in (8, 16):
            for mode in ("guarded", "strict"):
                yield row(advice.plan(family(name, n, 1), memory, mode, Limits(expansions=20_000)))


def repaired() -> Iterator[Row]:
    """Repair a plan after interventions of all kinds, and yield the cost of each repair."""
    trial = Trial.of(served(10))
    for seed in range(80):
        random, kind = Random(seed), KINDS[seed % len(KINDS)]
        position, happening = random_intervention(trial, random, kind)
        before = replace(trial.problem, initial=trial.states[position])
        now, rest = after_intervention(before, happening), rest_after(trial.plan, position)
        done = repair_or_replan(now, rest, before, None, compiled(now), True, Limits(expansions=20_000))
        yield ("gave-up" if done.steps is None else "solved"), round(done.cost), int(done.kind == "replan")


def on_paper() -> Iterator[Row]:
    """Plan for small worlds in the paper's mode."""
    for seed in range(FIRST, FIRST + 40):
        yield row(
            paper_plan(
                hierarchy(seed),
                limits=Limits(expansions=5_000),
                proof=lambda problem, states, deadline: impossible(problem),
            )
        )


INSTRUMENTS: Mapping[str, tuple[Callable[[], Iterator[Row]], ...]] = {
    "hierarchical": (planned,),
    "grounded": (planned, flat),
    "experience": (led,),
    "acting": (repaired,),
    "paper": (on_paper,),
    "": (planned,),
}
"""The functions that measure the constants of a folder of `planner/`."""


def measured(room: str) -> dict[str, float]:
    """Return the summed results of all measurements of a folder."""
    found: dict[str, float] = {"solved": 0, "unsolvable": 0, "gave-up": 0, "primitives": 0, "expansions": 0}
    begin = process_time()
    for instrument in INSTRUMENTS[room]:
        for status, primitives, expansions in instrument():
            found[status] += 1
            found["primitives"] += primitives
            found["expansions"] += expansions
    return {**found, "seconds": process_time() - begin}


def with_change(room: str, constant: Constant | None, factor: float) -> dict[str, float]:
    """Return the results with a constant multiplied by a factor; an empty result if the run fails."""
    with TemporaryDirectory() as folder:
        for path in ROOT.iterdir():
            if path.is_dir() and not path.name.startswith(".") and path.name != "planner":
                Path(folder, path.name).symlink_to(path)
        copytree(ROOT / "planner", Path(folder, "planner"), ignore=ignore_patterns("__pycache__"))
        if constant is not None:
            path = Path(folder) / constant.path.relative_to(ROOT)
            path.write_text(changed(path.read_text(encoding="utf-8"), constant, factor), encoding="utf-8")
        code = f"import json; from benchmarks.constants import measured; print(json.dumps(measured({room!r})))"
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": folder, "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
        )
    result: dict[str, float] = {} if done.returncode else json.loads(done.stdout.splitlines()[-1])
    return result


def verdict(base: Mapping[str, float], found: Mapping[str, float]) -> str:
    """Return a short description of the effect of a change; empty if there is no measurable effect."""
    if not found:
        return "fails"
    said = []
    if any(found[status] != base[status] for status in ("solved", "unsolvable")):
        said.append(
            f"{found['solved'] - base['solved']:+.0f} solved, {found['unsolvable'] - base['unsolvable']:+.0f} proved"
        )
    for what, least in (("primitives", LENGTH), ("expansions", EFFORT), ("seconds", TIME)):
        ratio = found[what] / base[what] if base[what] else 1.0
        if abs(ratio - 1) > least:
            said.append(f"{what} × {ratio:.3f}" if what == "primitives" else f"{what} × {ratio:.2f}")
    return ", ".join(said) or "nothing"


def main() -> None:
    """Print a table for each folder with the constants, their descriptions, and the effects of halving and doubling."""
    file = Path(os.environ["CONFAB_ROWS"]) if "CONFAB_ROWS" in os.environ else None
    known: dict[str, dict[str, float]] = json.loads(file.read_text()) if file is not None and file.exists() else {}

    def asked(room: str, constant: Constant | None, factor: float) -> dict[str, float]:
        key = f"{room}; {constant} = {constant.node.value!r} × {factor}" if constant else room
        if key not in known:
            known[key] = with_change(room, constant, factor)
            if file is not None:
                file.write_text(json.dumps(known, indent=0))
        return known[key]

    for room in os.environ.get("CONFAB_ROOMS", ",".join(INSTRUMENTS)).split(","):
        base = asked(room, None, 1.0)
        print(f"\nplanner/{room}: " + ", ".join(f"{what} {value:.0f}" for what, value in base.items()), "\n")
        print("| constant | value | what it is, and trades | halved | doubled |\n|---|---|---|---|---|")
        module, before = None, ""
        for constant in constants(ROOT / "planner" / room):
            said = [
                verdict(base, asked(room, constant, factor)) if constant.times(factor) != constant.node.value else "–"
                for factor in (0.5, 2.0)
            ]
            if constant.path != module:
                module = constant.path
                print(f"| `{module.relative_to(ROOT)}` | | | | |")
            text = "as above" if constant.said and constant.said == before else constant.said
            before = constant.said
            print(f"| {constant} | {constant.node.value!r} | {text} | {' | '.join(said)} |", flush=True)
