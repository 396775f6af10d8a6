"""Several steps of a level that are refined together: the checker, the planner, and the other modules that handle plans."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

import confab
from confab.planner.causal_links import NeedKind, purposes
from confab.planner.levels import levels_left
from confab.planner.plan import Plan, Step, renumbered
from confab.planner.solve import Mode
from confab.planner.validation import validate
from confab.reasoner.symbols import Fact, Symbol

LAUNDRY = """
@prefix : <https://example.org/laundry#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/laundry> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Cloth a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :IN, :CLEAN .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :IN .
:Shelf a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:Washer a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :in .
:in a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Cloth ; rdfs:range :IN .
:CLEAN a owl:Class, owl:NamedIndividual, c:SituationType .
:L1_CLEAN a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''
  DELETE { ?cloth :in ?from } INSERT { ?cloth :in ?shelf ; :CLEAN true }
  WHERE { ?cloth a :Cloth . ?shelf a :Shelf . ?cloth :in ?from ; :CLEAN false }''' .
:L2_CARRY a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:update '''
  DELETE { ?cloth :in ?from } INSERT { ?cloth :in ?to }
  WHERE { ?cloth a :Cloth . ?to a :Place . ?cloth :in ?from FILTER(?from != ?to) }''' .
:L2_WASH a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ; c:cost 5 ; c:update '''
  INSERT { :Cloth :CLEAN true } WHERE { ?washer a :Washer . :Cloth :in ?washer }''' .
:floor a :Place, owl:NamedIndividual . :shelf a :Shelf, owl:NamedIndividual . :washer a :Washer, owl:NamedIndividual .
:shirt a :Cloth, owl:NamedIndividual ; :in :floor . :sock a :Cloth, owl:NamedIndividual ; :in :floor .
[] a owl:AllDifferent ; owl:distinctMembers ( :floor :shelf :washer :shirt :sock ) .
:task a owl:NamedIndividual, c:Task ; c:goal :shirt.clean, :sock.clean, :shirt.in, :sock.in .
:shirt.clean a owl:NamedIndividual, c:ValueCondition ; c:situationType :CLEAN ; c:about :shirt .
:sock.clean a owl:NamedIndividual, c:ValueCondition ; c:situationType :CLEAN ; c:about :sock .
:shirt.in a owl:NamedIndividual, c:ValueCondition ; c:situationType :IN ; c:about :shirt ; c:value :shelf .
:sock.in a owl:NamedIndividual, c:ValueCondition ; c:situationType :IN ; c:about :sock ; c:value :shelf .
"""
"""Cloth is washed in a machine, which is a place that level 1 sees."""


@cache
def library() -> confab.Scene:
    return confab.load("library-small")


@cache
def tour() -> Plan:
    """Return the plan of one tour of the cart, in which three steps of level 1 are refined together."""
    return library().plan().plan


def node() -> Step:
    (only,) = tour().steps
    return only


def faults(step: Step) -> list[str]:
    return [fault.text for fault in validate(library().problem, Plan(renumbered((step,))))]


def bring(book: str, place: str) -> Step:
    arguments = (book, place)
    return Step((0,), library().problem.id_of("L1_BRING", arguments), 1, "L1_BRING", arguments)


def test_one_tour_with_all_books_is_the_refinement_of_all_steps_of_level_1() -> None:
    plan = tour()
    assert plan.length == {1: 3, 2: 10}
    assert len(plan) == 1
    assert {one.arguments for one in node().together} == {
        ("atlas", "shelf_a"),
        ("bible", "shelf_b"),
        ("comic", "shelf_a"),
    }
    assert validate(library().problem, plan) == []
    assert levels_left(library().problem, plan) == []
    assert plan.at_level(1) == node().together


@pytest.mark.parametrize(("mode", "leave_levels"), [("paper", True), ("guarded", False)], ids=["paper", "strict"])
def test_the_papers_mode_and_strict_levels_refine_each_step_alone(mode: Mode, leave_levels: bool) -> None:
    plan = library().plan(mode=mode, leave_levels=leave_levels).plan
    assert plan.length == {1: 3, 2: 17}
    assert not any(step.joined for step in plan.walk())


def test_steps_whose_joint_effect_differs_from_the_refinement_are_refused() -> None:
    fewer = replace(node(), joined=node().joined[:-1])
    assert any("its refinement leaves" in text for text in faults(fewer))
    elsewhere = replace(node(), joined=(*node().joined, bring("atlas", "shelf_b")))
    assert any("its refinement leaves <atlas, BOOK_AT>" in text for text in faults(elsewhere))


def test_rest_values_must_hold_at_the_end_of_a_joint_refinement_and_only_there() -> None:
    restless = replace(node(), steps=tuple(one for one in node().steps if one.behavior != "L2_SET"))
    (fault,) = faults(restless)
    assert "touches" in fault
    assert "at rest it is set" in fault


def test_each_step_must_be_applicable_after_the_steps_before_it() -> None:
    twice = replace(node(), joined=(*node().joined, bring("atlas", "shelf_a")))
    (fault,) = [text for text in faults(twice) if "preconditions" in text]
    assert "atlas shelf_a: its preconditions don't hold" in fault
    detour = replace(bring("atlas", "shelf_b"), steps=node().steps, joined=(bring("atlas", "shelf_a"), *rest_of_tour()))
    assert faults(detour) == []  # the order and the number of the steps don't matter, only their joint effect


def rest_of_tour() -> tuple[Step, ...]:
    return bring("bible", "shelf_b"), bring("comic", "shelf_a")


def test_steps_refined_together_have_one_level_and_common_steps_below() -> None:
    one = "steps that are refined together have one level"
    assert any(one in text for text in faults(replace(node(), steps=())))
    assert any(one in text for text in faults(replace(node(), joined=node().steps[:1])))
    wrong = replace(node(), joined=(replace(node().joined[0], id=999), *node().joined[1:]))
    assert any("its ID by the numbering of level 1" in text for text in faults(wrong))


def test_a_plan_with_steps_refined_together_is_written_and_read_as_it_is(tmp_path: Path) -> None:
    result = library().plan()
    path = result.save(tmp_path / "plan.json")
    assert library().read_plan(path) == result.plan


def test_every_step_of_a_joint_refinement_is_explained_and_named() -> None:
    plan, problem = tour(), library().problem
    purpose = purposes(problem, plan)[node().path]
    assert {change.fact for change in purpose.gives} == {
        Fact(Symbol("BOOK_AT", (book,)), place) for book, place in (one.arguments for one in node().together)
    }
    assert {need.kind for need in purpose.needs} == {NeedKind.GOAL}
    assert str(node()).count("L1_BRING") == 3
    assert [row["behavior"] for row in plan.to_records()].count("L1_BRING") == 3


def test_execution_recovers_from_an_intervention_within_a_joint_refinement() -> None:
    run = library().execute(plan=tour(), interventions="after=0.4 atlas BOOK_AT shelf_b")
    assert run.reached
    assert run.episode.replans


def test_a_joint_refinement_teaches_its_steps_and_no_method() -> None:
    memory = confab.Memory.of(library())
    memory.learn(library(), tour())
    again = library().plan(memory=memory)
    assert validate(library().problem, again.plan) == []
    assert again.plan.length[2] == 10


def test_a_large_library_needs_no_more_tours_than_the_capacity_of_the_cart_requires() -> None:
    plan = confab.load("library-large").plan().plan
    assert plan.length[1] == 12
    assert plan.length[2] <= 45


@pytest.mark.parametrize(("scene", "most"), [("centrifuge", 15), ("two-tables", 26), ("three-cups", 18)])
def test_a_change_that_each_refinement_would_undo_is_made_once_for_several_steps(scene: str, most: int) -> None:
    plan = confab.load(scene).plan().plan
    assert len(plan.primitives) <= most
    assert any(step.joined for step in plan.steps)


def test_things_that_one_step_of_a_lower_level_washes_together_are_cleaned_by_steps_refined_together(
    tmp_path: Path,
) -> None:
    (tmp_path / "laundry.ttl").write_text(LAUNDRY, "utf-8")
    plan = confab.load(tmp_path / "laundry.ttl").plan().plan
    assert plan.length == {1: 2, 2: 5}
    (node,) = plan.steps
    assert [step.behavior for step in node.together] == ["L1_CLEAN", "L1_CLEAN"]


def test_a_cup_is_not_filled_before_it_is_moved_where_level_1_moves_no_filled_cup() -> None:
    scene = confab.load("beverage-serving")
    plan = scene.plan(["cup1 LOCATION location7", "cup1 BEVERAGE beverage1"]).plan
    moved, filled = (
        next(i for i, s in enumerate(plan.primitives) if s.behavior == name) for name in ("B3_PUT_DOWN", "B3_TILT")
    )
    assert moved < filled


STATIONS = """
@prefix : <https://example.org/stations#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/stations> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Item a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT, :WASHED, :DRIED .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :AT, :ROBOT_AT .
:Rack a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:Sink a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:Dryer a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :Place .
:Robot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :AT ; c:hasSituationType :ROBOT_AT .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at .
:at a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Item ; rdfs:range :AT .
:ROBOT_AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :robotAt ; c:fromLevel 2 .
:robotAt a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Robot ; rdfs:range :ROBOT_AT .
:WASHED a owl:Class, owl:NamedIndividual, c:SituationType .
:DRIED a owl:Class, owl:NamedIndividual, c:SituationType .
:L1_WASH a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''
  INSERT { ?item :WASHED true } WHERE { ?item a :Item ; :at ?home . ?home a :Rack }''' .
