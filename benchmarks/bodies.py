"""Physical verification of tasks by robot and noise: share of successful rollouts, failures, and cost of a rollout.

    python -m benchmarks.bodies            print the table of all rollouts of the present code
    python -m benchmarks.bodies run [MM …] [TASK …]   run the missing rollouts of the reporting seeds
    python -m benchmarks.bodies carry [TASK …]   count older rollouts of tasks whose first two rollouts are reproduced bit by bit
    python -m benchmarks.bodies try TASK [MM [FROM [TO]]]   run development seeds of one task

Each rollout adds a line, with a digest of the code, to confab-out/bodies.jsonl. An interrupted run can be continued. Seeds from
7000 are for development: code may be changed because of their failures. Seeds from 80000 are for reporting only.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import confab
from confab.planner.plan import Step
from confab.reasoner.symbols import Fact
from confab.scene import Scene
from confab.sim.rollouts import Trial, wilson
from confab.sim.staging import Perturbation
from confab.sim.verify import Rollout, expectations

KEPT = Path("confab-out/bodies.jsonl")
DEVELOPMENT, REPORTING = 7000, 80000
NOISE = {4: 100, 0: 100, 8: 20}
"""Standard deviation in millimetres of every perceived position, with the number of rollouts per task.

The noises are measured in this order."""
AGAIN = 2
"""Number of rollouts of a task that are repeated to check that changed code gives the same results."""
MEASURED = ("sim", "ontology/embodiment.ttl", "ontology/robots")
"""Files on which a rollout depends most; after a change of one of these files, all rollouts are repeated."""


@dataclass(frozen=True)
class Case:
    """A task of the table: a scene and its steps.

    The steps are the stated primitives (behaviour and arguments), or otherwise the plan for `goals` or for the scene's goals.
    """

    robot: str
    scene: str
    primitives: tuple[str, ...] = ()
    goals: tuple[str, ...] = ()
    beads: bool = False


CASES = {
    "drawer": Case("two arms", "kitchen-corner", ("F3_OPEN right_hand drawer", "F3_SHUT right_hand drawer")),
    "door": Case("two arms", "kitchen-corner", ("F3_OPEN left_hand door", "F3_SHUT left_hand door")),
    "hood": Case("two arms", "centrifuge", ("F3_OPEN left_hand cover", "F3_SHUT left_hand cover")),
    "button": Case("two arms", "centrifuge", ("F3_PRESS right_hand start",)),
    "lid onto pot": Case("two arms", "kitchen-corner", goals=("lid LOCATION pot_top",)),
    "pick and place": Case("two arms", "beverage-serving", goals=("cup2 LOCATION location5",)),
    "serving": Case("Panda", "panda-serving", beads=True),
    "moving": Case("Panda", "panda-serving", goals=("cup1 LOCATION place2", "cup2 LOCATION place1")),
    "kitchen corner": Case("two arms", "spice-drawer"),
    "laboratory": Case("two arms", "centrifuge"),
    "move and pour": Case("two arms", "beverage-serving-moved", beads=True),
    "driving and serving": Case("two arms that drive", "two-tables", beads=True),
    "cup and bottle": Case("iiwa", "iiwa-serving", beads=True),
    "cup and bottle, six joints": Case("xArm 6", "xarm-serving", beads=True),
    "handing over and serving": Case("Panda pair", "panda-pair-serving", beads=True),
}
"""The tasks of the table, by name."""


@cache
def _scene(name: str) -> Scene:
    return confab.load(name)


def steps_of(case: Case) -> tuple[Step, ...]:
    """Return the primitives of a case."""
    if case.primitives:
        words = [text.split() for text in case.primitives]
        return tuple(Step((i,), 0, 3, name, tuple(arguments)) for i, (name, *arguments) in enumerate(words))
    scene = _scene(case.scene)
    if not case.goals:
        return scene.plan().plan.primitives
    wanted = {tuple(goal.split()[:2]) for goal in case.goals}
    as_it_is = [str(Fact(symbol, scene.problem.initial[symbol])) for symbol in scene.problem.goal]
    others = [fact for fact in as_it_is if tuple(fact.split()[:2]) not in wanted]
    return scene.plan((*others, *case.goals)).plan.primitives


@cache
def trial(name: str, noise: int) -> Trial:
    """Return the trial of a case with noise in millimetres."""
    case = CASES[name]
    scene, steps = _scene(case.scene), steps_of(case)
    expected = expectations(scene.problem, steps)
    return Trial(scene.embodiment, scene.problem.initial, steps, expected, Perturbation(), case.beads, noise / 1000)


def row(name: str, noise: int, rollout: Rollout) -> dict[str, Any]:
    """Return the stored record of a rollout."""
    failure = rollout.failure
    return {
        "task": name,
        "noise": noise,
        "seed": rollout.seed,
        "ok": rollout.ok,
        "failure": failure.verdict.code if failure else "",
        "at": f"{failure.step.behavior} {' '.join(failure.step.arguments)}" if failure else "",
        "said": str(failure.verdict) if failure else "",
        "cpu": round(rollout.cpu_seconds, 2),
        "planning": round(rollout.clock.planning, 2),
        "simulated": round(rollout.simulated_seconds, 1),
        "course": hashlib.sha256(repr([report.verdict for report in rollout.steps]).encode()).hexdigest()[:16],
    }


def code() -> str:
    """Return Git's hashes of the committed files on which a rollout depends."""
    command = ["git", "rev-parse", *(f"HEAD:{path}" for path in MEASURED)]
    found = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.split()
    return "-".join(name[:7] for name in found)


