"""The faults that validation must detect; each is inserted into the domain that `confab new` writes.

`python -m tests.ontology.faults` writes the table of docs/validation.md again.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from confab import ontology
from confab.reasoner.validation.findings import Finding
from confab.reasoner.validation.validate import validate

NAME, WITH_BODIES = "washing", "watering"
DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "validation.md"
BEGIN, END = "<!-- faults -->\n", "<!-- end of faults -->\n"


@dataclass(frozen=True)
class Fault:
    """A fault: its description, the rule that must detect it, its file, and the text that is replaced or added."""

    title: str
    rule: str
    file: str
    old: str
    new: str
    deep: bool


def faults() -> Iterator[Fault]:
    """Yield the faults that faults.txt describes."""
    for block in Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").split("\n## ")[1:]:
        title, *lines = block.rstrip("\n").split("\n")
        said = dict(line.split(": ", 1) for line in lines if line[:1] not in "-+")
        old, new = ("\n".join(line[2:] for line in lines if line[:1] == sign) for sign in "-+")
        name = WITH_BODIES if "bodies" in said else NAME
        file = f"{name}.ttl" if said["file"] == "domain" else f"{name}-{said['file']}.ttl"
        yield Fault(title, said["rule"], file, old, new, "deep" in said)


FAULTS = tuple(faults())


def skeleton(folder: Path, name: str = NAME) -> Path:
    """Write the skeleton domain, or the skeleton with bodies, into a folder; return the scene's file."""
    for template in sorted((ontology.ROOT / "skeleton" / ("bodies" if name == WITH_BODIES else "")).glob("*.ttl")):
        text = template.read_text(encoding="utf-8").replace("_DOMAIN_", name)
        (folder / template.name.replace("_DOMAIN_", name)).write_text(text, encoding="utf-8")
    return folder / f"{name}-scene.ttl"


def seed(fault: Fault, folder: Path) -> Path:
    """Write the skeleton with one fault; return the scene's file."""
    scene = skeleton(folder, fault.file.removesuffix(".ttl").partition("-")[0])
    file = folder / fault.file
    text = file.read_text(encoding="utf-8")
    if fault.old:
        assert fault.old in text, f"{fault.title}: the skeleton has no {fault.old!r}"
        text = text.replace(fault.old, fault.new, 1)
    else:
        text += fault.new + "\n"
    file.write_text(text, encoding="utf-8")
    return scene


def found(fault: Fault, folder: Path) -> list[Finding]:
    """Return the findings of validation for one inserted fault."""
    return validate([seed(fault, folder)], deep=fault.deep)


def rows(folder: Path) -> Iterator[str]:
    """Yield the rows of the documentation's table."""
    yield "| fault | rule | what is said | what to do |"
    yield "|---|---|---|---|"
    for number, fault in enumerate(FAULTS):
        place = folder / str(number)
        place.mkdir()
        finding = next(f for f in found(fault, place) if f.rule == fault.rule)
        words = (
            fault.title,
            f"`{fault.rule}`" + ("" if finding.serious else f" ({finding.severity})"),
            finding.what,
            finding.remedy,
        )
        yield "| " + " | ".join(_cell(word, place) for word in words) + " |"


def _cell(text: str, folder: Path) -> str:
    for path, word in (
        (f"{folder}/", ""),
        (str(folder), "."),
        (str(ontology.ROOT), "ontology"),
        ("|", "&#124;"),
        ("<", "&lt;"),
    ):
        text = text.replace(path, word)
    return re.sub(r"\s+", " ", text)


def main() -> None:
    """Write the table into the documentation page."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        table = "\n".join(rows(Path(folder).resolve())) + "\n"
    head, rest = DOCUMENT.read_text(encoding="utf-8").split(BEGIN)
    DOCUMENT.write_text(head + BEGIN + table + END + rest.split(END)[1], encoding="utf-8")
    print(f"{DOCUMENT}: {len(FAULTS)} faults", file=sys.stderr)


if __name__ == "__main__":
    main()
