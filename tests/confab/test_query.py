"""Queries about a scene: with its prefixes, in every form of SPARQL, in every RDF format; answers have types and IRIs."""

import json
import logging
import re
from pathlib import Path

import pytest
import rdflib
from click.testing import CliRunner

import confab
from confab import ontology
from confab.authoring import new_domain
from confab.cli import app
from confab.following import following
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.graph.query_process import QueryLimits
from confab.reasoner.limits import LimitError, within
from confab.reasoner.reading.applicable import SITUATION
from confab.reasoner.validation.validate import quick_errors

CUP1 = "https://w3id.org/confab/beverage-serving#cup1"
OF_CUP1 = "SELECT ?where WHERE { :cup1 k:location ?where }"


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


@pytest.fixture(scope="module")
def run() -> CliRunner:
    return CliRunner()


def test_every_prefix_of_the_file_of_a_scene_is_known_in_queries(scene: confab.Scene) -> None:
    assert scene.query(OF_CUP1)[0] == ("location2",)
    for name in ontology.scenes():
        other = confab.load(name)
        (file, *_) = other.knowledge.files.values()
        own = dict(re.findall(r"^@prefix\s+(\w*):\s+<(.*?)>", file.read_text(), re.MULTILINE))
        assert own.items() <= other.knowledge.spoken.items(), name


def test_a_default_value_is_a_fact_of_the_scene_and_not_in_its_graph(scene: confab.Scene) -> None:
    assert "left_hand HOLDS nothing" in scene.facts
    assert len(scene.query("SELECT ?hand { ?hand k:holds ?what }")) == 0


def test_names_of_the_core_need_no_prefix_of_their_own(scene: confab.Scene) -> None:
    rows = scene.query("SELECT ?b WHERE { ?b a :Behavior ; rdfs:label ?text FILTER(?text != ':cup1') } # :cup1")
    assert len(rows) == len(scene.problem.domain.behaviors)
    assert len(scene.query(f"PREFIX : <{CUP1[:-4]}> SELECT ?b WHERE {{ ?b a :Behavior }}")) == 0


def test_every_form_of_query_is_answered(scene: confab.Scene) -> None:
    yes, no = scene.query("ASK { :cup1 a k:Cup }"), scene.query("ASK { :cup1 a k:Bottle }")
    assert (bool(yes), yes[0], bool(no), no[0]) == (True, ("true",), False, ("false",))
    built = "CONSTRUCT { ?cup rdfs:seeAlso ?l } WHERE { ?cup a k:Cup ; k:location ?l }"
    assert scene.query(built)[0] == ("cup1", "seeAlso", "location2")
    assert (rdflib.URIRef(CUP1), rdflib.RDFS.seeAlso, None) in scene.construct(built)
    assert len(scene.query("DESCRIBE :cup1")) > 3


def test_a_data_frame_has_types(scene: confab.Scene) -> None:
    query = (
        "SELECT ?b ?level (?level > 1 AS ?below) (1.5 AS ?x) WHERE { ?b a :Behavior ; :level ?level } ORDER BY ?level"
    )
    frame = scene.query(query).dataframe()
    assert [str(kind) for kind in frame.dtypes[1:]] == ["Int64", "boolean", "Float64"]
    assert frame.level.max() == 3
    assert frame.below.sum() > 5


def test_the_command_line_lists_all_facts_of_a_domain_of_its_own_with_default_values(
    run: CliRunner, tmp_path: Path
) -> None:
    confab.new_domain("tearoom", tmp_path)
    shown = run.invoke(app, ["query", str(tmp_path / "tearoom-scene.ttl"), "--facts", "--fact", "plate2 PLACE sink"])
    assert shown.stdout.splitlines() == [
        "fact", "plate1 CLEANLINESS dirty", "plate1 PLACE table", "plate2 CLEANLINESS clean", "plate2 PLACE sink"
    ]  # fmt: skip


