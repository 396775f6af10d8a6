"""Hands with touch: they yield to contact with a finger, release a load when it stands, and perceive with noise."""

from dataclasses import replace

import numpy as np
import pytest

import confab
from confab.sim.attempt import Attempt
from confab.sim.engine import Engine
from confab.sim.faults import misaligned
from confab.sim.motion import line, pose_of
from confab.sim.urdf import Array
from confab.sim.verify import expectations, verify
from confab.sim.world import PhysicsWorld


@pytest.mark.parametrize("off", [(0.0, -0.004), (0.006, 0.0), (-0.006, 0.0)])
def test_a_hand_with_little_room_grasps_an_object_that_is_perceived_at_a_wrong_position(
    off: tuple[float, float],
) -> None:
    scene = confab.load("panda-serving")
    steps = scene.plan().plan.primitives[:3]
    expected = expectations(scene.problem, steps)
    rollout = verify(scene.embodiment, scene.problem.initial, steps, expected, beads=False, prepare=misaligned(off))
    assert [step.behavior for step in steps][-1] == "B3_LIFT"
    assert rollout.failure is None


def test_an_object_is_released_when_it_stands_even_if_the_table_is_lower_than_perceived() -> None:
    scene = confab.load("beverage-serving")
    steps = scene.plan().plan.primitives[:5]
    place = steps[3].arguments[-1]
    seem = scene.embodiment.places[place]
    higher = replace(seem, position=(*seem.position[:2], seem.position[2] + 0.006))
    embodiment = replace(scene.embodiment, places={**scene.embodiment.places, place: higher})
    heights: list[float] = []

    def watch(world: Engine) -> None:
        if world.current == 4 and not world.hands["left_hand"].closing:
            heights.append(float(world.truth("cup1")[1][2]))

    rollout = verify(
        embodiment, scene.problem.initial, steps, expectations(scene.problem, steps), beads=False, watch=watch
    )
    assert rollout.failure is None
    assert heights[0] == pytest.approx(seem.position[2], abs=0.003)


def test_the_perceived_position_of_a_resting_body_is_constant_and_averages_several_looks() -> None:
    scene = confab.load("beverage-serving")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False, noise=0.01) as world:
        assert np.array_equal(world.sense("cup1")[1], world.sense("cup1")[1])
        seen = []
        for _ in range(200):
            world.look()
            seen.append(world.sense("cup1")[1] - world.truth("cup1")[1])
        assert np.std(seen) == pytest.approx(0.01 / np.sqrt(6), rel=0.1)


def test_repeated_looks_at_a_mechanism_are_averaged() -> None:
    scene = confab.load("kitchen-corner")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False, noise=0.01) as world:
        seen = []
        for _ in range(300):
            for before in range(3):
                world.look(before)
            seen.append(world.shift(world.mechanics[0]))
        assert np.std(seen) == pytest.approx(0.01 / np.sqrt(18), rel=0.1)


def test_a_straight_line_blocked_by_the_elbow_is_followed_with_a_turning_elbow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = confab.load("panda-serving")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        attempt, driven = Attempt.begin(world, "gripper"), list[Array]()
        start = np.array([0.598, 0.359, 0.965, 0.412, 0.0, 0.0])
        goal = start - np.array([0.0, 0.0, 0.03, 0.0, 0.0, 0.0])
        reacher = attempt.reacher(margin=0.002)
        attempt.hand.posture = reacher.solve(start[None])[0][0]
        assert reacher.follow(line(start, goal)) is None
        monkeypatch.setattr(Attempt, "follow", lambda self, q, *_: driven.append(q))
        attempt.straight(goal, ())
        assert pose_of(attempt.hand.arm, driven[0][-1])[:5] == pytest.approx(goal[:5], abs=1e-4)
