"""Small worlds in time, made by hand: actors with windows, durations that depend on amounts, steps that overlap by need."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from itertools import islice
from time import perf_counter, sleep

import pytest

from confab.planner.grounded.best_first import Flat
from confab.planner.plan import Limits, Plan, Reason, Status, Step
from confab.planner.solve import Request, solve
from confab.planner.timed import call, concurrent
from confab.planner.timed.activities import Access, Activity
from confab.planner.timed.call import Timed, best_in_time, in_time
from confab.planner.timed.crews import Crew, crews_of, with_crew
from confab.planner.timed.exchange import choices_of
from confab.planner.timed.network import earliest, network_of
from confab.planner.timed.order import BEGIN, END, Order, Resource, Turn, TurnId, order_in_sequence
from confab.planner.timed.plan import Slot, TimedPlan
from confab.planner.timed.schedules import ActorChoices, CandidateSchedule, _ScheduleSearch, turn_edges
from confab.planner.timed.validation import validate_timed
from confab.planner.validation import Fault
from confab.reasoner.amounts import Amount, Quantity
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    TRUE,
    AmountEffect,
    Behavior,
    EqualityCondition,
    SituationType,
    Span,
    Symbol,
    Times,
    Timing,
    Witness,
)
from tests.planner.test_overlapping_by_need import task
from worlds.writing import becomes, behavior, has, world

JOBS = ("j1", "j2")
FROM_100 = ((Fraction(100), None),)


def lasting(one: Behavior, seconds: int | Amount, *actors: str) -> Behavior:
    """Return a behaviour with a duration and actors; all conditions and effects have the span throughout."""
    spans = [[(Span.THROUGHOUT, part) for part in parts] for parts in (one.preconditions, one.every_effect)]
    duration = Fraction(seconds) if isinstance(seconds, int) else seconds
    return replace(one, timing=Timing(duration, actors, tuple(spans[0]), tuple(spans[1])))  # type: ignore[arg-type]


def truth(name: str, kind: str) -> SituationType:
    return SituationType(name, (kind,), "Truth", boolean=True)


def jobs(robots: tuple[str, ...], windows: dict[str, tuple[tuple[Fraction, Fraction | None], ...]]) -> Problem:
    """Return a task with two jobs of 10 s for robots with windows."""
    work = lasting(behavior("WORK", 1, "?r:Robot ?j:Job", [], [becomes("DONE", "?j", TRUE)]), 10, "?r")
    made = world(
        [truth("DONE", "Job")], [work], {"Robot": robots, "Job": JOBS}, {}, {f"DONE {one}": TRUE for one in JOBS}
    )
    return replace(made, times=Times(windows=windows))


def steps(problem: Problem, *named: tuple[str, ...]) -> Plan:
    """Return a plan of the first level; each step is given by its behaviour and its arguments."""
    return Plan(
        tuple(
            Step((i,), problem.id_of(name, tuple(arguments)), 1, name, tuple(arguments))
            for i, (name, *arguments) in enumerate(named)
        )
    )


@pytest.mark.parametrize(("late", "makespan"), [("r1", 120), ("r2", 20)])
def test_actors_with_different_windows_are_not_interchangeable(late: str, makespan: int) -> None:
    problem = jobs(("r1", "r2"), {late: FROM_100})
    plan = steps(problem, *(("WORK", "r1", job) for job in JOBS))
    timed = in_time(problem, plan).plan
    assert timed is not None
    assert timed.makespan == timed.bound == makespan
    shortest = best_in_time(problem, plan).plan
    assert shortest is not None
    assert shortest.makespan == 20


def test_actors_with_equal_windows_are_interchangeable() -> None:
    problem = jobs(("r1", "r2"), {"r1": FROM_100, "r2": FROM_100})
    timed = in_time(problem, steps(problem, *(("WORK", "r1", job) for job in JOBS))).plan
    assert timed is not None
    assert timed.makespan == timed.bound == 110


def test_no_step_begins_whose_duration_depends_on_an_amount_that_another_step_is_changing() -> None:
    level = Amount("LEVEL", ("tank",))
    fill = replace(
        behavior("FILL", 1, "", [], []), amounts=(AmountEffect("LEVEL", ("tank",), "increase", Fraction(5)),)
    )
    stir = behavior("STIR", 1, "", [], [becomes("STIRRED", "tank", TRUE)])
    amount = SituationType("LEVEL", ("Tank",), "Number", quantity=Quantity())
    problem = world(
        [amount, truth("STIRRED", "Tank")],
        [lasting(fill, 10), lasting(stir, level)],
        {"Tank": ("tank",)},
        {"LEVEL tank": "3"},
        {"STIRRED tank": TRUE, "LEVEL tank": "8"},
    )
    one, other = steps(problem, ("STIR",), ("FILL",)).steps

    def faults(begin: int) -> list[str]:
        slots = (Slot(one, Fraction(begin), Fraction(begin + 3)), Slot(other, Fraction(0), Fraction(10)))
        return [fault.text for fault in validate_timed(problem, TimedPlan(Plan((one, other)), slots))]

    assert faults(0) == []
    assert "is changing LEVEL of tank" in faults(5)[0]


def test_the_ends_of_running_steps_may_come_in_another_order_than_their_begins() -> None:
    problem = task(
        "", "y r", q=(90, "e x", "s m, e !m, e r"), a=(100, "s m", "s n, e y"), b=(5, "s n, e r", "s x, e !y")
    )
    timed = concurrent.plan(problem, Limits(seconds=60.0))[1].plan
    assert timed is not None
    assert validate_timed(problem, timed) == []
    assert timed.makespan == 100


def test_each_search_without_durations_gets_half_of_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = task("", "g", a=(5, "", "s x, e !x"), b=(9, "", "s x, e !x"), c=(2, "o x", "e g"))
    ends, began = list[float](), perf_counter()

    def fruitless(task: object, limits: Limits, end: float) -> Flat:
        ends.append(end - began)
        sleep(max(end - perf_counter(), 0.0))
        return Flat(Status.GAVE_UP)

    monkeypatch.setattr(concurrent, "search", fruitless)
    concurrent.plan(problem, Limits(seconds=2.0))
    assert len(ends) == 2
    assert ends[1] < 1.9


def test_a_chosen_robot_hands_over_to_another_robot() -> None:
    over = lasting(
        behavior(
            "HANDOVER",
            1,
            "?giver:Robot ?taker:Robot ?j:Job",
            [has("HOLDER", "?j", "?giver"), EqualityCondition("?giver", "?taker", negated=True)],
            [becomes("HOLDER", "?j", "?taker")],
        ),
        10,
        "?giver",
        "?taker",
    )
    robots = ("r1", "r2", "r3")
    holder = SituationType("HOLDER", ("Job",), "Robot")
    goal = {"HOLDER j1": "r2"}
    problem = world([holder], [over], {"Robot": robots, "Job": JOBS}, {"HOLDER j1": "r1"}, goal)
    direct, *rest = (solve(Request(with_crew(problem, Crew((("Robot", robot),))))).plan for robot in robots)
    assert direct is not None
    assert len(direct.primitives) == 1
    assert [plan is not None and len(plan.primitives) for plan in rest] == [1, 2]


def test_every_actor_is_chosen_in_one_of_the_first_crews() -> None:
    kinds = {kind: tuple(f"{kind}{i}" for i in range(n)) for kind, n in (("Robot", 8), ("Cart", 10), ("Arm", 9))}
    work = lasting(
        behavior("WORK", 1, "?r:Robot ?c:Cart ?a:Arm", [], [becomes("DONE", "?c", TRUE)]), 10, "?r", "?c", "?a"
    )
    problem = world([truth("DONE", "Cart")], [work], kinds, {}, {"DONE Cart0": TRUE})
    crews = list(islice(crews_of(problem), 11))
    assert {one for crew in crews for _, one in crew.chosen} == {one for its in kinds.values() for one in its}
    assert len(set(crews_of(problem))) == 1 + 8 * 9 * 10


def test_a_weaker_bound_for_fewer_choices_replaces_no_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = jobs(("r1", "r2"), {})
    bounds, faults = iter((10, 5)), iter(([Fault((), "refused")], list[Fault]()))
    monkeypatch.setattr(call, "least", lambda *_: next(bounds))
    monkeypatch.setattr(call, "validate_timed", lambda *_: next(faults))
    timed = in_time(problem, steps(problem, *(("WORK", "r1", job) for job in JOBS))).plan
    assert timed is not None
    assert timed.bound == 10


def test_the_exchange_that_undoes_a_move_moves_the_turn_back() -> None:
    problem = jobs(("r1", "r2"), {})
    plan = steps(problem, ("WORK", "r1", "j1"), ("WORK", "r1", "j2"))
    order = order_in_sequence(problem, plan.primitives)
    network = network_of(order)
    network.durations[0] = 30
    search = _ScheduleSearch(order, network, choices_of(problem, plan, order, network))
    start = search.evaluated(order.turns)
    assert start is not None
    for _, undoing, turns in search.neighbours(start):
        after = search.evaluated(turns)
        assert after is not None
        back = [its for exchange, _, its in search.neighbours(after) if exchange == undoing]
        assert order.turns in back or undoing[0][1] not in search.critical(after)


def test_a_schedule_is_shortened_although_an_external_event_ends_later() -> None:
    problem = jobs(("r1", "r2"), {"r2": ((Fraction(0), None),)})
    strike = behavior("STRIKE", 1, "", [], [becomes("DONE", "j3", TRUE)])
    behaviors = {**problem.domain.behaviors, "STRIKE": lasting(strike, 0)}
    problem = replace(
        problem,
        domain=replace(problem.domain, behaviors=behaviors, first_ids={}),
        classes={**problem.classes, "Job": (*JOBS, "j3")},
        goal={**problem.goal, Symbol("DONE", ("j3",)): TRUE},
        times=replace(problem.times or Times(), events={"STRIKE": Fraction(100)}),
    )
    plan = steps(problem, *(("WORK", "r1", job) for job in JOBS), ("STRIKE",))
    timed = best_in_time(problem, plan).plan
    assert timed is not None
    assert {slot.end for slot in timed.slots} == {10, 100}


def test_the_reason_names_the_missed_deadline_and_the_actor_of_the_schedule() -> None:
    problem = jobs(("r1", "r2"), {})
    work = problem.domain.behaviors["WORK"]
    both = lasting(replace(work, effects=(*work.effects, becomes("SEEN", "?j", TRUE)), timing=None), 10, "?r")
    situations = {**problem.domain.situations, "SEEN": truth("SEEN", "Job")}
    seen, deadlines = {Symbol("SEEN", (job,)): TRUE for job in JOBS}, {"j1": Fraction(8), "j2": Fraction(5)}
    problem = replace(
        problem,
        domain=replace(problem.domain, behaviors={"WORK": both}, situations=situations, first_ids={}),
        goal={**problem.goal, **seen},
        times=Times(
            {**{Symbol("DONE", (j,)): by for j, by in deadlines.items()}, **dict.fromkeys(seen, Fraction(100))}
        ),
    )
    reason = in_time(problem, steps(problem, *(("WORK", "r1", job) for job in JOBS))).reason
    assert reason is not None
    assert "WORK r2 j2 takes from 0 to 10 s, but j2 DONE true is a goal by 5 s" in reason.text
    assert "SEEN" not in reason.text


def test_a_deadline_that_no_plan_keeps_is_given_up_at_once_with_the_least_time_of_the_goal() -> None:
    problem = jobs(("r1", "r2"), {"r1": FROM_100, "r2": FROM_100})
    plan = solve(Request(problem)).plan
    assert plan is not None
    told = best_in_time(
        replace(problem, times=replace(problem.times or Times(), deadlines=dict.fromkeys(problem.goal, Fraction(109)))),
        plan,
    )
    assert told.plan is None
    assert told.reason is not None
    assert "is a goal by 109 s, but no plan reaches it in less than 110 s" in told.reason.text
    kept = best_in_time(
        replace(problem, times=replace(problem.times or Times(), deadlines=dict.fromkeys(problem.goal, Fraction(110)))),
        plan,
    )
    assert kept.plan is not None


def test_missed_times_are_a_better_reason_than_a_fault_of_another_kind() -> None:
    other, late, later = Timed(reason=Reason("no order")), Timed(late=Fraction(5)), Timed(late=Fraction(6))
    assert [
        call._better(jobs((), {}), *pair) for pair in ((other, late), (late, other), (later, late), (late, later))
    ] == [late] * 4


@pytest.mark.parametrize(
    ("most", "said"),
    [(1000, "no plan with concurrent steps was found"), (1, "no plan with concurrent steps was found in 1 states")],
)
def test_the_reason_says_whether_the_search_for_concurrent_steps_was_limited(
    monkeypatch: pytest.MonkeyPatch, most: int, said: str
) -> None:
    monkeypatch.setattr(concurrent, "MOST_STATES", most)
    outcome, _ = concurrent.plan(
        task("q", "p", w=(4, "s q, e r", "s !q, e p"), v=(5, "s !q", "e r")), Limits(seconds=60.0)
    )
    assert outcome.reason is not None
    assert outcome.reason.text == said


def test_the_reason_says_why_the_schedule_of_concurrent_steps_was_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(concurrent, "in_time", lambda *_: Timed(reason=Reason("it is too late")))
    outcome, _ = concurrent.plan(
        task("q", "p", w=(4, "s q, e r", "s !q, e p"), v=(2, "s !q", "e r")), Limits(seconds=60.0)
    )
    assert outcome.reason is not None
    assert outcome.reason.text.endswith("; of the last one tried, it is too late")


if find_spec("ortools") is not None:  # it isn't among the packages of the suite

    def test_the_solver_is_named_only_if_its_schedule_is_returned() -> None:
        problem = jobs(("r1", "r2"), {})
        problem = replace(problem, classes={**problem.classes, "Job": (*JOBS, "j3")})
        timed = in_time(problem, steps(problem, *(("WORK", "r1", job) for job in (*JOBS, "j3")))).plan
        assert timed is not None
        assert (timed.makespan, timed.scheduler) == (Fraction(20), "exchanges")

    def test_the_solver_lets_no_turn_move_to_an_actor_while_other_turns_read_its_symbols() -> None:
        from confab.planner.timed.cpsat import shorter

        none = Access()
        names = [[0, 1, 2], [3, 4]]
        made = [
            Activity(Step((i,), i, 1, "DO", ()), Fraction(s), (), none, none, none)
            for i, s in enumerate((30, 15, 15, 10, 10))
        ]
        resources = tuple(
            Resource(tuple(Turn((i,), ((i, BEGIN),), ((i, END),), i > 2) for i in its), f"r{k}")
            for k, its in enumerate(names)
        )
        order = Order(tuple(made), (), resources)
        moves: dict[TurnId, tuple[int, ...]] = {(0, 1): (0, 1), (0, 2): (0, 1)}
        choices = ActorChoices(moves, {(turn, 1): {} for turn in moves})
        network = network_of(order)
        begins = earliest(network, turn_edges(order, order.turns))
        assert begins is not None
        found, bound = shorter(order, network, choices, CandidateSchedule(order.turns, begins), 0, 60.0)
        assert (begins.makespan, found.makespan, bound) == (60, 40, 40)


@pytest.mark.parametrize(("tank", "conflicts"), [("tank1", True), ("tank2", False)])
def test_a_quantifier_over_the_objects_with_a_value_conflicts_only_with_pending_effects_on_this_value(
    tank: str, conflicts: bool
) -> None:
    empty = Witness("?any", "Batch", (has("AT", "?any", "?t"),), negated=True)
    inspect = lasting(behavior("INSPECT", 1, "?t:Tank", [empty], [becomes("SEEN", "?t", TRUE)]), 10)
    fill = lasting(behavior("FILL", 1, "?b:Batch ?t:Tank", [has("AT", "?b", "out")], [becomes("AT", "?b", "?t")]), 10)
    classes = {"Batch": ("ale",), "Tank": ("tank1", "tank2"), "Place": ("out", "tank1", "tank2")}
    at = SituationType("AT", ("Batch",), "Place")
    problem = world([at, truth("SEEN", "Tank")], [inspect, fill], classes, {"AT ale": "out"}, {"SEEN tank1": TRUE})
    plan = steps(problem, ("INSPECT", "tank1"), ("FILL", "ale", tank))
    inspecting, filling = plan.steps
    slots = (Slot(inspecting, Fraction(5), Fraction(15)), Slot(filling, Fraction(0), Fraction(10)))
    said = [fault.text for fault in validate_timed(problem, TimedPlan(plan, slots))]
    assert bool(said) is conflicts
    assert not said or "is changing AT of ale" in said[0]
