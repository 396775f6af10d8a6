"""The necessary partial order of a plan."""

from functools import cache

import networkx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from confab.planner.acting.schedule import PartialOrder, partial_order, worker_of
from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Plan, Step
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import load
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Problem


@cache
def serving() -> Problem:
    return read(load("beverage-serving")).problem


@cache
def planned() -> Plan:
    found = plan(serving()).plan
    assert found is not None
    return found


@cache
def needed() -> PartialOrder:
    return partial_order(serving(), planned().primitives)


@given(st.randoms(use_true_random=False))
def test_every_linear_order_of_the_partial_order_is_a_valid_plan(random: object) -> None:
    primitives, order = planned().primitives, needed()
    key = {i: random.random() for i in order}  # type: ignore[attr-defined]
    line = networkx.lexicographical_topological_sort(order, key=lambda i: key[i])
    assert validate(serving(), Plan(tuple(primitives[i] for i in line))) == []


def test_reaching_for_a_cup_waits_for_its_put_down_and_reaching_for_a_bottle_waits_for_no_step() -> None:
    primitives = planned().primitives
    order = partial_order(serving(), primitives)
    position = {str(step): i for i, step in enumerate(primitives)}
    reach_cup1 = position["10 B3_REACH_HAND_OBJECT right_hand cup1"]
    put_down = next(i for i, step in enumerate(primitives) if step.id == 30)
    assert networkx.has_path(order, put_down, reach_cup1)
    assert not list(order.predecessors(position["8 B3_REACH_HAND_OBJECT right_hand bottle1"]))


# ------------------------------------------------------------------------------------------------- small ones, by hand


def step(name: str, *arguments: str) -> Step:
    return Step((0,), 0, 1, name, arguments)


def test_the_worker_of_a_step_is_the_first_worker_among_its_arguments() -> None:
    assert worker_of(step("GIVE", "cup1", "right", "left"), ["left", "right"]) == "right"
    assert worker_of(step("WAIT", "cup1"), frozenset(["left"])) == ""


def test_the_partial_order_labels_its_steps_and_refuses_inapplicable_steps() -> None:
    primitives = planned().primitives
    assert {i: data["label"] for i, data in needed().nodes(data=True)} == dict(enumerate(map(str, primitives)))
    with pytest.raises(ValueError, match="isn't applicable in the state before it"):
        partial_order(serving(), primitives[1:])
