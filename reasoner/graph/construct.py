"""Storage of a CONSTRUCT query's result as an ontology that imports the queried scene."""

from __future__ import annotations

from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.files import as_iri_part, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.graph.query_process import QueryLimits, ask
from confab.reasoner.kinds import CONSTRUCTED, stamped
from confab.reasoner.vocabulary import OWL, RDF


def write_construct(graph: KnowledgeGraph, query: str, path: Path, limits: QueryLimits | None = None) -> int:
    """Write the triples that a CONSTRUCT query returns to a Turtle file, and return their number.

    The file is an ontology that imports the scene, and is a scene itself. The ontology's IRI is the scene's IRI with
    the file's name as the last part.

    Raises
    ------
    KnowledgeError
        The query isn't SPARQL, or its result is empty or doesn't consist of triples.
    LimitError
        The query exceeds the limits of `confab.reasoner.graph.query_process.ask`.
    """
    name = ox.NamedNode(f"{graph.scene.rstrip('#/').rsplit('/', 1)[0]}/{as_iri_part(path.stem)}")
    kind, _, answer = ask(graph, query, limits)
    if kind != "triples":
        raise KnowledgeError(
            "wanted a CONSTRUCT query, whose answer is triples; a file of another kind takes the rows of a SELECT"
        )
    found = sorted({ox.Triple(*triple) for triple in answer}, key=str)
    if not found:
        raise KnowledgeError("the query gives no triples, so no file was written")
    head = [
        ox.Triple(name, ox.NamedNode(RDF + "type"), ox.NamedNode(OWL + "Ontology")),
        ox.Triple(name, ox.NamedNode(OWL + "imports"), ox.NamedNode(graph.scene)),
    ]
    text = ox.serialize([*head, *found], format=ox.RdfFormat.TURTLE, prefixes=graph.spoken) or b""
    write_whole(path, stamped(CONSTRUCTED, [text.decode("utf-8")]))
    return len(found)
