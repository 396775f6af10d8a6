"""What experience is worth: transfer, unseen classes, changed preferences, harm, clutter, files, and the learning curve.

    python -m benchmarks memory
    CONFAB_MEMORY=transfer,harm …    some of: transfer, flat, time, start, classes, flip, harm, clutter, files, curve

Training: scenes of 4, 6 and 8 objects, seeds 100 to 104, and more of the family full, seeds from 200 on; shortest plans of level 1,
on level 2 those of the fast planner without needless steps. Reported: seeds from 5000 on, which neither training nor development
ever saw. Expansions are those of the level that is led; seconds are CPU seconds.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from random import Random
from statistics import mean, median
from time import perf_counter, process_time, sleep

from planner.experience import portfolio as guided
from planner.experience.choice_points import BROAD, Field, Ground, single_level
from planner.experience.demonstrations import shortest
from planner.experience.discrepancy_search import Stream
from planner.experience.features import Schema
from planner.experience.portfolio import Memory
from planner.experience.scoring import Judge
from planner.hierarchical import planner as fast
from planner.hierarchical.operators import Program
from planner.paper.hierarchy import plan as paper_plan
from planner.paper.learning import learn
from planner.plan import Limits, Outcome
from planner.validation import validate
from reasoner.memory.counts import Candidate, Conclusion, Decision, Experience, Tally
from reasoner.memory.counts_file import load, save
from reasoner.memory.links import Links
from reasoner.names import Names
from reasoner.symbols import Problem
from worlds.lessons import problem, recognised, teach

TRAINING = ("served", "swap", "rotate", "full", "handover", "blocked", "random")
FAMILIES = TRAINING[:-1]
FLAT = ("served", "swap", "rotate", "handover", "blocked")
"""Families of which the memoryless search solves flat problems of level 2, too."""
LIMITS = Limits(expansions=2000)
SIZES, LESSONS, HELD_OUT = (4, 6, 8), range(100, 105), 5000
CROWDED = ((6, 2, range(200, 220)), (8, 2, range(200, 240)), (8, 3, range(200, 220)))
"""More lessons of the family full, which has much to learn: objects, hands, seeds."""
PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "learning-curve.png"


def main() -> None:
    """Print the tables."""
    sections: dict[str, Callable[[], None]] = {
        "transfer": transfer,
        "flat": flat,
        "time": time,
        "start": start,
        "classes": classes,
        "flip": flip,
        "harm": harm,
        "clutter": clutter,
        "files": files,
        "curve": curve,
    }
    for name in os.environ.get("CONFAB_MEMORY", ",".join(sections)).split(","):
        print(f"\n### {name}\n", flush=True)
        sections[name]()


def lessons(families: Sequence[str] = TRAINING) -> Iterator[tuple[str, int, int]]:
    """Yield family, size and seed of each training scene, the families in turn."""
    for seed in LESSONS:
        for objects in SIZES:
            for family in families:
                yield family, objects, seed


@lru_cache(maxsize=4)
def trained(level: int = 1) -> Memory:
    """Return a memory that has had all lessons."""
    experience = Experience("trained")
    for family, objects, seed in lessons():
        teach(experience, problem(family, objects, seed), level)
    for objects, hands, seeds in CROWDED:
        for seed in seeds:
            teach(experience, problem("full", objects, seed, hands=hands), level)
    return Memory(experience)


def ratio(outcome: Outcome, level: int) -> float | None:
    """Return expansions of a level for each of its steps, or None without a plan; of a plan that wasn't shortened."""
    return outcome.search[level].expanded / max(len(outcome.plan.steps), 1) if outcome.plan else None


def shown(ratios: Sequence[float | None]) -> str:
    solved = [r for r in ratios if r is not None]
    if not solved:
        return "none solved"
    good = sum(r <= 1.05 for r in solved)
    return f"{median(solved):.2f} (worst {max(solved):.2f}; {good}/{len(ratios)} within 1.05)"


