"""Memory on the command line: which rules may lead, and what is learned from executed plans."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import rdflib
from click.testing import CliRunner

import confab
from confab.authoring import unknown_terms
from confab.cli import app
from confab.planner.acting.episode import Failure
from confab.planner.plan import Plan
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.memory.experience import ITSELF, Experience, GoalKind, LearnedRule, Lesson, Method, Tally
from confab.reasoner.memory.links import Links
from confab.reasoner.memory.links_file import memory_lines


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


def test_trust_is_kept_in_the_memory_file_and_not_passed_on_by_a_merge(tmp_path: Path, scene: confab.Scene) -> None:
    memory, other = confab.Memory.of(scene), Experience("other")
    other.learn(Lesson(counted=[(GoalKind("LOCATION", ("Cup",)), ITSELF, Tally(1))]))
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


def test_a_memory_is_read_without_the_facts_of_its_scene(tmp_path: Path, scene: confab.Scene) -> None:
    memory = confab.Memory.of(scene)
    memory.teach(scene, scene.plan())
    memory.save(tmp_path / "memory.ttl")
    fresh = confab.load("beverage-serving")
    assert confab.Memory.load(tmp_path / "memory.ttl", fresh).experience.said == memory.experience.said
    assert "reading" not in vars(fresh)
    assert fresh.names.agree(fresh.reading.names)
    assert fresh.reading.names.agree(fresh.names)


def test_a_memory_that_is_edited_without_its_scene_keeps_its_terms(tmp_path: Path, scene: confab.Scene) -> None:
    file, other = tmp_path / "memory.ttl", tmp_path / "other.ttl"
    memory = confab.Memory.of(scene)
    memory.teach(scene, scene.plan())
    memory.save(file)
    assert not confab.validate(file)
    confab.Memory.of(scene).save(other)
    for arguments in (["trust", file, "all"], ["merge", file, other, "-o", file]):
        assert CliRunner().invoke(app, ["memory", *map(str, arguments)]).exit_code == 0
        assert unknown_terms(memory_lines(file), scene) == []
    assert confab.Memory.load(file, scene).experience.said == memory.experience.said
    file.write_text(file.read_text().replace("#Movable>", "#Movabel>").replace(":learnsAs", ":learns"))
    assert "undeclared-term" in {finding.rule for finding in confab.validate(file)}


def test_the_papers_links_are_read_for_the_papers_mode_alone(tmp_path: Path, scene: confab.Scene) -> None:
    memory = confab.Memory.of(scene)
    memory.teach(scene, scene.plan())
    memory.save(tmp_path / "memory.ttl")
    read = confab.Memory.load(tmp_path / "memory.ttl", scene)
    scene.plan(memory=read)
    assert not isinstance(read.linked, Links)
    scene.plan(memory=read, mode="paper")
    assert isinstance(read.linked, Links)
    assert len(read.linked) == len(memory.links) > 0


def test_an_episode_without_failure_teaches_like_its_plan(scene: confab.Scene) -> None:
    one, other = confab.Memory.of(scene), confab.Memory.of(scene)
    execution = scene.execute(memory=one)
    one.live(scene.problem, execution.episode)
    other.learn(scene, execution.episode.done)
    assert one.experience.totals() == other.experience.totals() != {}
    overlapping, at_once = confab.Memory.of(scene), [replace(event, begin=0.0) for event in execution.episode.events]
    overlapping.live(scene.problem, replace(execution.episode, events=tuple(at_once)))
    assert overlapping.experience.said == one.experience.said


def test_teaching_gives_rules_and_methods_of_every_level(scene: confab.Scene) -> None:
    memory, plan = confab.Memory.of(scene), scene.plan().plan
    memory.teach(scene, plan)
    said = memory.experience.said.values()
    done = {scene.problem.domain.behaviors[one.does[0]].level for one in said if isinstance(one, LearnedRule)}
    assert done == {1, 2, 3}
    assert {one.behavior[:3] for one in said if isinstance(one, Method)} == {"B1_", "B2_"}
    assert len(memory.links)
    with pytest.raises(KnowledgeError):
        memory.teach(confab.load("moved-serving"), plan)


def test_the_page_of_a_memory_is_readable_and_an_edited_rule_changes_the_plan(
    tmp_path: Path, scene: confab.Scene
) -> None:
    memory, path = confab.Memory.of(scene), tmp_path / "memory.ttl"
    memory.teach(scene, scene.plan().plan)
    memory.save(path)
    assert "move movable to place" in memory.page()
    led, rules = (
        scene.plan(memory=path),
        [one for one in memory.experience.said.values() if isinstance(one, LearnedRule)],
    )
    move = next(rule for rule in rules if rule.does[0] == "B1_MOVE")
    text = path.read_text()
    assert f"m:{move.name} a owl:NamedIndividual, :LearnedRule ;" in text
    path.write_text(
        text.replace(
            f"m:{move.name} a owl:NamedIndividual, :LearnedRule ;", f"m:{move.name} :enabled false ; a :LearnedRule ;"
        )
    )
    without = confab.Memory.load(path, scene).advisor
    assert move not in without.rules
    assert led.solved
    wary = text.replace(f":does {text.split(':does ')[1].split(' ')[0]}", ":does <https://x.org/nothing>")
    path.write_text(wary)
    assert scene.plan(memory=path).solved


def test_a_scene_too_large_for_the_papers_links_teaches_counts_alone(
    scene: confab.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("confab.memory.MOST_LINKS", 10)
    told = CliRunner().invoke(app, ["learn", "beverage-serving", "--memory", str(tmp_path / "memory.ttl")])
    assert told.exit_code == 0, told.output
    assert "only rules were learned" in told.stderr
    memory = confab.Memory.load(tmp_path / "memory.ttl", scene)
    assert not len(memory.links)
    assert len(memory.experience)


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


def test_rules_of_a_step_that_failed_in_execution_are_counted_as_failed(scene: confab.Scene) -> None:
    memory = confab.Memory.of(scene)
    memory.teach(scene, scene.plan().plan)
    episode = scene.execute().episode
    failure = Failure(episode.planned.primitives[0], "slipped", (), "it slipped", episode.initial)
    memory.live(scene.problem, replace(episode, failures=(failure,), done=Plan(())))
    failed = {name for name, facts in memory.experience.totals().items() for t in facts.values() if t.failed}
    did = {
        one.does[0] for name, one in memory.experience.said.items() if name in failed and isinstance(one, LearnedRule)
    }
    assert did == {episode.planned.steps[0].behavior}


@pytest.mark.parametrize(
    "name", ["drums-small", "tour-small", "carts-small", "wishes-small", "library-small", "towers-small"]
)
def test_a_memory_of_a_world_is_saved_and_read_again(name: str, tmp_path: Path) -> None:
    """The worlds have constraints, remembered situations, totals, soft goals, and steps that are refined together."""
    world = confab.load(name)
    memory = confab.Memory.of(world)
    memory.teach(world, world.plan())
    memory.save(tmp_path / "memory.ttl")
    read = confab.Memory.load(tmp_path / "memory.ttl", world)
    assert read.experience == memory.experience
    assert read.page() == memory.page()
    assert unknown_terms(memory_lines(tmp_path / "memory.ttl"), world) == []


def test_an_episode_with_an_intervention_teaches_the_steps_that_were_executed_as_planned(tmp_path: Path) -> None:
    library, memory, saved = confab.load("library-small"), tmp_path / "new.ttl", tmp_path / "episode.json"
    disturbed = ["execute", "library-small", "--intervene", "after=0.7 atlas BOOK_AT desk", "-o", str(saved)]
    assert CliRunner().invoke(app, [*disturbed, "--memory", str(memory), "--learn"]).exit_code == 0

    def expansions(result: confab.Result) -> int:
        return sum(counts.expanded for counts in result.outcome.search.values())

    without, led = library.plan(), library.plan(memory=memory)
    assert led.plan.length == without.plan.length
    assert expansions(led) < expansions(without) / 2
    again = confab.Memory.of(library)
    again.live(library.problem, library.read_episode(saved).episode)
    assert again.experience.totals() == confab.Memory.load(memory, library).experience.totals()


def test_the_steps_before_an_intervention_teach_no_method_for_the_behaviour_that_was_stopped() -> None:
    drums = confab.load("drums-small")
    run = drums.execute(interventions="after=1.2 acid IN bay1")
    memory, stopped = confab.Memory.of(drums), run.plan.steps[1]
    assert [str(step) for step in stopped.steps] == [str(step) for step in run.episode.planned.steps[1].steps[:3]]
    assert memory.live(drums.problem, run.episode)
    learned = [[name for name, _ in one.steps] for one in memory.experience.said.values() if isinstance(one, Method)]
    assert [step.behavior for step in stopped.steps] not in learned != []


def test_commands_report_an_episode_that_teaches_nothing(tmp_path: Path) -> None:
    memory, episode = tmp_path / "memory.ttl", tmp_path / "episode.json"
    done = json.loads(CliRunner().invoke(app, ["execute", "beverage-serving", "--json"]).stdout)
    episode.write_text(json.dumps({**done, "steps": []}))
    learned = CliRunner().invoke(app, ["learn", "beverage-serving", "--memory", str(memory), "--episode", str(episode)])
    assert learned.exit_code == 1
    assert "nothing was learned: no step was executed as planned, and no behaviour failed" in learned.stderr


def test_a_memory_learns_from_a_result_that_has_its_scene(scene: confab.Scene) -> None:
    result = scene.plan()
    one, two = confab.Memory.of(scene), confab.Memory.of(scene)
    one.learn(result)
    two.learn(scene, result.plan)
    assert one.links == two.links
    with pytest.raises(
        TypeError, match="a result or an execution, which has its scene, or a scene and a plan; got Plan alone"
    ):
        one.learn(result.plan)  # type: ignore[arg-type]


def test_learning_keeps_the_finished_scenes_if_a_later_one_exceeds_the_time_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taught, teach = list[str](), confab.Memory.teach

    def slow(memory: confab.Memory, *given: Any) -> None:
        if taught:
            raise OutOfTimeError("gave up")
        taught.append("first")
        teach(memory, *given)

    monkeypatch.setattr(confab.Memory, "teach", slow)
    memory = tmp_path / "memory.ttl"
    told = CliRunner().invoke(app, ["learn", "beverage-serving", "--memory", str(memory), "--rounds", "2"])
    assert isinstance(told.exception, OutOfTimeError)
    assert confab.Memory.load(memory).experience.episodes
