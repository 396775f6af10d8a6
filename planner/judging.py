"""Cogency of a candidate from counts: how much more its facts speak for choosing it than for passing it over.

c, p    how often such candidates were chosen, and passed over (or chosen in vain)
L       ln((c + ½) / (p + ½)) + Σ w_f · ln(p(f | chosen) / p(f | passed over)) over the facts f
w_f     relevance of a fact: Jensen–Shannon divergence of both distributions, less what chance alone gives
o       σ(L), then for each class level downwards (c + κ o) / (c + p + κ) with the counts of the very same pattern, and in the end
        with those of the very individual, each episode since weighing less: what was preferred among equals may change

Equation (1) of the paper drops a factor that all conclusions share, because all see the same facts. Lifted facts differ from one
candidate to the next; the share of candidates passed over of which they hold, in the denominator, restores the comparison.
Probabilities back off over classes, from the parameters' types down to the most specific ones: (m p̂ + α p_above) / (m + α), with
the same m, the lesser of both sums, on both sides.

After R. Hecht-Nielsen, "Cogent confabulation", Neural Networks 18 (2005) 111-115; back-off as in S. Katz, IEEE TASSP 35 (1987),
with the linear shrinkage of Jelinek and Mercer (1980).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from reasoner.experience import Candidate, Conclusion, Experience, Pattern, Tallies, lineage

Verdicts: TypeAlias = "dict[tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]], float]"
"""Cogency by classes, the facts' values, and the individuals where they matter."""

ALPHA = 1.0  # how much the class above weighs in a probability
KAPPA = 2.0  # how much L weighs against counts of the same pattern
DECAY = 0.9  # per episode, of what was preferred among equals
CLEAR = 3.0  # so many times as often taken as passed over is a clear preference
IS_WHO = " is who"
TOGETHER = "all of this together"
ENOUGH = 4  # of both choices and passes, for a fact to be looked at within the counts of another
TELLING = 0.02  # relevance of a fact from which it is worth that
LEAST = 1e-3  # a fact of less relevance isn't looked at


@dataclass(frozen=True)
class Factor:
    """One summand of a cogency: what spoke, and how strongly (natural logarithm; positive speaks for choosing)."""

    fact: str
    value: str
    weight: float


@dataclass
class Sums:
    """The counts of all conclusions of a class level: of facts, and of whole patterns of the relevant facts."""

    chosen: float = 0.0
    passed: float = 0.0
    facts: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    patterns: dict[Pattern, list[float]] = field(default_factory=dict)
    weights: dict[str, float] = field(default_factory=dict)
    apart: str | None = None
    parts: dict[str, Sums] | None = None

    def add(self, pattern: Pattern, chosen: float, passed: float) -> None:
        """Count a pattern and each of its facts."""
        self.chosen += chosen
        self.passed += passed
        for fact, value in pattern:
            pair = self.facts.setdefault(fact, {}).setdefault(value, [0.0, 0.0])
            pair[0] += chosen
            pair[1] += passed

    def relevance(self, fact: str) -> float:
        """Return w of a fact, in [0, 1]; asked once all is counted."""
        if fact not in self.weights:
            self.weights[fact] = relevance([(c, p) for c, p in self.facts.get(fact, {}).values()])
        return self.weights[fact]

    def part(self, pattern: Mapping[str, str]) -> tuple[str, Sums] | None:
        """Return the fact that discriminates most here and the counts of its value alone; None where counts are thin."""
        if self.parts is None:
            self.parts = {}
            if min(self.chosen, self.passed) >= ENOUGH:
                self.apart = max(self.facts, key=lambda fact: (self.relevance(fact), fact), default=None)
                if self.apart is not None and self.relevance(self.apart) < TELLING:
                    self.apart = None
            if self.apart is not None:
                for known, (c, p) in self.patterns.items():
                    value = dict(known).get(self.apart)
                    if value is not None:
                        part = self.parts.setdefault(value, Sums())
                        part.add(known, c, p)
                        part.patterns[known] = [c, p]
        within = self.parts.get(pattern.get(self.apart, "")) if self.apart is not None else None
        return None if within is None or self.apart is None else (self.apart, within)


def relevance(pairs: Sequence[tuple[float, float]]) -> float:
    """Return the Jensen–Shannon divergence of two distributions given as counts, less its small-sample bias, in [0, 1].

    >>> relevance([(50, 0), (0, 50)]) > 0.9, relevance([(50, 50), (50, 50)]), relevance([(1, 0), (0, 1)]) < 0.7
    (True, 0.0, True)
    """
    chosen, passed = sum(c for c, _ in pairs), sum(p for _, p in pairs)
    if not chosen or not passed:
        return 0.0
    divergence = 0.0
    for c, p in pairs:
        a, b = c / chosen, p / passed
        middle = (a + b) / 2
        divergence += (a * math.log(a / middle) if a else 0.0) + (b * math.log(b / middle) if b else 0.0)
    bias = (len(pairs) - 1) / 8 * (1 / chosen + 1 / passed)
    return min(max((divergence / 2 - bias) / math.log(2), 0.0), 1.0)


