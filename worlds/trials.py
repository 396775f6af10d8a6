"""Plans with the states before their primitives, and the remaining steps of plans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from confab.planner.hierarchical.planner import plan as hierarchical_plan
from confab.planner.plan import Plan, Step
from confab.planner.validation import successor
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State


@dataclass(frozen=True)
class Trial:
    """A problem, a plan for the problem, and the state before each primitive and at the end."""

    problem: Problem
    plan: Plan
    states: tuple[State, ...]

    @classmethod
    def of(cls, problem: Problem) -> Trial:
        """Return the trial of a problem with a new plan and its states."""
        found = hierarchical_plan(problem).plan
        assert found is not None
        states = [problem.initial]
        for step in found.primitives:
            after = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, states[-1])
            assert after is not None
            states.append(after)
        return cls(problem, found, tuple(states))


def rest_after(plan: Plan, count: int) -> list[Step]:
    """Return the rest of a plan after `count` primitives."""
    gone = {step.path for step in plan.primitives[:count]}

    def left(steps: Sequence[Step]) -> list[Step]:
        kept = [
            replace(s, steps=tuple(left(s.steps))) if s.steps else s for s in steps if s.steps or s.path not in gone
        ]
        return [s for s in kept if s.steps or (s.path not in gone and s.level == plan.primitives[0].level)]

    return left(plan.steps)
