"""A repair keeps the valid steps and is a plan; if it costs more than a new plan, the new plan is taken."""

import random
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from time import sleep

import pytest

from confab.planner.acting.repair import (
    CLOSE,
    changed_individuals,
    difference,
    rejected,
    repair_or_replan,
    replan,
    vanished,
)
from confab.planner.hierarchical.call import Compiled, compiled
from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Limits, Outcome, Plan, Status, Step
from confab.planner.plan_costs import cost_of
from confab.planner.validation import successor
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import State, Symbol
from worlds.families import family, tabletop
from worlds.trials import Trial, rest_after


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
def test_a_repaired_plan_leads_from_the_present_situation_to_the_goal(changes: State) -> None:
    now = replace(serving(), initial={**serving().initial, **changes})
    repaired = repair_or_replan(now, planned().steps, serving(), using=using())
    assert repaired.steps is not None
    end = carried_out(now, now.initial, repaired.steps)
    assert all(end[symbol] == value for symbol, value in now.goal.items())


def test_a_repair_without_relevant_changes_keeps_the_plan() -> None:
    repaired = repair_or_replan(serving(), planned().steps, serving(), using=using())
    assert repaired.steps is not None
    assert repaired.steps == planned().steps
    for done in range(1, len(planned().primitives)):
        now, rest = in_the_hand(done)
        repaired = repair_or_replan(now, rest, now, using=using())
        assert repaired.steps is not None
        left, found = Plan(rest).primitives, Plan(repaired.steps).primitives
        assert [(str(step), step.bindings) for step in found] == [(str(step), step.bindings) for step in left]


def test_a_repair_drops_exactly_the_steps_that_a_person_has_done() -> None:
    now = replace(serving(), initial={**serving().initial, location("cup1"): "location7"})
    repaired = repair_or_replan(now, planned().steps, serving(), using=using())
    assert repaired.steps is not None
    assert difference(planned().steps, repaired.steps) == (6, 0)


def test_a_repair_replaces_the_old_place_by_the_new_goal_place() -> None:
    now = replace(serving(), goal={**serving().goal, location("cup2"): "location6"})
    repaired = repair_or_replan(now, planned().steps, serving(), using=using())
    assert repaired.steps is not None
    assert repaired.kind == "repair"
    assert sum(difference(planned().steps, repaired.steps)) < 14


def test_a_repaired_plan_costs_at_most_slightly_more_than_a_new_plan() -> None:
    for place in ("location6", "location8"):
        for individual in ("cup1", "cup2", "bottle1"):
            now = replace(serving(), goal={**serving().goal, location(individual): place})
            repaired = repair_or_replan(now, planned().steps, serving(), using=using())
            scratch, _ = replan(now, None, using(), Limits())
            assert (repaired.steps is None) == (scratch is None)
            if scratch is not None:
                assert repaired.cost <= CLOSE * cost_of(now, Plan(scratch))


def test_the_reason_names_a_removed_object() -> None:
    gone = {symbol: value for symbol, value in serving().initial.items() if symbol.arguments != ("cup2",)}
    reasons = vanished(replace(serving(), initial=gone))
    assert [symbol.arguments for symbol, _ in reasons] == [("cup2",), ("cup2",)]
    assert all("cup2" in reason.terms for _, reason in reasons)


def test_steps_in_another_order_count_as_dropped_and_added() -> None:
    first, second, *others = planned().steps
    assert sum(difference(planned().steps, (second, first, *others))) == 12
    assert difference((first, second), planned().steps) == (0, sum(len(Plan((step,)).primitives) for step in others))
    assert difference(planned().steps, ()) == (len(planned().primitives), 0)


def test_steps_that_the_checker_rejects_have_a_reason_for_rejection() -> None:
    problem = tabletop()
    outcome = plan(problem)
    assert outcome.plan is not None
    assert rejected(problem, outcome.plan.steps) is None
    assert rejected(problem, outcome.plan.steps[:-1]) is not None
    assert rejected(problem, outcome.plan.steps[0].steps[1:]) is not None


def test_changed_individuals_are_all_individuals_in_changed_facts_and_goals() -> None:
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


def test_a_step_in_progress_is_finished_unless_this_is_not_allowed() -> None:
    first, *others = planned().steps
    pick, place = first.steps
    begun = replace(serving(), initial=carried_out(serving(), serving().initial, (pick,)))
    rest = (replace(first, steps=(place,)), *others)
    repaired = repair_or_replan(begun, rest, begun, using=using())
    assert (repaired.kind, repaired.steps is not None) == ("repair", True)
    assert repaired.steps is not None
    assert difference(rest, repaired.steps) == (0, 0)
    anew = repair_or_replan(begun, rest, begun, using=using(), in_progress=False)
    assert anew.steps is not None
    end = carried_out(begun, begun.initial, anew.steps)
    assert all(end[symbol] == value for symbol, value in begun.goal.items())
    assert repaired.cost == cost_of(begun, Plan(repaired.steps))


def test_a_repair_ends_at_its_time_limit() -> None:
    now = replace(serving(), initial={**serving().initial, location("cup1"): "location7"})
    late = repair_or_replan(now, planned().steps, serving(), using=using(), limits=Limits(seconds=-1.0))
    assert late.steps is None
    assert late.outcome is not None
    assert late.outcome.status is Status.GAVE_UP
    assert late.cost == 0
    begun = replace(serving(), initial=carried_out(serving(), serving().initial, planned().steps[0].steps[:1]))
    assert repair_or_replan(begun, (), begun, using=using(), limits=Limits(seconds=-1.0)).steps is None
    assert (
        repair_or_replan(now, planned().steps, serving(), using=using(), limits=Limits(seconds=60.0)).steps is not None
    )


def test_repair_and_replanning_share_one_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    now = replace(serving(), initial={**serving().initial, location("cup1"): "location7"})
    left: list[float | None] = []

    def planner(problem: Problem, /, *, limits: Limits) -> Outcome:
        left.append(limits.seconds)
        return plan(problem, limits=limits)

    def failing_repair(*_: object) -> None:
        sleep(0.05)

    monkeypatch.setattr("confab.planner.acting.repair.repair", failing_repair)
    repaired = repair_or_replan(now, planned().steps, serving(), planner, using(), limits=Limits(seconds=60.0))
    assert repaired.kind == "replan"
    assert repaired.steps is not None
    begun = replace(serving(), initial=carried_out(serving(), serving().initial, planned().steps[0].steps[:1]))
    repair_or_replan(begun, (), begun, planner, using(), limits=Limits(seconds=60.0))  # a hand is brought to rest first
    repair_or_replan(now, planned().steps, serving(), planner, using())
    first, second, unlimited = left
    assert first is not None
    assert second is not None
    assert 0 < first <= 60.0 - 0.05
    assert 0 < second <= 60.0 - 0.05
    assert unlimited is None


def in_the_hand(done: int, goal: State | None = None) -> tuple[Problem, tuple[Step, ...]]:
    """Return the situation after some primitives of the paper's plan, possibly with another goal, and the remaining steps."""
    now = replace(serving(), initial=carried_out(serving(), serving().initial, planned().primitives[:done]))
    return replace(now, goal=goal or now.goal), tuple(rest_after(planned(), done))


def test_a_held_object_is_brought_to_its_goal_even_if_no_step_of_the_plan_is_left() -> None:
    now, rest = in_the_hand(3)
    for left in ((), rest[1:]):
        repaired = repair_or_replan(now, left, now, using=using(), in_progress=False)
        assert repaired.steps is not None
        end = carried_out(now, now.initial, repaired.steps)
        assert all(end[symbol] == value for symbol, value in now.goal.items())
        assert repaired.cost == cost_of(now, Plan(rest))


def test_a_begun_step_is_finished_even_if_the_domain_has_no_rest_values() -> None:
    """A carried object is at no spot, so bringing it isn't applicable any more.

    Yet the step is finished, and nothing is put down.
    """
    rooms = read(load("rooms-battery")).problem
    first = plan(rooms).plan
    assert first is not None
    at = next(i for i, step in enumerate(first.steps) if any(child.behavior == "B2_PICK" for child in step.steps))
    step, *others = first.steps[at:]
    assert step.steps[-1].behavior == "B2_PLACE"
    state = carried_out(rooms, rooms.initial, (*first.steps[:at], *step.steps[:-1]))
    rest = (replace(step, steps=step.steps[-1:]), *others)
    charge = Symbol("BATTERY", ("rooms-battery:robot",))
    planned_for = replace(rooms, initial=state)
    now = replace(rooms, initial={**state, charge: str(float(state[charge]) + 1)})
    repaired = repair_or_replan(now, rest, planned_for, begun=True)
    assert repaired.steps is not None
    assert difference(rest, repaired.steps) == (0, 0)


def test_a_step_in_progress_is_not_finished_if_no_goal_requires_it_any_more() -> None:
    goal = {s: v for s, v in serving().goal.items() if s.arguments != ("cup1",)}
    now, rest = in_the_hand(3, goal=goal)
    assert rest[0].arguments[0] == "cup1"
    repaired = repair_or_replan(now, rest, serving(), using=using())
    assert repaired.steps is not None
    end = carried_out(now, now.initial, repaired.steps)
    assert all(end[symbol] == value for symbol, value in goal.items())
    assert end[location("cup1")] != "in_hand"
    others = sum(cost_of(serving(), Plan((step,))) for step in rest[1:] if "cup1" not in step.arguments)
    assert repaired.cost <= others + cost_of(serving(), Plan(rest[:1]))


