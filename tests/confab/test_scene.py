"""A scene in a notebook: its tables, its plan and its memory."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

import confab
from confab.interchange import read_plan
from confab.planner.plan import Left
from confab.planner.solve import Mode
from confab.scene import described
from confab.show import summary

GUESTS = Path(__file__).parent / "cases" / "guests.ttl"


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


@pytest.fixture(scope="module")
def result(scene: confab.Scene) -> confab.Result:
    return scene.plan()


def test_a_query_gives_rows_a_table_and_a_dataframe(scene: confab.Scene) -> None:
    table = scene.query("SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o")
    assert list(table)[:2] == [("bottle1", "location4"), ("bottle2", "location3")]
    assert table.dataframe().shape == (4, 2)
    assert ">bottle1</td>" in table._repr_html_()
    assert repr(table).splitlines()[0] == "o        l"


def test_the_graph_is_an_rdflib_graph_with_the_scenes_triples(scene: confab.Scene) -> None:
    rows = scene.graph.query("SELECT ?l WHERE { ?o k:location ?l } ORDER BY ?l")
    assert len(list(rows)) == 4


def test_a_result_shows_as_a_tree_and_is_a_networkx_graph(result: confab.Result) -> None:
    assert "solved: 4 / 10 / 32" in repr(result)
    assert "B3_GRASP" in result._repr_html_()
    graph = result.plan.to_networkx()
    assert graph.number_of_nodes() == 4 + 10 + 32
    refines = [edge for edge in graph.edges if graph.edges[edge]["kind"] == "refines"]
    assert len(refines) == 10 + 32


@pytest.mark.parametrize("mode", ["guarded", "strict", "paper"])
def test_every_mode_refines_as_the_paper_does(scene: confab.Scene, mode: Mode) -> None:
    plan = scene.plan(mode=mode).plan
    by_id = {step.id: [below.id for below in step.steps] for step in plan.steps}
    assert by_id == {22: [2, 22], 34: [4, 14, 27], 28: [3, 20], 39: [1, 11, 18]}


def test_a_saved_plan_is_read_back_as_it_was(tmp_path: Path, scene: confab.Scene, result: confab.Result) -> None:
    path = result.save(tmp_path / "plan.json")
    assert read_plan(path, scene.problem) == result.plan


def test_a_result_that_is_read_has_the_cost_and_the_unmet_soft_goals_of_the_saved_result(tmp_path: Path) -> None:
    scene = confab.load("wishes-small")
    made = scene.plan()
    read = scene.read_result(made.save(tmp_path / "plan.json"))
    assert read.outcome.unmet == made.outcome.unmet != set()
    assert read.outcome.cost == made.outcome.cost
    assert read.outcome.penalty == made.outcome.penalty
    assert read.outcome.total == made.outcome.total == 31
    assert "leaves a soft goal unmet: store STOCK 0 (weight 8)" in str(read)
    assert {"cost", "penalty", "forgone"} <= read.json().keys()
    assert scene.read_result(scene.plan("store STOCK 0").plan, "store STOCK 0").outcome.penalty == 0


def test_a_saved_plan_without_steps_is_read_and_executed(tmp_path: Path) -> None:
    scene = confab.load(GUESTS).without_goal("guest1", "guest2 AT")
    path = scene.plan().save(tmp_path / "plan.json")
    assert read_plan(path, scene.problem).steps == ()
    assert scene.execute(path).reached


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "holds no plan"),
        ({"status": "unsolvable"}, "status is 'unsolvable'"),
        ({"steps": [{"behavior": "B1_MVOE", "arguments": []}]}, "did you mean 'B1_MOVE'"),
        ({"steps": [{"behavior": "B1_MOVE", "arguments": ["cup1"]}]}, "takes 2 arguments, got 1"),
        ({"steps": [{"behavior": "B1_MOVE", "arguments": ["cup1", "location77"]}]}, "'location77' is no Location"),
        ({"steps": ["B1_MOVE"]}, "wanted an object"),
        ([], "holds no plan"),
    ],
)
def test_an_invalid_plan_file_is_refused_with_its_fault(
    tmp_path: Path, scene: confab.Scene, data: object, message: str
) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(data))
    with pytest.raises(confab.KnowledgeError, match=message):
        read_plan(path, scene.problem)


def test_a_memory_learns_saves_and_loads(tmp_path: Path, scene: confab.Scene, result: confab.Result) -> None:
    memory = confab.Memory.of(scene)
    memory.learn(scene, result.plan)
    path = memory.save(tmp_path / "memory.ttl")
    assert confab.Memory.load(path).links == memory.links
    assert "B1_MOVE cup1 location7" in str(list(memory.table()))


def test_an_unknown_name_of_the_package_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"the module confab has no 'plann'"):
        _ = confab.plann


def test_the_shipped_scenes_are_listed_with_their_levels_and_individuals() -> None:
    rows = {row["scene"]: row for row in described()}
    assert rows.keys() == set(confab.scenes())
    assert rows["beverage-serving"][1:4] == ("3", "13", "physics")
    assert rows["towers-small"]["verified by"] == "symbols only"


def test_a_plan_says_which_steps_replace_steps_of_a_level() -> None:
    outcome = confab.load("beverage-serving").plan().outcome
    assert len(summary(outcome).splitlines()) == 1
    said = summary(replace(outcome, left=(Left(1, (0,), (7,), ()), Left(2, (8, 1), (8, 1), ()))))
    assert said.splitlines()[1:] == ["steps 0 to 7 replace steps of level 1", "step 8.1 replaces steps of level 2"]
    assert summary(replace(outcome, left=(Left(1, (0,), (7,), ()),), given_up=("why",))).splitlines()[1:] == ["why"]
