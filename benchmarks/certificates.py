"""Certificates of "unsolvable": their number and kind, and the time of checking compared with planning.

CERTIFICATES_FROM and CERTIFICATES_COUNT choose other worlds.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from random import Random
from time import process_time

from confab.planner.certificate_checks import refusal
from confab.planner.certificates import Certificate
from confab.planner.plan import Limits, Status
from confab.planner.solve import Request, solve
from confab.reasoner.symbols import TRUE, Fact, Problem, Symbol
from worlds.agreement import solvable
from worlds.families import random_table
from worlds.hierarchies import hierarchy
from worlds.numbers import jugs, rounds

FIRST, COUNT = 4_000_000, 100
CORRUPTED = 50
LIMITS = Limits(expansions=20_000, seconds=20.0)
WORLDS: dict[str, Callable[[int], Problem]] = {
    "levels": hierarchy,
    "tables": random_table,
    "jugs": lambda seed: jugs(Random(seed))[0],
    "rounds": lambda seed: rounds(Random(seed))[0],
}


def corrupted(certificate: Certificate, rng: Random) -> Iterator[tuple[str, Certificate]]:
    """Yield versions of a certificate with a claim dropped or changed, or for another goal."""
    goal = certificate.unmet[0]
    other = Fact(Symbol(goal.symbol.situation, ("nothing",)), goal.value)
    yield "goal dropped", replace(certificate, unmet=())
    yield "another goal", replace(certificate, unmet=(other,))
    yield "a case more", replace(certificate, cases=certificate.cases + 1)
    yield "a case less", replace(certificate, cases=certificate.cases - 1)
    yield "a fact about nothing", replace(certificate, never=certificate.never | {Fact(other.symbol, TRUE)})
    if certificate.never:
        yield "a fact dropped", replace(certificate, never=certificate.never - {rng.choice(sorted(certificate.never))})
    if certificate.told_apart:
        gone = rng.choice(sorted(certificate.told_apart))
        apart = {symbol: values for symbol, values in certificate.told_apart.items() if symbol != gone}
        yield "a symbol dropped", replace(certificate, told_apart=apart)


def main() -> None:
    """Print the share of answers with a certificate, kinds, times, and what became of corrupted ones."""
    first, count = int(os.environ.get("CERTIFICATES_FROM", FIRST)), int(os.environ.get("CERTIFICATES_COUNT", COUNT))
    proved: list[tuple[Problem, Certificate]] = []
    print(
        "| worlds | unsolvable | certified | facts, pair, cases | gave up | of these without a plan | checking ÷ planning |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, make in WORLDS.items():
        kinds: Counter[str] = Counter()
        unsolvable = gave_up = hopeless = 0
        planning = checking = 0.0
        for seed in range(first, first + count):
            problem = make(seed)
            begin = process_time()
            outcome = solve(Request(problem, limits=LIMITS))
            planned = process_time() - begin
            if outcome.status is Status.GAVE_UP:
                gave_up += 1
                hopeless += solvable(problem, most=3_000) is False
            if outcome.status is not Status.UNSOLVABLE:
                continue
            unsolvable += 1
            if outcome.certificate is None:
                continue
            begin = process_time()
            assert refusal(problem, outcome.certificate) is None
            checking += process_time() - begin
            planning += planned
            kinds[outcome.certificate.kind] += 1
            proved.append((problem, outcome.certificate))
        share = sum(kinds.values())
        print(
            f"| {name} | {unsolvable} | {share} | {kinds['facts']}, {kinds['pair']}, {kinds['cases']} | {gave_up} "
            f"| {hopeless} | {checking / max(planning, 1e-9):.2f} |"
        )
    rng, refused, accepted = Random(1), Counter[str](), Counter[str]()
    for problem, certificate in proved:
        for what, bad in corrupted(certificate, rng):
            if sum(refused.values()) + sum(accepted.values()) >= CORRUPTED:
                break
            (accepted if refusal(problem, bad) is None else refused)[what] += 1
    print(f"\nCorrupted: {sum(refused.values())} refused, {sum(accepted.values())} accepted {dict(accepted) or ''}")


if __name__ == "__main__":
    main()
