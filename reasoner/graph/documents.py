"""Safe reading of RDF documents: RDF/XML is passed to the parser without external or recursive entities.

The XML parser expat reads the document type declaration; a declaration with only plain entities then replaces this declaration.
(Protégé 4 abbreviates namespaces by plain entities.) Comments, instructions and other declarations before the first element are
removed.
"""

from __future__ import annotations

import logging
import os
import re
import resource
from codecs import BOM_UTF8
from collections import Counter
from functools import lru_cache
from pathlib import Path
from xml.parsers import expat

import pyoxigraph as ox

from confab.reasoner.limits import check, current
from confab.reasoner.nesting import JSON, MOST_NESTED, TURTLE, nested, nested_elements

log = logging.getLogger(__name__)

FORMATS = {
    ".ttl": ox.RdfFormat.TURTLE,
    ".nt": ox.RdfFormat.N_TRIPLES,
    ".owl": ox.RdfFormat.RDF_XML,
    ".rdf": ox.RdfFormat.RDF_XML,
    ".xml": ox.RdfFormat.RDF_XML,
    ".jsonld": ox.RdfFormat.JSON_LD,
    ".trig": ox.RdfFormat.TRIG,
    ".nq": ox.RdfFormat.N_QUADS,
}
SYNTAXES = {".ofn": "functional syntax", ".omn": "Manchester syntax", ".owx": "OWL/XML", ".obo": "OBO"}
"""Formats that aren't supported because no library in use reads them correctly."""
SIGNS = (
    (rb"(@prefix|@base|PREFIX|BASE)\s", ox.RdfFormat.TURTLE),
    (rb"\{\s*\"|\[\s*\{", ox.RdfFormat.JSON_LD),
    (rb"(Prefix|Ontology)\s*\(", SYNTAXES[".ofn"]),
    (rb"(Prefix|Ontology):\s", SYNTAXES[".omn"]),
    (rb"(<\?xml[^>]*>\s*)?(<!DOCTYPE\s+Ontology|<Ontology\s)", SYNTAXES[".owx"]),
    (rb"format-version:", SYNTAXES[".obo"]),
    (rb"<\?xml\s|<!DOCTYPE\s|<rdf:RDF\s", ox.RdfFormat.RDF_XML),
)
"""Patterns for the beginning of a document, whose format may differ from the format that the suffix of the file names."""
PREFIXED = (ox.RdfFormat.TURTLE, ox.RdfFormat.TRIG)
"""Formats whose documents may begin with a prefix."""
REMOTE = re.compile(rb'"@context"\s*:\s*(\[\s*)?"')
SECONDS, MEGABYTES = 60.0, 1_000
"""Maximum CPU seconds and megabytes of memory for the parser process of one document."""
MOST_EXPANDED = 50_000_000
"""Maximum number of bytes to which all entity references of a document may expand."""
PLAIN = re.compile(r"[^\s<>&%\"']*")
REFERENCE = re.compile(rb"&([^\s&;#]+);")
DECLARATION = re.compile(rb"<!(DOCTYPE|ENTITY)", re.IGNORECASE)
ADVICE = "save the ontology again without a document type (Protégé 5 writes none)"


class DocumentError(ValueError):
    """Raised if a document is rejected; the message states the reason and a remedy."""


def document(file: Path) -> tuple[bytes, ox.RdfFormat]:
    """Return the content of an RDF file in a form that is safe for the parser, and the file's format.

    Raises
    ------
    DocumentError
        The file has an unsupported format, is invalid XML, or contains external or recursive entities.
    OSError
        The file can't be read.
    """
    ending = file.suffix.lower()
    form: ox.RdfFormat | str | None = FORMATS.get(ending) or SYNTAXES.get(ending)
    if form is None:
        saved = "; a plan, an episode or verdicts aren't a scene: give the scene that they belong to" * (
            ending == ".json"
        )
        raise DocumentError(f"unknown kind of file; wanted one of {', '.join(FORMATS)}{saved}")
    content = file.read_bytes().removeprefix(BOM_UTF8)
    begin = re.sub(rb"^(\s*#[^\n]*\n|\s+)*", b"", content[:10_000])
    found = next((found for sign, found in SIGNS if re.match(sign, begin)), form)
    form = form if found in PREFIXED and form in PREFIXED else found
    if isinstance(form, str):
        raise DocumentError(
            f"is in {form}, which isn't read here; open it in Protégé and save it as Turtle or RDF/XML (File, Save as …), or "
            f"convert it: robot convert -i {file.name} -o {file.stem}.{'owl' if ending == '.ttl' else 'ttl'}"
        )
    if form == ox.RdfFormat.JSON_LD and REMOTE.search(content):
        raise DocumentError("its @context lies elsewhere, and nothing is fetched; put the context itself into the file")
    if form == ox.RdfFormat.RDF_XML:
        content = plain_xml(content)
    else:
        try:
            content.decode("utf-8")
        except UnicodeDecodeError as error:
            line = content.count(b"\n", 0, error.start) + 1
            raise DocumentError(f"line {line} isn't in UTF-8 ({error.reason}); save the file in UTF-8") from error
    return safe(content, form, Path(os.path.realpath(file)).as_uri())


