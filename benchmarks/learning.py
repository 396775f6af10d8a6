"""Training and test problems as in the IPC learning track, solved with memory, without memory, and by lama-first.

    python -m benchmarks learning                      domains in ../shared/pddl
    CONFAB_PDDL=FOLDER python -m benchmarks learning   another folder of the form ``…/domain.pddl``, ``training…``, ``testing…``
    CONFAB_ALL=1 …                                     all test problems instead of four per folder

The memory learns from the training problems in order for a minute of CPU time. Each call reads the memory from one file. A call
is limited to 30 s of CPU time and 4 GB, including the start of its process. Each plan is checked.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time

from benchmarks.pddl import ROOT, Run, kept, peers, planners, problems, run

TEACHING = 60.0
SERIES = "without memory", "with memory", "lama-first"


def main() -> None:
    """Print the table."""
    folder = Path(os.environ.get("CONFAB_PDDL", ROOT.parent / "shared" / "pddl"))
    lama = planners(peers())["lama-first"]
    print(
        "Solved problems (CPU seconds for these, ratio of steps to lama-first where both solve a problem); rules, and the"
    )
    print("CPU seconds of learning them.\n")
    print(f"| problems | {' | '.join(SERIES)} | rules |\n|---|---|---|---|---|", flush=True)
    for domain, training, places in domains(folder):
        with tempfile.TemporaryDirectory() as made:
            memory = Path(made) / "memory.ttl"
            learned = teach(domain, training, memory)
            ours = [sys.executable, "-m", "benchmarks.learning", "{domain}", "{problem}", "{plan}"]
            for place, tests in places.items():
                runs: dict[str, list[Run]] = {name: [] for name in SERIES}
                for problem in tests:
                    runs[SERIES[0]].append(run(ours, domain, problem))
                    runs[SERIES[1]].append(run([*ours, str(memory)], domain, problem))
                    runs[SERIES[2]].append(kept("lama-first", lama, domain, problem))
                said = [_said(runs[name], runs[SERIES[2]]) for name in SERIES]
                print(f"| {place}: {len(tests)} | {' | '.join(said)} | {learned} |", flush=True)


def domains(folder: Path) -> Iterator[tuple[Path, list[Path], dict[str, list[Path]]]]:
    """Yield each domain with its training problems, and its test problems by folder."""
    places: dict[Path, dict[str, list[Path]]] = {}
    for place, domain, problem in problems(folder):
        if place.rpartition("/")[2].startswith("testing"):
            places.setdefault(domain, {}).setdefault(place, []).append(problem)
    for domain, tests in places.items():
        training = [file for p in sorted(domain.parent.glob("training*")) for file in sorted(p.glob("*.pddl"))]
        if training:
            yield domain, training, tests


def teach(domain: Path, training: list[Path], target: Path) -> str:
    """Learn from problems until the time limit, write the memory, and print its size."""
    from confab.planner.experience.following import rules_in
    from confab.planner.experience.lessons import teach as learn
    from confab.reasoner.memory.experience import Experience
    from confab.reasoner.names import Names
    from confab.reasoner.pddl.importing import imported
    from confab.reasoner.pddl.syntax import parse_files
    from worlds.memories import save

    experience, begin = Experience("lesson"), process_time()
    for file in training:
        if process_time() < begin + TEACHING:
            learn(experience, imported(parse_files(domain, file)).problem)
    save(target, experience, Names(()), "https://example.org/pddl")
    return f"{len(rules_in(experience))} in {process_time() - begin:.0f} s"


def _said(runs: list[Run], lama: list[Run]) -> str:
    """Return a text with the number of solved problems, their CPU seconds, and the ratio of plan lengths to lama-first."""
    solved = [done for done in runs if done.plan is not None]
    both = [(len(a.plan), len(b.plan)) for a, b in zip(runs, lama, strict=True) if a.plan and b.plan]
    length = f", × {sum(a for a, _ in both) / sum(b for _, b in both):.2f}" if both and runs is not lama else ""
    return f"{len(solved)} ({sum(done.seconds for done in solved):.0f} s{length})"


def solve(domain: str, problem: str, target: str, memory: str | None = None) -> None:
    """Solve one problem in a benchmarked process, and write its plan."""
    from confab.planner.experience.advice import Advisor, plan
    from confab.planner.plan import Limits
    from confab.planner.validation import validate
    from confab.reasoner.names import Names
    from confab.reasoner.pddl.importing import imported
    from confab.reasoner.pddl.syntax import parse_files
    from worlds.memories import load

    scene = imported(parse_files(Path(domain), Path(problem)))
    known = None if memory is None else Advisor(load(Path(memory), Names(())))
    outcome = plan(scene.problem, known, limits=Limits(expansions=10**9))  # the process ends with its CPU seconds
    print(outcome.status, outcome.search)
    if outcome.plan is not None:
        if validate(scene.problem, outcome.plan):
            raise AssertionError("no plan was returned as one")
        lines = (scene.line(step.behavior, step.arguments) for step in outcome.plan.steps)
        part = Path(f"{target}.part")
        part.write_text("".join(f"({line})\n" for line in lines if line))
        part.replace(target)


if __name__ == "__main__":
    solve(*sys.argv[1:])
