"""Dataclasses for PDDL formulas and effects, and functions that build, inspect and write them.

The functions that build formulas simplify subformulas that are always true or always false, so that the written PDDL contains no
empty disjunctions such as ``(or)``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias

from confab.reasoner.amounts import written


@dataclass(frozen=True)
class PddlTerm:
    """A variable or an object: its PDDL name, its type, and the individuals that it can denote."""

    name: str
    type: str = field(default="object", compare=False)
    members: frozenset[str] = field(default=frozenset(), compare=False)

    @property
    def variable(self) -> bool:
        """Whether the term is a variable."""
        return self.name.startswith("?")


@dataclass(frozen=True)
class FunctionTerm:
    """A function with its arguments."""

    function: str
    terms: tuple[PddlTerm, ...]


@dataclass(frozen=True)
class Arithmetic:
    """An arithmetic operation on two numbers; `sign` is ``+``, ``-``, ``*`` or ``/``."""

    sign: str
    left: NumericTerm
    right: NumericTerm


NumericTerm: TypeAlias = "Fraction | FunctionTerm | Arithmetic"


@dataclass(frozen=True)
class Atom:
    """A predicate with its arguments."""

    predicate: str
    terms: tuple[PddlTerm, ...]


@dataclass(frozen=True)
class Same:
    """An equality of two terms."""

    left: PddlTerm
    right: PddlTerm


@dataclass(frozen=True)
class Compare:
    """A comparison of two numbers by the operator `sign`."""

    sign: str
    left: NumericTerm
    right: NumericTerm


@dataclass(frozen=True)
class Not:
    """A negation."""

    inner: Formula


@dataclass(frozen=True)
class And:
    """A conjunction."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True)
class Or:
    """A disjunction."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True)
class Exists:
    """An existential quantification. A universal quantification is expressed as the negation of an existential quantification."""

    variables: tuple[PddlTerm, ...]
    inner: Formula


Formula: TypeAlias = "Atom | Same | Compare | Not | And | Or | Exists"
TRUE: Formula = And(())
FALSE: Formula = Or(())


@dataclass(frozen=True)
class Assignment:
    """An effect that sets or changes a function's value: ``assign``, ``increase`` or ``decrease``."""

    operation: str
    call: FunctionTerm
    by: NumericTerm


@dataclass(frozen=True)
class ConditionalEffect:
    """An effect on an atom or a function, for every binding of `variables` that satisfies `when` in the state before the action."""

    what: Atom | Not | Assignment
    when: Formula = TRUE
    variables: tuple[PddlTerm, ...] = ()


# ------------------------------------------------------------------------------------------------------------ building


def both(parts: Iterable[Formula]) -> Formula:
    """Return the simplified conjunction of some formulas."""
    flat = dict.fromkeys(one for part in parts for one in (part.parts if isinstance(part, And) else (part,)))
    if FALSE in flat or any(isinstance(one, Not) and one.inner in flat for one in flat):
        return FALSE
    return next(iter(flat)) if len(flat) == 1 else And(tuple(flat))


def either(parts: Iterable[Formula]) -> Formula:
    """Return the simplified disjunction of some formulas."""
    flat = dict.fromkeys(one for part in parts for one in (part.parts if isinstance(part, Or) else (part,)))
    if TRUE in flat or any(isinstance(one, Not) and one.inner in flat for one in flat):
        return TRUE
    return next(iter(flat)) if len(flat) == 1 else Or(tuple(flat))


def no(formula: Formula, yes: bool = True) -> Formula:
    """Return the simplified negation of a formula; return the formula itself if `yes` is False."""
    if not yes:
        return formula
    if formula in (TRUE, FALSE):
        return FALSE if formula == TRUE else TRUE
    return formula.inner if isinstance(formula, Not) else Not(formula)


def some(variables: Iterable[PddlTerm], formula: Formula) -> Formula:
    """Return a formula with an existential quantifier for the variables that the formula mentions."""
    variables = tuple(variables)
    if formula == FALSE or not all(one.members for one in variables):
        return FALSE
    inside = {term.name for term in terms(formula)}
    used = tuple(one for one in variables if one.name in inside)
    return Exists(used, formula) if used else formula


