"""The constructs of PDDL, one small problem each: imported, planned with the least number of steps, exported and imported again."""

from __future__ import annotations

from pathlib import Path

import pytest

from confab.planner.grounded.best_first import plan_level
from confab.planner.plan import Status
from confab.planner.solve import Request, solve
from confab.reasoner.amounts import Measure
from confab.reasoner.graph.knowledge import load
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.reading.problem import read
from confab.reasoner.validation.validate import validate
from tests.reasoner.test_pddl import assert_same_behaviour, same

AT = "(:predicates (at ?x) (way ?x ?y))"
GO = """(:action go :parameters (?x ?y) :precondition (and (at ?x) (way ?x ?y))
 :effect (and (at ?y) (not (at ?x))))"""

CONSTRUCTS = {  # domain, problem, number of steps of a plan
    "no types no req": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (at c))",
        2,
    ),
    "constants": (
        (
            "(:types place) (:constants home - place) (:predicates (at ?x - place)) (:action back :parameters "
            "(?x - place) :precondition (at ?x) :effect (and (at home) (not (at ?x))))"
        ),
        "(:objects a - place) (:init (at a)) (:goal (at home))",
        1,
    ),
    "constant also object": (
        (
            "(:types place) (:constants home - place) (:predicates (at ?x - place)) (:action back :parameters "
            "(?x - place) :precondition (at ?x) :effect (and (at home) (not (at ?x))))"
        ),
        "(:objects a home - place) (:init (at a)) (:goal (at home))",
        1,
    ),
    "object declared twice": (
        AT + GO,
        "(:objects a b c b a) (:init (at a) (way a b) (way b c)) (:goal (at c))",
        2,
    ),
    "object lower type": (
        (
            "(:types thing - object cup - thing) (:predicates (seen ?x - thing)) (:action see :parameters (?x - "
            "thing) :effect (seen ?x))"
        ),
        "(:objects a - thing a - cup) (:init ) (:goal (seen a))",
        1,
    ),
    "either pred": (
        (
            "(:types plane person city) (:predicates (at ?x - (either plane person) ?c - city) (in ?p - person "
            "?a - plane)) (:action fly :parameters (?a - plane ?f ?t - city) :precondition (at ?a ?f) :effect "
            "(and (at ?a ?t) (not (at ?a ?f)))) (:action board :parameters (?p - person ?a - plane ?c - city) "
            ":precondition (and (at ?p ?c) (at ?a ?c)) :effect (and (in ?p ?a) (not (at ?p ?c)))) (:action leave "
            ":parameters (?p - person ?a - plane ?c - city) :precondition (and (in ?p ?a) (at ?a ?c)) :effect "
            "(and (at ?p ?c) (not (in ?p ?a))))"
        ),
        "(:objects p - plane q - person x y - city) (:init (at p x) (at q x)) (:goal (at q y))",
        3,
    ),
    "either param": (
        (
            "(:types a b c) (:predicates (done ?x - (either a b)) (ok ?x - a)) (:action f :parameters (?x - "
            "(either a b)) :effect (done ?x)) (:action g :parameters (?x - (either a b)) :precondition (done ?x) "
            ":effect (ok ?x))"
        ),
        "(:objects u - a v - b w - c) (:init ) (:goal (and (ok u) (done v)))",
        3,
    ),
    "either quantified": (
        (
            "(:types a b c) (:predicates (done ?x) (fin)) (:action f :parameters (?x - object) :effect (done "
            "?x)) (:action g :parameters () :precondition (forall (?x - (either a b)) (done ?x)) :effect (fin))"
        ),
        "(:objects u - a v - b w - c) (:init ) (:goal (fin))",
        3,
    ),
    "either object": (
        ("(:types a b) (:predicates (done ?x - a)) (:action f :parameters (?x - (either a b)) :effect (done ?x))"),
        "(:objects u - a v - (either a b)) (:init ) (:goal (done u))",
        1,
    ),
    "either in types": (
        (
            "(:types boat - (either ship car) ship car - object) (:predicates (swims ?x - ship) (drives ?x - "
            "car)) (:action f :parameters (?x - ship) :effect (swims ?x)) (:action g :parameters (?x - car) "
            ":precondition (swims ?x) :effect (drives ?x))"
        ),
        "(:objects u - boat) (:init ) (:goal (drives u))",
        2,
    ),
    "type twice": (
        (
            "(:types boat - ship boat - car ship car) (:predicates (swims ?x - ship) (drives ?x - car)) (:action "
            "f :parameters (?x - ship) :effect (swims ?x)) (:action g :parameters (?x - car) :precondition "
            "(swims ?x) :effect (drives ?x))"
        ),
        "(:objects u - boat) (:init ) (:goal (drives u))",
        2,
    ),
    "no space": (
        (
            "(:types city)(:predicates(at?x - city)(way?x?y - city))(:action go :parameters(?x?y - "
            "city):precondition(and(at?x)(way?x?y)):effect(and(at?y)(not(at?x))))"
        ),
        "(:objects a b c - city) (:init (at a) (way a b) (way b c)) (:goal (at c))",
        2,
    ),
    "upper": (
        (
            "(:TYPES City) (:PREDICATES (At ?X - CITY) (Way ?x ?Y - city)) (:ACTION Go :PARAMETERS (?x ?y - "
            "City) :PRECONDITION (AND (AT ?X) (WAY ?x ?Y)) :EFFECT (AND (at ?y) (NOT (at ?x))))"
        ),
        "(:objects A b C - city) (:init (AT a) (way A B) (WAY b c)) (:goal (AT C))",
        2,
    ),
    "comments": (
        "; one\n" + AT + " ; (two\n" + GO,
        "(:objects a b c ; d\n) (:init (at a) (way a b) (way b c)) (:goal (at c))",
        2,
    ),
    "equality": (
        (
            "(:predicates (at ?x) (way ?x ?y))(:action go :parameters (?x ?y) :precondition (and (at ?x) (way ?x "
            "?y) (not (= ?x ?y))) :effect (and (at ?y) (not (at ?x))))"
        ),
        "(:objects a b c) (:init (at a) (way a b) (way b c) (way a a)) (:goal (at c))",
        2,
    ),
    "equality positive": (
        (
            "(:predicates (on ?x) (first ?x)) (:action f :parameters (?x ?y) :precondition (and (= ?x ?y) (first "
            "?y)) :effect (on ?x))"
        ),
        "(:objects a b) (:init (first b)) (:goal (on b))",
        1,
    ),
    "imply": (
        (
            "(:predicates (on ?x) (dep ?x ?y)) (:action f :parameters (?x) :precondition (forall (?y) (imply "
            "(dep ?x ?y) (on ?y))) :effect (on ?x))"
        ),
        "(:objects a b c) (:init (dep a b) (dep b c)) (:goal (on a))",
        3,
    ),
    "nested quant": (
        (
            "(:predicates (in ?x ?y) (open ?y) (done)) (:action o :parameters (?y) :effect (open ?y)) (:action f "
            ":parameters () :precondition (forall (?x) (exists (?y) (and (in ?x ?y) (open ?y)))) :effect (done))"
        ),
        "(:objects a b) (:init (in a a) (in a b) (in b b)) (:goal (done))",
        2,
    ),
    "goal neg": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (and (not (at a)) (not (at b))))",
        2,
    ),
    "goal or": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (or (at c) (at b)))",
        1,
    ),
    "goal imply": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (imply (at a) (at c)))",
        1,
    ),
    "goal forall": (
        "(:predicates (on ?x)) (:action f :parameters (?x) :effect (on ?x))",
        "(:objects a b c) (:init (on a)) (:goal (forall (?x) (on ?x)))",
        2,
    ),
    "goal exists": (
        AT + GO,
        (
            "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (exists (?x) (and (at ?x) (not (= ?x a)) "
            "(not (= ?x b)))))"
        ),
        2,
    ),
    "goal static": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (and (at c) (way a b)))",
        2,
    ),
    "goal eq": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (and (at b) (= a a)))",
        1,
    ),
    "goal empty": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (and))",
        0,
    ),
    "goal empty2": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal ())",
        0,
    ),
    "goal nested and": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (and (and (at b)) (and)))",
        1,
    ),
    "goal not undefined forall": (
        "(:predicates (on ?x)) (:action f :parameters (?x) :effect (not (on ?x)))",
        "(:objects a b c) (:init (on a) (on b)) (:goal (forall (?x) (not (on ?x))))",
        2,
    ),
    "object as predicate": (
        (
            "(:predicates (box ?x) (room ?r) (at ?x ?r)) (:action mv :parameters (?x ?a ?b) :precondition (and "
            "(box ?x) (room ?a) (room ?b) (at ?x ?a)) :effect (and (at ?x ?b) (not (at ?x ?a))))"
        ),
        "(:objects box room at) (:init (box box) (room room) (room at) (at box room)) (:goal (at box at))",
        1,
    ),
    "object as type": (
        (
            "(:types box room) (:predicates (at ?x - box ?r - room)) (:action mv :parameters (?x - box ?a ?b - "
            "room) :precondition (at ?x ?a) :effect (and (at ?x ?b) (not (at ?x ?a))))"
        ),
        "(:objects box - box room hall - room) (:init (at box room)) (:goal (at box hall))",
        1,
    ),
    "cost function": (
        (
            "(:predicates (at ?x) (way ?x ?y)) (:functions (total-cost) (d ?x ?y)) (:action go :parameters (?x "
            "?y) :precondition (and (at ?x) (way ?x ?y)) :effect (and (at ?y) (not (at ?x)) (increase "
            "(total-cost) (d ?x ?y))))"
        ),
        (
            "(:objects a b c) (:init (at a) (way a b) (way b c) (= (d a b) 3) (= (d b c) 4.5) (= (total-cost) "
            "0)) (:goal (at c)) (:metric minimize (total-cost))"
        ),
        2,
    ),
    "cost typed": (
        (
            "(:predicates (at ?x) (way ?x ?y)) (:functions (total-cost) - number (d ?x ?y) - number) (:action go "
            ":parameters (?x ?y) :precondition (and (at ?x) (way ?x ?y)) :effect (and (at ?y) (not (at ?x)) "
            "(increase (total-cost) (d ?x ?y))))"
        ),
        (
            "(:objects a b c) (:init (at a) (way a b) (way b c) (= (d a b) 3) (= (d b c) 4)) (:goal (at c)) "
            "(:metric minimize (total-cost))"
        ),
        2,
    ),
    "cost no metric": (
        (
            "(:predicates (at ?x) (way ?x ?y)) (:functions (total-cost)) (:action go :parameters (?x ?y) "
            ":precondition (and (at ?x) (way ?x ?y)) :effect (and (at ?y) (not (at ?x)) (increase (total-cost) "
            "1)))"
        ),
        "(:objects a b c) (:init (at a) (way a b) (way b c) (= (total-cost) 0)) (:goal (at c))",
        2,
    ),
    "cost const fn": (
        (
            "(:predicates (at ?x) (way ?x ?y)) (:functions (total-cost) (one)) (:action go :parameters (?x ?y) "
            ":precondition (and (at ?x) (way ?x ?y)) :effect (and (at ?y) (not (at ?x)) (increase (total-cost) "
            "(one))))"
        ),
        (
            "(:objects a b c) (:init (at a) (way a b) (way b c) (= (total-cost) 0) (= (one) 2)) (:goal (at c)) "
            "(:metric minimize (total-cost))"
        ),
        2,
    ),
    "metric total time": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (at c)) (:metric minimize (total-time))",
        2,
    ),
    "zero arity": (
        (
            "(:predicates (lit) (ready)) (:action f :parameters () :precondition () :effect (lit)) (:action g "
            ":precondition (lit) :effect (and (ready) (not (lit))))"
        ),
        "(:objects ) (:init ) (:goal (ready))",
        2,
    ),
    "no objects section": (
        ("(:constants a b) (:predicates (at ?x)) (:action f :parameters () :precondition (at a) :effect (at b))"),
        "(:objects ) (:init (at a)) (:goal (at b))",
        1,
    ),
    "unused type": (
        ("(:types a b c - object) (:predicates (p ?x - a) (q ?y - b)) (:action f :parameters (?x - a) :effect (p ?x))"),
        "(:objects o - a) (:init ) (:goal (p o))",
        1,
    ),
    "type object explicit": (
        (
            "(:types thing - object object) (:predicates (p ?x - object)) (:action f :parameters (?x - thing) "
            ":effect (p ?x))"
        ),
        "(:objects o - thing) (:init ) (:goal (p o))",
        1,
    ),
    "nested types": (
        ("(:types a - b b - c c - d d) (:predicates (p ?x - c)) (:action f :parameters (?x - b) :effect (p ?x))"),
        "(:objects o - a) (:init ) (:goal (p o))",
        1,
    ),
    "when": (
        (
            "(:predicates (on ?x) (link ?x ?y)) (:action f :parameters (?x) :effect (and (on ?x) (forall (?y) "
            "(when (link ?x ?y) (on ?y)))))"
        ),
        "(:objects a b c) (:init (link a b) (link b c)) (:goal (and (on a) (on b) (on c)))",
        2,
    ),
    "when or": (
        (
            "(:predicates (on ?x) (red ?x) (hot)) (:action f :parameters (?x) :effect (when (or (red ?x) (hot)) "
            "(on ?x)))"
        ),
        "(:objects a b) (:init (red a)) (:goal (on a))",
        1,
    ),
    "add delete same": (
        (
            "(:predicates (at ?x) (way ?x ?y)) (:action go :parameters (?x ?y) :precondition (and (at ?x) (way "
            "?x ?y)) :effect (and (not (at ?x)) (at ?y)))"
        ),
        "(:objects a b) (:init (at a) (way a a) (way a b)) (:goal (at b))",
        1,
    ),
    "pre neg static": (
        ("(:predicates (bad ?x) (on ?x)) (:action f :parameters (?x) :precondition (not (bad ?x)) :effect (on ?x))"),
        "(:objects a b) (:init (bad a)) (:goal (on b))",
        1,
    ),
    "not not": (
        ("(:predicates (p ?x) (q ?x)) (:action f :parameters (?x) :precondition (not (not (p ?x))) :effect (q ?x))"),
        "(:objects a) (:init (p a)) (:goal (q a))",
        1,
    ),
    "init not": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c) (not (at c))) (:goal (at c))",
        2,
    ),
    "init dup": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c) (at a)) (:goal (at c))",
        2,
    ),
    "init equal objects": (
        AT + GO,
        "(:objects a b c) (:init (at a) (way a b) (way b c) (= a a)) (:goal (at c))",
        2,
    ),
    "number objects": (
        AT + GO,
        "(:objects 1 2 3) (:init (at 1) (way 1 2) (way 2 3)) (:goal (at 3))",
        2,
    ),
    "pred eq declared": (
        (
            "(:predicates (at ?x) (way ?x ?y) (= ?x ?y))(:action go :parameters (?x ?y) :precondition (and (at "
            "?x) (way ?x ?y) (not (= ?x ?y))) :effect (and (at ?y) (not (at ?x))))"
        ),
        "(:objects a b c) (:init (at a) (way a b) (way b c) (= a a) (= b b) (= c c)) (:goal (at c))",
        2,
    ),
    "unused param": (
        "(:types ag it) (:predicates (p ?x - it)) (:action f :parameters (?x - it ?a - ag) :effect (p ?x))",
        "(:objects o - it z - ag) (:init ) (:goal (p o))",
        1,
    ),
    "param twice names": (
        "(:predicates (p ?x-1 ?x_1)) (:action f :parameters (?x-1 ?x_1) :effect (p ?x-1 ?x_1))",
        "(:objects a b) (:init ) (:goal (p a b))",
        1,
    ),
    "names clash": (
        (
            "(:types Truck) (:predicates (truck ?x) (TRUCK-AT ?x - truck)) (:action truck :parameters (?truck - "
            "truck) :effect (truck ?truck))"
        ),
        "(:objects truck - truck) (:init ) (:goal (truck truck))",
        1,
    ),
    "length": (
        AT + GO,
        ("(:objects a b c) (:init (at a) (way a b) (way b c)) (:goal (at c)) (:length (:serial 3) (:parallel 2))"),
        2,
    ),
    "exists pre": (
        (
            "(:predicates (near ?x ?y) (on ?x) (lit ?x)) (:action f :parameters (?x) :precondition (exists (?y "
            "?z) (and (near ?x ?y) (near ?y ?z) (not (lit ?z)))) :effect (on ?x))"
        ),
        "(:objects a b c) (:init (near a b) (near b c)) (:goal (on a))",
        1,
    ),
    "when nested forall": (
        (
            "(:predicates (in ?x ?y) (wet ?x) (rain ?y)) (:action f :parameters (?y) :precondition (rain ?y) "
            ":effect (forall (?x) (when (forall (?z) (imply (in ?x ?z) (rain ?z))) (wet ?x))))"
        ),
        "(:objects a b) (:init (rain b) (in a b)) (:goal (wet a))",
        1,
    ),
    "forall effect two": (
        (
            "(:types a b) (:predicates (l ?x - a ?y - b)) (:action f :parameters () :effect (forall (?x - a ?y - "
            "b) (l ?x ?y)))"
        ),
        "(:objects p q - a r s - b) (:init ) (:goal (l q s))",
        1,
    ),
}


