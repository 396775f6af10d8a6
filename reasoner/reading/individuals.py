"""Reading of the facts about some individuals, by queries whose cost doesn't depend on the size of the scene."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import chain

import pyoxigraph as ox

from confab.reasoner.closure import closure
from confab.reasoner.condition_nodes import NodeValues
from confab.reasoner.graph.knowledge import SCENE, KnowledgeGraph, text
from confab.reasoner.limits import checked
from confab.reasoner.reading.frame import Frame
from confab.reasoner.reading.rows import FIRST_INDEX_OF_NONE, Member, OntologySchema, Triple, index_of, link, stated
from confab.reasoner.reading.swrl import SWRL
from confab.reasoner.vocabulary import ARGUMENTS, CORE, INDIVIDUAL, OWL, RDF, TYPE

PLACES = (*(CORE + name for name in ARGUMENTS), CORE + "value")
"""Properties that lead from the node of a fact to the individuals of this fact."""
NO_IRI = re.compile(r'[\x00-\x20<>"{}|^`\\]')
INDEX = CORE + "index"
FACT = CORE + "SituatedObjectInstance"
RECOGNISING = "recognising the relevant part of the scene"
"""The work in progress, in the message of an error at the time limit."""


class Individuals:
    """The facts about individuals that have been read so far.

    Attributes
    ----------
    triples : ordered set of triples
        All facts about the individuals in `seen`, and some facts about other individuals: the facts that a query for their values
        has found.
    seen : set of individuals
    """

    def __init__(self, graph: KnowledgeGraph, schema: OntologySchema) -> None:
        self.graph, self.schema = graph, schema
        self.subclasses: dict[str, list[str]] = {}
        for kind, supers in schema.supers.items():
            for above in supers:
                self.subclasses.setdefault(above, []).append(kind)
        self.triples: dict[Triple, None] = {}
        self.seen: set[str] = set()
        values = (prop for node in schema.nodes.values() for prop in node.get(CORE + "valueProperty", ()))
        of_facts = (CORE + "situationType", CORE + "relation")
        self.links = {*PLACES, *of_facts, *values, *schema.nodes}  # properties of facts

    def visit(
        self, individuals: set[str], back: Mapping[str, set[str]] | None = None, classes: Iterable[str] = ()
    ) -> list[Triple]:
        """Read and return triples about individuals, about members of classes, and about subjects of property values.

        The keys of `back` are properties, and its values are the individuals that are the values of these properties.
        """
        parts = [f"{{ VALUES ?s {{ {values_of(individuals)} }} ?s ?p ?o }}"] if individuals else []
        for name, targets in (back or {}).items():
            if not targets:
                continue
            if name in PLACES:
                parts.append(
                    f"{{ VALUES ?x {{ {values_of(targets)} }} ?s <{name}> ?x ; ?p ?o . ?s a :SituatedObjectInstance }}"
                )
            else:
                parts.append(
                    f"{{ SELECT ?s (<{name}> AS ?p) ?o WHERE {{ VALUES ?o {{ {values_of(targets)} }} ?s <{name}> ?o }} }}"
                )
        for kind in classes:
            parts.append(f"{{ ?s a owl:NamedIndividual ; a/rdfs:subClassOf* <{kind}> ; ?p ?o }}")
        rows, unnamed = list[Triple](), dict[str, list[Triple]]()
        links, nodes, numbers = self.links, self.schema.nodes, self.schema.numbers
        query = "SELECT ?s ?p ?o WHERE {\n  " + "\n  UNION ".join(parts) + " }"
        for s, p, o in checked(self.graph.solutions(query, SCENE), RECOGNISING):
            subject, said = text(s), text(p)
            names = isinstance(o, ox.NamedNode)
            if said in numbers:
                rows.append(stated((s, p, o), numbers))
                continue
            if not names and said in links and subject not in nodes:
                link((s, p, o), blank=isinstance(o, ox.Literal) and said.startswith(CORE))  # raises an error
            if names or (isinstance(o, ox.Literal) and said != TYPE):
                of = rows if isinstance(s, ox.NamedNode) else unnamed.setdefault(subject, [])
                of.append((subject, said, text(o)))
        rows += [row for node in unnamed.values() if any(row[1:] == (TYPE, FACT) for row in node) for row in node]
        self.triples.update(dict.fromkeys(rows))
        kinds = self.below(classes)
        self.seen |= individuals | {s for s, p, o in rows if p == TYPE and o in kinds}
        return rows

    def below(self, classes: Iterable[str]) -> set[str]:
        """Return some classes and all their subclasses."""
        return closure(classes, lambda kind: self.subclasses.get(kind, ()))

    def members(self) -> list[Member]:
        """Return a row for each class of each individual that has been read: individual, class, and index of the individual."""
        named = set[str]()
        kinds: list[tuple[str, str]] = []
        indices: dict[str, int] = {}
        for s, p, o in self.triples:
            if p == TYPE and o == INDIVIDUAL:
                named.add(s)
            elif p == TYPE and not o.startswith(OWL):
                kinds.append((s, o))
            elif p == INDEX:
                indices[s] = min(index_of(s, o), indices.get(s, FIRST_INDEX_OF_NONE))
        named &= self.seen
        return [(s, kind, indices.get(s, FIRST_INDEX_OF_NONE)) for s, kind in kinds if s in named]

    def facts(self, known: Frame) -> list[Triple]:
        """Return the facts of value properties and relations between individuals in `seen`."""
        wanted, seen, numbers = known.properties.keys() | self.schema.nodes.keys(), self.seen, self.schema.numbers
        return [(s, p, o) for s, p, o in self.triples if p in wanted and s in seen and (o in seen or p in numbers)]

    def tuples(self) -> dict[str, NodeValues]:
        """Return the facts that are nodes and mention only individuals in `seen`."""
        nodes = self.schema.nodes
        facts = (
            {s for s, p, o in self.triples if p == TYPE and o == FACT} - nodes.keys() if self.schema.tuples else set()
        )
        found: dict[str, dict[str, list[str]]] = {}
        for s, p, o in sorted(triple for triple in self.triples if triple[0] in facts):
            found.setdefault(s, {}).setdefault(p, []).append(o)
        return {
            s: node
            for s, node in found.items()
            if all(o in self.seen for p in PLACES for o in node.get(p, ()) if o not in nodes)
        }


def values_of(iris: Iterable[str]) -> str:
    """Return the valid IRIs among `iris` in the notation of a VALUES clause."""
    return " ".join(f"<{iri}>" for iri in iris if not NO_IRI.search(iri))


def constants_of(schema: OntologySchema) -> set[str]:
    """Return the individuals in the conditions, effects and definitions of a schema, its actors, rest values and default values."""
    goals = goal_conditions(schema)
    names = (*PLACES, CORE + "restValue", CORE + "defaultValue", CORE + "actor")
    found = {v for iri, node in schema.nodes.items() if iri not in goals for name in names for v in node.get(name, ())}
    named = (OWL + "hasValue", RDF + "first")
    found |= {v for node in schema.expressions.values() for name in named for v in node.get(name, ()) if ":" in v}
    if schema.swrl:
        known = {*schema.swrl, *schema.supers, *chain.from_iterable(schema.supers.values())}
        said = (*named, *(SWRL + f"argument{place}" for place in (1, 2)))
        found |= {v for node in schema.swrl.values() for name in said for v in node.get(name, ()) if ":" in v} - known
    return (found - set(schema.nodes) - schema.individuals_of) | {CORE + "true", CORE + "false"}


def goal_conditions(schema: OntologySchema) -> set[str]:
    """Return the nodes of all goals of tasks."""
    return {iri for node in schema.nodes.values() for iri in node.get(CORE + "goal", ())}
