"""The number of processes that each command leaves behind if it is ended by kill -9, a crash or Ctrl-C.

python -m benchmarks.orphans             50 moments for each command and each end, as in docs/figures/promises.md
python -m benchmarks.orphans query 5     five moments for one command
"""

from __future__ import annotations

import ctypes
import faulthandler
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

from benchmarks._processes import fork, silence
from benchmarks.outputs import SCENE, prepare
from confab.cli import main as confab
from confab.scene import load

ENDS = {"kill -9": signal.SIGKILL, "crash": signal.SIGSEGV, "Ctrl-C": signal.SIGINT}
MOMENTS = 50
GRACE = 2.0
"""Seconds after the end of a command within which its processes must end."""
LONGEST, LATEST = 1.5, 10.0
"""Latest time in seconds at which a command is ended: after the command's first child process, and after the command's start."""
MARK = "CONFAB_ORPHANS"
"""Environment variable that marks the processes of a command."""
ADOPT = 36
"""PR_SET_CHILD_SUBREAPER of Linux: processes whose parent has ended become children of this process."""
CROSS = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"


IMPORTED = (
    "confab.agents",
    "confab.engines",
    "confab.serving",
    "confab.reasoner.validation.validate",
    "rdflib",
    "confab.sim.film",
    "confab.sim.rollouts",
)
"""Modules that the commands need, which are imported once."""
CALLS = (
    "verify one-arm-serving arm.json --rollouts 4 --workers 2 --perturb",
    "verify one-arm-serving arm.json --video NEW.mp4",
    "plan beverage-serving --engine fast-downward",
    f"validate {SCENE} --deep",
    "plan wide.jsonld",
    f"plan {SCENE}",
    "run one-arm-serving -o NEW",
    f"report {SCENE} -o NEW.html",
    "runs kept",
    "verify one-arm-serving arm.json",
    f"execute {SCENE}",
    f"execute {SCENE} --serve 0",
    "execute one-arm-serving --world pybullet",
    f"explain {SCENE}",
    f"learn {SCENE} --memory NEW.ttl",
    "memory show memory.ttl",
    "memory merge memory.ttl -o NEW.ttl",
    "memory trust memory.ttl all",
    "memory migrate memory.ttl B1_CARRY=B1_BRING",
    "new workshop -o NEW",
    "fetch http://127.0.0.1:9/nothing -o NEW",
    f"picture {SCENE} --classes -o NEW.png",
    f"validate {SCENE}",
    "generate served --objects 100 -o NEW.ttl",
    "convert tearoom.ttl --behaviors sparql -o NEW.ttl",
    "import domain.pddl problem.pddl -o NEW.ttl",
    f"export {SCENE} -o NEW",
    "export one-arm-serving --trajectory -o NEW.json",
)
"""Calls of the commands except query, serve and mcp."""


def commands(folder: Path) -> dict[str, Callable[[], object]]:
    """Write the files that the commands read into a folder, and return the commands by their calls."""
    for module in (*IMPORTED, *(["unified_planning.shortcuts"] if find_spec("unified_planning") else [])):
        import_module(module)
    prepare(folder)
    load("one-arm-serving").plan().save(folder / "arm.json")
    terms = ",".join(f'"t{i}": "urn:t{i}"' for i in range(3_000))
    level = '{"@context": {"x": "urn:x"}, "@id": "urn:b", "t2":'
    wide = f'{{"@context": {{{terms}}}, "@id": "urn:a", "t1":' + level * 400 + "1" + "}" * 401
    (folder / "wide.jsonld").write_text(wide)

    def command(words: Sequence[str]) -> Callable[[], object]:
        def run() -> None:
            os.chdir(folder)
            confab([word.replace("NEW", f"new-{os.getpid()}") for word in words])

        return run

    return {
        "query": command(["query", SCENE, CROSS]),
        "serve": lambda: served(folder / SCENE),
        "mcp": lambda: by_an_agent(folder),
        **{call: command(call.split()) for call in CALLS},
    }


def by_an_agent(folder: Path) -> None:
    """Serve an agent that sends a slow query and waits for the answer."""
    hello = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "orphans", "version": "1"}}
    asked = {"name": "query", "arguments": {"scene": SCENE, "sparql": CROSS, "seconds": 300}}
    messages: list[dict[str, object]] = [
        {"id": 1, "method": "initialize", "params": hello},
        {"method": "notifications/initialized"},
        {"id": 2, "method": "tools/call", "params": asked},
    ]
    reading, writing = os.pipe()
    os.dup2(reading, 0)
    for message in messages:
        os.write(writing, (json.dumps({"jsonrpc": "2.0", **message}) + "\n").encode())
    confab(["mcp", str(folder)])


