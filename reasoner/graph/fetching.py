"""Download of ontologies from the web on request; the catalog maps the IRI of an ontology to the downloaded file.

The loading of scenes never uses the network. A downloaded document is stored only if it is an ontology with the requested IRI, is
of bounded size, has no external or recursive entities, and imports no file paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from urllib.parse import urlsplit
from xml.sax.saxutils import quoteattr

import pyoxigraph as ox
import urllib3
from urllib3.exceptions import HTTPError, LocationValueError, MaxRetryError

from confab import ontology
from confab.reasoner.files import write_whole
from confab.reasoner.graph.documents import DocumentError, plain_xml, safe
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.vocabulary import OWL

MOST_BYTES = 20_000_000
SECONDS = 30.0
"""Maximum number of seconds for a download; the limit for the connection is a fifth of this number."""
REDIRECTS = 5
ACCEPT = "text/turtle, application/n-triples;q=0.9, application/rdf+xml;q=0.8, */*;q=0.1"
SUFFIX = {
    "text/turtle": ".ttl",
    "application/x-turtle": ".ttl",
    "application/n-triples": ".nt",
    "application/rdf+xml": ".owl",
    "application/owl+xml": ".owl",
    "application/xml": ".owl",
    "text/xml": ".owl",
}
FORM = {".ttl": ox.RdfFormat.TURTLE, ".nt": ox.RdfFormat.N_TRIPLES, ".owl": ox.RdfFormat.RDF_XML}
CATALOG = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
</catalog>
"""


@dataclass(frozen=True)
class Fetched:
    """A downloaded ontology: its file, the catalog with its IRI, and the IRIs that it imports."""

    file: Path
    catalog: Path
    imports: tuple[str, ...]


def fetch(url: str, folder: Path) -> Fetched:
    """Download an ontology into a folder, and add its IRI to the folder's catalog.

    Parameters
    ----------
    url : str
        ``http`` or ``https`` URL, which is also the IRI or version IRI of the ontology.
    folder : Path
        The folder of the importing ontology.

    Raises
    ------
    KnowledgeError
        The URL can't be reached, or the document is invalid, too large, unsafe, or not the requested ontology. If an error is
        raised, no file is written.
    """
    try:
        parts = urlsplit(url)
        good = parts.scheme in ("http", "https") and parts.hostname and ox.NamedNode(url) and (parts.port or 1)
    except ValueError:
        good = False
    if not good:
        raise KnowledgeError(f"'{url}' can't be fetched: wanted the http or https address of an ontology")
    content, kind = _download(url)
    said = url.split("#")[0]
    suffix = SUFFIX.get(kind) or _guessed(said, content)
    try:
        if suffix == ".owl":
            content = plain_xml(content)
        safely, form = safe(content, FORM[suffix], url)
        triples = [quad.triple for quad in ox.parse(safely, format=form, base_iri=url)]
    except DocumentError as error:
        raise KnowledgeError(f"{url}: {error}") from error
    except SyntaxError as error:
        raise KnowledgeError(f"{url}: is no {suffix[1:]} document (sent as '{kind or 'nothing'}'): {error}") from error
    iri = _declared(url, said, triples)
    imports = _imported(url, iri, triples)
    catalog, file = folder / ontology.CATALOG, folder / f"{_name(iri)}{suffix}"
    if file.exists():
        raise KnowledgeError(f"{file} exists already; remove it, or fetch into another folder")
    entries = _catalog_with(catalog, dict.fromkeys((said, iri), file.name))
    write_whole(file, content)
    write_whole(catalog, entries)
    return Fetched(file, catalog, imports)


