"""Constraints on every state: ``c:never`` and ``c:always`` of a situation type."""

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
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.problem import Problem
from worlds.judging import Judge
from worlds.mixed import mixed

DOMAIN = (ontology.ROOT / "domains" / "drums.ttl").read_text("utf-8")
SCENE = (ontology.ROOT / "scenes" / "drums-small.ttl").read_text("utf-8")
CATALOG = """<?xml version="1.0"?><catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
  <uri name="https://w3id.org/confab/drums" uri="drums.ttl"/></catalog>"""
REACTING: list[tuple[str, tuple[str, ...]]] = [
    ("acid1", ("base1", "base2", "bleach")),
    ("acid2", ("base1", "base2", "bleach")),
]
REACTING += [("peroxide", ("fuel", "solvent")), ("bleach", ("fuel",))]


OVENS = (Path(__file__).parent / "cases" / "ovens.ttl").read_text("utf-8")


def changed(tmp_path: Path, old: str, new: str) -> str:
    """Write the small scene with a replaced text in the domain and in the scene; return its path."""
    assert old in DOMAIN + SCENE
    (tmp_path / "drums.ttl").write_text(DOMAIN.replace(old, new), "utf-8")
    (tmp_path / "scene.ttl").write_text(SCENE.replace(old, new), "utf-8")
    (tmp_path / "catalog-v001.xml").write_text(CATALOG, "utf-8")
    return str(tmp_path / "scene.ttl")


def unconstrained(problem: Problem) -> Problem:
    """Return the problem in which the behaviours don't maintain the constraints, but the checker still knows them."""
    free = {
        name: replace(one, preconditions=tuple(c for c in one.preconditions if getattr(c, "constraint", None) is None))
        for name, one in problem.domain.behaviors.items()
    }
    return replace(problem, domain=replace(problem.domain, behaviors=free))


@pytest.mark.parametrize(
    ("name", "mode"),
    [("drums-small", "guarded"), ("drums-small", "paper"), ("drums-small", "optimal"), ("drums-large", "guarded")],
)
def test_drums_that_react_never_share_a_bay_and_a_bay_is_always_empty(
    name: str, mode: Literal["guarded", "paper", "optimal"]
) -> None:
    result = confab.load(name).plan(mode=mode)
    assert result.plan is not None
    where = {s.arguments[0]: v for s, v in result.problem.initial.items() if s.situation == "IN"}
    reacting: list[tuple[str, tuple[str, ...]]] = [("acid", ("base",))] if name == "drums-small" else REACTING
    for step in result.plan.primitives:
        if step.behavior == "L2_LIFT":
            where[step.arguments[0]] = step.arguments[1]
        if step.behavior == "L2_LOWER":
            where[step.arguments[0]] = str(step.bindings["bay"])
        assert not any(where[one] == where[other] != "forklift" for one, others in reacting for other in others)
        assert set(result.problem.classes["Bay"]) - {*where.values()}


def test_without_the_constraint_the_plan_is_shorter(tmp_path: Path) -> None:
    free = confab.load(changed(tmp_path, "c:never true ; ", "")).plan(optimal=True)
    assert len(free.plan.steps) < len(confab.load("drums-small").plan(optimal=True).plan.steps)


def test_the_checker_finds_a_violation_that_no_precondition_prevents(tmp_path: Path) -> None:
    free = confab.load(changed(tmp_path, "c:never true ; ", "")).plan()
    problem = unconstrained(confab.load("drums-small").problem)
    assert next(fault.text for fault in carried_out(problem, Plan(free.plan.steps))).endswith(
        "CLASH must never be true, and is true after it"
    )


def test_a_goal_that_violates_a_constraint_is_unsolvable_with_a_certificate() -> None:
    outcome = confab.load("drums-small").plan(goal=["acid IN bay1", "base IN bay1"]).outcome
    assert (outcome.status, outcome.certificate is not None) == (Status.UNSOLVABLE, True)


def test_explanations_name_the_constraint() -> None:
    assert "clash is never true" in str(confab.load("drums-small").plan().why("L1#0"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("c:fromLevel 2 ; c:valueProperty :at", "c:never true ; c:valueProperty :at", "AT has other values"),
        ("c:never true", "c:never true ; c:always true", "has both c:never and c:always; keep one"),
        ("{ ?bay a :Bay . ?one", "{ ?bay a :Bay ; :CLASH true . ?one", "CLASH must never be true, but .* recursively"),
        ("d:in :bay2", "d:in :bay1", "CLASH must never be true, and it is true of bay1 here"),
        ("c:never true", 'c:never "maybe"', "never is 'maybe'; wanted true or false"),
    ],
)
def test_an_invalid_constraint_is_refused_with_the_remedy(tmp_path: Path, old: str, new: str, message: str) -> None:
    scene = changed(tmp_path, old, new)
    with pytest.raises(KnowledgeError, match=message):
        confab.load(scene).plan()
    assert any("never" in str(row) and "error" in str(row) for row in confab.validate(scene))


def test_a_violation_of_a_constraint_by_an_intervention_is_removed() -> None:
    """An observed state may violate a constraint; the plan from this state adds no exception."""
    done = confab.load("drums-small").execute(interventions=["after=2 base IN bay3"])
    assert done.reached
    assert len(done.episode.replans) == 1
    assert [text.partition(": ")[2] for text in done.violations] == ["CLASH must never be true, and it is true of bay3"]
    assert done.violations[0] in done.summary()
    assert done.json()["violations"] == [*done.violations]
    assert confab.load("drums-small").execute().violations == ()


