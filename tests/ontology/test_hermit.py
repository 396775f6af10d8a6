"""HermiT, called directly: its conclusions, and the same conclusions for many individuals within seconds."""

from collections.abc import Callable
from os import times
from pathlib import Path

import pytest

from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, load
from confab.reasoner.validation.hermit import classify

pytestmark = pytest.mark.slow

HEAD = """
@prefix : <https://example.org/logic#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/logic> a owl:Ontology .
:Vessel a owl:Class . :Cup a owl:Class ; rdfs:subClassOf :Vessel . :Place a owl:Class ; owl:disjointWith :Vessel .
:at a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:range :Place .
:here a owl:NamedIndividual, :Place . :there a owl:NamedIndividual, :Place . :cup a owl:NamedIndividual, :Cup .
"""
DIFFERENT = "[ a owl:AllDifferent ; owl:distinctMembers ( :here :there ) ] ."
ONE = '"1"^^<http://www.w3.org/2001/XMLSchema#nonNegativeInteger>'
LOGIC = "https://example.org/logic#"

Logic = Callable[[str], KnowledgeGraph]


@pytest.fixture
def logic(tmp_path: Path) -> Logic:
    def loaded(more: str) -> KnowledgeGraph:
        (tmp_path / "logic.ttl").write_text(HEAD + more, encoding="utf-8")
        return load(tmp_path / "logic.ttl")

    return loaded


def test_two_values_of_a_functional_property_contradict_only_individuals_that_are_different(logic: Logic) -> None:
    both = ":cup :at :here, :there ."
    assert classify(logic(both)).consistent
    assert not classify(logic(both + DIFFERENT)).consistent
    assert not classify(logic(both + DIFFERENT.replace("distinctMembers", "members"))).consistent


def test_groups_of_different_individuals_may_share_members_in_any_order(logic: Logic) -> None:
    more = "[ a owl:AllDifferent ; owl:distinctMembers ( :there :cup :here ) ] ."
    assert classify(logic(DIFFERENT + more)).consistent
    assert not classify(logic(DIFFERENT + more + ":cup owl:sameAs :there .")).consistent


def test_hermit_takes_different_individuals_into_account(logic: Logic) -> None:
    busy = f":Busy rdfs:subClassOf [ a owl:Restriction ; owl:onProperty :holds ; owl:maxCardinality {ONE} ] ."
    holds = (
        ":holds a owl:ObjectProperty . :Busy a owl:Class . :robot a owl:NamedIndividual, :Busy ; :holds :here, :there ."
    )
    assert classify(logic(busy + holds)).consistent
    assert not classify(logic(busy + holds + DIFFERENT)).consistent


def test_a_class_that_can_have_no_individual_is_named_in_any_script(logic: Logic) -> None:
    assert classify(logic("")).empty == ()
    assert classify(logic(":Überall a owl:Class ; rdfs:subClassOf :Vessel, :Place .")).empty == (LOGIC + "Überall",)


def test_types_of_individuals_are_inferred_only_on_request(logic: Logic) -> None:
    graph = logic(":somewhere a owl:NamedIndividual . :cup :at :somewhere .")
    assert classify(graph).types == {}
    types = classify(graph, types=True).types
    assert types[LOGIC + "somewhere"] == {LOGIC + "Place"}
    assert types[LOGIC + "cup"] == {LOGIC + "Cup"}


def test_an_ontology_that_hermit_refuses_is_reported_in_the_words_of_hermit(logic: Logic) -> None:
    one = f"[ a owl:Restriction ; owl:onProperty :in ; owl:maxCardinality {ONE} ]"
    with pytest.raises(KnowledgeError, match=r"HermiT can't work on this ontology: .*logic#in"):
        classify(logic(f":in a owl:ObjectProperty, owl:TransitiveProperty . :Cup rdfs:subClassOf {one} ."))


def test_a_thousand_different_individuals_are_distinguished_in_seconds(logic: Logic) -> None:
    cups = [f":cup{number}" for number in range(1000)]
    many = " ".join(f"{cup} a owl:NamedIndividual, :Cup ; :at :here ." for cup in cups)
    many += f"[ a owl:AllDifferent ; owl:distinctMembers ( {' '.join(cups)} ) ] ."
    began = times()
    assert classify(logic(many)).consistent
    assert not classify(logic(many + ":cup1 owl:sameAs :cup999 .")).consistent
    now = times()
    assert now.children_user + now.children_system - began.children_user - began.children_system < 40  # CPU seconds
