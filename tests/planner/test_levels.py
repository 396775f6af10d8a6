"""The meaning of a plan with several levels (docs/levels.md): planners and checker agree in each case."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import product
from random import Random

import pytest

import confab
from confab.planner.grounded.best_first import plan_level
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.hierarchical.lowest_level import LowestLevel, exhausted
from confab.planner.hierarchical.planner import Call, compiled
from confab.planner.hierarchical.planner import plan as default
from confab.planner.hierarchical.scope import LEAST
from confab.planner.hierarchical.shortening import reordered
from confab.planner.hierarchical.unsolvability import Proofs
from confab.planner.levels import levels_left
from confab.planner.paper.hierarchy import DOUBT
from confab.planner.paper.hierarchy import plan as paper
from confab.planner.plan import Outcome, Plan, Reason, Status, Step, UnsolvableError, renumbered
from confab.planner.solve import Request, _proof, solve
from confab.planner.validation import successor, validate
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, SituationType, Symbol
from tests.planner import naive
from tests.planner.small import CASES, Case
from worlds.agreement import State, complaints, on_top, solvable
from worlds.families import tabletop
from worlds.hierarchies import hierarchy, states
from worlds.interpreter import Interpreter
from worlds.walking import faults
from worlds.writing import becomes, behavior, has, world

MODES: dict[str, Callable[[Problem], Outcome]] = {"paper": paper, "default": default}
"""The planners that solve every case."""


def after(problem: Problem, plan: Plan) -> Mapping[Symbol, str]:
    """Return the state after the primitives of a plan."""
    state: Mapping[Symbol, str] | None = problem.initial
    for step in plan.primitives:
        assert state is not None
        state = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state)
    assert state is not None
    return state


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_each_case_with_levels_has_the_expected_plan(case: Callable[[], Case], mode: str) -> None:
    wanted = case()
    outcome = MODES[mode](wanted.problem)
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert validate(wanted.problem, outcome.plan) == []
    if not any(step.joined for step in outcome.plan.walk()):  # a joint refinement of several steps has fewer primitives
        assert outcome.plan.length == wanted.length
    assert len(outcome.plan.primitives) <= max(wanted.length.items())[1]
    assert outcome.fallbacks == 0
    end = after(wanted.problem, outcome.plan)
    assert {symbol: end.get(symbol, FALSE) for symbol in wanted.afterwards} == wanted.afterwards
    assert all(end[symbol] != value for symbol, value in wanted.never.items())


def served(filled: str, to: str) -> Problem:
    """Return the paper's table with a drink in cup1 and the goal that this cup is at another place."""
    problem = tabletop()
    initial = {**problem.initial, Symbol("BEVERAGE", ("cup1",)): filled}
    return replace(problem, initial=initial, goal={Symbol("LOCATION", ("cup1",)): to})


def test_a_plan_that_leaves_a_level_names_the_violated_preconditions_of_this_level() -> None:
    problem = served("beverage1", "location7")
    outcome = paper(problem)
    assert outcome.plan is not None
    assert outcome.fallbacks == 1
    (left,) = levels_left(problem, outcome.plan)
    assert (left.level, left.first, left.last) == (1, (0,), (1,))
    (broken,) = left.broken
    assert broken.step == (1, 1)
    assert str(broken) == (
        "cup1 LOCATION location7: B1_MOVE cup1 location7 requires that (cup1 BEVERAGE no_beverage or cup1 is no Cup)"
    )


def test_the_papers_mode_does_not_leave_a_strict_level() -> None:
    outcome = paper(served("beverage1", "location7"), leave_levels=False)
    assert outcome.status is Status.GAVE_UP
    assert outcome.reason is not None
    assert outcome.reason.text == "no plan of level 1 was found that can be refined, and levels must not be left"
    assert paper(served("no_beverage", "location7"), leave_levels=False).status is Status.SOLVED


@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_no_mode_leaves_a_strict_level(mode: str) -> None:
    outcome = solve(Request(served("beverage1", "location7"), mode, leave_levels=False))
    assert outcome.status is Status.GAVE_UP


def test_a_plan_that_leaves_a_level_does_not_name_its_satisfied_preconditions() -> None:
    problem = served("no_beverage", "location7")
    outcome = plan_level(problem, 2)
    assert outcome.plan is not None
    (left,) = levels_left(problem, outcome.plan)
    assert left.broken == ()


def test_a_plan_that_leaves_no_level_names_no_preconditions() -> None:
    problem = served("no_beverage", "location7")
    outcome = paper(problem)
    assert outcome.plan is not None
    assert levels_left(problem, outcome.plan) == []


