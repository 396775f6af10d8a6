"""The page as one HTML file that needs neither a server nor a network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from string import Template

from confab.accepting import named_for
from confab.page.markup import asset, script
from confab.page.schema import PageData
from confab.reasoner.kinds import REPORT


def page_html(data: Mapping[str, object] | PageData | None, title: str) -> str:
    """Return the page as HTML text with embedded data. Without `data`, the page requests its data from the server."""
    content = json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    return Template(asset("page.html")).substitute(
        title=escape(title), style=asset("page.css"), data=content, script=script()
    )


def write_page(path: str | Path, data: PageData) -> Path:
    """Write the page with embedded data into a file atomically, and return the path.

    Raises
    ------
    KnowledgeError
        The name of the file ends in the suffix of another format.
    """
    from confab.reasoner.files import write_whole

    path = named_for(REPORT, path)
    write_whole(path, page_html(data, data["title"]))
    return path
