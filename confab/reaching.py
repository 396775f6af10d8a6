"""Reach facts (which hand reaches which place), computed from geometry and stored in a file beside the scene."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress

import pyoxigraph as ox

from confab import ontology
from confab.known import Known, S
from confab.reasoner.graph.knowledge import BASE, KnowledgeError, text
from confab.reasoner.vocabulary import EMBODIMENT, EPISODES

log = logging.getLogger(__name__)
ROBOTS = f"""PREFIX e: <{EMBODIMENT}>
SELECT ?robot WHERE {{ ?robot e:urdf ?file . FILTER NOT EXISTS {{ ?ontology :symbolicOnly true }}
  FILTER NOT EXISTS {{ GRAPH <{BASE}asserted> {{ ?episode a <{EPISODES}Episode> }} }}
  FILTER NOT EXISTS {{ ?memory :memoryFormat ?format }} }}"""
"""Query for the robots of a scene with geometry. For files of episodes and memories, the result is empty."""

REACHED = "SELECT DISTINCT ?place WHERE {{ ?hand <{relation}> ?place }}"
"""Query for the places that at least one hand reaches."""


def has_robot(scene: Known) -> bool:
    """Return whether a scene has a robot whose body is described."""
    return bool(scene.knowledge.select(ROBOTS))


def with_current_reach(scene: S, report: Callable[[str], None]) -> S:
    """Return a scene with up-to-date reach facts; a scene without a robot's body is returned unchanged.

    If the file of reach facts is missing or older than a file of the scene, the reach facts are checked, and computed if
    necessary. If the description of the bodies is incomplete, the scene is returned unchanged, and `report` is called with the name
    of the missing statement. The reach facts of shipped scenes are always up to date.
    """
    graph = scene.knowledge
    shipped = graph.path is not None and graph.path.is_relative_to(ontology.ROOT)
    if shipped or graph.remote or graph.faults or not graph.select(ROBOTS):
        return scene
    if graph.path is not None:  # a scene read from text has no file of reach facts
        file = graph.path.with_name(f"{graph.path.stem}.reach.ttl")
        own = [path for path in graph.files.values() if not path.is_relative_to(ontology.ROOT)]
        if file.is_file() and file.stat().st_mtime >= max(path.stat().st_mtime for path in own):
            return scene
        report("computing the reach of the hands")
    try:
        reached = with_reach(scene)
        if graph.path is not None and file.is_file():
            file.touch()
        return reached
    except (KnowledgeError, OSError, ImportError) as error:
        from confab.reasoner.embodiment.reach import reach_hash

        report(f"the reach of the hands isn't known: {error}")
        if isinstance(error, ImportError) and reach_hash(graph) is None:
            graph.faults.append(f"the reach of the hands isn't known, so no plan can be found: {error}")
        return scene


def with_reach(scene: S) -> S:
    """Return a scene with reach facts that agree with its geometry.

    Reach facts are computed if they are missing or were computed for another geometry. Computed facts are written into
    ``SCENE.reach.ttl`` beside the scene's file, so that later calls needn't compute them. If the file can't be written, only
    the returned scene has the reach facts.

    Raises
    ------
    KnowledgeError
        The scene has no geometry, or lacks statements that physics needs.
    """
    from confab.reasoner.embodiment.reach import reach_hash, reach_relation, save_reach
    from confab.sim.reach import fingerprint, reach

    if reach_hash(scene.knowledge) == fingerprint(scene.embodiment):
        return scene
    log.info("computing the reach of the hands of %s", scene.iri)
    try:
        reached = reach(scene.embodiment)
    except ValueError as error:
        raise KnowledgeError(f"{scene.iri}: {error}; physics needs bodies and skills (docs/bodies.md)") from error
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
            log.warning("%s: %s; the computed reach facts aren't saved", path, error.strerror)
    return type(scene)(graph, scene.seconds)


def unreached(scene: Known) -> list[str]:
    """Return a sentence for each unreachable place in initial facts or goals, with the obstacle for each hand."""
    from confab.reasoner.embodiment.reach import reach_relation
    from confab.sim.reach import hindrance

    graph = scene.knowledge
    if graph.remote or not graph.select(ROBOTS):
        return []
    problem = scene.problem
    used = dict.fromkeys((*problem.goal.values(), *problem.initial.values()))
    reached = {text(row[0]) for row in graph.select(REACHED.format(relation=reach_relation(graph)))}
    found = []
    for place in (name for name in used if name in scene.embodiment.places and scene.names.iri(name) not in reached):
        with suppress(ValueError):
            why = hindrance(scene.embodiment, place)
            found += [f"no hand reaches {place}: {'; '.join(why)}"] if why else []
    return found
