"""Goals that aren't facts: alternatives, quantified goals, comparisons of two amounts, and goals on a maximum."""

from pathlib import Path

import pytest

import confab
from confab import ontology
from confab.planner.plan import Status
from confab.planner.validation import validate
from confab.reasoner.symbols import TRUE, Symbol

SCENE = (ontology.ROOT / "scenes" / "carts-small.ttl").read_text("utf-8")
GOALS = {
    "either": (
        """:order.either a owl:NamedIndividual, c:AnyOf ; c:alternative :order.a, :order.b .
:order.a a owl:NamedIndividual, c:ValueCondition ; c:about :books ; c:situationType d:IN ; c:value :shop .
:order.b a owl:NamedIndividual, c:ValueCondition ; c:about :glass ; c:situationType d:IN ; c:value :cart .""",
        1,
    ),
    "some": (
        """:order.crate a owl:NamedIndividual, c:Variable ; c:termType d:Crate .
:order.some a owl:NamedIndividual, c:Witness ; c:witness :order.crate ; c:condition :order.in .
:order.in a owl:NamedIndividual, c:ValueCondition ; c:about :order.crate ; c:situationType d:IN ; c:value :shop .""",
        3,
    ),
    "none": (
        ":order.none a owl:NamedIndividual, c:AbsenceCondition ; c:ofClass d:Crate ; c:situationType d:IN ; c:value :store .",
        6,
    ),
    "maximum": (
        ":order.maximum a owl:NamedIndividual, c:Comparison ; c:about :cart ; c:situationType d:HEAVIEST ; "
        'c:sign "=" ; c:amount 4.0 .',
        1,
    ),
    "more": (
        """:order.more a owl:NamedIndividual, c:Comparison ; c:about :shop ; c:situationType d:STOCK ;
  c:sign ">" ; c:right :order.r .
:order.r a owl:NamedIndividual, c:Calculation ; c:about :store ; c:situationType d:STOCK .""",
        5,
    ),
}
"""Each goal has the number of primitives of its cheapest plan."""


@pytest.mark.parametrize("name", GOALS)
def test_a_goal_with_a_compound_condition_is_achieved_and_checked(name: str, tmp_path: Path) -> None:
    said, least = GOALS[name]
    begin = SCENE.index("  c:goal ")
    head, rest = SCENE[:begin], SCENE[SCENE.index(" .\n", begin) :]
    for number in range(1, 4):
        rest = rest.replace(f":order.goal{number} a", f":order.other{number} a")
    file = tmp_path / "scene.ttl"
    file.write_text(f"{head}  c:goal :order.{name}{rest}\n{said}\n", "utf-8")
    result = confab.load(file).plan(optimal=True)
    assert result.outcome.status is Status.SOLVED
    assert result.problem.goal == {Symbol(f"order.{name}", ("order",)): TRUE}
    assert validate(result.problem, result.plan) == []
    assert len(result.plan.primitives) == least
