"""Numbers in planning: random problems beside a search in plain Python; problems that unified-planning ships, read and solved.

python -m benchmarks numeric
CONFAB_PROBLEMS=100 …        how many random problems, half of jugs, half of a van whose ways have a price
"""

from __future__ import annotations

import os
from collections import Counter
from random import Random

from planner.plan import Limits, Status
from planner.plan_costs import cost_of
from planner.solve import Request, solve
from planner.validation import validate
from worlds.numbers import jugs, rounds

LIMITS = Limits(2_000_000, 60.0)


def main() -> None:
    """Print how many problems agree."""
    half = int(os.environ.get("CONFAB_PROBLEMS", "100")) // 2
    counts, wrong = Counter[str](), list[str]()
    for name, make in (("jugs", jugs), ("van", rounds)):
        for seed in range(half):
            problem, least = make(Random(seed))
            counts[f"{name}: solvable"] += least is not None
            for mode in ("guarded", "optimal", "paper"):
                found = solve(Request(problem, mode, LIMITS))
                counts[f"{name}: {mode}: {found.status.value}"] += 1
                if found.status is Status.GAVE_UP:
                    continue
                if (found.plan is not None) is not (least is not None):
                    wrong.append(f"{name} {seed} {mode}: {found.status.value}, and the cheapest plan costs {least}")
                elif found.plan is not None and least is not None:
                    cost = cost_of(problem, found.plan)
                    if validate(problem, found.plan) or cost < least or (mode == "optimal" and cost != least):
                        wrong.append(f"{name} {seed} {mode}: costs {cost}, the cheapest plan {least}")
                    counts[f"{name}: {mode}: cheapest"] += cost == least
    print(f"| of each world's {half} | |\n|---|---|")
    for what, many in sorted(counts.items()):
        print(f"| {what} | {many} |")
    print(f"\nDisagreements: {len(wrong)}", *wrong, sep="\n")
