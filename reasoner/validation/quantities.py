"""Rules of amounts: their units, their products, and the numbers that behaviours read."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from reasoner.amounts import Amount, Calculation, Expression, Measure, inside, situations_in
from reasoner.language import groups, walk
from reasoner.symbols import (
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Problem,
    Witness,
)
from reasoner.validation.case import Case, Fault
from reasoner.vocabulary import CORE


def unlike_units(case: Case) -> Iterator[Fault]:
    """Find amounts of different units that are compared, added, or assigned to one another."""
    if case.reading is None:
        return
    reading = case.reading
    units = {name: s.quantity.unit for name, s in reading.problem.domain.situations.items() if s.quantity}
    relations = {
        reading.names.short(iri): node.get(CORE + "unit", [""])[0] for iri, node in reading.schema.nodes.items()
    }

    def unit(expression: Expression) -> tuple[str, str]:
        """Return the unit of an amount, none if it has none or could have any, and two that don't go together."""
        match expression:
            case Amount(situation):
                return units.get(situation, ""), ""
            case Measure(relation):
                return relations.get(relation, ""), ""
            case Calculation(sign, left, right):
                (one, wrong), (other, also) = unit(left), unit(right)
                if sign in "+-" and one and other and one != other:
                    return one, f"{one} and {other}"
                if sign in "*/" and one and other:
                    return "", wrong or also  # servings by the hour
                return one or (other if sign != "/" else ""), wrong or also
            case Fraction():
                return "", ""

    for name, behavior in reading.problem.domain.behaviors.items():
        for left, right, does in _together(behavior):
            (one, wrong), (other, also) = unit(left), unit(right)
            both = wrong or also or (f"{one} and {other}" if one and other and one != other else "")
            if both:
                about = " and ".join(sorted(situations_in(left) | situations_in(right)))
                yield (
                    reading.names.iri(name),
                    f"{name} {does} {both} ({about})",
                    "a number of one unit says nothing of an amount of another",
                    "name amounts of one unit, mend a :unit, or multiply by a number that leads from one unit to the other",
                )


def _together(behavior: Behavior) -> Iterator[tuple[Expression, Expression, str]]:
    """Yield the pairs of amounts that a behaviour compares, or changes one by the other, and which of that it does."""
    for one in (inner for condition in behavior.conditions for inner in walk(condition)):
        if isinstance(one, Comparison):
            yield one.left, one.right, "compares"
    for effect in behavior.amounts:
        by: Expression = effect.amount
        if effect.operation == "scale":  # by a number without a unit
            by = Calculation("*", Amount(effect.situation, effect.arguments), effect.amount)
        yield Amount(effect.situation, effect.arguments), by, f"{effect.operation}s"


def multiplied_amounts(case: Case) -> Iterator[Fault]:
    """Find amounts that change and are multiplied, or divided by: a whole level isn't searched with such a calculation."""
    if case.reading is None:
        return
    domain, names = case.reading.problem.domain, case.reading.names
    changed = {effect.situation for behavior in domain.behaviors.values() for effect in behavior.amounts}
    rules = [(name, rule.behavior) for name, its in domain.rules.items() for rule in its]
    for name, behavior in (*domain.behaviors.items(), *rules):
        found = dict[tuple[str, str, str], None]()
        for left, right, does in _together(behavior):
            for part in (*inside(left), *(() if does == "scales" else inside(right))):
                if isinstance(part, Calculation) and part.operator in "*/":
                    one, other = (sorted(situations_in(side) & changed) for side in (part.left, part.right))
                    if other and (one or part.operator == "/"):
                        found[part.operator, " and ".join(one), " and ".join(other)] = None
        for sign, first, second in found:
            does = f"multiplies {first} by {second}" if sign == "*" else f"divides by {second}"
            yield (
                names.iri(name),
                f"{name} {does}, {'both of which' if first and sign == '*' else 'which'} behaviors change",
                "where a whole level is searched, as in a world of one level or for the cheapest plan, that is refused",
                "multiply by a relation's number or a constant, which never changes, or add and subtract instead",
            )


def numbers_missing(case: Case) -> Iterator[Fault]:
    """Find individuals without a number that a behaviour reads of their class: nothing can be done with them."""
    if case.reading is None:
        return
    problem, names = case.reading.problem, case.reading.names
    lacking: dict[tuple[str, str], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for behavior in problem.domain.behaviors.values():
        among = {term: (kind, frozenset(problem.classes.get(kind, ()))) for term, kind in behavior.kinds.items()}
        read = [*_measured(behavior.preconditions, among, problem)]
        for effect in behavior.amounts:
            conditions = (*behavior.preconditions, *effect.when, Comparison(effect.amount, "=", effect.amount))
            read += _measured(conditions, among, problem)
        for relation, kind, individuals in read:
            stated = {row[0] for row in problem.relations.get(relation, ())}
            for one in individuals - stated:
                lacking[relation, kind][one].add(behavior.name)
    for (relation, kind), found in sorted(lacking.items()):
        who = sorted(found)
        some = ", ".join(who[:5]) + (", …" if len(who) > 5 else "")
        readers = " and ".join(sorted(set().union(*found.values())))
        has = "have" if len(who) > 1 else "has"
        yield (
            names.iri(who[0]),
            f"{some} {has} no {relation}, which {readers} read{'' if ' and ' in readers else 's'} of each {kind}",
            "what isn't stated compares with nothing, so that no such behaviour can be done with it",
            f"state {relation} of {some}, or give it to another class than {kind}",
        )


def _measured(
    conditions: Sequence[Condition], among: Mapping[str, tuple[str, frozenset[str]]], problem: Problem
) -> Iterator[tuple[str, str, frozenset[str]]]:
    """Yield each relation that gives a number of one term, with the term's class and the individuals that it can stand for."""
    among = dict(among)
    for condition in conditions:
        if isinstance(condition, ClassCondition) and not condition.negated and condition.term in among:
            individuals = among[condition.term][1] & frozenset(problem.classes.get(condition.kind, ()))
            among[condition.term] = condition.kind, individuals
    for condition in conditions:
        match condition:
            case Comparison(left, _, right):
                for part in (*inside(left), *inside(right)):
                    if isinstance(part, Measure) and len(part.arguments) == 1 and part.arguments[0] in among:
                        yield part.relation, *among[part.arguments[0]]
            case Witness(variable, kind):
                members = kind, frozenset(problem.classes.get(kind, ()))
                for group in groups(condition):
                    yield from _measured(group, {**among, variable: members}, problem)
            case _:
                for group in groups(condition):
                    yield from _measured(group, among, problem)
