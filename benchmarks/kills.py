"""Commands that write files are killed at random times; acknowledged data must survive, and every file must be complete.

python -m benchmarks.kills             100 SIGKILLs for each command, as in docs/figures/promises.md
python -m benchmarks.kills save 20     20 SIGKILLs for one command
python -m benchmarks.kills --ctrl-c    SIGINTs instead of SIGKILLs; each call must end with 0 or 130
"""

from __future__ import annotations

import json
import logging
import math
import mmap
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import pyoxigraph as ox

from benchmarks._processes import fork
from confab import load as confab_scene
from confab.cli import main as confab
from confab.memory import Memory
from confab.reasoner.files import alone
from confab.reasoner.memory.experience import Experience, GoalKind, Lesson, Tally
from confab.terminal import INTERRUPTED

COMMANDS = {
    "learn": "learn",
    "merge": "memory merge",
    "trust": "memory trust",
    "migrate": "memory migrate",
    "execute": "execute --learn --save",
    "save": "Result.save",
    "run": "run",
    "crowd": "learn`, one of eight at a time, by any path, `learn",
}
LEARNING = ("learn", "execute", "run")
"""Commands that add an episode."""


class Ended(NamedTuple):
    """The end of a process: exit code (negative for a signal), CPU seconds, and number of calls if the calls were counted."""

    code: int
    seconds: float
    calls: int


def killed(
    write: Callable[[], object], after: float = math.inf, call: float = math.inf, sign: int = signal.SIGKILL
) -> Ended:
    """Run a function in a separate process; send a signal to the process after a CPU time, or at one of its calls."""
    made = mmap.mmap(-1, 8)  # shared with the child

    def run() -> int:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
                if call != math.inf or after == math.inf:
                    sys.setprofile(_counting(made, call, sign))
                write()
        except SystemExit as end:
            return int(end.code or 0)
        except KeyboardInterrupt:
            return INTERRUPTED
        return 0

    child = fork(run)
    while (ended := os.wait4(child, os.WNOHANG))[0] == 0:
        if spent(child) >= after:
            os.kill(child, sign)
            ended = os.wait4(child, 0)
            break
        time.sleep(0.0005 if after < math.inf else 0.02)
    _, state, used = ended
    return Ended(os.waitstatus_to_exitcode(state), used.ru_utime + used.ru_stime, int.from_bytes(made[:8], "little"))


def _counting(made: mmap.mmap, last: float, sign: int) -> Callable[[FrameType, str, object], None]:
    """Return a profiling function that counts calls of Python and C functions, and sends a signal at call number `last`."""
    so_far = 0

    def count(frame: FrameType, event: str, argument: object) -> None:
        nonlocal so_far
        so_far += 1
        if so_far >= last:
            sys.setprofile(None)
            os.kill(os.getpid(), sign)
        if last == math.inf:
            made[:8] = so_far.to_bytes(8, "little")

    return count


def spent(process: int) -> float:
    """Return the CPU seconds of a process, with a finer resolution than clock ticks."""
    return int(Path(f"/proc/{process}/schedstat").read_text().split()[0]) / 1e9


def learn(file: Path, number: int) -> None:
    """Learn one more episode into a memory."""
    with alone(file):
        memory = Memory.load(file)
        cups = GoalKind("LOCATION", ("Cup",))
        memory.experience.learn(Lesson(counted=[(cups, ("turn", str(number)), Tally(1))]))
        memory.save(file)


def crowd(kills: int, seed: int = 0) -> tuple[int, int]:
    """Let eight processes learn at once into one memory by different paths, and kill one process; return the counts of `trial`."""
    draw, lost, done = random.Random(seed), 0, 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        file, inside, beside = folder / "m.ttl", folder / "inside", folder / "beside"
        inside.mkdir()
        beside.symlink_to(folder)
        (inside / "link.ttl").symlink_to(Path("..") / "m.ttl")
        (folder / "again.ttl").symlink_to(inside / "link.ttl")
        paths = [file, Path("m.ttl"), Path("inside/../m.ttl"), inside / "link.ttl", Path("inside/link.ttl")]
        paths += [folder / "again.ttl", beside / "m.ttl", beside / "inside" / "link.ttl"]
        memory = Memory.of(confab_scene("living-room"))
        memory.experience = Experience("me", {"me": 1})
        memory.save(file)
        _, seconds, _ = killed(lambda: learn(file, -1), after=1e9)
        acknowledged = Memory.load(file).experience.episodes["me"]
        for number in range(kills):
            children = [fork(partial(learn_in, folder, path, number)) for path in paths]
            time.sleep(draw.uniform(0.0, len(paths) * seconds))
            os.kill(draw.choice(children), signal.SIGKILL)
            ended = [os.waitpid(child, 0)[1] for child in children]
            done += all(state == 0 for state in ended)
            acknowledged += sum(state == 0 for state in ended)
            found = Memory.load(file).experience.episodes["me"]
            lost += max(0, acknowledged - found) + len(torn(folder))
            acknowledged = found
    return done, lost


