"""Comparison with Fast Downward on tasks with axioms: solvability and length of a shortest plan.

python -m benchmarks axioms
CONFAB_PROBLEMS=200 …        number of random problems of each kind
CONFAB_KINDS=packing …       kinds: packing, gallery, random (all by default)
CONFAB_SEED=0 …              seed of the first problem
CONFAB_PEERS=PYTHON …        a Python that has up-fast-downward

The kinds packing (nested boxes) and gallery (rooms joined by open doors) are the shipped worlds with other individuals, states and
goals. Fast Downward gets the PDDL that `confab export` writes. The kind random is random PDDL (`worlds.axioms`), which both
planners read. The evaluator `worlds.axioms.Plain` also solves these tasks. Fast Downward searches by A* without a heuristic.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import process_time

from benchmarks.pddl import peers, planners, run
from confab.planner.plan import Limits, Status
from confab.planner.solve import Request, solve
from confab.planner.validation import LoggedState
from confab.reasoner.derivation import circular
from confab.reasoner.graph.knowledge import load
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import TRUE, Symbol
from worlds.axioms import Plain, axioms

SECONDS = 60.0


def boxes(problem: Problem, rng: Random) -> Problem:
    """Return a random problem of nested boxes, with one or two goals about defined situations."""
    rooms, count = ["hall", "vault"][: rng.choice((2, 2, 1))], rng.choice((2, 3, 3, 4))
    cases, things = [f"box{i}" for i in range(count)], ["ring"]
    initial = {}
    for place, thing in enumerate([*cases, *things]):  # a box lies in a room or in a box before it
        initial[Symbol("LIES_IN", (thing,))] = rng.choice([*rooms, *cases[: min(place, count)]])
    initial |= {Symbol("SHUT", (box,)): TRUE for box in cases if rng.random() < 0.5}
    members = {"Room": rooms, "Vault": rooms[1:], "Box": cases, "Thing": cases + things, "Place": rooms + cases}
    members |= dict.fromkeys(("INSIDE", "LIES_IN"), members["Place"]) | {"Object": rooms + cases + things}
    wanted = [Symbol("INSIDE", (one, other)) for one, other in pairwise(rng.sample([*things, *cases], 3))]
    wanted = [symbol for symbol in wanted if symbol.arguments[1] in cases]
    wanted.append(rng.choice([Symbol("STORED_AWAY", ("ring",)), Symbol("INSIDE", ("ring", rng.choice(rooms)))]))
    return _with(problem, members, {}, initial, dict.fromkeys(rng.sample(wanted, rng.choice((1, len(wanted)))), TRUE))


def rooms(problem: Problem, rng: Random) -> Problem:
    """Return a random problem of rooms joined by doors, with goals on the guard's room and on connections between rooms."""
    count = rng.choice((4, 5, 6))
    places = [f"room{i}" for i in range(count)]
    doors, initial = [], {}
    door_of, switch = set[tuple[str, ...]](), set[tuple[str, ...]]()
    joined = [[*both] for both in pairwise(places)] + [rng.sample(places, 2) for _ in range(rng.choice((0, 1, 2)))]
    for i, both in enumerate(joined):
        door = f"door{i}"
        doors.append(door)
        door_of |= {(door, place) for place in both}
        switch |= {(door, place) for place in rng.sample(rng.choice((places, both, both)), rng.choice((0, 1, 1, 2)))}
        if rng.random() < 0.4:
            initial[Symbol("OPEN", (door,))] = TRUE
    initial[Symbol("AT", ("guard",))] = rng.choice(places)
    members = {"Room": places, "Door": doors, "Guard": ["guard"], "Object": [*places, *doors, "guard"]}
    members |= dict.fromkeys(("AT", "JOINED", "WAY"), places)
    wanted = {Symbol("AT", ("guard",)): rng.choice(places)} if rng.random() < 0.6 else {}
    for _ in range(rng.choice((1, 2))):
        one, other = rng.sample(places, 2)
        wanted[Symbol("WAY", (one, other))] = rng.choice((TRUE, TRUE, "false"))
    return _with(problem, members, {"doorOf": door_of, "workedFrom": switch}, initial, wanted)


