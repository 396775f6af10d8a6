"""The plan checker detects each kind of fault; every planner relies on the checker, so the tests must show that it rejects."""

from dataclasses import replace

import pytest

from confab.planner.paper.hierarchy import plan
from confab.planner.plan import Plan, Step
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol
from tests.planner.small import Case, fire_door, tool, van


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


def test_the_checker_reports_one_fault_for_a_refinement_that_is_not_applicable(
    serving: Problem, steps: tuple[Step, ...]
) -> None:
    turned = replace(steps[0], steps=steps[0].steps[::-1])
    assert faults(serving, (turned, *steps[1:])).count("\n") == 0


def test_an_argument_of_another_class_is_found(serving: Problem, steps: tuple[Step, ...]) -> None:
    odd = replace(steps[0], arguments=("cup1", "cup2"))
    assert "don't take these arguments" in faults(serving, (odd, *steps[1:]))


def solved(case: Case) -> tuple[Step, ...]:
    found = plan(case.problem).plan
    assert found is not None
    return found.steps


def refined(step: Step, *names: str) -> Step:
    """Return a step with only the given sub-steps."""
    return replace(step, steps=tuple(below for below in step.steps if below.behavior in names))


def test_a_door_that_a_plan_leaves_open_is_detected() -> None:
    (fetch,) = solved(fire_door())
    open_ = refined(fetch, "OPEN", "TAKE", "GO", "PUT")
    assert "touches <door, DOOR> and leaves it open; at rest it is shut" in faults(fire_door().problem, (open_,))


def test_a_door_that_a_stretch_below_its_level_leaves_open_is_found() -> None:
    (fetch,) = solved(fire_door())
    open_ = refined(fetch, "OPEN", "TAKE", "GO", "PUT").steps
    said = faults(fire_door().problem, open_)
    assert "the stretch from 2 OPEN to 5 PUT touches" in said
    assert "leaves it open; at rest it is shut" in said


def test_a_door_that_was_open_and_is_not_touched_may_stay_open() -> None:
    problem = replace(fire_door().problem, initial={**fire_door().problem.initial, Symbol("DOOR", ("door",)): "open"})
    (fetch,) = solved(fire_door())
    assert faults(problem, (refined(fetch, "TAKE", "GO", "PUT"),)) == ""
    (shut,) = (step for step in fetch.steps if step.behavior == "SHUT")
    take, *rest = (step for step in fetch.steps if step.behavior not in ("OPEN", "SHUT"))
    assert faults(problem, (replace(fetch, steps=(take, shut, *rest)),)) == ""


def test_the_next_step_begins_where_the_refinement_of_the_one_before_ended() -> None:
    case = van()
    steps = solved(case)
    alone = solved(replace(case, problem=replace(case.problem, goal={Symbol("AT", ("parcel2",)): "north"})))
    other = next(i for i, step in enumerate(steps) if step.arguments == ("parcel2", "north"))
    again = (*steps[:other], alone[0], *steps[other + 1 :])
    assert faults(case.problem, steps) == ""
    assert "preconditions don't hold" in faults(case.problem, again)  # the van has left the depot


def test_a_step_without_refinement_among_refined_steps_is_detected() -> None:
    first, *others = solved(van())
    assert "it has no refinement, but other steps have one" in faults(
        van().problem, (replace(first, steps=()), *others)
    )


def test_a_refinement_with_more_effects_than_its_step_is_detected() -> None:
    case = tool()
    first, second = solved(case)
    assert "leaves <leg2, AT> = mounted, not bin" in faults(
        case.problem, (replace(first, steps=(*first.steps, *second.steps)), second)
    )
