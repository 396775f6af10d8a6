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
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from planner.experience.counts import Floats, Ledger, Sums
from reasoner.memory.counts import Candidate, Conclusion, Experience, Pattern, Tallies, lineage

Verdicts: TypeAlias = "dict[tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]], float]"
"""Cogency by classes, the facts' values, and the individuals where they matter."""

ALPHA = 1.0  # how much the class above weighs in a probability
KAPPA = 2.0  # how much L weighs against counts of the same pattern
DECAY = 0.9  # per episode, of what was preferred among equals
CLEAR = 3.0  # so many times as often taken as passed over is a clear preference
IS_WHO = " is who"
TOGETHER = "all of this together"
LEAST = 1e-3  # a fact of less relevance isn't looked at


@dataclass(frozen=True)
class Factor:
    """One summand of a cogency: what spoke, and how strongly (natural logarithm; positive speaks for choosing)."""

    fact: str
    value: str
    weight: float


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
        tallies: dict[str, Tallies] = {}
        for conclusion, patterns in experience.totals().items():
            if len(conclusion.classes) == len(roles.get(conclusion.behavior, ())):
                tallies.setdefault(conclusion.behavior, {})[conclusion] = patterns
        self.conclusions = {behavior: tuple(known) for behavior, known in tallies.items()}
        self._chains: dict[Conclusion, tuple[tuple[str, ...], ...]] = {}
        self._sums: dict[tuple[str, tuple[str, ...]], Sums] = {}
        self._weights: dict[tuple[int, ...], tuple[float, Floats | None]] = {}
        self.facts: dict[str, frozenset[str]] = {}
        self.ledgers: dict[str, Ledger] = {}
        for behavior, known in tallies.items():
            ledger = Ledger(known)
            levels = {tuple(self.roles[behavior]), *(conclusion.classes for conclusion in known)}
            relevance = [ledger.sums(self._members(behavior, classes)).relevance for classes in levels]
            telling = np.max(relevance, axis=0) > LEAST
            looked = frozenset(f for f, tells in zip(ledger.facts, telling, strict=True) if tells and f not in without)
            self.facts[behavior] = looked
            self.ledgers[behavior] = ledger.narrowed(looked)
        self.liked = self._liked(experience.preferences(DECAY))
        self._odds: dict[tuple[Conclusion, Pattern], float] = {}
        self.verdicts: dict[
            tuple[str, tuple[str, ...]], Verdicts
        ] = {}  # by behaviour and the facts that are asked of it

    def knows(self, behaviors: Iterable[str]) -> bool:
        """Whether anything was learned of any of these behaviours."""
        return any(behavior in self.ledgers for behavior in behaviors)

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
        ledger = self.ledgers.get(behavior)
        if ledger is None:
            return []
        given, codes = ledger.read(candidate.pattern)
        levels = [self._level(behavior, classes) for classes in self._chain(candidate.conclusion)]
        prior, spoken = self._spoken(ledger, levels, codes)
        found = [Factor(f"{candidate.conclusion}", "prior", prior)]
        if spoken is not None:
            weights = spoken[codes].tolist()
            found += [Factor(fact, value, weight) for (fact, value), weight in zip(given, weights, strict=True)]
        before = sum(factor.weight for factor in found)
        after = before
        row = np.zeros(len(ledger.facts), dtype=np.int64)
        row[[ledger.facts[fact] for fact, _ in given]] = codes
        for sums in levels:
            c, p = sums.patterns.get(row.tobytes(), (0.0, 0.0))
            o = 1 / (1 + math.exp(-max(min(after, 50.0), -50.0)))
            o = (c + KAPPA * o) / (c + p + KAPPA)
            if c + p:
                after = math.log(max(o, 1e-9)) - math.log(max(1 - o, 1e-9))
        c, p = levels[0].patterns.get(row.tobytes(), (0.0, 0.0))
        found.append(Factor(TOGETHER, f"chosen {c:g} of {c + p:g}", after - before))
        return found + self._preferences(candidate, after, tuple(given))

    def _spoken(self, ledger: Ledger, levels: Sequence[Sums], codes: Sequence[int]) -> tuple[float, Floats | None]:
        """Return the prior, and by code what each fact speaks; None where nothing was both chosen and passed over.

        From the parameters' types down, then within the value of what discriminates most, and so on.
        """
        strata: list[tuple[int | None, Sums]] = [(None, sums) for sums in levels if sums.chosen + sums.passed]
        strata = strata or [(None, levels[0])]
        while (part := strata[-1][1].part(codes)) is not None:
            strata.append(part)
        key = tuple(id(sums) for _, sums in strata)
        if key not in self._weights:
            fact_of, prior = ledger.fact_of, 0.0
            moved, weights = np.zeros(len(ledger.facts)), np.zeros(len(ledger.facts))
            ratios: tuple[Floats, Floats] | None = None
            for apart, sums in strata:
                total, before = sums.chosen + sums.passed, prior
                here = math.log((sums.chosen + 0.5) / (sums.passed + 0.5))
                prior = (total * here + ALPHA * prior) / (total + ALPHA)
                if apart is not None:
                    moved[apart] += prior - before
                m = min(sums.chosen, sums.passed)
                if not m:
                    continue
                above = ratios or (1 / (sums.sizes[fact_of] + 1),) * 2
                chosen, passed = sums.values
                ratios = (
                    (m * chosen[1:] / sums.chosen + ALPHA * above[0]) / (m + ALPHA),
                    (m * passed[1:] / sums.passed + ALPHA * above[1]) / (m + ALPHA),
                )
                weights = (m * sums.relevance + ALPHA * weights) / (m + ALPHA)
            spoken = None
            if ratios is not None:
                spoken = np.concatenate([[0.0], moved[fact_of] + weights[fact_of] * np.log(ratios[0] / ratios[1])])
            self._weights[key] = prior - float(moved.sum()), spoken
        return self._weights[key]

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

    def _members(self, behavior: str, classes: tuple[str, ...]) -> set[Conclusion]:
        """Return the conclusions that pass through a class level."""
        return {conclusion for conclusion in self.conclusions[behavior] if classes in self._chain(conclusion)}

    def _level(self, behavior: str, classes: tuple[str, ...]) -> Sums:
        """Return the counts of a class level."""
        key = behavior, classes
        found = self._sums.get(key)
        if found is None:
            found = self._sums[key] = self.ledgers[behavior].sums(self._members(behavior, classes))
        return found
