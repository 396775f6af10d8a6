"""The nesting depth of documents.

The depth is checked before parsing, because the time, memory or stack that some parsers need grows much faster than the depth.
"""

from __future__ import annotations

import re
from contextlib import suppress
from xml.parsers import expat

MOST_NESTED = 1_000
"""Maximum nesting depth of a document; all parsers in use can read this depth. The nesting depth of ontologies is about ten."""
PIECE = 256
"""Number of bytes in a piece of the document. Brackets are counted piece by piece, so that the depth may be overestimated by at
most this number."""
TURTLE = re.compile(
    rb'"""[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"""|\'\'\'[^\'\\]*(?:(?:\\.|\'(?!\'\'))[^\'\\]*)*\'\'\'|'
    rb'"[^"\\\n]*(?:\\.[^"\\\n]*)*"|\'[^\'\\\n]*(?:\\.[^\'\\\n]*)*\'|<[^<>"{}|^`\\\s]*>|#[^\n]*',
    re.DOTALL,
)
"""Pattern of the literals, IRIs and comments of Turtle and related formats. Brackets in them aren't counted."""
JSON = re.compile(rb'"[^"\\]*(?:\\.[^"\\]*)*"', re.DOTALL)
OPENING, CLOSING = (b"[", b"(", b"{", b"<<"), (b"]", b")", b"}", b">>")


def nested(content: bytes, quoted: re.Pattern[bytes] = TURTLE) -> int:
    """Return an upper bound of the nesting depth of brackets; brackets inside matches of `quoted` aren't counted.

    >>> nested(b"[" * 5000 + b"]" * 5000), nested(b"[]" * 5000), nested(b'"[" ' * 5000)
    (5000, 256, 0)
    """
    if (brackets := sum(map(content.count, OPENING))) <= MOST_NESTED:
        return brackets
    content = quoted.sub(b"", content)
    depth = lowest = most = 0
    for begin in range(0, len(content), PIECE):
        piece = content[begin : begin + PIECE]
        opened, closed = sum(map(piece.count, OPENING)), sum(map(piece.count, CLOSING))
        lowest = min(lowest, depth - closed)
        most = max(most, depth + opened - lowest)
        depth += opened - closed
    return most


def nested_elements(content: bytes) -> int:
    """Return the nesting depth of elements in an XML document, up to the first syntax error.

    >>> nested_elements(b"<a>" * 5000 + b"</a>" * 5000), nested_elements(b"<a>" + b"<b></b>" * 5000)
    (5000, 2)
    """
    if content.count(b"<") <= MOST_NESTED:
        return content.count(b"<")
    depth = most = 0

    def begin(*_: object) -> None:
        nonlocal depth, most
        depth += 1
        most = max(most, depth)

    def end(_: object) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    with suppress(expat.ExpatError):  # reported when the document is read
        parser.Parse(content, True)
    return most
