"""OWL 2 RL inference before planning, which adds inferred triples to the graph `inferred`.

Only static facts are inferred. Facts of situation types are excluded, because behaviours change these facts; only the domains and
ranges of their properties are used. The members of a class that is defined by situations aren't inferred; the class is compiled
into conditions (`confab.reasoner.reading.definitions`).

Subclasses are read without inference. The reasoner runs only if `needed` finds axioms, besides subclass axioms, that have
consequences. The limits of RL are listed in docs/inference.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import BASE, KnowledgeError, KnowledgeGraph, text
from confab.reasoner.names import local_name
from confab.reasoner.vocabulary import CORE, OWL, RDF, RDFS

TYPE, SAME, SUBCLASS = ox.NamedNode(RDF + "type"), OWL + "sameAs", RDFS + "subClassOf"
GIVEN = ("asserted", "reach")
WORLD = {CORE + name for name in ("Object", "Robot", "Hand")}
"""Core classes of physical objects; the other core classes describe behaviours and are excluded from inference."""

NEEDED = """
ASK {
  { VALUES ?axiom { owl:equivalentClass owl:intersectionOf owl:unionOf owl:someValuesFrom owl:allValuesFrom owl:hasValue
                    owl:hasKey owl:sameAs }
    ?subject ?axiom ?object . FILTER(?subject != :Truth) }
  UNION { ?relation a/rdfs:subClassOf* :Relation ;
            a|owl:inverseOf|^owl:inverseOf|^rdfs:subPropertyOf|owl:equivalentProperty ?more .
          FILTER(?more IN (owl:TransitiveProperty, owl:SymmetricProperty)
                 || EXISTS { ?more a owl:ObjectProperty }) }
}"""
CHANGING = "SELECT DISTINCT ?property WHERE { ?situation :valueProperty ?property }"
RELATIONS = "SELECT DISTINCT ?property WHERE { ?property a/rdfs:subClassOf* :Relation }"
CLASSES = "SELECT DISTINCT ?class WHERE { ?class a owl:Class . FILTER(isIRI(?class)) }"
PARTS_OF_DEFINITIONS = """
SELECT DISTINCT ?class ?part WHERE {
  ?class owl:equivalentClass/owl:intersectionOf/rdf:rest*/rdf:first ?part . FILTER(isIRI(?class) && isIRI(?part))
}"""
TYPED_BY_FACTS = """
SELECT DISTINCT ?individual ?class WHERE {
  ?situation :valueProperty ?property . ?subject ?property ?object .
  { ?property rdfs:domain ?class . BIND(?subject AS ?individual) } UNION
  { ?property rdfs:range ?class . BIND(?object AS ?individual) }
  FILTER(isIRI(?class))
}"""


def needed(graph: KnowledgeGraph) -> bool:
    """Return whether the ontology has axioms, besides subclass axioms, from which facts follow."""
    return bool(graph.query(NEEDED, GIVEN))


def infer(graph: KnowledgeGraph, *, always: bool = False) -> int:
    """Write the inferences of OWL 2 RL into the graph `inferred`, and return the number of new triples.

    Inferences are restricted to types, subclasses and rows of static relations.

    Parameters
    ----------
    graph : KnowledgeGraph
        The knowledge graph, whose graph `inferred` is cleared first.
    always : bool
        Whether to run the reasoner in any case, even if `needed` returns False.

    Raises
    ------
    KnowledgeError
        Two individuals would be identical, because both are values of a functional property.
    """
    graph.store.clear_graph(ox.NamedNode(BASE + "inferred"))
    if not always and not needed(graph):
        return 0
    changing = _iris(graph, CHANGING)
    relations, classes = _iris(graph, RELATIONS) - changing, _iris(graph, CLASSES)
    found = []
    for subject, predicate, value in _reason(_static(graph, changing)):
        if predicate == SAME and subject < value:
            _refuse_merging(graph, subject, value)
        if (predicate in (TYPE.value, SUBCLASS) and value in classes) or predicate in relations:
            found.append((subject, predicate, value))
    found += [(text(kind), SUBCLASS, text(part)) for kind, part in graph.select(PARTS_OF_DEFINITIONS, GIVEN)]
    new = [triple for triple in found if not _stated(graph, triple) and triple[0] != triple[2]]
    graph.add("inferred", new)
    return len(new)


def _iris(graph: KnowledgeGraph, query: str) -> set[str]:
    return {term.value for (term,) in graph.select(query, GIVEN) if isinstance(term, ox.NamedNode)}


def _static(graph: KnowledgeGraph, changing: set[str]) -> Iterator[ox.Triple]:
    """Yield the triples for the reasoner: all triples except literals, behaviours, and facts that may change."""
    for name in GIVEN:
        for quad in graph.store.quads_for_pattern(None, None, None, ox.NamedNode(BASE + name)):
            predicate = quad.predicate.value
            if isinstance(quad.object, ox.Literal) or predicate in changing or predicate.startswith(CORE):
                continue
            iri = quad.object.value if isinstance(quad.object, ox.NamedNode) else ""
            if not iri.startswith(CORE) or iri in WORLD:
                yield quad.triple
    for individual, kind in graph.select(TYPED_BY_FACTS, GIVEN):
        if isinstance(individual, ox.NamedNode) and isinstance(kind, ox.NamedNode):
            yield ox.Triple(individual, TYPE, kind)


def _reason(triples: Iterator[ox.Triple]) -> Iterator[tuple[str, str, str]]:
    """Yield the triples in the OWL 2 RL closure of given triples; only triples of IRIs are yielded."""
    import tempfile

    import reasonable

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "static.ttl"  # every N-Triples text is a Turtle text
        file.write_bytes(ox.serialize(triples, format=ox.RdfFormat.N_TRIPLES) or b"")
        reasoner = reasonable.PyReasoner()
        reasoner.load_file(str(file))
        for triple in reasoner.reason():
            if all(type(term).__name__ == "URIRef" for term in triple):
                yield tuple(map(str, triple))  # type: ignore[misc]


def _stated(graph: KnowledgeGraph, triple: tuple[str, str, str]) -> bool:
    subject, predicate, value = map(ox.NamedNode, triple)
    return any(ox.Quad(subject, predicate, value, ox.NamedNode(BASE + name)) in graph.store for name in GIVEN)


def _refuse_merging(graph: KnowledgeGraph, one: str, other: str) -> None:
    same = ox.NamedNode(SAME)
    stated = [(ox.NamedNode(a), same, ox.NamedNode(b)) for a, b in ((one, other), (other, one))]
    if not any(next(graph.store.quads_for_pattern(*pair, None), None) for pair in stated):
        raise KnowledgeError(
            f"{local_name(one)} and {local_name(other)} would be one individual, because a functional property has both as its "
            "values; drop one of the two facts, or state that the individuals are different, so that a reasoner finds the conflict"
        )
