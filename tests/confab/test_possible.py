"""Every entry point refuses an impossible fact with the same words, and accepts a possible or unknown fact."""

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
from confab import ontology
from confab.cli import app
from confab.page.sheet import Sheet
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.possible import impossible
from confab.reasoner.reading.observed import load_observed, save_observed
from confab.reasoner.symbols import Fact, Symbol
from confab.reasoner.validation.validate import validate

TWICE = "cup1 and cup2 have the same LOCATION, location1; state another LOCATION of one of the two"
HELD = "<left_hand, HOLDS> is cup1, but <cup1, LOCATION> is location2, and left_hand isn't at location2"
NOT_HELD = "<cup1, LOCATION> is in_hand, but no Hand has cup1 as its HOLDS"
WRONG = [("cup1 LOCATION location1", TWICE), ("left_hand HOLDS cup1", HELD), ("cup1 LOCATION in_hand", NOT_HELD)]

SCENE = """
@prefix : <https://example.org/{name}#> .
@prefix s: <https://w3id.org/confab/beverage-serving#> .
@prefix k: <https://w3id.org/confab/tabletop#> .
@prefix t: <https://w3id.org/confab/dining-table#> .
@prefix r: <https://w3id.org/confab/two-arms#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix dcterms: <http://purl.org/dc/terms/> .
<https://example.org/{name}> a owl:Ontology ; dcterms:title "Two cups"@en ; dcterms:description "Two cups."@en ;
  owl:imports <https://w3id.org/confab/tabletop-bodies>, <https://w3id.org/confab/dining-table>,
    <https://w3id.org/confab/two-arms> .
:cup1 a owl:NamedIndividual, k:Cup ; c:index 1 ; rdfs:label "cup 1"@en ; k:beverage k:no_beverage ; k:location t:{place} .
:cup2 a owl:NamedIndividual, k:Cup ; c:index 2 ; rdfs:label "cup 2"@en ; k:beverage k:no_beverage ; k:location t:location1 .
[ a owl:AllDifferent ; owl:distinctMembers ( :cup1 :cup2 k:nothing ) ] .
"""


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


def refused(act: Callable[[], object]) -> str:
    with pytest.raises(confab.KnowledgeError) as caught:
        act()
    return str(caught.value)


@pytest.mark.parametrize(("fact", "message"), WRONG)
def test_an_impossible_fact_is_refused_at_every_entry_point_in_the_same_words(
    fact: str, message: str, scene: confab.Scene, tmp_path: Path
) -> None:
    about, situation, value = fact.split()
    assert message in refused(lambda: scene.with_fact(fact))
    assert message in Sheet(scene).answer({"facts": {f"{about} {situation}": value}})["problem"]
    assert message.split("location2")[0].split("location1")[0] in refused(
        lambda: scene.execute(interventions=f"at=0.5 {fact}")
    )
    seen = {**scene.problem.initial, Symbol(situation, (about,)): value}
    save_observed(tmp_path / "seen.ttl", seen, scene.names, scene.iri)
    assert message in refused(lambda: load_observed(tmp_path / "seen.ttl", scene.reading))


def test_validation_of_a_file_reports_an_impossible_fact_in_the_same_words(tmp_path: Path) -> None:
    for name, place, more, message in (
        ("twice", "location1", "", TWICE),
        ("held", "location2", "r:left_hand k:holds :cup1 .", HELD),
        ("not_held", "location2", "", NOT_HELD),
    ):
        text = SCENE.format(name=name, place=place) + more
        text = text.replace("t:location2", "k:in_hand") if name == "not_held" else text
        (tmp_path / f"{name}.ttl").write_text(text, encoding="utf-8")
        (finding,) = (f for f in validate([tmp_path / f"{name}.ttl"]) if f.rule == "impossible-situation")
        assert finding.what == message.partition(";")[0]
        assert finding.serious
        assert finding.line


def test_an_intervention_that_is_impossible_at_its_step_is_refused_there(scene: confab.Scene) -> None:
    said = refused(lambda: scene.execute(interventions="after=28 cup2 LOCATION location7"))
    assert said.startswith("'after=28 cup2 LOCATION location7' can't happen: cup1 and cup2 have the same LOCATION")
    said = refused(lambda: scene.execute(interventions="after=28 add Cup cup9 LOCATION location5"))
    assert "cup2 and cup9 have the same LOCATION, location5" in said


