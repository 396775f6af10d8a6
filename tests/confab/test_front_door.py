"""The first commands of a user work: names with Tab completion, facts as text, results in place of plans, effective edits."""

import inspect
from pathlib import Path

import pytest
import rdflib

import confab
from confab.picturing import class_tree
from confab.reasoner.generate import write_scene

TABLETOP = rdflib.Namespace("https://w3id.org/confab/tabletop#")
SERVING = rdflib.Namespace("https://w3id.org/confab/beverage-serving#")
TABLE = rdflib.Namespace("https://w3id.org/confab/dining-table#")
CUPS = "SELECT ?cup WHERE { ?cup a k:Cup } ORDER BY ?cup"


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving")


@pytest.fixture(scope="module")
def result(scene: confab.Scene) -> confab.Result:
    return scene.plan()


def test_the_tab_key_offers_the_public_names_and_nothing_else() -> None:
    assert {name for name in dir(confab) if not name.startswith("_")} == set(confab.__all__)
    for name in confab.__all__:
        assert inspect.getdoc(getattr(confab, name)), name


def test_a_single_goal_can_be_given_as_a_text(scene: confab.Scene, result: confab.Result) -> None:
    goal = "cup2 LOCATION location8"
    assert scene.plan(goal).plan == scene.plan([goal]).plan != result.plan
    assert scene.execute(goals=goal).reached


def test_a_result_an_execution_or_a_file_can_replace_its_plan_as_argument(
    tmp_path: Path, scene: confab.Scene, result: confab.Result
) -> None:
    execution = scene.execute(result)
    assert execution.plan.length == result.plan.length
    assert scene.execute(result.save(tmp_path / "plan.json")).plan == execution.plan
    one, other, third = (confab.Memory.of(scene) for _ in range(3))
    one.learn(scene, result.plan)
    other.learn(scene, result)
    third.learn(scene, execution)
    assert one.experience.totals() == other.experience.totals() == third.experience.totals() != {}
    with pytest.raises(confab.KnowledgeError, match="wanted a plan"):
        scene.verify(7)  # type: ignore[arg-type]


def test_a_memory_may_be_the_name_of_its_file(tmp_path: Path, scene: confab.Scene, result: confab.Result) -> None:
    memory = confab.Memory.of(scene)
    memory.learn(scene, result)
    path = memory.save(tmp_path / "memory.ttl")
    assert scene.plan(memory=path).plan == scene.plan(memory=str(path)).plan
    assert scene.execute(memory=str(path)).reached
    with pytest.raises(confab.KnowledgeError, match="no such memory file"):
        scene.plan(memory="none.ttl")


def test_a_verification_with_0_rollouts_is_refused_in_one_sentence(scene: confab.Scene, result: confab.Result) -> None:
    with pytest.raises(confab.KnowledgeError, match="0 rollouts can't verify a plan; wanted 1 or more"):
        scene.verify(result, rollouts=0)


def test_facts_and_goals_are_shown_as_they_are_given(scene: confab.Scene) -> None:
    assert scene.objects["cup1"] == "Cup"
    assert "cup1 LOCATION location2" in scene.facts
    again = scene.with_fact(*scene.facts).with_goal(*scene.goals)
    assert (again.facts, again.goals) == (scene.facts, scene.goals)
    assert again.plan().plan == scene.plan().plan


@pytest.mark.parametrize("name", ["couriers-small", "house-small", "towers-small", "canal-small", "laboratory-small"])
def test_every_printed_fact_and_goal_of_a_scene_is_accepted_as_text(name: str) -> None:
    scene = confab.load(name)
    again = scene.with_fact(*scene.facts).with_goal(*scene.goals)
    assert again.problem == scene.problem


def test_a_changed_fact_gives_a_new_scene_and_does_not_change_the_first(tmp_path: Path, scene: confab.Scene) -> None:
    moved = scene.with_fact("cup1 LOCATION location7")
    assert moved.query("SELECT ?where WHERE { ?cup k:location ?where FILTER(STRENDS(STR(?cup), 'cup1')) }")[0] == (
        "location7",
    )
    assert "cup1 LOCATION location2" in scene.facts
    assert len(moved.plan().plan.steps) == 3
    wanted = moved.with_goal("cup2 LOCATION location8", "cup1 BEVERAGE no_beverage")
    assert {"cup2 LOCATION location8", "cup1 BEVERAGE no_beverage"} < set(wanted.goals)
    assert len(wanted.goals) == len(scene.goals)
    with pytest.raises(confab.KnowledgeError, match="did you mean 'location"):
        scene.with_fact("cup1 LOCATION location77")


def test_a_goal_is_left_out_by_its_first_words(scene: confab.Scene) -> None:
    assert {*scene.goals} - {*scene.without_goal("cup1 LOCATION", "bottle2").goals} == {
        "cup1 LOCATION location7",
        "bottle2 LOCATION location3",
    }
    assert scene.without_goal().goals == scene.without_goal("all").goals == []
    only = scene.without_goal().with_goal("cup2 LOCATION location5")
    assert (
        only.goals
        == ["cup2 LOCATION location5"]
        == list(scene.without_goal("cup1", "bottle1", "bottle2", "cup2 BEVERAGE").goals)
    )
    assert [str(step) for step in only.plan().plan] == ["28 B1_MOVE cup2 location5"]
    with pytest.raises(
        confab.KnowledgeError, match="no goal 'cup1 LOCATION location3'; did you mean 'cup1 LOCATION location7'"
    ):
        scene.without_goal("cup1 LOCATION location3")


