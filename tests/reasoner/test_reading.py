"""From graph to problem: the stated facts, defaults, goals, and facts that people type."""

from pathlib import Path

import pytest

import confab
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.reading.goals import parse_fact, with_goals
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import Symbol, Witness

SCENES = Path(__file__).resolve().parents[2] / "ontology" / "scenes"
SCENE = """
@prefix : <https://example.org/mine#> . @prefix k: <https://w3id.org/confab/tabletop#> .
@prefix c: <https://w3id.org/confab/core#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
<https://example.org/mine> a owl:Ontology ; owl:imports <https://w3id.org/confab/tabletop> .
:shelf a owl:NamedIndividual, k:Location . :floor a owl:NamedIndividual, k:Location .
:mug a owl:NamedIndividual, k:Cup ; k:beverage k:no_beverage ; {}
"""


@pytest.fixture(scope="module")
def serving() -> Reading:
    return read(load("beverage-serving"))


REEFERS = """@prefix : <https://example.org/reefers#> . @prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/reefers> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> .
:Reefer a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :IN, :PLUGGED .
:Place a owl:Class, owl:NamedIndividual ; rdfs:subClassOf :IN .
:IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :in .
:in a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Reefer ; rdfs:range :IN .
:PLUGGED a owl:Class, owl:NamedIndividual, c:SituationType ; c:fromLevel 2 ; c:restValue c:true .
:L1_BRING a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update
  "INSERT { ?r :in ?to } WHERE { ?r a :Reefer . ?to a :Place . ?r :in ?from FILTER(?from != ?to) }" .
:L2_BRING a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:update
  "INSERT { ?r :in ?to } WHERE { ?r a :Reefer . ?to a :Place . ?r :in ?from ; :PLUGGED false FILTER(?from != ?to) }" .
:L2_PLUG a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ; c:update
  "INSERT { ?r :PLUGGED true } WHERE { ?r a :Reefer ; :PLUGGED false }" .
:L2_UNPLUG a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 3 ; c:update
  "INSERT { ?r :PLUGGED false } WHERE { ?r a :Reefer ; :PLUGGED true }" .
:quay a owl:NamedIndividual, :Place ; c:index 1 . :ship a owl:NamedIndividual, :Place ; c:index 2 .
:r a owl:NamedIndividual, :Reefer ; c:index 3 ; :in :quay . :s a owl:NamedIndividual, :Reefer ; c:index 4 ; :in :quay .
:s.off a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :s ; c:situationType :PLUGGED ; c:value c:false .
[ a owl:AllDifferent ; owl:distinctMembers ( :quay :ship :r :s ) ] .
:task a owl:NamedIndividual, c:Task ; c:goal :task.r .
:task.r a owl:NamedIndividual, c:ValueCondition ; c:about :r ; c:situationType :IN ; c:value :ship ."""


def test_a_situation_that_rests_true_is_true_of_an_object_without_a_fact_in_every_mode_query_and_export(
    tmp_path: Path,
) -> None:
    (tmp_path / "reefers.ttl").write_text(REEFERS)
    scene = confab.load(tmp_path / "reefers.ttl")
    assert [fact for fact in scene.facts if "PLUGGED" in fact] == ["r PLUGGED true"]
    assert [one.behavior for one in scene.affordances("r") if "PLUG" in str(one.behavior)] == ["L2_UNPLUG"]
    for result in (scene.plan(), scene.plan(mode="paper"), scene.plan(optimal=True)):
        assert [step.behavior for step in result.plan.primitives] == ["L2_UNPLUG", "L2_BRING", "L2_PLUG"]
    off = scene.with_fact("r PLUGGED false")
    assert not [fact for fact in off.facts if "PLUGGED" in fact]
    assert [step.behavior for step in off.plan().plan.primitives] == ["L2_BRING"]
    assert [f for f in off.with_fact("r PLUGGED true").facts if "PLUGGED" in f] == ["r PLUGGED true"]


