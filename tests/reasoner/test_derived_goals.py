"""Goals that aren't facts: alternatives, quantified goals, comparisons of two amounts, and goals on a maximum."""

from pathlib import Path

import pytest

import confab
from confab import ontology
from confab.planner.plan import Status
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import KnowledgeError
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


def with_goal(name: str) -> str:
    """Return the scene with one of the `GOALS` in place of its own."""
    begin = SCENE.index("  c:goal ")
    head, rest = SCENE[:begin], SCENE[SCENE.index(" .\n", begin) :]
    for number in range(1, 4):
        rest = rest.replace(f":order.goal{number} a", f":order.other{number} a")
    return f"{head}  c:goal :order.{name}{rest}\n{GOALS[name][0]}\n"


@pytest.mark.parametrize("name", GOALS)
def test_a_goal_with_a_compound_condition_is_achieved_and_checked(name: str, tmp_path: Path) -> None:
    (tmp_path / "scene.ttl").write_text(with_goal(name), "utf-8")
    result = confab.load(tmp_path / "scene.ttl").plan(optimal=True)
    assert result.outcome.status is Status.SOLVED
    assert result.problem.goal == {Symbol(f"order.{name}", ("order",)): TRUE}
    assert validate(result.problem, result.plan) == []
    assert len(result.plan.primitives) == GOALS[name][1]


def test_a_domain_may_have_a_class_of_tasks_beside_a_compound_goal(tmp_path: Path) -> None:
    domain = (ontology.ROOT / "domains" / "carts.ttl").read_text("utf-8").replace(":Crate", ":Task")
    domain = domain.replace("w3id.org/confab/carts", "example.org/errands")
    scene = with_goal("none").replace("d:Crate", "d:Task").replace("w3id.org/confab/carts>", "example.org/errands>")
    (tmp_path / "domain.ttl").write_text(domain, "utf-8")
    (tmp_path / "scene.ttl").write_text(scene.replace("w3id.org/confab/carts#", "example.org/errands#"), "utf-8")
    loaded = confab.load([tmp_path / "scene.ttl", tmp_path / "domain.ttl"])
    result = loaded.plan(optimal=True)
    assert loaded.problem.classes["Task"] == ("books", "glass", "paper")
    assert len(result.plan.primitives) == GOALS["none"][1]
    assert {row.object for row in loaded.affordances()} == {"books", "glass", "paper", "cart"}
    assert loaded.query("SELECT ?crate WHERE { ?crate a d:Task ; d:in :store }")


@pytest.mark.parametrize(
    ("said", "fault"),
    [
        ("", "used as a condition but isn't declared"),
        ("a c:ValueCondition ; c:about :books ; c:situationType d:IN", "states no value"),
        (
            "a c:ValueCondition ; c:about :books ; c:situationType d:IN ; c:value :shop, :store",
            "wanted one c:value, found 2",
        ),
        (
            "a c:ValueCondition ; c:about :books, :glass ; c:situationType d:IN ; c:value :shop",
            "wanted one c:about, found 2",
        ),
    ],
)
def test_a_goal_that_lacks_or_repeats_a_part_is_refused_by_name(said: str, fault: str, tmp_path: Path) -> None:
    head, rest = SCENE[: SCENE.index("  c:goal ")], SCENE[SCENE.index(" .\n", SCENE.index("  c:goal ")) :]
    goal = f"\n:order.wrong {said} ." if said else ""
    (tmp_path / "scene.ttl").write_text(f"{head}  c:goal :order.wrong{rest}{goal}\n", "utf-8")
    with pytest.raises(KnowledgeError, match=fault):
        confab.load(tmp_path / "scene.ttl").plan()


HEADER = """@prefix : <https://example.org/w#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/w> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:cup a owl:NamedIndividual, :Cup .
:task a owl:NamedIndividual, c:Task ; c:goal :wanted .
"""
HELD = """:Cup a owl:Class ; rdfs:subClassOf c:Object ; c:hasSituationType :AT .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at .
:at a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Cup ; rdfs:range :AT .
:table a owl:NamedIndividual, :AT . :shelf a owl:NamedIndividual, :AT . :hand a owl:NamedIndividual, :AT ; c:fromLevel 2 .
:MOVE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:update "INSERT { ?cup :at ?place } WHERE { ?cup a :Cup . ?place a :AT }" .
:GRASP a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:update "INSERT { ?cup :at :hand } WHERE { ?cup a :Cup }" .
:cup :at :table .
:wanted a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:situationType :AT ; c:value :table ; c:negated true .
"""
FACING = """:Cup a owl:Class ; rdfs:subClassOf c:Object .
:FACING a owl:Class, owl:NamedIndividual, c:SituationType ; c:parameter :FACING.1, :FACING.2 ; c:defaultValue :front .
:FACING.1 a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Cup .
:FACING.2 a owl:NamedIndividual, c:Parameter ; c:index 2 ; c:termType :Cup .
:front a owl:NamedIndividual, :FACING . :left a owl:NamedIndividual, :FACING . :right a owl:NamedIndividual, :FACING .
:TURN a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:parameter :TURN.1, :TURN.2, :TURN.to ; c:postcondition :TURN.turned .
:TURN.1 a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Cup .
:TURN.2 a owl:NamedIndividual, c:Parameter ; c:index 2 ; c:termType :Cup .
:TURN.to a owl:NamedIndividual, c:Parameter ; c:index 3 ; c:termType :FACING .
:TURN.turned a owl:NamedIndividual, c:ValueEffect ; c:about :TURN.1 ; c:argument2 :TURN.2 ; c:situationType :FACING ;
  c:value :TURN.to .
:mug a owl:NamedIndividual, :Cup .
:wanted a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:argument2 :mug ; c:situationType :FACING ; c:value :front ;
  c:negated true .
"""
FILLED = """:Cup a owl:Class ; rdfs:subClassOf c:Object ; c:hasSituationType :FILLED .
:FILLED a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :filled .
:filled a owl:DatatypeProperty, owl:FunctionalProperty ; rdfs:domain :Cup ; rdfs:range xsd:decimal .
:EMPTY a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:update "INSERT { ?cup :filled 0.0 } WHERE { ?cup a :Cup }" .
:cup :filled 4.0 .
:wanted a owl:NamedIndividual, c:Comparison ; c:about :cup ; c:situationType :FILLED ; c:sign "=" ; c:amount 4.0 ; c:negated true .
"""


@pytest.mark.parametrize(
    ("world", "step"),
    [
        pytest.param(HELD, "GRASP cup", id="the only reachable value belongs to a lower level"),
        pytest.param(FACING, "TURN cup mug left", id="the values belong to no property"),
        pytest.param(FILLED, "EMPTY cup", id="the goal excludes one amount"),
    ],
)
def test_a_goal_that_excludes_a_value_holds_with_every_other_value(world: str, step: str, tmp_path: Path) -> None:
    (tmp_path / "w.ttl").write_text(HEADER + world, "utf-8")
    loaded = confab.load(tmp_path / "w.ttl")
    result = loaded.plan(optimal=True)
    assert [f"{one.behavior} {' '.join(one.arguments)}" for one in result.plan.primitives] == [step]
    assert result.problem.goal == {Symbol("wanted", ("task",)): TRUE}
