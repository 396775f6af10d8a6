"""The share of small faults in recognition, proofs and checkers that random worlds detect.

`benchmarks.mutants` draws the faults; only faults in functions are tried. A forked process puts one fault into the loaded module,
and judges worlds until a result is wrong; without the fault, the same result is right. The process judges only worlds that
execute the faulty statement: first those that have detected most faults, then the fast ones, up to a budget of time. A checker
judges plans or certificates that were made without the fault. The results are stored in a file, so that a later run can continue.
If the generator or the judge of worlds has changed, the later run tries the survivors again.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import json
import os
import resource
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from inspect import CO_OPTIMIZED
from itertools import accumulate, islice
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import process_time
from types import CodeType, FunctionType
from typing import Any, TypedDict

from benchmarks._processes import fork, silence
from benchmarks.mixed import SHARES
from benchmarks.mutants import LIBRARIES, ROOT, Instead, faults, meaning
from confab.planner.certificates import Certificate
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.problem import Problem
from confab.scene import Scene, load
from worlds import judging
from worlds.false_certificates import accepted, corrupted, of_a_task_with_a_plan
from worlds.interpreter import Interpreter
from worlds.mixed import RandomWorld, drawn
from worlds.scenes import scene
from worlds.slices import Slice

CHECKERS = sorted(f"planner/{file.name}" for file in (ROOT / "planner").glob("checked_*.py"))
PARTS: dict[str, dict[str, str]] = {
    "recognition": {"reasoner/reading/relevance.py": "recognition"},
    "proofs": {
        "planner/hierarchical/lowest_level.py": "guarded paper optimal proofs",
        "planner/hierarchical/unsolvability.py": "guarded paper optimal proofs",
        "planner/certifying.py": "proofs",
    },
    "checker of plans": dict.fromkeys(("planner/validation.py", *CHECKERS), "checker"),
    "checker of certificates": dict.fromkeys(
        ("planner/certificate_checks.py", "planner/possibilities.py"), "certificates"
    ),
}
"""The modules of each part, each with the mode in which worlds are judged.

