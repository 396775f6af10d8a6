"""Conversion of query results to nodes (subject → property → values), with checks of the values."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import chain

import pyoxigraph as ox

from confab.reasoner.amounts import exact, written
from confab.reasoner.closure import closure
from confab.reasoner.condition_nodes import NodeValues
from confab.reasoner.graph.knowledge import KnowledgeError, Term, text
from confab.reasoner.limits import checked
from confab.reasoner.names import Names, local_name
from confab.reasoner.vocabulary import CORE, OWL, TYPE

FIRST_INDEX_OF_NONE = 10**9  # sorts nodes without an index last, by their names
DATA = frozenset(
    CORE + name
    for name in (
        "index",
        "negated",
        "level",
        "fromLevel",
        "firstId",
        "cost",
        "update",
        "construct",
        "never",
        "always",
        "atMostOnce",
        "weight",
    )
)
DATA |= {CORE + name for name in ("amount", "sign", "change", "aggregate", "enforces", "unit", "wholeNumbers")}
DATA |= {CORE + name for name in ("leastAmount", "mostAmount", "defaultAmount")}
DATA |= {CORE + name for name in ("duration", "by", "happensAt", "availableFrom", "availableUntil")}
"""Core properties whose values are literals; the values of all other core properties are nodes."""
OF_ONTOLOGIES = frozenset({CORE + "symbolicOnly", CORE + "inputsHash"})
NOT_OF_AMOUNTS = {
    CORE + "restValue": "drop c:restValue, since an amount keeps the number that the last step gave it; "
    "c:defaultAmount states the amount of each object for which the scene states none",
    CORE + "defaultValue": "write c:defaultAmount with a number instead of c:defaultValue",
}  # fmt: skip
"""Properties of situation types that amounts don't have, each with the remedy."""
HIGHEST_LEVEL = 1_000
HIGHEST_COST = 10**9
HIGHEST_NUMBER = 10**9

Triple = tuple[str, str, str]
Member = tuple[str, str, int]
"""An individual, one of its classes, and its index."""


@dataclass(frozen=True)
class OntologySchema:
    """The part of an ontology that doesn't depend on individuals: the rows of `SCHEMA`, as IRIs.

    `nodes` contains situation types, behaviours with their parts, relations and tasks. `pairs` contains the situation types whose
    value property isn't functional. `whole` contains the amounts whose value property has the range of whole numbers. `exclusive`
    contains the situation types with exclusive values: in physics, only one individual at a time can have a given value.

    `tuples` tells whether some facts are nodes. `facts` contains the facts without arguments. `expressions` contains the
    definitions of classes. `axioms` contains the axioms about value properties. `swrl` contains the SWRL rules. `ontologies`
    contains the IRIs of the loaded files.
    """

    nodes: Mapping[str, NodeValues]
    supers: Mapping[str, Sequence[str]]
    owners: Sequence[tuple[str, str]]
    pairs: frozenset[str]
    whole: frozenset[str]
    from_levels: Mapping[str, int]
    facts: Mapping[str, NodeValues]
    tuples: bool
    expressions: Mapping[str, NodeValues]
    axioms: Mapping[str, NodeValues]
    swrl: Mapping[str, NodeValues]
    ontologies: Sequence[str]
    exclusive: frozenset[str] = frozenset()

    @cached_property
    def by_kind(self) -> Mapping[str, Sequence[str]]:
        """The nodes of each stated class, sorted by IRI."""
        found: dict[str, list[str]] = defaultdict(list)
        for iri, node in self.nodes.items():
            for kind in node[TYPE]:
                found[kind].append(iri)
        return found

    @cached_property
    def numbers(self) -> frozenset[str]:
        """The properties whose values are numbers: value properties of amounts, and relations that are datatype properties."""
        amounts = {p for iri in self.of_kind("Amount") for p in self.nodes[iri].get(CORE + "valueProperty", ())}
        return frozenset(amounts.union(self.by_kind.get(OWL + "DatatypeProperty", ())))

    @cached_property
    def value_properties(self) -> Mapping[str, str]:
        """The situation type of each value property."""
        types = self.of_kind("SituationType")
        return {prop: iri for iri in types for prop in self.nodes[iri].get(CORE + "valueProperty", ())}

    @cached_property
    def individuals_of(self) -> frozenset[str]:
        """The classes of objects; in a condition or effect, such a class stands for all of its members."""
        known = {*self.supers, *chain.from_iterable(self.supers.values()), *(kind for kind, _ in self.owners)}
        known |= {iri for iri, node in self.expressions.items() if OWL + "equivalentClass" in node}
        return frozenset(known - self.nodes.keys())

    def of_kind(self, *kinds: str) -> list[str]:
        """Return the nodes of some core classes."""
        return [iri for kind in kinds for iri in self.by_kind.get(CORE + kind, ())]


