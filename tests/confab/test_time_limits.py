"""Every command with `--time-limit`, and every call inside `confab.within`, ends at its time limit."""

import gc
import json
import math
from collections.abc import Callable
from pathlib import Path
from threading import Timer
from time import perf_counter, process_time, sleep
from typing import Any

import click
import pytest
from click.testing import CliRunner

import confab
from confab.cli import COMMANDS, app
from confab.commands.given import warn_of_errors
from confab.commands.options import Seconds
from confab.execution import Execution
from confab.pddl_commands import import_pddl
from confab.planner.hierarchical import planner as hierarchical
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.shortening import shortened
from confab.planner.plan import Plan, Status
from confab.planning import Result
from confab.reasoner.generate import write_scene
from confab.reasoner.graph import query_process
from confab.reasoner.graph.knowledge import KnowledgeGraph
from confab.reasoner.graph.query_process import QueryLimits, _dumped
from confab.reasoner.limits import Deadline, LimitError, OutOfTimeError, current
from confab.reasoner.validation.findings import Finding
from confab.scene import Scene
from confab.terminal import GAVE_UP

SOON, SLACK = 0.1, 1.5
"""The time limit, and the CPU seconds in which a call must end, imports included; without a limit, each call takes longer."""
WITHOUT = {"scenes", "runs", "new", "fetch", "picture", "generate", "convert", "memory", "mcp"}
"""Commands that neither search nor simulate."""


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scenes") / "large.ttl"
    write_scene(file, "served", 1_600, 2, 0, 0)
    return file


@pytest.fixture(scope="module")
def solved(large: Path) -> Result:
    return confab.load(large).plan()


def test_every_command_that_works_long_takes_a_time_limit() -> None:
    without = set()
    for name in COMMANDS:
        command = app.get_command(click.Context(app), name)
        assert command is not None
        if not any(isinstance(option.type, Seconds) and "--time-limit" in option.opts for option in command.params):
            without.add(name)
    assert without == WITHOUT


