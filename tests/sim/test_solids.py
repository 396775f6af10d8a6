"""Mechanisms and objects are solid: what is in one place with something else is found before physics moves it."""

from dataclasses import replace
from pathlib import Path

import pytest

import confab
from confab.reasoner.embodiment.solid_checks import through_a_solid
from confab.reasoner.embodiment.values import Embodiment, Link, Mechanism
from confab.reasoner.validation.validate import validate

WRONG = Path(__file__).parent / "wrong"


def findings(file: str) -> list[tuple[str, str]]:
    return [(finding.rule, finding.what) for finding in validate([WRONG / file]) if finding.serious]


def test_a_tray_that_stands_through_the_back_of_its_cabinet_is_refused_with_parts_millimetres_and_joint_value() -> None:
    said = "tray.floor (tray) is 29 mm inside cab.back (cab) where the joint of tray is at 0"
    assert findings("through.ttl") == [("through-a-solid", said)]


def test_blocks_that_overlap_at_first_are_refused_with_their_names_and_millimetres() -> None:
    assert findings("overlap.ttl") == [("overlapping-at-first", "a is 25 mm inside b at first")]


def changed(embodiment: Embodiment, name: str, **new: object) -> list[str]:
    """What is said of the mechanisms of a scene after a link has been changed."""

    def of(mechanism: Mechanism) -> Mechanism:
        links = tuple(replace(link, **new) if link.name == name else link for link in mechanism.links)  # type: ignore[arg-type]
        return replace(mechanism, links=links)

    return [
        what for _, what, _, _ in through_a_solid(replace(embodiment, mechanisms=tuple(map(of, embodiment.mechanisms))))
    ]


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


def test_a_link_behind_a_shut_neighbour_is_no_fault_since_the_neighbour_opens() -> None:
    embodiment = confab.load("kitchen-corner").embodiment
    cupboard = next(one for one in embodiment.mechanisms if one.name == "cupboard")
    (door,) = cupboard.links
    (tray_floor,) = (
        replace(part, name="tray.floor", size=(0.15, 0.2, 0.01), position=(0.0, 0.0, 0.0)) for part in door.parts[:1]
    )
    tray = Link(
        "tray", "prismatic", (tray_floor,), position=(0.0, 0.0, 0.1), axis=(-1.0, 0.0, 0.0), upper=0.15, opened=0.12
    )
    for upper in (1.8, 0.1):  # a door that hardly opens stays in the way
        case = replace(cupboard, links=(replace(door, upper=upper), tray))
        found = [what for _, what, _, _ in through_a_solid(replace(embodiment, mechanisms=(case,)))]
        assert bool(found) == (upper < 0.2), found
