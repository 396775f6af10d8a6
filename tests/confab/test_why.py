"""The reason for a step, and the reason against an alternative, in the scene's own words and for any kind of scene."""

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
import ontology
from confab import Scene
from confab.cli import app, main
from confab.labels import Labels, labels_of
from confab.lifted import Sayings
from confab.planner.plan import Plan
from confab.planner.plan_costs import cost_of
from confab.planner.validation import validate
from confab.reasoner.memory.experience import ITSELF
from confab.reasoner.problem import Domain
from worlds.writing import behavior

GUESTS = Path(__file__).parent / "cases" / "guests.ttl"

DOMAIN = """(define (domain lamps) (:requirements :strips :typing) (:types lamp room)
 (:predicates (in ?r - room) (door ?a ?b - room) (lit ?l - lamp) (hangs ?l - lamp ?r - room))
 (:action walk :parameters (?a ?b - room) :precondition (and (in ?a) (door ?a ?b)) :effect (and (in ?b) (not (in ?a))))
 (:action light :parameters (?l - lamp ?r - room) :precondition (and (in ?r) (hangs ?l ?r)) :effect (lit ?l)))"""
PROBLEM = """(define (problem evening) (:domain lamps) (:objects hall attic - room bulb - lamp)
 (:init (in hall) (door hall attic) (hangs bulb attic)) (:goal (lit bulb)))"""


@pytest.fixture(scope="module")
def serving() -> confab.Result:
    return confab.load("beverage-serving").plan()


@pytest.fixture(scope="module")
def lamps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lamps")
    (folder / "d.pddl").write_text(DOMAIN)
    (folder / "p.pddl").write_text(PROBLEM)
    made = CliRunner().invoke(
        app, ["import", str(folder / "d.pddl"), str(folder / "p.pddl"), "-o", str(folder / "evening.ttl")]
    )
    assert made.exit_code == 0, made.output
    return folder / "evening.ttl"


def test_a_step_is_accepted_by_number_level_path_and_words(serving: confab.Result) -> None:
    first = serving.why(0)
    assert (
        serving.why("L1#0") == serving.why("0") == serving.why("move cup 1") == serving.why("22 B1_MOVE cup1 location7")
    )
    assert first.what == "move cup 1 to location 7"
    assert first.needs[0] == "the goal requires that cup 1 is at location 7"
    assert serving.why("0.1.1").path == (0, 1, 1)


@pytest.mark.parametrize("asked", ["lift", "L3#99", "9.9", 7, "make tea"])
def test_an_unknown_or_ambiguous_step_is_refused(serving: confab.Result, asked: str | int) -> None:
    with pytest.raises(confab.KnowledgeError, match="step"):
        serving.why(asked)


def test_reasons_are_sentences_and_name_no_id(serving: confab.Result) -> None:
    said = str(serving.explain())
    assert "“place cup 1 in left hand to location 7” (L2#1) requires that left hand holds cup 1" in said
    assert not {"HOLDS", "LOCATION", "B2_PICK", "left_hand"} & set(said.replace("(", " ").split())


@pytest.mark.parametrize("name", ["beverage-serving", "house-small"])
def test_each_value_of_a_lifted_fact_has_a_sentence_of_its_own(name: str) -> None:
    scene = confab.load(name)
    memory = confab.Memory.of(scene)
    memory.learn(scene, scene.plan())
    labels = labels_of(scene.knowledge, scene.names, scene.problem)
    told = {fact for facts in memory.experience.totals().values() for fact in facts if fact != ITSELF}
    assert len(told) > 5
    assert len({Sayings(labels).asked(fact, {}) for fact in told}) == len(told)


@pytest.mark.parametrize(
    ("asked", "lacks"),
    [
        ("B1_POUR bottle1 cup2", "some hand can reach location 4 and can reach location 1"),
        ("B2_PICK left_hand bottle1", "left hand can reach location 4"),
    ],
)
def test_an_inapplicable_alternative_is_explained_by_its_failing_condition(
    serving: confab.Result, asked: str, lacks: str
) -> None:
    assert serving.why_not(asked).lacks == (lacks,)


def test_an_alternative_without_the_individual_of_a_negated_condition_takes_any_individual(tmp_path: Path) -> None:
    """The behaviour requires that no item is at the place; the place isn't named."""
    confab.new_domain("garage", tmp_path / "garage")
    result = confab.load(tmp_path / "garage" / "garage-scene.ttl").plan()
    told = result.why_not("B1_CARRY plate2")
    assert told.plan is not None
    assert "is possible, and the plan that was found costs 2 more" in str(told)


