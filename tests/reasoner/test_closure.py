"""The part that is read is closed: it contains all individuals that a step requires or changes, or that could make a step invalid.

There is one world for each kind of condition and effect.
"""

from pathlib import Path

import pytest

from confab.reasoner.graph.knowledge import load
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.relevance import recognise
from tests.reasoner.test_recognition import solvable
from tests.reasoner.worlds import HEAD, graph_of

THINGS = """
w:s0 a owl:NamedIndividual, w:Spot .
w:s1 a owl:NamedIndividual, w:Spot .
w:x a owl:NamedIndividual, w:Thing ; w:at w:nowhere .
w:y a owl:NamedIndividual, w:Tool ; w:at w:nowhere .
w:task a owl:NamedIndividual, :Task ; :goal w:task.g .
w:task.g a owl:NamedIndividual, :ValueCondition ; :about w:x ; :situationType w:COLOR ; :value w:blue .
w:DYE a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:DYE.x ; :postcondition w:DYE.blue .
w:DYE.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
w:DYE.blue a owl:NamedIndividual, :ValueEffect ; :about w:DYE.x ; :situationType w:COLOR ; :value w:blue .
"""
WORLDS = {
    "the bounds of an amount that an effect changes for a whole class": (
        """
        w:y w:fill 0 .
        w:DYE :postcondition w:DYE.use .
        w:DYE.use a owl:NamedIndividual, :AmountEffect ; :about w:Thing ; :situationType w:FILL ; :change "decrease" ; :amount 1 .
        """,
        False,
    ),
    "the bounds of an amount of those of a class of which a condition holds": (
        """
        w:y w:fill 0 ; w:touches w:s0 .
        w:DYE :postcondition w:DYE.use .
        w:DYE.use a owl:NamedIndividual, :AmountEffect ; :about w:Tool ; :situationType w:FILL ; :change "decrease" ; :amount 1 ;
          :when w:DYE.there .
        w:DYE.there a owl:NamedIndividual, :ValueCondition ; :about w:Tool ; :situationType w:TOUCHES ; :value w:s0 .
        """,
        False,
    ),
    "a parameter that only another effect names": (
        """
        w:DYE :parameter w:DYE.y ; :postcondition w:DYE.other .
        w:DYE.y a owl:NamedIndividual, :Parameter ; :index 2 ; :termType w:Tool .
        w:DYE.other a owl:NamedIndividual, :ValueEffect ; :about w:DYE.y ; :situationType w:AT ; :value w:nowhere .
        """,
        True,
    ),
    "what a static relation relates to a constant, where that must not be": (
        """
        w:y w:fits w:s0 .
        w:DYE :precondition w:DYE.none .
        w:DYE.none a owl:NamedIndividual, :Witness ; :witness w:DYE.w ; :condition w:DYE.fits ; :negated true .
        w:DYE.w a owl:NamedIndividual, :Variable ; :termType w:Tool .
        w:DYE.fits a owl:NamedIndividual, :RelationCondition ; :about w:DYE.w ; :relation w:fits ; :value w:s0 .
        """,
        False,
    ),
    "a fact of three individuals with a constant, where that must not be": (
        """
        w:lent a owl:NamedIndividual, :SituatedObjectInstance ; :situationType w:LENT ; :about w:y ; :argument2 w:y ;
          :argument3 w:s0 ; :value :true .
        w:DYE :precondition w:DYE.none .
        w:DYE.none a owl:NamedIndividual, :Witness ; :witness w:DYE.w ; :condition w:DYE.lent ; :negated true .
        w:DYE.w a owl:NamedIndividual, :Variable ; :termType w:Tool .
        w:DYE.lent a owl:NamedIndividual, :ValueCondition ; :about w:DYE.w ; :argument2 w:DYE.w ; :argument3 w:s0 ;
          :situationType w:LENT .
        """,
        False,
    ),
    "what a pair comes to hold of by an earlier step": (
        """
        w:DYE :precondition w:DYE.some .
        w:DYE.some a owl:NamedIndividual, :Witness ; :witness w:DYE.w ; :condition w:DYE.touches .
        w:DYE.w a owl:NamedIndividual, :Variable ; :termType w:Spot .
        w:DYE.touches a owl:NamedIndividual, :ValueCondition ; :about w:DYE.x ; :situationType w:TOUCHES ; :value w:DYE.w .
        w:GO a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:GO.x, w:GO.to ; :postcondition w:GO.there .
        w:GO.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
        w:GO.to a owl:NamedIndividual, :Parameter ; :index 2 ; :termType w:Spot .
        w:GO.there a owl:NamedIndividual, :ValueEffect ; :about w:GO.x ; :situationType w:TOUCHES ; :value w:GO.to .
        """,
        True,
    ),
    "a fact of three individuals that an earlier step makes true": (
        """
        w:DYE :precondition w:DYE.some .
        w:DYE.some a owl:NamedIndividual, :Witness ; :witness w:DYE.w ; :condition w:DYE.lent .
        w:DYE.w a owl:NamedIndividual, :Variable ; :termType w:Tool .
        w:DYE.lent a owl:NamedIndividual, :ValueCondition ; :about w:DYE.x ; :argument2 w:DYE.w ; :argument3 w:s0 ;
          :situationType w:LENT .
        w:LEND a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:LEND.x, w:LEND.y ; :postcondition w:LEND.done .
        w:LEND.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
        w:LEND.y a owl:NamedIndividual, :Parameter ; :index 2 ; :termType w:Tool .
        w:LEND.done a owl:NamedIndividual, :ValueEffect ; :about w:LEND.x ; :argument2 w:LEND.y ; :argument3 w:s0 ;
          :situationType w:LENT ; :value :true .
        """,
        True,
    ),
}


@pytest.mark.parametrize("what", WORLDS)
def test_the_slice_is_solvable_exactly_if_the_world_is(tmp_path: Path, what: str) -> None:
    text, expected = WORLDS[what]
    graph = graph_of(HEAD + THINGS + text, tmp_path)
    assert solvable(read(graph).problem, 100) is expected
    assert solvable(recognise(graph).problem, 100) is expected


def test_individuals_that_no_step_requires_or_changes_are_left_out_of_the_slice(tmp_path: Path) -> None:
    sliced = recognise(graph_of(HEAD + THINGS, tmp_path)).problem
    assert sliced.classes["Thing"] == ("x",)
    assert sliced.classes["Spot"] == ()


def test_a_class_without_named_individuals_changes_no_name(tmp_path: Path) -> None:
    more = (
        "<https://example.org/other#x> a owl:Class . <https://example.org/other#one> a <https://example.org/other#x> ."
    )
    graph = graph_of(f"@prefix other: <https://example.org/other#> .{HEAD}{THINGS}{more}", tmp_path)
    iri = "https://example.org/world#x"
    assert recognise(graph).names.short(iri) == read(graph).names.short(iri) == "x"


def test_a_situation_type_without_values_in_the_slice_does_not_become_boolean() -> None:
    path = Path(__file__).parents[1] / "planner/cases/values-outside-of-the-slice.ttl"
    slice_, whole = recognise(load(path)).problem, read(load(path)).problem
    assert "F0v0" not in slice_.classes.get("F0", ())
    assert {name: s.boolean for name, s in slice_.domain.situations.items()} == {
        name: s.boolean for name, s in whole.domain.situations.items()
    }