def test_the_rest_of_the_plan_without_superfluous_steps_is_a_repair_if_no_other_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("confab.planner.acting.repair.repair", lambda *_: None)
    fewer = dict(list(serving().goal.items())[1:])

    def none(there: Problem, /, *, limits: Limits) -> Outcome:
        return Outcome(Status.GAVE_UP)

    found = repair_or_replan(replace(serving(), goal=fewer), planned().steps, serving(), none, using())
    assert found.kind == "repair"
    assert found.steps is not None
    dropped, added = difference(planned().steps, found.steps)
    assert dropped > 0
    assert added == 0
    end = carried_out(serving(), serving().initial, found.steps)
    assert all(end[symbol] == value for symbol, value in fewer.items())


def test_undone_steps_are_repeated_first_and_the_planned_steps_are_kept() -> None:
    done = len(Plan(planned().steps[:2]).primitives)
    assert {step.arguments[0] for step in planned().steps[:2]} == {"cup1", "cup2"}
    now, rest = in_the_hand(done)
    moved = {location("cup1"): "location1", location("cup2"): "location2"}
    moved = {symbol: place for symbol, place in moved.items() if place not in now.initial.values()}
    assert moved
    back = replace(now, initial={**now.initial, **moved})
    repaired = repair_or_replan(back, rest, now, using=using())
    assert repaired.steps is not None
    assert difference(rest, repaired.steps)[0] == 0
    assert {s.arguments[0] for s in repaired.steps[: len(moved)]} == {symbol.arguments[0] for symbol in moved}


def after_interventions(problem: Problem, draw: random.Random) -> Problem:
    """Return a situation in which a person has moved an object, or has changed, added or dropped a goal."""
    stands = {s: v for s, v in problem.initial.items() if s.situation == "LOCATION" and v != "in_hand"}
    free = sorted({*problem.classes["Location"]} - {*stands.values(), *problem.goal.values(), "in_hand"})
    one = draw.choice(sorted(stands))
    what = draw.choice(["moves", "wants", "needs no more", "does"])
    if what == "needs no more":
        dropped = draw.choice(sorted(problem.goal))
        return replace(problem, goal={s: v for s, v in problem.goal.items() if s != dropped})
    if what == "does":
        done = draw.choice(sorted(s for s in problem.goal if problem.goal[s] not in stands.values()) or [one])
        return replace(problem, initial={**problem.initial, done: problem.goal.get(done, problem.initial[done])})
    if not free:
        return problem
    place = {one: draw.choice(free)}
    return (
        replace(problem, initial={**problem.initial, **place})
        if what == "moves"
        else replace(problem, goal={**problem.goal, **place})
    )


@pytest.mark.parametrize(
    ("name", "n", "many", "kept", "cost", "changed", "asked"),
    [
        ("served", 4, 16, 15, 272, 112, 12),
        ("swap", 6, 12, 11, 305, 34, 3),
        ("full", 4, 16, 14, 146, 50, 10),
        ("handover", 5, 12, 10, 245, 54, 6),
        ("blocked", 5, 12, 12, 209, 34, 7),
    ],
)
def test_repairs_after_random_interruptions_change_few_steps(
    name: str, n: int, many: int, kept: int, cost: float, changed: int, asked: int
) -> None:
    """Of `many` interruptions, at least `kept` are repaired.

    The total cost, the dropped and added steps, and the number of new plans for comparison are bounded.
    """
    trial = Trial.of(family(name, n))
    problem, uses = trial.problem, compiled(trial.problem)
    repaired, spent, different, anew = 0, 0.0, 0, list[Problem]()
    for seed in range(many):
        draw = random.Random(seed)
        done = draw.randrange(len(trial.plan.primitives))
        rest, before = rest_after(trial.plan, done), replace(problem, initial=trial.states[done])
        now = after_interventions(before, draw)

        def planner(there: Problem, /, *, limits: Limits) -> Outcome:
            anew.append(there)
            return plan(there, limits=limits, using=uses)

        result = repair_or_replan(now, rest, before, planner, uses)
        if result.steps is None:
            assert result.outcome is not None
            assert result.outcome.status is not Status.GAVE_UP
            continue
        end = carried_out(now, now.initial, result.steps)
        assert all(end[symbol] == value for symbol, value in now.goal.items())
        assert result.cost == cost_of(now, Plan(result.steps))
        repaired += result.kind == "repair"
        spent += result.cost
        different += sum(difference(rest, result.steps))
    assert repaired >= kept
    assert spent <= cost
    assert different <= changed
    assert len(anew) <= asked
