"""The second scenario: cereal and milk, written in Turtle alone, planned, and verified in physics."""

from pathlib import Path

import pytest

import confab
from confab.planner.solve import Mode
from confab.reaching import with_reach
from confab.scene import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return with_reach(confab.load("cereal-serving"))


@pytest.mark.parametrize("mode", ["paper", "guarded"])
def test_the_bowl_is_moved_then_gets_cereal_then_milk(scene: Scene, mode: Mode) -> None:
    found = scene.plan(mode=mode).json()
    behaviors = [step["behavior"] for step in found["steps"]]
    assert sorted(behaviors) == ["B1_MOVE", "B1_POUR_CEREAL", "B1_POUR_MILK"]
    assert behaviors.index("B1_POUR_CEREAL") < behaviors.index("B1_POUR_MILK")
    assert found["length"] == {"1": 3, "2": 8, "3": 26}


def test_a_filled_bowl_stays_where_it_is(scene: Scene) -> None:
    (move, *_) = scene.plan(mode="paper").json()["steps"]
    assert (move["behavior"], move["arguments"]) == ("B1_MOVE", ["bowl1", "location7"])


@pytest.mark.slow
def test_the_plan_is_verified_in_physics(scene: Scene) -> None:
    report = scene.plan(mode="paper").verify(rollouts=1, seed=0).json()
    assert report["status"] == "verified"
    assert report["rollouts"][0]["poured"] == pytest.approx([1.0, 1.0], abs=0.35)


def test_no_python_names_a_term_of_the_breakfast_domain() -> None:
    words = ("cereal", "milk", "bowl", "breakfast")
    root = Path(confab.__file__).parents[1]
    files = [
        file for room in ("ontology", "reasoner", "planner", "sim", "confab") for file in (root / room).rglob("*.py")
    ]
    assert [f for f in files if any(word in f.read_text(encoding="utf-8").lower() for word in words)] == []
