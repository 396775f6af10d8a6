"""Inputs that once caused faults cause none now, and neither does a sample of new inputs: each answer is a result or one line.

`make fuzz` runs all cases.
"""

import os
import random
import signal
from pathlib import Path

import pytest

from benchmarks import fuzz
from confab.planner.plan import Outcome, Reason, Status
from confab.planner.solve import Request


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    fuzz.sources(folder)
    return folder


@pytest.mark.parametrize("door", sorted({door for door, *_ in fuzz.known()}))
def test_inputs_that_once_caused_faults_cause_none(given: Path, door: str) -> None:
    seeds = [seed for where, seed, _ in fuzz.known() if where == door]
    assert [str(failure) for failure in fuzz.run_batch(door, seeds, given)] == []


@pytest.mark.parametrize("door", fuzz.DOORS)
def test_a_sample_of_new_inputs_causes_no_fault_at_any_entry_point(given: Path, door: str) -> None:
    share = 1 if door in ("bodies", "urdf", "meshes") else 2
    assert [str(failure) for failure in fuzz.run_batch(door, range(1_000_000, 1_000_000 + share), given)] == []


@pytest.mark.parametrize(
    ("replaced", "what"),
    [
        ("raise KeyError('seeded')", "exit 4"),
        ("print('Traceback (most recent call last)')", "a traceback"),
        ("import time; time.sleep(60)", "no end within"),
        ("while True: pass", "no end within"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "killed by signal 9"),
        ("open('scene.ttl', 'a').write('x')", "files changed: scene.ttl"),
        ("open('.confab-1.part', 'w').write('x')", "files changed: .confab-1.part"),
        ("import sys; sys.exit(2)", "exit 2 with 0 lines"),
    ],
)
def test_the_fuzzer_detects_each_kind_of_fault(
    given: Path, monkeypatch: pytest.MonkeyPatch, replaced: str, what: str
) -> None:
    monkeypatch.setattr("confab.commands.planning.load_scene", lambda *_: exec(replaced + "\nimport sys; sys.exit(0)"))
    monkeypatch.setattr(fuzz, "SECONDS", 1 if "while" in replaced else 30)
    monkeypatch.setattr(fuzz, "WAITING", 1 if "sleep" in replaced else 600)
    monkeypatch.setitem(fuzz.DOORS, "plan", (lambda _, folder: ["plan", str(folder / "scene.ttl"), "--diff", "x"], 1))
    failure = fuzz.run_case("plan", 0, given)
    assert failure is not None
    assert what in failure.what


def test_the_fuzzer_detects_an_invalid_plan(given: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.planner.validation.validate", lambda *_: ["seeded"])
    monkeypatch.setitem(fuzz.DOORS, "plan", (lambda _, folder: ["plan", str(folder / "scene.ttl"), "--json"], 1))
    failure = fuzz.run_case("plan", 0, given)
    assert failure is not None
    assert "no plan of what was read: seeded" in failure.what


def test_the_fuzzer_detects_a_wrong_unsolvable(given: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no(_: Request) -> Outcome:
        return Outcome(Status.UNSOLVABLE, reason=Reason("seeded"))

    monkeypatch.setattr("confab.plan_call.solve", no)
    monkeypatch.setattr(fuzz, "DOMAINS", ("ferry",))
    monkeypatch.setitem(fuzz.DOORS, "plan", (lambda _, folder: ["plan", str(folder / "scene.ttl"), "--json"], 1))
    failure = fuzz.run_case("plan", 0, given)
    assert failure is not None
    assert "unsolvable was said of what a search of all states solves" in failure.what


def test_the_fuzzer_runs_the_remaining_inputs_after_a_crash(given: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def crash(draw: random.Random, folder: Path) -> list[str]:
        if draw.random() < 0.5:
            os.kill(os.getpid(), signal.SIGKILL)
        return ["memory", "show", str(folder / "memory.ttl")]

    monkeypatch.setitem(fuzz.DOORS, "plan", (crash, 1))
    broke = list(fuzz.run_batch("plan", range(12), given))
    assert 0 < len(broke) < 12
    assert {failure.what for failure in broke} == {"killed by signal 9"}
