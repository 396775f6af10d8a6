"""Files of confabulation memories: knowledge links as annotated axioms in a Turtle file that imports the scene.

Each link is a triple ``quantified behaviour :associatedWith situated object instance``, annotated with ``:probability``
by an ``owl:Axiom``. Protégé shows the probability beside the triple. Confab writes links only to separate files, never
to ontologies that users edit.
"""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from urllib.parse import quote

import pyoxigraph as ox

from confab.reasoner import kinds
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, text
from confab.reasoner.memory.experience_file import MemoryLines, lines, no_such_file
from confab.reasoner.memory.links import Links
from confab.reasoner.names import Names
from confab.reasoner.nesting import MOST_NESTED, nested
from confab.reasoner.symbols import FALSE, TRUE, Symbol
from confab.reasoner.vocabulary import ARGUMENTS, CORE, MEMORY, OWL, RDF, XSD

ASSERTED = """
SELECT DISTINCT ?node ?property ?value WHERE {
  VALUES ?kind { :GroundBehavior :SituatedObjectInstance :Counter } ?node a ?kind ; ?property ?value
} ORDER BY ?node ?property ?value"""
ANNOTATED = """
SELECT ?behavior ?fact ?probability WHERE {
  ?behavior a :GroundBehavior .
  ?axiom owl:annotatedProperty :associatedWith ; owl:annotatedSource ?behavior ; owl:annotatedTarget ?fact ;
    :probability ?probability .
} ORDER BY ?behavior ?fact"""


def load_links(path: Path, names: Names, found: MemoryLines | None = None) -> Links:
    """Return the knowledge links in a memory file.

    Parameters
    ----------
    path : Path
    names : Names
        The scene's names; a term that the scene doesn't contain is named by the last part of its IRI.
    found : MemoryLines, optional
        The result of `memory_lines` for the file, if this result is known already.

    Raises
    ------
    KnowledgeError
        The file isn't Turtle, or a link lacks its behaviour or fact.
    """
    graph = _graph(path, found)
    nodes: dict[str, dict[str, str]] = {}
    for subject, predicate, value in graph.select(ASSERTED):
        if isinstance(value, ox.NamedNode):
            nodes.setdefault(text(subject), {})[text(predicate).removeprefix(CORE)] = text(value)
    links = Links()
    for behavior, fact, probability in graph.select(ANNOTATED):
        try:
            source, target = nodes[text(behavior)], nodes[text(fact)]
            conclusion = (names.short(source["behavior"]), _arguments(source, names))
            symbol = Symbol(names.short(target["situationType"]), _arguments(target, names))
            table = links.tables.setdefault(conclusion, {}).setdefault(symbol, {})
            if not 0 <= (share := float(text(probability))) <= 1:
                raise ValueError(f":probability {share}; wanted a number from 0 to 1")
            table[names.short(target["value"])] = share
        except (KeyError, ValueError) as error:
            raise KnowledgeError(f"{path}: the link {text(behavior)} → {text(fact)} isn't whole: {error}") from error
    return links


def memory_names(path: Path, found: MemoryLines | None = None) -> tuple[str, Names]:
    """Return the IRI of the scene that a memory file imports, and short names for the terms in the file.

    Raises
    ------
    KnowledgeError
        The file is missing, isn't Turtle, or imports no scene.
    """
    graph = _graph(path, found)
    imported = "SELECT ?scene WHERE { ?memory owl:imports ?scene FILTER(isIRI(?scene)) } ORDER BY ?scene"
    scenes = [text(row[0]) for row in graph.select(imported)]
    if not scenes:
        raise KnowledgeError(f"{path}: no memory: it imports no scene (owl:imports)")
    spoken = """SELECT DISTINCT ?said ?term WHERE {
      { ?node ?said ?term FILTER(isIRI(?term)) } UNION { ?term :durationStatistic ?node BIND(:durationStatistic AS ?said) }
    }"""
    return scenes[0], Names(
        text(term)
        for said, term in graph.select(spoken)
        if text(said).startswith(CORE) and not text(term).startswith(MEMORY)  # the terms of links, rules and durations
    )


def links_text(links: Links, names: Names, scene: str) -> str:
    """Return the triples of knowledge links as N-Triples, without the ontology's declaration."""
    iri = f"{scene.rstrip('#/')}.memory"
    return (ox.serialize(_triples(links, names, iri), format=ox.RdfFormat.N_TRIPLES) or b"").decode("utf-8")


