"""Soft goals: which of them a plan achieves.

A soft goal has a weight, which is the cost of leaving it unmet. A choice of soft goals is worth the cost of a plan for the hard
goals and the chosen ones, plus the weights of the others. `preferred` makes the choice by planning for some of them:

1. The hard goals alone: without a plan for them there is no plan.
2. All soft goals; if they have no plan together, none of them.
3. Each soft goal, the heaviest first, is added or dropped if that is cheaper, until no such change is.
4. With `exact`, all choices in the order of the weights that they leave unmet, until no further choice can be cheaper.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import TypeAlias

from confab.planner.plan import Forgone, Outcome, Plan, Status
from confab.planner.plan_costs import cost_of
from confab.planner.validation import validate
from confab.reasoner.limits import LimitError
from confab.reasoner.symbols import Fact, Problem, Symbol

Search: TypeAlias = "Callable[[Problem], Outcome]"
Goals: TypeAlias = frozenset[Symbol]
MOST_CHOICES = 200
"""Maximum number of choices that are planned for to prove that no other one is cheaper."""
PRECISION = 1_000_000
"""Maximum denominator of the stated cost of meeting a soft goal, since plans' costs are sums of floating-point numbers."""


def preferred(problem: Problem, search: Search, exact: bool = False) -> tuple[Problem, Outcome]:
    """Choose among the soft goals of a task.

    Parameters
    ----------
    problem : Problem
        Its soft goals are those with weights.
    search : callable
        Plans for the goals of a problem.
    exact : bool
        Whether all choices that could be cheaper are tried. If this takes more than `MOST_CHOICES` searches, or if a search
        proves nothing, the outcome has no bound.

    Returns
    -------
    Problem
        The task without the goals that are left unmet; without soft goals, the same task.
    Outcome
        Of planning for it; `forgone` has the soft goals that are left unmet.
    """
    if not problem.weights:
        return problem, search(problem)
    choices = _Choices(problem, search)
    nothing, everything = Goals(), Goals(problem.weights)
    if choices.total(nothing) is None:
        return choices.task(nothing), choices.outcome(nothing)
    best = choices.settled(nothing if choices.total(everything) is None else everything)
    proved = True
    if exact:
        best, proved = choices.cheapest(best)
    return choices.result(best, proved)


class _Choices:
    """The plans for some choices of soft goals."""

    def __init__(self, problem: Problem, search: Search) -> None:
        self.problem, self.search, self.weights = problem, search, problem.weights
        self.outcomes: dict[Goals, Outcome] = {}

    def task(self, kept: Goals) -> Problem:
        """Return the task with these soft goals as hard goals, and without the others."""
        return self.problem.only(self.weights.keys() - kept)

    def outcome(self, kept: Goals) -> Outcome:
        """Plan for a choice; a search that the time limit ends has given up, except the first search."""
        if kept not in self.outcomes:
            try:
                self.outcomes[kept] = self.search(self.task(kept))
            except LimitError:
                if not self.outcomes:
                    raise
                return Outcome(Status.GAVE_UP)
        return self.outcomes[kept]

    def cost(self, kept: Goals) -> Fraction | None:
        """Return the cost of a plan for a choice; None if none was found."""
        plan = self.outcome(kept).plan
        return None if plan is None else Fraction(cost_of(self.problem, plan))

    def total(self, kept: Goals) -> Fraction | None:
        """Return the cost of a plan for a choice, with the weights that it leaves unmet."""
        cost = self.cost(kept)
        return None if cost is None else cost + self.unmet(kept)

    def unmet(self, kept: Goals) -> Fraction:
        """Return the sum of the weights of the goals that aren't chosen."""
        return sum((weight for symbol, weight in self.weights.items() if symbol not in kept), Fraction(0))

    def cheaper(self, one: Goals, other: Goals) -> bool:
        """Return whether the plan for a choice costs less than the plan for another choice."""
        first, second = self.total(one), self.total(other)
        return first is not None and (second is None or first < second)

    def by_weight(self) -> list[Symbol]:
        """Return the soft goals, the lightest first."""
        return sorted(self.weights, key=lambda symbol: (self.weights[symbol], symbol))

    def settled(self, kept: Goals) -> Goals:
        """Return a choice that no single goal, added or dropped, makes cheaper."""
        found = None
        while found != kept:
            found = kept
            for symbol in reversed(self.by_weight()):
                if self.cheaper(kept ^ {symbol}, kept):
                    kept ^= {symbol}
        return kept

    def cheapest(self, best: Goals) -> tuple[Goals, bool]:
        """Return the cheapest choice, and whether that is proved.

        More goals never make the cheapest plan cheaper, so the plan for the hard goals alone bounds all others.
        """
        least, proved = self.least(Goals()), True
        for number, kept in enumerate(self.ascending()):
            total = self.total(best)
            if total is not None and least is not None and least + self.unmet(kept) >= total:
                return best, proved
            if number == MOST_CHOICES:
                return best, False
            if self.cheaper(kept, best):
                best = kept
            outcome = self.outcome(kept)
            proved = proved and (outcome.status is Status.UNSOLVABLE or self.least(kept) == self.cost(kept))
        return best, proved

    def least(self, kept: Goals) -> Fraction | None:
        """Return the proved lower bound on the cost of a plan for a choice."""
        bound = self.outcome(kept).bound
        return None if bound is None else Fraction(bound)

    def ascending(self) -> Iterator[Goals]:
        """Yield all choices, in the order of the weights that they leave unmet."""
        order = self.by_weight()
        waiting: list[tuple[Fraction, tuple[int, ...]]] = [(Fraction(0), ())]
        while waiting:
            unmet, dropped = heapq.heappop(waiting)
            yield Goals(symbol for i, symbol in enumerate(order) if i not in dropped)
            first = dropped[-1] + 1 if dropped else 0
            for i in range(first, len(order)):
                heapq.heappush(waiting, (unmet + self.weights[order[i]], (*dropped, i)))

    def result(self, kept: Goals, proved: bool) -> tuple[Problem, Outcome]:
        """Return the task of a choice and its outcome, with the goals that it leaves unmet and what each would cost."""
        outcome = self.outcome(kept)
        assert outcome.plan is not None
        kept |= {symbol for symbol in self.weights if symbol not in kept and self.met(symbol, outcome.plan)}
        cost, forgone = Fraction(cost_of(self.problem, outcome.plan)), []
        for symbol in reversed(self.by_weight()):
            if symbol not in kept:
                other = self.cost(kept | {symbol})
                fact = Fact(symbol, self.problem.goal[symbol])
                more = None if other is None else (other - cost).limit_denominator(PRECISION)
                forgone.append(Forgone(fact, self.weights[symbol], more))
        bound = outcome.bound if proved else None
        return self.task(kept), replace(outcome, forgone=tuple(forgone), bound=bound)

    def met(self, symbol: Symbol, plan: Plan) -> bool:
        """Return whether a soft goal holds at the end of a plan, though the plan was made without it."""
        return not validate(self.task(Goals({symbol})), plan)
