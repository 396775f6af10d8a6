"""Validation rules on contradictory or redundant conditions, and on states that are physically impossible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from confab.reasoner.amounts import COMPARING, Amount
from confab.reasoner.language import groups
from confab.reasoner.possible import against_physics
from confab.reasoner.problem import Problem
from confab.reasoner.sentences import plain
from confab.reasoner.symbols import (
    FALSE,
    NEVER,
    TRUE,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    Span,
    ValueCondition,
    Witness,
)
from confab.reasoner.timing import judged_by_events, projected, timing_of
from confab.reasoner.validation.case import Fault, ReadCase
from confab.reasoner.validation.definitions import both

Clash = tuple[Condition, Condition]
"""Two conditions that no state satisfies together."""


def contradictions(case: ReadCase) -> Iterator[Fault]:
    """Find behaviours, effects and rules with contradictory conditions; an inherited contradiction is reported once."""
    problem, names = case.problem, case.names
    told: dict[Clash, str] = {}
    for name, behavior in case.behaviors_and_rules:
        consequence = (
            "nothing follows from the rule" if name in problem.domain.rules else "the behaviour is never applicable"
        )
        for clash, where in _clashes(behavior, problem):
            if clash in told:
                continue
            told[clash] = name
            one, other = clash
            yield (
                names.iri(name),
                f"{name} requires{where} both {plain(one)} and {plain(other)}",
                f"no state satisfies both, so {'the effect never happens' if where else consequence}",
                "remove one of the two conditions, or correct its terms",
            )
    for name, behavior in problem.domain.behaviors.items():
        for condition in _undone(behavior, problem):
            yield (
                names.iri(name),
                f"{name} requires {plain(condition)} after its own effect makes this false",
                "the behaviour is never applicable",
                "remove the condition or the effect, or correct its c:during",
            )


def dead(problem: Problem) -> frozenset[str]:
    """Return the behaviours with contradictory preconditions."""
    return frozenset(
        name
        for name, b in problem.domain.behaviors.items()
        if any(not where for _, where in _clashes(b, problem)) or any(_undone(b, problem))
    )


def _undone(behavior: Behavior, problem: Problem) -> Iterator[Condition]:
    """Yield the conditions that an earlier effect of the same behaviour makes false, and that no other step may make true again."""
    timing, others_may = timing_of(behavior), judged_by_events(problem)
    for span, condition in timing.conditions:
        made = [one for one in timing.effects if not (others_may and span is Span.END and one[0] is Span.START)]
        if NEVER in projected([(span, condition)], made)[0]:
            yield condition


def _clashes(behavior: Behavior, problem: Problem) -> Iterator[tuple[Clash, str]]:
    """Yield contradictory pairs of conditions, each with its position as words (an empty text for preconditions)."""
    if clash := clashing(behavior.preconditions, problem, behavior.kinds):
        yield clash, ""
        return
    for effect in behavior.every_effect:
        if effect.when and (clash := clashing((*behavior.preconditions, *effect.when), problem, behavior.kinds)):
            yield clash, f" for its effect on {effect.situation}"
    for condition in behavior.preconditions:
        yield from (
            (clash, f" of each {inner.kind}" if inner.negated else f" of a {inner.kind}")
            for inner in _witnesses(condition)
            if (clash := clashing(inner.conditions, problem, {**behavior.kinds, inner.variable: inner.kind}))
        )


def _witnesses(condition: Condition) -> Iterator[Witness]:
    if isinstance(condition, Witness):
        yield condition
    for group in groups(condition):
        for inner in group:
            yield from _witnesses(inner)


def clashing(conditions: Sequence[Condition], problem: Problem, kinds: Mapping[str, str]) -> Clash | None:
    """Return two conditions of a conjunction that no state satisfies together; return None if every pair is satisfiable.

    `kinds` are the classes of the terms.
    """
    parts = [*_conjuncts(conditions, problem)]
    for place, one in enumerate(parts):
        if isinstance(one, EqualityCondition) and one.negated and one.left == one.right:
            return one, replace(one, negated=False)
        for other in parts[:place]:
            if _exclude(other, one, problem, kinds):
                return other, one
    return None


def _conjuncts(conditions: Sequence[Condition], problem: Problem) -> Iterator[Condition]:
    """Yield the conjuncts of a conjunction, in which nested conjunctions and negations are resolved."""
    for condition in conditions:
        match condition:
            case AnyOf(((only,),), True):
                yield from _conjuncts((replace(only, negated=not only.negated),), problem)
            case AnyOf((group,), False):
                yield from _conjuncts(group, problem)
            case AnyOf(alternatives, True) if all(len(group) == 1 for group in alternatives):
                for (one,) in alternatives:
                    yield from _conjuncts((replace(one, negated=not one.negated),), problem)
            case ValueCondition(situation, _, value, True) if problem.domain.situations[
                situation
            ].boolean and value in (TRUE, FALSE):
                yield replace(condition, value=FALSE if value == TRUE else TRUE, negated=False)
            case _:
                yield condition


def _exclude(one: Condition, other: Condition, problem: Problem, kinds: Mapping[str, str]) -> bool:
    match one, other:
        case ValueCondition(), ValueCondition() if (one.situation, one.arguments) == (other.situation, other.arguments):
            if one.negated or other.negated:
                return one.value == other.value and one.negated != other.negated
            return not _may_be_one(one.value, other.value, problem, kinds)
        case Comparison(), Comparison():
            return _apart(one, other)
        case EqualityCondition(), EqualityCondition():
            same = {one.left, one.right} == {other.left, other.right}
            return same and one.negated != other.negated
        case (
            (RelationCondition(), RelationCondition())
            | (ClassCondition(), ClassCondition())
            | (Witness(), Witness())
            | (AnyOf(), AnyOf())
        ):
            return replace(one, negated=not one.negated) == other
        case _:
            return False


def _may_be_one(one: str, other: str, problem: Problem, kinds: Mapping[str, str]) -> bool:
    """Return whether two terms may denote the same value."""
    if one[:1] != "?" and other[:1] != "?":
        return one == other
    for term, value in ((one, other), (other, one)):
        if term[:1] == "?" and value[:1] != "?" and term in kinds:
            return value in problem.members(kinds[term]) or not problem.members(kinds[term])
    return True


def _apart(one: Comparison, other: Comparison) -> bool:
    """Return whether two comparisons of the same amount with numbers contradict each other."""
    if one.left != other.left or not isinstance(one.left, Amount):
        return False
    if not isinstance(one.right, Fraction) or not isinstance(other.right, Fraction):
        return False
    limits = sorted({one.right, other.right})
    points = [*limits, limits[0] - 1, limits[-1] + 1, sum(limits, Fraction(0)) / len(limits)]
    return not any(
        all(COMPARING[c.operator](point, c.right) != c.negated for c in (one, other) if isinstance(c.right, Fraction))
        for point in points
    )


# ------------------------------------------------------------------------------------------- redundant conditions


@dataclass(frozen=True)
class _Inner:
    """A class condition inside a negated condition, on a term that is bound outside the negated condition."""

    term: str
    kind: str


def repeated_names(case: ReadCase) -> Iterator[Fault]:
    """Find negated conditions with a class condition on a term that is bound outside the negated condition.

    The author of the ontology probably meant two different individuals.
    """
    problem, names = case.problem, case.names
    told = set[_Inner]()
    maxima = {p.kind for one in problem.domain.aggregates.values() if not one.kept for p in one.parameters}
    for name, behavior in case.behaviors_and_rules:
        for condition in behavior.conditions:
            for one in _inside_negated(condition, False):
                outer = behavior.kinds.get(one.term)
                if outer is None or one in told or one.kind in maxima:
                    continue  # conditions on a maximum or minimum contain such class conditions
                told.add(one)
                term, anyway = one.term[1:], one.kind in problem.superclasses(outer)
                if not anyway and both(case, outer, one.kind):
                    continue
                yield (
                    names.iri(name),
                    f"a negated condition of {name} requires that {term} is of the class {one.kind}, "
                    f"{'which always holds' if anyway else f'but no {outer} is'}",
                    f"{term} denotes the same {outer} inside and outside of the negated condition",
                    f"if the negated condition is about another {one.kind}, use another name than {term} for it; if it is "
                    f"about {term} itself, "
                    "remove the class from the condition",
                )


def _inside_negated(condition: Condition, negated: bool) -> Iterator[_Inner]:
    for group in groups(condition):
        for inner in group:
            if (
                isinstance(inner, ClassCondition)
                and not inner.negated
                and (negated or condition.negated)
                and len(group) > 1
            ):
                yield _Inner(inner.term, inner.kind)
            yield from _inside_negated(inner, negated or condition.negated)


def impossible_situations(case: ReadCase) -> Iterator[Fault]:
    """Find initial states that are physically impossible, and goals that together are physically impossible."""
    problem, names = case.problem, case.names
    found = set()
    for fault in against_physics(problem, problem.initial):
        found.add(fault.what)
        yield names.iri(fault.symbol.arguments[0]), fault.what, fault.why, fault.remedy
    levels = problem.domain.levels
    for fault in against_physics(problem, problem.goal_on(levels[-1]) if levels else problem.goal):
        if fault.what not in found:
            yield (
                names.iri(fault.symbol.arguments[0]),
                f"the goals can't hold together: {fault.what}",
                fault.why,
                "require another value in one of the goals",
            )