A planner that gives up in a world without a plan counts as a fault of a proof.
"""
FIRST, WORLDS = 8_000_000, 200
"""First seed and number of worlds."""
BUDGET, PLANS = 2.0, 6
"""CPU seconds of the worlds that are judged with a fault, as measured without the fault; number of changed copies of each plan."""
SECONDS, WAITING = 60, 600.0
"""CPU seconds for the worlds of a fault, and seconds by the clock for a call on a busy machine."""
NOWHERE = "in no world: "
"""Result of a fault in a statement that no world executes."""
NOTED = "_noted_lines"
"""Name of the set of executed lines in an observed module."""
Check = Callable[[], list[str]]
"""A function that judges a world, and returns the complaints."""


class Record(TypedDict):
    """The results for the faults of a module, with a hash of the generator and the judge of worlds."""

    worlds: str
    results: dict[str, str]


@dataclass(frozen=True)
class Traced:
    """The result of a world without a fault: complaints, CPU seconds, and the executed lines of each module."""

    said: list[str]
    seconds: float
    lines: dict[str, list[int]]


def kills(many: int, into: Path, chosen: Sequence[str] = ()) -> None:
    """Try `many` faults in each part, or in the chosen parts, and print the share of detected faults."""
    for name in (*LIBRARIES, *(Instead(file, "").name for files in PARTS.values() for file in files)):
        import_module(name)  # `functions` finds only the functions of modules that are imported
    into.mkdir(parents=True, exist_ok=True)
    record = into / "mixed-mutants.json"
    known: dict[str, Record] = json.loads(record.read_text("utf-8")) if record.is_file() else {}
    worlds = [drawn(seed, **SHARES) for seed in range(FIRST, FIRST + WORLDS)]
    its_judge = [*sorted((ROOT / "worlds").glob("*.py")), Path(__file__)]
    judge = hashed("".join(file.read_text("utf-8") for file in its_judge))
    print("| part | module | faults tried | noticed | in no world | share of the others |\n|---|---|---|---|---|---|")
    for part, files in PARTS.items():
        if chosen and part not in chosen:
            continue
        total = Counter[str]()
        for mode in dict.fromkeys(files.values()):
            its = [file for file in files if files[file] == mode]
            texts = "".join((ROOT / file).read_text("utf-8") for file in its)
            checks = {world.seed: check(world, meant, mode) for world, meant in worlds}
            functions()
            gc.freeze()  # no collection in a forked process touches, and so copies, the memory of the worlds
            before = traced(its, checks, into / f"mixed-{mode}-{hashed(judge + texts)}.json")
            for file in its:
                source = (ROOT / file).read_text("utf-8")
                found = known.setdefault(f"{file} {hashed(meaning(source))}", Record(worlds=judge, results={}))
                if found["worlds"] != judge:
                    found["results"] = {fault: said for fault, said in found["results"].items() if said == "noticed"}
                    found["worlds"] = judge
                best = Counter[int]()
                drawn_faults = (one for one in faults(source, Random(file)) if changes(source, one[1]))
                for (name, number), text in islice(drawn_faults, -(-many // len(files))):
                    fault = f"{name.removeprefix('core/')}:{number}"
                    if fault not in found["results"]:
                        at, line = changed(source, text)
                        lines = statement(source, at)
                        useful = [seed for seed, one in before.items() if not lines.isdisjoint(one.lines[file])]
                        useful.sort(key=lambda seed: (-best[seed], before[seed].seconds))
                        by = noticed(file, text, within_budget(useful, before), checks, before)
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


def within_budget(seeds: Sequence[int], before: Mapping[int, Traced]) -> list[int]:
    """Return the first seeds whose worlds together take at most `BUDGET` CPU seconds without a fault, at least one."""
    used = accumulate(before[seed].seconds for seed in seeds)
    return list(seeds[: max(1, sum(one <= BUDGET for one in used))])


def traced(files: Sequence[str], checks: Mapping[int, Check], kept: Path) -> dict[int, Traced]:
    """Judge worlds without a fault, and return the results; the results are kept in a file for a later run."""

    def run(tell: Callable[[object], None]) -> None:
        executed = {file: set[int]() for file in files}
        for file in files:
            vars(import_module(Instead(file, "").name))[NOTED] = executed[file]
            put(file, noting((ROOT / file).read_text("utf-8")))
        for seed, one in checks.items():
            for lines in executed.values():
                lines.clear()
            begin = process_time()
            said = one()
            tell([seed, said, process_time() - begin, {file: sorted(lines) for file, lines in executed.items()}])

    answers: list[Any] = json.loads(kept.read_text("utf-8")) if kept.is_file() else []
    if not answers:
        answers, ended = forked(run, None)
        if not ended:
            raise SystemExit(f"{', '.join(files)}: the worlds can't be judged without any fault")
        kept.write_text(json.dumps(answers), "utf-8")
    return {seed: Traced(*others) for seed, *others in answers}


def noting(source: str) -> str:
    """Return a module's text in which each statement of a function first notes its line in a set."""
    tree = ast.parse(source)
    inside = {id(node) for one in ast.walk(tree) if isinstance(one, ast.FunctionDef) for node in ast.walk(one)}
    for node in list(ast.walk(tree)):
        for name in ("body", "orelse", "finalbody"):
            old = getattr(node, name, None)
            if id(node) in inside and isinstance(old, list):
                notes = (ast.parse(f"{NOTED}.add({one.lineno})").body[0] for one in old)
                setattr(node, name, [each for pair in zip(notes, old, strict=True) for each in pair])
    return ast.unparse(tree)


def noticed(
    file: str, text: str, seeds: Sequence[int], checks: Mapping[int, Check], before: Mapping[int, Traced]
) -> int | None:
    """Return the seed of the first world with a new complaint with a changed text of a module; 0 if the process fails."""

    def run(tell: Callable[[object], None]) -> None:
        put(file, text)
        for seed in seeds:
            if not set(checks[seed]()) <= set(before[seed].said):
                tell(seed)
                return

    answers, ended = forked(run, SECONDS)
    return answers[0] if answers else None if ended else 0


def put(file: str, text: str) -> None:
    """Put the changed functions of a text into a module: all users of the functions get the changed code."""
    import_module(Instead(file, "").name)
    different = changes((ROOT / file).read_text("utf-8"), text)
    for one in functions():
        if one.__code__ in different:
            one.__code__ = different[one.__code__]


@cache
def functions() -> list[FunctionType]:
    """Return all functions; called before the processes are forked, which then needn't look for them."""
    return [one for one in gc.get_objects() if isinstance(one, FunctionType)]


def changes(source: str, text: str) -> dict[CodeType, CodeType]:
    """Return the functions and methods that differ in two texts of a module, as code of both texts."""
    return dict(_differing(*(compile(one, "", "exec", dont_inherit=True) for one in (source, text))))


def _differing(old: CodeType, new: CodeType) -> Iterator[tuple[CodeType, CodeType]]:
    pairs = zip(*([one for one in code.co_consts if isinstance(one, CodeType)] for code in (old, new)), strict=False)
    for one, other in pairs:
        if not one.co_flags & CO_OPTIMIZED:  # the body of a class
            yield from _differing(one, other)
        elif one != other:
            yield one, other


