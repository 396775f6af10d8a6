"""Broken inputs of the command line (`benchmarks.broken_inputs`); each answer must be a result or an error message in one line.

    python -m benchmarks.fuzz                          run up to 100,000 cases, continuing the last run
    python -m benchmarks.fuzz --cases 500 --door plan  run 500 more cases of one door
    python -m benchmarks.fuzz --again memory:17        run one case again, and keep its files
    python -m benchmarks.fuzz --table                  print the table of docs/figures/promises.md

A case is a kind of input (a door) and a number, which is the seed of all random choices. A process with limits of time
and memory runs `BATCH` cases one after the other. A case *breaks* if the answer is a fault; such a case is run again in
a separate process. ``fuzz-tried.json`` has the number of cases, and ``fuzz-seeds.txt`` has the cases that broke, with
their corrections. `tests/confab/test_fuzz.py` runs these cases and some new cases.
"""

from __future__ import annotations

import argparse
import functools
import gc
import io
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

import pyoxigraph as ox

from benchmarks import broken_inputs, broken_worlds
from benchmarks._processes import fork
from benchmarks.broken_inputs import DOMAINS, HERE, TARGETS, Arguments
from benchmarks.broken_worlds import WORLDS
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.problem import Problem

if TYPE_CHECKING:
    from confab.planning import Result

DOORS = {**broken_inputs.DOORS, **broken_worlds.DOORS}
SEEDS, TRIED = HERE / "fuzz-seeds.txt", HERE / "fuzz-tried.json"
CASES, ROUND, BATCH = 100_000, 1_000, 100
SECONDS, WAITING, MEGABYTES = 30, 600, 4_000
"""Limits of a case in CPU seconds, in seconds by the clock (for busy machines), and in megabytes of memory."""
TIME_IS_OVER = {signal.SIGPROF: f"{SECONDS} s of CPU time", signal.SIGALRM: f"{WAITING} s"}
KEPT, ALIKE = 2, 70
"""Maximum number of kept cases with the same message, and number of characters compared."""
FEW_STATES, FEW_STEPS = 300, 60
"""Maximum numbers of states and grounded behaviours of a world in which an answer without a plan is checked by search."""


@dataclass(frozen=True)
class Failure:
    """A case that broke, with a description of the fault."""

    door: str
    seed: int
    what: str

    def __str__(self) -> str:
        """Return the line of the case in the file of seeds."""
        return f"{self.door}:{self.seed}  {' '.join(self.what.split())[:160]}"


# ----------------------------------------------------------------------------------------------------------- one case


def sources(given: Path) -> None:
    """Write the valid inputs of all doors."""
    broken_inputs.sources(given)
    broken_worlds.sources(given)


def run_case(door: str, seed: int, given: Path, keep: bool = False) -> Failure | None:
    """Run a case in a separate process; return the fault or None."""
    return next(run_batch(door, [seed], given, keep), None)


def run_batch(door: str, seeds: Sequence[int], given: Path, keep: bool = False) -> Iterator[Failure]:
    """Run cases of a door in one process, and continue in another process after a crash; yield the faults."""
    left = list(seeds)
    while left:
        reading, writing = os.pipe()
        child = fork(partial(_answer_all, door, left, given, reading, writing, keep))
        os.close(writing)
        with os.fdopen(reading, encoding="utf-8") as lines:
            for line in lines:
                if what := json.loads(line):
                    yield Failure(door, left[0], what)
                left.pop(0)
        _, state = os.waitpid(child, 0)
        if left:  # the process ended during a case
            if os.WIFSIGNALED(state):
                sign = os.WTERMSIG(state)
                over = {int(which): limit for which, limit in TIME_IS_OVER.items()}
                ended = f"no end within {over[sign]}" if sign in over else f"killed by signal {sign}"
            else:
                ended = f"the process ended with {os.WEXITSTATUS(state)}"
            yield Failure(door, left.pop(0), ended)


