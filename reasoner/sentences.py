"""Conditions and amounts as English sentences. A function of the caller provides the words for names and facts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, written
from confab.reasoner.language import substituted, walk
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    Constraint,
    EqualityCondition,
    Fact,
    RelationCondition,
    Symbol,
    ValueCondition,
    Witness,
)

Words = Callable[[Fact | str], str]
"""A function that returns the words for a fact, or for the name of an individual, class or relation."""
REGULAR = (
    "balance come connect contain face fit get hang hold join know "
    "lead lie live need own rest sit stand stay suit want wear wish work"
)
DENIALS = {
    **{
        "is": "isn't",
        "are": "aren't",
        "was": "wasn't",
        "has": "doesn't have",
        "can": "can't",
        "carries": "doesn't carry",
    },
    **{"reaches": "doesn't reach", "passes": "doesn't pass", "goes": "doesn't go"},
    **{f"{verb}s": f"doesn't {verb}" for verb in REGULAR.split()},
}
"""Verbs in the third person, with their negations."""
ORDINALS = ("first", "second", "third", "fourth", "fifth")
"""Words that tell different individuals of one class apart."""
SIGNS = {">=": "at least", "<=": "at most", ">": "more than", "<": "less than", "=": "exactly"}
"""Comparison operators in words."""


def said(condition: Condition, words: Words = str, outer: tuple[str, ...] = ()) -> str:
    """Return a condition as a clause.

    `words` returns the words for facts and names; `outer` are the classes of the witnesses that contain the condition.
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
        case Witness(comparison=Comparison() as comparison):
            return said(replace(comparison, negated=condition.negated), words, outer)
        case Witness(variable, kind, conditions, negated):
            return _sought(variable, kind, conditions, negated, words, outer)
        case AnyOf(constraint=Constraint(_, _, (once,))):
            return f"{words(once)} is true at most once"
        case AnyOf(constraint=Constraint(_, _, (one, other))):
            return f"{words(one)} is true only after {words(other)}"
        case AnyOf(constraint=Constraint(situation, always)):
            return f"{words(situation)} is {'always' if always else 'never'} true"
        case AnyOf(alternatives, True) if all(len(group) == 1 for group in alternatives):
            return " and ".join(said(replace(one, negated=not one.negated), words, outer) for (one,) in alternatives)
        case AnyOf(alternatives, negated):
            either = " or ".join(" and ".join(said(inner, words, outer) for inner in group) for group in alternatives)
            return f"{'not ' if negated else ''}({either})"
        case Comparison(left, sign, right, negated):
            sign = SIGNS[sign] if isinstance(left, Amount) and words is not str else sign
            sentence = f"{counted(left, words)} {sign} {counted(right, words)}"
            return denied(sentence) if negated else sentence


def plain(condition: Condition) -> str:
    """Return a condition as a clause with the names of the ontology, and with variables by name."""
    return said(condition).replace("?", "")


