"""Execution of timed plans whose durations deviate from the expected durations."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from random import Random

import pytest

from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Limits, Plan, Step
from confab.planner.timed import concurrent
from confab.planner.timed.call import in_time
from confab.planner.timed.dispatch import Dispatch, DispatchRun, simulated
from confab.planner.timed.plan import TimedPlan
from confab.planner.timed.validation import validate_timed
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol, Times
from worlds.timed import Action, TimedWorld, problem_of, timed_world

SPREAD = Fraction(3, 10)


@cache
def served() -> tuple[Problem, TimedPlan]:
    problem = read(load("beverage-serving")).problem
    found = plan(problem).plan
    assert found is not None
    timed = in_time(problem, found).plan
    assert timed is not None
    return problem, timed


def executed(problem: Problem, timed: TimedPlan, seed: int) -> DispatchRun:
    """Return an execution with random durations."""
    rng = Random(seed)
    factors = [Fraction(rng.randint(700, 1300), 1000) for _ in timed.slots]
    return simulated(Dispatch(problem, timed, SPREAD), lambda i, seconds: seconds * factors[i])


@pytest.mark.parametrize("seed", range(5))
def test_two_hands_whose_steps_take_longer_or_shorter_break_no_causal_link(seed: int) -> None:
    problem, timed = served()
    run = executed(problem, timed, seed)
    assert run.timed is not None
    assert validate_timed(problem, run.timed, executed=True) == []


def test_executions_of_random_timed_worlds_break_no_causal_link() -> None:
    for seed in range(12_000, 12_060):
        problem = problem_of(timed_world(seed))
        timed = concurrent.plan(problem, Limits(seconds=5.0))[1].plan
        if timed is not None:
            run = executed(problem, timed, seed)
            done = run.timed or TimedPlan(Plan(tuple(slot.step for slot in run.slots)), run.slots)
            asked = problem if run.timed else replace(problem, goal={})
            assert validate_timed(asked, done, executed=True) == [], seed


def test_a_late_step_shifts_only_the_steps_that_depend_on_it() -> None:
    problem, timed = served()
    dispatch = Dispatch(problem, timed)
    late = max(i for i, slot in enumerate(timed.slots) if slot.actors == ("left_hand",))
    run = simulated(dispatch, lambda i, seconds: seconds + 3 * (i == late))
    assert run.timed is not None
    ends = {slot.step.path: slot.end for slot in run.timed.slots}
    assert [ends[slot.step.path] - slot.end for slot in timed.slots if slot.actors == ("right_hand",)] == [0] * 16
    assert run.timed.makespan == timed.makespan + 3


def fuse(match: int, mend: int) -> TimedPlan | None:
    """Return the plan of a world in which a match must burn while a fuse is mended."""
    return concurrent.plan(problem_of(burning(match, mend)), Limits())[1].plan


def burning(match: int, mend: int) -> TimedWorld:
    light = Action(match, None, (), (("start", (0, True)), ("end", (0, False))))
    return TimedWorld(
        2, (light, Action(mend, None, (("throughout", (0, True)),), (("end", (1, True)),))), frozenset(), ((1, True),)
    )


@pytest.mark.parametrize(("match", "mend", "held_back"), [(10, 5, 0), (6, 5, 2)])
def test_a_step_whose_condition_might_end_too_early_is_held_back(match: int, mend: int, held_back: int) -> None:
    timed = fuse(match, mend)
    assert timed is not None
    run = executed(problem_of(burning(match, mend)), timed, 0)
    assert len(run.waiting) == held_back


def test_a_missed_deadline_is_reported_as_soon_as_it_is_certain() -> None:
    problem, timed = served()
    goal = next(s for s in problem.goal if any(s.arguments[0] in slot.step.arguments for slot in timed.slots))
    strict = replace(problem, times=Times(deadlines={Symbol(goal.situation, goal.arguments): Fraction(1)}))
    dispatch = Dispatch(strict, timed)
    (late,) = dispatch.late(Fraction(0))
    assert late.goal == goal
    assert late.certain
    assert simulated(dispatch, lambda i, seconds: seconds).said == {goal: 0}


def test_a_deadline_that_passes_while_a_step_is_executed_is_reported_at_the_deadline() -> None:
    problem = problem_of(TimedWorld(1, (Action(5, None, (), (("end", (0, True)),)),), frozenset(), ((0, True),)))
    problem = replace(problem, times=Times(deadlines=dict.fromkeys(problem.goal, Fraction(6))))
    timed = in_time(problem, Plan((Step((0,), 0, 1, "A0", ()),))).plan
    assert timed is not None
    (known,) = simulated(Dispatch(problem, timed, SPREAD), lambda i, seconds: 2 * seconds).said.values()
    assert 6 < known < 6.1


@pytest.mark.parametrize(("spread", "late"), [(Fraction(0), True), (SPREAD, False)])
def test_turns_are_exchanged_for_a_deadline_that_the_longest_durations_miss(spread: Fraction, late: bool) -> None:
    problem, timed = served()
    strict = replace(problem, times=Times(deadlines={Symbol("BEVERAGE", ("cup1",)): Fraction(12)}))
    run = simulated(Dispatch(strict, timed, spread), lambda i, seconds: seconds * (1 + SPREAD))
    assert run.timed is not None
    assert [bool(run.said), validate_timed(strict, run.timed, executed=True) != []] == [late, late]


def test_a_deadline_that_the_longest_durations_keep_changes_nothing() -> None:
    problem, timed = served()
    loose = replace(problem, times=Times(deadlines={Symbol("BEVERAGE", ("cup1",)): Fraction(15)}))
    run = simulated(Dispatch(loose, timed, SPREAD), lambda i, seconds: seconds)
    assert run.timed is not None
    assert run.timed.makespan == timed.makespan
