"""The shipped scenes with their bodies, the primitives of their plans, and the expected states."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import pytest

import confab
from confab.planner.plan import Step
from confab.reasoner.embodiment.values import Embodiment
from confab.reasoner.symbols import State
from confab.sim.verify import expectations


@dataclass(frozen=True)
class Case:
    """The arguments of `confab.sim.verify.verify`."""

    embodiment: Embodiment
    initial: State
    steps: Sequence[Step]
    expected: Sequence[State]


@cache
def case(name: str) -> Case:
    scene = confab.load(name)
    steps = scene.plan(mode="paper").plan.primitives
    return Case(scene.embodiment, scene.problem.initial, steps, expectations(scene.problem, steps))


@pytest.fixture(scope="session")
def serving() -> Case:
    return case("beverage-serving")


@pytest.fixture(scope="session")
def moved() -> Case:
    return case("beverage-serving-moved")
