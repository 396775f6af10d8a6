"""How long `confab plan --time-limit N` goes on after its limit, ending with exit 3; how long `confab validate` takes.

    python -m benchmarks.overrun              every call, as docs/promises.md has it
    python -m benchmarks.overrun validated    what validation takes

The limit is one of the clock, so a call is watched from outside: what CPU time it has used when the limit is over, and in the end,
with that of an engine that it runs.
On a busy machine the limit comes at another step, but a step takes the CPU time that it takes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import sleep

SCENES = {
    "1,000 objects": ("served", "--objects", "1000"),
    "10,000 objects": ("served", "--objects", "10000"),
    "100,000 irrelevant objects": ("served", "--objects", "4", "--clutter", "100000"),
    "200 objects": ("served", "--objects", "200"),
}
VALIDATED = ("1,000 objects", "10,000 objects")
"""These scenes are validated, which has no limit."""
MEMORY = "FILE"
"""Stands for a memory of `TAUGHT`."""
TAUGHT = ("served", "--objects", "8")
CALLS: tuple[tuple[str, float, tuple[str, ...]], ...] = (
    ("1,000 objects", 1, ()),
    ("1,000 objects", 2, ("--mode", "optimal")),
    ("10,000 objects", 2, ()),
    ("10,000 objects", 5, ()),
    ("10,000 objects", 10, ()),
    ("100,000 irrelevant objects", 2, ()),
    ("100,000 irrelevant objects", 5, ()),
    ("200 objects", 1, ("--mode", "paper")),
    ("200 objects", 3, ("--mode", "paper")),
    ("1,000 objects", 5, ("--mode", "paper")),
    ("1,000 objects", 1, ("--memory", MEMORY)),
    ("1,000 objects", 2, ("--memory", MEMORY)),
    ("10,000 objects", 5, ("--memory", MEMORY)),
    ("200 objects", 2, ("--engine", "fast-downward")),
    ("200 objects", 5, ("--engine", "fast-downward")),
    ("1,000 objects", 5, ("--engine", "fast-downward")),
)
"""In which scene, with how many seconds, and with which other options."""
WATCHED = """
import os, sys
from reasoner.limits import Deadline
begin = Deadline.after.__func__
def after(cls, seconds):
    os.write(int(os.environ["WATCH"]), b"!")
    return begin(cls, seconds)
Deadline.after = classmethod(after)
from confab.start import main
main()
"""
"""The command, which says when it begins to count."""


def overrun(arguments: list[str], seconds: float) -> tuple[int, float]:
    """Return how a command ended, and the CPU seconds that it used after its limit."""
    told, tell = os.pipe()
    with subprocess.Popen(
        [sys.executable, "-c", WATCHED, *arguments, "--time-limit", f"{seconds:g}"],
        pass_fds=(tell,),
        env={**os.environ, "WATCH": str(tell)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
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


def main() -> None:
    """Print a row for each call."""
    with tempfile.TemporaryDirectory(prefix="confab-overrun-") as folder:
        files = {name: Path(folder) / f"{number}.ttl" for number, name in enumerate(SCENES)}
        for name, file in files.items():
            confab("generate", *SCENES[name], "-o", str(file))
        taught, memory = (str(Path(folder) / name) for name in ("taught.ttl", "memory.ttl"))
        confab("generate", *TAUGHT, "-o", taught)
        confab("learn", taught, "--memory", memory)
        print("| scene | options | limit, s | exit | CPU s after it | share of the limit |\n|---|---|---|---|---|---|")
        for name, seconds, options in CALLS:
            code, after = overrun(["plan", str(files[name]), *(memory if o == MEMORY else o for o in options)], seconds)
            said = " ".join(options)
            print(
                f"| {name} | {f'`{said}`' if said else ''} | {seconds:g} | {code} | {after:.2f} | {after / seconds:.0%} |",
                flush=True,
            )


def validated() -> None:
    """Print what validation takes, a row for each scene."""
    print("| `confab validate` of | CPU s |\n|---|---|")
    with tempfile.TemporaryDirectory(prefix="confab-overrun-") as folder:
        file = str(Path(folder) / "scene.ttl")
        for name in VALIDATED:
            confab("generate", *SCENES[name], "-o", file)
            print(f"| {name} | {confab('validate', file):.1f} |", flush=True)


if __name__ == "__main__":
    validated() if sys.argv[1:] == ["validated"] else main()
