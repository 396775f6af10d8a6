"""The default planner solves solvable problems, proves unsolvable problems, and never confuses the two."""

from __future__ import annotations

import math
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import pytest

from confab.planner.grounded.grounding import ground as grounded
from confab.planner.grounded.shortest import each_goal_alone, shortest
from confab.planner.grounded.task import Task
from confab.planner.hierarchical import bounds as optimal
from confab.planner.hierarchical.planner import compiled, plan
from confab.planner.paper.transitions import Model, ground
from confab.planner.plan import Limits, Status
from confab.planner.validation import validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol
from tests.planner.test_subgoals import museum
from worlds.families import FAMILIES, family, random_table, table, tabletop
from worlds.rooms import rooms
from worlds.truth import StateSpace, TooManyError

EASY = [name for name in FAMILIES if name != "packed"]


def paper_table() -> Problem:
    return table(
        8,
        2,
        2,
        2,
        [4, 3, 2, 1],
        {"bottle1": 4, "bottle2": 3, "cup1": 7, "cup2": 5},
        {"cup1": "beverage1", "cup2": "beverage2"},
        [{1, 2, 3, 5, 6, 7}, {3, 4, 6, 7, 8}],
    )


def steps_of(problem: Problem, level: int, most: int = 10**6) -> float | None:
    """Return the least number of steps of a level, infinity if there is no plan, or None if the search is too large."""
    task = grounded(problem, level)
    if not isinstance(task, Task):
        return math.inf
    found = shortest(task, most_expanded=most)
    return found.bound if found.plan is not None or found.bound == math.inf else None


def test_the_papers_task_takes_4_steps_10_steps_and_32_steps() -> None:
    outcome = plan(paper_table())
    assert outcome.plan is not None
    assert outcome.plan.length == {1: 4, 2: 10, 3: 32}
    assert validate(paper_table(), outcome.plan) == []


@pytest.mark.parametrize("n", [4, 10, 50])
@pytest.mark.parametrize("name", EASY)
def test_every_family_is_solved_without_a_fallback(name: str, n: int) -> None:
    problem = family(name, n)
    outcome = plan(problem, limits=Limits(seconds=60))
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert outcome.fallbacks == 0
    assert validate(problem, outcome.plan) == []


@pytest.mark.parametrize("hands", [1, 4, 8])
def test_other_numbers_of_hands_are_served(hands: int) -> None:
    problem = family("served" if hands > 1 else "swap", 10, hands=hands)
    outcome = plan(problem, limits=Limits(seconds=60))
    if hands == 1:
        assert outcome.status is not Status.GAVE_UP
    else:
        assert outcome.plan is not None
        assert validate(problem, outcome.plan) == []


@pytest.mark.parametrize("name", ["served", "swap", "rotate"])
def test_the_scope_of_a_search_contains_a_hand_that_satisfies_an_existential_condition(name: str) -> None:
    """One of eight hands must reach both places: a scope without such a hand has no plan, so the whole level would be searched."""
    outcome = plan(family(name, 10, hands=8))
    assert outcome.plan is not None
    assert outcome.fallbacks == 0
    assert outcome.search[1].evaluated < 500  # in the whole world, thousands are evaluated


def test_the_effort_grows_in_proportion_to_the_number_of_objects_up_to_a_thousand() -> None:
    small, large = plan(family("served", 100), improve=0), plan(family("served", 1000), improve=0)
    assert large.plan is not None
    assert large.plan.length[3] > 9000
    assert large.search[1].expanded < 13 * small.search[1].expanded
    assert large.search[2].expanded + large.search[3].expanded < 60  # refinements are searched once, and then replayed


@pytest.mark.parametrize("part", range(4))
def test_random_tables_agree_with_exhaustive_search(part: int) -> None:
    for seed in range(20_000 + 10 * part, 20_000 + 10 * (part + 1)):
        problem = random_table(seed)
        fewest = steps_of(problem, 3, 5_000)
        if fewest is None:
            continue  # the benchmark tests larger scenes
        outcome = plan(problem)
        assert (outcome.status is Status.SOLVED) == (fewest < math.inf), seed
        assert outcome.status is not Status.GAVE_UP, seed
        if outcome.plan is not None:
            assert validate(problem, outcome.plan) == [], seed


