"""Every search and every episode ends within its time limit, with the right answer if there is one."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import pytest

import confab
from confab.planner.acting import executive
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.generated import code
from confab.planner.grounded.joins import JoinTable
from confab.planner.grounded.reachability import Reached
from confab.planner.hierarchical.call import compiled
from confab.planner.hierarchical.unsolvability import impossible
from confab.planner.plan import Limits, Outcome, Plan, Status
from confab.planner.solve import Mode
from confab.reasoner.limits import OutOfTimeError, check, current, within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import TRUE, RelationCondition, SituationType
from worlds.writing import becomes, behavior, has, world

CASES = Path(__file__).parent / "cases"


@pytest.mark.parametrize("mode", ["guarded", "optimal"])
@pytest.mark.parametrize("name", ["h2", "full", "202470", "202991"])
def test_planning_of_goals_in_series_ends_after_a_replay_of_steps(name: str, mode: Mode) -> None:
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
    monkeypatch.setattr("confab.planner.acting.repair.repair", lambda *_: None)
    monkeypatch.setattr("confab.planner.acting.repair.replan", lambda *_: nothing)
    episode = executive.act(problem, SymbolicWorld(problem), Plan(()))
    assert episode.status.value == "gave-up"
    assert "planned 3 times in the same situation" in episode.reasons[0].text


def test_an_episode_ends_within_its_time_limit() -> None:
    problem = confab.load(CASES / "execute-without-end" / "isles-mid.ttl").problem
    begin = process_time()
    with within(0.0):
        episode = executive.act(problem, SymbolicWorld(problem))
    assert episode.status.value == "gave-up"
    assert process_time() - begin < 1.0


def test_blocks_of_limits_nest_and_the_earliest_deadline_counts() -> None:
    with within(60.0) as outer:
        with within(90.0) as inner:
            assert inner is outer
        with within(0.0), pytest.raises(OutOfTimeError, match="gave up after 0 s while resting"):
            check("resting")
        check("resting")
    assert current().left is None
    assert Limits().end() is None
    with within(10.0):
        assert 0.0 < (Limits(seconds=20.0).end(0.5) or 0.0) - perf_counter() <= 5.0


def test_a_join_beyond_the_deadline_is_not_begun() -> None:
    table = JoinTable(1, 4000)
    table.add(np.arange(4000).reshape(-1, 1))
    begin = process_time()
    with within(0.2), pytest.raises(OutOfTimeError):
        table.match((), table.rows, 20_000_000)
    assert process_time() - begin < 0.2


def test_a_chain_of_preconditions_may_be_longer_than_the_stack() -> None:
    """Each lamp needs the lamp before it; the first lamp needs a switch that doesn't exist."""
    lamps = [f"lamp{i}" for i in range(1500)]
    light = behavior(
        "LIGHT", 1, "?a:Lamp ?b:Lamp",
        [RelationCondition("after", ("?a", "?b")), has("LIT", "?a", TRUE)], [becomes("LIT", "?b", TRUE)],
    )  # fmt: skip
    problem = world(
        [SituationType("LIT", ("Lamp",), "Truth", boolean=True)], [light], {"Lamp": tuple(lamps)}, {},
        {f"LIT {lamps[-1]}": TRUE}, {"after": pairwise(lamps)},
    )  # fmt: skip
    assert impossible(problem) is not None


def test_a_compilation_that_would_pass_the_deadline_is_not_begun() -> None:
    begin = perf_counter()
    with within(0.1), pytest.raises(OutOfTimeError, match=r"gave up after 0\.1 s while compiling"):
        code("x = 1\n" * 200_000)
    assert perf_counter() - begin < 0.1


@pytest.mark.parametrize(
    "work", [compiled, lambda problem: Reached(problem, problem.domain.levels[-1], problem.initial, 10**6, None)]
)
def test_compiling_and_grounding_many_static_facts_end_by_the_deadline(work: Callable[[Problem], object]) -> None:
    problem = confab.load("two-cups").problem
    many = frozenset((str(i), str(j)) for i in range(100) for j in range(100))
    problem = replace(problem, relations={**problem.relations, "many": many})
    with within(0.0), pytest.raises(OutOfTimeError):
        work(problem)
