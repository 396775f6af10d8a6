"""Wishes of random worlds: further goals, most of them soft, and the least total of cost and unmet weights.

A wish may be about a symbol that a goal or another wish is about, about all individuals of a class, about derived situations, or a
goal with alternatives or with some individual. Each fact of a wish about a class counts by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from random import Random
from typing import Any

from confab.reasoner.amounts import Amount
from confab.reasoner.derivation import TASK
from confab.reasoner.language import terms, walk
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Comparison,
    Condition,
    Parameter,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    Witness,
)
from worlds.interpreter import Interpreter, State
from worlds.phrases import EACH, named

WEIGHTS = "1/2", "1", "2", "3", "5"
"""Weights of soft goals."""
KINDS = (
    "same",
    "other",
    "other",
    "pair",
    "pair",
    "class",
    "class",
    "defined",
    "defined",
    "any",
    "any",
    "all",
    "some",
    "some",
)
MOST, HARD = 8, 0.2
"""Maximum number of facts of the wishes of a world, and share of wishes that are hard goals."""


@dataclass(frozen=True)
class Wish:
    """A goal: its condition as it is written, and its weight if it is soft."""

    condition: Condition
    weight: Fraction | None

    def facts(self, problem: Problem) -> list[Condition]:
        """Return the conditions that count by themselves: one for each individual of a class."""
        match self.condition:
            case Witness(variable, kind, (ValueCondition() as one,), True) if variable == EACH:
                found = []
                for member in problem.classes.get(kind, ()):
                    arguments = tuple(member if term == EACH else term for term in one.arguments)
                    found.append(replace(one, arguments=arguments, negated=not one.negated))
                return list[Condition](found)
            case _:
                return [self.condition]


def wishes(seed: int, meant: Interpreter, states: Sequence[State], share: float) -> tuple[Wish, ...]:
    """Return the wishes of a share of the worlds; most of them hold in some of the given states."""
    rng = Random(f"wishes {seed}")
    if rng.random() >= share:
        return ()
    draft, found = _Wishes(rng, meant, states), list[Wish]()
    for _ in range(rng.choice((1, 2, 2, 3))):
        weight = None if rng.random() < HARD else Fraction(rng.choice(WEIGHTS))
        found += [Wish(one, weight) for one in draft.conditions(rng.choice(KINDS))]
    while sum(len(one.facts(meant.problem)) for one in found) > MOST:
        found.pop()
    return tuple(found)


class _Wishes:
    """Draws the conditions of wishes."""

    def __init__(self, rng: Random, meant: Interpreter, states: Sequence[State]) -> None:
        self.rng, self.of, self.states = rng, meant, states
        self.kinds = meant.problem.domain.situations
        self.symbols = [s for s in meant.slots if s.arguments != ("task",) and not self.kinds[s.situation].added]

    def conditions(self, kind: str) -> list[Condition]:
        """Return conditions of one or two wishes of a kind, or nothing if the world has none."""
        rng, goal = self.rng, self.of.problem.goal
        goals = [symbol for symbol in goal if symbol in self.of.slots and symbol.arguments != ("task",)]
        derived = [s for s in self.symbols if self.of.slots[s] >= self.of.stated]
        unary = [s for s in self.symbols if len(s.arguments) == 1 and self.kinds[s.situation].quantity is None]
        match kind:
            case "same" | "other" if goals:
                return [self.fact(rng.choice(goals))]
            case "pair" if self.symbols:
                symbol = self.symbol(self.symbols)
                return [self.fact(symbol), self.fact(symbol)]
            case "class" if unary:
                return [self.of_each(self.symbol(unary))]
            case "defined" if derived:
                return [self.fact(rng.choice(derived)) for _ in range(rng.choice((1, 2)))]
            case "any" if self.symbols:
                return [AnyOf(tuple(self.group(rng.choice((1, 1, 2))) for _ in range(rng.choice((2, 2, 3)))))]
            case "all" if self.symbols:
                return [AnyOf((self.group(2),))]
            case "some" if self.symbols:
                return [self.some()]
            case _:
                return []

    def symbol(self, symbols: Sequence[Symbol]) -> Symbol:
        """Return one of some symbols, preferring changed symbols, and symbols with rest values."""
        state = self.rng.choice(self.states)
        changed = [s for s in symbols if self.of.value(state, s) != self.of.value(self.of.initial, s)]
        resting = [s for s in symbols if self.kinds[s.situation].rest is not None]
        return self.rng.choice(self.rng.choice([some for some in (changed, changed, resting, symbols) if some]))

    def fact(self, symbol: Symbol) -> Condition:
        """Return the condition that a symbol has the value of some state, or any value."""
        rng, kind = self.rng, self.kinds[symbol.situation]
        value: Any = self.of.value(rng.choice(self.states), symbol)
        if kind.quantity is None:
            if rng.random() < 0.2:
                value = rng.choice((FALSE, TRUE) if kind.boolean else self.of.problem.classes[kind.range])
            if kind.boolean:
                return ValueCondition(symbol.situation, symbol.arguments, TRUE, value == FALSE)
            return ValueCondition(symbol.situation, symbol.arguments, value, rng.random() < 0.2)
        sayable = value == value and abs(value) < 100 and Fraction(value).denominator in (1, 2, 4)
        limit, sign = Fraction(value) if sayable else Fraction(1), rng.choice(("=", ">=", "<=", "<", ">"))
        limit += {"<": 1, ">": -1}.get(sign, 0)
        return Comparison(Amount(symbol.situation, symbol.arguments), sign, limit, rng.random() < 0.1)

    def group(self, many: int) -> tuple[Condition, ...]:
        return tuple(self.fact(self.symbol(self.symbols)) for _ in range(many))

    def of_each(self, symbol: Symbol) -> Condition:
        """Return the condition that all individuals of a class have a value."""
        kind = self.kinds[symbol.situation].arguments[0]
        one = self.fact(symbol)
        kinds = [of for of in ("A", "B", "A1") if self.of.problem.classes[of] and of in kind.split("|")]
        if not kinds or not isinstance(one, ValueCondition):
            return one
        inner = replace(one, arguments=(EACH,), negated=not one.negated)
        return Witness(EACH, self.rng.choice(kinds), (inner,), True)

    def some(self) -> Condition:
        """Return the condition that some individual satisfies one or two conditions, or none does."""
        rng = self.rng
        symbol = self.symbol(self.symbols)
        kind = self.kinds[symbol.situation].arguments[0].split("|")[0]
        inner = [self.about(symbol)]
        others = [
            s for s in self.symbols if self.kinds[s.situation].arguments[0] == kind and s.situation != symbol.situation
        ]
        if others and rng.random() < 0.5:
            inner.append(self.about(self.symbol(others)))
        return Witness("?w", kind, tuple(inner), rng.random() < 0.2)

    def about(self, symbol: Symbol) -> Condition:
        """Return a condition like that of a fact, with the variable in place of the first argument."""
        one = self.fact(symbol)
        arguments = ("?w", *symbol.arguments[1:])
        if isinstance(one, Comparison):
            return replace(one, left=Amount(symbol.situation, arguments))
        assert isinstance(one, ValueCondition)
        return replace(one, arguments=arguments)


def softened(problem: Problem, wished: Sequence[Wish], weights: Mapping[Symbol, Fraction]) -> Problem:
    """Return a problem with goals for wishes, and the weights of all soft goals."""
    found = dict(weights)
    for number, wish in enumerate(wished):
        facts = wish.facts(problem)
        for member, condition in enumerate(facts):
            name = f"wish{number}" if condition is wish.condition else f"wish{number}.{member}"
            problem = with_goal(problem, name, condition)
            found |= {} if wish.weight is None else {Symbol(name, ("task",)): wish.weight}
    return replace(problem, weights=found)


def with_goal(problem: Problem, name: str, wanted: Condition) -> Problem:
    """Return a problem with another goal, which a rule defines."""
    domain = problem.domain
    levels = [domain.situations[each].level for each in named([wanted])]
    levels += [problem.value_levels.get(term, 1) for inner in walk(wanted) for term in terms(inner)]
    derived = SituationType(name, (TASK,), "Truth", max(levels, default=1), boolean=True, default=FALSE)
    rule = Rule(name, (Parameter("?task", TASK),), (), (wanted,))
    more = replace(domain, situations={**domain.situations, name: derived}, rules={**domain.rules, name: (rule,)})
    goal = {Symbol(name, ("task",)): TRUE, **problem.goal}
    return replace(problem, domain=more, goal=goal, classes={**problem.classes, TASK: ("task",)})


def choices(weights: Iterable[Symbol]) -> Iterator[frozenset[Symbol]]:
    """Yield all sets of soft goals."""
    every = list(weights)
    for many in range(len(every) + 1):
        yield from map(frozenset, combinations(every, many))


def least_costs(soft: Interpreter, most: int) -> dict[frozenset[Symbol], Fraction]:
    """Return the least cost of each choice of soft goals that some steps of the lowest level meet, together with the hard goals.

    Only the hard goals and the goals of the choice release symbols from their rest values.

    Raises
    ------
    TooManyStatesError
        More than `most` nodes are reachable.
    """
    problem, weights = soft.problem, soft.problem.weights
    level = max(problem.domain.levels, default=0)
    hard = {symbol: value for symbol, value in problem.goal.items() if symbol not in weights}
    meant = soft.without_weights()
    groups: dict[frozenset[int], list[frozenset[Symbol]]] = {}
    for kept in choices(weights):
        its = meant.wanting({**hard, **{symbol: problem.goal[symbol] for symbol in kept}}).rests
        groups.setdefault(frozenset(its), []).append(kept)
    found: dict[frozenset[Symbol], Fraction] = {}
    for slots, some in groups.items():
        free = meant.wanting({})
        free.rests = {slot: rest for slot, rest in meant.wanting({}).rests.items() if slot in slots}
        best: dict[frozenset[Symbol], Any] = {}
        for (state, restless), cost in free.explored(level, most).costs.items():
            if not restless and all(meant.meets(state, symbol, value) for symbol, value in hard.items()):
                met = frozenset(symbol for symbol in weights if meant.meets(state, symbol, problem.goal[symbol]))
                best[met] = min(cost, best.get(met, cost))
        for kept in some:
            costs = [Fraction(cost) for met, cost in best.items() if kept <= met]
            found |= {kept: min(costs)} if costs else {}
    return found


def least_total(costs: Mapping[frozenset[Symbol], Fraction], weights: Mapping[Symbol, Fraction]) -> Fraction | None:
    """Return the least sum of the cost of a choice and the weights of the other soft goals, or None without a plan."""
    totals = [
        cost + sum(weight for symbol, weight in weights.items() if symbol not in kept) for kept, cost in costs.items()
    ]
    return min(totals, default=None)
