"""Planning from an intermediate situation: a hand holds a bottle, so the bottle is at no place that the first level sees."""

from dataclasses import replace

import pytest

from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Limits, Status
from confab.planner.solve import Request, solve
from confab.planner.validation import successor, validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State
from worlds.families import family
from worlds.hierarchies import hierarchy


def course(problem: Problem) -> list[State]:
    """Return the states along a plan."""
    found = plan(problem).plan
    assert found is not None
    states: list[State] = [dict(problem.initial)]
    for step in found.primitives:
        after = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, states[-1])
        assert after is not None
        states.append(after)
    return states


@pytest.mark.parametrize("number", (2, 16, 20, 26))
def test_the_rest_of_a_plan_is_planned_with_few_expansions_from_each_of_its_states(number: int) -> None:
    problem = family("served", 5)
    here = replace(problem, initial=course(problem)[number])
    outcome = plan(here, limits=Limits(expansions=10_000))
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert validate(here, outcome.plan) == []


def test_steps_of_a_lower_level_that_bring_symbols_to_rest_are_reported() -> None:
    problem = family("served", 5)
    held = next(state for state in course(problem) if "in_hand" in state.values())
    outcome = plan(replace(problem, initial=held))
    assert outcome.plan is not None
    below = [step.level > 1 for step in outcome.plan.steps]
    assert sum(below) == below[below.index(True) :].index(False) > 0  # these steps are consecutive
    assert [text[:45] for text in outcome.given_up] == ["steps of a lower level bring symbols to rest "]


@pytest.mark.parametrize("seed", (9902726, 9903910, 9904745))
def test_a_task_that_is_not_at_rest_initially_is_solved_on_the_lowest_level_alone(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("confab.planner.hierarchical.agenda.Agenda.achieve_all", lambda agenda: False)
    outcome = solve(Request(hierarchy(seed)))
    assert outcome.status is Status.SOLVED
