"""Conditions are tested in an order in which each variable is bound before its use, whatever the written order."""

from itertools import permutations

import pytest

from confab.planner.paper.transitions import Model
from confab.reasoner.language import DomainError
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    AnyOf,
    Behavior,
    Condition,
    GroundBehavior,
    Parameter,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)

AT = SituationType("AT", ("Thing",), "Place")
CLASSES = {"Thing": ("box", "lid"), "Place": ("shelf", "table")}
HERE = ValueCondition("AT", ("?thing",), "?here")
ALONE = Witness(
    "?other", "Thing", (ValueCondition("AT", ("?other",), "?here"), ValueCondition("AT", ("?other",), "table")), True
)
EITHER = AnyOf(((ValueCondition("AT", ("lid",), "?here"),), (ValueCondition("AT", ("box",), "?here"),)))


def model(conditions: tuple[Condition, ...], box: str) -> Model:
    behavior = Behavior(
        "GO",
        1,
        (Parameter("?thing", "Thing"),),
        (Parameter("?here", "Place"),),
        conditions,
        (ValueEffect("AT", ("?thing",), "table"),),
    )
    initial = {Symbol("AT", ("box",)): box, Symbol("AT", ("lid",)): "shelf"}
    return Model(Problem("toy", Domain({"AT": AT}, {"GO": behavior}), CLASSES, {}, initial, {}))


@pytest.mark.parametrize("conditions", list(permutations((HERE, ALONE, EITHER))))
@pytest.mark.parametrize(("box", "applicable"), [("shelf", True), ("table", False)])
def test_a_nested_condition_is_evaluated_after_the_conditions_that_bind_its_variables(
    conditions: tuple[Condition, ...], box: str, applicable: bool
) -> None:
    toy = model(conditions, box)
    applied = toy.apply(GroundBehavior(0, "GO", ("box",)), toy.values(toy.problem.initial))
    assert (applied is not None) is applicable


def test_a_variable_that_no_condition_determines_is_named() -> None:
    with pytest.raises(DomainError, match=r"GO: nothing determines \?here"):
        model((ValueCondition("AT", ("?thing",), "?here", negated=True),), "shelf")
