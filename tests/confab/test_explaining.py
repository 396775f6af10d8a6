"""An explanation states the rule, the episodes that support it, and the evidence for and against the alternative."""

from pathlib import Path

import pytest

import confab
from confab.explaining import Explanation, explain
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.experience import Ground
from worlds.lessons import taught

STEPS: list[Ground] = [("B1_MOVE", ("cup1", "location7"))]
AGAINST: Ground = ("B1_POUR", ("bottle1", "cup1"))


@pytest.fixture(scope="module")
def memory() -> confab.Memory:
    found = confab.Memory.of(confab.load("beverage-serving"))
    found.experience = taught().experience
    return found


@pytest.fixture(scope="module")
def explanation(memory: confab.Memory) -> Explanation:
    return explain(confab.load("beverage-serving").problem, memory, STEPS, 0, AGAINST)


def test_the_weights_of_the_reasons_add_up_to_the_lead_over_the_alternative(explanation: Explanation) -> None:
    assert sum(why.weight for why in explanation.reasons) == pytest.approx(explanation.lead)


def test_an_explanation_has_the_rule_as_a_sentence_and_its_numbers_of_episodes(explanation: Explanation) -> None:
    assert explanation.rule.startswith("so that movable LOCATION location, when ")
    assert explanation.rule.endswith("B1_MOVE movable location")
    assert "chosen" in explanation.behind
    assert "taught" in explanation.behind


def test_an_explanation_without_a_rule_in_memory_says_so(memory: confab.Memory) -> None:
    scene = confab.load("beverage-serving")
    told = explain(scene.problem, confab.Memory.of(scene), STEPS)
    assert told.note == "memory has no rule that would do B1_MOVE cup1 location7 there"


def test_an_explanation_is_available_as_text_json_and_picture(explanation: Explanation, tmp_path: Path) -> None:
    assert str(explanation).startswith("B1_MOVE cup1 location7, not B1_POUR bottle1 cup1")
    assert explanation.json()["reasons"][0]["fact"] == explanation.reasons[0].fact
    explanation.plot(tmp_path / "why.png")
    assert (tmp_path / "why.png").stat().st_size > 1000


def test_an_unknown_step_or_an_inapplicable_alternative_is_a_clear_error(memory: confab.Memory) -> None:
    problem = confab.load("beverage-serving").problem
    with pytest.raises(KnowledgeError, match="no step 7"):
        explain(problem, memory, STEPS, 7)
    with pytest.raises(KnowledgeError, match="could not be done there"):
        explain(problem, memory, STEPS, 0, ("B1_POUR", ("cup1", "cup2")))
