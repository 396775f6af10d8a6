"""HTML as values: text is escaped, markup is not."""

from __future__ import annotations

from functools import cache
from html import escape
from pathlib import Path

EMPTY = frozenset({"br", "circle", "img", "line", "path", "rect", "source", "use"})


class Markup(str):
    """Text that is valid HTML."""

    __slots__ = ()


def tag(name: str, *inner: object, **attributes: object) -> Markup:
    """Return an element; attributes that are None or False are left out, ``class_`` is the class and ``data_x`` is ``data-x``.

    >>> tag("p", "a < b ", tag("b", "yes"), class_="note", title=None)
    '<p class="note">a &lt; b <b>yes</b></p>'
    """
    shown = "".join(
        f" {key.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{escape(str(value))}"')
        for key, value in attributes.items()
        if value is not None and value is not False
    )
    if name in EMPTY and not inner:
        return Markup(f"<{name}{shown}/>" if name not in ("br", "img", "source") else f"<{name}{shown}>")
    return Markup(f"<{name}{shown}>{joined(*inner)}</{name}>")


def joined(*parts: object) -> Markup:
    """Return the concatenation of parts: text is escaped, lists are flattened, None is skipped."""
    found = []
    for part in parts:
        if isinstance(part, Markup):
            found.append(str(part))
        elif isinstance(part, list | tuple):
            found.append(str(joined(*part)))
        elif part is not None:
            found.append(escape(str(part)))
    return Markup("".join(found))


def number(value: float) -> str:
    """Return a number as text with about three significant digits."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


@cache
def asset(name: str) -> str:
    """Return the text of a file in this folder."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


@cache
def script() -> str:
    """Return the page's script: the parts in the folder `script`, in their order, as one module."""
    parts = sorted((Path(__file__).parent / "script").glob("*.js"))
    return "\n".join(part.read_text(encoding="utf-8") for part in parts)


def styled(*pieces: object) -> str:
    """Return pieces with their style for a notebook, without external files and without effect on the rest of the page."""
    return str(tag("div", tag("style", Markup(asset("page.css"))), *pieces, class_="confab"))
