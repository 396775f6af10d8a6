"""Import of a robot's world model, or of a foreign RDF file, as a scene (`confab import`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from confab import ontology
from confab.connecting import parts_of, reached
from confab.reasoner.embodiment.interfaces import Interface, read_interface
from confab.reasoner.files import as_iri_part, write_whole
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.kinds import IMPORTED, stamped
from confab.reasoner.names import nearest
from confab.reasoner.vocabulary import CORE, LABEL, OWL, RDF, RDFS, XSD
from confab.scene import load
from confab.sim.robots.transport import RobotError, WorldModel

MODEL, LINK = "https://w3id.org/confab/model#", "https://w3id.org/confab/model/link#"
"""Namespaces of the properties for the fields of a world model: the first for fields with literals, the second for fields that
name an entity.
"""

DCTERMS = "http://purl.org/dc/terms/"
WORLD_FILES = {".yaml": "pyrobosim", ".yml": "pyrobosim"}
"""The name of the interface that reads a world file, indexed by the suffix of the file."""


def scene_of_world(on: str, path: Path) -> int:
    """Write the world model of a robot as a scene in Turtle, and return the number of the scene's individuals.

    Parameters
    ----------
    on : str
        ``INTERFACE:ADDRESS`` with a shipped interface, or a world file whose suffix determines the interface.
    path : Path
        File to write.

    Raises
    ------
    KnowledgeError
        The interface doesn't exist or has no scene query, no connection to the robot is possible, or the scene query has no
        result.
    """
    name, where = (
        (WORLD_FILES[Path(on).suffix], on) if Path(on).suffix in WORLD_FILES and Path(on).is_file() else parts_of(on)
    )
    known = _interfaces()
    if name not in known:
        raise KnowledgeError(f"no interface '{name}'{nearest(name, known)} (interfaces: {', '.join(known)})")
    domain = load(str(known[name]))
    interface = read_interface(domain.knowledge.store, domain.names.short, name)
    transport = reached(interface, where, 0)
    try:
        model = getattr(transport, "scene_model", transport.model)()
    except RobotError as error:
        raise KnowledgeError(str(error)) from error
    text, count = scene_text(interface, model, path.stem, f"World of {Path(where).name or where}")
    write_whole(path, stamped(IMPORTED, [text]))
    return count


def scene_text(interface: Interface, model: WorldModel, name: str, title: str) -> tuple[str, int]:
    """Return the scene that an interface's scene query constructs from a world model, as Turtle, and the number of individuals.

    Raises
    ------
    KnowledgeError
        The interface has no scene query, or the query has no result.
    """
    if not interface.scene_query:
        raise KnowledgeError(f"{interface.name} has no e:sceneQuery, so its world model can't be imported")
    iri = f"https://example.org/{as_iri_part(name)}"
    store = ox.Store()
    store.extend(ox.Quad(*triple) for triple in _triples(model, iri + "#"))
    answer = store.query((ontology.ROOT / "alignments" / interface.scene_query).read_text(encoding="utf-8"))
    if not isinstance(answer, ox.QueryTriples):
        raise KnowledgeError(f"{interface.scene_query} is no CONSTRUCT query")
    found = sorted(set(answer), key=str)
    if not found:
        raise KnowledgeError(f"{interface.scene_query} has no result for the world model of {interface.name}")
    text = _turtle(iri, [interface.iri.rpartition("#")[0]], found, title)
    return text, len({triple.subject for triple in found})


def scene_of_graph(source: Path, query: str, path: Path) -> int:
    """Write the scene that a query constructs from a foreign RDF file as Turtle, and return the number of individuals.

    Parameters
    ----------
    source : Path
        An RDF file with terms of another ontology.
    query : str
        The path of a CONSTRUCT query, or the file name of a shipped query (in the folder ``alignments``).
    path : Path
        File to write. The file imports the shipped ontologies whose terms the query uses.

    Raises
    ------
    KnowledgeError
        A file can't be read, or the query has no result.
    """
    file = next((one for one in (Path(query), ontology.ROOT / "alignments" / query) if one.is_file()), None)
    if file is None:
        known = ", ".join(sorted(one.name for one in (ontology.ROOT / "alignments").glob("*.rq")))
        raise KnowledgeError(f"no query '{query}', neither a file nor one of the alignments ({known})")
    store = ox.Store()
    formats = {".turtle": ox.RdfFormat.TURTLE, ".owl": ox.RdfFormat.RDF_XML}
    try:
        form = formats.get(source.suffix) or ox.RdfFormat.from_extension(source.suffix.lstrip("."))
        store.load(path=str(source), format=form)
        answer = store.query(file.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError) as error:
        raise KnowledgeError(f"{source}, {file.name}: {error}") from error
    found = sorted(set(answer), key=str) if isinstance(answer, ox.QueryTriples) else []
    if not found:
        raise KnowledgeError(f"{file.name} has no result for {source}")
    spaces = {term.value.rpartition("#")[0] for triple in found for term in triple if isinstance(term, ox.NamedNode)}
    iri = f"https://example.org/{as_iri_part(path.stem)}"
    text = _turtle(iri, sorted(spaces & {*ontology.shipped()}), found, f"Scene of {source.name}")
    write_whole(path, stamped(IMPORTED, [text]))
    return len({triple.subject for triple in found})


def _interfaces() -> Mapping[str, Path]:
    """Return the files of the shipped interfaces by the name of the interface."""
    shipped = {iri.rsplit("/", 1)[-1]: path for iri, path in ontology.shipped().items()}
    return {
        name: path
        for name, path in shipped.items()
        if path.parent.name == "robots" and " e:Interface " in path.read_text(encoding="utf-8")
    }


# ------------------------------------------------------------------------------------------------------------- world models


def _triples(model: WorldModel, namespace: str) -> Iterator[ox.Triple]:
    """Yield a world model as triples, with an individual for each entity and a property for each field."""
    nodes = {entity: ox.NamedNode(namespace + as_iri_part(entity)) for entity in model}
    for entity, fields in model.items():
        for name, shown in fields.items():
            for one in shown if isinstance(shown, list | tuple) else [shown]:
                field_ = as_iri_part(name)
                if (literal := _literal(one)) is not None:
                    yield ox.Triple(nodes[entity], ox.NamedNode(MODEL + field_), literal)
                if isinstance(one, str) and one in nodes:
                    yield ox.Triple(nodes[entity], ox.NamedNode(LINK + field_), nodes[one])


def _literal(shown: Any) -> ox.Literal | None:
    if isinstance(shown, bool):
        return ox.Literal("true" if shown else "false", datatype=ox.NamedNode(XSD + "boolean"))
    if isinstance(shown, int | float):
        return ox.Literal(f"{shown:.6f}", datatype=ox.NamedNode(XSD + "decimal"))
    return ox.Literal(shown) if isinstance(shown, str) else None


def _turtle(iri: str, imported: Sequence[str], found: list[ox.Triple], title: str) -> str:
    """Return a scene as Turtle: a header, the given triples, labels, and the statement that all individuals are different."""
    individuals = sorted({str(triple.subject.value) for triple in found if isinstance(triple.subject, ox.NamedNode)})
    things = [one for one in individuals if "." not in one.rpartition("#")[2]]
    labelled = {
        str(t.subject.value) for t in found if t.predicate.value == LABEL and isinstance(t.subject, ox.NamedNode)
    }
    here = ox.NamedNode(iri)
    head = [
        ox.Triple(here, ox.NamedNode(RDF + "type"), ox.NamedNode(OWL + "Ontology")),
        *(ox.Triple(here, ox.NamedNode(OWL + "imports"), ox.NamedNode(one)) for one in imported),
        ox.Triple(here, ox.NamedNode(DCTERMS + "title"), ox.Literal(title, language="en")),
        ox.Triple(here, ox.NamedNode(CORE + "symbolicOnly"), ox.Literal(True)),
    ]
    labels = [
        ox.Triple(ox.NamedNode(one), ox.NamedNode(LABEL), ox.Literal(_words(one), language="en"))
        for one in things
        if one not in labelled
    ]
    spoken = {"": iri + "#", "owl": OWL, "rdfs": RDFS, "xsd": XSD, "c": CORE, "dcterms": DCTERMS}
    terms = [term.value for triple in found for term in triple if isinstance(term, ox.NamedNode)]
    for space in sorted({term.rpartition("#")[0] + "#" for term in terms} - {*spoken.values(), RDF}):
        spoken[space.rstrip("#").rsplit("/", 1)[-1].removesuffix(".owl")] = space
    body = ox.serialize([*head, *found, *labels], format=ox.RdfFormat.TURTLE, prefixes=spoken) or b""
    members = " ".join(f"<{one}>" for one in things)
    different = f"\n[ a owl:AllDifferent ; owl:distinctMembers ( {members} ) ] .\n"
    return body.decode("utf-8") + different


def _words(iri: str) -> str:
    return iri.rpartition("#")[2].replace("_", " ")