def _answer_all(door: str, seeds: Sequence[int], given: Path, reading: int, writing: int, keep: bool) -> None:
    """Run cases in the child process, and write a line for each case."""
    os.close(reading)
    for sign in TIME_IS_OVER:
        signal.signal(sign, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MEGABYTES << 20, MEGABYTES << 20))
    gc.set_threshold(50_000, 20, 20)
    results = _recorded()
    with os.fdopen(writing, "w", encoding="utf-8") as lines:
        for seed in seeds:
            what = _answer(door, seed, given, results, keep)
            print(json.dumps(what), file=lines, flush=True)


def _recorded() -> list[Result]:
    """Return a list in which every plan of this process is recorded, and cache constant objects."""
    import rdflib.plugins.sparql.processor as sparql
    from rdflib.plugins.sparql.algebra import translateQuery
    from rdflib.plugins.sparql.parser import parseQuery

    from confab import engines, planning

    results: list[Result] = []
    plan = planning.plan_by

    def noted(*arguments: Any) -> Result:
        results.append(plan(*arguments))
        return results[-1]

    @functools.cache
    def translated(text: str, base: str | None, prefixes: tuple[tuple[str, Any], ...]) -> Any:
        return translateQuery(parseQuery(text), base, dict(prefixes))

    def translated_once(text: str, base: str | None = None, prefixes: Mapping[str, Any] | None = None) -> Any:
        return translated(text, base, tuple((prefixes or {}).items()))

    for place, name, new in (
        (planning, "plan_by", noted),
        (sparql, "parseQuery", str),
        (sparql, "translateQuery", translated_once),
        (engines, "iter_modules", functools.cache(lambda: tuple(iter_modules()))),
    ):
        setattr(place, name, new)
    return results


def _answer(door: str, seed: int, given: Path, results: list[Result], keep: bool) -> str:
    """Draw and run a case, and return the fault of its ending; an empty text without a fault."""
    folder = Path(tempfile.mkdtemp(prefix="confab-fuzz-"))
    try:
        draw = random.Random(f"{door} {seed}")
        case, out, err = folder / "case", folder / "stdout", folder / "stderr"
        shutil.copytree(given / draw.choice(WORLDS.get(door, DOMAINS)), case)
        call = DOORS[door][0](draw, case)
        before = _contents(case)
        os.chdir(case)
        results.clear()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(WAITING)
        code, wrong = _run(call, case, out, err, results)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.alarm(0)
        said, printed = (path.read_text(errors="replace") for path in (err, out))
        wrong = _judged(call, code, said, printed, before, _contents(case)) or wrong
        if keep:
            print(f"{door}:{seed}", *map(repr, call), f"\n{wrong or 'holds'}\nfiles:", folder, flush=True)
        return wrong
    finally:
        os.chdir("/")
        if not keep:
            shutil.rmtree(folder, ignore_errors=True)


def _run(call: Arguments, case: Path, out: Path, err: Path, results: list[Result]) -> tuple[int, str]:
    """Run a command and check its answer; return the exit code and the fault of the answer."""
    from confab.cli import main

    code = 99
    with out.open("w") as stdout, err.open("w") as stderr, redirect_stdout(stdout), redirect_stderr(stderr):
        try:
            main(call)
        except SystemExit as end:
            code = int(end.code or 0)
        except BaseException:
            return 98, traceback.format_exc()
    try:
        if code == 0:
            _check_files(call, case)
        for result in results:
            _check_plan(result)
    except Exception as error:
        lines = (
            traceback.format_exception_only(error)
            if isinstance(error, AssertionError)
            else traceback.format_exception(error)
        )
        return code, "a wrong answer: " + "".join(lines)[-400:]
    return code, ""


def _judged(
    call: Arguments, code: int, said: str, printed: str, before: dict[str, bytes], after: dict[str, bytes]
) -> str:
    """Return the fault of a command's exit code, output or changed files; an empty text without a fault."""
    if code not in (0, 1, 2, 3):
        return f"exit {code}: {said}"
    if "Traceback" in said + printed:
        return f"a traceback: {said[-300:]}"
    told = [line for line in said.splitlines() if line.startswith("confab: ")]
    if code == 2 and (printed or not told):
        return f"exit 2 with {len(told)} lines and with output: {printed[:100]}"
    changed = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    if bad := [
        name
        for name in changed
        if name.split("/")[0] not in {*TARGETS, *call}
        and not name.startswith("out")
        and not name.endswith(".reach.ttl")
    ]:
        return f"files changed: {', '.join(bad)}"
    if code == 2 and changed and call[0] != "learn":
        return f"exit 2, but {', '.join(changed)} changed"
    return ""