def transfer(levels: Sequence[int] = (1,), seeds: int = 10) -> None:
    """Expansions for each step on scenes 5 to 10 times as large as the lessons; beside them the memoryless search."""
    print(
        f"{'level':<6}{'family':<10}{'n':<4}{'memory leads':<44}{'default':<44}{'strict':<44}{'none':<44}primitives, of none"
    )
    for level in levels:
        for family in TRAINING:
            if level == 2 and family == "random":
                continue
            objects = 20 if family == "random" else 40
            wanted = 50 if family == "random" else seeds if family == "full" else 3
            rows: dict[str, list[float | None]] = {"leading": [], "guarded": [], "strict": [], "none": []}
            lengths: list[float] = []
            for seed in range(HELD_OUT, HELD_OUT + 10 * wanted if family == "random" else HELD_OUT + wanted):
                within = single_level(problem(family, objects, seed), level)
                alone = fast.plan(within, limits=LIMITS, improve=0)
                led = guided.plan(within, trained(level), "leading", LIMITS, improve=0)
                if alone.plan is None and led.plan is None and family == "random":
                    continue
                rows["none"].append(ratio(alone, level))
                for mode in ("leading", "guarded", "strict"):
                    found = led if mode == "leading" else guided.plan(within, trained(level), mode, LIMITS, improve=0)
                    assert found.plan is None or validate(within, found.plan) == []
                    rows[mode].append(ratio(found, level))
                short = fast.plan(within, limits=LIMITS), guided.plan(within, trained(level), "leading", LIMITS)
                if all(found.plan is not None for found in short):
                    primitives = [len(found.plan.primitives) for found in short if found.plan is not None]
                    lengths.append(primitives[1] / primitives[0])
                if len(rows["none"]) == wanted:
                    break
            print(f"{level:<6}{family:<10}{objects:<4}", end="")
            print(
                "".join(f"{shown(row):<44}" for row in rows.values()) + (f"{mean(lengths):.2f}" if lengths else "–"),
                flush=True,
            )


def flat() -> None:
    """Print the same for problems that begin on level 2."""
    transfer((2,), 10)


def time() -> None:
    """CPU milliseconds of a call with the domain compiled, the least of five, and of one expansion of the memory's search."""
    print(
        f"{'level':<6}{'family':<10}{'n':<4}{'seed':<6}{'none':>8}{'default':>9}{'of none':>9}{'leading':>9}{'per node':>10}"
    )
    for level in (1, 2):
        for family in TRAINING if level == 1 else FLAT:
            for objects in {"full": (10, 20, 40, 60), "random": (20,)}.get(family, (10, 40)):
                for seed in range(HELD_OUT, HELD_OUT + {"full": 3, "random": 12}.get(family, 1)):
                    within = single_level(problem(family, objects, seed), level)
                    calls = (
                        partial(fast.plan, within),
                        partial(guided.plan, within, trained(level)),
                        partial(guided.plan, within, trained(level), "leading"),
                    )
                    spent: list[list[float]] = [[], [], []]
                    for _ in range(5):
                        for row, call in zip(spent, calls, strict=True):
                            seconds, found = cpu(partial(call, using=fast.compiled(within)))
                            row.append(seconds)
                    figures = [min(row) * 1e3 for row in spent]
                    print(f"{level:<6}{family:<10}{objects:<4}{seed:<6}{figures[0]:>8.1f}{figures[1]:>9.1f}", end="")
                    print(f"{figures[1] / figures[0]:>9.2f}{figures[2]:>9.1f}", end="")
                    print(f"{figures[2] / max(found.search[level].expanded, 1):>10.2f}  {found.status}", flush=True)


def cpu(call: Callable[[], Outcome]) -> tuple[float, Outcome]:
    gc.collect()
    began = process_time()
    found = call()
    return process_time() - began, found


