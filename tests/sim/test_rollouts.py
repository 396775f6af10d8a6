"""Many rollouts: each seed gives the same result, wherever it runs."""

import functools
import os
from pathlib import Path

import pytest

from confab.sim.rollouts import Trial, rollouts, wilson
from confab.sim.staging import Perturbation
from confab.sim.world import PhysicsWorld

from .conftest import Case

SEEDS = range(5000, 5003)


def first_steps(serving: Case, count: int = 2) -> Trial:
    """Reach for a cup and grasp it, without beverage and with perturbation."""
    return Trial(
        serving.embodiment,
        serving.initial,
        serving.steps[:count],
        serving.expected[:count],
        Perturbation(),
        beads=False,
    )


def die_once(mark: Path, world: PhysicsWorld) -> None:
    """Kill the process that runs the second seed, at the first attempt."""
    del world
    try:
        mark.touch(exist_ok=False)
    except FileExistsError:
        return
    os._exit(9)


def die(world: PhysicsWorld) -> None:
    del world
    os._exit(9)


def test_two_processes_give_the_results_of_one_for_each_seed_even_if_one_process_dies(
    serving: Case, tmp_path: Path
) -> None:
    trial = first_steps(serving)
    alone, seen = rollouts(trial, SEEDS), list[int]()
    dying = Trial(**{**vars(trial), "prepare": functools.partial(die_once, tmp_path / "died")})
    together = rollouts(dying, SEEDS, 2, lambda rollout: seen.append(rollout.seed))
    assert (tmp_path / "died").exists()
    assert together == alone
    assert sorted(seen) == list(SEEDS)
    assert len({rollout.steps[1].verdict.measured["force_n"] for rollout in alone}) == len(SEEDS)


def test_a_rollout_in_which_every_process_dies_is_given_up_and_named(serving: Case) -> None:
    trial = Trial(**{**vars(first_steps(serving, 0)), "prepare": die})
    with pytest.raises(RuntimeError, match=r"seed 500\d was given up: 3 processes died at it"):
        rollouts(trial, SEEDS[:2], 2)


def test_an_error_in_a_worker_process_is_raised_in_the_caller(serving: Case) -> None:
    trial = Trial(**{**vars(first_steps(serving)), "expected": serving.expected[:1]})
    with pytest.raises(ValueError, match="shorter"):
        rollouts(trial, SEEDS[:2], 2)


@pytest.mark.parametrize("workers", [0, "-1", "many", "http://somewhere"])
def test_an_invalid_value_of_workers_is_refused_by_name(serving: Case, workers: int | str) -> None:
    with pytest.raises(ValueError, match=f"workers '{workers}'"):
        rollouts(first_steps(serving), SEEDS, workers)


def test_the_confidence_interval_is_wilson_s() -> None:
    assert wilson(98, 100) == pytest.approx((0.93, 0.9945), abs=5e-4)
    assert wilson(0, 10) == pytest.approx((0.0, 0.2775), abs=5e-4)
    assert wilson(10, 10) == pytest.approx((0.7225, 1.0), abs=5e-4)


@pytest.mark.filterwarnings("ignore")
def test_a_ray_cluster_of_two_nodes_gives_the_same_results_even_if_a_worker_dies(serving: Case, tmp_path: Path) -> None:
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        cluster.add_node(num_cpus=1)
        os.environ["RAY_ADDRESS"] = cluster.address
        trial = first_steps(serving)
        dying = Trial(**{**vars(trial), "prepare": functools.partial(die_once, tmp_path / "died")})
        assert rollouts(dying, SEEDS, "ray") == rollouts(trial, SEEDS)
        assert (tmp_path / "died").exists()
    finally:
        del os.environ["RAY_ADDRESS"]
        cluster.shutdown()
