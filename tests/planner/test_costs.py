"""Costs of behaviours are calculated from relations and amounts: every evaluator agrees, and cheapest plans are cheapest."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

import confab
from confab.planner.plan import Limits, Status
from confab.planner.plan_costs import cost_of
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import load
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import TRUE, RelationCondition, SituationType
from worlds.numbers import jugs, rounds
from worlds.writing import becomes, behavior, has, lacks, world


@pytest.mark.parametrize("make", [jugs, rounds])
@pytest.mark.parametrize("seed", range(10))
def test_a_plan_that_is_reported_as_cheapest_is_cheapest(
    seed: int, make: Callable[[Random], tuple[Problem, Fraction | None]]
) -> None:
    problem, least = make(Random(seed))
    found = solve(Request(problem, "optimal", Limits(1_000_000, 30.0)))
    if least is None:
        assert found.status is Status.UNSOLVABLE
        return
    assert found.plan is not None
    assert validate(problem, found.plan) == []
    assert found.bound == least == cost_of(problem, found.plan)


def tour(stops: int) -> Problem:
    """Return a tour of stops: a walk to the next stop costs 4, a ride 0.5, and a ticket for all rides, sold at one stop, 5."""
    names = tuple(f"stop{i}" for i in range(stops))
    here, there, joined = (
        has("AT", "me", "?from"),
        becomes("AT", "me", "?to"),
        RelationCondition("street", ("?from", "?to")),
    )
    walk = behavior("WALK", 1, "?to:Stop", [here, joined], [there], "?from:Stop")
    ride = behavior("RIDE", 1, "?to:Stop", [here, joined, has("PAID", "me", TRUE)], [there], "?from:Stop")
    buy = behavior("BUY", 1, "", [has("AT", "me", "stop2"), lacks("PAID", "me", TRUE)], [becomes("PAID", "me", TRUE)])
    look = behavior("LOOK", 1, "?at:Stop", [has("AT", "me", "?at")], [becomes("SEEN", "?at", TRUE)])
    return world(
        [
            SituationType("AT", ("Me",), "Stop"),
            SituationType("SEEN", ("Stop",), "Truth", boolean=True),
            SituationType("PAID", ("Me",), "Truth", boolean=True),
        ],
        [replace(walk, cost=4.0), replace(ride, cost=0.5), replace(buy, cost=5.0), look],
        {"Stop": names, "Me": ("me",)},
        {"AT me": "stop0"},
        {f"SEEN {name}": TRUE for name in names},
        {"street": [pair for i in range(stops) for pair in ((names[i - 1], names[i]), (names[i], names[i - 1]))]},
    )


def lift(ways: list[tuple[int, int]], floors: int) -> Problem:
    """Return a lift between floors; level 1 sees that people enter and leave, but doesn't see the motion of the lift."""
    people, names = tuple(f"person{i}" for i in range(len(ways))), tuple(f"floor{i}" for i in range(floors))
    inside, entered, left = has("IN", "?p", "lift"), becomes("IN", "?p", "lift"), becomes("IN", "?p", "?f")
    waits, there = has("IN", "?p", "?f"), has("LIFT_AT", "lift", "?f")
    steps = [
        behavior("L1_ENTER", 1, "?p:Person", [waits], [entered], "?f:Floor"),
        behavior("L1_LEAVE", 1, "?p:Person ?f:Floor", [inside], [left]),
        behavior("L2_ENTER", 2, "?p:Person", [waits, there], [entered], "?f:Floor"),
        behavior("L2_LEAVE", 2, "?p:Person ?f:Floor", [inside, there], [left]),
        behavior(
            "L2_GO", 2, "?to:Floor", [there, RelationCondition("next", ("?f", "?to"))],
            [becomes("LIFT_AT", "lift", "?to")], "?f:Floor",
        ),
    ]  # fmt: skip
    return world(
        [SituationType("IN", ("Person",), "Holder"), SituationType("LIFT_AT", ("Lift",), "Floor", level=2)],
        steps,
        {"Person": people, "Floor": names, "Lift": ("lift",), "Holder": ("lift", *names)},
        {"LIFT_AT lift": "floor0", **{f"IN {one}": names[begin] for one, (begin, _) in zip(people, ways, strict=True)}},
        {f"IN {one}": names[end] for one, (_, end) in zip(people, ways, strict=True)},
        {"next": [pair for i in range(1, floors) for pair in ((names[i - 1], names[i]), (names[i], names[i - 1]))]},
    )


def test_a_default_plan_buys_an_object_that_makes_later_steps_cheaper() -> None:
    problem = tour(9)
    outcome = solve(Request(problem))
    assert outcome.plan is not None
    assert outcome.bound == 9, "each stop is looked at"
    found = outcome.plan
    assert {"BUY", "RIDE"} <= {step.behavior for step in found.steps}
    assert cost_of(problem, found) == 2 * 4 + 5 + 6 * 0.5 + 9


