"""The relaxed-plan heuristic h_FF, which also yields a relaxed plan and the applicable operators.

A layer contains the bits that are reached at the same time. A relaxed operator is reached when its last required bit is
reached. The cost of a bit is the sum of two parts: the cost of all repetitions of the cheapest operator that sets the bit, and
the costs of the bits that this operator requires. An operator that changes an amount is repeated until a comparison holds. The
number of repetitions is the difference divided by the operator's change, or one if the change depends on the state. The relaxed
plan consists of the supporters of the goal. A goal that is unreachable in the relaxed task is unreachable in the task.

The heuristic is described by Hoffmann and Nebel, "The FF planning system", JAIR 14 (2001). Additive costs choose the supporters,
as in Keyder and Geffner, "Heuristics for planning with action costs revisited", ECAI 2008. Repetitions are described by Scala,
Haslum, Thiébaux and Ramirez, "Subgoaling techniques for satisficing and optimal numeric planning", JAIR 68 (2020).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from heapq import heappop, heappush
from typing import NamedTuple, TypeAlias

from confab.planner.grounded.amounts import Exact, Linear, Move, pushes
from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.task import Task, bits_of

MOST_TIMES = 1000
"""Maximum number of repetitions that count for one operator."""
AmountPush: TypeAlias = "tuple[Linear, str, Exact | None]"
"""A difference, the required sign, and the change of the difference by an operator.

The change is None if the change depends on the state.
"""

Repetitions: TypeAlias = "tuple[int, ...]"
"""The number of repetitions of each `AmountPush` in a state; 0 if no number suffices."""
REMEMBERED = 1000
"""Number of states whose evaluation is remembered. Only the bits that operators or the goal require, and the repetitions, count."""


class Evaluation(NamedTuple):
    """The evaluation of a state: h, a relaxed plan sorted by layers, the applicable operators, and the work in bits."""

    h: int
    plan: list[int]
    applicable: list[int]
    work: int

    def ranked(self) -> tuple[list[int], int]:
        """Return the applicable operators, those of the relaxed plan first, and the number of these."""
        possible = set(self.applicable)
        preferred = [operator for operator in dict.fromkeys(self.plan) if operator in possible]
        return [*preferred, *sorted(possible.difference(preferred))], len(preferred)


Evaluate: TypeAlias = "Callable[[int], Evaluation | None]"
"""Function of a state that returns the evaluation, or None if the goal is unreachable from the state."""


def heuristic(task: Task) -> Evaluate:
    """Return the heuristic h_FF of a task as a function of a state."""
    needs, adds, owners, repeated = _relaxed(task)
    each = (sum(map(len, needs)) + sum(map(len, adds))) / max(len(needs), 1)
    asked = union(1 << bit for bit in set(task.needs.items.tolist())) | task.goal
    adds = _only(adds, asked)
    operators, goal = len(task), bits_of(task.goal)
    once = [0 if owner < 0 else 1 for owner in owners]
    groups, missing, needed_by = _grouped(needs, task.size)
    always = sorted(o for group, number in zip(groups, missing, strict=True) if not number for o in group)
    unreached = [-1] * task.size

    @lru_cache(REMEMBERED)
    def counted(repetitions: Repetitions) -> tuple[list[int], set[int]]:
        """Return the number of repetitions of each relaxed operator, and the operators that can't make their comparison true."""
        times, useless = once[:], set[int]()
        for number, found in zip(repetitions, repeated.values(), strict=True):
            for o in found:
                times[o] = number
            if not number:
                useless.update(found)
        return times, useless

    @lru_cache(REMEMBERED)
    def evaluated(state: int, repetitions: Repetitions) -> Evaluation | None:
        times, useless = counted(repetitions)
        left, cost, layer_of, supporter = missing[:], unreached[:], unreached[:], unreached[:]
        layer = bits_of(state)
        for bit in layer:
            cost[bit] = layer_of[bit] = 0
        reached, applicable, depth, number = always[:], None, 0, 0
        while True:
            for bit in layer:
                ready: list[int] = []
                for group in needed_by[bit]:
                    left[group] -= 1
                    if not left[group]:
                        ready += groups[group]
                if ready:
                    ready.sort()
                    reached += ready
            if applicable is None:
                applicable = [o for o in reached if o < operators]
            if useless:
                reached = [o for o in reached if o not in useless]
            depth += 1
            number += len(reached)
            layer = []
            for o in reached:
                total = times[o]
                for bit in needs[o]:
                    total += cost[bit]
                for bit in adds[o]:
                    known = cost[bit]
                    if known < 0:
                        cost[bit], supporter[bit], layer_of[bit] = total, o, depth
                        layer.append(bit)
                    elif total < known:
                        cost[bit], supporter[bit] = total, o
            # An operator of a later layer may need fewer repetitions.
            if not layer or (not repeated and all(cost[bit] >= 0 for bit in goal)):
                break
            reached = []
        if any(cost[bit] < 0 for bit in goal):
            return None
        chosen: dict[int, tuple[int, int]] = {}  # operator: first layer in which its effect is required, repetitions
        for bit, o in _supported(goal, needs, supporter):
            if (owner := owners[o]) >= 0:
                first, often = chosen.get(owner, (depth, 0))
                chosen[owner] = min(first, layer_of[bit]), max(often, times[o])
        applicable.sort()
        plan = sorted(chosen, key=lambda o: (chosen[o][0], o))
        if repeated:
            plan = [o for o in plan for _ in range(chosen[o][1])]
        return Evaluation(len(plan), plan, applicable, 1 + round(number * each))

    repetitions = _repetitions(task, repeated)
    return lambda state: evaluated(state & asked, repetitions(state))


