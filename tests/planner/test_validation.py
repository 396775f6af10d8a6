"""The plan checker finds each kind of fault; it is the judge of every planner here, so it must be seen saying no."""

from dataclasses import replace

import pytest

from planner.paper.hierarchy import plan
from planner.plan import Plan, Step
from planner.validation import validate
from reasoner.graph.knowledge import load
from reasoner.reading.problem import read
from reasoner.symbols import Problem


@pytest.fixture(scope="module")
def serving() -> Problem:
    return read(load("beverage-serving")).problem


@pytest.fixture(scope="module")
def steps(serving: Problem) -> tuple[Step, ...]:
    found = plan(serving).plan
    assert found is not None
    return found.steps


def faults(problem: Problem, steps: tuple[Step, ...]) -> str:
    return "\n".join(fault.text for fault in validate(problem, Plan(steps)))


def test_a_plan_of_the_planner_has_no_fault(serving: Problem, steps: tuple[Step, ...]) -> None:
    assert faults(serving, steps) == ""


def test_a_step_out_of_order_lacks_its_preconditions(serving: Problem, steps: tuple[Step, ...]) -> None:
    assert "preconditions don't hold" in faults(serving, steps[::-1])


def test_a_missing_step_leaves_the_goal_unreached(serving: Problem, steps: tuple[Step, ...]) -> None:
    assert "isn't reached" in faults(serving, steps[:-1])


def test_a_wrong_id_is_found(serving: Problem, steps: tuple[Step, ...]) -> None:
    assert "its ID by the numbering" in faults(serving, (replace(steps[0], id=21), *steps[1:]))


def test_a_refinement_that_leaves_the_object_in_the_hand_is_found(serving: Problem, steps: tuple[Step, ...]) -> None:
    unfinished = replace(steps[0], steps=steps[0].steps[:-1])
    assert "its refinement leaves <cup1, LOCATION> = in_hand" in faults(serving, (unfinished, *steps[1:]))


def test_an_argument_of_another_class_is_found(serving: Problem, steps: tuple[Step, ...]) -> None:
    odd = replace(steps[0], arguments=("cup1", "cup2"))
    assert "don't take these arguments" in faults(serving, (odd, *steps[1:]))
