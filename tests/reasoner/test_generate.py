"""Generated scenes are ordinary ontology files, and equal seeds give equal scenes."""

import re
from itertools import pairwise
from pathlib import Path

import pyoxigraph as ox
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from confab.planner.hierarchical.planner import plan
from confab.reasoner.generate import FOLDER, PLACEMENTS, families, generate, strips, write_scene
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import Symbol
from confab.reasoner.validation.validate import validate


def reading_of(folder: Path, family: str, **sizes: int) -> Reading:
    path = folder / f"{family}.ttl"
    write_scene(path, family, **sizes)
    return read(load(path))


def where(problem: Problem, state: str = "initial") -> dict[str, str]:
    facts = getattr(problem, state)
    return {symbol.arguments[0]: value for symbol, value in facts.items() if symbol.situation == "LOCATION"}


@pytest.mark.parametrize("family", families())
@pytest.mark.parametrize("sizes", [{"objects": 4}, {"objects": 10, "hands": 3, "clutter": 20, "seed": 7}])
def test_every_family_gives_a_scene_that_loads(tmp_path: Path, family: str, sizes: dict[str, int]) -> None:
    problem = reading_of(tmp_path, family, **sizes).problem
    assert len(problem.classes["Hand"]) == sizes.get("hands", 2)
    assert len(problem.classes["Movable"]) == sizes["objects"] + sizes.get("clutter", 0)
    assert problem.goal
    assert len(set(where(problem).values())) == len(problem.classes["Movable"])


@pytest.mark.parametrize("path", sorted(FOLDER.rglob("*.ttl")), ids=lambda path: path.stem)
def test_a_template_with_the_prefixes_of_its_table_is_turtle(path: Path) -> None:
    table = (FOLDER / "parts" / "table.ttl").read_text(encoding="utf-8")
    text = table if path.parent.name == "parts" else table + path.read_text(encoding="utf-8")
    assert list(ox.parse(text.encode(), format=ox.RdfFormat.TURTLE))


def test_a_generated_scene_with_four_objects_is_the_table_of_the_paper(tmp_path: Path) -> None:
    generated, paper = reading_of(tmp_path, "served").problem, read(load("beverage-serving")).problem
    assert where(generated) == where(paper)
    assert {name: len(members) for name, members in generated.classes.items()} == {
        name: len(paper.classes[name]) for name in generated.classes
    }
    assert generated.initial[Symbol("BEVERAGE", ("bottle1",))] == "beverage1"
    assert generated.initial[Symbol("BEVERAGE", ("cup1",))] == "no_beverage"
    goal = where(generated, "goal")
    assert (goal["bottle1"], goal["bottle2"]) == ("location4", "location3")
    assert {goal["cup1"], goal["cup2"]} < {f"location{i}" for i in (5, 6, 7, 8)}
    assert set(generated.goal) == set(paper.goal)


@pytest.mark.parametrize("family", sorted({*families()} - {"unsolvable", "random"}))
def test_four_objects_of_a_family_have_a_plan(tmp_path: Path, family: str) -> None:
    assert plan(reading_of(tmp_path, family, clutter=1).problem).plan


@pytest.mark.parametrize("family", families())
def test_a_generated_scene_is_valid(tmp_path: Path, family: str) -> None:
    path = tmp_path / f"my-{family}.ttl"
    write_scene(path, family, objects=6, clutter=3)
    assert validate([path]) == []


def test_an_unsolvable_scene_has_one_goal_place_that_no_hand_reaches(tmp_path: Path) -> None:
    problem = reading_of(tmp_path, "unsolvable", objects=6).problem
    reached = {place for _, place in problem.relations["canReach"]}
    assert len([place for place in where(problem, "goal").values() if place not in reached]) == 1


@settings(max_examples=40)
@given(
    family=st.sampled_from(families()),
    objects=st.integers(3, 30).map(lambda n: 2 * n),
    hands=st.integers(2, 4),
    clutter=st.integers(0, 5),
    seed=st.integers(0, 99),
)
def test_the_same_seed_gives_the_same_text(family: str, objects: int, hands: int, clutter: int, seed: int) -> None:
    text = generate(family, objects, hands, clutter, seed)
    assert text == generate(family, objects, hands, clutter, seed)
    assert text != generate(family, objects, hands, clutter, seed + 1)
    assert not re.search(r"_[A-Z]+_", text)


@given(columns=st.integers(2, 60), hands=st.integers(1, 6))
def test_the_strips_of_hands_cover_all_places_and_neighbours_overlap(columns: int, hands: int) -> None:
    reach = [set(places) for places in strips(columns, hands, range(1, 2 * columns + 1))]
    assert set().union(*reach) == set(range(1, 2 * columns + 1))
    assert all(one & other for one, other in pairwise(reach))


def test_a_generated_scene_states_that_it_has_no_geometry() -> None:
    assert "c:symbolicOnly true" in generate("swap")


def test_every_placement_is_used_by_a_family() -> None:
    used = re.findall(r"#\* placement (\S+)", "".join(p.read_text(encoding="utf-8") for p in FOLDER.glob("*.ttl")))
    assert sorted(used) == sorted(PLACEMENTS)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("serve", 4, 2), "did you mean 'served'"),
        (("served", 5, 2), "even number of objects"),
        (("served", 4, 0), "even number of objects"),
        (("handover", 4, 1), "take 2 hands or more"),
    ],
)
def test_impossible_parameters_of_a_generated_scene_are_refused_by_name(
    arguments: tuple[str, int, int], message: str
) -> None:
    with pytest.raises(KnowledgeError, match=message):
        generate(*arguments)
