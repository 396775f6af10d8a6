"""The relaxed-plan heuristic h_FF, which also tells what is applicable and what is preferred.

Bits are reached in layers, a relaxed operator when the last bit it needs is. A bit's cost is that of its cheapest
operator so far (one, plus the costs of what the operator needs); the operators behind the goal make the relaxed plan.
Operators that are reached with the first layer are the applicable ones: no successor generator is needed.

Hoffmann and Nebel, "The FF planning system", JAIR 14 (2001); additive costs choose the supporters, as in Keyder and
Geffner, "Heuristics for planning with action costs revisited", ECAI 2008.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

from confab.planner.grounded.task import Task

Evaluation: TypeAlias = "tuple[int, list[int], list[int]] | None"
"""h, the relaxed plan in the order of its layers, the applicable operators; None if the goal isn't reachable even so."""

Evaluate: TypeAlias = Callable[[int], Evaluation]


class EvaluateFor(Protocol):
    """Evaluates a state, for the goal of the task or for other bits."""

    def __call__(self, state: int, goal: Sequence[int] = ...) -> Evaluation:
        """Return h of a state."""


def heuristic(task: Task) -> EvaluateFor:
    """Return h_FF of a task, as a function of a state."""
    operators, owners = len(task), task.owners
    needs, adds = task.needs.lists(), task.adds.lists()
    step = [0 if owner < 0 else 1 for owner in owners]
    missing = [len(bits) for bits in needs]
    always = [o for o, number in enumerate(missing) if not number]
    needed_by: list[list[int]] = [[] for _ in range(task.size)]
    for o, bits in enumerate(needs):
        for bit in bits:
            needed_by[bit].append(o)
    whole = _bits(task.goal, task.size)
    unreached = [-1] * task.size
    size = (task.size + 7) // 8
    of_byte = [[b for b in range(8) if byte >> b & 1] for byte in range(256)]

    def evaluate(state: int, goal: Sequence[int] = whole) -> Evaluation:
        left, cost, layer_of, supporter = missing[:], unreached[:], unreached[:], unreached[:]
        layer = [8 * i + b for i, byte in enumerate(state.to_bytes(size, "little")) if byte for b in of_byte[byte]]
        for bit in layer:
            cost[bit] = layer_of[bit] = 0
        reached, applicable, depth = always[:], None, 0
        while True:
            for bit in layer:
                for o in needed_by[bit]:
                    left[o] -= 1
                    if not left[o]:
                        reached.append(o)
            if applicable is None:
                applicable = [o for o in reached if o < operators]
            depth += 1
            layer = []
            for o in reached:
                total = step[o]
                for bit in needs[o]:
                    total += cost[bit]
                for bit in adds[o]:
                    known = cost[bit]
                    if known < 0:
                        cost[bit], supporter[bit], layer_of[bit] = total, o, depth
                        layer.append(bit)
                    elif total < known:
                        cost[bit], supporter[bit] = total, o
            if not layer or all(cost[bit] >= 0 for bit in goal):
                break
            reached = []
        if any(cost[bit] < 0 for bit in goal):
            return None
        chosen: dict[int, int] = {}  # operator: layer in which its effect is wanted first
        waiting, seen = list(goal), set(goal)
        while waiting:
            bit = waiting.pop()
            o = supporter[bit]
            if o >= 0:
                owner = owners[o]
                if owner >= 0:
                    chosen[owner] = min(layer_of[bit], chosen.get(owner, depth))
                for need in needs[o]:
                    if need not in seen:
                        seen.add(need)
                        waiting.append(need)
        applicable.sort()
        return len(chosen), sorted(chosen, key=lambda o: (chosen[o], o)), applicable

    return evaluate


def _bits(state: int, size: int) -> list[int]:
    return [bit for bit in range(size) if state >> bit & 1]
