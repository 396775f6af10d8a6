"""Choice among rule instances by cogency, which is learned from the facts of earlier choices and rejections.

The facts about an individual in a role are generated from the domain. Such a fact is about one of the following: a class of the
individual that behaviours distinguish, a value or goal value of the individual, an object that has the individual as value or goal
value, or a static relation to the individual in another role.

Cogency is eq. (1) of the paper in log odds: a rule contributes ln((c + ½)/(p + ½)) for c choices and p rejections or
failures, and each fact contributes ln(p(fact | chosen)/p(fact | not)). An unseen fact contributes nothing; an unseen
class is judged by its superclasses. Preferences for single individuals decay by a tenth with each episode.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import log
from typing import TypeAlias

from confab.planner.hierarchical.operators import Program
from confab.planner.transitions import Cell, Table
from confab.reasoner.language import walk
from confab.reasoner.memory.experience import ITSELF, Experience, LearnedRule, Method, RoleFact, Tally
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, ClassCondition, Witness

DECAY = 0.9
"""Factor by which a preference decays with each later episode."""
CROWD = 4
"""Maximum size of a class for which preferences for single individuals are counted."""
ByRole: TypeAlias = "Mapping[str, str]"
"""The individual of each role, by the name of the role."""
AnswerOf: TypeAlias = "Callable[[str, ByRole], str]"
"""Function that returns the answer to a question about an individual in a role."""


class FactReader:
    """Reader of facts about the individuals in a rule's roles, for one table and one goal."""

    def __init__(self, program: Program, table: Table, goal: Mapping[Cell, str]) -> None:
        self.problem, self.table, self.goal = program.problem, table, goal
        self.constants = frozenset(program.named)
        self.kinds = told_apart(self.problem)
        self.wanters: dict[tuple[str, str], list[Cell]] = {}
        for cell, value in goal.items():
            self.wanters.setdefault((cell[0], value), []).append(cell)
        self._plans: dict[tuple[str, bool], list[tuple[int, str, AnswerOf]]] = {}

    def facts(self, rule: LearnedRule, roles: tuple[str, ...], among: Container[str] | None = None) -> list[RoleFact]:
        """Return the facts about the individuals in a rule's roles, optionally only the facts for given questions."""
        plan = self._plans.get((rule.name, among is None))
        if plan is None:
            asked = [question for question in self._questions(rule) if among is None or question[1] in among]
            plan = self._plans[rule.name, among is None] = asked
        named = {individual: role for (role, _), individual in zip(rule.kinds, roles, strict=True)}
        return [(asks, answer(roles[i], named)) for i, asks, answer in plan]

    def individuals(self, rule: LearnedRule, roles: tuple[str, ...]) -> list[RoleFact]:
        """Return the individual in each role of a rule, for the roles whose class has few members."""
        members = self.problem.members
        return [
            (f"who is {role[1:]}", individual)
            for (role, kind), individual in zip(rule.kinds, roles, strict=True)
            if 1 < len(members(kind)) <= CROWD
        ]

    def _questions(self, rule: LearnedRule) -> Iterator[tuple[int, str, AnswerOf]]:
        members, situations = self.problem.members, self.problem.domain.situations.values()
        for i, (role, kind) in enumerate(rule.kinds):
            here, name = members(kind), role[1:]
            for other in self.kinds:
                if not here <= members(other) and not here.isdisjoint(members(other)):
                    yield i, f"{name} is a {other}", partial(self._belongs, members(other))
            for s in situations:
                if len(s.arguments) == 1 and not here.isdisjoint(members(s.arguments[0])):
                    yield i, f"{s.name} of {name}", partial(self._value, s.name)
                    yield i, f"wanted {s.name} of {name}", partial(self._wanted, s.name)
                if not s.boolean and len(s.arguments) == 1 and not here.isdisjoint(members(s.range)):
                    own = rule.goal.arguments if rule.goal.situation == s.name else ()
                    yield i, f"who has {name} as {s.name}", partial(self._holders, s.name)
                    yield i, f"who wants {name} as {s.name}", partial(self._wanting, s.name, own)
            for relation, rows in self.problem.relations.items():
                if len(next(iter(rows), ())) == 2:
                    for j, (other, of) in enumerate(rule.kinds):
                        if j != i and any(a in here and b in members(of) for a, b in rows):
                            yield i, f"{name} {relation} {other[1:]}", partial(self._tied, rows, other)

    def _belongs(self, among: Container[str], individual: str, _: ByRole) -> str:
        return "yes" if individual in among else "no"

    def _value(self, situation: str, individual: str, named: ByRole) -> str:
        value = self.table.now[situation].get(individual, "none")
        return value if value == "none" or value in self.constants else named.get(value, "?another")[1:]

    def _wanted(self, situation: str, individual: str, _: ByRole) -> str:
        wanted = self.goal.get((situation, individual))
        if wanted is None:
            return "nothing"
        return "as it is" if self.table.now[situation].get(individual, FALSE) == wanted else "not yet"

    def _holders(self, situation: str, individual: str, named: ByRole) -> str:
        keys = self.table.holders[situation].get(individual)
        if not keys:
            return "nobody"
        return next((role[1:] for one, role in named.items() if one in keys), "somebody")

    def _wanting(self, situation: str, own: Container[str], individual: str, named: ByRole) -> str:
        now, wanters = self.table.now[situation], self.wanters.get((situation, individual), ())
        others = (key for _, key in wanters if not isinstance(key, str) or named.get(key) not in own)
        return "somebody" if any(now.get(key, FALSE) != individual for key in others) else "nobody"

    def _tied(self, rows: Container[tuple[str, ...]], other: str, individual: str, named: ByRole) -> str:
        return "yes" if any(role == other and (individual, end) in rows for end, role in named.items()) else "no"


