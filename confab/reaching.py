"""Reach facts at the front desk: computed from geometry when they are missing or stale, and kept beside the scene."""

from __future__ import annotations

import logging

import pyoxigraph as ox

from confab.scene import Scene
from reasoner.graph import BASE, KnowledgeError
from reasoner.reach import reach_hash, reach_relation, save_reach

log = logging.getLogger(__name__)


def with_reach(scene: Scene) -> Scene:
    """Return the scene with reach facts that fit its geometry.

    They are computed if the scene has none, or those of another geometry, and then written into ``SCENE.reach.ttl`` beside the
    scene's file, so that planning needs no physics; where that can't be written they live as long as the returned scene.

    Raises
    ------
    KnowledgeError, EmbodimentError
        The scene is symbolic only, or lacks something that physics needs.
    """
    from sim.reach import fingerprint, reach

    if reach_hash(scene.knowledge) == fingerprint(scene.embodiment):
        return scene
    log.info("computing what the hands of %s reach", scene.iri)
    try:
        reached = reach(scene.embodiment)
    except ValueError as error:
        raise KnowledgeError(f"{scene.iri}: {error}; physics needs bodies and skills (docs/authoring.md)") from error
    graph, names, target = scene.knowledge, scene.names, ox.NamedNode(BASE + "reach")
    relation = ox.NamedNode(reach_relation(graph))
    graph.store.clear_graph(target)
    graph.store.extend(
        ox.Quad(ox.NamedNode(names.iri(hand)), relation, ox.NamedNode(names.iri(place)), target)
        for hand, place in reached.pairs
    )
    if graph.path is not None:
        path = graph.path.with_name(f"{graph.path.stem}.reach.ttl")
        try:
            save_reach(path, graph, names, reached.pairs, reached.inputs)
            log.info("wrote %s", path)
        except OSError as error:
            log.warning("%s: can't be written (%s); what was computed isn't kept", path, error.strerror)
    return Scene(graph, scene.seconds)
