"""Calculation of sums, counts and remembered situation types in a state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product

from confab.reasoner.aggregates.remembering import in_order_of_update
from confab.reasoner.amounts import (
    COMPARING,
    NOTHING,
    Amount,
    Calculation,
    Expression,
    Measure,
    Number,
    divided,
    number,
    written,
)
from confab.reasoner.language import mentions
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    SituationType,
    Symbol,
    ValueCondition,
    Witness,
)


def with_totals(
    domain: Domain,
    classes: Mapping[str, Sequence[str]],
    relations: Mapping[str, frozenset[tuple[str, ...]]],
    state: Mapping[Symbol, str],
) -> dict[Symbol, str]:
    """Return a state extended by the sums, the counts and the true remembered symbols that follow from the state.

    The number of violations of a constraint is included only if some effects change this number.
    """
    found = dict(state)
    changed = {effect.situation for behavior in domain.behaviors.values() for effect in behavior.amounts}
    left_out = domain.constraints.keys() - changed
    for one in in_order_of_update(domain):
        if one.kept and one.situation not in left_out:
            numbers = totals(one, classes, relations, found, domain.situations)
            if one.situation in domain.remembers:
                numbers = {symbol: TRUE for symbol, number in numbers.items() if number != "0"}
            found |= numbers
    return found


def exceptions(
    domain: Domain,
    classes: Mapping[str, Sequence[str]],
    relations: Mapping[str, frozenset[tuple[str, ...]]],
    state: Mapping[Symbol, str],
) -> dict[Symbol, str]:
    """Return the number of violations of each constraint in a state; for a violated constraint, for each row of individuals."""
    found: dict[Symbol, str] = {}
    for name in domain.constraints:
        numbers = worths(domain.aggregates[name], EnumeratedState(classes, relations, state, domain.situations))
        violations = {Symbol(name, row): written(number) for row, number in sorted(numbers.items())}
        found |= violations or {Symbol(name, ()): "0"}
    return found


def following(problem: Problem, state: Mapping[Symbol, str]) -> dict[Symbol, str]:
    """Return a state, after changes by observations or interventions, with updated sums, counts and remembered symbols."""
    return with_totals(problem.domain, problem.classes, problem.relations, state)


def totals(
    aggregate: Aggregate,
    classes: Mapping[str, Sequence[str]],
    relations: Mapping[str, frozenset[tuple[str, ...]]],
    state: Mapping[Symbol, str],
    situations: Mapping[str, SituationType],
) -> dict[Symbol, str]:
    """Return the values of a sum or count for all of its arguments in a state, as texts of exact numbers."""
    kinds = [classes.get(p.kind, ()) for p in aggregate.parameters]
    found = {row: Fraction(0) for row in product(*kinds)}
    for row, worth in worths(aggregate, EnumeratedState(classes, relations, state, situations)).items():
        found[row[: len(kinds)]] += worth
    return {Symbol(aggregate.situation, row): written(total) for row, total in found.items()}


def worths(aggregate: Aggregate, world: EnumeratedState) -> dict[tuple[str, ...], Fraction]:
    """Return the number that each solution of an aggregate's conditions contributes; a solution is a row of individuals."""
    found: dict[tuple[str, ...], Fraction] = {}
    names = tuple(aggregate.kinds)
    for terms in world.solutions(aggregate.conditions, {}, aggregate.kinds, names):
        row, number = tuple(terms[name] for name in names), world.worth(aggregate.amount, terms)
        if row not in found and isinstance(number, Fraction):
            found[row] = number
    return found