# ------------------------------------------------------------------------------------------------------- random worlds


@pytest.mark.parametrize("part", range(4))
@pytest.mark.parametrize("mode", MODES)
def test_plans_in_random_worlds_keep_their_levels_and_no_answer_is_wrong(mode: str, part: int) -> None:
    for seed in range(25 * part, 25 * (part + 1)):
        problem = hierarchy(seed)
        outcome = MODES[mode](problem)
        reference = outcome if mode == "paper" else paper(problem)
        truth = solvable(problem) if outcome.status is Status.UNSOLVABLE else None
        assert complaints(problem, outcome, reference, truth) == [], seed


def naively(problem: Problem) -> Callable[[State], Iterable[tuple[float, State]]]:
    """Return the function from a state to its successors, computed by the naive interpreter."""
    behaviors = problem.domain.at_level(problem.domain.levels[-1])
    return lambda state: ((b.cost, after) for b in behaviors for _, after in naive.results(problem, b, dict(state)))


def test_exhaustive_search_in_random_worlds_agrees_with_the_naive_interpreter() -> None:
    small = [problem for problem in map(hierarchy, range(400)) if states(problem) <= 60]
    found = [solvable(problem) for problem in small]
    assert found == [solvable(problem, naively) for problem in small]
    assert [paper(problem).status is Status.SOLVED for problem in small] == found
    assert min(found.count(True), found.count(False)) > 5


def test_random_worlds_include_plans_that_keep_levels_and_plans_that_leave_them() -> None:
    problems = list(map(hierarchy, range(100)))
    outcomes = list(map(paper, problems))
    solved = [(p, o) for p, o in zip(problems, outcomes, strict=True) if o.plan is not None]
    assert {len(p.domain.levels) for p in problems} == {2, 3}
    assert sum(not on_top(p, o) for p, o in solved) > 2
    assert sum(on_top(p, o) for p, o in solved) > 50
    excursions = [
        o
        for p, o in solved
        if p.domain.situations["COVER"].rest and {"OPEN", "SHUT"} <= {s.behavior for s in o.plan.walk()}  # type: ignore[union-attr]
    ]
    assert len(excursions) > 5


def test_each_kind_of_wrong_outcome_is_reported() -> None:
    problem = hierarchy(0)
    outcome = paper(problem)
    assert outcome.plan is not None
    assert complaints(problem, outcome, outcome, True) == []
    assert "invalid" in complaints(problem, replace(outcome, plan=Plan(outcome.plan.steps[:-1])), outcome, True)[0]
    assert "the first level left" in complaints(problem, plan_level(problem, 2), outcome, True)
    refused = replace(outcome, status=Status.UNSOLVABLE, plan=None)
    assert "a false unsolvable" in complaints(problem, refused, outcome, True)
    assert "a plan where there is none" in complaints(problem, outcome, outcome, False)


def test_a_refinement_without_its_upper_steps_is_valid_and_violates_no_precondition() -> None:
    compared = 0
    for seed in range(80):
        problem = hierarchy(seed)
        found = paper(problem).plan
        if found is None or any(step.level > 1 for step in found.steps):
            continue
        below = Plan(tuple(step for above in found.steps for step in above.steps))
        assert validate(problem, below) == [], seed
        assert [left.broken for left in levels_left(problem, below)] == [()] * bool(below.steps), seed
        compared += 1
    assert compared > 20


def test_the_number_of_examined_states_grows_with_the_work_of_the_searches() -> None:
    lamps = " ".join(f"lamp{i}" for i in range(13))
    problem = imported(
        parse(
            """(define (domain lamps) (:requirements :typing) (:types lamp) (:predicates (on ?x - lamp) (odd) (even))
             (:action light :parameters (?x - lamp) :precondition (even) :effect (and (on ?x) (odd) (not (even))))
             (:action dim :parameters (?x - lamp) :precondition (odd) :effect (and (not (on ?x)) (even) (not (odd)))))""",
            f"(define (problem p) (:domain lamps) (:objects {lamps} - lamp) (:init (even)) (:goal (and (odd) (even))))",
        )
    ).problem
    proofs = Proofs(LowestLevel(Call(problem, compiled(problem), None, 1), searched=False))
    proofs.examine()  # the states are too many for a proof
    proofs.call.space.worked = 20_000 * LEAST
    with pytest.raises(UnsolvableError, match="none of all"):
        proofs.examine()


