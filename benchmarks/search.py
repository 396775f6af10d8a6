"""The default planner: scaling, other planners, plan lengths, random tables compared with exhaustive search, and ablations.

    python -m benchmarks search
    CONFAB_SEARCH=scale,random …     parts: scale, hands, peers, optimal, lengths, random, parts (all by default)
    CONFAB_TABLES=2000 …             number of random tables (200 by default)
    CONFAB_SECONDS=480 …             seconds after which no further random table is tried
    CONFAB_ROWS=FILE …               store the row of each random table in a file, and continue from the stored rows
    CONFAB_PEER_ROWS=FILE …          store the runs of other planners in a file

Times are medians of several runs in CPU seconds, which depend little on the load of the machine. Seeds below 60,000 were used
for the development of the planner. Random tables have seeds from 3,000,000, and families have seeds from 100.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import product
from math import log
from pathlib import Path
from random import Random
from statistics import mean, median
from time import perf_counter, process_time
from typing import Any

from benchmarks._beside import beside_peers, optimal_costs
from benchmarks.pddl import peers
from confab.planner.experience.advice import Advisor
from confab.planner.experience.advice import plan as guided
from confab.planner.experience.lessons import teach
from confab.planner.grounded.best_first import plan_level
from confab.planner.hierarchical.planner import Compiled, compiled, plan
from confab.planner.plan import Limits, Outcome, Reason, Status
from confab.planner.validation import validate
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import load
from confab.reasoner.limits import LimitError
from confab.reasoner.memory.experience import Experience, Method
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.reading.problem import read
from worlds.families import family as packed
from worlds.families import random_table
from worlds.lessons import problem as lesson
from worlds.truth import StateSpace, TooManyError

FAMILIES = ("served", "handover", "swap", "rotate", "full", "blocked")
SEED, TABLES = 100, int(os.environ.get("CONFAB_SEEDS", "3_000_000"))
PARTS_SEED, BUDGET = 110, 20.0
"""Seed of the tables for ablations, and time limit in CPU seconds. The memory's lessons have the seeds 100 and 101."""
LENGTHS = Path(__file__).with_name("lengths.json")


def main() -> None:
    """Print the tables; exit with an error if an easy family needs steps of a lower level, or a plan or a proof is wrong."""
    sections: dict[str, Callable[[], None]] = {
        "scale": scale,
        "hands": hands,
        "peers": lambda: beside_peers(peers_with_gtpyhop(), SEED),
        "optimal": lambda: optimal_costs(peers_with_gtpyhop(), SEED),
        "lengths": lengths,
        "random": random_tables,
        "parts": parts,
    }
    for name in os.environ.get("CONFAB_SEARCH", ",".join(sections)).split(","):
        print(f"\n### {name}\n", flush=True)
        sections[name]()


