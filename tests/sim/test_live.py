"""A world in which people interfere: possible interventions, their effects, and the attribution of failures."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import confab
from confab.planner.acting.episode import Intervention, InterventionKind
from confab.planner.plan import Step
from confab.reasoner.symbols import Fact, Symbol
from confab.sim.faults import knocked
from confab.sim.live import LiveWorld
from confab.sim.world import PhysicsWorld

REACH = Step((0,), 8, 3, "B3_REACH_HAND_OBJECT", ("right_hand", "bottle1"), {"place": "location4"}, None, ())


@pytest.fixture
def live() -> Iterator[LiveWorld]:
    scene = confab.load("beverage-serving")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        yield LiveWorld(world, scene.problem.classes, scene.problem, "canReach")


def put(individual: str, place: str, **when: float) -> Intervention:
    return Intervention(InterventionKind.WORLD, (Fact(Symbol("LOCATION", (individual,)), place),), **when)  # type: ignore[arg-type]


def test_impossible_interventions_are_recognised_before_execution(live: LiveWorld) -> None:
    held = Intervention(InterventionKind.WORLD, (Fact(Symbol("HOLDS", ("left_hand",)), "cup1"),))
    assert live.impossible(put("cup1", "location6")) is None
    assert "which is no place" in str(live.impossible(put("cup1", "in_hand")))
    assert "interventions change BEVERAGE and LOCATION" in str(live.impossible(held))
    assert "no body of this world" in str(
        live.impossible(Intervention(InterventionKind.REMOVE, individual="left_hand"))
    )
    assert "has a shape" in str(live.impossible(Intervention(InterventionKind.ADD, individual="x", kind="Hand")))


def test_a_primitive_does_not_fail_because_a_person_moves_another_object(live: LiveWorld) -> None:
    live.announce((put("cup2", "location6", at=0.4),))
    assert live.execute(REACH).ok
    assert live.observe()[Symbol("LOCATION", ("cup2",))] == "location6"
    assert live.world.moved_by_others == set()


def test_a_primitive_is_interrupted_when_its_object_is_removed(live: LiveWorld) -> None:
    live.announce((Intervention(InterventionKind.REMOVE, individual="bottle1", at=0.4),))
    verdict = live.execute(REACH)
    assert (verdict.ok, verdict.code) == (False, "interrupted")
    seen = live.observe()
    assert Symbol("LOCATION", ("bottle1",)) not in seen
    assert Symbol("HAND_POSITION", ("right_hand",)) in seen  # the position has a name in any case


def test_interventions_on_a_removed_object_change_nothing(live: LiveWorld) -> None:
    gone = Intervention(InterventionKind.REMOVE, individual="cup1")
    for intervention in (gone, gone, put("cup1", "location6")):
        live.disturb(intervention)
    assert "cup1" not in live.world.bodies


def test_the_grasp_of_a_slipped_object_is_measured_again(live: LiveWorld) -> None:
    grasp = Step((1,), 29, 3, "B3_GRASP", ("right_hand",), {"object": "bottle1"}, None, ())
    nothing = Step((2,), 30, 3, "B3_PUT_DOWN", ("left_hand",), {"object": "cup1", "location": "location1"}, None, ())
    assert live.execute(REACH).ok
    assert live.execute(grasp).ok
    hand = live.world.hands["right_hand"]
    assert hand.grasp is not None
    rotation, base = hand.grasp
    hand.grasp = rotation, base + 0.05
    assert not live.execute(nothing).ok
    assert abs(hand.grasp[1] - base).max() < 0.005


def test_a_drawer_that_a_person_shuts_is_opened_again() -> None:
    """The hand is on its way to a jar in the drawer: the robot perceives that the drawer is shut, and the plan is repaired."""
    scene = confab.load("kitchen-corner")
    goals = ("jar LOCATION left_spot", "cup LOCATION shelf", "lid LOCATION right_spot")
    run = scene.execute(interventions="at=7 drawer OPENED false", world="pybullet", goals=goals)
    assert run.reached
    done = [event.step.behavior for event in run.episode.events]
    assert done.count("F3_OPEN") == 2
    assert done.count("F3_SHUT") == 1
    assert [change.kind for change in run.episode.replans] == ["repair"]


def test_a_hand_at_the_handle_of_a_drawer_that_a_person_shuts_returns_to_its_home_posture() -> None:
    """The hand lies on its side around the handle and can't turn there, so it draws back first."""
    scene = confab.load("kitchen-corner")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        live, opening = LiveWorld(world, scene.problem.classes), Step((0,), 0, 3, "F3_OPEN", ("right_hand", "drawer"))
        live.announce((Intervention(InterventionKind.WORLD, (Fact(Symbol("OPENED", ("drawer",)), "false"),), at=1.7),))
        assert live.execute(opening).code == "interrupted"
        assert live.observe()[Symbol("OPENED", ("drawer",))] == "false"
        hand = world.hands["right_hand"]
        assert abs(hand.measured() - hand.hand.home).max() < 0.03
        assert live.execute(opening).ok


