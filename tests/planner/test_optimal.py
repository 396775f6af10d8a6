"""The optimal mode's bounds are true, and its plans as short as it says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from planner.grounded.grounding import ground
from planner.grounded.state_space import Space, TooLargeError
from planner.hierarchical import bounds as optimal
from planner.hierarchical.bounds import a_star, lm_cut
from planner.plan import Counts, Limits, Reason, Status
from planner.solve import Request, solve
from planner.validation import validate
from worlds.families import family, random_table


@pytest.mark.parametrize("part", range(2))
def test_lm_cut_never_overestimates_and_a_star_with_it_is_optimal(part: int) -> None:
    compared = 0
    for seed in range(50_000 + 40 * part, 50_000 + 40 * (part + 1)):
        problem = random_table(seed)
        try:
            truth = Space(problem, 3).search(3_000)
        except TooLargeError:
            continue
        task = ground(problem, 3)
        if isinstance(task, Reason):
            assert truth.steps is None
            continue
        heuristic = lm_cut(task)
        shortest = math.inf if truth.steps is None else len(truth.steps)
        assert heuristic(task.initial) <= shortest, seed
        bound, operators = a_star(task, heuristic, math.inf, 1000, None, Counts())
        assert bound <= shortest, seed
        if operators is not None:
            compared += 1
            assert len(operators) == shortest, seed
    assert compared > 5


def test_a_plan_is_optimal_when_its_cost_is_the_bound() -> None:
    problem = family("full", 4)
    problem = replace(problem, goal=problem.goal_on(3))
    outcome = optimal.plan(problem)
    truth = Space(problem, 3).search(10**6)
    assert outcome.plan is not None
    assert truth.steps is not None
    assert optimal.cost(problem, outcome.plan) == outcome.bound == len(truth.steps)
    assert validate(problem, outcome.plan) == []


def test_when_time_runs_out_there_is_a_plan_and_a_bound_below_it() -> None:
    problem = family("served", 6)
    outcome = optimal.plan(problem, limits=Limits(seconds=1.5))
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert outcome.bound is not None
    assert 0 < outcome.bound <= optimal.cost(problem, outcome.plan)
    assert outcome.seconds < 1.5 * 1.1 + 0.5


def test_a_shorter_plan_that_leaves_a_hand_lowered_is_none() -> None:
    problem = family("served", 2, hands=1)
    outcome = solve(Request(problem, "optimal"))
    assert outcome.plan is not None
    assert outcome.bound == optimal.cost(problem, outcome.plan)
    shorter = Space(problem, 3).search(10**6)
    assert shorter.steps is not None
    assert len(shorter.steps) < outcome.bound, "the world has no such plan; choose another"


def test_the_bound_holds_where_something_not_at_rest_need_not_be_touched() -> None:
    problem = family("served", 2, hands=1)
    lowered = {s: "location4" for s in problem.initial if s.situation == "HAND_POSITION"}
    problem = replace(problem, initial={**problem.initial, **lowered})
    outcome = solve(Request(problem, "optimal"))
    assert outcome.plan is not None
    assert outcome.bound is not None
    assert outcome.bound <= optimal.cost(problem, outcome.plan)
