"""Every shipped file and a learned memory are unchanged after a round trip through the OWL API, and conform to OWL 2 DL."""

import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pyoxigraph as ox
import pytest

import confab
from confab import ontology
from confab.reasoner.generate import write_scene
from confab.reasoner.reading.observed import save_observed
from tests.ontology.faults import WITH_BODIES, skeleton
from tests.ontology.test_imports import TEMPLATES
from tests.planner.test_costs import DELIVERY
from worlds import owlapi
from worlds.entailed import domain

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(owlapi.jvm() is None or not owlapi.jars(), reason="no Java, or no jars of the OWL API"),
]

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
WORKED_OUT = {"defined.ttl": domain(), "priced.ttl": DELIVERY}
"""Texts with definitions of every kind and SWRL rules, and a text with a calculated price."""


def canonical(file: Path) -> ox.Dataset:
    """Return a file's triples with blank nodes named by RDFC-1.0."""
    dataset = ox.Dataset(ox.parse(path=str(file), format=ox.RdfFormat.TURTLE, base_iri="https://example.org/"))
    dataset.canonicalize(ox.CanonicalizationAlgorithm.RDFC_1_0)
    return dataset


def through_the_owl_api(files: list[Path], target: Path) -> dict[str, list[str]]:
    """Load files with the OWL API and save them into a folder; return each file's violations of OWL 2 DL."""
    target.mkdir()
    command = [sys.executable, "-m", "worlds.owlapi", str(target), *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    found: dict[str, list[str]] = json.loads(done.stdout.splitlines()[-1])
    return found


def everything(folder: Path) -> list[Path]:
    """Return every shipped file and every written file with triples, except SHACL shapes and patterns with placeholders."""
    scene = confab.load("beverage-serving")
    memory = confab.Memory.of(scene)
    memory.learn(scene, scene.plan(mode="paper").plan)
    memory.save(folder / "memory.ttl")
    save_observed(folder / "observed.ttl", scene.problem.initial, scene.names, scene.iri)
    write_scene(folder / "swapped.ttl", "swap", 4, 2, 0, 1)
    skeleton(folder)
    skeleton(folder, WITH_BODIES)
    shipped = [
        path for path in ontology.ROOT.rglob("*.ttl") if not {*TEMPLATES} & {*path.relative_to(ontology.ROOT).parts}
    ]
    return sorted([*shipped, *EXAMPLES.rglob("*.ttl"), *folder.glob("*.ttl")])


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], Path, dict[str, list[str]]]:
    """Return all files, the folder into which the OWL API saved them, and their violations; one JVM processes all files."""
    folder = tmp_path_factory.mktemp("sent")
    files = everything(folder)
    for name, text in WORKED_OUT.items():
        (folder / name).write_text(text)
    back = folder / "back"
    return files, back, through_the_owl_api([*files, *(folder / name for name in WORKED_OUT)], back)


def test_every_file_survives_a_round_trip_and_conforms_to_owl_2_dl_but_for_durations(
    sent: tuple[list[Path], Path, dict[str, list[str]]],
) -> None:
    """OWL 2 DL has no `xsd:dayTimeDuration`, the datatype of times (docs/authoring.md)."""
    files, back, violations = sent
    names = [file.name for file in files]
    assert {"soma-alignment.ttl", "cereal-serving.reach.ttl", "ferry.ttl", "watering-bodies.ttl", "memory.ttl"} <= {
        *names
    }
    assert len({*names, *WORKED_OUT}) == len(names) + len(WORKED_OUT), "files of one name would overwrite each other"
    found = {Path(file).name: [one for one in its if "dayTimeDuration" not in one] for file, its in violations.items()}
    assert {name: its for name, its in found.items() if its} == {}
    assert [Path(file).name for file, its in violations.items() if its] == ["bakery.ttl"]
    assert [file.name for file in files if canonical(file) != canonical(back / file.name)] == []


@pytest.mark.parametrize("name", WORKED_OUT)
def test_files_with_definitions_or_calculations_conform_to_owl_2_dl_and_lose_no_triple(
    sent: tuple[list[Path], Path, dict[str, list[str]]], name: str
) -> None:
    """The OWL API adds missing declarations; every written triple is present after the round trip."""
    _, back, violations = sent
    file = back.parent / name
    assert violations[str(file)] == []
    before, after = (
        Counter(re.sub(r"_:\w+", "_:", str(quad)) for quad in canonical(one)) for one in (file, back / name)
    )
    assert before - after == Counter()


def test_a_violation_of_owl_2_dl_and_a_changed_triple_are_detected(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    file = tmp_path / "washing.ttl"
    axioms = (
        ":near a owl:ObjectProperty, owl:TransitiveProperty, owl:FunctionalProperty . :Item skos:undeclared :Plate .\n"
    )
    file.write_text(file.read_text() + axioms)
    violations = through_the_owl_api([file, scene], tmp_path / "back")
    assert violations[str(file)]
    assert canonical(scene) != canonical(file)
