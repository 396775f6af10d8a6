"""Conditions on earlier states: ``c:remembers``, ``c:atMostOnce`` and ``c:onlyAfter``, and the constraints of PDDL."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest
from click.testing import CliRunner

import confab
import ontology
from confab.cli import app
from confab.planner.plan import Plan, Status
from confab.planner.validation import carried_out
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from worlds.judging import Judge
from worlds.mixed import mixed

DOMAIN = (ontology.ROOT / "domains" / "tour.ttl").read_text("utf-8")
SCENE = (ontology.ROOT / "scenes" / "tour-small.ttl").read_text("utf-8")
CATALOG = """<?xml version="1.0"?><catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
  <uri name="https://w3id.org/confab/{0}" uri="{0}.ttl"/></catalog>"""
TRIP = """(define (domain trip) (:requirements :typing :constraints) (:types place) (:constants a b c d - place)
  (:predicates (at ?p - place) (road ?a ?b - place) (key) (bag))
  (:constraints (and (forall (?p - place) (at-most-once (at ?p))) (sometime-before (at c) (and (key) (bag)))))
  (:action go :parameters (?a ?b - place) :precondition (and (at ?a) (road ?a ?b))
    :effect (and (not (at ?a)) (at ?b)))
  (:action take :parameters () :precondition (at b) :effect (key))
  (:action pack :parameters () :precondition (at a) :effect (bag)))"""
ROADS = """(define (problem roads) (:domain trip) (:init (at a) (road a b) (road b a) (road b c) (road a c) (road c d)
  (road d c) (road b d) (road d b)) (:goal (at c)) (:constraints (sometime (at d))))"""


def written(folder: Path, name: str, domain: str, scene: str) -> str:
    """Write a domain and a scene; return the path of the scene."""
    (folder / f"{name}.ttl").write_text(domain, "utf-8")
    (folder / "scene.ttl").write_text(scene, "utf-8")
    (folder / "catalog-v001.xml").write_text(CATALOG.format(name), "utf-8")
    return str(folder / "scene.ttl")


def tour(folder: Path, old: str, new: str) -> str:
    """Write the small tour with a replaced text in the domain and in the scene; return the path of the scene."""
    assert old in DOMAIN + SCENE
    return written(folder, "tour", DOMAIN.replace(old, new), SCENE.replace(old, new))


def pddl(folder: Path, domain: str, problem: str) -> str:
    """Import PDDL files; return the path of the scene."""
    (folder / "d.pddl").write_text(domain, "utf-8")
    (folder / "p.pddl").write_text(problem, "utf-8")
    scene = str(folder / "scene.ttl")
    made = CliRunner().invoke(app, ["import", str(folder / "d.pddl"), str(folder / "p.pddl"), "-o", scene])
    assert made.exit_code == 0, made.output
    return scene


def without_added_parts(problem: Problem) -> Problem:
    """Return the problem with only the effects and preconditions that the author wrote; the checker still knows the definitions."""
    remembers = problem.domain.remembers
    written = {
        name: replace(
            one,
            preconditions=tuple(c for c in one.preconditions if getattr(c, "constraint", None) is None),
            effects=tuple(effect for effect in one.effects if effect.situation not in remembers),
        )
        for name, one in problem.domain.behaviors.items()
    }
    return replace(problem, domain=replace(problem.domain, behaviors=written))


@pytest.mark.parametrize("mode", ["guarded", "paper", "optimal"])
def test_the_plan_keeps_at_most_once_and_only_after_and_achieves_all_remembered_goals(
    mode: Literal["guarded", "paper", "optimal"],
) -> None:
    plan = confab.load("tour-small").plan(mode=mode).plan
    stops = [step.arguments[1] for step in plan.primitives]
    assert stops.count("bridge") == 1
    assert stops.index("office") < stops.index("museum")
    assert "castle" in stops
    assert len(stops) == 9


@pytest.mark.parametrize(
    ("old", "fault"),
    [
        ("c:atMostOnce true ; ", "CROSSED must be true at most once, and is true after it"),
        ("c:onlyAfter :BUYING ; ", "IN_MUSEUM must be true only after BUYING, and is true after it"),
    ],
)
def test_the_checker_enforces_the_definitions_without_the_added_effects(old: str, fault: str, tmp_path: Path) -> None:
    free = confab.load(tour(tmp_path, old, "")).plan(optimal=True).plan
    assert len(free.steps) < 9
    problem = confab.load("tour-small").problem
    faults = carried_out(without_added_parts(problem), Plan(free.steps))
    assert [one.text for one in faults if one.text.endswith(fault)]
    assert not carried_out(without_added_parts(problem), confab.load("tour-small").plan().plan)


def test_a_scene_that_begins_after_the_earlier_state_states_what_is_remembered(tmp_path: Path) -> None:
    ticket = DOMAIN.replace("c:onlyAfter :BUYING", "c:onlyAfter :TICKET").replace(
        ":AT, :BUYING", ":AT, :TICKET, :BUYING"
    )
    ticket += ":TICKET a owl:Class, owl:NamedIndividual, c:SituationType ; c:remembers :BUYING ."
    inside = SCENE.replace("d:at :station", "d:at :museum")
    bought = (
        inside + ":bought a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :bus ; c:situationType d:TICKET ."
    )
    for domain, remedy in (
        (DOMAIN, "declare a situation type that c:remembers BUYING"),
        (ticket, "state TICKET of bus in"),
    ):
        with pytest.raises(KnowledgeError, match="IN_MUSEUM must be true only after") as raised:
            _ = confab.load(written(tmp_path, "tour", domain, inside)).problem
        assert remedy in str(raised.value) and ".before." not in str(raised.value)
    begun = confab.load(written(tmp_path, "tour", ticket, bought))
    for result in (begun.plan(), begun.plan(optimal=True), begun.plan(mode="paper")):
        assert "office" not in [step.arguments[1] for step in result.plan.primitives]
        assert not carried_out(without_added_parts(begun.problem), result.plan)
    elsewhere = confab.load(written(tmp_path, "tour", ticket, SCENE))
    assert "office" in [step.arguments[1] for step in elsewhere.plan().plan.primitives]
    told = elsewhere.with_fact("bus TICKET true", "bus AT museum").plan()
    assert "office" not in [step.arguments[1] for step in told.plan.primitives]


def test_a_fact_that_holds_only_within_a_step_of_an_upper_level_is_remembered(tmp_path: Path) -> None:
    """The acid would be on the forklift twice, and only level 2 sees this. No behaviour carries the acid back to make room."""
    scenes = ontology.ROOT / "scenes"
    domain = (ontology.ROOT / "domains" / "drums.ttl").read_text("utf-8")
    domain = domain.replace(":hasSituationType :IN ;", ":hasSituationType :IN, :CARRIED ;")
    domain += """
