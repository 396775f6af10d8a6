"""Certificates of unsolvability: their share and kind, the time to check them, and the rejection of corrupted certificates.

    python -m benchmarks certificates       100 worlds of each kind, and 50 corrupted certificates (docs/figures/promises.md)

CERTIFICATES_FROM and CERTIFICATES_COUNT select other worlds.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import process_time
from typing import TypeVar

import confab
from benchmarks import broken_worlds
from confab.plan_options import NO_ENGINE
from confab.planner.certificate_checks import refusal
from confab.planner.certificates import Certificate
from confab.planner.plan import Limits, Outcome, Status
from confab.planner.solve import Request, solve
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.language import DomainError
from confab.reasoner.symbols import Fact, Problem, Symbol
from worlds.agreement import solvable
from worlds.families import random_table
from worlds.hierarchies import hierarchy
from worlds.interpreter import Interpreter, State, TooManyStatesError
from worlds.mixed import mixed
from worlds.numbers import jugs, rounds
from worlds.scenes import scene

FIRST, COUNT = 4_000_000, 100
CORRUPTED = 50
"""Number of certificates that are corrupted, drawn from all worlds."""
MOST_STATES = 600
"""Maximum number of states of a world in which certificates with a missing claim are refuted by search."""
LIMITS = Limits(expansions=20_000, seconds=20.0)
"""Limits of planning for problems without a scene file."""
SAMPLE = 20
"""Number of reachable states that are changed to refute a certificate."""
SECONDS = 20.0
"""Time limit in seconds of planning for a scene."""
DOORS = ("defined", "amounts", "updates")
"""The doors of `benchmarks.fuzz` that break scenes with derived situations, amounts and SPARQL updates."""
Answer = tuple[Problem, Outcome, float]
"""A problem, its outcome, and the CPU seconds of planning."""
T = TypeVar("T")
NOTHING = "nothing"
"""A name that occurs in no world."""
VALUES: dict[str, Callable[[int], Problem]] = {
    "levels": hierarchy,
    "tables": random_table,
    "jugs": lambda seed: jugs(Random(seed))[0],
    "rounds": lambda seed: rounds(Random(seed))[0],
}
"""Functions from a seed to a problem, by kind."""


class Scenes:
    """Scenes in files of a folder: random worlds, generated unsolvable tables, and broken scenes of the fuzzer."""

    def __init__(self, folder: Path) -> None:
        self.file, self.given = folder / "world.ttl", folder / "given"
        broken_worlds.sources(self.given)

    def random(self, seed: int) -> Path:
        """Write a random world of one to three levels."""
        self.file.write_text(scene(mixed(seed)), encoding="utf-8")
        return self.file

    def unsolvable(self, seed: int) -> Path:
        """Write a table on which no hand reaches the goal place of one cup."""
        self.file.unlink(missing_ok=True)
        confab.generate("unsolvable", self.file, objects=2 + 2 * (seed % 5), seed=seed)
        return self.file

    def broken(self, seed: int) -> Path:
        """Write a readable scene with definitions, amounts or updates that the fuzzer has broken."""
        draw, case = Random(f"certificates {seed}"), self.given.parent / "case"
        while True:
            door = draw.choice(DOORS)
            shutil.rmtree(case, ignore_errors=True)
            shutil.copytree(self.given / draw.choice(broken_worlds.WORLDS[door]), case)
            broken_worlds.DOORS[door][0](draw, case)
            try:
                if confab.load(case / "scene.ttl").problem.goal:
                    return case / "scene.ttl"
            except (KnowledgeError, DomainError):
                continue


def answers(folder: Path, seeds: Iterable[int]) -> Iterator[tuple[str, Iterator[Answer]]]:
    """Yield the answers for each kind of world."""
    scenes = Scenes(folder)
    for name, make in VALUES.items():
        yield name, map(of_value, map(make, seeds))
    for write in (scenes.random, scenes.unsolvable, scenes.broken):
        yield f"scenes: {write.__name__}", of_scenes(write, seeds)


def of_value(problem: Problem) -> Answer:
    """Plan for a problem, and return the answer."""
    outcome, seconds = timed(lambda: solve(Request(problem, limits=LIMITS)))
    return problem, outcome, seconds


def of_scenes(write: Callable[[int], Path], seeds: Iterable[int]) -> Iterator[Answer]:
    """Plan for each scene, and yield the answers; scenes that confab rejects are left out."""
    for seed in seeds:
        try:
            loaded = confab.load(write(seed))
            result, seconds = timed(partial(loaded.plan, engine=NO_ENGINE, time_limit=SECONDS))
        except (KnowledgeError, DomainError):
            continue
        yield result.problem, result.outcome, seconds


def timed(call: Callable[[], T]) -> tuple[T, float]:
    """Return the result of a call and its CPU seconds."""
    begin = process_time()
    return call(), process_time() - begin


def corrupted(problem: Problem, certificate: Certificate, rng: Random) -> Iterator[tuple[str, Certificate]]:
    """Yield invalid certificates: with a false claim, for another goal, or without a necessary claim."""
    goal = certificate.unmet[0]
    other = Fact(Symbol(goal.symbol.situation, (NOTHING,)), goal.value)
    yield "without a goal", replace(certificate, unmet=())
    yield "of another goal", replace(certificate, unmet=(other,))
    yield "with a case more", replace(certificate, cases=certificate.cases + 1)
    yield "with a case less", replace(certificate, cases=certificate.cases - 1)
    first = rng.choice(sorted(s for s in problem.initial if s.situation not in problem.domain.rules))
    true = Fact(first, problem.initial[first])
    yield "with a fact of the initial state as never true", replace(certificate, never=certificate.never | {true})
    if certificate.always:
        one = rng.choice(sorted(certificate.always))
        yield "with another constant", replace(certificate, always={**certificate.always, one: NOTHING})
    meant = Interpreter(problem)
    for fact in rng.sample(sorted(certificate.never), min(3, len(certificate.never))):
        less = replace(certificate, never=certificate.never - {fact})
        if disproved(meant, less, fact.symbol, [fact.value]):
            yield "without a fact that is never true", less
            break
    for name in ("always", "told_apart"):
        claims = getattr(certificate, name)
        for symbol in rng.sample(sorted(claims), min(3, len(claims))):
            kept = {one: of for one, of in claims.items() if one != symbol}
            less = replace(certificate, always=kept) if name == "always" else replace(certificate, told_apart=kept)
            if disproved(meant, less, symbol, problem.values(symbol, 9)):
                yield f"without a symbol of {name}", less
                break


def disproved(meant: Interpreter, certificate: Certificate, symbol: Symbol, values: Iterable[str]) -> bool:
    """Return whether a state that a certificate allows leads to a state that the certificate excludes.

    A tested state is a reachable state with another value of the symbol whose claim was removed. All other claims of the
    certificate hold in a tested state. The plain interpreter, which shares no code with the checker, searches for the goal or
    the opposite of a claim.
    """
    at, level = meant.slots.get(symbol), meant.problem.domain.levels[-1]
    if at is None or at >= meant.stated or meant.kinds[symbol.situation].quantity is not None:
        return False

    def allowed(state: State) -> bool:
        never = any(meant.meets(state, fact.symbol, fact.value) for fact in certificate.never)
        return not never and all(meant.meets(state, one, value) for one, value in certificate.always.items())

    other = meant.wanting({fact.symbol: fact.value for fact in certificate.unmet})
    try:
        reached = {state for state, _ in meant.wanting({}).explored(level, MOST_STATES, rests=False).costs}
        for state in sorted(reached, key=str)[:SAMPLE]:
            for value in values:
                other.initial = meant.closed([*state[:at], value, *state[at + 1 :]])
                if allowed(other.initial):
                    found = other.explored(level, MOST_STATES, rests=False)
                    if found.least is not None or not all(allowed(after) for after, _ in found.costs):
                        return True
    except TooManyStatesError:
        pass
    return False


def main() -> int:
    """Print shares, kinds and times of certificates, and the results for corrupted certificates; return 1 on a fault."""
    first, count = int(os.environ.get("CERTIFICATES_FROM", FIRST)), int(os.environ.get("CERTIFICATES_COUNT", COUNT))
    proved: list[tuple[Problem, Certificate]] = []
    wrong = 0
    print(
        "| worlds | planned | unsolvable | certified | by facts, a pair, cases | gave up | of these without a plan "
        "| checking ÷ planning |"
    )
    print("|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory(prefix="confab-certificates-") as folder:
        for name, found in answers(Path(folder), range(first, first + count)):
            kinds, number, unsolvable, gave_up, hopeless, planning, checking = Counter[str](), 0, 0, 0, 0, 0.0, 0.0
            for problem, outcome, seconds in found:
                number += 1
                if outcome.status is Status.GAVE_UP:
                    gave_up += 1
                    hopeless += solvable(problem, most=3_000) is False
                if outcome.status is not Status.UNSOLVABLE:
                    continue
                unsolvable += 1
                if outcome.certificate is None:
                    continue
                said, took = timed(partial(refusal, problem, outcome.certificate))
                if said is None:
                    checking, planning = checking + took, planning + seconds
                    kinds[outcome.certificate.kind] += 1
                    proved.append((problem, outcome.certificate))
            certified = sum(kinds.values())
            wrong += unsolvable - certified
            print(
                f"| {name} | {number} | {unsolvable} | {certified} | {kinds['facts']}, {kinds['pair']}, {kinds['cases']} "
                f"| {gave_up} | {hopeless} | {checking / max(planning, 1e-9):.3f} |",
                flush=True,
            )
    rng, refused, accepted = Random(1), Counter[str](), Counter[str]()
    rng.shuffle(proved)
    for problem, certificate in proved:
        drawn = [*corrupted(problem, certificate, rng)]
        fewest = min((refused[what] + accepted[what], what) for what, _ in drawn)[1]
        bad = dict(drawn)[fewest]
        (accepted if refusal(problem, bad) is None else refused)[fewest] += 1
        if sum(refused.values()) + sum(accepted.values()) == CORRUPTED:
            break
    print("\n| corrupted certificates | refused | accepted |\n|---|---|---|")
    for what in sorted({*refused, *accepted}):
        print(f"| {what} | {refused[what]} | {accepted[what]} |")
    print(f"| **all** | {sum(refused.values())} | {sum(accepted.values())} |")
    return int(bool(wrong or accepted))


if __name__ == "__main__":
    sys.exit(main())