def texts(name: str) -> tuple[str, str]:
    domain, problem, _ = CONSTRUCTS[name]
    return f"(define (domain d) {domain})", f"(define (problem e) (:domain d) {problem})"


@pytest.mark.parametrize("name", CONSTRUCTS)
def test_a_construct_is_planned(name: str) -> None:
    outcome = plan_level(imported(parse(*texts(name))).problem)
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert len(outcome.plan.steps) == CONSTRUCTS[name][2]


@pytest.mark.parametrize("name", CONSTRUCTS)
def test_a_construct_survives_import_and_export(name: str, tmp_path: Path) -> None:
    found = imported(parse(*texts(name)))
    scene = tmp_path / "e.ttl"
    scene.write_text(turtle(found.problem, "title", "description", found.said))
    assert [finding for finding in validate([scene]) if finding.severity != "remark"] == []
    assert same(found.problem, read(load(scene)).problem)
    exported = to_pddl(found.problem)
    assert_same_behaviour(found.problem, exported, imported(parse(exported.domain, exported.problem)), 20)


def test_a_cost_with_many_values_is_one_price() -> None:
    places = range(30)
    ways = " ".join(f"(way p{i} p{j}) (= (toll p{i} p{j}) {i * 31 + j})" for i in places for j in places if i != j)
    domain = "(define (domain d) (:predicates (at ?x) (way ?x ?y)) (:functions (total-cost) (toll ?x ?y))" + GO.replace(
        "(not (at ?x))", "(not (at ?x)) (increase (total-cost) (toll ?x ?y))"
    )
    names = " ".join(f"p{i}" for i in places)
    problem = f"(define (problem e) (:domain d) (:objects {names}) (:init (at p0) {ways}) (:goal (at p9)) "
    problem += "(:metric minimize (total-cost)))"
    behaviors = imported(parse(domain + ")", problem)).problem.domain.behaviors
    assert {b.name: b.price for b in behaviors.values()} == {"GO": Measure("toll", ("?x", "?y"))}


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (
            "(or (q a) (q b))",
            "the_world GOAL_REACHED true can't be reached: GOAL_REACHED requires (a Q true or b Q true), which never holds",
        ),
        ("(q a)", "a Q true can't be reached: F requires a P false, which never holds"),
    ],
)
def test_a_permanent_fact_is_given_as_the_reason(goal: str, reason: str) -> None:
    domain = """(define (domain d) (:predicates (p ?x) (q ?x))
     (:action f :parameters (?x) :precondition (not (p ?x)) :effect (q ?x))
     (:action g :parameters (?x) :precondition (q ?x) :effect (not (p ?x))))"""
    problem = f"(define (problem e) (:domain d) (:objects a b) (:init (p a) (p b)) (:goal {goal}))"
    outcome = solve(Request(imported(parse(domain, problem)).problem))
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert outcome.reason.text == reason


