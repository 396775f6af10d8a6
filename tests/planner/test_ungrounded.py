"""A level with too many quantified behaviours is searched without grounding."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from time import perf_counter

import pytest

from confab.planner.hierarchical import planner
from confab.planner.hierarchical.call import Call, compiled
from confab.planner.hierarchical.ungrounded import UngroundedSearch
from confab.planner.plan import Limits
from confab.planner.solve import Mode, Request, solve
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from confab.scene import load
from worlds.interpreter import TooManyStatesError
from worlds.mixed import drawn
from worlds.scenes import scene

TRAIN = """
(define (domain train) (:requirements :strips :typing :negative-preconditions) (:types wagon place)
  (:predicates (at ?w - wagon ?p - place) (road ?p ?q - place) (free ?p - place) (first ?w - wagon) (last ?w - wagon)
               (coupled ?v ?w - wagon) (pulling) (drawn ?w - wagon) (gap ?p - place))
  (:action drive :parameters (?w ?v - wagon ?p ?q - place)
    :precondition (and (not (pulling)) (first ?w) (coupled ?w ?v) (at ?w ?p) (road ?p ?q) (free ?q))
    :effect (and (not (at ?w ?p)) (at ?w ?q) (not (free ?q)) (gap ?p) (pulling) (drawn ?v)))
  (:action follow :parameters (?w ?v - wagon ?p ?q - place)
    :precondition (and (drawn ?w) (coupled ?w ?v) (at ?w ?p) (gap ?q))
    :effect (and (not (at ?w ?p)) (at ?w ?q) (not (gap ?q)) (gap ?p) (not (drawn ?w)) (drawn ?v)))
  (:action close-up :parameters (?w - wagon ?p ?q - place)
    :precondition (and (drawn ?w) (last ?w) (at ?w ?p) (gap ?q))
    :effect (and (not (at ?w ?p)) (at ?w ?q) (not (gap ?q)) (free ?p) (not (drawn ?w)) (not (pulling)))))
