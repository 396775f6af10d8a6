"""The necessary partial order of a plan, and execution with both hands at once."""

from functools import cache
from random import Random

import networkx
import pytest
from hypothesis import given
from hypothesis import strategies as st

import confab
from confab.planner.acting.schedule import PartialOrder, partial_order, ready, urgency_of, worker_of
from confab.planner.plan import Plan, Step
from confab.planner.validation import validate
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import FALSE, TRUE, Behavior, SituationType, Symbol, ValueEffect
from tests.planner.serving import planned, serving
from tests.planner.slots import schedule


@cache
def needed() -> PartialOrder:
    return partial_order(serving(), planned().primitives)


def test_both_hands_take_at_most_three_quarters_of_the_time_of_one() -> None:
    slots = schedule(serving(), planned().primitives)
    assert len(slots) == 32
    assert max(slot.end for slot in slots) <= 0.75 * 32


def test_no_hand_does_two_things_at_once() -> None:
    slots = schedule(serving(), planned().primitives)
    for one in slots:
        for other in slots:
            if one is not other and one.worker == other.worker:
                assert one.end <= other.begin or other.end <= one.begin


def test_a_schedule_is_sequential_if_no_two_steps_may_overlap() -> None:
    slots = schedule(serving(), planned().primitives, apart=lambda one, other: False)
    assert max(slot.end for slot in slots) == 32


@given(st.randoms(use_true_random=False))
def test_every_linear_order_of_the_partial_order_is_a_valid_plan(random: object) -> None:
    primitives, order = planned().primitives, needed()
    key = {i: random.random() for i in order}  # type: ignore[attr-defined]
    line = networkx.lexicographical_topological_sort(order, key=lambda i: key[i])
    assert validate(serving(), Plan(tuple(primitives[i] for i in line))) == []


def test_a_step_that_needs_any_one_of_several_earlier_changes_waits_for_the_first_of_them() -> None:
    scene = confab.load(
        "panda-pair-serving"
    )  # the other hand takes the first cup from the place of the second, and puts it down
    plan = scene.plan().plan
    assert plan is not None
    order, random = partial_order(scene.problem, plan.primitives), Random(1)
    for _ in range(20):
        key = {i: random.random() for i in order}
        line = networkx.lexicographical_topological_sort(order, key=key.__getitem__)
        assert validate(scene.problem, Plan(tuple(plan.primitives[i] for i in line))) == []


def test_a_step_waits_for_an_earlier_step_that_would_undo_its_effects_even_if_that_step_changes_nothing_in_the_plan() -> (
    None
):
    def behavior(name: str, **values: str) -> Behavior:
        return Behavior(
            name, 1, (), (), (), tuple(ValueEffect(which, ("hall",), value) for which, value in values.items())
        )

    behaviors = [behavior("ENTER", LAMP=TRUE, VISITED=TRUE), behavior("LEAVE", LAMP=FALSE)]
    situations = {name: SituationType(name, ("Room",), "Truth", boolean=True) for name in ("LAMP", "VISITED")}
    lamp, visited = (Symbol(name, ("hall",)) for name in situations)
    domain = Domain(situations, {one.name: one for one in behaviors})
    problem = Problem("urn:hall", domain, {"Room": ("hall",)}, {}, {lamp: TRUE}, {lamp: FALSE, visited: TRUE})
    primitives = [Step((number,), number, 1, one.name, ()) for number, one in enumerate(behaviors)]
    assert validate(problem, Plan(tuple(primitives))) == []
    assert networkx.has_path(partial_order(problem, primitives), 0, 1)


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


FORK: PartialOrder = networkx.DiGraph([(0, 1), (1, 2), (0, 3)])


def test_the_urgency_of_a_step_is_the_duration_of_the_longest_chain_behind_it() -> None:
    assert urgency_of(FORK) == {0: 3.0, 1: 2.0, 2: 1.0, 3: 1.0}


def begin(begun: set[int], running: list[int], urgency: dict[int, float], room: bool = True) -> list[int]:
    steps = [step("A", "left"), step("B", "left"), step("C", "right"), step("D", "right")]
    return ready(FORK, steps, ["left", "right"], begun, running, urgency, lambda one, other: room)


def test_a_step_begins_when_all_before_it_has_ended_the_most_urgent_first() -> None:
    urgency = urgency_of(FORK)
    assert begin(set(), [], urgency) == [0]
    assert begin({0}, [0], urgency) == []
    assert begin({0}, [], urgency) == [1, 3]
    assert begin({0}, [], {**urgency, 3: 9.0}) == [3, 1]
    assert begin({0}, [], urgency, room=False) == [1]
    assert begin({0, 1}, [1], urgency) == [3]
    assert begin({0, 1, 3}, [3], urgency) == []


def test_the_worker_of_a_step_is_the_first_worker_among_its_arguments() -> None:
    assert worker_of(step("GIVE", "cup1", "right", "left"), ["left", "right"]) == "right"
    assert worker_of(step("WAIT", "cup1"), frozenset(["left"])) == ""


def test_a_schedule_has_the_given_durations_and_slots_sorted_by_begin() -> None:
    primitives = planned().primitives
    slow = {i: 1.0 + i % 3 for i in range(len(primitives))}
    slots = schedule(serving(), primitives, slow)
    assert all(slot.end - slot.begin == slow[slot.position] for slot in slots)
    assert [slot.begin for slot in slots] == sorted(slot.begin for slot in slots)
    assert schedule(serving(), ()) == []


def test_the_partial_order_labels_its_steps_and_refuses_inapplicable_steps() -> None:
    primitives = planned().primitives
    assert {i: data["label"] for i, data in needed().nodes(data=True)} == dict(enumerate(map(str, primitives)))
    with pytest.raises(ValueError, match="isn't applicable in the state before it"):
        partial_order(serving(), primitives[1:])
