"""The site has the content of the pages: the same headings, code blocks, tables and lists; the reference has every public name."""

import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

import confab
from confab.planner.plan import Outcome, Plan, Step

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
VOID = {"area", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr"}
CAN_BUILD = find_spec("mkdocs") is not None and find_spec("material") is not None
Shown = tuple[str, str]
"""A kind of block (heading, code, table, list), and its text without markup and surrounding white space."""


def words(text: str) -> str:
    """Return a text with single spaces, and without typographic quotes and entities, so that page and site can be compared."""
    return " ".join(text.replace("\xa0", " ").split())


def written(text: str) -> Iterator[Shown]:
    """Yield the blocks of a page, parsed as CommonMark with tables, like on GitHub."""
    tokens = MarkdownIt("commonmark", {"html": True}).enable("table").parse(text)
    for i, token in enumerate(tokens):
        if token.type == "heading_open":
            yield token.tag, words(plain(tokens[i + 1]))
        elif token.type in ("fence", "code_block"):
            yield "code", token.content.strip()
        elif token.type == "table_open":
            cells = (tokens[j + 1] for j in range(i, closing(tokens, i)) if tokens[j].type in ("th_open", "td_open"))
            yield "table", words(" ".join(plain(cell) for cell in cells))
        elif token.type == "list_item_open":
            yield "item", words(plain(next(one for one in tokens[i:] if one.type == "inline"))).split(" ")[0]


def closing(tokens: list[Token], start: int) -> int:
    """Return the index of the token that closes the block that token number `start` opens."""
    return next(
        i for i in range(start, len(tokens)) if tokens[i].nesting == -1 and tokens[i].level == tokens[start].level
    )


def plain(inline: Token) -> str:
    """Return the text of an inline token without its markup."""
    return "".join(
        child.content if child.type in ("text", "code_inline") else " " if child.type.endswith("break") else ""
        for child in inline.children or ()
    )


class Rendered(HTMLParser):
    """Collects the blocks of a page of the site, and the text of its paragraphs."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.skipping = ""
        self.blocks: list[tuple[str, list[str]]] = []
        self.paragraphs: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.names |= {given["id"]} if "id" in given else set()
        if tag in VOID:
            return
        if not self.inside and tag != "article":
            return
        self.open.append(tag)
        if self.skipping:
            return
        if given.get("class") in ("headerlink", "filename", "doc-labels") or tag in ("style", "script", "button"):
            self.skipping = "/".join(self.open)
        elif tag == "pre":
            self.blocks.append(("code", []))
        elif tag == "table":
            self.blocks.append(("table", []))
        elif re.fullmatch("h[1-6]", tag):
            self.blocks.append((tag, []))
        elif tag == "li":
            self.blocks.append(("item", []))
        elif tag == "p":
            self.paragraphs.append("")

    @property
    def inside(self) -> bool:
        return bool(self.open)

    def handle_endtag(self, tag: str) -> None:
        if not self.inside or tag in VOID:
            return
        if self.skipping == "/".join(self.open):
            self.skipping = ""
        while self.open.pop() != tag:
            pass
        if tag in ("td", "th") and self.blocks and self.blocks[-1][0] == "table":
            self.blocks[-1][1].append(" ")

    def handle_data(self, data: str) -> None:
        if not self.inside or self.skipping:
            return
        if "p" in self.open and self.paragraphs:
            self.paragraphs[-1] += data
        holders = {"pre": "code", "table": "table", "li": "item"} | {f"h{i}": f"h{i}" for i in range(1, 7)}
        innermost = next((holders[tag] for tag in reversed(self.open) if tag in holders), None)
        if innermost and self.blocks and self.blocks[-1][0] == innermost:
            self.blocks[-1][1].append(data)

    def shown(self) -> list[Shown]:
        """Return the blocks in the form of `written`."""
        return [
            (kind, text.strip() if kind == "code" else words(text).split(" ")[0] if kind == "item" else words(text))
            for kind, parts in self.blocks
            for text in ["".join(parts)]
        ]


def rendered(page: Path) -> Rendered:
    parser = Rendered()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser


def build(sources: Path, site: Path) -> None:
    """Build the site in strict mode, in which a warning is an error."""
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-f", str(sources / "mkdocs.yml"), "-d", str(site)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site that `make docs` builds, without a warning."""
    folder = tmp_path_factory.mktemp("site")
    build(ROOT, folder)
    return folder


needs_mkdocs = pytest.mark.skipif(not CAN_BUILD, reason="needs the extra docs")


@needs_mkdocs
def test_every_page_of_the_site_has_the_blocks_of_its_source(site: Path) -> None:
    for page in PAGES:
        source = list(written(page.read_text(encoding="utf-8")))
        shown = rendered((site / page.relative_to(DOCS)).with_suffix(".html")).shown()
        if page.stem == "reference":  # the docstrings add further blocks
            shown = [block for block in shown if block in source]
        assert shown == source, page.name


@needs_mkdocs
def test_no_paragraph_of_the_site_contains_markup(site: Path) -> None:
    for page in PAGES:
        for text in rendered((site / page.relative_to(DOCS)).with_suffix(".html")).paragraphs:
            assert not re.search(r"^\s*(```|\||#+ |[-*] |:::)|\]\(|`", text, re.MULTILINE), f"{page.name}: {text}"


@needs_mkdocs
def test_the_reference_shows_every_public_method_also_inherited_ones(site: Path) -> None:
    names = rendered(site / "reference.html").names
    homes = {name: getattr(confab, name) for name in confab.__all__} | {
        f"planner.plan.{one.__name__}": one for one in (Plan, Step, Outcome)
    }
    wanted = {
        f"confab.{name}.{member}" if member else f"confab.{name}"
        for name, home in homes.items()
        for member in ["", *(methods(home) if inspect.isclass(home) else ())]
    }
    assert sorted(wanted - names) == []


def methods(home: type) -> list[str]:
    """Return the names of the public methods and properties of a class that classes of this project define."""
    return [
        name
        for name in dir(home)
        if not name.startswith("_")
        and isinstance(inspect.getattr_static(home, name), property | classmethod | staticmethod | type(methods))
        and any(name in vars(base) for base in home.__mro__ if base.__module__.startswith("confab"))
    ]


@needs_mkdocs
def test_a_fence_that_the_site_can_not_parse_is_detected(tmp_path: Path) -> None:
    text = "# Page\n\n```turtle toys/toys.ttl\n# Object types\n:a :b :c .\n```\n"
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text(text)
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[0]
    (tmp_path / "mkdocs.yml").write_text(config.replace("strict: true", "strict: false"))
    build(tmp_path, tmp_path / "site")
    page = rendered(tmp_path / "site" / "index.html")
    assert list(written(text)) == [("h1", "Page"), ("code", "# Object types\n:a :b :c .")]
    assert page.shown() != list(written(text))