def test_an_alternative_may_name_an_individual_that_the_task_does_not_need() -> None:
    result = confab.load("living-room").plan()
    assert "bread1" not in result.problem.individuals
    assert "“eat bread 1” isn't applicable" in str(result.why_not("EAT bread1"))


def test_a_saved_plan_is_explained_like_a_new_one(serving: confab.Result, tmp_path: Path) -> None:
    file = serving.save(tmp_path / "plan.json")
    again = confab.load("beverage-serving").read_result(file)
    assert again.why("L2#0") == serving.why("L2#0")
    assert str(again.why_not("B2_PICK left_hand bottle1")) == str(serving.why_not("B2_PICK left_hand bottle1"))
    assert again.explain().steps == serving.explain().steps
    run = CliRunner().invoke
    told = run(app, ["explain", "beverage-serving", "L2#0", "--plan", str(file)])
    assert told.output.strip() == str(serving.why("L2#0"))
    other = run(app, ["explain", "beverage-serving", "--plan", str(file), "--goal", "cup2 LOCATION location8"])
    assert "isn't valid in this scene with these goals: the goal <cup2, LOCATION> = location8" in str(other.exception)
    both = run(app, ["explain", "beverage-serving", "--plan", str(file), "--optimal"])
    assert "leave out --mode and --optimal" in str(both.exception)


def test_a_saved_plan_keeps_the_soft_goals_that_it_meets(tmp_path: Path) -> None:
    scene = confab.load("wishes-small")
    result = scene.plan()
    again = scene.read_result(result.save(tmp_path / "plan.json"))
    assert again.problem.goal == result.in_whole_scene().problem.goal
    assert again.explain().steps == result.explain().steps


@pytest.mark.parametrize("asked", ["B1_MOVE cup2 location1", "B2_PICK right_hand cup1", "B1_MOVE bottle1 location6"])
def test_an_applicable_alternative_gets_a_plan_to_the_goal_and_its_additional_cost(
    serving: confab.Result, asked: str
) -> None:
    told = serving.why_not(asked)
    assert told.plan is not None
    assert validate(serving.problem, told.plan) == []
    assert told.more == cost_of(serving.problem, told.plan) - cost_of(serving.problem, serving.plan)
    behavior, *arguments = asked.split()
    assert (behavior, tuple(arguments)) in {(s.behavior, s.arguments) for s in told.plan.walk()}


def test_the_precondition_of_an_upper_level_that_an_alternative_violates_is_reported_first(
    serving: confab.Result,
) -> None:
    """A cup that is filled at its present place must then be carried while it is full.

    Level 1 forbids this, and level 2 doesn't see it.
    """
    told = serving.why_not("B1_POUR bottle1 cup1", 0)
    (broken,) = told.breaks
    assert "the plan that was found violates a condition of a level above" in told.answer
    assert broken.startswith(
        "cup 1 is at location 7: “move cup 1 to location 7” of level 1 requires that (cup 1 carries no beverage"
    )
    assert str(told).splitlines()[1].strip() == broken
    assert told.json()["breaks"] == [broken]


def test_an_alternative_that_keeps_its_levels_violates_no_precondition(serving: confab.Result) -> None:
    told = serving.why_not("cup2 LOCATION location8")
    assert told.plan is not None
    assert told.breaks == ()
    assert "is possible, and" in told.answer


def test_an_alternative_may_name_the_hand_that_takes_part(serving: confab.Result) -> None:
    told = serving.why_not("cup1 LOCATION location7 by right_hand")
    assert told.plan is not None
    moving = [
        s for s in told.plan.at_level(2) if "cup1" in (*s.arguments, *s.bindings.values()) and s.behavior != "B2_POUR"
    ]
    assert moving
    assert all("right_hand" in step.arguments for step in moving)
    assert serving.why_not("cup2 LOCATION location5 by right_hand").plan is None
    assert serving.why_not("cup1 LOCATION location7").more == 0


def test_the_answer_about_another_goal_names_the_goal_that_it_replaces(serving: confab.Result) -> None:
    answer = serving.why_not("cup2 LOCATION location8").answer
    assert "cup 2 is at location 8, in place of the goal that cup 2 is at location 5, is possible" in answer


def test_another_goal_is_planned_as_an_alternative(serving: confab.Result) -> None:
    told = serving.why_not("cup2 LOCATION location8")
    assert told.more is not None
    assert told.more > 0
    assert "cup 2 is at location 8" in told.answer


