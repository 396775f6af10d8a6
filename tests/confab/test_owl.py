"""What is added through owlready2 is seen by SPARQL and planned with; objects and places of a foreign kitchen are read."""

from pathlib import Path

import pyoxigraph as ox

import confab
import ontology
from confab.authoring import new_domain
from reasoner.graph import BASE, load
from reasoner.reading import read

LABELS = "SELECT ?label WHERE { <https://example.org/tearoom-scene#plate3> rdfs:label ?label }"


def test_what_owlready2_adds_is_seen_by_sparql_and_by_the_planner(tmp_path: Path) -> None:
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


def test_what_owlready2_removes_is_gone(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    scene = confab.load(tmp_path / "tearoom-scene.ttl")
    plate = scene.owl["https://example.org/tearoom-scene#plate1"]
    plate.cleanliness = None
    rows = scene.query("SELECT ?how WHERE { <https://example.org/tearoom-scene#plate1> d:cleanliness ?how }")
    assert len(rows) == 0


FOREIGN = """
@prefix soma: <http://www.ease-crc.org/ont/SOMA.owl#> . @prefix dul: <http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#> .
@prefix k: <https://w3id.org/confab/tabletop#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> . @prefix : <https://example.org/kitchen#> .
<https://example.org/kitchen> a owl:Ontology ; owl:imports <https://w3id.org/confab/tabletop> ,
  <https://w3id.org/confab/soma-alignment> .
soma:Cup a owl:Class ; rdfs:subClassOf k:Cup . soma:Surface a owl:Class ; rdfs:subClassOf k:Location .
:mug_3 a owl:NamedIndividual, soma:Cup ; dul:hasLocation :counter_1 . :counter_1 a owl:NamedIndividual, soma:Surface .
"""


def test_objects_and_places_of_a_foreign_kitchen_are_read(tmp_path: Path) -> None:
    (tmp_path / "kitchen.ttl").write_text(FOREIGN)
    graph = load(tmp_path / "kitchen.ttl")
    found = graph.query((ontology.ROOT / "alignments" / "places-from-dul.rq").read_text())
    assert isinstance(found, ox.QueryTriples)
    for triple in list(found):
        graph.store.add(ox.Quad(triple.subject, triple.predicate, triple.object, ox.NamedNode(BASE + "asserted")))
    problem = read(graph).problem
    assert problem.classes["Movable"] == ("mug_3",)
    assert {str(symbol): value for symbol, value in problem.initial.items()} == {
        "<mug_3, LOCATION>": "counter_1",
        "<mug_3, BEVERAGE>": "no_beverage",
    }


def test_the_alignment_imports_neither_soma_nor_dul() -> None:
    graph = load(ontology.ROOT / "alignments" / "soma-alignment.ttl")
    assert all(iri.startswith("https://w3id.org/confab/") for iri in graph.files)
