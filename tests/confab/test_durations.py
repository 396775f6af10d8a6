"""Durations of primitives that a memory learns from executions: their statistics, the file, and their use in schedules."""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random

import pytest
from click.testing import CliRunner

import confab
from confab.cli import app, main
from confab.execution import Execution
from confab.memory import Memory
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.acting.world import WorldReport
from confab.planner.plan import Step
from confab.planning import Result
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.problem import Problem

SLOWER = {"left_hand": 1.0, "right_hand": 1.5}


class Robot(SymbolicWorld):
    """A robot whose primitives take 1 to 4 s, by up to 20 % more or less, and whose right hand is slower."""

    measured = True

    def __init__(self, problem: Problem, seed: int = 0, slower: Mapping[str, float] = SLOWER) -> None:
        super().__init__(problem)
        self.rng, self.slower = Random(seed), slower

    def execute(self, step: Step) -> WorldReport:
        slower = next(self.slower[one] for one in step.arguments if one in self.slower)
        true = Random(step.behavior).uniform(1, 4) * slower
        self._seconds_of[step.behavior] = true * self.rng.uniform(0.8, 1.2)
        return super().execute(step)


@cache
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


@cache
def planned() -> Result:
    return scene().plan(minimise="makespan")


@cache
def executed(seed: int) -> Execution:
    return scene().execute(planned(), world=Robot(scene().problem, seed))


def learned(seeds: range) -> Memory:
    memory = Memory.of(scene())
    for seed in seeds:
        memory.measure(scene().problem, executed(seed).episode)
    return memory


def test_the_command_that_writes_a_plan_into_a_file_prints_its_schedule(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = planned()
    monkeypatch.setattr("confab.planning.plan_by", lambda *_: found)
    with pytest.raises(SystemExit, match="0"):
        main(["plan", "beverage-serving", "--minimise", "makespan", "-o", str(tmp_path / "plan.json")])
    said = capsys.readouterr().out
    assert said.startswith(f"{tmp_path / 'plan.json'}: solved") and "\nmakespan " in said and "\nleft_hand" in said


def test_ten_episodes_predict_the_eleventh_within_its_spread() -> None:
    known = learned(range(10)).statistics
    events = executed(10).episode.events
    predicted = [known[event.step.behavior, event.step.arguments[0]] for event in events]
    errors = [event.end - event.begin - one.mean for event, one in zip(events, predicted, strict=True)]
    within = [abs(error) <= 2 * one.spread for error, one in zip(errors, predicted, strict=True)]
    assert sum(within) >= 0.9 * len(within)
    assert abs(sum(errors)) <= 2 * sum(one.spread**2 for one in predicted) ** 0.5


def test_the_speed_of_each_actor_is_learned_separately_and_used_in_the_schedule() -> None:
    memory = learned(range(10))
    known = memory.statistics
    both = {name for name, actor in known if actor == "left_hand" and (name, "right_hand") in known}
    ratios = [known[name, "right_hand"].mean / known[name, "left_hand"].mean for name in both]
    assert ratios == pytest.approx([1.5] * len(ratios), rel=0.15)
    timed = scene().plan(minimise="makespan", memory=memory, time_limit=1.5).timed
    assert timed is not None
    for slot in timed.slots:
        mean = known[slot.step.behavior, slot.actors[0]].mean
        assert float(slot.end - slot.begin) == pytest.approx(mean, abs=0.001)
    assert timed.least <= timed.bound <= timed.makespan


def test_durations_in_a_symbolic_world_are_assumed_and_not_learned() -> None:
    memory = Memory.of(scene())
    memory.measure(scene().problem, scene().execute(planned()).episode)
    assert not memory.statistics


def test_merged_memories_add_their_executions_whatever_the_order_and_number_of_merges() -> None:
    one, other, all_ = learned(range(3)), learned(range(3, 8)), learned(range(8))
    merged = Memory.of(scene())
    for memory in (other, one, other):
        merged.merge(memory, trust=True)
    assert merged.statistics.keys() == all_.statistics.keys()
    for key, its in merged.statistics.items():
        together = all_.statistics[key]
        assert its.count == together.count
        assert (its.mean, its.spread) == pytest.approx((together.mean, together.spread), abs=1e-4)


def test_durations_of_a_robot_that_is_not_trusted_are_not_used() -> None:
    memory = Memory.of(scene())
    memory.merge(learned(range(1)))
    assert not memory.statistics


def test_durations_survive_the_file_without_the_scene_too_and_disabled_ones_stay_unused(tmp_path: Path) -> None:
    memory, file = learned(range(3)), tmp_path / "memory.ttl"
    memory.save(file)
    alone = Memory.load(file)
    assert alone.statistics == Memory.load(file, scene()).statistics == memory.statistics
    alone.save(tmp_path / "again.ttl")
    assert Memory.load(tmp_path / "again.ttl", scene()).statistics == memory.statistics
    text = file.read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if "B3_GRASP by left_hand" in line)
    file.write_text(
        text.replace(line, line.replace(" ; :replica", " ; :enabled false ; :replica", 1)), encoding="utf-8"
    )
    changed = Memory.load(file, scene())
    assert memory.statistics.keys() - changed.statistics.keys() == {("B3_GRASP", "left_hand")}


def test_a_negative_statistic_is_found_by_validation_and_by_the_planner(tmp_path: Path) -> None:
    file, wrongs = tmp_path / "memory.ttl", {"mean": "-1.0", "spread": "-0.5", "count": "0"}
    learned(range(1)).save(file)
    whole = text = file.read_text(encoding="utf-8")
    for part, wrong in wrongs.items():
        file.write_text(re.sub(rf":{part} [\d.]+", f":{part} {wrong}", text, count=1), encoding="utf-8")
        with pytest.raises(KnowledgeError, match="broken memory"):
            Memory.load(file, scene())
        whole = re.sub(rf":{part} [\d.]+", f":{part} {wrong}", whole, count=1)
    file.write_text(whole, encoding="utf-8")
    assert [f.rule for f in confab.validate(file) if f.rule == "negative-statistic"] == ["negative-statistic"] * 3


def test_episodes_in_files_teach_durations_and_the_memory_shows_them(tmp_path: Path) -> None:
    files = [executed(seed).save(tmp_path / f"{seed}.json") for seed in (1, 2)]
    memory = str(tmp_path / "memory.ttl")
    given = [word for file in files for word in ("--episode", str(file))]
    run = CliRunner()
    assert run.invoke(app, ["learn", "beverage-serving", "--memory", memory, *given]).exit_code == 0
    assert "B3_GRASP by left_hand: " in run.invoke(app, ["memory", "show", memory]).output


def test_a_primitive_that_failed_teaches_no_duration() -> None:
    episode = executed(0).episode
    failed = replace(episode, events=tuple(replace(event, ok=False) for event in episode.events))
    memory = Memory.of(scene())
    memory.measure(scene().problem, failed)
    assert not memory.statistics