def read() -> list[dict[str, Any]]:
    """Return the records of all rollouts."""
    return [json.loads(text) for text in KEPT.read_text(encoding="utf-8").splitlines()] if KEPT.exists() else []


def kept() -> list[dict[str, Any]]:
    """Return the records of the rollouts of the present code."""
    now = code()
    return [one for one in read() if one["code"] == now]


def carry(names: Sequence[str]) -> None:
    """Accept rollouts of older code as those of the present code if the first rollouts of the task and noise are reproduced."""
    rows, now = read(), code()
    for name, noise in product(names, NOISE):
        older = [one for one in rows if (one["task"], one["noise"]) == (name, noise) and one["code"] != now]
        again = [row(name, noise, trial(name, noise).run(one["seed"]))["course"] for one in older[:AGAIN]]
        same = bool(older) and again == [one["course"] for one in older[:AGAIN]]
        print(name, noise, len(older), "the same" if same else "others", flush=True)
        rows = [{**one, "code": now} if same and one in older else one for one in rows]
    KEPT.write_text("".join(json.dumps(one) + "\n" for one in rows), encoding="utf-8")


def missing(names: Sequence[str], noises: Sequence[int]) -> Iterator[tuple[str, int, int]]:
    """Yield task, noise and seed of the missing rollouts, row by row."""
    done = {(one["task"], one["noise"], one["seed"]) for one in kept()}
    for noise, name in product(noises, names):
        seeds = range(REPORTING, REPORTING + NOISE[noise])
        yield from ((name, noise, seed) for seed in seeds if (name, noise, seed) not in done)


def run(names: Sequence[str], noises: Sequence[int]) -> None:
    """Run the missing rollouts of tasks, and append a record for each."""
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    now = code()
    for name, noise, seed in missing(names, noises):
        found = {"code": now, **row(name, noise, trial(name, noise).run(seed))}
        with KEPT.open("a", encoding="utf-8") as file:
            file.write(json.dumps(found) + "\n")


def tried(name: str, noise: int, seeds: Sequence[int]) -> None:
    """Run a task with development seeds, and print each rollout and failure."""
    good = 0
    for seed in seeds:
        found = row(name, noise, trial(name, noise).run(seed))
        good += found["ok"]
        print(seed, "verified" if found["ok"] else f"{found['at']}: {found['said']}", found["cpu"], flush=True)
    print(f"{good} of {len(seeds)} at {noise} mm")


def main() -> None:
    """Print the table of the rollouts."""
    rows = kept()
    print(
        "| task | robot | noise | verified | 95 % confidence | CPU s, median | of it planning | simulated s | failures |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name, case in CASES.items():
        for noise in sorted(NOISE):
            if some := [one for one in rows if (one["task"], one["noise"]) == (name, noise)]:
                print(_line(name, case, noise, some))


def _line(name: str, case: Case, noise: int, rows: Sequence[dict[str, Any]]) -> str:
    good = sum(one["ok"] for one in rows)
    low, high = wilson(good, len(rows))
    why = Counter(f"{one['failure']} at {one['at'].split()[0]}" for one in rows if not one["ok"])
    cpu, planning, simulated = (median(one[what] for one in rows) for what in ("cpu", "planning", "simulated"))
    return (
        f"| {name} | {case.robot} | {noise} mm | {good} of {len(rows)} | {low:.0%} to {high:.0%} | {cpu:.1f} | {planning:.2f} "
        f"| {simulated:.1f} | {', '.join(f'{count} {what}' for what, count in why.most_common())} |"
    )


if __name__ == "__main__":
    match sys.argv[1:]:
        case []:
            main()
        case ["run", *words]:
            noises = [int(word) for word in words if word.isdecimal()]
            run([word for word in words if not word.isdecimal()] or list(CASES), noises or list(NOISE))
        case ["carry", *names]:
            carry(names or list(CASES))
        case ["try", name, *numbers]:
            noise, first, last = (*map(int, numbers), *(0, DEVELOPMENT, DEVELOPMENT + 10)[len(numbers) :])
            tried(name, noise, range(first, last))
        case _:
            raise SystemExit(__doc__)
