"""The search for a certificate that a task has no plan.

The first step is relaxed reachability, which determines the facts that can become true if no fact ever becomes false. The
computation works backwards from the goal, so that only relevant facts are considered. A required fact that isn't reachable
in the relaxed task never holds.

Some goals exclude each other in every state: by the definitions of derived facts, or because a state with all of these goals
violates a constraint or the bounds of a derived amount. This needs no search.

If the relaxed goal is reachable, the next step distinguishes a few values, at first the values of the goal. Then the cases
are searched; a case is a combination of the distinguished values. A path through the cases to the goal is executed on the
original task. If the execution fails, the cases also distinguish the values on which the execution failed. This step is
repeated until no path remains (then the task is unsolvable), or until a path succeeds (then there is a plan).

The last step distinguishes all values, so that each case is a state. A choice of distinguished values may have infinitely
many cases, while another choice has only few cases. Therefore each choice is tried first with a small work limit, and then
with larger limits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import combinations, pairwise, product
from math import prod
from operator import itemgetter
from time import perf_counter
from typing import TypeAlias

from confab.planner.certificate_checks import (
    ANY,
    Cases,
    CaseView,
    ClaimCase,
    Try,
    is_bounded,
    wanted_in_the_end,
    with_hard_goals,
)
from confab.planner.certificates import Certificate
from confab.planner.checked_conditions import own_variables, unified, variables
from confab.planner.possibilities import FactEvaluation, Lowest, NoTimeLeftError, Range, WorkLimitError
from confab.planner.validation import BehaviorReader, LoggedState
from confab.reasoner.amounts import meets, number, written
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Behavior, Effect, Fact, State, Symbol

WORK = 3_000_000
"""Maximum work to find a certificate: the number of tested conditions plus the number of behaviours that are tried in cases."""
LITTLE = 2_000, 20_000
"""Maximum number of tests per goal in the first and in the second round.

After the second round, all goals are examined with the full limit.
"""
PAIR, FEWER, SHARE = 100_000, 200_000, 0.5
"""Maximum number of tests for each pair of goals, and for removing symbols from a certificate.

