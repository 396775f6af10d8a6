"""Reading of measured situation types: their bounds `e:holdsIf` for the perceiver `e:perceive_measured`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from confab.reasoner.embodiment.facts import BodyFacts, EmbodimentError
from confab.reasoner.embodiment.skills import TERM, guards
from confab.reasoner.embodiment.values import Guard

MEASURED = "perceive_measured"
"""The perceiver of measured situation types."""

PAIRED = ("beside", "apart", "above", "over", "inside", "contact", "turned")
"""Quantities measured between two individuals, in metres, newtons and radians; `inside` is 1 or 0."""

SINGLE = ("tilt", "joint")
"""Quantities measured on one individual."""

OF_JOINTS = ("opened", "shut", "lower", "upper")
"""Numbers of a link that can be bounds of a measured situation type."""


def bounds(facts: BodyFacts, situation: str, settings: Mapping[str, float], alone: bool) -> tuple[Guard, ...]:
    """Return the bounds within which a measured situation type is true; `alone` tells whether the type has a single argument.

    Raises
    ------
    EmbodimentError
        No bound is stated, or a bound contains an unknown quantity or number.
    """
    found = guards(situation, facts.text(situation, "holds_if"))
    known = SINGLE if alone else (*PAIRED, *SINGLE)
    if not found:
        raise EmbodimentError(f"{situation} has an empty e:holdsIf; wanted bounds like beside <= 0.02", situation)
    for guard in found:
        if guard.quantity not in known:
            whose = "one individual" if alone else "an individual and a value"
            raise EmbodimentError(
                f"{situation} has a bound on '{guard.quantity}'; wanted a quantity of {whose}: {', '.join(known)}",
                situation,
            )
        for _, term in TERM.findall(guard.bound):
            if term[0].isalpha() and term not in settings and not (guard.quantity == "joint" and term in OF_JOINTS):
                raise EmbodimentError(
                    f"{situation} has the bound '{guard}', but no number '{term}'; state it, or write a number",
                    situation,
                )
    return found


def asked(
    facts: BodyFacts, situation: str, values: tuple[str, ...], names: Callable[[str], str]
) -> tuple[tuple[str, ...], ...]:
    """Return the arguments of all symbols of a boolean situation type: single individuals, or pairs of individual and value."""
    kinds = {kind for kind, links in facts.links.items() if situation in links.get("has_situation_type", ())}
    those = (
        node for node in facts.ordered(facts.classes) if node not in kinds and kinds & {*facts.nearest_first(node)[1:]}
    )
    individuals = [names(node) for node in those if node not in facts.supers]
    if not values:
        return tuple((one,) for one in individuals)
    return tuple((one, value) for one in individuals for value in values if value != one)
