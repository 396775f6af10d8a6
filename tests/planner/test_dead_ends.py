"""An order of goals can lead to a dead end that no step undoes; the plan still has only steps of level 1."""

from confab.planner.hierarchical.call import Call, compiled, fresh_call
from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Status
from confab.planner.validation import validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, SituationType, Witness
from worlds.hierarchies import hierarchy
from worlds.writing import becomes, behavior, has, lacks, world


def slide(items: int, packed: bool = False) -> Problem:
    """Return a world in which a robot rides down a slide with an item and can't return, or ties the item to a rope and stays.

    If `packed`, the items must be packed before.
    """
    names = tuple(f"item{number}" for number in range(items))
    up, tied = has("ROBOT_AT", "robot", "top"), has("ROPE", "rope", "?i")
    ready = [has("PACKED", "?i", TRUE)] if packed else []
    return world(
        [
            SituationType("AT", ("Item",), "Place"),
            SituationType("PACKED", ("Item",), "Truth", boolean=True),
            SituationType("ROBOT_AT", ("Robot",), "Place", level=2),
            SituationType("ROPE", ("Rope",), "ROPE", level=2, rest="loose"),
        ],
        [
            behavior("SEND", 1, "?i:Item", [has("AT", "?i", "top"), *ready], [becomes("AT", "?i", "bottom")]),
            behavior("PACK", 1, "?i:Item", [has("AT", "?i", "top")], [becomes("PACKED", "?i", TRUE)]),
            behavior("WRAP", 2, "?i:Item", [has("AT", "?i", "top")], [becomes("PACKED", "?i", TRUE)]),
            behavior("RIDE", 2, "?i:Item", [up, has("AT", "?i", "top")],
                     [becomes("AT", "?i", "bottom"), becomes("ROBOT_AT", "robot", "bottom")]),
            behavior("TIE", 2, "?i:Item", [up, has("ROPE", "rope", "loose")], [becomes("ROPE", "rope", "?i")]),
            behavior("LOWER", 2, "?i:Item", [up, tied], [becomes("AT", "?i", "bottom"), becomes("ROPE", "rope", "loose")]),
        ],
        {"Item": names, "Robot": ("robot",), "Rope": ("rope",), "Place": ("top", "bottom"), "ROPE": ("loose", *names)},
        {**{f"AT {name}": "top" for name in names}, "ROBOT_AT robot": "top", "ROPE rope": "loose"},
        {f"AT {name}": "bottom" for name in names},
    )  # fmt: skip


def test_a_refinement_that_makes_a_goal_unreachable_is_replaced_by_another_one() -> None:
    problem = slide(3)
    outcome = plan(problem)
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []
    assert outcome.given_up == ()
    assert [step.behavior for step in outcome.plan.steps] == ["SEND"] * 3
    assert outcome.plan.length[2] <= 6


def test_planning_restarts_after_a_dead_end_of_goals_in_series_and_keeps_level_1() -> None:
    problem = slide(12, packed=True)
    outcome = plan(problem)
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []
    assert outcome.given_up == ()
    assert outcome.plan.length[1] == 24


