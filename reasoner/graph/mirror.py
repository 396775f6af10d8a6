"""An owlready2 world that is synchronised with a knowledge graph, for users who think in classes.

The world is made from the scene's triples. `pull` transfers statements that were added to it or removed from it to the graph; it
is called before every query. The world isn't written to files: Turtle files belong to their authors.
"""

from __future__ import annotations

import io
from typing import Any

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import BASE, SCENE, KnowledgeGraph
from confab.reasoner.validation.hermit import world_of


class Mirror:
    """An owlready2 world, and those of its statements that the graph contains.

    Attributes
    ----------
    world : owlready2.World
    """

    def __init__(self, graph: KnowledgeGraph) -> None:
        self.graph = graph
        self.world: Any = world_of(graph.ntriples(SCENE))
        self.world.get_ontology(graph.scene + "#")  # the target of `with`
        self._seen = self._lines()

    def pull(self) -> int:
        """Transfer changes of the world to the graph `asserted`; return their number."""
        now = self._lines()
        added, removed = now - self._seen, self._seen - now
        name = ox.NamedNode(BASE + "asserted")
        for quad in _parse(added):
            self.graph.store.add(ox.Quad(quad.subject, quad.predicate, quad.object, name))
        for quad in _parse(removed):
            for graph in SCENE:
                self.graph.store.remove(ox.Quad(quad.subject, quad.predicate, quad.object, ox.NamedNode(BASE + graph)))
        self._seen = now
        return len(added) + len(removed)

    def _lines(self) -> set[bytes]:
        """Return the world as N-Triples, one line each."""
        file = io.BytesIO()
        self.world.save(file, format="ntriples")
        return set(file.getvalue().splitlines())


def _parse(lines: set[bytes]) -> list[ox.Quad]:
    return list(ox.parse(b"\n".join(sorted(lines)), format=ox.RdfFormat.N_TRIPLES))
