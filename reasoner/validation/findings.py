"""Findings of validation, with the file, the line, a description of the fault, its consequence and the remedy."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import KnowledgeGraph, readable
from confab.reasoner.limits import check
from confab.reasoner.names import local_name
from confab.reasoner.updates.texts import TextPosition
from confab.reasoner.vocabulary import CORE, RDFS

ERROR, WARNING, REMARK = "error", "warning", "remark"
CAUSES = ("unreadable", "undeclared-term")
"""Rules whose findings are listed first because other findings may be their consequences."""

LABEL = ox.NamedNode(RDFS + "label")
NAME = re.compile(r"[:/#]([^\s:/#<>()\[\]\"',;]+)(?<!\.)")
PREFIX = re.compile(r"^\s*@?prefix\s+([\w.-]*):\s*<([^>]*)>", re.MULTILINE | re.IGNORECASE)
TEXTS = tuple(ox.NamedNode(CORE + name) for name in ("update", "construct"))


@dataclass(frozen=True, order=True)
class Finding:
    """A fault in an ontology, or a remark on the ontology.

    Attributes
    ----------
    file : str
        Path of the file that contains the node.
    line : int
        The line of the node's first occurrence in the file, counted from 1; 0 if unknown.
    node, label : str
        IRI and label (or local name) of the term at fault; both are empty if the finding is about the whole file.
    rule : str
        Name of the violated rule.
    what, why, remedy : str
        The fault, its consequence, and its remedy.
    severity : str
        ``error``; ``warning`` for a fault that doesn't prevent planning; ``remark`` for information.
    """

    file: str
    line: int
    node: str
    label: str
    rule: str
    what: str
    why: str
    remedy: str
    severity: str = ERROR

    @property
    def serious(self) -> bool:
        """Whether the finding is an error."""
        return self.severity == ERROR

    def __str__(self) -> str:
        """Return the finding in the format of compiler messages."""
        return f"{self.headline}\n{self.advice}"

    @property
    def headline(self) -> str:
        """The position, the fault and the rule, in one line."""
        place = f"{self.file}:{self.line}" if self.line else self.file
        place += "" if self.serious else f": {self.severity}"
        return f"{place}: {self.what} [{self.rule}]"

    @property
    def advice(self) -> str:
        """The consequence and the remedy, in two lines."""
        return f"    why: {self.why}\n    do:  {self.remedy}"

    def as_dict(self) -> dict[str, str | int]:
        """Return the finding as a dictionary that can be written as JSON."""
        return asdict(self)


def listing(findings: Sequence[Finding]) -> str:
    """Return the text of findings for a terminal. Errors come last; advice that several findings share is printed once."""
    parts = []
    for severity in (REMARK, WARNING, ERROR):
        own = [finding for finding in findings if finding.severity == severity]
        if severity != ERROR:
            own.sort(key=lambda finding: (finding.rule, finding))
        together = groupby(own, lambda finding: (finding.rule, finding.advice))
        lines = [line for (_, advice), group in together for line in (*(one.headline for one in group), advice)]
        parts += ["\n".join(lines)] if lines else []
    return "\n\n".join(parts)


class Places:
    """File, line and label of the nodes in a loaded graph; the files are parsed when the first finding needs the files."""

    def __init__(self, graph: KnowledgeGraph) -> None:
        self.graph = graph
        self._lines: dict[Path, _LineIndex] = {}

    def finding(self, rule: str, node: str, what: str, why: str, remedy: str, severity: str = ERROR) -> Finding:
        """Return a finding on a node; for a node that was compiled from an update, the position is in the update."""
        check("validating the ontology")
        if node in self.graph.written:
            return self.in_update(rule, self.graph.written[node], what, why, remedy, severity)
        file = self._files.get(node) or self._naming(node) or self.graph.path
        return Finding(
            str(file or ""), self._line(file, node), node, self.label(node), rule, what, why, remedy, severity
        )

    def in_update(
        self, rule: str, place: TextPosition, what: str, why: str, remedy: str, severity: str = ERROR
    ) -> Finding:
        """Return a finding on a part of an update, with the behaviour as the node, and the line of the part."""
        node = place.behavior
        file = self._files.get(node) or self.graph.path
        line = self._line(file, node)
        said = [
            quad for text in TEXTS for quad in self.graph.store.quads_for_pattern(ox.NamedNode(node), text, None, None)
        ]
        texts = [quad.object.value for quad in said if isinstance(quad.object, ox.Literal)]
        if file and line and texts and (begin := file.read_text(encoding="utf-8").find(texts[0])) >= 0:
            line = file.read_text(encoding="utf-8").count("\n", 0, begin) + place.line
        return Finding(str(file or ""), line, node, self.label(node), rule, f"{what} ({place})", why, remedy, severity)

    def label(self, node: str) -> str:
        """Return the label of a node, preferably in English; for a node without a label, return its local name."""
        try:
            quads = self.graph.store.quads_for_pattern(ox.NamedNode(node), LABEL, None, None)
        except ValueError:  # a blank node has no IRI
            return ""
        found = [quad.object for quad in quads if isinstance(quad.object, ox.Literal)]
        found.sort(key=lambda literal: (literal.language != "en", literal.value))
        return found[0].value if found else local_name(node)

    def _naming(self, node: str) -> Path | None:
        """Return a file that mentions a node; this is for nodes about which no file contains statements."""
        name = local_name(node)
        for file in self.graph.files.values():
            text = file.read_text(encoding="utf-8") if file.suffix == ".ttl" else ""
            if node.startswith("file:") and f"<{relative(node, file)}>" in text:
                return file
            short = f"<{node.removesuffix(name)}>" in text and re.search(rf":{re.escape(name)}\b", text)
            if short or f"<{node}>" in text:
                return file
        return None

    def _line(self, file: Path | None, node: str) -> int:
        if file is None:
            return 0
        if file not in self._lines:
            self._lines[file] = _LineIndex(file)
        return self._lines[file].of(node)

    @cached_property
    def _files(self) -> Mapping[str, Path]:
        files: dict[str, Path] = {}
        said = [_subjects(file) for file in self.graph.files.values()]
        for part in ("typed", "other"):
            for file, subjects in zip(self.graph.files.values(), said, strict=True):
                files = dict.fromkeys(subjects[part], file) | files
        return files


def fill(template: str, words: Mapping[str, str]) -> str:
    """Replace each ``{name}`` in a template by the word for this name; names without a word are kept.

    >>> fill("{node} has no {what}", {"node": "cup1"})
    'cup1 has no {what}'
    """
    return re.sub(r"\{(\w+)\}", lambda match: words.get(match[1], match[0]), template)


def unique(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings without duplicates. Findings that may be causes come first; all findings are sorted by file and line."""
    return sorted(set(findings), key=lambda finding: (finding.rule not in CAUSES, finding))


