"""The page docs/vocabulary.md, which `make vocabulary` writes from the ontology files and a test compares with these files."""

from __future__ import annotations

import re
from pathlib import Path

import rdflib
from rdflib import DCTERMS, OWL, RDF, RDFS, SKOS, XSD, URIRef

from confab import ontology
from confab.reasoner.names import local_name

PAGE = Path(__file__).resolve().parents[1] / "docs" / "vocabulary.md"
FILES = ("core.ttl", "embodiment.ttl", "episodes.ttl")
VANN = rdflib.Namespace("http://purl.org/vocab/vann/")
KINDS = {
    OWL.Class: "class",
    OWL.ObjectProperty: "object property",
    OWL.DatatypeProperty: "data property",
    OWL.AnnotationProperty: "annotation",
    OWL.NamedIndividual: "individual",
}
HEAD = """# The vocabulary

The terms of domains and scenes, generated from the ontology files by `make vocabulary`. Arrows lead from the domain of
a property to its range; *one* means at most one value.
"""


def page() -> str:
    """Return the text of the page."""
    return "\n".join([HEAD, *(part(ontology.ROOT / name) for name in FILES)])


def part(file: Path) -> str:
    """Return the part of the page about one ontology file: a heading, and a table for each section of the file."""
    graph = rdflib.Graph().parse(file)
    (about,) = graph.subjects(RDF.type, OWL.Ontology)
    space, prefix = (graph.value(about, VANN[f"preferredNamespace{end}"]) for end in ("Uri", "Prefix"))
    version = local_name(str(graph.value(about, OWL.versionIRI)).rsplit("/", 1)[0])
    lines = [
        f"## {graph.value(about, DCTERMS.title)} (`ontology/{file.name}`)",
        "",
        f"{graph.value(about, DCTERMS.description)} Version {version}, prefix `{prefix}:` for `{space}`.",
    ]
    for title, names in sections(file.read_text(encoding="utf-8")):
        lines += ["", f"### {title}", "", "| term | label | kind | definition |", "|---|---|---|---|"]
        lines += [row(graph, URIRef(f"{space}{name}")) for name in names]
    return "\n".join([*lines, ""])


def sections(text: str) -> list[tuple[str, list[str]]]:
    """Return the sections of a file: the title in a comment, and the terms that the section declares."""
    found: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        if match := re.match(r"#{5,}\s+(.+)", line):
            found.append((match[1], []))
        elif found and (match := re.match(r":([A-Za-z]\w*) a ", line)):
            found[-1][1].append(match[1])
    return [(title, names) for title, names in found if names]


def row(graph: rdflib.Graph, term: URIRef) -> str:
    """Return the row of the table for a term."""
    kinds = [word for kind, word in KINDS.items() if (term, RDF.type, kind) in graph] or [
        local_name(str(kind)) for kind in sorted(graph.objects(term, RDF.type), key=str)
    ]
    if "individual" in kinds and (
        own := sorted({*graph.objects(term, RDF.type)} - {OWL.NamedIndividual, OWL.Class}, key=str)
    ):
        kinds[kinds.index("individual")] = local_name(str(own[0]))
    kind = " and ".join(kinds)
    above = ", ".join(
        f"`{local_name(str(o))}`"
        for o in sorted(graph.objects(term, RDFS.subClassOf), key=str)
        if isinstance(o, URIRef)
    )
    ends = [_names(graph, term, end) for end in (RDFS.domain, RDFS.range)]
    kind += f" below {above}" if above else ""
    kind += f": {ends[0] or 'anything'} → {ends[1] or 'anything'}" if any(ends) else ""
    kind += ", one" if (term, RDF.type, OWL.FunctionalProperty) in graph else ""
    kind += ", deprecated" if graph.value(term, OWL.deprecated) else ""
    labels = ", ".join(
        f"{label}{'' if label.language == 'en' else f' ({label.language})'}"
        for label in sorted(graph.objects(term, RDFS.label), key=lambda label: str(getattr(label, "language", "")))
        if isinstance(label, rdflib.Literal)
    )
    said = str(graph.value(term, SKOS.definition) or "")
    example = graph.value(term, SKOS.example)
    said += f" *{example}*" if example else ""
    return f"| `{local_name(str(term))}` | {labels} | {kind} | {said} |".replace("\n", " ")


def _names(graph: rdflib.Graph, term: URIRef, end: URIRef) -> str:
    found = sorted(o for o in graph.objects(term, end) if isinstance(o, URIRef))
    return " and ".join(f"`{'xsd:' if o.startswith(str(XSD)) else ''}{local_name(str(o))}`" for o in found)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
