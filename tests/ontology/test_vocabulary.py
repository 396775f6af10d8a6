"""The vocabulary has the metadata that tools look for, and its page agrees with the files."""

import subprocess
import sys
from pathlib import Path

import pytest
import rdflib
from rdflib import OWL, RDF, RDFS, SKOS

from benchmarks import vocabulary
from confab import ontology
from confab.reasoner.validation.hermit import NoJavaError, java

SYNC = """
import contextlib, io, sys, owlready2
from confab.scene import load
world = load(sys.argv[1]).owl
with contextlib.redirect_stdout(io.StringIO()), world.get_ontology("urn:confab:concluded#"):
    owlready2.sync_reasoner(world, infer_property_values=False, debug=0)
print(list(world.inconsistent_classes()))
"""


def has_java() -> bool:
    try:
        return bool(java())
    except NoJavaError:
        return False


def test_the_vocabulary_page_agrees_with_the_files() -> None:
    assert vocabulary.PAGE.read_text(encoding="utf-8") == vocabulary.page(), "run make vocabulary"


@pytest.mark.parametrize("name", vocabulary.FILES)
def test_every_term_names_its_ontology_and_has_a_definition(name: str) -> None:
    graph = rdflib.Graph().parse(ontology.ROOT / name)
    (about,) = graph.subjects(RDF.type, OWL.Ontology)
    space = str(graph.value(about, vocabulary.VANN.preferredNamespaceUri))
    assert graph.value(about, vocabulary.VANN.preferredNamespacePrefix)
    assert graph.value(about, rdflib.DCTERMS.created) <= graph.value(about, rdflib.DCTERMS.modified)  # type: ignore[operator]
    terms = {
        term for term in graph.subjects(RDF.type) if str(term).startswith(space) and "." not in str(term)[len(space) :]
    }
    assert len(terms) > 20
    for term in terms:
        assert graph.value(term, RDFS.isDefinedBy) == about, term
        assert {label.language for label in graph.objects(term, RDFS.label) if isinstance(label, rdflib.Literal)} >= {
            "en"
        }
        assert graph.value(term, SKOS.definition), term


@pytest.mark.slow
@pytest.mark.skipif(not has_java(), reason="no Java")
@pytest.mark.parametrize("name", ["core.ttl", "scenes/beverage-serving.ttl"])
def test_owlready2s_own_reasoner_finds_them_consistent(name: str) -> None:
    command = [sys.executable, "-c", SYNC, str(Path(ontology.ROOT) / name)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr
