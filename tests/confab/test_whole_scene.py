"""A plan that leaves is one of the whole scene, whatever was read of it for planning."""

from pathlib import Path

import pytest

import confab
from planner.plan import Status

CASES = Path(__file__).parent / "cases"
MODES = ("guarded", "strict", "optimal", "paper")


@pytest.mark.parametrize("mode", MODES)
def test_an_effect_on_a_class_asks_the_bounds_of_each_of_its_amounts(mode: str) -> None:
    result = confab.load(CASES / "lamps.ttl").plan(mode=mode)
    assert [step.behavior for step in result.plan.steps] == ["FILL", "BURN"]
    assert result.outcome.bound in (None, 2)


@pytest.mark.parametrize("mode", MODES)
def test_a_bound_that_nothing_can_keep_makes_the_task_unsolvable(mode: str) -> None:
    assert confab.load(CASES / "lamps-without-oil.ttl").plan(mode=mode).outcome.status is Status.UNSOLVABLE