def nodes_of(triples: Iterable[tuple[str, str, str]]) -> dict[str, dict[str, list[str]]]:
    """Return the properties and values of each subject, sorted by subject and value."""
    nodes: dict[str, dict[str, list[str]]] = {}
    for subject, predicate, value in checked(triples, "reading the scene"):
        nodes.setdefault(subject, {}).setdefault(predicate, []).append(value)
    for node in checked(nodes.values(), "reading the scene"):
        for values in node.values():
            if len(values) > 1:
                values.sort()
    return dict(sorted(nodes.items()))


def core_triple(row: Sequence[Term]) -> Triple:
    """Return a triple as texts; raise `KnowledgeError` if the value is a literal although the values of the property are nodes."""
    subject, predicate, value = row
    named = text(predicate)
    return (
        link(row, blank=True) if named.startswith(CORE) and named not in DATA else (text(subject), named, text(value))
    )


def link(row: Sequence[Term], blank: bool = False) -> Triple:
    """Return a triple between two individuals as texts; blank nodes are allowed only if `blank`.

    Raises
    ------
    KnowledgeError
        The subject or the value is a literal, or a blank node that isn't allowed.
    """
    subject, predicate, value = row
    if text(predicate) in OF_ONTOLOGIES:
        said = local_name(text(predicate))
        raise KnowledgeError(
            f"<{text(subject)}>: {said} belongs to an ontology, not to an individual; move it beside owl:imports"
        )
    # the message has no ID of the node, which differs in each process
    if isinstance(subject, ox.BlankNode) and not blank:
        raise KnowledgeError(f"a node without a name has a value of {local_name(text(predicate))}; name the individual")
    if not (isinstance(value, ox.NamedNode) or (blank and isinstance(value, ox.BlankNode))):
        what = f"the text '{text(value)[:60]}'" if isinstance(value, ox.Literal) else "a node without a name"
        name = "a node without a name" if isinstance(subject, ox.BlankNode) else f"<{text(subject)}>"
        said, number = f"{name}: {local_name(text(predicate))}", NOT_OF_AMOUNTS.get(text(predicate))
        if number and isinstance(value, ox.Literal) and exact(text(value)) is not None:
            raise KnowledgeError(f"{said} is the number {text(value)}; name an individual, or, for an amount, {number}")
        raise KnowledgeError(
            f"{said} has {what} as its value; name an individual instead"
            + (", without quotation marks" if isinstance(value, ox.Literal) else "")
        )
    return text(subject), text(predicate), text(value)


def stated(row: Sequence[Term], numbers: Collection[str]) -> Triple:
    """Return a fact as texts; the value must be a number if the property is one of `numbers`."""
    subject, predicate, value = row
    if text(predicate) not in numbers:
        return link(row)
    what = f"<{text(subject)}>: {local_name(text(predicate))}"
    if not isinstance(value, ox.Literal):
        raise KnowledgeError(f"{what} leads to {text(value)[:60]}, where a number belongs; write one, like 2 or 1.5")
    return text(subject), text(predicate), written(decimal(text(value), what))


def decimal(text: str, what: str) -> Fraction:
    """Return the exact value of a number in an ontology.

    Raises
    ------
    KnowledgeError
        The text isn't a number.
    """
    found = exact(text)
    if found is None:
        raise KnowledgeError(f"{what} is '{text[:40]}'; wanted a number, like 2 or 1.5")
    return found


def index_of(iri: str, index: str) -> int:
    """Return the position of a node in the declared order; a node without an index comes last."""
    if not index:
        return FIRST_INDEX_OF_NONE
    return whole_number(index, f"<{iri}>: c:index", -HIGHEST_NUMBER, HIGHEST_NUMBER)