def memory_lines(path: Path) -> MemoryLines:
    """Read a memory file and split the text into its parts.

    Raises
    ------
    KnowledgeError
        The file is missing, isn't text, or its brackets are nested too deeply.
    """
    if not path.is_file():
        raise no_such_file(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
        if nested(text.encode()) > MOST_NESTED:
            raise KnowledgeError(f"{path}: no memory: its brackets are nested more than {MOST_NESTED:,} deep")
        return lines(text)
    except UnicodeDecodeError as error:
        raise KnowledgeError(f"{path}: broken memory: {error}; plan with memory=None, or restore a copy") from error
    except OSError as error:
        raise KnowledgeError(f"{path}: can't be read: {error.strerror or error}") from error


def _graph(path: Path, found: MemoryLines | None = None) -> KnowledgeGraph:
    """Return the triples of a memory file, except tallies."""
    found = found or memory_lines(path)
    rest = found.rest + found.paper
    graph = KnowledgeGraph("")
    try:
        graph.extend("memory", ox.parse(rest, format=ox.RdfFormat.TURTLE, base_iri=path.resolve().as_uri()))
    except SyntaxError as error:
        refuse_another_kind(path)
        raise KnowledgeError(f"{path}: broken memory: {error}; plan with memory=None, or restore a copy") from error
    return graph


class AnotherKindError(KnowledgeError):
    """Raised if a file that should be a memory has a known kind of content other than a memory."""


def refuse_another_kind(path: Path) -> None:
    """Raise `AnotherKindError` if a file has a known kind of content other than a memory."""
    kind = kinds.kind_of(path)
    if kind is not None and kind.name not in (kinds.MEMORY, "a text"):
        raise AnotherKindError(f"{path}: is {kind}; wanted a memory, which 'confab learn' makes")


def _triples(links: Links, names: Names, iri: str) -> Iterator[ox.Triple]:
    owl, rdf = OWL, RDF

    def node(name: str) -> ox.NamedNode:
        return ox.NamedNode(name)

    def of(name: str) -> ox.NamedNode:
        return node(CORE + name) if name in (TRUE, FALSE) else node(names.iri(name) if name in names else CORE + name)

    def described(subject: ox.NamedNode, kind: str, parts: dict[str, ox.NamedNode]) -> Iterator[ox.Triple]:
        yield ox.Triple(subject, node(rdf + "type"), node(owl + "NamedIndividual"))
        yield ox.Triple(subject, node(rdf + "type"), node(CORE + kind))
        for name, value in parts.items():
            yield ox.Triple(subject, node(CORE + name), value)

    facts: dict[ox.NamedNode, tuple[Symbol, str]] = {}
    axioms = []
    for conclusion, symbols in sorted(links.tables.items()):
        behavior, arguments = conclusion
        source = node(f"{iri}#{_readable(behavior, *arguments)}")
        parts = {"behavior": of(behavior), **dict(zip(ARGUMENTS, map(of, arguments), strict=False))}
        yield from described(source, "GroundBehavior", parts)
        for symbol, table in sorted(symbols.items()):
            for value, probability in sorted(table.items()):
                fact = node(f"{iri}#{_readable(symbol.situation, *symbol.arguments, value)}")
                facts[fact] = (symbol, value)
                yield ox.Triple(source, node(CORE + "associatedWith"), fact)
                axioms.append((source, fact, probability))
    for fact, (symbol, value) in facts.items():
        parts = {
            "situationType": of(symbol.situation),
            **dict(zip(ARGUMENTS, map(of, symbol.arguments), strict=False)),
            "value": of(value),
        }
        yield from described(fact, "SituatedObjectInstance", parts)
    for number, (source, fact, probability) in enumerate(axioms):
        axiom = ox.BlankNode(f"link{number}")
        yield ox.Triple(axiom, node(rdf + "type"), node(owl + "Axiom"))
        yield ox.Triple(axiom, node(owl + "annotatedSource"), source)
        yield ox.Triple(axiom, node(owl + "annotatedProperty"), node(CORE + "associatedWith"))
        yield ox.Triple(axiom, node(owl + "annotatedTarget"), fact)
        # the probability is a decimal, because some programs write doubles with only seven digits
        decimal = f"{Decimal(repr(probability)):f}"
        yield ox.Triple(axiom, node(CORE + "probability"), ox.Literal(decimal, datatype=node(XSD + "decimal")))


def _readable(*words: str) -> str:
    return ".".join(quote(word.replace(":", "-"), safe="") for word in words)


def _arguments(node: dict[str, str], names: Names) -> tuple[str, ...]:
    return tuple(names.short(node[name]) for name in ARGUMENTS if name in node)
