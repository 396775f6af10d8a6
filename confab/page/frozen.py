"""The page as one HTML file that needs neither a server nor a network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from pathlib import Path
from string import Template

from confab.page.markup import asset, script
from confab.page.schema import PageData
from confab.reasoner.graph.knowledge import KnowledgeError


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

    if Path(path).suffix.lower() not in ("", ".html", ".htm", ".xhtml"):
        raise KnowledgeError(f"{path}: a page is HTML; wanted a name that ends in .html")
    write_whole(Path(path), page_html(data, data["title"]))
    return Path(path)