def served(scene: Path) -> None:
    """Serve a scene, and send a slow query to the server."""
    from urllib.parse import quote
    from urllib.request import urlopen

    from confab.serving import serving

    with serving(load(scene), 0) as server:
        urlopen(f"{server.url}sparql?query={quote(CROSS)}").read()


def begun(run: Callable[[], object]) -> int:
    """Run a function in a separate process and process group; return the process number."""

    def alone() -> None:
        os.setpgid(0, 0)
        faulthandler.disable()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        silence()
        run()

    child = fork(alone)
    os.setpgid(child, child)  # the child also calls this; either call may be the first
    return child


def marked(mark: str) -> list[int]:
    """Return the numbers of running processes with a mark in their environment."""
    found = []
    for place in Path("/proc").iterdir():
        if place.name.isdecimal() and int(place.name) != os.getpid():
            try:
                if f"{MARK}={mark}".encode() in (place / "environ").read_bytes():
                    state = (place / "stat").read_text().rpartition(")")[2].split()[0]
                    found += [int(place.name)] * (state != "Z")
            except OSError:  # the process has just ended
                continue
    return found


def below(process: int) -> set[int]:
    """Return the numbers of running processes that descend from a process."""
    found: set[int] = set()
    try:
        children = [task.read_text().split() for task in Path(f"/proc/{process}/task").glob("*/children")]
    except OSError:  # the process has just ended
        return found
    for child in (int(number) for numbers in children for number in numbers):
        with suppress(OSError):
            if Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
                found.add(child)
        found |= below(child)
    return found


def left(run: Callable[[], object], sign: signal.Signals, after: float) -> tuple[int, int]:
    """End a command after a time; return the number of its child processes at this time, and of processes left behind."""
    mark = os.environ[MARK] = uuid4().hex
    before = below(os.getpid())
    child = begun(run)
    time.sleep(after)
    there = len({*marked(mark), *below(child)})
    (os.killpg if sign == signal.SIGINT else os.kill)(child, sign)
    os.waitpid(child, 0)
    until = time.monotonic() + GRACE
    while (rest := {*marked(mark), *below(os.getpid())} - before) and time.monotonic() < until:
        time.sleep(0.02)
    for orphan in rest:
        os.kill(orphan, signal.SIGKILL)
    with suppress(ChildProcessError):  # no process was left behind or adopted
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    return there, len(rest)


def length(run: Callable[[], object]) -> float:
    """Return the latest time, in seconds after the start of a command, at which the command is ended."""
    begin, end = time.monotonic(), LATEST
    os.environ[MARK] = uuid4().hex
    child = begun(run)
    while (passed := time.monotonic() - begin) < end:
        if os.waitpid(child, os.WNOHANG)[0]:
            return passed
        if end == LATEST and below(child):
            end = passed + LONGEST
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return end


def trials(run: Callable[[], object], sign: signal.Signals, moments: int) -> tuple[int, int]:
    """Return the number of moments at which a command had child processes, and the total number of processes left behind."""
    seconds, busy, orphans = length(run), 0, 0
    for number in range(moments):
        there, rest = left(run, sign, seconds * (number + 0.5) / moments)
        busy, orphans = busy + bool(there), orphans + rest
    return busy, orphans


def main(arguments: Sequence[str] = ()) -> int:
    """Print the table; return 1 if a process was left behind."""
    if ctypes.CDLL(None, use_errno=True).prctl(ADOPT, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "orphans can't be adopted here")
    moments, worst = int(arguments[1]) if len(arguments) > 1 else MOMENTS, 0
    head = [f"{end}: of {moments} moments with processes | left" for end in ENDS]
    print(f"| command | {' | '.join(head)} |\n|---|{'---|' * 2 * len(ENDS)}")
    with tempfile.TemporaryDirectory() as name:
        for command, run in commands(Path(name)).items():
            if arguments and not f"{command} ".startswith(f"{arguments[0]} "):
                continue
            found = [trials(run, sign, moments) for sign in ENDS.values()]
            worst += sum(orphans for _, orphans in found)
            print(f"| `{command}` | {' | '.join(f'{busy} | {orphans}' for busy, orphans in found)} |", flush=True)
    return int(bool(worst))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
