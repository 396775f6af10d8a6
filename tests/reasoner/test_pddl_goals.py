"""Goals, soft goals and metrics of PDDL: the imported problem has the cheapest plans of the PDDL problem."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import confab
from confab.planner.plan import Limits, Status
from confab.planner.plan_costs import cost_of
from confab.planner.preferences import preferred
from confab.planner.solve import Request, solve
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Parameter, Rule, SituationType, Symbol
from worlds.writing import becomes, behavior, has, lacks, world

COSTS = "(:functions (total-cost) (f))"
MAKE = "(:action make :parameters () :effect (and (g) (increase (f) 1) (increase (total-cost) 1)))"
SOFT = "(:metric minimize (+ (total-cost) (* 5 (is-violated x))))"


def cheapest(domain: str, problem: str, folder: Path) -> list[str] | None:
    """Return the steps of a cheapest plan in PDDL's notation, or None if no plan exists."""
    found = imported(parse(f"(define (domain d) {domain})", f"(define (problem e) (:domain d) {problem})"))
    scene = folder / "scene.ttl"
    scene.write_text(turtle(found.problem, "title", "description", found.said))
    outcome = confab.load(scene).plan(optimal=True).outcome
    if outcome.plan is None:
        assert outcome.status is Status.UNSOLVABLE
        return None
    return [found.line(step.behavior, step.arguments) for step in outcome.plan.steps]


@pytest.mark.parametrize(
    ("goal", "steps"),
    [
        ("(preference x (g))", ["make"]),
        ("(preference x (>= (f) 1))", ["make"]),
        ("(preference x (d))", ["make"]),
        ("(and (or (h) (not (h))) (preference x (g)))", ["make"]),
        ("(and (forall (?o) (imply (= ?o ?o) (= ?o ?o))) (preference x (g)))", ["make"]),
        ("(preference x (h))", []),
    ],
)
def test_a_soft_goal_is_not_a_fact_before_the_plan(goal: str, steps: list[str], tmp_path: Path) -> None:
    domain = f"(:predicates (g) (d) (h)) {COSTS} (:derived (d) (g)) {MAKE}"
    init = "(:objects o) (:init (= (f) 0) (= (total-cost) 0))"
    assert cheapest(domain, f"{init} (:goal {goal}) {SOFT}", tmp_path) == steps


@pytest.mark.parametrize(
    ("hard", "x", "y", "steps"),
    [
        ("", "(and (g) (h))", "(not (on o))", ["both"]),
        ("", "(or (g) (h))", "(not (g))", ["make"]),
        ("", "(g)", "(not (g))", ["make"]),
        ("(not (g))", "(g)", "(on o)", []),
        ("", "(forall (?o) (on ?o))", "(h)", []),
        ("", "(exists (?o) (on ?o))", "(on o)", ["put o"]),
    ],
)
def test_a_soft_goal_may_be_any_condition(hard: str, x: str, y: str, steps: list[str], tmp_path: Path) -> None:
    domain = f"""(:predicates (g) (h) (on ?x)) {COSTS} {MAKE}
     (:action both :parameters () :effect (and (g) (h) (increase (total-cost) 4)))
     (:action put :parameters (?x) :effect (and (on ?x) (increase (total-cost) 3)))"""
    metric = "(:metric minimize (+ (total-cost) (is-violated y) (* 5 (is-violated x))))"
    goal = f"(:goal (and {hard} (preference x {x}) (preference y {y})))"
    problem = f"(:objects o p) (:init (= (f) 0) (= (total-cost) 0)) {goal}"
    assert cheapest(domain, f"{problem} {metric}", tmp_path) == steps
    if not hard:
        assert cheapest(domain, f"{problem} (:metric minimize (total-cost))", tmp_path) == []


def test_a_value_that_only_a_soft_goal_mentions_keeps_its_predicate(tmp_path: Path) -> None:
    domain = """(:predicates (at ?x ?y) (in ?x ?y) (place ?x) (truck ?x)) (:functions (total-cost))
     (:action load :parameters (?p ?t ?l) :precondition (and (truck ?t) (place ?l) (at ?p ?l) (at ?t ?l))
      :effect (and (not (at ?p ?l)) (in ?p ?t) (increase (total-cost) 1)))
     (:action unload :parameters (?p ?t ?l) :precondition (and (truck ?t) (place ?l) (in ?p ?t) (at ?t ?l))
      :effect (and (at ?p ?l) (not (in ?p ?t)) (increase (total-cost) 1)))
     (:action drive :parameters (?t ?f ?l) :precondition (and (truck ?t) (place ?l) (place ?f) (at ?t ?f))
      :effect (and (at ?t ?l) (not (at ?t ?f)) (increase (total-cost) 1)))"""
    init = "(:objects p t a b) (:init (truck t) (place a) (place b) (at p a) (at t a) (= (total-cost) 0))"
    assert cheapest(domain, f"{init} (:goal (and (at t b) (preference x (at p t)))) {SOFT}", tmp_path) == [
        "drive t a b"
    ]
    assert cheapest(domain, f"{init} (:goal (and (at t b) (preference x (in p t)))) {SOFT}", tmp_path) == [
        "load p t a",
        "drive t a b",
    ]


