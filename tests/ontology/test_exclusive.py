"""Values that physics allows for one individual at a time: behaviours that could give them to a second one are reported."""

import pytest

from confab.planner.validation import successor
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeGraph, load
from confab.reasoner.names import local_name
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol
from confab.reasoner.validation.case import ReadCase
from confab.reasoner.validation.exclusive import values_not_kept_exclusive

PREFIXES = (
    "PREFIX owl: <http://www.w3.org/2002/07/owl#> PREFIX k: <https://w3id.org/confab/tabletop#> "
    "PREFIX : <https://w3id.org/confab/core#> "
)


def found(graph: KnowledgeGraph) -> list[tuple[str, str]]:
    infer(graph)
    return [(local_name(node), what) for node, what, *_ in values_not_kept_exclusive(ReadCase(graph, read(graph)))]


def changed(deleted: str, inserted: str = "") -> KnowledgeGraph:
    """Return the paper's scene after some triples are deleted and others are inserted."""
    graph = load("beverage-serving")
    graph.store.update(
        f"{PREFIXES} DELETE {{ GRAPH ?g {{ {deleted} }} }} INSERT {{ GRAPH ?g {{ {inserted} }} }} "
        f"WHERE {{ GRAPH ?g {{ {deleted} }} }}"
    )
    return graph


@pytest.mark.parametrize("name", ["beverage-serving", "cereal-serving", "kitchen-corner", "two-tables"])
def test_no_behavior_of_a_shipped_scene_gives_an_exclusive_value_to_two_individuals(name: str) -> None:
    assert found(load(name)) == []


@pytest.mark.parametrize(
    ("deleted", "inserted", "behavior"),
    [
        ("k:B3_GRASP :precondition k:B3_GRASP.free", "", "B3_GRASP"),
        ("k:B2_PLACE :postcondition k:B2_PLACE.released", "", "B2_PLACE"),
        ("k:B2_PICK :postcondition k:B2_PICK.inHand", "", "B2_PICK"),
        ("k:B2_PICK.from :termType k:Location", "k:B2_PICK.from :termType k:LOCATION", "B2_PICK"),
        ("k:B1_MOVE :precondition k:B1_MOVE.free", "", "B1_MOVE"),
        ("k:B3_PUT_DOWN :precondition k:B3_PUT_DOWN.free", "", "B3_PUT_DOWN"),
        ("k:B2_PLACE.free :ofClass k:Movable", "k:B2_PLACE.free :ofClass k:Cup", "B2_PLACE"),
    ],
)
def test_a_behavior_that_gives_an_exclusive_value_to_two_individuals_is_named(
    deleted: str, inserted: str, behavior: str
) -> None:
    assert [name for name, _ in found(changed(deleted, inserted))] == [behavior]


def test_a_behavior_that_moves_a_value_from_its_holder_keeps_the_value_exclusive() -> None:
    graph = changed("k:B3_GRASP.handEmpty :value k:nothing", "k:B3_GRASP.handEmpty :value k:nothing")
    over = """k:PASS a owl:NamedIndividual, :Behavior ; :level 3 ; :index 20 ; :parameter k:PASS.giver, k:PASS.taker ;
        :precondition k:PASS.gives, k:PASS.empty ; :postcondition k:PASS.has, k:PASS.lost .
      k:PASS.giver a :Parameter ; :index 1 ; :termType :Hand . k:PASS.taker a :Parameter ; :index 2 ; :termType :Hand .
      k:PASS.object a :Variable ; :termType k:Movable .
      k:PASS.gives a :ValueCondition ; :about k:PASS.giver ; :situationType k:HOLDS ; :value k:PASS.object .
      k:PASS.empty a :ValueCondition ; :about k:PASS.taker ; :situationType k:HOLDS ; :value k:nothing .
      k:PASS.has a :ValueEffect ; :about k:PASS.taker ; :situationType k:HOLDS ; :value k:PASS.object .
      k:PASS.lost a :ValueEffect ; :about k:PASS.giver ; :situationType k:HOLDS ; :value k:nothing ."""
    graph.store.update(
        f"{PREFIXES} INSERT {{ GRAPH ?g {{ {over} }} }} WHERE {{ GRAPH ?g {{ k:B3_GRASP a :Behavior }} }}"
    )
    assert found(graph) == []
    graph.store.update(
        f"{PREFIXES} DELETE {{ GRAPH ?g {{ k:PASS :postcondition k:PASS.lost }} }} WHERE {{ GRAPH ?g {{ ?s ?p ?o }} }}"
    )
    assert [name for name, _ in found(graph)] == ["PASS"]


def test_no_second_hand_can_grasp_what_a_hand_holds() -> None:
    problem = read(load("beverage-serving")).problem
    both = {Symbol("HAND_POSITION", (hand,)): "cup1" for hand in ("left_hand", "right_hand")}
    grasp = problem.domain.behaviors["B3_GRASP"]
    held = successor(problem, grasp, ("left_hand",), {**problem.initial, **both})
    assert held is not None
    assert held[Symbol("HOLDS", ("left_hand",))] == "cup1"
    assert successor(problem, grasp, ("right_hand",), held) is None