@pytest.mark.parametrize(
    "words",
    [
        "plan SCENE", "plan SCENE --engine none", "plan SCENE --mode optimal", "plan SCENE --mode paper",
        "execute SCENE", "execute SCENE --mode paper", "explain SCENE", "explain SCENE --not WHAT",
        "learn SCENE --memory NEW.ttl", "query SCENE --affords all", "validate SCENE", "export SCENE -o NEW",
        "run SCENE -o NEW", "verify SCENE PLAN.json",
    ],
)  # fmt: skip
def test_a_command_ends_by_its_time_limit(words: str, large: Path, tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text(json.dumps({"steps": []}))
    put = {"SCENE": large, "WHAT": "cup1 LOCATION location3", "PLAN.json": tmp_path / "plan.json"}
    put |= {"NEW": tmp_path / "new", "NEW.ttl": tmp_path / "new.ttl"}
    begin = process_time()
    done = CliRunner().invoke(app, [*(str(put.get(word, word)) for word in words.split()), "--time-limit", f"{SOON}"])
    assert process_time() - begin < SLACK
    assert isinstance(done.exception, LimitError) or done.exit_code == GAVE_UP
    assert list(tmp_path.iterdir()) == [tmp_path / "plan.json"]


def test_the_import_of_a_large_pddl_problem_ends_by_its_time_limit(tmp_path: Path) -> None:
    domain, problem = tmp_path / "domain.pddl", tmp_path / "problem.pddl"
    domain.write_text("(define (domain d) (:predicates (p ?x)) (:action a :parameters (?x) :effect (p ?x)))")
    facts = "(p o) " * 300_000
    problem.write_text(f"(define (problem e) (:domain d) (:objects o) (:init {facts}) (:goal (p o)))")
    begin = process_time()
    with confab.within(SOON), pytest.raises(OutOfTimeError):
        import_pddl(domain, problem, tmp_path / "new.ttl")
    assert process_time() - begin < SLACK


@pytest.mark.parametrize(
    "call",
    [
        lambda scene, _: scene.plan(),
        lambda scene, _: scene.plan(mode="paper"),
        lambda scene, _: scene.plan(optimal=True),
        lambda scene, _: scene.execute(),
        lambda scene, _: scene.explain(),
        lambda scene, _: scene.affordances(),
        lambda scene, _: confab.load(scene.knowledge.path),
        lambda scene, _: confab.validate(scene.knowledge.path),
        lambda _, result: Result(result.scene, result.problem, result.outcome, {}).explain(),
        lambda _, result: result.why_not("cup1 LOCATION location3"),
        lambda scene, result: confab.Memory.of(scene).teach(scene, result),
        lambda scene, result: confab.Memory.of(scene).learn(scene, result),
    ],
)
def test_a_call_ends_by_the_limit_of_the_block_around_it(
    call: Callable[[Scene, Result], object], large: Path, solved: Result
) -> None:
    scene = solved.scene
    assert isinstance(scene, Scene)
    gc.collect()  # what earlier tests left isn't the call's time
    begin = process_time()
    with confab.within(SOON):
        try:
            found = call(scene, solved)
        except OutOfTimeError:
            found = None
    assert process_time() - begin < SLACK
    if isinstance(found, Result):
        assert found.outcome.status is Status.GAVE_UP
    if isinstance(found, Execution):
        assert found.episode.status.value == "gave-up"


def test_a_lesson_beyond_its_time_limit_adds_nothing_to_the_memory(solved: Result) -> None:
    memory = confab.Memory.of(solved.scene)
    with confab.within(SOON), pytest.raises(OutOfTimeError):
        memory.teach(solved.scene, solved)
    assert not memory.experience.episodes
    assert not len(memory.links)


def test_a_remark_on_superfluous_steps_ends_by_its_time_limit(solved: Result) -> None:
    with confab.within(0.0), pytest.raises(OutOfTimeError):
        solved.dearer()


def test_a_simulation_ends_by_its_time_limit() -> None:
    pytest.importorskip("pybullet")
    scene = confab.load("beverage-serving")
    result = scene.plan()
    begin = process_time()
    with pytest.raises(OutOfTimeError, match="while simulating"):
        scene.verify(result, 50, time_limit=1.0)
    assert process_time() - begin < 4.0


@pytest.mark.parametrize(
    "call",
    [
        lambda _, result: result.scene.plan(time_limit=60.0),
        lambda _, result: result.scene.execute(time_limit=60.0),
        lambda _, result: result.verify(time_limit=60.0),
        lambda limits, result: result.scene.query("ASK {}", limits=limits),
    ],
)
def test_the_limit_of_a_call_includes_its_first_checks(
    call: Callable[[QueryLimits, Result], object], solved: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[float] = []

    def first(_: object) -> None:
        held.append(current().seconds)
        raise InterruptedError

    monkeypatch.setattr(Scene, "settle", first)
    with pytest.raises(InterruptedError):
        call(QueryLimits(seconds=60.0), solved)
    assert held == [60.0]


def test_explaining_a_plan_is_within_the_limit_of_planning_it(monkeypatch: pytest.MonkeyPatch) -> None:
    held: list[float] = []
    explain = Result.explain

    def watched(result: Result) -> object:
        held.append(current().seconds)
        return explain(result)

    monkeypatch.setattr(Result, "explain", watched)
    confab.load("beverage-serving").explain(time_limit=60.0)
    assert held == [60.0]


def test_a_command_begins_no_quick_validation_shortly_before_its_time_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[object] = []

    def quick_errors(graph: KnowledgeGraph) -> list[Finding]:
        calls.append(graph)
        return []

    monkeypatch.setattr("confab.reasoner.validation.validate.quick_errors", quick_errors)
    confab.load("two-cups").save(tmp_path / "saved.ttl")
    loaded = confab.load(str(tmp_path / "saved.ttl"))
    for seconds, count in ((0.5, 0), (60.0, 1)):
        warn_of_errors(loaded, Deadline.after(seconds))
        assert len(calls) == count


@pytest.mark.parametrize("limit", ["5", math.nan])
def test_a_time_limit_of_a_block_that_is_no_number_is_refused(limit: float) -> None:
    with pytest.raises(TypeError, match="wanted seconds as a number"), confab.within(limit):
        pass


def test_the_time_limit_of_a_query_includes_sending_the_scene_to_its_process(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = list[float]()

    class Recorded(Timer):
        def __init__(self, seconds: float, function: Callable[[], None]) -> None:
            limits.append(seconds)
            super().__init__(seconds, function)

    def slowly(graph: KnowledgeGraph) -> bytes:
        sleep(0.2)
        return _dumped(graph)

    monkeypatch.setattr(query_process, "Timer", Recorded)
    monkeypatch.setattr(query_process, "_dumped", slowly)
    confab.load("beverage-serving").query("ASK {}", QueryLimits(seconds=30.0))
    assert limits[0] < 29.9


def test_the_last_part_of_the_time_limit_is_for_the_check_of_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = list[float]()

    def recorded(call: Call, *others: Any) -> Plan:
        assert call.space.deadline is not None
        ends.append(call.space.deadline)
        return shortened(call, *others)

    monkeypatch.setattr(hierarchical, "shortened", recorded)
    begin, limit = perf_counter(), 100.0
    assert confab.load("two-cups").plan(time_limit=limit, engine="none").solved
    assert begin + limit * 0.5 < ends[0] < begin + limit * 0.9
