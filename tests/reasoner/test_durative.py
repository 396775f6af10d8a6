"""PDDL 2.1: durative actions and timed initial literals become scenes; unified-planning's validator accepts their plans."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from time import process_time

import pytest

import confab
from confab.planner.plan import Limits
from confab.planner.solve import Request, solve
from confab.planner.timed import concurrent
from confab.planner.timed.call import in_time
from confab.planner.timed.plan import TimedPlan
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import Imported, imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.symbols import FALSE, TRUE, Span, ValueEffect
from confab.reasoner.timing import only_during, projected
from confab.trees import behavior_tree

EPSILON = Fraction(1, 1000)
CELLAR = """(define (domain cellar) (:requirements :typing :durative-actions) (:types match fuse)
  (:predicates (handfree) (unused ?m - match) (mended ?f - fuse) (light ?m - match))
  (:durative-action strike :parameters (?m - match) :duration (= ?duration 5)
    :condition (at start (unused ?m))
    :effect (and (at start (not (unused ?m))) (at start (light ?m)) (at end (not (light ?m)))))
  (:durative-action correct :parameters (?f - fuse ?m - match) :duration (= ?duration 2)
    :condition (and (at start (handfree)) (over all (light ?m)))
    :effect (and (at start (not (handfree))) (at end (mended ?f)) (at end (handfree)))))"""
FUSES = """(define (problem fuses) (:domain cellar) (:objects a b - match f g h - fuse)
  (:init (handfree) (unused a) (unused b)) (:goal (and (mended f) (mended g) (mended h))) (:metric minimize (total-time)))"""
TRUCK = """(define (domain truck) (:requirements :typing :durative-actions :fluents) (:types place truck)
  (:predicates (at ?t - truck ?p - place) (road ?p ?q - place) (open ?p - place))
  (:functions (length ?p ?q - place) (speed ?t - truck))
  (:durative-action drive :parameters (?t - truck ?p ?q - place) :duration (= ?duration (/ (length ?p ?q) (speed ?t)))
    :condition (and (at start (at ?t ?p)) (over all (road ?p ?q)) (at end (open ?q)))
    :effect (and (at start (not (at ?t ?p))) (at end (at ?t ?q)))))"""
WAY = """(define (problem way) (:domain truck) (:objects t u - truck x y - place)
  (:init (at t x) (at u x) (road x y) (= (length x y) 12) (= (speed t) 4) (= (speed u) 3) (at 10 (open y)))
  (:goal (and (at t y) (at u y))))"""

BAKERY = """(define (domain bakery) (:requirements :typing :durative-actions)
  (:types short long - oven loaf) (:predicates (hot ?o - oven) (baked ?l - loaf) (packed ?k ?l - loaf))
  (:durative-action warm :parameters (?o - short) :duration (= ?duration 4)
    :condition () :effect (and (at start (hot ?o)) (at end (not (hot ?o)))))
  (:durative-action heat :parameters (?o - long) :duration (= ?duration 12)
    :condition () :effect (and (at start (hot ?o)) (at end (not (hot ?o)))))
  (:durative-action bake :parameters (?l - loaf ?o - oven) :duration (= ?duration 9)
    :condition (over all (hot ?o)) :effect (at end (baked ?l)))
  (:durative-action pack :parameters (?k ?l - loaf ?o - oven) :duration (= ?duration 1)
    :condition (and (over all (baked ?k)) (over all (baked ?l)) (over all (hot ?o))) :effect (at end (packed ?k ?l))))"""


def loaves(number: int, ovens: str) -> str:
    every = [f"l{i}" for i in range(number)]
    goals = " ".join(f"(packed {a} {b})" for a, b in zip(every[::2], every[1::2], strict=True))
    return f"(define (problem p) (:domain bakery) (:objects {ovens} {' '.join(every)} - loaf) (:init) (:goal (and {goals})))"


def planned(found: Imported) -> TimedPlan:
    problem = found.problem
    if only_during(problem):
        timed = concurrent.plan(problem, Limits(seconds=20.0), EPSILON)[1]
    else:
        plan = solve(Request(problem, limits=Limits(seconds=20.0))).plan
        assert plan is not None
        timed = in_time(problem, plan, 1.0, EPSILON)
    assert timed.plan is not None, timed.reason
    return timed.plan


def accepted(domain: str, problem: str, found: Imported, timed: TimedPlan) -> bool:
    """Return whether unified-planning's validator accepts a timed plan."""
    pytest.importorskip("unified_planning")
    from unified_planning.engines.plan_validator import TimeTriggeredPlanValidator
    from unified_planning.io import PDDLReader
    from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    read = PDDLReader().parse_problem_string(domain, problem)
    lines = []
    for slot in timed.slots:
        line = found.line(slot.step.behavior, slot.step.arguments)
        if slot.step.behavior not in (found.problem.times.events if found.problem.times else {}):
            lines.append(f"{float(slot.begin):.6f}: ({line}) [{float(slot.end - slot.begin):.6f}]")
    plan = PDDLReader().parse_plan_string(read, "\n".join(lines))
    return bool(TimeTriggeredPlanValidator().validate(read, plan))


