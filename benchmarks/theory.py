"""The paper's equations in the paper's task: expansions by episode, with memory, and without levels."""

from __future__ import annotations

from dataclasses import replace

import confab
from confab.planner.plan import Limits, Outcome
from confab.planner.solve import Request, solve
from confab.reasoner.problem import Problem
from confab.reasoner.reading.quantification import quantify

EPISODES = 5
FLAT = 200_000


def flat(scene: confab.Scene) -> Outcome:
    """Return the outcome of the paper's search on the level of primitives alone."""
    problem = scene.problem
    lowest = problem.domain.levels[-1]
    behaviors = {name: b for name, b in problem.domain.behaviors.items() if b.level == lowest}
    alone: Problem = replace(problem, domain=replace(problem.domain, behaviors=behaviors))
    grounds = {lowest: quantify(scene.knowledge, scene.reading, lowest)}
    return solve(Request(alone, "paper", Limits(expansions=FLAT), None, None, grounds))


def main() -> None:
    """Print the tables."""
    scene = confab.load("beverage-serving")
    curve = confab.practise(scene, confab.Memory.of(scene), rounds=EPISODES)
    print("| episode | " + " | ".join(str(number + 1) for number in range(EPISODES)) + " |")
    print("|---" * (EPISODES + 1) + "|")
    for name, values in (
        ("the paper's mode, no memory", curve.without["paper"]),
        ("the paper's mode, with the memory of the earlier episodes", curve.with_memory["paper"]),
        ("the default planner, no memory", curve.without["guarded"]),
    ):
        print(f"| {name} | " + " | ".join(str(value) for value in values) + " |")
    outcome = flat(scene)
    expanded = sum(counts.expanded for counts in outcome.search.values())
    print(f"\nPrimitives alone, without levels: {outcome.status.value} after {expanded:,} expansions.")


if __name__ == "__main__":
    main()
