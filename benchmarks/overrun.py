"""The time that commands and calls continue after their time limit, and the time that `confab validate` takes.

    python -m benchmarks.overrun [--limits 1,5] [--rows 3,7] [FILE.ttl …]    commands and calls, in hard scenes and in the given
    files
    python -m benchmarks.overrun validated                      the time of validation

Each call is tried with the longest limit in several scenes, until a call reaches the limit. The other limits are tried in this
scene. If a call ends before its limit, the cell of the table is "before".

The clock of a call stands still while the call waits for a processor, so that the load of the machine hardly affects the
results. The time of child processes counts as long as the call waits for them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from time import perf_counter

from benchmarks._processes import seconds_of_children

SCENES = {
    "1,000 objects": ("served", "--objects", "1000"),
    "10,000 objects": ("served", "--objects", "10000"),
    "100,000 irrelevant objects": ("served", "--objects", "4", "--clutter", "100000"),
    "200 objects in a ring": ("rotate", "--objects", "200"),
    "full shelves": ("full", "--objects", "60"),
    "1,000 in each other's way": ("blocked", "--objects", "1000"),
}
"""Generated scenes. In most of these scenes, planning takes more than five seconds."""
BATCHES = {"200 batches": 200, "1,000 batches": 1_000}
"""Scenes like the example bakery, whose plans have schedules, with this number of additional batches."""
WEIGHED = {"200 weighed objects": 200, "1,000 weighed objects": 1_000}
"""Scenes of the family `served` with this number of objects, whose goals have weights."""
VALIDATED = ("1,000 objects", "10,000 objects")
EASY, TABLE = "200 objects", "the paper's table"
SERVED = (EASY, "1,000 objects", "10,000 objects")
"""Scenes with goals about cups, for which a memory is learned."""
LARGE = ("10,000 objects", "100,000 irrelevant objects")
BODIES = (EASY, "three cups", TABLE)
"""Scenes with bodies, whose plans can be executed in physics."""
SHIPPED = {TABLE: "beverage-serving", "three cups": "three-cups"}
TRIED = 3
"""Maximum number of scenes in which a call is tried with the longest limit."""
EVERY = "SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i }"
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("plan", "SCENE"),
    ("plan", "SCENE", "--engine", "none"),
    ("plan", "SCENE", "--engine", "fast-downward"),
    ("plan", "SCENE", "--mode", "optimal"),
    ("plan", "SCENE", "--mode", "paper"),
    ("plan", "SCENE", "--levels", "strict"),
    ("plan", "SERVED", "--memory", "MEMORY"),
    ("execute", "SCENE"),
    ("execute", "SCENE", "--mode", "paper"),
    ("execute", "BODIES", "--world", "pybullet"),
    ("explain", "SCENE"),
    ("explain", "SERVED", "--not", "cup1 LOCATION location3"),
    ("learn", "SCENE", "--memory", "NEW.ttl"),
    ("query", "SCENE", EVERY),
    ("query", "LARGE", "--affords", "all"),
    ("validate", "LARGE"),
    ("export", "LARGE", "-o", "NEW"),
    ("run", "SCENE", "--no-video", "-o", "NEW"),
    ("run", "BODIES", "--no-video", "-o", "NEW"),
    ("verify", TABLE, "PLAN.json", "--rollouts", "100"),
    ("verify", TABLE, "PLAN.json", "--rollouts", "100", "--workers", "2"),
    ("verify", TABLE, "PLAN.json", "--rollouts", "100", "--video", "NEW.mp4"),
    ("report", "SCENE", "-o", "NEW.html"),
    ("execute", "BODIES", "--world", "pybullet", "--both-hands"),
    ("explain", "SCENE", "--plot", "NEW.png"),
    ("learn", "SCENE", "--memory", "NEW.ttl", "--rounds", "3"),
    ("validate", "LARGE", "--deep"),
    ("export", "SCENE", "--bt", "-o", "NEW"),
    ("export", "BODIES", "--trajectory", "-o", "NEW.json"),
    ("import", "domain.pddl", "problem.pddl", "-o", "NEW.ttl"),
    ("plan", "TIMED"),
    ("plan", "SERVED", "--minimise", "makespan"),
    ("plan", "SOFT"),
    ("execute", "TIMED"),
    ("execute", "SOFT"),
)
"""All commands with a time limit, each with the scene or the group of scenes in which it is tried.

