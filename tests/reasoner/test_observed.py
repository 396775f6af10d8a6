"""Observed facts are written into the graph, and planning can start from them."""

from dataclasses import replace
from pathlib import Path

import pytest

from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.memory.links import Links
from confab.reasoner.reading.observed import assert_observed, load_observed, save_observed
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol
from worlds.memories import save_links

CUP2 = Symbol("LOCATION", ("cup2",))


def test_an_observed_value_replaces_the_value_of_the_scene(tmp_path: Path) -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    save_observed(tmp_path / "observed.ttl", {CUP2: "location8"}, reading.names, graph.scene)
    seen = load_observed(tmp_path / "observed.ttl", reading)
    assert seen.problem.initial[CUP2] == "location8"
    assert replace(seen.problem, initial={**seen.problem.initial, CUP2: "location1"}) == reading.problem


def test_a_fact_that_is_false_in_the_scene_can_be_observed_as_true(tmp_path: Path) -> None:
    graph, closed = load("drawers-small"), Symbol("OPENED", ("box",))
    reading, file = read(graph), tmp_path / "observed.ttl"
    save_observed(file, {closed: "true"}, reading.names, graph.scene)
    assert load_observed(file, reading).problem.initial[closed] == "true"
    save_observed(file, {Symbol("OPENED", ("letter",)): "true"}, reading.names, graph.scene)
    with pytest.raises(KnowledgeError, match="which the scene doesn't have"):
        load_observed(file, reading)


def test_an_observed_amount_replaces_the_amount_of_the_scene(tmp_path: Path) -> None:
    graph, servings = load("three-cups"), Symbol("SERVINGS", ("bottle1",))
    reading, file = read(graph), tmp_path / "observed.ttl"
    save_observed(file, {servings: "2"}, reading.names, graph.scene)
    assert load_observed(file, reading).problem.initial[servings] == "2"
    file.write_text(file.read_text().replace('amount "2"', 'amount "some"'))
    with pytest.raises(KnowledgeError, match="the amount 'some' is no number"):
        load_observed(file, reading)


def test_the_graph_has_the_observed_places_and_the_scene_keeps_its_own() -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    assert_observed(graph, {CUP2: "location8"}, reading.names)
    rows = graph.select(
        "SELECT ?v WHERE { ?f a :SituatedObjectInstance ; :about ?o ; :value ?v . ?o rdfs:label 'cup 2'@en }"
    )
    assert [reading.names.short(row[0].value) for row in rows if row[0]] == ["location8"]
    assert read(graph).problem == reading.problem


def test_observations_of_another_scene_are_refused(tmp_path: Path) -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    (tmp_path / "observed.ttl").write_text(
        "@prefix c: <https://w3id.org/confab/core#> . <urn:f> a c:SituatedObjectInstance ; c:about <urn:x> ;"
        " c:situationType <urn:y> ; c:value <urn:z> ."
    )
    with pytest.raises(KnowledgeError, match="which the scene doesn't have"):
        load_observed(tmp_path / "observed.ttl", reading)
    with pytest.raises(KnowledgeError, match="no such file"):
        load_observed(tmp_path / "none.ttl", reading)


def test_an_observed_value_that_is_not_declared_is_refused(tmp_path: Path) -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    save_observed(tmp_path / "observed.ttl", {CUP2: "location8"}, reading.names, graph.scene)
    text = (tmp_path / "observed.ttl").read_text()
    (tmp_path / "observed.ttl").write_text(text.replace("#location8>", "#location88>"))
    with pytest.raises(KnowledgeError, match=r"observed.ttl: .*location88 isn't declared.*; observe this scene again"):
        load_observed(tmp_path / "observed.ttl", reading)


def test_a_file_with_two_values_of_a_fact_is_refused_as_observation(tmp_path: Path) -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    links = Links({("B1_MOVE", ("cup2", "location5")): {CUP2: {"location1": 0.5, "location8": 0.5}}})
    save_links(tmp_path / "memory.ttl", links, reading.names, graph.scene)
    with pytest.raises(KnowledgeError, match="is location1 and location8, but only one of the two can be observed"):
        load_observed(tmp_path / "memory.ttl", reading)
