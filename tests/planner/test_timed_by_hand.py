"""Small worlds in time, made by hand: actors with windows, durations that depend on amounts, steps that overlap by need."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from time import perf_counter, sleep

import pytest

from confab.planner.grounded.best_first import Flat
from confab.planner.plan import Limits, Plan, Status, Step
from confab.planner.timed import concurrent
from confab.planner.timed.call import best_in_time, in_time
from confab.planner.timed.plan import Slot, TimedPlan
from confab.planner.timed.validation import validate_timed
from confab.reasoner.amounts import Amount, Quantity
from confab.reasoner.symbols import (
    TRUE,
    AmountEffect,
    Behavior,
    Problem,
    SituationType,
    Span,
    Times,
    Timing,
)
from tests.planner.test_overlapping_by_need import task
from worlds.writing import becomes, behavior, world

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
