"""Dataclasses for the declarations in a PDDL domain and a PDDL problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from confab.reasoner.pddl.durative import Durative
from confab.reasoner.pddl.words import Form, PddlWord

COMPARISONS = ("<", "<=", "=", ">=", ">")
CHANGES = ("assign", "increase", "decrease", "scale-up", "scale-down")


@dataclass(frozen=True)
class Typed:
    """A type, an object or a variable (with its question mark), together with its declared type."""

    name: str
    type: str
    place: PddlWord


@dataclass(frozen=True)
class Action:
    """A parsed action; the names in `precondition` and `effect` have been checked against the declarations.

    For a durative action, `precondition` and `effect` contain all conditions and effects without their times, `durative` contains
    them with their times. `durative` is None for other actions.
    """

    name: str
    parameters: tuple[Typed, ...]
    precondition: Form | None
    effect: Form | None
    place: PddlWord
    durative: Durative | None = None


@dataclass(frozen=True)
class Axiom:
    """A rule of a derived predicate: the predicate with its variables, and the checked condition."""

    predicate: str
    parameters: tuple[Typed, ...]
    condition: Form


@dataclass
class Pddl:
    """A parsed domain and problem.

    The parser has checked that all names are declared and that all numbers of arguments are right.
    """

    domain: str = "domain"
    problem: str = "problem"
    types: dict[str, tuple[str, ...]] = field(default_factory=lambda: {"object": ()})  # direct supertypes by type
    predicates: dict[str, tuple[Typed, ...]] = field(default_factory=dict)
    functions: dict[str, tuple[Typed, ...]] = field(default_factory=dict)
    objects: dict[str, str] = field(default_factory=dict)  # objects with their types; constants come first
    actions: dict[str, Action] = field(default_factory=dict)
    axioms: list[Axiom] = field(default_factory=list)
    forbidden: list[str] = field(default_factory=list)  # derived predicates that must never hold
    # predicates that stay true after the other predicate was true
    remembers: dict[str, str] = field(default_factory=dict)
    sometime: list[Form] = field(default_factory=list)  # further goals
    initial: list[tuple[str, ...]] = field(default_factory=list)
    numbers: dict[tuple[str, ...], Fraction] = field(default_factory=dict)
    timed: list[tuple[Fraction, tuple[str, ...], bool]] = field(default_factory=list)  # time, atom and new truth value
    goal: Form | None = None
    preferences: dict[str, Form] = field(default_factory=dict)  # soft goals
    # the weights of functions and of `is-violated NAME` in the metric; None if no metric or only the time is stated
    metric: dict[str, Fraction] | None = None

    def above(self, name: str) -> Sequence[str]:
        """Return a type and all its supertypes, from the nearest supertype to ``object``."""
        found = {name: None}
        layer = [name]
        while layer:
            layer = [kind for lower in layer for kind in self.types[lower] if kind not in found and kind != "object"]
            found |= dict.fromkeys(layer)
        return tuple(found) if name == "object" else (*found, "object")

    def of_type(self, name: str) -> tuple[str, ...]:
        """Return the objects of a type and of its subtypes."""
        kinds = {kind for kind in self.types if name in self.above(kind)}
        return tuple(o for o, t in self.objects.items() if t in kinds)


def either(kinds: Sequence[str]) -> str:
    """Return the name of the common supertype that stands for PDDL's ``(either …)`` of some types.

    >>> either(["person", "aircraft"])
    'either aircraft person'
    """
    kinds = sorted(set(kinds))
    return "object" if "object" in kinds else kinds[0] if len(kinds) == 1 else f"either {' '.join(kinds)}"