def start() -> None:
    """Measure what reading a memory costs a process, and forming its judge: CPU seconds, the least of five."""
    within = problem("full", 40, HELD_OUT)
    schema = Schema(Program(within))
    names = Names(f"https://w3id.org/confab/tabletop#{name}" for name in (*within.domain.behaviors, *within.classes))
    for level in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "memory.ttl"
            save(path, trained(level).experience, names, "https://w3id.org/confab/tabletop")
            reading, judging = [], []
            for _ in range(5):
                gc.collect()
                began = process_time()
                found = load(path, names)
                reading.append(process_time() - began)
                Memory(found).judge(schema)
                judging.append(process_time() - began - reading[-1])
            print(
                f"lessons of level {level}: {len(found)} links, {path.stat().st_size / 1e6:.1f} MB, read in {min(reading):.2f} s, "
                f"judge in {min(judging):.2f} s"
            )


def classes() -> None:
    """Plan with bowls, which no lesson had, in place of cups."""
    bowl = "\n:Bowl a owl:Class, owl:NamedIndividual ; rdfs:subClassOf k:Cup .\n"

    def bowls(text: str) -> str:
        return text.replace("owl:NamedIndividual, k:Cup", "owl:NamedIndividual, :Bowl") + bowl

    same = total = 0
    for family in FAMILIES:
        for seed in range(HELD_OUT, HELD_OUT + 3):
            plans = []
            for edit in (lambda text: text, bowls):
                within = problem(family, 20, seed, edit=edit)
                found = guided.plan(within, Memory(trained().experience), "leading")
                plans.append(
                    ([str(step) for step in found.plan.steps] if found.plan else None, found.search[1].expanded)
                )
            same += plans[0] == plans[1]
            total += 1
    print(f"same plan with the same expansions: {same} of {total}")


