"""Times of whole calls, quantification and task recognition in scenes of growing size, compared with other systems.

    python -m benchmarks quantification
    CONFAB_CLUTTER=1000,100000 python -m benchmarks quantification     with these numbers of irrelevant objects
    CONFAB_PEERS=PYTHON …                                              with a Python that has up-fast-downward already

Each world of each size is measured in a separate process. Times are the minimum of several repetitions. Whole calls are
measured in CPU seconds, other functions in wall-clock seconds.
"""

from __future__ import annotations

import json
import os
import re
import resource
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import log
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from benchmarks._processes import seconds_of_children

CALLS = (4, 50, 200, 1_000, 10_000)
OBJECTS = (24, 70, 224)  # with twice as many places, this is a thousand to a hundred thousand moves
RDFLIB_OBJECTS = (4, 12, 24, 70)
PEER_OBJECTS = (4, 10, 20, 30)
CLUTTER = tuple(int(float(k)) for k in os.environ.get("CONFAB_CLUTTER", "0,1e3,1e4,1e5,1e6").split(","))
REPEATS = 7
CAP = 60.0
ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Print the tables."""
    with tempfile.TemporaryDirectory() as folder:
        calls(Path(folder))
        grounding(Path(folder))
        rdflib_engine(Path(folder))
        translator(Path(folder))
        worlds(Path(folder))


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table in Markdown."""
    print(f"\n{title}\n\n| {' | '.join(columns)} |\n|{'---|' * len(columns)}", flush=True)
    for row in rows:
        print("| " + " | ".join(f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row) + " |")
    sys.stdout.flush()


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> str:
    """Return the exponent of the power of the size with which the time grows from the first to the last measurement."""
    if len(sizes) < 2 or not all(sizes) or not all(seconds):
        return "–"
    return f"{log(seconds[-1] / seconds[0]) / log(sizes[-1] / sizes[0]):.2f}"


def least(action: Callable[[], object], repeats: int = REPEATS) -> float:
    """Return the minimum time of several repetitions; slow functions have fewer repetitions."""
    best = float("inf")
    for _ in range(repeats):
        begin = perf_counter()
        action()
        best = min(best, perf_counter() - begin)
        if best > 1.0:
            repeats = min(repeats, 3)
    return best