def learn_in(folder: Path, path: Path, number: int) -> None:
    """Learn one more episode in a process of its own, with a folder as its current folder."""
    os.chdir(folder)
    logging.disable()  # each process would log that it waits
    learn(path, number)


def torn(folder: Path) -> list[str]:
    """Return the unreadable files in a folder; unfinished files are hidden and end in ``.part``."""
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
    """Return a renaming that is possible in the memory: of Cup to Mug, or of Mug to Cup."""
    said = Memory.load(file).experience.said.values()
    classes = {kind for one in said if isinstance(one, GoalKind) for kind in one.classes}
    return "Mug=Cup" if "Mug" in classes else "Cup=Mug"


def trial(kills: int, command: str, seed: int = 0, sign: int = signal.SIGKILL) -> tuple[int, int]:
    """Kill a command `kills` times; return the number of finished calls, and the number of lost episodes and torn files.

    A process that ends after SIGINT with another exit code than 130 also counts as lost.
    """
    draw, lost, done = random.Random(seed), 0, 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, other, plan, episode = (folder / name for name in ("m.ttl", "other.ttl", "plan.json", "episode.ttl"))
        where = "one-arm-serving" if command == "run" else "living-room"
        scene = confab_scene(where)
        memory = Memory.of(scene)
        memory.experience = Experience("me", {"me": 1})
        memory.teach(scene, result := scene.plan())  # the memory gets rules, orders and methods
        memory.save(file)
        memory.experience = Experience("you", {"you": 7})
        memory.save(other)
        writes: dict[str, Callable[[int], object]] = {
            "learn": lambda _: confab(["learn", where, "--memory", str(file)]),
            "merge": lambda _: confab(["memory", "merge", str(file), str(other), "-o", str(file)]),
            "trust": lambda _: confab(["memory", "trust", str(file), "all"]),
            "migrate": lambda _: confab(["memory", "migrate", str(file), rename(file)]),
            "execute": lambda _: confab(["execute", where, "--memory", str(file), "--learn", "--save", str(episode)]),
            "save": lambda _: result.save(plan),
            "run": lambda _: confab(["run", where, "--no-video", "--memory", str(file), "--out", str(folder / "out")]),
        }
        learn(file, -1)
        with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), suppress(SystemExit):
            writes[command](-2)  # imports the modules before the fork
        code, _, calls = killed(lambda: writes[command](-3))
        assert code == 0, f"{command} doesn't work at all"
        _, seconds, _ = killed(lambda: writes[command](-4), after=1e9)
        acknowledged = Memory.load(file).experience.episodes["me"]
        for number in range(kills):
            # half of the kills at any time, the other half while or after files are written at the end of the command
            when = draw.choice((draw.uniform(0.0, 1.1), draw.uniform(0.9, 1.05)))
            moment = {"after": seconds * when} if number % 2 else {"call": calls * when}
            code = killed(partial(writes[command], number), **moment, sign=sign).code
            done += code == 0
            acknowledged += code == 0 and command in LEARNING
            lost += code not in (0, INTERRUPTED if sign == signal.SIGINT else -sign)
            found = Memory.load(file).experience.episodes["me"]
            lost += max(0, acknowledged - found) + len(torn(folder))
            acknowledged = found
    return done, lost


def main(arguments: Sequence[str]) -> int:
    """Print the table; return 1 if data were lost."""
    sign = signal.SIGINT if "--ctrl-c" in arguments else signal.SIGKILL
    words = [word for word in arguments if word != "--ctrl-c"]
    commands = words[:1] or [command for command in COMMANDS if command != "crowd" or sign == signal.SIGKILL]
    kills, worst = int(words[1]) if len(words) > 1 else 100, 0
    what = "interrupted" if sign == signal.SIGINT else "killed"
    print(f"| {what} | times | answered before | acknowledged episodes lost, or files torn |\n|---|---|---|---|")
    for command in commands:
        done, lost = crowd(kills) if command == "crowd" else trial(kills, command, sign=sign)
        worst = max(worst, lost)
        print(f"| `{COMMANDS[command]}` | {kills} | {done} | {lost} |", flush=True)
    return int(bool(worst))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
