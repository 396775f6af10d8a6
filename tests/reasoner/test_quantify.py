"""Quantification by SPARQL yields the paper's numbering, and the same set as enumeration."""

import builtins
import re
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings

import ontology
from planner.paper.transitions import DomainError, Model, ground
from reasoner.generate import write_scene
from reasoner.graph.knowledge import load
from reasoner.reading.problem import read
from reasoner.reading.quantification import Quantified, by_join, by_query, quantify, query_for
from reasoner.reading.relevance import recognise
from tests.reasoner.worlds import graph_of, worlds


@pytest.mark.parametrize("scene", ontology.scenes())
def test_sparql_and_enumeration_give_the_same_behaviours_and_ids(scene: str) -> None:
    graph = load(scene)
    reading = read(graph)
    for level in reading.problem.domain.levels:
        by_query = quantify(graph, reading, level)
        assert by_query == ground(reading.problem, level)
        assert all(reading.problem.id_of(g.behavior, g.arguments) == g.id for g in by_query)


@pytest.mark.parametrize(
    ("level", "number", "text"),
    [
        (1, 22, "B1_MOVE cup1 location7"), (1, 34, "B1_POUR bottle1 cup1"), (1, 39, "B1_POUR bottle2 cup2"),
        (2, 4, "B2_PICK right_hand bottle1"), (2, 14, "B2_POUR right_hand cup1"), (2, 27, "B2_PLACE right_hand location4"),
        (3, 6, "B3_REACH_HAND_OBJECT left_hand cup1"), (3, 23, "B3_REACH_HAND_LOCATION right_hand location4"),
        (3, 29, "B3_GRASP right_hand"), (3, 30, "B3_PUT_DOWN left_hand"), (3, 33, "B3_LIFT right_hand"),
        (3, 35, "B3_TILT right_hand"), (3, 37, "B3_STAND_UPRIGHT right_hand"),
    ],
)  # fmt: skip
def test_ids_are_those_of_the_figures(level: int, number: int, text: str) -> None:
    graph = load("beverage-serving")
    assert f"{number} {text}" in [str(g) for g in quantify(graph, read(graph), level)]


def test_the_query_can_be_read_and_run() -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    text = query_for(reading, reading.problem.domain.behaviors["B2_PICK"])
    assert re.search(r"SELECT \?hand \?object", text)
    assert len(graph.select(text)) == 8


def same(one: Quantified, other: Quantified) -> bool:
    return np.array_equal(one.ids, other.ids) and list(one) == list(other)


@settings(max_examples=100)
@given(text=worlds())
def test_query_and_join_give_the_same_set_in_any_world(text: str) -> None:
    with TemporaryDirectory() as folder:
        graph = graph_of(text, Path(folder))
    for reading in (read(graph), recognise(graph)):
        problem = reading.problem
        for behavior in problem.domain.behaviors.values():
            assert same(by_query(graph, reading, behavior), by_join(problem, behavior))
            feasible = by_join(problem, behavior, feasible=True)
            assert same(by_query(graph, reading, behavior, feasible=True), feasible)
            assert set(feasible) <= set(by_join(problem, behavior))
        everything = [row for behavior in problem.domain.behaviors.values() for row in by_join(problem, behavior)]
        assert tuple(everything) == ground(problem, 1)


@settings(max_examples=100)
@given(text=worlds())
def test_what_can_be_done_is_feasible(text: str) -> None:
    with TemporaryDirectory() as folder:
        problem = read(graph_of(text, Path(folder))).problem
    try:
        model = Model(problem)
    except DomainError:
        return
    possible = {applied.ground for applied in model.successors(ground(problem, 1), model.values(problem.initial))}
    assert possible <= {
        row for behavior in problem.domain.behaviors.values() for row in by_join(problem, behavior, feasible=True)
    }


@pytest.mark.parametrize("family", ["served", "random"])
def test_query_and_join_give_the_same_set_on_a_table(tmp_path: Path, family: str) -> None:
    write_scene(tmp_path / "scene.ttl", family, objects=10, hands=3, clutter=5, seed=4)
    graph = load(tmp_path / "scene.ttl")
    for reading in (read(graph), recognise(graph)):
        for behavior in reading.problem.domain.behaviors.values():
            for feasible in (False, True):
                rows = by_query(graph, reading, behavior, feasible=feasible)
                assert same(rows, by_join(reading.problem, behavior, feasible=feasible))
                assert all(reading.problem.id_of(g.behavior, g.arguments) == g.id for g in rows)


def test_a_type_that_a_relation_implies_is_not_asked_for() -> None:
    reading = read(load("beverage-serving"))
    place = reading.problem.domain.behaviors["B2_PLACE"]
    assert query_for(reading, place, ordered=False).count("rdfs:subClassOf*") == 2
    assert query_for(reading, place, feasible=True, ordered=False).count("rdfs:subClassOf*") == 0


def test_without_arrow_the_rows_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = load("beverage-serving")
    reading = read(graph)
    behavior = reading.problem.domain.behaviors["B1_POUR"]
    with_arrow, ask = by_query(graph, reading, behavior), builtins.__import__

    def without(name: str, *arguments: object) -> ModuleType:
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return ask(name, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", without)
    assert same(with_arrow, by_query(graph, reading, behavior))
