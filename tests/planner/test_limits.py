"""Every search and every episode ends: with the right answer where there is one, and within its time."""

from pathlib import Path
from time import process_time

import pytest

import confab
from planner.acting import executive
from planner.acting.symbolic_world import SymbolicWorld
from planner.plan import Outcome, Plan, Status
from reasoner.limits import within

CASES = Path(__file__).parent / "cases"


@pytest.mark.parametrize("mode", ["guarded", "optimal"])
@pytest.mark.parametrize("name", ["h2", "full", "202470", "202991"])
def test_goals_in_series_notice_what_changed_after_the_steps_were_done_again(name: str, mode: str) -> None:
    result = confab.load(CASES / f"endless-{name}.ttl").plan(mode=mode)
    assert result.outcome.status is Status.SOLVED
    assert len(result.plan.primitives) == 2


@pytest.mark.parametrize("name", ["isles-mid", "cookery-mid"])
def test_an_episode_ends_when_a_goal_that_follows_from_rules_holds(name: str) -> None:
    episode = confab.load(CASES / "execute-without-end" / f"{name}.ttl").execute().episode
    assert episode.status.value == "reached"
    assert not episode.replans


def test_an_episode_in_which_planning_changes_nothing_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = confab.load(CASES / "endless-h2.ttl").problem
    nothing = (), Outcome(Status.SOLVED, Plan(()))
    monkeypatch.setattr(executive, "replan", lambda *_: nothing)
    episode = executive.act(problem, SymbolicWorld(problem), Plan(()), mending=False)
    assert episode.status.value == "gave-up"
    assert "planned 3 times in the same situation" in episode.reasons[0].text


def test_an_episode_ends_within_its_time() -> None:
    problem = confab.load(CASES / "execute-without-end" / "isles-mid.ttl").problem
    begin = process_time()
    with within(0.0):
        episode = executive.act(problem, SymbolicWorld(problem))
    assert episode.status.value == "gave-up"
    assert process_time() - begin < 1.0
