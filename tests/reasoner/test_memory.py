"""The memory file: it preserves what was learned, consists of annotated axioms, and a broken file gives a clear error."""

from pathlib import Path

import pytest
import rdflib

from confab.planner.paper.hierarchy import plan
from confab.planner.paper.learning import learn
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, load, read_into
from confab.reasoner.memory.links import Links
from confab.reasoner.memory.links_file import links_text, load_links, memory_names
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import Symbol
from worlds.memories import save_links


@pytest.fixture(scope="module")
def serving() -> Reading:
    return read(load("beverage-serving"))


@pytest.fixture(scope="module")
def links(serving: Reading) -> Links:
    found = plan(serving.problem).plan
    assert found is not None
    return learn(serving.problem, found, Links())


def test_links_survive_the_file(tmp_path: Path, serving: Reading, links: Links) -> None:
    path = tmp_path / "memory.ttl"
    save_links(path, links, serving.names, serving.problem.scene)
    assert load_links(path, serving.names) == links


def test_links_to_truth_values_survive_the_file(tmp_path: Path, serving: Reading) -> None:
    move = ("B1_MOVE", ("cup1", "location7"))
    links = Links({move: {Symbol("LOCATION", ("cup1",)): {"true": 0.75, "false": 0.25}}})
    save_links(tmp_path / "m.ttl", links, serving.names, serving.problem.scene)
    assert load_links(tmp_path / "m.ttl", serving.names) == links


@pytest.mark.parametrize("share", ["-0.75", "1.5", "NaN"])
def test_an_invalid_probability_of_a_link_is_refused(tmp_path: Path, serving: Reading, share: str) -> None:
    file, move = tmp_path / "m.ttl", ("B1_MOVE", ("cup1", "location7"))
    links = Links({move: {Symbol("LOCATION", ("cup1",)): {"location2": 0.75, "location3": 0.25}}})
    save_links(file, links, serving.names, serving.problem.scene)
    assert "0.75" in file.read_text()
    file.write_text(file.read_text().replace("0.75", share))
    with pytest.raises(KnowledgeError):
        load_links(file, serving.names)


def test_links_survive_a_rewrite_of_the_file_by_another_program(tmp_path: Path, serving: Reading, links: Links) -> None:
    save_links(tmp_path / "ours.ttl", links, serving.names, serving.problem.scene)
    rdflib.Graph().parse(tmp_path / "ours.ttl").serialize(tmp_path / "theirs.ttl")
    assert load_links(tmp_path / "theirs.ttl", serving.names) == links


def test_the_same_links_give_the_same_file(tmp_path: Path, serving: Reading, links: Links) -> None:
    for name in ("a.ttl", "b.ttl"):
        save_links(tmp_path / name, links, serving.names, serving.problem.scene)
    assert (tmp_path / "a.ttl").read_bytes() == (tmp_path / "b.ttl").read_bytes()


def test_each_link_is_an_annotated_axiom_about_a_triple_that_is_asserted(
    tmp_path: Path, serving: Reading, links: Links
) -> None:
    save_links(tmp_path / "memory.ttl", links, serving.names, serving.problem.scene)
    graph = KnowledgeGraph("")
    read_into(graph, tmp_path / "memory.ttl", "memory")
    rows = graph.select(
        """SELECT ?b ?f ?p WHERE { ?axiom a owl:Axiom ; owl:annotatedSource ?b ; owl:annotatedProperty :associatedWith ;
           owl:annotatedTarget ?f ; :probability ?p . ?b a :GroundBehavior ; :associatedWith ?f . ?f a :SituatedObjectInstance }"""
    )
    assert len(rows) == len(links) > 0


def test_the_file_imports_the_scene(tmp_path: Path, serving: Reading, links: Links) -> None:
    save_links(tmp_path / "memory.ttl", links, serving.names, serving.problem.scene)
    assert f"imports <{serving.problem.scene}>" in (tmp_path / "memory.ttl").read_text()


def test_a_missing_or_broken_memory_is_a_clear_error(tmp_path: Path, serving: Reading) -> None:
    with pytest.raises(KnowledgeError, match="no such memory file"):
        load_links(tmp_path / "none.ttl", serving.names)
    (tmp_path / "broken.ttl").write_text("<a> <b")
    with pytest.raises(KnowledgeError, match=r"broken\.ttl"):
        load_links(tmp_path / "broken.ttl", serving.names)


def test_terms_that_the_scene_does_not_have_are_kept_under_their_names(tmp_path: Path, serving: Reading) -> None:
    links = Links({("B1_JUGGLE", ("cup1", "club9")): {Symbol("SPINS", ("club9",)): {"fast": 0.5}}})
    save_links(tmp_path / "m.ttl", links, serving.names, serving.problem.scene)
    assert load_links(tmp_path / "m.ttl", serving.names) == links


def test_the_text_of_links_is_the_content_of_the_file_without_its_head(
    tmp_path: Path, serving: Reading, links: Links
) -> None:
    text = links_text(links, serving.names, serving.problem.scene)
    assert "imports" not in text
    assert "Ontology" not in text
    save_links(tmp_path / "m.ttl", links, serving.names, serving.problem.scene)
    (tmp_path / "n.ttl").write_text(text)
    assert load_links(tmp_path / "n.ttl", serving.names) == links
    scene, names = memory_names(tmp_path / "m.ttl")
    assert scene == serving.problem.scene
    assert names.iri("cup1") == serving.names.iri("cup1")
    with pytest.raises(KnowledgeError, match="it imports no scene"):
        memory_names(tmp_path / "n.ttl")


def test_a_blank_node_is_no_import_of_a_memory(tmp_path: Path, serving: Reading, links: Links) -> None:
    file = tmp_path / "m.ttl"
    save_links(file, links, serving.names, serving.problem.scene)
    file.write_text(f"{file.read_text()}\n_:some <http://www.w3.org/2002/07/owl#imports> _:other .\n")
    assert memory_names(file)[0] == serving.problem.scene
