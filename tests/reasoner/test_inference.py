"""Static conclusions of OWL 2 RL are added before planning, and only if there are any."""

from pathlib import Path

import pytest

from confab.reasoner.graph.inference import infer, needed
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, load
from confab.reasoner.reading.problem import read
from tests.ontology.faults import skeleton

NEAR = ":near rdfs:label 'near' ; a owl:ObjectProperty, owl:NamedIndividual, c:Relation"


def graph_of(folder: Path, domain: str = "", scene: str = "") -> KnowledgeGraph:
    path = skeleton(folder)
    for file, added in ((folder / "washing.ttl", domain), (path, scene)):
        file.write_text(file.read_text() + added + "\n")
    return load(path)


def inferred(graph: KnowledgeGraph, prop: str) -> set[tuple[str, str]]:
    rows = graph.select(f"SELECT ?s ?o WHERE {{ ?s {prop} ?o }}", ["inferred"])
    return {(s.value.split("#")[1], o.value.split("#")[1]) for s, o in rows if s and o}


def test_the_reasoner_does_not_run_on_an_ontology_without_axioms_for_it() -> None:
    graph = load("beverage-serving")
    assert not needed(graph)
    assert infer(graph) == 0


def test_a_transitive_relation_is_closed_and_the_planner_sees_it(tmp_path: Path) -> None:
    graph = graph_of(tmp_path, NEAR + ", owl:TransitiveProperty .", ":table d:near :shelf . :shelf d:near :sink .")
    assert needed(graph)
    infer(graph)
    assert inferred(graph, "d:near") == {("table", "sink")}
    assert read(graph).problem.relations["near"] == {("table", "shelf"), ("shelf", "sink"), ("table", "sink")}


@pytest.mark.parametrize(
    ("axiom", "stated", "concluded"),
    [
        (NEAR + ", owl:SymmetricProperty .", ":table d:near :shelf .", ("near", ("shelf", "table"))),
        (
            NEAR
            + " . :by a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:label 'by' ; rdfs:subPropertyOf :near .",
            ":table d:by :shelf .",
            ("near", ("table", "shelf")),
        ),
        (
            NEAR
            + " . :by a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:label 'by' ; owl:inverseOf :near .",
            ":table d:by :shelf .",
            ("near", ("shelf", "table")),
        ),
    ],
)
def test_inference_completes_static_relations(
    tmp_path: Path, axiom: str, stated: str, concluded: tuple[str, tuple[str, str]]
) -> None:
    graph = graph_of(tmp_path, axiom, stated)
    infer(graph)
    assert concluded[1] in inferred(graph, "d:" + concluded[0])


def test_a_class_defined_by_a_static_relation_gets_its_individuals(tmp_path: Path) -> None:
    domain = NEAR + (
        " . :Handy a owl:Class, owl:NamedIndividual ; rdfs:label 'handy' ; owl:equivalentClass "
        "[ a owl:Restriction ; owl:onProperty :near ; owl:someValuesFrom :Sink ] ."
    )
    graph = graph_of(tmp_path, domain, ":table d:near :sink .")
    infer(graph)
    assert read(graph).problem.classes["Handy"] == ("table",)


def test_changeable_facts_lead_to_no_static_inference(tmp_path: Path) -> None:
    domain = (
        ":AtSink a owl:Class ; rdfs:label 'x' ; rdfs:subClassOf :Item . "
        "[ a owl:Restriction ; owl:onProperty :isAt ; owl:hasValue :dirty ] rdfs:subClassOf :AtSink ."
    )
    graph = graph_of(tmp_path, domain)
    infer(graph, always=True)
    assert not [pair for pair in inferred(graph, "a") if pair[1] == "AtSink"]
    assert inferred(graph, "d:isAt") == set()


def test_individuals_that_inference_would_identify_are_refused_by_name(tmp_path: Path) -> None:
    graph = graph_of(
        tmp_path,
        NEAR + ", owl:FunctionalProperty, owl:SymmetricProperty .",
        ":table d:near :shelf . :sink d:near :table .",
    )
    with pytest.raises(KnowledgeError, match="shelf and sink would be one individual"):
        infer(graph)


def test_inferring_twice_gives_the_same(tmp_path: Path) -> None:
    graph = graph_of(tmp_path, NEAR + ", owl:TransitiveProperty .", ":table d:near :shelf . :shelf d:near :sink .")
    assert infer(graph) == infer(graph)
