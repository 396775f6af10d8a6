"""How deeply a document is nested, bounded from its bytes: the time or memory of some parsers grows with the square of it."""

from __future__ import annotations

MOST_NESTED = 1_000
"""Levels that every parser here reads without trouble; ontologies have some ten."""
PIECE = 256
"""Bytes that are looked at at once; by so much the bound may be too large."""


def nested(content: bytes) -> int:
    """Return an upper bound of how many brackets are open at once; brackets inside texts count as well.

    >>> nested(b"[" * 5000 + b"]" * 5000), nested(b"[]" * 5000)
    (5000, 256)
    """
    return _bound(content, (b"[", b"(", b"{"), (b"]", b")", b"}"))


def nested_elements(content: bytes) -> int:
    """Return such a bound for the elements of an XML document.

    >>> nested_elements(b"<a>" * 5000 + b"</a>" * 5000), nested_elements(b"<!-- b --><a><b/></a>" * 5000) < 256
    (5000, True)
    """
    for sign, put in ((b"<!", b""), (b"<?", b""), (b"</", b"\0"), (b"/>", b"\0")):
        content = content.replace(sign, put)
    return _bound(content, (b"<",), (b"\0",))


def _bound(content: bytes, opening: tuple[bytes, ...], closing: tuple[bytes, ...]) -> int:
    depth = lowest = most = 0
    for begin in range(0, len(content), PIECE):
        piece = content[begin : begin + PIECE]
        opened, closed = sum(map(piece.count, opening)), sum(map(piece.count, closing))
        lowest = min(lowest, depth - closed)
        most = max(most, depth + opened - lowest)
        depth += opened - closed
    return most
