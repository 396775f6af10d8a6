"""The affordances of an object depend on the situation, and a SPARQL query on the graph returns the same behaviours."""

from functools import cache
from pathlib import Path

import pytest

import confab
from confab.planner.affordances import affordances
from confab.planner.paper.transitions import Model, ground
from confab.planner.validation import LoggedState
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeGraph, load, text
from confab.reasoner.names import local_name
from confab.reasoner.reading.applicable import SITUATION, applicable_query, write_situation
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import TRUE, State, Symbol
from tests.ontology.faults import skeleton

LAMPS = Path(__file__).parent / "cases" / "dim-lamps.ttl"
"""A lamp and a thing that is no lamp; behaviours and rules about what is off or doesn't glow, and about things in no kitchen."""


@cache
def scene(name: str | Path) -> tuple[KnowledgeGraph, Reading]:
    graph = load(name)
    infer(graph)
    return graph, read(graph)


def afforded(name: str | Path, **changes: str) -> set[tuple[str, ...]]:
    """Return (object, behaviour, arguments …) in the initial situation with changes, written as ``object__SITUATION=value``."""
    reading = scene(name)[1]
    state = dict(reading.problem.initial)
    for key, value in changes.items():
        about, situation = key.split("__")
        state[Symbol(situation, (about,))] = value
    return {(found.object, found.behavior, *found.arguments) for found in affordances(reading.problem, state)}


def test_a_cup_affords_pouring_if_a_drink_is_wanted() -> None:
    assert ("cup1", "POUR", "bottle1", "cup1") not in afforded("living-room")
    assert ("cup1", "POUR", "bottle1", "cup1") in afforded("living-room", anna__WISH="juice")
    assert ("cup1", "POUR", "bottle1", "cup1") not in afforded("living-room", anna__WISH="tea")
    assert ("cup1", "POUR", "bottle1", "cup1") not in afforded("living-room", anna__WISH="juice", cup1__CONTENT="juice")


def test_a_cup_in_the_living_room_affords_clearing_away_unless_a_drink_is_wanted() -> None:
    cleared = ("cup1", "CLEAR_AWAY", "cup1", "counter_right")
    assert cleared in afforded("living-room")
    assert cleared not in afforded("living-room", anna__WISH="juice")
    assert cleared not in afforded("living-room", cup1__PLACE="counter_right")
    assert cleared not in afforded("living-room", bread2__PLACE="counter_right")


def test_bread_on_the_floor_does_not_afford_eating() -> None:
    assert ("bread1", "EAT", "bread1") not in afforded("living-room")
    assert ("bread2", "EAT", "bread2") in afforded("living-room")
    assert ("bread1", "EAT", "bread1") in afforded("living-room", bread1__PLACE="counter_right")
    assert ("bread2", "EAT", "bread2") not in afforded("living-room", bread2__REST_OF_FOOD="eaten")


def test_owl_inference_finds_the_places_in_the_living_room() -> None:
    graph, reading = scene("living-room")
    assert reading.problem.classes["LivingRoomPlace"] == ("floor", "table_left", "table_right")
    graph = load("living-room")
    assert "LivingRoomPlace" not in read(graph).problem.classes or not read(graph).problem.classes["LivingRoomPlace"]


def test_an_affordance_is_object_situation_behaviour_and_effect() -> None:
    reading = scene("living-room")[1]
    found = next(a for a in affordances(reading.problem) if a.behavior == "CLEAR_AWAY")
    assert [str(fact) for fact in found.situation] == ["cup1 CONTENT empty", "cup1 PLACE table_left"]
    assert [str(fact) for fact in found.effect] == ["cup1 PLACE counter_right"]


