"""`benchmarks.overrun` measures the overrun of every command and every call with a time limit."""

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from time import process_time

import pytest

import confab
from benchmarks.overrun import CALLS, COMMANDS, bakery
from confab import cli
from confab.scene import Scene

LIMIT, SLACK = 1.0, 1.5
SERVERS = {"serve"}
"""Commands whose time limit applies to a single query (`benchmarks.load`)."""


def test_every_command_with_a_time_limit_is_measured() -> None:
    limited = {
        name
        for name, (module, function) in cli.COMMANDS.items()
        if any(
            "--time-limit" in one.opts for one in getattr(import_module(f"confab.commands.{module}"), function).params
        )
    }
    assert len(limited) > 10
    assert limited - SERVERS == {words[0] for words in COMMANDS}


def test_every_call_with_a_time_limit_is_measured() -> None:
    limited = {
        name
        for public in (getattr(confab, name) for name in confab.__all__)
        if inspect.isclass(public)
        for name, method in inspect.getmembers(public, inspect.isfunction)
        if not name.startswith("_") and {"time_limit", "seconds", "limits"} & set(inspect.signature(method).parameters)
    }
    assert {"plan", "execute", "query"} <= limited
    assert {name for name in limited - SERVERS if not any(f".{name}(" in call for _, call in CALLS)} == set()


@pytest.mark.parametrize("call", [Scene.plan, Scene.execute, Scene.explain])
def test_scheduling_and_executing_in_time_end_by_the_time_limit(call: Callable[..., object], tmp_path: Path) -> None:
    file = tmp_path / "bakery.ttl"
    file.write_text(bakery(600), encoding="utf-8")
    scene = confab.load(file)
    begin = process_time()
    call(scene, time_limit=LIMIT)
    assert process_time() - begin < LIMIT + SLACK
