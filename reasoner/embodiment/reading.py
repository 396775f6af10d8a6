"""From the knowledge graph to `reasoner.embodiment.values`: bodies, places, robots, and who carries out and perceives what.

The vocabulary is that of ``ontology/embodiment.ttl``. Attributes are read in one query (every data property below
``:attribute``), links in another; the rest is looking them up.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyoxigraph as ox

import ontology
from reasoner.embodiment.values import (
    Body,
    Color,
    Embodiment,
    Filling,
    Fixture,
    Hand,
    PerceiverUse,
    Place,
    Robot,
    Shape,
    SkillUse,
    Vector,
)
from reasoner.graph.knowledge import KnowledgeError
from reasoner.names import local_name
from reasoner.vocabulary import CORE, EMBODIMENT, OWL, RDFS

PREFIXES = {
    "": EMBODIMENT,
    "c": CORE,
    "owl": OWL,
    "rdfs": RDFS,
}
ATTRIBUTES = (
    "SELECT DISTINCT ?node ?property ?value WHERE { ?property rdfs:subPropertyOf+ :attribute . ?node ?property ?value }"
)
LINKS = """
SELECT DISTINCT ?node ?property ?value WHERE {
  { VALUES ?property { :shape :profilePoint :skill :role :perceiver :adjusts c:handOf c:parameter } }
  UNION { ?property rdfs:subPropertyOf :specialValue }
  ?node ?property ?value
} ORDER BY ?node ?property ?value"""
VARIABLES = """
SELECT DISTINCT ?behavior ?term WHERE {
  ?behavior (c:precondition|c:postcondition)/(c:condition|c:alternative|c:when)*/(c:about|c:value|c:argument2|c:witness) ?term .
  ?term a c:Variable ; :role ?role
} ORDER BY ?behavior ?term"""
TYPES = """
SELECT DISTINCT ?node ?class WHERE {
  ?node a owl:NamedIndividual, ?class . FILTER(!STRSTARTS(STR(?class), STR(owl:)))
} ORDER BY ?node ?class"""
SUPERS = """
SELECT DISTINCT ?sub ?super WHERE {
  ?sub rdfs:subClassOf ?super . FILTER(isIRI(?sub) && isIRI(?super))
} ORDER BY ?sub ?super"""
INDICES = "SELECT DISTINCT ?node ?index WHERE { ?node c:index ?index }"

PALETTE: tuple[Color, ...] = (
    (0.95, 0.50, 0.10, 1.0),
    (0.80, 0.12, 0.28, 1.0),
    (0.95, 0.93, 0.88, 1.0),
    (0.35, 0.20, 0.10, 1.0),
    (0.20, 0.55, 0.90, 1.0),
    (0.55, 0.75, 0.20, 1.0),
)
"""Colours of beverages that declare none, in their order."""

GREY = "0.7 0.7 0.7 1"


class EmbodimentError(KnowledgeError):
    """What the ontology says about bodies can't be used; the message says what, where, and what to do."""


def read_embodiment(
    store: ox.Store, names: Callable[[str], str], folders: Sequence[Path] = (ontology.ROOT,)
) -> Embodiment:
    """Return what the graph says about bodies.

    Parameters
    ----------
    store : pyoxigraph.Store
        The scene with all that it imports; named graphs are read as one.
    names : callable
        From an IRI to the short name that plans use.
    folders : sequence of Path
        Where a robot's URDF file is looked for.

    Raises
    ------
    EmbodimentError
        An attribute is missing or of the wrong kind, or a file isn't there.
    """
    facts = _Facts.read(store)
    return Embodiment(
        robots=tuple(_robot(facts, node, names, folders) for node in facts.ordered(facts.having("urdf"))),
        fixtures=tuple(_fixture(facts, node, names) for node in facts.members("Fixture")),
        places={names(node): Place(names(node), _position(facts, node)) for node in _places(facts)},
        bodies={names(node): _body(facts, node, shape, names) for node, shape in _shaped(facts)},
        fillings=_fillings(facts, names),
        skills=_skills(facts, names, store),
        perceivers=_perceivers(facts, names),
    )


# ----------------------------------------------------------------------------------------------- the graph, looked up


@dataclass(frozen=True)
class _Facts:
    """Attributes, links, classes and indices by node (an IRI)."""

    attributes: Mapping[str, Mapping[str, str]]
    links: Mapping[str, Mapping[str, Sequence[str]]]
    classes: Mapping[str, Sequence[str]]
    supers: Mapping[str, Sequence[str]]
    indices: Mapping[str, int]

    @classmethod
    def read(cls, store: ox.Store) -> _Facts:
        attributes: dict[str, dict[str, str]] = defaultdict(dict)
        links: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
        for node, name, value in _rows(store, ATTRIBUTES):
            attributes[node][_snake(local_name(name))] = value
        for node, name, value in _rows(store, LINKS):
            links[node][_snake(local_name(name))].append(value)
        indices = {node: int(index) for node, index in _rows(store, INDICES)}
        return cls(attributes, links, _grouped(_rows(store, TYPES)), _grouped(_rows(store, SUPERS)), indices)

    def text(self, node: str, name: str, default: str | None = None) -> str:
        """Return an attribute's text, or raise that it's missing."""
        value = self.attributes.get(node, {}).get(name, default)
        if value is None:
            raise EmbodimentError(f"{node} has no :{_camel(name)} (see ontology/embodiment.ttl)")
        return value

    def number(self, node: str, name: str, default: float | None = None) -> float:
        """Return an attribute's number."""
        return self.numbers(node, name, None if default is None else str(default))[0]

    def numbers(self, node: str, name: str, default: str | None = None) -> tuple[float, ...]:
        """Return the numbers of an attribute that lists some."""
        value = self.text(node, name, default)
        try:
            return tuple(float(word) for word in value.split())
        except ValueError:
            raise EmbodimentError(f"{node} has :{_camel(name)} '{value}'; wanted numbers") from None

    def all_numbers(self, node: str) -> dict[str, float]:
        """Return all of a node's attributes that are numbers."""
        found = {}
        for name, value in self.attributes.get(node, {}).items():
            try:
                found[name] = float(value)
            except ValueError:
                continue
        return found

    def having(self, attribute: str) -> list[str]:
        """Return the nodes that have an attribute."""
        return [node for node, values in self.attributes.items() if attribute in values]

    def linked(self, node: str, name: str) -> Sequence[str]:
        """Return what a node is linked to."""
        return self.links.get(node, {}).get(name, ())

    def ordered(self, nodes: Iterable[str]) -> list[str]:
        """Return nodes by index, those without one last, then by IRI."""
        return sorted(nodes, key=lambda node: (self.indices.get(node, 10**9), node))

    def members(self, class_name: str) -> list[str]:
        """Return the individuals of a class of the vocabulary."""
        return self.ordered(n for n, kinds in self.classes.items() if PREFIXES[""] + class_name in kinds)

    def nearest_first(self, node: str) -> list[str]:
        """Return a node, its classes and their superclasses, from the nearest to the most general."""
        found = [node]
        layer = list(self.classes.get(node, ()))
        while layer:
            found += [kind for kind in layer if kind not in found]
            layer = [up for kind in layer for up in self.supers.get(kind, ()) if up not in found]
        return found


def _rows(store: ox.Store, query: str) -> list[tuple[str, ...]]:
    solutions = store.query(query, prefixes=PREFIXES, use_default_graph_as_union=True)
    if not isinstance(solutions, ox.QuerySolutions):
        raise TypeError("a SELECT query gives solutions")
    return [tuple("" if term is None else term.value for term in row) for row in solutions]


def _grouped(rows: Iterable[tuple[str, ...]]) -> Mapping[str, list[str]]:
    groups: dict[str, list[str]] = defaultdict(list)
    for key, value in rows:
        groups[key].append(value)
    return groups


