"""Durations learned from ten executions, and how well they predict the eleventh.

    python -m benchmarks durations

Two hands serve beverages; one hand takes 1.5 times as long as the other. Each behaviour has a true duration from 1 to 4 s, and each
execution of a primitive deviates by up to 30 %. The first execution is planned without known durations.
"""

from __future__ import annotations

from fractions import Fraction
from math import exp, log
from random import Random

from confab.planner.plan import Step
from confab.planner.solve import Request, solve
from confab.planner.timed.call import in_time
from confab.planner.timed.dispatch import Dispatch, simulated
from confab.planner.timed.measuring import measured, with_durations
from confab.reasoner.memory.experience import Statistics
from confab.reasoner.problem import Problem
from worlds.families import family

EPISODES, WORLDS, SLOWER = 10, 10, Fraction(3, 2)
OBJECTS = 4


def main() -> None:
    """Print the table."""
    steps: list[float] = []
    inside: list[bool] = []
    makespans: list[float] = []
    before: list[float] = []
    ratios: list[float] = []
    for seed in range(WORLDS):
        rng = Random(seed)
        executed: list[tuple[Step, float]] = []
        for number in range(EPISODES + 1):
            problem = family("served", OBJECTS, 100 * seed + number)
            statistics = measured(problem, executed)
            seconds, planned, actual = _executed(problem, statistics, seed, rng)
            if number in (0, EPISODES):
                (makespans if number else before).append(abs(log(planned / actual)))
            if number == EPISODES:
                for step, its in seconds:
                    one = statistics[step.behavior, step.arguments[0]]
                    steps.append(abs(one.mean - its) / its)
                    inside.append(abs(one.mean - its) <= 2 * one.spread)
                known = [
                    name for name, actor in statistics if actor == "left_hand" and (name, "right_hand") in statistics
                ]
                ratios += [statistics[n, "right_hand"].mean / statistics[n, "left_hand"].mean for n in known]
            executed += seconds
    print(f"Worlds: {WORLDS}; executions before the prediction: {EPISODES}\n\n| | |\n|---|---|")
    print(f"| duration of a primitive, mean relative error | {sum(steps) / len(steps):.3f} |")
    print(f"| primitives within two standard deviations | {sum(inside)} of {len(inside)} |")
    print(
        f"| makespan predicted ÷ actual, eleventh execution, mean factor | {exp(sum(makespans) / len(makespans)):.3f} |"
    )
    print(f"| the same of the first execution, with one second each | {exp(sum(before) / len(before)):.3f} |")
    mean = sum(ratios) / len(ratios)
    print(
        f"| duration of the slower hand ÷ the other (true: 1.5) | {mean:.3f}, from {min(ratios):.2f} to {max(ratios):.2f} |"
    )


def _executed(
    problem: Problem, statistics: Statistics, seed: int, rng: Random
) -> tuple[list[tuple[Step, float]], float, float]:
    """Plan with the statistics and execute; return the durations, the planned makespan and the actual makespan."""
    known = with_durations(problem, statistics)
    plan = solve(Request(known)).plan
    assert plan is not None
    timed = in_time(known, plan).plan
    assert timed is not None
    dispatch = Dispatch(known, timed, Fraction(3, 10))

    def actual(number: int, _: Fraction) -> Fraction:
        step = dispatch.step(number)
        true = Fraction(Random(f"{seed} {step.behavior}").randint(10, 40), 10)
        return true * (SLOWER if step.arguments[0] == "right_hand" else 1) * Fraction(rng.randint(700, 1300), 1000)

    run = simulated(dispatch, actual)
    assert run.timed is not None
    seconds = [(slot.step, float(slot.end - slot.begin)) for slot in run.slots]
    return seconds, float(timed.makespan), float(run.timed.makespan)


if __name__ == "__main__":
    main()
