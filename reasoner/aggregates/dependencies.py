"""Dependencies between aggregates, and expansion of derived situation types in the conditions of aggregates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count

from confab.reasoner.afterwards import closed
from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, inside, situations_in
from confab.reasoner.closure import closure
from confab.reasoner.derivation import circular
from confab.reasoner.language import DomainError, plain_variables, situations_of, substituted, walk
from confab.reasoner.symbols import (
    FALSE,
    Aggregate,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    Rule,
    SituationType,
    ValueCondition,
    Witness,
)


def in_order(aggregates: Mapping[str, Aggregate]) -> list[Aggregate]:
    """Return aggregates in order of dependency: an aggregate follows all aggregates that it reads.

    Raises
    ------
    DomainError
        An aggregate depends on itself; the message names the aggregate.
    """
    found: dict[str, Aggregate] = {}
    waiting = dict(aggregates)
    while waiting:
        ready = [name for name, one in waiting.items() if not read_by(one) & waiting.keys()]
        if not ready:
            name = min(waiting)
            for _ in waiting:  # leads into a cycle
                name = min(read_by(waiting[name]) & waiting.keys())
            raise DomainError(
                f"{name} depends on itself, since its rule reads "
                f"{' and '.join(sorted(read_by(waiting[name]) & waiting.keys()))}; remove one of these amounts from its rule"
            )
        for name in ready:
            found[name] = waiting.pop(name)
    return list(found.values())


def read_by(aggregate: Aggregate) -> frozenset[str]:
    """Return the situation types on which an aggregate depends directly."""
    asked = (s for c in aggregate.conditions for inner in walk(c) for s in situations_of(inner))
    return situations_in(aggregate.amount).union(asked)


def _followed(situations: frozenset[str], rules: Mapping[str, Sequence[Rule]]) -> set[str]:
    """Return situation types together with all types on which their definitions depend."""

    def named(name: str) -> Iterator[str]:
        return (
            s for rule in rules.get(name, ()) for one in rule.conditions for c in walk(one) for s in situations_of(c)
        )

    return closure(situations, named)


def unfolded(
    aggregate: Aggregate, rules: Mapping[str, Sequence[Rule]], situations: Mapping[str, SituationType]
) -> Aggregate:
    """Return an equivalent aggregate whose conditions contain the definitions of derived situation types instead of these types.

    A situation that doesn't exist, because an individual isn't of the class that has the situation type, is neither true nor false.

    Raises
    ------
    DomainError
        The definition of a derived situation type is recursive; the message names the aggregate and the situation type.
    """
    if not read_by(aggregate) & rules.keys():
        return aggregate
    if lost := sorted(_followed(read_by(aggregate), rules) & circular(rules)):
        raise DomainError(
            f"{aggregate.situation} is calculated from {lost[0]}, which is defined recursively; aggregate over situation types "
            "that behaviours change, or over one whose definition isn't recursive"
        )
    numbers = count(1)

    def one(condition: Condition) -> Condition:
        match condition:
            case ValueCondition(situation, arguments, value, negated) if situation in rules:
                bodies = tuple(body(rule, arguments) for rule in rules[situation])
                if value != FALSE:
                    return AnyOf(bodies, negated)
                of = zip(arguments, situations[situation].arguments, strict=True)
                return AnyOf(((*(ClassCondition(a, kind) for a, kind in of), AnyOf(bodies, negated=True)),), negated)
            case Witness(_, _, inner):
                return replace(condition, conditions=tuple(map(one, inner)))
            case AnyOf(alternatives):
                return replace(condition, alternatives=tuple(tuple(map(one, group)) for group in alternatives))
            case _:
                return condition

    def body(rule: Rule, arguments: Sequence[str]) -> tuple[Condition, ...]:
        number = next(numbers)
        terms = dict(zip((p.name for p in rule.parameters), arguments, strict=True))
        terms |= {v.name: f"{v.name}_rule{number}" for v in rule.variables}
        plain = plain_variables(rule.conditions)  # other variables are local to a disjunction or witness
        asked = closed(rule.conditions, frozenset(plain | {p.name for p in rule.parameters}), rule.behavior.kinds)
        found = tuple(one(substituted(condition, terms)) for condition in asked)
        for variable in rule.variables:
            if variable.name in plain:
                found = (Witness(terms[variable.name], variable.kind, found),)
        members = (ClassCondition(terms[p.name], p.kind) for p in rule.parameters)
        return (*members, *found)

    return unfolded(replace(aggregate, conditions=tuple(map(one, aggregate.conditions))), rules, situations)


def existing(aggregate: Aggregate) -> tuple[Condition, ...]:
    """Return the condition that the number of an aggregate is defined; return no condition for a number that is always defined."""
    whole = aggregate.amount
    amounts = [part for part in inside(whole) if isinstance(part, Amount | Measure)]
    return (Comparison(whole, "=", whole),) if amounts or divides(whole) else ()


def divides(expression: Expression) -> bool:
    """Return whether an expression contains a division."""
    return any(isinstance(part, Calculation) and part.operator == "/" for part in inside(expression))
