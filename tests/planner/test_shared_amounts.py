"""Steps that share an amount overlap as far as the amount suffices, and no further."""

from fractions import Fraction
from itertools import permutations
from random import Random

import pytest

from confab.planner.plan import Limits
from confab.planner.solve import Request, solve
from confab.planner.timed.call import best_in_time, in_time
from confab.planner.timed.pools import AmountUse, pool_of
from confab.planner.timed.validation import validate_timed
from confab.reasoner.amounts import Quantity
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem


def jobs(amount: int, *every: tuple[int, int], condition: str = "(>= (free) {0})", takes: str = "decrease") -> Problem:
    """Return a task with a job for each duration and number of units, which the job borrows from a shared amount."""
    gives = "increase" if takes == "decrease" else "decrease"
    actions = " ".join(
        f"(:durative-action a{i} :parameters () :duration (= ?duration {seconds}) "
        f":condition (at start {condition.format(units)}) :effect (and (at start ({takes} (free) {units})) "
        f"(at end ({gives} (free) {units})) (at end (p{i}))))"
        for i, (seconds, units) in enumerate(every)
    )
    facts = " ".join(f"(p{i})" for i in range(len(every)))
    domain = f"(define (domain d) (:requirements :durative-actions :fluents) (:predicates {facts}) (:functions (free)) {actions})"
    problem = f"(define (problem p) (:domain d) (:init (= (free) {amount})) (:goal (and {facts})))"
    return imported(parse(domain, problem)).problem


@pytest.mark.parametrize("separation", [Fraction(0), Fraction(1, 1000)])
@pytest.mark.parametrize(
    ("problem", "makespan"),
    [
        (jobs(2, *[(4, 1)] * 5), 12),
        (jobs(9, *[(4, 1)] * 5), 4),
        (jobs(1, (4, 1), (3, 1)), 7),
        (jobs(3, (4, 2), (4, 1), (2, 3)), 6),
        (jobs(2, *[(4, 1)] * 4, condition="(> (free) 0)"), 8),
        (jobs(0, *[(4, 1)] * 4, condition="(<= (free) 1)", takes="increase"), 8),
        (jobs(0, *[(4, 1)] * 4, condition="(< (free) 2)", takes="increase"), 8),
    ],
)
def test_jobs_overlap_while_the_shared_amount_suffices(problem: Problem, makespan: int, separation: Fraction) -> None:
    plan = solve(Request(problem, limits=Limits(seconds=20.0))).plan
    assert plan is not None
    timed = best_in_time(problem, plan, separation=separation).plan
    assert timed is not None
    assert makespan <= timed.makespan < makespan + 1
    assert timed.bound <= timed.makespan
    assert validate_timed(problem, timed, separation) == []


def least(amount: int, every: list[tuple[int, int]]) -> int:
    """Return the least makespan of jobs: that of the best list schedule."""
    found = []
    for order in permutations(every):
        ends: list[tuple[int, int]] = []
        now = 0
        for seconds, units in order:
            while sum(u for end, u in ends if end > now) + units > amount:
                now = min(end for end, _ in ends if end > now)
            ends.append((now + seconds, units))
        found.append(max(end for end, _ in ends))
    return min(found)


def test_schedules_of_random_jobs_are_valid_and_not_shorter_than_the_shortest() -> None:
    ratios = []
    for seed in range(60):
        rng = Random(seed)
        amount = rng.randint(1, 4)
        every = [(rng.randint(1, 5), rng.randint(1, amount)) for _ in range(rng.randint(2, 5))]
        problem = jobs(amount, *every)
        plan = solve(Request(problem, limits=Limits(seconds=20.0))).plan
        assert plan is not None
        timed = in_time(problem, plan).plan
        assert timed is not None
        assert validate_timed(problem, timed) == []
        assert timed.bound <= least(amount, every) <= timed.makespan, (seed, amount, every)
        ratios.append(timed.makespan / least(amount, every))
    assert sum(ratios) / len(ratios) < 1.1


def test_a_pool_orders_only_events_of_which_one_takes_what_the_other_gives() -> None:
    one = AmountUse(Fraction(-1), ((Fraction(1), False),))
    pool = pool_of(
        [one, AmountUse(Fraction(1)), one, AmountUse(Fraction(1)), one, AmountUse(Fraction(1))], Fraction(2), Quantity()
    )
    assert pool is not None
    assert list(pool.pairs([0, 2, 1, 4, 3, 5])) == [(1, 4)]
    need = AmountUse(Fraction(0), ((Fraction(2), False),))
    pool = pool_of([one, AmountUse(Fraction(1)), need], Fraction(2), Quantity())
    assert pool is not None
    assert list(pool.pairs([0, 1, 2])) == [(1, 2)]
    assert list(pool.pairs([2, 0, 1])) == [(2, 0)]
    assert pool_of([one, AmountUse(Fraction(-1))], Fraction(2), Quantity()) is None