@pytest.mark.parametrize("asked", ["cup2 LOCATOIN location8", "B1_MOV cup2 location8", "B1_MOVE cup2 nowhere", "hello"])
def test_a_misspelt_alternative_is_refused(serving: confab.Result, asked: str) -> None:
    with pytest.raises(confab.KnowledgeError):
        serving.why_not(asked)


def test_a_flat_import_is_explained(lamps: Path) -> None:
    result = confab.load(lamps).plan()
    walk, light = (result.why(i) for i in range(2))
    assert any(light.step.split(" ", 1)[1] in need or light.what in need for need in walk.needs)
    assert "the goal requires" in light.needs[0]
    assert result.why_not(f"{result.plan.steps[1].behavior} bulb hall").lacks


@pytest.mark.parametrize("scene", ["towers-small", "laboratory-small", "house-small", "couriers-small"])
def test_symbolic_worlds_are_explained(scene: str) -> None:
    account = confab.load(scene).explain()
    assert account.steps
    assert all(step.needs for step in account.steps)


def test_the_explanation_of_an_unsolvable_task_names_the_contested_place() -> None:
    told = confab.load("beverage-serving").explain(["cup1 LOCATION location7", "cup2 LOCATION location7"])
    assert told.steps == ()
    assert "location7" in told.headline


@pytest.mark.parametrize(
    ("label", "sentence"),
    [
        ("move a cup to the TUB", "move cup 2 to tub"),
        ("move cup: a cup is heavy", "move cup 2: a cup is heavy (tub)"),
        ("move cups", "move cups (cup 2, tub)"),
    ],
)
def test_an_individual_replaces_the_first_word_of_a_label_that_equals_the_name_of_its_parameter(
    label: str, sentence: str
) -> None:
    move = behavior("MOVE", 1, "?cup:Cup ?tub:Tub", [], [])
    domain = Domain({}, {"MOVE": move})
    assert Labels({"MOVE": label, "cup2": "cup 2"}, {}, domain).grounded("MOVE", ("cup2", "tub")) == sentence


def test_the_proof_that_no_plan_exists_is_explained_in_the_labels_of_the_scene() -> None:
    ward = str(Path(__file__).parents[1] / "planner/cases/reason-key-opens-nothing/ward-small.ttl")
    result = confab.load(ward).plan()
    assert result.certificate is not None
    told = str(result.explain())
    assert "requires a Key that opens cabinet0" in told
    assert "never: cabinet0 lock unlocked" in told
    assert told.endswith("The goal requires that patient0 received drug0; this never holds.")
    shown = CliRunner().invoke(app, ["explain", ward])
    assert shown.exit_code == 1
    assert "An independent checker has verified this" in shown.output


def test_the_command_line_explains_plans_steps_and_alternatives() -> None:
    run = CliRunner().invoke
    assert "the goal requires that cup 1" in run(app, ["explain", "beverage-serving"]).output
    assert "requires that left hand holds cup 1" in run(app, ["explain", "beverage-serving", "L2#0"]).output
    assert (
        "left hand can reach location 4"
        in run(app, ["explain", "beverage-serving", "--not", "B2_PICK left_hand bottle1"]).output
    )
    assert run(app, ["explain", "beverage-serving", "L9#0"]).exit_code != 0


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("L2#0", "trolley has charge at least 8"),
        ("L2#14", "one of its effects uses a number that isn't stated for these individuals"),
    ],
)
def test_an_alternative_that_leaves_the_bounds_of_an_amount_is_not_called_applicable(
    place: str, said: str, tmp_path: Path
) -> None:
    for folder, name in (("domains", "canteen"), ("scenes", "canteen-small")):
        text = (ontology.ROOT / folder / f"{name}.ttl").read_text("utf-8")
        text = text.replace("https://w3id.org/confab/canteen", "https://example.org/canteen")
        text = text.replace(":L2_DRIVE.at, :L2_DRIVE.charged", ":L2_DRIVE.at")  # only the bounds of the battery matter
        (tmp_path / f"{name}.ttl").write_text(text, "utf-8")
    alone = confab.load(str(tmp_path / "canteen-small.ttl")).plan(leave_levels=False)  # each step has its own drives
    told = str(alone.why_not("L2_DRIVE trolley table2", place))
    assert said in told
    assert "could be done" not in told


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ("move cup 1 to location 8", "B1_MOVE cup1 location8"),
        ("pour bottle1 to cup2", "B1_POUR bottle1 cup2"),
        ("cup 2 is at location 8", "cup2 LOCATION location8"),
    ],
)
def test_an_alternative_is_given_by_names_or_in_the_words_of_an_explanation(words: str, names: str) -> None:
    result = confab.load("beverage-serving").plan()
    assert str(result.why_not(words)).partition("\n")[0] == str(result.why_not(names)).partition("\n")[0]


