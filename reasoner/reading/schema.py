"""Reading of the part of an ontology that doesn't depend on individuals: behaviours, situation types, classes and definitions."""

from __future__ import annotations

from collections import defaultdict

from confab.reasoner.graph.knowledge import SCENE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.limits import checked
from confab.reasoner.reading import swrl
from confab.reasoner.reading.definitions import AXIOMS, EXPRESSIONS
from confab.reasoner.reading.rows import (
    HIGHEST_LEVEL,
    OntologySchema,
    core_triple,
    nodes_of,
    superclasses,
    whole_number,
)
from confab.reasoner.vocabulary import CORE, EMBODIMENT

TEXTS = tuple(CORE + name for name in ("update", "extends", "construct"))
"""Properties whose values are texts of updates and queries."""
# core classes of the schema's nodes
KINDS = (
    "SituationType",
    "Behavior",
    "Term",
    "Condition",
    "Effect",
    "Level",
    "Span",
    "Task",
    "Relation",
    "Calculation",
    "Rule",
    "Window",
)
SCHEMA = f"""
SELECT DISTINCT ?part ?node ?property ?value WHERE {{
  {{ VALUES ?kind {{ {" ".join(":" + kind for kind in KINDS)} }}
    ?node a/rdfs:subClassOf* ?kind ; ?property ?value . BIND("node" AS ?part) }}
  UNION {{ ?node rdfs:subClassOf ?value . FILTER(isIRI(?node) && isIRI(?value))
    FILTER NOT EXISTS {{ VALUES ?kind {{ {" ".join(":" + kind for kind in KINDS)} }} ?node rdfs:subClassOf* ?kind }}
    BIND("class" AS ?part) BIND(rdfs:subClassOf AS ?property) }}
  UNION {{ ?node :hasSituationType ?value . BIND("owner" AS ?part) BIND(:hasSituationType AS ?property) }}
  UNION {{ ?node :valueProperty ?property . FILTER NOT EXISTS {{ ?property a owl:FunctionalProperty }}
    BIND("pair" AS ?part) BIND(?property AS ?value) }}
  UNION {{ ?node :valueProperty/rdfs:range ?value . FILTER(?value IN (xsd:integer, xsd:decimal))
    BIND("range" AS ?part) BIND(rdfs:range AS ?property) }}
  UNION {{ ?node <{EMBODIMENT}perceiver>/<{EMBODIMENT}exclusive> ?value .
    BIND("exclusive" AS ?part) BIND(<{EMBODIMENT}exclusive> AS ?property) }}
  UNION {{ ?node :fromLevel ?value . BIND("level" AS ?part) BIND(:fromLevel AS ?property) }}
  UNION {{ ?node a :SituatedObjectInstance ; ?property ?value .
    FILTER NOT EXISTS {{ ?node :about ?object }} BIND("fact" AS ?part) }}
  UNION {{ {{ SELECT ?node WHERE {{ ?node a :SituatedObjectInstance ; :about ?object }} LIMIT 1 }}
    BIND("tuples" AS ?part) BIND(rdf:type AS ?property) BIND(:SituatedObjectInstance AS ?value) }}
  UNION {{ ?node a owl:Ontology . BIND("ontology" AS ?part) BIND(rdf:type AS ?property) BIND(owl:Ontology AS ?value) }}
  UNION {{ {EXPRESSIONS} BIND("expression" AS ?part) }}
  UNION {{ {AXIOMS} BIND("axiom" AS ?part) }}
  UNION {{ {swrl.RULES} BIND("swrl" AS ?part) }}
}}"""
"""Query for the rows that every planning call in a world needs; a row with the part ``tuples`` tells that some facts are nodes.

The query has no ORDER BY, because a store needs more time to sort the rows than to find them. Results are sorted where the order
matters (`nodes_of`, `classes_of`, `initial_state`).
"""


def read_schema(graph: KnowledgeGraph) -> OntologySchema:
    """Return the part of an ontology that doesn't depend on individuals, read by one query."""
    parts: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
    for part, *row in checked(graph.solutions(SCHEMA, SCENE), "reading the scene"):
        parts[text(part)].append(core_triple(row))
    written = [triple for triple in parts["node"] if graph.remote and triple[1] in TEXTS]
    if written:  # a remote store contains only the texts of updates
        from confab.reasoner.updates.compiling import compiled

        found = compiled(lambda query: graph.select(query, SCENE), {}, graph.prefixes)
        if found.faults:
            raise KnowledgeError(str(found.faults[0]))
        parts["node"] += [core_triple(triple) for triple in found.triples]  # type: ignore[arg-type]
    return OntologySchema(
        nodes=nodes_of(parts["node"]),
        supers=superclasses(sorted((sub, sup) for sub, _, sup in parts["class"])),
        owners=sorted((kind, situation) for kind, _, situation in parts["owner"]),
        pairs=frozenset(situation for situation, _, _ in parts["pair"])
        - {situation for situation, _, kind in parts["node"] if kind == CORE + "Amount"},
        whole=frozenset(situation for situation, _, kind in parts["range"] if kind.endswith("integer")),
        from_levels={
            value: whole_number(level, f"<{value}>: c:fromLevel", 0, HIGHEST_LEVEL)
            for value, _, level in parts["level"]
        },
        facts=nodes_of(parts["fact"]),
        tuples=bool(parts["tuples"]),
        expressions=nodes_of(parts["expression"]),
        axioms=nodes_of(parts["axiom"]),
        swrl=nodes_of(parts["swrl"]),
        ontologies=sorted(iri for iri, _, _ in parts["ontology"]),
        exclusive=frozenset(situation for situation, _, value in parts["exclusive"] if value in ("true", "1")),
    )
