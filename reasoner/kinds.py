"""The kinds of files that Confab writes, recognised by their content.

Reports, pictures and films contain the maker's name "Confab". Plans and verdicts have specific keys; memories and episodes have
specific properties. Files for further editing (scenes, PDDL) end with a stamp: a comment with a hash of the content above the
stamp. If a file is edited, its stamp no longer fits, and the file is no longer recognised. Confab considers all other files as
foreign.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.nesting import MOST_NESTED, nested
from confab.reasoner.vocabulary import CORE, EPISODES, OWL, RDF

MAKER = "Made by Confab"
"""The maker's name in the metadata of pictures and films."""
REPORT, PICTURE, FILM = "a report", "a picture", "a film"
PLAN, VERDICTS, ROWS, TRIPLES = "a plan", "verdicts", "rows of a query", "triples of a query"
MEMORY, EPISODE, OBSERVED, REACH = "a memory", "an episode", "observed facts", "facts of what hands reach"
TRAJECTORIES = "trajectories"
GENERATED, SAVED, IMPORTED, CONVERTED, CONSTRUCTED = (
    "a generated scene",
    "a saved scene",
    "an imported scene",
    "a converted ontology",
    "a constructed ontology",
)
RUN = "the record of a run"
TREE = "an exported behaviour tree"
DOMAIN, PROBLEM, CATALOG = "an exported PDDL domain", "an exported PDDL problem", "a catalog"
STAMP = re.compile(rb"(<!-- )?[#;] Written by Confab: (?P<kind>[^;\n]+); SHA-256 (?P<hash>[0-9a-f]{64})( -->)?\n?\Z")
STAMP_BYTES = 200
"""A stamp is searched in this number of bytes at the end of a file."""
HEAD_BYTES = 4096
PICTURES = (b"\x89PNG\r\n\x1a\n", b"%PDF-")
GENERATOR = re.compile(rb'<meta name="generator" content="Confab"')


@dataclass(frozen=True)
class Kind:
    """The kind of a file's content.

    Parameters
    ----------
    name : str
        The name of the kind in messages, with its article.
    foreign : bool
        True for kinds of files that Confab doesn't write; such files are never overwritten.
    columns : tuple of str, optional
        The columns of query results; None if the columns are unknown, or if the file has no columns.
    """

    name: str
    foreign: bool = False
    columns: tuple[str, ...] | None = None

    def __str__(self) -> str:
        return f"{self.name} (columns {', '.join(self.columns)})" if self.columns else self.name

    def replaces(self, old: Kind) -> bool:
        """Return whether content of this kind may replace content of the kind `old`."""
        same_columns = None in (self.columns, old.columns) or self.columns == old.columns
        return not old.foreign and self.name == old.name and same_columns


def stamped(kind: str, content: Iterable[str], comment: str = "#") -> Iterator[str]:
    """Yield the pieces of a text and then a stamp, which is a comment with the kind of the text and a hash of its content.

    >>> print("".join(stamped("a text", ["one"])).strip())
    one
    # Written by Confab: a text; SHA-256 2c8b08da5ce60398e1f19af0e5dccc744df274b826abe585eaba68c525434806
    """
    digest, piece = sha256(), "\n"
    for piece in content:
        digest.update(piece.encode("utf-8"))
        yield piece
    if not piece.endswith("\n"):
        digest.update(b"\n")
        yield "\n"
    end = " -->" if comment.startswith("<!--") else ""
    yield f"{comment} Written by Confab: {kind}; SHA-256 {digest.hexdigest()}{end}\n"


def kind_of(file: Path, suffix: str | None = None) -> Kind | None:
    """Return the kind of a file's content; return None for an empty file.

    Parameters
    ----------
    file : Path
    suffix : str, optional
        The suffix that distinguishes CSV from other texts; by default the file's suffix.

    Raises
    ------
    OSError
        The file can't be read.
    """
    content = file.read_bytes()
    text = content.strip()
    if not text:
        return None
    return (
        _binary(content) or _stamp(content) or _marked_up(text) or _json(text) or _turtle(text) or _rows(file, suffix)
    )


def _binary(content: bytes) -> Kind | None:
    film = content[:4] == b"GIF8" or content[4:8] == b"ftyp"
    if film or content.startswith(PICTURES) or b"<svg" in content[:HEAD_BYTES]:
        if MAKER.encode() in content:
            return Kind(FILM if film else PICTURE)
        return Kind(f"{FILM if film else PICTURE} from elsewhere", foreign=True)
    return Kind("binary data", foreign=True) if b"\0" in content[:HEAD_BYTES] else None