@pytest.mark.parametrize(
    "fact",
    [
        ':r :PLUGGED "true" .',
        ':r.fact a c:SituatedObjectInstance ; c:about :r ; c:situationType "PLUGGED" .',
        '[] a c:SituatedObjectInstance ; c:about :r ; c:situationType :PLUGGED ; c:value "true" .',
    ],
)
def test_every_mode_refuses_a_text_in_the_place_of_an_individual_in_the_same_words(fact: str, tmp_path: Path) -> None:
    (tmp_path / "reefers.ttl").write_text(REEFERS + fact)
    said = set()
    for mode in ("guarded", "optimal", "paper"):
        with pytest.raises(
            KnowledgeError, match=r"the text '(true|PLUGGED)' as its value; name an individual"
        ) as error:
            confab.load(tmp_path / "reefers.ttl").plan(mode=mode)
        said.add(str(error.value))
    assert len(said) == 1


@pytest.mark.parametrize("node", [":s.off a owl:NamedIndividual,", "[] a"])
def test_a_stated_fact_is_read_by_every_mode_whether_its_node_has_a_name_or_not(node: str, tmp_path: Path) -> None:
    (tmp_path / "reefers.ttl").write_text(REEFERS.replace(":s.off a owl:NamedIndividual,", node))
    scene = confab.load(tmp_path / "reefers.ttl").without_goal().with_goal("s IN ship")
    for changed, steps in ((scene, 1), (scene.with_fact("s PLUGGED true"), 3)):
        for result in (changed.plan(), changed.plan(mode="paper"), changed.plan(optimal=True)):
            assert len(result.plan.primitives) == steps


def test_every_situated_object_has_the_value_that_the_scene_states(serving: Reading) -> None:
    facts = {str(symbol): value for symbol, value in serving.problem.initial.items()}
    assert facts["<cup1, LOCATION>"] == "location2"
    assert facts["<bottle2, BEVERAGE>"] == "beverage2"
    assert len(facts) == 14  # 4 objects x {location, beverage}, 2 hands x {content, position, tilt}


def test_a_hand_without_a_stated_value_has_its_rest_value(serving: Reading) -> None:
    assert serving.problem.initial[Symbol("HOLDS", ("left_hand",))] == "nothing"


def test_values_of_lower_levels_do_not_exist_on_upper_levels(serving: Reading) -> None:
    location = Symbol("LOCATION", ("cup1",))
    assert len(serving.problem.values(location, 1)) == 8
    assert "in_hand" in serving.problem.values(location, 2)


def test_an_absence_condition_is_a_negated_witness(serving: Reading) -> None:
    conditions = serving.problem.domain.behaviors["B1_MOVE"].preconditions
    assert [c.negated for c in conditions if isinstance(c, Witness)] == [True, False]


def test_short_names_of_terms_map_to_their_iris(serving: Reading) -> None:
    assert serving.names.iri("cup1") == "https://w3id.org/confab/beverage-serving#cup1"


def test_a_new_goal_replaces_the_goal_of_the_same_symbol(serving: Reading) -> None:
    problem = with_goals(serving.problem, ["cup2 LOCATION location8"])
    assert problem.goal[Symbol("LOCATION", ("cup2",))] == "location8"
    assert len(problem.goal) == len(serving.problem.goal)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cup9 LOCATION location8", "unknown individual 'cup9'.*did you mean 'cup"),
        ("cup2 LOCATON location8", "unknown situation type 'LOCATON'.*did you mean 'LOCATION'"),
        ("left_hand canReach location8", "canReach is a relation, which never changes"),
        ("cup2 LOCATION location99", "unknown individual 'location99'.*did you mean 'location"),
        ("cup2 LOCATION beverage1", "beverage1 is no value of LOCATION"),
        ("left_hand LOCATION location1", "left_hand has no LOCATION"),
        ("cup2 LOCATION", "needs one word after it, a value last; got none"),
        ("cup2", "is no fact"),
    ],
)
def test_the_message_on_a_fact_with_an_unknown_name_gives_the_most_similar_name(
    serving: Reading, text: str, message: str
) -> None:
    with pytest.raises(KnowledgeError, match=message):
        parse_fact(serving.problem, text)


