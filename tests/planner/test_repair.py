"""Repair keeps what is still valid, and is a plan; where it is worse than replanning it gives way."""

from dataclasses import replace
from functools import cache

import pytest

from planner.acting.repair import CLOSE, difference, mend, rejected, replan, vanished
from planner.hierarchical.planner import plan
from planner.hierarchical.serialization import Compiled, compiled
from planner.plan import Limits, Plan, Step
from planner.plan_costs import cost_of
from planner.validation import successor
from reasoner.graph.knowledge import load
from reasoner.reading.problem import read
from reasoner.symbols import Problem, State, Symbol
from worlds.families import tabletop


@cache
def serving() -> Problem:
    return read(load("beverage-serving")).problem


@cache
def using() -> Compiled:
    return compiled(serving())


@cache
def planned() -> Plan:
    found = plan(serving()).plan
    assert found is not None
    return found


def after(state: State, steps: tuple[Step, ...]) -> State:
    for step in Plan(steps).primitives:
        following = successor(serving(), serving().domain.behaviors[step.behavior], step.arguments, state)
        assert following is not None, step
        state = following
    return state


def location(individual: str) -> Symbol:
    return Symbol("LOCATION", (individual,))


@pytest.mark.parametrize("changes", [{}, {location("bottle1"): "location8"}, {location("cup1"): "location7"}])
def test_what_comes_out_leads_to_the_goal_from_the_situation_as_it_is(changes: State) -> None:
    now = replace(serving(), initial={**serving().initial, **changes})
    mended = mend(now, planned().steps, serving(), using=using())
    assert mended.steps is not None
    end = after(now.initial, mended.steps)
    assert all(end[symbol] == value for symbol, value in now.goal.items())


def test_where_nothing_that_matters_has_changed_nothing_changes() -> None:
    mended = mend(serving(), planned().steps, serving(), using=using())
    assert mended.steps is not None
    assert difference(planned().steps, mended.steps) == (0, 0)


def test_what_somebody_else_has_done_is_dropped_and_no_more() -> None:
    now = replace(serving(), initial={**serving().initial, location("cup1"): "location7"})
    mended = mend(now, planned().steps, serving(), using=using())
    assert mended.steps is not None
    assert difference(planned().steps, mended.steps) == (6, 0)


def test_another_place_is_gone_to_in_place_of_the_old_one() -> None:
    now = replace(serving(), goal={**serving().goal, location("cup2"): "location6"})
    mended = mend(now, planned().steps, serving(), using=using())
    assert mended.steps is not None
    assert mended.kind == "repair"
    assert sum(difference(planned().steps, mended.steps)) < 14


def test_it_costs_at_most_a_tenth_more_than_replanning() -> None:
    for place in ("location6", "location8"):
        for individual in ("cup1", "cup2", "bottle1"):
            now = replace(serving(), goal={**serving().goal, location(individual): place})
            mended = mend(now, planned().steps, serving(), using=using())
            scratch, _ = replan(now, None, using(), Limits())
            assert (mended.steps is None) == (scratch is None)
            if scratch is not None:
                assert mended.cost <= CLOSE * cost_of(now, Plan(scratch))


def test_what_is_not_there_is_named() -> None:
    gone = {symbol: value for symbol, value in serving().initial.items() if symbol.arguments != ("cup2",)}
    reasons = vanished(replace(serving(), initial=gone))
    assert [symbol.arguments for symbol, _ in reasons] == [("cup2",), ("cup2",)]
    assert all("cup2" in reason.terms for _, reason in reasons)


def test_done_in_another_order_counts_as_dropped_and_added() -> None:
    first, second, *others = planned().steps
    assert sum(difference(planned().steps, (second, first, *others))) == 12


def test_steps_that_the_checker_rejects_are_not_followed() -> None:
    problem = tabletop()
    outcome = plan(problem)
    assert outcome.plan is not None
    assert rejected(problem, outcome.plan.steps) is None
    assert rejected(problem, outcome.plan.steps[:-1]) is not None
    assert rejected(problem, outcome.plan.steps[0].steps[1:]) is not None