def _subjects(file: Path) -> dict[str, list[str]]:
    """Return the subjects in a file, in two groups: subjects with a stated class (``typed``), and other subjects (``other``)."""
    found: dict[str, list[str]] = {"typed": [], "other": []}
    with readable(file) as (content, form):
        for quad in ox.parse(content, format=form, base_iri=file.as_uri()):
            if isinstance(quad.subject, ox.NamedNode):
                found["typed" if quad.predicate.value.endswith("#type") else "other"].append(quad.subject.value)
    return found


def relative(node: str, file: Path) -> str:
    """Return an IRI relative to the IRI of a file.

    >>> relative("file:///tmp/a.ttl#x", Path("/tmp/a.ttl")), relative("file:///tmp/x", Path("/tmp/a.ttl"))
    ('#x', 'x')
    """
    own = file.resolve().as_uri()
    return node.removeprefix(own) if node.startswith(own) else node.removeprefix(f"{own.rpartition('/')[0]}/")


class _LineIndex:
    """The lines of a Turtle file: the first line that begins with a word, and the first line that mentions a name."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.text = file.read_text(encoding="utf-8") if file.suffix == ".ttl" else ""
        self.heads, self.names = dict[str, int](), dict[str, int]()
        for number, line in enumerate(self.text.split("\n"), 1):
            self.heads.setdefault(re.split(r"\s", line, maxsplit=1)[0], number)
            for name in NAME.findall(line):
                self.names.setdefault(name, number)
        self.prefixes: dict[str, list[str]] = defaultdict(list)
        for prefix, space in PREFIX.findall(self.text):
            self.prefixes[space].append(prefix)

    def of(self, node: str) -> int:
        """Return the first line that states something about a node, or else the first line that mentions the node, or else 0."""
        short = local_name(node)
        if node.startswith("file:") and (begin := self.text.find(f"<{relative(node, self.file)}>")) >= 0:
            return self.text.count("\n", 0, begin) + 1
        words = [*(f"{prefix}:{short}" for prefix in self.prefixes.get(node.removesuffix(short), ())), f"<{node}>"]
        found = [self.heads[word] for word in words if word in self.heads]
        return min(found) if found else self.names.get(short, 0)