@pytest.mark.parametrize(
    ("stated", "message"),
    [("k:holds :mug .", "<mug, LOCATION> has no value"), ("k:location :shelf, :floor .", "several values")],
)
def test_a_situated_object_needs_exactly_one_value(tmp_path: Path, stated: str, message: str) -> None:
    path = tmp_path / "mine.ttl"
    path.write_text(SCENE.format(stated))
    with pytest.raises(KnowledgeError, match=message):
        read(load(path))


def test_a_missing_value_of_an_individual_of_two_classes_is_explained_by_the_classes(tmp_path: Path) -> None:
    path = tmp_path / "mine.ttl"
    path.write_text(
        SCENE.format("k:location :shelf .").replace(
            ":floor a owl:NamedIndividual,", ":floor a k:Cup, owl:NamedIndividual,"
        )
    )
    with pytest.raises(
        KnowledgeError, match=r"floor is a .*, which has .*, and a Location: drop one of the two classes"
    ):
        read(load(path))


def test_a_negated_goal_of_an_impossible_fact_adds_no_goal(tmp_path: Path) -> None:
    """A towel for which CLEAN doesn't exist isn't clean, with or without that goal."""
    scene = (SCENES / "drawers-small.ttl").read_text()
    goal = ":keepsakes.never a owl:NamedIndividual, c:ValueCondition ; c:about :album ; c:situationType d:OPENED ; c:negated true ."
    path = tmp_path / "mine.ttl"
    path.write_text(scene.replace(":keepsakes.letter .", ":keepsakes.letter, :keepsakes.never .", 1) + goal)
    assert read(load(path)).problem.goal == read(load("drawers-small")).problem.goal


def test_a_stated_fact_outside_of_the_class_of_its_situation_type_is_ignored(tmp_path: Path) -> None:
    """A drawer can be opened, an album can't; no fact follows from the statement that the album is open."""
    path = tmp_path / "mine.ttl"
    said = ":open_album a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :album ; c:situationType d:OPENED ."
    path.write_text((SCENES / "drawers-small.ttl").read_text() + said)
    assert read(load(path)).problem.initial == read(load("drawers-small")).problem.initial


def test_a_fact_says_what_holds_and_may_not_be_negated(tmp_path: Path) -> None:
    path = tmp_path / "mine.ttl"
    said = ":closed a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :drawer ; c:situationType d:OPENED ; c:negated true ."
    path.write_text((SCENES / "drawers-small.ttl").read_text() + said)
    with pytest.raises(KnowledgeError, match="closed> is a fact with c:negated"):
        read(load(path))


def test_a_conjunction_may_replace_a_single_condition(tmp_path: Path) -> None:
    domain = (SCENES.parent / "domains" / "drawers.ttl").read_text()
    together = "c:precondition :L2_TAKE.all ;"
    found = domain.replace("c:precondition :L2_TAKE.empty, :L2_TAKE.isAt, :L2_TAKE.reachable ;", together)
    assert found != domain
    all_ = (
        ":L2_TAKE.all a owl:NamedIndividual, c:AllOf ; c:condition :L2_TAKE.empty, :L2_TAKE.isAt, :L2_TAKE.reachable ."
    )
    path = tmp_path / "drawers.ttl"
    path.write_text(found + all_)
    mine = tmp_path / "mine.ttl"
    mine.write_text((SCENES / "drawers-small.ttl").read_text())
    (tmp_path / "catalog-v001.xml").write_text(
        '<?xml version="1.0"?><catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">'
        '<uri name="https://w3id.org/confab/drawers" uri="drawers.ttl"/></catalog>'
    )
    said = read(load(mine)).problem.domain.behaviors["L2_TAKE"]
    assert said == read(load("drawers-small")).problem.domain.behaviors["L2_TAKE"]