def test_the_message_on_a_shipped_query_without_its_vocabulary_names_usable_queries() -> None:
    with pytest.raises(confab.KnowledgeError, match=r"a vocabulary that this scene doesn't import; .*what-is-wanted"):
        confab.load("towers-small").query("where-is-everything")


def test_a_parameter_that_no_condition_determines_takes_any_member_of_its_class(tmp_path: Path) -> None:
    domain = """
    @prefix : <https://example.org/lamps#> .
    @prefix c: <https://w3id.org/confab/core#> .
    @prefix owl: <http://www.w3.org/2002/07/owl#> .
    @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
    <https://example.org/lamps> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> .
    :Lamp a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :ON .
    :Hand a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
    :Match a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
    :ON a owl:Class, owl:NamedIndividual, c:SituationType .
    :LIGHT a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update
      "INSERT { ?lamp :ON true } WHERE { ?lamp a :Lamp . ?hand a :Hand . ?match a :Match . FILTER NOT EXISTS { ?lamp :ON true } }" .
    :a a owl:NamedIndividual, :Lamp ; c:index 1 .
    :left a owl:NamedIndividual, :Hand ; c:index 2 .
    :right a owl:NamedIndividual, :Hand ; c:index 3 .
    :m a owl:NamedIndividual, :Match ; c:index 4 .
    """
    (tmp_path / "lamps.ttl").write_text(domain)
    result = confab.load(tmp_path / "lamps.ttl").plan(goal="a ON true")
    assert str(result.plan[0]) == "0 LIGHT a left m"
    assert "costs the same" in str(result.why_not("LIGHT a right"))


@pytest.mark.parametrize(
    ("asked", "place", "replaced"),
    [
        ("B2_PICK right_hand cup1", "L1#0", "L2#0"),
        ("B3_GRASP left_hand", "L1#0", "L3#1"),
        ("B1_MOVE cup1 location8", "L3#3", "L1#0"),
    ],
)
def test_an_alternative_of_another_level_replaces_a_step_in_or_above_the_named_one(
    serving: confab.Result, asked: str, place: str, replaced: str
) -> None:
    assert f"({replaced})" in serving.why_not(asked, place).answer


def test_an_alternative_is_accepted_as_a_step_as_its_text_and_as_words(serving: confab.Result) -> None:
    step = serving.plan[0]
    told = {str(serving.why_not(one)) for one in (step, str(step), (step.behavior, *step.arguments))}
    assert len(told) == 1
    assert "already has this step" in told.pop()


def test_an_alternative_in_a_plan_without_steps_replaces_nothing() -> None:
    result = confab.load("beverage-serving").plan().in_whole_scene()
    empty = replace(result, outcome=replace(result.outcome, plan=Plan(())))
    assert "no step that B1_MOVE could replace" in empty.why_not("B1_MOVE cup1 location8").answer


def test_another_goal_is_planned_as_an_alternative_to_an_unsolvable_task() -> None:
    scene = confab.load("two-cups").without_goal()
    result = scene.plan(["cup1 LOCATION location7", "cup2 LOCATION location7"])
    assert not result.solved
    told = result.why_not("cup2 LOCATION location5")
    assert told.answer.startswith(
        "the goal that cup 2 is at location 5, in place of the goal that cup 2 is at location 7, is"
    )
    assert told.plan is not None
    assert told.more is None
    assert result.why_not("cup2 LOCATION location7").answer.startswith("no plan achieves that cup 2 is at location 7: ")
    for ask in (lambda: result.why(0), result.verify):
        with pytest.raises(
            confab.KnowledgeError, match=r"there is no plan \(unsolvable\): cup1 LOCATION location7 and"
        ):
            ask()