def measured(*arguments: object) -> dict[str, Any]:
    """Run a part of this module in a separate process, and return its output."""
    command = [sys.executable, "-m", "benchmarks.quantification", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def scene(folder: Path, objects: int = 4, clutter: int = 0) -> Path:
    """Return a generated scene of the family `served`."""
    from confab.reasoner.generate import write_scene

    path = folder / f"served-{objects}-{clutter}.ttl"
    if not path.is_file():
        write_scene(path, "served", objects=objects, clutter=clutter)
    return path


# ------------------------------------------------------------------------------------------------------------ 0. whole calls


def calls(folder: Path) -> None:
    """Print the times of a call from file to plan, of the command, and of the import of rdflib."""
    found = [measured("call", scene(folder, objects), scene(folder, CALLS[1])) for objects in CALLS]
    names = ("load", "plan", "whole")
    rows = [[objects, one["steps"], *(one[name] for name in names)] for objects, one in zip(CALLS, found, strict=True)]
    powers = [exponent(CALLS[1:], [one[name] for one in found[1:]]) for name in names]
    rows.append([f"grows from {CALLS[1]} on by the power", "", *powers])
    columns = ("objects", "steps", "load, s", "plan, s", "whole call, s")
    table("confab.load(file).plan(), the task served", columns, rows)
    command = "import sys; sys.argv = ['confab', 'plan', 'beverage-serving']; from confab.cli import main; main()"
    ours, theirs = cold(command), cold("import rdflib")
    table("A command of its own", ("confab plan, s", "import rdflib, s", "ratio"), [[ours, theirs, ours / theirs]])


def call(path: str, before: str) -> dict[str, float]:
    """Measure loading and planning in a scene after a first call has imported all modules."""
    import confab

    confab.load(before).plan()
    found: list[dict[str, float]] = []
    while len(found) < (1 if found and found[0]["whole"] > 1.0 else REPEATS):
        begin = process_time()
        loaded = confab.load(path)
        middle = process_time()
        result = loaded.plan()
        end = process_time()
        one = {"load": middle - begin, "plan": end - middle, "whole": end - begin}
        found.append({**one, "steps": len(result.plan.steps)})
        del loaded, result  # frees the store before the next measurement
    return min(found, key=lambda one: one["whole"])


def cold(script: str) -> float:
    """Return the minimum CPU seconds of a separate Python process for a script, with compiled modules."""
    compiled = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    best = float("inf")
    for _ in range(REPEATS):
        before = seconds_of_children()
        subprocess.run([sys.executable, "-c", script], stdout=subprocess.DEVNULL, cwd=ROOT, env=compiled, check=True)
        best = min(best, seconds_of_children() - before)
    return best


# ------------------------------------------------------------------------------------------------------ 1. how many, how fast


def grounding(folder: Path) -> None:
    """Print the time of the quantification of B1_MOVE by SPARQL."""
    found = [measured("ground", scene(folder, objects)) for objects in OBJECTS]
    names = ("sparql", "peak_mb")
    rows = [[one["rows"], *(one[name] for name in names)] for one in found]
    sizes = [one["rows"] for one in found]
    rows.append(["grows by the power", *(exponent(sizes, [one[name] for one in found]) for name in names[:-1]), ""])
    columns = ("rows", "SPARQL, s", "peak memory, MB")
    table("B1_MOVE(object, location), all quantified behaviours", columns, rows)


def ground(path: str) -> dict[str, float]:
    """Measure the quantification of one behaviour in a scene."""
    from confab.reasoner.graph.knowledge import load
    from confab.reasoner.reading.problem import read
    from confab.reasoner.reading.quantification import query_for

    graph = load(path)
    reading = read(graph)
    query = query_for(reading, reading.problem.domain.behaviors["B1_MOVE"])
    found: dict[str, float] = {"rows": len(graph.select(query))}
    found["sparql"] = least(lambda: graph.select(query))
    return {**found, "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


# ------------------------------------------------------------------------------------------------ 2. and 3. irrelevant objects


def worlds(folder: Path) -> None:
    """Print the load rate and the planning time of one task in worlds of growing size, in memory and at an endpoint."""
    here, there = [], []
    for clutter in CLUTTER:
        path = scene(folder, clutter=clutter)
        here.append(measured("plan", path))
        with oxigraph(path) as url:
            there.append(measured("plan", url))
        path.unlink()
    for place, found in (("in memory", here), ("behind an Oxigraph server", there)):
        base = found[0]
        names = ("recognition", "paper", "fast")
        columns = ["irrelevant objects"]
        columns += ["triples", "load, s", "triples/s", "peak, GB"] if place == "in memory" else []
        columns += ["queries", *(f"{n}, s" for n in names), "recognition + paper, ratio", "recognition + fast, ratio"]
        rows = []
        for clutter, one in zip(CLUTTER, found, strict=True):
            loading = [one["triples"], one["load"], round(one["triples"] / one["load"]), one["peak_mb"] / 1024]
            ratios = [
                (one["recognition"] + one[mode]) / (base["recognition"] + base[mode]) for mode in ("paper", "fast")
            ]
            rows.append(
                [
                    f"{clutter:,}",
                    *(loading if place == "in memory" else []),
                    one["queries"],
                    *(one[n] for n in names),
                    *ratios,
                ]
            )
        if len(CLUTTER) > 2:
            sizes = [max(k, 4) for k in CLUTTER]
            powers = [exponent(sizes, [one[n] for one in found]) for n in names]
            blank = [""] * (5 if place == "in memory" else 1)
            rows.append(["grows by the power", *blank, *powers, "", ""])
        table(f"The task of four objects among irrelevant ones, {place}", columns, rows)


def plan(source: str) -> dict[str, float | str]:
    """Measure loading, task recognition and planning with a file or an endpoint."""
    from confab.planner.hierarchical.planner import plan as fast
    from confab.planner.paper.hierarchy import plan as paper
    from confab.reasoner.graph.knowledge import load
    from confab.reasoner.graph.stores import connect
    from confab.reasoner.reading.relevance import recognise

    begin = perf_counter()
    graph = connect(source) if "://" in source else load(source)
    found: dict[str, float | str] = {"load": perf_counter() - begin, "triples": len(graph.store)}
    before = graph.round_trips
    problem = recognise(graph).problem
    found["queries"] = graph.round_trips - before
    found["recognition"] = least(lambda: recognise(graph))
    found["paper"] = least(lambda: paper(problem))
    found["fast"] = least(lambda: fast(problem))
    found["status"] = f"{paper(problem).status.value} {fast(problem).status.value}"
    return {**found, "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


@contextmanager
def oxigraph(path: Path) -> Iterator[str]:
    """Run the Oxigraph server on loopback with a scene and its imports, and yield the server's URL."""
    import urllib3

    from confab.reasoner.graph.knowledge import load

    bare = load(scene(path.parent))
    files = [file for iri, file in bare.files.items() if iri != bare.scene] + [path]
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    binary = str(Path(sys.executable).with_name("oxigraph"))
    server = subprocess.Popen(
        [binary, "serve", "--bind", f"127.0.0.1:{port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(100):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        for file in files:
            with file.open("rb") as body:
                address = f"http://127.0.0.1:{port}/store?default"
                answer = urllib3.request(
                    "POST", address, body=body, headers={"Content-Type": "text/turtle"}, timeout=900
                )
            if answer.status >= 300:
                raise SystemExit(f"the Oxigraph server refused {file.name}: {answer.status}")
        yield f"http://127.0.0.1:{port}/query"
    finally:
        server.terminate()
        server.wait(30)


# ----------------------------------------------------------------------------------------------------------------- 4. peers


def rdflib_engine(folder: Path) -> None:
    """Print the time that rdflib's SPARQL engine takes for a quantification."""
    import rdflib

    from confab.reasoner.graph.knowledge import load
    from confab.reasoner.reading.problem import read
    from confab.reasoner.reading.quantification import query_for
    from confab.reasoner.vocabulary import PREFIXES

    rows: list[list[Any]] = []
    for objects in RDFLIB_OBJECTS:
        graph = load(scene(folder, objects))
        reading = read(graph)
        behavior = reading.problem.domain.behaviors["B1_MOVE"]
        other = rdflib.Graph()
        other.parse(data=graph.ntriples(), format="nt")
        query = query_for(reading, behavior)
        answer: list[object] = []

        def ask(query: str = query, other: rdflib.Graph = other, answer: list[object] = answer) -> None:
            answer[:] = list(other.query(query, initNs=PREFIXES))

        theirs = least(ask, 2)
        ours = least(lambda: graph.select(query))  # noqa: B023
        rows.append([len(answer), ours, theirs, theirs / ours])
    sizes = [row[0] for row in rows]
    rows.append(["grows by the power", *(exponent(sizes, [row[i] for row in rows]) for i in (1, 2)), ""])
    table("The same query in rdflib's own engine", ("rows", "ours, s", "rdflib, s", "ratio"), rows)


def translator(folder: Path) -> None:
    """Print the time that Fast Downward's translator takes to ground the exported problem, and the time of Confab."""
    from benchmarks.pddl import peers, planners
    from confab.planner.grounded.grounding import ground as ground_level
    from confab.planner.plan import Reason
    from confab.reasoner.graph.knowledge import load
    from confab.reasoner.pddl.exporting import to_pddl
    from confab.reasoner.reading.relevance import recognise

    try:
        command = planners(peers())["translate"]
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"\nFast Downward's translator is left out: {error}")
        return
    rows: list[list[object]] = []
    for level in (2, 3):
        slow = False
        for objects in PEER_OBJECTS:
            graph = load(scene(folder, objects))
            problem = recognise(graph).problem
            begin = perf_counter()
            problem = recognise(graph).problem
            task = ground_level(problem, level)
            count = 0 if isinstance(task, Reason) else len(task)
            ours = perf_counter() - begin
            theirs, said = None, f"more than {CAP:.0f}"
            if not slow:
                exported = to_pddl(problem, level)
                (folder / "domain.pddl").write_text(exported.domain)
                (folder / "problem.pddl").write_text(exported.problem)
                theirs = _translate(command, folder)
                slow = theirs is None
                said = f"{theirs:.3g}" if theirs is not None else said
            rows.append([level, objects, count, ours, said, f"{theirs / ours:.0f}" if theirs else "–"])
    columns = ("level", "objects", "operators", "ours, s", "translator, s", "ratio")
    table(
        "Grounding one level: ours from the graph on, Fast Downward's translator from the exported text on",
        columns,
        rows,
    )


def _translate(command: Sequence[str], folder: Path) -> float | None:
    """Return the CPU seconds that the translator reports, or None if it exceeds the time limit."""
    names = {"{domain}": "domain.pddl", "{problem}": "problem.pddl", "{plan}": "output.sas"}
    full = [names.get(word, word) for word in command]
    try:
        done = subprocess.run(full, cwd=folder, capture_output=True, text=True, timeout=CAP, check=False)
    except subprocess.TimeoutExpired:
        return None
    match = re.search(r"Done! \[([\d.]+)s CPU", done.stdout)
    if match is None:
        raise SystemExit(f"the translator failed: {done.stdout[-500:]}{done.stderr[-500:]}")
    return float(match.group(1))


if __name__ == "__main__":
    part, *arguments = sys.argv[1:]
    parts: dict[str, Callable[..., dict[str, Any]]] = {"call": call, "ground": ground, "plan": plan}
    print(json.dumps(parts[part](*arguments)))
