"""The main task in physics: correct plans are verified; of a wrong plan, the report names the step and the cause."""

import json
import sys
import time
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pybullet
import pytest
from rich.console import Console

import confab
from confab.authoring import new_domain
from confab.physics import Report, on_trust
from confab.planner.plan import Plan
from confab.reasoner.embodiment.reach import reach_hash
from confab.reasoner.symbols import Symbol
from confab.show import plan_tree, show
from confab.sim.faults import hidden_wall
from confab.sim.reach import fingerprint, reach
from confab.sim.verdict import SkillError, Verdict
from confab.sim.verify import Rollout


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


@pytest.fixture(scope="module")
def report(scene: confab.Scene) -> Report:
    return scene.plan().verify(seed=0)


def test_the_plan_verifies_and_both_cups_hold_most_of_the_beverage(report: Report) -> None:
    assert report.verified, report.summary()
    (rollout,) = report.rollouts
    assert len(rollout.steps) == 32
    assert len(rollout.poured) == 2
    assert min(rollout.poured) >= 0.8


def test_the_final_perceived_state_fulfils_the_goal(scene: confab.Scene, report: Report) -> None:
    seen = report.rollouts[0].state
    assert {symbol: seen[symbol] for symbol in scene.problem.goal} == scene.problem.goal


def test_the_same_seed_gives_the_same_rollout(scene: confab.Scene, report: Report) -> None:
    again = scene.plan().verify(seed=0).rollouts[0]
    assert _without_clock(again) == _without_clock(report.rollouts[0])


def test_a_wall_before_a_bottle_fails_at_its_step_with_code_object_and_number(scene: confab.Scene) -> None:
    failed = scene.plan().verify(seed=0, prepare=hidden_wall("bottle1"))
    assert not failed.verified
    failure = failed.rollouts[0].failure
    assert failure is not None
    assert str(failure.step) == "8 B3_REACH_HAND_OBJECT right_hand bottle1"
    assert (failure.verdict.code, failure.verdict.objects) == ("tracking error", ("hidden wall",))
    assert failure.verdict.measured
    assert json.loads(json.dumps(failed.json()))["status"] == "failed"
    assert "hidden wall" in failed.notes()[failure.step.path]


def test_a_failure_shows_expected_and_perceived_values_or_objects_and_numbers() -> None:
    told = "HAND_TILT of left_hand: expected upright, seen tilted"
    assert str(Verdict(False, "unexpected", ("left_hand", "upright", "tilted"), message=told)) == f"unexpected: {told}"
    lost = SkillError("slip or drop", ("jar1",), "it isn't in the hand").verdict
    assert str(lost) == "slip or drop: jar1, it isn't in the hand"
    blocked = SkillError("goal in collision", ("tray1", "jar1"), clearance_m=-0.0034).verdict
    assert str(blocked) == "goal in collision: tray1, jar1 (clearance_m -0.0034)"
    assert blocked.as_json()["message"] == "the hand or its load would touch something there"


def test_effects_without_a_perceiver_are_counted_as_taken_on_trust(scene: confab.Scene, report: Report) -> None:
    assert report.trusted == {}
    symbol = Symbol("GREETED", ("cup1",))
    assert on_trust(scene, [{**scene.problem.initial, symbol: "warmly"}]) == {"GREETED": 1}
    told = replace(report, trusted={"GREETED": 1}).summary()
    assert told.endswith("; on trust, since no perceiver reads the effects: 1 of GREETED")


def test_lines_are_complete_in_a_pipe_and_wrap_in_a_terminal(
    report: Report, capsys: pytest.CaptureFixture[str]
) -> None:
    path, told = report.plan.primitives[0].path, "goal in collision: " + "tray1, jar1 " * 20 + "(clearance_m -0.0034)"
    tree = plan_tree(report.plan, "[a title] " + "word " * 40 + "of search", {path: f"✗ {told}"})
    show(tree)
    piped = capsys.readouterr().out
    assert f"✗ {told}\n" in piped
    assert "[a title] word" in piped.splitlines()[0]
    assert piped.splitlines()[0].endswith("of search")
    file = StringIO()
    Console(file=file, force_terminal=True, color_system=None, width=60).print(tree, markup=False, highlight=False)
    wrapped = file.getvalue()
    assert max(map(len, wrapped.splitlines())) <= 60
    assert "-0.0034)" in wrapped
    assert "of search" in " ".join(wrapped.split("├")[0].split())


