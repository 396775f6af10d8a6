"""Checker of certificates of unsolvability; the checker shares no code with any search.

The checker examines only the lowest level of the task, because a failure of an upper level proves nothing. Behaviours
and conditions are evaluated by `confab.planner.possibilities`. The checker verifies three properties of the
certificate's set of states. First, the set of states contains the initial state. Second, no behaviour of the lowest
level leads out of the set of states; the checker expands each case of the certificate with all applicable behaviours.
A sum or count that contradicts the other values of its case is replaced by its value according to its definition.
Third, the set of states contains no final state. In a final state, the goal holds, and each symbol with a rest value
has its rest value or its initial value. A final state violates no constraint, and all derived amounts are within their bounds.

A plan of several levels is a sequence of behaviours of the lowest level that ends in a final state (docs/levels.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from typing import Generic, TypeAlias, TypeVar

from confab.planner.certificates import Certificate
from confab.planner.checked_conditions import own_variables, undetermined, unified
from confab.planner.possibilities import Beginning, FactEvaluation, Lowest, Range, WorkLimitError
from confab.reasoner.aggregates.dependencies import in_order
from confab.reasoner.amounts import bounds, number, written
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Behavior, Fact, Symbol
from confab.reasoner.timing import by_events

OTHER, ANY, KEPT = "", "?", "="
"""The special entries of a case.

The entry `OTHER` means any value that isn't distinguished. The entry `ANY` means any value. In a successor, the entry `KEPT`
means the value before the behaviour.
"""
WORK = 3_000_000
"""Maximum work of a check: the number of tested conditions plus the number of behaviours that are tried in cases."""
MOST_CASES = 200_000

T = TypeVar("T")
ClaimCase: TypeAlias = "tuple[str, ...]"
Leaf: TypeAlias = "tuple[tuple[tuple[int, tuple[str, ...]], ...] | None, str]"
"""The result of a behaviour in a case: the changed entries with their possible values, and the violated claim, if any.

