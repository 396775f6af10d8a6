"""HTML as values: what is text is escaped, what is markup stays as it is."""

from __future__ import annotations

from functools import cache
from html import escape
from pathlib import Path

EMPTY = frozenset({"br", "circle", "img", "line", "path", "rect", "source", "use"})


class Markup(str):
    """Text that is HTML already."""

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
    """Return parts one behind the other: text is escaped, lists are taken apart, None is nothing."""
    found = []
    for part in parts:
        if isinstance(part, Markup):
            found.append(str(part))
        elif isinstance(part, list | tuple):
            found.append(str(joined(*part)))
        elif part is not None:
            found.append(escape(str(part)))
    return Markup("".join(found))


@cache
def asset(name: str) -> str:
    """Return a file that lies beside this one."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def styled(*pieces: object) -> str:
    """Return pieces with their style, as a notebook shows them: nothing is fetched, nothing else on the page is touched."""
    return str(tag("div", tag("style", Markup(asset("style.css"))), *pieces, class_="confab"))
