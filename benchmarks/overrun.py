"""How long commands and calls go on after their time limit; how long `confab validate` takes.

    python -m benchmarks.overrun [--limits 1,5] [FILE.ttl …]    every command and call, in hard scenes and in the files
    python -m benchmarks.overrun validated                      what validation takes

The limit is one of the clock, so a call is watched from outside: what CPU time it has used when the limit is over, and in the end,
with that of all processes that it runs.
On a busy machine the limit comes at another step, but a step takes the CPU time that it takes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import sleep

SCENES = {
    "1,000 objects": ("served", "--objects", "1000"),
    "10,000 objects": ("served", "--objects", "10000"),
    "100,000 irrelevant objects": ("served", "--objects", "4", "--clutter", "100000"),
    "200 objects in a ring": ("rotate", "--objects", "200"),
    "full shelves": ("full", "--objects", "60"),
    "1,000 in each other's way": ("blocked", "--objects", "1000"),
}
"""Generated scenes that aren't planned in within five seconds, most of them."""
VALIDATED = ("1,000 objects", "10,000 objects")
EASY, TABLE = "200 objects", "the paper's table"
EVERY = "SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i }"
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("plan", "SCENE"),
    ("plan", "SCENE", "--engine", "none"),
    ("plan", "SCENE", "--engine", "fast-downward"),
    ("plan", "SCENE", "--mode", "optimal"),
    ("plan", "SCENE", "--mode", "paper"),
    ("plan", "SCENE", "--levels", "strict"),
    ("plan", "SCENE", "--memory", "MEMORY"),
    ("execute", "SCENE"),
    ("execute", "SCENE", "--mode", "paper"),
    ("execute", TABLE, "--world", "pybullet"),
    ("explain", "SCENE"),
    ("explain", EASY, "--not", "cup1 LOCATION location3"),
    ("learn", "SCENE", "--memory", "NEW.ttl"),
    ("query", "SCENE", EVERY),
    ("query", "SCENE", "--affords", "all"),
    ("validate", "SCENE"),
    ("export", "SCENE", "-o", "NEW"),
    ("run", "SCENE", "--no-video", "-o", "NEW"),
    ("run", TABLE, "--no-video", "-o", "NEW"),
    ("verify", TABLE, "PLAN.json", "--rollouts", "100"),
    ("verify", TABLE, "PLAN.json", "--rollouts", "100", "--workers", "2"),
)
"""Commands; each is tried with each limit, SCENE being one hard scene after the other."""
CALLS: tuple[tuple[str, str], ...] = (
    ("SCENE", "scene.plan(time_limit=S)"),
    ("SCENE", "scene.plan(time_limit=S, engine='none')"),
    ("SCENE", "scene.plan(time_limit=S, optimal=True)"),
    ("SCENE", "scene.plan(time_limit=S, mode='paper')"),
    ("SCENE", "scene.explain(time_limit=S)"),
    ("SCENE", "scene.execute(time_limit=S)"),
    (TABLE, "scene.execute(time_limit=S, world='pybullet')"),
    (TABLE, "result.verify(100, time_limit=S)"),
    (EASY, "result.why_not('cup1 LOCATION location3', seconds=S)"),
    (EASY, "within: result.explain()"),
    (EASY, "within: confab.Memory.of(scene).teach(scene, result)"),
    ("SCENE", "within: confab.load(scene.knowledge.path)"),
    ("SCENE", "within: scene.affordances()"),
    ("SCENE", "within: scene.query(EVERY)"),
    ("SCENE", "within: confab.validate(scene.knowledge.path)"),
    ("SCENE", "within: scene.problem"),
)
"""Calls in Python with the scene in which they are made; `within` stands for a block of `confab.within(S)`."""
BEGUN = """
import os, sys
from reasoner.limits import Deadline
begin = Deadline.after.__func__
def after(cls, seconds):
    if seconds == SECONDS:
        os.write(int(os.environ["WATCH"]), b"!")
    return begin(cls, seconds)
Deadline.after = classmethod(after)
"""
"""Says when a call begins to count."""
COMMAND = "from confab.start import main; main()"
CALL = """
import confab
scene, EVERY, S = confab.load(sys.argv[1]), sys.argv[2], SECONDS
if 'result.' in sys.argv[3] or 'result)' in sys.argv[3]:
    result = scene.plan()
try:
    if sys.argv[3].startswith("within: "):
        with confab.within(S):
            eval(sys.argv[3].removeprefix("within: "))
    else:
        eval(sys.argv[3])
except Exception as error:
    from reasoner.limits import LimitError
    os._exit(3 if isinstance(error, LimitError) else print(repr(error)[:300], file=sys.stderr) or 4)
os._exit(0)
"""


