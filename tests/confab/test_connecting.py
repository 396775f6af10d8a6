"""Robots with a controller of their own: the protocol, the conformance test, interfaces as data, and a robot behind HTTP."""

import asyncio
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

import confab
from confab.connecting import connected
from confab.execution import Execution, execute
from confab.planner.acting.asynchronous import Synchronous
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.acting.world import INTERRUPTED, WorldReport
from confab.planner.plan import Step
from confab.reasoner.embodiment.interfaces import read_interface
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State, Symbol
from confab.scene import Scene
from confab.sim.robots.adapter import InterfaceWorld
from confab.sim.robots.http_transport import HttpRobot
from confab.testing import check_world
from confab.world_import import scene_of_graph, scene_text
from tests.sim.robot_server import Fault, Robot, interface, served

GOALS = ("ball THING_AT chest_inside", "chest OPEN false")
CATALOG = """<?xml version="1.0"?><catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
<uri name="https://example.org/rover" uri="rover.ttl"/></catalog>"""


@pytest.fixture(scope="module")
def rover(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Return the scene that the robot's world model describes, with its interface."""
    return confab.load(scene_file(tmp_path_factory.mktemp("rover"))).with_goal(*GOALS)


def scene_file(folder: Path) -> Path:
    """Write the scene that the robot's world model describes."""
    (folder / "rover.ttl").write_text(interface())
    (folder / "catalog-v001.xml").write_text(CATALOG)
    alone = confab.load(str(folder / "rover.ttl"))
    found = read_interface(alone.knowledge.store, alone.names.short, "rover")
    (folder / "scene.ttl").write_text(scene_text(found, Robot().model(), "scene", "Two rooms")[0])
    return folder / "scene.ttl"


@contextmanager
def acting(scene: Scene, fault: Fault, seconds: float = 5.0) -> Iterator[tuple[InterfaceWorld, Robot]]:
    """Yield the world of a served robot, whose actions may take some seconds, and the robot."""
    robot = Robot(fault)
    with served(robot) as address:
        world, _ = connected(scene, scene.problem, f"rover:{address}")
        calls = {name: replace(call, seconds=seconds) for name, call in world.interface.calls.items()}
        yield InterfaceWorld(replace(world.interface, calls=calls), HttpRobot(address), scene.problem), robot


def fine(action: str, arguments: dict[str, str]) -> str:
    return ""


def run(scene: Scene, fault: Fault, seconds: float = 5.0) -> tuple[Execution, Robot]:
    with acting(scene, fault, seconds) as (world, robot):
        return execute(scene, scene.problem, world=world), robot


# ------------------------------------------------------------------------------------------------------------- interfaces


def test_a_robot_is_driven_by_an_interface_that_is_described_in_turtle(rover: Scene) -> None:
    with served(robot := Robot()) as address:
        done = rover.execute(world=f"rover:{address}")
    assert done.reached
    assert robot.where["ball"] == "chest_inside"
    assert not robot.open["chest"]
    assert robot.called == len(done.episode.events)


def test_the_shapes_of_a_world_model_are_on_the_map(rover: Scene) -> None:
    shapes = [one for (one,) in rover.query("SELECT ?shape { :hall c:shape ?shape } ORDER BY ?shape").values()]
    assert shapes == ["POINT (1 2)", "POLYGON ((0 0, 4 0, 4 3, 0 3, 0 0))"]


def test_a_robot_that_keeps_to_the_protocol_passes_every_check(rover: Scene) -> None:
    with acting(rover, fine) as (world, _):
        found = check_world(world, rover.problem)
    assert found.passed, str(found)
    assert found["execution"].passed
    assert found["effects"].passed


def test_a_false_report_of_an_effect_is_detected_and_not_believed(rover: Scene) -> None:
    def lies(action: str, arguments: dict[str, str]) -> str:
        return "lie" if action == "grab" else ""

    with acting(rover, lies) as (world, _):
        found = check_world(world, rover.problem)
    assert not found.passed
    assert "B2_PICK" in found["effects"].found
    done, robot = run(rover, lies)
    assert not done.reached
    assert robot.where["ball"] == "shelf_top"
    assert all(fact.value != "rover" for fact in done.episode.course if fact.symbol.situation == "THING_AT")


def test_an_action_that_hangs_is_cancelled_at_its_time_limit(rover: Scene) -> None:
    hung: list[str] = []

    def hangs(action: str, arguments: dict[str, str]) -> str:
        hung.append(action)
        return "hang" if len(hung) == 2 else ""

    done, _ = run(rover, hangs, seconds=0.2)
    assert done.reached
    assert [failure.code for failure in done.episode.failures] == ["timed out"]


def test_the_deadline_of_a_call_stops_an_action_that_hangs(rover: Scene) -> None:
    plan = rover.plan().plan
    with acting(rover, lambda *_: "hang", seconds=60.0) as (world, robot), within(1.0):
        begin = time.monotonic()
        done = execute(rover, rover.problem, plan, world=world)
        assert time.monotonic() - begin < 5.0
        assert robot.cancelled.is_set()
    assert not done.reached


def test_invalid_answers_of_a_robot_are_failures_with_a_code(rover: Scene) -> None:
    for wrong, code in (("half", "no answer"), ("garbage", "unknown answer"), ("refuse", "refused")):
        once = iter([wrong])
        done, _ = run(rover, lambda *_, once=once: next(once, ""))
        assert done.reached
        assert [failure.code for failure in done.episode.failures] == [code]


def test_a_world_model_that_cannot_be_read_ends_the_episode_with_its_reason(rover: Scene) -> None:
    with acting(rover, fine) as (world, robot):
        robot.garbled = True
        done = execute(rover, rover.problem, world=world)
    assert not done.reached
    assert "no JSON" in done.summary()


def test_facts_of_the_world_model_with_unknown_names_are_left_out(rover: Scene) -> None:
    with acting(rover, fine) as (world, robot):
        robot.where["ball"] = "moon"
        robot.at = 17  # type: ignore[assignment]
        seen = {str(symbol): value for symbol, value in world.observe().items()}
    assert not any("ball" in symbol or "ROBOT_AT" in symbol for symbol in seen)
    assert any("book" in symbol for symbol in seen)


def test_actions_with_random_faults_never_hang_and_succeed_only_if_observed(rover: Scene) -> None:
    """Each verdict is compared with the robot's actions.

    A success is reported only if it is true, and all observed facts are true.
    """
    draw = random.Random(41)
    wrong = ["hang", "half", "lie", "garbage", "refuse"]
    behaviors = rover.problem.domain.at_level(2)
    faults: list[str] = []

    def faulty(action: str, arguments: dict[str, str]) -> str:
        faults.append(draw.choice([*wrong, *[""] * 10]))
        return faults[-1]

    codes = {"hang": "timed out", "half": "no answer", "garbage": "unknown answer", "refuse": "refused"}
    with acting(rover, faulty, seconds=0.2) as (world, robot):
        for number in range(120):
            behavior = draw.choice(behaviors)
            arguments = tuple(
                draw.choice(sorted(rover.problem.members(p.kind)) or ["none"]) for p in behavior.parameters
            )
            begin = time.monotonic()
            said = world.execute(Step((number,), 0, 2, behavior.name, arguments))
            assert time.monotonic() - begin < 5.0
            if faults[-1] in codes:
                assert (said.ok, said.code) == (False, codes[faults[-1]])
            seen = {str(symbol): value for symbol, value in world.observe().items()}
            assert seen["<ball, THING_AT>"].rpartition(":")[2] == robot.where["ball"]
            assert seen["<chest, OPEN>"] == str(robot.open["chest"]).lower()
    assert {*faults} == {*wrong, ""}


def test_an_episode_with_random_faults_reports_its_goal_as_reached_only_if_it_is(rover: Scene) -> None:
    draw = random.Random(41)
    for _ in range(3):
        done, robot = run(rover, lambda *_: draw.choice(["half", "lie", "refuse", *[""] * 12]))
        there = robot.where["ball"] == "chest_inside" and not robot.open["chest"]
        assert done.reached == there, done.summary()


def test_a_missing_interface_or_an_interface_without_an_action_is_refused_by_name(rover: Scene, tmp_path: Path) -> None:
    for on, said in (
        ("rovr:http://x", "did you mean 'rover'"),
        (":http://x", "INTERFACE:ADDRESS"),
        ("rover:ftp://x", "no address"),
    ):
        with pytest.raises(KnowledgeError, match=said):
            rover.execute(world=on)
    (tmp_path / "rover.ttl").write_text(interface().replace("e:carriesOut r:B2_PICK ;", "e:carriesOut r:B2_GRAB ;"))
    (tmp_path / "catalog-v001.xml").write_text(CATALOG)
    alone = confab.load(str(tmp_path / "rover.ttl"))
    with pytest.raises(KnowledgeError, match="#grab has neither a parameter"):
        connected(alone, alone.problem, "rover:http://127.0.0.1:1")


SKIROS = """@prefix s: <http://rvmi.aau.dk/ontologies/skiros.owl#> .
@prefix cora: <http://www.inf.ufrgs.br/phi-group/ontologies/cora.owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> . @prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
s:Room-1 a s:Room ; rdfs:label "hall" ; s:contain s:Shelf-4 . s:Room-2 a s:Room ; rdfs:label "den" ; s:contain s:Chest-5 .
s:Door-3 a s:Door ; rdfs:label "door" ; s:Open false ; s:adjacentLocation s:Room-1, s:Room-2 .
s:Shelf-4 a s:Location ; rdfs:label "shelf" ; s:Open true ; s:contain s:Ball-6 . s:Ball-6 a s:Ball ; rdfs:label "ball" .
s:Chest-5 a s:Location ; rdfs:label "chest" ; s:Open false .
cora:Robot-7 a cora:Robot ; rdfs:label "robi" ; s:at s:Room-1 ; s:BatteryPercentage "100"^^xsd:float ."""


def test_a_scene_of_another_ontology_is_imported_by_a_query_and_has_a_plan(tmp_path: Path) -> None:
    (tmp_path / "foreign.turtle").write_text(SKIROS)
    count = scene_of_graph(tmp_path / "foreign.turtle", "rooms-from-skiros.rq", tmp_path / "scene.ttl")
    assert count > 10
    result = confab.load(str(tmp_path / "scene.ttl")).plan(["Ball-6 THING_AT Chest-5", "Chest-5 OPEN false"])
    assert result.solved
    assert [step.behavior for step in result.plan.primitives].count("B2_OPEN_DOOR") == 1
    with pytest.raises(KnowledgeError, match="has no result"):
        (tmp_path / "empty.ttl").write_text("")
        scene_of_graph(tmp_path / "empty.ttl", "rooms-from-skiros.rq", tmp_path / "none.ttl")
    with pytest.raises(KnowledgeError, match="no query 'x'"):
        scene_of_graph(tmp_path / "foreign.turtle", "x", tmp_path / "none.ttl")


# ------------------------------------------------------------------------------------------------------------- the protocol


@dataclass
class Slow:
    """An asynchronous robot that changes symbols, and takes time for each change."""

    problem: Problem
    pause: float = 0.0

    def __post_init__(self) -> None:
        self.inner = SymbolicWorld(self.problem)
        self.ended = asyncio.Event()

    @property
    def seconds(self) -> float:
        return self.inner.seconds

    async def observe(self) -> State:
        return self.inner.observe()

    async def execute(self, step: Step) -> WorldReport:
        self.ended.clear()
        try:
            await asyncio.wait_for(self.ended.wait(), self.pause)
        except asyncio.TimeoutError:
            return self.inner.execute(step)
        return WorldReport(False, INTERRUPTED, step.arguments, "it was stopped")

    async def stop(self) -> None:
        self.ended.set()


def test_an_asynchronous_robot_acts_and_passes_every_check() -> None:
    scene = confab.load("beverage-serving")
    with Synchronous(Slow(scene.problem, 0.002)) as world:
        assert scene.execute(world=world).reached
    with Synchronous(Slow(scene.problem, 0.1)) as world:
        found = check_world(world, scene.problem, scene.plan().plan.primitives[:2])
    assert found.passed, str(found)
    assert "interrupted" in found["cancellation"].found


def test_the_deadline_stops_an_asynchronous_robot() -> None:
    scene = confab.load("beverage-serving")
    with Synchronous(Slow(scene.problem, 60.0)) as world:
        begin = time.monotonic()
        done = scene.execute(world=world, time_limit=1.0)
    assert time.monotonic() - begin < 5.0
    assert not done.reached


def test_ctrl_c_cancels_the_running_action(tmp_path: Path) -> None:
    robot = Robot(lambda *_: "hang")
    with served(robot) as address:
        script = (
            "import sys; from confab.cli import main; "
            f"main(['execute', sys.argv[1], '--on', 'rover:{address}', '--goal', 'ball THING_AT chest_inside'])"
        )
        command = [sys.executable, "-c", script, str(scene_file(tmp_path))]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
            while not robot.called and running.poll() is None:
                time.sleep(0.05)
            running.send_signal(signal.SIGINT)
            _, said = running.communicate(timeout=20)
    assert robot.called == 1
    assert robot.cancelled.is_set()
    assert running.returncode == 130
    assert "interrupted" in said


def test_interventions_are_refused_before_a_robot_moves(rover: Scene) -> None:
    with acting(rover, fine) as (world, robot), pytest.raises(KnowledgeError, match="in simulated worlds only"):
        execute(rover, rover.problem, world=world, interventions=["at=1 ball THING_AT chest_inside"])
    assert robot.called == 0


def test_an_unknown_observed_value_ends_the_episode_with_its_name() -> None:
    problem = confab.load("beverage-serving").problem

    class Odd(SymbolicWorld):
        def observe(self) -> State:
            return {**super().observe(), **odd}

    odd = {Symbol("LOCATION", ("cup1",)): "shelf"}
    done = confab.load("beverage-serving").execute(world=Odd(problem))
    assert not done.reached
    assert "<cup1, LOCATION> = shelf; which is no value of LOCATION (in_hand, location1, " in done.summary()
    odd = {Symbol("COLOUR", ("cup1",)): "red"}
    assert (
        "the scene has no situation type COLOUR"
        in confab.load("beverage-serving").execute(world=Odd(problem)).summary()
    )
    assert check_world(Odd(problem), problem)["symbols"].passed is False


def test_a_world_that_stays_stopped_or_always_fails_a_step_fails_the_conformance_test() -> None:
    problem = confab.load("beverage-serving").problem

    class Stopped(SymbolicWorld):
        still = False

        def execute(self, step: Step) -> WorldReport:
            return WorldReport(False, "interrupted") if self.still else super().execute(step)

        def stop(self) -> None:
            self.still = True

    assert check_world(Stopped(problem), problem)["cancellation"].passed is False

    class Clumsy(SymbolicWorld):
        def execute(self, step: Step) -> WorldReport:
            if step.behavior == "B3_GRASP":
                return WorldReport(False, "slipped", step.arguments)
            return super().execute(step)

    found = check_world(Clumsy(problem), problem)
    assert not found.passed
    assert "B3_GRASP left_hand, which failed 5 times: slipped" in found["execution"].found


def test_a_robot_that_ignores_a_cancellation_is_reported(rover: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.sim.robots.adapter.GRACE", 0.2)
    with acting(rover, lambda *_: "hang", seconds=60.0) as (world, _):
        monkeypatch.setattr(world.transport, "cancel", lambda: None)
        found = check_world(world, rover.problem)
    assert found["cancellation"].passed is False
    assert "not stopped" in found["cancellation"].found


def test_a_world_that_does_not_stop_or_whose_clock_runs_backwards_fails_the_conformance_test() -> None:
    problem = confab.load("beverage-serving").problem

    class Stubborn(SymbolicWorld):
        def execute(self, step: Step) -> WorldReport:
            time.sleep(0.4)
            return super().execute(step)

    found = check_world(Stubborn(problem), problem, stopped_within=0.1)
    assert found["cancellation"].passed is False

    class Backwards(SymbolicWorld):
        def observe(self) -> State:
            self.seconds -= 1.0
            return super().observe()

    assert check_world(Backwards(problem), problem)["clock"].passed is False
