"""Writers of files, killed at any moment: what was acknowledged is still there, and every file is whole.

python -m benchmarks.kills          100 SIGKILLs for each command, as docs/promises.md quotes them
python -m benchmarks.kills save 20  so many for one
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pyoxigraph as ox

from confab import load as confab_scene
from confab.cli import main as confab
from confab.memory import Memory
from reasoner.files import alone
from reasoner.memory.experience import Experience, GoalKind, Lesson, Tally

COMMANDS = {
    "learn": "learn",
    "merge": "memory merge",
    "trust": "memory trust",
    "migrate": "memory migrate",
    "execute": "execute --learn --save",
    "save": "Result.save",
    "run": "run",
}
LEARNING = ("learn", "execute", "run")
"""What adds an episode."""


def killed(write: Callable[[], object], after: float | None) -> bool:
    """Run something in a process of its own and kill it after some seconds, if any; return whether it had ended by itself."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns of forking beside threads
        child = os.fork()
    if child == 0:
        code = 1
        try:
            with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
                write()
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            os._exit(code)
    if after is not None:
        time.sleep(after)
        os.kill(child, signal.SIGKILL)
    _, state = os.waitpid(child, 0)
    return os.WIFEXITED(state) and os.WEXITSTATUS(state) == 0


def learn(file: Path, number: int) -> None:
    """Learn one more episode into a memory, as `confab learn` does."""
    with alone(file):
        memory = Memory.load(file)
        cups = GoalKind("LOCATION", ("Cup",))
        memory.experience.learn(Lesson(counted=[(cups, ("turn", str(number)), Tally(1))]))
        memory.save(file)


def torn(folder: Path) -> list[str]:
    """Return the files in a folder that can't be read; what a kill leaves of a new one is hidden and ends in ``.part``."""
    found = []
    for file in (*folder.rglob("*.ttl"), *folder.rglob("*.json")):
        try:
            if file.suffix == ".json":
                json.loads(file.read_text())
            else:
                list(ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri="urn:kills"))
        except (SyntaxError, ValueError) as error:
            found.append(f"{file.name}: {error}")
    return found


def rename(file: Path) -> str:
    """Return a rename that the memory can do: there, or back again."""
    said = Memory.load(file).experience.said.values()
    classes = {kind for one in said if isinstance(one, GoalKind) for kind in one.classes}
    return "Mug=Cup" if "Mug" in classes else "Cup=Mug"


def trial(kills: int, command: str, seed: int = 0) -> tuple[int, int]:
    """Kill a command so many times; return how often it had answered, and how many acknowledged episodes and files were lost."""
    draw, lost, done = random.Random(seed), 0, 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, other, plan, episode = (folder / name for name in ("m.ttl", "other.ttl", "plan.json", "episode.ttl"))
        where = "one-arm-serving" if command == "run" else "living-room"
        scene = confab_scene(where)
        memory = Memory.of(scene)
        memory.experience = Experience("me", {"me": 1})
        memory.save(file)
        memory.experience = Experience("you", {"you": 7})
        memory.save(other)
        result = scene.plan()
        writes: dict[str, Callable[[int], object]] = {
            "learn": lambda number: learn(file, number),
            "merge": lambda _: confab(["memory", "merge", str(file), str(other), "-o", str(file)]),
            "trust": lambda _: confab(["memory", "trust", str(file), "all"]),
            "migrate": lambda _: confab(["memory", "migrate", str(file), rename(file)]),
            "execute": lambda _: confab(["execute", where, "--memory", str(file), "--learn", "--save", str(episode)]),
            "save": lambda _: result.save(plan),
            "run": lambda _: confab(["run", where, "--no-video", "--memory", str(file), "--out", str(folder / "out")]),
        }
        learn(file, -1)
        begin = time.monotonic()
        killed(lambda: writes[command](-2), None)
        long = 1.2 * (time.monotonic() - begin)  # at the latest it is killed a little after it has ended
        acknowledged = Memory.load(file).experience.episodes["me"]
        for number in range(kills):
            if killed(lambda number=number: writes[command](number), draw.uniform(0.0, long)):  # type: ignore[misc]
                done += 1
                acknowledged += command in LEARNING
            found = Memory.load(file).experience.episodes["me"]
            lost += max(0, acknowledged - found) + len(torn(folder))
            acknowledged = found
    return done, lost


def main() -> int:
    """Print the table; return 1 if anything was lost."""
    commands = sys.argv[1:2] or list(COMMANDS)
    kills, worst = int(sys.argv[2]) if len(sys.argv) > 2 else 100, 0
    print("| killed | times | answered before | acknowledged episodes lost, or files torn |\n|---|---|---|---|")
    for command in commands:
        done, lost = trial(kills, command)
        worst = max(worst, lost)
        print(f"| `{COMMANDS[command]}` | {kills} | {done} | {lost} |", flush=True)
    return int(bool(worst))


if __name__ == "__main__":
    sys.exit(main())
