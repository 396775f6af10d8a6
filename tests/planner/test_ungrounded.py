"""A level with too many quantified behaviours is searched without grounding."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from confab.planner.hierarchical.call import Call, compiled
from confab.planner.hierarchical.ungrounded import UngroundedSearch
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.symbols import Problem
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