def test_an_affordance_has_the_amounts_that_a_behaviour_compares_and_changes() -> None:
    reading = scene("canteen-small")[1]
    found = {(a.behavior, *a.arguments): a for a in affordances(reading.problem)}
    refill, drive = found["L1_REFILL", "jug1"], found["L2_DRIVE", "trolley", "tap"]
    assert [str(fact) for fact in (*refill.situation, *refill.effect)] == ["jug1 SERVINGS 1.5", "jug1 SERVINGS 2"]
    assert [str(fact) for fact in drive.situation] == ["trolley BATTERY 6", "trolley TROLLEY_AT dock"]
    assert [str(fact) for fact in drive.effect] == ["trolley BATTERY 4", "trolley TROLLEY_AT tap"]


def test_the_effects_of_an_affordance_are_of_situation_types_of_the_author() -> None:
    reading = scene("tour-small")[1]
    effects = {str(fact) for found in affordances(reading.problem) for fact in found.effect}
    assert "bridge SEEN true" in effects
    assert not [fact for fact in effects if "." in fact]


def states(reading: Reading, level: int) -> list[State]:
    """Return some states that behaviours of a level reach."""
    model = Model(reading.problem)
    grounds = ground(reading.problem, level)
    values = [model.values(reading.problem.initial)]
    for _ in range(4):
        values += [applied.after for applied in list(model.successors(grounds, values[-1]))[:1]]
    return [model.state(value) for value in values]


@pytest.mark.parametrize(
    ("name", "level"),
    [("beverage-serving", 1), ("beverage-serving", 2), ("beverage-serving", 3), ("living-room", 1), (LAMPS, 1)],
)
def test_sparql_and_the_planner_agree_on_the_applicable_behaviours(name: str | Path, level: int) -> None:
    graph, reading = scene(name)
    model, grounds = Model(reading.problem), ground(reading.problem, level)
    for state in states(reading, level):
        write_situation(graph, reading, state)
        wanted = {(g.behavior, *g.arguments) for g in grounds if model.apply(g, model.values(state)) is not None}
        found = set()
        for behavior in reading.problem.domain.at_level(level):
            for row in graph.select(applicable_query(graph, reading, behavior), ("asserted", "inferred", "reach")):
                arguments = [reading.names.short(term.value) for term in row[: len(behavior.parameters)] if term]
                found.add((behavior.name, *arguments))
        assert found == wanted


def test_queries_see_the_derived_facts_that_planning_sees() -> None:
    """A fact is false only of individuals that have its situation type, and a local variable has its class."""
    graph, reading = scene(LAMPS)
    write_situation(graph, reading)
    asked = f"SELECT ?kind ?about WHERE {{ GRAPH <{SITUATION}> {{ [] :situationType ?kind ; :about ?about }} }}"
    found = {(local_name(text(kind)), local_name(text(about))) for kind, about in graph.select(asked, ("situation",))}
    facts = LoggedState(reading.problem, reading.problem.initial)
    derived = {(name, one) for name in ("D1", "D2", "D3", "GLOWS") for one in ("l1", "t1")}
    assert found & derived == {(name, one) for name, one in derived if facts.value(name, (one,)) == TRUE}
    assert ("D1", "l1") in found


def test_the_query_of_applicable_behaviours_names_the_graph_of_the_situation() -> None:
    graph, reading = scene("beverage-serving")
    query = applicable_query(graph, reading, reading.problem.domain.behaviors["B2_PICK"])
    assert f"GRAPH <{SITUATION}>" in query
    assert "canReach" in query


def test_an_added_subclass_and_its_individual_are_quantified_over(tmp_path: Path) -> None:
    path = skeleton(tmp_path)
    text = path.read_text()
    added = (
        'd:Bowl a owl:Class ; rdfs:subClassOf d:Item ; rdfs:label "bowl"@en . '
        ':bowl1 a owl:NamedIndividual, d:Bowl ; c:index 3 ; rdfs:label "bowl 1"@en ; d:isAt :sink ; d:cleanliness d:dirty .'
    )
    path.write_text(text + added)
    assert ("bowl1", "B1_WASH", "bowl1") in afforded(path)
    assert read(load(path)).problem.id_of("B1_WASH", ("bowl1",)) == 11