@pytest.mark.parametrize("call", ["plan", "verify", "explain", "explain 0", "export --bt -o tree"])
def test_no_is_an_answer_of_every_command_that_needs_a_plan(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    command, *more = call.split()
    unsolvable = ["--goal", "cup1 LOCATION location7", "--goal", "cup2 LOCATION location7"]
    with pytest.raises(SystemExit) as ended:
        main([command, "two-cups", *more, *unsolvable])
    assert ended.value.code == 1
    assert "unsolvable" in "".join(capsys.readouterr())


@pytest.mark.parametrize("asked", ["", " ", 3, None])
def test_an_alternative_without_words_is_refused(serving: confab.Result, asked: str) -> None:
    with pytest.raises(confab.KnowledgeError, match="wanted a"):
        serving.why_not(asked)


@pytest.mark.parametrize("asked", [None, 1.5, 22, "22"])
def test_a_value_that_names_no_step_is_refused(serving: confab.Result, asked: str) -> None:
    with pytest.raises(confab.KnowledgeError, match="no step"):
        serving.why(asked)


def test_a_negative_number_counts_steps_from_the_end(serving: confab.Result) -> None:
    assert serving.why(-1) == serving.why(serving.plan[-1])


def test_steps_refined_together_with_the_same_label_are_named_once(serving: confab.Result) -> None:
    step = serving.plan[0]
    assert serving.labels.step(replace(step, joined=(step,))) == serving.labels.step(step)


def test_the_text_of_steps_that_are_refined_together_is_a_question_about_the_first() -> None:
    result = confab.load("library-small").plan()
    joined = next(step for step in result.plan.steps if step.joined)
    assert "the plan already has this step" in str(result.why_not(joined))
    assert str(result.why_not(str(joined))) == str(result.why_not(joined))


ROOMS = """
@prefix : <https://example.org/rooms#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/rooms> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Ball a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :IN .
:Robot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT, :DIRTY .
:Room a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :IN, :AT .
:IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :in .
:in a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Ball ; rdfs:range :IN .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at ; c:fromLevel 2 ; c:restValue :home .
:at a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Robot ; rdfs:range :AT .
:DIRTY a owl:Class, owl:NamedIndividual, c:SituationType ; c:fromLevel 2 .
:beside a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Room ; rdfs:range :Room .
:L1_BRING a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''DELETE { ?ball :in ?from }
INSERT { ?ball :in ?to } WHERE { ?ball a :Ball . ?to a :Room . ?ball :in ?from FILTER(?from != ?to) }''' .
:L2_PUSH a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ; c:update '''DELETE { ?ball :in ?from . ?robot :at ?from }
INSERT { ?ball :in ?to . ?robot :at ?to ; :DIRTY true }
WHERE { ?robot a :Robot . ?ball a :Ball . ?to a :Room . ?ball :in ?from . ?robot :at ?from . ?from :beside ?to }''' .
:L2_WALK a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ; c:update '''DELETE { ?robot :at ?from }
INSERT { ?robot :at ?to } WHERE { ?robot a :Robot . ?to a :Room . ?robot :at ?from . ?from :beside ?to }''' .
:L2_THROW a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 3 ; c:cost 10.0 ; c:update '''DELETE { ?ball :in ?from }
INSERT { ?ball :in ?to . ?robot :DIRTY true }
WHERE { ?robot a :Robot . ?ball a :Ball . ?to a :Room . ?ball :in ?from . ?robot :at ?from FILTER(?from != ?to) }''' .
:ball a owl:NamedIndividual, :Ball ; c:index 1 ; :in :home .
:robot1 a owl:NamedIndividual, :Robot ; c:index 2 ; :at :home .
:robot2 a owl:NamedIndividual, :Robot ; c:index 3 ; :at :home .
:home a owl:NamedIndividual, :Room ; c:index 4 ; :beside :hall .
:hall a owl:NamedIndividual, :Room ; c:index 5 ; :beside :home, :attic .
:attic a owl:NamedIndividual, :Room ; c:index 6 ; :beside :hall .
[ a owl:AllDifferent ; owl:distinctMembers ( :ball :robot1 :robot2 :home :hall :attic ) ] .
"""
"""A robot that brings a ball within level 2 is dirty afterwards, and it comes back home if it has no other goal."""


def rooms(folder: Path, *goals: str) -> Scene:
    """Return the scene with the rooms and goals; each goal may have a weight after its value."""
    task = f":task a owl:NamedIndividual, c:Task ; c:goal {', '.join(f':goal{i}' for i in range(len(goals)))} ."
    for i, (about, situation, value, *weight) in enumerate(map(str.split, goals)):
        task += (
            f"\n:goal{i} a owl:NamedIndividual, c:ValueCondition ; c:about :{about} ; c:situationType :{situation} ; "
        )
        task += f"c:value {value}{''.join(f' ; c:weight {one}' for one in weight)} ."
    (folder / "rooms.ttl").write_text(ROOMS + task)
    return confab.load(folder / "rooms.ttl")


def test_the_cost_of_an_alternative_to_an_optimal_plan_is_proved_and_that_of_another_plan_is_the_cost_of_a_plan() -> (
    None
):
    scene = confab.load("wishes-small")
    proved, found = (scene.plan(optimal=optimal).why_not("store STOCK 0") for optimal in (True, False))
    assert proved.more == scene.plan("store STOCK 0", optimal=True).cost - scene.plan(optimal=True).cost
    assert "is possible and costs 11 more" in proved.answer
    assert "is possible, and the plan that was found costs 11 more" in found.answer


def test_an_alternative_to_a_plan_with_fewest_steps_has_fewest_steps(tmp_path: Path) -> None:
    """A throw costs more than the three cheapest steps."""
    told = rooms(tmp_path, "ball IN :attic").plan(minimise="steps").why_not("ball IN hall")
    assert told.plan is not None
    assert [step.behavior for step in told.plan.primitives] == ["L2_THROW"]
    assert "is possible and costs the same (1 primitives instead of 1)" in told.answer


def test_an_alternative_to_a_plan_that_keeps_its_levels_keeps_its_levels(tmp_path: Path) -> None:
    scene = rooms(tmp_path, "ball IN :attic")
    assert scene.plan().why_not("robot1 AT attic").plan is not None
    told = scene.plan(leave_levels=False).why_not("robot1 AT attic")
    assert "levels must not be left" in told.answer


def test_an_alternative_to_a_plan_from_observed_facts_begins_with_these_facts(tmp_path: Path) -> None:
    scene = rooms(tmp_path, "ball IN :attic")
    seen = ("ball c:situationType :IN", "robot1 c:situationType :AT", "robot2 c:situationType :AT")
    facts = (f"[] a c:SituatedObjectInstance ; c:about :{one.replace(' ', ' ; ', 1)} ; c:value :hall ." for one in seen)
    prefixes = ROOMS.split("<https://example.org/rooms> ")[0]
    (tmp_path / "seen.ttl").write_text("\n".join([prefixes, *facts]))
    told = scene.plan(observed=tmp_path / "seen.ttl").why_not("robot1 AT attic")
    assert told.plan is not None
    assert len(told.plan.primitives) == 1


def test_an_alternative_meets_the_soft_goals_that_the_plan_meets_and_needs_no_others() -> None:
    scene = confab.load("wishes-small")
    result = scene.read_result(scene.without_goal("glass", "store").plan().plan)
    assert [goal.met for goal in result.soft_goals] == [False, False]
    told = result.why_not("books IN store")
    assert told.more == -result.cost
    assert "soft goal" not in told.answer


@pytest.mark.parametrize(
    ("hard", "asked", "soft"),
    [
        ("robot2 AT :hall", "ball IN hall", "(weight 50) that robot2"),
        ("ball IN :hall", "ball IN hall by robot1", "(weight 90) that robot1"),
    ],
)
def test_the_answer_names_a_soft_goal_that_only_the_plan_without_the_alternative_meets(
    hard: str, asked: str, soft: str, tmp_path: Path
) -> None:
    scene = rooms(tmp_path, hard, "robot1 DIRTY c:false 90.0", "robot2 DIRTY c:false 50.0")
    told = scene.plan().why_not(asked)
    assert told.plan is not None
    assert f", without the soft goal {soft} isn't DIRTY, " in told.answer


def test_the_answer_names_a_soft_goal_that_only_the_plan_with_the_alternative_meets() -> None:
    told = confab.load("wishes-small").plan().why_not("paper IN shop")
    assert ", with the soft goal (weight 8) that store stock 0, is possible" in told.answer


def test_an_alternative_to_a_goal_about_two_individuals_takes_the_place_of_this_goal() -> None:
    result = confab.load(GUESTS).plan(["guest1 KNOWS guest2", "guest2 KNOWS guest1"])
    assert "this is a goal already" in result.why_not("guest1 KNOWS guest2").answer
    told = result.why_not("guest1 KNOWS guest2 false")
    assert "in place of the goal that guest 1 KNOWS guest 2, is possible" in told.answer
    assert told.more == -1
    assert told.plan is not None
    assert [step.arguments for step in told.plan if step.behavior == "PRESENT"] == [("guest2", "guest1")]


def test_the_individual_that_a_goal_is_about_can_be_the_one_that_takes_part() -> None:
    told = confab.load(GUESTS).plan().why_not("guest1 AT salon by guest1")
    assert told.more == 0