:L1_DRY a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:update '''
  INSERT { ?item :DRIED true } WHERE { ?item a :Item ; :WASHED true ; :at ?home . ?home a :Rack }''' .
:L1_STORE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; c:update '''
  DELETE { ?item :at ?from } INSERT { ?item :at ?to }
  WHERE { ?item a :Item . ?to a :Place . ?item :DRIED true ; :at ?from . ?from a :Rack FILTER(?from != ?to) }''' .
:L2_GO a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:update '''
  DELETE { ?robot :robotAt ?from } INSERT { ?robot :robotAt ?to }
  WHERE { ?robot a :Robot . ?to a :Place . ?robot :robotAt ?from FILTER(?from != ?to) }''' .
:L2_TAKE a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ; c:update '''
  DELETE { ?item :at ?place } INSERT { ?item :at ?robot }
  WHERE { ?robot a :Robot . ?item a :Item ; :at ?place . ?place a :Place . ?robot :robotAt ?place
    FILTER NOT EXISTS { ?other a :Item ; :at ?robot } }''' .
:L2_PUT a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 3 ; c:update '''
  DELETE { ?item :at ?robot } INSERT { ?item :at ?place }
  WHERE { ?item a :Item ; :at ?robot . ?robot a :Robot ; :robotAt ?place . ?place a :Place }''' .