def test_a_plan_that_stops_before_the_goal_is_not_verified(scene: confab.Scene) -> None:
    first = Plan(scene.plan().plan.steps[:1])
    short = scene.verify(first)
    assert all(rollout.ok for rollout in short.rollouts)
    assert not short.verified
    assert "the goal isn't reached: " in short.summary()
    assert "cup2 LOCATION location5 (seen: location1)" in short.summary()


def test_a_behaviour_without_a_skill_is_refused_by_name(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    tearoom = confab.load(tmp_path / "tearoom-scene.ttl")
    with pytest.raises(confab.KnowledgeError, match="B1_CARRY names no skill"):
        tearoom.plan().verify()


def test_the_committed_reach_facts_fit_the_geometry() -> None:
    computed = ("beverage-serving", "beverage-serving-moved", "one-arm-serving", "panda-serving", "two-cups")
    for name in (
        *computed,
        "panda-pair-serving",
        "iiwa-serving",
        "xarm-serving",
        "two-tables",
        "kitchen-corner",
        "spice-drawer",
    ):
        shipped = confab.load(name)
        assert reach_hash(shipped.knowledge) == fingerprint(shipped.embodiment)
        if name in computed:
            assert shipped.problem.relations["canReach"] == reach(shipped.embodiment).pairs


def test_a_scene_that_is_symbolic_only_is_refused_by_name(tmp_path: Path) -> None:
    from confab.reasoner.generate import write_scene

    write_scene(tmp_path / "table.ttl", "served")
    symbolic = confab.load(tmp_path / "table.ttl")
    with pytest.raises(confab.KnowledgeError, match="symbolic only"):
        symbolic.plan().verify()


def _without_clock(rollout: Rollout) -> dict[str, object]:
    return {key: value for key, value in rollout.as_json().items() if key != "cpu_seconds"}


@pytest.mark.skipif(sys.platform != "linux", reason="other systems always have a screen")
@pytest.mark.parametrize(
    ("display", "said"), [(None, "DISPLAY isn't set"), (":987", "':987' doesn't answer|libX11 is missing")]
)
def test_a_window_without_a_screen_is_refused_in_one_line(
    display: str | None, said: str, scene: confab.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(confab.KnowledgeError, match=said) as error:
        scene.plan().verify(gui=True, video=tmp_path / "films" / "run.mp4")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "films").exists()


def test_a_screen_shows_the_simulation_no_faster_than_simulated_time(
    scene: confab.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a display, PyBullet's server refuses to draw; the requests to the server are recorded all the same."""
    from confab.sim.screen import Screen
    from confab.sim.world import PhysicsWorld

    written: list[str] = []

    def write(text: str, position: list[float], **options: object) -> int:
        written.append(text)
        return 7

    monkeypatch.setattr("confab.sim.screen.pybullet.addUserDebugText", write)
    monkeypatch.setattr("confab.sim.engine.pybullet.GUI", pybullet.DIRECT)
    begin = time.monotonic()
    with PhysicsWorld(
        scene.embodiment, scene.problem.initial, watch=Screen(("REACH", "GRASP"), 4.0), gui=True
    ) as world:
        for world.current in (0, 1):
            world.run(120)
        looks = [pybullet.getVisualShapeData(bead.body, physicsClientId=world.client)[0] for bead in world.beads]
    assert {look[2] for look in looks} == {pybullet.GEOM_SPHERE}
    assert written == ["REACH", "GRASP"]
    assert time.monotonic() - begin >= 0.24
