"""Whether planners agree on a world, and with the truth.

The truth is what a search through all states of the lowest level finds, by whichever reading of behaviours it is given.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping

from planner.levels import levels_left
from planner.plan import Outcome, Status
from planner.validation import Facts, Rules, validate
from reasoner.symbols import FALSE, Problem, Symbol
from worlds.writing import quantified

State = Mapping[Symbol, str]
Successors = Callable[[Problem], Callable[[State], Iterable[State]]]


def by_the_checker(problem: Problem) -> Callable[[State], Iterable[State]]:
    """Return a function of a state to those that behaviours of the lowest level lead to, as the checker reads them."""
    rules = Rules(problem)
    steps = list(quantified(problem, problem.domain.levels[-1]))

    def successors(state: State) -> Iterable[State]:
        facts = Facts(problem, state)
        for behavior, arguments in steps:
            changes = rules.changes(behavior, arguments, facts)
            if changes is not None:
                yield {**state, **{Symbol(situation, key): value for situation, key, value in changes}}

    return successors


def solvable(problem: Problem, successors: Successors = by_the_checker, most: int = 20_000) -> bool | None:
    """Return whether some steps of the lowest level reach the goal with all that was touched at rest; None above so many states."""
    after = successors(problem)
    rests = {
        s: r for s in problem.initial if (r := problem.domain.situations[s.situation].rest) and s not in problem.goal
    }

    def restless(before: State, state: State, old: frozenset[Symbol]) -> frozenset[Symbol]:
        """Return what was touched and isn't at rest."""
        return frozenset(s for s, r in rests.items() if state[s] != r and (s in old or state[s] != before[s]))

    start = frozenset(problem.initial.items()), frozenset[Symbol]()
    seen, waiting = {start}, deque([start])
    while waiting:
        facts, old = waiting.popleft()
        state = dict(facts)
        if not old and all(state.get(symbol, FALSE) == value for symbol, value in problem.goal.items()):
            return True
        for following in after(state):
            node = frozenset(following.items()), restless(state, following, old)
            if node not in seen:
                if len(seen) >= most:
                    return None
                seen.add(node)
                waiting.append(node)
    return False


def complaints(problem: Problem, outcome: Outcome, other: Outcome, truth: bool | None) -> list[str]:
    """Return what is wrong with an outcome, given that of the paper's mode and whether there is a plan, where that is known."""
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
    """Whether steps of lower levels stand in a plan because it is shorter so, and break nothing that a level above asks."""
    if outcome.plan is None or other.plan is None or outcome.given_up:
        return False
    whole = any(left.broken for left in levels_left(problem, outcome.plan))
    return not whole and len(outcome.plan.primitives) < len(other.plan.primitives)


def on_top(problem: Problem, outcome: Outcome) -> bool:
    """Whether a plan consists of steps of the most abstract level."""
    return outcome.plan is not None and all(step.level == problem.domain.levels[0] for step in outcome.plan.steps)
