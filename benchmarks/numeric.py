"""Numeric planning: random problems compared with a search in plain Python, and the numeric problems of unified-planning.

python -m benchmarks numeric
CONFAB_PROBLEMS=100 …        number of random problems: half with jugs, half with a van whose roads have costs
"""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from benchmarks.pddl import accepted
from confab.planner.plan import Limits, Status
from confab.planner.plan_costs import cost_of
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.language import DomainError
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.words import PddlError
from worlds.numbers import jugs, rounds

MODES = ("guarded", "optimal", "paper")
LIMITS = Limits(2_000_000, 60.0)


def main() -> None:
    """Print the numbers of solved random problems and the disagreements with the search in plain Python."""
    half = int(os.environ.get("CONFAB_PROBLEMS", "100")) // 2
    counts, wrong = Counter[tuple[str, str, str]](), list[str]()
    for name, make in (("jugs", jugs), ("van", rounds)):
        for seed in range(half):
            problem, least = make(Random(seed))
            for mode in MODES:
                found = solve(Request(problem, mode, LIMITS))
                counts[name, mode, found.status.value] += 1
                if found.status is Status.GAVE_UP:
                    continue
                if (found.plan is not None) is not (least is not None):
                    wrong.append(f"{name} {seed} {mode}: {found.status.value}, and the cheapest plan costs {least}")
                elif found.plan is not None and least is not None:
                    cost = cost_of(problem, found.plan)
                    if validate(problem, found.plan) or cost < least or (mode == "optimal" and cost != least):
                        wrong.append(f"{name} {seed} {mode}: costs {cost}, the cheapest plan {least}")
                    counts[name, mode, "cheapest"] += cost == least
    print(f"| of {half} each | mode | solved | cheapest | unsolvable | given up |\n|---|---|---|---|---|---|")
    for name in ("jugs", "van"):
        for mode in MODES:
            row = [counts[name, mode, what] for what in ("solved", "cheapest", "unsolvable", "gave-up")]
            print(f"| {name} | {mode} | {' | '.join(map(str, row))} |")
    print(f"\nDisagreements: {len(wrong)}", *wrong, sep="\n")
    others()


def others() -> None:
    """Print the numbers of unified-planning's problems that are read, solved and accepted by its validator."""
    print(
        "\n| problems of unified-planning's tests | read | solved | accepted by its validator | refused |\n|---|---|---|---|---|"
    )
    tally, refused = Counter[tuple[str, str]](), Counter[str]()
    for where, name, domain, text in published():
        outcome, accepts = tried(domain, text)
        tally[where, "read"] += not outcome.startswith("refused")
        tally[where, "solved"] += outcome == "solved"
        tally[where, "accepted"] += accepts
        if outcome != "solved":
            refused[f"{name}: {outcome}"] += 1
    for where in dict.fromkeys(where for where, _ in tally):
        read, done, good = (tally[where, what] for what in ("read", "solved", "accepted"))
        missing = sum(one.startswith(where) for one in refused)
        print(f"| {where} | {read} | {done} | {good} | {missing} |")
    print("", *(f"- {one}" for one in sorted(refused)), sep="\n")


def published() -> Iterator[tuple[str, str, str, str]]:
    """Yield the numeric problems in unified-planning's wheel: the source, a name, and domain and problem as PDDL."""
    import unified_planning
    from unified_planning.io import PDDLWriter
    from unified_planning.test.examples import get_example_problems

    for name, example in get_example_problems().items():
        kind = getattr(example.problem, "kind", None)
        if (
            kind is not None
            and (kind.has_int_fluents() or kind.has_real_fluents())
            and hasattr(example.problem, "actions")
        ):
            writer = PDDLWriter(example.problem)
            with suppress(AttributeError):  # unified-planning's writer can't write some examples
                yield "examples", f"examples: {name}", writer.get_domain(), writer.get_problem()
    tests = Path(unified_planning.__file__).parent / "test" / "pddl"
    for domain in sorted([*tests.glob("*/domain.pddl"), *tests.glob("*/d.pddl")]):
        if ":functions" in domain.read_text():
            for problem in sorted([*domain.parent.glob("problem*.pddl"), *domain.parent.glob("p.pddl")]):
                name = f"files: {domain.parent.name}/{problem.name}"
                yield "files", name, domain.read_text(), problem.read_text()


def tried(domain: str, problem: str) -> tuple[str, bool]:
    """Return the result for a problem as text, and whether unified-planning accepts the plan."""
    try:
        found = imported(parse(domain, problem))
    except PddlError as error:
        return f"refused: {error}", False
    try:
        outcome = solve(Request(found.problem, limits=LIMITS))
    except DomainError as error:
        return f"read, but {str(error)[:80]}", False
    if outcome.plan is None:
        return f"{outcome.status.value}: {outcome.reason.text if outcome.reason else ''}", False
    lines = [line for step in outcome.plan.primitives if (line := found.line(step.behavior, step.arguments))]
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        files = Path(folder) / "domain.pddl", Path(folder) / "problem.pddl"
        for file, text in zip(files, (domain, problem), strict=True):
            file.write_text(text)
        return "solved", accepted(*files, lines)
