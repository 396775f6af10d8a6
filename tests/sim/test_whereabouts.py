"""The position of a hand follows from its motions, in three dimensions: blocks are stacked as in the guide."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import confab
from confab.planner.plan import Step
from confab.reaching import with_reach
from confab.reasoner.symbols import Symbol
from confab.scene import Scene
from confab.sim.faults import displaced
from confab.sim.world import PhysicsWorld

POSITION = Symbol("HAND_POSITION", ("left_hand",))


def step(behavior: str, *arguments: str) -> Step:
    return Step((0,), 0, 3, behavior, ("left_hand", *arguments))


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    file = tmp_path_factory.mktemp("stack") / "stack.ttl"
    file.write_text((Path(__file__).parent / "right" / "stack.ttl").read_text(encoding="utf-8"), encoding="utf-8")
    return with_reach(confab.load(file))


@pytest.fixture
def world(stack: Scene) -> Iterator[PhysicsWorld]:
    with PhysicsWorld(stack.embodiment, stack.problem.initial) as world:
        yield world


def test_three_stacked_blocks_verify(stack: Scene) -> None:
    report = stack.plan().verify(rollouts=2, seed=4100, perturb=True)
    assert str(report).startswith("verified"), report


def test_a_hand_stopped_in_motion_is_at_no_named_place(world: PhysicsWorld) -> None:
    assert world.observe()[POSITION] == "raised"
    world.hands["left_hand"].limit = 1.0

    def stop(engine: object) -> None:
        if world.steps == 200:
            world.hands["left_hand"].deadline = 0

    world.disturb = stop
    assert world.execute(step("B3_REACH_HAND_OBJECT", "a")).code == "too slow"
    assert POSITION not in world.observe()


def test_a_hand_is_no_longer_at_an_object_that_has_been_moved(world: PhysicsWorld) -> None:
    assert world.execute(step("B3_REACH_HAND_OBJECT", "a")).ok
    assert world.observe()[POSITION] == "a"
    displaced("a", (0.0, 0.2))(world)
    assert POSITION not in world.observe()


def test_an_unstated_coordinate_of_a_carried_place_is_0(stack: Scene, world: PhysicsWorld) -> None:
    assert stack.embodiment.places["p4"].position == (0.0, 0.0, 0.095)
    np.testing.assert_allclose(world.place("p4")[:2], world.truth("b")[1][:2], atol=1e-4)