`SHARE` is the share of the remaining tests that each kind of certificate may use.
"""
FEW = 3
"""Maximum number of distinguished values of a symbol; if more are needed, all its values are distinguished."""
ReachabilityQuestion: TypeAlias = "tuple[str, str, tuple[str, ...], str]"
"""Kinds of questions about reachability: can a symbol get a value (`GETS`), can a symbol lose its value (`LEAVES`), which amounts
can a symbol get (`RANGE`), can a condition on the final state hold (`ENDS`)?"""
GETS, LEAVES, RANGE, ENDS = "gets", "leaves", "range", "ends"


def certify(problem: Problem, most: float = WORK, few_states: bool = False) -> Certificate | None:
    """Return a certificate that a task has no plan, or None if there is a plan, or if the work limit is too small.

    With `few_states`, a search has already examined all states, so that a certificate of all states is cheap.
    """
    if not problem.domain.levels:
        return None
    problem = with_hard_goals(problem)
    lowest = Lowest(problem, most)
    try:
        relaxed = Relaxed(lowest)
        if few_states:
            found = _with_little(lowest, PAIR, partial(relaxed.certificate, problem.goal))
            found = found or _with_little(lowest, most, partial(by_states, lowest))
            if found is not None:
                return _with_fewer(lowest, found)
        return (
            _in_every_state(lowest, by_bounds)
            or _at_once(lowest, LITTLE[0])
            or _in_every_state(lowest, by_definitions)
            or _contested(lowest)
            or _at_once(lowest, LITTLE[1])
            or relaxed.certificate(problem.goal)
            or _in_stages(lowest, relaxed)
        )
    except (WorkLimitError, RecursionError):
        return None


def _at_once(lowest: Lowest, little: int) -> Certificate | None:
    """Return a certificate for a single goal; each goal is tried with a small work limit."""
    for symbol, wanted in sorted(lowest.problem.goal.items()):
        alone = {symbol: wanted}
        if (found := _with_little(lowest, little, partial(Relaxed(lowest).certificate, alone))) is not None:
            return found
        if lowest.work >= lowest.most:
            break
    return None


def _with_little(lowest: Lowest, little: float, find: Callable[[], Certificate | None]) -> Certificate | None:
    """Return the certificate that `find` returns within a work limit, or None; a `NoTimeLeftError` ends the whole search."""
    most = lowest.most
    try:
        lowest.most = min(most, lowest.work + little)
        return find()
    except NoTimeLeftError:
        raise
    except WorkLimitError:
        return None
    finally:
        lowest.most = most


def _contested(lowest: Lowest) -> Certificate | None:
    """Return a certificate for two goals that require the same value, if only one symbol can have this value."""
    wanting: dict[tuple[str, str], list[Symbol]] = {}
    for symbol, wanted in sorted(lowest.problem.goal.items()):
        kind = lowest.problem.domain.situations[symbol.situation]
        if not kind.boolean and kind.quantity is None:
            wanting.setdefault((symbol.situation, wanted), []).append(symbol)
    for (_, wanted), symbols in wanting.items():
        for one, other in pairwise(symbols):
            told_apart = {one: (wanted,), other: (wanted,)}
            unmet = (Fact(one, wanted), Fact(other, wanted))
            if (found := _counted(lowest, Certificate(told_apart=told_apart, unmet=unmet))) is not None:
                return found
    return None


class Relaxed:
    """Relaxed reachability, computed backwards from the questions.

    A new question has the answer "impossible" until an achiever is found. When an answer changes, all dependent answers
    are computed again.
    """

    def __init__(self, lowest: Lowest) -> None:
        self.lowest, self.problem = lowest, lowest.problem
        self.possible: set[ReachabilityQuestion] = set()
        self.ranges: dict[Symbol, Range] = {}
        self.reads: dict[ReachabilityQuestion, None] = {}  # the questions asked while one question is examined
        self._readers: dict[ReachabilityQuestion, dict[ReachabilityQuestion, None]] = {}
        self._waiting: dict[ReachabilityQuestion, None] = {}
        self._asking: ReachabilityQuestion | None = None

    # -------------------------------------------------------------------------------------------- answers known so far

    def may(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol can get a value."""
        if self.lowest.initial(symbol) == value:
            return True
        return value in self.lowest.given[symbol.situation] and self._ask(
            (GETS, symbol.situation, symbol.arguments, value)
        )

    def may_not(self, symbol: Symbol, value: str) -> bool:
        """Return whether a symbol can get a value other than the given one."""
        if self.lowest.initial(symbol) != value:
            return True
        if self.problem.domain.situations[symbol.situation].boolean:
            return self.may(symbol, FALSE if value == TRUE else TRUE)
        return self._ask((LEAVES, symbol.situation, symbol.arguments, value))

    def between(self, symbol: Symbol) -> Range:
        """Return the range of the amounts that a symbol can get; the definition of a derived amount determines its range."""
        if symbol.situation in self.problem.domain.aggregates:
            return self.lowest.allowed(symbol)
        first = self.lowest.initial(symbol)
        self._ask((RANGE, symbol.situation, symbol.arguments, first))
        return self.ranges.get(symbol, Range(number(first), number(first)))

    def _ask(self, key: ReachabilityQuestion) -> bool:
        self.reads[key] = None
        readers = self._readers.get(key)
        if readers is None:
            readers = self._readers[key] = {}
            self._waiting[key] = None
        if self._asking is not None:
            readers[self._asking] = None
        return key in self.possible

    # -------------------------------------------------------------------------------------------- computing the answers

    def reachable(self, key: ReachabilityQuestion) -> bool:
        """Answer a question about reachability: return whether the answer is yes."""
        self._asking = None
        self._ask(key)
        while self._waiting and key not in self.possible:
            one = next(iter(self._waiting))
            del self._waiting[one]
            if one not in self.possible and self._examined(one):
                if one[0] != RANGE:
                    self.possible.add(one)
                self._waiting.update(self._readers[one])
        return key in self.possible

    def _examined(self, key: ReachabilityQuestion) -> bool:
        """Return whether the answer to a question is yes, or the range of an amount wider, according to the present knowledge.

        `reads` records the other questions on which the answer depends.
        """
        kind, situation, arguments, value = key
        self._asking, self.reads = key, {}
        reading = FactEvaluation(self.lowest, self)
        if kind == ENDS:
            return reading.goal(Symbol(situation, arguments), value)
        if kind == RANGE:
            return self._wider(reading, Symbol(situation, arguments))
        for behavior, effect in self.lowest.effects.get(situation, ()):
            words = (*arguments, value if kind == GETS else None)
            for env in self._envs(reading, behavior, effect, (*effect.arguments, effect.value), words):
                becomes = env.get(effect.value, effect.value)
                if (becomes == value) is (kind == GETS) and reading.amounts(behavior, env) is not None:
                    return True
        return False

    def _envs(
        self,
        reading: FactEvaluation,
        behavior: Behavior,
        effect: Effect,
        terms: tuple[str, ...],
        words: tuple[str | None, ...],
    ) -> Iterator[dict[str, str]]:
        """Yield the bindings of a behaviour's variables that make the terms of an effect equal to the given words."""
        own = own_variables(behavior).union(*(variables(condition) for condition in effect.when))
        given = unified(self.problem, behavior, own, terms, words)
        if given is None:
            return
        yield from reading.solutions(self.lowest.asked(behavior, effect.when), given, behavior.kinds)

    def _wider(self, reading: FactEvaluation, symbol: Symbol) -> bool:
        first = number(self.lowest.initial(symbol))
        before = now = self.ranges.get(symbol, Range(first, first))
        limits = self.lowest.bounds_of(symbol.situation)
        for behavior in self.lowest.behaviors:
            for effect in behavior.amounts:
                if effect.situation != symbol.situation:
                    continue
                constant = effect.operation == "assign" and isinstance(effect.amount, Fraction)
                for env in self._envs(reading, behavior, effect, effect.arguments, symbol.arguments):
                    after = (reading.amounts(behavior, env) or {}).get(symbol)
                    if after is None:
                        continue
                    low, high = after[0].low, after[0].high
                    if not constant:  # widen the range in one step to the farthest reachable amount
                        low = min(limits.low, now.low) if low < now.low else low
                        high = max(limits.high, now.high) if high > now.high else high
                    now = now.hull(Range(low, high))
        self.ranges[symbol] = now
        return now != before

    # ------------------------------------------------------------------------------------------------------ certificate

    def certificate(self, goal: State) -> Certificate | None:
        """Return a certificate if some part of a goal isn't reachable."""
        for symbol, wanted in sorted(goal.items()):
            key = ENDS, symbol.situation, symbol.arguments, wanted
            if not self.reachable(key):
                never, always = self.claims([key])
                return Certificate(frozenset(never), always, unmet=(Fact(symbol, wanted),))
        return None

    def claims(self, keys: Iterable[ReachabilityQuestion]) -> tuple[set[Fact], dict[Symbol, str]]:
        """Return all claims "never" and "always" on which the impossibility of some facts depends."""
        never, always = set[Fact](), dict[Symbol, str]()
        seen, waiting = set[ReachabilityQuestion](), list(keys)
        while waiting:
            key = waiting.pop()
            if key in seen or key in self.possible:
                continue
            seen.add(key)
            kind, situation, arguments, value = key
            symbol = Symbol(situation, arguments)
            if kind == RANGE and not (value := self._bounds(symbol)):
                continue  # the symbol may have any allowed amount
            if kind == GETS:
                never.add(Fact(symbol, value))
            elif kind != ENDS:
                always[symbol] = value
            self._examined(key)
            waiting += self.reads
        return never, always

    def _bounds(self, symbol: Symbol) -> str:
        first = number(self.lowest.initial(symbol))
        found, limits = self.ranges.get(symbol, Range(first, first)), self.lowest.bounds_of(symbol.situation)
        if not isinstance(found.low, float) and found.low == found.high:
            return written(found.low)
        parts = [
            f">={written(found.low)}" if not isinstance(found.low, float) and found.low != limits.low else "",
            f"<={written(found.high)}" if not isinstance(found.high, float) and found.high != limits.high else "",
        ]
        return ",".join(part for part in parts if part)


