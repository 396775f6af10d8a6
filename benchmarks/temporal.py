"""Temporal problems of the field: coverage and makespan of Confab, LPG and Tamer; random timed worlds in a full search; families.

    python -m benchmarks temporal                        with problems in ../shared/temporal
    CONFAB_TEMPORAL=FOLDER python -m benchmarks temporal with problems elsewhere
    CONFAB_PEERS=PYTHON …                                with a Python that has up-lpg and up-tamer
    CONFAB_INSTANCES=1,5,12 …                            these instances of each domain only
    CONFAB_PLANNERS=confab,lpg,tamer …                   these planners only
    CONFAB_KINDS=worlds CONFAB_COUNT=1000 …              the random worlds only
    CONFAB_KINDS=families CONFAB_SIZES=10,40 …           the families only, with these numbers of objects

Each run is a separate process, limited to 30 s of CPU time. LPG improves its plan until the limit. Confab plans as the command
`confab plan --minimise makespan` does. Its plans are judged by unified-planning's TimeTriggeredPlanValidator, with conflicting
events 1 ms apart.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from benchmarks._processes import seconds_of_children

SECONDS, SPACING, VALIDATING = 30, 2, 5
ROOT = Path(__file__).resolve().parents[1]
PROBLEMS = Path(os.environ.get("CONFAB_TEMPORAL", ROOT.parent / "shared" / "temporal"))
EPSILON = Fraction(1, 1000)
FIRST, COUNT = 20_000, 5_000
TABLES = ("served", "swap", "handover", "blocked")
PEER = """
import json, re, subprocess, sys, tempfile
name, domain, problem = sys.argv[1:]
if name == "lpg":  # the engine's program: unified-planning can't read all of its plans
    from up_lpg.lpg_planner import lpg_os
    from importlib.resources import files
    with tempfile.TemporaryDirectory() as folder:
        command = [files("up_lpg") / lpg_os[sys.platform], "-o", domain, "-f", problem, "-n", "1000", "-cputime", "28"]
        said = subprocess.run([*command, "-out", folder + "/plan"], capture_output=True, text=True).stdout
    ends = [float(end) for end in re.findall(r"^Duration: +([0-9.]+)", said, re.MULTILINE)][-1:]  # each is the shortest so far
else:
    from unified_planning.io import PDDLReader
    from unified_planning.shortcuts import OneshotPlanner, get_environment
    get_environment().credits_stream = None
    get_environment().error_used_name = False
    with OneshotPlanner(name=name) as planner:
        plan = planner.solve(PDDLReader().parse_problem(domain, problem)).plan
    ends = [] if plan is None else [float(begin + (lasts or 0)) for begin, _, lasts in plan.timed_actions]