def test_answers_have_iris_on_request(scene: confab.Scene, run: CliRunner, tmp_path: Path) -> None:
    table = scene.query("SELECT ?o ?n WHERE { ?o a k:Cup ; :index ?n } ORDER BY ?o")
    assert table.iris()[0] == (CUP1, "3")
    standard = json.loads(table.standard("sparql-json"))["results"]["bindings"]
    assert standard[0]["o"] == {"type": "uri", "value": CUP1}
    assert standard[0]["n"]["datatype"].endswith("#integer")
    assert b"<uri>" in table.standard("sparql-xml")
    told = run.invoke(
        app, ["query", "beverage-serving", "SELECT ?o WHERE { ?o a k:Cup } ORDER BY ?o", "--json", "--iris"]
    )
    assert json.loads(told.stdout)[0] == {"o": CUP1}
    for ending in ("csv", "json", "tsv", "srj", "srx", "txt"):
        file = tmp_path / f"cups.{ending}"
        run.invoke(app, ["query", "beverage-serving", "SELECT ?o WHERE { ?o a k:Cup }", "-o", str(file)])
        assert "cup2" in file.read_text()
    told = run.invoke(app, ["query", "beverage-serving", "ASK { :cup1 a k:Bottle }"])
    assert (told.exit_code, told.stdout) == (1, "false\n")


def test_texts_with_any_characters_are_returned_unchanged(scene: confab.Scene) -> None:
    said = "tab\tline\nquote\" back\\slash 'é€' | <&>"
    table = scene.query(f"SELECT ({rdflib.Literal(said).n3()} AS ?text) ?nothing WHERE {{}}")
    assert table[0] == (said, None)
    assert json.loads(table.standard("sparql-json"))["results"]["bindings"] == [
        {"text": {"type": "literal", "value": said}}
    ]


@pytest.mark.parametrize("behavior", ["B1_POUR", "B2_PICK", "B3_LIFT"])
def test_a_displayed_query_runs_in_rdflib_without_additional_prefixes(scene: confab.Scene, behavior: str) -> None:
    shown = scene.quantifying_query(behavior)
    theirs = scene.graph.query(shown, initNs={})
    ours = scene.query(shown)
    assert [tuple(map(str, row)) for row in theirs if isinstance(row, tuple)] == list(ours.iris())
    assert scene.query(scene.applicable_query(behavior)).columns


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("SELECT ?o WHERE { ?o k:location ?l", "error at 1:35.*there the query ends"),
        ("SELECT ?o\nWHERE { ?o k:location }", "error at 2:23.*there stands '}'"),
        ("SELECT ?o WHERE { ?o kk:location ?l }", "1:.*no prefix 'kk:' is known"),
        ("SELECT ?o WHERE { ?o a :Behavior } LIMIT x", "error at 1:42"),
        ("INSERT DATA { :a :b :c }", "it is an update, and a scene is only read"),
    ],
)
def test_a_faulty_query_is_answered_in_one_line_with_the_place(scene: confab.Scene, query: str, said: str) -> None:
    with pytest.raises(KnowledgeError, match=said) as caught:
        scene.query(query)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_any_rdf_file_can_be_queried_and_planning_names_the_missing_import(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "any.ttl").write_text("@prefix : <http://e.org/a#> .\n:x :y :z .\n")
    (tmp_path / "robot.ttl").write_text(
        "@prefix owl: <http://www.w3.org/2002/07/owl#> . <http://e.org/o> a owl:Ontology ; owl:imports <package://x/y.owl> ."
    )
    for name, missing in (("any.ttl", "wanted one 'a owl:Ontology'"), ("robot.ttl", "imports <package://x/y.owl>")):
        scene = confab.load(tmp_path / name)
        with caplog.at_level(logging.WARNING):
            assert len(scene.query("SELECT * WHERE { ?s ?p ?o }"))
        assert missing in caplog.text
        caplog.clear()
        assert len(scene.query("SELECT * WHERE { ?s ?p ?o }"))
        assert caplog.text == ""
        for call in (scene.plan, scene.execute, lambda s=scene: s.facts, lambda s=scene: s.embodiment):
            with pytest.raises(KnowledgeError, match=missing):
                call()
    assert confab.load(tmp_path / "any.ttl").query("SELECT ?o WHERE { :x :y ?o }")[0] == ("z",)


def test_an_empty_answer_false_or_0_is_logged_with_the_unknown_terms_of_the_query(
    scene: confab.Scene, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger("confab"), "propagate", True)  # an earlier call with -v has changed it
    with caplog.at_level(logging.WARNING, "confab"):
        scene.query("SELECT ?o WHERE { ?o :location ?l ; rdfs:label ':cup1 x:y' . FILTER(?o != :cup1) }")
        assert "has no term :location (did you mean k:location?)" in caplog.text
        caplog.clear()
        scene.query("SELECT (COUNT(?o) AS ?n) WHERE { ?o a k:Cupp }")
        scene.query("ASK { <https://w3id.org/confab/beverage-serving#cup1> k:locaton ?place }")
        assert "has no term k:Cupp (did you mean 'Cup'?)" in caplog.text
        assert "has no term k:locaton (did you mean 'location'?)" in caplog.text
        caplog.clear()
        scene.query("SELECT ?o WHERE { ?o k:location :cup1 }")
        scene.query("PREFIX prov: <http://www.w3.org/ns/prov#> ASK { ?x prov:used ?y ; owl:sameAs ?z }")
        scene.query("ASK { :cup1 a k:Bottle ; rdfs:subClassOf c:SituationType }")
        assert caplog.text == ""


