"""Levels that external engines solve: the answer is a valid plan of Confab, or is reported as no plan."""

from __future__ import annotations

import re
from pathlib import Path
from time import sleep
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

import confab
from confab import engines
from confab.answers import planned
from confab.cli import app
from confab.engines import Answer, answer, at_rest, plan_by_engine, some_installed
from confab.planner.grounded.best_first import search
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.plan import Limits, Outcome, Reason, Status
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import Deadline
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse

SCENE = "beverage-serving-moved"


def stand_in(domain: str, problem: str, engine: str | None, deadline: Deadline) -> Answer:
    """Plan the PDDL that an engine would receive, with Confab's own planner."""
    read = imported(parse(domain, problem))
    task = ground(read.problem)
    assert isinstance(task, Task)
    found = search(task)
    return engine or "any", "SOLVED_SATISFICING", [read.line(*task.describe(operator)[:2]) for operator in found.plan]


@pytest.fixture(autouse=True)
def no_engine_but_the_stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "answer", stand_in)


def test_the_plan_of_an_engine_is_grouped_under_the_upper_levels_and_is_valid() -> None:
    problem = confab.load(SCENE).problem
    outcome = plan_by_engine(problem, "stand-in")
    assert outcome.status is Status.SOLVED and outcome.engine == "stand-in" and outcome.plan is not None
    assert outcome.plan.length.keys() == {1, 2, 3}
    assert validate(problem, outcome.plan) == []
    assert at_rest(problem, 3).keys() and not at_rest(problem, 1)


def test_the_levels_that_the_plan_of_an_engine_leaves_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "under_the_levels_above", lambda _, plan: plan)
    outcome = plan_by_engine(confab.load(SCENE).problem, "stand-in")
    assert outcome.plan is not None and {step.level for step in outcome.plan.steps} != {1}
    assert {one.level for one in outcome.left} == {1, 2}


def test_an_engine_plans_the_chosen_level() -> None:
    outcome = plan_by_engine(confab.load(SCENE).problem, "stand-in", 2)
    assert outcome.plan is not None and 3 not in outcome.plan.length
    with pytest.raises(KnowledgeError, match=r"no level 7; this scene has 1, 2, 3"):
        plan_by_engine(confab.load(SCENE).problem, "stand-in", 7)


@pytest.mark.parametrize(
    ("said", "status", "reason"),
    [
        ("UNSOLVABLE_PROVEN", Status.UNSOLVABLE, "e: no plan exists on level 3"),
        ("UNSOLVABLE_INCOMPLETELY", Status.GAVE_UP, "e: unsolvable incompletely"),
        ("TIMEOUT", Status.GAVE_UP, "e: timeout"),
        ("SOLVED_SATISFICING", Status.GAVE_UP, "e: its plan is invalid: the goal"),
    ],
)
def test_answers_of_an_engine_without_a_valid_plan_are_reported_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, said: str, status: Status, reason: str
) -> None:
    monkeypatch.setattr(engines, "answer", lambda *_: ("e", said, []))
    outcome = plan_by_engine(confab.load(SCENE).problem, "e")
    assert outcome.status is status and outcome.plan is None and outcome.reason is not None
    assert outcome.reason.text.startswith(reason)


def test_an_installed_engine_runs_if_the_own_search_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    gave_up = Outcome(Status.GAVE_UP, reason=Reason("the limit came first"))
    monkeypatch.setattr("confab.planner.hierarchical.planner.plan", lambda *_, **__: gave_up)
    scene = confab.load(SCENE)
    result = scene.plan(time_limit=60)
    assert result.solved and result.json()["engine"] == "any"
    assert scene.plan(engine="none").outcome.reason == gave_up.reason
    assert planned(scene, [], [], "guarded", 60.0).outcome.reason == gave_up.reason  # an agent's call
    monkeypatch.setattr("confab.plan_call.solve", lambda _: gave_up)
    assert planned(scene, [], [], "paper", 60.0).outcome.reason == gave_up.reason
    monkeypatch.setattr(engines, "answer", lambda *_: ("e", "TIMEOUT", []))
    for seconds, when in ((60, "then"), (None, "before")):
        outcome = scene.plan(time_limit=seconds).outcome
        assert outcome.status is Status.GAVE_UP
        assert outcome.reason == Reason(f"the limit came first; an installed engine was tried {when}: e: timeout")


def test_the_time_that_is_kept_for_an_engine_shortens_a_plan_that_confab_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = list[Limits]()

    def solved(request: Request) -> Outcome:
        limits.append(request.limits)
        return solve(request)

    monkeypatch.setattr("confab.plan_call.solve", solved)
    for engine in (None, "none"):
        assert confab.load(SCENE).plan(time_limit=60, engine=engine).outcome.engine is None
    kept, none = limits
    assert kept.seconds == pytest.approx(none.seconds, abs=3) and kept.seconds is not None and kept.seconds > 50
    assert (kept.finding, none.finding) == (0.6, 1.0)


def test_without_a_time_limit_an_engine_runs_after_bounded_work_and_own_search_continues_if_it_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("confab.plan_call.OURS_WORK", 0)
    monkeypatch.setattr("confab.plan_call.find_spec", lambda name: name)
    monkeypatch.setattr(engines, "some_installed", lambda problem: True)
    scene = confab.load("library-large")
    assert scene.plan().json()["engine"] == "any"
    assert scene.plan(engine="none").outcome.engine is None
    monkeypatch.setattr(engines, "answer", lambda *_: ("e", "TIMEOUT", []))
    result = scene.plan()
    assert result.solved and result.outcome.engine is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--level", "2"], "a level is chosen for an engine"),
        (["--engine", "e", "--optimal"], "an engine plans by itself"),
        (["--engine", "e", "--mode", "optimal"], "an engine plans by itself"),
        (["--engine", "e", "--levels", "strict"], "an engine plans one level alone"),
    ],
)
def test_options_that_exclude_each_other_are_misuse(options: list[str], message: str) -> None:
    done = CliRunner().invoke(app, ["plan", SCENE, *options])
    assert isinstance(done.exception, KnowledgeError) and message in str(done.exception)


def test_an_engine_that_is_not_installed_is_named_with_those_that_are(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("unified_planning")
    monkeypatch.undo()
    with pytest.raises(KnowledgeError, match=r"no engine 'nonesuch' is installed \(installed: .*\)"):
        plan_by_engine(confab.load(SCENE).problem, "nonesuch")


@pytest.mark.parametrize("scene", ["beverage-serving", "one-arm-serving"])
def test_fast_downward_plans_the_lowest_level(monkeypatch: pytest.MonkeyPatch, scene: str) -> None:
    pytest.importorskip("up_fast_downward", reason="needs the engine up-fast-downward")
    monkeypatch.undo()
    problem = confab.load(scene).problem
    outcome = plan_by_engine(problem, "fast-downward")
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert validate(problem, outcome.plan) == []


def test_unified_planning_reads_action_costs_and_unreadable_levels_are_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("unified_planning", reason="needs the extra 'pddl'")
    domain = """(define (domain d) (:requirements :strips :numeric-fluents) (:predicates (p)) (:functions (total-cost))
     (:action a :parameters () :effect (and (p) (increase (total-cost) 3))))"""
    problem = "(define (problem x) (:domain d) (:init (= (total-cost) 0)) (:goal (p)) (:metric minimize (total-cost)))"
    try:
        assert answer(domain, problem, None, Deadline.after(10.0))[1].startswith("SOLVED")
    except KnowledgeError as error:  # if no engine is installed
        assert "no engine takes this problem" in str(error)
    with pytest.raises(KnowledgeError, match="unified-planning can't read this level"):
        answer("(define (domain d) (:requirements :numeric-fluents) (:predicates", problem, None, Deadline.after(10.0))
    with pytest.raises(KnowledgeError, match="no installed engine takes derived predicates"):
        monkeypatch.setattr("unified_planning.engines.factory.Factory.preference_list", [])
        answer("(define (domain d) (:derived (p) (q)))", problem, None, Deadline.after(10.0))


def test_a_level_that_no_engine_supports_is_reported_and_no_time_is_reserved_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("up_fast_downward", reason="needs the engine up-fast-downward")
    monkeypatch.undo()
    defined, counted, plain = (confab.load(scene).problem for scene in ("gallery-small", "canteen-small", SCENE))
    with pytest.raises(KnowledgeError, match="fast-downward takes no numbers"):
        plan_by_engine(counted, "fast-downward")
    monkeypatch.setattr("confab.engines.iter_modules", lambda: [SimpleNamespace(name="up_fast_downward")])
    assert [some_installed(problem) for problem in (plain, defined, counted)] == [True, True, False]
    monkeypatch.setattr("confab.engines.iter_modules", lambda: [SimpleNamespace(name="up_pyperplan")])
    assert [some_installed(problem) for problem in (plain, defined, counted)] == [True, False, False]


def test_an_engine_that_reads_pddl_plans_with_defined_situation_types(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("up_fast_downward", reason="needs the engine up-fast-downward")
    monkeypatch.undo()
    problem = confab.load("gallery-small").problem
    outcome = plan_by_engine(problem, "fast-downward")
    assert outcome.status is Status.SOLVED and outcome.plan is not None and validate(problem, outcome.plan) == []


def test_an_engine_is_stopped_at_the_time_limit_with_all_its_processes(tmp_path: Path) -> None:
    pytest.importorskip("unified_planning", reason="needs the extra 'pddl'")
    late = tmp_path / "late"
    slow = SimpleNamespace(_get_cmd=lambda *_: ["sh", "-c", f"(sleep 1; touch {late}) & wait"])
    assert engines._directly(slow, "", "", Deadline.after(0.1)) == ("TIMEOUT", [])
    sleep(1.1)
    assert not late.exists()


def test_a_plan_that_an_engine_has_written_by_its_limit_counts() -> None:
    pytest.importorskip("unified_planning", reason="needs the extra 'pddl'")
    files = "printf '(a x)\\n(b y)\\n' > plan.1; sleep 0.01; printf '(a' > plan.2; printf '1 2' > plan_numbers; sleep 9"
    slow = SimpleNamespace(_get_cmd=lambda *_: ["sh", "-c", files])
    assert engines._directly(slow, "", "", Deadline.after(0.5)) == ("SOLVED_SATISFICING", ["(a x)", "(b y)"])


def test_the_used_engine_is_logged_with_its_time_limit(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("up_fast_downward", reason="needs the engine up-fast-downward")
    monkeypatch.undo()
    monkeypatch.setattr(engines, "_directly", lambda *_: ("TIMEOUT", []))
    plan_by_engine(confab.load(SCENE).problem, None)
    assert re.search(r"trying the engine fast-downward, for up to [56]\d", caplog.text)


def test_the_time_of_the_export_counts_towards_the_time_limit_of_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, left = confab.load(SCENE), list[float | None]()
    exporting = to_pddl

    def slowly(*given: Any) -> Any:
        sleep(0.05)
        return exporting(*given)

    def late(domain: str, problem: str, engine: str | None, deadline: Deadline) -> Answer:
        left.append(deadline.left)
        return "e", "TIMEOUT", []

    monkeypatch.setattr(engines, "to_pddl", slowly)
    monkeypatch.setattr(engines, "answer", late)
    assert plan_by_engine(scene.problem, None, seconds=0.04).status is Status.GAVE_UP
    assert left == []
    assert plan_by_engine(scene.problem, None, seconds=10.0).status is Status.GAVE_UP
    assert 0 < (left[0] or 0) <= 9.95
