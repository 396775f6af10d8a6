from dataclasses import replace

from sim.reach import fingerprint, reach

from .conftest import Case


def test_reach_comes_out_of_the_robot_s_geometry(serving: Case) -> None:
    found = reach(serving.embodiment)
    for hand, places in (("left_hand", "123567"), ("right_hand", "234678")):
        assert {place for by, place in found.pairs if by == hand} == {f"location{i}" for i in places}


def test_a_table_that_stands_further_away_is_reached_less(serving: Case) -> None:
    places = serving.embodiment.places
    far = {n: replace(p, position=(p.position[0] + 0.12, *p.position[1:])) for n, p in places.items()}
    away = replace(serving.embodiment, places=far)
    assert reach(away).pairs < reach(serving.embodiment).pairs


def test_the_fingerprint_changes_with_what_reach_depends_on_and_with_nothing_else(serving: Case) -> None:
    body = serving.embodiment
    (name, place), *_ = body.places.items()
    moved = replace(body, places={**body.places, name: replace(place, position=(0.41, 0.44, 0.7))})
    turned = replace(body, robots=(replace(body.robots[0], yaw=0.01),))
    assert len({fingerprint(body), fingerprint(moved), fingerprint(turned)}) == 3
    repainted = {n: replace(b, servings=9.0) for n, b in body.bodies.items()}
    assert fingerprint(replace(body, bodies=repainted)) == fingerprint(body)