def cost_left(task: Task) -> Callable[[int], float]:
    """Return a function from a state to the cost of a relaxed plan with the cheapest supporters.

    The cost is infinite if there is no relaxed plan. The state must be reachable from the task's initial state.
    """
    needs, adds, owners, repeated = _relaxed(task)
    costs = [0.0 if owner < 0 else task.costs[owner] for owner in owners]
    asked = _relevant(needs, adds, task) & ~_constant(task)
    needs, adds = _only(needs, asked), _only(adds, asked)
    groups, missing, needed_by = _grouped([bits if adds[o] else [] for o, bits in enumerate(needs)], task.size)
    groups = [[o for o in group if adds[o]] for group in groups]
    always = sorted(o for group, number in zip(groups, missing, strict=True) if not number for o in group)
    goal = bits_of(task.goal & asked)

    @lru_cache(REMEMBERED)
    def priced(repetitions: Repetitions) -> list[float]:
        """Return the cost of each operator with its repetitions.

        The cost is infinite if the operator can't make its comparison true.
        """
        price = costs[:]
        for number, found in zip(repetitions, repeated.values(), strict=True):
            times = number or math.inf
            for o in found:
                price[o] = times * costs[o] if costs[o] or times < math.inf else math.inf
        return price

    @lru_cache(REMEMBERED)
    def left(state: int, repetitions: Repetitions) -> float:
        price, open_ = priced(repetitions), missing[:]
        reached, supporter = [math.inf] * task.size, [-1] * task.size
        held = bits_of(state)
        for bit in held:
            reached[bit] = 0.0
        wanted = {bit for bit in goal if reached[bit]}
        ready = always[:]
        for bit in held:
            for group in needed_by[bit]:
                open_[group] -= 1
                if not open_[group]:
                    ready += groups[group]
        ready.sort()
        queue: list[tuple[float, int]] = []
        while True:
            for o in ready:
                total = price[o]
                for need in needs[o]:
                    total += reached[need]
                for bit in adds[o]:
                    if total < reached[bit]:
                        reached[bit], supporter[bit] = total, o
                        heappush(queue, (total, bit))
            if not queue or not wanted:
                break
            cost, bit = heappop(queue)
            ready = []
            if cost <= reached[bit]:
                wanted.discard(bit)
                for group in needed_by[bit]:
                    open_[group] -= 1
                    if not open_[group]:
                        ready += groups[group]
                ready.sort()
        if wanted:
            return math.inf
        chosen: dict[int, float] = {}
        for _, o in _supported(goal, needs, supporter):
            chosen[owners[o]] = max(chosen.get(owners[o], 0.0), price[o])
        return sum(chosen.values())

    repetitions = _repetitions(task, repeated)
    return lambda state: left(state & asked, repetitions(state))


def _repetitions(task: Task, repeated: Mapping[AmountPush, object]) -> Callable[[int], Repetitions]:
    """Return a function from a state to the number of repetitions of each `AmountPush`."""
    amounts, known = task.amounts, dict[int, Repetitions]()
    if amounts is None or not repeated:
        return lambda state: ()
    differences = list(dict.fromkeys(difference for difference, _, _ in repeated))
    asked = [(differences.index(difference), sign, push) for difference, sign, push in repeated]
    same = dict[Repetitions, Repetitions]()

    def of(state: int) -> Repetitions:
        found = known.get(state >> amounts.size)
        if found is None:
            vector = amounts.vector(state)
            worth = [difference.of(vector) for difference in differences]
            found = tuple([_times(worth[place], sign, push) for place, sign, push in asked])
            found = known[state >> amounts.size] = same.setdefault(found, found)
        return found

    return of


def _relevant(needs: Sequence[Sequence[int]], adds: Sequence[Sequence[int]], task: Task) -> int:
    """Return the mask of the bits that the goal requires, directly or through relaxed operators."""
    setters = by_bit(adds, task.size)
    waiting = bits_of(task.goal)
    found, seen = set(waiting), set[int]()
    for bit in waiting:  # the loop appends bits to the list
        for o in setters[bit]:
            if o not in seen:
                seen.add(o)
                fresh = [need for need in needs[o] if need not in found]
                found.update(fresh)
                waiting += fresh
    return union(1 << bit for bit in found)


