"""Mechanisms and objects are solid: overlaps are found before physics pushes the bodies apart."""

import re
from dataclasses import replace
from pathlib import Path

import pybullet
import pytest

import confab
from benchmarks import solids
from confab.reasoner.embodiment.solid_checks import through_a_solid
from confab.reasoner.embodiment.values import Embodiment, Link, Mechanism, Part
from confab.reasoner.validation.validate import validate
from confab.sim.staging import Perturbation
from confab.sim.world import PhysicsWorld

WRONG, RIGHT = (Path(__file__).parent / name for name in ("wrong", "right"))


def findings(file: str) -> list[tuple[str, str]]:
    return [(finding.rule, finding.what) for finding in validate([WRONG / file]) if finding.serious]


def test_a_tray_that_stands_through_the_back_of_its_cabinet_is_refused_with_parts_millimetres_and_joint_value() -> None:
    said = "tray.floor (tray) is 29 mm inside cab.back (cab) where the joint of tray is at 0"
    assert findings("through.ttl") == [("through-a-solid", said)]


def test_blocks_that_overlap_at_first_are_refused_with_their_names_and_millimetres() -> None:
    assert findings("overlap.ttl") == [("overlapping-at-first", "a is 25 mm inside b initially")]


def changed(embodiment: Embodiment, name: str, **new: object) -> list[str]:
    """Return the findings about the mechanisms of a scene after a link has been changed."""

    def of(mechanism: Mechanism) -> Mechanism:
        links = tuple(replace(link, **new) if link.name == name else link for link in mechanism.links)  # type: ignore[arg-type]
        return replace(mechanism, links=links)

    return [
        what for _, what, _, _ in through_a_solid(replace(embodiment, mechanisms=tuple(map(of, embodiment.mechanisms))))
    ]


def test_a_drawer_behind_a_door_that_counts_as_open_too_early_is_refused() -> None:
    embodiment = confab.load(RIGHT / "cupboard.ttl").embodiment
    (said,) = changed(embodiment, "door", opened=0.3)
    assert "inside door.panel (door) where the joint of drawer is at" in said
    assert said.endswith("whether door is shut or at 0.675, to which a hand opens it")


@pytest.mark.parametrize(
    ("scene", "link", "new", "said"),
    [
        ("kitchen-corner", "door", {"upper": 4.7}, "door.panel (door)"),
        ("kitchen-corner", "drawer", {"axis": (0.0, 1.0, 0.0)}, "drawer.bottom (drawer) is 65 mm inside drawers.left"),
        ("centrifuge", "cover", {"axis": (0.0, -1.0, 0.0)}, "cover.skirt (cover)"),
        ("centrifuge", "start", {"touches": ()}, "start.knob (start) is 8 mm inside centrifuge.panel"),
    ],
)
def test_a_joint_is_swept_against_its_case_and_its_neighbours(
    scene: str, link: str, new: dict[str, object], said: str
) -> None:
    embodiment = confab.load(scene).embodiment
    assert list(through_a_solid(embodiment)) == []
    assert any(said in what for what in changed(embodiment, link, **new)), changed(embodiment, link, **new)


def test_a_link_behind_a_shut_neighbour_is_no_fault_if_the_neighbour_opens() -> None:
    embodiment = confab.load("kitchen-corner").embodiment
    cupboard = next(one for one in embodiment.mechanisms if one.name == "cupboard")
    (door,) = cupboard.links
    (tray_floor,) = (
        replace(part, name="tray.floor", size=(0.15, 0.2, 0.01), position=(0.0, 0.0, 0.0)) for part in door.parts[:1]
    )
    tray = Link(
        "tray", "prismatic", (tray_floor,), position=(0.0, 0.0, 0.1), axis=(-1.0, 0.0, 0.0), upper=0.15, opened=0.12
    )
    for opened in (1.6, 0.1):  # a door that hardly opens stays in the way
        case = replace(cupboard, links=(replace(door, opened=opened), tray))
        found = [what for _, what, _, _ in through_a_solid(replace(embodiment, mechanisms=(case,)))]
        assert bool(found) == (opened < 0.2), found


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("through.ttl", "tray is 29 mm inside cab while the joints of cab are at 0"),
        ("overlap.ttl", "b is 25 mm inside a initially, at p2"),
    ],
)
def test_a_world_with_initially_overlapping_solids_is_refused(file: str, said: str) -> None:
    scene = confab.load(WRONG / file)
    with pytest.raises(ValueError, match=re.escape(said)):
        PhysicsWorld(scene.embodiment, scene.problem.initial)


def test_perturbed_objects_do_not_overlap_at_first() -> None:
    scene = confab.load(WRONG / "overlap.ttl")
    # 5 mm beside the other body, which may be turned
    p2 = replace(scene.embodiment.places["p2"], position=(0.42, 0.135, 0.7))
    embodiment = replace(scene.embodiment, places={**scene.embodiment.places, "p2": p2})
    for seed in range(5):
        with PhysicsWorld(embodiment, scene.problem.initial, seed, Perturbation()) as world:
            apart = pybullet.getClosestPoints(
                world.bodies["a"].body, world.bodies["b"].body, 0.05, physicsClientId=world.client
            )
            assert min(point[8] for point in apart) > -0.002


def test_a_drawer_does_not_slide_through_a_shut_door() -> None:
    scene = confab.load("kitchen-corner")
    cupboard = next(one for one in scene.embodiment.mechanisms if one.name == "cupboard")
    tray = Link("tray", "prismatic", (Part("tray.floor", "box", (0.12, 0.2, 0.01)),), upper=0.15, opened=0.12)
    tray = replace(tray, position=(0.0, 0.0, 0.1), axis=(-1.0, 0.0, 0.0))
    embodiment = replace(scene.embodiment, mechanisms=(replace(cupboard, links=(*cupboard.links, tray)),), places={})
    for opened in (False, True):
        with PhysicsWorld(replace(embodiment, perceivers={}), {}) as world:
            world.links["door"].set("door", opened)
            pull = {"controlMode": pybullet.VELOCITY_CONTROL, "targetVelocity": 0.3, "force": 5.0}
            joints, body = world.links["tray"].joints, world.links["tray"].body
            hold = {"controlMode": pybullet.VELOCITY_CONTROL, "targetVelocity": 0.0, "force": 50.0}
            pybullet.setJointMotorControl2(body, joints["door"], **hold, physicsClientId=world.client)
            pybullet.setJointMotorControl2(body, joints["tray"], **pull, physicsClientId=world.client)
            world.run(240)
            value = world.links["tray"].values()["tray"]
            assert (value > 0.1) == opened, value


def test_wrong_mutants_of_mechanisms_are_refused_and_harmless_mutants_are_accepted() -> None:
    wrong = harmless = 0
    for mutant in solids.mutants(seed=7):
        if mutant.depth >= solids.WRONG:
            assert mutant.refused, f"{mutant.scene}: {mutant.change}, {mutant.depth * 1000:.1f} mm"
            wrong += 1
        elif mutant.depth <= solids.HARMLESS:
            assert not mutant.refused, f"{mutant.scene}: {mutant.change}"
            harmless += 1
        if wrong >= 10 and harmless >= 5:
            break
