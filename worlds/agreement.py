"""Comparison of planners on a world with each other and with an exhaustive search.

The search visits all states of the lowest level. The caller provides the function from a state to its successors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from heapq import heappop, heappush
from itertools import count, product

from confab.planner.levels import levels_left
from confab.planner.plan import Outcome, Status
from confab.planner.validation import BehaviorReader, LoggedState, validate
from confab.reasoner.amounts import meets
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Symbol
from worlds.writing import quantified

State = Mapping[Symbol, str]
Successors = Callable[[Problem], Callable[[State], Iterable[tuple[float, State]]]]
"""Function that maps a problem to a function from states to their successors with costs."""


def by_the_checker(problem: Problem) -> Callable[[State], Iterable[tuple[float, State]]]:
    """Return the function from a state to its successors on the lowest level, computed by the plan checker's interpreter."""
    rules = BehaviorReader(problem)
    steps = list(quantified(problem, problem.domain.levels[-1]))

    def successors(state: State) -> Iterable[tuple[float, State]]:
        facts = LoggedState(problem, state)
        for behavior, arguments in steps:
            changes = rules.changes(behavior, arguments, facts)
            if changes is not None:
                price = rules.price(behavior, arguments, facts)
                cost = behavior.cost if price is None else float(price)
                yield cost, {**state, **{Symbol(situation, key): value for situation, key, value in changes}}

    return successors


def cheapest(problem: Problem, successors: Successors = by_the_checker, most: int = 20_000) -> float | None:
    """Return the least cost of steps of the lowest level that reach the goal, with rest values for all changed symbols.

    The result is infinity if no steps reach the goal, and None if there are more than `most` states. The plan checker derives
    defined situations and compares amounts.
    """
    after = successors(problem)
    lowest = problem.domain.at_level(problem.domain.levels[-1])
    kinds, changed = problem.domain.situations, frozenset[str]().union(*(b.changes for b in lowest))
    of = {
        n: (problem.classes.get(c, ()) for c in kinds[n].arguments)
        for n in sorted(changed)
        if kinds[n].boolean and kinds[n].rest
    }
    unstated = (Symbol(name, arguments) for name, classes in of.items() for arguments in product(*classes))
    every = dict.fromkeys((*problem.initial, *unstated))
    rests = {s: r for s in every if (r := kinds[s.situation].rest) and not problem.releases(s)}

    def restless(before: State, state: State, old: frozenset[Symbol]) -> frozenset[Symbol]:
        """Return the changed symbols that do not have their rest value."""
        now = ((s, r, state.get(s, FALSE), before.get(s, FALSE)) for s, r in rests.items())
        return frozenset(s for s, r, value, earlier in now if value != r and (s in old or value != earlier))

    def reached(state: State) -> bool:
        facts = LoggedState(problem, state)
        return all(meets(facts.value(s.situation, s.arguments) or FALSE, wanted) for s, wanted in problem.goal.items())

    start = frozenset(problem.initial.items()), frozenset[Symbol]()
    least, waiting, number = {start: 0.0}, [(0.0, 0, start)], count(1)
    while waiting:
        cost, _, node = heappop(waiting)
        facts, old = node
        if cost > least[node]:
            continue
        state = dict(facts)
        if not old and reached(state):
            return cost
        for more, following in after(state):
            node = frozenset(following.items()), restless(state, following, old)
            if cost + more < least.get(node, math.inf):
                if len(least) >= most:
                    return None
                least[node] = cost + more
                heappush(waiting, (cost + more, next(number), node))
    return math.inf


def solvable(problem: Problem, successors: Successors = by_the_checker, most: int = 20_000) -> bool | None:
    """Return whether steps of the lowest level reach the goal, with rest values for all changed symbols.

    The result is None if there are more than `most` states.
    """
    least = cheapest(problem, successors, most)
    return None if least is None else least < math.inf


def complaints(problem: Problem, outcome: Outcome, other: Outcome, truth: bool | None) -> list[str]:
    """Return the faults of an outcome, given the outcome of the paper's mode and, if known, whether a plan exists."""
    found = []
    if outcome.plan is not None:
        found += [f"invalid: {fault.text}" for fault in validate(problem, outcome.plan)]
        found += ["a plan where there is none"] if truth is False else []
    if outcome.status is Status.GAVE_UP:
        found.append("gave up")
    if outcome.status is Status.UNSOLVABLE and (truth or other.status is Status.SOLVED):
        found.append("a false unsolvable")
    if on_top(problem, other) and not on_top(problem, outcome) and not shorter(problem, outcome, other):
        found.append("the first level left")
    return found


def shorter(problem: Problem, outcome: Outcome, other: Outcome) -> bool:
    """Return whether a plan is shorter than the other plan and violates no condition of a level above its steps."""
    if outcome.plan is None or other.plan is None or outcome.given_up:
        return False
    whole = any(left.broken for left in levels_left(problem, outcome.plan))
    return not whole and len(outcome.plan.primitives) < len(other.plan.primitives)


def on_top(problem: Problem, outcome: Outcome) -> bool:
    """Return whether all top steps of a plan belong to the most abstract level."""
    return outcome.plan is not None and all(step.level == problem.domain.levels[0] for step in outcome.plan.steps)
