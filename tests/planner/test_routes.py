"""Plans whose steps share rounds: other orders of all steps, with other steps between them."""

from itertools import pairwise, permutations
from pathlib import Path

import pytest

import confab
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse

GARDEN = """@prefix : <https://example.org/garden#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/garden> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Spot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :STANDS .
:Bed a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Spot, :GROWS ; c:hasSituationType :MOIST .
:Table a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Spot, :GROWS .
:Tap a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Spot .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :GROWS .
:Seedling a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :GROWS .
:Gardener a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :STANDS, :WATER .
:MOIST a owl:Class, owl:NamedIndividual, c:SituationType .
:WATER a owl:NamedIndividual, c:SituationType, c:Amount ; c:fromLevel 2 ; c:valueProperty :water ; c:leastAmount 0.0 .
:water a owl:DatatypeProperty, owl:FunctionalProperty ; rdfs:domain :Gardener ; rdfs:range xsd:integer .
:STANDS a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :stands ; c:fromLevel 2 .
:stands a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Gardener ; rdfs:range :STANDS .
:GROWS a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :grows .
:grows a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Seedling ; rdfs:range :GROWS .
:WAY a owl:NamedIndividual, c:Relation .
:L1_WATER a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ;
  c:update "INSERT { ?bed :MOIST true } WHERE { ?bed a :Bed . ?bed :MOIST false }" .
:L1_PLANT a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:update '''
  DELETE { ?seedling :grows ?table } INSERT { ?seedling :grows ?bed }
  WHERE { ?seedling a :Seedling . ?bed a :Bed . ?seedling :grows ?table . ?table a :Table }''' .
:L2_WALK a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:price :L2_WALK.price ; c:update '''
  DELETE { ?one :stands ?from } INSERT { ?one :stands ?to }
  WHERE { ?one a :Gardener . ?to a :Spot . ?one :stands ?from FILTER(?from != ?to) }''' .
:L2_WALK.price a owl:NamedIndividual, c:Calculation ; c:about :L2_WALK.from ; c:argument2 :L2_WALK.to ; c:relation :WAY .
:L2_FILL a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ; c:update '''
  INSERT { ?one :water 3 } WHERE { ?one a :Gardener . ?one :stands ?tap . ?tap a :Tap }''' .
:L2_POUR a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 3 ; c:update '''
  DELETE { ?one :water ?n } INSERT { ?bed :MOIST true . ?one :water ?m }
  WHERE { ?one a :Gardener . ?bed a :Bed . ?one :stands ?bed ; :water ?n FILTER(?n >= 1) BIND(?n - 1 AS ?m) }''' .
:L2_TAKE a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 4 ; c:update '''
  DELETE { ?seedling :grows ?table } INSERT { ?seedling :grows ?place }
  WHERE { ?seedling a :Seedling . ?place a :Place . ?seedling :grows ?table . ?table a :Table
          FILTER NOT EXISTS { ?other a :Seedling ; :grows ?place } FILTER EXISTS { ?one a :Gardener ; :stands ?table } }''' .
:L2_SET a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 5 ; c:update '''
  DELETE { ?seedling :grows ?place } INSERT { ?seedling :grows ?bed }
  WHERE { ?seedling a :Seedling . ?bed a :Bed . ?seedling :grows ?place . ?place a :Place
          FILTER EXISTS { ?one a :Gardener ; :stands ?bed } }''' .
"""
"""A gardener waters beds with a can for three beds, and plants seedlings that lie on a tray with two places."""
SPOTS = {"table": (0, 0), "tap": (5, 1)}
BEDS = {f"bed{i}": spot for i, spot in enumerate([(2, 7), (8, 2), (1, 4), (9, 6), (4, 8), (7, 0), (3, 3), (6, 5)])}
PLANTED = {"seedling1": "bed3", "seedling2": "bed6", "seedling3": "bed3", "seedling4": "bed0"}