def _stamp(content: bytes) -> Kind | None:
    if found := STAMP.search(content, max(0, len(content) - STAMP_BYTES)):
        name = found["kind"].decode("utf-8", "replace")
        edited = sha256(content[: found.start()]).hexdigest() != found["hash"].decode()
        return Kind(f"{name} that was edited since", foreign=True) if edited else Kind(name)
    if re.match(rb"(\s|;[^\n]*\n)*\(define\s", content):
        return Kind("PDDL", foreign=True)
    return None


def _marked_up(text: bytes) -> Kind | None:
    head = text[:HEAD_BYTES]
    if re.match(rb"<!doctype html|<html", head, re.IGNORECASE):
        return Kind(REPORT) if GENERATOR.search(head) else Kind("an HTML page from elsewhere", foreign=True)
    if re.match(rb"(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<catalog\s", head, re.DOTALL):
        return Kind(CATALOG)
    if re.match(rb"(<\?xml[^>]*>\s*)?<sparql\s", head):
        return Kind(ROWS, columns=tuple(name.decode() for name in re.findall(rb'<variable name="([^"]+)"', head)))
    if re.match(rb"<\?xml|<\w+:RDF\s", head):
        return Kind("an XML document", foreign=True)
    return None


def _json(text: bytes) -> Kind | None:
    if not text.startswith((b"{", b"[", b"true", b"false")):
        return None
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return None
    match data:
        case {"scene": _, "status": _, "search": _, "seconds": _}:
            return Kind(PLAN)
        case {"status": _, "success": _, "rollouts": list()}:
            return Kind(VERDICTS)
        case {"scene": _, "status": _, "events": list(), "course": list()}:
            return Kind(EPISODE)
        case {"run": _, "when": _, "how": _, "page": _}:
            return Kind(RUN)
        case {"scene": _, "rate": _, "primitives": list()}:
            return Kind(TRAJECTORIES)
        case {"head": {"vars": list(names)}, "results": _}:
            return Kind(ROWS, columns=tuple(map(str, names)))
        case bool() | [] | {"head": _, "boolean": _}:
            return Kind(ROWS)
        case [{}, *_] if all(isinstance(row, dict) and row.keys() == data[0].keys() for row in data):
            return Kind(ROWS, columns=tuple(data[0]))
    return Kind("JSON from elsewhere", foreign=True)


def _turtle(text: bytes) -> Kind | None:
    """Return the kind of a Turtle file according to its first distinctive triple; return None for a text that isn't Turtle."""
    some = False
    if nested(text) <= MOST_NESTED:
        try:
            for triple in ox.parse(text, format=ox.RdfFormat.TURTLE, base_iri="urn:confab:file"):
                some = True
                if kind := _told_by(triple):
                    return Kind(kind)
        except SyntaxError:
            some = some or text.startswith((b"@prefix", b"@base", b"PREFIX"))
    return Kind("a scene or another ontology", foreign=True) if some else None


def _told_by(triple: ox.Quad) -> str | None:
    predicate, value = triple.predicate.value, getattr(triple.object, "value", "")
    if predicate in (CORE + "memoryFormat", CORE + "associatedWith"):
        return MEMORY
    if predicate == EPISODES + "scene":
        return EPISODE
    if predicate == CORE + "inputsHash":
        return REACH
    header = predicate == RDF + "type" and value == OWL + "Ontology"
    return OBSERVED if header and str(triple.subject).endswith(".observed>") else None


def _rows(file: Path, suffix: str | None) -> Kind:
    """Return the kind of a text that no other check recognises.

    A text contains query results if its first line is a list of columns in the file format that the suffix denotes.
    """
    with file.open(encoding="utf-8", errors="replace", newline="") as lines:
        first = lines.readline(HEAD_BYTES).rstrip("\r\n")
    columns: tuple[str, ...] = ()
    ending = (suffix or file.suffix).lower()
    if ending == ".csv":
        columns = tuple(next(csv.reader([first]), ()))
    elif ending == ".tsv" and first.startswith("?"):
        columns = tuple(name[1:] for name in first.split("\t"))
    elif ending == ".txt":
        columns = tuple(re.split(r" {2,}", first))
    names = columns and all(re.fullmatch(r"\w+", name) for name in columns)
    return Kind(ROWS, columns=columns) if names else Kind("a text", foreign=True)
