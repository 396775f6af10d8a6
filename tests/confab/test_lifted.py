"""Learned rules are described in plain English: with "no", "every" and negations, and with the labels of the shipped scenes."""

from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
from confab.cli import app
from confab.labels import Labels
from confab.lifted import Sayings
from confab.reasoner.memory.experience import LearnedRule
from confab.reasoner.problem import Domain
from confab.reasoner.sentences import denied
from confab.reasoner.symbols import (
    AnyOf,
    Condition,
    Constraint,
    EqualityCondition,
    Fact,
    RelationCondition,
    SituationType,
    Symbol,
    ValueCondition,
    Witness,
)

LABELS = Labels(
    {"Gate": "gate", "Lock": "lock", "open": "open", "shut": "shut", "gateOf": "is a gate of"},
    {"GATE": "is open or shut", "IN": "is in", "MOORING": "is tied up or loose"},
    Domain({}, {}),
)
SHUT = ValueCondition("GATE", ("?other",), "shut", negated=True)
OF_LOCK = RelationCondition("gateOf", ("?other", "?lock"))


@pytest.mark.parametrize(
    ("condition", "sentence"),
    [
        (Witness("?x", "Boat", (ValueCondition("IN", ("?x",), "?lock"),), negated=True), "no Boat is in lock"),
        (Witness("?x", "Boat", (ValueCondition("IN", ("?x",), "?lock"),)), "some Boat is in lock"),
        (Witness("?other", "Gate", (SHUT, OF_LOCK), negated=True), "every gate that is a gate of lock is shut"),
        (
            Witness(
                "?other", "Gate", (EqualityCondition("?other", "?gate", negated=True), OF_LOCK, SHUT), negated=True
            ),
            "every gate but gate that is a gate of lock is shut",
        ),
        (
            Witness("?other", "Gate", (RelationCondition("gateOf", ("?gate", "?other")), SHUT), negated=True),
            "every gate that gate is a gate of is shut",
        ),
        (RelationCondition("gateOf", ("?gate", "?lock"), negated=True), "gate isn't a gate of lock"),
        (ValueCondition("GATE", ("?gate",), "open", negated=True), "gate isn't open"),
    ],
)
def test_conditions_with_quantifiers_are_written_as_sentences(condition: Condition, sentence: str) -> None:
    assert Sayings(LABELS).condition(condition) == sentence


def test_a_value_that_names_the_state_is_written_without_the_property() -> None:
    assert LABELS.fact(Fact(Symbol("GATE", ("g",)), "shut")) == "g is shut"
    assert LABELS.fact(Fact(Symbol("MOORING", ("b",)), "tied up")) == "b is tied up"
    assert LABELS.fact(Fact(Symbol("IN", ("b",)), "shut")) == "b is in shut"


def test_a_negated_fact_is_written_with_a_negated_verb() -> None:
    assert denied("hand can reach location") == "hand can't reach location"
    assert denied("FERRY EMPTY") == "not FERRY EMPTY"


def test_two_conditions_that_enforce_one_constraint_are_written_once() -> None:
    asks = [AnyOf(((OF_LOCK,),), True, Constraint("FLOOD")), AnyOf(((SHUT,),), True, Constraint("FLOOD"))]
    rule = LearnedRule(ValueCondition("IN", ("?boat",), "?lock"), tuple(asks), ("ENTER", ("?boat",)), ())
    assert Sayings(LABELS).rule(rule).count("FLOOD is never true") == 1


def test_a_memory_of_a_shipped_scene_is_shown_in_its_labels_without_naming_the_scene(tmp_path: Path) -> None:
    scene = confab.load("two-cups")
    memory = confab.Memory.of(scene)
    memory.teach(scene, scene.plan().plan)
    memory.save(tmp_path / "memory.ttl")
    shown = CliRunner().invoke(app, ["memory", "show", str(tmp_path / "memory.ttl")]).output
    assert "is at place" in " ".join(shown.split())
    assert "B1_MOVE" not in shown


def test_a_situation_type_whose_label_begins_with_is_needs_no_label_of_its_property() -> None:
    kinds = {"WET": SituationType("WET", ("Pot",), "", boolean=True), "ON": SituationType("ON", ("Pot",), "Bench")}
    labels = Labels({"WET": "is watered", "ON": "is on"}, {}, Domain(kinds, {}))
    assert labels.fact(Fact(Symbol("WET", ("fern",)), "true")) == "fern is watered"
    assert labels.fact(Fact(Symbol("ON", ("fern",)), "bench")) == "fern is on bench"
    assert labels.about(Symbol("ON", ("fern",))) == "fern is on"
