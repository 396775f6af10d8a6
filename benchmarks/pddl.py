"""Standard PDDL problems: coverage, time and plan length compared with pyperplan and Fast Downward, and time of grounding.

    python -m benchmarks pddl                        with problems in ../shared/pddl
    CONFAB_PDDL=FOLDER python -m benchmarks pddl     with problems in another folder
    CONFAB_PEERS=PYTHON …                            with a Python that has pyperplan and up-fast-downward already
    CONFAB_ALL=1 …                                   all problems instead of four per folder
    CONFAB_DOMAINS=ferry,satellite …                 these folders only
    CONFAB_PLANNERS=confab,lama-first …              these planners and tables only

The planner ``confab`` is the flat core, ``confab-whole`` is ``confab plan`` without an engine, and ``confab-engine`` is
``confab plan`` with an engine. The planner ``enhsp``, which supports numbers, needs up-enhsp. ``grounding`` and ``read-back`` are
further tables.

Each run is a separate process, limited to 30 s of CPU time and 4 GB. A folder has ``…/domain.pddl`` and problems, which are beside
the domain or in a subfolder ``testing…``. If the other planners can't be installed, only Confab runs. Results are stored in
``confab-out/pddl-runs`` by planner, problem and code of the planner, so that an interrupted benchmark can continue. Delete this
folder to repeat all runs.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import venv
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from math import exp, log
from pathlib import Path
from time import process_time

from benchmarks._processes import seconds_of_children

SECONDS, BYTES = 30, 4 * 2**30
ROOT = Path(__file__).resolve().parents[1]
PER_FOLDER = 4
RUNS = ROOT / "confab-out" / "pddl-runs"
CORE = ("planner/grounded/*.py", "reasoner/pddl/*.py", "reasoner/symbols.py")
OURS = {
    "confab": CORE,
    "confab-whole": (*CORE, "planner/*.py", "planner/hierarchical/*.py"),
    "confab-engine": (*CORE, "confab/engines.py"),
}
"""The files that determine the plans of each planner of Confab."""
ENGINE = "fast-downward"
"""The engine of the planner ``confab-engine``."""


@dataclass(frozen=True)
class Run:
    """The result for one problem. `plan` is None without a plan. `accepted` is the verdict of unified-planning's validator."""

    plan: tuple[str, ...] | None
    seconds: float
    output: str
    accepted: bool | None = None


def main() -> None:
    """Print the tables."""
    folder = Path(os.environ.get("CONFAB_PDDL", ROOT.parent / "shared" / "pddl"))
    found = list(problems(folder))
    if not found:
        print(f"no problems in {folder}; name a folder with CONFAB_PDDL")
        return
    python: str | None = None
    try:
        python = peers()
    except (OSError, subprocess.CalledProcessError):
        print("pyperplan and Fast Downward can't be installed here: Confab alone")
    commands = {name: command for name, command in planners(python).items() if name in wanted()}
    if commands:
        coverage(found, commands)
    if "grounding" in wanted() and python is not None:
        grounding(found, python)
    if "read-back" in wanted() and python is not None:
        read_back(python)


def wanted() -> list[str]:
    """Return the names of the planners and tables in CONFAB_PLANNERS, by default the main planners and tables."""
    named = os.environ.get("CONFAB_PLANNERS")
    return named.split(",") if named else ["confab", "pyperplan", "lama-first", "grounding", "read-back"]