def safe(content: bytes, form: ox.RdfFormat, base: str) -> tuple[bytes, ox.RdfFormat]:
    """Return a document and its format. A parser can read the document in time and memory that are proportional to its size.

    Deep nesting is rejected in every format. JSON-LD, in which each level may repeat its context, is parsed in a separate process
    and returned as TriG.

    Raises
    ------
    DocumentError
        The document is nested too deeply, or its parsing takes too much time or memory.
    SyntaxError
        The document isn't valid in its format.
    """
    json = form == ox.RdfFormat.JSON_LD
    xml = form == ox.RdfFormat.RDF_XML
    if (nested_elements(content) if xml else nested(content, JSON if json else TURTLE)) > MOST_NESTED:
        what = "elements" if xml else "brackets"
        raise DocumentError(
            f"refused, since its {what} are nested more than {MOST_NESTED:,} deep; say it in a flat way"
        )
    return (_parsed_apart(content, form.media_type, base), ox.RdfFormat.TRIG) if json else (content, form)


@lru_cache(maxsize=8)
def _parsed_apart(content: bytes, media_type: str, base: str) -> bytes:
    from subprocess import TimeoutExpired

    from confab.reasoner.workers import WorkerError, call, in_force

    left = current().left
    try:
        parsed: bytes = call(as_trig, content, media_type, base, seconds=SECONDS, megabytes=MEGABYTES, timeout=left)
    except TimeoutExpired:
        check("reading a document")
        raise
    except WorkerError as error:
        log.debug("%s", error)
        seconds = in_force(resource.RLIMIT_CPU, int(SECONDS))
        megabytes = in_force(resource.RLIMIT_AS, MEGABYTES * 1_000_000) // 1_000_000
        raise DocumentError(
            f"can't be read within {seconds} s and {megabytes:,} MB; give it one context, or save it as Turtle"
        ) from error
    return parsed


def as_trig(content: bytes, media_type: str, base: str) -> bytes:
    """Return a document converted to TriG."""
    form = ox.RdfFormat.from_media_type(media_type)
    assert form is not None
    quads = ox.parse(content, format=form, base_iri=base)
    found = list(quads)
    return ox.serialize(found, format=ox.RdfFormat.TRIG, prefixes=dict(quads.prefixes)) or b""


def plain_xml(content: bytes) -> bytes:
    """Return an XML document with only plain entities; a document without a document type is returned unchanged.

    >>> plain_xml(b'<!--<a>--><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>')
    b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'

    Raises
    ------
    DocumentError
        The document isn't XML, contains external or parameter entities, or would expand to more than `MOST_EXPANDED` bytes.
    """
    prolog = _Prolog()
    prolog.read(content)
    body = content[prolog.end :]
    if found := DECLARATION.search(body):
        raise DocumentError(f"refused, since '{found[0].decode()}' stands inside the document; {ADVICE}")
    if prolog.name is None:
        return content
    size = sum(
        number * len(prolog.entities.get(name, b"")) for name, number in Counter(REFERENCE.findall(body)).items()
    )
    if size > MOST_EXPANDED:
        raise DocumentError(f"refused, since its entities grow to {size:,} bytes when expanded; {ADVICE}")
    entities = b"".join(b'<!ENTITY %s "%s">' % entity for entity in prolog.entities.items())
    return b"<!DOCTYPE %s [%s]>" % (prolog.name, entities) + body


class _Prolog:
    """The part of an XML document before its first element: the name of the document type and the entities."""

    def __init__(self) -> None:
        self.name: bytes | None = None
        self.entities: dict[bytes, bytes] = {}
        self.end = -1

    def read(self, content: bytes) -> None:
        """Read a document, as UTF-8, up to its first element."""
        parser = expat.ParserCreate("utf-8")
        parser.StartDoctypeDeclHandler = self._doctype
        parser.EntityDeclHandler = self._entity
        parser.StartElementHandler = lambda *_: self._element(parser)
        try:
            parser.Parse(content, True)
        except _PrologIsReadError:
            return
        except expat.ExpatError as error:
            raise DocumentError(f"no XML: {error}") from error
        raise DocumentError("no XML: it has no element")

    def _element(self, parser: expat.XMLParserType) -> None:
        self.end = parser.CurrentByteIndex
        raise _PrologIsReadError

    def _doctype(self, name: str, system: str | None, public: str | None, _: bool) -> None:
        if system or public:
            raise DocumentError(f"refused, since its document type reads '{system or public}'; {ADVICE}")
        self.name = name.encode()

    def _entity(self, name: str, parameter: bool, value: str | None, *_: object) -> None:
        if parameter or value is None or not PLAIN.fullmatch(value):
            raise DocumentError(
                f"refused, since its entity '{name}' reads another file or grows when expanded; {ADVICE}"
            )
        self.entities.setdefault(name.encode(), value.encode())


class _PrologIsReadError(Exception):
    """Raised at the first element to end the reading of the prolog."""