def _constant(task: Task) -> int:
    """Return the mask of the initial bits that no operator clears."""
    cleared = union(bits for operator in range(len(task)) for _, bits, _ in task.changes_of(operator)[1])
    compared = 0 if task.amounts is None else task.amounts.compared
    return task.initial & (1 << task.size) - 1 & ~(cleared | task.derived.mask | compared)


def _only(lists: Sequence[Sequence[int]], mask: int) -> list[list[int]]:
    """Return the bits of each list that are in a mask."""
    asked = set(bits_of(mask))
    return [[bit for bit in bits if bit in asked] for bits in lists]


def _grouped(needs: Sequence[Sequence[int]], size: int) -> tuple[list[list[int]], list[int], list[list[int]]]:
    """Return groups of relaxed operators that require the same bits.

    Also return the number of bits that each group requires, and, for each bit, the groups that require the bit.
    """
    groups = dict[tuple[int, ...], list[int]]()
    for o, bits in enumerate(needs):
        groups.setdefault(tuple(bits), []).append(o)
    return list(groups.values()), [len(bits) for bits in groups], by_bit(list(groups), size)


def by_bit(lists: Sequence[Sequence[int]], size: int) -> list[list[int]]:
    """Return, for each bit, the numbers of the lists that contain the bit."""
    found: list[list[int]] = [[] for _ in range(size)]
    for number, bits in enumerate(lists):
        for bit in bits:
            found[bit].append(number)
    return found


def _supported(
    goal: Sequence[int], needs: Sequence[Sequence[int]], supporter: Sequence[int]
) -> Iterator[tuple[int, int]]:
    """Yield the bits that a relaxed plan reaches for the goal, each with its supporter."""
    waiting, seen = list(goal), set(goal)
    while waiting:
        bit = waiting.pop()
        o = supporter[bit]
        if o >= 0:
            yield bit, o
            fresh = [need for need in needs[o] if need not in seen]
            seen.update(fresh)
            waiting += fresh


def _relaxed(task: Task) -> tuple[list[list[int]], list[list[int]], list[int], dict[AmountPush, list[int]]]:
    """Return the required bits, the added bits and the owners of the relaxed operators.

    Also return the relaxed operators of each `AmountPush`. An operator has a separate relaxed operator for each
    comparison that the operator may make true. The owner of a relaxed operator is the operator from which the relaxed
    operator was made.
    """
    needs, adds, owners = task.needs.lists(), task.adds.lists(), list(task.owners)
    repeated = defaultdict[AmountPush, list[int]](list)
    if task.amounts is not None:
        compared = {bit: key for key, bit in task.amounts.bits.items()}
        for o, bits in enumerate(adds[:]):
            for bit in bits if not compared.keys().isdisjoint(bits) else ():
                if bit in compared:
                    difference, sign = compared[bit]
                    repeated[difference, sign, _push(task, o, difference, sign)].append(len(owners))
                    needs.append(needs[o])
                    adds.append([bit])
                    owners.append(owners[o])
            adds[o] = [bit for bit in bits if bit not in compared]
    return needs, adds, owners, repeated


def _push(task: Task, relaxed: int, difference: Linear, sign: str) -> Exact | None:
    """Return the greatest change of a difference by a relaxed operator, or None if the change depends on the state.

    Other conditional changes by the same operator count if they help. Several such changes may have the required sum, although none
    of them suffices. If the sign is "=", they may help in any direction, so that the change depends on the state.
    """
    amounts, owner = task.amounts, task.owners[relaxed]
    assert amounts is not None
    moves = amounts.made(owner) if owner >= 0 else ()
    own = union(1 << bit for bit in task.needs[relaxed]) if any(move.when for move in moves) else 0
    certain, others = list[Move](), list[Move]()
    for move in moves:
        (certain if move.when & own == move.when else others).append(move)
    alone = [(move, pushes([move], difference)) for move in others]
    if sign == "=" and any(push is not False and push != 0 for _, push in alone):
        return None
    found = pushes(certain + [move for move, push in alone if push is None or push > 0], difference)
    return None if isinstance(found, bool) else found


def _times(amount: Exact, sign: str, push: Exact | None) -> int:
    """Return the number of applications of an operator until a difference has the required sign.

    Return 0 if no number of applications suffices.
    """
    if push is None:
        return 1
    if sign == "=":
        amount, push = (amount, push) if amount < 0 else (-amount, -push)
    if push <= 0:
        return 0
    times = max(-(amount // push), 1)
    if sign == ">" and amount + times * push == 0:
        times += 1
    return min(times, MOST_TIMES)