def problems(folder: Path) -> Iterator[tuple[str, Path, Path]]:
    """Yield the folder, the domain and the problem of four problems per folder, evenly spread from the first to the last."""
    named = os.environ.get("CONFAB_DOMAINS", "").split(",")
    for domain in sorted(folder.rglob("domain.pddl")):
        if named != [""] and domain.parent.name not in named:
            continue
        for place in [domain.parent, *sorted(p for p in domain.parent.iterdir() if p.is_dir() and _measured(p.name))]:
            here = sorted(file for file in place.glob("*.pddl") if file.name != "domain.pddl")
            chosen = {i * (len(here) - 1) // (PER_FOLDER - 1) for i in range(PER_FOLDER)} if here else set()
            if "CONFAB_ALL" in os.environ:
                chosen = set(range(len(here)))
            for i in sorted(chosen):
                yield str(place.relative_to(folder)), domain, here[i]


def _measured(place: str) -> bool:
    """Return whether the problems of a folder belong to the benchmark; training problems belong to it only with CONFAB_ALL."""
    return place.startswith("testing") or ("CONFAB_ALL" in os.environ and place.startswith("training"))


def peers() -> str:
    """Return a Python interpreter with the other planners; by default the planners are installed under ``confab-out`` once."""
    if "CONFAB_PEERS" in os.environ:
        return os.environ["CONFAB_PEERS"]
    place = ROOT / "confab-out" / "peers"
    python = place / "bin" / "python"
    if not python.exists():
        venv.create(place, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "pyperplan", "up-fast-downward"], check=True)
    return str(python)


def planners(python: str | None) -> dict[str, list[str]]:
    """Return the command of each planner, with the placeholders ``{domain}``, ``{problem}`` and ``{plan}``."""
    files = ["{domain}", "{problem}", "{plan}"]
    confab = {
        "confab": [sys.executable, "-m", "benchmarks.pddl", *files],
        "confab-whole": [sys.executable, "-m", "benchmarks.learning", *files],
        "confab-engine": [sys.executable, "-m", "benchmarks.pddl", *files, ENGINE],
    }
    if python is None:
        return confab
    inside = "import importlib.util as u, pathlib; print(pathlib.Path(u.find_spec('up_fast_downward').origin).parent)"
    place = subprocess.run([python, "-c", inside], capture_output=True, text=True, check=True).stdout.strip()
    downward = [python, f"{place}/downward/fast-downward.py"]
    jar = Path(place).parent / "up_enhsp" / "ENHSP" / "enhsp.jar"  # exists if up-enhsp is installed
    java = ["java", "-Xmx2g", "-XX:CompressedClassSpaceSize=64m", "-XX:ReservedCodeCacheSize=64m", "-jar", str(jar)]
    if jar.exists():
        confab["enhsp"] = [*java, "-o", "{domain}", "-f", "{problem}", "-sp", "{plan}"]
    return {
        **confab,
        "pyperplan": [python, "-m", "pyperplan", "-s", "gbf", "-H", "hff", "{domain}", "{problem}"],
        "lama-first": [*downward, "--alias", "lama-first", "--plan-file", "{plan}", "{domain}", "{problem}"],
        "translate": [*downward, "--translate", "--sas-file", "{plan}", "{domain}", "{problem}"],
    }


def kept(name: str, command: Sequence[str], domain: Path, problem: Path) -> Run:
    """Return the result of a planner for a problem, from an earlier run if available; plans of Confab are validated."""
    ours = name in OURS
    code = [file.read_bytes() for pattern in OURS.get(name, ()) for file in sorted(ROOT.glob(pattern))]
    texts = [*code, domain.read_bytes(), problem.read_bytes(), f"{name} {SECONDS} {BYTES}".encode()]
    place = RUNS / f"{name}-{hashlib.sha256(b'|'.join(texts)).hexdigest()[:24]}.json"
    if place.exists():
        found = json.loads(place.read_text())
        del found["problem"]
        return Run(**{**found, "plan": None if found["plan"] is None else tuple(found["plan"])})
    done = run(command, domain, problem)
    if done.seconds > SECONDS + 1:  # the limit applies to each process of a planner, but also to their sum
        done = Run(None, done.seconds, done.output)
    verdict = None
    if ours and done.plan is not None:
        with suppress(Exception):  # unified-planning can't read some problems
            verdict = accepted(domain, problem, done.plan)
    done = Run(done.plan, done.seconds, done.output[-2000:], verdict)
    RUNS.mkdir(parents=True, exist_ok=True)
    part = place.with_suffix(".part")
    part.write_text(json.dumps({**asdict(done), "problem": str(problem)}))
    part.replace(place)
    return done