def fillers(method: Method, roles: Sequence[str | None], problem: Problem) -> list[RoleFact]:
    """Return the facts about each individual in an open role of a small class, alone and together with individuals of the step."""
    found = list[RoleFact]()
    for role, individual in zip(method.open, roles[method.roles :], strict=True):
        if role.source is None and individual is not None and 1 < len(problem.members(role.kind)) <= CROWD:
            asks = f"who is {role.kind}"
            found += [
                (asks, individual),
                *((f"{asks} with {other}", individual) for other in roles[: method.roles] if other),
            ]
    return found


@dataclass(frozen=True)
class Factor:
    """One term of the sum that makes a behaviour's cogency: a fact, and the fact's weight as a logarithm of odds."""

    fact: RoleFact
    weight: float


class Scorer:
    """Computation of the cogency of following a rule; the cogency is computed from counts."""

    def __init__(self, experience: Experience) -> None:
        self.totals = experience.totals()
        self.preferred = experience.preferences(DECAY)
        self._weights: dict[str, dict[RoleFact, float]] = {}
        self._asked: dict[str, frozenset[str]] = {}

    def weights(self, rule: LearnedRule | Method) -> Mapping[RoleFact, float]:
        """Return the contributions of a rule itself, and of each counted fact, to the cogency of the rule, in ln odds."""
        found = self._weights.get(rule.name)
        if found is None:
            counted = self.totals.get(rule.name, {})
            whole = counted.get(ITSELF, Tally())
            not_ = whole.passed_over + whole.failed
            spread = Counter(asks for asks, _ in counted)
            found = self._weights[rule.name] = {ITSELF: log((whole.chosen + 0.5) / (not_ + 0.5))} if counted else {}
            for fact, tally in counted.items():
                if fact != ITSELF and spread[fact[0]] > 1:  # otherwise the fact doesn't distinguish candidates
                    chosen = (tally.chosen + 1) / (whole.chosen + spread[fact[0]])
                    passed = (tally.passed_over + tally.failed + 1) / (not_ + spread[fact[0]])
                    found[fact] = log(chosen / passed)
        return found

    def factors(
        self, rule: LearnedRule | Method, facts: Iterable[RoleFact], individuals: Iterable[RoleFact] = ()
    ) -> Iterator[Factor]:
        """Yield the contributions to the cogency of following a rule in a situation with the given facts."""
        weights, liked = self.weights(rule), self.preferred.get(rule.name, {})
        for fact in (ITSELF, *facts):
            if fact in weights:
                yield Factor(fact, weights[fact])
        for fact in individuals:
            c, p = liked.get(fact, (0.0, 0.0))
            if c or p:
                yield Factor(fact, log((c + 0.5) / (p + 0.5)))

    def cogency(self, rule: LearnedRule | Method, facts: Iterable[RoleFact], individuals: Iterable[RoleFact]) -> float:
        """Return the sum of the contributions to the cogency."""
        return sum(factor.weight for factor in self.factors(rule, facts, individuals))

    def score(self, reader: FactReader, rule: LearnedRule, roles: tuple[str, ...]) -> float:
        """Return the cogency of following a rule with individuals in its roles, according to the counted facts."""
        weights = self.weights(rule)
        if rule.name not in self._asked:
            self._asked[rule.name] = frozenset(asks for asks, _ in weights)
        facts = reader.facts(rule, roles, self._asked[rule.name])
        individual = reader.individuals(rule, roles) if rule.name in self.preferred else ()
        return self.cogency(rule, facts, individual)


def told_apart(problem: Problem) -> tuple[str, ...]:
    """Return the classes that behaviours, situation types or terms use; other classes don't affect applicability."""
    found: dict[str, None] = {}
    for behavior in problem.domain.behaviors.values():
        found.update(dict.fromkeys(behavior.kinds.values()))
        for condition in (*behavior.preconditions, *(c for effect in behavior.effects for c in effect.when)):
            found.update((inner.kind, None) for inner in walk(condition) if isinstance(inner, ClassCondition | Witness))
    for situation in problem.domain.situations.values():
        found.update(dict.fromkeys((*situation.arguments, situation.range)))
    return tuple(sorted(found))
