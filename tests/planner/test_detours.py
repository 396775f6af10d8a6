"""Superfluous steps of a plan are removed if they are many: a chest that every step unlocks and locks again."""

import pytest

from confab.planner.hierarchical.call import Call, compiled
from confab.planner.hierarchical.detours import without_detours
from confab.planner.hierarchical.planner import plan
from confab.planner.hierarchical.shortening import shortened
from confab.planner.levels import levels_left
from confab.planner.validation import validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, SituationType
from worlds.writing import becomes, behavior, has, lacks, world


def chest(items: int) -> Problem:
    """Return a world in which items are fetched from a chest whose rest value is locked."""
    names = tuple(f"item{number}" for number in range(items))
    return world(
        [SituationType("AT", ("Item",), "Place"), SituationType("LID", ("Chest",), "LID", level=2, rest="locked")],
        [
            behavior("FETCH", 1, "?i:Item", [has("AT", "?i", "inside")], [becomes("AT", "?i", "table")]),
            behavior("TAKE", 2, "?i:Item", [has("AT", "?i", "inside"), has("LID", "chest", "open")],
                     [becomes("AT", "?i", "table")]),
            behavior("UNLOCK", 2, "", [has("LID", "chest", "locked")], [becomes("LID", "chest", "shut")]),
            behavior("OPEN", 2, "", [has("LID", "chest", "shut")], [becomes("LID", "chest", "open")]),
            behavior("SHUT", 2, "", [has("LID", "chest", "open")], [becomes("LID", "chest", "shut")]),
            behavior("LOCK", 2, "", [has("LID", "chest", "shut"), lacks("LID", "chest", "open")],
                     [becomes("LID", "chest", "locked")]),
        ],
        {"Item": names, "Chest": ("chest",), "Place": ("inside", "table"), "LID": ("locked", "shut", "open")},
        {**{f"AT {name}": "inside" for name in names}, "LID chest": "locked"},
        {f"AT {name}": "table" for name in names},
    )  # fmt: skip


def names(problem: Problem, leave_levels: bool = True) -> list[str]:
    """Return the primitives of a problem's plan."""
    found = plan(problem, leave_levels=leave_levels).plan
    assert found is not None
    assert validate(problem, found) == []
    assert [left for left in levels_left(problem, found) if left.broken] == []
    return [step.behavior for step in found.primitives]


def test_a_plan_leaves_a_level_if_a_plan_that_keeps_it_would_be_much_longer() -> None:
    assert names(chest(4)) == ["UNLOCK", "OPEN", *["TAKE"] * 4, "SHUT", "LOCK"]
    assert len(names(chest(4), leave_levels=False)) == 20


def test_a_plan_that_is_slightly_longer_with_its_levels_keeps_them() -> None:
    found = plan(chest(1)).plan
    assert found is not None
    assert found.length == {1: 1, 2: 5}


@pytest.mark.parametrize("items", [2, 3, 5])
def test_pairs_of_steps_that_cancel_each_other_are_removed_from_the_inside_out(items: int) -> None:
    problem = chest(items)
    call = Call(problem, compiled(problem), None, 1000)
    for item in range(items):
        step = call.refiner.do(1, "FETCH", (f"item{item}",))
        assert step is not None
        call.steps.append(step)
    end = call.table.state()
    left = without_detours(call.refiner, call.steps, 2)
    assert call.table.state() == problem.initial
    assert [step.behavior for step in left] == ["UNLOCK", "OPEN", *["TAKE"] * items, "SHUT", "LOCK"]
    call.replace_steps(left)
    assert call.table.state() == end


@pytest.mark.parametrize("inside", [True, False])
def test_primitives_after_the_first_state_with_all_goals_are_dropped_even_without_time(inside: bool) -> None:
    problem = world(
        [
            SituationType("AT", ("Item",), "Place"),
            SituationType("VAN", ("Van",), "Place", level=2),
            SituationType("LAMP", ("Van",), "Truth", level=2, rest=FALSE, boolean=True),  # on, and nothing changes it
        ],
        [
            behavior("BRING", 1, "?i:Item ?p:Place", [lacks("AT", "?i", "?p")], [becomes("AT", "?i", "?p")]),
            behavior("CARRY", 2, "?i:Item ?p:Place", [has("VAN", "van", "?p")], [becomes("AT", "?i", "?p")]),
            behavior("DRIVE", 2, "?p:Place", [lacks("VAN", "van", "?p")], [becomes("VAN", "van", "?p")]),
        ],
        {"Item": ("item",), "Van": ("van",), "Place": ("north", "south", "west")},
        {"AT item": "north", "VAN van": "north", "LAMP van": TRUE},
        {"AT item": "south"},
    )  # fmt: skip
    call = Call(problem, compiled(problem), None, 1000)
    step, idle = call.refiner.do(1, "BRING", ("item", "south")), call.refiner.do(2, "DRIVE", ("west",))
    assert step is not None
    assert idle is not None
    call.steps = [step._replace(steps=(*step.steps, idle))] if inside else [step, idle]
    call.space.deadline = 0.0  # no time is left for shortening
    shortest = shortened(call, 1, True, lambda call: None)
    assert validate(problem, shortest) == []
    assert shortest.length == {1: 1, 2: 2}