def _contents(case: Path) -> dict[str, bytes]:
    return {str(file.relative_to(case)): file.read_bytes() for file in sorted(case.rglob("*")) if file.is_file()}


def _check_files(call: Arguments, case: Path) -> None:
    """Raise an exception if a file that the command has written can't be read."""
    from confab.memory import Memory

    memory = case / "memory.ttl"
    wrote = call[0] in ("learn", "memory", "execute") and call[1] not in ("show", "migrate", "trust")
    if wrote and str(memory) in call:
        with redirect_stdout(io.StringIO()):
            Memory.load(memory)
    for file in case.glob("out.ttl"):
        list(ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri="urn:fuzz:base"))


def _check_plan(result: Result) -> None:
    """Raise `AssertionError` if a plan is invalid, or if a task that was called unsolvable has a plan."""
    from confab.planner.certificate_checks import refusal
    from confab.planner.plan import Status
    from confab.planner.validation import validate
    from worlds.agreement import cheapest

    outcome, problem = result.outcome, result.problem
    proved = outcome.status is Status.UNSOLVABLE or outcome.bound is not None
    if (
        proved
        and quantified_behaviors(problem) <= FEW_STEPS
        and (least := cheapest(problem, most=FEW_STATES)) is not None
    ):
        unsolvable = outcome.status is Status.UNSOLVABLE
        assert not unsolvable or least == math.inf, "unsolvable was said of what a search of all states solves"
        assert (outcome.bound or 0.0) <= least + float(outcome.penalty or 0) + 1e-6, (
            f"{outcome.bound} was proved, and a search of all states finds {least}"
        )
    if outcome.status is Status.UNSOLVABLE:
        assert outcome.certificate is not None, "unsolvable was said without a certificate"
        assert refusal(problem, outcome.certificate) is None, "the certificate of unsolvable is refused"
    if outcome.plan is None:
        return
    faults = validate(problem, outcome.plan)
    assert not faults, f"no plan of what was read: {faults[0]}"
    with suppress(KnowledgeError):  # parts that are irrelevant to the task may be broken
        whole = replace(result.scene.reading.problem, goal=problem.goal)
        names = {
            member for members in whole.classes.values() for member in members
        }  # the plan may be longer than for a part of the scene
        seen = {
            symbol: value for symbol, value in problem.initial.items() if symbol in whole.initial and value in names
        }
        faults = validate(replace(whole, initial={**whole.initial, **seen}), outcome.plan)
        faults = [fault for fault in faults if "its ID" not in str(fault)]
        assert not faults, f"no plan of the whole scene: {faults[0]}"


def quantified_behaviors(problem: Problem) -> int:
    """Return the number of grounded behaviours of the lowest level."""
    return sum(
        functools.reduce(lambda many, p: many * len(problem.classes.get(p.kind, ())), behavior.parameters, 1)
        for behavior in problem.domain.at_level(problem.domain.levels[-1])
    )


# ------------------------------------------------------------------------------------------------------------- many


def _import_all() -> None:
    """Import the modules that the cases need before the processes are forked."""
    rooms = {
        "confab": "cli execution explaining picturing pddl_commands authoring reaching show live",
        "confab.planner": "acting.executive experience.advice hierarchical.bounds paper.hierarchy",
        "confab.reasoner": "validation.validate graph.query_process reading.applicable",
    }
    for name in (
        *(f"{room}.{part}" for room, parts in rooms.items() for part in parts.split()),
        "matplotlib.figure",
        "pyshacl",
    ):
        import_module(name)
    gc.freeze()


