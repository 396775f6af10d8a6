"""Certificates of unsolvability that prove nothing, made from valid certificates, for tests of their checker."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import product
from random import Random

from confab.planner.certificate_checks import is_bounded, refusal
from confab.planner.certificates import Certificate
from confab.reasoner.amounts import Quantity, written
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Fact, Symbol
from worlds.interpreter import Interpreter, State, TooManyStatesError

MOST_STATES = 600
"""Maximum number of states of a world in which certificates with a missing claim are refuted by search."""
CHECKING = 30_000
"""Maximum work of the checker for each certificate."""
SAMPLE = 20
"""Number of reachable states that are changed to refute a certificate."""
SHARES = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
"""Shares of the symbols whose values a random certificate tells apart."""
COUNTED = re.compile(r"(\d+) cases can be reached")
"""The message of the checker for a wrong number of cases."""
NOTHING = "nothing"
"""A name that occurs in no world."""
OTHERS = ("!", NOTHING)
"""Names that occur in no world, and that are in sorted order before and after those of worlds."""


def corrupted(problem: Problem, certificate: Certificate, rng: Random) -> Iterator[tuple[str, Certificate]]:
    """Yield invalid certificates: with a false claim, for another goal, or without a necessary claim."""
    goal = certificate.unmet[0]
    other = Fact(Symbol(goal.symbol.situation, (NOTHING,)), goal.value)
    yield "without a goal", replace(certificate, unmet=())
    yield "of another goal", replace(certificate, unmet=(other,))
    yield "with a case more", replace(certificate, cases=certificate.cases + 1)
    yield "with a case less", replace(certificate, cases=certificate.cases - 1)
    if stated := sorted(symbol for symbol in problem.initial if symbol.situation not in problem.domain.rules):
        first = rng.choice(stated)
        true = Fact(first, problem.initial[first])
        yield "with a fact of the initial state as never true", replace(certificate, never=certificate.never | {true})
    if certificate.always:
        one = rng.choice(sorted(certificate.always))
        for name in OTHERS:
            yield "with another constant", replace(certificate, always={**certificate.always, one: name})
    meant = Interpreter(problem)
    if certificate.bounded and not (certificate.never or certificate.always or certificate.told_apart):
        bounds = [one for one in meant.slots if one.situation in problem.domain.aggregates]
        drawn = [("without the violated bound", replace(certificate, bounded=()))]
        for one in rng.sample(bounds, min(3, len(bounds))):
            drawn.append(("with another bound", replace(certificate, bounded=(one,))))
        for goal in certificate.unmet if len(certificate.unmet) > 1 else ():
            fewer = tuple(fact for fact in certificate.unmet if fact != goal)
            drawn.append(("with fewer goals beyond a bound", replace(certificate, unmet=fewer)))
        yield from ((what, less) for what, less in drawn if refuted(meant, less))
    for fact in rng.sample(sorted(certificate.never), min(3, len(certificate.never))):
        less = replace(certificate, never=certificate.never - {fact})
        if disproved(meant, less, fact.symbol, [v for v in given(problem, fact.symbol.situation) if v == fact.value]):
            yield "without a fact that is never true", less
            break
    for name in ("always", "told_apart"):
        claims = getattr(certificate, name)
        for symbol in rng.sample(sorted(claims), min(3, len(claims))):
            kept = {one: of for one, of in claims.items() if one != symbol}
            less = replace(certificate, always=kept) if name == "always" else replace(certificate, told_apart=kept)
            if disproved(meant, less, symbol, given(problem, symbol.situation)):
                yield f"without a symbol of {name}", less
                break


def of_a_task_with_a_plan(
    problem: Problem, meant: Interpreter, reached: Sequence[State], rng: Random
) -> Iterator[tuple[str, Certificate]]:
    """Yield random certificates of a task that has a plan.

    All claims except those about the goal hold in all reachable states, or in all states that are reachable without one behaviour.
    One certificate claims that the goal excludes a fact that no task requires.
    """
    symbols = [symbol for symbol, slot in meant.slots.items() if slot < meant.stated]
    rests = {s: kind.rest for s in symbols if (kind := meant.kinds[s.situation]).rest and s not in problem.goal}
    final = sorted(Fact(symbol, value) for symbol, value in {**rests, **problem.goal}.items())
    totals = (
        Symbol(name, row)
        for name, one in problem.domain.aggregates.items()
        for row in product(*(problem.classes.get(p.kind, ()) for p in one.parameters))
    )
    bounded = tuple(symbol for symbol in totals if is_bounded(problem, symbol))
    known = [(meant, reached), *without_a_behavior(meant, rng)]
    for share in SHARES:
        by, states = rng.choice(known)
        apart = {symbol: () for symbol in symbols if rng.random() < share}
        always, never = dict[Symbol, str](), set[Fact]()
        for symbol in symbols:
            values = {by.value(state, symbol) for state in states}
            kind = meant.kinds[symbol.situation]
            if symbol in apart or None in values:
                continue
            if len(values) == 1 and rng.random() < 0.8:
                (value,) = values
                always[symbol] = str(value) if kind.quantity is None else written(Fraction(value))
            elif kind.quantity is None:
                others = (FALSE, TRUE) if kind.boolean else problem.members(kind.range)
                never.update(Fact(symbol, value) for value in others if value not in values)
        unmet = tuple(rng.sample(final, rng.randint(1, len(final))))
        found = Certificate(frozenset(never), always, apart, 1, unmet, bounded if rng.random() < 0.7 else ())
        yield f"at random, {share:.0%} told apart", found
    ends = [state for state in reached if meant.wanted(state)]
    for symbol in rng.sample(symbols, len(symbols)):
        value = meant.value(meant.initial, symbol)
        if meant.kinds[symbol.situation].quantity is None and all(
            meant.value(state, symbol) != value for state in ends
        ):
            fact = Fact(symbol, NOTHING)
            if ends and fact.symbol not in rests and fact.symbol not in problem.goal:
                found = Certificate(told_apart=dict.fromkeys(symbols, ()), unmet=(*final, fact))
                yield "with a fact that the task doesn't require", found
                break


def without_a_behavior(meant: Interpreter, rng: Random) -> Iterator[tuple[Interpreter, Sequence[State]]]:
    """Yield interpreters without one of two behaviours of the lowest level, each with the states that are reachable then."""
    problem = meant.problem
    lowest = [behavior.name for behavior in problem.domain.at_level(problem.domain.levels[-1])]
    for name in rng.sample(lowest, min(2, len(lowest) - 1)):
        others = {other: one for other, one in problem.domain.behaviors.items() if other != name}
        fewer = Interpreter(replace(problem, domain=replace(problem.domain, behaviors=others)))
        with suppress(TooManyStatesError):
            found = fewer.explored(problem.domain.levels[-1], MOST_STATES, rests=False).costs
            yield fewer, [state for state, _ in found]


def accepted(problem: Problem, what: str, certificate: Certificate) -> bool:
    """Return whether the checker accepts a certificate with a description.

    Unless the number of cases is what is wrong, the certificate gets the number that the checker counts.
    """
    said = refusal(problem, certificate, CHECKING)
    if said is not None and "case" not in what and (counted := COUNTED.match(said)):
        said = refusal(problem, replace(certificate, cases=int(counted[1])), CHECKING)
    return said is None


def given(problem: Problem, situation: str) -> list[str]:
    """Return the values that effects of the lowest level can give; a certificate needs no claim that excludes other values."""
    found: set[str] = set()
    for behavior in problem.domain.at_level(problem.domain.levels[-1]):
        for effect in behavior.effects:
            if effect.situation == situation:
                kind = behavior.kinds.get(effect.value)
                found.update([effect.value] if kind is None else problem.members(kind))
    return sorted(found)


def refuted(meant: Interpreter, certificate: Certificate) -> bool:
    """Return whether a state has the goals, and keeps the bounds, of a certificate without claims.

    The state is the initial state with the goals; a certificate without claims allows this state, reachable or not.
    """
    goals = {fact.symbol: fact.value for fact in certificate.unmet}
    end = list(meant.initial)
    for symbol, at in meant.slots.items():
        if symbol in goals and at < meant.stated and meant.kinds[symbol.situation].quantity is None:
            if goals[symbol] not in (end[at], *given(meant.problem, symbol.situation)):
                return False  # no state has this value
            end[at] = goals[symbol]
    state = meant.closed(end)

    def kept(symbol: Symbol) -> bool:
        """Return whether a derived amount is within its bounds, or as far beyond them as in the initial state."""
        first, now = meant.value(meant.initial, symbol), meant.value(state, symbol)
        quantity = meant.kinds[symbol.situation].quantity or Quantity()
        above = quantity.least is None or now >= min(quantity.least, first)
        return above and (quantity.most is None or now <= max(quantity.most, first))

    return all(map(kept, certificate.bounded)) and all(meant.meets(state, one, value) for one, value in goals.items())


def disproved(meant: Interpreter, certificate: Certificate, symbol: Symbol, values: Iterable[str]) -> bool:
    """Return whether a state that a certificate allows leads to a state that the certificate excludes.

    A tested state is a reachable state with another value of the symbol whose claim was removed. All other claims of the
    certificate hold in a tested state, and the state belongs to the case of the reachable state: symbols that the certificate
    tells apart are unchanged. The plain interpreter, which shares no code with the checker, searches for the goal or the
    opposite of a claim.
    """
    at, level = meant.slots.get(symbol), meant.problem.domain.levels[-1]
    if at is None or at >= meant.stated or meant.kinds[symbol.situation].quantity is not None:
        return False

    def possible(state: State) -> bool:
        """Return whether all amounts are within their bounds; the checker of certificates assumes this."""
        bounds = ((slot, meant.kinds[one.situation].quantity) for one, slot in meant.slots.items())
        return all(
            (quantity.least is None or state[slot] >= quantity.least)
            and (quantity.most is None or state[slot] <= quantity.most)
            for slot, quantity in bounds
            if quantity is not None and state[slot] is not None
        )

    def of_one_case(state: State, changed: State) -> bool:
        return all(meant.value(state, one) == meant.value(changed, one) for one in certificate.told_apart)

    def allowed(state: State) -> bool:
        never = any(meant.meets(state, fact.symbol, fact.value) for fact in certificate.never)
        return not never and all(meant.meets(state, one, value) for one, value in certificate.always.items())

    other = meant.wanting({fact.symbol: fact.value for fact in certificate.unmet})
    try:
        reached = {state for state, _ in meant.wanting({}).explored(level, MOST_STATES, rests=False).costs}
        for state in sorted(reached, key=str)[:SAMPLE]:
            for value in values:
                other.initial = meant.closed([*state[:at], value, *state[at + 1 :]])
                if possible(other.initial) and allowed(other.initial) and of_one_case(state, other.initial):
                    found = other.explored(level, MOST_STATES, rests=False)
                    if found.least is not None or not all(allowed(after) for after, _ in found.costs):
                        return True
    except TooManyStatesError:
        pass
    return False
