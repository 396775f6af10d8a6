"""A mobile base: it finds its path between objects, carries what the hands hold, and reports the obstacle that stops it."""

from dataclasses import replace

import numpy as np
import pybullet
import pytest

from confab.reasoner.embodiment.values import Embodiment, Fixture
from confab.sim.arms import hand_frames
from confab.sim.driving import drive
from confab.sim.staging import Perturbation
from confab.sim.verdict import SkillError
from confab.sim.verify import verify
from confab.sim.world import PhysicsWorld

from .conftest import case


@pytest.fixture(scope="module")
def tables() -> Embodiment:
    return case("two-tables").embodiment


def world(embodiment: Embodiment, *fixtures: Fixture, perturb: Perturbation | None = None) -> PhysicsWorld:
    """Return a world with the robot between its tables and more furniture."""
    more = replace(embodiment, fixtures=(*embodiment.fixtures, *fixtures))
    return PhysicsWorld(more, case("two-tables").initial, beads=False, perturb=perturb)


def test_a_mobile_robot_serves_from_two_tables() -> None:
    one = case("two-tables")
    assert sum(step.behavior == "D3_DRIVE" for step in one.steps) >= 4
    errand, promised = one.steps[:8], one.expected[:8]  # a cup is fetched from the sideboard and put on the table
    assert "location3" in promised[-1].values()
    rollout = verify(one.embodiment, one.initial, errand, promised, beads=False, perturb=Perturbation())
    assert rollout.failure is None
    assert dict(rollout.state) == dict(promised[-1])


def test_the_arms_use_the_measured_position_of_the_base(tables: Embodiment) -> None:
    with world(tables, perturb=Perturbation()) as here:
        drive(here, "two_arms", "aside")
        away = np.abs(here.bases["two_arms"].pose()[:2] - np.array([-0.8, 0.5])).max()
        assert 1e-4 < away < 0.011  # the base stops a little beside its stand, and perceives this
        for hand in here.hands.values():
            state = pybullet.getLinkState(hand.body, hand.tip, computeForwardKinematics=1, physicsClientId=here.client)
            found = hand_frames(hand.arm, hand.measured()[None])[1][0]
            assert np.allclose(found, state[4], atol=1e-5)


def test_a_mobile_base_drives_around_obstacles(tables: Embodiment) -> None:
    box = Fixture("box", (0.12, 0.12, 0.9), (-0.46, 0.28, 0.45))
    with world(tables, box) as here:
        drive(here, "two_arms", "aside")
        assert here.observe()[next(s for s in here.symbols if s.situation == "STANDS_AT")] == "aside"


def test_a_base_that_is_walled_in_is_refused_before_it_moves_and_the_walls_are_named(tables: Embodiment) -> None:
    fence = [Fixture(f"wall{i}", (0.04, 1.6, 1.0), (-0.55, 0.0, 0.5)) for i in range(1)]
    fence += [Fixture(f"side{i}", (1.4, 0.04, 1.0), (0.1, y, 0.5)) for i, y in enumerate((-0.8, 0.8))]
    with world(tables, *fence) as here:
        with pytest.raises(SkillError) as refused:
            drive(here, "two_arms", "aside")
        assert refused.value.verdict.code == "no path"
        assert {"two_arms", "aside"} < {*refused.value.verdict.objects}
        assert here.steps == 0


def test_an_unseen_wall_stops_a_mobile_robot_and_is_named(tables: Embodiment) -> None:
    with world(tables) as here:
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[0.3, 0.02, 0.5], physicsClientId=here.client
        )
        body = pybullet.createMultiBody(0, shape, basePosition=[-0.75, 0.35, 0.5], physicsClientId=here.client)
        here.names[body] = "hidden wall"
        with pytest.raises(SkillError) as stopped:
            drive(here, "two_arms", "aside")
    assert stopped.value.verdict.code == "tracking error"
    assert "hidden wall" in stopped.value.verdict.objects