# ----------------------------------------------------------------------------------------------- certificates with cases


def _in_stages(lowest: Lowest, relaxed: Relaxed) -> Certificate | None:
    """Return a certificate for two goals, for all goals, or of all states; the cheapest kind is tried first."""
    for little in (LITTLE[1], lowest.most):
        for find in (
            partial(by_pairs, lowest, relaxed),
            partial(by_cases, lowest, relaxed, lowest.problem.goal),
            partial(by_states, lowest),
        ):
            if (found := _with_little(lowest, min(little, SHARE * (lowest.most - lowest.work)), find)) is not None:
                return _with_fewer(lowest, found)
    return None


def _in_every_state(lowest: Lowest, find: Callable[[Lowest], Certificate | None]) -> Certificate | None:
    """Return a certificate with few goals that exclude each other in every state."""
    found = _with_little(lowest, SHARE * (lowest.most - lowest.work), partial(find, lowest))
    return None if found is None else _with_fewer(lowest, found)


def by_bounds(lowest: Lowest) -> Certificate | None:
    """Return a certificate that some goals, in any state, violate a constraint or the bounds of a derived amount.

    Without goals, an amount can have its initial value, which is never an excess; therefore each excess involves goals.
    """
    domain, classes = lowest.problem.domain, lowest.problem.classes
    goals = tuple(Fact(symbol, wanted) for symbol, wanted in sorted(lowest.problem.goal.items()))
    cases = Cases(lowest, Certificate(unmet=goals))
    for name, aggregate in domain.aggregates.items():
        violation = domain.constraints[name].situation if name in domain.constraints else None
        for individuals in product(*(classes.get(p.kind, ()) for p in aggregate.parameters)):
            symbol, final = Symbol(name, individuals), cases.final(())
            if is_bounded(lowest.problem, symbol) and cases.excess(FactEvaluation(lowest, final), symbol) is not None:
                used = tuple(f for f in goals if f.symbol in final.used or f.symbol.situation == violation)
                return Certificate(unmet=used, bounded=(symbol,))
    return None