def test_a_goal_with_a_disjunction_holds_in_the_last_state(tmp_path: Path) -> None:
    domain = """(:predicates (p) (q) (r) (s)) (:functions (total-cost))
     (:action make :parameters () :precondition (not (s)) :effect (and (p) (increase (total-cost) 1)))
     (:action spoil :parameters () :precondition (p) :effect (and (r) (not (p)) (s) (increase (total-cost) 1)))"""
    init = "(:init (= (total-cost) 0))"
    assert cheapest(domain, f"{init} (:goal (and (or (p) (q)) (preference x (r)))) {SOFT}", tmp_path) == ["make"]
    assert cheapest(domain, f"{init} (:goal (and (or (p) (q)) (r)))", tmp_path) is None


@pytest.mark.parametrize("goal", ["(q)", "(or (q) (r))", "(exists (?x) (and (q) (= ?x ?x)))"])
def test_a_goal_that_a_timed_literal_ends_is_not_reached(goal: str, tmp_path: Path) -> None:
    domain = """(:predicates (p) (q) (r))
     (:durative-action make :parameters () :duration (= ?duration 1) :condition (and) :effect (at end (p)))"""
    problem = f"(:objects o) (:init (q) (at 5 (not (q)))) (:goal (and (p) {goal}))"
    assert cheapest(domain, problem, tmp_path) is None


FUELS = """(:predicates (q)) (:functions (total-cost) (fuel) (oil) (rate) (of ?x))
 (:action a :parameters () :effect (and (q) (increase (fuel) 2) (increase (total-cost) 10)))
 (:action b :parameters () :effect (and (q) (increase (oil) 3) (increase (total-cost) 1)))
 (:action c :parameters (?x) :effect (increase (of ?x) 1))
 (:action d :parameters (?x) :effect (when (q) (increase (rate) 1)))"""
FUELLED = """(:objects m n) (:init (= (fuel) 0) (= (oil) 0) (= (rate) 2) (= (total-cost) 0) (= (of m) 0) (= (of n) 0))
 (:goal {})
 (:metric minimize {}))"""


@pytest.mark.parametrize(
    ("metric", "costs"),
    [
        ("(fuel)", (2, 0)),
        ("(oil)", (0, 3)),
        ("(total-cost)", (10, 1)),
        ("(+ (fuel) (+ (fuel) (oil)))", (4, 3)),
        ("(+ (* 2 (fuel)) (* (oil) 1e1) 7)", (4, 30)),
        ("(/ (+ (fuel) (oil)) 4)", (0.5, 0.75)),
        ("(- (total-cost) (- (fuel) (* 2 (oil))))", (8, 7)),
        ("(* (+ 1 2) (* (fuel) .5))", (3, 0)),
        ("(+ (total-time) (oil))", (0, 3)),
    ],
)
def test_the_cost_of_an_action_is_its_part_of_the_metric(metric: str, costs: tuple[float, float]) -> None:
    found = imported(
        parse(f"(define (domain d) {FUELS})", "(define (problem e) (:domain d) " + FUELLED.format("(q)", metric))
    )
    assert tuple(found.problem.domain.behaviors[name].cost for name in "AB") == costs


@pytest.mark.parametrize(
    ("metric", "message"),
    [
        ("(* (fuel) (oil))", "problem:3:20: the metric must be a weighted sum; (* …) isn't"),
        ("(+ (oil) (/ 1 (fuel)))", "problem:3:29: the metric must be a weighted sum; (/ …) isn't"),
        ("(/ (fuel) 0)", "problem:3:20: the metric must be a weighted sum; (/ …) isn't"),
        ("(+ (of m) (oil))", "problem:3:23: the terms of 'of' must have the same weight in the metric for all objects"),
        ("(+ (oil) (rate))", "problem:3:29: action 'd' changes 'rate' under a condition"),
        ("(- (is-violated x))", "problem:3:23: the violation of preference 'x' reduces the metric"),
        ("(+ (oil) 1e)", "problem:3:29: wanted a number, got '1e'"),
    ],
)
def test_a_metric_that_no_sum_of_costs_equals_is_refused_with_its_place(metric: str, message: str) -> None:
    problem = "(define (problem e) (:domain d) " + FUELLED.format("(and (q) (preference x (q)))", metric)
    with pytest.raises(PddlError) as refused:
        parse(f"(define (domain d) {FUELS})", problem)
    assert str(refused.value).startswith(message)