def scene(family: str, n: int, hands: int = 2, seed: int = SEED) -> tuple[Problem, float]:
    """Return the problem of a generated scene, and the CPU seconds of reading the scene."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{family}-{n}.ttl"
        write_scene(path, family, n, hands, 0, seed)
        begin = process_time()
        problem = read(load(str(path))).problem
        return problem, process_time() - begin


def timed(function: Callable[[], Any], runs: int = 5) -> tuple[Any, float]:
    """Return the result of a function, and the median CPU seconds of several calls."""
    seconds = []
    for _ in range(runs):
        gc.collect()
        begin = process_time()
        result = function()
        seconds.append(process_time() - begin)
    return result, median(seconds)


def cold(problem: Problem, program: Compiled, improve: int | None = None) -> Callable[[], Outcome]:
    """Return a planning call without memory."""
    if improve is None:
        return lambda: plan(problem, using=Compiled(program.program))
    return lambda: plan(problem, improve=improve, using=Compiled(program.program))


def check(problem: Problem, outcome: Outcome, what: str, easy: bool = True) -> None:
    """Stop the benchmark if a plan is invalid, or if an easy family needed steps of a lower level."""
    if outcome.plan is None or validate(problem, outcome.plan):
        sys.exit(f"{what}: {outcome.status.value}, not a valid plan: {outcome.reason}")
    if easy and outcome.fallbacks:
        sys.exit(f"{what}: {outcome.fallbacks} fallbacks, where there should be none")


def scale() -> None:
    """Plan for tables of the family `served` of growing size, with methods that are learned during each call."""
    python = peers_with_gtpyhop()
    print(
        "| n | read ms | compile ms | plan ms | improved ms | steps 1/2/3 | improved | expansions 1/2/3 | GTPyhop ms | its steps |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    plans: dict[int, float] = {}
    for n in (4, 10, 20, 50, 100, 200, 1000, 10_000):
        problem, reading = scene("served", n)
        runs = 9 if n <= 200 else 3 if n <= 1000 else 1
        program, compiling = timed(partial(compiled, problem), runs)
        first, seconds = timed(cold(problem, program, 0), runs)
        better, improving = timed(cold(problem, program), runs)
        if n <= 1000:
            check(problem, first, f"served {n}")
            check(problem, better, f"served {n} improved")
        plans[n] = seconds
        peer_seconds, peer_steps = gtpyhop(python, problem) if n <= 200 else ("", "")
        steps = "/".join(str(first.plan.length[level]) for level in (1, 2, 3))
        expansions = "/".join(str(count.expanded) for count in first.search.values())
        print(
            f"| {n} | {reading * 1e3:.0f} | {compiling * 1e3:.1f} | {seconds * 1e3:.2f} | {improving * 1e3:.1f} | {steps} | "
            f"{len(better.plan.primitives)} | {expansions} | {peer_seconds} | {peer_steps} |",
            flush=True,
        )
    exponent = log(plans[10_000] / plans[50]) / log(10_000 / 50)
    print(f"\ngrowth exponent of planning from 50 to 10,000: {exponent:.2f}")


def hands() -> None:
    """Plan for all families with up to 50 objects, and with more hands."""
    print("| family | hands | n | plan ms | steps 1/2/3 | expansions 1/2/3 | cache hits/misses | fallbacks |")
    print("|---|---|---|---|---|---|---|---|")
    cases = [(family, 2, n) for family in FAMILIES for n in (4, 10, 20, 50)]
    cases += [(family, number, n) for family in ("served", "swap", "rotate") for number in (4, 8) for n in (20, 50)]
    cases += [("packed", 2, n) for n in (4, 10, 20, 50)]  # full tables have no free place
    for family, number, n in cases:
        problem = scene(family, n, number)[0] if family != "packed" else packed("packed", n, SEED)
        program = compiled(problem)
        outcome, seconds = timed(cold(problem, program, 0), 3 if family != "packed" else 1)
        check(problem, outcome, f"{family} {n}", easy=family not in ("full", "packed"))
        steps = "/".join(str(outcome.plan.length.get(level, 0)) for level in (1, 2, 3))
        expansions = "/".join(str(count.expanded) for count in outcome.search.values())
        print(
            f"| {family} | {number} | {n} | {seconds * 1e3:.1f} | {steps} | {expansions} | {outcome.hits}/{outcome.misses} | "
            f"{outcome.fallbacks} |",
            flush=True,
        )


# -------------------------------------------------------------------------------------------------------------- peers


def peers_with_gtpyhop() -> str:
    """Return the Python of the other planners, with gtpyhop installed."""
    python = peers()
    if subprocess.run([python, "-c", "import gtpyhop"], capture_output=True, check=False).returncode:
        subprocess.run([python, "-m", "pip", "install", "-q", "gtpyhop"], check=True)
    return python


def gtpyhop(python: str, problem: Problem) -> tuple[str, str]:
    """Return the milliseconds and the number of steps of GTPyhop with handwritten methods."""
    at = {s.arguments[0]: v for s, v in problem.initial.items() if s.situation == "LOCATION"}
    drinks = {s.arguments[0]: v for s, v in problem.initial.items() if s.situation == "BEVERAGE"}
    reach: dict[str, list[str]] = {}
    for hand, place in sorted(problem.relations["canReach"]):
        reach.setdefault(hand, []).append(place)
    goals = {s.arguments[0]: v for s, v in problem.goal.items() if s.situation == "LOCATION"}
    pours = {s.arguments[0]: v for s, v in problem.goal.items() if s.situation == "BEVERAGE"}
    table = {
        "at": at,
        "drinks": {o: None if v == "no_beverage" else v for o, v in drinks.items()},
        "reach": reach,
        "goals": goals,
        "pours": pours,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.json"
        path.write_text(json.dumps(table))
        script = Path(__file__).with_name("_gtpyhop_tabletop.py")
        try:
            done = subprocess.run(
                [python, script, path], capture_output=True, text=True, timeout=120, check=False
            ).stdout.split()[-2:]
        except subprocess.TimeoutExpired:
            done = []
    return (f"{float(done[0]) * 1e3:.1f}", done[1]) if len(done) == 2 else ("–", "–")


# ------------------------------------------------------------------------------------------------------------- lengths


def lengths() -> None:
    """Compare the lengths of the first and the shortened plan with the best known lengths (sources in `lengths.json`)."""
    known: dict[str, dict[str, Any]] = json.loads(LENGTHS.read_text()) if LENGTHS.exists() else {}
    print(
        "| family | n | first | improved | first ms | improving ms | best known | source | ratio | at least | ratio |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    ratios, late = [], 0
    for family in FAMILIES:
        for n in (4, 10, 20, 50):
            problem, _ = scene(family, n)
            program = compiled(problem)
            first, before = timed(cold(problem, program, 0), 3)
            better, seconds = timed(cold(problem, program), 3)
            check(problem, better, f"{family} {n}", easy=False)
            best, bound = known.get(f"{family} {n}"), at_least(problem)
            length = len(better.plan.primitives)
            ratio = length / best["length"] if best else None
            ratios += [ratio] if ratio else []
            late += seconds - before > max(0.05, 2 * before)
            print(
                f"| {family} | {n} | {len(first.plan.primitives) if first.plan else '–'} | {length} | {before * 1e3:.1f} | "
                f"{(seconds - before) * 1e3:.1f} | {best['length'] if best else '–'} | {best['source'] if best else '–'} | "
                f"{f'{ratio:.2f}' if ratio else '–'} | {bound} | {length / bound:.2f} |",
                flush=True,
            )
    if ratios:
        print(f"\nmean ratio {mean(ratios):.3f}, largest {max(ratios):.2f}")
    print(f"improving took longer than 50 ms and twice the first plan in {late} of {len(ratios)} rows")


def at_least(problem: Problem) -> int:
    """Return a lower bound on the number of primitives of a table's plan that leaves the hands empty and raised.

    An object that changes its place, and a bottle that is poured from, is grasped and put down at least once; this takes six
    primitives. If no hand reaches both places of the object, it is grasped and put down twice. A pour takes four primitives. If
    cup and bottle are each moved at most once, a hand that moves the bottle must reach a place of the cup; otherwise one more
    move is counted.
    """
    reach: dict[str, set[str]] = {}
    for hand, place in problem.relations["canReach"]:
        reach.setdefault(place, set()).add(hand)
    at = {s.arguments[0]: v for s, v in problem.initial.items() if s.situation == "LOCATION"}
    to = at | {s.arguments[0]: v for s, v in problem.goal.items() if s.situation == "LOCATION"}
    drinks = {v: s.arguments[0] for s, v in problem.initial.items() if s.situation == "BEVERAGE"}
    pours = [
        (drinks[v], s.arguments[0])
        for s, v in problem.goal.items()
        if s.situation == "BEVERAGE" and problem.initial[s] != v
    ]
    moved = {thing for thing in at if at[thing] != to[thing]} | {bottle for bottle, _ in pours}
    moves = {thing: 1 if reach.get(at[thing], set()) & reach.get(to[thing], set()) else 2 for thing in moved}
    more: set[str] = set()  # at most one additional move for each bottle and each cup
    for bottle, cup in pours:
        hands = reach.get(at[bottle], set()) & reach.get(to[bottle], set())
        there = reach.get(at[cup], set()) | reach.get(to[cup], set())
        if moves[bottle] == 1 and moves.get(cup, 1) == 1 and not hands & there and not {bottle, cup} & more:
            more |= {bottle, cup}
    return 6 * (sum(moves.values()) + len(more) // 2) + 4 * len(pours)


# -------------------------------------------------------------------------------------------------------- random tables


def random_tables() -> None:
    """Plan for random tables of 10³ to 10⁶ reachable states, and compare with a search of all states (`worlds.truth`).

    With `CONFAB_ROWS=FILE`, the row of each table is stored in the file, and stored rows aren't measured again.
    """
    wanted = int(os.environ.get("CONFAB_TABLES", "200"))
    end = perf_counter() + float(os.environ.get("CONFAB_SECONDS", "inf"))
    file = Path(os.environ["CONFAB_ROWS"]) if "CONFAB_ROWS" in os.environ else None
    rows: list[dict[str, Any]] = (
        [json.loads(line) for line in file.open()] if file is not None and file.exists() else []
    )
    seed = rows[-1]["seed"] if rows else TABLES
    while sum(row["status"] is not None for row in rows) < wanted and perf_counter() < end:
        seed += 1
        row = compared(seed, rows)
        rows += [row] if row else []
        if file is not None and row:
            with file.open("a") as lines:
                lines.write(json.dumps(row) + "\n")
    done = [row for row in rows if row["status"] is not None]
    for what, number in sorted(Counter((row["solvable"], row["status"]) for row in done).items()):
        print(f"{'solvable' if what[0] else 'unsolvable'}, {what[1]}: {number} ({100 * number / len(done):.0f} %)")
    print(f"seeds {TABLES + 1} to {seed}; solvable ones left out for the sake of the share: {len(rows) - len(done)}")
    for low in (3, 4, 5):
        print(
            f"tables of 10^{low} to 10^{low + 1} states: {sum(10**low <= row['states'] < 10 ** (low + 1) for row in done)}"
        )
    states = [row["states"] for row in done]
    print(f"states: {min(states)} to {max(states)}, median {median(states):.0f}")
    seconds = [row["seconds"] for row in done]
    print(f"CPU seconds per table: median {median(seconds):.4f}, largest {max(seconds):.2f}")
    over = [row["length"] / row["shortest"] for row in done if row["shortest"]]
    print(f"length over the shortest of the lowest level: mean {mean(over):.2f}, largest {max(over):.2f}")
    wrong = [row["seed"] for row in done if row["status"] != ("solved" if row["solvable"] else "unsolvable")]
    print(f"false answers and given up: {len(wrong)} {wrong or ''}")
    if wrong:
        sys.exit("not every table was decided rightly")


def compared(seed: int, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Return the result of the exhaustive search and of the planner, or None for a table of another size or without steps."""
    problem = random_table(seed)
    if seed % 3:  # hands reach fewer places on two of three tables, so that more tables are unsolvable
        rng = Random(f"reach {seed}")
        pairs = frozenset(p for p in sorted(problem.relations["canReach"]) if rng.random() > 0.18 * (seed % 3))
        problem = replace(problem, relations={"canReach": pairs})
    try:
        truth = StateSpace(problem).explore(10**6)
    except TooManyError:
        return None
    if truth.states < 1000 or truth.shortest == 0:
        return None
    solvable = truth.shortest is not None
    row = {"seed": seed, "states": truth.states, "solvable": solvable, "shortest": truth.shortest, "status": None}
    done = [r["solvable"] for r in rows if r["status"] is not None]
    if solvable and done.count(True) > 2 * done.count(False):  # an incomplete run also has such tables
        return row
    begin = process_time()
    outcome = plan(problem)
    seconds = process_time() - begin
    if outcome.plan is not None:
        check(problem, outcome, f"random table {seed}", easy=False)
    length = len(outcome.plan.primitives) if outcome.plan else None
    return {**row, "status": outcome.status.value, "seconds": round(seconds, 5), "length": length}