@pytest.mark.parametrize("level", [1, 2])
def test_exhaustion_reaches_exactly_the_states_that_the_papers_model_reaches(level: int) -> None:
    for seed in range(30_000, 30_012):
        problem = random_table(seed)
        model = Model(problem)
        grounds = ground(problem, level)
        seen = {model.values(problem.initial)}
        queue = list(seen)
        while queue:
            for applied in model.successors(grounds, queue.pop()):
                if applied.after not in seen:
                    seen.add(applied.after)
                    queue.append(applied.after)
        task = grounded(problem, level, goal={})
        assert isinstance(task, Task)
        nowhere = replace(task, size=task.size + 1, goal=1 << task.size)
        assert len(shortest(nowhere).states) == len(seen), seed


def test_a_place_that_no_hand_reaches_is_named() -> None:
    problem = table(8, 2, 1, 1, [1, 2], {"cup1": 8}, {}, [{1, 2, 3}, {2, 3, 4}])
    outcome = plan(problem)
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None
    assert outcome.reason.text.startswith(
        "cup1 LOCATION location8 can't be reached: B3_REACH_HAND_LOCATION requires a Hand that canReach location8"
    )
    assert {"cup1", "LOCATION", "location8", "canReach"} <= set(outcome.reason.terms)


def test_two_goals_for_one_place_are_named() -> None:
    problem = table(8, 2, 2, 1, [1, 2, 3], {"cup1": 4, "cup2": 4}, {}, [{1, 2, 3, 4}, {2, 3, 4}])
    outcome = plan(problem)
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None
    assert "exclude each other" in outcome.reason.text
    assert {"cup1", "cup2", "location4"} <= set(outcome.reason.terms)


def test_a_full_table_is_solved_on_a_lower_level() -> None:
    problem = table(3, 2, 3, 0, [1, 2, 3], {"cup1": 2, "cup2": 1, "cup3": 3}, {}, [{1, 2, 3}, {1, 2, 3}])
    outcome = plan(problem)
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []
    assert outcome.fallbacks > 0


def test_a_goal_that_holds_already_needs_no_step() -> None:
    problem = replace(paper_table(), goal={Symbol("LOCATION", ("cup1",)): "location2"})
    outcome = plan(problem)
    assert outcome.plan is not None
    assert outcome.plan.steps == ()


@pytest.mark.parametrize("seconds", [1.0, 2.0])
def test_the_time_limit_is_obeyed(seconds: float) -> None:
    problem = family("packed", 30, seed=3)
    using = compiled(problem)
    over = []
    for _ in range(3):  # the machine may be busy with other processes
        begin = perf_counter()
        outcome = plan(problem, limits=Limits(seconds=seconds), using=using)
        over.append(perf_counter() - begin - seconds)
        assert outcome.status is not Status.UNSOLVABLE
        if outcome.reason is not None:
            assert "time limit" in outcome.reason.text
    assert min(over) < 0.1 * seconds


def test_a_limit_of_expansions_is_obeyed_and_reported() -> None:
    outcome = plan(family("packed", 30, seed=3), limits=Limits(expansions=50))
    assert outcome.status is Status.GAVE_UP
    assert outcome.reason is not None
    assert "50 expansions" in outcome.reason.text


def test_the_reason_for_giving_up_names_the_next_goal_and_the_step_without_refinement() -> None:
    outcome = plan(museum(21), limits=Limits(expansions=50))
    assert outcome.reason is not None
    assert outcome.reason.text == (
        "stopped at the limit: 50 expansions; 0 of 1 goals were reached, picture HANGS room20 was next; "
        "MOVE picture room20 wasn't refined there"
    )
    assert {"HANGS", "picture", "room20", "MOVE"} <= set(outcome.reason.terms)


def test_improvement_never_lengthens_a_plan_and_keeps_it_valid() -> None:
    for name in ("full", "rotate"):
        problem = family(name, 10, seed=1)
        first, improved = plan(problem, improve=0).plan, plan(problem, improve=20).plan
        assert first is not None
        assert improved is not None
        assert len(improved.primitives) <= len(first.primitives)
        assert validate(problem, improved) == []


def test_improvement_removes_a_put_down_that_a_pick_up_undoes() -> None:
    problem = table(4, 2, 2, 0, [1, 2], {"cup1": 2, "cup2": 1}, {}, [{1, 2, 3, 4}, {1, 2, 3, 4}])
    improved = plan(problem).plan
    assert improved is not None
    assert len(improved.primitives) == 12  # both objects are held at once; 18 if one is put aside
    assert validate(problem, improved) == []


