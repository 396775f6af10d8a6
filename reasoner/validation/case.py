"""Input and output types of validation rules."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import BASE, SCENE, KnowledgeGraph
from confab.reasoner.names import Names
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import Reading
from confab.reasoner.symbols import Behavior
from confab.reasoner.vocabulary import CORE, RDF

Fault = tuple[str, str, str, str]
"""A fault: the node at fault, a description, its consequence, and the remedy."""


@dataclass(frozen=True)
class Case:
    """Input of a validation rule: the graph of an ontology."""

    graph: KnowledgeGraph

    @cached_property
    def triples(self) -> Sequence[ox.Triple]:
        """All triples in the named graphs that planning reads."""
        names = [ox.NamedNode(BASE + name) for name in SCENE]
        return [quad.triple for name in names for quad in self.graph.store.quads_for_pattern(None, None, None, name)]

    @cached_property
    def types(self) -> dict[str, set[str]]:
        """The stated classes of each IRI."""
        found: dict[str, set[str]] = defaultdict(set)
        for triple in self.triples:
            if (
                triple.predicate.value == RDF + "type"
                and isinstance(triple.subject, ox.NamedNode)
                and isinstance(triple.object, ox.NamedNode)
            ):
                found[triple.subject.value].add(triple.object.value)
        return found

    @cached_property
    def relative(self) -> frozenset[str]:
        """The IRIs that are relative in their file, and therefore depend on the file's folder."""
        parts = (part for triple in self.triples for part in (triple.subject, triple.predicate, triple.object))
        return frozenset(p.value for p in parts if isinstance(p, ox.NamedNode) and p.value.startswith("file:"))


@dataclass(frozen=True)
class ReadCase(Case):
    """A case with the planning problem that was read from the graph."""

    reading: Reading

    @property
    def problem(self) -> Problem:
        """The planning problem."""
        return self.reading.problem

    @property
    def names(self) -> Names:
        """The short names and IRIs of the terms."""
        return self.reading.names

    @cached_property
    def units(self) -> dict[str, str]:
        """The stated units of amounts and of relations to numbers, by short name."""
        nodes = self.reading.schema.nodes
        return {self.names.short(iri): unit for iri, node in nodes.items() for unit in node.get(CORE + "unit", ())[:1]}

    @property
    def behaviors_and_rules(self) -> list[tuple[str, Behavior]]:
        """The behaviours, and the rules in the form of behaviours, by name; several rules may have one name.

        A goal about a class has a rule for each member; the first one, which has the goal's name, stands for all of them.
        """
        domain = self.problem.domain
        rules = ((name, one.behavior) for name, its in domain.rules.items() if name in self.names for one in its)
        return [*domain.behaviors.items(), *rules]