def run(command: Sequence[str], domain: Path, problem: Path, cap: int = SECONDS) -> Run:
    """Run one planner on one problem within limits of CPU seconds per process."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "problem.pddl"  # pyperplan writes its plan beside the problem
        copy.write_text(problem.read_text())
        plan = Path(folder) / "plan"
        words = [w.format(domain=domain, problem=copy, plan=plan) for w in command]
        before = seconds_of_children()
        try:
            done = subprocess.run(
                words,
                cwd=ROOT,
                capture_output=True,
                text=True,
                timeout=20 * cap,
                preexec_fn=partial(_limit, cap),
                check=False,
            )
            output = done.stdout + done.stderr
        except subprocess.TimeoutExpired:
            output = "timeout"
        seconds = seconds_of_children() - before
        beside = Path(f"{copy}.soln")
        text = next((p.read_text() for p in (plan, beside) if p.exists()), None)
        lines = None if text is None else tuple(re.findall(r"^\((.*)\)", text, re.MULTILINE))
        return Run(lines, seconds, output)


def _limit(cap: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (cap, cap + 1))
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))


def coverage(found: Sequence[tuple[str, Path, Path]], commands: dict[str, list[str]]) -> None:
    """Print the number of solved problems, the CPU time and the plan length by domain and planner."""
    runs: dict[tuple[str, Path], Run] = {}
    for _, domain, problem in found:
        for name, command in commands.items():
            runs[name, problem] = kept(name, command, domain, problem)
    rejected = [f"{problem}: {name}" for (name, problem), done in runs.items() if done.accepted is False]
    folders = list(dict.fromkeys(place for place, _, _ in found))
    print(
        "Number of solved problems; CPU seconds for these; geometric mean of the ratio of plan lengths to lama-first, over the"
    )
    print("problems that both solve; for Confab the number of plans that unified-planning's plan validator accepts.\n")
    print("| problems |", " | ".join(commands), "|")
    print("|---" * (len(commands) + 1) + "|")
    for folder in [*folders, "all"]:
        here = [problem for place, _, problem in found if folder in (place, "all")]
        cells = []
        for name in commands:
            solved = [runs[name, p] for p in here if runs[name, p].plan is not None]
            seconds = sum(r.seconds for r in solved)
            judged = [r.accepted for r in solved if r.accepted is not None]
            valid = f", {sum(judged)} accepted" if judged else ""
            cells.append(f"{len(solved)} ({seconds:.1f} s{_ratio(runs, name, here)}{valid})")
        print(f"| {folder}: {len(here)} | {' | '.join(cells)} |", flush=True)
    print(f"\nPlans of Confab that unified-planning's validator rejects: {len(rejected)}", *rejected, sep="\n")
    for name in commands:
        missing = [str(p.relative_to(p.parents[2])) for _, _, p in found if runs[name, p].plan is None]
        print(f"Not solved by {name}:", ", ".join(missing) or "none")


def _ratio(runs: dict[tuple[str, Path], Run], name: str, here: Sequence[Path]) -> str:
    """Return the geometric mean of the plan lengths relative to lama-first, over problems that both planners solve, as text."""
    pairs = [(runs[name, p].plan, runs["lama-first", p].plan) for p in here if ("lama-first", p) in runs]
    ratios = [log(len(a) / len(b)) for a, b in pairs if a and b]
    return f", length × {exp(sum(ratios) / len(ratios)):.2f}" if ratios and name != "lama-first" else ""


def accepted(domain: Path, problem: Path, plan: Sequence[str]) -> bool:
    """Return whether unified-planning's sequential plan validator accepts a plan."""
    from unified_planning.engines import SequentialPlanValidator
    from unified_planning.engines.results import ValidationResultStatus
    from unified_planning.io import PDDLReader
    from unified_planning.plans import ActionInstance, SequentialPlan

    head, actions, rest = domain.read_text().partition("(:action")
    head = re.sub(r"\((\S+) (\?\w+) \2\)", r"(\1 \2 \2_)", head)  # the reader merges the arguments of (in ?obj ?obj)
    task = PDDLReader().parse_problem_string(head + actions + rest, problem.read_text())
    steps = []
    for line in plan:
        name, *words = line.split()
        manager = task.environment.expression_manager
        steps.append(ActionInstance(task.action(name), tuple(manager.ObjectExp(task.object(word)) for word in words)))
    validator = SequentialPlanValidator()
    validator.skip_checks = True  # the validator supports action costs but declares that it doesn't
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = validator.validate(task, SequentialPlan(steps))
    return bool(result.status == ValidationResultStatus.VALID)