def flip() -> None:
    """Episodes until a preference that flipped after 40 is followed again: as the test does it."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "tests/planner/test_guided.py",
        "-k",
        "flips",
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[1])
    print("relearned within 10 episodes after 40:", "yes" if done.returncode == 0 else "NO")


def bad_memories(level: int = 1) -> dict[str, Memory]:
    """Return memories that are inverted, random, or of another domain."""
    random = Random(0)
    found = {name: Experience(name, {name: 1}) for name in ("inverted", "random", "wrong domain")}
    for _, conclusion, pattern, tally in trained(level).experience:
        counts = {
            "inverted": (conclusion, Tally(tally.passed_over, tally.chosen)),
            "random": (conclusion, Tally(random.randrange(20), random.randrange(20))),
            "wrong domain": (replace(conclusion, behavior=f"OTHER_{conclusion.behavior}"), tally),
        }
        for name, (about, counted) in counts.items():
            found[name].counts.setdefault((name, 0), {}).setdefault(about, {})[pattern] = counted
    return {name: Memory(experience) for name, experience in found.items()}


def harm(seeds: int = 3) -> None:
    """Expansions over the memoryless ones, the worst of every instance; untrusted memory without being told."""
    print(
        f"{'memory':<14}{'instances':<11}{'strict, worst ratio':<21}{'default, worst ratio (excess)':<31}"
        f"{'leading, worst ratio (excess)':<31}{'within the guard':<18}untrusted = strict"
    )
    for name, memory in {"trained": trained(), **bad_memories()}.items():
        strict: list[float] = []
        worst: dict[str, list[tuple[float, float]]] = {"guarded": [], "leading": []}
        same = held = True
        for family in (*TRAINING, "unsolvable"):
            for objects in (4, 8, 12):
                for seed in range(HELD_OUT, HELD_OUT + seeds):
                    within = problem(family, objects, seed)
                    using = fast.compiled(within)
                    alone = fast.plan(within, using=using, limits=LIMITS).search[1].expanded
                    here = guided.plan(within, memory, "strict", LIMITS, using).search[1].expanded
                    strict.append(here / max(alone, 1))
                    for mode, row in worst.items():
                        free = guided.plan(within, memory, mode, LIMITS, using).search[1].expanded
                        row.append((free / max(alone, 1), free - 1.05 * alone))
                        held &= row[-1][1] <= guided.stretch_for(within) * (1 + len(within.goal))
                    doubted = guided.plan(within, replace(memory, trusted=False), "leading", LIMITS, using)
                    same &= doubted.search[1].expanded == here
        cells = [f"{max(r for r, _ in row):.2f} ({max(e for _, e in row):+.0f})" for row in worst.values()]
        print(
            f"{name:<14}{len(strict):<11}{max(strict):<21.3f}{cells[0]:<31}{cells[1]:<31}{held!s:<18}{same}", flush=True
        )


def clutter(seeds: int = 5) -> None:
    """100 irrelevant objects: the same choices, and what a node costs; as planned, and with nothing left out of the scene."""
    for family in ("served", "swap", "handover"):
        for name, scene in (("what the task needs", recognised), ("the whole scene", problem)):
            same, costs = 0, []
            for seed in range(HELD_OUT, HELD_OUT + seeds):
                calls, plans, nodes = [], [], []
                for extra in (0, 100):
                    within = scene(family, 20, seed, extra)
                    using, memory = fast.compiled(within), Memory(trained().experience)
                    found = guided.plan(within, memory, "leading", using=using)
                    plans.append([(s.behavior, s.arguments) for s in found.plan.steps] if found.plan else None)
                    calls.append(partial(guided.plan, within, memory, "leading", using=using))
                for _ in range(5):
                    nodes.append([spent / max(found.search[1].expanded, 1) for spent, found in map(cpu, calls)])
                same += plans[0] == plans[1]
                costs.append(min(cost for _, cost in nodes) / min(cost for cost, _ in nodes))
            print(
                f"{family:<10}{name:<21} same choices {same} of {seeds}, cost of a node × {median(costs):.2f}", end=""
            )
            print(f" ({min(costs):.2f} to {max(costs):.2f})", flush=True)


def files(links: int = 100_000, kills: int = 100) -> None:
    """1e5 links: save, load, open in the OWL API; 100 kills at random moments."""
    big = Experience("robot0")
    patterns = [(c, k, t) for c, table in trained().experience.totals().items() for k, t in table.items()]
    for number in range(links):
        conclusion, pattern, tally = patterns[number % len(patterns)]
        replica = f"robot{number // len(patterns)}"
        big.episodes[replica] = 1
        big.counts.setdefault((replica, 0), {}).setdefault(conclusion, {})[pattern] = tally
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "memory.ttl"
        names = Names(
            f"https://w3id.org/confab/tabletop#{name}" for name in ("B1_MOVE", "B1_POUR", "Bottle", "Cup", "Location")
        )
        for what, call in (
            ("save", lambda: save(path, big, names, "https://w3id.org/confab/tabletop")),
            ("load", lambda: load(path, names)),
        ):
            gc.collect()
            began, busy = perf_counter(), process_time()
            call()
            print(f"{what}: {perf_counter() - began:.2f} s, of it CPU {process_time() - busy:.2f} s")
        print(f"{len(big)} links, {path.stat().st_size / 1e6:.0f} MB")
        print("OWL API:", in_owl_api(path))
        lost = killed(Path(folder) / "killed.ttl", kills)
        print(f"{kills} kills: acknowledged episodes lost: {lost}")


OPEN = """
import sys, time, resource
from pathlib import Path
from worlds.owlapi import jars, jvm, places
import jpype, jpype.imports
jpype.startJVM(jvm(), "-Xss16m", "-Xmx3g", "-Dorg.slf4j.simpleLogger.defaultLogLevel=off", classpath=jars())
from java.io import File
from org.semanticweb.owlapi.apibinding import OWLManager
from org.semanticweb.owlapi.model import IRI
from org.semanticweb.owlapi.util import SimpleIRIMapper
path = Path(sys.argv[1])
manager = OWLManager.createOWLOntologyManager()
for iri, place in places([path]).items():
    manager.getIRIMappers().add(SimpleIRIMapper(IRI.create(iri), IRI.create(File(str(place)))))
