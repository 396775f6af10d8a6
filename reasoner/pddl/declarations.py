"""The declarations of a domain and a problem of PDDL, as values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from confab.reasoner.pddl.durative import Durative
from confab.reasoner.pddl.words import Form, Word

COMPARISONS = ("<", "<=", "=", ">=", ">")
CHANGES = ("assign", "increase", "decrease", "scale-up", "scale-down")


@dataclass(frozen=True)
class Typed:
    """A name (of a type, an object or, with its question mark, a variable) and its type."""

    name: str
    type: str
    place: Word


@dataclass(frozen=True)
class Action:
    """An action as parsed; `precondition` and `effect` are forms whose words have been checked.

    For a durative action they are the conditions and effects of the action as a whole (`confab.reasoner.pddl.durative`);
    `durative` has its parts.
    """

    name: str
    parameters: tuple[Typed, ...]
    precondition: Form | None
    effect: Form | None
    place: Word
    durative: Durative | None = None


@dataclass(frozen=True)
class Axiom:
    """A derived predicate with variables and its checked condition."""

    predicate: str
    parameters: tuple[Typed, ...]
    condition: Form


@dataclass
class Pddl:
    """A domain with a problem, checked: every type, predicate, function, object and variable is declared, every arity right."""

    domain: str = "domain"
    problem: str = "problem"
    types: dict[str, tuple[str, ...]] = field(default_factory=lambda: {"object": ()})  # and the types right above
    predicates: dict[str, tuple[Typed, ...]] = field(default_factory=dict)
    functions: dict[str, tuple[Typed, ...]] = field(default_factory=dict)
    objects: dict[str, str] = field(default_factory=dict)  # and their type; constants first
    actions: dict[str, Action] = field(default_factory=dict)
    axioms: list[Axiom] = field(default_factory=list)
    forbidden: list[str] = field(default_factory=list)  # the derived predicates that never hold
    initial: list[tuple[str, ...]] = field(default_factory=list)
    numbers: dict[tuple[str, ...], Fraction] = field(default_factory=dict)
    timed: list[tuple[Fraction, tuple[str, ...], bool]] = field(default_factory=list)  # facts that begin or end to hold
    goal: Form | None = None
    minimize: Form | None = None  # the metric

    def above(self, name: str) -> Sequence[str]:
        """Return a type and its supertypes, from the nearest to ``object``."""
        found = {name: None}
        layer = [name]
        while layer:
            layer = [kind for lower in layer for kind in self.types[lower] if kind not in found and kind != "object"]
            found |= dict.fromkeys(layer)
        return tuple(found) if name == "object" else (*found, "object")

    def of_type(self, name: str) -> tuple[str, ...]:
        """Return the objects of a type."""
        kinds = {kind for kind in self.types if name in self.above(kind)}
        return tuple(o for o, t in self.objects.items() if t in kinds)


def either(kinds: Sequence[str]) -> str:
    """Return the name of the type above some types.

    >>> either(["person", "aircraft"])
    'either aircraft person'
    """
    kinds = sorted(set(kinds))
    return "object" if "object" in kinds else kinds[0] if len(kinds) == 1 else f"either {' '.join(kinds)}"
