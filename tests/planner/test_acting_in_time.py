"""Execution of tasks with durations, deadlines and windows: all actors at once, dispatched by the temporal network."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from random import Random
from time import sleep

import pytest

import confab
from confab.planner.acting.dispatching import Concurrency, later
from confab.planner.acting.episode import End, Episode, Event, Intervention, InterventionKind
from confab.planner.acting.executive import act
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.plan import Limits, Outcome, Reason, Status
from confab.planner.solve import Request, solve
from confab.planner.timed.call import best_in_time
from confab.planner.timed.plan import Slot, TimedPlan
from confab.planner.timed.validation import validate_timed
from confab.reasoner.limits import current, within
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, Symbol, Times
from tests.planner.serving import planned, serving
from tests.planner.test_dispatch import burning, fuse
from tests.reasoner.test_durative import CELLAR, FUSES, TRUCK, WAY
from worlds.timed import Action, TimedWorld, problem_of

FILLED, MOVED = Symbol("BEVERAGE", ("cup1",)), Symbol("LOCATION", ("cup2",))
SERIAL = 32


def with_times(**times: object) -> Problem:
    return replace(serving(), times=Times(**times))  # type: ignore[arg-type]


def acted(
    problem: Problem,
    *interventions: Intervention,
    stretch: Callable[[Fraction], Fraction] = lambda expected: expected,
    spread: Fraction = Fraction(0),
    told: Callable[[Event], None] | None = None,
) -> Episode:
    world = SymbolicWorld(problem, stretch=stretch)
    return act(problem, world, planned(), interventions, observer=told, together=Concurrency(spread=spread))


def executed(episode: Episode) -> TimedPlan:
    """Return the executed primitives with their times."""
    slots = {e.step.path: Slot(e.step, Fraction(e.begin), Fraction(e.end)) for e in episode.events}
    return TimedPlan(episode.done, tuple(slots[step.path] for step in episode.done.primitives))


def test_two_hands_take_two_thirds_of_the_time_of_one() -> None:
    episode = acted(serving())
    assert episode.status is End.REACHED
    assert episode.seconds["simulated"] <= 0.7 * SERIAL
    assert validate_timed(serving(), executed(episode), executed=True) == []


@pytest.mark.parametrize("seed", range(4))
def test_steps_that_take_up_to_thirty_percent_more_or_less_break_no_causal_link(seed: int) -> None:
    rng = Random(seed)
    episode = acted(
        serving(), stretch=lambda seconds: seconds * Fraction(rng.randint(700, 1300), 1000), spread=Fraction(3, 10)
    )
    assert episode.status is End.REACHED
    assert not episode.replans
    assert validate_timed(serving(), executed(episode), executed=True) == []


def test_a_hand_that_is_available_later_begins_later() -> None:
    episode = acted(with_times(windows={"right_hand": ((Fraction(10), None),)}))
    begins = [event.begin for event in episode.events if "right_hand" in event.step.arguments]
    assert episode.status is End.REACHED
    assert min(begins) == 10


def test_a_deadline_that_no_schedule_keeps_is_given_up_at_the_beginning_and_the_others_are_kept() -> None:
    told: list[Event] = []
    problem = with_times(deadlines={FILLED: Fraction(5), MOVED: Fraction(20)})
    episode = acted(problem, told=told.append)
    assert [(event.seconds, event.text) for event in told if event.what == "late"] == [
        (0, "the deadline of cup1 BEVERAGE beverage1 can't be kept any more")
    ]
    assert episode.status is End.IMPOSSIBLE
    (reason,) = episode.reasons
    assert "cup1 BEVERAGE beverage1 is a goal by 5 s, and holds from 7 s on; this was known at 0 s" in reason.text
    assert all(episode.observed[symbol] == value for symbol, value in serving().goal.items())


def test_a_deadline_is_known_to_be_missed_when_a_step_has_taken_too_long() -> None:
    told: list[Event] = []
    first = iter([Fraction(20)])
    episode = acted(
        with_times(deadlines={FILLED: Fraction(20)}), stretch=lambda its: its * next(first, 1), told=told.append
    )
    late = next(event for event in told if event.what == "late")
    reached = next(change.seconds for change in episode.course if change.symbol == FILLED)
    assert late.seconds <= 20 < reached
    assert episode.status is End.IMPOSSIBLE


def test_a_deadline_that_is_kept_in_spite_of_an_intervention_is_reached() -> None:
    change = partial(Intervention, InterventionKind.WORLD, (Fact(MOVED, "location8"),))
    episode = acted(with_times(deadlines={FILLED: Fraction(30)}), change(at=3.5))
    assert episode.status is End.REACHED
    assert len(episode.replans) == 1
    assert episode.seconds["simulated"] < len(episode.events)  # both hands go on at once


def test_primitives_that_run_during_an_intervention_end_and_keep_their_effects() -> None:
    change = Intervention(InterventionKind.WORLD, (Fact(MOVED, "location8"),), at=1.5)
    episode = acted(serving(), change)
    running = [event for event in episode.events if event.begin < 1.5 < event.end]
    assert len(running) == 2
    assert all(event.ok for event in running)


def test_later_times_leave_out_what_is_over() -> None:
    times = Times(
        deadlines={FILLED: Fraction(12)},
        windows={"a": ((Fraction(0), Fraction(5)), (Fraction(8), Fraction(20)), (Fraction(30), None))},
        events={"DAWN": Fraction(4), "NOON": Fraction(12)},
    )
    assert later(times, Fraction(10)) == Times(
        deadlines={FILLED: Fraction(2)},
        windows={"a": ((Fraction(0), Fraction(10)), (Fraction(20), None))},
        events={"NOON": Fraction(2)},
        since=Fraction(10),
    )


def test_the_reason_why_the_remaining_steps_have_no_schedule_states_times_from_the_beginning_of_the_plan() -> None:
    problem = with_times(windows={hand: ((Fraction(0), Fraction(22)),) for hand in ("left_hand", "right_hand")})
    episode = acted(problem, Intervention(InterventionKind.WORLD, (Fact(MOVED, "location8"),), at=8.2))
    assert episode.status is End.GAVE_UP
    assert "but left_hand is available only from 9 to 22 s" in episode.reasons[0].text


@pytest.mark.parametrize(("at", "stopped"), [(4.2, 0), (8.2, 1), (9.2, 0), (10.2, 1), (16.2, 1)])
def test_an_intervention_stops_the_primitives_that_depend_on_a_changed_fact_and_the_goals_are_reached(
    at: float, stopped: int
) -> None:
    """The left hand holds cup 2 when the cup is moved at 8.2 s, so the left hand stops and the right hand goes on."""
    episode = acted(serving(), Intervention(InterventionKind.WORLD, (Fact(MOVED, "location8"),), at=at))
    running = [event for event in episode.events if event.begin < at < event.begin + 1]
    interrupted = [event for event in running if event.code == "interrupted"]
    assert len(interrupted) == stopped
    assert all(event.end == pytest.approx(at) and "left_hand" in event.step.arguments for event in interrupted)
    assert all(event.ok for event in running if event not in interrupted)
    assert episode.status is End.REACHED


@pytest.mark.parametrize("by", [5, 6])
def test_a_goal_is_reached_when_its_step_ends_although_a_step_that_it_needs_meanwhile_ends_later(by: int) -> None:
    """The match burns for 8 s, and the fuse is mended after 5 s."""
    problem = problem_of(burning(8, 5))
    problem = replace(problem, times=Times(deadlines=dict.fromkeys(problem.goal, Fraction(by))))
    timed = fuse(8, 5)
    assert timed is not None
    episode = act(problem, SymbolicWorld(problem), timed.plan, together=Concurrency(timed))
    assert episode.status is End.REACHED
    assert [(change.seconds, change.value) for change in episode.course] == [(0, "true"), (5, "true"), (8, "false")]


def test_a_time_limit_that_ends_planning_and_then_the_episode_is_one_reason() -> None:
    def too_slow(problem: Problem, limits: Limits | None = None) -> Outcome:
        sleep(0.01 + (current().left or 0.0))
        return Outcome(Status.GAVE_UP, reason=Reason("gave up after 0.8 s while compiling conditions; give more time"))

    with within(0.8):
        episode = act(serving(), SymbolicWorld(serving()), planner=too_slow)
    assert episode.status is End.GAVE_UP
    assert [reason.text for reason in episode.reasons] == ["gave up after 0.8 s while planning; give more time"]


def test_steps_that_overlap_by_need_and_are_planned_anew_are_given_up_and_not_called_impossible() -> None:
    problem = problem_of(burning(8, 5))
    assert act(problem, SymbolicWorld(problem)).status is End.GAVE_UP


def test_a_task_with_windows_that_is_executed_one_step_after_another_is_not_called_reached() -> None:
    problem = with_times(windows={"right_hand": ((Fraction(40), None),)})
    episode = act(problem, SymbolicWorld(problem), planned())
    assert episode.status is End.IMPOSSIBLE
    assert "took from 12 to 13 s, and right_hand isn't available then" in episode.reasons[0].text


@pytest.mark.parametrize(("texts", "seconds"), [((CELLAR, FUSES), 6), ((TRUCK, WAY), 10)])
def test_imported_durative_actions_and_timed_literals_are_executed_in_time(
    texts: tuple[str, str], seconds: int, tmp_path: Path
) -> None:
    file = tmp_path / "scene.ttl"
    file.write_text(turtle(imported(parse(*texts)).problem, "title", "description"), encoding="utf-8")
    run = confab.load(file).execute()
    assert run.reached
    assert run.episode.seconds["simulated"] == pytest.approx(seconds, abs=0.01)


def test_a_step_outside_of_the_window_of_its_actor_makes_an_episode_impossible() -> None:
    problem = problem_of(
        TimedWorld(1, (Action(3, 0, (), (("end", (0, True)),)),), frozenset(), ((0, True),), windows=((0, 0, 3),))
    )
    for factor, status in ((1, End.REACHED), (2, End.IMPOSSIBLE)):
        slower = SymbolicWorld(problem, stretch=partial(Fraction.__mul__, Fraction(factor)))
        assert act(problem, slower, together=Concurrency()).status is status


@pytest.mark.parametrize(("spread", "status"), [(0, End.REACHED), (Fraction(1, 10), End.GAVE_UP)])
def test_a_step_ends_before_an_external_event_ends_if_its_duration_is_certain(spread: Fraction, status: End) -> None:
    flash = Action(4, None, (), (("start", (1, True)), ("end", (0, True)), ("end", (1, False))))
    event = Action(1, None, (), (("end", (1, True)),))
    problem = problem_of(TimedWorld(2, (event, flash), frozenset(), ((0, True), (1, True))))
    problem = replace(problem, times=Times(events={"A0": Fraction(3)}))
    plan = solve(Request(problem)).plan
    assert plan is not None
    timed = best_in_time(problem, plan).plan
    assert timed is not None
    assert timed.makespan == 4
    assert (
        act(problem, SymbolicWorld(problem), timed.plan, together=Concurrency(timed, Fraction(spread))).status is status
    )
