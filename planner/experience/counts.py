"""The counts of one behaviour as arrays: how often each value of each fact was seen with what was chosen, and with what wasn't.

row      a conclusion and a pattern, with its counts
code     a value of a fact, numbered through all facts from 1 on; 0 where a pattern doesn't have the fact; the last ones stand for
         a value that was never seen of each fact
ledger   all rows of a behaviour; `Sums` are the counts of some of them
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from reasoner.memory.counts import Conclusion, Pattern, Tally

Floats: TypeAlias = "NDArray[np.float64]"
Ints: TypeAlias = "NDArray[np.int64]"

ENOUGH = 4  # of both choices and passes, for a fact to be looked at within the counts of another
TELLING = 0.02  # relevance of a fact from which it is worth that
EQUAL = 1e-12  # relevances that differ by less are the same, however they were added up


class Codes(dict[tuple[str, str], int]):
    """Numbers facts with their values from 1 on, as they come."""

    def __missing__(self, pair: tuple[str, str]) -> int:
        """Return the next number."""
        self[pair] = number = len(self) + 1
        return number


class Ledger:
    """All that was counted of one behaviour.

    Parameters
    ----------
    tallies : mapping of conclusion to patterns with their tallies
    """

    def __init__(self, tallies: Mapping[Conclusion, Mapping[Pattern, Tally]]) -> None:
        self.code = Codes()
        self.conclusions = [conclusion for conclusion, patterns in tallies.items() for _ in patterns]
        rows = [[self.code[pair] for pair in pattern] for patterns in tallies.values() for pattern in patterns]
        counts = [(t.chosen, t.passed_over + t.failed) for patterns in tallies.values() for t in patterns.values()]
        self.chosen, self.passed = np.array(counts, dtype=np.float64).reshape(-1, 2).T
        self.facts: dict[str, int] = {}
        self.of = np.array([self.facts.setdefault(fact, len(self.facts)) for fact, _ in self.code], dtype=np.int64)
        self.codes = np.zeros((len(rows), len(self.facts)), dtype=np.int64)
        for number, row in enumerate(rows):
            given = np.array(row, dtype=np.int64)
            self.codes[number, self.of[given - 1]] = given

    def narrowed(self, looked: Collection[str]) -> Ledger:
        """Return the same counts of only these facts."""
        found = copy(self)
        columns = [column for fact, column in self.facts.items() if fact in looked]
        kept = np.isin(self.of, columns)
        number = np.concatenate([[0], np.where(kept, np.cumsum(kept), 0)])
        found.facts = {fact: i for i, fact in enumerate(fact for fact in self.facts if fact in looked)}
        found.of = np.searchsorted(columns, self.of[kept])
        found.code = Codes({pair: int(number[code]) for pair, code in self.code.items() if kept[code - 1]})
        found.codes = number[self.codes[:, columns]]
        return found

    @property
    def fact_of(self) -> Ints:
        """The fact of each code but 0."""
        return np.concatenate([self.of, np.arange(len(self.facts))])

    def read(self, pattern: Pattern) -> tuple[list[tuple[str, str]], list[int]]:
        """Return the facts of a pattern that the ledger keeps, with their codes."""
        facts, codes, seen = self.facts, self.code, len(self.code) + 1
        given = [pair for pair in pattern if pair[0] in facts]
        return given, [codes.get(pair) or seen + facts[pair[0]] for pair in given]

    def sums(self, conclusions: Collection[Conclusion] | None = None) -> Sums:
        """Return the counts of some conclusions, or of all."""
        if conclusions is None:
            return Sums(self, np.arange(len(self.codes)))
        return Sums(self, np.array([i for i, c in enumerate(self.conclusions) if c in conclusions], dtype=np.int64))


@dataclass
class Sums:
    """The counts of some rows of a ledger: of their number, of each value of each fact, and of whole patterns."""

    ledger: Ledger
    rows: Ints

    def __post_init__(self) -> None:
        self.chosen = float(self.ledger.chosen[self.rows].sum())
        self.passed = float(self.ledger.passed[self.rows].sum())
        self._parts: dict[int, Sums | None] = {}

    @cached_property
    def values(self) -> tuple[Floats, Floats]:
        """How often each code was chosen, and passed over."""
        codes, width = self.ledger.codes[self.rows].ravel(), self.ledger.codes.shape[1]

        def counted(counts: Floats) -> Floats:
            each: Floats = np.repeat(counts[self.rows], width)
            return np.bincount(codes, each, 1 + len(self.ledger.fact_of)).astype(np.float64)

        return counted(self.ledger.chosen), counted(self.ledger.passed)

    @cached_property
    def sizes(self) -> Ints:
        """How many values of each fact were seen."""
        chosen, passed = self.values
        return np.bincount(self.ledger.fact_of[(chosen + passed)[1:] > 0], minlength=len(self.ledger.facts))

    @cached_property
    def relevance(self) -> Floats:
        """The relevance w of each fact, in [0, 1]."""
        chosen, passed = self.values
        return relevances(chosen[1:], passed[1:], self.ledger.fact_of, len(self.ledger.facts))

    @cached_property
    def patterns(self) -> dict[bytes, tuple[float, float]]:
        """How often each pattern of the facts that are kept was chosen and passed over."""
        found: dict[bytes, tuple[float, float]] = {}
        for row in self.rows.tolist():
            key = self.ledger.codes[row].tobytes()
            c, p = found.get(key, (0.0, 0.0))
            found[key] = c + float(self.ledger.chosen[row]), p + float(self.ledger.passed[row])
        return found

    @cached_property
    def apart(self) -> int | None:
        """The fact that discriminates most here; None where counts are thin or nothing does."""
        if min(self.chosen, self.passed) < ENOUGH or not len(self.ledger.facts):
            return None
        best = float(self.relevance.max())
        if best < TELLING:
            return None
        names = list(self.ledger.facts)
        return max(np.flatnonzero(self.relevance > best - EQUAL).tolist(), key=names.__getitem__)

    def part(self, codes: Collection[int]) -> tuple[int, Sums] | None:
        """Return the fact that discriminates most here and the counts of its value alone, if there are any."""
        if self.apart is None:
            return None
        seen = self.ledger.of
        code = next((code for code in codes if code <= len(seen) and seen[code - 1] == self.apart), 0)
        if code not in self._parts:
            rows = self.rows[self.ledger.codes[self.rows, self.apart] == code] if code else self.rows[:0]
            self._parts[code] = Sums(self.ledger, rows) if len(rows) else None
        part = self._parts[code]
        return None if part is None else (self.apart, part)


def relevances(chosen: Floats, passed: Floats, of: Ints, facts: int) -> Floats:
    """Return for each fact the Jensen–Shannon divergence of two distributions given as counts, less its small-sample bias.

    Parameters
    ----------
    chosen, passed : array of shape (values,)
        Counts of each value of each fact.
    of : array of shape (values,)
        To which fact a value belongs.
    facts : int

    Returns
    -------
    array of shape (facts,), in [0, 1]

    Examples
    --------
    >>> apart = relevances(np.array([50.0, 0]), np.array([0, 50.0]), np.array([0, 0]), 1)
    >>> alike = relevances(np.array([50.0, 50]), np.array([50, 50.0]), np.array([0, 0]), 1)
    >>> thin = relevances(np.array([1.0, 0]), np.array([0, 1.0]), np.array([0, 0]), 1)
    >>> bool(apart[0] > 0.9), float(alike[0]), bool(thin[0] < 0.7)
    (True, 0.0, True)
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        all_chosen, all_passed = np.bincount(of, chosen, facts), np.bincount(of, passed, facts)
        a, b = chosen / all_chosen[of], passed / all_passed[of]
        middle = (a + b) / 2
        terms = np.where(a > 0, a * np.log(a / middle), 0.0) + np.where(b > 0, b * np.log(b / middle), 0.0)
        seen = np.bincount(of[chosen + passed > 0], minlength=facts)
        bias = (seen - 1) / 8 * (1 / all_chosen + 1 / all_passed)
        found = (np.bincount(of, terms, facts) / 2 - bias) / math.log(2)
    return np.where((all_chosen > 0) & (all_passed > 0), np.clip(found, 0.0, 1.0), 0.0)
