"""The individuals (nodes) of one behaviour or rule during compilation, with their properties and positions in the update."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pyoxigraph as ox

from confab.reasoner.condition_nodes import Properties, triples
from confab.reasoner.updates.texts import TextPosition, Update
from confab.reasoner.vocabulary import CORE, INDIVIDUAL, TYPE


@dataclass
class Nodes:
    """The nodes of one behaviour or rule.

    Attributes
    ----------
    behavior : str
    said : mapping of node to properties
        The properties of each node, as a mapping of the core property's name to values; the key `TYPE` has the node's classes.
    places : mapping of node to TextPosition
    links : Properties
        The properties of the behaviour itself.
    count : mapping of name to int
        For each name, the number of nodes whose IRI contains the name.
    now : Update
        The update that is being compiled.
    """

    behavior: str
    said: dict[str, Properties] = field(default_factory=dict)
    places: dict[str, TextPosition] = field(default_factory=dict)
    links: Properties = field(default_factory=lambda: {"parameter": [], "precondition": [], "postcondition": []})
    count: dict[str, int] = field(default_factory=dict)
    now: Update = field(default_factory=lambda: Update("", "", {}))

    def new(self, name: str, kind: str, at: int) -> str:
        """Return the IRI of a new node, which consists of the behaviour's IRI, `name` and a number."""
        self.count[name] = self.count.get(name, 0) + 1
        node = f"{self.behavior}.{name}{self.count[name]:03}"
        self.said[node] = {TYPE: [INDIVIDUAL, CORE + kind]}
        self.places[node] = self.now.place(at)
        return node

    def condition(self, kind: str, at: int, properties: Properties, negated: bool = False) -> str:
        """Return the IRI of a new condition node with the given properties."""
        node = self.new("condition", kind, at)
        self.said[node] |= properties
        if negated:
            self.negate(node)
        return node

    def negate(self, node: str) -> None:
        """Negate a condition or effect; the negation of a negated node is positive."""
        if self.said[node].pop("negated", None) is None:
            self.said[node]["negated"] = ["true"]

    def triples(self) -> Iterator[ox.Triple]:
        """Yield the triples of the behaviour and of all its nodes."""
        for node, properties in [(self.behavior, self.links), *self.said.items()]:
            yield from triples(ox.NamedNode(node), properties)
