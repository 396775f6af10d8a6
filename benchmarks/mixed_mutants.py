"""The share of small faults in recognition, proofs and checkers that random worlds detect.

`benchmarks.mutants` draws the faults. A separate process with one fault judges the worlds until a result is wrong that is right
without the fault. The results are stored in a file, so that a later run can continue.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import sys
import warnings
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from benchmarks.mutants import ROOT, Instead, faults, meaning
from worlds.interpreter import Interpreter, TooManyStatesError
from worlds.mixed import RandomWorld, drawn

CHECKERS = sorted(f"planner/{file.name}" for file in (ROOT / "planner").glob("checked_*.py"))
PARTS: dict[str, dict[str, str]] = {
    "recognition": {"reasoner/reading/relevance.py": "guarded"},
    "proofs": {"planner/hierarchical/unsolvability.py": "guarded", "planner/certifying.py": "proofs"},
    "checker of plans": dict.fromkeys(("planner/validation.py", *CHECKERS), "checker"),
    "checker of certificates": dict.fromkeys(
        ("planner/certificate_checks.py", "planner/possibilities.py"), "certificates"
    ),
}
"""The modules of each part, each with the mode in which worlds are judged.

A planner that gives up in a world without a plan counts as a fault of a proof.
"""
WITHOUT_PLANS = ("proofs", "checker of certificates")
"""Parts whose faults are mostly detected by worlds without a plan, which are judged first."""
FIRST, WORLDS, SECONDS, WAITING = 8_000_000, 150, 60, 600.0
"""First seed and number of worlds, CPU seconds for all worlds, and seconds by the clock for a call on a busy machine."""
Drawn = tuple[RandomWorld, Interpreter]


def kills(many: int, into: Path) -> None:
    """Try `many` faults in each part, and print the share of detected faults."""
    into.mkdir(parents=True, exist_ok=True)
    record = into / "mixed-mutants.json"
    known: dict[str, dict[str, str]] = json.loads(record.read_text("utf-8")) if record.is_file() else {}
    worlds = [drawn(seed) for seed in range(FIRST, FIRST + WORLDS)]
    print("| part | module | faults tried | noticed | share |\n|---|---|---|---|---|")
    for part, files in PARTS.items():
        useful = sorted(worlds, key=lambda one: hopeless(one[1]) is not (part in WITHOUT_PLANS))
        total = [0, 0]
        for file, mode in files.items():
            source = (ROOT / file).read_text("utf-8")
            its = known.setdefault(f"{file} {hashlib.sha256(meaning(source).encode()).hexdigest()[:12]}", {})
            before = complained(file, source, useful, mode, set())
            if not isinstance(before, set):
                raise SystemExit(f"{file}: the worlds can't be judged without any fault")
            share = -(-many // len(files))
            for (name, number), text in islice(faults(source, Random(file)), share):
                key = f"{name.removeprefix('core/')}:{number}"
                if key not in its:
                    found = complained(file, text, useful, mode, before)
                    line = next(
                        n for o, n in zip(source.splitlines(), [*text.splitlines(), ""], strict=False) if o != n
                    )
                    its[key] = "noticed" if not isinstance(found, set) or found else f"survived: {line.strip()}"
                    record.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", "utf-8")
                    print(file, key, its[key], file=sys.stderr, flush=True)
            noticed = sum(said == "noticed" for said in its.values())
            total = [total[0] + len(its), total[1] + noticed]
            print(f"| {part} | `{file}` | {len(its)} | {noticed} | {noticed / max(len(its), 1):.0%} |", flush=True)
        print(f"| {part} | **all** | {total[0]} | {total[1]} | {total[1] / max(total[0], 1):.0%} |", flush=True)


def hopeless(meant: Interpreter) -> bool:
    """Return whether a world has no plan."""
    try:
        return meant.explored(meant.problem.domain.levels[-1], 2_000).least is None
    except TooManyStatesError:
        return False


def complained(file: str, text: str, worlds: Sequence[Drawn], mode: str, before: set[str]) -> set[str] | None:
    """Return the complaints with a changed text of a module: all, or the first new complaint, or None if the process fails."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns about forks with threads
        child = os.fork()
    if child == 0:
        code = 1
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
            os.close(reading)
            with open(os.devnull, "w") as nowhere:  # noqa: PTH123
                os.dup2(nowhere.fileno(), 1)
                os.dup2(nowhere.fileno(), 2)
            faulty = Instead(file, text)
            sys.meta_path.insert(0, faulty)
            found = judge(worlds, mode, lambda said: bool(before) and said not in before)
            if sys.modules[faulty.name].__loader__ is faulty:  # otherwise the worlds were judged without the fault
                os.write(writing, json.dumps(sorted(found)).encode())
                code = 0
        finally:
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading) as answer:
        said = answer.read()
    _, state = os.waitpid(child, 0)
    if not (os.WIFEXITED(state) and os.WEXITSTATUS(state) == 0):
        return None
    return {one for one in json.loads(said) if not before or one not in before}


def judge(worlds: Sequence[Drawn], mode: str, enough: Callable[[str], bool]) -> set[str]:
    """Judge worlds in one mode until `enough` is true for a complaint (a found fault); return the complaints and call results."""
    from worlds import judging

    judging.SECONDS = WAITING
    found: set[str] = set()
    with TemporaryDirectory() as folder:
        for world, meant in worlds:
            its = judging.Judge(world, Path(folder), only=mode, meant=meant).judged()
            said = {
                f"{world.seed} {one.kind} {one.mode}"
                for one in (*its.complaints, *its.remarks)
                if one.kind != "gave-up" or hopeless(meant)
            }
            found |= said | {f"{world.seed} judged"}
            if any(map(enough, said)):
                break
    return found


if __name__ == "__main__":
    kills(int(sys.argv[1]), Path(sys.argv[2]))
