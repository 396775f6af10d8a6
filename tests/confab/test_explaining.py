"""An explanation names what decided: without it the choice flips or gets less clear."""

from pathlib import Path

import pytest

import confab
from confab.explaining import Explanation, explain
from planner.experience.choice_points import Field, Ground
from planner.experience.scoring import Judge
from planner.hierarchical.operators import Program
from reasoner.graph.knowledge import KnowledgeError
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


def test_the_weights_add_up_to_the_lead(explanation: Explanation) -> None:
    assert explanation.lead > 0
    assert sum(why.weight for why in explanation.reasons) == pytest.approx(explanation.lead)


def test_without_what_is_named_first_the_choice_flips_or_is_less_clear(
    memory: confab.Memory, explanation: Explanation
) -> None:
    first = explanation.reasons[0]
    problem = confab.load("beverage-serving").problem
    field = Field(Program(problem), problem, 1)
    roles = {b.name: field.schema.roles(b) for b in problem.domain.behaviors.values()}
    without = Judge(memory.experience, problem.parents, roles, frozenset({first.fact, *first.also}))
    chosen, other = field.candidate(STEPS[0]), field.candidate(AGAINST)
    assert chosen is not None
    assert other is not None
    lead = without.cogency(chosen) - without.cogency(other)
    assert lead < explanation.lead
    assert first.drop == pytest.approx(explanation.lead - lead)


def test_it_comes_as_text_json_and_picture(explanation: Explanation, tmp_path: Path) -> None:
    assert str(explanation).startswith("B1_MOVE cup1 location7, not B1_POUR bottle1 cup1")
    assert explanation.json()["reasons"][0]["fact"] == explanation.reasons[0].fact
    explanation.plot(tmp_path / "why.png")
    assert (tmp_path / "why.png").stat().st_size > 1000


def test_a_step_or_alternative_that_is_not_there_is_a_clear_error(memory: confab.Memory) -> None:
    problem = confab.load("beverage-serving").problem
    with pytest.raises(KnowledgeError, match="no step 7"):
        explain(problem, memory, STEPS, 7)
    with pytest.raises(KnowledgeError, match="could not be done there"):
        explain(problem, memory, STEPS, 0, ("B1_POUR", ("cup1", "cup2")))