def overrun(code: str, arguments: Sequence[str], seconds: float) -> tuple[int, float]:
    """Return how a process ended that runs a code, and the CPU seconds that it used after its limit."""
    told, tell = os.pipe()
    with subprocess.Popen(
        [sys.executable, "-c", (BEGUN + code).replace("SECONDS", repr(seconds)), *arguments],
        pass_fds=(tell,),
        env={**os.environ, "WATCH": str(tell)},
        stdout=subprocess.DEVNULL,
        stderr=None if "-v" in sys.argv else subprocess.DEVNULL,
    ) as process:
        os.close(tell)
        os.read(told, 1)
        sleep(seconds)
        used = cpu_seconds(process.pid) if process.poll() is None else None
        _, state, resources = os.wait4(process.pid, 0) if used is not None else (0, process.returncode << 8, None)
        process.returncode = os.waitstatus_to_exitcode(state)
        os.close(told)
    after = 0.0 if resources is None or used is None else resources.ru_utime + resources.ru_stime - used
    return process.returncode, max(0.0, after)


def cpu_seconds(process: int) -> float:
    """Return the seconds of CPU time that a process and all that it runs have had."""
    folder = Path("/proc") / str(process)
    try:
        own = int((folder / "schedstat").read_text().split()[0]) / 1e9
        children = (folder / "task" / str(process) / "children").read_text().split()
    except OSError:  # it ended meanwhile
        return 0.0
    return own + sum(map(cpu_seconds, map(int, children)))


def confab(*arguments: str) -> float:
    """Run a command that has to succeed; return the seconds of CPU time that it took."""
    before = getrusage(RUSAGE_CHILDREN)
    command = [sys.executable, "-c", "from confab.start import main; main()", *arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(limits: Sequence[float], files: Sequence[str]) -> None:
    """Print a row for each command and call: by limit the share of it that was used after it, and how the call ended."""
    with tempfile.TemporaryDirectory(prefix="confab-overrun-") as folder:
        scenes = {Path(file).stem: file for file in files}
        for number, (name, family) in enumerate({**SCENES, EASY: ("served", "--objects", "200")}.items()):
            scenes[name] = str(Path(folder, f"scene{number}.ttl"))
            confab("generate", *family, "-o", scenes[name])
        memory, plan = (str(Path(folder, name)) for name in ("memory.ttl", "plan.json"))
        taught = str(Path(folder, "taught.ttl"))
        confab("generate", "served", "--objects", "8", "-o", taught)
        confab("learn", taught, "--memory", memory)
        confab("plan", "beverage-serving", "-o", plan)
        known = {**scenes, TABLE: "beverage-serving", "MEMORY": memory, "PLAN.json": plan}
        hard, new = [name for name in scenes if name != EASY], count()
        print(f"| call | scene | {' | '.join(f'{seconds:g} s' for seconds in limits)} |")
        print("|---|---|" + "---|" * len(limits))
        rows: list[tuple[str, str, tuple[str, ...]]] = [
            (words[1], " ".join(("confab", words[0], *words[2:])), words) for words in COMMANDS
        ]
        rows += [(where, call, ()) for where, call in CALLS]
        for number, (where, said, words) in enumerate(rows):
            name = hard[number % len(hard)] if where == "SCENE" else where
            print(f"| `{said.replace(EVERY, 'EVERY')}` | {name}", end="", flush=True)
            for seconds in limits:
                if words:
                    made = {word: str(Path(folder, f"{next(new)}{word}")) for word in ("NEW", "NEW.ttl")}
                    put = {**known, "SCENE": known[name], **made}
                    arguments = [*(put.get(word, word) for word in words), "--time-limit", f"{seconds:g}"]
                    code, after = overrun(COMMAND, arguments, seconds)
                else:
                    code, after = overrun(CALL, [known[name], EVERY, said], seconds)
                print(f" | {after / seconds:.0%} ({code})", end="", flush=True)
            print(" |", flush=True)


def validated() -> None:
    """Print what validation takes, a row for each scene."""
    print("| `confab validate` of | CPU s |\n|---|---|")
    with tempfile.TemporaryDirectory(prefix="confab-overrun-") as folder:
        file = str(Path(folder) / "scene.ttl")
        for name in VALIDATED:
            confab("generate", *SCENES[name], "-o", file)
            print(f"| {name} | {confab('validate', file):.1f} |", flush=True)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "-v"]
    if given == ["validated"]:
        validated()
    else:
        asked = given.pop(given.index("--limits") + 1) if "--limits" in given else "1,5,20"
        main([float(one) for one in asked.split(",")], [word for word in given if word != "--limits"])