def test_a_plan_of_the_lowest_level_is_found_while_planning_goal_by_goal_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = tabletop()
    lowest = LowestLevel(Call(problem, compiled(problem), None, 1))
    proofs, works = Proofs(lowest), 0
    while lowest.plan is None:
        proofs.examine()
        works += 1
        proofs.call.space.worked = 2 * proofs.call.space.worked + 1
    monkeypatch.setattr("confab.planner.hierarchical.unsolvability.impossible", pytest.fail)
    found = lowest.plan
    proofs.attempt()  # finds no further plan, and looks for no proof
    assert works > 1
    assert lowest.plan is found
    assert validate(problem, found) == []


def test_a_plan_of_the_lowest_level_is_shortened_for_all_goals_of_the_task() -> None:
    problem = tabletop()
    call = Call(problem, compiled(problem), None, 500)
    call.achieved = dict(list(call.goal.items())[:2])  # planning goal by goal has achieved some of the goals
    flat = plan_level(problem, problem.domain.levels[-1])
    assert flat.plan is not None
    lowest = LowestLevel(call)
    lowest.offer(flat.plan, False)
    lowest.adopt()
    reordered(call, 10**6, lambda _: None, Random(0))
    assert validate(problem, call.tree()) == []


def test_a_shorter_order_of_goals_also_achieves_the_goals_that_level_1_does_not_see() -> None:
    problem = hierarchy(4_000_382)  # level 1 doesn't see the goal position of the robot
    outcome = default(problem)
    assert outcome.plan is not None
    assert validate(problem, outcome.plan) == []


@pytest.mark.parametrize(
    ("name", "goal", "refinements"),
    [("library-small", "cart BRAKE released", 2), ("house-small", "study_door DOOR open", 7)],
)
def test_a_goal_that_only_a_lower_level_sees_needs_no_new_refinements_on_the_first_level(
    name: str, goal: str, refinements: int
) -> None:
    outcome = confab.load(name).plan(goal, engine="none").outcome
    assert outcome.left
    assert outcome.misses <= refinements  # as many as the steps of the other goals need


def test_a_refinement_that_was_found_in_a_state_is_not_searched_again_in_this_state() -> None:
    problem = tabletop()
    call = Call(problem, compiled(problem), None, 10_000)
    refiner, first = call.refiner, call.program.levels[0]
    behavior = problem.domain.at_level(first)[0]
    every = product(*(problem.classes[parameter.kind] for parameter in behavior.parameters))
    arguments = next(a for a in every if refiner.do(first, behavior.name, a) is not None)
    call.table.undo(0)
    step, searched = refiner.do(first, behavior.name, arguments), refiner.misses
    call.table.undo(0)
    refiner.methods.known.clear()
    assert refiner.do(first, behavior.name, arguments) == step
    assert refiner.misses == searched


def pen(goal: Mapping[str, str], *, key: bool = True) -> Problem:
    """Two levels: an animal is driven through a gate, and level 2 opens the gate if there is a key."""
    ajar = SituationType("AJAR", ("Gate",), "Truth", 2, FALSE, FALSE, True)
    opening = [has("AJAR", "?g", FALSE)] + ([] if key else [has("IN", "lion", "nowhere")])
    return world(
        [ajar, SituationType("IN", ("Animal",), "IN")],
        [
            behavior("B1_DRIVE", 1, "?a:Animal ?to:IN", [], [becomes("IN", "?a", "?to")]),
            behavior("B2_OPEN", 2, "?g:Gate", opening, [becomes("AJAR", "?g", TRUE)]),
            behavior("B2_SHUT", 2, "?g:Gate", [has("AJAR", "?g", TRUE)], [becomes("AJAR", "?g", FALSE)]),
            behavior("B2_DRIVE", 2, "?a:Animal ?to:IN", [has("AJAR", "gate", TRUE)], [becomes("IN", "?a", "?to")]),
        ],
        {"Gate": ("gate",), "Animal": ("lion",), "IN": ("pen", "yard", "nowhere")},
        {"IN lion": "pen"},
        goal,
    )


def test_the_papers_mode_reports_the_left_level_and_the_fact_that_this_level_does_not_know() -> None:
    outcome = paper(pen({"AJAR gate": TRUE}))
    assert outcome.status is Status.SOLVED and outcome.fallbacks == 1
    assert outcome.given_up == (
        "level 1, which doesn't know gate AJAR true, was given up: no plan of it was found that can be refined",
    )


