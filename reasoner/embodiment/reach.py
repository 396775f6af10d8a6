"""Reach facts (which hand reaches which place), calculated by `confab.sim.reach` and stored in a file beside the scene."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.files import alone, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.names import Names
from confab.reasoner.vocabulary import CORE, OWL, PROV, RDF

RELATIONS = "SELECT DISTINCT ?relation WHERE { ?relation a :ReachRelation } ORDER BY ?relation"
HASHES = "SELECT DISTINCT ?hash WHERE { ?ontology :inputsHash ?hash }"


def reach_relation(graph: KnowledgeGraph) -> str:
    """Return the IRI of the relation of reach facts.

    Raises
    ------
    KnowledgeError
        The domain declares no relation of reach facts, or several such relations.
    """
    found = [row[0].value for row in graph.select(RELATIONS) if isinstance(row[0], ox.NamedNode)]
    if len(found) != 1:
        raise KnowledgeError(f"wanted one relation that is a c:ReachRelation, found {len(found)}: {', '.join(found)}")
    return found[0]


def reach_hash(graph: KnowledgeGraph) -> str | None:
    """Return the hash of the inputs from which the scene's reach file was calculated, or None if the file doesn't exist."""
    rows = graph.select(HASHES, ("reach",))
    return rows[0][0].value if rows and isinstance(rows[0][0], ox.Literal) else None


def save_reach(
    path: Path, graph: KnowledgeGraph, names: Names, pairs: Iterable[tuple[str, str]], inputs_hash: str
) -> None:
    """Write reach facts and the hash of their inputs to a file beside the scene.

    Parameters
    ----------
    path : Path
        ``SCENE.reach.ttl``.
    graph : KnowledgeGraph
        The scene.
    names : Names
    pairs : iterable of (hand, place)
        Pairs of short names: a hand, and a place that the hand reaches.
    inputs_hash : str
        Hash of the geometry and the settings; if it changes, the file is outdated.
    """
    relation = ox.NamedNode(reach_relation(graph))
    iri = ox.NamedNode(f"{graph.scene.rstrip('#/')}.reach")
    kind, hash_property = ox.NamedNode(RDF + "type"), ox.NamedNode(CORE + "inputsHash")
    by = ox.NamedNode(PROV + "wasGeneratedBy")
    owl = OWL
    triples = [
        ox.Triple(iri, kind, ox.NamedNode(owl + "Ontology")),
        ox.Triple(iri, ox.NamedNode(owl + "imports"), ox.NamedNode(graph.scene)),
        ox.Triple(iri, by, ox.Literal("inverse kinematics of the robot's URDF at every place of the scene")),
        ox.Triple(iri, hash_property, ox.Literal(inputs_hash)),
        ox.Triple(by, kind, ox.NamedNode(owl + "AnnotationProperty")),
    ]
    triples += [
        ox.Triple(ox.NamedNode(names.iri(hand)), relation, ox.NamedNode(names.iri(place)))
        for hand, place in sorted(pairs)
    ]
    _write(path, graph, triples)


def add_to_reach(path: Path, graph: KnowledgeGraph, triples: Iterable[ox.Triple]) -> None:
    """Add triples to a scene's reach file."""
    with alone(path):
        there = [quad.triple for quad in ox.parse(path.read_bytes(), format=ox.RdfFormat.TURTLE)]
        _write(path, graph, dict.fromkeys((*there, *triples)))


def _write(path: Path, graph: KnowledgeGraph, triples: Iterable[ox.Triple]) -> None:
    prefixes = {p: n for p, n in graph.prefixes.items() if p in ("owl", "k", "r", "t")}
    text = ox.serialize(triples, format=ox.RdfFormat.TURTLE, prefixes={**prefixes, "": CORE, "prov": PROV})
    write_whole(path, text or b"")
