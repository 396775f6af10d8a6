"""The relaxed-plan heuristic where there are amounts: an operator that moves an amount is counted as often as it takes.

As `confab.planner.grounded.hff`, but that a comparison costs so many times its operator as the amount is away, divided by how
far the
operator moves it; once where that depends on the state. A comparison that nothing moves towards what is wanted is never reached,
so that the relaxed plan that isn't there proves that there is no plan.

Scala, Haslum, Thiébaux and Ramirez, "Subgoaling techniques for satisficing and optimal numeric planning", JAIR 68 (2020).
"""

from __future__ import annotations

import heapq
from fractions import Fraction
from math import ceil

from confab.planner.grounded.amounts import Exact, Linear, Move, pushes
from confab.planner.grounded.hff import Evaluate, Evaluation
from confab.planner.grounded.task import Task, bits_of

MOST_TIMES = 1000
"""An operator is counted so often at most: a distance has to be told from a longer one, and no more."""


def heuristic(task: Task) -> Evaluate:
    """Return h of a task that has amounts, as a function of a state; the relaxed plan has an operator as often as it is counted."""
    amounts = task.amounts
    assert amounts is not None
    operators, owners, needs = len(task), task.owners, task.needs.lists()
    compared: dict[int, tuple[Linear, str]] = {bit: key for key, bit in amounts.bits.items()}
    adds = [[bit for bit in bits if bit not in compared] for bits in task.adds.lists()]
    moving: list[list[tuple[int, Linear, str, Exact | None]]] = [[] for _ in owners]
    for o, bits in enumerate(task.adds.lists()):
        for bit in bits:
            if bit in compared:
                moving[o].append((bit, *compared[bit], _push(task, o, compared[bit][0])))
    step = [0 if owner < 0 else 1 for owner in owners]
    missing = [len(bits) for bits in needs]
    always = [o for o, number in enumerate(missing) if not number]
    needed_by: list[list[int]] = [[] for _ in range(task.size)]
    for o, bits in enumerate(needs):
        for bit in bits:
            needed_by[bit].append(o)
    goal, low = bits_of(task.goal), (1 << task.size) - 1

    def evaluate(state: int) -> Evaluation:
        vector = amounts.vector(state)
        left, cost = missing[:], [-1] * task.size
        supporter: list[tuple[int, int]] = [(-1, 0)] * task.size  # operator, and how often
        queue = [(0, bit, -1, 0) for bit in bits_of(state & low)]
        applicable: list[int] = []

        def done(o: int) -> None:
            price = step[o] + sum(cost[bit] for bit in needs[o])
            if o < operators and all(state >> bit & 1 for bit in needs[o]):
                applicable.append(o)
            for bit in adds[o]:
                if cost[bit] < 0:
                    heapq.heappush(queue, (price, bit, o, 1))
            for bit, difference, sign, push in moving[o]:
                if cost[bit] < 0:
                    times = _times(difference.of(vector), sign, push)
                    if times:
                        heapq.heappush(queue, (price + (times - 1) * step[o], bit, o, times))

        for o in always:
            done(o)
        while queue:
            price, bit, o, times = heapq.heappop(queue)
            if cost[bit] >= 0:
                continue
            cost[bit], supporter[bit] = price, (o, times)
            for other in needed_by[bit]:
                left[other] -= 1
                if not left[other]:
                    done(other)
        if any(cost[bit] < 0 for bit in goal):
            return None
        chosen: dict[int, tuple[int, int]] = {}  # operator: what its effect costs, how often
        waiting, seen = goal[:], set(goal)
        while waiting:
            bit = waiting.pop()
            o, times = supporter[bit]
            if o >= 0:
                owner = owners[o]
                if owner >= 0:
                    first, known = chosen.get(owner, (cost[bit], 0))
                    chosen[owner] = min(first, cost[bit]), max(known, times)
                for need in needs[o]:
                    if need not in seen:
                        seen.add(need)
                        waiting.append(need)
        plan = sorted(chosen, key=lambda o: (chosen[o][0], o))
        applicable.sort()
        return sum(times for _, times in chosen.values()), [o for o in plan for _ in range(chosen[o][1])], applicable

    return evaluate


def repeats(task: Task) -> bool:
    """Whether the relaxed plan of the initial state does something more than once: else h of FF says the same, and faster."""
    evaluation = heuristic(task)(task.initial)
    return evaluation is not None and len(set(evaluation[1])) < len(evaluation[1])


def _push(task: Task, relaxed: int, difference: Linear) -> Exact | None:
    """Return how far a relaxed operator moves a difference; None if that depends on the state."""
    amounts = task.amounts
    assert amounts is not None
    moves: list[Move] = []
    if task.owners[relaxed] >= 0:
        own = sum(1 << bit for bit in task.needs[relaxed])
        moves = [move for move in amounts.moves(task.owners[relaxed]) if move.when & own == move.when]
    found = pushes(moves, difference)
    return None if isinstance(found, bool) else found


def _times(amount: Exact, sign: str, push: Exact | None) -> int:
    """Return how often an operator has to be done until a difference is what its sign says; 0 if never."""
    if push is None:
        return 1
    if sign == "=":
        amount, push = (amount, push) if amount < 0 else (-amount, -push)
    if push <= 0:
        return 0
    times = max(ceil(Fraction(-amount) / Fraction(push)), 1)
    if sign == ">" and amount + times * push == 0:
        times += 1
    return min(times, MOST_TIMES)