def same(left: PddlTerm, right: PddlTerm) -> Formula:
    """Return the equality of two terms.

    The equality is true for equal terms, and false for terms that can't denote the same individual.
    """
    if left == right:
        return TRUE
    return Same(left, right) if left.members & right.members else FALSE


def conjuncts(formula: Formula) -> tuple[Formula, ...]:
    """Return the conjuncts of a formula."""
    return formula.parts if isinstance(formula, And) else (formula,)


# ------------------------------------------------------------------------------------------------------------- reading


def inside(formula: Formula) -> Iterator[Formula]:
    """Yield a formula and all its subformulas."""
    yield formula
    match formula:
        case Not(inner) | Exists(_, inner):
            yield from inside(inner)
        case And(parts) | Or(parts):
            for part in parts:
                yield from inside(part)
        case Atom() | Same() | Compare():
            return


def calls(number: NumericTerm) -> Iterator[FunctionTerm]:
    """Yield the function terms in a numeric expression."""
    match number:
        case FunctionTerm():
            yield number
        case Arithmetic(_, left, right):
            yield from calls(left)
            yield from calls(right)
        case Fraction():
            return


def terms(formula: Formula) -> Iterator[PddlTerm]:
    """Yield the terms of all atoms, equalities and comparisons in a formula."""
    for one in inside(formula):
        match one:
            case Atom(_, its):
                yield from its
            case Same(left, right):
                yield from (left, right)
            case Compare(_, left, right):
                yield from (term for number in (left, right) for call in calls(number) for term in call.terms)
            case Not() | And() | Or() | Exists():
                continue


def terms_of(change: ConditionalEffect) -> Iterator[PddlTerm]:
    """Yield the terms in an effect and its condition."""
    yield from terms(change.when)
    if isinstance(change.what, Assignment):
        numbers = (change.what.call, change.what.by)
        yield from (term for number in numbers for call in calls(number) for term in call.terms)
    else:
        yield from terms(change.what)


# ------------------------------------------------------------------------------------------------------------- writing


def typed(variables: Sequence[PddlTerm]) -> str:
    """Return variables with their types in the notation of PDDL declarations."""
    return " ".join(f"{one.name} - {one.type}" for one in variables)


def formula_text(formula: Formula) -> str:
    """Return the PDDL text of a formula."""
    match formula:
        case Atom(predicate, its):
            return f"({' '.join([predicate, *(term.name for term in its)])})"
        case Same(left, right):
            return f"(= {left.name} {right.name})"
        case Compare(sign, left, right):
            return f"({sign} {number_text(left)} {number_text(right)})"
        case Not(inner):
            return f"(not {formula_text(inner)})"
        case And(parts):
            return f"(and {' '.join(map(formula_text, parts))})"
        case Or(parts):
            return f"(or {' '.join(map(formula_text, parts))})"
        case Exists(variables, inner):
            return f"(exists ({typed(variables)}) {formula_text(inner)})"


def change_text(change: ConditionalEffect) -> str:
    """Return the PDDL text of an effect."""
    if isinstance(change.what, Assignment):
        text = f"({change.what.operation} {number_text(change.what.call)} {number_text(change.what.by)})"
    else:
        text = formula_text(change.what)
    text = text if change.when == TRUE else f"(when {formula_text(change.when)} {text})"
    return f"(forall ({typed(change.variables)}) {text})" if change.variables else text


def number_text(number: NumericTerm) -> str:
    """Return the PDDL text of a numeric expression; a number without a finite decimal notation becomes a quotient."""
    match number:
        case FunctionTerm(function, its):
            return f"({' '.join([function, *(term.name for term in its)])})"
        case Arithmetic(sign, left, right):
            return f"({sign} {number_text(left)} {number_text(right)})"
        case Fraction():
            text = written(number)
            return f"(/ {number.numerator} {number.denominator})" if "/" in text else text