TRUCKS = """(define (domain trucks) (:requirements :strips :typing)
 (:types place locatable - object truck parcel - locatable)
 (:predicates (at ?x - locatable ?p - place) (in ?x - parcel ?t - truck) (road ?a ?b - place))
 (:action drive :parameters (?t - truck ?a ?b - place)
  :precondition (and (at ?t ?a) (road ?a ?b)) :effect (and (not (at ?t ?a)) (at ?t ?b)))
 (:action load :parameters (?x - parcel ?t - truck ?p - place)
  :precondition (and (at ?t ?p) (at ?x ?p)) :effect (and (not (at ?x ?p)) (in ?x ?t)))
 (:action unload :parameters (?x - parcel ?t - truck ?p - place)
  :precondition (and (at ?t ?p) (in ?x ?t)) :effect (and (at ?x ?p) (not (in ?x ?t)))))"""


def trucks(size: int) -> str:
    """Return a problem with `size` trucks, and twelve times as many parcels and places. All places are connected by roads."""
    vehicles, places, parcels = range(size), range(12 * size), range(12 * size)
    roads = " ".join(f"(road p{a} p{b})" for a in places for b in places if a != b)
    at = " ".join([*(f"(at t{i} p0)" for i in vehicles), *(f"(at x{i} p{i})" for i in parcels)])
    things = f"{' '.join(f't{i}' for i in vehicles)} - truck {' '.join(f'p{i}' for i in places)} - place"
    wanted = " ".join(f"(at x{i} p0)" for i in parcels)
    return f"""(define (problem size{size}) (:domain trucks) (:objects {things} {" ".join(f"x{i}" for i in parcels)} - parcel)
 (:init {at} {roads}) (:goal (and {wanted})))"""


def grounding(found: Sequence[tuple[str, Path, Path]], python: str) -> None:
    """Print the times of parsing and grounding, and the times of Fast Downward's translator."""
    from confab.planner.grounded.grounding import ground
    from confab.planner.grounded.task import Task
    from confab.reasoner.pddl.importing import imported
    from confab.reasoner.pddl.syntax import parse_files

    translate = planners(python)["translate"]
    with tempfile.TemporaryDirectory() as folder:
        made = []
        for size in (3, 4, 5, 6):
            place = Path(folder) / "generated" / f"trucks{size}"
            place.mkdir(parents=True)
            (place / "domain.pddl").write_text(TRUCKS)
            (place / "problem.pddl").write_text(trucks(size))
            made.append(("", place / "domain.pddl", place / "problem.pddl"))
        rows = []
        for _, domain, problem in [*found, *made]:
            begin = process_time()
            task = ground(imported(parse_files(domain, problem)).problem)
            if isinstance(task, Task):
                rows.append((len(task), process_time() - begin, domain, problem))
        print("\nGrounding, CPU seconds: ours in-process, from the text on; the translator's own count ('Done!')\n")
        print("| problem | operators | ours | translator | ratio |\n|---|---|---|---|---|")
        for operators, seconds, domain, problem in sorted(rows, reverse=True, key=lambda row: row[:2])[:12]:
            match = re.search(r"Done! \[([\d.]+)s CPU", run(translate, domain, problem).output)
            theirs = float(match.group(1)) if match else float("inf")
            name = problem.relative_to(problem.parents[2])
            said = f"{theirs:.2f} | {theirs / seconds:.1f}" if match else f"more than {SECONDS} | –"
            print(f"| {name} | {operators} | {seconds:.3f} | {said} |", flush=True)