def test_an_amount_out_of_its_bounds_is_refused() -> None:
    scene = confab.load("canteen-small")
    symbol = next(s for s in scene.problem.initial if scene.problem.domain.situations[s.situation].quantity)
    for value in ("-9999", "99999", ">=2"):
        message = f"{symbol} is {value}; "
        fact = str(Fact(symbol, value))
        assert message in refused(lambda fact=fact: scene.with_fact(fact))  # type: ignore[misc]
        assert message in refused(lambda fact=fact: scene.execute(interventions=f"at=1 {fact}"))  # type: ignore[misc]


def test_swapped_places_of_cups_and_a_lifted_or_grasped_cup_are_possible_facts(scene: confab.Scene) -> None:
    assert scene.with_fact("cup1 LOCATION location1", "cup2 LOCATION location2").plan().solved
    assert "left_hand HOLDS cup1" in scene.with_fact("left_hand HOLDS cup1", "cup1 LOCATION in_hand").facts
    assert scene.with_fact("left_hand HOLDS cup1", "left_hand HAND_POSITION cup1").facts


def test_an_unknown_fact_is_no_fault(scene: confab.Scene) -> None:
    problem = scene.problem
    assert not [*impossible(problem, {})]
    assert not [*impossible(problem, {Symbol("LOCATION", ("cup1",)): "in_hand"})]
    assert not [*impossible(problem, {Symbol("HOLDS", ("left_hand",)): "cup1"})]


def test_an_existing_fault_of_a_scene_does_not_prevent_other_facts(tmp_path: Path) -> None:
    (tmp_path / "twice.ttl").write_text(SCENE.format(name="twice", place="location1"), encoding="utf-8")
    scene = confab.load(tmp_path / "twice.ttl")
    assert scene.with_fact("right_hand HAND_TILT tilted").facts
    assert scene.with_fact("cup1 LOCATION location3").facts


def test_a_derived_fact_is_refused_by_interventions_as_by_with_fact() -> None:
    scene = confab.load("carts-small")
    with pytest.raises(KnowledgeError, match="a rule defines LOAD; change a fact that it follows from"):
        scene.execute(interventions=["after=1 cart LOAD 5"])
    with pytest.raises(KnowledgeError, match="a rule defines LOAD; change a fact"):
        scene.with_fact("cart LOAD 5")


@pytest.mark.parametrize("fact", ["bay1 CLASH true", "bay1 CLASH false"])
def test_a_fact_that_a_rule_defines_is_refused_at_every_door(tmp_path: Path, fact: str) -> None:
    scene = confab.load("drums-small")
    message = "a rule defines CLASH; change a fact that it follows from"
    with pytest.raises(KnowledgeError, match=message):
        scene.with_fact(fact)
    with pytest.raises(KnowledgeError, match=message):
        scene.execute(interventions=[f"after=1 {fact}"])
    run = CliRunner().invoke(app, ["execute", "drums-small", "--intervene", f"after=1 {fact}"])
    assert message in str(run.exception)
    about, name, value = fact.split()
    sheet = Sheet(scene)
    sheet.symbols[f"{about} {name}"] = Symbol(name, (about,))
    with pytest.raises(KnowledgeError, match=message):
        sheet.turned({"facts": {f"{about} {name}": value}})
    file = tmp_path / "stated.ttl"
    text = ontology.scenes()["drums-small"].read_text(encoding="utf-8")
    file.write_text(f"{text}\n:stated a c:SituatedObjectInstance ; c:situationType d:{name} ; c:about :{about} .\n")
    with pytest.raises(KnowledgeError, match="CLASH> is stated, but a rule defines it"):
        confab.load(file).plan()


def test_an_error_lists_only_situation_types_of_the_author() -> None:
    with pytest.raises(KnowledgeError, match=r"\(known: AT, CLASH, IN, RESERVE\)"):
        confab.load("drums-small").with_fact("bay1 CLSH true")
