"""A certificate proves that a task has no plan: a set of states that contains the initial state, is closed, and violates the goal.

Three kinds of claims describe the set of states of a certificate. First, some facts *never* hold. Second, some symbols
*always* keep their value, or an amount stays within bounds. Third, the values of some symbols are *told apart*
(distinguished): only some combinations of these values, called cases, are reachable, and the certificate states their
number. A certificate without distinguished values has a single case. If a certificate distinguishes all values, each
case is a single state.

A certificate can also name derived amounts that are *bounded*. A state with the goals violates these bounds, and no plan
leads to such a state. The number of violations of a constraint is such an amount.

`confab.planner.certificate_checks` verifies a certificate, `confab.planner.certifying` finds one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypedDict

from confab.reasoner.symbols import Fact, Symbol

FORMAT = 1


@dataclass(frozen=True)
class Certificate:
    """A set of states that contains the initial state, that no lowest-level behaviour leaves, and that contains no goal state.

    Attributes
    ----------
    never : frozenset of Fact
        Facts that hold in no state.
    always : mapping of Symbol to value
        Symbols with a value that holds in all states. The value of an amount is a range that contains the amount in all states.
    told_apart : mapping of Symbol to values
        Symbols with the values that are distinguished from each other and from all other values; an empty tuple means all values.
    cases : int
        Number of reachable combinations of distinguished values; the goal holds in none of these combinations.
    unmet : tuple of Fact
        Goals of which at least one doesn't hold in each case.
    bounded : tuple of Symbol
        Derived amounts with bounds that the goals of `unmet` together violate.
    """

    never: frozenset[Fact] = frozenset()
    always: Mapping[Symbol, str] = field(default_factory=dict)
    told_apart: Mapping[Symbol, tuple[str, ...]] = field(default_factory=dict)
    cases: int = 1
    unmet: tuple[Fact, ...] = ()
    bounded: tuple[Symbol, ...] = ()

    @property
    def kind(self) -> str:
        """The kind of claims in the certificate, as a short text."""
        if not self.told_apart:
            return "bounds" if self.bounded else "facts"
        return "pair" if len(self.told_apart) == 2 and all(map(len, self.told_apart.values())) else "cases"


class ToldApartJson(TypedDict):
    """A symbol, as a list of situation type and arguments, with its distinguished values."""

    symbol: list[str]
    values: list[str]


class CertificateJson(TypedDict):
    """A certificate as JSON data; a fact is a list of situation type, arguments and value."""

    format: int
    never: list[list[str]]
    always: list[list[str]]
    told_apart: list[ToldApartJson]
    cases: int
    unmet: list[list[str]]
    bounded: list[list[str]]


def certificate_json(certificate: Certificate) -> CertificateJson:
    """Return a certificate as JSON data."""
    return {
        "format": FORMAT,
        "never": [_listed(fact) for fact in sorted(certificate.never)],
        "always": [_listed(Fact(symbol, value)) for symbol, value in sorted(certificate.always.items())],
        "told_apart": [
            {"symbol": [symbol.situation, *symbol.arguments], "values": list(values)}
            for symbol, values in sorted(certificate.told_apart.items())
        ],
        "cases": certificate.cases,
        "unmet": [_listed(fact) for fact in certificate.unmet],
        "bounded": [[symbol.situation, *symbol.arguments] for symbol in certificate.bounded],
    }


def certificate_from(data: Any) -> Certificate:
    """Return the certificate that JSON data describe.

    Raises
    ------
    ValueError
        The data contain no certificate; the message states the expected data.
    """
    try:
        if data["format"] != FORMAT:
            raise ValueError(f"a certificate of format {data['format']!r}; wanted {FORMAT}")
        if type(data["cases"]) is not int:
            raise ValueError(f'"cases" is {data["cases"]!r}; wanted a whole number')
        return Certificate(
            never=frozenset(map(_fact, data["never"])),
            always={fact.symbol: fact.value for fact in map(_fact, data["always"])},
            told_apart={_symbol(one["symbol"]): tuple(map(_text, one["values"])) for one in data["told_apart"]},
            cases=data["cases"],
            unmet=tuple(map(_fact, data["unmet"])),
            bounded=tuple(map(_symbol, data.get("bounded", ()))),
        )
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise ValueError(
            "no certificate; wanted an object with format, never, always, told_apart, cases and unmet, as --json prints it"
        ) from error


def _listed(fact: Fact) -> list[str]:
    return [fact.symbol.situation, *fact.symbol.arguments, fact.value]


def _fact(words: Sequence[Any]) -> Fact:
    situation, *arguments, value = map(_text, words)
    return Fact(Symbol(situation, tuple(arguments)), value)


def _symbol(words: Sequence[Any]) -> Symbol:
    situation, *arguments = map(_text, words)
    return Symbol(situation, tuple(arguments))


def _text(word: Any) -> str:
    if not isinstance(word, str):
        raise TypeError(word)
    return word
