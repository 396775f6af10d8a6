"""PDDL import and export: imported problems are exported without a change; unsupported constructs are refused with their place."""

from __future__ import annotations

import os
import random
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

import confab
from confab.pddl_commands import export_pddl, import_pddl, read_pddl_plan
from confab.planner.grounded.best_first import plan_level, search
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.plan import Limits, Plan, Status, Step
from confab.planner.solve import Request, solve
from confab.planner.validation import validate as faults
from confab.reasoner.amounts import Measure
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.pddl.exporting import Exported, plan_of, to_pddl
from confab.reasoner.pddl.importing import Imported, imported
from confab.reasoner.pddl.syntax import parse, parse_files
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.validation.validate import validate
from tests.planner.naive import tabletop

TRUCKS = (
    """(define (domain trucks) (:requirements :strips :typing)
 (:types place locatable - object truck parcel - locatable)
 (:predicates (at ?x - locatable ?p - place) (in ?x - parcel ?t - truck) (road ?a ?b - place) (empty ?t - truck))
 (:action drive :parameters (?t - truck ?a ?b - place)
  :precondition (and (at ?t ?a) (road ?a ?b)) :effect (and (not (at ?t ?a)) (at ?t ?b)))
 (:action load :parameters (?x - parcel ?t - truck ?p - place)
  :precondition (and (at ?t ?p) (at ?x ?p) (empty ?t)) :effect (and (not (at ?x ?p)) (in ?x ?t) (not (empty ?t))))
 (:action unload :parameters (?x - parcel ?t - truck ?p - place)
  :precondition (and (at ?t ?p) (in ?x ?t)) :effect (and (at ?x ?p) (not (in ?x ?t)) (empty ?t))))""",
    """(define (problem two) (:domain trucks) (:objects t - truck x1 x2 - parcel a b c - place)
 (:init (at t a) (at x1 b) (at x2 c) (road a b) (road b c) (road c b) (road b a) (empty t))
 (:goal (and (at x1 c) (at x2 a))))""",
)
LAMPS = (  # negation, disjunction, quantifiers, conditional effects, equality, constants
    """(define (domain lamps) (:requirements :adl)
 (:types lamp room) (:constants hall - room)
 (:predicates (lit ?l - lamp) (in ?l - lamp ?r - room) (broken ?l - lamp) (here ?r - room) (dark) (linked ?a ?b - lamp))
 (:action walk :parameters (?from ?to - room)
  :precondition (and (here ?from) (not (= ?from ?to)) (or (= ?to hall) (= ?from hall)))
  :effect (and (here ?to) (not (here ?from))))
 (:action switch :parameters (?l - lamp)
  :precondition (and (exists (?r - room) (and (here ?r) (in ?l ?r))) (not (broken ?l)))
  :effect (and (when (lit ?l) (not (lit ?l))) (when (not (lit ?l)) (lit ?l))
   (forall (?o - lamp) (when (and (linked ?l ?o) (not (broken ?o))) (lit ?o)))))
 (:action rest :parameters () :precondition (forall (?l - lamp) (imply (in ?l hall) (not (lit ?l)))) :effect (dark))
 (:action wake :parameters () :precondition (dark) :effect (not (dark))))""",
    """(define (problem evening) (:domain lamps) (:objects l1 l2 l3 - lamp study - room)
 (:init (here study) (in l1 hall) (in l2 study) (in l3 hall) (lit l1) (broken l3) (linked l1 l2))
 (:goal (and (dark) (or (lit l2) (lit l3)) (not (lit l1)))))""",
)
TOLLS = (
    """(define (domain tolls) (:requirements :strips :action-costs)
 (:predicates (at ?p) (road ?a ?b)) (:functions (total-cost) - number (toll ?a ?b) - number)
 (:action go :parameters (?a ?b) :precondition (and (at ?a) (road ?a ?b))
  :effect (and (at ?b) (not (at ?a)) (increase (total-cost) (toll ?a ?b)))))""",
    """(define (problem trip) (:domain tolls) (:objects a b c)
 (:init (at a) (road a b) (road b c) (road a c) (= (toll a b) 1) (= (toll b c) 2) (= (toll a c) 9) (= (total-cost) 0))
 (:goal (at c)) (:metric minimize (total-cost)))""",
)
BOXES = (
    """(define (domain boxes) (:requirements :typing :derived-predicates)
 (:types thing - object box - thing)
 (:predicates (in ?t - thing ?b - box) (inside ?t - thing ?b - box) (loose ?t - thing) (shut ?b - box) (reachable ?t - thing))
 (:derived (inside ?t ?b) (or (in ?t ?b) (exists (?c - box) (and (in ?t ?c) (inside ?c ?b)))))
 (:derived (loose ?t) (not (exists (?b - box) (in ?t ?b))))
 (:derived (reachable ?t) (forall (?b - box) (imply (inside ?t ?b) (not (shut ?b)))))
 (:action open :parameters (?b - box) :precondition (reachable ?b) :effect (not (shut ?b)))
 (:action put :parameters (?t - thing ?b - box)
  :precondition (and (loose ?t) (reachable ?b) (not (shut ?b)) (not (= ?t ?b)) (not (inside ?b ?t))) :effect (in ?t ?b))
 (:action take :parameters (?t - thing ?b - box) :precondition (and (in ?t ?b) (reachable ?t)) :effect (not (in ?t ?b))))""",
    """(define (problem packing) (:domain boxes) (:objects ball - thing small middle large - box)
 (:init (in ball large) (shut large)) (:goal (and (inside ball large) (in ball small) (inside small middle))))""",
)
OWN = {"boxes": BOXES, "trucks": TRUCKS, "lamps": LAMPS, "tolls": TOLLS}
GIVEN = Path(os.environ.get("CONFAB_PDDL", Path(__file__).resolve().parents[3] / "shared" / "pddl"))
"""Problems of other authors, which aren't part of this repository; they are tested if they are available."""


