"""The share of small faults in recognition, proofs and checkers that random worlds detect.

`benchmarks.mutants` draws the faults. A separate process with one fault judges worlds until a result is wrong; without the
fault, the same result is right. The process judges only worlds that execute the faulty statement, first those that have
detected most faults. The results are stored in a file, so that a later run can continue. If the generator or the judge of
worlds has changed, the later run tries the survivors again.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import resource
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from itertools import islice
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, TypedDict

from benchmarks.mutants import LIBRARIES, ROOT, Instead, faults, meaning
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
FIRST, WORLDS, TRIED = 8_000_000, 200, 30
"""First seed and number of worlds, and maximum number of worlds that are judged with a fault."""
SECONDS, WAITING = 60, 600.0
"""CPU seconds for the worlds of a fault, and seconds by the clock for a call on a busy machine."""
CONSTRAINED = 0.3
"""Share of worlds with a constraint on every state."""
NOWHERE = "in no world: "
"""Result of a fault in a statement that no world executes."""
Drawn = tuple[RandomWorld, Interpreter]
Saying = dict[str, list[str]]
"""The complaints about each world, by its seed."""


class Record(TypedDict):
    """The results for the faults of a module, with a hash of the generator and the judge of worlds."""

    worlds: str
    results: dict[str, str]


def kills(many: int, into: Path, chosen: Sequence[str] = ()) -> None:
    """Try `many` faults in each part, or in the chosen parts, and print the share of detected faults."""
    for name in LIBRARIES:
        import_module(name)
    into.mkdir(parents=True, exist_ok=True)
    record = into / "mixed-mutants.json"
    known: dict[str, Record] = json.loads(record.read_text("utf-8")) if record.is_file() else {}
    worlds = {seed: drawn(seed, constrained=CONSTRAINED) for seed in range(FIRST, FIRST + WORLDS)}
    judging = hashed("".join(file.read_text("utf-8") for file in sorted((ROOT / "worlds").glob("*.py"))))
    print(
        "| part | module | faults tried | detected | without effect in these worlds | detected, share of the others |\n"
        "|---|---|---|---|---|---|"
    )
    for part, files in PARTS.items():
        if chosen and part not in chosen:
            continue
        total = Counter[str]()
        for mode in dict.fromkeys(files.values()):
            its = [file for file in files if files[file] == mode]
            texts = "".join((ROOT / file).read_text("utf-8") for file in its)
            kept = into / f"mixed-{mode}-{hashed(judging + texts)}.json"
            before, lines = traced(its, list(worlds.values()), mode, kept)
            for file in its:
                source = (ROOT / file).read_text("utf-8")
                key = f"{file} {hashed(meaning(source))}"
                found = known.setdefault(key, Record(worlds=judging, results={}))
                if found["worlds"] != judging:
                    found["results"] = {fault: said for fault, said in found["results"].items() if said == "noticed"}
                    found["worlds"] = judging
                best = Counter[int]()
                for (name, number), text in islice(faults(source, Random(file)), -(-many // len(files))):
                    fault = f"{name.removeprefix('core/')}:{number}"
                    if fault not in found["results"]:
                        at, line = changed(source, text)
                        where = statement(source, at)
                        useful = [seed for seed in worlds if not where or not where.isdisjoint(lines[file][seed])]
                        useful.sort(key=lambda seed: -best[seed])
                        tried = {seed: worlds[seed] for seed in useful[:TRIED]}
                        by = noticed(file, text, tried, mode, before)
                        best.update([by] if by else [])
                        said = "noticed" if by is not None else f"survived: {line}"
                        found["results"][fault] = said if useful else NOWHERE + line
                        record.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", "utf-8")
                        print(file, fault, at, by, found["results"][fault], file=sys.stderr, flush=True)
                row = Counter(said.partition(": ")[0] for said in found["results"].values())
                total += row
                print(f"| {part} | `{file}` | {shares(row)} |", flush=True)
        print(f"| {part} | **all** | {shares(total)} |", flush=True)


def shares(row: Counter[str]) -> str:
    """Return the number of faults, of detected faults, of faults that no world executes, and the share, as cells of a table."""
    nowhere = row[NOWHERE.partition(": ")[0]]
    others = row.total() - nowhere
    return f"{row.total()} | {row['noticed']} | {nowhere} | {row['noticed'] / max(others, 1):.0%}"


def hashed(text: str) -> str:
    """Return a short hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def changed(source: str, text: str) -> tuple[int, str]:
    """Return the number of the first line that differs in a changed text, and the changed line."""
    pairs = zip(source.splitlines(), [*text.splitlines(), ""], strict=False)
    return next((at, new.strip()) for at, (old, new) in enumerate(pairs, 1) if old != new)