def test_an_action_that_reduces_the_metric_is_refused() -> None:
    problem = "(define (problem e) (:domain d) " + FUELLED.format("(q)", "(- (oil) (fuel))")
    with pytest.raises(PddlError, match="action 'a': its cost is -2"):
        imported(parse(f"(define (domain d) {FUELS})", problem))


@pytest.mark.parametrize(
    ("metric", "steps"),
    [
        ("(is-violated x)", ["make"]),
        ("(+ (total-cost) (* .25 (is-violated x)) (/ (is-violated x) 2))", []),
        ("(+ (total-cost) (is-violated x) (is-violated x))", ["make"]),
        ("(+ (total-cost) (* 1E+1 (is-violated x)))", ["make"]),
    ],
)
def test_the_weight_of_a_soft_goal_is_its_part_of_the_metric(metric: str, steps: list[str], tmp_path: Path) -> None:
    problem = (
        f"(:init (h) (= (f) 0) (= (total-cost) 0)) (:goal (and (h) (preference x (g)))) (:metric minimize {metric})"
    )
    unmake = "(:action unmake :parameters () :effect (not (h)))"
    assert cheapest(f"(:predicates (g) (h)) {COSTS} {MAKE} {unmake}", problem, tmp_path) == steps


def total(problem: Problem) -> Fraction:
    """Return the least sum of a plan's cost and the weights of the soft goals that the plan leaves unmet."""
    limits = Limits(seconds=60.0)
    task, outcome = preferred(
        problem, lambda one: solve(Request(one, limits=limits)), lambda one: solve(Request(one, "optimal", limits))
    )
    assert outcome.plan is not None
    assert outcome.proved
    return Fraction(cost_of(task, outcome.plan)) + sum(one.weight for one in outcome.forgone)


@pytest.mark.parametrize(
    ("wish", "weight", "least"), [("north", 9, 7), ("north", 1, 6), ("home", 1, 5), ("east", 1, 3)]
)
def test_a_symbol_whose_exported_soft_goal_is_unmet_has_to_be_at_rest(wish: str, weight: int, least: int) -> None:
    go = behavior("GO", 1, "?v:Van ?p:Place", [lacks("AT", "?v", "?p")], [becomes("AT", "?v", "?p")])
    north = behavior("GO_NORTH", 1, "?v:Van", [], [becomes("AT", "?v", "north")])
    look = behavior("LOOK", 1, "?v:Van ?p:Place", [has("AT", "?v", "?p")], [becomes("SEEN", "?p", TRUE)])
    problem = world(
        [SituationType("AT", ("Van",), "All", rest="home"), SituationType("SEEN", ("Place",), "Truth", boolean=True)],
        [replace(go, cost=2.0), replace(north, cost=4.0), look],
        {"Van": ("van",), "Place": ("home", "east"), "All": ("home", "east", "north")},
        {"AT van": "home"},
        {"SEEN east": TRUE, "AT van": wish},
    )
    problem = replace(problem, weights={Symbol("AT", ("van",)): Fraction(weight)})
    exported = to_pddl(problem)
    again = imported(parse(exported.domain, exported.problem)).problem
    assert total(problem) == total(again) == least


def test_a_symbol_of_a_hard_goal_need_not_be_at_rest_although_a_soft_goal_is_about_it_too() -> None:
    sent = SituationType("SENT", ("Van",), "Truth", boolean=True, rest=FALSE)
    home = SituationType("HOME", ("Van",), "Truth", boolean=True, default=FALSE)
    problem = world(
        [sent, home],
        [behavior("SEND", 1, "?v:Van", [], [becomes("SENT", "?v", TRUE)])],
        {"Van": ("van",)},
        {},
        {"SENT van": TRUE, "HOME van": TRUE},
    )
    rules = {"HOME": (Rule("HOME", (Parameter("?v", "Van"),), (), (lacks("SENT", "?v", TRUE),)),)}
    problem = replace(problem, domain=replace(problem.domain, rules=rules))
    problem = replace(problem, weights={Symbol("HOME", ("van",)): Fraction(1)})
    exported = to_pddl(problem)
    again = imported(parse(exported.domain, exported.problem)).problem
    assert total(problem) == total(again) == 2


FILL = """(:types tank) (:predicates (full) (done)) (:functions (total-cost) (level ?t - tank) (cap ?t - tank))
 (:action fill :parameters (?t - tank) :effect (and (increase (level ?t) 1) (increase (total-cost) 1)))
 (:action finish :parameters () :precondition (full) :effect (and (done) (increase (total-cost) 1)))"""
