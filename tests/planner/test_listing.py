"""List scheduling of small orders of activities."""

from collections.abc import Mapping, Sequence
from fractions import Fraction

from confab.planner.plan import Step
from confab.planner.timed.activities import Access, Activity
from confab.planner.timed.listing import Listing
from confab.planner.timed.network import network_of
from confab.planner.timed.order import BEGIN, END, Order, Resource, Turn, TurnId


def listing(
    seconds: Sequence[int],
    turns: Mapping[str | None, Sequence[Sequence[int]]],
    before: Sequence[tuple[int, int]],
    of: Mapping[TurnId, Sequence[int]],
) -> Listing:
    """Return the list scheduling of activities with these durations, turns of resources, precedences and choices of actors."""
    none = Access()
    activities = [
        Activity(Step((i,), i, 1, "DO", ()), Fraction(s), (), none, none, none) for i, s in enumerate(seconds)
    ]
    resources = [
        Resource(tuple(Turn(tuple(its), ((its[0], BEGIN),), ((its[-1], END),)) for its in line), actor)
        for actor, line in turns.items()
    ]
    edges = tuple((i, END, j, BEGIN) for i, j in before)
    order = Order(tuple(activities), edges, tuple(resources))
    return Listing(order, network_of(order), of, {(turn, one): {} for turn, able in of.items() for one in able})


def test_a_block_is_tried_again_when_any_resource_is_free_that_excluded_some_of_its_actors() -> None:
    # Hand 0 holds what hand 1 opens, so hand 2 can't do both; then hand 0 uses the place that the robot occupies from 3 to 4.
    occupied = listing(
        [1, 1, 1, 1, 9],
        {"hand0": [[0, 2]], "hand1": [[1]], "hand2": [], "robot": [[3], [4]], None: [[3, 4], [2]]},
        [(0, 1), (1, 2), (3, 4)],
        {(0, 0): (0, 1, 2), (1, 0): (1, 0, 2)},
    )
    assert occupied.turns() == [[(0, 0)], [(1, 0)], [], [(3, 0), (3, 1)], [(4, 0), (4, 1)]]


def test_an_actor_whose_turns_keep_their_order_takes_turns_of_another_actor_at_any_time() -> None:
    two = listing([2, 2], {"hand0": [[0], [1]], "hand1": []}, [], {(0, 0): (0, 1), (0, 1): (0, 1)})
    two.kept = {1}
    assert two.turns() == [[(0, 0)], [(0, 1)]]


def test_a_turn_that_keeps_its_order_follows_the_turn_before_it_also_on_another_actor() -> None:
    two = listing([2, 2], {"hand0": [[0], [1]], "hand1": []}, [], {(0, 0): (1,), (0, 1): (0, 1)})
    two.kept = {0}
    assert two.turns() == [[(0, 1)], [(0, 0)]]