def by_definitions(lowest: Lowest) -> Certificate | None:
    """Return a certificate that some goals, in any state, contradict the definitions of derived facts."""
    defined = lowest.problem.domain.rules.keys() | lowest.problem.domain.aggregates.keys()
    goals = tuple(Fact(symbol, wanted) for symbol, wanted in sorted(lowest.problem.goal.items()))
    derived = any(fact.symbol.situation in defined for fact in goals)
    return _counted(lowest, Certificate(unmet=goals)) if derived else None


def by_pairs(lowest: Lowest, relaxed: Relaxed) -> Certificate | None:
    """Return a certificate that two goals about the same individual can't both hold when all symbols have their rest values."""
    pairs = []
    for (one, a), (other, b) in combinations(sorted(lowest.problem.goal.items()), 2):
        if a in other.arguments or b in one.arguments:  # pairs whose goals mention each other's values come first
            pairs.append((0, {one: a, other: b}))
        elif not {*one.arguments}.isdisjoint(other.arguments):
            pairs.append((1, {one: a, other: b}))
    for _, pair in sorted(pairs, key=itemgetter(0)):
        if lowest.work >= lowest.most:
            break
        if (found := _with_little(lowest, PAIR, partial(by_cases, lowest, relaxed, pair))) is not None:
            return found
    return None


def by_cases(lowest: Lowest, relaxed: Relaxed, goal: State) -> Certificate | None:
    """Distinguish more and more values until the goal, or a part of the goal, holds in no case."""
    certificate = Certificate(cases=0)
    while True:
        cases = Cases(lowest, certificate)
        cases.explore()
        if cases.fault:
            return None
        if cases.reached is None:
            return replace(certificate, cases=len(cases.came_from))
        refined = _refined(cases, cases.reached, relaxed, goal)
        if refined is None or refined == certificate:
            return None
        certificate = refined


