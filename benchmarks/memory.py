"""The benefit of learned experience: transfer to larger worlds, flat PDDL, harm by bad memories, and files.

    python -m benchmarks memory
    CONFAB_MEMORY=transfer,harm …     sections: transfer, worlds, curve, said, pddl, harm, files (all by default)
    CONFAB_WORLDS=FOLDER …            a folder of further worlds: pairs ``…-small.ttl`` and ``…-large.ttl``
    CONFAB_PDDL=FOLDER …              a folder with ``domain.pddl``, ``training…`` and ``testing…``
    CONFAB_ALL=1 …                    all PDDL test problems instead of a few per folder

For tables, the memory learns from one problem with 4 and one with 6 objects of each of six families, with seed 100. The
reported problems have seeds from 5000. Expansions are counted on the most abstract level. Seconds are CPU seconds of a whole
call. In a lesson, the planner plans for the goals in several orders.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import median
from time import process_time

import confab
from confab import ontology
from confab.planner.experience.advice import Advisor, plan
from confab.planner.experience.following import rules_in
from confab.planner.experience.lessons import live, teach
from confab.planner.hierarchical import planner as fast
from confab.planner.plan import Limits, Outcome
from confab.planner.validation import validate
from confab.reasoner.memory.experience import ITSELF, Experience, GoalKind, Lesson, Tally
from confab.reasoner.names import Names
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse_files
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.problem import Problem
from worlds.lessons import backwards, problem, taught
from worlds.memories import load, save

FAMILIES = ("served", "swap", "rotate", "full", "handover", "blocked")
SHARED = Path(__file__).resolve().parents[2] / "shared"
SECONDS, TRAINED, TESTED = 30.0, 6, 2


def main() -> None:
    """Print the tables."""
    sections: dict[str, Callable[[], None]] = {
        "transfer": transfer,
        "worlds": worlds,
        "curve": curve,
        "said": said,
        "pddl": pddl,
        "harm": harm,
        "files": files,
    }
    for name in os.environ.get("CONFAB_MEMORY", ",".join(sections)).split(","):
        print(f"\n### {name}\n", flush=True)
        sections[name]()


def measured(call: Callable[[], Outcome], within: Problem) -> tuple[Outcome, float]:
    """Return the outcome of a call and its CPU seconds; an invalid plan ends the benchmark."""
    begin = process_time()
    outcome = call()
    seconds = process_time() - begin
    if outcome.plan is not None and validate(within, outcome.plan):
        raise AssertionError("no plan was returned as one")
    return outcome, seconds


def expanded(outcome: Outcome, within: Problem) -> int:
    """Return the number of expansions on the most abstract level."""
    first = within.domain.levels[0]
    return outcome.search[first].expanded if first in outcome.search else 0


def shown(outcome: Outcome, seconds: float, within: Problem) -> str:
    """Return table cells: steps of each level, expansions of the most abstract level and of all levels, and CPU seconds."""
    if outcome.plan is None:
        return f"{outcome.status.value} | – | {seconds:.2f}"
    whole = sum(counts.expanded for counts in outcome.search.values())
    length = "/".join(str(n) for n in outcome.plan.length.values())
    return f"{length} | {expanded(outcome, within)} ({whole}) | {seconds:.2f}"


def beside(name: str, within: Problem, memory: Advisor) -> None:
    """Print a row of a problem, planned without memory and with memory in the default mode."""
    limits = Limits(seconds=SECONDS)
    none = measured(lambda: fast.plan(within, limits=limits), within)
    led = measured(lambda: plan(within, memory, limits=limits), within)
    print(f"| {name} | {shown(*none, within)} | {shown(*led, within)} |", flush=True)


HEAD = """| | steps, none | expansions of level 1 (all) | s | steps, with memory | expansions of level 1 (all) | s |
|---|---|---|---|---|---|---|"""


def transfer(sizes: tuple[int, ...] = (20, 40), seeds: int = 3) -> None:
    """Print the expansions per step on tables that are about five times as large as the tables of the lessons."""
    print(f"{sum(1 for _ in rules_in(taught(FAMILIES).experience))} rules from 12 lessons\n")
    print("| family | n | none | default | strict | primitives, default ÷ none | CPU, default ÷ none |")
    print("|---|---|---|---|---|---|---|")
    for family in FAMILIES:
        for n in sizes:
            rows = []
            for seed in range(5000, 5000 + seeds):
                within = problem(family, n, seed)
                none, alone = measured(lambda within=within: fast.plan(within), within)  # type: ignore[misc]
                led, seconds = measured(lambda within=within: plan(within, taught(FAMILIES)), within)  # type: ignore[misc]
                strict, _ = measured(lambda within=within: plan(within, taught(FAMILIES), "strict"), within)  # type: ignore[misc]
                if none.plan is None or led.plan is None or strict.plan is None:
                    continue
                per = [expanded(o, within) / max(o.plan.length[1], 1) for o in (none, led, strict) if o.plan]
                rows.append([*per, len(led.plan.primitives) / len(none.plan.primitives), seconds / alone])
            said = [f"{median(column):.2f} ({max(column):.2f})" for column in zip(*rows, strict=True)]
            print(f"| {family} | {n} | {' | '.join(said)} |", flush=True)


def worlds() -> None:
    """Print the benefit of one lesson in a small world for the same world and for a large world of its kind."""
    print(HEAD)
    folders = [
        ontology.ROOT / "scenes",
        *([Path(os.environ["CONFAB_WORLDS"])] if "CONFAB_WORLDS" in os.environ else []),
    ]
    for folder in folders:
        for small in sorted(folder.rglob("*-small.ttl")):
            large = small.with_name(small.name.replace("-small", "-large"))
            experience = Experience("lesson")
            teach(experience, confab.load(str(small)).problem)
            if large.exists():
                beside(small.stem.removesuffix("-small"), confab.load(str(large)).problem, Advisor(experience))
    lab = SHARED / "cases" / "lab" / "lab-scene.ttl"
    if lab.exists():
        scene, experience = confab.load(str(lab)).problem, Experience("lesson")
        for lessons in (1, 10):
            while experience.episodes.get("lesson", 0) < lessons:
                teach(experience, scene)
            beside(f"lab, {lessons} lessons", scene, Advisor(experience))


def curve(world: str = "laboratory", episodes: int = 3) -> None:
    """Print the effort in a large world without memory, after a lesson in a small world, and after episodes in the large world."""
    small, large = (confab.load(f"{world}-{size}").problem for size in ("small", "large"))
    experience = Experience("lesson")
    print(f"| {world}-large | steps | expansions of level 1 (all) | s | rules |\n|---|---|---|---|---|")
    print(f"| without memory | {shown(*measured(lambda: fast.plan(large), large), large)} | – |", flush=True)
    teach(experience, small)
    for number in range(episodes):
        led, seconds = measured(lambda: plan(large, Advisor(experience)), large)
        before = "a lesson in the small world" if not number else f"{number} episode{'s' * (number > 1)} more"
        print(f"| after {before} | {shown(led, seconds, large)} | {len(rules_in(experience))} |", flush=True)
        if led.plan is not None:
            live(experience, [(large, led.plan)])


def said(worlds: tuple[str, ...] = ("gallery", "canteen", "laboratory")) -> None:
    """Print the rules of the most abstract level that a lesson gives, in words."""
    for world in worlds:
        scene = confab.load(f"{world}-small")
        memory = confab.Memory.of(scene)
        memory.teach(scene, scene.plan().plan)
        print(f"\n{world}")
        say, behaviors = memory.sayings(), scene.problem.domain.behaviors
        rules = [r for r in rules_in(memory.experience) if behaviors[r.does[0]].level == scene.problem.domain.levels[0]]
        for rule in sorted(rules, key=lambda rule: (rule.goal.situation, rule.does, rule.name)):
            print(f"- {say.rule(rule)}")


def folders() -> Iterator[tuple[Path, list[Path], list[Path]]]:
    """Yield each PDDL domain with training problems and test problems of several sizes."""
    root = Path(os.environ.get("CONFAB_PDDL", SHARED / "pddl"))
    for domain in sorted(root.rglob("domain.pddl")):
        places = sorted(p for p in domain.parent.iterdir() if p.is_dir())
        training = [f for p in places if p.name.startswith("training") for f in sorted(p.glob("p*.pddl"))]
        testing = [f for p in places if p.name.startswith("testing") for f in sorted(p.glob("p*.pddl"))]
        if training and testing:
            every = range(len(testing)) if "CONFAB_ALL" in os.environ else sample(len(testing))
            yield domain, training[:TRAINED], [testing[i] for i in every]


def sample(many: int) -> list[int]:
    """Return a few indices, including the first and the last."""
    return sorted({i * (many - 1) // TESTED for i in range(TESTED + 1)})


def pddl() -> None:
    """Print results for flat problems without memory, and with rules from a few small problems."""
    print(HEAD)
    for domain, training, testing in folders():
        experience, begin = Experience("lesson"), process_time()
        try:
            for file in training:
                teach(experience, imported(parse_files(domain, file)).problem)
        except PddlError as error:
            print(f"| {domain.parent.name}: {error} | | | | | | |")
            continue
        name = "/".join(domain.parent.parts[-2:])
        print(f"| **{name}**, {len(rules_in(experience))} rules in {process_time() - begin:.1f} s | | | | | | |")
        for file in testing:
            beside(f"{file.parent.name}/{file.stem}", imported(parse_files(domain, file)).problem, Advisor(experience))


@cache
def bad_memories() -> dict[str, Advisor]:
    """Return memories with right rules, with wrong rules, and with rules of another domain, by name."""
    good = taught(FAMILIES)
    rules = rules_in(good.experience)
    turned = [backwards(rule) for rule in rules]
    careless = [replace(rule, asks=rule.asks[::2]) for rule in rules]
    swapped = [replace(rule, does=(rule.does[0], rule.does[1][::-1])) for rule in rules]
    other = [replace(rule, does=(f"OTHER_{rule.does[0]}", rule.does[1])) for rule in rules]
    found = {"trained": good}
    for name, those in (
        ("goal and condition exchanged", turned),
        ("half the conditions", careless),
        ("arguments swapped", swapped),
        ("of another domain", other),
    ):
        experience = Experience(name)
        experience.learn(Lesson(said=list(those)))
        found[name] = Advisor(experience)
    return found


def harm(seeds: int = 1) -> None:
    """Print for good and bad memories the worst ratio and the worst excess of expansions, compared with no memory."""
    print("| memory | strict | default | leading |\n|---|---|---|---|")
    cases = [
        problem(f, n, s)
        for f in (*FAMILIES, "random", "unsolvable")
        for n in (4, 8, 12)
        for s in range(7000, 7000 + seeds)
    ]
    alone = [expanded(fast.plan(within), within) for within in cases]
    for name, memory in bad_memories().items():
        said = []
        for mode in ("strict", "guarded", "leading"):
            led = [expanded(plan(within, memory, mode), within) for within in cases]
            pairs = list(zip(led, alone, strict=True))
            said.append(
                f"{max(a / max(b, 1) for a, b in pairs):.2f} (+{max(a - b for a, b in pairs)}), Σ {sum(led) / sum(alone):.2f}"
            )
        print(f"| {name} | {' | '.join(said)} |", flush=True)


def files(links: int = 100_000) -> None:
    """Print the times to save and load a memory with about `links` counters."""
    experience = Experience("robot")
    experience.merge(taught(FAMILIES).experience)
    kinds = [GoalKind("LOCATION", (f"Kind{i}",)) for i in range(100)]
    for number in range(links // 1000):
        experience.replica = f"robot{number}"
        facts = [("cup is a Bowl", str(i)) for i in range(9)]
        experience.learn(Lesson(counted=[(kind, fact, Tally(1)) for kind in kinds for fact in (ITSELF, *facts)]))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "memory.ttl"
        times = [process_time()]
        save(path, experience, Names(()), "https://x.org/k")
        times.append(process_time())
        found = load(path, Names(()))
        times.append(process_time())
        assert len(found) == len(experience)
        size = path.stat().st_size / 2**20
        print(
            f"{len(found):,} counters, {size:.0f} MB: saved in {times[1] - times[0]:.1f} s, loaded in {times[2] - times[1]:.1f} s"
        )


if __name__ == "__main__":
    main()