def forked(run: Callable[[Callable[[object], None]], None], seconds: int | None) -> tuple[list[Any], bool]:
    """Call a function in a separate process; return what it tells, and whether it returns within its CPU seconds."""
    reading, writing = os.pipe()

    def tell() -> None:
        if seconds is not None:
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        os.close(reading)
        silence()
        with os.fdopen(writing, "w") as answers:
            run(lambda said: print(json.dumps(said), file=answers, flush=True))

    child = fork(tell)
    os.close(writing)
    with os.fdopen(reading) as given:
        said = [json.loads(line) for line in given]
    _, state = os.waitpid(child, 0)
    return said, os.WIFEXITED(state) and os.WEXITSTATUS(state) == 0


def check(world: RandomWorld, meant: Interpreter, mode: str) -> Check:
    """Return the check of a world in a mode. Everything that needs no faulty module is made now, once for all faults.

    A result that is the same as without a fault isn't judged again.
    """
    judging.SECONDS = WAITING
    with TemporaryDirectory() as folder:
        judge = judging.Judge(world, Path(folder), only=mode, meant=meant)
        judge.truth()
        file = Path(folder, "world.ttl")
        file.write_text(scene(world), "utf-8")
        read = judge.call("load", lambda: load(file))
        problem = None if read is None else judge.call("read", lambda: read.reading.problem)
        if read is None or problem is None:
            return list
        its = {"recognition": recognition, "checker": plans, "certificates": certificates}.get(mode)
        run = proofs(judge, read, mode) if its is None else its(judge, read, file)

    def complaints() -> list[str]:
        found = judge.found
        judge.found = judging.Judged(least=found.least, known=found.known)
        judge.rng = Random(world.seed)
        run()
        said, judge.found = [*judge.found.complaints, *judge.found.remarks], found
        kept = (one for one in said if one.kind != "gave-up" or (found.known and found.least is None))
        return sorted({f"{one.kind} {one.mode}" for one in kept})

    return complaints


def recognition(judge: judging.Judge, read: Scene, file: Path) -> Callable[[], None]:
    """Return the check of recognition in a world."""
    usual: list[tuple[Slice, Problem]] = []
    for one in (*judge.slices(read), *judge.crowd(file)):
        with suppress(KnowledgeError):  # the scene is refused
            usual.append((one, one.part().problem))
    renamed = judge.renamed(file)

    def compare() -> None:
        for one, problem in usual:
            part = one.part()
            if part.problem != problem and one.wrong(part):
                judge.complain("the part of the scene differs", "recognition")

    def run() -> None:
        judge.call("recognition", compare)
        judge.call("recognition of names", lambda: judge.names(renamed))

    return run


def proofs(judge: judging.Judge, read: Scene, modes: str) -> Callable[[], None]:
    """Return the check of the proofs, and of planning in some modes, in a world."""
    problem, options = read.reading.problem, {"guarded": {}, "paper": {"mode": "paper"}, "optimal": {"mode": "optimal"}}
    kinds = () if "guarded" in modes else ("all", *judging.KINDS)
    usual = {kind: judge.call(kind, partial(judging.certificate, kind, problem)) for kind in kinds}

    def run() -> None:
        for mode in options.keys() & modes.split():
            judge.outcome(read, mode, **options[mode])
        for kind, known in usual.items():
            judge.proofs_of(problem, kind, known)
        judge.call("proofs by a search", lambda: judge.searched(problem))

    return run


def plans(judge: judging.Judge, read: Scene, _: Path) -> Callable[[], None]:
    """Return the check of the checker of plans with a plan of a world."""
    problem, outcome = read.reading.problem, judge.outcome(read, "guarded")
    made = [outcome.plan] if outcome is not None and outcome.plan is not None else []

    def run() -> None:
        judge.call("checker", lambda: judge.states(problem, PLANS))
        judge.call("checker", lambda: judge.checker(problem, made, PLANS))

    return run


def certificates(judge: judging.Judge, read: Scene, _: Path) -> Callable[[], None]:
    """Return the check of the checker of certificates with certificates of a world."""
    problem = read.reading.problem
    made = list(certificates_of(problem, judge, Random(judge.world.seed)))

    def run() -> None:
        for number, (what, one, right) in enumerate(made):
            if accepted(problem, what, one) is not right:
                judge.complain(f"{number} {what}", "certificates")

    return run


def certificates_of(problem: Problem, judge: judging.Judge, rng: Random) -> Iterator[tuple[str, Certificate, bool]]:
    """Yield certificates of a task, each with a description and whether the certificate is right."""
    if judge.found.least is not None and judge.surely is not None:
        lesser = judging.of_lesser_tasks(problem, rng)
        others = of_a_task_with_a_plan(problem, judge.meant, judge.reached, rng)
        yield from ((what, one, False) for what, one in (*lesser, *others))
        return
    for kind in ("all", *judging.KINDS):
        if (one := judging.certificate(kind, problem)) is not None:
            yield f"by {kind}", one, True
            if one.cases <= judging.FEW_CASES:
                yield from ((what, false, False) for what, false in corrupted(problem, one, rng))


if __name__ == "__main__":
    kills(int(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