def statement(source: str, line: int) -> set[int]:
    """Return the lines of the statement that contains a line; of a compound statement, the lines before its body.

    Return an empty set if the statement is outside of functions, so that each process executes it.
    """
    found, within = set[int](), False
    waiting: list[tuple[ast.AST, bool]] = [(ast.parse(source), False)]
    while waiting:
        node, inside = waiting.pop()
        for child in ast.iter_child_nodes(node):
            first, last = getattr(child, "lineno", 0), getattr(child, "end_lineno", 0)
            if isinstance(child, ast.stmt) and first <= line <= last:
                body = getattr(child, "body", None)
                end = body[0].lineno - 1 if body and body[0].lineno > first else last
                found, within = set(range(first, end + 1)), inside
            waiting.append((child, inside or isinstance(child, ast.FunctionDef)))
    return found if within else set()


def hopeless(meant: Interpreter) -> bool:
    """Return whether a world has no plan."""
    try:
        return meant.explored(meant.problem.domain.levels[-1], 2_000).least is None
    except TooManyStatesError:
        return False


def traced(
    files: Sequence[str], worlds: Sequence[Drawn], mode: str, kept: Path
) -> tuple[Saying, dict[str, dict[int, set[int]]]]:
    """Judge worlds without a fault; return the complaints, and for each file the lines that each world executes.

    The results are kept in a file for a later run.
    """

    def run(tell: Callable[[object], None]) -> None:
        executed: dict[str, set[int]] = {Instead(file, "").name: set() for file in files}

        def call(frame: FrameType, event: str, given: object) -> Any:
            lines = executed.get(frame.f_globals.get("__name__", ""))
            if lines is None:
                return None

            def line(frame: FrameType, event: str, given: object) -> Any:
                lines.add(frame.f_lineno)
                return line

            return line(frame, event, given)

        for world, meant in worlds:
            for lines in executed.values():
                lines.clear()
            sys.settrace(call)
            said = judged(world, meant, mode)
            sys.settrace(None)
            tell([world.seed, said, [sorted(lines) for lines in executed.values()]])

    answers: list[Any] = json.loads(kept.read_text("utf-8")) if kept.is_file() else []
    if not answers:
        answers, ended = forked(run, None)
        if not ended:
            raise SystemExit(f"{', '.join(files)}: the worlds can't be judged without any fault")
        kept.write_text(json.dumps(answers), "utf-8")
    before = {str(seed): said for seed, said, _ in answers}
    return before, {file: {seed: set(lines[i]) for seed, _, lines in answers} for i, file in enumerate(files)}


def noticed(file: str, text: str, worlds: dict[int, Drawn], mode: str, before: Saying) -> int | None:
    """Return the seed of the first world that causes a new complaint if a module has a changed text; 0 if the process fails."""

    def run(tell: Callable[[object], None]) -> None:
        faulty = Instead(file, text)
        sys.meta_path.insert(0, faulty)
        for seed, (world, meant) in worlds.items():
            if not set(judged(world, meant, mode)) <= set(before[str(seed)]):
                tell(seed)
                return
        if worlds and sys.modules[faulty.name].__loader__ is not faulty:
            raise ImportError(faulty.name)  # the worlds were judged without the fault

    answers, ended = forked(run, SECONDS)
    return answers[0] if answers else None if ended else 0


def forked(run: Callable[[Callable[[object], None]], None], seconds: int | None) -> tuple[list[Any], bool]:
    """Call a function in a separate process; return what it tells, and whether it returns within its CPU seconds."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns about forks with threads
        child = os.fork()
    if child == 0:
        code = 1
        try:
            if seconds is not None:
                resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
            os.close(reading)
            with open(os.devnull, "w") as nowhere:  # noqa: PTH123
                os.dup2(nowhere.fileno(), 1)
                os.dup2(nowhere.fileno(), 2)
            with os.fdopen(writing, "w") as answers:
                run(lambda said: print(json.dumps(said), file=answers, flush=True))
            code = 0
        finally:
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading) as given:
        said = [json.loads(line) for line in given]
    _, state = os.waitpid(child, 0)
    return said, os.WIFEXITED(state) and os.WEXITSTATUS(state) == 0


def judged(world: RandomWorld, meant: Interpreter, mode: str) -> list[str]:
    """Judge a world in one mode, and return its complaints."""
    from worlds import judging

    judging.SECONDS = WAITING
    with TemporaryDirectory() as folder:
        its = judging.Judge(world, Path(folder), only=mode, meant=meant).judged()
    kept: Iterable[judging.Complaint] = (
        one for one in (*its.complaints, *its.remarks) if one.kind != "gave-up" or hopeless(meant)
    )
    return sorted({f"{one.kind} {one.mode}" for one in kept})


if __name__ == "__main__":
    kills(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