def _with(
    problem: Problem,
    members: dict[str, list[str]],
    relations: dict[str, set[tuple[str, ...]]],
    initial: dict[Symbol, str],
    goal: dict[Symbol, str],
) -> Problem:
    classes = {name: tuple(members.get(name, ())) for name in problem.classes} | {"Truth": problem.classes["Truth"]}
    static = {name: frozenset(rows) for name, rows in relations.items()}
    return replace(problem, classes=classes, relations=static, initial=initial, goal=goal)


def downward(domain: str, problem: str, command: list[str]) -> int | None:
    """Return the length of Fast Downward's shortest plan, or None if Fast Downward proves that there is no plan."""
    with TemporaryDirectory() as folder:
        files = Path(folder) / "domain.pddl", Path(folder) / "problem.pddl"
        for file, text in zip(files, (domain, problem), strict=True):
            file.write_text(text)
        done = run(command, *files, cap=int(SECONDS))
    if done.plan is None and "unsolvable" not in done.output and "no solution" not in done.output:
        raise RuntimeError(done.output[-1500:])
    return None if done.plan is None else len(done.plan)


def deepest(problem: Problem) -> int:
    """Return the length of the longest chain of a transitive situation type in the initial state."""
    name = "INSIDE" if "INSIDE" in problem.domain.rules else "WAY"
    facts, (one, other) = LoggedState(problem, problem.initial), problem.domain.situations[name].arguments
    return max(sum(facts.value(name, (a, b)) == TRUE for b in problem.classes[other]) for a in problem.classes[one])


def made(kind: str, seed: int) -> tuple[Problem, str, str]:
    """Return a random problem of a kind, and its domain and problem as PDDL."""
    if kind == "random":
        domain, text = axioms(Random(seed))
        return imported(parse(domain, text)).problem, domain, text
    world = read(load(f"{kind}-small")).problem
    problem = KINDS[kind](world, Random(seed))
    written = to_pddl(problem)
    return problem, written.domain, written.problem


KINDS = {"packing": boxes, "gallery": rooms}


def main() -> None:
    """Print statistics of the problems, and all disagreements with Fast Downward."""
    count, first = int(os.environ.get("CONFAB_PROBLEMS", "200")), int(os.environ.get("CONFAB_SEED", "0"))
    kinds = os.environ.get("CONFAB_KINDS", "packing,gallery,random").split(",")
    command = planners(peers())["lama-first"]
    place = command.index("--alias")
    command = [*command[:place], *command[place + 2 :], "--search", "astar(blind())"]
    counts, wrong, seconds = Counter[str](), list[str](), dict.fromkeys(("optimal", "guarded"), 0.0)
    for kind in kinds:
        for seed in range(first, first + count):
            problem, domain, text = made(kind, seed)
            theirs = downward(domain, text, command)
            counts[f"{kind}: solvable"] += theirs is not None
            counts[f"{kind}: steps"] += theirs or 0
            if kind == "random":
                plainly = Plain(domain).shortest(text)
                counts[f"{kind}: solvable in at least one step"] += bool(theirs)
                counts[f"{kind}: recursive derived predicates"] += len(circular(problem.domain.rules))
                if plainly != theirs:
                    wrong.append(f"{kind} {seed}: plainly {plainly}, Fast Downward: {theirs}")
            else:
                counts[f"{kind}: chains of three and more"] += deepest(problem) >= 3
            for mode in seconds:
                begin = process_time()
                found = solve(Request(problem, mode, Limits(10_000_000, SECONDS)))
                seconds[mode] += process_time() - begin
                solved, steps = found.status is Status.SOLVED, found.plan.steps if found.plan else ()
                length = len(steps)
                counts[f"{kind}: steps of {mode}"] += length
                if solved is not (theirs is not None) or found.status is Status.GAVE_UP:
                    wrong.append(f"{kind} {seed} {mode}: {found.status.name}, Fast Downward: {theirs}")
                elif length < (theirs or 0) or (mode == "optimal" and length != (theirs or 0)):
                    wrong.append(f"{kind} {seed} {mode}: {length} steps, Fast Downward: {theirs}")
    print(f"| of each kind's {count} | |\n|---|---|")
    for what, many in sorted(counts.items()):
        print(f"| {what} | {many} |")
    print("\nCPU s:", ", ".join(f"{mode} {spent:.1f}" for mode, spent in seconds.items()))
    print(f"\nDisagreements: {len(wrong)}", *wrong, sep="\n")
