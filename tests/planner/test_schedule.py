"""The partial order that a plan needs, and both hands at once."""

from functools import cache

import networkx
from hypothesis import given
from hypothesis import strategies as st

from planner.acting.schedule import Order, makespan, partial_order, schedule
from planner.hierarchical.planner import plan
from planner.plan import Plan
from planner.validation import validate
from reasoner.graph.knowledge import load
from reasoner.reading.problem import read
from reasoner.symbols import Problem


@cache
def serving() -> Problem:
    return read(load("beverage-serving")).problem


@cache
def planned() -> Plan:
    found = plan(serving()).plan
    assert found is not None
    return found


@cache
def needed() -> Order:
    return partial_order(serving(), planned().primitives)


def test_both_hands_take_at_most_three_quarters_of_the_time_of_one() -> None:
    slots = schedule(serving(), planned().primitives)
    assert len(slots) == 32
    assert makespan(slots) <= 0.75 * 32


def test_no_hand_does_two_things_at_once() -> None:
    slots = schedule(serving(), planned().primitives)
    for one in slots:
        for other in slots:
            if one is not other and one.worker == other.worker:
                assert one.end <= other.begin or other.end <= one.begin


def test_without_room_for_two_it_is_done_one_by_one() -> None:
    slots = schedule(serving(), planned().primitives, apart=lambda one, other: False)
    assert makespan(slots) == 32


@given(st.randoms(use_true_random=False))
def test_every_order_that_keeps_the_partial_order_is_a_plan_to_the_same_end(random: object) -> None:
    primitives, order = planned().primitives, needed()
    key = {i: random.random() for i in order}  # type: ignore[attr-defined]
    line = networkx.lexicographical_topological_sort(order, key=lambda i: key[i])
    assert validate(serving(), Plan(tuple(primitives[i] for i in line))) == []


def test_a_pour_waits_for_the_cup_and_the_cup_for_nobody() -> None:
    primitives = planned().primitives
    order = partial_order(serving(), primitives)
    position = {str(step): i for i, step in enumerate(primitives)}
    reach_cup1 = position["10 B3_REACH_HAND_OBJECT right_hand cup1"]
    put_down = next(i for i, step in enumerate(primitives) if step.id == 30)
    assert networkx.has_path(order, put_down, reach_cup1)
    assert not list(order.predecessors(position["8 B3_REACH_HAND_OBJECT right_hand bottle1"]))
