"""Definitions in random states: the derived facts of search, checker and plain Python, compared with those that HermiT entails.

python -m benchmarks entailed
CONFAB_STATES=10000 …        how many states; 10,000 take an hour of one core
CONFAB_SEED=0 …              the first one's seed
"""

from __future__ import annotations

import os
from collections import Counter
from os import times
from time import process_time

from worlds.derivations import compared, first_problem

BATCH = 500


def main() -> None:
    """Print how many states agree, and what doesn't."""
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
