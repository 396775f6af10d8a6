"""Random worlds of two and three levels: the levels of plans, correctness of answers and length of plans in each mode.

LEVELS_FROM and LEVELS_COUNT select other worlds. Seeds below 1,000,000 are for development.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from statistics import median
from time import process_time

from confab.planner.hierarchical.planner import plan as default_plan
from confab.planner.paper.hierarchy import plan as paper_plan
from confab.planner.plan import Limits, Outcome, Plan, Status
from confab.reasoner.problem import Problem
from worlds.agreement import complaints, on_top, solvable
from worlds.hierarchies import hierarchy

FIRST, COUNT = 3_000_000, 2_000
LIMITS = Limits(expansions=20_000, seconds=60.0)
MODES: dict[str, Callable[..., Outcome]] = {"paper": paper_plan, "default": default_plan}
SHOWN = 5


def main() -> None:
    """Print the results of each mode, and their faults."""
    first, count = int(os.environ.get("LEVELS_FROM", FIRST)), int(os.environ.get("LEVELS_COUNT", COUNT))
    outcomes: dict[str, list[Outcome]] = {mode: [] for mode in MODES}
    times: dict[str, list[float]] = {mode: [] for mode in MODES}
    wrong: dict[str, dict[str, list[int]]] = {mode: {} for mode in MODES}
    ratios: dict[str, list[float]] = {mode: [] for mode in MODES}
    truths: Counter[bool | None] = Counter()
    for seed in range(first, first + count):
        problem = hierarchy(seed)
        found = {}
        for mode, plan in MODES.items():
            begin = process_time()
            found[mode] = plan(problem, limits=LIMITS)
            times[mode].append(process_time() - begin)
            outcomes[mode].append(found[mode])
        truth = None
        if any(outcome.status is Status.UNSOLVABLE for outcome in found.values()):
            truth = solvable(problem)
        truths[truth] += 1
        for mode, outcome in found.items():
            for what in complaints(problem, outcome, found["paper"], truth):
                wrong[mode].setdefault(what.split(":")[0], []).append(seed)
            if outcome.plan and found["paper"].plan:
                ratios[mode].append(cost(problem, outcome.plan) / max(cost(problem, found["paper"].plan), 1))
    print(f"Worlds {first} to {first + count - 1}; {truths[True] + truths[False]} searched to the end.\n")
    print(
        "| mode | solved | on level 1 | unsolvable | gave up | length ÷ paper's: mean, most | CPU ms: median, sum | wrong |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for mode, its in outcomes.items():
        status = Counter(outcome.status for outcome in its)
        top = sum(on_top(hierarchy(first + i), outcome) for i, outcome in enumerate(its) if outcome.plan)
        mean, most = sum(ratios[mode]) / max(len(ratios[mode]), 1), max(ratios[mode], default=0.0)
        print(
            f"| {mode} | {status[Status.SOLVED]} | {top} | {status[Status.UNSOLVABLE]} | {status[Status.GAVE_UP]} "
            f"| {mean:.3f}, {most:.2f} | {1e3 * median(times[mode]):.1f}, {1e3 * sum(times[mode]):.0f} "
            f"| {len({seed for seeds in wrong[mode].values() for seed in seeds})} |"
        )
    for mode, its_wrong in wrong.items():
        for what, seeds in sorted(its_wrong.items()):
            print(f"\n{mode}: {what} in {len(seeds)} worlds, e.g. {', '.join(map(str, seeds[:SHOWN]))}")


def cost(problem: Problem, plan: Plan) -> int:
    """Return the number of primitives of a plan."""
    return len(plan.at_level(problem.domain.levels[-1]))