def test_the_same_input_gives_the_same_plan_in_any_process() -> None:
    code = (
        "from worlds.families import family\nfrom confab.planner.hierarchical.planner import plan\n"
        "for f in ('served', 'full', 'blocked'):\n"
        "    print([(str(s), sorted(s.bindings.items())) for s in plan(family(f, 6)).plan.walk()])"
    )
    root = Path(__file__).parents[2]
    printed = {
        subprocess.run(
            [sys.executable, "-c", code], cwd=root, env={"PYTHONHASHSEED": seed}, capture_output=True, check=True
        ).stdout
        for seed in ("0", "1")
    }
    assert len(printed) == 1


def test_compiled_domains_and_found_refinements_are_reused_for_another_goal() -> None:
    problem = family("served", 10)
    using = compiled(problem)
    plan(problem, using=using)
    other = replace(problem, goal={Symbol("LOCATION", ("cup1",)): "location20"})
    outcome = plan(other, using=using)
    assert outcome.plan is not None
    assert validate(other, outcome.plan) == []
    assert outcome.search[3].expanded == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_domain_with_booleans_disjunction_and_keys_is_planned(seed: int) -> None:
    problem = rooms(6, seed)
    outcome = plan(problem)
    assert (outcome.status is Status.SOLVED) == (steps_of(problem, 1) != math.inf)
    assert outcome.status is not Status.GAVE_UP
    if outcome.plan is not None:
        assert validate(problem, outcome.plan) == []


def test_the_shipped_scene_has_the_behaviours_of_the_table_of_the_families() -> None:
    assert set(tabletop().domain.behaviors) == set(paper_table().domain.behaviors)


@pytest.mark.parametrize("name", ["swap", "rotate", "blocked"])
def test_a_small_task_takes_as_few_steps_of_the_middle_level_as_any_plan(name: str) -> None:
    problem = family(name, 4)
    better = plan(problem).plan
    assert better is not None
    assert validate(problem, better) == []
    end = {symbol: value for symbol, value in problem.initial.items() if symbol.situation == "HOLDS"}
    assert len(better.at_level(2)) == steps_of(replace(problem, goal=end | dict(problem.goal)), 2)


def test_a_search_with_an_upper_bound_finds_the_same_shortest_plans() -> None:
    compared = 0
    for seed in range(40_000, 40_040):
        task = grounded(random_table(seed), 2)
        if isinstance(task, Task):
            truth = shortest(task).bound
            below = min(truth, 30) + 1
            assert min(shortest(task, each_goal_alone(task), below).bound, below) == min(truth, below), seed
            assert shortest(task, each_goal_alone(task), truth).plan is None, seed
            compared += truth < math.inf
    assert compared > 10


def test_the_time_limit_also_holds_if_only_the_lowest_level_is_planned() -> None:
    problem = family("swap", 50)
    level = problem.domain.levels[-1]
    only = {behavior.name: behavior for behavior in problem.domain.at_level(level)}
    flat = replace(problem, domain=replace(problem.domain, behaviors=only))
    over = []
    for search in (plan, optimal.plan):
        begin = perf_counter()
        outcome = search(flat, limits=Limits(expansions=10**9, seconds=1.0))
        over.append(perf_counter() - begin - 1.0)
        assert outcome.status is Status.GAVE_UP
    assert max(over) < 1.0  # a tenth on an idle machine


@pytest.mark.parametrize("n", [4, 10])
def test_a_table_without_a_free_place_is_solved_by_two_hands(n: int) -> None:
    problem = family("packed", n)
    outcome = plan(problem)
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []


def test_a_goal_out_of_reach_is_proved_without_grounding_a_large_table() -> None:
    problem = family("served", 200)
    place = "location401"
    classes = {
        kind: (*members, place) if "location1" in members else members for kind, members in problem.classes.items()
    }
    cup = next(symbol.arguments[0] for symbol in problem.goal if symbol.situation == "BEVERAGE")
    fallen = replace(problem, classes=classes, initial={**problem.initial, Symbol("LOCATION", (cup,)): place})
    tracemalloc.start()
    outcome = plan(fallen)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None
    assert cup in outcome.reason.text
    assert most < 300e6


def test_the_state_space_of_the_benchmarks_agrees_with_exhaustive_search() -> None:
    for seed in range(43_000, 43_010):
        problem = random_table(seed)
        try:
            truth = StateSpace(problem).explore(20_000)
        except TooManyError:
            continue
        steps = steps_of(problem, 3)
        assert (math.inf if truth.shortest is None else truth.shortest) == steps, seed
