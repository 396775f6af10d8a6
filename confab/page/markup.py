"""Construction of HTML: plain text is escaped, and markup is inserted unchanged."""

from __future__ import annotations

import re
from functools import cache
from html import escape
from math import pi
from pathlib import Path

EMPTY = frozenset({"br", "circle", "img", "line", "path", "rect", "source", "use"})


class Markup(str):
    """Text that is valid HTML."""

    __slots__ = ()


def tag(name: str, *inner: object, **attributes: object) -> Markup:
    """Return an HTML element.

    Attributes that are None or False are omitted. Attributes may have names like ``class_`` and ``data_x``.

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
    """Concatenate parts: text is escaped, lists are flattened, and None is skipped."""
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


UNITS = {"m": ("mm", 1000.0), "rad": ("°", 180 / pi), "n": ("N", 1.0), "s": ("s", 1.0)}
"""The unit and the factor with which the page displays a measurement, by the ending of the measurement's name."""
MEASURED = re.compile(r" \(\w+ [-\d.e+]+(, \w+ [-\d.e+]+)*\)$")


def measurement(name: str, value: float) -> tuple[str, str]:
    """Return the name and the value of a measurement as texts.

    >>> measurement("tip_error_m", 0.0041), measurement("tilt_rad", 0.5), measurement("beads", 12)
    (('tip error', '4.1 mm'), ('tilt', '28.6°'), ('beads', '12'))
    """
    words, _, end = name.rpartition("_")
    unit, factor = UNITS.get(end, ("", 1.0)) if words else ("", 1.0)
    shown = number(0.0 if abs(value * factor) < 1e-3 else value * factor)
    return (words if unit else name).replace("_", " "), shown + (unit if unit == "°" else f" {unit}" if unit else "")


def spaced(name: str) -> str:
    """Return a name in camel case or with underscores as separate words.

    >>> spaced("sourcePlace"), spaced("beside_place")
    ('source place', 'beside place')
    """
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).replace("_", " ").lower()


def plain(note: str) -> str:
    """Return the note of a verdict without the measurements at its end."""
    return MEASURED.sub("", note)


@cache
def asset(name: str) -> str:
    """Return the text of a file in the folder of this module."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


@cache
def script() -> str:
    """Return the script of the page, which joins the files of the folder `script` in their order."""
    parts = sorted((Path(__file__).parent / "script").glob("*.js"))
    return "\n".join(part.read_text(encoding="utf-8") for part in parts)


def styled(*pieces: object) -> str:
    """Return pieces of HTML with their style sheet, so that the style of the notebook doesn't affect them."""
    return str(tag("div", tag("style", Markup(asset("page.css"))), *pieces, class_="confab"))
