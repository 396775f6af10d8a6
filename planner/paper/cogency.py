"""Cogent confabulation: the degree to which a behaviour supports the assumed facts.

The memory of the paper is a table p(<o, S> | b). For each quantified behaviour b and each situated object symbol <o, S>, the
table contains a categorical distribution over the values of the symbol. The distribution is uniform before learning.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from confab.reasoner.memory.links import Conclusion, Links
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State, Symbol


@dataclass(frozen=True)
class PaperConstants:
    """The constants of equations (2) and (5) of the paper."""

    k: float = 3.0
    anticipated_length: int = 100  # N; the paper gives no value; a value near the plan's length degrades the search
    learning: float = 0.1  # λ of eq. (2)

    def bonus(self, c_m: float, n: int) -> float:
        """Return the term c of the paper's equation 5: ``(c_m - 1) k w`` with ``w = max(1 - n/N, 0)``."""
        return (c_m - 1.0) * self.k * max(1.0 - n / self.anticipated_length, 0.0)


PAPER = PaperConstants()


def situation(state: State, problem: Problem, level: int) -> list[tuple[Symbol, str, tuple[str, ...]]]:
    """Return the facts of a state that a level sees, each with the values that its symbol can have on that level.

    The cogency has a factor for each fact, even for irrelevant facts (section III-D of the paper).
    """
    facts = []
    for symbol in sorted(state):
        if problem.domain.situations[symbol.situation].level <= level:
            values = problem.values(symbol, level)
            if state[symbol] in values:
                facts.append((symbol, state[symbol], values))
    return facts


def cogencies(
    links: Links, conclusions: Sequence[Conclusion], state: State, problem: Problem, level: int
) -> dict[Conclusion, float]:
    """Return ln cogency(b), in [-inf, 0], of each conclusion: the sum of ln p(fact | b) over the facts of a state.

    Eq. (1) treats the facts as independent given the behaviour. The factor k of eq. (1) is omitted, because k is the same for
    all behaviours.
    """
    facts = situation(state, problem, level)
    uniform = -sum(math.log(len(values)) for _, _, values in facts)
    scores = {}
    for conclusion in conclusions:
        if conclusion not in links.tables:
            scores[conclusion] = uniform
            continue
        p = [links.probability(conclusion, symbol, value, values) for symbol, value, values in facts]
        scores[conclusion] = sum(map(math.log, p)) if all(p) else -math.inf
    return scores


def ranking(scores: Mapping[Conclusion, float]) -> dict[Conclusion, float]:
    """Return c_m of eq. (4) for each conclusion: the rank divided by the number of conclusions.

    The most cogent conclusion has rank 1. Equally cogent conclusions share the lowest of their ranks.

    >>> ranking({("a", ()): -1.0, ("b", ()): -3.0, ("c", ()): -1.0, ("d", ()): -9.0})
    {('a', ()): 0.25, ('b', ()): 0.75, ('c', ()): 0.25, ('d', ()): 1.0}
    """
    ordered = sorted(-round(score, 12) for score in scores.values())
    return {key: (bisect_left(ordered, -round(score, 12)) + 1) / len(ordered) for key, score in scores.items()}