def given_problems() -> list[Path]:
    return [sorted(d.parent.rglob("p*.pddl"))[0] for d in sorted(GIVEN.rglob("domain.pddl"))]


def given(problem: Path) -> Imported:
    folder = next(f for f in problem.parents if (f / "domain.pddl").is_file())
    return imported(parse_files(folder / "domain.pddl", problem))


def task_of(problem: Problem) -> Task:
    task = ground(problem)
    assert isinstance(task, Task)
    return task


def same(first: Problem, second: Problem) -> bool:
    """Return whether two problems are equal, except for parent classes and the classes of the core vocabulary."""
    return (
        (first.scene, first.domain.behaviors, first.domain.situations, first.domain.rules, first.goal, first.initial)
        == (
            second.scene,
            second.domain.behaviors,
            second.domain.situations,
            second.domain.rules,
            second.goal,
            second.initial,
        )
        and {k: v for k, v in first.relations.items() if v} == {k: v for k, v in second.relations.items() if v}
        and {k: second.classes.get(k, ()) for k in first.classes} == dict(first.classes)
    )


def assert_same_behaviour(first: Problem, exported: Exported, second: Imported, steps: int = 60) -> None:
    """Walk at random through both problems.

    In every state the same behaviours are applicable, and the goal holds in both or in neither.
    """
    one, other = task_of(first), task_of(second.problem)

    def applicable(task: Task, state: int) -> dict[tuple[str, tuple[str, ...]], int]:
        found = {}
        for operator in range(len(task)):
            after = task.applied(state, operator)
            if after is not None and after != state:
                name, arguments, _ = task.describe(operator)
                if task is one:
                    found[name, arguments] = operator
                else:
                    (step,) = plan_of(exported, second.line(name, arguments))
                    found[step.behavior, step.arguments] = operator
        return found

    choice = random.Random(0)
    states = one.initial, other.initial
    for _ in range(steps):
        assert (states[0] & one.goal == one.goal) == (states[1] & other.goal == other.goal)
        ours, theirs = applicable(one, states[0]), applicable(other, states[1])
        assert ours.keys() == theirs.keys()
        if not ours:
            return
        step = choice.choice(sorted(ours, key=str))
        left, right = one.applied(states[0], ours[step]), other.applied(states[1], theirs[step])
        assert left is not None and right is not None
        states = left, right


# ------------------------------------------------------------------------------------------------------------- import


def test_predicates_that_exclude_each_other_become_one_situation_type() -> None:
    problem = imported(parse(*TRUCKS)).problem
    at = problem.domain.situations["AT"]
    assert not at.boolean and at.arguments == ("Locatable",)
    assert "IN" not in problem.domain.situations
    assert {"t", "a", "b", "c", "no_at"} == set(problem.classes["AT"])