class EnumeratedState:
    """A state in which conditions are evaluated by enumeration of individuals."""

    def __init__(
        self,
        classes: Mapping[str, Sequence[str]],
        relations: Mapping[str, frozenset[tuple[str, ...]]],
        state: Mapping[Symbol, str],
        situations: Mapping[str, SituationType],
    ) -> None:
        self.classes, self.relations, self.state, self.situations = classes, relations, state, situations
        self.members = {kind: frozenset(those) for kind, those in classes.items()}
        self.numbers: dict[str, dict[tuple[str, ...], Number]] = {}

    def value(self, situation: str, arguments: tuple[str, ...]) -> str | None:
        """Return the value of a symbol; return None if the symbol doesn't exist."""
        found = self.state.get(Symbol(situation, arguments))
        kind = self.situations[situation]
        if found is None and kind.boolean:
            there = zip(arguments, kind.arguments, strict=True)
            return FALSE if all(a in self.members.get(of, ()) for a, of in there) else None
        return found

    def worth(self, expression: Expression, terms: Mapping[str, str]) -> Number:
        """Return the number that an expression denotes."""
        match expression:
            case Amount(situation, arguments):
                return number(self.value(situation, tuple(terms.get(a, a) for a in arguments)))
            case Measure(relation, arguments):
                key = tuple(terms.get(a, a) for a in arguments)
                if relation not in self.numbers:
                    self.numbers[relation] = {r[:-1]: number(r[-1]) for r in self.relations.get(relation, ())}
                return self.numbers[relation].get(key, NOTHING)
            case Calculation(sign, left, right):
                one, other = self.worth(left, terms), self.worth(right, terms)
                return (
                    divided(one, other) if sign == "/" else {"+": one + other, "-": one - other, "*": one * other}[sign]
                )
            case exact:
                return exact

    def solutions(
        self, conditions: Sequence[Condition], terms: dict[str, str], kinds: Mapping[str, str], names: Sequence[str]
    ) -> Iterator[dict[str, str]]:
        """Yield the variable bindings that satisfy conditions; variables that a value determines aren't enumerated."""
        if any(not self.holds(c, terms, kinds) for c in conditions if not mentions(c) - terms.keys()):
            return
        waiting = [c for c in conditions if mentions(c) - terms.keys()]
        for c in waiting:
            if (
                isinstance(c, ValueCondition)
                and not c.negated
                and mentions(c) - terms.keys() == {c.value} - {*c.arguments}
            ):
                found = self.value(c.situation, tuple(terms.get(a, a) for a in c.arguments))
                if found is not None and found in self.members.get(kinds[c.value], ()):
                    yield from self.solutions(conditions, {**terms, c.value: found}, kinds, names)
                return
        left = [name for name in reversed(names) if name not in terms]
        left += sorted({t for c in waiting for t in mentions(c)} - terms.keys() - {*left})
        if not left:
            yield terms
            return
        for individual in self.classes.get(kinds[left[0]], ()):
            yield from self.solutions(conditions, {**terms, left[0]: individual}, kinds, names)

    def holds(self, condition: Condition, terms: Mapping[str, str], kinds: Mapping[str, str]) -> bool:
        """Return whether a condition with bound variables is true."""
        of = terms.get
        match condition:
            case ValueCondition(situation, arguments, value, negated):
                return (self.value(situation, tuple(of(a, a) for a in arguments)) == of(value, value)) is not negated
            case RelationCondition(relation, arguments, negated):
                return (tuple(of(a, a) for a in arguments) in self.relations.get(relation, ())) is not negated
            case ClassCondition(term, kind, negated):
                return (of(term, term) in self.members.get(kind, ())) is not negated
            case EqualityCondition(left, right, negated):
                return (of(left, left) == of(right, right)) is not negated
            case Comparison(left, sign, right, negated):
                return COMPARING[sign](self.worth(left, terms), self.worth(right, terms)) is not negated
            case Witness(variable, kind, inner, negated):
                open_ = {name: one for name, one in terms.items() if name != variable}
                found = self.solutions(inner, open_, {**kinds, variable: kind}, (variable,))
                return any(True for _ in found) is not negated
            case AnyOf(alternatives, negated):
                ways = (self.solutions(group, dict(terms), kinds, ()) for group in alternatives)
                return any(True for way in ways for _ in way) is not negated