def by_states(lowest: Lowest) -> Certificate | None:
    """Return a certificate that distinguishes all values: each case is a state, and none satisfies the goal and the rest values."""
    problem = lowest.problem
    told_apart: dict[Symbol, tuple[str, ...]] = {}
    for name in sorted(lowest.changing):
        kind = problem.domain.situations[name]
        stated = [symbol for symbol in problem.initial if symbol.situation == name]
        of = [problem.classes.get(each, ()) for each in kind.arguments] if kind.boolean else []
        lowest.spend(prod(map(len, of)))
        unstated = (Symbol(name, arguments) for arguments in product(*of)) if of else ()
        told_apart.update(dict.fromkeys((*stated, *unstated), ()))
    rests = [
        Fact(s, str(rest)) for s in told_apart if (rest := problem.domain.situations[s.situation].rest) is not None
    ]
    unmet = [Fact(symbol, wanted) for symbol, wanted in sorted(problem.goal.items())]
    unmet += [fact for fact in sorted(rests) if fact.symbol not in problem.goal and wanted_in_the_end(problem, fact)]
    cases = _closed(lowest, Certificate(told_apart=told_apart, unmet=tuple(unmet)))
    if cases is None:
        return None
    return replace(cases.certificate, unmet=_enough(cases, unmet), cases=len(cases.came_from))


def _with_fewer(lowest: Lowest, found: Certificate) -> Certificate:
    """Return a certificate without superfluous symbols and goals; each is tested with a small work limit.

    Half of the time that is left is kept for the check of the certificate.
    """
    most, end = min(lowest.work + FEWER, lowest.most), lowest.deadline
    lowest.deadline = (perf_counter() + end) / 2

    def reduced(fewer: Certificate) -> Certificate | None:
        work = min(LITTLE[1], SHARE * (most - lowest.work))
        return _with_little(lowest, work, partial(_counted, lowest, fewer))

    with suppress(NoTimeLeftError):
        for symbol in sorted(found.told_apart):
            told_apart = {s: values for s, values in found.told_apart.items() if s != symbol}
            found = reduced(replace(found, told_apart=told_apart)) or found
        for fact in found.unmet if len(found.unmet) > 1 else ():
            unmet = tuple(other for other in found.unmet if other != fact)
            found = (reduced(replace(found, unmet=unmet)) if unmet else None) or found
    lowest.deadline = end
    return found


def _closed(lowest: Lowest, certificate: Certificate) -> Cases | None:
    """Return the cases of a certificate if the goal holds in no reachable case; otherwise None."""
    cases = Cases(lowest, certificate)
    cases.explore()
    return None if cases.fault or cases.reached is not None else cases


def _counted(lowest: Lowest, certificate: Certificate) -> Certificate | None:
    """Return a certificate with the number of its cases, if the certificate is valid."""
    cases = _closed(lowest, certificate)
    return None if cases is None else replace(certificate, cases=len(cases.came_from))


def _enough(cases: Cases, unmet: Sequence[Fact]) -> tuple[Fact, ...]:
    """Return a few facts such that each case violates at least one of the facts."""
    failing = {
        fact: {
            case
            for case in cases.came_from
            if not cases.met(FactEvaluation(cases.lowest, CaseView(cases.claims, case)), fact)
        }
        for fact in unmet
    }
    found: list[Fact] = []
    left = set(cases.came_from)
    while left:
        found.append(max(unmet, key=lambda fact: len(failing[fact] & left)))
        left -= failing[found[-1]]
    return tuple(sorted(found))