def test_predicates_that_can_hold_together_stay_separate_situation_types() -> None:
    domain = """(define (domain lift) (:predicates (boarded ?p) (served ?p) (waiting ?p))
      (:action board :parameters (?p) :precondition (waiting ?p) :effect (boarded ?p))
      (:action leave :parameters (?p) :precondition (boarded ?p) :effect (and (not (boarded ?p)) (served ?p))))"""
    problem = "(define (problem one) (:domain lift) (:objects p) (:init (waiting p)) (:goal (served p)))"
    situations = imported(parse(domain, problem)).problem.domain.situations
    assert all(s.boolean for s in situations.values())


@pytest.mark.parametrize("name", OWN)
def test_an_imported_scene_is_valid_and_reads_back_as_the_same_problem(name: str, tmp_path: Path) -> None:
    (tmp_path / "d.pddl").write_text(OWN[name][0])
    (tmp_path / "p.pddl").write_text(OWN[name][1])
    problem = import_pddl(tmp_path / "d.pddl", tmp_path / "p.pddl", tmp_path / "scene.ttl")
    assert [finding for finding in validate([tmp_path / "scene.ttl"]) if finding.severity != "remark"] == []
    assert same(problem, read(load(tmp_path / "scene.ttl")).problem)


@pytest.mark.parametrize("name", OWN)
def test_import_export_import_is_the_same_problem(name: str) -> None:
    first = imported(parse(*OWN[name])).problem
    exported = to_pddl(first)
    assert_same_behaviour(first, exported, imported(parse(exported.domain, exported.problem)))


@pytest.mark.parametrize("name", sorted(OWN.keys() - {"boxes"}))  # its reader doesn't support derived predicates
def test_plans_of_imported_problems_are_accepted_by_unified_planning(name: str) -> None:
    scene = imported(parse(*OWN[name]))
    task = task_of(scene.problem)
    found = search(task)
    assert found.status is Status.SOLVED
    outcome = plan_level(scene.problem)
    assert outcome.plan is not None and faults(scene.problem, outcome.plan) == []
    lines = [scene.line(*task.describe(operator)[:2]) for operator in found.plan]
    assert accepted(*OWN[name], [line for line in lines if line])


def accepted(domain: str, problem: str, plan: list[str]) -> bool:
    engines = pytest.importorskip("unified_planning.engines")
    from unified_planning.io import PDDLReader
    from unified_planning.plans import ActionInstance, SequentialPlan

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # deprecation warnings of the parser, and a warning about action costs
        task = PDDLReader().parse_problem_string(domain, problem)
        term = task.environment.expression_manager.ObjectExp
        steps = [
            ActionInstance(task.action(name), tuple(term(task.object(word)) for word in words))
            for name, *words in (line.split() for line in plan)
        ]
        validator = engines.SequentialPlanValidator()
        validator.skip_checks = True
        result = validator.validate(task, SequentialPlan(steps))
    return bool(result.status.name == "VALID")


def test_costs_that_depend_on_objects_are_kept() -> None:
    problem = imported(parse(*TOLLS)).problem
    assert {b.name: b.price for b in problem.domain.behaviors.values()} == {"GO": Measure("toll", ("?a", "?b"))}
    exported = to_pddl(problem)
    assert "(increase (total-cost) (toll ?a ?b))" in exported.domain
    assert ":numeric-fluents" not in exported.domain  # so that planners that support only costs accept the domain
    for one in (problem, imported(parse(exported.domain, exported.problem)).problem):
        outcome = solve(Request(one, "optimal"))
        assert outcome.cost == outcome.bound == 3


@pytest.mark.parametrize("path", given_problems(), ids=lambda p: str(p.relative_to(GIVEN)))
def test_given_domains_survive_import_and_export(path: Path, tmp_path: Path) -> None:
    found = given(path)
    scene = tmp_path / f"{found.problem.scene.rsplit('/', 1)[-1]}.ttl"
    scene.write_text(turtle(found.problem, "title", "description", found.said))
    assert [finding for finding in validate([scene]) if finding.severity != "remark"] == []
    assert same(found.problem, read(load(scene)).problem)
    exported = to_pddl(found.problem)
    assert_same_behaviour(found.problem, exported, imported(parse(exported.domain, exported.problem)), 20)