LOCATION = {name: Symbol("LOCATION", (name,)) for name in ("cup1", "cup2", "bottle1", "box1")}


def handled(change: InterventionKind, individual: str, *numbers: float, place: str = "") -> Intervention:
    facts = (Fact(LOCATION[individual], place),) if place else ()
    return Intervention(change, facts, individual=individual, kind="Movable", numbers=numbers)


def test_an_object_beside_its_place_is_at_a_spot_that_the_same_hand_reaches(live: LiveWorld) -> None:
    live.disturb(handled(InterventionKind.PUSH, "cup2", 0.02, 0.08))
    assert live.observe()[LOCATION["cup2"]] == "spot1"
    (spot,) = live.discoveries()
    assert "Location" in spot.kinds
    assert ("canReach", ("left_hand", "spot1")) in spot.relations
    assert live.discoveries() == ()
    assert live.observe()[LOCATION["cup2"]] == "spot1"  # the spot isn't discovered twice
    live.disturb(handled(InterventionKind.PUSH, "cup2", -0.02, -0.08))
    assert live.observe()[LOCATION["cup2"]] == "location1"


def test_an_unknown_object_is_fixed_if_no_hand_opens_wide_enough(live: LiveWorld) -> None:
    live.disturb(handled(InterventionKind.BOX, "box1", 0.12, 0.12, 0.2, place="location7"))
    assert live.observe()[LOCATION["box1"]] == "location7"
    (box,) = live.discoveries()
    assert box.kinds == ("Movable",)
    assert "hands open to 10 cm" in box.fixed


def test_a_box_that_interrupts_a_primitive_is_seen_before_the_next_simulation_step(live: LiveWorld) -> None:
    box = handled(InterventionKind.BOX, "box1", 0.06, 0.06, 0.12, place="location7")
    live.announce((replace(box, at=0.03),))
    step = Step((0,), 0, 3, "B3_REACH_HAND_LOCATION", ("right_hand", "location7"))
    assert live.execute(step).code == "interrupted"
    assert live.observe()[LOCATION["box1"]] == "location7"


def test_a_lying_object_is_at_no_place_and_is_reported_as_lying(live: LiveWorld) -> None:
    live.disturb(handled(InterventionKind.KNOCK, "cup1"))
    assert LOCATION["cup1"] not in live.observe()
    assert live.why_unplaced("cup1").startswith("lies ")
    assert live.why_unplaced("cup2").startswith("stands ")
    assert live.execute(REACH).ok  # only the primitive during which the cup fell would fail because of it


def test_free_spots_on_the_table_are_within_reach_and_clear_of_places(live: LiveWorld) -> None:
    spots = live.free_spots()
    assert spots
    world = live.world
    for spot in spots:
        assert any(name == "canReach" for name, _ in spot.relations)
        point = world.place(spot.individual)
        others = [world.place(name) for name in world.embodiment.places if name not in {s.individual for s in spots}]
        assert min(float(np.linalg.norm(point - other)) for other in others) >= 0.1


def test_a_planted_timed_fault_happens_in_a_live_world() -> None:
    scene = confab.load("beverage-serving")
    with PhysicsWorld(scene.embodiment, scene.problem.initial, beads=False) as world:
        knocked("cup2", 0, 0.1)(world)
        live = LiveWorld(world, scene.problem.classes)
        assert live.execute(REACH).code == "toppled"
