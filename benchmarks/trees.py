"""Execution of exported behaviour trees, run by ``python -m benchmarks.trees [--runner RUNNER] [--disturbances N]``.

The trees of ten plans are ticked by py_trees. With a runner (the compiled ``benchmarks/btcpp/runner.cpp``), the trees
are also ticked by BehaviorTree.CPP. Then changed facts are undone at random during executions by py_trees and by
Confab.
"""

from __future__ import annotations

import argparse
import random
import subprocess
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import confab
from confab.planner.acting.episode import End
from confab.planner.acting.executive import act
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.acting.world import WorldReport
from confab.planner.behavior_tree import Situation
from confab.planner.plan import Plan, Step
from confab.planner.validation import open_goals
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE
from confab.trees import Tree, behavior_tree, export_trees, filled, ticked

NAMES = (
    "rooms-snacks",
    "rooms-waste",
    "rooms-breakfast",
    "beverage-serving",
    "two-cups",
    "cereal-serving",
    "couriers-small",
    "drawers-small",
    "gallery-small",
    "packing-small",
)


class Undone(SymbolicWorld):
    """A world in which one changed fact gets its initial value again after some primitives."""

    def __init__(self, problem: Problem, after: int, draw: random.Random) -> None:
        super().__init__(problem)
        self.left, self.draw = after, draw

    def execute(self, step: Step) -> WorldReport:
        """Execute a primitive; after the chosen primitive, undo a change."""
        said = super().execute(step)
        self.left -= 1
        if self.left == 0:
            goals = [s for s in self.problem.goal if self.state.get(s, FALSE) != self.problem.initial.get(s, FALSE)]
            taken = {value for symbol, value in self.state.items()}
            free = [s for s in sorted(goals) if s.arguments[0] not in taken]
            if free:
                symbol = self.draw.choice(free)
                self.state[symbol] = self.problem.initial.get(symbol, FALSE)
        return said


def by_py_trees(problem: Problem, tree: Tree, path: Path, world: SymbolicWorld) -> tuple[bool, list[str]]:
    """Return whether py_trees reaches SUCCESS, and the primitives in their order."""
    done: list[str] = []
    reached = ticked(filled(tree, path, problem, world, lambda step: done.append(str(step))), 3000)
    return reached and not open_goals(replace(problem, initial=world.state)), done


def by_btcpp(problem: Problem, tree: Tree, path: Path, runner: Path) -> tuple[bool, list[str]]:
    """Return whether BehaviorTree.CPP reaches SUCCESS, and the primitives in their order."""
    world, done = SymbolicWorld(problem), list[str]()
    with subprocess.Popen([runner, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for line in process.stdout:
            key = line.strip()
            if key not in tree.leaves:
                return key == "SUCCESS" and not open_goals(replace(problem, initial=world.state)), done
            leaf = tree.leaves[key]
            if key.startswith("a") and isinstance(leaf, Step):
                done.append(str(leaf))
                said = world.execute(leaf).ok
            else:
                said = Situation(problem, world.observe()).asks(leaf)
            process.stdin.write(f"{int(said)}\n")
            process.stdin.flush()
    return False, done


def order_kept(done: list[str], plan: Plan) -> str:
    """Return whether primitives have the plan's order, with the answer ``in parallel`` if only independent pairs differ."""
    if done == [str(step) for step in plan.primitives]:
        return "yes"
    individuals = {individual for step in plan.primitives for individual in step.arguments}
    by_individual = (
        (
            [str(step) for step in plan.primitives if one in step.arguments],
            [each for each in done if one in each.split()],
        )
        for one in individuals
    )
    return "in parallel" if all(ours == theirs for ours, theirs in by_individual) else "no"


def main() -> None:
    """Print the results of ten plans, and of plans with disturbances."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runner", type=Path)
    parser.add_argument("--disturbances", type=int, default=50)
    given = parser.parse_args()
    plans: dict[str, tuple[Problem, Plan]] = {}
    print(
        "| plan | primitives | py_trees | in our order | BehaviorTree.CPP | in our order |\n|---|---|---|---|---|---|"
    )
    with TemporaryDirectory() as folder:
        for name in NAMES:
            scene = confab.load(name)
            plan = scene.plan().plan
            assert plan is not None
            plans[name] = scene.problem, plan
            tree = behavior_tree(scene.problem, plan)
            xml, python = export_trees(scene.problem, plan, Path(folder) / name)
            ok, done = by_py_trees(scene.problem, tree, python, SymbolicWorld(scene.problem))
            row = [name, str(len(plan.primitives)), "SUCCESS" if ok else "failed", order_kept(done, plan)]
            if given.runner is not None:
                ok, done = by_btcpp(scene.problem, tree, xml, given.runner)
                row += ["SUCCESS" if ok else "failed", order_kept(done, plan)]
            print("| " + " | ".join(row) + " |", flush=True)
        alone = ours = 0
        for seed in range(given.disturbances):
            draw = random.Random(seed)
            name = draw.choice(NAMES)
            problem, plan = plans[name]
            after = draw.randrange(1, len(plan.primitives) + 1)
            tree, python = behavior_tree(problem, plan), Path(folder) / name / "tree.py"
            alone += by_py_trees(problem, tree, python, Undone(problem, after, random.Random(seed)))[0]
            ours += act(problem, Undone(problem, after, random.Random(seed)), plan).status is End.REACHED
    print(f"\n{given.disturbances} disturbances: {alone} goals reached by the tree alone, {ours} by our executive")


if __name__ == "__main__":
    main()
