"""The SPARQL queries for quantification yield the paper's numbering, and the same set as enumeration."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings

from confab import ontology
from confab.planner.paper.transitions import ground
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import load
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.quantification import quantify, query_for
from confab.reasoner.reading.relevance import recognise
from tests.reasoner.worlds import graph_of, worlds


@pytest.mark.parametrize("scene", ontology.scenes())
def test_sparql_and_enumeration_give_the_same_behaviours_and_ids(scene: str) -> None:
    graph = load(scene)
    reading = read(graph)
    for level in reading.problem.domain.levels:
        found = quantify(graph, reading, level)
        assert found == ground(reading.problem, level)
        assert all(reading.problem.id_of(g.behavior, g.arguments) == g.id for g in found)


@pytest.mark.parametrize(
    ("level", "number", "text"),
    [
        (1, 22, "B1_MOVE cup1 location7"), (1, 34, "B1_POUR bottle1 cup1"), (1, 39, "B1_POUR bottle2 cup2"),
        (2, 4, "B2_PICK right_hand bottle1"), (2, 14, "B2_POUR right_hand cup1"), (2, 27, "B2_PLACE right_hand location4"),
        (3, 6, "B3_REACH_HAND_OBJECT left_hand cup1"), (3, 23, "B3_REACH_HAND_LOCATION right_hand location4"),
        (3, 29, "B3_GRASP right_hand"), (3, 30, "B3_PUT_DOWN left_hand"), (3, 33, "B3_LIFT right_hand"),
        (3, 35, "B3_TILT right_hand"), (3, 37, "B3_STAND_UPRIGHT right_hand"),
    ],
)  # fmt: skip
def test_ids_are_those_of_the_figures(level: int, number: int, text: str) -> None:
    graph = load("beverage-serving")
    assert f"{number} {text}" in [str(g) for g in quantify(graph, read(graph), level)]


def test_the_query_for_quantification_is_readable_and_runs() -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    text = query_for(reading, reading.problem.domain.behaviors["B2_PICK"])
    assert re.search(r"SELECT \?hand \?object", text)
    assert len(graph.select(text)) == 8


@settings(max_examples=40)
@given(text=worlds())
def test_query_and_enumeration_give_the_same_behaviours_in_any_world(text: str) -> None:
    with TemporaryDirectory() as folder:
        graph = graph_of(text, Path(folder))
    for reading in (read(graph), recognise(graph)):
        assert quantify(graph, reading, 1) == ground(reading.problem, 1)


@pytest.mark.parametrize("family", ["served", "random"])
def test_query_and_enumeration_give_the_same_behaviours_on_a_table(tmp_path: Path, family: str) -> None:
    write_scene(tmp_path / "scene.ttl", family, objects=10, hands=3, clutter=5, seed=4)
    graph = load(tmp_path / "scene.ttl")
    for reading in (read(graph), recognise(graph)):
        for level in reading.problem.domain.levels:
            assert quantify(graph, reading, level) == ground(reading.problem, level)


def test_individuals_of_several_namespaces_and_of_two_indices_are_numbered_once(tmp_path: Path) -> None:
    """An individual that SPARQL sorts by its IRI has the ID of its short name; a second index doesn't add a second row."""
    path = tmp_path / "scene.ttl"
    write_scene(path, "served")
    far = "".join(
        f"<https://a.org/x#{name}> a owl:NamedIndividual, k:Cup ; k:location {place} ; k:beverage k:no_beverage .\n"
        for name, place in (("zebra", ":location7"), ("cup1", ":location8"))
    )
    text = path.read_text(encoding="utf-8") + ":cup1 c:index 9 .\n:aardvark a owl:NamedIndividual, k:Location .\n" + far
    path.write_text(text, encoding="utf-8")
    graph = load(path)
    reading = read(graph)
    for level in reading.problem.domain.levels:
        assert quantify(graph, reading, level) == ground(reading.problem, level)