# --------------------------------------------------------------------------------------------------------------- parts


@contextmanager
def budget(seconds: float) -> Iterator[None]:
    """Raise `LimitError` in the block after `seconds` of CPU time; planners handle the error like their own limit."""

    def stop(*_: object) -> None:
        raise LimitError(f"{seconds:g} s of CPU")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def within(seconds: float, variant: Callable[[], Outcome]) -> Outcome:
    """Return the outcome of a planning call within a limit of CPU time."""
    try:
        with budget(seconds):
            return variant()
    except LimitError as limit:
        return Outcome(Status.GAVE_UP, reason=Reason(str(limit)))


class Forgetful(dict[str, list[Method]]):
    """A store of methods that keeps no method."""

    def setdefault(self, behavior: str, default: list[Method]) -> list[Method]:
        """Return the default without storing it."""
        return default


def variants(problem: Problem, memory: Advisor) -> dict[str, Callable[[], Outcome]]:
    """Return planning calls that each omit one part of the planner, by the name of the part."""
    limits, level = Limits(expansions=10**7), problem.domain.levels[-1]
    only = {behavior.name: behavior for behavior in problem.domain.at_level(level)}
    flat = replace(problem, domain=Domain(problem.domain.situations, only, problem.domain.first_ids))

    def without_methods() -> Outcome:
        return plan(problem, limits=limits, improve=0, using=Compiled(compiled(problem).program, Forgetful()))

    return {
        "nothing, memory leading": partial(guided, problem, memory, "leading", limits),
        "nothing, memory guarded": partial(guided, problem, memory, "guarded", limits),
        "memory": partial(plan, problem, limits=limits, improve=0),
        "memory, cached refinements": without_methods,
        "memory, levels": partial(plan, flat, limits=limits, improve=0),
        "memory, levels, goal order (flat h_FF)": partial(plan_level, problem, limits=limits),
    }


def parts() -> None:
    """Measure the contribution of each part of the planner by omitting it, for `BUDGET` CPU seconds each."""
    experience = Experience("lessons")
    for family, objects, seed in product(("served", "swap", "full"), (4, 6), (100, 101)):
        teach(experience, lesson(family, objects, seed))
    memory = Advisor(experience)
    print("| family | n | without | status | CPU ms | expansions 1/2/3 | primitives |")
    print("|---|---|---|---|---|---|---|")
    cases = [(family, n) for family in ("served", "swap") for n in (4, 10, 50)]
    for family, n in [*cases, ("full", 20), ("full", 50)]:
        problem, _ = scene(family, n, seed=PARTS_SEED)
        for name, variant in variants(problem, memory).items():
            outcome, seconds = timed(partial(within, BUDGET, variant), 1)
            expansions = "/".join(str(count.expanded) for count in outcome.search.values())
            length = len(outcome.plan.primitives) if outcome.plan else "–"
            print(
                f"| {family} | {n} | {name} | {outcome.status.value} | {seconds * 1e3:.1f} | {expansions} | {length} |",
                flush=True,
            )