def preferred(experience: Experience) -> set[tuple[str, str, str]]:
    """Return behaviour, role and individual where one was taken `CLEAR` times as often as it was passed over, of late."""
    sums: dict[tuple[str, str, str], list[float]] = {}
    for conclusion, table in experience.preferences(DECAY).items():
        for pattern, (c, p) in table.items():
            fact, who = pattern[-1]
            pair = sums.setdefault((conclusion.behavior, fact.removesuffix(IS_WHO), who), [0.0, 0.0])
            pair[0] += c
            pair[1] += p
    return {key for key, (c, p) in sums.items() if c >= CLEAR * (p + 1)}


class Judge:
    """What an experience says of candidates; reads it once, and remembers its verdicts.

    Parameters
    ----------
    experience : Experience
    parents : mapping of class to its superclasses
    roles : mapping of behaviour to its roles, each a name and a class
        Where back-off ends.
    without : facts that are not looked at
        For explanations: what would be chosen without them?
    """

    def __init__(
        self,
        experience: Experience,
        parents: Mapping[str, tuple[str, ...]],
        roles: Mapping[str, Sequence[tuple[str, str]]],
        without: frozenset[str] = frozenset(),
    ) -> None:
        self.parents = parents
        self.roles = {behavior: [kind for _, kind in pairs] for behavior, pairs in roles.items()}
        self.names = {behavior: [name for name, _ in pairs] for behavior, pairs in roles.items()}
        self.tallies: dict[str, Tallies] = {}
        for conclusion, patterns in experience.totals().items():
            if len(conclusion.classes) == len(roles.get(conclusion.behavior, ())):
                self.tallies.setdefault(conclusion.behavior, {})[conclusion] = patterns
        self._chains: dict[Conclusion, tuple[tuple[str, ...], ...]] = {}
        self._sums: dict[tuple[str, tuple[str, ...]], Sums] = {}
        self.facts: dict[str, frozenset[str]] = {}
        for behavior in self.tallies:
            top = self._raw(behavior, tuple(self.roles[behavior]))
            within = [self._raw(behavior, c.classes) for c in self.tallies[behavior]]
            self.facts[behavior] = frozenset(
                fact
                for fact in top.facts
                if fact not in without and any(sums.relevance(fact) > LEAST for sums in (top, *within))
            )
        self.liked = self._liked(experience.preferences(DECAY))
        self._odds: dict[tuple[Conclusion, Pattern], float] = {}
        self.verdicts: dict[
            tuple[str, tuple[str, ...]], Verdicts
        ] = {}  # by behaviour and the facts that are asked of it

    def knows(self, behaviors: Iterable[str]) -> bool:
        """Whether anything was learned of any of these behaviours."""
        return any(behavior in self.tallies for behavior in behaviors)

    def odds(self, conclusion: Conclusion, pattern: Pattern) -> float:
        """Return ln(o / (1 - o)): positive if such a candidate is rather chosen than passed over.

        The pattern may have more facts than are looked at.
        """
        key = conclusion, pattern
        found = self._odds.get(key)
        if found is None:
            found = self._odds[key] = sum(factor.weight for factor in self.factors(Candidate(conclusion, pattern)))
        return found

    def cogency(self, candidate: Candidate) -> float:
        """Return the candidate's odds, and what is preferred among its equals."""
        return sum(factor.weight for factor in self.factors(candidate))

    def factors(self, candidate: Candidate) -> list[Factor]:
        """Return the summands of a candidate's cogency, the facts in their order."""
        behavior = candidate.conclusion.behavior
        if behavior not in self.tallies:
            return []
        looked = self.facts[behavior]
        pattern = tuple(pair for pair in candidate.pattern if pair[0] in looked)
        levels = [self._level(behavior, classes) for classes in self._chain(candidate.conclusion)]
        prior = 0.0
        weights = dict.fromkeys((fact for fact, _ in pattern), 0.0)
        ratios: dict[str, tuple[float, float]] = {}
        strata = [("", sums) for sums in levels if sums.chosen + sums.passed] or [("", levels[0])]
        given = dict(pattern)
        while (part := strata[-1][1].part(given)) is not None:
            strata.append(part)
        moved = dict.fromkeys(given, 0.0)
        for apart, sums in strata:
            total = sums.chosen + sums.passed
            before = prior
            here = math.log((sums.chosen + 0.5) / (sums.passed + 0.5))
            prior = (total * here + ALPHA * prior) / (total + ALPHA)
            if apart:
                moved[apart] += prior - before
            m = min(sums.chosen, sums.passed)
            if not m:
                continue
            for fact, value in pattern:
                table = sums.facts.get(fact, {})
                above = ratios.get(fact) or (1 / (len(table) + 1),) * 2
                c, p = table.get(value, (0.0, 0.0))
                ratios[fact] = (
                    (m * c / sums.chosen + ALPHA * above[0]) / (m + ALPHA),
                    (m * p / sums.passed + ALPHA * above[1]) / (m + ALPHA),
                )
                weights[fact] = (m * sums.relevance(fact) + ALPHA * weights[fact]) / (m + ALPHA)
        found = [Factor(f"{candidate.conclusion}", "prior", prior - sum(moved.values()))]
        found += [
            Factor(fact, value, moved[fact] + weights[fact] * math.log(ratios[fact][0] / ratios[fact][1]))
            for fact, value in pattern
            if fact in ratios
        ]
        before = sum(factor.weight for factor in found)
        after = before
        for sums in levels:
            c, p = sums.patterns.get(pattern, (0.0, 0.0))
            o = 1 / (1 + math.exp(-max(min(after, 50.0), -50.0)))
            o = (c + KAPPA * o) / (c + p + KAPPA)
            if c + p:
                after = math.log(max(o, 1e-9)) - math.log(max(1 - o, 1e-9))
        c, p = levels[0].patterns.get(pattern, (0.0, 0.0))
        found.append(Factor(TOGETHER, f"chosen {c:g} of {c + p:g}", after - before))
        return found + self._preferences(candidate, after, pattern)

    def _preferences(self, candidate: Candidate, odds: float, pattern: Pattern) -> list[Factor]:
        """Return how far the individuals themselves are preferred to others in their roles, on top of `odds`."""
        found = []
        liked = self.liked.get((candidate.conclusion.behavior, candidate.conclusion.classes), {})
        for role, individual in candidate.roles if liked else ():
            c, p = liked.get((*pattern, (f"{role}{IS_WHO}", individual)), (0.0, 0.0))
            if c + p:
                before = 1 / (1 + math.exp(-max(min(odds, 50.0), -50.0)))
                after = (c + KAPPA * before) / (c + p + KAPPA)
                found.append(Factor(f"{role}{IS_WHO}", individual, math.log(after) - math.log(1 - after) - odds))
                odds += found[-1].weight
        return found

    def _liked(
        self, preferred: Mapping[Conclusion, Mapping[Pattern, tuple[float, float]]]
    ) -> dict[tuple[str, tuple[str, ...]], dict[Pattern, tuple[float, float]]]:
        """Return the individuals that were preferred, and not, by pattern of the facts that are looked at."""
        found: dict[tuple[str, tuple[str, ...]], dict[Pattern, tuple[float, float]]] = {}
        for conclusion, table in preferred.items():
            looked = self.facts.get(conclusion.behavior)
            if looked is None or len(conclusion.classes) != len(self.roles[conclusion.behavior]):
                continue
            liked = found.setdefault((conclusion.behavior, conclusion.classes), {})
            for pattern, (c, p) in table.items():
                key = (*(pair for pair in pattern[:-1] if pair[0] in looked), pattern[-1])
                c0, p0 = liked.get(key, (0.0, 0.0))
                liked[key] = c0 + c, p0 + p
        return found

    def _chain(self, conclusion: Conclusion) -> tuple[tuple[str, ...], ...]:
        """Return the class levels of a conclusion, the parameters' types first."""
        found = self._chains.get(conclusion)
        if found is None:
            lines = [
                lineage(kind, top, self.parents)
                for kind, top in zip(conclusion.classes, self.roles[conclusion.behavior], strict=True)
            ]
            depth = max(map(len, lines), default=1)
            levels = [tuple(line[min(i, len(line) - 1)] for line in lines) for i in range(depth)]
            found = self._chains[conclusion] = tuple(dict.fromkeys(levels))
        return found

    def _members(self, behavior: str, classes: tuple[str, ...]) -> Iterable[dict[Pattern, tuple[float, float]]]:
        """Yield the patterns of each conclusion that passes through a class level."""
        for conclusion, patterns in self.tallies[behavior].items():
            if classes in self._chain(conclusion):
                yield {k: (float(t.chosen), float(t.passed_over + t.failed)) for k, t in patterns.items()}

    def _raw(self, behavior: str, classes: tuple[str, ...]) -> Sums:
        sums = Sums()
        for patterns in self._members(behavior, classes):
            for pattern, (c, p) in patterns.items():
                sums.add(pattern, c, p)
        return sums

    def _level(self, behavior: str, classes: tuple[str, ...]) -> Sums:
        """Return the counts of a class level, with patterns of the relevant facts only."""
        key = behavior, classes
        found = self._sums.get(key)
        if found is None:
            found = self._sums[key] = self._raw(behavior, classes)
            looked = self.facts[behavior]
            for patterns in self._members(behavior, classes):
                for pattern, (c, p) in patterns.items():
                    pair = found.patterns.setdefault(tuple(f for f in pattern if f[0] in looked), [0.0, 0.0])
                    pair[0] += c
                    pair[1] += p
        return found
