"""The choice of the soft goals that a plan achieves.

The weight of a soft goal is the cost of leaving the goal unmet. The total cost of a choice of soft goals has two parts: the cost of
a plan for the hard goals and the chosen soft goals, and the weights of the other soft goals. `preferred` searches for a choice with
a small total cost.

First, `preferred` plans for the hard goals alone. If there is no plan for the hard goals, the task has no plan, unless a soft goal
replaces a rest value. Second, it plans for all soft goals together. From either choice, it adds or drops one soft goal at a time,
the heaviest first, until no such change makes the choice cheaper. If it finds no plan for all soft goals, it adds each goal, the
heaviest first, for which it finds a plan. These plans only compare choices, so they needn't be shortened. If `shorten` is given,
`preferred` then shortens the plans of the few cheapest choices and of the choice with the most goals with little work, since a plan
for many goals may become much cheaper. In the end, it shortens the plan of the best of them with the full work. If `prove` is
given, it computes a lower bound for the choice and for all choices that could be cheaper. Choices with a smaller sum of unmet
weights come first.

If `extend` is given, a choice for which the search gave up gets the plan of a choice with fewer goals, extended by steps for the
other goals. Finally, the plan of the result is extended by steps for each unmet soft goal whose weight exceeds the cost of these
steps.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain, islice
from math import inf
from typing import TypeAlias

from confab.planner.plan import Forgone, Outcome, Plan, Status
from confab.planner.plan_costs import cost_of
from confab.planner.validation import unmet_goals
from confab.reasoner.derivation import conditions_of_goal
from confab.reasoner.limits import LimitError, OutOfTimeError, overtime
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Fact, Symbol, Times

PlanSearch: TypeAlias = "Callable[[Problem], Outcome]"
Shortener: TypeAlias = "Callable[[Problem, Outcome, bool], Outcome]"
Extender: TypeAlias = "Callable[[Problem, Outcome], Outcome]"
Goals: TypeAlias = frozenset[Symbol]
MOST_CHOICES = 200
"""Maximum number of choices for which a separate plan is searched in order to prove that no other choice is cheaper."""
SHORTENED = 3
"""Maximum number of choices that are compared by plans shortened with little work, besides the choice with the most goals."""
PRECISION = 1_000_000
"""Maximum denominator of the stated cost of meeting a soft goal; this cost is rounded, since costs are floating-point numbers."""


def preferred(
    problem: Problem,
    search: PlanSearch,
    prove: PlanSearch | None = None,
    shorten: Shortener | None = None,
    extend: Extender | None = None,
) -> tuple[Problem, Outcome]:
    """Choose among the soft goals of a task; return the task without the unmet soft goals, and the outcome of planning for it.

    Parameters
    ----------
    problem : Problem
        A problem whose soft goals have weights.
    search, prove : callable
        Functions that plan for the goals of a problem. `prove` also proves a lower bound on the cost; with `prove`, all choices are
        tried that could be cheaper, at most `MOST_CHOICES`, and `bound` of the outcome is a lower bound on the total cost of any
        choice.
    shorten : callable, optional
        Function that shortens the plan of an outcome of `search`, if its last argument is true with little work.
    extend : callable, optional
        Function that plans for the goals of a problem by additional steps after the plan of an outcome, or gives up.
    """
    if not problem.weights:
        return problem, (prove or search)(problem)
    choices = _SoftGoalChoices(problem, search, prove, extend)
    nothing, everything = Goals(), Goals(problem.weights)
    if choices.total(nothing) is None:
        choices.least(nothing)
    if (first := choices.first()) is None:
        found = choices.outcome(nothing)
        certified = not choices.away or choices.excluded()
        return choices.task(nothing), found if certified else replace(found, status=Status.GAVE_UP, certificate=None)
    if choices.total(everything) is not None:
        most = everything
        choices.settle(most)
    else:
        most = choices.grown(first)
    choices.settle(first)
    best, *others = choices.compared()
    if prove is not None:
        best, least = choices.cheapest(best)
        return choices.result(best, choices.outcome(best), least)
    if shorten is None:
        return choices.result(best, choices.outcome(best))
    best = choices.shortened([*dict.fromkeys([best, *others[: SHORTENED - 1], most])], shorten)
    return choices.result(best, choices.briefly[best], shorten=shorten)


class _SoftGoalChoices:
    """The outcomes of planning for choices of soft goals, and lower bounds on the costs of their plans.

    `briefly` are the outcomes with shortened plans. `away` are the soft goals that may demand other values than rest values. If
    such a goal isn't chosen, the symbols that it concerns must be at rest in the end, so that a plan for fewer goals can cost more.
    `ended` and `proofs_ended` state whether the time for searches and proofs is over; each further choice would end in the same
    way. `hard` are the choices for which the search gave up; there is no search for choices with more goals.
    """

    def __init__(self, problem: Problem, search: PlanSearch, prove: PlanSearch | None, extend: Extender | None) -> None:
        self.problem, self.search, self.prove, self.extend = problem, search, prove, extend
        self.weights = problem.weights
        self.away = Goals(symbol for symbol in problem.weights if problem.may_leave_rest(symbol))
        self.outcomes: dict[Goals, Outcome] = {}
        self.briefly: dict[Goals, Outcome] = {}
        self.hard: list[Goals] = []
        self.conflicts: list[tuple[frozenset[tuple[Symbol, str]], Outcome]] = []
        self.bounds: dict[Goals, Fraction | None] = {}
        self.prices: dict[int, tuple[Plan, Fraction]] = {}
        self.ended = self.proofs_ended = False

    def task(self, kept: Goals) -> Problem:
        """Return the task with the chosen soft goals as hard goals, and without the other soft goals."""
        return self.problem.only(self.weights.keys() - kept)

    def outcome(self, kept: Goals) -> Outcome:
        """Return the outcome of planning for a choice.

        There is no search if goals of the choice are known to exclude each other, or if a search for some of the goals alone has
        found no plan. If a limit ends a search, the outcome has the status "gave up". If a limit ends the first search, the method
        raises `LimitError` instead. If the search gives up, the plan of a choice with fewer goals is extended.
        """
        if kept not in self.outcomes:
            if self.ended:
                return Outcome(Status.GAVE_UP)
            task = self.task(kept)
            goals = task.goal_on(task.domain.levels[-1]).items()
            if (known := next((outcome for unmet, outcome in self.conflicts if unmet <= goals), None)) is not None:
                return self.outcomes.setdefault(kept, known)
            found = Outcome(Status.GAVE_UP)
            if not any(self.easier(fewer, kept) for fewer in self.hard):
                try:
                    found = self.search(task)
                except LimitError as error:
                    if not self.outcomes:
                        raise
                    self.ended = isinstance(error, OutOfTimeError)
                    return found
                if found.plan is None:
                    self.hard.append(kept)
            if found.status is Status.GAVE_UP and (begun := self.most_begun(kept)) is not None:
                found = self.extended(kept, begun) or found
            self.outcomes[kept] = found
            if found.plan is not None:
                self.outcomes.setdefault(
                    self.met(kept, found), found
                )  # no search for goals that the plan meets without additional cost
            if found.certificate is not None and found.certificate.unmet:
                unmet = frozenset((fact.symbol, fact.value) for fact in found.certificate.unmet)
                self.conflicts.append((unmet, found))
        return self.outcomes[kept]

    def most_begun(self, kept: Goals) -> Outcome | None:
        """Return the outcome with the cheapest plan for a part of a choice; prefer the parts with the most goals."""
        parts = [fewer for fewer, outcome in self.outcomes.items() if fewer < kept and outcome.plan is not None]
        best = min(parts, key=lambda part: (-len(part), self.price(self.outcomes[part])), default=None)
        return None if best is None else self.outcomes[best]

    def extended(self, kept: Goals, begun: Outcome) -> Outcome | None:
        """Return an outcome for a choice whose plan begins with the plan of another outcome, or None if none is found."""
        try:
            found = None if self.extend is None else self.extend(self.task(kept), begun)
        except LimitError:
            return None
        return None if found is None or found.plan is None else found

    def easier(self, fewer: Goals, kept: Goals) -> bool:
        """Return whether every plan for one choice is also a plan for another choice with fewer goals."""
        return fewer < kept and self.away.isdisjoint(kept - fewer)

    def excluded(self) -> bool:
        """Return whether a certificate proves that no choice has a plan; it may not depend on rest values of soft goals."""
        certificate, problem = self.outcome(Goals()).certificate, self.problem
        hard = problem.goal.keys() - self.weights.keys()
        rests = {fact.symbol for fact in certificate.unmet} - hard if certificate is not None else set[Symbol]()
        return certificate is not None and not any(problem.concerns(goal, s) for goal in self.away for s in rests)

    def first(self) -> Goals | None:
        """Return the first choice for which a plan is found: without soft goals, or else any choice if a rest value matters."""
        others = islice(self.ascending(), MOST_CHOICES if self.away and not self.excluded() else 0)
        return next((kept for kept in chain((Goals(),), others) if self.total(kept) is not None), None)

    def least(self, kept: Goals) -> Fraction | None:
        """Return a proved lower bound on the cost of a plan for a choice, or None without a plan; store the cheapest plan."""
        if kept not in self.bounds:
            known = proved = self.outcome(kept)
            if self.prove is not None and not self.proofs_ended and known.status is not Status.UNSOLVABLE:
                try:
                    proved = self.prove(self.task(kept))
                except LimitError as error:
                    self.proofs_ended = isinstance(error, OutOfTimeError)
            none = proved.status is Status.UNSOLVABLE or proved.bound == inf
            self.bounds[kept] = None if none else Fraction(proved.bound or 0.0)
            self.outcomes[kept] = min((one for one in (proved, known) if one.plan), key=self.price, default=proved)
        return self.bounds[kept]

    def cost(self, kept: Goals) -> Fraction | None:
        """Return the cost of the plan for a choice, or None if no plan was found."""
        found = self.outcome(kept)
        return None if found.plan is None else self.price(found)

    def price(self, found: Outcome) -> Fraction:
        """Return the cost of the plan of an outcome."""
        plan = found.plan
        assert plan is not None
        if id(plan) not in self.prices:
            self.prices[id(plan)] = plan, Fraction(cost_of(self.problem, plan))
        return self.prices[id(plan)][1]

    def total(self, kept: Goals) -> Fraction | None:
        """Return the total cost of a choice: the cost of its plan plus the unmet weights, or None if no plan was found."""
        cost = self.cost(kept)
        return None if cost is None else cost + self.unmet(kept)

    def unmet(self, kept: Goals) -> Fraction:
        """Return the sum of the weights of the soft goals that aren't chosen."""
        return sum((weight for symbol, weight in self.weights.items() if symbol not in kept), Fraction(0))

    def cheaper(self, one: Goals, other: Goals) -> bool:
        """Return whether the total cost of a choice is less than the total cost of another choice."""
        first, second = self.total(one), self.total(other)
        return first is not None and (second is None or first < second)

    def by_weight(self) -> list[Symbol]:
        """Return the soft goals sorted by weight, the smallest weight first."""
        return sorted(self.weights, key=lambda symbol: (self.weights[symbol], symbol))

    def settle(self, kept: Goals) -> None:
        """Plan for the choices that add or drop a single soft goal, and move on while such a choice is cheaper."""
        found, total = None, self.total(kept)
        while found != kept:
            found = kept
            for symbol in reversed(self.by_weight()):
                other = None if self.ended else self.total(kept ^ {symbol})
                if other is not None and (total is None or other < total):
                    kept, total = kept ^ {symbol}, other

    def grown(self, kept: Goals) -> Goals:
        """Return a choice with as many further goals as possible: each goal, the heaviest first, for which a plan is found."""
        for symbol in reversed(self.by_weight()):
            if symbol not in kept and not self.ended and self.total(kept | {symbol}) is not None:
                kept |= {symbol}
        return kept

    def compared(self) -> list[Goals]:
        """Return the choices with different plans, sorted by their total costs."""
        totals = {kept: total for kept in self.outcomes if (total := self.total(kept)) is not None}
        best = dict[int, Goals]()
        for kept in sorted(totals, key=totals.__getitem__):
            best.setdefault(id(self.outcomes[kept]), kept)
        return list(best.values())

    def shortened(self, some: Sequence[Goals], shorten: Shortener) -> Goals:
        """Shorten the plans of several choices with little work, and return the cheapest of these choices."""
        if len(some) == 1:
            self.briefly = dict.fromkeys(some, self.outcome(some[0]))
            return some[0]
        self.briefly = {kept: self.shorter(kept, self.outcome(kept), shorten, briefly=True) for kept in some}
        return min(some, key=lambda kept: self.price(self.briefly[kept]) + self.unmet(kept))

    def shorter(self, kept: Goals, found: Outcome, shorten: Shortener, briefly: bool) -> Outcome:
        """Return the outcome of a choice with a shortened plan, or the outcome itself if no time is left for shortening."""
        try:
            other = shorten(self.task(kept), found, briefly)
        except LimitError:
            return found
        return found if other.plan is None else other

    def cheapest(self, best: Goals) -> tuple[Goals, Fraction]:
        """Return the cheapest choice found, at least as cheap as `best`, and a lower bound on the total cost of any choice.

        An additional goal never makes the cheapest plan cheaper, unless the goal replaces a rest value. Therefore the bound for
        the hard goals alone is otherwise a lower bound on the cost of a plan for any choice.
        """
        self.least(best)
        cheapest, bounds = Fraction(0) if self.away else self.least(Goals()) or Fraction(0), list[Fraction]()
        for number, kept in enumerate(self.ascending()):
            bound, total = cheapest + self.unmet(kept), self.total(best)
            assert total is not None
            if number == MOST_CHOICES or self.proofs_ended or bound >= total:
                return best, min([bound, *bounds])
            own = self.least(kept)
            if own is not None:
                bounds.append(max(bound, own + self.unmet(kept)))
            if self.cheaper(kept, best):
                best = kept
        return best, min(bounds)

    def ascending(self) -> Iterator[Goals]:
        """Yield all choices, sorted by the sum of the unmet weights, the smallest sum first."""
        order = self.by_weight()
        waiting: list[tuple[Fraction, tuple[int, ...]]] = [(Fraction(0), ())]
        while waiting:
            unmet, dropped = heapq.heappop(waiting)
            yield Goals(symbol for i, symbol in enumerate(order) if i not in dropped)
            first = dropped[-1] + 1 if dropped else 0
            for i in range(first, len(order)):
                heapq.heappush(waiting, (unmet + self.weights[order[i]], (*dropped, i)))

    def result(
        self, chosen: Goals, outcome: Outcome, least: Fraction | None = None, shorten: Shortener | None = None
    ) -> tuple[Problem, Outcome]:
        """Return the task of a choice, and the outcome with the unmet soft goals and the additional cost of meeting each goal.

        As long as some steps for an unmet soft goal cost less than its weight, they extend the plan of the outcome. Finally,
        `shorten` shortens the plan. `least` is a lower bound on the total cost of any choice.
        """
        longer: Outcome | None = outcome
        kept = chosen
        while longer is not None:
            outcome, longer, more = longer, None, dict[Symbol, Fraction | None]()
            kept = self.met(kept, outcome)
            for symbol in reversed(self.by_weight()):
                if symbol not in kept:
                    other = self.extended(kept | {symbol}, outcome)
                    more[symbol] = None if other is None else self.price(other)
                    if other is not None and self.price(other) - self.price(outcome) < self.weights[symbol]:
                        longer, kept = other, kept | {symbol}
                        break
        if shorten is not None:
            outcome = self.shorter(kept, outcome, shorten, briefly=False)
            kept = self.met(kept, outcome)
        cost, forgone = self.price(outcome), []
        for symbol, longer_cost in more.items():
            if symbol in kept:
                continue
            fact = Fact(symbol, self.problem.goal[symbol])
            wanted = conditions_of_goal(self.problem.domain, symbol)
            searched = self.more(chosen, symbol) if kept == chosen else None  # an extended plan has other unmet goals
            extended = None if longer_cost is None else longer_cost - cost
            known = [one for one in (extended, searched) if one is not None]
            price = min(known).limit_denominator(PRECISION) if known else None
            forgone.append(Forgone(fact, self.weights[symbol], price, wanted, self.why(chosen | {symbol})))
        penalty = self.unmet(kept)
        bound = None if least is None else float(min(least, cost + penalty))
        return self.task(kept), replace(outcome, forgone=tuple(forgone), penalty=penalty, bound=bound)

    def met(self, kept: Goals, found: Outcome) -> Goals:
        """Return the soft goals that the plan of the outcome for a choice meets; without the choice, no goal with a deadline."""
        assert found.plan is not None
        late = (self.problem.times or Times()).deadlines.keys() - kept
        with overtime():
            return Goals(self.weights.keys() - unmet_goals(self.problem, found.plan) - late)

    def why(self, other: Goals) -> str:
        """Return why a choice has no plan: there is none, a limit ended the search, or the search found none."""
        found = self.outcomes.get(other)
        if found is not None and found.status is Status.UNSOLVABLE and self.away <= other:
            return "no plan meets it and the other goals"
        none = "no plan that meets it and the other goals was found"
        if found is None and self.ended:
            return f"{none} before the time limit"
        return f"{none}: {found.reason.text.split(';')[0]}" if found is not None and found.reason is not None else none

    def more(self, chosen: Goals, symbol: Symbol) -> Fraction | None:
        """Return the additional cost of meeting an unmet soft goal, as the difference of plans for which the same work was done.

        If there is no plan for the goal and the chosen goals alone, a plan may meet further goals, which release rest values.
        """
        other = chosen | {symbol}
        if self.cost(other) is None:
            more = [
                self.price(found) for kept, found in self.outcomes.items() if kept > other and found.plan is not None
            ]
            return min(more) - self.price(self.outcomes[chosen]) if more else None
        found = self.briefly if other in self.briefly else self.outcomes
        return self.price(found[other]) - self.price(found[chosen])
