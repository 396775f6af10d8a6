"""Small random worlds with all constructs, planned in every mode and compared with a search of all states.

    python -m benchmarks.mixed                    judge COUNT worlds from seed FIRST
    python -m benchmarks.mixed --from 5000000 --count 100000 --workers 2 --into FOLDER
    python -m benchmarks.mixed --mutants 100      print the share of 100 small faults per part that the worlds detect
    python -m benchmarks.mixed --seed 5000123     judge one world with all checks, and print its scene

An interrupted run can be continued with the same folder. The folder has the results of each stretch (range of seeds),
and a small world for each fault. The exit code is 1 if a fault was found.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from worlds.features import features
from worlds.judging import Complaint, Judge, Judged
from worlds.mixed import RandomWorld, drawn, mixed
from worlds.scenes import scene
from worlds.shrinking import shrunk

FIRST, COUNT, STRETCH = 1_000_000, 1_000, 250
SHARES = {
    "constrained": 0.3,
    "mutual": 0.2,
    "priced": 0.2,
    "everyone": 0.1,
    "repeated": 0.2,
    "nested": 0.1,
    "negated": 0.15,
    "wished": 0.1,
    "several": 0.1,
    "partial": 0.1,
    "ternary": 0.1,
    "overlapping": 0.15,
    "extended": 0.1,
    "local": 0.15,
}
"""Shares of worlds with a constraint on every state, with situation types that define each other, with costs that depend on
amounts, with a goal about all individuals of a class, with behaviours that change a situation type by several effects, with
totals of totals, with goals that exclude a value or an amount, with soft goals that aren't among the goals, with several
constraints on every state or on the order of states, with numbers that only some pairs have, with situation types of three
arguments, with classes that share individuals or are defined, with behaviours that extend others, and with variables that are
local to groups of conditions or to effects."""
SHRUNK = 2
"""Number of worlds that each process shrinks for each kind of fault."""
SHOWN, MUTANTS = 6, 100
SAMPLE = 25
"""Sampling interval: one of this number of worlds is examined for the effects of its features."""


def signature(one: Complaint) -> str:
    """Return a text by which different faults are distinguished as far as possible."""
    detail = one.text.split(":")[0] if one.kind == "crash" else ""
    mode = one.mode.split(" ")[0] if one.mode.startswith("export") else one.mode
    return " | ".join(part for part in (one.kind, mode, detail) if part)


def judged(seed: int, folder: Path, every: bool = False) -> Judged:
    """Judge the world of a seed, and return the result."""
    return Judge(mixed(seed, **SHARES), folder, every).judged()


def stretch(first: int, count: int, into: Path | None, known: dict[str, int]) -> dict[str, Any]:
    """Judge `count` worlds, shrink worlds with faults, and return the results."""
    begin = time.process_time()
    found: dict[str, Any] = {
        "first": first, "count": count, "wrong": {}, "remarks": {}, "truth": Counter(), "lengths": Counter(),
        "levels": Counter(), "status": Counter(), "seconds": Counter(), "features": Counter(), "decisive": Counter(),
    }  # fmt: skip
    with TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            world, meant = drawn(seed, **SHARES)
            its = Judge(world, Path(folder), meant=meant).judged()
            note(found, seed, world, its)
            for one in its.complaints:
                said = signature(one)
                if into is not None and known.get(said, 0) < SHRUNK:
                    known[said] = known.get(said, 0) + 1
                    write(world, one, into, Path(folder))
    found["cpu"] = time.process_time() - begin
    return found


def note(found: dict[str, Any], seed: int, world: RandomWorld, its: Judged) -> None:
    """Add the result of a world to the results of a stretch."""
    for kind, ones in (("wrong", its.complaints), ("remarks", its.remarks)):
        for said in dict.fromkeys(map(signature, ones)):
            found[kind].setdefault(said, []).append(seed)
    found["truth"]["unknown" if not its.known else "none" if its.least is None else "some"] += 1
    found["lengths"][str(its.length)] += 1
    found["levels"][str(len(world.problem.domain.levels))] += 1
    if seed % SAMPLE == 0 and its.known:
        found["features"]["worlds"] += 1
        for name, decisive in features(world, its.least):
            found["features"][name] += 1
            found["decisive"][name] += decisive
    for mode, status in its.status.items():
        found["status"][f"{mode}: {status}"] += 1
    for mode, seconds in its.seconds.items():
        found["seconds"][mode] += seconds


def write(world: RandomWorld, one: Complaint, into: Path, folder: Path) -> Path:
    """Shrink a world with a fault, and write the scene of the small world; return its path."""
    said = signature(one)

    def still(smaller: RandomWorld) -> bool:
        try:
            complaints = Judge(smaller, folder, only=one.mode).judged().complaints
        except Exception:  # the smaller world can't be judged
            return False
        return any(signature(other) == said for other in complaints)

    small = shrunk(world, still, 20.0 if one.kind != "endless" else 60.0) if still(world) else world
    again = Judge(small, folder, only=one.mode).judged()
    words = next((other for other in again.complaints if signature(other) == said), one)
    name = "".join(c if c.isalnum() else "-" for c in said)[:80]
    file = into / name / f"{world.seed}.ttl"
    file.parent.mkdir(parents=True, exist_ok=True)
    head = f"# seed {world.seed}: {words.kind} ({words.mode}) {words.text}\n# least cost by exhaustive search: {again.least}\n"
    file.write_text(head + scene(small), encoding="utf-8")
    return file


def _stretch(job: tuple[int, int, Path | None, dict[str, int]]) -> dict[str, Any]:
    return stretch(*job)


def run(first: int, count: int, workers: int, into: Path | None) -> dict[str, Any]:
    """Judge worlds in stretches, continuing an earlier run into the same folder, and return the total results."""
    done: dict[int, dict[str, Any]] = {}
    record = None
    if into is not None:
        into.mkdir(parents=True, exist_ok=True)
        record = into / "stretches.jsonl"
        for line in record.read_text("utf-8").splitlines() if record.is_file() else ():
            one = json.loads(line)
            done[one["first"]] = one
    every = [(at, min(STRETCH, first + count - at)) for at in range(first, first + count, STRETCH)]
    known: dict[str, int] = {}
    for one in done.values():
        for said in one["wrong"]:
            known[said] = SHRUNK
    jobs = [(at, many, into, known) for at, many in every if done.get(at, {}).get("count") != many]
    total: dict[str, Any] = {}
    for at, many in every:
        if done.get(at, {}).get("count") == many:
            add(total, done[at])

    def came(one: dict[str, Any]) -> None:
        add(total, one)
        known.update(dict.fromkeys(one["wrong"], SHRUNK))
        if record is not None:
            with record.open("a", encoding="utf-8") as file:
                file.write(json.dumps(one) + "\n")
        print(
            f"{one['first']} + {one['count']}: {one['cpu']:.0f} s, wrong: {_short(one['wrong'])}",
            file=sys.stderr,
            flush=True,
        )

    if workers < 2:
        for job in jobs:
            came(stretch(*job))
    else:
        with get_context("spawn").Pool(workers, maxtasksperchild=8) as pool:
            for one in pool.imap_unordered(_stretch, jobs):
                came(one)
    return total


def _short(wrong: dict[str, list[int]]) -> str:
    return ", ".join(f"{said} {len(seeds)}" for said, seeds in sorted(wrong.items())) or "nothing"


def add(total: dict[str, Any], one: dict[str, Any]) -> None:
    """Add the results of a stretch to the total."""
    for key in ("wrong", "remarks"):
        for said, seeds in one[key].items():
            total.setdefault(key, {}).setdefault(said, []).extend(seeds)
    for key in ("truth", "lengths", "levels", "status", "seconds", "features", "decisive"):
        total.setdefault(key, Counter()).update(one[key])
    for key in ("count", "cpu"):
        total[key] = total.get(key, 0) + one[key]


def table(total: dict[str, Any]) -> None:
    """Print the results of all worlds."""
    count = total["count"]
    truth, lengths = total["truth"], total["lengths"]
    print(
        f"{count} worlds; {truth['some']} can be solved, {truth['none']} can't, {truth['unknown']} are too large to tell. ",
        end="",
    )
    print(f"CPU: {1e3 * total['cpu'] / count:.0f} ms a world.\n")
    print("| steps of the longest plan | " + " | ".join(sorted(lengths, key=int)) + " |")
    print("|---" * (len(lengths) + 1) + "|")
    print("| worlds | " + " | ".join(str(lengths[n]) for n in sorted(lengths, key=int)) + " |\n")
    print("| mode | " + " | ".join(STATUS) + " | CPU ms each |\n|---" + "|---" * (len(STATUS) + 1) + "|")
    for mode in dict.fromkeys(key.split(": ")[0] for key in sorted(total["status"])):
        row = [total["status"].get(f"{mode}: {status}", 0) for status in STATUS]
        print(
            f"| {mode} | {' | '.join(map(str, row))} | {1e3 * total['seconds'].get(mode, 0) / max(sum(row), 1):.1f} |"
        )
    sampled = total["features"].pop("worlds", 0)
    print(
        f"\n| Of {sampled} worlds these have, and in these it decides whether or at what cost the goal is reached | has | decides |"
    )
    print("|---|---|---|")
    for name, has in sorted(total["features"].items(), key=lambda pair: -total["decisive"][pair[0]]):
        print(f"| {name} | {has / sampled:.0%} | {total['decisive'][name] / sampled:.1%} |")
    for key, title in (("wrong", "What is wrong"), ("remarks", "Not wrong")):
        print(f"\n| {title} | worlds | per 1,000 | seeds |\n|---|---|---|---|")
        for said, seeds in sorted(total.get(key, {}).items(), key=lambda pair: -len(pair[1])):
            shown = ", ".join(map(str, sorted(seeds)[:SHOWN]))
            print(f"| {said.replace(' | ', ', ')} | {len(seeds)} | {1e3 * len(seeds) / count:.2f} | {shown} |")


STATUS = ("solved", "unsolvable", "gave-up", "refused", "crash", "endless", "reached", "impossible")


def main(arguments: Sequence[str] = ()) -> int:
    """Judge the requested worlds, and print the results; return 1 if a fault was found."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mixed")
    parser.add_argument("--from", dest="first", type=int, default=FIRST)
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--into", type=Path)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--mutants", type=int, nargs="?", const=MUTANTS)
    asked = parser.parse_args(arguments)
    if asked.mutants is not None:
        words = [
            str(asked.mutants),
            str(asked.into or "confab-out"),
        ]  # a separate process, which has not yet imported the faulty modules
        return subprocess.run([sys.executable, "-m", "benchmarks.mixed_mutants", *words], check=False).returncode
    if asked.seed is not None:
        with TemporaryDirectory() as folder:
            its = judged(asked.seed, Path(folder), every=True)
        print(scene(mixed(asked.seed, **SHARES)))
        print(f"# least {its.least}, states {its.states}, {its.status}")
        for one in (*its.complaints, *its.remarks):
            print(f"# {one.kind} ({one.mode}): {one.text}")
        return int(bool(its.complaints))
    total = run(asked.first, asked.count, asked.workers, asked.into)
    table(total)
    return int(bool(total.get("wrong")))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
