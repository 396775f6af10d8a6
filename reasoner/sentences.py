"""Conditions and amounts as sentences, in names or in whatever words a caller has for facts and names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, written
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Fact,
    RelationCondition,
    Symbol,
    ValueCondition,
    Witness,
    substituted,
)

Words = Callable[[Fact | str], str]
"""How a fact, or the name of an individual, a class or a relation, is written."""
MARK = "\ue000"
"""Stands in a sentence for the individual that a witness looks for."""
DENIALS = {"is": "isn't", "has": "doesn't have", "can": "can't", "holds": "doesn't hold", "carries": "doesn't carry"}
"""What says the opposite, by the first word that says what is so."""


def said(condition: Condition, words: Words = str) -> str:
    """Return a condition as a sentence, in a caller's words for facts and names, if it has some.

    >>> said(RelationCondition("canReach", ("left_hand", "location7")))
    'left_hand canReach location7'
    >>> said(Witness("?o", "Cup", (ValueCondition("LOCATION", ("?o",), "location7"),), negated=True))
    'no Cup LOCATION location7'
    >>> shut = ValueCondition("SHUT", ("?door",), TRUE)
    >>> said(Witness("?door", "Door", (RelationCondition("inFrontOf", ("?door", "shelf")), shut), negated=True))
    'no Door that inFrontOf shelf SHUT true'
    """
    match condition:
        case ValueCondition(situation, arguments, value, negated):
            if negated and value in (TRUE, FALSE):
                return words(Fact(Symbol(situation, arguments), FALSE if value == TRUE else TRUE))
            return _signed(words(Fact(Symbol(situation, arguments), value)), negated)
        case RelationCondition(relation, arguments, negated):
            return _signed(" ".join(map(words, (arguments[0], relation, *arguments[1:]))), negated)
        case ClassCondition(term, kind, negated):
            return f"{words(term)} is {f'no {words(kind)}' if negated else an(words(kind))}"
        case EqualityCondition(left, right, negated):
            return f"{words(left)} is {'not ' if negated else ''}{words(right)}"
        case Witness(variable, kind, conditions, negated):
            return _sought(variable, words(kind), conditions, negated, words)
        case AnyOf(alternatives, True) if all(len(group) == 1 for group in alternatives):
            return " and ".join(said(replace(one, negated=not one.negated), words) for (one,) in alternatives)
        case AnyOf(alternatives, negated):
            either = " or ".join(" and ".join(said(inner, words) for inner in group) for group in alternatives)
            return f"{'not ' if negated else ''}({either})"
        case Comparison(left, sign, right, negated):
            return ("not " if negated else "") + f"{counted(left, words)} {sign} {counted(right, words)}"


def _sought(variable: str, kind: str, conditions: Sequence[Condition], negated: bool, words: Words) -> str:
    """Return that some individual of a class is as conditions say, or none is, or every one is as the last denies."""
    but = [c for c in conditions if isinstance(c, EqualityCondition) and c.negated and variable in (c.left, c.right)]
    asked = sorted((c for c in conditions if c not in but), key=lambda c: c.negated)
    which = "no" if negated else "some"
    if asked and negated and isinstance(asked[-1], ValueCondition | RelationCondition) and asked[-1].negated:
        which = "every"  # none isn't: all are
        asked[-1] = replace(asked[-1], negated=False)
    others = " and ".join(words(c.right if c.left == variable else c.left) for c in but)
    whole = f"{which} {kind}{f' but {others}' if but else ''}"
    clauses = [said(substituted(c, {variable: MARK}), words) for c in asked]
    if not clauses:
        return f"there is {whole}"
    *before, last = clauses
    if which != "every" and not last.startswith(f"{MARK} "):  # any of them may come last
        before.sort(key=lambda clause: clause.startswith(f"{MARK} "))
        if before and before[-1].startswith(f"{MARK} "):
            before, last = [*before[:-1], last], before[-1]
    if not before and last.endswith(f" {MARK}") and which != "every":
        return last.replace(MARK, whole)
    if which == "some" and all(clause.startswith(f"{MARK} ") for clause in clauses):
        return f"{whole} {' and '.join(clause.removeprefix(f'{MARK} ') for clause in clauses)}"
    relative = [_relative(clause) for clause in before]
    if not last.startswith(f"{MARK} ") or None in relative:
        such = " and ".join(clause.replace(MARK, "it") for clause in before)
        end = last.replace(MARK, "it")
        if which == "every" and such:
            return f"for {whole} such that {such}, {end}"
        return f"{whole} is such that {' and '.join(filter(None, (such, end)))}"
    return " ".join((whole, " and ".join(filter(None, relative)), last.removeprefix(f"{MARK} "))).replace("  ", " ")


def _relative(clause: str) -> str | None:
    """Return a clause about the individual that is looked for as a relative clause; None if it is none in its place."""
    if clause.startswith(f"{MARK} ") and clause.count(MARK) == 1:
        return f"that {clause.removeprefix(f'{MARK} ')}"
    if clause.endswith(f" {MARK}") and clause.count(MARK) == 1:
        return f"that {clause.removesuffix(f' {MARK}')}"
    return None


def _signed(sentence: str, negated: bool) -> str:
    return denied(sentence) if negated else sentence


def denied(sentence: str) -> str:
    """Return the opposite of a sentence.

    >>> denied("cup 1 is at location 7"), denied("ferry EMPTY")
    ("cup 1 isn't at location 7", 'not ferry EMPTY')
    """
    parts = sentence.split(" ")
    place = next((i for i, word in enumerate(parts) if i and word in DENIALS), None)
    if place is None:
        return f"not {sentence}"
    return " ".join((*parts[:place], DENIALS[parts[place]], *parts[place + 1 :]))


def an(noun: str) -> str:
    """Return a noun with its article.

    >>> an("Item"), an("cup")
    ('an Item', 'a cup')
    """
    return f"{'an' if noun[:1].lower() in 'aeiou' else 'a'} {noun}"


def counted(expression: Expression, words: Words = str) -> str:
    """Return an amount as people write it.

    >>> from fractions import Fraction
    >>> counted(Calculation("-", Amount("SERVINGS", ("bottle1",)), Fraction(1, 2)))
    '(bottle1 SERVINGS - 0.5)'
    """
    match expression:
        case Amount(situation, arguments):
            return words(Fact(Symbol(situation, arguments), "")).strip()
        case Measure(relation, arguments):
            return " ".join(map(words, (*arguments[:1], relation, *arguments[1:])))
        case Calculation(sign, left, right):
            return f"({counted(left, words)} {sign} {counted(right, words)})"
        case number:
            return written(number)
