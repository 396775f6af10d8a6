"""Memory at the front desk: who may lead, and what is learned from what was carried out."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import rdflib
from click.testing import CliRunner

import confab
from confab.cli import app
from confab.explaining import explain
from planner.acting.episode import Failure
from planner.experience.demonstrations import lesson
from reasoner.generate import write_scene
from reasoner.graph.knowledge import KnowledgeError
from reasoner.memory.counts import Candidate, Conclusion, Decision, Experience


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


def test_trust_is_kept_in_the_file_and_not_passed_on(tmp_path: Path, scene: confab.Scene) -> None:
    memory, other = confab.Memory.of(scene), Experience("other")
    other.learn([Decision(Candidate(Conclusion("B1_MOVE", ("Cup", "Location")), (("a", "b"),)))])
    memory.experience.merge(other)
    assert not memory.advisor.trusted
    with pytest.raises(KnowledgeError, match="no replica 'nobody'"):
        memory.trust(["nobody"])
    memory.trust(["other"])
    assert memory.advisor.trusted
    memory.save(tmp_path / "memory.ttl")
    assert confab.Memory.load(tmp_path / "memory.ttl", scene).advisor.trusted
    rdflib.Graph().parse(tmp_path / "memory.ttl").serialize(tmp_path / "theirs.ttl")
    assert confab.Memory.load(tmp_path / "theirs.ttl", scene).advisor.trusted
    third = confab.Memory.of(scene)
    third.merge(confab.Memory.load(tmp_path / "memory.ttl", scene))
    assert not third.advisor.trusted


def test_an_episode_without_failure_teaches_like_its_plan(scene: confab.Scene) -> None:
    one, other = confab.Memory.of(scene), confab.Memory.of(scene)
    execution = scene.execute(memory=one)
    one.live(scene.problem, execution.episode)
    other.learn(scene, execution.episode.done)
    assert one.experience.totals() == other.experience.totals() != {}


def test_teaching_shows_good_examples_of_two_levels(scene: confab.Scene) -> None:
    memory, plan = confab.Memory.of(scene), scene.plan().plan
    memory.teach(scene, plan)
    chosen = [(c.behavior, t.chosen) for c, table in memory.experience.totals().items() for t in table.values()]
    for level in (1, 2):
        steps = lesson(scene.problem, level)
        assert sum(count for behavior, count in chosen if behavior.startswith(f"B{level}_")) == len(steps)
        assert 0 < len(steps) <= len(plan.at_level(level))
    assert len(memory.links)
    with pytest.raises(KnowledgeError):
        memory.teach(confab.load("moved-serving"), plan)


def test_a_scene_too_large_for_the_papers_links_teaches_counts_alone(
    scene: confab.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("confab.memory.MOST_LINKS", 10)
    told = CliRunner().invoke(app, ["learn", "beverage-serving", "--memory", str(tmp_path / "memory.ttl")])
    assert told.exit_code == 0, told.output
    assert "only counts were learned" in told.stderr
    memory = confab.Memory.load(tmp_path / "memory.ttl", scene)
    assert not len(memory.links)
    assert len(memory.experience)


def test_every_level_is_learned_where_no_shortest_plan_is_found(tmp_path: Path) -> None:
    write_scene(tmp_path / "full.ttl", "full", 12, seed=1)
    made = confab.load(tmp_path / "full.ttl")
    memory = confab.Memory.of(made)
    assert lesson(made.problem, 1) == []
    memory.teach(made, made.plan().plan)
    assert {c.behavior[:3] for c in memory.experience.totals()} == {"B1_", "B2_"}


def test_a_scene_without_plan_is_named_and_the_others_are_learned(tmp_path: Path) -> None:
    write_scene(tmp_path / "no.ttl", "unsolvable", 4)
    memory = tmp_path / "memory.ttl"
    told = CliRunner().invoke(app, ["learn", "beverage-serving", str(tmp_path / "no.ttl"), "--memory", str(memory)])
    assert told.exit_code == 1, told.output
    assert "no.ttl: nothing to learn, unsolvable: " in told.stderr
    assert confab.Memory.load(memory).experience.episodes
    alone = CliRunner().invoke(app, ["learn", str(tmp_path / "no.ttl"), "--memory", str(tmp_path / "none.ttl")])
    assert alone.exit_code == 1
    assert not (tmp_path / "none.ttl").exists()


def test_learners_at_the_same_file_lose_nothing(tmp_path: Path) -> None:
    run = "from confab.cli import main; main()"
    command = [sys.executable, "-c", run, "learn", "beverage-serving", "--memory", str(tmp_path / "memory.ttl")]
    learners = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for _ in range(3)]
    assert [learner.wait(120) for learner in learners] == [0, 0, 0]
    assert sum(confab.Memory.load(tmp_path / "memory.ttl").experience.episodes.values()) == 3


def test_an_explanation_says_when_memory_had_no_part_and_when_it_knows_nothing(
    tmp_path: Path, scene: confab.Scene
) -> None:
    memory = str(tmp_path / "memory.ttl")
    assert CliRunner().invoke(app, ["learn", "beverage-serving", "--memory", memory]).exit_code == 0
    told = CliRunner().invoke(app, ["explain", "beverage-serving", "--memory", memory])
    assert "before memory was asked" in told.output
    steps = [(step.behavior, step.arguments) for step in scene.plan().plan.at_level(1)]
    assert (
        explain(scene.problem, confab.Memory.of(scene), steps).note
        == f"memory has never seen {steps[0][0]} chosen or passed over"
    )


def test_what_failed_when_it_was_carried_out_is_counted_as_failed(scene: confab.Scene) -> None:
    memory = confab.Memory.of(scene)
    episode = scene.execute().episode
    primitive = episode.planned.primitives[0]
    failure = Failure(primitive, "slipped", (), "it slipped", episode.initial)
    memory.live(scene.problem, replace(episode, failures=(failure,)))
    tallies = [(c.behavior, t) for _, c, _, t in memory.experience]
    above = [step.behavior for step in episode.planned.walk() if step.path in (primitive.path[:1], primitive.path[:2])]
    assert sorted(behavior for behavior, _ in tallies) == sorted(above)
    assert all((t.chosen, t.failed) == (0, 1) for _, t in tallies)
