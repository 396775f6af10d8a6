"""The bounds of the optimal mode are correct, and its plans are as short as it states."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from confab.planner.grounded.best_first import plan_level
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.shortest import shortest
from confab.planner.grounded.task import Task
from confab.planner.hierarchical import bounds as optimal
from confab.planner.hierarchical.bounds import lm_cut
from confab.planner.plan import Limits, Reason, Status
from confab.planner.plan_costs import cost_of
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.symbols import FALSE, TRUE, SituationType, Symbol
from worlds.families import family, random_table
from worlds.writing import becomes, behavior, has, world


@pytest.mark.parametrize("part", range(2))
def test_lm_cut_never_overestimates_and_a_star_with_it_is_optimal(part: int) -> None:
    compared = 0
    for seed in range(50_000 + 40 * part, 50_000 + 40 * (part + 1)):
        problem = random_table(seed)
        task = ground(problem, 3)
        if isinstance(task, Reason):
            continue
        truth = shortest(task, most_expanded=3_000)
        if truth.plan is None and truth.bound < math.inf:
            continue  # too many states
        heuristic = lm_cut(task)
        assert heuristic(task.initial) <= truth.bound, seed
        found = shortest(task, heuristic, most_expanded=1000)
        assert found.bound <= truth.bound, seed
        if found.plan is not None:
            compared += 1
            assert len(found.plan) == truth.bound, seed
    assert compared > 5


def test_a_plan_is_optimal_when_its_cost_is_the_bound() -> None:
    problem = family("full", 4)
    problem = replace(problem, goal=problem.goal_on(3))
    outcome = optimal.plan(problem)
    assert outcome.plan is not None
    task = ground(problem, 3)
    assert isinstance(task, Task)
    assert cost_of(problem, outcome.plan) == outcome.bound == shortest(task).bound
    assert validate(problem, outcome.plan) == []


def test_the_optimal_mode_returns_a_plan_and_a_lower_bound_at_its_time_limit() -> None:
    problem = family("served", 6)
    outcome = optimal.plan(problem, limits=Limits(seconds=3.0))
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert outcome.bound is not None
    assert 0 < outcome.bound <= cost_of(problem, outcome.plan)
    assert outcome.seconds < 3.0 * 1.1 + 0.5


def test_a_shorter_plan_that_leaves_a_hand_lowered_is_not_accepted() -> None:
    problem = family("served", 2, hands=1)
    outcome = solve(Request(problem, "optimal"))
    assert outcome.plan is not None
    assert outcome.bound == cost_of(problem, outcome.plan)
    task = ground(problem, 3)
    assert isinstance(task, Task)
    assert shortest(task).bound < outcome.bound, "the world has no such plan; choose another"


def test_the_bound_is_correct_if_a_variable_that_is_not_at_rest_need_not_change() -> None:
    problem = family("served", 2, hands=1)
    lowered = {s: "location4" for s in problem.initial if s.situation == "HAND_POSITION"}
    problem = replace(problem, initial={**problem.initial, **lowered})
    outcome = solve(Request(problem, "optimal"))
    assert outcome.plan is not None
    assert outcome.bound is not None
    assert outcome.bound <= cost_of(problem, outcome.plan)


def test_an_unstated_boolean_fact_is_at_rest_at_the_end_of_an_optimal_plan() -> None:
    ajar = SituationType("AJAR", ("Gate",), "Truth", 2, FALSE, FALSE, True)
    within = SituationType("IN", ("Animal",), "IN")
    problem = world(
        [ajar, within],
        [
            behavior("B1_DRIVE", 1, "?a:Animal ?to:IN", [], [becomes("IN", "?a", "?to")]),
            behavior("B2_OPEN", 2, "?g:Gate", [has("AJAR", "?g", FALSE)], [becomes("AJAR", "?g", TRUE)]),
            behavior("B2_SHUT", 2, "?g:Gate", [has("AJAR", "?g", TRUE)], [becomes("AJAR", "?g", FALSE)]),
            behavior("B2_DRIVE", 2, "?a:Animal ?to:IN", [has("AJAR", "gate", TRUE)], [becomes("IN", "?a", "?to")]),
        ],
        {"Gate": ("gate",), "Animal": ("lion",), "IN": ("pen", "yard")},
        {"IN lion": "pen"},
        {"IN lion": "yard"},
    )
    assert problem.goal_on(2) == {Symbol("IN", ("lion",)): "yard", Symbol("AJAR", ("gate",)): FALSE}
    outcome, flat = optimal.plan(problem), plan_level(problem)
    assert outcome.plan is not None and flat.plan is not None
    assert outcome.bound == cost_of(problem, outcome.plan) == len(flat.plan.steps) == 3
    assert validate(problem, flat.plan) == validate(problem, outcome.plan) == []
