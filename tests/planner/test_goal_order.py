"""Goals that have to be achieved before others: necessary orders of goals that no operator makes false."""

from __future__ import annotations

import itertools
import random

import pytest

from confab.planner.grounded.best_first import plan_level
from confab.planner.grounded.exploring import explore, path_to
from confab.planner.grounded.goal_order import ordered
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.shortest import AStar, nothing
from confab.planner.grounded.task import Task
from confab.planner.plan import Counts, Limits, Status
from confab.planner.validation import validate
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem

VARNISHING = """(define (domain varnishing) (:requirements :typing :conditional-effects) (:types cell)
 (:predicates (way ?p ?q - cell) (me ?p - cell) (dry ?p - cell) (done ?p - cell) (dust ?p - cell) (clean ?p - cell))
 (:action go :parameters (?p ?q - cell) :precondition (and (me ?p) (way ?p ?q) (dry ?q))
  :effect (and (me ?q) (not (me ?p)) (dry ?p) (not (dry ?q))))
 (:action varnish :parameters (?p ?q - cell) :precondition (and (me ?p) (way ?p ?q) (dry ?q))
  :effect (and (done ?q) (not (dry ?q)) (when (dust ?p) (clean ?q)))))"""


def floor(cells: str, ways: list[str], start: str, goals: list[str], dusty: str = "") -> Problem:
    """A varnisher that can't step on varnish; each way is a pair of neighbouring cells."""
    both = " ".join(f"(way {way[0]} {way[1]}) (way {way[1]} {way[0]})" for way in ways)
    text = f"""(define (problem p) (:domain varnishing) (:objects {" ".join(cells)} - cell)
     (:init (me {start}) {both} {" ".join(f"(dry {c})" for c in cells if c != start)} {" ".join(f"(dust {c})" for c in dusty)})
     (:goal (and {" ".join(goals)})))"""
    return imported(parse(VARNISHING, text)).problem


def grounded(problem: Problem) -> Task:
    task = ground(problem)
    assert isinstance(task, Task)
    return task


def least_cost(task: Task) -> int | None:
    """The cost of a cheapest plan, by a search of all states without a bound."""
    order = AStar(task, nothing, float("inf"), Counts())
    list(explore(task, order))
    return None if order.best is None else len(path_to(order.reached, order.best))


def test_varnishing_a_corridor_from_its_end_follows_from_an_order_of_all_goals() -> None:
    cells = "abcdefghij"
    problem = floor(cells, [p + q for p, q in itertools.pairwise(cells)], "a", [f"(done {c})" for c in "jihgfedcb"])
    outcome = plan_level(problem, limits=Limits(expansions=30))
    assert outcome.status is Status.SOLVED and outcome.plan is not None and validate(problem, outcome.plan) == []
    assert [step.arguments[1] for step in outcome.plan.steps if step.behavior == "VARNISH"] == list("jihgfedcb")


@pytest.mark.parametrize("seed", range(60))
def test_no_order_of_goals_excludes_a_cheapest_plan(seed: int) -> None:
    rng = random.Random(seed)
    cells = "abcdefg"[: rng.randint(4, 7)]
    ways = [rng.choice(cells[:i]) + cells[i] for i in range(1, len(cells))]  # a tree, and some more ways
    ways += [p + q for p in cells for q in cells if p < q and rng.random() < 0.15]
    goals = [f"({rng.choice(['done', 'done', 'clean', 'dry'])} {c})" for c in cells if rng.random() < 0.7]
    goals += [f"(me {rng.choice(cells)})"] * (rng.random() < 0.3)
    problem = floor(
        cells, ways, rng.choice(cells), goals or ["(done a)"], "".join(c for c in cells if rng.random() < 0.5)
    )
    task = ground(problem)
    if isinstance(task, Task):
        assert least_cost(ordered(task)) == least_cost(task)


def test_the_random_floors_have_orders_and_plans() -> None:
    """Otherwise the test before would show nothing."""
    task = grounded(floor("abcd", ["ab", "bc", "cd"], "a", ["(done b)", "(done c)", "(done d)"]))
    assert ordered(task) is not task and least_cost(task) == 7
    free = grounded(floor("abcd", ["ab", "ac", "ad"], "a", ["(done b)", "(done c)", "(done d)"]))
    assert ordered(free) is free


def test_goals_that_an_operator_makes_false_have_no_necessary_order() -> None:
    task = grounded(floor("abcd", ["ab", "bc", "cd"], "a", ["(me b)", "(dry c)", "(dry d)"]))
    assert ordered(task) is task
