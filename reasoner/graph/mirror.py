"""An owlready2 world that is synchronised with a knowledge graph, for access to the ontology as Python classes.

The world is created from the scene's triples. `Mirror.pull` transfers added and removed statements to the graph before each query.
The world is never written to files.
"""

from __future__ import annotations

import io
from typing import Any

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import BASE, SCENE, KnowledgeGraph
from confab.reasoner.validation.hermit import world_of


class Mirror:
    """An owlready2 world (`world`) of a knowledge graph's scene."""

    def __init__(self, graph: KnowledgeGraph) -> None:
        self.graph = graph
        self.world: Any = world_of(graph.ntriples(SCENE))
        self.world.get_ontology(graph.scene + "#")  # the ontology for users' ``with`` blocks
        self._seen = self._lines()

    def pull(self) -> int:
        """Transfer to the graph `asserted` the changes of the world since the last call, and return their number."""
        now = self._lines()
        added, removed = now - self._seen, self._seen - now
        self.graph.extend("asserted", _parse(added))
        for quad in _parse(removed):
            for graph in SCENE:
                self.graph.store.remove(ox.Quad(quad.subject, quad.predicate, quad.object, ox.NamedNode(BASE + graph)))
        self._seen = now
        return len(added) + len(removed)

    def _lines(self) -> set[bytes]:
        """Return the statements of the world as lines of N-Triples."""
        file = io.BytesIO()
        self.world.save(file, format="ntriples")
        return set(file.getvalue().splitlines())


def _parse(lines: set[bytes]) -> list[ox.Quad]:
    return list(ox.parse(b"\n".join(sorted(lines)), format=ox.RdfFormat.N_TRIPLES))
