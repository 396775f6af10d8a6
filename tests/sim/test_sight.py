"""Visibility: objects under a lid or behind a door are believed to be at their last places until they are uncovered."""

from dataclasses import replace
from functools import cache

import pytest

import confab
from confab.physics import Report
from confab.planner.acting.episode import Intervention, InterventionKind
from confab.planner.plan import Plan
from confab.reasoner.embodiment.values import Embodiment, Mechanism, Part, PerceiverUse, Place
from confab.reasoner.symbols import Fact, Symbol
from confab.scene import Scene
from confab.sim.faults import displaced
from confab.sim.interventions import take_away
from confab.sim.live import LiveWorld
from confab.sim.perception import observe_covered
from confab.sim.verdict import SkillError
from confab.sim.verify import Rollout, verify
from confab.sim.world import PhysicsWorld

CUP, JAR, LID = (Symbol("LOCATION", (name,)) for name in ("cup", "jar", "lid"))


@cache
def kitchen() -> Scene:
    return confab.load("kitchen-corner")


def set_joint(world: PhysicsWorld, link: str, opened: bool) -> None:
    """Open or shut a link at once, with everything that it carries."""
    live = LiveWorld(world, {})
    live.disturb(Intervention(InterventionKind.WORLD, (Fact(Symbol("OPENED", (link,)), str(opened).lower()),)))


def covered(world: PhysicsWorld, name: str) -> str | None:
    return observe_covered(world, PerceiverUse("COVERED", "perceive_covered"), (name,))


def with_hollow_pot() -> Embodiment:
    """Return the kitchen with a hollow pot that can cover the jar; the pot is slightly higher than the jar."""
    sides = ((0.065, 0.0, 0.01, 0.14), (-0.065, 0.0, 0.01, 0.14), (0.0, 0.065, 0.14, 0.01), (0.0, -0.065, 0.14, 0.01))
    walls = (Part(f"wall{i}", "box", (dx, dy, 0.14), (x, y, 0.07)) for i, (x, y, dx, dy) in enumerate(sides))
    body = kitchen().embodiment
    furniture = tuple(one for one in body.mechanisms if one.name != "pot")
    pot = Mechanism("pot", (0.6, 0.0, 0.7), 0.0, tuple(walls), ())
    places = {"pot_top": Place("pot_top", (0.0, 0.0, 0.14), "pot"), "in_pot": Place("in_pot", (0.0, 0.0, 0.0), "pot")}
    return replace(body, mechanisms=(*furniture, pot), places={**body.places, **places})


def test_an_object_in_a_shut_cupboard_is_believed_and_perceived_after_the_door_opens() -> None:
    with PhysicsWorld(kitchen().embodiment, kitchen().problem.initial) as world:
        state = world.observe()
        assert state[CUP] == "shelf"
        assert Fact(CUP, "shelf") in world.believed(state)
        assert covered(world, "cup") == "true"
        assert covered(world, "lid") == "false"
        set_joint(world, "door", True)
        assert world.believed(world.observe()) == ()
        assert covered(world, "cup") == "false"


def test_an_object_under_a_lid_is_believed_and_perceived_after_the_lid_is_removed() -> None:
    initial = {**kitchen().problem.initial, JAR: "in_pot", LID: "pot_top"}
    with PhysicsWorld(with_hollow_pot(), initial) as world:
        assert not world.perceives("jar")
        assert world.observe()[JAR] == "in_pot"
        displaced("lid", (-0.2, -0.1))(world)
        world.run(60)
        assert world.perceives("jar")
        assert world.observe()[JAR] == "in_pot"


def test_the_believed_position_of_an_object_moves_with_its_drawer_and_is_perceived_when_it_is_open() -> None:
    body = replace(kitchen().embodiment, cameras=((0.62, -0.4, 2.0),))
    with PhysicsWorld(body, kitchen().problem.initial) as world:
        assert not world.perceives("jar")
        before = world.sense("jar")[1]
        set_joint(world, "drawer", True)
        assert world.perceives("jar")
        shift = world.sense("jar")[1] - before
        assert shift == pytest.approx([-0.17, 0.0, 0.0], abs=0.01)
        set_joint(world, "drawer", False)
        assert not world.perceives("jar")
        assert world.sense("jar")[1] == pytest.approx(before, abs=0.005)
        assert world.observe()[JAR] == "compartment"


def test_a_removed_hidden_object_is_believed_to_be_there_until_its_place_is_uncovered() -> None:
    with PhysicsWorld(kitchen().embodiment, kitchen().problem.initial) as world:
        take_away(world, "cup")
        assert world.observe()[CUP] == "shelf"
        set_joint(world, "door", True)
        assert CUP not in world.observe()
        with pytest.raises(SkillError, match="nowhere to be seen"):
            world.sense("cup")


def test_a_motion_within_a_shut_cupboard_is_perceived_when_the_door_opens() -> None:
    with PhysicsWorld(kitchen().embodiment, kitchen().problem.initial) as world:
        displaced("cup", (0.0, -0.07))(world)
        world.run(30)
        assert world.observe()[CUP] == "shelf"
        believed = world.sense("cup")[1]
        set_joint(world, "door", True)
        assert world.sense("cup")[1] - believed == pytest.approx([0.0, -0.07, 0.0], abs=0.005)


def test_a_plan_stops_when_an_opened_door_shows_that_a_belief_is_wrong() -> None:
    scene = kitchen()
    steps = scene.plan().plan.primitives[:1]
    assert steps[0].behavior == "F3_OPEN"
    rollout = verify(
        scene.embodiment,
        scene.problem.initial,
        steps,
        [{**scene.problem.initial, Symbol("OPENED", ("door",)): "true"}],
        prepare=lambda world: take_away(world, "cup"),
    )
    failure = rollout.failure
    assert failure is not None
    assert failure.verdict.message == "BEVERAGE of cup: expected no_beverage, seen no value"
    assert CUP not in rollout.state


def test_the_report_on_a_hidden_goal_says_that_it_was_not_seen() -> None:
    scene = kitchen()
    plan = Plan(())
    with PhysicsWorld(scene.embodiment, scene.problem.initial) as world:
        state = world.observe()
        rollout = Rollout(0, True, (), (), 1.0, 1.0, state, believed=world.believed(state))
    assert "; not seen in the end, believed: cup LOCATION shelf" in Report(plan, {CUP: "shelf"}, (rollout,)).summary()
    assert "believed" not in Report(plan, {LID: "right_spot"}, (rollout,)).summary()
    assert rollout.as_json()["believed"] == ["cup BEVERAGE no_beverage", "cup LOCATION shelf"]