def _sought(
    variable: str, named: str, conditions: Sequence[Condition], negated: bool, words: Words, outer: tuple[str, ...]
) -> str:
    """Return the clause "some, no, or every individual of a class satisfies the conditions" in words.

    "Every" stands for a negated witness whose last condition is negated.
    """
    kind = words(named)
    but = [c for c in conditions if isinstance(c, EqualityCondition) and c.negated and variable in (c.left, c.right)]
    asked = sorted((c for c in conditions if c not in but), key=lambda c: c.negated)
    which = "no" if negated else "some"
    if asked and negated and isinstance(asked[-1], ValueCondition | RelationCondition) and asked[-1].negated:
        which = "every"
        asked[-1] = replace(asked[-1], negated=False)
    others = " and ".join(words(c.right if c.left == variable else c.left) for c in but)
    whole = f"{which} {kind}{f' but {others}' if but else ''}"
    mark = next(f"⟨{depth}⟩" for depth in count() if f"⟨{depth}⟩" not in f"{conditions}")  # stands for the individual
    clauses = [said(substituted(c, {variable: mark}), words, (*outer, named)) for c in asked]
    if not clauses:
        return f"there is {whole}"
    if which != "every":  # clauses with the individual as the subject come last
        clauses.sort(key=lambda clause: clause.startswith(f"{mark} "))
    *before, last = clauses
    if not before and last.endswith(f" {mark}") and last.count(mark) == 1 and which != "every":
        return last.replace(mark, whole)
    if which == "some" and all(_is_subject(mark, clause) for clause in clauses):
        return f"{whole} {' and '.join(clause.removeprefix(f'{mark} ') for clause in clauses)}"
    inner = [c for c in clauses if c.startswith("some ") and c.endswith(f" {mark}") and c.count(mark) == 1]
    if which == "no" and len(inner) == 1 < len(clauses) and words is not str:
        rest = [_relative(mark, clause) for clause in clauses if clause != inner[0]]
        if None not in rest:  # for example, "no item is at a place that is full"
            return (
                f"no {inner[0].removeprefix('some ').removesuffix(mark)}{an(kind)} {' and '.join(filter(None, rest))}"
            )
    relative = [_relative(mark, clause) for clause in before]
    if _is_subject(mark, last) and None not in relative:
        return " ".join(
            (whole, *([" and ".join(filter(None, relative))] if before else []), last.removeprefix(f"{mark} "))
        )
    it, before_it = kind.partition(" of ")[0], outer.count(named)
    alike = any(isinstance(part, Witness) and part.kind == named for c in conditions for part in walk(c))
    number = ORDINALS[before_it] if before_it < len(ORDINALS) else f"{before_it + 1}th"
    it = f"the {number} {it}" if before_it or alike else f"the {it}"
    such = " and ".join(clause.replace(mark, it) for clause in (before if which == "every" else clauses))
    if which == "every":
        return f"for {whole}{f' such that {such}' if such else ''}, {last.replace(mark, it)}"
    return f"there is {whole} such that {such}"


def _is_subject(mark: str, clause: str) -> bool:
    """Return whether a placeholder for an individual is the subject of a clause and doesn't occur elsewhere in the clause."""
    return clause.startswith(f"{mark} ") and clause.count(mark) == 1


def _relative(mark: str, clause: str) -> str | None:
    """Return a clause as a relative clause about the individual that a placeholder denotes, or None if this is impossible."""
    if _is_subject(mark, clause):
        return f"that {clause.removeprefix(f'{mark} ')}"
    if clause.endswith(f" {mark}") and clause.count(mark) == 1 and " and " not in clause:
        return f"that {clause.removesuffix(f' {mark}')}"
    return None


def _signed(sentence: str, negated: bool) -> str:
    return denied(sentence) if negated else sentence


def denied(sentence: str) -> str:
    """Return the negation of a clause.

    >>> denied("cup 1 is at location 7"), denied("ferry EMPTY")
    ("cup 1 isn't at location 7", 'not ferry EMPTY')
    """
    parts = sentence.split(" ")
    place = next((i for i, word in enumerate(parts) if i and word in DENIALS), None)
    if place is None:
        return f"not {sentence}"
    return " ".join((*parts[:place], DENIALS[parts[place]], *parts[place + 1 :]))


def an(noun: str) -> str:
    """Return a noun with the indefinite article.

    >>> an("Item"), an("cup")
    ('an Item', 'a cup')
    """
    return f"{'an' if noun[:1].lower() in 'aeiou' else 'a'} {noun}"


def counted(expression: Expression, words: Words = str) -> str:
    """Return a numeric expression in words.

    >>> from fractions import Fraction
    >>> counted(Calculation("-", Amount("SERVINGS", ("bottle1",)), Fraction(1, 2)))
    '(bottle1 SERVINGS - 0.5)'
    """
    match expression:
        case Amount(situation, arguments):
            return words(Fact(Symbol(situation, arguments), "")).strip()
        case Measure(relation, arguments):
            if words is str:
                return " ".join((*arguments[:1], relation, *arguments[1:]))
            name, of = words(relation), " and ".join(map(words, arguments))
            return (
                f"the {name} {of}" if name.split(" ")[-1] in ("between", "from", "of", "to") else f"the {name} of {of}"
            )
        case Calculation(sign, left, right):
            return f"({counted(left, words)} {sign} {counted(right, words)})"
        case number:
            return written(number)