:L2_WASH a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 4 ; c:update '''
  INSERT { ?item :WASHED true } WHERE { ?item a :Item ; :at ?sink . ?sink a :Sink }''' .
:L2_DRY a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 5 ; c:update '''
  INSERT { ?item :DRIED true } WHERE { ?item a :Item ; :WASHED true ; :at ?dryer . ?dryer a :Dryer }''' .
:cup a owl:NamedIndividual, :Item ; c:index 1 ; :at :rack .
:robot a owl:NamedIndividual, :Robot ; c:index 2 ; c:fromLevel 2 ; :robotAt :rack .
:rack a owl:NamedIndividual, :Rack ; c:index 3 .
:sink a owl:NamedIndividual, :Sink ; c:index 4 .
:dryer a owl:NamedIndividual, :Dryer ; c:index 5 .
:shelf a owl:NamedIndividual, :Place ; c:index 6 .
[ a owl:AllDifferent ; owl:distinctMembers ( :cup :dryer :rack :robot :shelf :sink ) ] .
:task a owl:NamedIndividual, c:Task ; c:goal :task.washed, :task.dried, :task.stored .
:task.washed a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:situationType :WASHED .
:task.dried a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:situationType :DRIED .
:task.stored a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:situationType :AT ; c:value :shelf .
"""
"""On level 1, an item is washed, dried and stored from a rack; level 1 also sees the stations of each refinement."""


def test_an_item_goes_from_station_to_station_if_level_1_takes_each_step_from_its_rack(tmp_path: Path) -> None:
    (tmp_path / "stations.ttl").write_text(STATIONS, "utf-8")
    scene = confab.load(tmp_path / "stations.ttl")
    result = scene.plan()
    assert result.plan.length == {1: 3, 2: 11}
    assert not result.faults(result.plan)
    assert sum(len(node.together) == 3 for node in result.plan) == 1