# ------------------------------------------------------------------------------------------------------------ refusals

DOMAIN = """(define (domain d)
 (:types a b)
 (:predicates (p ?x - a) (q ?x ?y))
 (:action f :parameters (?x - a)
  :precondition {}
  :effect {}))"""
PROBLEM = "(define (problem e) (:domain d)\n (:objects o - a)\n (:init {})\n (:goal {}))"


@pytest.mark.parametrize(
    ("precondition", "effect", "init", "goal", "message"),
    [
        ("(p ?x", "(p ?x)", "", "(p o)", "domain:1:1: this '(' is never closed"),
        ("(r ?x)", "(p ?x)", "", "(p o)", "domain:5:17: undefined predicate 'r' (known: p, q)"),
        ("(p ?y)", "(p ?x)", "", "(p o)", "domain:5:20: undefined variable ?y (known: ?x)"),
        ("(p ?x ?x)", "(p ?x)", "", "(p o)", "domain:5:17: predicate 'p' takes 1 arguments, got 2"),
        ("(exists (?z - c) (p ?z))", "(p ?x)", "", "(p o)", "domain:5:31: undefined type 'c' (known: a, b, object)"),
        ("(> (f) 3)", "(p ?x)", "", "(p o)", "domain:5:20: undefined function 'f' (known: none)"),
        ("(p ?x)", "(assign (f) 3)", "", "(p o)", "domain:6:19: undefined function 'f' (known: none)"),
        ("(p ?x)", "(p ?x)", "(p u)", "(p o)", "problem:3:12: undefined object 'u'"),
        ("(p ?x)", "(p ?x)", "(p o o)", "(p o)", "problem:3:9: predicate 'p' takes 1 arguments, got 2"),
        ("(p ?x)", "(p ?x)", "(at 5 (nope o))", "(p o)", "problem:3:9: wanted (at TIME (predicate …))"),
        ("(p ?x)", "(p ?x)", "", "(p o))", "problem:4:16: ')' without '('"),
    ],
)  # fmt: skip
def test_bad_pddl_is_refused_with_its_place(precondition: str, effect: str, init: str, goal: str, message: str) -> None:
    with pytest.raises(PddlError) as refused:
        parse(DOMAIN.format(precondition, effect), PROBLEM.format(init, goal))
    assert str(refused.value).startswith(message)
    assert "\n" not in str(refused.value)


def test_unsupported_features_are_refused_by_name() -> None:
    domain = "(define (domain d) (:predicates (p))\n (:process f :parameters () :effect (p)))"
    with pytest.raises(PddlError, match=r"domain:2:2: processes are not supported"):
        parse(domain, "(define (problem e) (:domain d) (:init) (:goal (p)))")


def test_unused_requirements_of_pddl_are_ignored() -> None:
    domain = DOMAIN.replace("(:types", "(:requirements :strips :derived-predicates :durative-actions) (:types", 1)
    assert parse(domain.format("(p ?x)", "(p ?x)"), PROBLEM.format("", "(p o)")).objects == {"o": "a"}


def test_a_hundred_thousand_objects_are_read_in_seconds(tmp_path: Path) -> None:
    names = " ".join(f"o{i}" for i in range(100_000))
    pddl = parse(
        DOMAIN.format("(p ?x)", "(not (p ?x))"),
        f"(define (problem e) (:domain d) (:objects {names} - a) (:init) (:goal (p o1)))",
    )
    assert len(pddl.objects) == 100_000
    (tmp_path / "huge.pddl").write_bytes(b" " * (33 * 2**20))
    with pytest.raises(PddlError, match="33 MB, more than the 32 MB allowed"):
        parse_files(tmp_path / "huge.pddl", tmp_path / "huge.pddl")


# -------------------------------------------------------------------------------------------------------------- export


def bound(problem: Problem, plan: Plan) -> Iterator[Step]:
    """Yield the steps of a plan with the individuals of their variables; the grounded task knows these individuals, too."""
    task = ground(problem, plan.steps[0].level)
    assert isinstance(task, Task)
    state = task.initial
    for step in plan.steps:
        operators = (o for o in range(len(task)) if task.describe(o)[:2] == (step.behavior, step.arguments))
        operator = next(o for o in operators if task.applied(state, o) is not None)
        yield task.steps([operator])[0]
        state = task.applied(state, operator) or 0


@pytest.mark.parametrize("level", [1, 2, 3])
def test_a_level_of_the_tabletop_is_exported_and_its_plans_are_imported(level: int, tmp_path: Path) -> None:
    problem = tabletop()
    domain, task = export_pddl(problem, level, tmp_path)
    exported = to_pddl(problem, level)
    second = imported(parse(domain.read_text(), task.read_text()))
    grounded = task_of(second.problem)
    found = search(grounded, Limits(expansions=20_000))
    assert found.status is Status.SOLVED
    lines = "".join(f"({second.line(*grounded.describe(operator)[:2])})\n" for operator in found.plan)
    plan = read_pddl_plan(problem, level, lines)
    assert faults(problem, plan) == []
    assert faults(problem, read_pddl_plan(problem, level, lines, regroup=True)) == []
    assert [step.bindings for step in plan.steps] == [step.bindings for step in bound(problem, plan)]
    assert exported.actions.keys() >= {line.strip("()").split()[0] for line in lines.splitlines()}
    with pytest.raises(KnowledgeError, match="line 1: no action 'fly'"):
        read_pddl_plan(problem, level, "(fly left_hand)")


def test_an_unknown_level_is_refused(tmp_path: Path) -> None:
    with pytest.raises(KnowledgeError, match="no level 7; this scene has 1, 2, 3"):
        export_pddl(tabletop(), 7, tmp_path)


def test_derived_predicates_are_planned_with_and_a_circular_derivation_is_refused() -> None:
    found = solve(Request(imported(parse(*BOXES)).problem))
    assert found.status is Status.SOLVED
    assert found.plan is not None
    assert (
        len(found.plan.steps) >= 5
    )  # the large box is opened, the ball is taken out and packed into the small box, and the small box is put away
    domain, problem = BOXES
    with pytest.raises(PddlError, match=r"domain:\d+:\d+: 'loose' is derived, so it can't be an effect"):
        parse(domain.replace(":effect (in ?t ?b))", ":effect (and (loose ?t) (in ?t ?b)))"), problem)
    with pytest.raises(PddlError, match=r"problem:\d+:\d+: 'loose' is derived, so it can't be stated"):
        parse(domain, problem.replace("(shut large)", "(shut large) (loose small)"))
    circular = domain.replace(
        "(:action open",
        "(:derived (loose ?t) (not (reachable ?t)))\n(:derived (reachable ?t) (loose ?t))\n(:action open",
    )
    with pytest.raises(
        PddlError, match=r"'loose' is derived from \(not \(reachable …\)\), which is derived from it in turn"
    ):
        imported(parse(circular, problem))


def test_a_type_may_follow_its_dash_without_a_space() -> None:
    loose, plain = (
        parse(
            f"(define (domain d) (:types boat) (:predicates (out ?b {dash}boat)) (:functions (knots ?b {dash}boat))"
            f" (:action sail :parameters (?b {dash}boat) :precondition (> (knots ?b) -2) :effect (out ?b)))",
            f"(define (problem p) (:domain d) (:objects a-b {dash}boat) (:init (= (knots a-b) -1)) (:goal (out a-b)))",
        )
        for dash in ("-", "- ")
    )
    assert imported(loose).problem == imported(plain).problem


def test_objects_of_pddl_may_have_the_names_of_tasks_goals_and_facts(tmp_path: Path) -> None:
    (tmp_path / "domain.pddl").write_text(
        "(define (domain errands) (:requirements :strips :typing) (:types item) (:predicates (done ?x - item) (near ?x ?y - item))"
        " (:action do :parameters (?x ?y - item) :precondition (and (near ?x ?y) (not (done ?x))) :effect (done ?x)))",
        "utf-8",
    )
    (tmp_path / "problem.pddl").write_text(
        "(define (problem p) (:domain errands) (:objects task goal1 fact1 - item)"
        " (:init (near task goal1) (near goal1 fact1) (near fact1 task)) (:goal (and (done task) (done goal1) (done fact1))))",
        "utf-8",
    )
    import_pddl(tmp_path / "domain.pddl", tmp_path / "problem.pddl", tmp_path / "scene.ttl")
    assert len(confab.load(tmp_path / "scene.ttl").plan().plan.primitives) == 3
    assert "error" not in {severity for severity, *_ in confab.validate(tmp_path / "scene.ttl")}
