"""Reduction of the cost of a plan by replacing windows, that is, sequences of consecutive steps.

A replacement starts in the same state as the window, and sets the bits that later steps and the goal require. The amounts after
the replacement must still let the later steps reach the goal. The search for a replacement uses the operators nearest to the
window. An operator is near if few steps lead from the start of the window to the operator, and few steps from the operator to
the end of the window. The search is A* with h_FF (`confab.planner.grounded.shortest`). A state is dropped if, according to h,
no cheaper plan leads through the state.

First, the order of all steps may change (`confab.planner.grounded.routes`). Windows of steps are tried on the resulting plan and
on a regrouped plan, in which each step follows a step on which it depends. The given order is kept if the other order saves
nothing. Finally, the remaining work is spent on the whole plan as one window, with all operators: first with a greater weight of
h, then with a lower bound. Of two equally cheap plans, the plan with fewer steps counts as cheaper (`TRIFLE`).

Work is counted in examined operators instead of seconds. Therefore the result is the same on every machine.

Action elimination (`shortened`) is described by Nakhost and Müller, "Action elimination and plan neighborhood graph search", ICAPS
2010. Windows of plans are described by Siddiqui and Haslum, "Continuing plan quality optimisation", JAIR 54 (2015).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from confab.planner.grounded.amounts import Linear
from confab.planner.grounded.derived_arrays import union
from confab.planner.grounded.hff import cost_left
from confab.planner.grounded.joins import Ints
from confab.planner.grounded.routes import rerouted
from confab.planner.grounded.shortest import Estimate, each_goal_alone, shortest
from confab.planner.grounded.task import Grouped, Task, bits_of
from confab.planner.plan_costs import TRIFLE

STATES, STEPS = 400, 12
"""At first, a cheapest plan is searched with at most `STATES` states, if the given plan has at most `STEPS` steps."""
WAYS = 20
"""Number of alternatives of derived bits that are processed in the time in which one operator is examined."""
SIZES = (8, 16, 32)
"""Lengths of windows in steps; a long window can contain a whole round trip that a shorter plan avoids."""
OPERATORS, EVALUATIONS, SHARE = 150, 100, 2_000
"""Limits of the search for a cheaper window of steps: the number of operators, and the minimum number of evaluations of h_FF.

