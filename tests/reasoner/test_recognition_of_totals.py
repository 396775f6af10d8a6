"""Task recognition reads the individuals on which totals of totals depend, and finds goals by any name of their terms."""

from pathlib import Path

import pytest

import confab
from confab.planner.plan import Status
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.relevance import recognise

YARD = """@prefix : <https://example.org/yard#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix o: <https://example.org/other#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/yard> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Cart a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :IN ; c:hasSituationType :LOAD, :OVERLOADED .
:Train a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :TOTAL .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :IN .
:Bin a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
:Crate a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :IN, :FULL .
:IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :in .
:in a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Crate ; rdfs:range :IN .
:FULL a owl:Class, owl:NamedIndividual, c:SituationType .
:OVERLOADED a owl:Class, owl:NamedIndividual, c:SituationType .
:LOAD a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :load .
:TOTAL a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :total .
:load a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Cart ; rdfs:range xsd:decimal .
:total a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Train ; rdfs:range xsd:decimal .
:pulls a owl:ObjectProperty, owl:NamedIndividual, c:Relation .
:handles a owl:ObjectProperty, owl:NamedIndividual, c:Relation .
:LOAD.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?cart :load ?n } WHERE {
  SELECT ?cart (COUNT(?crate) AS ?n) WHERE { ?cart a :Cart . ?crate a :Crate ; :in ?cart ; :FULL true } GROUP BY ?cart }\"\"\" .
:PUT a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update \"\"\"DELETE { ?crate :in ?from }
  INSERT { ?crate :in ?cart } WHERE { ?crate a :Crate . ?cart a :Cart . ?crate :in ?from }\"\"\" .
:TAKE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:cost 5.0 ; c:update \"\"\"DELETE { ?crate :in ?cart }
  INSERT { ?crate :in ?place } WHERE { ?crate a :Crate . ?place a :Place . ?crate :in ?cart . ?cart a :Cart }\"\"\" .
:cart1 a owl:NamedIndividual, :Cart . :cart2 a owl:NamedIndividual, :Cart . :floor a owl:NamedIndividual, :Place .
:crate1 a owl:NamedIndividual, :Crate ; :in :floor . :crate2 a owl:NamedIndividual, :Crate ; :in :cart2 .
:train1 a owl:NamedIndividual, :Train ; :pulls :cart1, :cart2 . :bin1 a owl:NamedIndividual, :Bin ; :handles :crate2 .
:full1 a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :crate1 ; c:situationType :FULL .
:full2 a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :crate2 ; c:situationType :FULL .
[ a owl:AllDifferent ; owl:distinctMembers ( :cart1 :cart2 :floor :crate1 :crate2 :train1 :bin1 ) ] .
:task a owl:NamedIndividual, c:Task ; c:goal :task.goal .
:task.goal a owl:NamedIndividual, c:ValueCondition ; c:about :crate1 ; c:situationType :IN ; c:value :cart1 .
"""
SUM = """:TOTAL c:mostAmount 1.0 .
:TOTAL.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?train :total ?n } WHERE {
  SELECT ?train (SUM(?load) AS ?n) WHERE { ?train a :Train ; :pulls ?cart . ?cart a :Cart ; :load ?load } GROUP BY ?train }\"\"\" .
"""
EMPTY = """:EMPTY a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; c:update \"\"\"INSERT { ?crate :FULL false }
  WHERE { ?crate a :Crate . ?bin a :Bin ; :handles ?crate }\"\"\" .
"""
NEVER = """:OVERLOADED c:never true .
:OVERLOADED.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?cart :OVERLOADED true }
  WHERE { ?cart a :Cart ; :load ?n FILTER(?n > 1) }\"\"\" .
"""


def yard(tmp_path: Path, *more: str) -> Path:
    (tmp_path / "yard.ttl").write_text(YARD + "".join(more), encoding="utf-8")
    return tmp_path / "yard.ttl"


@pytest.mark.parametrize(("more", "cost"), [("", 6.0), (EMPTY, 2.0)])
def test_the_bound_of_a_sum_of_counts_holds_for_owners_that_no_step_names(
    more: str, cost: float, tmp_path: Path
) -> None:
    result = confab.load(yard(tmp_path, SUM, more)).plan(optimal=True)
    assert result.outcome.status is Status.SOLVED
    assert result.outcome.bound == cost


