"""Facts added through owlready2 are queried by SPARQL and used in plans; objects and places of a foreign ontology are read."""

from pathlib import Path

import pytest

import confab
from confab import ontology
from confab.authoring import new_domain
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.validation.validate import validate

LABELS = "SELECT ?label WHERE { <https://example.org/tearoom-scene#plate3> rdfs:label ?label }"


def test_facts_added_by_owlready2_affect_queries_and_plans(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    scene = confab.load(tmp_path / "tearoom-scene.ttl")
    assert len(scene.query(LABELS)) == 0
    world = scene.owl
    domain = world.get_namespace("https://example.org/tearoom#")
    with world.get_ontology("https://example.org/tearoom-scene#"):
        plate = domain.Plate("plate3")
    plate.label.append("plate 3")
    plate.isAt = world["https://example.org/tearoom-scene#sink"]
    plate.cleanliness = domain.dirty
    assert scene.query(LABELS)[0] == ("plate 3",)
    result = scene.plan(["plate3 CLEANLINESS clean", "plate1 CLEANLINESS dirty"], mode="paper")
    assert result.json()["steps"][0]["arguments"] == ["plate3"]


def test_facts_removed_by_owlready2_are_removed_from_the_graph(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    scene = confab.load(tmp_path / "tearoom-scene.ttl")
    plate = scene.owl["https://example.org/tearoom-scene#plate1"]
    plate.cleanliness = None
    rows = scene.query("SELECT ?how WHERE { <https://example.org/tearoom-scene#plate1> d:cleanliness ?how }")
    assert len(rows) == 0


EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "kitchen"


def test_objects_and_places_of_a_foreign_kitchen_are_read_and_planned_with(tmp_path: Path) -> None:
    for file in EXAMPLE.glob("*.ttl"):
        (tmp_path / file.name).write_text(file.read_text())
    query = (ontology.ROOT / "alignments" / "places-from-dul.rq").read_text()
    assert confab.load(tmp_path / "bridge.ttl").construct(query, tmp_path / "facts.ttl") == 4
    scene = confab.load(tmp_path / "facts.ttl")
    assert scene.problem.classes["Movable"] == ("juice_1", "mug_3")
    steps = scene.plan(["mug_3 LOCATION island"]).json()["steps"]
    assert [(step["behavior"], step["arguments"]) for step in steps] == [("B1_MOVE", ["mug_3", "island"])]
    assert [str(finding) for finding in validate([EXAMPLE / "kitchen.ttl"])] == []
    with pytest.raises(KnowledgeError, match="wanted a CONSTRUCT query"):
        scene.construct("SELECT ?x WHERE { ?x a k:Cup }", tmp_path / "none.ttl")


def test_the_alignment_imports_neither_soma_nor_dul() -> None:
    graph = load(ontology.ROOT / "alignments" / "soma-alignment.ttl")
    assert all(iri.startswith("https://w3id.org/confab/") for iri in graph.files)