CONJUNCTION = """
@prefix : <https://example.org/s#> . @prefix b: <https://w3id.org/confab/beverage-serving#> .
@prefix c: <https://w3id.org/confab/core#> . @prefix k: <https://w3id.org/confab/tabletop#> .
@prefix t: <https://w3id.org/confab/dining-table#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
<https://example.org/s> a owl:Ontology ; owl:imports <https://w3id.org/confab/beverage-serving> .
b:serving c:goal :both . :both a owl:NamedIndividual, c:AllOf ; c:condition :one, :other .
:one a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:situationType k:LOCATION ; c:value t:location1 .
:other a owl:NamedIndividual, c:ValueCondition ; c:about :cup ; c:situationType k:BEVERAGE ; c:value b:beverage1 .
:cup a owl:NamedIndividual, k:Cup ; k:location t:location6 ; k:beverage k:no_beverage .
"""


def test_the_other_goals_of_a_conjunction_stay_if_one_is_left_out_or_replaced() -> None:
    scene = confab.load(CONJUNCTION)
    assert {*scene.goals} - {*scene.without_goal("cup LOCATION").goals} == {"cup LOCATION location1"}
    assert {*scene.goals} ^ {*scene.with_goal("cup LOCATION location8").goals} == {
        "cup LOCATION location1",
        "cup LOCATION location8",
    }


def test_a_scene_without_a_task_can_be_given_a_goal(tmp_path: Path) -> None:
    write_scene(tmp_path / "s.ttl", "served", 4)
    text = (tmp_path / "s.ttl").read_text()
    (tmp_path / "s.ttl").write_text(text.replace("c:Task", "c:Object").replace("c:goal", "rdfs:seeAlso"))
    bare = confab.load(tmp_path / "s.ttl")
    assert bare.goals == []
    (first, *_) = [fact for fact in bare.facts if "LOCATION" in fact]
    assert bare.with_goal(first).plan().plan.steps == ()


def test_edits_of_the_rdflib_graph_affect_queries_and_plans() -> None:
    scene = confab.load("beverage-serving")
    graph = scene.graph
    before = len(scene.query(CUPS))
    graph.add((SERVING.cup9, rdflib.RDF.type, TABLETOP.Cup))
    assert len(scene.query(CUPS)) == before + 1
    graph.remove((SERVING.cup9, None, None))
    assert len(scene.query(CUPS)) == before
    graph.set((SERVING.cup1, TABLETOP.location, TABLE.location7))
    assert "cup1 LOCATION location7" in scene.facts
    assert len(scene.plan().plan.steps) == 3
    graph.update(
        "DELETE { ?cup k:location ?l } INSERT { ?cup k:location t:location2 } WHERE { ?cup k:location ?l . FILTER(?cup = <"
        + SERVING.cup1
        + ">) }"
    )
    assert len(scene.plan().plan.steps) == 4
    with pytest.raises(confab.KnowledgeError, match="no triple of RDF"):
        graph.add((SERVING.cup1, rdflib.URIRef("no iri"), SERVING.cup1))


def test_a_picture_is_an_image_or_a_file_if_a_file_is_named(tmp_path: Path, scene: confab.Scene) -> None:
    assert scene.picture(classes=True).size[0] > 100
    assert scene.picture(tmp_path / "card.png", behavior="B2_PICK").is_file()


def test_an_argument_of_a_wrong_type_is_refused_in_one_sentence(scene: confab.Scene, result: confab.Result) -> None:
    with pytest.raises(confab.KnowledgeError, match=r"time_limit='5' is no number; wanted seconds as a number, e.g. 5"):
        scene.plan(time_limit="5")  # type: ignore[arg-type]
    with pytest.raises(confab.KnowledgeError, match="rollouts='3' is no number"):
        result.verify(rollouts="3")  # type: ignore[arg-type]
    with pytest.raises(confab.KnowledgeError, match=r"wanted a text like 'cup2 LOCATION location8', or several; got 7"):
        scene.plan(7)  # type: ignore[arg-type]


def test_a_plan_is_reordered_only_if_the_new_order_is_applicable(result: confab.Result) -> None:
    assert [step.id for step in result.in_order(22, 34, 28, 39).steps] == [22, 34, 28, 39]
    with pytest.raises(confab.KnowledgeError, match="wanted 22, 28, 34, 39 in another order; got 22"):
        result.in_order(22)
    with pytest.raises(confab.KnowledgeError, match="can't be done in that order"):
        result.in_order(39, 34, 28, 22)


def test_a_shipped_query_is_run_by_its_name(scene: confab.Scene) -> None:
    assert ("cup1", "location2") in scene.query("where-is-everything")
    with pytest.raises(confab.KnowledgeError, match="did you mean 'where-is-everything'"):
        scene.query("where-is-everythin")


def test_a_picture_of_classes_marks_derived_situation_types() -> None:
    words = [text.get_text() for text in class_tree(confab.load("packing-small")).axes[0].texts]
    assert "Thing\nLIES_IN\nfollows: INSIDE, OUT_OF_REACH,\nSTORED_AWAY" in words