print(json.dumps(max(ends) if ends else None))
"""


def main() -> None:
    """Print the tables."""
    kinds = os.environ.get("CONFAB_KINDS", "problems,worlds").split(",")
    if "problems" in kinds:
        _problems()
    if "worlds" in kinds:
        for kind in ("", "limited", "shared"):
            _worlds(kind)
    if "families" in kinds:
        _families()


def _families() -> None:
    """Print the makespans of plans for tables with two and eight hands and for three mobile robots, with bounds and CPU times."""
    from confab.planner.solve import Request, solve
    from confab.planner.timed.call import best_in_time, in_time
    from worlds.deliveries import deliveries
    from worlds.families import family

    print(
        "| family | actors | n | steps | makespan of the plan's steps ÷ bound | makespan | bound for these steps "
        "| makespan ÷ bound | sequential plan, CPU s | schedule, CPU s |"
    )
    print("|---" * 10 + "|")
    for n in map(int, os.environ.get("CONFAB_SIZES", "10,40,100,200").split(",")):
        for name, actors in [(one, hands) for hands in (2, 8) for one in TABLES] + [("deliveries", 3)]:
            problem = deliveries(n, actors, 1) if name == "deliveries" else family(name, n, 1, actors)
            began = process_time()
            plan = solve(Request(problem)).plan
            assert plan is not None
            planned = process_time()
            timed = best_in_time(problem, plan).plan
            ended = process_time()
            plain = in_time(problem, plan).plan
            assert timed is not None and plain is not None
            bound = max(timed.bound, timed.least)
            print(
                f"| {name} | {actors} | {n} | {len(timed.slots)} | {float(plain.makespan / bound):.3f} | {float(timed.makespan):g} "
                f"| {float(bound):g} | {float(timed.makespan / bound):.3f} | {planned - began:.1f} | {ended - planned:.1f} |",
                flush=True,
            )


def _problems() -> None:
    planners = os.environ.get("CONFAB_PLANNERS", "confab,lpg,tamer").split(",")
    chosen = os.environ.get("CONFAB_INSTANCES", "")
    table: dict[str, dict[str, dict[str, float | None]]] = {}
    accepted: Counter[bool | None] = Counter()
    for folder in sorted(path for path in PROBLEMS.iterdir() if path.is_dir()):
        for problem in sorted((folder / "instances").glob("*.pddl"), key=lambda p: int(p.stem.split("-")[-1])):
            number = problem.stem.split("-")[-1]
            if chosen and number not in chosen.split(","):
                continue
            domain = folder / "domain.pddl"
            domain = domain if domain.exists() else folder / "domains" / f"domain-{number}.pddl"
            for planner in planners:
                found = _run(planner, domain, problem)
                row = table.setdefault(folder.name, {}).setdefault(planner, {})
                row[number] = found["makespan"] if found else None
                if found and planner == "confab":
                    verdict = found["accepted"]
                    accepted[verdict if isinstance(verdict, bool) else None] += 1
    print(
        "Solved, and makespan over the least of any planner here (geometric mean over the problems that this planner solved):\n"
    )
    print("| domain |" + "".join(f" {planner} |" for planner in planners))
    print("|---" * (len(planners) + 1) + "|")
    for name, rows in table.items():
        cells = [f"{sum(v is not None for v in rows[p].values())}{_ratio(rows, p)}" for p in planners]
        print(f"| {name}: {len(rows[planners[0]])} |" + "".join(f" {cell} |" for cell in cells))
    print(
        f"\nPlans of ours: {accepted[True]} accepted by unified-planning's validator, {accepted[False]} rejected, "
        f"{accepted[None]} of problems that it can't read"
    )


def _ratio(rows: dict[str, dict[str, float | None]], planner: str) -> str:
    product, many = 1.0, 0
    for number, makespan in rows[planner].items():
        known = [row[number] for row in rows.values() if row.get(number) is not None]
        if makespan is not None:
            product, many = product * makespan / min(value for value in known if value is not None), many + 1
    return f" (× {product ** (1 / many):.2f})" if many else ""


def _run(planner: str, domain: Path, problem: Path) -> dict[str, float | bool] | None:
    """Return the makespan and the verdict of a planner's plan, or None if the planner finds no plan in time."""
    if planner == "confab":
        command = [sys.executable, "-m", "benchmarks.temporal", "one", str(domain), str(problem)]
    else:
        command = [os.environ.get("CONFAB_PEERS", sys.executable), "-c", PEER, planner, str(domain), str(problem)]

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))

    with suppress(subprocess.TimeoutExpired):
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, preexec_fn=limited, timeout=SECONDS * 20, check=False
        )
        return _said(done)
    return None


def _said(done: subprocess.CompletedProcess[str]) -> dict[str, float | bool] | None:
    """Return the makespan and the verdict that a finished process has printed, or None if it has printed none."""
    lines = done.stdout.splitlines()
    if not lines or done.returncode < 0:
        return None
    try:
        said = json.loads(lines[-1])
    except ValueError:
        return None
    return said if isinstance(said, dict) else None if said is None else {"makespan": float(said), "accepted": True}


def one(domain: Path, problem: Path) -> None:
    """Print the makespan of Confab's plan for one problem, and whether the validator accepts the plan.

    The plan is that of ``confab import`` and ``confab plan --minimise makespan``, which allow conflicting events at the same time.
    Its events are then scheduled again in their order, `EPSILON` apart. Time limits are in CPU seconds.
    """

    def used() -> float:
        return process_time() + seconds_of_children()

    time.perf_counter = used  # before Confab imports it
    import confab
    from confab.planner.timed.activities import EventKind
    from confab.planner.timed.call import in_time
    from confab.reasoner.pddl.importing import imported
    from confab.reasoner.pddl.syntax import parse_files
    from confab.reasoner.pddl.turtle import turtle

    def left() -> float:
        return max(SECONDS - VALIDATING - used(), 1.0)

    found = imported(parse_files(domain, problem))
    with TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.ttl"
        scene.write_text(turtle(found.problem, problem.stem, "An imported problem."), encoding="utf-8")
        result = confab.load(scene).plan(minimise="makespan", time_limit=left() - SPACING)
    timed = result.timed
    if timed is not None:
        slots = list(enumerate(timed.slots))
        begins = [(slot.begin, 1, number, EventKind.BEGIN) for number, slot in slots]
        ends = [(slot.end, int(slot.begin == slot.end), number, EventKind.END) for number, slot in slots]
        events = [(number, kind) for *_, number, kind in sorted((*begins, *ends), key=lambda one: one[:3])]
        timed = in_time(result.problem, timed.plan, left(), EPSILON, events).plan
    if timed is None:
        print("null")
        return
    given = set(found.problem.times.events if found.problem.times else ())  # timed initial literals
    steps = [
        (slot.begin, found.line(slot.step.behavior, slot.step.arguments), slot.end - slot.begin)
        for slot in timed.slots
        if slot.step.behavior not in given
    ]
    print(json.dumps({"makespan": float(timed.makespan), "accepted": validated(domain, problem, steps)}), flush=True)


