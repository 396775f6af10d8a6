"""What exists: core vocabulary, domains, robots, scenes, shapes, checks and questions, as files.

The only Python of this room finds those files: by the name of a scene, and by the catalog that tells where an imported
ontology lies (OASIS XML Catalogs 1.1, the format that Protégé reads and writes).
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

ROOT = Path(__file__).resolve().parent
CATALOG = "catalog-v001.xml"
SUFFIXES = (".ttl", ".owl", ".rdf", ".nt", ".jsonld", ".trig", ".nq")
SATELLITES = ("reach", "memory", "observed", "episodes")
"""Middle parts of the names of files that belong to a scene, as in ``SCENE.reach.ttl``."""


def scenes() -> dict[str, Path]:
    """Return the shipped scenes: name to file, in alphabetical order."""
    found = sorted((ROOT / "scenes").glob("*.ttl"))
    return {path.stem: path for path in found if path.suffixes[-2:-1] not in [[f".{kind}"] for kind in SATELLITES]}


@cache
def shipped() -> Mapping[str, Path]:
    """Return the shipped ontologies, as the catalog lists them: IRI to file."""
    return MappingProxyType(_entries(ROOT / CATALOG))


def catalog(path: Path) -> Mapping[str, Path]:
    """Return what a catalog says: ontology IRI to file.

    Raises
    ------
    ValueError
        The file is no XML catalog; the message says where and why. Entity declarations are refused.
    """
    return shipped() if path == ROOT / CATALOG else _entries(path)


def _entries(path: Path) -> dict[str, Path]:
    text = path.read_text(encoding="utf-8")
    if "<!ENTITY" in text or "<!DOCTYPE" in text:
        raise ValueError(f"{path}: a catalog with a document type or entities is refused; remove the <!DOCTYPE …> part")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: no XML catalog: {error}") from error
    entries = {}
    for element in root.iter("{urn:oasis:names:tc:entity:xmlns:xml:catalog}uri"):
        name, uri = element.get("name"), element.get("uri")
        if name and uri and "://" not in uri:
            entries[name] = Path(os.path.realpath(path.parent / uri))  # raises nothing where links go in circles
    return entries