FILLED = "(:objects a b - tank) (:init (= (level a) 0) (= (level b) 0) (= (cap a) 2) (= (cap b) 0) (= (total-cost) 0))"


@pytest.mark.parametrize(
    ("read", "goal", "steps"),
    [
        ("", "(>= (level a) (cap a))", ["fill a"] * 2),
        ("", "(forall (?t - tank) (>= (level ?t) (cap ?t)))", ["fill a"] * 2),
        ("", "(preference x (>= (level a) (+ (cap b) 1)))", ["fill a"]),
        ("(:derived (full) (exists (?t - tank) (> (level ?t) (cap ?t))))", "(done)", ["fill b", "finish"]),
        ("(:constraints (forall (?t - tank) (always (<= (level ?t) (cap ?t)))))", "(>= (level a) 2)", ["fill a"] * 2),
        ("(:constraints (forall (?t - tank) (always (<= (level ?t) (cap ?t)))))", "(>= (level b) 1)", None),
    ],
)
def test_a_function_that_never_changes_keeps_its_numbers_whatever_reads_it(
    read: str, goal: str, steps: list[str] | None, tmp_path: Path
) -> None:
    assert (
        cheapest(f"{FILL} {read}", f"{FILLED} (:goal {goal}) {SOFT if 'preference' in goal else ''}", tmp_path) == steps
    )


@pytest.mark.parametrize("factor", ["1", "0.0000001", "1e-20", "123456789"])
def test_a_cost_is_written_with_all_its_digits(factor: str, tmp_path: Path) -> None:
    domain = """(:predicates (g) (h)) (:functions (total-cost))
     (:action long :parameters () :effect (and (g) (increase (total-cost) 4)))
     (:action first :parameters () :effect (and (h) (increase (total-cost) 1)))
     (:action second :parameters () :precondition (h) :effect (and (g) (increase (total-cost) 1)))"""
    problem = f"(:init (= (total-cost) 0)) (:goal (g)) (:metric minimize (* {factor} (total-cost)))"
    assert cheapest(domain, problem, tmp_path) == ["first", "second"]


@pytest.mark.parametrize(
    ("action", "init", "goal", "steps"),
    [
        (
            "(?w_x) :precondition (exists (?x) (and (lit ?x) (at ?w_x ?x))) :effect (done)",
            "(lit b) (at a b)",
            "(done)",
            ["act a"],
        ),
        (
            "(?x ?l) :precondition (at ?x ?l) :effect (and (not (at ?x ?l)) (forall (?x) (when (done) (at ?x ?l))))",
            "(done) (at a c) (at b d)",
            "(and (at b c) (at b d))",
            ["act a c"],
        ),
        (
            "(?x ?a ?b) :precondition (at ?x ?a) :effect"
            " (and (not (at ?x ?a)) (at ?x ?b) (forall (?x) (when (at ?x ?b) (not (at ?x ?b)))))",
            "(at a c) (at b d)",
            "(and (at a d) (not (at b d)))",
            ["act a c d"],
        ),
        (
            "(?x ?x_) :precondition (forall (?x ?x_) (exists (?x) (at ?x ?x_))) :effect (at ?x ?x_)",
            "(at a a) (at a b) (at b c) (at c d)",
            "(at d d)",
            ["act d d"],
        ),
        (
            "(?x) :precondition (and) :effect (lit ?x)",
            "(at a b)",
            "(exists (?x) (and (lit ?x) (exists (?y) (and (at ?x ?y) (exists (?x) (and (not (lit ?x)) (at ?x ?y)))))))",
            None,
        ),
    ],
)
def test_each_quantified_variable_is_another_one_than_those_outside_its_quantifier(
    action: str, init: str, goal: str, steps: list[str] | None, tmp_path: Path
) -> None:
    domain = f"(:predicates (at ?x ?l) (lit ?x) (done)) (:action act :parameters {action})"
    assert cheapest(domain, f"(:objects a b c d) (:init {init}) (:goal {goal})", tmp_path) == steps


def test_objects_may_have_numbers_as_names(tmp_path: Path) -> None:
    domain = """(:predicates (at ?x ?y) (way ?x ?y)) (:action move :parameters (?x ?a ?b)
      :precondition (and (at ?x ?a) (way ?a ?b)) :effect (and (not (at ?x ?a)) (at ?x ?b)))"""
    problem = "(:objects 1 2 3) (:init (at 1 2) (way 2 3)) (:goal (at 1 3))"
    assert cheapest(domain, problem, tmp_path) == ["move 1 2 3"]
