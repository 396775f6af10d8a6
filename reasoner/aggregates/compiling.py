"""A domain without aggregates: its behaviours keep sums and counts, and no condition reads a maximum or minimum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice

from confab.reasoner.aggregates.extrema import extrema_replaced
from confab.reasoner.aggregates.keeping import MOST_CONDITIONS, kept
from confab.reasoner.folding import Folding
from confab.reasoner.language import DomainError, walk
from confab.reasoner.limits import check
from confab.reasoner.symbols import Behavior, Condition, Domain, spread


def compiled(domain: Domain, classes: Mapping[str, Sequence[str]]) -> Domain:
    """Return a domain whose behaviours keep sums and counts up to date, and name no maximum, no minimum and no class in an effect.

    Raises
    ------
    DomainError
        An effect or a price reads a maximum or minimum, or too many effects change one number at once.
    """
    domain = extrema_replaced(domain)
    aggregates = domain.aggregates.values()
    behaviors = {}
    for name, behavior in domain.behaviors.items():
        check("deriving amounts")
        behaviors[name] = _folded(
            spread(kept(behavior, aggregates, domain.situations, classes), classes), domain, classes
        )
        conditions = chain.from_iterable(map(walk, behaviors[name].conditions))
        many = sum(1 for _ in islice(conditions, MOST_CONDITIONS + 1))
        if aggregates and many > MOST_CONDITIONS:
            raise DomainError(
                f"{name}: the effects that keep {' and '.join(sorted(domain.aggregates))} take more than {MOST_CONDITIONS} "
                "conditions; let fewer of its effects change them, or let no derived amount depend on another"
            )
    return replace(domain, behaviors=behaviors)


def _folded(behavior: Behavior, domain: Domain, classes: Mapping[str, Sequence[str]]) -> Behavior:
    """Return a behaviour whose effects on derived amounts are decided as far as no state is needed."""
    if not behavior.changes & domain.aggregates.keys():
        return behavior
    known = frozenset(behavior.preconditions) if behavior.timing is None else frozenset[Condition]()
    own = tuple(effect for effect in behavior.amounts if effect.situation not in domain.aggregates)
    derived = (effect for effect in behavior.amounts if effect.situation in domain.aggregates)
    return replace(behavior, amounts=(*own, *Folding(classes, behavior.kinds, known).effects(derived)))
