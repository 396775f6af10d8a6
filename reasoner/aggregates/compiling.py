"""Compilation of a domain: behaviours update sums, counts and remembered situation types, and maintain constraints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, islice

from confab.reasoner.afterwards import TooManyCasesError
from confab.reasoner.aggregates import keeping
from confab.reasoner.aggregates.keeping import MOST_CONDITIONS
from confab.reasoner.aggregates.remembering import in_order_of_update, remembering, stated
from confab.reasoner.effects import spread
from confab.reasoner.folding import Folding
from confab.reasoner.language import DomainError, mentions, plain_variables, walk
from confab.reasoner.limits import check
from confab.reasoner.problem import Domain
from confab.reasoner.symbols import Aggregate, AnyOf, Behavior, Condition, Effect, Span, Witness
from confab.reasoner.timing import given_itself, with_given_effects


def compiled(domain: Domain, classes: Mapping[str, Sequence[str]]) -> Domain:
    """Return an equivalent domain in which behaviours update sums, counts and remembered situation types.

    Effects on all members of a class become one effect per member.

    Raises
    ------
    DomainError
        Too many effects change the same total or remembered situation type.
    """
    updated = in_order_of_update(domain)
    behaviors = {}
    for name, behavior in domain.behaviors.items():
        check("deriving amounts")
        if behavior.timing is not None:
            for one in (one for one in updated if one.situation not in domain.remembers):
                with _few_effects(name, one, domain):
                    behavior = keeping.kept_in_time(behavior, one, domain.situations, classes)
            behavior = with_given_effects(behavior, domain.aggregates, domain.situations, classes)
        for one in updated:
            with _few_effects(name, one, domain):
                if one.situation in domain.remembers:
                    behavior = remembering(behavior, one, domain, classes)
                else:
                    behavior = keeping.kept(behavior, (one,), domain.situations, classes)
        if behavior.timing is not None:
            asked = given_itself(behavior, behavior.preconditions, tuple(Span), domain.situations, classes)
            behavior = replace(behavior, preconditions=asked)
        behaviors[name] = _folded(spread(_prevented(behavior, domain, classes), classes), domain, classes)
        conditions = chain.from_iterable(map(walk, behaviors[name].conditions))
        many = sum(1 for _ in islice(conditions, MOST_CONDITIONS + 1))
        if updated and many > MOST_CONDITIONS:
            kept = " and ".join(sorted({stated(one.situation, domain) for one in updated}))
            raise DomainError(
                f"{name}: the effects that keep {kept} take more than {MOST_CONDITIONS} "
                "conditions; let fewer of its effects change them, or let no derived amount depend on another"
            )
    return replace(domain, behaviors=behaviors)


@contextmanager
def _few_effects(name: str, one: Aggregate, domain: Domain) -> Iterator[None]:
    """Raise `DomainError` if too many effects of a behaviour change a derived amount or a remembered situation type."""
    try:
        yield
    except TooManyCasesError:
        raise DomainError(
            f"{name} changes the facts that determine {stated(one.situation, domain)} by too many effects at once; "
            "use fewer effects, or another behaviour for some of them"
        ) from None


def _prevented(behavior: Behavior, domain: Domain, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour with additional preconditions that prevent violations of constraints.

    No constraint is violated before the behaviour, so the behaviour can only add violations. The additional precondition is the
    negation of the condition under which the behaviour adds a violation. A durative behaviour doesn't get this precondition, but
    effects that count the violations; the schedule checks the bound of the count.
    """
    if behavior.timing is not None or not behavior.changes & domain.constraints.keys():
        return behavior
    counts = [effect for effect in behavior.amounts if effect.situation in domain.constraints]
    amounts = tuple(effect for effect in behavior.amounts if effect.situation not in domain.constraints)
    kinds = {**behavior.kinds, **{one.each.name: one.each.kind for one in counts if one.each is not None}}
    bound = {p.name for p in behavior.parameters} | plain_variables(behavior.preconditions)
    folding, preconditions = Folding(classes, kinds, frozenset(behavior.preconditions)), list(behavior.preconditions)
    for effect in counts:
        inner = folding.conjunction(effect.when)
        empty = effect.each is not None and not classes.get(effect.each.kind)
        if inner is None or empty or effect.operation != "increase":
            continue
        for variable in sorted(set[str]().union(*map(mentions, inner)) - bound):
            inner = (Witness(variable, kinds[variable], inner),)
        preconditions.append(AnyOf((inner,), negated=True, constraint=domain.constraints[effect.situation]))
    others: tuple[Effect, ...] = (*behavior.effects, *amounts)
    used = set[str]().union(*(mentions(c) for one in others for c in one.when), bound)
    used = used.union(*map(mentions, behavior.preconditions))
    unused = set[str]().union(*(mentions(c) for one in counts for c in one.when)) - used
    variables = tuple(variable for variable in behavior.variables if variable.name not in unused)
    return replace(behavior, variables=variables, preconditions=tuple(dict.fromkeys(preconditions)), amounts=amounts)


def _folded(behavior: Behavior, domain: Domain, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour in which constant conditions are removed from the effects on derived amounts."""
    if not behavior.changes & domain.aggregates.keys():
        return behavior
    known = frozenset(behavior.preconditions) if behavior.timing is None else frozenset[Condition]()
    own = tuple(effect for effect in behavior.amounts if effect.situation not in domain.aggregates)
    derived = (effect for effect in behavior.amounts if effect.situation in domain.aggregates)
    return replace(behavior, amounts=(*own, *Folding(classes, behavior.kinds, known).effects(derived)))
