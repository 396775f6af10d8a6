"""The same name in two groups of conditions denotes two variables: a lamp and a plug may be in different rooms."""

from pathlib import Path

import pytest

import confab
from confab.planner.plan import Status

SCENE = (Path(__file__).parent / "cases" / "lamp-and-plug.ttl").read_text("utf-8")
"""The lamp of the house and the plug are in different rooms; `:lamp` and `:plug` are conditions on some lamp or plug in a room."""
LIT = ":task c:goal [ a c:ValueCondition ; c:about :house ; c:situationType :LIT ] ."
RULE = """:OK.rule a owl:NamedIndividual, c:Rule ; c:situationType :OK ; c:about :x.h ; c:condition :lamp, :plug .
:lamp c:condition [ a c:ValueCondition ; c:about :x.l ; c:situationType :ON ] .
:GLOW a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ;
  c:update "INSERT { ?h :LIT true } WHERE { ?h a :House . ?h :OK true }" .
"""
BEHAVIOR = """:GLOW a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; c:parameter :x.h ;
  c:precondition :lamp, :plug ; c:postcondition :GLOW.lit .
:GLOW.lit a owl:NamedIndividual, c:ValueEffect ; c:situationType :LIT ; c:about :x.h .
"""
ALTERNATIVES = """:lamp.any a owl:NamedIndividual, c:AnyOf ; c:alternative :lamp.at, :lamp.on .
:lamp.on a owl:NamedIndividual, c:ValueCondition ; c:about :x.l ; c:situationType :ON .
"""
NOT_THERE = (":plug a owl:NamedIndividual, c:Witness ;", ":plug a owl:NamedIndividual, c:Witness ; c:negated true ;")


def scene(folder: Path, more: str, *changes: tuple[str, str]) -> confab.Scene:
    """Return the scene with further statements and with some changes."""
    text = SCENE + more
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "world.ttl").write_text(text, "utf-8")
    return confab.load(folder / "world.ttl")


def cost(found: confab.Scene) -> float:
    """Return the cost of the cheapest plan."""
    result = found.plan(optimal=True, engine="none")
    assert result.outcome.status is Status.SOLVED
    return float(result.cost)


def test_the_witnesses_of_a_rule_may_be_in_different_rooms(tmp_path: Path) -> None:
    assert cost(scene(tmp_path, RULE + LIT)) == 2


def test_a_rule_without_a_plug_in_any_room_does_not_hold_if_a_plug_is_in_another_room_than_the_lamp(
    tmp_path: Path,
) -> None:
    assert cost(scene(tmp_path, RULE + LIT, NOT_THERE)) == 10


def test_the_individuals_of_both_witnesses_of_a_behavior_are_read(tmp_path: Path) -> None:
    assert cost(scene(tmp_path, BEHAVIOR + LIT)) == 1


def test_the_individuals_of_a_witness_and_of_an_alternative_are_read(tmp_path: Path) -> None:
    some = (
        BEHAVIOR.replace(":lamp, :plug", ":any, :plug")
        + ":any a owl:NamedIndividual, c:AnyOf ; c:alternative :lamp, :dark .\n"
    )
    dark = ":dark a owl:NamedIndividual, c:ValueCondition ; c:about :x.h ; c:situationType :OK .\n"
    assert cost(scene(tmp_path, some + dark + LIT)) == 1


def test_the_individuals_of_a_precondition_and_of_an_effect_are_read(tmp_path: Path) -> None:
    when = ":GLOW.lit c:when [ a c:ValueCondition ; c:about :l1 ; c:situationType :AT ; c:value :x.v ] .\n"
    alone = BEHAVIOR.replace(":lamp, :plug", ":plug")
    assert cost(scene(tmp_path, alone + when + LIT)) == 1


def test_a_goal_may_be_met_by_witnesses_in_different_rooms(tmp_path: Path) -> None:
    goal = """:task c:goal [ a c:Witness ; c:witness :x.g ; c:condition :lamp, :plug, [ a c:ValueCondition ; c:about :x.g ;
      c:situationType :LIT ] ] . :x.g a owl:NamedIndividual, c:Variable ; c:termType :House .\n"""
    assert cost(scene(tmp_path, goal)) == 10


@pytest.mark.parametrize("second", [":plug", ":plug.any"])
def test_a_behavior_is_applicable_with_alternatives_in_different_rooms(tmp_path: Path, second: str) -> None:
    more = """:plug.any a owl:NamedIndividual, c:AnyOf ; c:alternative :plug.at, :plug.off .
:plug.off a owl:NamedIndividual, c:ValueCondition ; c:about :house ; c:situationType :OK .
:x.l a c:Parameter ; c:index 2 . :GLOW c:parameter :x.l .
"""
    if second == ":plug.any":
        more += ":x.p a c:Parameter ; c:index 3 . :GLOW c:parameter :x.p .\n"
    behavior = BEHAVIOR.replace(":lamp, :plug", f":lamp.any, {second}")
    found = scene(tmp_path, behavior + ALTERNATIVES + more + LIT)
    assert "GLOW" in {row["behavior"] for row in found.affordances()}


def test_a_rule_is_learned_from_a_behavior_that_forbids_a_plug_in_some_room(tmp_path: Path) -> None:
    room = ":plug c:condition [ a c:EqualityCondition ; c:about :x.v ; c:value :k1 ] .\n"
    found = scene(tmp_path, BEHAVIOR + room + LIT, NOT_THERE)
    memory = confab.Memory.of(found)
    memory.learn(found, found.plan())
    memory.save(tmp_path / "memory.ttl")
    again = found.plan(memory=tmp_path / "memory.ttl")
    assert [step.behavior for step in again.plan.primitives] == ["GLOW"]