def validated(domain: Path, problem: Path, steps: Sequence[tuple[Fraction, str, Fraction]]) -> bool | None:
    """Return whether unified-planning's validator accepts steps with their exact begins and durations.

    Return None if unified-planning can't read the problem: it knows no (either …) and no type that is declared twice.
    """
    from pyparsing import ParseBaseException
    from unified_planning.engines.plan_validator import TimeTriggeredPlanValidator
    from unified_planning.io import PDDLReader
    from unified_planning.model import DurativeAction
    from unified_planning.plans import TimeTriggeredPlan
    from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    get_environment().error_used_name = False  # an action and a predicate may have the same name
    try:
        read = PDDLReader().parse_problem(str(domain), str(problem))
    except (ParseBaseException, SyntaxError):
        return None
    plan = PDDLReader().parse_plan_string(read, "\n".join(f"0: ({line}) [1]" for _, line, _ in steps if line))
    made = zip((step for step in steps if step[1]), plan.timed_actions, strict=True)
    timed = [
        (begin, one, lasts if isinstance(one.action, DurativeAction) else None)
        for (begin, _, lasts), (_, one, _) in made
    ]
    validator = TimeTriggeredPlanValidator()
    validator.skip_checks = True  # a function without a value for some objects isn't in its list of features
    return bool(validator.validate(read, TimeTriggeredPlan(timed)))


def _worlds(kind: str) -> None:
    """Print how plans of random timed worlds compare with an exhaustive search.

    The worlds have deadlines and windows if `kind` is ``limited``, and an amount that actions share if it is ``shared``.
    """
    from confab.planner.plan import Limits, Status
    from confab.planner.solve import Request, solve
    from confab.planner.timed.call import best_in_time
    from confab.planner.timed.plan import schedule_of
    from worlds.timed import least_makespan, problem_of, rejected, timed_world

    first, count = int(os.environ.get("CONFAB_SEED", FIRST)), int(os.environ.get("CONFAB_COUNT", COUNT))
    found: Counter[str] = Counter()
    ratios: list[float] = []
    wrong: list[int] = []
    began = process_time()
    for seed in range(first, first + count):
        world = timed_world(seed, limited=kind == "limited", shared=kind == "shared")
        problem = problem_of(world)
        outcome = solve(Request(problem, limits=Limits(seconds=20.0)))
        timed = schedule_of(outcome)
        if timed is None and outcome.plan is not None:
            timed = best_in_time(problem, outcome.plan, 1.0).plan
        try:
            least = least_makespan(world)
        except MemoryError:
            found["too large to be searched"] += 1
            continue
        if timed is None and outcome.status is Status.UNSOLVABLE:
            found["without a plan, and proved to be so"] += least is None
            wrong += [seed] * (least is not None)
        elif timed is None:
            found["without a plan, and we found none" if least is None else "solvable, and we found no plan"] += 1
        elif least is None or timed.makespan < least or rejected(world, timed) is not None:
            wrong.append(seed)
        else:
            found["solved"] += 1
            found["of these with the least makespan"] += timed.makespan == least
            ratios.append(float(timed.makespan / least))
    what = {"": "", "limited": " with deadlines and windows", "shared": " with a shared amount"}[kind]
    print(
        f"\nRandom timed worlds{what}, {first} to {first + count - 1}, {process_time() - began:.0f} CPU s:\n\n| | |\n|---|---|"
    )
    for name, many in sorted(found.items()):
        print(f"| {name} | {many} |")
    print(f"| makespan ÷ least, mean | {sum(ratios) / max(len(ratios), 1):.3f} |")
    print(f"| wrong: no plan, shorter than the least, or a wrong proof | {len(wrong)} {wrong[:5] or ''} |")


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        one(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        main()
