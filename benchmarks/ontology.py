"""The cost of validation, of OWL 2 RL inference, and of HermiT on tables of the family `served`.

    python -m benchmarks ontology

The table has medians of three runs in wall and CPU seconds, including the Java process. Validation is measured from the
file, and the other functions are measured from a loaded graph.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

from confab.reasoner.generate import write_scene
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import load
from confab.reasoner.validation import hermit
from confab.reasoner.validation.validate import validate

REPEATS = 3
AXIOM = """
k:BeverageOrVessel a owl:Class ; rdfs:label "beverage or vessel"@en ;
  owl:equivalentClass [ a owl:Class ; owl:unionOf ( k:Beverage k:Vessel ) ] .
"""  # an axiom with a conclusion, since the shipped tabletop has none


def main() -> None:
    """Print the table."""
    print(f"{'what':<44}{'objects':>8}{'wall':>8}{'CPU':>8}{'wanted':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for what, objects, wanted, work in (
            ("validate, without HermiT", 100, 2, validation),
            ("OWL 2 RL, with a class to conclude", 1000, 3, materialisation),
            ("HermiT: consistency, empty classes, terms", 100, None, logic),
            ("HermiT: consistency, empty classes, terms", 1000, 20, logic),
        ):
            file = Path(folder) / f"served{objects}.ttl"
            write_scene(file, "served", objects)
            wall, cpu = (median(column) for column in zip(*(work(file) for _ in range(REPEATS)), strict=True))
            print(f"{what:<44}{objects:>8}{wall:>8.2f}{cpu:>8.2f}{f'≤ {wanted}' if wanted else '':>8}", flush=True)


def timed(call: Callable[[], object]) -> tuple[float, float]:
    """Return the wall and CPU seconds of a call, including the CPU seconds of child processes."""
    began, before = perf_counter(), sum(os.times()[:4])
    call()
    return perf_counter() - began, sum(os.times()[:4]) - before


def validation(file: Path) -> tuple[float, float]:
    def work() -> None:
        assert validate([file]) == []

    return timed(work)


def materialisation(file: Path) -> tuple[float, float]:
    text = file.read_text(encoding="utf-8")
    file.write_text(text if text.endswith(AXIOM) else text + AXIOM, encoding="utf-8")
    graph = load(file)
    spent = timed(lambda: infer(graph))
    assert graph.ntriples(["inferred"])
    return spent


def logic(file: Path) -> tuple[float, float]:
    graph = load(file)

    def work() -> None:
        assert list(hermit.faults(graph)) == []

    return timed(work)


if __name__ == "__main__":
    main()