SCENE stands for hard scenes; successive commands begin with different scenes.
"""
CALLS: tuple[tuple[str, str], ...] = (
    ("SCENE", "scene.plan(time_limit=S)"),
    ("SCENE", "scene.plan(time_limit=S, engine='none')"),
    ("SCENE", "scene.plan(time_limit=S, optimal=True)"),
    ("SCENE", "scene.plan(time_limit=S, mode='paper')"),
    ("SCENE", "scene.explain(time_limit=S)"),
    ("SCENE", "scene.execute(time_limit=S)"),
    ("BODIES", "scene.execute(time_limit=S, world='pybullet')"),
    (TABLE, "result.verify(100, time_limit=S)"),
    ("SERVED", "result.why_not('cup1 LOCATION location3', seconds=S)"),
    ("SERVED", "within: result.explain()"),
    ("SERVED", "within: confab.Memory.of(scene).teach(scene, result)"),
    ("LARGE", "within: confab.load(scene.knowledge.path)"),
    ("LARGE", "within: scene.affordances()"),
    ("SCENE", "within: scene.query(EVERY)"),
    ("SCENE", "scene.query(EVERY, limits=QueryLimits(seconds=S))"),
    ("SCENE", "scene.construct(ALL, NEW, limits=QueryLimits(seconds=S))"),
    ("LARGE", "within: confab.validate(scene.knowledge.path)"),
    ("LARGE", "within: scene.problem"),
    ("TIMED", "scene.plan(time_limit=S)"),
    ("SERVED", "scene.plan(time_limit=S, minimise='makespan')"),
    ("SOFT", "scene.plan(time_limit=S)"),
    ("TIMED", "scene.execute(time_limit=S)"),
    ("TIMED", "scene.explain(time_limit=S)"),
    ("TIMED", "within: confab.Memory.of(scene).teach(scene, result)"),
)
"""Calls in Python, each with its scene or group of scenes. `within` stands for a block of `confab.within(S)`."""
BEGUN = """
import os, sys, threading, time
here, real, seen = os.open("/proc/self/schedstat", os.O_RDONLY), time.perf_counter, [0.0, 0.0]
def clock():
    now = real()
    if now - seen[0] > 0.001:
        seen[:] = now, int(os.pread(here, 99, 0).split()[1]) / 1e9
    return now - seen[1]
time.perf_counter = clock
class Timer(threading.Timer):
    def run(self):
        end = clock() + self.interval
        while not self.finished.wait(0.01):
            if clock() >= end:
                return self.function(*self.args, **self.kwargs)
threading.Timer = Timer
from confab.reasoner.limits import Deadline
begin = Deadline.after.__func__
def after(cls, seconds):
    if seconds == SECONDS:
        os.write(int(os.environ["WATCH"]), b"!")
    return begin(cls, seconds)
Deadline.after = classmethod(after)
"""
"""Code that lets the clock stand still while the process waits for a processor, and reports the begin of the time limit."""
COMMAND = "from confab.start import main; main()"
CALL = """
import confab
from confab.reasoner.graph.query_process import QueryLimits
scene, EVERY, S = confab.load(sys.argv[1]), sys.argv[2], SECONDS
ALL, NEW = EVERY.replace("SELECT (COUNT(*) AS ?n)", "CONSTRUCT { ?a ?e ?i } WHERE"), sys.argv[4]
if 'result.' in sys.argv[3] or 'result)' in sys.argv[3]:
    result = scene.plan()
os.write(int(os.environ["WATCH"]), b"!")
try:
    if sys.argv[3].startswith("within: "):
        with confab.within(S):
            got = eval(sys.argv[3].removeprefix("within: "))
    else:
        got = eval(sys.argv[3])
except Exception as error:
    from confab.reasoner.limits import LimitError
    os._exit(3 if isinstance(error, LimitError) else print(repr(error)[:300], file=sys.stderr) or 4)
ended = getattr(got, 'outcome', None) or getattr(got, 'episode', None)
os._exit(3 if ended and ended.status.value == 'gave-up' else 0)
"""


@dataclass(frozen=True)
class Ended:
    """The end of a process: its exit code, and the seconds since the begin of its limit in which it didn't wait for a processor."""

    code: int
    took: float

    def measured(self, seconds: float) -> bool:
        """Return whether the process reached its limit, or ended early because of the limit."""
        return self.took > seconds or self.code == 3

    def share(self, seconds: float) -> str:
        """Return the time after the limit as a share of the limit, and the exit code, as text."""
        over = max(0.0, self.took / seconds - 1)
        return f"{over:.0%} ({self.code})" if self.measured(seconds) else f"before ({self.code})"


def overrun(code: str, arguments: Sequence[str], seconds: float) -> Ended:
    """Run code with a time limit in a separate process, and return the end of the process."""
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
        began, waited, late = perf_counter(), waiting(process.pid), waiting(os.getpid())
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        took = perf_counter() - began - (waiting(process.pid) - waited) - (waiting(os.getpid()) - late)
        os.close(told)
        return Ended(process.wait(), took)


def bakery(batches: int) -> str:
    """Return the example bakery with additional batches."""
    text = Path(__file__).parents[1].joinpath("docs", "examples", "bakery", "bakery.ttl").read_text(encoding="utf-8")
    its = [line for line in text.splitlines() if line.startswith((":rye a", ":morning.rye a"))]
    named = [(f"batch{n}", line.replace("c:index 1", f"c:index {n + 4}")) for n in range(batches) for line in its]
    goals = [f":morning c:goal :morning.batch{n} ." for n in range(batches)]
    return "\n".join([text, *(line.replace("rye", name) for name, line in named), *goals])