def test_one_missing_value_blocks_no_query(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    file = tmp_path / "tearoom-scene.ttl"
    text = file.read_text()
    file.write_text(text.replace("d:isAt", "rdfs:seeAlso", 1))
    scene = confab.load(file)
    with pytest.raises(KnowledgeError, match="has no value"):
        scene.plan()
    assert len(scene.query("SELECT ?x WHERE { ?x a d:Plate }")) >= 1


INSIDE = "SELECT ?what ?where WHERE { ?what d:isInside ?where } ORDER BY ?what ?where"


def test_initial_derived_facts_are_queried_like_stated_facts() -> None:
    packing = confab.load("packing-small")
    rows = [("casket", "chest"), ("casket", "hall"), ("chest", "hall"), ("ring", "hall")]
    assert list(packing.query(INSIDE)) == rows
    by_sparql = f"SELECT ?what ?where WHERE {{ GRAPH <{SITUATION}> {{ {INSIDE[INSIDE.index('{') + 1 :]}".replace(
        "}", "} }"
    )
    assert list(packing.query(by_sparql)) == rows
    moved = packing.with_fact("ring LIES_IN casket")
    assert list(moved.query(INSIDE)) == [*rows[:3], ("ring", "casket"), ("ring", "chest"), ("ring", "hall")]
    stored = packing.with_fact("chest LIES_IN vault")
    assert not packing.query("ASK { ?thing a d:StoredThing }")
    assert [name for (name,) in stored.query("SELECT ?x WHERE { ?x a d:StoredThing }")] == [
        "casket"
    ]  # inside a box and inside a vault


def test_a_query_about_derived_facts_does_not_change_the_scene() -> None:
    """Derived facts are computed in each state of a plan.

    The result of a query about the initial state doesn't affect planning.
    """
    packing = confab.load("packing-small")
    before = packing.plan()
    packing.query(INSIDE)
    assert quick_errors(packing.knowledge) == []
    assert packing.plan().plan.steps == before.plan.steps


def test_the_derivation_of_facts_for_a_query_keeps_the_time_limit_of_the_query() -> None:
    problem = confab.load("packing-small").problem
    with within(0.0), pytest.raises(LimitError, match="gave up after 0 s while"):
        list(following(problem, ["INSIDE"]))
    with pytest.raises(LimitError):
        confab.load("packing-small").query(INSIDE, QueryLimits(seconds=0.0))


def test_a_query_finds_the_sums_and_counts_that_it_names() -> None:
    carts = confab.load("carts-small")
    assert carts.query("SELECT ?cart ?load WHERE { ?cart d:load ?load }").values() == [("cart", 0)]
    stock = carts.query("SELECT ?rack ?stock WHERE { ?rack d:stock ?stock } ORDER BY ?rack").values()
    assert stock == [("shop", 0), ("store", 3)]


def test_the_facts_that_rules_make_true_are_listed_apart_from_the_facts_that_can_be_given() -> None:
    packing = confab.load("packing-small")
    derived = packing.derived_facts
    assert [fact.split()[::2] for fact in derived if " INSIDE " in fact] == [list(row) for row in packing.query(INSIDE)]
    assert "casket OUT_OF_REACH true" in derived
    assert packing.derived_facts["ring INSIDE hall"] == "true"
    assert not {*derived} & {*packing.facts}
    assert packing.with_fact(*packing.facts).facts == packing.facts
    moved = packing.with_fact("ring LIES_IN casket")
    assert {"ring INSIDE casket true", "ring INSIDE chest true"} < {*moved.derived_facts}
    assert confab.load("tour-small").derived_facts == [
        "station VISITED true"
    ]  # and no type that expresses a constraint
    done = CliRunner().invoke(app, ["query", "packing-small", "--derived", "--format", "csv"])
    assert done.output.splitlines() == ["fact", *derived]