def test_a_constraint_on_a_count_makes_the_facts_relevant_that_are_counted(tmp_path: Path) -> None:
    scene = yard(
        tmp_path, NEVER, EMPTY, ":crate3 a owl:NamedIndividual, :Crate ; :in :cart1 . :bin1 :handles :crate3 .\n"
    )
    scene.write_text(
        scene.read_text("utf-8") + ":full3 a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :crate3 ; "
        "c:situationType :FULL . [ a owl:AllDifferent ; owl:distinctMembers ( :crate3 :crate1 :crate2 ) ] .\n",
        encoding="utf-8",
    )
    result = confab.load(scene).plan(optimal=True)
    assert result.outcome.bound == 2.0
    assert {step.behavior for step in result.plan.primitives} == {"EMPTY", "PUT"}


def test_a_total_may_belong_to_two_classes(tmp_path: Path) -> None:
    rule = """:Place c:hasSituationType :TOTAL . :TOTAL c:mostAmount 3.0 .
:TOTAL.rule a owl:NamedIndividual, c:Rule ; c:aggregate "sum" ; c:situationType :TOTAL ; c:about :train1 ; c:right :TOTAL.n ;
  c:condition :TOTAL.in .
:TOTAL.n a owl:NamedIndividual, c:Calculation ; c:about :TOTAL.cart ; c:situationType :LOAD .
:TOTAL.cart a owl:NamedIndividual, c:Variable ; c:termType :Cart .
:TOTAL.in a owl:NamedIndividual, c:RelationCondition ; c:relation :pulls ; c:about :train1 ; c:value :TOTAL.cart .
"""
    assert confab.load(yard(tmp_path, rule.replace("rdfs:domain :Train ; ", ""))).plan().outcome.status is Status.SOLVED


OTHER = "o:IN a owl:NamedIndividual, :Place . [ a owl:AllDifferent ; owl:distinctMembers ( :floor o:IN ) ] .\n"


def test_a_goal_names_its_situation_type_by_a_longer_name(tmp_path: Path) -> None:
    scene = yard(tmp_path, OTHER, EMPTY)
    part = recognise(load(scene), ["crate1 yard:IN cart1"])
    assert {"PUT", "TAKE"} <= {one.name for one in part.problem.domain.behaviors.values()}
    assert confab.load(scene).plan("crate1 yard:IN cart1", optimal=True).outcome.bound == 1.0


def test_a_behaviour_has_the_same_name_in_a_part_of_the_scene_as_in_the_whole_scene(tmp_path: Path) -> None:
    graph = load(yard(tmp_path, SUM, "o:PUT a owl:NamedIndividual, :Bin .\n"))
    part, whole = recognise(graph).problem, read(graph).problem
    assert "PUT" not in part.individuals | whole.domain.behaviors.keys()
    assert part.domain.behaviors.keys() == whole.domain.behaviors.keys()


@pytest.mark.parametrize("word", ["cart1#", "cart%zz", "cart<1", "7"])
def test_a_word_that_is_no_name_is_an_unknown_individual(word: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"unknown individual '{word}'"):
        confab.load(yard(tmp_path)).plan(f"crate1 IN {word}")


def test_the_variable_of_a_nested_condition_has_no_meaning_outside_of_it(tmp_path: Path) -> None:
    move = """:MOVE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:parameter :MOVE.crate ; c:postcondition :MOVE.in ;
  c:precondition :MOVE.some, :MOVE.at .
:MOVE.crate a owl:NamedIndividual, c:Parameter ; c:termType :Crate . :MOVE.x a owl:NamedIndividual, c:Variable ; c:termType :Place .
:MOVE.in a owl:NamedIndividual, c:ValueEffect ; c:about :MOVE.crate ; c:situationType :IN ; c:value :cart1 .
:MOVE.some a owl:NamedIndividual, c:Witness ; c:witness :MOVE.x ; c:condition :MOVE.near .
:MOVE.near a owl:NamedIndividual, c:RelationCondition ; c:relation :handles ; c:about :MOVE.crate ; c:value :MOVE.x .
:MOVE.at a owl:NamedIndividual, c:ValueCondition ; c:about :MOVE.crate ; c:situationType :IN ; c:value :MOVE.x .
"""
    with pytest.raises(KnowledgeError, match=r"MOVE\.x is the c:witness of another condition"):
        recognise(load(yard(tmp_path, move)))