def read_back(python: str) -> None:
    """Import Fast Downward's plans for the lowest level of scenes, and print the results of validation and of physics."""
    import confab
    from confab.pddl_commands import read_pddl_plan
    from confab.planner.validation import validate

    command, program = planners(python)["lama-first"], [str(Path(sys.executable).parent / "confab")]
    print("\nPrimitive level exported, planned by Fast Downward (lama-first), read back\n")
    print("| scene | steps | validated | in physics |\n|---|---|---|---|")
    for scene in ("beverage-serving", "beverage-serving-moved", "one-arm-serving"):
        with tempfile.TemporaryDirectory() as folder:
            place, file = Path(folder), Path(folder) / "downward.plan"
            subprocess.run([*program, "export", scene, "-o", folder], cwd=ROOT, check=True, capture_output=True)
            steps = run(command, place / "domain.pddl", place / "problem.pddl").plan
            if steps is None:
                print(f"| {scene} | no plan | | |")
                continue
            file.write_text("".join(f"({step})\n" for step in steps))
            problem = confab.load(scene).problem
            faults = validate(problem, read_pddl_plan(problem, None, file.read_text(), regroup=True))
            done = subprocess.run(
                [*program, "verify", scene, str(file)], cwd=ROOT, check=False, capture_output=True, text=True
            )
            said = done.stdout.partition("\n")[0] or done.stderr.strip()
            print(f"| {scene} | {len(steps)} | {'no: ' + str(faults[0]) if faults else 'yes'} | {said} |", flush=True)


def _solve(domain: str, problem: str, target: str) -> None:
    """Solve one problem with the flat search, and write the plan; runs in the benchmarked process."""
    gc.disable()
    from confab.planner.grounded.best_first import search
    from confab.planner.grounded.grounding import ground
    from confab.planner.grounded.task import Task
    from confab.planner.plan import OUT_OF_MEMORY, Limits, Status
    from confab.reasoner.pddl.importing import imported
    from confab.reasoner.pddl.syntax import parse_files

    scene = imported(parse_files(Path(domain), Path(problem)))
    try:
        task = ground(scene.problem)
    except MemoryError:
        task = OUT_OF_MEMORY
    if not isinstance(task, Task):
        print(task.text)
        return

    def write(plan: Sequence[int]) -> None:
        steps = (scene.line(*task.describe(operator)[:2]) for operator in plan)
        part = Path(f"{target}.part")
        part.write_text("".join(f"({line})\n" for line in steps if line))
        part.replace(target)

    found = search(task, Limits(expansions=10**9), found=write)
    print(found.status, found.counts)
    if found.status is Status.SOLVED:
        write(found.plan)


def _by_engine(domain: str, problem: str, target: str, engine: str) -> None:
    """Solve one problem with an engine, as ``confab plan --engine`` does, and write its plan."""
    from confab.engines import plan_by_engine
    from confab.reasoner.pddl.importing import imported
    from confab.reasoner.pddl.syntax import parse_files

    scene = imported(parse_files(Path(domain), Path(problem)))
    found = plan_by_engine(scene.problem, engine)
    print(found.status, found.reason.text if found.reason else "")
    if found.plan is not None:
        lines = (scene.line(step.behavior, step.arguments) for step in found.plan.steps)
        Path(target).write_text("".join(f"({line})\n" for line in lines if line))


if __name__ == "__main__":
    _by_engine(*sys.argv[1:5]) if len(sys.argv) > 4 else _solve(*sys.argv[1:4])
