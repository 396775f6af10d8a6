"""Soft goals: which of them a plan achieves.

A soft goal has a weight, which is the cost of leaving it unmet. A choice of soft goals is worth the cost of a plan for the hard
goals and the chosen ones, plus the weights of the others. `preferred` makes the choice by planning for some of them:

1. The hard goals alone: without a plan for them there is no plan.
2. All soft goals; if they have no plan together, none of them.
3. Each soft goal, the heaviest first, is added or dropped if that is cheaper, until no such change is.
4. With `prove`, the choice is proved, and so are all choices that could be cheaper, in the order of the weights that they leave
   unmet.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from math import inf
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


def preferred(problem: Problem, search: Search, prove: Search | None = None) -> tuple[Problem, Outcome]:
    """Choose among the soft goals of a task.

    Parameters
    ----------
    problem : Problem
        Its soft goals are those with weights.
    search : callable
        Plans for the goals of a problem.
    prove : callable, optional
        Plans for the goals of a problem and proves a lower bound on the cost of a plan. If given, all choices that could be
        cheaper are tried, at most `MOST_CHOICES`.

    Returns
    -------
    Problem
        The task without the goals that are left unmet; without soft goals, the same task.
    Outcome
        Of planning for it; `forgone` has the soft goals that are left unmet. With `prove`, its bound is a lower bound on the cost
        of a plan with the weights that it leaves unmet, less the weights that this plan leaves unmet.
    """
    if not problem.weights:
        return problem, (prove or search)(problem)
    choices = _Choices(problem, search, prove)
    nothing, everything = Goals(), Goals(problem.weights)
    if choices.total(nothing) is None:
        choices.least(nothing)
        if choices.total(nothing) is None:
            return choices.task(nothing), choices.outcome(nothing)
    best = choices.settled(nothing if choices.total(everything) is None else everything)
    if prove is None:
        return choices.result(best)
    return choices.result(*choices.cheapest(best))


class _Choices:
    """The plans for some choices of soft goals."""

    def __init__(self, problem: Problem, search: Search, prove: Search | None) -> None:
        self.problem, self.search, self.prove, self.weights = problem, search, prove, problem.weights
        self.outcomes: dict[Goals, Outcome] = {}
        self.bounds: dict[Goals, Fraction | None] = {}

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

    def least(self, kept: Goals) -> Fraction | None:
        """Return a proved lower bound on the cost of a plan for a choice, None if there is no plan; keep the cheapest plan."""
        if kept not in self.bounds:
            known = proved = self.outcome(kept)
            if self.prove is not None and known.status is not Status.UNSOLVABLE:
                with suppress(LimitError):
                    proved = self.prove(self.task(kept))
            none = proved.status is Status.UNSOLVABLE or proved.bound == inf
            self.bounds[kept] = None if none else Fraction(proved.bound or 0.0)
            self.outcomes[kept] = min((one for one in (proved, known) if one.plan), key=self.price, default=proved)
        return self.bounds[kept]

    def cost(self, kept: Goals) -> Fraction | None:
        """Return the cost of a plan for a choice; None if none was found."""
        found = self.outcome(kept)
        return None if found.plan is None else self.price(found)

    def price(self, found: Outcome) -> Fraction:
        """Return the cost of the plan of an outcome."""
        assert found.plan is not None
        return Fraction(cost_of(self.problem, found.plan))

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

    def cheapest(self, best: Goals) -> tuple[Goals, Fraction]:
        """Return the cheapest choice that is found from a choice, and a lower bound on the cost of any choice.

        More goals never make the cheapest plan cheaper, so the bound for the hard goals alone is a bound for all choices.
        """
        self.least(best)
        cheapest, bounds = self.least(Goals()) or Fraction(0), list[Fraction]()
        for number, kept in enumerate(self.ascending()):
            bound, total = cheapest + self.unmet(kept), self.total(best)
            assert total is not None
            if number == MOST_CHOICES or bound >= total:
                return best, min([bound, *bounds])
            own = self.least(kept)
            if own is not None:
                bounds.append(max(bound, own + self.unmet(kept)))
            if self.cheaper(kept, best):
                best = kept
        return best, min(bounds)

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

    def result(self, kept: Goals, least: Fraction | None = None) -> tuple[Problem, Outcome]:
        """Return the task of a choice and its outcome, with the goals that it leaves unmet and what each would cost.

        `least` is a lower bound on the cost of any choice.
        """
        outcome = self.outcome(kept)
        assert outcome.plan is not None
        kept |= {symbol for symbol in self.weights if symbol not in kept and self.met(symbol, outcome.plan)}
        cost, forgone = self.price(outcome), []
        for symbol in reversed(self.by_weight()):
            if symbol not in kept:
                other = self.cost(kept | {symbol})
                fact = Fact(symbol, self.problem.goal[symbol])
                more = None if other is None else (other - cost).limit_denominator(PRECISION)
                forgone.append(Forgone(fact, self.weights[symbol], more))
        bound = None if least is None else float(min(max(least - self.unmet(kept), Fraction(0)), cost))
        return self.task(kept), replace(outcome, forgone=tuple(forgone), bound=bound)

    def met(self, symbol: Symbol, plan: Plan) -> bool:
        """Return whether a soft goal holds at the end of a plan, though the plan was made without it."""
        return not validate(self.task(Goals({symbol})), plan)