def garden(folder: Path) -> confab.Scene:
    """Return a scene of the garden with eight beds and four seedlings."""
    spots = SPOTS | BEDS
    text = GARDEN + ":table a owl:NamedIndividual, :Table . :tap a owl:NamedIndividual, :Tap .\n"
    text += "".join(f":{bed} a owl:NamedIndividual, :Bed .\n" for bed in BEDS)
    text += "".join(f":place{i} a owl:NamedIndividual, :Place ; c:fromLevel 2 .\n" for i in range(2))
    text += ":gardener a owl:NamedIndividual, :Gardener ; c:fromLevel 2 ; :stands :table ; :water 0 .\n"
    text += "".join(f":{one} a owl:NamedIndividual, :Seedling ; :grows :table .\n" for one in PLANTED)
    for one, other in permutations(spots, 2):
        way = 1 + sum(abs(a - b) for a, b in zip(spots[one], spots[other], strict=True))
        text += f"[] a c:SituatedObjectInstance ; c:relation :WAY ; c:about :{one} ; c:argument2 :{other} ; c:amount {way}.0 .\n"
    goals = [(bed, "MOIST", "c:true") for bed in BEDS] + [(one, "GROWS", f":{bed}") for one, bed in PLANTED.items()]
    text += ":task a owl:NamedIndividual, c:Task ; c:goal " + ", ".join(f":g{i}" for i in range(len(goals))) + " .\n"
    for i, (about, situation, value) in enumerate(goals):
        text += f":g{i} a owl:NamedIndividual, c:ValueCondition ; c:about :{about} ; "
        text += f"c:situationType :{situation} ; c:value {value} .\n"
    names = [*spots, *PLANTED, "gardener", "place0", "place1"]
    text += f"[] a owl:AllDifferent ; owl:distinctMembers ( {' '.join(':' + name for name in names)} ) .\n"
    (folder / "garden.ttl").write_text(text)
    return confab.load(folder / "garden.ttl")


def test_a_round_through_a_garden_waters_and_plants_on_the_way(tmp_path: Path) -> None:
    """The best plan known costs 87; a plan that serves one bed or seedling after another costs more than 140."""
    found = garden(tmp_path).plan()
    assert found.plan is not None
    assert validate(found.problem, found.plan) == []
    assert found.cost <= 95


def test_a_long_round_is_the_joint_refinement_of_all_steps_of_level_1(tmp_path: Path) -> None:
    plan = garden(tmp_path).plan().plan
    assert plan is not None
    assert {step.level for step in plan.steps} == {1}
    assert plan.length[1] == len(BEDS) + len(PLANTED)


@pytest.mark.parametrize(("scene", "most"), [("library-large", 36), ("canteen-large", 40), ("carts-large", 320)])
def test_a_vehicle_serves_several_objects_in_one_round(scene: str, most: int) -> None:
    assert confab.load(scene).plan().cost <= most


ROUND = """(define (domain round) (:requirements :strips :typing :derived-predicates :disjunctive-preconditions)
 (:types place)
 (:predicates (at ?p - place) (next ?p ?q - place) (one) (two) (three) (four) (lit) (open) (free) (way)
              (first ?p - place) (second ?p - place) (third ?p - place) (fourth ?p - place) (gate ?p - place))
 (:derived (way) (or (and (lit) (open)) (free)))
 (:action go :parameters (?p ?q - place) :precondition (and (at ?p) (next ?p ?q)) :effect (and (not (at ?p)) (at ?q)))
 (:action do1 :parameters (?p - place) :precondition (and (at ?p) (first ?p)) :effect (and (one) (open)))
 (:action do2 :parameters (?p - place) :precondition (and (at ?p) (second ?p)) :effect (and (two) (not (open))))
 (:action do3 :parameters (?p - place) :precondition (and (at ?p) (third ?p)) :effect (three))
 (:action do4 :parameters (?p - place) :precondition (and (at ?p) (fourth ?p)) :effect (four))
 (:action light :parameters () :precondition () :effect (lit))
 (:action unlock :parameters (?p - place) :precondition (and (at ?p) (gate ?p)) :effect (free)))"""


def test_known_connecting_steps_do_not_take_the_place_of_a_derived_goal() -> None:
    """The order that is cheapest for the other goals makes the derived goal false again."""
    places = [f"p{i}" for i in range(31)]
    ways = " ".join(f"(next {p} {q}) (next {q} {p})" for p, q in pairwise(places))
    text = f"""(define (problem p) (:domain round) (:objects {" ".join(places)} - place)
      (:init (at p0) {ways} (first p5) (second p10) (third p15) (fourth p20) (gate p30))
      (:goal (and (one) (two) (three) (four) (way))))"""
    problem = imported(parse(ROUND, text)).problem
    outcome = solve(Request(problem))
    assert outcome.plan is not None
    assert not validate(problem, outcome.plan)