def test_always_of_pddl_becomes_a_constraint_and_other_trajectory_constraints_are_refused_by_name(
    tmp_path: Path,
) -> None:
    domain = """(define (domain drums) (:requirements :typing :constraints) (:types bay drum)
      (:predicates (in ?d - drum ?b - bay) (reacts ?a ?b - drum))
      (:constraints (forall (?a ?b - drum ?y - bay) (always (not (and (reacts ?a ?b) (in ?a ?y) (in ?b ?y))))))
      (:action move :parameters (?d - drum ?f ?t - bay) :precondition (in ?d ?f)
        :effect (and (not (in ?d ?f)) (in ?d ?t))))"""
    problem = """(define (problem swap) (:domain drums) (:objects b1 b2 b3 - bay acid base - drum)
      (:init (in acid b1) (in base b2) (reacts acid base)) (:goal (and (in acid b2) (in base b1))))"""
    (tmp_path / "d.pddl").write_text(domain)
    (tmp_path / "p.pddl").write_text(problem)
    scene = str(tmp_path / "scene.ttl")
    made = CliRunner().invoke(app, ["import", str(tmp_path / "d.pddl"), str(tmp_path / "p.pddl"), "-o", scene])
    assert made.exit_code == 0
    assert len(confab.load(scene).plan(optimal=True).plan.steps) == 3
    with pytest.raises(PddlError, match="'sometime-after' is not supported in"):
        parse(domain.replace("(always", "(sometime-after"), problem)


def test_random_worlds_with_constraints_are_answered_as_exhaustive_search_answers(tmp_path: Path) -> None:
    judged = 0
    for seed in range(430_000_000, 430_000_020):
        world = mixed(seed, constrained=1.0)
        judged += bool(world.problem.domain.constraints)
        assert not Judge(world, tmp_path).judged().complaints, seed
    assert judged >= 8


@pytest.mark.parametrize("seed", [410_000_044, 410_000_270, 410_000_048])
def test_constraints_on_empty_classes_and_unions_of_classes_keep_their_meaning(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed, constrained=0.3), tmp_path, every=True).judged().complaints


def test_a_schedule_keeps_a_constraint_at_every_time_and_without_it_overlaps(tmp_path: Path) -> None:
    """An oven is on from the start to the end of a step, and two ovens are never on at the same time."""
    times = []
    for name, text in (("ovens", OVENS), ("free", OVENS.replace("c:never true ; ", ""))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "ovens.ttl").write_text(text, "utf-8")
        timed = confab.load(str(tmp_path / name / "ovens.ttl")).plan(minimise="makespan").timed
        assert timed is not None
        times.append(timed.makespan)
    assert times == [120, 60]


def test_a_constraint_on_a_total_of_totals_that_stays_the_same_forbids_nothing() -> None:
    """Each step moves one individual from one count to another, so that the sum of the counts stays 2."""
    outcome = confab.load(Path(__file__).parent / "cases" / "total-of-totals.ttl").plan().outcome
    assert outcome.status is Status.SOLVED


def test_a_bounded_count_that_a_step_raises_and_lowers_again_is_kept_on_two_levels() -> None:
    timed = confab.load(Path(__file__).parent / "cases" / "ovens-in-levels.ttl").plan(minimise="makespan").timed
    assert timed is not None
    assert timed.makespan == 120


REFILL = """@prefix : <https://example.org/tanks#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/tanks> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Tank a owl:Class ; rdfs:subClassOf c:Object ; c:hasSituationType :SEALED, :CHECKED, :HOLDS .
:SEALED a owl:Class, owl:NamedIndividual, c:SituationType ; c:always true .
:CHECKED a owl:Class, owl:NamedIndividual, c:SituationType .
:HOLDS a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :holds .
:holds a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Tank ; rdfs:range :HOLDS .
:oil a owl:NamedIndividual, :HOLDS . :water a owl:NamedIndividual, :HOLDS .
:tank a owl:NamedIndividual, :Tank ; c:index 1 ; :holds :oil .
:sealed a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :tank ; c:situationType :SEALED .
[ a owl:AllDifferent ; owl:distinctMembers ( :oil :water :tank ) ] .
:CHECK a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''
  DELETE { ?tank :SEALED true } INSERT { ?tank :CHECKED true } WHERE { ?tank a :Tank } ;
  INSERT { ?tank :SEALED true } WHERE { ?tank :holds ?liquid }''' .
:task a owl:NamedIndividual, c:Task ; c:goal [ a c:ValueCondition ; c:about :tank ; c:situationType :CHECKED ] .
"""


def test_an_effect_whose_condition_holds_for_one_of_several_values_keeps_a_constraint(tmp_path: Path) -> None:
    """The tank is open only during the step: it holds some liquid, whichever it is."""
    (tmp_path / "tanks.ttl").write_text(REFILL, "utf-8")
    outcome = confab.load(tmp_path / "tanks.ttl").plan().outcome
    assert outcome.status is Status.SOLVED
    (tmp_path / "tanks.ttl").write_text(REFILL.replace("?liquid", ":water"), "utf-8")
    assert confab.load(tmp_path / "tanks.ttl").plan().outcome.status is Status.UNSOLVABLE
