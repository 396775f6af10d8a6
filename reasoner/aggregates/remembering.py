"""Effects by which a behaviour updates a remembered situation type.

A remembered symbol remembers an original symbol: a behaviour makes the remembered symbol true if the original symbol is true after
the behaviour. The original symbol has a count of solutions, which is 0 or 1; this count becomes 1 under the same condition. The
regression of counts (`confab.reasoner.aggregates.keeping`) therefore also derives the effects on remembered symbols. The count has
the maximum 0, because the effects on a count with this maximum depend only on the state after the behaviour.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from confab.reasoner.aggregates.dependencies import in_order, read_by, unfolded
from confab.reasoner.aggregates.keeping import kept
from confab.reasoner.amounts import Quantity
from confab.reasoner.effects import made_of
from confab.reasoner.folding import Folding
from confab.reasoner.language import DomainError, mentions
from confab.reasoner.problem import Domain
from confab.reasoner.symbols import (
    TRUE,
    Aggregate,
    AmountEffect,
    Behavior,
    Parameter,
    SituationType,
    ValueCondition,
    ValueEffect,
)

NONE_ALLOWED = Quantity(whole=True, most=Fraction(0))
"""The properties of a count that must stay 0: whole numbers with the maximum 0."""


def solutions_of(name: str, situation: SituationType, negated: bool = False) -> Aggregate:
    """Return the aggregate that counts the symbols of a situation type with the value true (false if `negated`)."""
    variables = tuple(Parameter(f"?argument{i}", kind) for i, kind in enumerate(situation.arguments))
    true = ValueCondition(situation.name, tuple(one.name for one in variables), TRUE, negated)
    return Aggregate(name, "count", Fraction(1), (), variables, (true,))


def in_order_of_update(domain: Domain) -> list[Aggregate]:
    """Return the aggregates of a domain, and a count for each remembered situation type, in order of dependency.

    The count of a remembered situation type is 1 if the original symbol is true, and 0 otherwise.

    Raises
    ------
    DomainError
        A remembered situation type depends on itself or on a recursive definition.
    """
    return in_order({**domain.aggregates, **{name: count_of(name, domain) for name in domain.remembers}})


def count_of(name: str, domain: Domain) -> Aggregate:
    """Return, for a remembered situation type, the count that is 1 if the original symbol with the same arguments is true.

    Raises
    ------
    DomainError
        The definition of the original situation type is recursive.
    """
    source = domain.remembers[name]
    count = solutions_of(name, replace(domain.situations[source], arguments=domain.situations[name].arguments))
    return unfolded(replace(count, parameters=count.variables, variables=()), domain.rules, domain.situations)


def stated(name: str, domain: Domain) -> str:
    """Return what a count or a remembered situation type expresses: itself, or the constraint for which Confab added it."""
    added = name in domain.situations and domain.situations[name].added
    for key, one in domain.constraints.items():
        if key == name or (added and one.about and name.startswith(f"{one.about[0]}.")):
            return f"the constraint that {one}"
    return name


def remembering(behavior: Behavior, count: Aggregate, domain: Domain, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour that makes a remembered symbol true if the original symbol is true after the behaviour.

    A behaviour is returned unchanged if the remembered situation type doesn't exist on the behaviour's level.

    Parameters
    ----------
    behavior : Behavior
        The behaviour, which already updates everything on which the remembered situation type depends.
    count : Aggregate
        The count of the remembered situation type, as `count_of` returns it.
    domain : Domain
    classes : mapping of class to individuals

    Raises
    ------
    DomainError
        The behaviour has a duration or an actor.
    TooManyCasesError
        Too many effects of the behaviour change the same remembered situation type.
    """
    if not read_by(count) & behavior.changes or behavior.level < domain.situations[count.situation].level:
        return behavior
    if behavior.timing is not None:
        raise DomainError(
            f"{behavior.name} has a duration or an actor, and changes what {stated(count.situation, domain)} remembers; leave out "
            "the duration and the actor, or the condition about earlier states (c:remembers, c:atMostOnce, c:onlyAfter)"
        )
    situations = {
        **domain.situations,
        count.situation: replace(domain.situations[count.situation], quantity=NONE_ALLOWED),
    }
    counting = kept(behavior, (count,), situations, classes)
    known = frozenset(behavior.preconditions)
    kinds = {**counting.kinds, **{e.each.name: e.each.kind for e in counting.amounts if e.each is not None}}
    made = (one for e in counting.amounts if e.situation == count.situation for one in _alone(e, classes))
    found = Folding(classes, kinds, known).effects(made)
    effects = (ValueEffect(e.situation, e.arguments, TRUE, e.when, e.each) for e in found)
    used = {term for e in found for term in (*e.arguments, *(t for c in e.when for t in mentions(c)))}
    variables = tuple(v for v in counting.variables if v in behavior.variables or v.name in used)
    return replace(behavior, variables=variables, effects=(*behavior.effects, *effects))


def _alone(effect: AmountEffect, classes: Mapping[str, Sequence[str]]) -> Iterator[AmountEffect]:
    """Yield an effect; an effect on a class becomes one per member, unless the arguments of its symbol have the member."""
    if effect.each is None or effect.each.name in effect.arguments:
        yield effect
        return
    for member in classes.get(effect.each.kind, ()):
        one = made_of(effect, member)
        assert isinstance(one, AmountEffect)
        yield one
