from dataclasses import replace

from confab.reasoner.embodiment.values import Embodiment, Fixture, Place
from confab.sim.reach import fingerprint, hindrance, reach

from .conftest import Case, case


def test_reach_follows_from_the_geometry_of_the_robot(serving: Case) -> None:
    found = reach(serving.embodiment)
    for hand, places in (("left_hand", "123567"), ("right_hand", "234678")):
        assert {place for by, place in found.pairs if by == hand} == {f"location{i}" for i in places}


def test_a_table_that_stands_further_away_is_reached_less(serving: Case) -> None:
    places = serving.embodiment.places
    far = {n: replace(p, position=(p.position[0] + 0.12, *p.position[1:])) for n, p in places.items()}
    away = replace(serving.embodiment, places=far)
    assert reach(away).pairs < reach(serving.embodiment).pairs


def test_the_fingerprint_of_reach_changes_exactly_with_its_inputs(serving: Case) -> None:
    body = serving.embodiment
    (name, place), *_ = body.places.items()
    moved = replace(body, places={**body.places, name: replace(place, position=(0.41, 0.44, 0.7))})
    turned = replace(body, robots=(replace(body.robots[0], yaw=0.01),))
    assert len({fingerprint(body), fingerprint(moved), fingerprint(turned)}) == 3
    repainted = {n: replace(b, servings=9.0) for n, b in body.bodies.items()}
    assert fingerprint(replace(body, bodies=repainted)) == fingerprint(body)


def test_the_hindrance_of_a_place_is_named_with_stage_object_and_height(serving: Case) -> None:
    name = "location5"
    assert hindrance(serving.embodiment, name) == (
        "right_hand: 9.9 cm out of reach when grasping cup1, 50 mm above its base",
    )
    for height, missing in ((0.19, 26), (0.2, 16)):
        assert hindrance(below_a_lamp(serving, height), name)[0] == (
            f"left_hand: lamp is in the way by {missing} mm when lifting bottle1, 75 mm above its base"
        )


def test_the_hindrance_of_a_place_in_a_mechanism_is_named_with_the_part() -> None:
    body = case("kitchen-corner").embodiment
    low = replace(body, places={**body.places, "shelf": replace(body.places["shelf"], height=0.02)})
    assert hindrance(low, "shelf")[0] == "left_hand: cupboard.bottom (cupboard) is in the way by 13 mm when grasping"


def test_a_hand_reaches_a_place_below_a_solid_if_there_is_room_for_the_lifted_load(serving: Case) -> None:
    assert ("left_hand", "location5") in reach(below_a_lamp(serving, 0.25)).pairs
    assert ("left_hand", "location5") not in reach(below_a_lamp(serving, 0.2)).pairs


def test_a_place_on_a_movable_body_is_reached_if_it_is_reached_above_some_place(serving: Case) -> None:
    body, on = serving.embodiment, Place("on_cup1", (0.0, 0.0, 0.1), "cup1")
    higher = Place("on_cup2", (0.0, 0.0, 0.1), "cup2")
    two = replace(body, places={**body.places, "on_cup1": on, "on_cup2": higher})
    own = {(hand, place) for hand, place in reach(two).pairs if place.startswith("on_")}
    assert own == {(hand, place) for hand in ("left_hand", "right_hand") for place in ("on_cup1", "on_cup2")}
    away = replace(two, places={**two.places, "on_cup1": replace(on, position=(0.9, 0.0, 0.1))})
    assert {place for _, place in reach(away).pairs if place.startswith("on_")} == {"on_cup2"}


def test_a_height_without_a_possible_grasp_excludes_no_place(serving: Case) -> None:
    body, cup = serving.embodiment, serving.embodiment.bodies["cup1"]
    flat = replace(cup, name="coin", shape=replace(cup.shape, grasp_height=0.01))
    assert reach(replace(body, bodies={**body.bodies, "coin": flat})).pairs == reach(body).pairs


def below_a_lamp(serving: Case, height: float) -> Embodiment:
    """Return the embodiment with a board of 2 cm whose middle is `height` above location5; a bottle is 16 cm high."""
    x, y, z = serving.embodiment.places["location5"].position
    lamp = Fixture("lamp", (0.5, 0.5, 0.02), (x, y, z + height))
    return replace(serving.embodiment, fixtures=(*serving.embodiment.fixtures, lamp))
