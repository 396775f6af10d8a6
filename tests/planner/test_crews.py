"""Sharing of the work in problems that name no actors: the acting classes."""

from __future__ import annotations

import confab
from confab.planner.solve import Request, solve
from confab.planner.timed.call import best_in_time
from confab.planner.timed.crews import acting_classes, crews_of, every_actor
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem

MOVING = """(define (domain moving) (:requirements :typing :durative-actions) (:types place van person box)
 (:predicates (road ?p ?q - place) (van-at ?v - van ?p - place) (at ?b - box ?p - place) (in ?b - box ?v - van)
   (free ?v - van) (waits ?m - person ?p - place) (drives ?m - person ?v - van))
 (:durative-action board :parameters (?m - person ?v - van ?p - place) :duration (= ?duration 1)
  :condition (and (over all (van-at ?v ?p)) (at start (waits ?m ?p)) (at start (free ?v)))
  :effect (and (at start (not (waits ?m ?p))) (at start (not (free ?v))) (at end (drives ?m ?v))))
 (:durative-action drive :parameters (?m - person ?v - van ?p ?q - place) :duration (= ?duration 10)
  :condition (and (at start (van-at ?v ?p)) (over all (drives ?m ?v)) (over all (road ?p ?q)))
  :effect (and (at start (not (van-at ?v ?p))) (at end (van-at ?v ?q))))
 (:durative-action load :parameters (?b - box ?v - van ?p - place) :duration (= ?duration 2)
  :condition (and (over all (van-at ?v ?p)) (at start (at ?b ?p)))
  :effect (and (at start (not (at ?b ?p))) (at end (in ?b ?v))))
 (:durative-action unload :parameters (?b - box ?v - van ?p - place) :duration (= ?duration 2)
  :condition (and (over all (van-at ?v ?p)) (at start (in ?b ?v)))
  :effect (and (at start (not (in ?b ?v))) (at end (at ?b ?p)))))"""


def houses(many: int) -> Problem:
    """For each house a box, a van and a person at the depot, and a road from the depot."""
    numbers = range(many)
    text = f"""(define (problem p) (:domain moving) (:objects depot {" ".join(f"house{i}" for i in numbers)} - place
     {" ".join(f"van{i}" for i in numbers)} - van {" ".join(f"m{i}" for i in numbers)} - person
     {" ".join(f"b{i}" for i in numbers)} - box)
     (:init {" ".join(f"(road depot house{i}) (road house{i} depot)" for i in numbers)}
            {" ".join(f"(van-at van{i} depot) (free van{i}) (waits m{i} depot)" for i in numbers)}
            {" ".join(f"(at b{i} depot)" for i in numbers)})
     (:goal (and {" ".join(f"(at b{i} house{i})" for i in numbers)})))"""
    return imported(parse(MOVING, text)).problem


def test_actors_are_the_fewest_individuals_of_which_each_primitive_names_one() -> None:
    problem = houses(2)
    assert set(acting_classes(problem)) == {"Van"}
    assert every_actor(problem) == ["van0", "van1"]
    assert len(list(crews_of(problem))) == 1 + 2


def test_a_problem_with_actors_has_no_acting_classes() -> None:
    scene = confab.load("beverage-serving")
    assert set(every_actor(scene.problem)) == {"left_hand", "right_hand"}


def test_vans_without_stated_actors_deliver_at_the_same_time() -> None:
    problem = houses(3)
    plan = solve(Request(problem)).plan
    assert plan is not None
    timed = best_in_time(problem, plan).plan
    assert timed is not None and timed.makespan == 2 + 10 + 2
