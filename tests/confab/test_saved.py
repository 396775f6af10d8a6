"""Saved episodes and verdicts are read again without a change; any other file is refused with one sentence."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
from confab.cli import app
from confab.page.data import page_data
from confab.sim.verdict import Verdict
from confab.sim.verify import Rollout, StepReport

PEOPLE = (
    "after=28 cup2 LOCATION location8",
    "after=28 add Cup cup9 LOCATION location2 BEVERAGE no_beverage",
    "after=99 cup1 LOCATION location6",
)


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


def test_a_saved_episode_is_read_back_unchanged(scene: confab.Scene, tmp_path: Path) -> None:
    done = scene.execute(interventions=PEOPLE)
    again = scene.read_episode(done.save(tmp_path / "episode.json"))
    assert again.json() == done.json()
    assert (again.summary(), again.reached) == (done.summary(), True)
    assert again.episode.observed == done.episode.observed
    assert again.report(tmp_path / "page.html").is_file()
    # the file is recognised as an episode
    assert scene.execute(interventions=PEOPLE).save(tmp_path / "episode.json").is_file()


def test_saved_verdicts_are_read_back_unchanged(scene: confab.Scene, tmp_path: Path) -> None:
    plan = scene.plan()
    steps = [StepReport(step, Verdict(True, measured={"lag": 0.5}), 1.0) for step in plan.plan.primitives]
    lost = Verdict(False, "slip or drop", ("cup2",), {"lag": 0.0863}, "it was lost")
    seen = {symbol: "location8" for symbol in scene.problem.goal if symbol.situation == "LOCATION"}
    rollouts = (
        Rollout(3, False, (*steps[:2], StepReport(plan.plan.primitives[2], lost, 0.5)), (0.9,), 1.0, 2.5),
        Rollout(4, True, tuple(steps), (), 1.0, 2.5, seen),
    )
    report = confab.Report(plan.plan, scene.problem.goal, rollouts, None, {"HAND_TILT": 2}, scene, True, 0.002)
    file = tmp_path / "verify.json"
    file.write_text(json.dumps(report.json()))
    again = scene.read_report(file, plan)
    assert again.json() == report.json()
    assert (again.summary(), again.good, again.verified) == (report.summary(), 0, False)
    command = "confab verify beverage-serving PLAN.json --rollouts 2 --seed 3 --noise 0.002 --perturb"
    assert page_data(scene, report=again)["again"] == command
    with pytest.raises(confab.KnowledgeError, match="give the plan that was verified"):
        scene.read_report(file, scene.plan("cup1 LOCATION location6"))


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", "3", '{"scene": 1}', '{"rollouts": [3]}', '{"rollouts": [], "trusted": {}}']
)
def test_a_file_that_is_neither_an_episode_nor_a_verdict_is_refused(
    scene: confab.Scene, text: str, tmp_path: Path
) -> None:
    file = tmp_path / "wrong.json"
    file.write_text(text)
    for read in (lambda: scene.read_episode(file), lambda: scene.read_report(file, scene.plan())):
        with pytest.raises(confab.KnowledgeError, match=r"wrong\.json: "):
            read()


def test_an_episode_of_another_scene_or_in_turtle_is_refused(scene: confab.Scene, tmp_path: Path) -> None:
    done = confab.load("towers-small").execute()
    with pytest.raises(confab.KnowledgeError, match="load that scene"):
        scene.read_episode(done.save(tmp_path / "towers.json"))
    with pytest.raises(confab.KnowledgeError, match="with_episodes"):
        scene.read_episode(done.save(tmp_path / "towers.ttl"))


def test_a_command_writes_the_page_of_a_saved_episode(tmp_path: Path) -> None:
    page, visit = tmp_path / "page.html", tmp_path / "visit.json"
    invoke = CliRunner().invoke
    assert invoke(app, ["execute", "towers-small", "-o", str(visit)]).exit_code == 0
    done = invoke(app, ["report", "towers-small", "--episode", str(visit), "-o", str(page)])
    assert done.exit_code == 0, done.output
    assert '"status":"reached"' in page.read_text()
    assert invoke(app, ["report", "towers-small", "-o", str(page)]).exit_code == 0
    assert '"status":"a plan, checked"' in page.read_text()
    wrong = invoke(app, ["report", "towers-small", "--verdicts", str(visit), "-o", str(page)])
    assert "--verdicts belong to a plan" in str(wrong.exception)


@pytest.mark.parametrize("name", ["library-small", "carts-small", "rooms-snacks", "beverage-serving"])
def test_a_saved_scene_is_the_same_task_in_one_file(name: str, tmp_path: Path) -> None:
    """The file contains all imported ontologies; SPARQL texts keep the prefixes of their own files."""
    scene = confab.load(name)
    again = confab.load(scene.save(tmp_path / "saved.ttl"))
    assert again.problem == scene.problem
    compiled = "L1_BRING.book"  # a parameter that is compiled from the text of L1_BRING
    assert compiled not in (tmp_path / "saved.ttl").read_text(encoding="utf-8")


def test_a_changed_scene_is_saved_with_its_changes(tmp_path: Path) -> None:
    scene = confab.load("beverage-serving").with_fact("cup1 LOCATION location7").with_goal("cup2 LOCATION location8")
    saved = confab.load(scene.save(tmp_path / "saved.ttl"))
    assert saved.facts["cup1 LOCATION"] == "location7"
    assert saved.goals == scene.goals
    with pytest.raises(confab.KnowledgeError, match=r"ends in \.ttl"):
        scene.save(tmp_path / "saved.owl")


def test_a_saved_scene_replaces_only_an_unedited_saved_scene(scene: confab.Scene, tmp_path: Path) -> None:
    file = scene.save(tmp_path / "saved.ttl")
    scene.save(file)
    file.write_text(file.read_text(encoding="utf-8") + "# mine\n", encoding="utf-8")
    with pytest.raises(OSError, match="which a saved scene doesn't replace"):
        scene.save(file)


def test_a_graph_of_rdflib_that_contains_the_imports_is_loaded(tmp_path: Path) -> None:
    scene = confab.load("library-small")
    scene.graph.serialize(tmp_path / "whole.ttl", format="turtle")
    assert confab.load(tmp_path / "whole.ttl").problem.goal == scene.problem.goal
    assert confab.load(scene.graph).plan().plan.length == scene.plan().plan.length


def test_two_scenes_in_one_file_are_named(tmp_path: Path) -> None:
    (tmp_path / "two.ttl").write_text(
        "@prefix owl: <http://www.w3.org/2002/07/owl#> . <urn:a> a owl:Ontology . <urn:b> a owl:Ontology .",
        encoding="utf-8",
    )
    with pytest.raises(confab.KnowledgeError, match="found 2: <urn:a>, <urn:b>"):
        confab.load(tmp_path / "two.ttl").plan()