def known() -> Iterator[tuple[str, int, str]]:
    """Yield the kept cases, each with its corrected cause if known."""
    for line in SEEDS.read_text(encoding="utf-8").splitlines() if SEEDS.is_file() else ():
        if match := re.match(r"(\w+):(\d+)", line):
            yield match[1], int(match[2]), line.partition(" mended: ")[2].strip()


def tried() -> dict[str, list[int]]:
    """Return for each door the number of cases that were tried and the number of cases that broke."""
    noted = json.loads(TRIED.read_text(encoding="utf-8")) if TRIED.is_file() else {}
    return {door: noted.get(door, [0, 0]) for door in DOORS}


def note(failure: Failure) -> None:
    """Keep a case that broke, unless enough cases with the same message are kept."""
    line = str(failure)
    words = line.partition("  ")[2][:ALIKE]
    if sum(words in kept for kept in SEEDS.read_text(encoding="utf-8").splitlines()) < KEPT:
        with SEEDS.open("a", encoding="utf-8") as file:
            file.write(f"{line}\n")


def fuzz(cases: int, doors: Sequence[str]) -> int:
    """Run `cases` cases, divided among the doors by their shares, and record the results; return the number of faults."""
    shares = {door: DOORS[door][1] for door in doors}
    begin, done, broke = time.monotonic(), 0, sum(fell for _, fell in tried().values())
    before = broke
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder)
        sources(given)
        _import_all()
        while done < cases:
            for door, share in shares.items():
                many = min(cases - done, -(-ROUND * share // sum(shares.values())))
                first, fell = tried()[door]
                for at in range(first, first + many, BATCH):
                    seeds = range(at, min(at + BATCH, first + many))
                    for failure in run_batch(door, seeds, given):
                        fell += 1
                        alone = run_case(door, failure.seed, given)
                        what = alone or replace(failure, what=f"only after others of {seeds}: {failure.what}")
                        print(what, flush=True)
                        note(what)
                    noted = {**tried(), door: [seeds.stop, fell]}
                    TRIED.write_text(
                        "{\n" + ",\n".join(f'"{d}": {n}' for d, n in noted.items()) + "\n}\n", encoding="utf-8"
                    )
                done += many
            broke = sum(fell for _, fell in tried().values())
            print(
                f"{done:,} cases in {time.monotonic() - begin:.0f} s, {broke} broke in all", file=sys.stderr, flush=True
            )
    return broke - before


def table() -> None:
    """Print the number of cases and faults of each door, and the number of corrected causes."""
    print("| input | cases tried | wrong answers | causes corrected | causes open |\n|---|---|---|---|---|")
    cases, counts = list(known()), tried()
    for door, (run, _) in DOORS.items():
        causes = [cause for d, _, cause in cases if d == door]
        mended = len(set(causes) - {""})
        print(
            f"| {str(run.__doc__).rstrip('.')} | {counts[door][0]:,} | {counts[door][1]} | {mended} | {causes.count('')} |"
        )
    causes = [cause for *_, cause in cases]
    all_tried, all_broke = (sum(numbers) for numbers in zip(*counts.values(), strict=True))
    print(f"| all | {all_tried:,} | {all_broke} | {len(set(causes) - {''})} | {causes.count('')} |")
    print("\nCorrected, each cause once:\n")
    for cause in sorted(set(causes) - {""}):
        print(f"- {cause}")


def main() -> int:
    """Run the requested cases; return 1 if a case broke."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int)
    parser.add_argument("--door", choices=DOORS, action="append")
    parser.add_argument("--again", metavar="DOOR:NUMBER")
    parser.add_argument("--table", action="store_true")
    asked = parser.parse_args()
    if asked.table:
        table()
        return 0
    if asked.again:
        door, _, number = asked.again.partition(":")
        with tempfile.TemporaryDirectory() as folder:
            sources(Path(folder))
            return int(run_case(door, int(number), Path(folder), keep=True) is not None)
    cases = CASES - sum(many for many, _ in tried().values()) if asked.cases is None else asked.cases
    return int(fuzz(cases, asked.door or tuple(DOORS)) > 0)


if __name__ == "__main__":
    sys.exit(main())