def test_fuses_are_repaired_while_a_match_burns() -> None:
    found = imported(parse(CELLAR, FUSES))
    timed = planned(found)
    assert only_during(found.problem) == {"STRIKE"}
    assert 6 < timed.makespan < 7  # three fuses and one hand
    assert accepted(CELLAR, FUSES, found, timed)


def test_a_step_that_is_too_long_for_one_envelope_runs_in_a_longer_one() -> None:
    problem = loaves(4, "a b - short c - long")
    found = imported(parse(BAKERY, problem))
    timed = planned(found)
    assert {slot.step.behavior for slot in timed.slots} == {"HEAT", "BAKE", "PACK"}
    assert accepted(BAKERY, problem, found, timed)


def test_steps_that_differ_only_in_their_duration_give_way_to_the_longest_of_them() -> None:
    """An object of a type (either a b) belongs to both types."""
    timed = planned(imported(parse(BAKERY, loaves(4, "a - (either short long)"))))
    assert [slot.step.behavior for slot in timed.slots if slot.step.behavior in ("WARM", "HEAT")] == ["HEAT"]


def test_a_value_that_no_step_gives_for_long_enough_is_out_of_reach() -> None:
    problem = imported(parse(BAKERY, loaves(2, "a - short"))).problem
    outcome, timed = concurrent.plan(problem, Limits(seconds=5.0), EPSILON)
    assert outcome.status.value == "gave-up" and timed.plan is None


def test_sixty_loaves_are_baked_and_packed_at_the_same_time() -> None:
    problem = loaves(60, "c - long")
    found = imported(parse(BAKERY, problem))
    timed = planned(found)
    assert timed.makespan == 12 and accepted(BAKERY, problem, found, timed)


def test_a_metric_may_weigh_the_makespan_beside_a_cost() -> None:
    problem = "(define (problem p) (:domain d) (:init (= (fuel) 0)) (:goal (done)) (:metric minimize {}))"
    domain = """(define (domain d) (:predicates (done)) (:functions (fuel))
      (:durative-action go :parameters () :duration (and (at start (>= ?duration 2)) (at end (<= ?duration 3)))
        :condition () :effect (and (at end (done)) (at end (increase (fuel) 5)))))"""
    for metric, cost in (("(+ (* 2 (total-time)) (* 3 (fuel)))", 15), ("(* 2 (total-time))", 1), ("(fuel)", 5)):
        found = imported(parse(domain, problem.format(metric)))
        assert found.problem.domain.behaviors["GO"].cost == cost
        assert planned(found).makespan == 2
    for metric in ("()", "(- (fuel) (total-time))", "(* (fuel) (total-time))"):
        with pytest.raises(PddlError):
            parse(domain, problem.format(metric))


def test_a_duration_is_calculated_and_a_timed_initial_fact_is_awaited() -> None:
    found = imported(parse(TRUCK, WAY))
    timed = planned(found)
    seconds = {slot.step.arguments[0]: slot.end - slot.begin for slot in timed.slots if slot.step.behavior == "DRIVE"}
    assert seconds == {"t": Fraction(3), "u": Fraction(4)}
    assert min(slot.end for slot in timed.slots if slot.step.behavior == "DRIVE") > 10


@pytest.mark.parametrize(("domain", "problem"), [(CELLAR, FUSES), (TRUCK, WAY)])
def test_a_scene_file_keeps_all_durations_and_timed_conditions_of_a_pddl_domain(
    domain: str, problem: str, tmp_path: Path
) -> None:
    found = imported(parse(domain, problem)).problem
    path = tmp_path / "scene.ttl"
    path.write_text(turtle(found, "title", "description"), encoding="utf-8")
    read = confab.load(str(path)).problem
    assert read.times == found.times
    for name, behavior in found.domain.behaviors.items():
        again = read.domain.behaviors[name]
        assert set(again.preconditions) == set(behavior.preconditions)
        assert set(again.effects) == set(behavior.effects)
        assert behavior.timing is not None
        assert again.timing is not None
        assert again.timing.duration == behavior.timing.duration
        assert set(again.timing.effects) == set(behavior.timing.effects)
        for span in (Span.START, Span.END):
            assert set(again.timing.asked(span)) == set(behavior.timing.asked(span))


def test_what_a_step_takes_at_its_start_and_gives_back_at_its_end_is_unchanged_and_equal_increases_add_up(
    tmp_path: Path,
) -> None:
    domain = """(define (domain crane) (:requirements :durative-actions :fluents) (:functions (power) (height))
      (:durative-action lift :parameters () :duration (= ?duration 5) :condition (at start (>= (power) 2))
        :effect (and (at start (decrease (power) 2)) (at end (increase (power) 2))
          (at end (increase (height) 1)) (at end (increase (height) 1)))))"""
    problem = """(define (problem high) (:domain crane) (:init (= (power) 3) (= (height) 0))
      (:goal (and (= (power) 3) (= (height) 4))))"""
    path = tmp_path / "scene.ttl"
    path.write_text(turtle(imported(parse(domain, problem)).problem, "title", "description"), encoding="utf-8")
    plan = confab.load(str(path)).plan(time_limit=20).plan
    assert plan is not None
    assert [step.behavior for step in plan.primitives] == ["LIFT", "LIFT"]