def _download(url: str) -> tuple[bytes, str]:
    """Return the content and the media type of the document at a URL."""
    end = monotonic() + SECONDS
    pool = urllib3.PoolManager(
        retries=urllib3.Retry(total=REDIRECTS, connect=0, read=0, redirect=REDIRECTS, status=0, other=0),
        timeout=urllib3.Timeout(connect=SECONDS / 5, read=SECONDS / 3),
    )
    headers = {"Accept": ACCEPT, "Accept-Encoding": "identity", "User-Agent": "confab"}
    try:
        answer = pool.request("GET", url, headers=headers, preload_content=False, decode_content=False)
        try:
            if answer.status != 200:
                raise KnowledgeError(f"{url}: the server answers {answer.status} {answer.reason or ''}".rstrip())
            if answer.headers.get("Content-Encoding", "identity") != "identity":
                raise KnowledgeError(f"{url}: the server sends compressed data, which wasn't requested; refused")
            content = b""
            for piece in answer.stream(65536):
                content += piece
                if len(content) > MOST_BYTES:
                    raise KnowledgeError(f"{url}: refused, since it is larger than {MOST_BYTES // 1_000_000} MB")
                if monotonic() > end:
                    raise KnowledgeError(f"{url}: refused, since it takes longer than {SECONDS:.0f} s")
            kind = answer.headers.get("Content-Type", "").partition(";")[0].strip().lower()
        finally:
            answer.close()
    except (HTTPError, LocationValueError) as error:
        cause = error.reason if isinstance(error, MaxRetryError) and error.reason else error
        raise KnowledgeError(f"{url}: can't be fetched: {str(cause).partition(': ')[2] or cause}") from error
    return content, kind


def _guessed(url: str, content: bytes) -> str:
    """Return the file suffix for a document whose media type is unknown."""
    suffix = Path(urlsplit(url).path).suffix.lower()
    if suffix in FORM:
        return suffix
    return ".owl" if suffix == ".rdf" or content.lstrip()[:5] in (b"<?xml", b"<rdf:", b"<!DOC") else ".ttl"


def _declared(url: str, said: str, triples: Sequence[ox.Triple]) -> str:
    """Return the IRI of the ontology that a document contains; raise `KnowledgeError` unless it is the requested ontology."""
    kind = ox.NamedNode(OWL + "Ontology")
    found = [t.subject.value for t in triples if t.object == kind and isinstance(t.subject, ox.NamedNode)]
    if len(found) != 1:
        raise KnowledgeError(f"{url}: holds {len(found)} ontologies; wanted one 'a owl:Ontology' with an IRI")
    names = {t.object.value for t in triples if t.predicate.value == OWL + "versionIRI" and hasattr(t.object, "value")}
    if said.rstrip("/") not in {name.rstrip("#/") for name in {found[0], *names}}:
        raise KnowledgeError(f"{url}: is the ontology <{found[0]}>; import and fetch it by that IRI")
    return found[0]


def _imported(url: str, iri: str, triples: Sequence[ox.Triple]) -> tuple[str, ...]:
    imports = sorted(
        t.object.value
        for t in triples
        if t.predicate.value == OWL + "imports"
        and isinstance(t.object, ox.NamedNode)
        and t.subject == ox.NamedNode(iri)
    )
    for imported in imports:
        if not imported.startswith(("http://", "https://", "urn:")):
            raise KnowledgeError(f"{url}: refused, since it imports <{imported}>, a file of this machine")
    return tuple(imports)


def _name(iri: str) -> str:
    """Return a file name that is the last part of an IRI."""
    name = iri.rstrip("#/").rsplit("/", 1)[-1]
    for suffix in FORM:
        name = name.removesuffix(suffix)
    if not name or name.startswith(".") or "\\" in name or "\0" in name:
        raise KnowledgeError(f"<{iri}> ends in '{name}', which can't be the name of a file")
    return name


def _catalog_with(path: Path, entries: dict[str, str]) -> str:
    """Return the text of a catalog with additional entries."""
    text = path.read_text(encoding="utf-8") if path.is_file() else CATALOG
    try:
        known = ontology.catalog(path) if path.is_file() else {}
    except ValueError as error:
        raise KnowledgeError(str(error)) from error
    new = [
        f"  <uri name={quoteattr(iri)} uri={quoteattr(place)}/>\n" for iri, place in entries.items() if iri not in known
    ]
    head, end, rest = text.rpartition("</catalog>")
    return head + "".join(new) + end + rest