def test_a_default_plan_transports_all_people_in_one_round() -> None:
    """Up and down once: twice five floors, and each of six people enters and leaves."""
    found = solve(Request(lift([(0, 4), (2, 5), (1, 3), (5, 1), (4, 0), (3, 2)], 6)))
    assert found.plan is not None
    assert found.plan.length == {1: 12, 2: 22}


DELIVERY = """@prefix : <https://example.org/van#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/van> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Van a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT, :LOAD .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :AT .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at . :at a owl:ObjectProperty, owl:FunctionalProperty .
:LOAD a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :load ; c:leastAmount 0.0 .
:load a owl:DatatypeProperty, owl:FunctionalProperty ; rdfs:domain :Van ; rdfs:range xsd:decimal .
:WAY a owl:NamedIndividual, c:Relation ; c:parameter :WAY.from, :WAY.to .
:WAY.from a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Place .
:WAY.to a owl:NamedIndividual, c:Parameter ; c:index 2 ; c:termType :Place .
:DRIVE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:price :DRIVE.fare ;
  c:update "INSERT { ?van :at ?to } WHERE { ?van a :Van . ?to a :Place . ?van :at ?from FILTER(?from != ?to) }" .
:DRIVE.fare a owl:NamedIndividual, c:Calculation ; c:sign "*" ; c:left :DRIVE.way ; c:right :DRIVE.heavy .
:DRIVE.way a owl:NamedIndividual, c:Calculation ; c:relation :WAY ; c:about :DRIVE.from ; c:argument2 :DRIVE.to .
:DRIVE.heavy a owl:NamedIndividual, c:Calculation ; c:sign "+" ; c:about :DRIVE.van ; c:situationType :LOAD ; c:amount 1.0 .
:UNLOAD a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:cost 4.0 ;
  c:update "DELETE { ?van :load ?n } INSERT { ?van :load 0.0 } WHERE { ?van a :Van . ?van :load ?n }" .
:van1 a owl:NamedIndividual, :Van ; c:index 1 ; :at :yard ; :load 2.0 .
:yard a owl:NamedIndividual, :Place ; c:index 2 . :north a owl:NamedIndividual, :Place ; c:index 3 .
:south a owl:NamedIndividual, :Place ; c:index 4 .
[ a owl:AllDifferent ; owl:distinctMembers ( :van1 :yard :north :south ) ] .
:w1 a owl:NamedIndividual, c:SituatedObjectInstance ; c:relation :WAY ; c:about :yard ; c:argument2 :north ; c:amount 3.0 .
:w2 a owl:NamedIndividual, c:SituatedObjectInstance ; c:relation :WAY ; c:about :north ; c:argument2 :south ; c:amount 1.0 .
:w3 a owl:NamedIndividual, c:SituatedObjectInstance ; c:relation :WAY ; c:about :yard ; c:argument2 :south ; c:amount 5.0 .
:task a owl:NamedIndividual, c:Task ; c:goal :there .
:there a owl:NamedIndividual, c:ValueCondition ; c:about :van1 ; c:situationType :AT ; c:value :south .
"""


def test_a_price_in_turtle_leads_to_the_cheapest_plan_and_is_printed(tmp_path: Path) -> None:
    path = tmp_path / "van.ttl"
    path.write_text(DELIVERY)
    found = confab.load(path).plan(optimal=True)
    assert found.outcome.plan is not None
    assert [step.behavior for step in found.outcome.plan.steps] == ["UNLOAD", "DRIVE", "DRIVE"]  # 4 + 3 + 1, not 3 * 5
    assert (found.outcome.cost, found.json()["cost"], found.json()["bound"]) == (8.0, 8.0, 8.0)
    assert "costs 8, proved cheapest on the lowest level" in str(found)
    assert confab.load(path).plan(mode="paper").outcome.cost == 8.0


def test_a_behaviour_with_a_cost_and_a_price_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "van.ttl"
    path.write_text(DELIVERY.replace("c:price :DRIVE.fare", "c:price :DRIVE.fare ; c:cost 1.0"))
    with pytest.raises(confab.KnowledgeError, match="DRIVE> has a c:cost and a c:price; keep one of them"):
        confab.load(path).plan()


def test_a_price_that_depends_on_changing_values_survives_pddl_and_turtle(tmp_path: Path) -> None:
    """Functions have typed arguments: otherwise each place would need a load."""
    path = tmp_path / "van.ttl"
    path.write_text(DELIVERY)
    exported = to_pddl(read(load(path)).problem)
    again = tmp_path / "again.ttl"
    found = imported(parse(exported.domain, exported.problem))
    again.write_text(turtle(found.problem, "van", "a van", found.said))
    assert confab.load(again).plan(optimal=True).outcome.cost == 8.0


def test_a_cheaper_plan_with_amounts_keeps_the_steps_of_level_1() -> None:
    plan = confab.load("carts-small").plan()
    assert (plan.cost, plan.plan.length) == (34.0, {1: 5, 2: 7})