The changed entries are None if the behaviour isn't applicable.
"""


def refusal(problem: Problem, certificate: Certificate, most: float = WORK) -> str | None:
    """Return the reason why a certificate doesn't prove that a problem has no plan, or None if it is a proof.

    If overlapping steps may reach more goals, the behaviours are the begins and the ends of steps. A plan may leave soft goals.
    """
    try:
        return rejection(problem, certificate, most)
    except WorkLimitError as error:
        return f"checking it takes {error}"


def rejection(problem: Problem, certificate: Certificate, most: float = WORK) -> str | None:
    """Return the same reason as `refusal`; raise `WorkLimitError` if the limit of work or time ends the check."""
    events = by_events(problem)
    if events is None:
        return "steps that overlap may reach more goals, and their begins and ends can't be examined separately"
    problem = with_hard_goals(events)
    try:
        for symbol in (*certificate.told_apart, *certificate.always, *(fact.symbol for fact in certificate.never)):
            if symbol.situation not in problem.domain.situations:
                return f"it mentions {symbol}, which this task doesn't have"
            if symbol.situation in problem.domain.rules:
                return f"it mentions {symbol}, which is defined by rules"
        if not certificate.unmet:
            return "it doesn't state which goals can't hold"
        for fact in certificate.unmet:
            if fact.symbol.situation not in problem.domain.situations or not wanted_in_the_end(problem, fact):
                return f"{fact} isn't wanted in this task"
        for symbol in certificate.bounded:
            if not is_bounded(problem, symbol):
                return f"{symbol} isn't a derived amount with bounds"
        cases = Cases(Lowest(problem, most), certificate)
        cases.explore()
    except (ValueError, ZeroDivisionError) as error:
        return f"it isn't well formed: {error}"
    if cases.fault:
        return cases.fault
    if cases.reached is not None:
        return "the goal may hold in one of its cases"
    if len(cases.came_from) != certificate.cases:
        return f"{len(cases.came_from)} cases can be reached, not {certificate.cases}"
    return None


class Decisions(Generic[T]):
    """A trie of results; each result is indexed by the entries of the case on which the result depends."""

    def __init__(self) -> None:
        self.at: int | None = None
        self.found: T | None = None
        self.below: dict[str, Decisions[T]] = {}

    def find(self, case: ClaimCase) -> T | None:
        """Return the stored result for a case."""
        node: Decisions[T] | None = self
        while node is not None and node.at is not None:
            node = node.below.get(case[node.at])
        return None if node is None else node.found

    def learn(self, case: ClaimCase, reads: Iterable[int], found: T) -> None:
        """Store a result under the entries on which the result depends."""
        node = self
        for at in dict.fromkeys(reads):
            node.at = at
            node = node.below.setdefault(case[at], Decisions())
        node.found = found


@dataclass
class CaseView:
    """The values of symbols in one case of a certificate; `reads` are the entries read, `unknown` the symbols without an entry."""

    claims: Claims
    case: ClaimCase
    reads: list[int] = field(default_factory=list)
    unknown: list[tuple[Symbol, str, bool]] | None = None

    def may(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value in at least one state of the case."""
        claims = self.claims
        at = claims.places.get(symbol)
        if at is not None:
            self.reads.append(at)
            entry = self.case[at]
            if entry == OTHER:
                if value in claims.apart[at]:
                    return False
            elif entry != ANY:
                return entry == value
        always = claims.certificate.always.get(symbol)
        if always is not None:
            return always == value
        if Fact(symbol, value) in claims.certificate.never:
            return False
        if claims.lowest.initial(symbol) != value and value not in claims.lowest.given[symbol.situation]:
            return False
        if self.unknown is not None:
            self.unknown.append((symbol, value, True))
        return True

    def may_not(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value other than the given value in at least one state of the case."""
        claims = self.claims
        at = claims.places.get(symbol)
        if at is not None:
            self.reads.append(at)
            entry = self.case[at]
            if entry not in (OTHER, ANY):
                return entry != value
            if entry == OTHER and value in claims.apart[at]:
                return True
        always = claims.certificate.always.get(symbol)
        if always is not None:
            return always != value
        if claims.lowest.problem.domain.situations[symbol.situation].boolean:
            return self.may(symbol, FALSE if value == TRUE else TRUE)
        others = {claims.lowest.initial(symbol), *claims.lowest.given[symbol.situation]} - {value}
        if all(Fact(symbol, other) in claims.certificate.never for other in others):
            return False
        if self.unknown is not None:
            self.unknown.append((symbol, value, False))
        return True

    def between(self, symbol: Symbol) -> Range:
        """Return the range of amounts of a symbol in the case."""
        claims = self.claims
        at = claims.places.get(symbol)
        if at is not None:
            self.reads.append(at)
            if self.case[at] != ANY:
                exactly = Fraction(self.case[at])
                return Range(exactly, exactly)
        if self.unknown is not None:
            self.unknown.append((symbol, "", True))
        return claims.range(symbol)


@dataclass
class FinalView(CaseView):
    """The values of symbols in the final states of a case, where symbols have their `wanted` values; `used` are those read."""

    wanted: Mapping[Symbol, str] = field(default_factory=dict)
    used: set[Symbol] = field(default_factory=set)

    def goal(self, symbol: Symbol) -> str | None:
        """Return the wanted value of a symbol, or None; record that the symbol was used."""
        if symbol not in self.wanted:
            return None
        self.used.add(symbol)
        return self.wanted[symbol]

    def may(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value in some final state of the case."""
        goal = self.goal(symbol)
        return super().may(symbol, value) if goal is None else goal == value

    def may_not(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol has a value other than the given value in some final state of the case."""
        goal = self.goal(symbol)
        return super().may_not(symbol, value) if goal is None else goal != value

    def between(self, symbol: Symbol) -> Range:
        """Return the range of amounts of a symbol in the final states of the case."""
        found, goal = super().between(symbol), self.goal(symbol)
        return found if goal is None else narrowed(found, goal)


class Claims:
    """A certificate prepared for queries: positions of distinguished symbols, and bounds of amounts."""

    def __init__(self, lowest: Lowest, certificate: Certificate) -> None:
        self.lowest, self.certificate = lowest, certificate
        self.symbols = tuple(sorted(certificate.told_apart))
        self.places = {symbol: i for i, symbol in enumerate(self.symbols)}
        self.apart = [frozenset(certificate.told_apart[symbol]) for symbol in self.symbols]
        self._ranges: dict[Symbol, Range] = {}

    def entry(self, at: int, value: str) -> str:
        """Return the entry that represents a value at a position of a case."""
        return value if not self.apart[at] or value in self.apart[at] else OTHER

    def range(self, symbol: Symbol) -> Range:
        """Return the range of amounts of a symbol in all cases."""
        if symbol not in self._ranges:
            found = self.lowest.allowed(symbol)
            always = self.certificate.always.get(symbol)
            self._ranges[symbol] = found if always is None else narrowed(found, always)
        return self._ranges[symbol]

    def broken(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol with the given value violates a claim "never" or "always"."""
        always = self.certificate.always.get(symbol)
        return (always is not None and always != value) or Fact(symbol, value) in self.certificate.never


@dataclass
class Try:
    """A behaviour with its individuals, and its known results."""

    behavior: Behavior
    env: Mapping[str, str]
    known: Decisions[Leaf] = field(default_factory=Decisions)


class Cases:
    """All reachable cases of a certificate, starting with the initial case.

    `came_from` maps each case to its predecessor and the behaviour that leads from the predecessor to the case.

    `fault` is the reason why the certificate is invalid; `reached` is a case in which the goal may hold.
    """

    def __init__(self, lowest: Lowest, certificate: Certificate) -> None:
        self.lowest, self.problem, self.certificate = lowest, lowest.problem, certificate
        self.claims = Claims(lowest, certificate)
        self.fault = ""
        self.reached: ClaimCase | None = None
        self.came_from: dict[ClaimCase, tuple[ClaimCase, Try | None]] = {}
        self._ends: Decisions[bool] = Decisions()
        self._totals = [
            (at, aggregate, symbol.arguments, Decisions[Range]())
            for aggregate in in_order(self.problem.domain.aggregates)
            for symbol, at in self.claims.places.items()
            if symbol.situation == aggregate.situation and aggregate.kept
        ]
        self._bounds: dict[Symbol, Range] = {}

    # ---------------------------------------------------------------------------------------------------- beginning

    def first(self) -> ClaimCase | None:
        """Return the initial case, or None if some claim doesn't hold in the initial state; `fault` then names the claim."""
        self.fault = next(self._wrong_at_first(), "")
        entries = (self.claims.entry(i, self.lowest.initial(symbol)) for i, symbol in enumerate(self.claims.symbols))
        return None if self.fault else tuple(entries)

    def _wrong_at_first(self) -> Iterator[str]:
        """Yield the claims that don't hold in the initial state or that no certificate may make, and effects that say nothing."""
        lowest, certificate = self.lowest, self.certificate
        for behavior in lowest.behaviors:
            if unknown := undetermined(behavior):
                yield f"nothing determines {', '.join(unknown)}, which an effect of {behavior.name} names"
        for symbol in (*certificate.always, *certificate.told_apart, *(fact.symbol for fact in certificate.never)):
            if not lowest.exists(symbol.situation, symbol.arguments):
                yield f"there is no {symbol}"
            if lowest.quantity(symbol.situation) is not None and certificate.told_apart.get(symbol):
                yield f"the certificate lists amounts of {symbol}; it may only distinguish all amounts of a symbol"
        for fact in certificate.never:
            if lowest.quantity(fact.symbol.situation) is not None:
                yield f"{fact}: the certificate must claim bounds that always hold for an amount, not single amounts"
            if lowest.initial(fact.symbol) == fact.value:
                yield f"{fact} holds in the beginning"
        for symbol, value in certificate.always.items():
            first, so = lowest.initial(symbol), lowest.initial(symbol) == value
            if lowest.quantity(symbol.situation) is not None:
                if any(sign in "<>" for sign, _ in bounds(value)):
                    raise ValueError(f"bounds of {symbol} have to be <= or >=, not {value}")
                within = self.claims.range(symbol)
                so = within.low <= number(first) <= within.high
            if not so:
                yield f"{symbol} isn't {value} in the beginning"

    # ------------------------------------------------------------------------------------------------------- search

    def explore(self) -> None:
        """Expand all cases in breadth-first order. Stop at a fault, or at a case in which the goal may hold."""
        first = self.first()
        if first is None:
            return
        tries = list(self.tries())
        self.came_from[first] = (first, None)
        queue = [first]
        for case in queue:  # the loop appends cases to the queue
            if self.ends_here(case):
                self.reached = case
                return
            for one in tries:
                self.lowest.spend()
                changes, broken = self.after(one, case)
                if broken:
                    self.fault = broken
                    return
                if changes is None:
                    continue
                for following in self._following(case, changes):
                    if following not in self.came_from:
                        self.came_from[following] = (case, one)
                        queue.append(following)
            if len(queue) > MOST_CASES:
                raise WorkLimitError(f"more than {MOST_CASES} cases")

    def _following(self, case: ClaimCase, changes: tuple[tuple[int, tuple[str, ...]], ...]) -> Iterator[ClaimCase]:
        if not changes:
            return
        for choice in product(*(entries for _, entries in changes)):
            following = list(case)
            for (at, _), entry in zip(changes, choice, strict=True):
                if entry != KEPT:
                    following[at] = entry
            self.lowest.spend()
            yield self._by_definition(tuple(following))

    def _by_definition(self, case: ClaimCase) -> ClaimCase:
        """Return a case in which each sum and count agrees with its definition, whatever the effects that update it say."""
        for at, aggregate, arguments, known in self._totals:
            if case[at] == ANY:
                continue
            found = known.find(case)
            if found is None:
                view = CaseView(self.claims, case)
                found = FactEvaluation(self.lowest, view).total(aggregate, arguments)
                known.learn(case, view.reads, found)
            if not found.low <= number(case[at]) <= found.high:
                exact = isinstance(found.low, Fraction) and found.low == found.high
                case = (*case[:at], written(Fraction(found.low)) if exact else ANY, *case[at + 1 :])
        return case

    def tries(self) -> Iterator[Try]:
        """Yield the behaviours, with individuals, that may change a distinguished value or violate a claim."""
        known = FactEvaluation(self.lowest, CaseView(self.claims, (ANY,) * len(self.claims.symbols)))
        seen: set[tuple[str, tuple[tuple[str, str], ...]]] = set()
        wanted: dict[str, dict[tuple[Symbol, str | None], None]] = {}
        for symbol in (*self.claims.symbols, *sorted(self.certificate.always)):
            wanted.setdefault(symbol.situation, {})[symbol, None] = None
        for fact in sorted(self.certificate.never):
            wanted.setdefault(fact.symbol.situation, {})[fact.symbol, fact.value] = None
        for behavior in self.lowest.behaviors:
            own = own_variables(behavior)
            for effect in behavior.every_effect:
                value = getattr(effect, "value", None)
                for symbol, becomes in wanted.get(effect.situation, ()):
                    given = unified(
                        self.problem, behavior, own, (*effect.arguments, value), (*symbol.arguments, becomes)
                    )
                    if given is None:
                        continue
                    for env in known.solutions(self.lowest.asked(behavior), given, behavior.kinds):
                        key = behavior.name, tuple(sorted(env.items()))
                        if key not in seen:
                            seen.add(key)
                            yield Try(behavior, env)

    # -------------------------------------------------------------------------------------- one behaviour in one case

    def after(self, one: Try, case: ClaimCase) -> Leaf:
        """Return the result of a behaviour in a case, from the stored results if possible."""
        known = one.known.find(case)
        if known is None:
            view = CaseView(self.claims, case)
            known = self.effects(FactEvaluation(self.lowest, view), one)
            one.known.learn(case, view.reads, known)
        return known

    def effects(self, reading: FactEvaluation, one: Try) -> Leaf:
        """Return the possible changes by a behaviour to the symbols that the certificate mentions."""
        behavior, env, claims = one.behavior, one.env, self.claims
        if not all(reading.holds(condition, env, behavior.kinds) for condition in behavior.preconditions):
            return None, ""
        amounts = reading.amounts(behavior, env)
        if amounts is None:
            return None, ""
        changes: dict[int, list[str]] = {}
        for effect in behavior.effects:
            ways = list(reading.solutions(effect.when, env, behavior.kinds)) if effect.when else [dict(env)]
            made = {
                (
                    Symbol(effect.situation, tuple(way.get(a, a) for a in effect.arguments)),
                    way.get(effect.value, effect.value),
                )
                for way in ways
            }
            sure = not effect.when or (
                len(made) == 1 and any(True for _ in reading.solutions(effect.when, env, behavior.kinds, must=True))
            )
            for symbol, value in sorted(made):
                at = claims.places.get(symbol)
                if not self.lowest.exists(symbol.situation, symbol.arguments):
                    continue
                if claims.broken(symbol, value) and not self._overruled(behavior, env, symbol):
                    return None, f"{behavior.name} {' '.join(env.values())} may make it so that {Fact(symbol, value)}"
                if at is not None:
                    entry = claims.entry(at, value)
                    changes[at] = [entry] if sure else [*changes.get(at, [KEPT]), entry]
        for symbol, (now, sure) in amounts.items():
            always, at = self.certificate.always.get(symbol), claims.places.get(symbol)
            if always is not None:
                within = claims.range(symbol)
                if now.low < within.low or now.high > within.high:
                    return None, f"{behavior.name} {' '.join(env.values())} may take {symbol} out of {always}"
            if at is not None:
                exact = sure and now.low == now.high and isinstance(now.low, Fraction)
                changes[at] = [written(now.low) if exact and isinstance(now.low, Fraction) else ANY]
        return tuple((at, tuple(dict.fromkeys(entries))) for at, entries in sorted(changes.items())), ""

    def _overruled(self, behavior: Behavior, env: Mapping[str, str], symbol: Symbol) -> bool:
        """Return whether an unconditional effect certainly gives a symbol the value that the certificate claims."""
        last = [
            env.get(effect.value, effect.value)
            for effect in behavior.effects
            if effect.situation == symbol.situation
            and not effect.when
            and tuple(env.get(a, a) for a in effect.arguments) == symbol.arguments
        ]
        others = [e for e in behavior.effects if e.situation == symbol.situation and e.when and e.value != FALSE]
        return bool(last) and not others and not self.claims.broken(symbol, last[-1])

    def ends_here(self, case: ClaimCase) -> bool:
        """Return whether the goal and the rest values hold in some state of a case that violates no bound."""
        known = self._ends.find(case)
        if known is None:
            view, final = CaseView(self.claims, case), self.final(case)
            reading, at_the_end = FactEvaluation(self.lowest, view), FactEvaluation(self.lowest, final)
            known = (
                all(self.met(reading, fact) for fact in self.certificate.unmet)
                and all(
                    self.met(at_the_end, fact) for fact in self.certificate.unmet if fact.symbol not in final.wanted
                )
                and all(self.excess(at_the_end, symbol) is None for symbol in self.certificate.bounded)
            )
            self._ends.learn(case, (*view.reads, *final.reads), known)
        return known

    def final(self, case: ClaimCase) -> FinalView:
        """Return the view of the states of a case in which the stated goals of the certificate hold."""
        domain, goal = self.problem.domain, self.problem.goal
        goals = (fact for fact in self.certificate.unmet if fact.symbol in goal)
        wanted = {
            fact.symbol: fact.value
            for fact in goals
            if fact.symbol.situation not in domain.rules and fact.symbol.situation not in domain.aggregates
        }
        return FinalView(self.claims, case, wanted=wanted)

    def excess(self, reading: FactEvaluation, symbol: Symbol) -> tuple[Range, Range] | None:
        """Return the range of a derived amount and its bounds, if the amount certainly violates the bounds; otherwise None.

        A plan doesn't violate the bounds. If the initial state violates the bounds, the amount may keep its initial value. A goal
        of the certificate that is itself a violation of a constraint counts as one violation.
        """
        domain = self.problem.domain
        aggregate = domain.aggregates[symbol.situation]
        if symbol not in self._bounds:
            first = FactEvaluation(self.lowest, Beginning(self.lowest)).total(aggregate, symbol.arguments)
            self._bounds[symbol] = self.lowest.bounds_of(symbol.situation).hull(first)
        allowed, found = self._bounds[symbol], reading.total(aggregate, symbol.arguments)
        if (constraint := domain.constraints.get(symbol.situation)) is not None:
            violation = constraint.situation, FALSE if constraint.always else TRUE
            goals = {
                fact
                for fact in self.certificate.unmet
                if fact.symbol in self.problem.goal
                and (fact.symbol.situation, fact.value) == violation
                and self.lowest.exists(fact.symbol.situation, fact.symbol.arguments)
            }
            found = Range(max(found.low, len(goals)), found.high)
        return (found, allowed) if found.low > allowed.high or found.high < allowed.low else None

    def met(self, reading: FactEvaluation, fact: Fact) -> bool:
        """Return whether a goal or rest value may hold in the end; a symbol that isn't at rest initially may keep its value."""
        symbol, wanted = fact.symbol, fact.value
        if reading.goal(symbol, wanted):
            return True
        return symbol not in self.problem.goal and reading.goal(symbol, self.lowest.initial(symbol))


def with_hard_goals(problem: Problem) -> Problem:
    """Return the problem without its soft goals; `weights` contains those that release their symbols from the rest value."""
    if not problem.weights:
        return problem
    goal = {symbol: value for symbol, value in problem.goal.items() if symbol not in problem.weights}
    released = {symbol: weight for symbol, weight in problem.weights.items() if problem.may_leave_rest(symbol)}
    return replace(problem, goal=goal, weights=released)


def wanted_in_the_end(problem: Problem, fact: Fact) -> bool:
    """Return whether a fact is a goal, or a rest value that a plan must restore after changing the symbol.

    The soft goals of the problem are those that `with_hard_goals` returns.
    """
    symbol = fact.symbol
    if symbol in problem.goal:
        return problem.goal[symbol] == fact.value
    if symbol.situation in problem.domain.rules or problem.releases(symbol):
        return False
    kind = problem.domain.situations[symbol.situation]
    return kind.rest == fact.value and problem.first_level(symbol) <= problem.domain.levels[-1]


def is_bounded(problem: Problem, symbol: Symbol) -> bool:
    """Return whether a symbol is a sum or count whose bounds every plan respects."""
    aggregate = problem.domain.aggregates.get(symbol.situation)
    quantity = problem.domain.situations[symbol.situation].quantity if aggregate is not None else None
    return (
        aggregate is not None
        and aggregate.kept
        and quantity is not None
        and quantity.bounded
        and len(symbol.arguments) == len(aggregate.parameters)
        and all(a in problem.members(p.kind) for a, p in zip(symbol.arguments, aggregate.parameters, strict=True))
    )


def narrowed(found: Range, limits: str) -> Range:
    """Return the part of a range of amounts that is within limits; the ends count even if the limits exclude them."""
    low, high = found.low, found.high
    for sign, limit in bounds(limits):
        low = max(low, limit) if sign[0] in ">=" else low
        high = min(high, limit) if sign[0] in "<=" else high
    return Range(low, high, found.partial)