def _snake(name: str) -> str:
    """Return ``uprightAngle`` as ``upright_angle``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def _camel(name: str) -> str:
    head, *tail = name.split("_")
    return head + "".join(word.capitalize() for word in tail)


# ----------------------------------------------------------------------------------------------- bodies


def _position(facts: _Facts, node: str) -> Vector:
    return (facts.number(node, "x"), facts.number(node, "y"), facts.number(node, "z"))


def _color(facts: _Facts, node: str, default: str = GREY) -> Color:
    numbers = facts.numbers(node, "color", default)
    if len(numbers) != 4:
        raise EmbodimentError(f"{node} has :color {numbers}; wanted red, green, blue and opacity")
    return (numbers[0], numbers[1], numbers[2], numbers[3])


def _fixture(facts: _Facts, node: str, names: Callable[[str], str]) -> Fixture:
    size = (facts.number(node, "size_x"), facts.number(node, "size_y"), facts.number(node, "size_z"))
    yaw, friction = facts.number(node, "yaw", 0.0), facts.number(node, "friction", 0.8)
    return Fixture(names(node), size, _position(facts, node), yaw, _color(facts, node), friction)


def _places(facts: _Facts) -> list[str]:
    """Return what has coordinates and is neither furniture nor robot."""
    other = {*facts.members("Fixture"), *facts.having("urdf")}
    return facts.ordered(node for node in facts.having("x") if node not in other)


def _shaped(facts: _Facts) -> list[tuple[str, str]]:
    """Return individuals that have a shape, by themselves or by their nearest class that has one."""
    found = []
    for node in facts.ordered(facts.classes):
        if node in facts.supers or any(node in kinds for kinds in facts.classes.values()):
            continue
        shapes = [shape for kind in facts.nearest_first(node) for shape in facts.linked(kind, "shape")]
        if shapes:
            found.append((node, shapes[0]))
    return found


def _body(facts: _Facts, node: str, shape: str, names: Callable[[str], str]) -> Body:
    numbers = facts.all_numbers(shape)
    profile = sorted(
        (facts.number(point, "height"), facts.number(point, "inner_radius"))
        for point in facts.linked(shape, "profile_point")
    )
    return Body(
        names(node),
        Shape(
            facts.text(shape, "kind"),
            facts.number(shape, "mass"),
            facts.number(shape, "grasp_height"),
            tuple(profile),
            {name: numbers[name] for name in ("wall", "radius", "height", "width", "depth") if name in numbers},
            _color(facts, shape),
            facts.number(shape, "friction", 0.8),
        ),
        facts.number(node, "servings", facts.number(shape, "servings", 1.0)),
    )


def _fillings(facts: _Facts, names: Callable[[str], str]) -> dict[str, Filling]:
    """Return how each beverage looks: what its nearest class says, or it itself."""
    found: dict[str, Filling] = {}
    for node in facts.ordered(facts.classes):
        kinds = [kind for kind in facts.nearest_first(node) if "serving_beads" in facts.attributes.get(kind, {})]
        if not kinds or node in facts.supers or node == kinds[0] != node:
            continue
        if kinds[0] == node and any(node in classes for classes in facts.classes.values()):
            continue
        kind, color = kinds[0], PALETTE[len(found) % len(PALETTE)]
        found[names(node)] = Filling(
            names(node),
            int(facts.number(kind, "serving_beads")),
            facts.number(kind, "bead_radius"),
            facts.number(kind, "bead_mass"),
            facts.number(kind, "bead_friction"),
            _color(facts, node, " ".join(str(part) for part in color)),
        )
    return found


# ----------------------------------------------------------------------------------------------- robots


def _robot(facts: _Facts, node: str, names: Callable[[str], str], folders: Sequence[Path]) -> Robot:
    file = Path(facts.text(node, "urdf"))
    found = next((folder / file for folder in folders if (folder / file).is_file()), None)
    if found is None:
        places = ", ".join(str(folder) for folder in folders)
        raise EmbodimentError(f"{node} has :urdf '{file}', which is in none of: {places}")
    hands = facts.ordered(hand for hand, links in facts.links.items() if node in links.get("hand_of", ()))
    return Robot(
        names(node),
        str(found),
        tuple(_hand(facts, hand, names) for hand in hands),
        _position(facts, node),
        facts.number(node, "yaw", 0.0),
        facts.number(node, "acceleration"),
    )


def _hand(facts: _Facts, node: str, names: Callable[[str], str]) -> Hand:
    arm, home = tuple(facts.text(node, "arm_joints").split()), facts.numbers(node, "home_posture")
    if len(arm) != len(home):
        raise EmbodimentError(f"{node} has {len(arm)} :armJoints and {len(home)} angles in :homePosture")
    return Hand(
        names(node),
        facts.text(node, "tip"),
        arm,
        tuple(facts.text(node, "finger_joints").split()),
        home,
        facts.number(node, "opening"),
        facts.number(node, "grip"),
    )


# ----------------------------------------------------------------------------------------------- skills and perceivers


def _settings(facts: _Facts, general: str, special: str) -> dict[str, float]:
    """Return the numbers of a skill or perceiver, those of who uses it before them, adjustments before both."""
    settings = facts.all_numbers(general) | facts.all_numbers(special)
    for node in sorted(node for node, links in facts.links.items() if special in links.get("adjusts", ())):
        settings |= facts.all_numbers(node)
    return settings


def _skills(facts: _Facts, names: Callable[[str], str], store: ox.Store) -> dict[str, SkillUse]:
    variables = _grouped(_rows(store, VARIABLES))
    roles = {term: local_name(links["role"][0]) for term, links in facts.links.items() if "role" in links}
    found = {}
    for behavior in facts.ordered(node for node, links in facts.links.items() if "skill" in links):
        skill = facts.linked(behavior, "skill")[0]
        parameters = facts.ordered(facts.linked(behavior, "parameter"))
        found[names(behavior)] = SkillUse(
            names(behavior),
            local_name(skill),
            tuple(roles.get(parameter, "") for parameter in parameters),
            {local_name(term).rsplit(".", 1)[-1]: roles[term] for term in variables.get(behavior, ())},
            _settings(facts, skill, behavior),
        )
    return found


def _perceivers(facts: _Facts, names: Callable[[str], str]) -> dict[str, PerceiverUse]:
    found = {}
    for situation in facts.ordered(node for node, links in facts.links.items() if "perceiver" in links):
        perceiver = facts.linked(situation, "perceiver")[0]
        special = {
            name.removeprefix("value_"): names(values[0])
            for name, values in facts.links[situation].items()
            if name.startswith("value_")
        }
        choices = [node for node in facts.ordered(facts.classes) if situation in facts.nearest_first(node)[1:]]
        found[names(situation)] = PerceiverUse(
            names(situation),
            local_name(perceiver),
            _settings(facts, perceiver, situation),
            special,
            tuple(map(names, choices)),
        )
    return found
