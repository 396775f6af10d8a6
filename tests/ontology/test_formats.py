"""A scene is the same in every RDF format that a library reads; for any other format, the message says how to convert the file."""

from pathlib import Path

import pyoxigraph as ox
import pytest

import confab
from confab.authoring import new_domain
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.updates.converting import convert

FORMS = {
    "nt": ox.RdfFormat.N_TRIPLES,
    "owl": ox.RdfFormat.RDF_XML,
    "rdf": ox.RdfFormat.RDF_XML,
    "xml": ox.RdfFormat.RDF_XML,
    "jsonld": ox.RdfFormat.JSON_LD,
    "trig": ox.RdfFormat.TRIG,
    "nq": ox.RdfFormat.N_QUADS,
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    new_domain("tearoom", tmp_path)
    return tmp_path / "tearoom-scene.ttl"


@pytest.mark.parametrize("ending", FORMS)
def test_a_scene_plans_alike_in_every_form(scene: Path, ending: str) -> None:
    wanted = confab.load(scene).plan().plan
    named = FORMS[ending].supports_datasets
    for file in (scene, scene.with_name("tearoom.ttl")):
        graph = ox.NamedNode("urn:g") if named else ox.DefaultGraph()
        parsed = ox.parse(path=str(file), base_iri="https://example.org/")
        quads = [ox.Quad(q.subject, q.predicate, q.object, graph) for q in parsed]
        file.with_suffix(f".{ending}").write_bytes(ox.serialize(quads, format=FORMS[ending]) or b"")
        file.unlink()
    catalog = scene.with_name("catalog-v001.xml")
    catalog.write_text(catalog.read_text().replace("tearoom.ttl", f"tearoom.{ending}"))
    assert confab.load(scene.with_suffix(f".{ending}")).plan().plan == wanted


@pytest.mark.parametrize("form", [ox.RdfFormat.TURTLE, ox.RdfFormat.RDF_XML, ox.RdfFormat.JSON_LD])
@pytest.mark.parametrize("ending", ["ttl", "owl", "jsonld"])
def test_the_content_of_a_file_determines_its_format(scene: Path, form: ox.RdfFormat, ending: str) -> None:
    prefixes = {"owl": "http://www.w3.org/2002/07/owl#"}
    quads = [*ox.parse(path=str(scene), base_iri="https://example.org/")]
    scene.unlink()
    file = scene.with_suffix(f".{ending}")
    file.write_bytes(ox.serialize(quads, format=form, prefixes=prefixes) or b"")
    assert load(file).scene == "https://example.org/tearoom-scene"


def test_a_byte_order_mark_is_ignored_and_another_encoding_than_utf_8_is_refused_by_line(scene: Path) -> None:
    text = scene.read_text()
    scene.write_text(text, encoding="utf-8-sig")
    assert load(scene).scene == "https://example.org/tearoom-scene"
    for encoding, line in (("utf-16", 1), ("latin-1", 2)):
        scene.write_text(f"#\n# Tässchen\n{text}".replace("…", ""), encoding=encoding)
        with pytest.raises(KnowledgeError, match=f"line {line} isn't in UTF-8 .*; save the file in UTF-8"):
            load(scene)


def test_a_blank_node_at_the_beginning_of_turtle_is_no_json_ld(scene: Path) -> None:
    scene.write_text("[] a <urn:x:A> .\n[ ] a <urn:x:A> .\n" + scene.read_text())
    assert load(scene).scene == "https://example.org/tearoom-scene"


@pytest.mark.parametrize(
    ("name", "text", "form"),
    [
        ("a.ofn", "Prefix(:=<http://e.org/>)\nOntology(<http://e.org/>)", "functional syntax"),
        ("a.owl", "# saved by Protégé\nPrefix(:=<http://e.org/>)\nOntology(<http://e.org/>)", "functional syntax"),
        ("a.omn", "Prefix: : <http://e.org/>\nOntology: <http://e.org/>", "Manchester syntax"),
        ("a.owl", "Prefix: : <http://e.org/>\nOntology: <http://e.org/>", "Manchester syntax"),
        ("a.ttl", "Prefix: : <http://e.org/>\nOntology: <http://e.org/>", "Manchester syntax"),
        ("a.owx", '<?xml version="1.0"?>\n<Ontology xmlns="http://www.w3.org/2002/07/owl#"/>', "OWL/XML"),
        ("a.owl", '<?xml version="1.0"?>\n<Ontology xmlns="http://www.w3.org/2002/07/owl#"/>', "OWL/XML"),
    ],
)
def test_the_message_on_an_unsupported_format_says_how_to_save_the_file(
    tmp_path: Path, name: str, text: str, form: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(
        KnowledgeError, match=f"is in {form}, which isn't read here; open it in Protégé and save it as Turtle"
    ):
        load(tmp_path / name)


def test_a_remote_json_ld_context_is_not_fetched(tmp_path: Path) -> None:
    (tmp_path / "a.jsonld").write_text('{"@context": "https://schema.org/", "@id": "https://e.org/a"}')
    with pytest.raises(KnowledgeError, match="nothing is fetched"):
        load(tmp_path / "a.jsonld")


DEEP = 20_000
NESTED = {
    "ttl": "<urn:a> <urn:p> " + "[<urn:p> " * DEEP + "1" + "]" * DEEP + " .",
    "nt": "<urn:a> <urn:p> " + "<<( <urn:a> <urn:p> " * DEEP + "1" + ")>>" * DEEP + " .",
    "trig": "<urn:a> <urn:p> " + '( "]))" ' * DEEP + ")" * DEEP + " .",
    "jsonld": '{"@id": "urn:a", "urn:p": ' * DEEP + "1" + "}" * DEEP,
    "owl": '<r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns="urn:x#">'
    + '<a x="/>"><b>' * DEEP
    + "</b></a>" * DEEP
    + "</r:RDF>",
}


@pytest.mark.parametrize("ending", NESTED)
def test_a_file_that_is_nested_too_deeply_is_refused_in_every_format(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"deep.{ending}"
    file.write_text(NESTED[ending])
    with pytest.raises(KnowledgeError, match="nested more than 1,000 deep"):
        load(file)


def test_brackets_in_literals_and_closed_brackets_do_not_count_as_nesting(tmp_path: Path) -> None:
    file = tmp_path / "flat.ttl"
    file.write_text("<urn:a> a <http://www.w3.org/2002/07/owl#Ontology> . " + '<urn:a> <urn:p> "((", [] , () . ' * 2000)
    assert load(file).scene == "urn:a"


def test_json_ld_that_explodes_is_refused_at_a_memory_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.reasoner.graph.documents.MEGABYTES", 300)
    terms = ",".join(f'"t{i}": "urn:t{i}"' for i in range(10_000))
    level = '{"@context": {"x": "urn:x"}, "@id": "urn:b", "t2":'
    file = tmp_path / "wide.jsonld"
    file.write_text(f'{{"@context": {{{terms}}}, "@id": "urn:a", "t1":' + level * 400 + "1" + "}" * 401)
    with pytest.raises(KnowledgeError, match="can't be read within 60 s and 300 MB"):
        load(file)


def test_a_catalog_with_a_circular_link_gives_an_error_of_one_line(scene: Path) -> None:
    catalog, loop = scene.with_name("catalog-v001.xml"), scene.with_name("loop.ttl")
    loop.symlink_to("loop.ttl")
    catalog.write_text(catalog.read_text().replace('uri="tearoom.ttl"', 'uri="loop.ttl"'))
    with pytest.raises(KnowledgeError, match=r"loop\.ttl, which is a link that leads to no file; correct the entry"):
        load(scene)
    for call in (load, confab.validate, lambda file: convert(file, "sparql")):
        with pytest.raises((KnowledgeError, OSError)):
            call(loop)