The maximum number of evaluations is `EVALUATIONS`, or the work divided by `SHARE` if this is greater.
"""
WEIGHT = 3
"""Weight of h_FF when the whole plan is searched again with all operators."""
REMAINING = 4
"""Divisor of the work that remains for windows if another route made the plan cheaper."""
RANKED = 20
"""Work of ranking a state by the lower bound."""
TRIALS = 2_000_000
"""Maximum number of replayed operators when superfluous steps are removed."""
LOOK = 50
"""Number of operators that are ranked in the time in which one operator is examined."""


def shorter(
    task: Task, plan: Sequence[int], work: int, deadline: float | None = None, routes: bool = True
) -> list[int]:
    """Return a plan that costs at most as much as the given plan.

    The result is a cheapest plan if a search of few states proves this; otherwise some windows of steps may be replaced.

    Parameters
    ----------
    task : Task
    plan : sequence of int
        Operators that lead from the task's initial state to its goal.
    work : int
        Maximum number of examined operators; the function examines half a million to a million operators per second. Routes may
        take more (`confab.planner.grounded.routes.LEAST_WORK`).
    deadline : float, optional
        The deadline on the clock of `time.perf_counter`.
    routes : bool
        Whether the order of all steps may change, in a plan of the lowest level (`confab.planner.grounded.routes`).
    """
    if task.prices or len(set(task.costs)) > 1 or not any(task.costs):
        prices = {operator: price.plus(Linear((), Fraction(TRIFLE))) for operator, price in task.prices.items()}
        task = replace(task, costs=[cost + TRIFLE for cost in task.costs], prices=prices)
    best = cheaper(task, plan, without_superfluous_steps(task, plan, deadline))
    work -= len(plan) ** 2 // 2  # about the number of replayed operators
    if len(best) <= STEPS:
        best, proved = proved_cheapest(task, best, work, deadline)
        if proved:
            return best
    if routes and task.level == task.problem.domain.levels[-1]:
        before, best = task.cost_of(best), rerouted(task, best, work, deadline)
        work //= REMAINING if task.cost_of(best) < before else 1
    windows = _Windows(task, work, max(EVALUATIONS, work // SHARE), deadline)
    while True:
        before = task.cost_of(best)
        for size in SIZES:
            if windows.over:
                break
            best = windows.pass_over(best, size)
            best = cheaper(task, best, windows.pass_over(regrouped(task, best), size))
        if task.cost_of(best) < before:
            best = cheaper(task, best, without_superfluous_steps(task, best, deadline))
            windows.work -= len(best) ** 2 // 2
        if task.cost_of(best) == before or windows.over:
            return cheaper(task, windows.restarted(best), plan)


def cheaper(task: Task, plan: Sequence[int], other: Sequence[int]) -> list[int]:
    """Return the cheaper of two plans, or the first plan if their costs are equal."""
    return list(other if task.cost_of(other) < task.cost_of(plan) else plan)


def proved_cheapest(task: Task, plan: list[int], work: int, deadline: float | None) -> tuple[list[int], bool]:
    """Return a plan, and whether it is proved to be a cheapest plan.

    The plan is the given plan if a search of few states finds no cheaper plan.
    """
    looked = (1 + LOOK * len(task.applicable(task.initial)[0])) * (1 + task.derived.effort // WAYS)
    cost = task.cost_of(plan)
    found = shortest(task, each_goal_alone(task), cost, min(STATES, work // looked), deadline)
    best = plan if found.plan is None else list(found.plan)
    return best, found.bound >= task.cost_of(best)


def without_superfluous_steps(task: Task, plan: Sequence[int], deadline: float | None = None) -> list[int]:
    """Return a plan without the steps that neither the goal nor a remaining step requires.

    In a very long plan, the function tests only the first steps.
    """
    plan = list(plan)
    state, i, work = task.initial, 0, TRIALS
    while i < len(plan):
        work -= len(plan) - i
        if work < 0 or (deadline is not None and perf_counter() > deadline):
            break
        trial, kept = task.carried_out(state, plan[i + 1 :])
        if trial & task.goal == task.goal:
            plan[i:] = kept
        else:
            after = task.applied(state, plan[i])
            assert after is not None
            state, i = after, i + 1
    return plan


def regrouped(task: Task, plan: Sequence[int]) -> list[int]:
    """Return a plan in another order, in which each step follows the latest step that it depends on.

    Two steps keep their order if one depends on the other, or if one would make the other's precondition false. If the new order
    doesn't reach the goal, return the plan in the given order.
    """
    n = len(plan)
    states = _states(task, plan)
    after: list[set[int]] = [set() for _ in range(n)]
    setter: dict[int, int] = {}
    readers: dict[int, list[int]] = {}
    clearer: dict[int, int] = {}
    causes: list[set[int]] = [set() for _ in range(n)]
    for i, operator in enumerate(plan):
        precondition, changes = task.changes_of(operator)
        need, clear, set_ = precondition, 0, 0
        for when, c, s in changes:
            if states[i] & when == when:
                need |= when
                clear |= c
                set_ |= s
        for bit in bits_of(need):
            if bit in setter:
                after[setter[bit]].add(i)
                causes[i].add(setter[bit])
            readers.setdefault(bit, []).append(i)
        for bit in bits_of(clear):
            for r in readers.pop(bit, ()):
                if r != i:
                    after[r].add(i)
            if bit in setter and setter[bit] != i:
                after[setter[bit]].add(i)
            clearer[bit] = i
        for bit in bits_of(set_):
            if bit in clearer and clearer[bit] != i:
                after[clearer[bit]].add(i)
            setter[bit] = i
    open_ = [0] * n
    for followers in after:
        for f in followers:
            open_[f] += 1
    ready = [(1, i) for i in range(n) if not open_[i]]
    placed: dict[int, int] = {}
    order: list[int] = []
    while ready:
        _, i = heappop(ready)
        placed[i] = len(order)
        order.append(i)
        for f in after[i]:
            open_[f] -= 1
            if not open_[f]:
                heappush(ready, (-max((placed[c] for c in causes[f]), default=-1), f))
    found = [plan[i] for i in order]
    return found if _leads(task, task.initial, found) else list(plan)


def _states(task: Task, plan: Sequence[int]) -> list[int]:
    """Return the initial state and the state after each step of a plan."""
    found = [task.initial]
    for operator in plan:
        after = task.applied(found[-1], operator)
        assert after is not None
        found.append(after)
    return found


def _leads(task: Task, state: int, plan: Sequence[int]) -> bool:
    """Return whether a plan leads from a state to the goal."""
    after, kept = task.carried_out(state, plan)
    return len(kept) == len(plan) and after & task.goal == task.goal


@dataclass
class _Windows:
    """The common data of the windows of steps of one task; `work` is the remaining work."""

    task: Task
    work: int
    most: int
    """Maximum number of evaluations of h_FF in the search for a cheaper window of steps."""
    deadline: float | None
    failed: set[tuple[int, int, float]] = field(default_factory=set)
    """Windows of steps that weren't replaced, each as a state, required bits and a cost."""
    _cleared: dict[int, int] = field(default_factory=dict)

    @cached_property
    def cut(self) -> float:
        """The weight of h_FF in the test that drops states.

        The weight is below 1 if costs differ, because h_FF may then exceed the remaining cost.
        """
        return min(self.task.costs) / max(self.task.costs)

    @property
    def over(self) -> bool:
        """Whether the work is used up or the deadline has passed."""
        return self.work <= 0 or self.late

    @property
    def late(self) -> bool:
        """Whether the deadline has passed."""
        return self.deadline is not None and perf_counter() > self.deadline

    def pass_over(self, plan: list[int], size: int) -> list[int]:
        """Return the plan after trying windows of `size` steps; each window overlaps the previous window by half."""
        states, needed = _states(self.task, plan), self.needed(plan)
        start = 0
        while start < len(plan) - 1 and not self.over:
            end = min(start + size, len(plan))
            spent = sum(map(self.task.spent, states[start:end], plan[start:end]))
            found = self.replacement(plan[start:end], states[start], needed[end] & states[end], spent)
            if found is not None and _leads(self.task, states[start], [*found, *plan[end:]]):
                other = [*plan[:start], *found, *plan[end:]]
                if not self.task.prices or self.task.cost_of(other) < self.task.cost_of(plan):
                    plan[start:end] = found
                    states, needed = _states(self.task, plan), self.needed(plan)
                    start = max(0, start - size // 2)
                    continue
            self.failed.add((states[start], needed[end] & states[end], spent))
            if end == len(plan):
                break
            start += size // 2
        return plan

    def needed(self, plan: Sequence[int]) -> list[int]:
        """Return, for each position of a plan, the bits that the later steps and the goal require."""
        states = _states(self.task, plan)
        wanted = self.task.goal
        found = [wanted]
        for state, operator in zip(reversed(states[:-1]), reversed(plan), strict=True):
            precondition, changes = self.task.changes_of(operator)
            more = precondition
            for when, _, set_ in changes:
                if state & when == when and set_ & wanted:
                    more |= when
                    wanted &= ~set_
            wanted |= more
            found.append(wanted)
        return found[::-1]

    def replacement(self, steps: list[int], state: int, wanted: int, spent: float) -> list[int] | None:
        """Search for a replacement of a window: steps that lead from a state to the required bits and cost less than `spent`.

        Return None if the search with operators near the window finds no replacement.
        """
        if (state, wanted, spent) in self.failed:
            return None
        operators = self.near(steps, state, wanted)
        task = self.part(operators, state, wanted)
        found = self.search(task, spent, self.most, cost_left(task), len(task.owners), cut=self.cut)
        return None if found is None else [operators[operator] for operator in found]

    def restarted(self, plan: list[int]) -> list[int]:
        """Return a cheaper plan that a search with all operators finds within the remaining work, or the given plan.

        The work must suffice for the successors of as many states as the plan has steps.
        """
        task, best, operators = self.task, plan, max(len(self.task.owners), 1)
        following = 1 + task.derived.effort // WAYS
        for bound, each, weight, cut in (cost_left, operators, WEIGHT, self.cut), (each_goal_alone, RANKED, 1, 1.0):
            most = self.work // (operators * following)
            if self.over or most < len(plan) * len(task.applicable(task.initial)[0]):
                break
            with suppress(MemoryError):
                known = self.work // (each * following)
                found = self.search(task, task.cost_of(best), known, bound(task), each, weight, cut)
                best = best if found is None else without_superfluous_steps(task, found, self.deadline)
        return best

    def search(
        self, task: Task, upper: float, most: int, bound: Estimate, each: int, weight: int = 1, cut: float = 1.0
    ) -> list[int] | None:
        """Search for a plan cheaper than `upper` by A*, with the work `each` for a state.

        States whose cost plus `cut` times the estimate reaches `upper` are dropped.
        """
        found = shortest(task, bound, upper, deadline=self.deadline, most_reached=most, weight=weight, cut=cut)
        self.work -= len(found.states) * each
        return None if found.plan is None else list(found.plan)

    @cached_property
    def arrays(self) -> tuple[Ints, Ints, Ints]:
        """Three arrays: the owner of each relaxed operator, and the relaxed operator of each required and each added bit."""
        task = self.task
        number = np.arange(len(task.owners))
        return (
            np.array(task.owners, np.int64),
            np.repeat(number, np.diff(task.needs.starts)),
            np.repeat(number, np.diff(task.adds.starts)),
        )

    def flags(self, bits: int) -> NDArray[np.bool_]:
        """Return an array that contains, for each bit of the task, whether the bit is set."""
        size = self.task.size
        packed = np.frombuffer((bits & (1 << size) - 1).to_bytes((size + 7) // 8, "little"), np.uint8)
        return np.unpackbits(packed, count=size, bitorder="little").astype(bool)

    def near(self, steps: Sequence[int], state: int, wanted: int) -> list[int]:
        """Return the operators nearest to a window in ascending order, including the operators of the window.

        An operator is excluded if it clears a required bit that no step of the window clears, because another operator would have
        to set the bit again.
        """
        task, far = self.task, 1000
        owners, _, _ = self.arrays
        at_first = self.flags(state)
        forward = np.full(len(owners), far)
        known = at_first.copy()
        for depth in range(len(steps)):
            ready = (counts(known, task.needs) == np.diff(task.needs.starts)) & (forward == far)
            if not ready.any():
                break
            self.work -= len(owners) // LOOK
            forward[ready] = depth
            known[task.adds.items[ready[self.arrays[2]]]] = True
        lost = 0
        for operator in steps:
            for _, cleared, _ in task.changes_of(operator)[1]:
                lost |= cleared
        target = self.flags(wanted & (~state | lost))
        backward = np.full(len(owners), far)
        later = np.zeros(task.size, bool)
        for depth in range(len(steps)):
            self.work -= len(owners) // LOOK
            helps = (counts(target, task.adds) > 0) & (backward == far) & (forward < far)
            target |= later
            later[:] = False
            if helps.any():
                backward[helps] = depth
                new = np.zeros(task.size, bool)
                new[task.needs.items[helps[self.arrays[1]]]] = True
                target |= new & ~at_first
                later = new & at_first
        score = forward + backward
        order = np.argsort(score, kind="stable")
        order = order[score[order] < far]
        chosen = dict.fromkeys(steps)
        kept = wanted & state & ~lost
        for operator in owners[order].tolist():
            if len(chosen) >= OPERATORS:
                break
            if operator >= 0 and not self.cleared(operator) & kept:
                chosen[operator] = None
        return sorted(chosen)

    def cleared(self, operator: int) -> int:
        """Return the mask of the bits that an operator clears without a further condition; it is computed only once."""
        found = self._cleared.get(operator)
        if found is None:
            changes = self.task.changes_of(operator)[1]
            found = self._cleared[operator] = union(cleared for when, cleared, _ in changes if not when)
        return found

    def part(self, operators: Sequence[int], state: int, wanted: int) -> Task:
        """Return the task of reaching the required bits from a state by the given operators; its states have the same bits.

        The task has no relaxed operators for derived bits that the operators can't change, and for conditions that can't hold.
        """
        task, amounts = self.task, self.task.amounts
        owners, _, adding = self.arrays
        place = {operator: i for i, operator in enumerate(operators)}
        changing = union(clear | set_ for operator in operators for _, clear, set_ in task.changes_of(operator)[1])
        changing |= amounts.compared if amounts is not None else 0
        for part in task.derived.parts:
            if changing & union(way for bit in part for way in bit.alternatives):
                changing |= union(bit.mask for bit in part)
        mine, changes = np.isin(owners, operators), self.flags(changing)
        changes[task.adds.items[mine[adding]]] = True
        possible = counts(self.flags(state) | changes, task.needs) == np.diff(task.needs.starts)
        kept = (mine | (owners < 0)) & possible & (counts(changes, task.adds) > 0)
        kept[: len(task)] = False
        rows = [*operators, *np.flatnonzero(kept).tolist()]
        if amounts is not None:
            of = amounts.made
            amounts = replace(amounts, moves=lambda operator: of(operators[operator]), _moves={}, _results={})
        return replace(
            task,
            whole=task,
            initial=state,
            goal=wanted,
            costs=[task.costs[operator] for operator in operators],
            prices={place[operator]: price for operator, price in task.prices.items() if operator in place},
            owners=[place.get(task.owners[r], -1) for r in rows],
            needs=Grouped.of([task.needs[r] for r in rows]),
            adds=Grouped.of([task.adds[r] for r in rows]),
            change=lambda operator: task.changes_of(operators[operator]),
            describe=lambda operator: task.describe(operators[operator]),
            barred=set(),
            amounts=amounts,
            _changes={},
        )


def counts(flags: NDArray[np.bool_], lists: Grouped) -> Ints:
    """Return, for each list of bits, the number of its bits whose flag is set."""
    found: Ints = np.diff(np.concatenate([[0], np.cumsum(flags[lists.items])])[lists.starts])
    return found