began, busy = time.perf_counter(), time.process_time()
loaded = manager.loadOntologyFromOntologyDocument(File(str(path)))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
print(f"{loaded.getAxiomCount()} axioms in {time.perf_counter() - began:.1f} s, "
      f"CPU of all threads {time.process_time() - busy:.1f} s, {peak:.1f} GB at most")
"""


def in_owl_api(path: Path) -> str:
    """Return how a file opens in the library behind Protégé, in a process of its own."""
    command = [sys.executable, "-c", OPEN, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[1])
    return (done.stdout.splitlines() or done.stderr.splitlines() or ["nothing"])[-1]


def killed(path: Path, kills: int) -> int:
    """Return how many acknowledged episodes are lost when a learner is killed again and again."""
    random, lost = Random(0), 0
    for _ in range(kills):
        command = [sys.executable, "-m", "tests.reasoner.learner", str(path)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1])
        assert process.stdout is not None
        said = [process.stdout.readline()]
        sleep(random.random() * 0.03)
        process.send_signal(signal.SIGKILL)
        said += process.stdout.read().splitlines()
        process.wait()
        last = max(int(line) for line in said if line.strip())
        lost += max(last - load(path).episodes["robot"], 0)
    return lost


class Grounded(Memory):
    """Counts of grounded behaviours and the very facts of the world, without roles and classes: for comparison."""

    def stream(self, program: Program, problem: Problem, level: int) -> Stream:
        """Return the search that these counts lead."""
        roles = {conclusion.behavior: () for _, conclusion, _, _ in self.experience}
        return GroundedStream(Field(program, problem, level), Judge(self.experience, {}, roles))

    def knows(self, behaviors: Iterable[str]) -> bool:
        """Whether anything was counted."""
        return len(self.experience) > 0


class GroundedStream(Stream):
    """The same search, led by grounded counts."""

    def __init__(self, field: Field, judge: Judge) -> None:
        super().__init__(field, Judge(Experience("none"), {}, {}))
        self.judge = judge

    def _odds(self, ground: Ground) -> float:
        self.evaluated += 1
        seen = grounded(self.field, ground)
        return float("-inf") if self.field.roles(ground) is None else self.judge.odds(seen.conclusion, seen.pattern)


def grounded(field: Field, ground: Ground) -> Candidate:
    """Return a behaviour with all facts and goals of the world, each by its name."""
    facts = [(f"{s} {key}", value) for s, cells in field.table.now.items() for key, value in cells.items()]
    goals = [(f"goal {s} {key}", value) for (s, key), value in field.goal.items()]
    return Candidate(Conclusion(" ".join((ground[0], *ground[1])), ()), tuple(sorted(facts + goals)))


def teach_grounded(experience: Experience, lesson: Problem) -> None:
    """Let grounded counts live the same episode as `teach` gives lifted ones."""
    within = single_level(lesson, 1)
    program = Program(within)
    steps = shortest(program, within, 1) or []
    field, lived = Field(program, within, 1), []
    for position, step in enumerate(steps):
        others = [g for g in field.proposals(field.unmet(), breadth=BROAD) if g not in steps[position:]]
        lived.append(Decision(grounded(field, step), tuple(grounded(field, other) for other in others)))
        field.do(step)
    experience.learn(lived)


def curve(most: int = 36) -> None:
    """Over episodes: expansions for each step of plans not yet shortened, and time of a whole call; level 1 of held-out scenes."""
    checks = (0, 1, 2, 4, 6, 12, 18, 24, most)
    tests = [problem(family, 20, HELD_OUT) for family in FAMILIES]
    small = [replace_levels(problem(family, 4, HELD_OUT)) for family in ("served", "swap", "handover")]
    base = measured(
        tests, lambda within, improve: partial(fast.plan, within, using=fast.compiled(within), improve=improve)
    )
    lifted, counts, links = Experience("lifted"), Experience("counts"), Links()
    points: list[tuple[float, ...]] = []
    todo = list(lessons(FAMILIES))[:most]
    head = (
        f"{'episodes':<10}{'lifted':>8}{'ms':>8}{'counts':>8}{'ms':>8}{'none':>8}{'ms':>8}{'paper, n = 4':>14}{'ms':>8}"
    )
    print(head, flush=True)
    for episode in range(most + 1):
        if episode in checks:
            row: list[float] = [episode]
            for memory in (Memory(lifted), Grounded(counts)):

                def led(within: Problem, improve: int, memory: Memory = memory) -> Callable[[], Outcome]:
                    using = fast.compiled(within)
                    return partial(guided.plan, within, memory, "leading", using=using, improve=improve)

                row += measured(tests, led)
            row += base
            spent, ratios = 0.0, []
            for within in small:
                seconds, found = cpu(lambda: paper_plan(within, links, limits=Limits(expansions=1000)))  # noqa: B023
                spent += seconds * 1e3 / len(small)
                ratios.append(found.search[1].expanded / (len(found.plan.steps) if found.plan else 8))
            row += [mean(ratios), spent]
            points.append(tuple(row))
            print(
                f"{episode:<10}" + "".join(f"{a:>8.2f}{b:>8.0f}" for a, b in zip(row[1:7:2], row[2:7:2], strict=True)),
                end="",
            )
            print(f"{row[7]:>14.1f}{row[8]:>8.0f}", flush=True)
        if episode < most:
            family, objects, seed = todo[episode]
            lesson = problem(family, objects, seed)
            teach(lifted, lesson)
            teach_grounded(counts, lesson)
            shown_plan = fast.plan(replace_levels(lesson)).plan
            if shown_plan is not None:
                links = learn(replace_levels(lesson), shown_plan, links)
    draw(points)


def measured(tests: Sequence[Problem], calls: Callable[[Problem, int], Callable[[], Outcome]]) -> tuple[float, float]:
    """Return means: expansions for each step of a plan that isn't shortened, and CPU ms of a call that shortens it."""
    ratios = [ratio(calls(within, 0)(), 1) or 10.0 for within in tests]
    return mean(ratios), 1e3 * mean(cpu(calls(within, fast.IMPROVEMENTS))[0] for within in tests)


