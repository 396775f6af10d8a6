"""Comparison of the facts that search, checker and plain Python derive in random states with HermiT's entailments.

python -m benchmarks entailed
CONFAB_STATES=10000 …        number of states; 10,000 states take an hour of one core
CONFAB_SEED=0 …              seed of the first state
"""

from __future__ import annotations

import os
from collections import Counter
from os import times
from time import process_time

from worlds.derivations import compared, first_problem

BATCH = 500


def main() -> None:
    """Print the number of states in which each definition is true, and the differences of each evaluator."""
    count, first = int(os.environ.get("CONFAB_STATES", "10000")), int(os.environ.get("CONFAB_SEED", "0"))
    problem, true, wrong, done = first_problem(), Counter[str](), dict[str, list[str]](), 0
    began, java = process_time(), times().children_user
    for start in range(first, first + count, BATCH):
        seeds = range(start, min(start + BATCH, first + count))
        more, others = compared(problem, seeds)
        true, done = true + more, done + len(seeds)
        wrong = {who: wrong.get(who, []) + others[who] for who in others}
        print(f"{done} states, {process_time() - began:.0f} + {times().children_user - java:.0f} CPU s", flush=True)
    print(f"\n| definition | true of, in {done} states |\n|---|---|")
    for name, many in sorted(true.items()):
        print(f"| {name} | {many} |")
    print("\n| evaluator | facts that differ from HermiT's entailments |\n|---|---|")
    for who, faults in wrong.items():
        print(f"| {who} | {len(faults)} {'; '.join(faults[:5])} |")
