"""Validation of plans by the rules of docs/levels.md, computed by the plain interpreter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from confab.planner.plan import Plan, Step
from worlds.interpreter import NOTHING, Interpreter, State


def faults(of: Interpreter, plan: Plan) -> list[str]:
    """Return the faults of a plan by the rules of docs/levels.md; empty if the plan is valid."""
    walk = _Walk(of)
    end = walk.sequence(plan.steps, 0, of.initial, False)
    if end is not None and not of.wanted(end):
        walk.faults.append("the goal isn't reached")
    return walk.faults


def cost(of: Interpreter, plan: Plan) -> Any:
    """Return the total cost of a plan's steps of the lowest level."""
    return executed(of, plan)[0]


def executed(of: Interpreter, plan: Plan) -> tuple[Any, State]:
    """Return the total cost of a plan's steps of the lowest level, and the state after the steps or before an inapplicable step."""
    state, total = of.initial, 0
    for step in plan.at_level(of.problem.domain.levels[-1]):
        made = next(of.done(step.behavior, step.arguments, state), None)
        if made is None:
            return NOTHING, state
        total, state = total + made[0], made[1]
    return total, state


class _Walk:
    """The step-by-step execution of a plan."""

    def __init__(self, interpreter: Interpreter) -> None:
        self.of, self.problem = interpreter, interpreter.problem
        self.levels, self.faults = self.problem.domain.levels, list[str]()
        kinds = self.problem.domain.situations
        self.rests = [slot for slot, symbol in enumerate(self.of.symbols) if kinds[symbol.situation].rest is not None]

    def sequence(
        self, steps: Sequence[Step], above: int, state: State, inside: bool, outer: set[int] | None = None
    ) -> State | None:
        """Execute the steps that refine a step of level `above`, where level 0 is the task; return the final state.

        The symbols that steps of the sequence change are added to `outer`, even if a later step changes them back.
        """
        level = next((level for level in self.levels if level > above), None)
        if level is None:
            if steps:
                self.faults.append("steps below the lowest level")
                return None
            return state
        touched: set[int] = set()
        position = 0
        while position < len(steps):
            before, last = state, position + 1
            if steps[position].level == level:
                after = self.step(steps[position], state, touched)
            elif steps[position].level > level:
                while last < len(steps) and steps[last].level > level:
                    last += 1
                after = self.sequence(steps[position:last], level, state, inside, touched)
            else:
                self.faults.append("a step has a higher level than its parent")
                return None
            if after is None:
                return None
            position, state = last, after
            touched |= {slot for slot in self.rests if before[slot] != state[slot]}
        if outer is not None:
            outer |= touched
        for slot in touched:
            symbol = self.of.symbols[slot]
            at_rest = state[slot] == self.problem.domain.situations[symbol.situation].rest
            own = above < self.problem.first_level(symbol) <= level
            if own and not at_rest and (inside or not self.problem.releases(symbol)):
                self.faults.append(f"{symbol} is left {state[slot]}, not at rest")
        return state

    def step(self, step: Step, state: State, touched: set[int]) -> State | None:
        """Execute a step, or steps that are refined together, with the refinement; return the final state.

        The symbols that steps which are refined together state to change are added to `touched`.
        """
        made = [state]
        for one in step.together:
            if step.joined and (one.level != step.level or not step.steps or (one is not step and one.steps)):
                self.faults.append(f"{step} can't be refined together")
                return None
            done = [
                (before, after) for before in made for _, after in self.of.done(one.behavior, one.arguments, before)
            ]
            made = [after for _, after in done]
            if step.joined and len(done) == 1:
                touched |= {slot for slot in self.rests if done[0][0][slot] != done[0][1][slot]}
        if not made:
            self.faults.append(f"{step} can't be done")
            return None
        if step.level == self.levels[-1]:
            if step.steps:
                self.faults.append(f"{step} is of the lowest level, but has steps")
            return made[0]
        end = self.sequence(step.steps, step.level, state, True)
        if end is None:
            return None
        if not any(self.as_said(step.level, state, said, end) for said in made):
            self.faults.append(f"the refinement of {step} has another result than the step")
        return end

    def as_said(self, level: int, before: State, said: State, end: State) -> bool:
        """Return whether, after a refinement, all symbols visible on a level have the values that the refined step determines."""
        for slot in range(self.of.stated):
            symbol = self.of.symbols[slot]
            seen = self.problem.first_level(symbol) <= level and symbol.situation not in self.problem.domain.remembers
            hidden = said[slot] == before[slot] and self.problem.value_levels.get(str(before[slot]), 1) > level
            if seen and not hidden and end[slot] != said[slot]:
                return False
        return True
