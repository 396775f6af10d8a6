"""Execution of timed plans whose durations deviate by up to 30 %.

    python -m benchmarks dispatch
    CONFAB_COUNT=1000 …  runs, a tenth of them on tables
    CONFAB_SEED=1 …      the first seed

Groups: shipped scenes whose plans have overlapping steps, and at most 100 of them; tables with two, four and eight hands;
deliveries by three mobile robots of different speeds; random timed worlds; and random timed worlds with deadlines and windows. In
scenes and on tables, each behaviour has a random duration. In the first three groups, half of the goals have a deadline, 5 % after
the time at which the plan achieves them; the plan was made without these deadlines. The independent checker judges every execution.
A clairvoyant schedule knows the actual durations; it has the same steps, may exchange turns and actors, and is judged by the
checker too. The planned order is the order of turns in the timed plan. A run is held back if a remaining primitive can't begin such
that its end is in time for all durations within the deviation; only completed runs are late.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import exp, inf, log
from random import Random

from confab.planner.plan import Limits, Plan
from confab.planner.solve import Request, solve
from confab.planner.timed import concurrent
from confab.planner.timed.call import best_in_time, timed_plan
from confab.planner.timed.dispatch import Dispatch, simulated
from confab.planner.timed.network import earliest, network_of
from confab.planner.timed.plan import TimedPlan
from confab.planner.timed.schedules import ActorChoices, durations_with, least, shortest, turn_edges
from confab.planner.timed.validation import validate_timed
from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.graph.knowledge import load
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import Symbol, Times
from confab.reasoner.timing import only_during
from confab.scene import scenes
from worlds.deliveries import deliveries
from worlds.families import family
from worlds.timed import problem_of, timed_world

SPREAD = Fraction(3, 10)
RUNS_OF_A_SCENE, RUNS_OF_A_PLAN = 10, 25
LARGEST = 100
FAMILIES = ("served", "swap", "handover", "blocked")


@dataclass
class Figures:
    """Counts and ratios of the runs of a group."""

    counts: Counter[str] = field(default_factory=Counter)
    ratios: list[float] = field(default_factory=list)
    bounds: list[float] = field(default_factory=list)


def main() -> None:
    """Print the table."""
    count, first = int(os.environ.get("CONFAB_COUNT", 1_000)), int(os.environ.get("CONFAB_SEED", 1))
    columns = (
        "",
        "runs",
        "completed",
        "held back",
        "broken causal links",
        "late",
        "late, and the planned order keeps all times",
        "late, and a clairvoyant schedule keeps all times",
        "makespan ÷ clairvoyant",
        "makespan ÷ lower bound",
    )
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    for name, share, plans, each in (
        ("scenes", 2, _scenes(first), RUNS_OF_A_SCENE),
        ("tables", 1, _tables(first), RUNS_OF_A_PLAN),
        ("deliveries", 2, _deliveries(first), RUNS_OF_A_PLAN),
        ("random", 2, _random(first, False), 1),
        ("random, limited", 3, _random(first, True), 1),
    ):
        figures, number, most = Figures(), 0, count * share // 10
        for problem, timed in plans:
            for _ in range(each):
                if number < most:
                    number += 1
                    _run(problem, timed, Random(f"{name} {first} {number}"), figures)
            if number >= most:
                break
        c = figures.counts
        print(
            f"| {name} | {number} | {c['completed']} | {c['held back']} | {c['broken']} | {c['late']} | {c['late, order']} "
            f"| {c['late, clairvoyant']} | {_mean(figures.ratios)} | {_mean(figures.bounds)} |",
            flush=True,
        )


def _mean(ratios: list[float]) -> str:
    return f"{exp(sum(map(log, ratios)) / len(ratios)):.3f}, at most {max(ratios):.2f}" if ratios else ""


def _scenes(first: int) -> Iterator[tuple[Problem, TimedPlan]]:
    for seed in range(first, first + 1_000):
        for name in scenes():
            rng = Random(f"{seed} {name}")
            for problem, timed in _planned(_with_durations(read(load(name)).problem, rng), rng):
                if len(timed.slots) <= LARGEST and timed.makespan < timed.serial:
                    yield problem, timed


def _tables(first: int) -> Iterator[tuple[Problem, TimedPlan]]:
    for seed in range(first, first + 1_000):
        for hands, n in ((2, 4), (4, 8), (8, 12)):
            rng = Random(f"{seed} {hands}")
            yield from _planned(_with_durations(family(FAMILIES[seed % len(FAMILIES)], n, seed, hands), rng), rng)


def _deliveries(first: int) -> Iterator[tuple[Problem, TimedPlan]]:
    for seed in range(first, first + 1_000):
        for n in (6, 9, 12):
            yield from _planned(deliveries(n, 3, seed), Random(f"{seed} {n}"))


def _with_durations(problem: Problem, rng: Random) -> Problem:
    """Return a problem in which each primitive has a random duration."""
    lowest = problem.domain.at_level(problem.domain.levels[-1])
    return replace(problem, times=Times(measured={one.name: Fraction(rng.randint(2, 8), 2) for one in lowest}))


def _planned(problem: Problem, rng: Random) -> Iterator[tuple[Problem, TimedPlan]]:
    """Yield a problem with deadlines and its timed plan, if a plan is found."""
    plan = solve(Request(problem, limits=Limits(seconds=20.0))).plan
    timed = None if plan is None else best_in_time(problem, plan, 5.0).plan
    if timed is None:
        return
    reached = _reached(problem, timed)
    deadlines = {goal: at * Fraction(105, 100) for goal, at in reached.items() if at and rng.random() < 0.5}
    yield replace(problem, times=replace(problem.times or Times(), deadlines=deadlines)), timed


def _reached(problem: Problem, timed: TimedPlan) -> dict[Symbol, Fraction]:
    """Return the time of the last change of each goal, in a plan whose effects are at the end."""
    rules, facts = BehaviorReader(problem), LoggedState(problem, problem.initial)
    found: dict[Symbol, Fraction] = {}
    for slot in timed.slots:
        for situation, key, value in (
            rules.changes(problem.domain.behaviors[slot.step.behavior], slot.step.arguments, facts) or ()
        ):
            facts.put(situation, key, value)
            found[Symbol(situation, key)] = slot.end
    return {goal: found[goal] for goal in problem.goal if goal in found}


def _random(first: int, limited: bool) -> Iterator[tuple[Problem, TimedPlan]]:
    for seed in range(498_100_000 + first, 499_000_000):
        problem = problem_of(timed_world(seed, limited=limited))
        plan = None if only_during(problem) else solve(Request(problem, limits=Limits(seconds=5.0))).plan
        timed = (
            concurrent.plan(problem, Limits(seconds=5.0))[1] if plan is None else best_in_time(problem, plan, 1.0)
        ).plan
        if timed is not None:
            yield problem, timed


def _run(problem: Problem, timed: TimedPlan, rng: Random, figures: Figures) -> None:
    """Execute a plan with random durations, and add the results to the figures."""
    counts = figures.counts
    factors = [Fraction(rng.randint(700, 1300), 1000) for _ in timed.slots]
    dispatch = Dispatch(problem, timed, SPREAD)
    planned = Dispatch(problem, timed)
    run = simulated(dispatch, lambda i, seconds: seconds * factors[i])
    untimed = replace(problem, times=Times(events=problem.times.events) if problem.times else None)
    if run.timed is None:
        counts["held back"] += 1
        begun = TimedPlan(Plan(tuple(slot.step for slot in run.slots)), run.slots)
        if validate_timed(replace(untimed, goal={}), begun, executed=True):
            counts["broken"] += 1
    else:
        counts["completed"] += 1
        if validate_timed(untimed, run.timed, executed=True):
            counts["broken"] += 1
    order_keeps, keeps, makespan, bound = _hindsight(planned, factors)
    if run.timed is not None and _late(problem, run.timed):
        counts["late"] += 1
        counts["late, order"] += order_keeps
        counts["late, clairvoyant"] += keeps
    if run.timed is not None and keeps and makespan:
        figures.ratios.append(float(run.timed.makespan / makespan))
        figures.bounds.append(float(run.timed.makespan / bound))


def _late(problem: Problem, timed: TimedPlan) -> bool:
    """Return whether an execution misses a deadline or overruns a window."""
    return any(
        "has to be by" in f.text or "isn't available" in f.text for f in validate_timed(problem, timed, executed=True)
    )


def _hindsight(planned: Dispatch, factors: list[Fraction]) -> tuple[bool, bool, Fraction, Fraction]:
    """Return whether the planned order keeps all times with the actual durations, and whether the best known schedule does.

    Also return the makespan of the best known schedule, and its lower bound.
    """
    order = planned.order
    actual = [
        replace(one, duration=one.duration * factor) for one, factor in zip(order.activities, factors, strict=True)
    ]
    network = network_of(replace(order, activities=tuple(actual)), more=[planned.network.unit / 1000])
    scale = planned.network.unit / network.unit
    lasts = {
        key: {m: int(its * factors[m] * scale) for m, its in by.items()} for key, by in planned.choices.lasts.items()
    }
    choices = ActorChoices(planned.choices.of, lasts)
    same = earliest(network, turn_edges(order, planned.turns))
    events = planned.problem.times.events if planned.problem.times else {}
    untimed = replace(planned.problem, times=Times(events=events))
    bound = least(order, network, choices)
    costs: tuple[float, float] = (inf, inf) if same is None else same.cost
    while (best := shortest(order, network, choices, inf, bound)) is not None:
        lasting = replace(network, durations=durations_with(network, choices, best.turns))
        no_more = ActorChoices({}, {key: {} for key in choices.lasts})
        timed = timed_plan(planned.problem, planned.plan, order, lasting, no_more, best)
        if timed is not None and not validate_timed(untimed, timed, executed=True):
            costs = min(costs, best.begins.cost)
            break
        moved = {turn for resource, line in enumerate(best.turns) for turn in line if turn[0] != resource}
        if not moved:
            break
        choices = replace(choices, of={turn: able for turn, able in choices.of.items() if turn not in moved})
    keeps = not costs[0]
    makespan = Fraction(costs[1]) * network.unit if keeps else Fraction(0)
    return same is not None and not same.late, keeps, makespan, bound * network.unit