def weighed(file: str) -> None:
    """Give all goals of a generated scene the same weight."""
    text = Path(file).read_text(encoding="utf-8")
    Path(file).write_text(text.replace("c:ValueCondition ;", "c:ValueCondition ; c:weight 30.0 ;"), encoding="utf-8")


def waiting(process: int) -> float:
    """Return the seconds in which a process, perhaps an ended one, has waited for a processor."""
    return int((Path("/proc") / str(process) / "schedstat").read_text().split()[1]) / 1e9


def confab(*arguments: str) -> float:
    """Run a command that must succeed; return its CPU seconds."""
    before = seconds_of_children()
    command = [sys.executable, "-c", "from confab.start import main; main()", *arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return seconds_of_children() - before


def main(limits: Sequence[float], chosen: Collection[int], files: Sequence[str]) -> None:
    """Print a row for each command and call, or for the rows of the given numbers, with the overrun at each limit."""
    with tempfile.TemporaryDirectory(prefix="confab-overrun-") as folder:
        scenes, more = {Path(file).stem: file for file in files}, dict[str, str]()
        for number, (name, family) in enumerate({**SCENES, EASY: ("served", "--objects", "200")}.items()):
            scenes[name] = str(Path(folder, f"scene{number}.ttl"))
            confab("generate", *family, "-o", scenes[name])
        for name, batches in BATCHES.items():
            more[name] = str(Path(folder, f"{batches}-batches.ttl"))
            Path(more[name]).write_text(bakery(batches), encoding="utf-8")
        for name, objects in WEIGHED.items():
            more[name] = str(Path(folder, f"{objects}-weighed.ttl"))
            confab("generate", "served", "--objects", str(objects), "-o", more[name])
            weighed(more[name])
        memory, plan = (str(Path(folder, name)) for name in ("memory.ttl", "plan.json"))
        taught = str(Path(folder, "taught.ttl"))
        confab("generate", "served", "--objects", "8", "-o", taught)
        confab("learn", taught, "--memory", memory)
        confab("plan", "beverage-serving", "-o", plan)
        confab("export", scenes["1,000 objects"], "-o", folder)
        hard, turn, new = [name for name in scenes if name != EASY], count(), count()
        known = {**scenes, **more, **SHIPPED, "MEMORY": memory, "PLAN.json": plan}
        known |= {name: str(Path(folder, name)) for name in ("domain.pddl", "problem.pddl")}

        def tried(said: str, words: Sequence[str], name: str, seconds: float) -> Ended:
            if not words:
                return overrun(CALL, [known[name], EVERY, said, str(Path(folder, f"{next(new)}.ttl"))], seconds)
            put = {**known, words[1]: known[name]}
            put |= {word: str(Path(folder, f"{next(new)}{word}")) for word in words if word.startswith("NEW")}
            return overrun(COMMAND, [*(put.get(word, word) for word in words), "--time-limit", f"{seconds:g}"], seconds)

        print(f"| | call | scene | {' | '.join(f'{seconds:g} s' for seconds in limits)} |")
        print("|---|---|---|" + "---|" * len(limits))
        rows: list[tuple[str, str, tuple[str, ...]]] = [
            (words[1], " ".join(("confab", words[0], *words[2:])), words) for words in COMMANDS
        ]
        rows += [(where, call, ()) for where, call in CALLS]
        for number, (where, said, words) in enumerate(rows, 1):
            first = next(turn) if where == "SCENE" else 0
            if chosen and number not in chosen:
                continue
            groups = {"SCENE": hard[first % len(hard) :] + hard[: first % len(hard)]}
            groups |= {"SERVED": [*SERVED], "LARGE": [*LARGE], "BODIES": [*BODIES]}
            groups |= {"TIMED": [*BATCHES], "SOFT": [*WEIGHED]}
            ended: dict[tuple[str, float], Ended] = {}
            for name in groups.get(where, [where])[:TRIED]:
                ended[name, max(limits)] = tried(said, words, name, max(limits))
                if ended[name, max(limits)].measured(max(limits)):
                    break
            scene = max(ended, key=lambda one: (ended[one].measured(one[1]), ended[one].took))[0]
            for seconds in limits:
                if (scene, seconds) not in ended:
                    ended[scene, seconds] = tried(said, words, scene, seconds)
            cells = " | ".join(ended[scene, seconds].share(seconds) for seconds in limits)
            print(f"| {number} | `{said.replace(EVERY, 'EVERY')}` | {scene} | {cells} |", flush=True)


def validated() -> None:
    """Print the CPU seconds of validation for each scene."""
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
        rows = given.pop(given.index("--rows") + 1) if "--rows" in given else ""
        main(
            [float(one) for one in asked.split(",")],
            {int(one) for one in rows.split(",") if one},
            [word for word in given if word not in ("--limits", "--rows")],
        )
