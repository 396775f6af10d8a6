"""A derived fact is explained by the facts from which it follows, with the labels of the ontology."""

import re
from pathlib import Path

import confab

THEATRE = Path(__file__).parents[2] / "docs" / "examples" / "theatre" / "first-night.ttl"


def needs(scene: str | Path, step: str) -> list[str]:
    result = confab.load(scene).plan()
    return list(result.why(step).needs)


def test_the_reason_for_a_step_names_the_facts_from_which_a_defined_goal_follows() -> None:
    assert needs("packing-small", "L1#3") == [
        "the goal requires that ring is stored away, which follows from: chest lies in vault"
    ]
    assert needs("packing-small", "L1#1") == [
        "the goal requires that ring is inside casket, which follows from: ring lies in casket",
        "the goal requires that ring is stored away, which follows from: ring lies in casket",
    ]


def test_a_defined_condition_is_explained_with_the_fact_that_violated_it_before() -> None:
    asks = "“put ring into casket” (L1#1) requires that casket isn't out of reach; without this step, chest is shut"
    assert asks in needs("packing-small", "L1#0")


def test_a_condition_on_all_members_of_a_class_is_explained_as_such() -> None:
    asked = needs(THEATRE, "unload cloud")
    assert asked[0] == "the goal requires that cloud isn't stowed, which follows from: cart doesn't carry cloud"
    assert re.match(r"“switch (back|front) on” \(L1#15\) requires that no prop is stowed", asked[1])
