"""Worlds of two levels in time: values that exist only during a step, soft goals with deadlines, and execution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import confab
from confab.planner.acting.dispatching import Concurrency
from confab.planner.acting.episode import End, Episode, Intervention, InterventionKind
from confab.planner.acting.executive import act
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.plan import Plan
from confab.planner.solve import Request, solve
from confab.planner.timed.call import best_in_time
from confab.planner.timed.validation import validate_timed
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Behavior,
    Condition,
    Effect,
    Fact,
    SituationType,
    Span,
    Symbol,
    Times,
    Timing,
    ValueEffect,
)
from confab.reasoner.timing import projected
from confab.timing import needs_others_meanwhile
from worlds.writing import becomes, behavior, has, lacks, world

START, THROUGHOUT, AT_END = Span.START, Span.THROUGHOUT, Span.END


def step(
    name: str,
    terms: str,
    seconds: str,
    asked: Sequence[tuple[Span, Condition]],
    made: Sequence[tuple[Span, Effect]],
    *actors: str,
) -> Behavior:
    """Return a behaviour of level 2 with a duration."""
    conditions, effects = projected(asked, made)
    whole = behavior(name, 2, terms, conditions, [one for one in effects if isinstance(one, ValueEffect)])
    return replace(whole, timing=Timing(Fraction(seconds), actors, tuple(asked), tuple(made)))


def truth(name: str, kind: str, level: int = 2) -> SituationType:
    return SituationType(name, (kind,), "Truth", level, boolean=True)


def test_a_value_that_exists_only_during_a_step_prevents_no_plan_without_it() -> None:
    """The match burns only during a step; on two levels, no other step may use it, but the lamp gives light, too."""
    mended = becomes("MENDED", "?f", TRUE)
    fuses = world(
        [truth("MENDED", "Fuse", 1), truth("LIT", "Match"), truth("ON", "Lamp")],
        [
            behavior("REPAIR", 1, "?f:Fuse", [lacks("MENDED", "?f", TRUE)], [mended]),
            step(
                "BURN",
                "?m:Match",
                "8",
                [],
                [(START, becomes("LIT", "?m", TRUE)), (AT_END, becomes("LIT", "?m", FALSE))],
            ),
            step("SWITCH", "?l:Lamp", "3", [], [(THROUGHOUT, becomes("ON", "?l", TRUE))]),
            step("BY_MATCH", "?f:Fuse ?m:Match", "5", [(THROUGHOUT, has("LIT", "?m", TRUE))], [(THROUGHOUT, mended)]),
            step("BY_LAMP", "?f:Fuse ?l:Lamp", "5", [(THROUGHOUT, has("ON", "?l", TRUE))], [(THROUGHOUT, mended)]),
        ],
        {"Fuse": ("fuse",), "Match": ("match",), "Lamp": ("lamp",)},
        {},
        {"MENDED fuse": TRUE},
    )
    assert not needs_others_meanwhile(fuses)
    plan = solve(Request(fuses, leave_levels=False)).plan
    assert plan is not None
    assert [one.behavior for one in plan.primitives] == ["SWITCH", "BY_LAMP"]
    timed = best_in_time(fuses, plan).plan
    assert timed is not None
    assert timed.makespan == 8
    assert not validate_timed(fuses, timed)


POST = '''
@prefix : <https://example.org/post#> . @prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> . @prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/post> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
xsd:dayTimeDuration a rdfs:Datatype .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :IN, :AT .
:Van a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :IN ; c:hasSituationType :AT .
:Parcel a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :IN .
:IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :in .
:in a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Parcel ; rdfs:range :IN .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at ; c:fromLevel 2 .
:at a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Van ; rdfs:range :AT .
:BRING a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update """
  DELETE { ?parcel :in ?from } INSERT { ?parcel :in ?to }
  WHERE { ?parcel a :Parcel . ?to a :Place . ?parcel :in ?from FILTER(?from != ?to) }""" .
:LOAD a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:actor :LOAD.van ;
  c:duration "PT4S"^^xsd:dayTimeDuration ; c:update """
  DELETE { ?parcel :in ?place } INSERT { ?parcel :in ?van }
  WHERE { ?van a :Van . ?parcel a :Parcel . ?van :at ?place . ?parcel :in ?place }""" .
:UNLOAD a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ; c:actor :UNLOAD.van ;
  c:duration "PT4S"^^xsd:dayTimeDuration ; c:update """
  DELETE { ?parcel :in ?van } INSERT { ?parcel :in ?place }
  WHERE { ?van a :Van . ?parcel a :Parcel . ?van :at ?place . ?parcel :in ?van }""" .
:DRIVE a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 3 ; c:actor :DRIVE.van ;
  c:duration "PT10S"^^xsd:dayTimeDuration ; c:update """
  DELETE { ?van :at ?from } INSERT { ?van :at ?to }
  WHERE { ?van a :Van . ?to a :Place . ?van :at ?from FILTER(?from != ?to) }""" .
:LOAD.van a owl:NamedIndividual . :UNLOAD.van a owl:NamedIndividual . :DRIVE.van a owl:NamedIndividual .
:north a owl:NamedIndividual, :Place ; c:index 1 . :south a owl:NamedIndividual, :Place ; c:index 2 .
:van a owl:NamedIndividual, :Van ; c:index 3 ; c:fromLevel 2 ; :at :north .
:book a owl:NamedIndividual, :Parcel ; c:index 4 ; :in :north . :lamp a owl:NamedIndividual, :Parcel ; c:index 5 ; :in :north .
[] a owl:AllDifferent ; owl:distinctMembers ( :book :lamp :north :south :van ) .
:task a owl:NamedIndividual, c:Task ; c:goal :task.book, :task.lamp .
'''
"""A van brings parcels from place to place: one tour with two parcels takes 26 s, and two tours take 46 s."""


def post(folder: Path, soft: str = "", **deadlines: int) -> confab.Scene:
    """Return the scene in which both parcels shall be in the south, with deadlines in seconds and soft goals."""
    goals = [
        f":task.{one} a owl:NamedIndividual, c:ValueCondition ; c:about :{one} ; c:situationType :IN ; c:value :south"
        + (f' ; c:by "PT{deadlines[one]}S"^^xsd:dayTimeDuration' if one in deadlines else "")
        + f"{' ; c:weight 20' if one in soft else ''} .\n"
        for one in ("book", "lamp")
    ]
    (folder / "post.ttl").write_text(POST + "".join(goals))
    return confab.load(folder / "post.ttl")


@pytest.mark.parametrize("soft", ["book lamp", "lamp"])
def test_soft_goals_are_met_whose_deadlines_only_a_joint_refinement_keeps(tmp_path: Path, soft: str) -> None:
    result = post(tmp_path, soft, book=22, lamp=26).plan()
    assert result.timed is not None
    assert result.timed.makespan == 26
    assert not result.outcome.forgone
    assert len(result.timed.plan.steps[0].together) == 2


def passage(at: str, wait: str = "8", by: str | None = None) -> tuple[Problem, Plan]:
    """Return a task and its plan: a robot waits, and goes out for 10 s through a gate that an event opens at a time."""
    asked = [(THROUGHOUT, has("READY", "?r", TRUE)), (THROUGHOUT, has("OPEN", "gate", TRUE))]
    crossing = world(
        [truth("OUT", "Robot", 1), truth("READY", "Robot"), truth("OPEN", "Gate")],
        [
            behavior("LEAVE", 1, "?r:Robot", [], [becomes("OUT", "?r", TRUE)]),
            step("WAIT", "?r:Robot", wait, [], [(THROUGHOUT, becomes("READY", "?r", TRUE))], "?r"),
            step("GO", "?r:Robot", "10", asked, [(THROUGHOUT, becomes("OUT", "?r", TRUE))], "?r"),
            step("EVENT", "", "0", [], [(THROUGHOUT, becomes("OPEN", "gate", TRUE))]),
        ],
        {"Robot": ("robot", "other"), "Gate": ("gate",)},
        {"OPEN gate": FALSE},
        {"OUT robot": TRUE},
    )
    deadlines = {} if by is None else {Symbol("OUT", ("robot",)): Fraction(by)}
    problem = replace(crossing, times=Times(deadlines, events={"EVENT": Fraction(at)}))
    plan = solve(Request(problem)).plan
    assert plan is not None
    return problem, plan


def acted(problem: Problem, plan: Plan, *interventions: Intervention) -> Episode:
    """Return an episode in which each primitive takes its duration."""
    timed = best_in_time(problem, plan).plan
    assert timed is not None
    return act(problem, SymbolicWorld(problem), timed.plan, interventions, together=Concurrency(timed))


def test_an_intervention_while_all_actors_wait_for_an_event_does_not_end_the_episode() -> None:
    ready = Fact(Symbol("READY", ("other",)), TRUE)
    changes = [Intervention(InterventionKind.WORLD, (ready,), at=seconds) for seconds in (20.0, 25.0)]
    episode = acted(*passage("30"), *changes)
    assert episode.status is End.REACHED
    assert [event.begin for event in episode.events if event.step.behavior == "GO"] == [30]


def test_steps_that_end_or_begin_exactly_at_a_stated_time_keep_it_whatever_the_fraction_of_a_second() -> None:
    problem, plan = passage("0.4", wait="0.3", by="10.4")
    times = problem.times or Times()
    window = {"robot": ((Fraction("0.3"), Fraction("10.6")),)}
    assert acted(problem, plan).status is End.REACHED
    later = replace(times, deadlines={}, windows=window)
    assert acted(replace(problem, times=later), plan).status is End.REACHED


def test_a_goal_of_an_intervention_has_no_deadline_from_the_goal_that_it_replaces(tmp_path: Path) -> None:
    scene = post(tmp_path, book=22)
    assert not scene.execute(interventions=["at=9 book IN north"]).reached
    assert scene.execute(interventions=["at=9 goal book IN north"]).reached