@pytest.mark.parametrize(
    ("domain", "message"),
    [
        ("(:types a) (:predicates (p ?x - (or a a)))", "domain:1:52: wanted a type or (either TYPE …)"),
        ("(:types a) (:predicates (p ?x - (either a c)))", "domain:1:62: undefined type 'c' (known: a, object)"),
        ("(:types a - b b - a)", "domain:1:28: type 'a' is above itself"),
    ],
)
def test_impossible_types_are_refused_with_their_place(domain: str, message: str) -> None:
    with pytest.raises(PddlError) as refused:
        parse(f"(define (domain d) {domain})", "(define (problem e) (:domain d) (:init) (:goal ()))")
    assert str(refused.value) == message


def test_each_fact_of_a_conjunctive_goal_is_a_goal_also_below_forall() -> None:
    domain = """(define (domain d) (:requirements :adl) (:types a b)
     (:predicates (p ?x - a) (q ?x - a ?y - b) (heavy ?x - a))
     (:action f :parameters (?x - a) :precondition (not (p ?x)) :effect (p ?x))
     (:action g :parameters (?x - a ?y - b) :precondition (p ?x) :effect (and (q ?x ?y) (not (p ?x)))))"""
    goal = """(and (forall (?x - a) (and (not (p ?x)) (imply (heavy ?x) (forall (?y - b) (q ?x ?y)))))
      (forall (?x ?y - a) (or (= ?x ?y) (exists (?z - b) (q ?x ?z)))))"""
    problem = f"(define (problem e) (:domain d) (:objects m n - a u v - b) (:init (p m) (heavy m)) (:goal {goal}))"
    found = imported(parse(domain, problem)).problem
    facts = {(symbol.situation, *symbol.arguments, value) for symbol, value in found.goal.items()}
    assert facts == {
        ("P", "m", "false"),
        ("P", "n", "false"),
        ("Q", "m", "u", "true"),
        ("Q", "m", "v", "true"),
        ("GOAL_REACHED", "the_world", "true"),
    }
    outcome = plan_level(found)
    assert outcome.plan is not None
    assert sorted(step.behavior for step in outcome.plan.steps) == ["F", "F", "G", "G", "G"]


def test_a_value_in_two_conditions_makes_one_parameter() -> None:
    domain = """(define (domain sky) (:requirements :strips :typing :negative-preconditions)
        (:types scope direction) (:predicates (at ?s - scope ?d - direction))
        (:action turn :parameters (?s - scope ?new ?old - direction)
            :precondition (and (at ?s ?old) (not (at ?s ?new))) :effect (and (at ?s ?new) (not (at ?s ?old)))))"""
    problem = """(define (problem p) (:domain sky) (:objects s - scope a b - direction)
        (:init (at s a)) (:goal (and (at s b))))"""
    exported = to_pddl(imported(parse(domain, problem)).problem, 1)
    assert "(not (= ?old ?new))" in exported.domain
    assert "?other" not in exported.domain
    again = plan_level(imported(parse(exported.domain, exported.problem)).problem)
    assert again.plan is not None
    assert [step.arguments for step in again.plan.steps] == [("s", "b", "a")]