def test_affordances_take_defined_situation_types_into_account() -> None:
    graph = load("packing-small")
    reading = read(graph)
    found = {(one.object, one.behavior) for one in affordances(reading.problem)}
    assert ("chest", "OPEN") in found
    assert "casket" not in {name for name, _ in found}  # the chest around the casket is shut
    write_situation(graph, reading)
    inside = "SELECT ?x ?y WHERE { ?x <https://w3id.org/confab/packing#isInside> ?y }"
    rows = {
        tuple(local_name(text(term)) for term in row) for row in graph.select(inside, [SITUATION.rsplit(":", 1)[-1]])
    }
    assert rows == {("casket", "chest"), ("casket", "hall"), ("chest", "hall"), ("ring", "hall")}


WATER = """@prefix : <https://example.org/water#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/water> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Tank a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :LEVEL .
:LEVEL a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :level .
:level a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Tank ; rdfs:range xsd:decimal .
:rate a owl:DatatypeProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Tank ; rdfs:range xsd:decimal .
:FILL a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update \"\"\"
    DELETE { ?tank :level ?old } INSERT { ?tank :level ?new }
    WHERE { ?tank a :Tank . ?tap a :Tank . ?tank :level ?old . ?tap :rate ?rate BIND(?old + ?rate AS ?new) }\"\"\" .
:DRAIN a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:price :DRAIN.price ; c:update \"\"\"
    DELETE { ?tank :level ?old } INSERT { ?tank :level 0 } WHERE { ?tank a :Tank . ?tank :level ?old }\"\"\" .
:DRAIN.tank a owl:NamedIndividual .
:DRAIN.price a owl:NamedIndividual, c:Calculation ; c:relation :rate ; c:about :DRAIN.tank .
:one a owl:NamedIndividual, :Tank ; c:index 1 ; :level 1.0 ; :rate 2.0 .
:two a owl:NamedIndividual, :Tank ; c:index 2 ; :level 2.0 ; :rate -1.0 .
:three a owl:NamedIndividual, :Tank ; c:index 3 ; :level 3.0 .
:task a owl:NamedIndividual, c:Task ; c:goal :task.full .
:task.full a owl:NamedIndividual, c:Comparison ; c:about :one ; c:situationType :LEVEL ; c:sign ">=" ; c:amount 3.0 .
"""


def test_a_behaviour_is_applicable_only_if_its_price_and_the_numbers_of_its_effects_exist() -> None:
    scene = confab.load(WATER)
    assert [tuple(row) for row in scene.query(scene.applicable_query("DRAIN"))] == [("one",)]
    filled = {tuple(row) for row in scene.query(scene.applicable_query("FILL"))}
    assert filled == {(tank, tap) for tank in ("one", "two", "three") for tap in ("one", "two")}


def test_affordances_are_listed_beside_a_behaviour_without_parameters() -> None:
    opened = """:OPEN_ALL a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; c:update \"\"\"
    DELETE { :one :level ?old } INSERT { :one :level 5 } WHERE { :one :level ?old }\"\"\" .
"""
    scene = confab.load(WATER + opened)
    assert "OPEN_ALL" in scene.problem.domain.behaviors
    assert [tuple(row)[:3] for row in scene.affordances("two")] == [
        ("two", "FILL", "two one"),
        ("two", "FILL", "two two"),
    ]


def test_the_affordances_of_one_object_are_those_of_all_objects_that_it_has() -> None:
    scene = confab.load("beverage-serving")
    rows = [tuple(row) for row in scene.affordances()]
    assert rows == sorted(rows) and len({row[0] for row in rows}) > 3
    for name in {row[0] for row in rows}:
        assert [tuple(row) for row in scene.affordances(name)] == [row for row in rows if row[0] == name]
