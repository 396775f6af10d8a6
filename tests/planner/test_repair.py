"""Repair keeps what is still valid, and is a plan; where it is worse than replanning it gives way."""

import random
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import pytest

from planner.acting.repair import CLOSE, changed_individuals, difference, mend, rejected, replan, vanished
from planner.hierarchical.planner import plan
from planner.hierarchical.serialization import Compiled, compiled
from planner.plan import Limits, Plan, Status, Step
from planner.plan_costs import cost_of
from planner.validation import successor
from reasoner.graph.knowledge import load
from reasoner.reading.problem import read
from reasoner.symbols import Problem, State, Symbol
from worlds.families import family, tabletop


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


def carried_out(problem: Problem, state: State, steps: Sequence[Step]) -> State:
    for step in Plan(tuple(steps)).primitives:
        following = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state)
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
    end = carried_out(now, now.initial, mended.steps)
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


def test_who_is_touched_by_a_change_is_named_by_it_before_or_after() -> None:
    now = replace(
        serving(),
        initial={
            **{s: v for s, v in serving().initial.items() if s != location("bottle1")},
            location("cup1"): "location7",
            Symbol("LOCATION", ("stranger",)): "location8",
        },
        goal={location("cup2"): "location6"},
    )
    was = {s: v for s, v in serving().goal.items() if s != location("cup2")}
    touched = {"cup1", "location7", serving().initial[location("cup1")], "stranger", "location8", "bottle1"}
    touched |= {serving().initial[location("bottle1")], "cup2", "location6", "false"}
    touched |= {name for symbol, value in was.items() for name in (*symbol.arguments, value)}
    touched |= {value for symbol, value in serving().goal.items() if symbol == location("cup2")}
    assert changed_individuals(serving(), now) == touched
    assert changed_individuals(now, serving()) == touched
    assert changed_individuals(serving(), serving()) == set()


def test_a_step_that_is_under_way_is_finished_unless_it_may_not_be() -> None:
    first, *others = planned().steps
    pick, place = first.steps
    begun = replace(serving(), initial=carried_out(serving(), serving().initial, (pick,)))
    rest = (replace(first, steps=(place,)), *others)
    mended = mend(begun, rest, begun, using=using())
    assert (mended.kind, mended.steps is not None) == ("repair", True)
    assert mended.steps is not None
    assert difference(rest, mended.steps) == (0, 0)
    anew = mend(begun, rest, begun, using=using(), in_progress=False)
    assert anew.steps is not None
    end = carried_out(begun, begun.initial, anew.steps)
    assert all(end[symbol] == value for symbol, value in begun.goal.items())
    assert 0 <= mended.seconds < 60
    assert mended.cost == cost_of(begun, Plan(mended.steps))


def test_a_limit_of_time_is_kept_to() -> None:
    now = replace(serving(), initial={**serving().initial, location("cup1"): "location7"})
    late = mend(now, planned().steps, serving(), using=using(), limits=Limits(seconds=-1.0))
    assert late.steps is None
    assert late.outcome is not None
    assert late.outcome.status is Status.GAVE_UP
    assert late.cost == 0
    assert 0 <= late.seconds < 60
    begun = replace(serving(), initial=carried_out(serving(), serving().initial, planned().steps[0].steps[:1]))
    assert mend(begun, (), begun, using=using(), limits=Limits(seconds=-1.0)).steps is None
    assert mend(now, planned().steps, serving(), using=using(), limits=Limits(seconds=60.0)).steps is not None


def rest_of(steps: Sequence[Step], done: int) -> tuple[Step, ...]:
    """Return what is left to do of steps after some of their primitives."""
    found = []
    for step in steps:
        many = len(Plan((step,)).primitives)
        if done < many:
            found.append(replace(step, steps=rest_of(step.steps, done)) if done else step)
        done = max(done - many, 0)
    return tuple(found)


@pytest.mark.parametrize(
    ("name", "n", "kept", "cost", "changed"),
    [
        ("served", 4, 6, 167, 60),
        ("swap", 6, 5, 246, 128),
        ("full", 4, 8, 107, 48),
        ("handover", 5, 7, 246, 86),
        ("blocked", 5, 8, 184, 38),
    ],
)
def test_whatever_is_moved_whenever_little_is_done_otherwise(
    name: str, n: int, kept: int, cost: float, changed: int
) -> None:
    """Of eight interruptions somewhere in a plan as many are repaired, at no more cost, with no more steps dropped or added."""
    problem = family(name, n)
    uses = compiled(problem)
    whole = plan(problem, using=uses).plan
    assert whole is not None
    repaired, spent, different = 0, 0.0, 0
    for seed in range(8):
        draw = random.Random(seed)
        done = draw.randrange(len(whole.primitives) - 1)
        rest, state = rest_of(whole.steps, done), carried_out(problem, problem.initial, whole.primitives[:done])
        stand = {s: v for s, v in state.items() if s.situation == "LOCATION" and v != "in_hand"}
        moved = draw.choice(sorted(stand))
        place = draw.choice(sorted({*problem.classes["Location"]} - {*stand.values(), "in_hand"}))
        now = replace(problem, initial={**state, moved: place})
        mended = mend(now, rest, replace(problem, initial=state), using=uses)
        assert mended.steps is not None
        end = carried_out(problem, now.initial, mended.steps)
        assert all(end[symbol] == value for symbol, value in problem.goal.items())
        repaired += mended.kind == "repair"
        spent += mended.cost
        different += sum(difference(rest, mended.steps))
    assert repaired >= kept
    assert spent <= cost
    assert different <= changed
