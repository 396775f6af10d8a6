"""A* in toy worlds: states are tuples of one digit string, so the tests need neither ontology nor physics."""

from collections.abc import Callable, Iterable
from itertools import count

import pytest

from confab.planner.paper.astar import a_star
from confab.planner.paper.cogency import PaperConstants
from confab.planner.paper.hierarchy import plan
from confab.planner.paper.transitions import Applied, Values
from confab.planner.plan import Limits, Status
from confab.reasoner.symbols import GroundBehavior
from worlds.families import tabletop


def graph(
    edges: dict[str, dict[str, float]],
) -> tuple[Callable[[Values], Iterable[Applied]], Callable[[Values, Applied], float]]:
    """Return the successors and the costs of a graph that is given as node → {node: cost}."""
    names = {
        (a, b): GroundBehavior(i, f"{a}{b}", ()) for i, (a, b) in enumerate((a, b) for a in edges for b in edges[a])
    }
    costs = {names[a, b].behavior: cost for a in edges for b, cost in edges[a].items()}

    def successors(state: Values) -> Iterable[Applied]:
        return [Applied(names[state[0], b], {}, (b,)) for b in edges.get(state[0], {})]

    return successors, lambda state, applied: costs[applied.ground.behavior]


def names(path: tuple[Applied, ...]) -> list[str]:
    return [applied.ground.behavior for applied in path]


def test_the_cheapest_path_wins_over_the_one_found_first() -> None:
    successors, cost = graph({"a": {"d": 9, "b": 1}, "b": {"c": 1}, "c": {"d": 1}})
    assert names(a_star(("a",), {0: "d"}, successors, cost).path) == ["ab", "bc", "cd"]


def test_a_state_reached_again_more_cheaply_gets_the_cheaper_parent() -> None:
    successors, cost = graph({"a": {"c": 5, "b": 1}, "b": {"c": 1}, "c": {"d": 1}})
    assert names(a_star(("a",), {0: "d"}, successors, cost).path) == ["ab", "bc", "cd"]


def test_cycles_end_and_exhaustion_is_unsolvable() -> None:
    successors, cost = graph({"a": {"b": 1}, "b": {"a": 1}})
    found = a_star(("a",), {0: "z"}, successors, cost)
    assert (found.status, found.path, found.counts.expanded) == (Status.UNSOLVABLE, (), 2)


def test_the_limit_of_expansions_gives_up_instead_of_claiming_anything() -> None:
    successors, cost = graph({"a": {"b": 1}, "b": {"c": 1}, "c": {"d": 1}})
    assert a_star(("a",), {0: "d"}, successors, cost, limits=Limits(expansions=2)).status is Status.GAVE_UP


def test_the_time_limit_ends_a_search_within_one_state(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = count()
    for module in ("plan", "paper.hierarchy", "paper.astar"):
        monkeypatch.setattr(f"confab.planner.{module}.perf_counter", lambda: float(next(clock)), raising=False)
    outcome = plan(tabletop(), limits=Limits(seconds=4.0))
    assert outcome.status is Status.GAVE_UP
    assert sum(counts.generated for counts in outcome.search.values()) <= 5


def test_a_start_that_is_the_goal_needs_no_step() -> None:
    found = a_star(("a",), {0: "a"}, lambda state: (), lambda state, applied: 1.0)
    assert (found.status, found.path, found.counts.expanded) == (Status.SOLVED, (), 0)


def test_the_more_cogent_of_two_equal_paths_is_taken() -> None:
    successors, cost = graph({"a": {"b": 1, "c": 1}, "b": {"d": 1}, "c": {"d": 1}})
    ranks = {"ab": 1.0, "ac": 0.5, "bd": 1.0, "cd": 1.0}
    found = a_star(
        ("a",), {0: "d"}, successors, cost,
        rank=lambda state: lambda applied: ranks[applied.ground.behavior], bonus=PaperConstants().bonus,
    )  # fmt: skip
    assert names(found.path) == ["ac", "cd"]
    assert found.ranks == (0.5, 1.0)
