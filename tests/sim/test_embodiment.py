import pyoxigraph as ox
import pytest

from confab.reasoner.embodiment.facts import EmbodimentError
from confab.reasoner.embodiment.reading import read_embodiment
from confab.reasoner.graph.knowledge import load
from confab.reasoner.names import local_name

from .conftest import Case

E = "https://w3id.org/confab/embodiment#"
BODIES = "https://w3id.org/confab/tabletop-bodies#"


def test_the_bodies_of_a_scene_are_read(serving: Case) -> None:
    body = serving.embodiment
    assert list(body.bodies) == ["bottle1", "bottle2", "cup1", "cup2"]
    assert body.bodies["cup1"].shape.profile == ((0.0, 0.031), (0.09, 0.037))
    assert list(body.places)[:2] == ["location1", "location2"]
    assert [hand.name for robot in body.robots for hand in robot.hands] == ["left_hand", "right_hand"]
    assert list(body.fillings) == ["beverage1", "beverage2"]


def test_every_primitive_names_its_skill_and_the_roles_of_its_terms(serving: Case) -> None:
    skills = serving.embodiment.skills
    assert {step.behavior for step in serving.steps} <= set(skills)
    reach = skills["B3_REACH_HAND_OBJECT"]
    assert (reach.skill, reach.parameters) == ("reach", ("hand", "target"))
    tilt = skills["B3_TILT"]
    assert (tilt.parameters, tilt.variables) == (("hand",), {"source": "source", "target": "target"})


def test_every_situation_type_of_the_scene_has_a_perceiver(serving: Case) -> None:
    assert {symbol.situation for symbol in serving.initial} == set(serving.embodiment.perceivers)
    assert serving.embodiment.perceivers["LOCATION"].values == {"in_hand": "in_hand"}


def changed(subject: str, name: str, value: ox.Literal | None) -> ox.Store:
    """The shipped scene with one attribute removed or replaced."""
    store = load("beverage-serving").store
    for quad in list(store.quads_for_pattern(ox.NamedNode(subject), ox.NamedNode(E + name), None, None)):
        store.remove(quad)
    if value is not None:
        store.add(ox.Quad(ox.NamedNode(subject), ox.NamedNode(E + name), value))
    return store


@pytest.mark.parametrize(
    ("subject", "name", "value", "message"),
    [
        (BODIES + "cup_shape", "mass", None, "cup_shape has no e:mass"),
        (BODIES + "cup_shape", "graspHeight", ox.Literal("high"), "graspHeight 'high'; wanted numbers"),
        (BODIES + "cup_shape", "color", ox.Literal("1 0 0"), "wanted red, green, blue and opacity"),
        ("https://w3id.org/confab/two-arms#two_arms", "urdf", ox.Literal("robots/none.urdf"), "but this file isn't in"),
        ("https://w3id.org/confab/two-arms#left_hand", "homePosture", ox.Literal("0 0"), "7 e:armJoints and 2 angles"),
    ],
)
def test_a_wrong_attribute_is_named(subject: str, name: str, value: ox.Literal | None, message: str) -> None:
    with pytest.raises(EmbodimentError, match=message):
        read_embodiment(changed(subject, name, value), local_name)


def test_a_setting_of_a_behaviour_overrides_the_setting_of_its_skill() -> None:
    behavior = "https://w3id.org/confab/tabletop#B3_LIFT"
    number = ox.Literal("0.25", datatype=ox.NamedNode("http://www.w3.org/2001/XMLSchema#decimal"))
    assert read_embodiment(changed(behavior, "raised", number), local_name).skills["B3_LIFT"].numbers["raised"] == 0.25
