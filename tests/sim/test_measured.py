"""A user's own situation types that are perceived by measured quantities: bounds in Turtle, without Python."""

from pathlib import Path

import numpy as np
import pytest

import confab
from confab.reasoner.embodiment.facts import EmbodimentError
from confab.reasoner.symbols import Symbol
from confab.sim.interventions import UPRIGHT, put
from confab.sim.verdict import Verdict
from confab.sim.verify import compare
from confab.sim.world import PhysicsWorld

STACK = Path(__file__).parent / "right" / "stack.ttl"
ON = """
:ON a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :on .
:ON e:perceiver e:perceive_measured ; e:holdsIf "{bounds}" ; rdfs:label "on"@en ; skos:definition "A block on another one."@en .
:on a owl:ObjectProperty, owl:NamedIndividual ; rdfs:domain :Block ; rdfs:range :ON ; rdfs:label "is on"@en .
:on skos:definition "Relates a block to those below it."@en .
:Block c:hasSituationType :ON ; rdfs:subClassOf :ON .
"""


def stack(tmp_path: Path, bounds: str) -> confab.Scene:
    file = tmp_path / "stack.ttl"
    file.write_text(STACK.read_text(encoding="utf-8") + ON.format(bounds=bounds), encoding="utf-8")
    return confab.load(file)


def test_the_relation_on_is_measured_and_a_deviation_is_reported_in_numbers(tmp_path: Path) -> None:
    scene = stack(tmp_path, "beside <= 0.02; over >= -0.004; over <= 0.004; contact >= 0.1")
    with PhysicsWorld(scene.embodiment, scene.problem.initial) as world:
        a_on_b = Symbol("ON", ("a", "b"))
        state = world.observe()
        assert {value for symbol, value in state.items() if symbol.situation == "ON"} == {"false"}
        verdict = compare(world, {**state, a_on_b: "true"}, Verdict(True))
        assert (verdict.ok, verdict.code) == (False, "unexpected")
        assert "beside 0.24" in str(verdict)
        put(world, "a", world.truth("b")[1] + np.array([0.01, 0.0, 0.096]), UPRIGHT)
        world.run(60)
        assert [s for s, value in world.observe().items() if s.situation == "ON" and value == "true"] == [a_on_b]


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ("bside <= 0.02", "wanted a quantity of an individual and a value: beside"),
        ("beside <= near", "no number 'near'"),
    ],
)
def test_an_invalid_bound_is_refused_with_the_valid_ones(tmp_path: Path, bounds: str, words: str) -> None:
    with pytest.raises(EmbodimentError, match=words):
        _ = stack(tmp_path, bounds).embodiment