"""


def train(wagons: int, width: int) -> Problem:
    """Return a train in a square of streets, which has to turn round a corner to the opposite side."""
    names = [f"w{i}" for i in range(wagons)]
    places = {(x, y): f"p{x}-{y}" for x in range(width) for y in range(width)}
    at = {(wagons - 1 - i, 0): name for i, name in enumerate(names)}
    near = ((1, 0), (-1, 0), (0, 1), (0, -1))
    facts = [f"(at {name} {places[where]})" for where, name in at.items()]
    facts += [f"(free {name})" for where, name in places.items() if where not in at]
    facts += [
        f"(road {name} {places[x + a, y + b]})"
        for (x, y), name in places.items()
        for a, b in near
        if (x + a, y + b) in places
    ]
    facts += [f"(coupled {v} {w})" for v, w in pairwise(names)]
    goals = [f"(at {name} {places[width - 1, width - 1 - i]})" for i, name in enumerate(names)]
    text = f"""(define (problem p) (:domain train) (:objects {" ".join(names)} - wagon {" ".join(places.values())} - place)
      (:init (first {names[0]}) (last {names[-1]}) {" ".join(facts)}) (:goal (and {" ".join(goals)} (not (pulling)))))"""
    return imported(parse(TRAIN, text)).problem


def test_a_train_whose_wagons_follow_by_themselves_is_planned_without_grounding() -> None:
    """There are 1.4 million quantified behaviours; after each move of the first wagon, all others have only one move."""
    problem = train(6, 14)
    outcome = solve(Request(problem))
    assert outcome.plan is not None
    assert not validate(problem, outcome.plan)
    least = 6 * (2 * 14 - 1 - 6)  # the first wagon moves to the opposite corner
    assert len(outcome.plan.primitives) == least


@pytest.mark.parametrize("first", range(3_100_100, 3_100_160, 30))
def test_the_search_without_grounding_finds_a_plan_exactly_if_there_is_one(tmp_path: Path, first: int) -> None:
    """The generated joins know each kind of condition and of effect."""
    judged = 0
    for seed in range(first, first + 30):
        world, meant = drawn(seed)
        try:
            least = meant.explored(world.problem.domain.levels[-1], 3_000).least
        except TooManyStatesError:
            continue
        (tmp_path / "w.ttl").write_text(scene(world), encoding="utf-8")
        problem = load(tmp_path / "w.ttl").reading.problem
        call = Call(problem, compiled(problem), None, 100_000)
        if all(map(call.met, call.goal)):
            continue
        steps = UngroundedSearch(call, 200_000).plan()
        assert (steps is None) == (least is None), seed
        if steps is not None:
            call.steps = steps
            assert not validate(problem, call.tree()), seed
        judged += 1
    assert judged > 20


MIXING = """(define (domain mixing) (:requirements :strips :typing) (:types thing)
 (:predicates (first ?a - thing) (second ?a - thing) (third ?a - thing) (right ?a ?b ?c - thing) (mixed ?a ?b ?c - thing) (done))
 (:action step1 :parameters (?x ?y - thing) :precondition (first ?x) :effect (and (not (first ?x)) (first ?y)))
 (:action step2 :parameters (?x ?y - thing) :precondition (second ?x) :effect (and (not (second ?x)) (second ?y)))
 (:action step3 :parameters (?x ?y - thing) :precondition (third ?x) :effect (and (not (third ?x)) (third ?y)))
 (:action mix :parameters (?x ?y ?z - thing) :precondition (and (first ?x) (second ?y) (third ?z)) :effect (mixed ?x ?y ?z))
 (:action end :parameters (?x ?y ?z - thing) :precondition (and (first ?x) (second ?y) (third ?z) (right ?x ?y ?z))
   :effect (done)))"""


def mixing(number: int) -> Problem:
    """Return a task in which only one of many mixtures is right."""
    things = [f"t{i}" for i in range(number)]
    return imported(
        parse(
            MIXING,
            f"""(define (problem p) (:domain mixing) (:objects {" ".join(things)} - thing)
      (:init (first t0) (second t0) (third t0) (right {things[-1]} {things[-2]} {things[-3]})) (:goal (done)))""",
        )
    ).problem


def test_planning_goes_on_from_the_initial_state_after_a_search_that_found_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = mixing(105)  # more than a million quantified behaviours
    monkeypatch.setattr(planner, "TRIALS", 4_000)
    monkeypatch.setattr(planner, "TRIALS_AT_FIRST", 500)
    outcome = solve(Request(problem))
    assert outcome.plan is not None
    assert not validate(problem, outcome.plan)


def test_the_search_keeps_its_limits_within_one_state() -> None:
    """A single state has a million successors."""
    call = Call(mixing(100), compiled(mixing(100)), None, 100_000)
    search = UngroundedSearch(call, 5_000)
    assert search.plan() is None
    assert search.trials <= 5_001
    assert not call.table.since(0)
    call = Call(call.problem, call.using, perf_counter(), 100_000)
    with pytest.raises(LimitError, match="time limit"):
        UngroundedSearch(call, 10**9).plan()


def test_a_plan_that_is_found_counts_against_the_budget_and_is_kept() -> None:
    call = Call(train(3, 5), compiled(train(3, 5)), None, 10_000)
    steps = UngroundedSearch(call, 10**6).plan()
    assert steps is not None and call.space.worked > 0 and call.space.expanded > 0
    call = Call(call.problem, call.using, None, 5)
    assert UngroundedSearch(call, 10**6).plan() is None and call.space.expanded <= 5


@pytest.mark.parametrize("mode", ["guarded", "optimal"])
@pytest.mark.parametrize(
    "static", ["", "(:action undo :parameters (?a ?b) :precondition (p ?a ?b) :effect (not (p ?a ?b)))"]
)
def test_a_behaviour_with_many_parameters_is_planned(mode: Mode, static: str) -> None:
    """Python can't nest a loop for each of them."""
    many = [f"?x{i}" for i in range(24)]
    domain = f"""(define (domain many) (:requirements :strips) (:predicates (p ?a ?b) (done))
      (:action do :parameters ({" ".join(many)}) :precondition (and {" ".join(f"(p {a} {b})" for a, b in pairwise(many))})
        :effect (done)) {static})"""
    text = "(define (problem p) (:domain many) (:objects a b c) (:init (p a b) (p b a)) (:goal (done)))"
    problem = imported(parse(domain, text)).problem
    outcome = solve(Request(problem, mode, Limits(seconds=20.0)))
    assert outcome.plan is not None and len(outcome.plan.primitives) == 1
    with pytest.raises(LimitError, match=r"2824295364\d\d quantified behaviours of level 1"):
        solve(Request(problem, "paper"))
