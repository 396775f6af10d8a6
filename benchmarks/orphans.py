"""Commands that start processes, ended at any moment by kill -9, a crash or Ctrl-C: how many processes they leave behind.

python -m benchmarks.orphans             50 moments for each command and each end, as docs/figures/promises.md quotes them
python -m benchmarks.orphans query 5     so many for one command
"""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

from confab.authoring import new_domain
from confab.cli import main as confab
from confab.scene import load

ENDS = {"kill -9": signal.SIGKILL, "crash": signal.SIGSEGV, "Ctrl-C": signal.SIGINT}
MOMENTS = 50
GRACE = 2.0
"""Seconds after the end of a command in which its processes have to end."""
LONGEST = 1.5
"""Seconds of a command over which the moments are spread, from its start on."""
MARK = "CONFAB_ORPHANS"
"""Environment variable that marks the processes of a command."""
CROSS = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"


IMPORTED = (
    "confab.engines",
    "confab.serving",
    "confab.reasoner.validation.validate",
    "rdflib",
    "confab.sim.film",
    "confab.sim.rollouts",
)
"""Imports of the commands, done once for all."""


def commands(folder: Path) -> dict[str, Callable[[], object]]:
    """Return the commands with their arguments; their files are written into a folder."""
    for module in (*IMPORTED, *(["unified_planning.shortcuts"] if find_spec("unified_planning") else [])):
        import_module(module)
    new_domain("tearoom", folder)
    scene = folder / "tearoom-scene.ttl"
    plan = load("one-arm-serving").plan().save(folder / "plan.json")
    terms = ",".join(f'"t{i}": "urn:t{i}"' for i in range(3_000))
    level = '{"@context": {"x": "urn:x"}, "@id": "urn:b", "t2":'
    wide = folder / "wide.jsonld"
    wide.write_text(f'{{"@context": {{{terms}}}, "@id": "urn:a", "t1":' + level * 400 + "1" + "}" * 401)
    rollouts = ["verify", "one-arm-serving", str(plan), "--rollouts", "4", "--workers", "2", "--perturb"]
    film = ["verify", "one-arm-serving", str(plan), "--video", str(folder / "film.mp4")]
    return {
        "query": lambda: confab(["query", str(scene), CROSS]),
        "serve": lambda: served(scene),
        "verify --workers": lambda: confab(rollouts),
        "verify --video": lambda: confab(film),
        "plan --engine": lambda: confab(["plan", "beverage-serving", "--engine", "fast-downward"]),
        "plan of JSON-LD": lambda: confab(["plan", str(wide)]),
        "validate --deep": lambda: confab(["validate", str(scene), "--deep"]),
    }


def served(scene: Path) -> None:
    """Serve a scene and send it a slow query."""
    from urllib.parse import quote
    from urllib.request import urlopen

    from confab.serving import serving

    with serving(load(scene), 0) as server:
        urlopen(f"{server.url}sparql?query={quote(CROSS)}").read()


def begun(run: Callable[[], object]) -> int:
    """Run something in a process, and process group, of its own; return its number."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns of forking beside threads
        child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setpgid(0, 0)
            faulthandler.disable()
            signal.signal(signal.SIGINT, signal.default_int_handler)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(nowhere, stream)
            run()
            code = 0
        finally:
            os._exit(code)
    os.setpgid(child, child)  # the child does so, too; the order is arbitrary
    return child


def marked(mark: str) -> list[int]:
    """Return the processes that run and have a mark in their environment."""
    found = []
    for place in Path("/proc").iterdir():
        if place.name.isdecimal() and int(place.name) != os.getpid():
            try:
                if f"{MARK}={mark}".encode() in (place / "environ").read_bytes():
                    state = (place / "stat").read_text().rpartition(")")[2].split()[0]
                    found += [int(place.name)] * (state != "Z")
            except OSError:  # it has just ended
                continue
    return found


def left(run: Callable[[], object], sign: signal.Signals, after: float) -> tuple[int, int]:
    """End a command after a time; return the numbers of processes that it had started and that are left."""
    mark = os.environ[MARK] = uuid4().hex
    child = begun(run)
    time.sleep(after)
    there = len(marked(mark))
    (os.killpg if sign == signal.SIGINT else os.kill)(child, sign)
    os.waitpid(child, 0)
    until = time.monotonic() + GRACE
    while (rest := marked(mark)) and time.monotonic() < until:
        time.sleep(0.02)
    for orphan in rest:
        os.kill(orphan, signal.SIGKILL)
    return there, len(rest)


def length(run: Callable[[], object]) -> float:
    """Return the seconds that a command takes, up to the longest that is looked at."""
    begin = time.monotonic()
    os.environ[MARK] = uuid4().hex
    child = begun(run)
    while time.monotonic() - begin < LONGEST:
        if os.waitpid(child, os.WNOHANG)[0]:
            return time.monotonic() - begin
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return LONGEST


def trials(run: Callable[[], object], sign: signal.Signals, moments: int) -> tuple[int, int]:
    """Return at how many moments of a command it had started processes, and how many processes it left in all."""
    seconds, busy, orphans = length(run), 0, 0
    for number in range(moments):
        there, rest = left(run, sign, seconds * (number + 0.5) / moments)
        busy, orphans = busy + bool(there), orphans + rest
    return busy, orphans


def main(arguments: Sequence[str] = ()) -> int:
    """Print the table; return 1 if any process was left."""
    moments, worst = int(arguments[1]) if len(arguments) > 1 else MOMENTS, 0
    head = [f"{end}: of {moments} moments with processes | left" for end in ENDS]
    print(f"| command | {' | '.join(head)} |\n|---|{'---|' * 2 * len(ENDS)}")
    with tempfile.TemporaryDirectory() as name:
        for command, run in commands(Path(name)).items():
            if arguments and arguments[0] != command:
                continue
            found = [trials(run, sign, moments) for sign in ENDS.values()]
            worst += sum(orphans for _, orphans in found)
            print(f"| `{command}` | {' | '.join(f'{busy} | {orphans}' for busy, orphans in found)} |", flush=True)
    return int(bool(worst))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
