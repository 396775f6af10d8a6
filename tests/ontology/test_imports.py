"""Catalog, file names and ontology IRIs agree; loading works offline; malicious RDF/XML is refused."""

import socket
from pathlib import Path

import pytest

from confab import ontology
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.names import local_name
from tests.ontology.faults import skeleton
from worlds.owlapi import ontology_iri

TEMPLATES = ("families", "shapes", "skeleton")
"""Folders of files that aren't ontologies to load: patterns of scenes, SHACL shapes, and the template of `confab new`."""


def ontology_files() -> list[Path]:
    files = (
        path for path in ontology.ROOT.rglob("*.ttl") if not set(path.relative_to(ontology.ROOT).parts) & set(TEMPLATES)
    )
    return sorted(path for path in files if path.suffixes[-2:-1] not in [[f".{kind}"] for kind in ontology.SATELLITES])


def test_the_catalog_lists_exactly_the_existing_files() -> None:
    assert sorted(ontology.shipped().values()) == ontology_files()


@pytest.mark.parametrize("iri", ontology.shipped())
def test_catalog_file_name_and_iri_agree(iri: str) -> None:
    file = ontology.shipped()[iri]
    assert ontology_iri(file) == iri
    assert file.stem == local_name(iri)


def test_a_file_with_a_wrong_name_is_detected(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    renamed = scene.rename(tmp_path / "other.ttl")
    assert renamed.stem != local_name(ontology_iri(renamed))


def test_loading_never_opens_a_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("somebody wanted the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    iris = {file: iri for iri, file in ontology.shipped().items()}
    loaded: set[Path] = set()
    for file in [*ontology.scenes().values(), *iris]:
        if file not in loaded:
            graph = load(file)
            assert graph.scene == iris[file]
            loaded.update(graph.files.values())


HEAD = '<?xml version="1.0"?>\n{}<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:owl="http://www.w3.org/2002/07/owl#">'
BODY = '<owl:Ontology rdf:about="https://example.org/mine"/></rdf:RDF>'


@pytest.mark.parametrize(
    "dtd",
    [
        '<!DOCTYPE rdf:RDF [ <!ENTITY a "ha"> <!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"> ]>\n',
        '<!DOCTYPE rdf:RDF [ <!ENTITY secret SYSTEM "file:///etc/hostname"> ]>\n',
        '<!DOCTYPE rdf:RDF [ <!ENTITY % more SYSTEM "file:///etc/hostname"> %more; ]>\n',
        '<!DOCTYPE rdf:RDF SYSTEM "file:///etc/hostname">\n',
        '<!DOCTYPE rdf:RDF PUBLIC "x" "https://example.org/x.dtd">\n',
    ],
    ids=["expansion", "file", "parameter", "doctype", "public"],
)
def test_entity_tricks_in_rdf_xml_are_refused(tmp_path: Path, dtd: str) -> None:
    (tmp_path / "mine.owl").write_text(HEAD.format(dtd) + BODY)
    with pytest.raises(KnowledgeError, match="refused"):
        load(tmp_path / "mine.owl")


def test_entities_that_abbreviate_a_namespace_are_accepted(tmp_path: Path) -> None:
    dtd = '<!DOCTYPE rdf:RDF [ <!ENTITY mine "https://example.org/"> ]>\n'
    (tmp_path / "mine.owl").write_text(HEAD.format(dtd) + BODY.replace("https://example.org/mine", "&mine;mine"))
    assert load(tmp_path / "mine.owl").scene == "https://example.org/mine"


def test_an_import_by_file_path_is_refused(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    scene.write_text(scene.read_text().replace("<https://example.org/washing>", f"<{(tmp_path / 'x.ttl').as_uri()}>"))
    with pytest.raises(KnowledgeError, match="imports <file:"):
        load(scene)
