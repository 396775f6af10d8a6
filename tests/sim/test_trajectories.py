"""Trajectories as data: their format, and their replay by joint servos alone."""

import json
from pathlib import Path

import pytest

import confab
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.symbols import Symbol
from confab.sim.trajectory import Recorder, exported
from confab.sim.verify import expectations, verify
from confab.trajectories import trajectories, write_trajectories
from worlds.replaying import replay

yaml = pytest.importorskip("yaml")


def test_a_cup_is_moved_by_the_exported_joint_paths_alone(tmp_path: Path) -> None:
    scene = confab.load("beverage-serving")
    steps = scene.plan().plan.primitives[:6]
    recorder, now, slots = Recorder(), 0.0, []
    expected = expectations(scene.problem, steps)
    rollout = verify(scene.embodiment, scene.problem.initial, steps, expected, beads=False, watch=recorder)
    for report in rollout.steps:
        slots.append((report.step, now, now + report.seconds))
        now += report.seconds
    primitives = list(exported(scene.embodiment, recorder, slots))
    for file in (tmp_path / "six.json", tmp_path / "six.yaml"):
        write_trajectories(file, {"scene": scene.iri, "rate": 240.0, "primitives": primitives})
    as_yaml = yaml.safe_load((tmp_path / "six.yaml").read_text())
    assert as_yaml == json.loads((tmp_path / "six.json").read_text())

    (own,) = primitives[0]["hands"]
    goal = own["follow_joint_trajectory"]
    assert goal["trajectory"]["joint_names"] == list(scene.embodiment.hand(own["hand"])[1].arm)
    seconds = [
        p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] / 1e9 for p in goal["trajectory"]["points"]
    ]
    assert seconds == sorted(set(seconds))
    assert seconds[-1] <= primitives[0]["end"]
    efforts = [g["command"]["max_effort"] for p in primitives for hand in p["hands"] for g in hand["gripper"]]
    assert scene.embodiment.hand(own["hand"])[1].grip in efforts
    assert [g["object"] for p in primitives for hand in p["hands"] for g in hand["grasps"]] == ["cup1"]

    done = replay(scene.embodiment, scene.problem.initial, as_yaml["primitives"], beads=False)
    assert done.state[Symbol("LOCATION", ("cup1",))] == "location7"
    assert done.tracking < 0.005


def test_a_scene_whose_robot_drives_has_no_trajectories() -> None:
    with pytest.raises(KnowledgeError, match="drives"):
        trajectories(confab.load("two-tables"))
