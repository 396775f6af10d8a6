"""Planted faults stop the plan at the expected primitive, with code, objects and number; benchmarks/faults.py plants them all."""

import pickle
from dataclasses import replace

import pytest

from benchmarks.faults import PLANTED, Planted, nominal
from confab.sim.faults import PLANTS
from confab.sim.rollouts import Trial
from confab.sim.verdict import CODES

from .conftest import Case

QUICK = [
    planted for planted in PLANTED if planted.step <= 3 and not planted.beads and planted.scene == "beverage-serving"
]
JOINTED = [planted for planted in PLANTED if planted.step == 0 and planted.scene == "kitchen-corner"]


@pytest.mark.parametrize("planted", QUICK, ids=[planted.kind for planted in QUICK])
def test_a_planted_fault_stops_the_plan_at_the_expected_step_with_the_expected_code(
    serving: Case, planted: Planted
) -> None:
    end = planted.step + 1
    trial = Trial(serving.embodiment, serving.initial, serving.steps[:end], serving.expected[:end])
    rollout = planted.run(trial)
    assert planted.found(rollout), rollout.failure


@pytest.mark.parametrize("planted", JOINTED, ids=[planted.kind for planted in JOINTED])
def test_a_planted_fault_of_a_mechanism_stops_its_first_primitive(planted: Planted) -> None:
    trial = nominal(planted.scene)
    rollout = planted.run(replace(trial, steps=trial.steps[:1], expected=trial.expected[:1]))
    assert planted.found(rollout), rollout.failure


def test_at_least_fifty_kinds_of_faults_are_planted_and_all_of_them_can_be_pickled() -> None:
    assert len({planted.kind for planted in PLANTED}) >= 50
    assert sum(planted.scene != "beverage-serving" for planted in PLANTED) >= 20
    assert {planted.fault.kind for planted in PLANTED} == PLANTS.keys()
    assert {planted.code for planted in PLANTED} <= CODES.keys()
    for planted in PLANTED:
        assert pickle.loads(pickle.dumps(planted.fault)) == planted.fault
