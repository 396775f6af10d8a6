"""Export of behaviours in time: durative actions that Confab, unified-planning and engines read back."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import confab
from confab import engines
from confab.pddl_commands import read_timed_plan
from confab.planner.plan import Limits, Status
from confab.planner.solve import Request, solve
from confab.planner.timed.call import best_in_time
from confab.planner.timed.pieces import default_actors
from confab.planner.timed.plan import TimedPlan, schedule_of
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.pddl.exporting import Exported, plan_of, to_pddl
from confab.reasoner.pddl.importing import Imported, imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Times
from tests.reasoner.test_durative import BAKERY, CELLAR, FUSES, TRUCK, WAY, loaves
from worlds.timed import problem_of, timed_world

APART = Fraction(1, 1000)
"""The time between the begins of two steps, since the validator requires conflicting events at different times."""
OVENS = "s - short l - long"
TASKS = {"cellar": (CELLAR, FUSES), "truck": (TRUCK, WAY), "bakery": (BAKERY, loaves(4, OVENS))}


def exported(problem: Problem) -> Exported:
    return to_pddl(problem, workers=default_actors(problem))


def planned(problem: Problem) -> TimedPlan | None:
    outcome = solve(Request(problem, limits=Limits(seconds=20.0)))
    timed = schedule_of(outcome)
    return best_in_time(problem, outcome.plan).plan if timed is None and outcome.plan is not None else timed


def lines(found: Imported, timed: TimedPlan) -> str:
    """The steps of a plan of an imported problem in the competition format, without external events."""
    events = found.problem.times.events if found.problem.times else {}
    steps = [slot for slot in timed.slots if slot.step.behavior not in events]
    return "\n".join(
        f"{float(slot.begin):.6f}: ({found.line(slot.step.behavior, slot.step.arguments)}) [{float(slot.end - slot.begin):.6f}]"
        for slot in steps
    )


def test_each_condition_and_effect_has_its_time() -> None:
    text = " ".join(exported(imported(parse(CELLAR, FUSES)).problem).domain.split())
    assert ":durative-actions" in text
    strike = text.split("(:durative-action strike ")[1].split("(:durative-action")[0]
    assert "(= ?duration 5)" in strike and "(at start (unused ?m))" in strike and "(at end (not (light ?m)))" in strike
    assert "(at start (light ?m))" in strike
    correct = text.split("(:durative-action correct ")[1]
    assert "(over all (light ?m))" in correct and "(at end (mended ?f))" in correct


def test_external_events_become_timed_initial_literals_and_calculated_durations_stay() -> None:
    found = exported(imported(parse(TRUCK, WAY)).problem)
    assert "(at 10 (open y))" in found.problem
    assert "(= ?duration (/ (length ?p ?q) (speed ?t)))" in found.domain


def test_a_condition_that_nothing_changes_is_a_condition_at_the_start_whatever_its_time() -> None:
    text = TRUCK.replace("(over all (road ?p ?q))", "(at end (road ?p ?q))")
    assert "(at start (road ?p ?q))" in exported(imported(parse(text, WAY)).problem).domain


@pytest.mark.parametrize("name", TASKS)
def test_an_export_that_is_imported_again_has_plans_with_the_same_makespan(name: str) -> None:
    first = imported(parse(*TASKS[name])).problem
    out = exported(first)
    again = imported(parse(out.domain, out.problem))
    one, other = planned(first), planned(again.problem)
    assert one is not None and other is not None and one.makespan == other.makespan
    back = read_timed_plan(first, out, lines(again, other)).plan
    assert back is not None and back.makespan == one.makespan


@pytest.mark.parametrize("kind", ["plain", "limited", "shared"])
@pytest.mark.parametrize("seed", range(12))
def test_plans_of_exported_random_worlds_are_plans_of_these_worlds(seed: int, kind: str) -> None:
    problem = problem_of(timed_world(4_000 + seed, limited=kind == "limited", shared=kind == "shared"))
    problem = replace(problem, times=replace(problem.times or Times(), deadlines={}))  # PDDL has none
    out = exported(problem)
    again = imported(parse(out.domain, out.problem))
    timed = planned(again.problem)
    assert (timed is None) is (planned(problem) is None)
    if timed is not None:
        assert read_timed_plan(problem, out, lines(again, timed)).plan is not None


@pytest.mark.parametrize("name", ["cellar", "bakery"])
def test_the_validator_of_unified_planning_accepts_plans_of_the_export(name: str, tmp_path: Path) -> None:
    pytest.importorskip("unified_planning")
    from unified_planning.engines.plan_validator import TimeTriggeredPlanValidator
    from unified_planning.io import PDDLReader
    from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    out = exported(imported(parse(*TASKS[name])).problem)
    again = imported(parse(out.domain, out.problem))
    timed = planned(again.problem)
    assert timed is not None
    slots = sorted(timed.slots, key=lambda slot: slot.begin)
    apart = [replace(one, begin=one.begin + n * APART, end=one.end + n * APART) for n, one in enumerate(slots)]
    files = [tmp_path / "domain.pddl", tmp_path / "problem.pddl"]
    files[0].write_text(out.domain)
    files[1].write_text(out.problem)
    read = PDDLReader().parse_problem(*map(str, files))
    plan = PDDLReader().parse_plan_string(read, lines(again, replace(timed, slots=tuple(apart))))
    assert TimeTriggeredPlanValidator().validate(read, plan)


def test_an_actor_is_busy_from_start_to_end_and_a_default_actor_is_a_worker() -> None:
    scene = confab.load("beverage-serving")
    text = " ".join(exported(scene.problem).domain.split())
    assert "(at start (idle ?left_hand))" not in text
    assert text.count("(at start (idle ?hand))") == text.count("(at end (idle ?hand))") > 0


def test_lines_of_plans_are_read_with_and_without_times_and_bad_lines_are_named_at_once() -> None:
    out = exported(imported(parse(TRUCK, WAY)).problem)
    text = "; a comment\n  0.5 :  ( DRIVE  t x y )  [D:4.0; C:1]\n(drive u x y)\n"
    assert [(line.arguments, line.begin, line.duration) for line in plan_of(out, text)] == [
        (("t", "x", "y"), Fraction(1, 2), Fraction(4)),
        (("u", "x", "y"), None, None),
    ]
    for bad in ("1.2.3: (drive t x y) [4]", " " * 100_000 + "]", "0: (drive t x y) [4] [5]", "fly t"):
        with pytest.raises(ValueError, match="line 2: no action"):
            plan_of(out, f"(drive t x y)\n{bad}")


def test_an_event_that_depends_on_the_state_is_no_timed_initial_literal() -> None:
    problem = imported(parse(TRUCK, WAY)).problem
    assert problem.times is not None
    (event,) = problem.times.events
    (drive,) = (one for name, one in problem.domain.behaviors.items() if name != event)
    behaviors = {**problem.domain.behaviors, event: replace(drive, name=event)}
    with pytest.raises(KnowledgeError, match=f"the external event {event} depends on the state"):
        exported(replace(problem, domain=replace(problem.domain, behaviors=behaviors)))


def test_the_timed_plan_of_an_engine_is_read_and_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = imported(parse(CELLAR, FUSES)).problem
    out = exported(problem)
    again = imported(parse(out.domain, out.problem))
    timed = planned(again.problem)
    assert timed is not None
    said = lines(again, timed).splitlines()
    monkeypatch.setattr(engines, "answer", lambda *_: ("lpg", "SOLVED_SATISFICING", said))
    found = engines.plan_in_time_by_engine(problem, "lpg")
    its = schedule_of(found)
    assert found.status is Status.SOLVED and its is not None and its.makespan == timed.makespan
    said.pop(0)  # a match that isn't struck mends nothing
    assert engines.plan_in_time_by_engine(problem, "lpg").status is Status.GAVE_UP
