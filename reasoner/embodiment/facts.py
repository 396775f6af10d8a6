"""The graph's statements about bodies as tables: attributes, links, classes and indices of each node.

The vocabulary is ``ontology/embodiment.ttl``. One query reads all attributes (data properties below ``:attribute``), and one
query reads all links. All further accesses to statements about bodies are lookups in tables.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.embodiment.values import Color, Vector
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import local_name
from confab.reasoner.reading.rows import index_of
from confab.reasoner.vocabulary import CORE, EMBODIMENT, OWL, RDFS

PREFIXES = {"": EMBODIMENT, "c": CORE, "owl": OWL, "rdfs": RDFS}
ATTRIBUTES = (
    "SELECT DISTINCT ?node ?property ?value WHERE { ?property rdfs:subPropertyOf+ :attribute . ?node ?property ?value }"
)
LINKS = """
SELECT DISTINCT ?node ?property ?value WHERE {
  { VALUES ?property { :reachedFrom } ?own rdfs:subPropertyOf ?property . ?node ?own ?value }
  UNION { VALUES ?property { :shape :profilePoint :skill :role :perceiver :adjusts :phase :part
      :feature :partOf :carriedBy :reachedFrom :touchesPart c:handOf c:parameter c:termType c:hasSituationType }
    ?node ?property ?value }
  UNION { ?property rdfs:subPropertyOf :specialValue . ?node ?property ?value }
} ORDER BY ?node ?property ?value"""
TYPES = """
SELECT DISTINCT ?node ?class WHERE {
  ?node a owl:NamedIndividual, ?class . FILTER(!STRSTARTS(STR(?class), STR(owl:)))
} ORDER BY ?node ?class"""
SUPERS = """
SELECT DISTINCT ?sub ?super WHERE {
  ?sub rdfs:subClassOf ?super . FILTER(isIRI(?sub) && isIRI(?super))
} ORDER BY ?sub ?super"""
INDICES = "SELECT DISTINCT ?node ?index WHERE { ?node c:index ?index }"

GREY = "0.7 0.7 0.7 1"


class EmbodimentError(KnowledgeError):
    """Raised if the ontology's description of a body is invalid; the message states the fault, its position and the remedy."""