def test_goals_with_a_necessary_order_are_achieved_on_level_1() -> None:
    """A cell can be marked only if no cell is plain; a plain cell can be stirred, and never becomes plain again."""
    none_plain = Witness("?o", "Cell", (lacks("FILL", "?o", "empty"), lacks("FILL", "?o", "stirred")), negated=True)
    empty, open_ = has("FILL", "?c", "empty"), has("LID", "lid", "open")
    below = [
        behavior("POUR", 2, "?c:Cell", [empty, open_], [becomes("FILL", "?c", "plain")]),
        behavior("WHISK", 2, "?c:Cell", [lacks("FILL", "?c", "empty"), open_], [becomes("FILL", "?c", "stirred")]),
        behavior("STAMP", 2, "?c:Cell", [has("FILL", "?c", "stirred"), open_], [becomes("MARKED", "?c", TRUE)]),
        behavior("OPEN", 2, "", [has("LID", "lid", "shut")], [becomes("LID", "lid", "open")]),
        behavior("SHUT", 2, "", [open_], [becomes("LID", "lid", "shut")]),
    ]
    above = [
        behavior("STIR", 1, "?c:Cell", [lacks("FILL", "?c", "empty")], [becomes("FILL", "?c", "stirred")]),
        behavior("FILL_UP", 1, "?c:Cell", [empty], [becomes("FILL", "?c", "plain")]),
        behavior("MARK", 1, "?c:Cell", [has("FILL", "?c", "stirred"), none_plain], [becomes("MARKED", "?c", TRUE)]),
    ]
    problem = world(
        [
            SituationType("FILL", ("Cell",), "FILL"),
            SituationType("MARKED", ("Cell",), "Truth", boolean=True),
            SituationType("LID", ("Lid",), "LID", level=2, rest="shut"),
        ],
        [*above, *below],
        {"Cell": ("cell1", "cell2"), "Lid": ("lid",), "FILL": ("empty", "plain", "stirred"), "LID": ("open", "shut")},
        {"FILL cell1": "empty", "FILL cell2": "empty", "LID lid": "shut", "MARKED cell1": FALSE, "MARKED cell2": FALSE},
        {"FILL cell2": "plain", "MARKED cell1": TRUE},
    )
    outcome = plan(problem, leave_levels=False)
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []
    assert outcome.given_up == ()
    assert [str(step.behavior) for step in outcome.plan.steps] == ["FILL_UP", "STIR", "MARK", "FILL_UP"]


def test_a_plan_with_fewer_steps_also_achieves_the_goals_that_level_1_does_not_see() -> None:
    """Each room needs a towel, one wash cleans all towels, and the maid must be at home in the end."""
    rooms, towels, places = ("a", "b", "c"), ("t1", "t2", "t3"), ("home", "hall")
    clean = [has("CLEAN", "?r", FALSE), has("USED", "?t", FALSE)]
    cleaned = [becomes("CLEAN", "?r", TRUE), becomes("USED", "?t", TRUE)]
    fresh = [becomes("USED", towel, FALSE) for towel in towels]
    hall = has("MAID_AT", "maid", "hall")
    problem = world(
        [
            SituationType("CLEAN", ("Room",), "Truth", boolean=True),
            SituationType("USED", ("Towel",), "Truth", boolean=True),
            SituationType("MAID_AT", ("Maid",), "Place", level=2),
        ],
        [
            behavior("CLEAN_UP", 1, "?r:Room ?t:Towel", clean, cleaned),
            behavior("WASH", 1, "", [], fresh),
            behavior("SCRUB", 2, "?r:Room ?t:Towel", [*clean, hall], cleaned),
            behavior("BOIL", 2, "", [hall], fresh),
            behavior("GO", 2, "?p:Place", [lacks("MAID_AT", "maid", "?p")], [becomes("MAID_AT", "maid", "?p")]),
        ],
        {"Room": rooms, "Towel": towels, "Maid": ("maid",), "Place": places},
        {**{f"CLEAN {r}": FALSE for r in rooms}, **{f"USED {t}": FALSE for t in towels}, "MAID_AT maid": "hall"},
        {**{f"CLEAN {r}": TRUE for r in rooms}, **{f"USED {t}": FALSE for t in towels}, "MAID_AT maid": "home"},
    )  # fmt: skip
    outcome = plan(problem)
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []
    assert outcome.plan.length == {1: 4, 2: 5}


def test_a_fresh_call_repeats_no_search_for_a_refinement() -> None:
    problem = slide(3)
    call = Call(problem, compiled(problem), None, 10_000)
    first, second = (call.refiner.do(1, "SEND", (item,)) for item in ("item0", "item1"))
    assert first is not None
    assert second is None  # the robot rode down
    call.using.methods.clear()
    other = fresh_call(call, problem)
    assert other.refiner.do(1, "SEND", ("item0",)) == first
    assert other.refiner.do(1, "SEND", ("item1",)) is None
    assert other.space.worked == 0


def test_a_goal_that_level_1_does_not_see_is_achieved_again_after_it_was_undone() -> None:
    problem = hierarchy(8_040_534)
    outcome = plan(problem)
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []
