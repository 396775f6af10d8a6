"""Planning from observed facts, and planning with a proved bound."""

import json
from dataclasses import fields
from html import unescape
from inspect import signature
from pathlib import Path
from typing import cast, get_args

import pytest

import confab
from confab import cli
from confab.authoring import new_domain
from confab.commands.planning import plan
from confab.plan_options import PlanKeywords, PlanOptions
from confab.planner.plan import Outcome, Plan, Status
from confab.planner.solve import MODES, Mode
from confab.reasoner.generate import write_scene
from confab.reasoner.memory.links import Links
from confab.reasoner.reading.observed import save_observed
from confab.reasoner.reading.relevance import recognise
from confab.reasoner.symbols import Symbol


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


def test_a_plan_can_start_from_observed_facts(tmp_path: Path, scene: confab.Scene) -> None:
    seen = {**scene.problem.initial, Symbol("LOCATION", ("cup1",)): "location7"}
    save_observed(tmp_path / "seen.ttl", seen, scene.names, scene.iri)
    steps = [str(step) for step in scene.plan(observed=tmp_path / "seen.ttl").plan.steps]
    assert len(steps) == 3
    assert not any("B1_MOVE cup1" in step for step in steps)


def test_the_bound_does_not_exceed_the_cost_of_the_plan(scene: confab.Scene) -> None:
    result = scene.plan(optimal=True, time_limit=2.0)
    assert result.outcome.bound is not None
    assert 0 < result.outcome.bound <= len(result.plan.primitives) <= 32
    assert result.json()["bound"] == result.outcome.bound


def test_options_that_exclude_each_other_are_refused(scene: confab.Scene) -> None:
    with pytest.raises(confab.KnowledgeError, match="and not mode='paper'"):
        scene.plan(optimal=True, mode="paper")
    with pytest.raises(confab.KnowledgeError, match="may leave the others"):
        scene.plan(mode="optimal", leave_levels=False)
    with pytest.raises(confab.KnowledgeError, match="uses no memory"):
        scene.plan(mode="optimal", memory=Links())


def test_python_the_command_line_and_agents_have_the_same_options_of_a_planning_call() -> None:
    options = [field.name for field in fields(PlanOptions)]
    assert [*PlanKeywords.__annotations__] == options
    assert [
        name for name in signature(confab.Scene.plan).parameters if name not in ("scene", "goals", "goal")
    ] == options
    written = {parameter.name for parameter in plan.params} | {"leave_levels"}
    assert {*options} <= written


def test_facts_and_goals_are_changed_on_the_command_line_as_in_python(
    scene: confab.Scene, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = ["--fact", "cup1 LOCATION location6", "--without-goal", "cup2", "--without-goal", "bottle1"]
    with pytest.raises(SystemExit, match="0"):
        cli.main(["plan", "beverage-serving", *changes, "--json"])
    shown = json.loads(capsys.readouterr().out)
    changed = scene.with_fact("cup1 LOCATION location6").without_goal("cup2", "bottle1")
    assert shown["steps"] == json.loads(json.dumps(changed.plan().json()["steps"]))
    with pytest.raises(SystemExit, match="1"):
        cli.main(["query", "beverage-serving", *changes, "ASK { :serving c:goal ?goal . ?goal c:about :cup2 }"])


def test_the_command_of_a_page_repeats_the_call_in_the_changed_scene(tmp_path: Path, scene: confab.Scene) -> None:
    changed = scene.without_goal("cup1 BEVERAGE").with_fact("cup1 LOCATION location6")
    page = changed.plan().report(tmp_path / "page.html").read_text()
    again = "--without-goal=cup1 BEVERAGE beverage1' '--fact=cup1 LOCATION location6'"
    assert f"confab plan beverage-serving '{again}" in unescape(page)


def test_the_mode_and_the_option_of_the_optimal_search_are_one(scene: confab.Scene) -> None:
    assert scene.plan(mode="optimal", time_limit=3.0).outcome.bound is not None


def test_a_plan_that_the_checker_rejects_never_leaves_the_command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nothing = Outcome(Status.SOLVED, Plan(()))
    monkeypatch.setitem(cast("dict[str, object]", MODES), "guarded", lambda request: nothing)
    with pytest.raises(SystemExit) as ended:
        cli.main(["plan", "beverage-serving"])
    printed = capsys.readouterr()
    assert ended.value.code == 4
    assert printed.out == ""
    assert "returned steps that are no plan" in printed.err


def test_every_mode_reports_that_no_hand_reaches_the_goal_place(tmp_path: Path) -> None:
    write_scene(tmp_path / "table.ttl", "unsolvable")
    for mode in get_args(Mode):
        outcome = confab.load(tmp_path / "table.ttl").plan(mode=mode).outcome
        assert outcome.status is Status.UNSOLVABLE, mode
        assert outcome.reason is not None
        assert "a Hand that canReach location7, and there is none" in outcome.reason.text


def test_a_place_that_only_an_absence_condition_names_is_in_the_slice(tmp_path: Path) -> None:
    # No fact connects the plate with the sink, except that a behaviour may bring the plate to any free place.
    new_domain("tearoom", tmp_path)
    tearoom = confab.load(tmp_path / "tearoom-scene.ttl")
    assert "sink" in recognise(tearoom.knowledge).problem.classes["Place"]
    assert [step.behavior for step in tearoom.plan().plan.steps] == ["B1_CARRY", "B1_WASH", "B1_CARRY"]


def test_unsolvable_is_returned_only_for_the_whole_scene(tmp_path: Path) -> None:
    write_scene(tmp_path / "table.ttl", "unsolvable", objects=4, clutter=20)
    scene = confab.load(tmp_path / "table.ttl")
    result = scene.plan()
    assert result.outcome.status is Status.UNSOLVABLE
    assert result.problem.initial == scene.problem.initial
