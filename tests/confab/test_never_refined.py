"""A behaviour that can occur in no plan is an error of `plan` at once, in every mode, with its name, its level and the remedy."""

from pathlib import Path

import pytest

import confab
from confab.planner.plan import Status
from confab.reasoner.graph.knowledge import KnowledgeError
from tests.reasoner.worlds import HEAD

WORLD = """
w:x a owl:NamedIndividual, w:Thing ; w:at w:nowhere .
w:s0 a owl:NamedIndividual, w:Spot .
w:task a owl:NamedIndividual, :Task ; :goal w:task.g .
w:task.g a owl:NamedIndividual, :ValueCondition ; :about w:x ; :situationType w:COLOR ; :value w:blue .
w:DYE a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:DYE.x ; :postcondition w:DYE.blue .
w:DYE.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
w:DYE.blue a owl:NamedIndividual, :ValueEffect ; :about w:DYE.x ; :situationType w:COLOR ; :value w:blue .
w:DIP a owl:NamedIndividual, :Behavior ; :level 2 ; :parameter w:DIP.x ; :postcondition w:DIP.done .
w:DIP.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
w:WET a owl:Class, owl:NamedIndividual, :SituationType ; :fromLevel 2 ; :restValue :false .
w:Thing :hasSituationType w:WET .
"""
DIPPED = "w:DIP.done a owl:NamedIndividual, :ValueEffect ; :about w:DIP.x ; :situationType w:WET ; :value :true .\n"
DYED = "w:DIP.done a owl:NamedIndividual, :ValueEffect ; :about w:DIP.x ; :situationType w:COLOR ; :value w:blue .\n"
WETTED = "w:DIP :postcondition w:DIP.wet .\nw:DIP.wet" + DIPPED.removeprefix("w:DIP.done")
DRIED = """
w:DRY a owl:NamedIndividual, :Behavior ; :level 2 ; :parameter w:DRY.x ; :postcondition w:DRY.done .
w:DRY.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
w:DRY.done a owl:NamedIndividual, :ValueEffect ; :about w:DRY.x ; :situationType w:WET ; :value :false .
"""
MODES = pytest.mark.parametrize(
    "options", [{}, {"leave_levels": False}, {"mode": "optimal"}, {"mode": "paper"}], ids=lambda o: str([*o.values()])
)


def scene(folder: Path, *texts: str) -> confab.Scene:
    (folder / "world.ttl").write_text(HEAD + WORLD + "".join(texts), encoding="utf-8")
    return confab.load(folder / "world.ttl")


@MODES
def test_a_behaviour_whose_effect_no_lower_level_achieves_is_an_error(
    tmp_path: Path, options: dict[str, object]
) -> None:
    with pytest.raises(
        KnowledgeError, match=r"DYE of level 1 can never be refined: it makes COLOR blue.*from level 2 on"
    ):
        scene(tmp_path, DIPPED).plan(**options)  # type: ignore[arg-type]


@MODES
def test_a_behaviour_whose_rest_value_no_behaviour_restores_is_an_error(
    tmp_path: Path, options: dict[str, object]
) -> None:
    with pytest.raises(
        KnowledgeError, match=r"DIP of level 2 can be in no plan: it makes WET true.*level 2.*back to false"
    ):
        scene(tmp_path, DYED, WETTED).plan(**options)  # type: ignore[arg-type]


@MODES
def test_a_behaviour_whose_rest_value_is_restored_is_planned(tmp_path: Path, options: dict[str, object]) -> None:
    assert [step.behavior for step in scene(tmp_path, DYED, WETTED, DRIED).plan(**options).plan.primitives] == [  # type: ignore[arg-type]
        "DIP",
        "DRY",
    ]


def test_a_goal_may_require_another_value_than_the_rest_value(tmp_path: Path) -> None:
    """Only planning can tell whether a goal that isn't at rest is reachable; a goal need not have its rest value."""
    assert scene(tmp_path, DYED, WETTED).plan(["x WET true"]).outcome.status is Status.SOLVED


def test_a_behaviour_that_the_task_cannot_need_is_no_error(tmp_path: Path) -> None:
    unneeded = """
    w:GO a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:GO.x ; :postcondition w:GO.there .
    w:GO.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
    w:GO.there a owl:NamedIndividual, :ValueEffect ; :about w:GO.x ; :situationType w:AT ; :value w:s0 .
    """
    assert scene(tmp_path, DYED, unneeded).plan().outcome.status is Status.SOLVED


@MODES
def test_a_task_is_planned_without_a_behaviour_that_can_be_in_no_plan(
    tmp_path: Path, options: dict[str, object]
) -> None:
    """No behaviour refines DYE where FADE was executed; PAINT has the effect that the goal requires."""
    stain = """
    w:STAIN a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:STAIN.x ; :postcondition w:STAIN.blue, w:STAIN.there .
    w:STAIN.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
    w:STAIN.blue a owl:NamedIndividual, :ValueEffect ; :about w:STAIN.x ; :situationType w:COLOR ; :value w:blue .
    w:STAIN.there a owl:NamedIndividual, :ValueEffect ; :about w:STAIN.x ; :situationType w:AT ; :value w:s0 .
    """
    plan = scene(tmp_path, DYED, stain).plan(**options).plan  # type: ignore[arg-type]
    assert [step.behavior for step in plan.primitives] == ["DIP"]


def test_a_rest_value_of_a_derived_situation_type_is_an_error(tmp_path: Path) -> None:
    derived = """
w:DAMP a owl:Class, owl:NamedIndividual, :SituationType ; :fromLevel 2 ; :restValue :false .
w:Thing :hasSituationType w:DAMP .
w:DAMP.rule a owl:NamedIndividual, :Rule ; :construct "CONSTRUCT { ?x w:DAMP true } WHERE { ?x a w:Thing . ?x w:WET true }" .
"""
    with pytest.raises(KnowledgeError, match=r"DAMP is derived, and has a c:restValue.*its rules read"):
        scene(tmp_path, DYED, WETTED, DRIED, derived).plan()


@MODES
def test_a_behaviour_that_can_be_in_no_plan_is_no_error_if_a_plan_may_leave_the_goal(
    tmp_path: Path, options: dict[str, object]
) -> None:
    weight = "w:task.g :weight 3.0 .\n"
    found = scene(tmp_path, DIPPED, weight).plan(**options)  # type: ignore[arg-type]
    assert found.outcome.status is Status.SOLVED
    assert found.plan.steps == ()
