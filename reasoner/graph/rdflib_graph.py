"""An rdflib view of a knowledge graph; additions and removals change both graphs."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import pyoxigraph as ox
import rdflib
from rdflib.plugins.stores.memory import Memory

from confab.reasoner.graph.knowledge import BASE, GRAPHS, KnowledgeError, KnowledgeGraph


def rdflib_graph(graph: KnowledgeGraph, edited: Callable[[], None]) -> rdflib.Graph:
    """Return a knowledge graph as an rdflib graph that forwards its changes; `edited` is called after each change.

    New triples are added to the graph `asserted`; removed triples are removed from all graphs. Inferences aren't updated.
    """
    store = _WriteThrough(graph, edited)
    found = rdflib.Graph(store)
    found.parse(data=graph.ntriples(), format="nt", bnode_context=_SameNames())
    for prefix, namespace in graph.prefixes.items():
        found.bind(prefix, namespace)
    store.writes = True
    return found


class _SameNames(dict[str, str]):
    """Identity mapping of blank node names, so that rdflib keeps the names of the knowledge graph."""

    def get(self, name: str, default: object = None) -> str:
        """Return the name itself."""
        return name


class _WriteThrough(Memory):
    """rdflib's store in memory, which forwards every change to the knowledge graph."""

    def __init__(self, graph: KnowledgeGraph, edited: Callable[[], None]) -> None:
        super().__init__()
        self.graph, self.edited, self.writes = graph, edited, False

    def add(self, triple: Any, context: Any, quoted: bool = False) -> None:
        """Add a triple to both graphs; raise `KnowledgeError` if the triple isn't valid RDF."""
        if self.writes:
            quad = _quad(self.graph, triple, "asserted")
            self.graph.store.add(quad)
            self.edited()
        super().add(triple, context, quoted)

    def remove(self, triple_pattern: Any, context: Any = None) -> None:
        """Remove the triples that match a pattern from both graphs."""
        gone = [triple for triple, _ in self.triples(triple_pattern, context)] if self.writes else []
        for triple in gone:
            for name in GRAPHS:
                self.graph.store.remove(_quad(self.graph, triple, name))
        super().remove(triple_pattern, context)
        if gone:
            self.edited()


def _quad(graph: KnowledgeGraph, triple: Any, name: str) -> ox.Quad:
    if graph.remote:
        raise KnowledgeError(f"{graph.scene}: a remote store is only read; change it with its own tools")
    try:
        subject, predicate, value = map(_term, triple)
        return ox.Quad(subject, predicate, value, ox.NamedNode(BASE + name))
    except (TypeError, ValueError) as error:
        raise KnowledgeError(f"{' '.join(map(str, triple))}: no triple of RDF, so it wasn't added: {error}") from error


def _term(term: Any) -> Any:
    match term:
        case rdflib.URIRef():
            return ox.NamedNode(str(term))
        case rdflib.BNode():
            return ox.BlankNode(str(term))
        case rdflib.Literal(language=str(language)):
            return ox.Literal(str(term), language=language)
        case rdflib.Literal(datatype=datatype):
            return ox.Literal(str(term), datatype=ox.NamedNode(str(datatype)) if datatype else None)
        case _:
            raise TypeError(f"{term!r} is no term")


@lru_cache(maxsize=10_000)
def rdflib_term(term: object) -> rdflib.term.Node:
    """Return a term of a knowledge graph as a term of rdflib."""
    match term:
        case ox.NamedNode(value=value):
            return rdflib.URIRef(value)
        case ox.BlankNode(value=value):
            return rdflib.BNode(value)
        case ox.Literal(value=value, language=None, datatype=datatype):
            return rdflib.Literal(value, datatype=rdflib.URIRef(datatype.value))
        case ox.Literal(value=value, language=language):
            return rdflib.Literal(value, lang=language)
        case _:
            raise TypeError(f"{term!r} is no term of RDF 1.1")
