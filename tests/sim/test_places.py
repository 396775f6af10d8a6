"""Places in holes, below shelves and in drawers behind doors: a load is put down and taken without other contact."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import confab
from confab.reaching import with_reach
from confab.scene import Scene
from confab.sim.attempt import Attempt
from confab.sim.faults import stranger
from confab.sim.rollouts import Trial
from confab.sim.running import SkillRun
from confab.sim.staging import Perturbation
from confab.sim.verdict import REFUTED, SkillError
from confab.sim.verify import expectations
from confab.sim.world import PhysicsWorld

RIGHT = Path(__file__).parent / "right"
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def scene(name: str, folder: Path) -> Scene:
    return with_reach(confab.load(shutil.copy(RIGHT / f"{name}.ttl", folder)))


@pytest.mark.parametrize(
    ("name", "noise", "seed"),
    [
        ("peg", 0.0, 4105),
        *[(name, 0.004, 4106) for name in ("peg", "shelf", "cupboard")],
        ("tray", 0.004, 4106),
        ("handover", 0.004, 4106),
        ("pots", 0.004, 4106),
        ("blocks", 0.004, 4106),
    ],
)
def test_perturbed_rollouts_verify(name: str, noise: float, seed: int, tmp_path: Path) -> None:
    one = scene(name, tmp_path)
    steps = one.plan().plan.primitives
    expected = expectations(one.problem, steps)
    trial = Trial(one.embodiment, one.problem.initial, steps, expected, Perturbation(), False, noise)
    rollout = trial.run(seed)
    assert rollout.ok, rollout.failure


def test_a_pot_that_carries_a_place_is_not_at_its_own_place_and_an_object_in_the_pot_is(tmp_path: Path) -> None:
    one = scene("pots", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial, 3, Perturbation()) as world:
        seen = {
            symbol.arguments[0]: value for symbol, value in world.observe().items() if symbol.situation == "LOCATION"
        }
    assert seen == {"pot_a": "p1", "pot_b": "p2", "pen": "in_a", "lid": "on_b"}


def test_a_board_above_a_place_stays_an_obstacle_of_a_load_that_leaves_the_place(tmp_path: Path) -> None:
    one = with_reach(confab.load(shutil.copy(EXAMPLES / "workshop" / "workshop.ttl", tmp_path)))
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        assert {part.rpartition(".")[2] for part in world.below("inside")} == {"left", "right", "back"}


def test_the_outer_fitting_is_opened_first_and_shut_last(tmp_path: Path) -> None:
    steps = scene("cupboard", tmp_path).plan().plan.primitives
    fittings = [(step.behavior, step.arguments[1]) for step in steps if step.behavior.startswith("F3")]
    assert fittings == [("F3_OPEN", "door"), ("F3_OPEN", "drawer"), ("F3_SHUT", "drawer"), ("F3_SHUT", "door")]


def test_a_load_is_clear_of_the_rim_before_it_enters_a_hole(tmp_path: Path) -> None:
    one = scene("peg", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        hand, rim = world.hands["left_hand"], 0.04
        for name, least in (("hole", rim), ("spot", 0.0)):
            height = world.clear_height(hand, "peg1", world.place(name), 0.02, 0.19)
            assert least + 0.008 < height < max(least, 0.02) + 0.025, name


def test_a_hand_lifts_to_the_height_that_the_board_above_leaves(tmp_path: Path) -> None:
    one = scene("shelf", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        for step in one.plan().plan.primitives[:3]:
            verdict = world.execute(step)
            assert verdict.ok, verdict
        assert step.behavior == "B3_LIFT"
        lifted = world.truth("jar1")[1] - world.place("under")
        assert 0.03 < lifted[2] < 0.24 - 0.09
        assert np.hypot(*lifted[:2]) < 0.02


def test_an_object_on_a_load_belongs_to_the_load_and_is_no_obstacle(tmp_path: Path) -> None:
    one = scene("tray", tmp_path)
    at = {"tray": "p1", "tin1": "s1", "tin2": "s2"}
    state = {
        s: at.get(s.arguments[0], value) if s.situation == "LOCATION" else value
        for s, value in one.problem.initial.items()
    }
    with PhysicsWorld(one.embodiment, state) as world:
        hand = world.hands["left_hand"]
        alone, laden = world.load_spheres(hand, "tin1"), world.load_spheres(hand, "tray")
        assert len(laden.radii) > 2 * len(alone.radii)
        assert not {"tray", "tin1", "tin2"} & {solid.name for solid in world.surroundings("left_hand", "tray").solids}
        assert {"tray", "tin2"} <= {solid.name for solid in world.surroundings("left_hand", "tin1").solids}


def test_profile_points_of_equal_height_keep_the_order_of_their_indices(tmp_path: Path) -> None:
    shape = scene("tray", tmp_path).embodiment.bodies["tray"].shape
    assert shape.profile == ((0.0, 0.13), (0.012, 0.13), (0.012, 0.012), (0.18, 0.012))


def test_an_unreachable_place_on_a_body_is_refuted_for_the_position_of_the_body(tmp_path: Path) -> None:
    one = scene("tray", tmp_path)
    steps = one.plan().plan.primitives
    taken = next(i for i, step in enumerate(steps) if step.arguments == ("left_hand", "tin1"))
    moved = {"p1": (0.61, -0.46, 0.7), "p3": (0.42, 0.05, 0.7)}
    places = {n: replace(p, position=moved.get(n, p.position)) for n, p in one.embodiment.places.items()}
    with PhysicsWorld(replace(one.embodiment, places=places), one.problem.initial) as world:
        *lifted, verdict = [world.execute(step) for step in steps[taken : taken + 4]]
    assert all(done.ok for done in lifted)
    assert verdict.code == "unreachable"
    assert "tray LOCATION p1" in map(str, verdict.facts)


def test_a_collision_is_reported_with_the_body_the_millimetres_and_the_phase(tmp_path: Path) -> None:
    one = scene("peg", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        stranger((0.42, 0.19, 0.7), (0.3, 0.06, 0.2))(world)
        verdict = world.execute(one.plan().plan.primitives[0])
    assert re.search(r"goal in collision: .*\d mm (inside|from) stranger in reach\.\w+, wanted 3 mm", str(verdict)), (
        verdict
    )


def test_all_bodies_that_block_a_hand_at_some_height_are_reported(tmp_path: Path) -> None:
    one = scene("shelf", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        stranger((0.5, 0.1, 0.7), (0.07, 0.3, 0.12))(world)
        verdict = world.execute(one.plan().plan.primitives[0])
    assert {"shelf", "stranger"} <= {*verdict.objects}, verdict


def test_a_place_of_the_load_is_no_place_for_the_load(tmp_path: Path) -> None:
    one = scene("stack", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        holding = replace(Attempt.begin(world, "left_hand"), held="b")
        run = SkillRun(holding, {"target": "p4"}, {})
        with pytest.raises(SkillError, match="p4 is a place of b, which the hand carries") as raised:
            run.at("target")
    assert raised.value.verdict.code in REFUTED


def test_motion_planning_uses_the_actual_width_of_a_box(tmp_path: Path) -> None:
    one = scene("stack", tmp_path)
    with PhysicsWorld(one.embodiment, one.problem.initial) as world:
        (block,) = [solid for solid in world.surroundings("left_hand").solids if solid.name == "a"]
        point = world.truth("a")[1] + np.array([0.05, 0.0, 0.05])
    assert block.distance(point) == pytest.approx(0.02, abs=1e-3)