def test_an_export_without_time_is_refused_where_a_value_holds_only_during_a_step() -> None:
    with pytest.raises(KnowledgeError, match="only while it lasts"):
        to_pddl(imported(parse(CELLAR, FUSES)).problem)


def test_a_scene_with_time_is_planned_with_its_schedule(tmp_path: Path) -> None:
    path = tmp_path / "scene.ttl"
    path.write_text(turtle(imported(parse(CELLAR, FUSES)).problem, "title", "description"), encoding="utf-8")
    result = confab.load(str(path)).plan(time_limit=20)
    assert result.timed is not None
    assert result.json()["schedule"]["makespan"] == float(result.timed.makespan)
    assert "makespan" in str(result)
    assert "STRIKE" in result._repr_html_()
    with pytest.raises(KnowledgeError, match="must overlap"):
        behavior_tree(result.problem, result.plan)
    with pytest.raises(KnowledgeError, match="must overlap"):
        confab.load(str(path)).plan(engine="tamer")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (":condition (unused ?m) :effect (at end (light ?m))", "wanted .at start"),
        (":condition (at start (unused ?m)) :effect (over all (light ?m))", "an effect is .at start"),
        (":effect (at end (when (at start (unused ?m)) (light ?m)))", "undefined predicate|takes"),
        (":effect (when (at start (unused ?m)) (at end (light ?m)))", "at another time than the effect"),
    ],
)
def test_a_condition_or_effect_with_a_missing_or_wrong_time_is_refused_with_its_place(text: str, said: str) -> None:
    head = CELLAR[: CELLAR.index("(:durative-action strike")]
    domain = f"{head}\n(:durative-action strike :parameters (?m - match) :duration (= ?duration 5) {text}))"
    with pytest.raises(PddlError, match=rf"domain:4:\d+: .*({said})"):
        parse(domain, FUSES)


@pytest.mark.parametrize(
    "duration",
    [
        "(and (>= ?duration 2) (>= ?duration 5))",
        "(and (= ?duration 5) (<= ?duration 3))",
        "(and (<= ?duration 5) (= ?duration 3))",
        "(and (>= ?duration 5) (<= ?duration 3))",
    ],
)
def test_bounds_of_a_duration_that_an_import_would_ignore_are_refused_with_their_place(duration: str) -> None:
    domain = CELLAR.replace("(= ?duration 5)", duration)
    with pytest.raises(PddlError, match=r"domain:3:\d+: .*bound"):
        parse(domain, FUSES)


@pytest.mark.parametrize(
    ("action", "init", "goal", "steps"),
    [
        ("(at start (not (p))) :effect (and (at start (p)) (when (at end (p)) (at end (q))))", "", "(q)", ["A"]),
        (
            "(at start (p)) :effect (and (at start (not (p))) (when (at end (not (p))) (at end (q))) (at end (p)))",
            "(p)",
            "(and (p) (q))",
            ["A"],
        ),
        (
            "(at start (not (p))) :effect (and (at start (p)) (when (at end (p)) (at end (not (q)))) (at end (r)))",
            "(q)",
            "(and (q) (r))",
            None,
        ),
        (
            "(at start (< (n) 1)) :effect (and (at start (increase (n) 1)) (when (at end (>= (n) 1)) (at end (q))))",
            "",
            "(q)",
            ["A"],
        ),
    ],
)
def test_a_condition_of_an_effect_at_the_end_is_judged_at_the_end(
    action: str, init: str, goal: str, steps: list[str] | None, tmp_path: Path
) -> None:
    domain = f"""(define (domain d) (:predicates (p) (q) (r)) (:functions (n))
      (:durative-action a :parameters () :duration (= ?duration 5) :condition {action}))"""
    found = imported(parse(domain, f"(define (problem e) (:domain d) (:init {init} (= (n) 0)) (:goal {goal}))"))
    path = tmp_path / "scene.ttl"
    path.write_text(turtle(found.problem, "title", "description"), encoding="utf-8")
    read = confab.load(str(path))
    for name, behavior in found.problem.domain.behaviors.items():
        assert set(read.problem.domain.behaviors[name].every_effect) == set(behavior.every_effect)
    plan = read.plan(optimal=True).outcome.plan
    assert (plan and [step.behavior for step in plan.primitives]) == steps


def test_the_effects_of_a_step_on_many_individuals_are_ordered_in_proportion_to_their_number() -> None:
    begun = [(Span.START, ValueEffect("P", (f"i{i}",), TRUE)) for i in range(10_000)]
    ended = [(Span.END, replace(effect, value=FALSE)) for _, effect in begun]
    begin = process_time()
    assert projected((), [*begun, *ended]) == ((), tuple(effect for _, effect in ended))
    assert process_time() - begin < 5.0
