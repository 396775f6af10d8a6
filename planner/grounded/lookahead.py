"""Lookahead: the search executes a relaxed plan as far as possible, and replaces or inserts operators if necessary.

The method follows Vidal, "A lookahead strategy for heuristic search planning", ICAPS 2004.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from time import perf_counter
from typing import TypeAlias

from confab.planner.grounded.task import Task, bits_of

ENABLING = 8
"""Maximum number of missing bits for which the lookahead tries to insert an operator."""
StatePath: TypeAlias = "tuple[int, list[int]]"
"""A state, and the operators on the path to this state."""


def lookahead(task: Task, deadline: float | None = None) -> Callable[[int, Sequence[int]], StatePath]:
    """Return a function that executes a relaxed plan from a state as far as possible.

    The function returns the final state and the executed operators. If no operator of the plan is applicable, the function
    replaces an operator by an applicable operator that sets the same bit for a later operator or the goal. For example, a truck
    that has moved north starts from its new place. If there is no replacement, the function inserts an operator that sets the
    only missing bit of other operators. For example, a truck is moved back to the place where the next parcel can be loaded.
    Among several operators to insert, the function selects the operator after which the rest of the plan achieves the most
    goals.
    """

    @cache
    def setters() -> list[dict[int, None]]:
        found: list[dict[int, None]] = [{} for _ in range(task.size)]
        for bits, owner in zip(task.adds.lists(), task.owners, strict=True):
            for bit in bits:
                if owner >= 0:
                    found[bit][owner] = None
        return found

    @cache
    def set_by(operator: int) -> int:
        found = task.set_by(operator)
        return found if task.amounts is None else found | task.amounts.compared & moved()[operator]

    @cache
    def moved() -> list[int]:
        found = [0] * len(task)
        for bits, owner in zip(task.adds.lists(), task.owners, strict=True):
            if owner >= 0:
                found[owner] |= sum(1 << bit for bit in bits)
        return found

    def replaced(state: int, stuck: list[int]) -> tuple[int, int, list[int]] | None:
        needed = [task.goal]  # bits that the goal and the later operators require, beginning at the end
        for operator in reversed(stuck):
            needed.append(needed[-1] | task.changes_of(operator)[0])
        for i, operator in enumerate(stuck):
            for bit in bits_of(set_by(operator) & needed[-2 - i] & ~state):
                for other in setters()[bit]:
                    after = task.applied(state, other)
                    if after is not None and after >> bit & 1:
                        return after, other, stuck[:i] + stuck[i + 1 :]
        return None

    def in_turn(state: int, left: Sequence[int]) -> tuple[int, list[int], list[int]]:
        done, stuck = [], []
        for operator in left:
            if set_by(operator) & ~state:  # otherwise the operator's effects hold already
                after = task.applied(state, operator)
                if after is None:
                    stuck.append(operator)
                elif after != state:
                    state = after
                    done.append(operator)
        return state, done, stuck

    def enabling(state: int, stuck: list[int]) -> tuple[int, int, list[int]] | None:
        lacking = Counter(task.changes_of(operator)[0] & ~state for operator in stuck)
        best: tuple[tuple[int, int], int, int] | None = None
        applicable = task.applicable(state)[0]
        single = [bits for bits, _ in lacking.most_common() if bits.bit_count() == 1]
        for bits in single[:ENABLING]:
            other = next((o for o in applicable if set_by(o) & bits), None)
            after = None if other is None else task.applied(state, other)
            if other is None or after is None:
                continue
            end, done, _ = in_turn(after, stuck)
            rank = (end & task.goal).bit_count(), len(done)
            if done and (best is None or rank > best[0]):
                best = rank, after, other
        return None if best is None else (best[1], best[2], stuck)

    def carried_out(state: int, relaxed_plan: Sequence[int]) -> StatePath:
        path: list[int] = []
        left = list(relaxed_plan)
        while True:
            state, done, stuck = in_turn(state, left)
            path += done
            if deadline is not None and perf_counter() > deadline:
                return state, path
            if not done:
                instead = replaced(state, stuck) or enabling(state, stuck)
                if instead is None:
                    return state, path
                state, operator, stuck = instead
                path.append(operator)
            left = stuck

    return carried_out
