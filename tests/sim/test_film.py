"""The contents of a film: names of visible objects only, and a camera that sees the action."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

import confab
from confab.sim.faults import stranger
from confab.sim.film import BAR, Film, _points, _visible, _write_row
from confab.sim.picture import view_of
from confab.sim.world import PhysicsWorld

SCENE = confab.load("spice-drawer")
BLANK: Any = np.full((544, 960, 3), 255, np.uint8)


@pytest.fixture
def world() -> Iterator[PhysicsWorld]:
    with PhysicsWorld(SCENE.embodiment, SCENE.problem.initial, beads=False) as world:
        yield world


def test_a_film_shows_the_names_of_visible_objects_only(world: PhysicsWorld) -> None:
    film = Film("unwritten.mp4", SCENE.plan().plan.primitives)
    film.camera = view_of(SCENE.embodiment, film.width, film.height, BAR)
    named = film._named(BLANK, world)
    assert (named != BLANK).any()
    film.names = {"cup": "a cup with a name as long as half the picture"}  # the cup is in the shut cupboard
    assert (film._named(BLANK, world) == named).all()
    world.links["door"].set("door", True)
    film.names = {"jar": "a jar with a name as long as half the picture"}  # the jar is visible
    assert not (film._named(BLANK, world) == named).all()


def test_the_name_of_a_place_is_not_written_on_a_thing_in_front_of_the_place(world: PhysicsWorld) -> None:
    film = Film("unwritten.mp4", [])
    film.camera = camera = view_of(SCENE.embodiment, film.width, film.height, BAR)
    point, name = _points(world, "pot_top")[0]
    away = np.array(camera.eye) - point
    middle = point + 0.3 * away / np.linalg.norm(away)
    pictures = []
    for size, written in ((0.0, True), (0.06, False)):
        if size:
            stranger((middle[0], middle[1], middle[2] - size - 0.008), (0.01, size, size))(world)
        film.names = {}
        pictures.append(film._named(BLANK, world))
        film.names = {name: "spot"}
        assert (film._named(BLANK, world) != pictures[-1]).any() == written
        assert _visible(world, camera, point, name)


def test_the_camera_turns_to_a_side_on_which_the_handle_is_visible(world: PhysicsWorld) -> None:
    """From the other side of the table, the chest hides the drawer's handle."""
    film = Film("unwritten.mp4", [step for step in SCENE.plan().plan.primitives if "drawer" in step.arguments])
    first, handle = view_of(SCENE.embodiment, film.width, film.height, BAR), _points(world, "drawer")[0][0]
    world.current = 0
    film._turn_to_action(world)
    assert film.camera is not None
    assert not _visible(world, first, handle, "drawer")
    assert _visible(world, film.camera, handle, "drawer")


def test_the_caption_of_a_film_shows_the_primitive_after_long_names_of_steps() -> None:
    blank = Image.new("RGB", (960, 40), "white")
    _write_row(ImageDraw.Draw(blank), ["pour bottle 1 to cup 1; " * 9, "pour to cup 1", "tilt left hand"], 960, 10)
    pixels = np.asarray(blank)
    dark = np.argwhere((pixels < 90).all(axis=2))
    assert 800 < dark[:, 1].min() < dark[:, 1].max() < 950
