"""A goal releases the symbols that it is about, directly or by a definition, from their rest values."""

from __future__ import annotations

from pathlib import Path

import pytest

import confab
from confab.planner.solve import Mode
from confab.planner.validation import validate

BOXES = """
@prefix : <https://example.org/w#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/w> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Box a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :LID, :FREE .
:LID a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :lid ; c:restValue :shut .
:lid a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Box ; rdfs:range :LID .
:shut a owl:NamedIndividual, :LID . :open a owl:NamedIndividual, :LID . :ajar a owl:NamedIndividual, :LID .
:FREE a owl:Class, owl:NamedIndividual, c:SituationType .
:FREE.rule a owl:NamedIndividual, c:Rule ; c:construct "CONSTRUCT { ?b :FREE true } WHERE { ?b a :Box ; :lid :open }" .
:SET a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update \"\"\"
  INSERT { ?b :lid ?v } WHERE { ?b a :Box . ?v a :LID . ?b :lid ?old FILTER(?old != ?v) }\"\"\" .
:box1 a owl:NamedIndividual, :Box ; c:index 1 ; :lid :shut .
:box2 a owl:NamedIndividual, :Box ; c:index 2 ; :lid :shut .
:open1 a owl:NamedIndividual, c:ValueCondition ; c:about :box1 ; c:situationType :LID ; c:value :open .
:ajar1 a owl:NamedIndividual, c:ValueCondition ; c:about :box1 ; c:situationType :LID ; c:value :ajar .
:shut1 a owl:NamedIndividual, c:ValueCondition ; c:about :box1 ; c:situationType :LID ; c:value :shut ; c:negated true .
:free1 a owl:NamedIndividual, c:ValueCondition ; c:about :box1 ; c:situationType :FREE .
:free2 a owl:NamedIndividual, c:ValueCondition ; c:about :box2 ; c:situationType :FREE .
:either a owl:NamedIndividual, c:AnyOf ; c:alternative :open1, :ajar1 .
:some a owl:NamedIndividual, c:Witness ; c:witness :x ; c:condition :openx .
:x a owl:NamedIndividual, c:Variable ; c:termType :Box .
:openx a owl:NamedIndividual, c:ValueCondition ; c:about :x ; c:situationType :LID ; c:value :open .
:task a owl:NamedIndividual, c:Task ; c:goal GOALS .
"""


def boxes(folder: Path, goals: str) -> confab.Scene:
    (folder / "w.ttl").write_text(BOXES.replace("GOALS", goals), encoding="utf-8")
    return confab.load(folder / "w.ttl")


@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
@pytest.mark.parametrize("goal", [":shut1", ":either", ":some", ":free1"])
def test_a_goal_of_any_form_releases_what_it_is_about(tmp_path: Path, goal: str, mode: Mode) -> None:
    scene = boxes(tmp_path, goal)
    found = scene.plan(mode=mode, engine="none").outcome
    assert found.plan is not None and found.plan.length == {1: 1}
    assert validate(scene.problem, found.plan) == []


def test_symbols_that_no_goal_is_about_return_to_rest(tmp_path: Path) -> None:
    both = boxes(tmp_path, ":free1, :free2").plan().outcome.plan
    assert both is not None and both.length == {1: 2}
    assert "box1" in str(validate(boxes(tmp_path, ":free2").problem, both))
    assert validate(boxes(tmp_path, ":some").problem, both) == []


@pytest.mark.parametrize(("weights", "value"), [((3, 9), "ajar"), ((9, 3), "open")])
def test_of_two_soft_goals_about_one_symbol_the_greater_weight_wins(
    tmp_path: Path, weights: tuple[int, int], value: str
) -> None:
    scene = boxes(tmp_path, f":open1, :ajar1 . :open1 c:weight {weights[0]}.0 . :ajar1 c:weight {weights[1]}.0")
    found = scene.plan(optimal=True).outcome
    assert found.proved and (found.total, found.bound) == (4.0, 4.0)
    assert found.plan is not None and found.plan.steps[0].arguments == ("box1", value)


@pytest.mark.parametrize("goal", [":either", ":some", ":free1"])
def test_a_goal_may_use_a_behaviour_whose_change_no_behaviour_takes_back(tmp_path: Path, goal: str) -> None:
    text = BOXES.replace("GOALS", goal).replace("FILTER(?old != ?v)", "FILTER(?old != ?v && ?v != :shut)")
    (tmp_path / "w.ttl").write_text(text, encoding="utf-8")
    found = confab.load(tmp_path / "w.ttl").plan(optimal=True).outcome
    assert found.proved and found.bound == 1.0


NEIGHBOURS = """
:NEXT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :next .
:Box rdfs:subClassOf :NEXT ; c:hasSituationType :NEXT .
:next a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Box ; rdfs:range :NEXT .
:box1 :next :box2 . :box2 :next :box1 .
:beside a owl:NamedIndividual, c:AllOf ; c:condition :next1, :openy ; c:weight 5.0 .
:y a owl:NamedIndividual, c:Variable ; c:termType :Box .
:next1 a owl:NamedIndividual, c:ValueCondition ; c:about :box1 ; c:situationType :NEXT ; c:value :y .
:openy a owl:NamedIndividual, c:ValueCondition ; c:about :y ; c:situationType :LID ; c:value :open .
:beside2 a owl:NamedIndividual, c:Witness ; c:witness :z ; c:condition :same, :nextz, :openy .
:z a owl:NamedIndividual, c:Variable ; c:termType :Box .
:nextz a owl:NamedIndividual, c:ValueCondition ; c:about :z ; c:situationType :NEXT ; c:value :y .
:same a owl:NamedIndividual, c:EqualityCondition ; c:about :z ; c:value :box1 .
"""


@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
@pytest.mark.parametrize("goal", [":beside", ":beside2"])
def test_a_goal_may_be_about_an_individual_that_its_conditions_determine(tmp_path: Path, goal: str, mode: Mode) -> None:
    (tmp_path / "w.ttl").write_text(BOXES.replace("GOALS", goal) + NEIGHBOURS, encoding="utf-8")
    found = confab.load(tmp_path / "w.ttl").plan(mode=mode, engine="none").outcome
    assert found.plan is not None
    assert [step.arguments for step in found.plan.steps] == [("box2", "open")]
