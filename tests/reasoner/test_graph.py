"""Loading: shipped names and files, offline imports, and errors that name the place and the remedy."""

from pathlib import Path

import pytest

from confab import ontology
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.limits import Deadline, LimitError, within

HEADER = """@prefix owl: <http://www.w3.org/2002/07/owl#> .
<https://example.org/mine> a owl:Ontology ; owl:imports <{}> .
"""


def test_every_shipped_scene_loads_by_its_name() -> None:
    for name in ontology.scenes():
        assert load(name).scene.rsplit("/", 1)[-1] == name


def test_an_import_is_found_beside_the_file_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "mine.ttl").write_text(HEADER.format("https://example.org/other"))
    (tmp_path / "other.ttl").write_text("<https://example.org/other> a <http://www.w3.org/2002/07/owl#Ontology> .")
    assert list(load(tmp_path / "mine.ttl").files) == ["https://example.org/mine", "https://example.org/other"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("@prefix : <x", "mine.ttl"),
        ("<a> <b> <c> .", "wanted one 'a owl:Ontology'"),
        (HEADER.format("https://example.org/nowhere"), "confab fetch https://example.org/nowhere --into"),
    ],
    ids=["syntax", "no-ontology", "unknown-import"],
)
def test_a_file_that_cannot_be_used_is_named_with_its_fault(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "mine.ttl"
    path.write_text(content)
    with pytest.raises(KnowledgeError, match=message):
        load(path)


def test_the_message_on_an_unknown_scene_lists_the_known_ones() -> None:
    with pytest.raises(KnowledgeError, match="beverage-serving"):
        load("beverage-srving")


def test_a_catalog_with_entities_is_refused(tmp_path: Path) -> None:
    (tmp_path / "catalog-v001.xml").write_text(
        '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><catalog>&x;</catalog>'
    )
    (tmp_path / "mine.ttl").write_text(HEADER.format("https://example.org/other"))
    with pytest.raises(KnowledgeError, match="refused"):
        load(tmp_path / "mine.ttl")


def test_a_catalog_entry_with_a_circular_link_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "catalog-v001.xml").write_text(
        '<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog"><uri name="urn:l" uri="loop.ttl"/></catalog>'
    )
    (tmp_path / "loop.ttl").symlink_to("loop.ttl")
    (tmp_path / "mine.ttl").write_text(HEADER.format("urn:l"))
    with pytest.raises(KnowledgeError, match="a link that leads to no file; correct the entry"):
        load(tmp_path / "mine.ttl")


def test_a_query_that_is_no_sparql_is_a_clear_error() -> None:
    graph = load("beverage-serving")
    with pytest.raises(KnowledgeError, match="not SPARQL"):
        graph.select("SELEKT ?x")
    with pytest.raises(KnowledgeError, match="SELECT"):
        graph.select("ASK { ?a ?b ?c }")


def test_reading_of_a_file_stops_at_the_deadline(tmp_path: Path) -> None:
    file = tmp_path / "large.ttl"
    file.write_text("<urn:s> a <http://www.w3.org/2002/07/owl#Ontology> .\n" + "<urn:a> <urn:b> <urn:c> .\n" * 100_000)
    checked: list[str] = []

    class Soon(Deadline):
        def check(self, doing: str, ahead: float = 0.0) -> None:
            checked.append(doing)
            if len(checked) > 20:
                raise LimitError("over")

    with within(Soon(at=0.0)), pytest.raises(LimitError):
        load(file)
    assert checked[-1] == f"reading {file}"