@dataclass(frozen=True)
class BodyFacts:
    """Attributes, links, classes and indices of nodes, by the IRI of the node."""

    attributes: Mapping[str, Mapping[str, str]]
    links: Mapping[str, Mapping[str, Sequence[str]]]
    classes: Mapping[str, Sequence[str]]
    supers: Mapping[str, Sequence[str]]
    indices: Mapping[str, int]

    @classmethod
    def read(cls, store: ox.Store) -> BodyFacts:
        """Read the tables from a store."""
        attributes: dict[str, dict[str, str]] = defaultdict(dict)
        links: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
        for node, name, value in rows(store, ATTRIBUTES):
            attributes[node][snake(local_name(name))] = value
        for node, name, value in rows(store, LINKS):
            links[node][snake(local_name(name))].append(value)
        indices = {node: index_of(node, index) for node, index in rows(store, INDICES)}
        return cls(attributes, links, grouped(rows(store, TYPES)), grouped(rows(store, SUPERS)), indices)

    def text(self, node: str, name: str, default: str | None = None) -> str:
        """Return the text of an attribute, or `default`; raise `EmbodimentError` if both are missing."""
        value = self.attributes.get(node, {}).get(name, default)
        if value is None:
            raise EmbodimentError(f"{node} has no e:{camel(name)} (see ontology/embodiment.ttl)", node)
        return value

    def number(self, node: str, name: str, default: float | None = None) -> float:
        """Return the first number of an attribute."""
        return self.numbers(node, name, None if default is None else str(default))[0]

    def numbers(self, node: str, name: str, default: str | None = None) -> tuple[float, ...]:
        """Return all numbers in the text of an attribute."""
        value = self.text(node, name, default)
        try:
            return tuple(float(word) for word in value.split())
        except ValueError:
            raise EmbodimentError(f"{node} has e:{camel(name)} '{value}'; wanted numbers", node) from None

    def position(self, node: str, default: str | None = None) -> Vector:
        """Return the coordinates x, y and z of a node, in metres."""
        x, y, z = (self.numbers(node, name, default)[0] for name in ("x", "y", "z"))
        return (x, y, z)

    def turned(self, node: str) -> Vector:
        """Return roll, pitch and yaw of a node in radians, each 0 by default."""
        return (self.number(node, "roll", 0.0), self.number(node, "pitch", 0.0), self.number(node, "yaw", 0.0))

    def color(self, node: str, default: str = GREY) -> Color:
        """Return the colour of a node: red, green, blue and opacity."""
        numbers = self.numbers(node, "color", default)
        if len(numbers) != 4:
            raise EmbodimentError(f"{node} has e:color {numbers}; wanted red, green, blue and opacity", node)
        return (numbers[0], numbers[1], numbers[2], numbers[3])

    def file(self, node: str, name: str, folders: Sequence[Path]) -> str:
        """Return the path of the file that an attribute names, searched in the folders and in PyBullet's data."""
        file = self.text(node, name)
        installed = [place.parent for place in [pybullet_data()] if place]
        for folder in (*folders, *installed):
            if (folder / file).is_file():
                return str(folder / file)
        raise EmbodimentError(
            f"{node} has e:{camel(name)} '{file}', but this file isn't in {' or '.join(map(str, folders))}", node
        )

    def all_numbers(self, node: str) -> dict[str, float]:
        """Return all attributes of a node whose value is a number."""
        found = {}
        for name, value in self.attributes.get(node, {}).items():
            try:
                found[name] = float(value)
            except ValueError:
                continue
        return found

    def settings(self, general: str, special: str) -> dict[str, float]:
        """Return the settings of a skill for a behaviour, or the settings of a perceiver for a situation type.

        `general` is the skill or perceiver, and `special` is the behaviour or situation type. The numbers of `special` override the
        numbers of `general`; adjustments override both.
        """
        settings = self.all_numbers(general) | self.all_numbers(special)
        for node in sorted(node for node, links in self.links.items() if special in links.get("adjusts", ())):
            settings |= self.all_numbers(node)
        return settings

    def having(self, attribute: str) -> list[str]:
        """Return the nodes that have an attribute."""
        return [node for node, values in self.attributes.items() if attribute in values]

    def linked(self, node: str, name: str) -> Sequence[str]:
        """Return the nodes to which a property links a node."""
        return self.links.get(node, {}).get(name, ())

    def ordered(self, nodes: Iterable[str]) -> list[str]:
        """Return nodes sorted by index, then by IRI; nodes without an index come last."""
        return sorted(nodes, key=lambda node: (self.indices.get(node, 10**9), node))

    def members(self, class_name: str) -> list[str]:
        """Return the individuals of a class of the embodiment vocabulary and of its subclasses."""
        known, layer = {PREFIXES[""] + class_name}, {PREFIXES[""] + class_name}
        while layer:
            layer = {sub for sub, ups in self.supers.items() if layer & {*ups}} - known
            known |= layer
        return self.ordered(node for node, kinds in self.classes.items() if known & {*kinds})

    def nearest_first(self, node: str) -> list[str]:
        """Return a node, its classes and their superclasses, from the most specific to the most general."""
        found = [node]
        layer = list(self.classes.get(node, ()))
        while layer:
            found += [kind for kind in layer if kind not in found]
            layer = [up for kind in layer for up in self.supers.get(kind, ()) if up not in found]
        return found


def rows(store: ox.Store, query: str) -> list[tuple[str, ...]]:
    """Return the rows of a SELECT query as text."""
    solutions = store.query(query, prefixes=PREFIXES, use_default_graph_as_union=True)
    if not isinstance(solutions, ox.QuerySolutions):
        raise TypeError("a SELECT query gives solutions")
    return [tuple("" if term is None else term.value for term in row) for row in solutions]


def grouped(rows: Iterable[tuple[str, ...]]) -> Mapping[str, list[str]]:
    """Return a mapping of each first element of the pairs to the list of its second elements."""
    groups: dict[str, list[str]] = defaultdict(list)
    for key, value in rows:
        groups[key].append(value)
    return groups


def snake(name: str) -> str:
    """Return a camel-case name in snake case: ``upright_angle`` for ``uprightAngle``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def camel(name: str) -> str:
    """Return a snake-case name in camel case: ``uprightAngle`` for ``upright_angle``."""
    head, *tail = name.split("_")
    return head + "".join(word.capitalize() for word in tail)


def pybullet_data() -> Path | None:
    """Return the folder of PyBullet's robots and meshes, or None if the package isn't installed."""
    found = find_spec("pybullet_data")
    return Path(found.origin).parent if found and found.origin else None
