"""What broke once holds, and so does a share of new cases: each answer is a result or one line. All of them: `make fuzz`."""

from pathlib import Path

import pytest

from benchmarks import fuzz


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    fuzz.sources(folder)
    return folder


def test_the_cases_that_broke_once_hold(given: Path) -> None:
    assert [str(failure) for door, seed in fuzz.known() if (failure := fuzz.run_case(door, seed, given))] == []


@pytest.mark.parametrize("door", fuzz.DOORS)
def test_a_share_of_new_cases_holds_at_each_door(given: Path, door: str) -> None:
    assert [str(failure) for seed in range(1_000_000, 1_000_002) if (failure := fuzz.run_case(door, seed, given))] == []


@pytest.mark.parametrize(
    ("replaced", "what"),
    [
        ("raise KeyError('seeded')", "exit 4"),
        ("print('Traceback (most recent call last)')", "a traceback"),
        ("import time; time.sleep(60)", "no end within 1 s"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "killed by signal 11"),
        ("open('scene.ttl', 'a').write('x')", "files changed: scene.ttl"),
        ("open('.confab-1.part', 'w').write('x')", "files changed: .confab-1.part"),
        ("import sys; sys.exit(2)", "exit 2 with 0 lines"),
    ],
)
def test_each_way_to_break_is_seen(given: Path, monkeypatch: pytest.MonkeyPatch, replaced: str, what: str) -> None:
    monkeypatch.setattr("confab.cli._load", lambda *_: exec(replaced + "; import sys; sys.exit(0)"))
    monkeypatch.setattr(fuzz, "SECONDS", 1 if "sleep" in replaced else 30)
    monkeypatch.setitem(fuzz.DOORS, "plan", lambda _, folder: ["plan", str(folder / "scene.ttl"), "--diff", "x"])
    failure = fuzz.run_case("plan", 0, given)
    assert failure is not None
    assert what in failure.what


def test_a_plan_that_is_none_is_seen(given: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.validation.validate", lambda *_: ["seeded"])
    monkeypatch.setitem(fuzz.DOORS, "plan", lambda _, folder: ["plan", str(folder / "scene.ttl"), "--json"])
    failure = fuzz.run_case("plan", 0, given)
    assert failure is not None
    assert "no plan of what was read: seeded" in failure.what
