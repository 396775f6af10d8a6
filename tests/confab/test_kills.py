"""A process that writes a memory may be killed at any moment: no acknowledged episode is lost.

`python -m benchmarks.kills` kills more often.
"""

import random
from contextlib import nullcontext

import pytest

from benchmarks import kills
from confab.memory import Memory


@pytest.mark.parametrize("command", ["learn", "migrate"])
def test_a_kill_loses_no_acknowledged_episode(command: str) -> None:
    _, lost = kills.trial(5, command)
    assert lost == 0


def test_eight_concurrent_learners_lose_no_episode_if_one_is_killed() -> None:
    _, lost = kills.crowd(5)
    assert lost == 0


def test_the_benchmark_detects_a_lost_episode_after_a_kill(monkeypatch: pytest.MonkeyPatch) -> None:
    save = Memory.save

    def forgetful(memory: Memory, *target: object) -> object:
        memory.experience.episodes["me"] = 1
        return save(memory, *target)  # type: ignore[arg-type]

    monkeypatch.setattr(Memory, "save", forgetful)
    monkeypatch.setattr(random.Random, "uniform", lambda *_: 2.0)  # the process ends before it is killed
    _, lost = kills.trial(2, "learn")
    assert lost > 0


def test_the_benchmark_detects_a_lost_episode_among_eight_learners(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kills, "alone", lambda _: nullcontext())  # no process waits for another
    assert any(kills.crowd(3, seed)[1] > 0 for seed in range(5))  # whether two processes meet depends on the machine