def whole_number(text: str, what: str, least: int, most: int) -> int:
    """Return a whole number in an ontology.

    Raises
    ------
    KnowledgeError
        The text isn't a whole number between `least` and `most`.
    """
    number = int(text) if re.fullmatch(r"[+-]?\d{1,18}", text) else None
    if number is None or not least <= number <= most:
        raise KnowledgeError(f"{what} is '{text[:40]}'; wanted a whole number from {least} to {most}")
    return number


def is_a(node: NodeValues, *kinds: str) -> bool:
    """Return whether a node is stated to belong to one of some core classes."""
    types = node[TYPE]
    return any(CORE + kind in types for kind in kinds)


def ordered(iris: Iterable[str], nodes: Mapping[str, NodeValues], names: Names) -> list[str]:
    """Return nodes sorted by index, then by name."""

    def key(iri: str) -> tuple[int, str]:
        if iri not in nodes:
            raise KnowledgeError(
                f"<{iri}> is used as a parameter but isn't declared as one; declare it, or correct the name"
            )
        index, *_ = nodes[iri].get(CORE + "index", [""])
        return (index_of(iri, index), names.short(iri))

    return sorted(iris, key=key)


def superclasses(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the direct superclasses of each class."""
    supers: dict[str, list[str]] = defaultdict(list)
    for sub, sup in pairs:
        if sub != sup:
            supers[sub].append(sup)
    return dict(supers)


def classes_of(
    instances: Sequence[Member], supers: Mapping[str, Sequence[str]], names: Names
) -> tuple[dict[str, tuple[str, ...]], dict[str, tuple[str, ...]]]:
    """Return the individuals of each class and its subclasses in declared order, and each class's direct superclasses."""

    @cache
    def above(kind: str) -> set[str]:
        return closure([kind], lambda each: supers.get(each, ()))

    of: dict[str, set[str]] = defaultdict(set)
    place: dict[str, int] = {}
    for individual, kind, index in checked(instances, "reading the scene"):
        of[individual] |= above(kind)
        place[individual] = min(index, place.get(individual, index))
    members: dict[str, list[str]] = {kind: [] for kind in {*supers, *chain.from_iterable(supers.values())}}
    named = [(place[iri], names.short(iri), kinds) for iri, kinds in checked(of.items(), "reading the scene")]
    for _, name, kinds in sorted(named):
        for kind in kinds:
            members.setdefault(kind, []).append(name)
    classes = {name: tuple(members[kind]) for name, kind in sorted((names.short(kind), kind) for kind in members)}
    return classes, {names.short(sub): tuple(map(names.short, group)) for sub, group in supers.items()}


def derived_goals(schema: OntologySchema) -> list[str]:
    """Return the goals that aren't facts, for example alternatives, witnesses, and comparisons of two amounts."""
    extrema = {
        situation
        for iri in schema.of_kind("Rule")
        if {"max", "min"}.intersection(schema.nodes[iri].get(CORE + "aggregate", ()))
        for situation in schema.nodes[iri].get(CORE + "situationType", ())
    }

    def fact(node: NodeValues) -> bool:
        said = {name.removeprefix(CORE): {*values} for name, values in node.items()}
        types, negated = said.get("situationType", set()), not {"true", "1"}.isdisjoint(said.get("negated", ()))
        if is_a(node, "Comparison"):
            plain = "amount" in said and {"left", "right", "relation"}.isdisjoint(said) and extrema.isdisjoint(types)
            return plain and not (negated and "=" in said.get("sign", ()))
        boolean = said.get("value", set()) <= {CORE + "true", CORE + "false"} or not schema.pairs.isdisjoint(types)
        return is_a(node, "ValueCondition") and (boolean or not negated)

    goals = checked(goals_of(schema.nodes), "reading the scene")
    return sorted(iri for iri in goals if not fact(schema.nodes[iri]))


def goals_of(nodes: Mapping[str, NodeValues]) -> list[str]:
    """Return the nodes that are goals of tasks."""
    goals = dict.fromkeys(
        iri for node in checked(nodes.values(), "reading the scene") for iri in node.get(CORE + "goal", ())
    )
    return [iri for iri in goals if iri in nodes]
