"""Sentences about learned experience: rules, orders of goals, methods, kinds of goals, and the facts that a score counts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from confab.labels import Labels
from confab.reasoner.amounts import LESS, MORE
from confab.reasoner.memory.experience import GoalKind, LearnedItem, LearnedOrder, LearnedRule, Method
from confab.reasoner.problem import Domain
from confab.reasoner.sentences import said as plainly
from confab.reasoner.symbols import Condition, Fact, RelationCondition, Symbol, Witness

MOST_SAID = 6
"""Maximum number of conditions in the sentence about a rule."""
ASKED = (
    (re.compile(r"wanted (\S+) of (\S+)"), "the {0} wanted of {1}: {answer}"),
    (re.compile(r"who has (\S+) as (\S+)"), "object whose {1} is {0}: {answer}"),
    (re.compile(r"who wants (\S+) as (\S+)"), "object whose {1} shall be {0}: {answer}"),
    (re.compile(r"who is (\S+) with (\S+)"), "{0} is {answer} beside {1}"),
    (re.compile(r"who is (\S+)"), "{0} is {answer}"),
    (re.compile(r"(\S+) is a (\S+)"), "{0} is a {1}: {answer}"),
    (re.compile(r"(\S+) of (\S+)"), "the {0} of {1}: {answer}"),
)


class Sayings:
    """Writer of sentences about learned experience.

    The sentences use labels if labels are available, and otherwise the ontology's names.
    """

    def __init__(self, labels: Labels | None = None) -> None:
        self.labels = labels or Labels({}, {}, Domain({}, {}))

    def name(self, name: str) -> str:
        """Return the label of a role, class or term."""
        role = re.fullmatch(r"\?(.+?)(\d*)", name)
        if role is None or name in self.labels.words:
            return self.labels.name(name)
        kind = next(
            (k for k in (role[1], role[1][:1].upper() + role[1][1:], role[1].upper()) if k in self.labels.words),
            role[1],
        )
        return self.labels.name(kind) + (f" {role[2]}" if role[2] else "")

    def condition(self, condition: Condition) -> str:
        """Return a condition as a sentence."""
        return plainly(condition, self._words)

    def _words(self, what: object) -> str:
        return self.fact(what) if isinstance(what, Fact) else self.name(str(what))

    def fact(self, fact: Fact) -> str:
        """Return a fact about roles as a sentence."""
        terms = {t: self.name(t) for t in (*fact.symbol.arguments, fact.value)}
        put = Fact(Symbol(fact.symbol.situation, tuple(terms[a] for a in fact.symbol.arguments)), terms[fact.value])
        if fact.value in ("true", "false"):
            put = Fact(put.symbol, fact.value)
        return self.labels.fact(put)

    def step(self, behavior: str, terms: Sequence[str]) -> str:
        """Return a behaviour with its arguments (roles or individuals) as a sentence."""
        known = self.labels.domain.behaviors.get(behavior)
        if known is None or len(known.parameters) != len(terms):
            return " ".join((self.labels.name(behavior), *map(self.name, terms)))
        put = {p.name: self.name(term) for p, term in zip(known.parameters, terms, strict=True)}
        return self.labels.behavior(known, put)

    def goal(self, rule: LearnedRule) -> str:
        """Return the goal of a rule as a sentence."""
        if rule.goal.value in (MORE, LESS):
            who = " ".join(map(self.name, rule.goal.arguments))
            return f"the amount “{self.name(rule.goal.situation)}” of {who} {'in' if rule.goal.value == MORE else 'de'}creases"
        return self.fact(Fact(Symbol(rule.goal.situation, rule.goal.arguments), rule.goal.value))

    def rule(self, rule: LearnedRule) -> str:
        """Return a rule as a sentence."""
        said = sorted(rule.asks, key=lambda c: isinstance(c, Witness | RelationCondition))
        asks = [*dict.fromkeys(map(self.condition, said))]  # several conditions may enforce one constraint
        left = len(asks) - MOST_SAID
        more = f" and {left} more condition{'s' * (left > 1)}" if left > 0 else ""
        when = f", when {', '.join(asks[:MOST_SAID])}{more}" if asks else ""
        return f"so that {self.goal(rule)}{when}: {self.step(*rule.does)}"

    def said(self, one: LearnedItem) -> str:
        """Return a learned rule, order of goals, method or kind of goal as a sentence."""
        match one:
            case LearnedRule():
                return self.rule(one)
            case LearnedOrder(first, then, shared):
                same = " of the same individual" if shared else ""
                return f"{self.name(first)} before {self.name(then)}{same}"
            case Method(behavior, _, steps, _):
                return f"{self.name(behavior)} by {', '.join(self.name(name) for name, _ in steps)}"
            case GoalKind(situation, classes):
                what = self.name(situation)
                return " of ".join((what, *(name for name in map(self.name, classes) if name not in what.split(" "))))
        raise TypeError(one)

    def asked(self, fact: tuple[str, str], roles: Mapping[str, str]) -> str:
        """Return a sentence about a fact that cogency (a score) counts, with individuals in place of roles."""
        asks, answer = fact

        def put(word: str) -> str:
            return self.labels.name(roles["?" + word]) if "?" + word in roles else self.name(word)

        for pattern, sentence in ASKED:
            if match := pattern.fullmatch(asks):
                return sentence.format(*map(put, match.groups()), answer=put(answer))
        return f"{' '.join(map(put, asks.split()))}: {answer}"
