"""Goals, soft goals and metrics of PDDL: the imported problem has the cheapest plans of the PDDL problem."""

from __future__ import annotations

from pathlib import Path

import pytest

import confab
from confab.planner.plan import Status
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle

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
