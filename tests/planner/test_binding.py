"""Shortened plans also satisfy conditions that only an upper level states."""

from __future__ import annotations

from dataclasses import replace

import pytest

from confab.planner.hierarchical.inherited_preconditions import binding
from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Plan
from confab.planner.validation import successor, validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import ClassCondition, Symbol, ValueCondition
from worlds.families import family, tabletop


def filled_and_moved(problem: Problem, found: Plan) -> list[str]:
    """Return the primitives that put down a filled cup at another place than the place where it was filled."""
    state, at, moved = dict(problem.initial), dict[str, str](), list[str]()
    for step in found.primitives:
        after = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state)
        assert after is not None
        for cup in problem.classes["Cup"]:
            place = after[Symbol("LOCATION", (cup,))]
            rests = after[Symbol("BEVERAGE", (cup,))] != "no_beverage" and place != "in_hand"
            if rests and at.setdefault(cup, place) != place:
                moved.append(str(step))
        state = after
    return moved


@pytest.mark.parametrize(
    ("name", "seed"), [("served", 100), ("served", 101), ("served", 102), ("blocked", 100), ("blocked", 101)]
)
def test_shortening_moves_no_filled_cup(name: str, seed: int) -> None:
    problem = family(name, 4, seed)
    found = plan(problem).plan
    assert found is not None
    assert not validate(problem, found)
    assert not filled_and_moved(problem, found)


def test_without_the_condition_shortening_would_move_a_filled_cup() -> None:
    """This test shows that the test above can fail: without the condition on filled cups, such plans are shorter and are found."""
    problem = family("served", 4, 101)
    move = problem.domain.behaviors["B1_MOVE"]
    loose = replace(move, preconditions=tuple(c for c in move.preconditions if "BEVERAGE" not in repr(c)))
    domain = replace(problem.domain, behaviors={**problem.domain.behaviors, "B1_MOVE": loose})
    free, bound = plan(replace(problem, domain=domain)).plan, plan(problem).plan
    assert free is not None
    assert bound is not None
    assert filled_and_moved(problem, free)
    assert free.length[3] < bound.length[3]


def test_plans_that_satisfy_the_condition_are_still_shortened() -> None:
    problem = family("blocked", 4, 100)
    first, short = plan(problem, improve=0).plan, plan(problem).plan
    assert first is not None
    assert short is not None
    assert short.length[3] < first.length[3]


def test_preconditions_of_a_level_are_translated_into_the_terms_of_the_lower_level() -> None:
    problem = tabletop()
    own = problem.domain.behaviors["B2_PLACE"].preconditions
    bound = binding(problem, 2).behaviors["B2_PLACE"].preconditions
    assert bound[: len(own)] == own
    (guard,) = bound[len(own) :]
    assert ValueCondition("BEVERAGE", ("?object",), "no_beverage") in guard.alternatives[0][0].alternatives[0]  # type: ignore[union-attr]
    assert ClassCondition("?object", "Cup", negated=True) in guard.alternatives[0][0].alternatives[1]  # type: ignore[union-attr]


def test_values_that_the_upper_level_does_not_see_get_no_additional_preconditions() -> None:
    problem = tabletop()
    assert binding(problem, 2).behaviors["B2_PICK"] == problem.domain.behaviors["B2_PICK"]


def test_the_first_level_gets_no_additional_preconditions() -> None:
    problem = tabletop()
    assert binding(problem, 1) == problem.domain
