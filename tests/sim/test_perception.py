"""Perceived facts are true in random worlds, and noise up to the thresholds changes no fact."""

import numpy as np
import pytest

from benchmarks.perception import perception
from confab.reasoner.symbols import State
from confab.sim.faults import displaced, drained, lying
from confab.sim.staging import Perturbation
from confab.sim.verdict import Verdict
from confab.sim.verify import compare
from confab.sim.world import PhysicsWorld

from .conftest import Case, case


def shuffled(case: Case, seed: int) -> State:
    """Return the case's facts with objects at random other places and some cups filled."""
    rng = np.random.default_rng(seed)
    places = iter(rng.permutation(list(case.embodiment.places)).tolist())
    fillings = [*case.embodiment.fillings, "no_beverage"]
    state = dict(case.initial)
    for symbol in case.initial:
        if symbol.situation == "LOCATION":
            state[symbol] = next(places)
        elif symbol.situation == "BEVERAGE":
            state[symbol] = fillings[rng.integers(len(fillings))]
    return state


@pytest.mark.parametrize("seed", range(5000, 5006))
def test_random_worlds_are_perceived_correctly_despite_noise(serving: Case, seed: int) -> None:
    truth = shuffled(serving, seed)
    with PhysicsWorld(serving.embodiment, truth, seed, Perturbation(), noise=0.002) as world:
        for _ in range(5):
            assert dict(world.observe()) == dict(truth)


def test_an_object_that_lies_or_stands_beside_its_place_is_at_no_place(serving: Case) -> None:
    where = {s.arguments[0]: s for s in serving.initial if s.situation == "LOCATION"}
    for plant, name in ((lying("cup1"), "cup1"), (displaced("cup2", (0.08, 0.0)), "cup2")):
        with PhysicsWorld(serving.embodiment, serving.initial, beads=False) as world:
            plant(world)
            seen = world.observe()
            assert where[name] not in seen
            assert {s: v for s, v in seen.items() if s != where[name]} == {
                s: v for s, v in serving.initial.items() if s != where[name]
            }


def test_a_vessel_is_filled_from_a_tenth_of_a_serving_on(serving: Case) -> None:
    (symbol,) = (s for s in serving.initial if s.situation == "BEVERAGE" and s.arguments == ("bottle1",))
    for left, seen in ((2, serving.initial[symbol]), (1, "no_beverage")):
        with PhysicsWorld(serving.embodiment, serving.initial) as world:
            drained("bottle1", left)(world)
            assert world.observe()[symbol] == seen


def test_errors_of_perception_under_strong_noise_are_counted_not_hidden() -> None:
    tally = perception(2, list[str]().append)
    assert {situation for situation, _ in tally.looks} == {
        symbol.situation for symbol in case("beverage-serving").initial
    }
    for count in (tally.wrong, tally.missed):
        assert all(count[situation, noise] == 0 for situation, noise in tally.looks if noise <= 0.002)
    assert tally.missed["LOCATION", 0.02] > tally.missed["LOCATION", 0.005]


def test_an_unexpected_perception_is_repeated_and_a_real_deviation_is_still_found(moved: Case) -> None:
    wanted = {symbol: value for symbol, value in moved.initial.items() if symbol.situation == "LOCATION"}
    symbol = next(iter(wanted))
    who = symbol.arguments[0]
    with PhysicsWorld(moved.embodiment, moved.initial, beads=False, noise=0.002) as world:
        world.observe()
        world.errors[who] = world.steps, np.array([0.0, 0.0, 0.02])  # a measurement with a large error
        assert symbol not in world.observe()
        assert compare(world, {**world.observe(), **wanted}, Verdict(True)).ok
        displaced(who, (0.1, 0.0))(world)
        world.run(30)
        assert compare(world, wanted, Verdict(True)).code == "misplaced"
