"""What isn't at rest is brought to rest: where a repair, or a plan, begins in the middle of something.

What a hand holds in the beginning is at no place that the level above knows, so that none of its steps may begin or end there.
"""

from __future__ import annotations

from confab.planner.hierarchical.serialization import Call
from confab.planner.hierarchical.subplans import Effort
from confab.reasoner.symbols import Problem

RESTING = Effort(depth=6)
"""To bring what isn't at rest there."""


def fresh_call(call: Call, problem: Problem, settled: bool = False) -> Call:
    """Return a call from the beginning once more, that knows which refinements were found and which weren't.

    If `settled`, what isn't at rest is brought to rest first.
    """
    other = Call(problem, call.using, call.segments.deadline, call.segments.most)
    other.refiner.found, other.refiner.failed = call.refiner.found, call.refiner.failed
    if settled:
        settle(other)
        other.settled = bool(other.steps)
    return other


def settle(call: Call) -> bool:
    """Bring everything that the upper levels don't know of to rest, the lowest level first; whether that succeeded.

    What a hand holds goes where it is wanted if that takes no longer, else to any place.
    """
    for level in reversed(call.program.levels[1:]):
        targets = call.restless(level)
        if not targets:
            continue
        hidden = {
            (name, key): call.goal[name, key]
            for name, cells in call.table.now.items()
            for key, value in cells.items()
            if call.problem.value_levels.get(value, 1) == level and (name, key) in call.goal
        }
        keep = call.segments.keeping({})
        for wanted in ({**targets, **hidden}, targets):
            steps = call.refiner.achieve(level, wanted, keep, RESTING)
            if steps is not None:
                call.steps.extend(steps)
                break
    return call.at_rest()