def test_the_papers_mode_searches_for_proofs_with_growing_limits() -> None:
    asked: list[int] = []

    def proof(problem: Problem, states: int, deadline: float | None) -> None:
        asked.append(states)

    assert paper(hierarchy(3000016), proof=proof).status is Status.UNSOLVABLE
    assert asked == [0, 3 * DOUBT]
    assert isinstance(_proof(pen({"IN lion": "yard"}, key=False), 100, None), UnsolvableError)
    assert _proof(pen({"IN lion": "yard"}, key=False), 100, 0.0) is None  # the deadline passed first


def test_the_reason_of_an_exhausted_search_states_the_number_of_states() -> None:
    task = ground(
        replace(pen({"IN lion": "yard"}), goal={Symbol("IN", ("lion",)): "yard", Symbol("AJAR", ("gate",)): TRUE}), 2
    )
    assert isinstance(task, Task)
    assert isinstance(exhausted(task, 100), Plan)
    shut = replace(task, barred={(task.initial, operator) for operator in range(len(task))})
    reason = exhausted(shut, 100)
    assert isinstance(reason, Reason)
    assert reason.text == "none of all 1 states of level 2 that can be reached fulfils the goal"


def door(*, levels: int) -> Problem:
    """A door that is open initially and shut at rest; opening it also lights a lamp."""
    opens = [becomes("DOOR", "door", "open"), becomes("LAMP", "door", TRUE)]
    moves = [
        one
        for level, prefix in ((1, "UPPER_"), (2, ""))[-levels:]
        for one in (
            behavior(f"{prefix}OPEN", level if levels > 1 else 1, "", [has("DOOR", "door", "shut")], opens),
            behavior(
                f"{prefix}SHUT",
                level if levels > 1 else 1,
                "",
                [has("DOOR", "door", "open")],
                [becomes("DOOR", "door", "shut")],
            ),
        )
    ]
    return world(
        [
            SituationType("DOOR", ("Door",), "DOOR", rest="shut"),
            SituationType("LAMP", ("Door",), "Truth", default=FALSE, boolean=True),
        ],
        moves,
        {"Door": ("door",), "DOOR": ("open", "shut")},
        {"DOOR door": "open"},
        {"LAMP door": TRUE},
    )


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
def test_a_door_that_is_open_initially_is_shut_in_the_end_if_a_step_moves_it(mode: str, levels: int) -> None:
    outcome = solve(Request(door(levels=levels), mode))
    assert outcome.plan is not None
    assert [step.behavior for step in outcome.plan.primitives] == ["SHUT", "OPEN", "SHUT"]


def test_a_plan_may_not_leave_a_moved_door_open_however_its_steps_are_grouped() -> None:
    problem = door(levels=2)

    def step(name: str, *below: Step, joined: tuple[Step, ...] = ()) -> Step:
        level = problem.domain.behaviors[name].level
        return Step((0,), problem.id_of(name, ()), level, name, (), {}, None, below, joined)

    shut, open_ = step("SHUT"), step("OPEN")
    alone = (step("UPPER_SHUT", shut), step("UPPER_OPEN", open_))
    together = (step("UPPER_SHUT", shut, open_, joined=(step("UPPER_OPEN"),)),)
    for steps in ((shut, open_), alone, together):
        plan = Plan(renumbered(steps))
        assert "leaves it open" in str(validate(problem, plan)[0].text)
        assert any("left open" in one for one in faults(Interpreter(problem), plan))


def test_a_boolean_whose_false_is_unstated_may_be_at_rest_when_true() -> None:
    shut, lamp = (SituationType(name, ("Door",), "Truth", boolean=True) for name in ("SHUT", "LAMP"))
    problem = world(
        [replace(shut, rest=TRUE), lamp],
        [
            behavior("OPEN", 1, "", [has("SHUT", "door", TRUE)], [becomes("SHUT", "door", FALSE), becomes("LAMP", "door", TRUE)]),
            behavior("CLOSE", 1, "", [has("SHUT", "door", FALSE)], [becomes("SHUT", "door", TRUE)]),
        ],
        {"Door": ("door",)},
        {},
        {"LAMP door": TRUE},
    )  # fmt: skip
    for mode in ("guarded", "optimal", "paper"):
        outcome = solve(Request(problem, mode))
        assert outcome.plan is not None
        assert [step.behavior for step in outcome.plan.primitives] == ["CLOSE", "OPEN", "CLOSE"]


def test_a_problem_without_behaviours_is_refused_in_words() -> None:
    lamp = SituationType("LAMP", ("Door",), "Truth", boolean=True)
    problem = world([lamp], [], {"Door": ("door",)}, {}, {"LAMP door": TRUE})
    with pytest.raises(ValueError, match="has no behaviours"):
        solve(Request(problem))