:CARRIED a owl:Class, owl:NamedIndividual, c:SituationType ; c:atMostOnce true .
:CARRIED.rule a owl:NamedIndividual, c:Rule ; c:construct
  "CONSTRUCT { ?drum :CARRIED true } WHERE { ?drum a :Drum ; :in ?forklift . ?forklift a :Forklift }" .
"""
    scene = confab.load(written(tmp_path, "drums", domain, (scenes / "drums-small.ttl").read_text("utf-8")))
    outcome = scene.plan().outcome
    assert (outcome.status, outcome.certificate is not None) == (Status.UNSOLVABLE, True)
    moved = scene.plan(goal=["acid IN bay3", "base IN bay1"]).plan
    assert [step.behavior for step in moved.primitives].count("L2_LIFT") == 2


def test_explanations_name_the_constraint_of_the_author() -> None:
    plan = confab.load("tour-small").plan()
    assert "in a museum is true only after buying tickets" in str(plan.why("L1#0"))
    assert "CROSSED must be true at most once" in map(
        str, confab.load("tour-small").problem.domain.constraints.values()
    )


def test_an_intervention_is_remembered_and_cannot_make_a_remembered_situation_false() -> None:
    scene = confab.load("tour-small")
    done = scene.execute(interventions=["after=1 bus AT bridge", "after=3 bus AT station"])
    assert done.reached
    assert "bridge" not in [step.arguments[1] for step in done.episode.done.primitives]
    with pytest.raises(KnowledgeError, match="SEEN remembers VISITED, so it never becomes false"):
        scene.execute(interventions=["after=1 station SEEN false"])


def test_queries_find_initially_remembered_facts_in_scenes_with_constraints() -> None:
    found = confab.load("tour-small").query(
        "PREFIX d: <https://w3id.org/confab/tour#> SELECT ?p { ?f :situationType d:SEEN ; :about ?p }"
    )
    assert "station" in str(found)
    constrained = confab.load("drums-small")
    assert not len(constrained.query("PREFIX d: <https://w3id.org/confab/drums#> SELECT ?b { ?b d:CLASH true }"))


def test_the_constraints_of_pddl_hold_and_become_goals(tmp_path: Path) -> None:
    plan = confab.load(pddl(tmp_path, TRIP, ROADS)).plan(optimal=True).plan
    assert [step.behavior for step in plan.steps] == ["PACK", "GO", "TAKE", "GO", "GO"]


@pytest.mark.parametrize("both", [False, True])
def test_sometime_before_requires_an_earlier_state_as_in_pddl(both: bool, tmp_path: Path) -> None:
    """An action that makes both conditions true at the same time violates ``sometime-before``."""
    domain = f"""(define (domain d) (:predicates (a) (b)) (:constraints (sometime-before (b) (a)))
      (:action both :parameters () :precondition () :effect (and (a) (b)))
      {"" if both else "(:action first :parameters () :precondition () :effect (a))"})"""
    problem = "(define (problem p) (:domain d) (:init) (:goal (b)))"
    outcome = confab.load(pddl(tmp_path, domain, problem)).plan().outcome
    assert outcome.status is (Status.UNSOLVABLE if both else Status.SOLVED)


@pytest.mark.filterwarnings("ignore")  # unified-planning uses deprecated functions of pyparsing
def test_an_export_has_the_effects_that_record_remembered_facts(tmp_path: Path) -> None:
    domain, problem = confab.load(pddl(tmp_path, TRIP, ROADS)).to_pddl()
    assert not imported(parse(domain, problem)).problem.domain.remembers
    read = pytest.importorskip("unified_planning.io").PDDLReader().parse_problem_string(domain, problem)
    assert any(effect.is_conditional() and "held" in str(effect.fluent) for effect in read.action("go").effects)


def test_random_worlds_with_remembered_facts_have_the_answers_of_exhaustive_search(tmp_path: Path) -> None:
    remembering = 0
    for seed in range(497_900_000, 497_900_008):
        world = mixed(seed, remembered=1.0)
        remembering += bool(world.problem.domain.remembers)
        assert not Judge(world, tmp_path).judged().complaints, seed
    assert remembering >= 5