def _refined(cases: Cases, end: ClaimCase, relaxed: Relaxed, goal: State) -> Certificate | None:
    """Return a certificate that also distinguishes the values on which a path through the cases fails, or None if it succeeds."""
    lowest, problem = cases.lowest, cases.problem
    path: list[tuple[ClaimCase, Try, ClaimCase]] = []
    while True:
        before, one = cases.came_from[end]
        if one is None:
            break
        path.append((before, one, end))
        end = before
    facts, rules = LoggedState(problem, problem.initial), BehaviorReader(problem)
    for before, one, after in reversed(path):
        view = CaseView(cases.claims, before, unknown=[])
        cases.effects(FactEvaluation(lowest, view), one)
        arguments = tuple(one.env[p.name] for p in one.behavior.parameters)
        changes = rules.changes(one.behavior, arguments, facts)
        wrong = _wrong(view, facts)
        for situation, key, value in changes or ():
            facts.put(situation, key, value)
        if changes is None or not _is(cases, facts, after, bool(wrong)):
            return _told_apart(cases, relaxed, wrong or view.unknown or [])
    goals = [Fact(symbol, wanted) for symbol, wanted in sorted(goal.items())]
    open_ = [f for f in goals if not meets(facts.value(f.symbol.situation, f.symbol.arguments) or FALSE, f.value)]
    rests = [] if open_ else _restless(problem, facts)
    for fact in open_ or rests:
        if fact in cases.certificate.unmet:
            view = CaseView(cases.claims, path[0][2] if path else end, unknown=[])
            cases.met(FactEvaluation(lowest, view), fact)
            if wrong := _wrong(view, facts):
                return _told_apart(cases, relaxed, wrong)
    known = {symbol.situation for symbol in cases.certificate.told_apart}
    for fact in sorted(open_ or rests, key=lambda fact: fact.symbol.situation not in known):
        if fact not in cases.certificate.unmet:
            return replace(cases.certificate, unmet=(*cases.certificate.unmet, fact))
    return None


def _wrong(view: CaseView, facts: LoggedState) -> list[tuple[Symbol, str, bool]]:
    """Return the facts that a case assumes and that don't hold in the actual state."""
    found = []
    for symbol, value, has in view.unknown or ():
        now = facts.value(symbol.situation, symbol.arguments)
        if not value or (now == value) is not has:
            found.append((symbol, value, has))
    return found


def _is(cases: Cases, facts: LoggedState, case: ClaimCase, exactly: bool) -> bool:
    """Return whether a state belongs to a case."""
    for at, symbol in enumerate(cases.claims.symbols):
        now = facts.value(symbol.situation, symbol.arguments) or FALSE
        if (case[at] == ANY and exactly) or (case[at] != ANY and cases.claims.entry(at, now) != case[at]):
            return False
    return True


def _restless(problem: Problem, facts: LoggedState) -> list[Fact]:
    """Return the rest values, or initial values, that a final state must have and that the given state doesn't have."""
    found = []
    for symbol, now in sorted(facts.state().items()):
        rest = problem.domain.situations[symbol.situation].rest
        if rest is None or now in (rest, problem.initial.get(symbol, FALSE)):
            continue
        if symbol not in problem.goal and wanted_in_the_end(problem, Fact(symbol, rest)):
            found.append(Fact(symbol, rest))
    return found


def _told_apart(cases: Cases, relaxed: Relaxed, wrong: Iterable[tuple[Symbol, str, bool]]) -> Certificate | None:
    """Return a certificate that either claims that an assumed fact never holds, or distinguishes the value of the fact."""
    certificate, lowest = cases.certificate, cases.lowest
    apart = dict(certificate.told_apart)
    impossible = []
    for symbol, value, has in wrong:
        amount = lowest.quantity(symbol.situation) is not None
        key = GETS if has else LEAVES, symbol.situation, symbol.arguments, value
        known = lowest.initial(symbol) == value if has else lowest.initial(symbol) != value
        if not amount and not known and not relaxed.reachable(key):
            impossible.append(key)
            continue
        told = apart.get(symbol)
        if amount or (told is not None and (not told or len(told) >= FEW)):
            apart[symbol] = ()
        else:
            apart[symbol] = tuple(dict.fromkeys((*(told or ()), value)))
    never, always = relaxed.claims(impossible)
    return replace(
        certificate,
        never=certificate.never | never,
        always={**certificate.always, **always},
        told_apart=apart,
    )
