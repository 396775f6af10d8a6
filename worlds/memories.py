"""Files of experience and of the paper's links, written without a scene and read as `confab.Memory.load` reads them."""

from __future__ import annotations

from pathlib import Path

from confab.reasoner.files import write_whole
from confab.reasoner.memory.experience import Experience
from confab.reasoner.memory.experience_file import parse, turtle
from confab.reasoner.memory.links import Links
from confab.reasoner.memory.links_file import links_text, memory_lines
from confab.reasoner.names import Names
from confab.reasoner.vocabulary import OWL


def save(path: Path, experience: Experience, names: Names, domain: str) -> None:
    """Write a memory file of experience that imports an ontology."""
    write_whole(path, turtle(experience, names, domain))


def load(path: Path, names: Names | None = None) -> Experience:
    """Read a memory file of experience."""
    return parse(memory_lines(path), str(path), names)


def save_links(path: Path, links: Links, names: Names, scene: str) -> None:
    """Write a memory file of links alone that imports a scene."""
    head = f"@prefix owl: <{OWL}> .\n<{scene}.memory> a owl:Ontology ; owl:imports <{scene}> .\n"
    write_whole(path, [head, links_text(links, names, scene)])