def replace_levels(within: Problem) -> Problem:
    """Return a problem with the behaviours of its first level alone."""
    top = {name: b for name, b in within.domain.behaviors.items() if b.level == 1}
    return replace(within, domain=replace(within.domain, behaviors=top))


def draw(points: Sequence[tuple[float, ...]]) -> None:
    """Draw the learning curve: expansions for each step, and time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.2), layout="constrained")
    names = ("lifted counts, n = 20", "grounded counts, n = 20", "none (fast planner), n = 20", "paper's mode, n = 4")
    styles = (("o-", "tab:blue"), ("^-", "tab:green"), ("--", "gray"), ("s-", "tab:orange"))
    labels = "level-1 expansions for each step", "CPU ms of a planning call"
    for column, (axes, label) in enumerate(zip(figure.subplots(1, 2), labels, strict=True)):
        for line, (name, (style, color)) in enumerate(zip(names, styles, strict=True)):
            axes.plot(
                [p[0] for p in points], [p[1 + 2 * line + column] for p in points], style, color=color, label=name
            )
        if not column:
            axes.legend(fontsize=8, loc="center right")
        axes.set_yscale("log")
        axes.set_ylabel(label)
        axes.set_xlabel("episodes (scenes of 4 to 8 objects)")
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURE, dpi=120)


if __name__ == "__main__":
    main()
