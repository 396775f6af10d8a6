"""Names that a new user tries: they work, or the error gives the correct name."""

from __future__ import annotations

import builtins
import copy
import json
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import confab
import confab.why  # its classes have an overview, too
from confab import ontology
from confab.cli import main
from confab.guessing import groups, hint, known, listed
from confab.hints import COMMANDS, HINTS, OVERVIEW
from confab.planner.plan import Plan
from confab.planner.timed.plan import TimedPlan
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import public_names
from confab.reasoner.symbols import Fact
from confab.sim.verdict import Verdict
from confab.sim.verify import Rollout, StepReport


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load("beverage-serving-moved")


@pytest.fixture(scope="module")
def result(scene: confab.Scene) -> confab.Result:
    return scene.plan()


Refused = Callable[[list[str]], str]


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Refused:
    """Return the message on stderr with which the command line refuses a command as misuse."""

    def said(line: list[str]) -> str:
        with pytest.raises(SystemExit, match="2"):
            main(line)
        return capsys.readouterr().err

    return said


@pytest.fixture(scope="module")
def things(scene: confab.Scene, result: confab.Result) -> dict[str, object]:
    """One object of each kind that has a table of wrong names and can be created without physics."""
    problem, execution = scene.problem, scene.execute(result)
    symbol = next(iter(problem.goal))
    rollout = Rollout(0, True, (StepReport(result.plan.primitives[0], Verdict(True), 1.0),), (), 1.0, 1.0)
    return {
        "confab": confab,
        "scene": scene,
        "result": result,
        "plan": result.plan,
        "step": result.plan[0],
        "outcome": result.outcome,
        "execution": execution,
        "episode": execution.episode,
        "memory": confab.Memory.of(scene),
        "table": scene.query("where-is-everything"),
        "problem": problem,
        "domain": problem.domain,
        "behaviour": scene.behaviors["B1_MOVE"],
        "situation": problem.domain.situations[symbol.situation],
        "symbol": symbol,
        "fact": Fact(symbol, problem.goal[symbol]),
        "report": confab.Report(result.plan, problem.goal, (rollout,)),
        "rollout": rollout,
        "verdict": Verdict(True),
        "schedule": TimedPlan(Plan(()), ()),
    }


def first(kind: str, name: str) -> str:
    """Return the first suggestion of the hint about a wrong name; empty if the hint is only an overview."""
    found = re.match(r"; (?:use|perhaps) (.+?)(\. [A-Z].* has, |$)", hint(f"a {kind}", name))
    return found[1] if found else ""


def kinds_of_objects() -> dict[type, str]:
    """Return the classes whose errors about wrong names give hints, each with its kind."""
    found, waiting = dict[type, str](), [object]
    while waiting:
        for cls in {*type.__subclasses__(waiting.pop())} - {type}:
            waiting.append(cls)
            kind = cls.__dict__.get("_kind")
            if isinstance(kind, str) and cls.__module__.startswith("confab."):
                found[cls] = kind.split()[-1]
    return found


def test_the_error_on_each_listed_wrong_name_gives_only_the_right_name(things: dict[str, object]) -> None:
    for kind, there in things.items():
        for name, _ in listed(kind):
            if not hasattr(there, name):
                with pytest.raises(AttributeError) as told:
                    getattr(there, name)
                right = (
                    re.sub(r"^scene\b", "confab.load(SCENE)", known(kind)[name])
                    if kind == "confab"
                    else known(kind)[name]
                )
                assert str(told.value).endswith(f"has no '{name}'; use {right}"), name


@pytest.mark.usefixtures("things")  # imports the classes
def test_each_public_name_is_in_exactly_one_group_of_the_overview_of_its_object() -> None:
    of_kind = dict[str, list[str]]()
    for cls, kind in kinds_of_objects().items():
        of_kind.setdefault(kind, []).extend(public_names(cls))
    classes = ("Curve", "Execution", "KnowledgeError", "Memory", "Report", "Result", "Scene", "Table")
    of_kind["confab"] = [*(name for name in confab.__all__ if name not in classes), *classes, "__version__"]
    assert set(OVERVIEW) == set(of_kind)
    homes = {"confab": "confab.", "memory": "confab.Memory."}
    for kind, names in of_kind.items():
        shown = [item.removeprefix(homes.get(kind, ".")) for group in groups(kind).values() for item in group]
        own = [item.partition("(")[0] for item in shown if re.fullmatch(r"\w+(\([^()]*\))?", item)]
        told = [name for name in own if name in names or name not in dir(builtins)]
        assert (len({*told}), {*told}) == (len(told), {*names}), kind


def test_an_uncertain_name_is_answered_by_a_readable_overview_by_purpose(things: dict[str, object]) -> None:
    for there in things.values():
        with pytest.raises(AttributeError) as told:
            getattr(there, "frobnicate")  # noqa: B009
        text = str(told.value)
        assert re.search(r"has no 'frobnicate'\. (The|An?) .* has, [a-z ]+.*: ", text)
        assert len(text) < 640
    with pytest.raises(
        AttributeError, match=r"no 'frob_facts'; perhaps facts\. A scene has, to read: facts, .*to plan: plan\(\);"
    ):
        getattr(things["scene"], "frob_facts")  # noqa: B009


def test_no_table_of_hints_has_a_wrong_name_twice() -> None:
    for kind, table in {**HINTS, "command": COMMANDS}.items():
        names = [name for words in table.values() for name in words.split()]
        assert sorted(set(names)) == sorted(names), kind


def test_all_names_in_hints_exist(things: dict[str, object]) -> None:
    for kind, there in things.items():
        for right in [*HINTS.get(kind, ()), *(item for group in groups(kind).values() for item in group)]:
            path = re.match(r"[\w.]*", right)
            assert path is not None
            first, *rest = path[0].split(".")
            if "==" in right or " " in right or first in dir(builtins) or first in ("", "copy"):
                continue  # a sentence, or a Python expression without an object of Confab
            root = confab if first[0].isupper() else there
            found = (
                things[first]
                if first in things and (first != "plan" or rest or kind == "plan")
                else getattr(root, first)
            )
            for name in rest:
                assert hasattr(found, name), (kind, right)
                found = getattr(found, name)


@pytest.mark.parametrize(
    ("source", "right"),
    [
        ("from confab import Planner", r"use confab.load\(SCENE\).plan\(\)"),
        ("from confab import load, solve", r"use confab.load\(SCENE\).plan\(\)"),
        ("confab.Scene.load('x')", r"use confab.load\(SOURCE\)"),
        ("confab.Scene.from_file('x')", r"use confab.load\(SOURCE\)"),
        ("confab.Result.from_json('x')", r"use scene.read_result\(FILE\)"),
        ("Plan.from_json('x')", r"use scene.read_plan\(FILE\)"),
        ("confab.Memory.open('x')", r"confab.Memory.load\(FILE\)"),
    ],
)
def test_a_wrong_import_or_class_method_names_the_call_that_creates_the_object(source: str, right: str) -> None:
    with pytest.raises((ImportError, AttributeError), match=right):
        exec(source)


def test_steps_are_hashable_and_a_result_equals_its_copy(result: confab.Result) -> None:
    assert len(set(result.plan)) == len(result.plan)
    assert pickle.loads(pickle.dumps(result)) == result


def test_the_error_on_a_misspelt_name_gives_the_most_similar_name(scene: confab.Scene) -> None:
    with pytest.raises(AttributeError, match=r"a scene has no 'qury'; did you mean 'query'\?"):
        getattr(scene, "qury")  # noqa: B009
    with pytest.raises(AttributeError, match=r"did you mean 'load'"):
        getattr(confab, "laod")  # noqa: B009
    assert not hasattr(scene, "_repr_latex_")


GUESSED = {
    "scene": "replan:plan plan_for:plan remove_fact:with_fact initial_facts:facts get_fact:facts "
    "behavior:behaviors schema:behaviors relations:problem.relations to_turtle:graph validate:confab.validate why:explain "
    "report:plan().report monte_carlo:verify "
    "map:picture namespaces:knowledge.prefixes step_through:execute learn:Memory.of(scene).learn",
    "result": "makespan:timed schedule:timed plan_length:plan.length expanded:outcome.search planning_time:seconds "
    "is_optimal:outcome.bound visualise:report policy:plan",
    "plan": "num_steps:length save:result.save cost:result.cost makespan:result.timed subplans:steps",
    "step": "args:arguments operator:behavior objects:arguments label:result.labels",
    "execution": "interventions:episode.interventions timeline:episode.events n_replans:episode.replans",
    "table": "to_csv:csv to_dict:records df:dataframe head:[*table]",
    "confab": "load_domain:confab.load read_ttl:confab.load Problem:confab.load "
    "list_domains:confab.scenes families:confab.generate",
}
"""Guessed names, and the names that Confab suggests for them."""


@pytest.mark.parametrize("kind", GUESSED)
def test_a_wrong_name_is_matched_by_its_words(kind: str) -> None:
    pairs = [pair.split(":") for pair in GUESSED[kind].split()]
    told = {name: first(kind, name) for name, _ in pairs}
    assert [(name, told[name]) for name, right in pairs if right not in told[name]] == []
    assert first(kind, "xyzzy") == ""


def test_a_name_of_another_library_s_object_leads_to_the_conversion_into_this_object() -> None:
    assert first("scene", "isomorphic") == "graph.isomorphic()"
    assert first("scene", "disjoint_classes") == "owl.disjoint_classes()"
    assert first("plan", "number_of_nodes") == "to_networkx().number_of_nodes()"
    pytest.importorskip("pandas")
    assert first("plan", "iterrows") == "to_dataframe().iterrows()"
    assert first("result", "iloc") == "plan.to_dataframe().iloc"


def test_a_wrong_name_that_another_object_s_table_lists_leads_to_that_object() -> None:
    asked = [("confab", "load_result"), ("result", "tail"), ("step", "to_file"), ("plan", "remove_goal")]
    assert [first(*each) for each in asked] == [
        "confab.load(SCENE).read_result(FILE)", "plan[-1]", "result.save(FILE)", "scene.with_goal(FACT)",
    ]  # fmt: skip


def test_an_everyday_word_leads_to_the_right_name() -> None:
    asked = {
        ("scene", "inventory"): "objects",
        ("scene", "believe"): "with_fact(FACT)",
        ("result", "went_well"): "solved",
    }
    assert {each: first(*each) for each in asked} == asked


def test_an_iteration_over_an_object_without_items_names_what_has_items(things: dict[str, object]) -> None:
    for kind, right in {
        "execution": "plan",
        "memory": r"table\(\)",
        "step": "arguments",
        "problem": "individuals",
    }.items():
        with pytest.raises(TypeError, match=f"has no items; use {right}$"):
            iter(things[kind]).__next__()  # type: ignore[call-overload]


def test_the_error_on_a_scene_constructed_from_a_name_gives_the_call_of_load() -> None:
    with pytest.raises(TypeError, match=r"use confab\.load\('beverage-serving'\)"):
        confab.Scene("beverage-serving")  # type: ignore[arg-type]


def test_a_plan_is_a_sequence_of_the_steps_of_its_first_level(result: confab.Result) -> None:
    plan = result.plan
    assert [*plan] == [*plan.steps] == [plan[i] for i in range(len(plan))]
    assert plan[-1:] == plan.steps[-1:]
    assert plan.index(plan[0]) == 0
    assert plan[0] in plan
    assert repr(plan).splitlines()[1] == f"  {plan[0]}"
    assert Plan(())
    assert len(Plan(())) == 0


def test_a_step_is_accepted_as_object_number_name_path_and_words(result: confab.Result) -> None:
    step = result.plan[0]
    told = [
        repr(result.why(asked))
        for asked in (step, 0, f"L{step.level}#0", step.path, str(step), (step.behavior, *step.arguments))
    ]
    assert len(set(told)) == 1


def test_a_plan_is_copied_and_pickled(result: confab.Result) -> None:
    assert copy.deepcopy(result.plan) == pickle.loads(pickle.dumps(result.plan)) == result.plan


def test_an_empty_plan_states_that_all_goals_hold(scene: confab.Scene) -> None:
    now = scene.problem.initial
    done = scene.plan([f"{Fact(symbol, now[symbol])}" for symbol in scene.problem.goal])
    assert done.solved
    assert repr(done).startswith("solved: nothing to do, since all goals hold")


def test_the_command_line_runs_as_a_module_groups_its_commands_and_guesses_a_misspelt_one() -> None:
    def said(*words: str) -> subprocess.CompletedProcess[str]:
        line = [sys.executable, "-m", "confab", *words]
        return subprocess.run(line, capture_output=True, text=True, check=False)

    text = said("--help").stdout
    assert [text.index(title) for title in ("Plan and act:", "Learn:", "Ask:", "Author:", "Exchange:")]
    wrong = said("plna")
    assert wrong.returncode == 2
    assert wrong.stderr.strip() == "confab: no such command 'plna'; did you mean 'plan'?; see confab --help"


def test_a_wrong_argument_is_understood_by_its_words_also_among_further_options(
    scene: confab.Scene, result: confab.Result
) -> None:
    calls: dict[str, tuple[Callable[..., object], str]] = {
        "trials": (scene.verify, "rollouts"),
        "simulator": (scene.execute, "world"),
        "path": (confab.load, "source"),
    }
    for wrong_name, (call, right) in calls.items():
        with pytest.raises(TypeError, match=f"did you mean '{right}'"):
            call(**{wrong_name: 1})
    with pytest.raises(TypeError, match=r"it takes .*noise"):
        result.verify(xyzzy=1)  # type: ignore[call-arg]


def test_the_error_on_a_wrong_access_to_a_scene_gives_the_right_access(scene: confab.Scene) -> None:
    with pytest.raises(TypeError, match="use objects"):
        scene["cup1"]
    with pytest.raises(AttributeError, match=r"use \['cup1'\]"):
        getattr(scene.objects, "cup1")  # noqa: B009
    with pytest.raises(confab.KnowledgeError, match="is no memory"):
        scene.plan(memory=True)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("line", "right"),
    [
        (["ls"], "scenes"),
        (["init"], "new"),
        (["plan", "x", "--format", "json"], "--json"),
        (["simulate"], "verify"),
        (["verify", "x", "--n-episodes", "3"], "--rollouts"),
    ],
)
def test_the_command_line_understands_commands_and_options_by_their_words(
    refused: Refused, line: list[str], right: str
) -> None:
    assert f"did you mean '{right}'" in refused(line).lower()


def test_an_error_names_a_parameter_in_python_and_an_option_on_the_command_line(
    scene: confab.Scene, refused: Refused
) -> None:
    with pytest.raises(confab.KnowledgeError, match=r"leave out optimal=True"):
        scene.plan(engine="fast-downward", optimal=True)
    assert "leave out --optimal" in refused(["plan", "beverage-serving", "--engine", "fast-downward", "--optimal"])


def test_the_error_on_a_goal_in_three_arguments_says_that_a_goal_is_one_text(scene: confab.Scene) -> None:
    with pytest.raises(confab.KnowledgeError, match=r"the goal 'cup2' is no fact; wanted one text"):
        scene.plan("cup2", "LOCATION", "location8")  # type: ignore[arg-type]


def test_a_value_property_in_a_fact_names_its_situation_type(scene: confab.Scene, result: confab.Result) -> None:
    for call in (scene.plan, scene.with_fact, result.why_not):
        with pytest.raises(confab.KnowledgeError, match="it is the value property of BEVERAGE"):
            call("cup1 beverage beverage1")


def test_an_incomplete_fact_gets_an_example_of_its_own_scene(scene: confab.Scene) -> None:
    with pytest.raises(
        confab.KnowledgeError, match=r"is no fact; wanted 'object SITUATION value', e\.g\. '.+'"
    ) as told:
        scene.with_fact("cup1")
    assert str(told.value).rpartition("e.g. ")[2].strip("'") in scene.goals


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (
            "cup2 LOCATION location8 false",
            "c:about :cup2 ; c:situationType :LOCATION ; c:value :location8 ; c:negated true",
        ),
        ("Cup LOCATION location8", "Cup is a class, and each fact is about one individual (cup1, cup2"),
    ],
)
def test_a_goal_that_excludes_a_value_or_is_about_a_class_is_refused_with_its_form_in_the_scene(
    goal: str, said: str
) -> None:
    with pytest.raises(confab.KnowledgeError) as raised:
        confab.load("beverage-serving").plan(goal)
    assert said in str(raised.value)
    assert ":task c:goal [" in str(raised.value)


def test_explain_and_why_give_the_same_answer_and_the_error_on_an_unknown_step_lists_the_steps(
    result: confab.Result,
) -> None:
    step = result.plan[0]
    assert result.explain(step) == result.why(step)
    with pytest.raises(confab.KnowledgeError, match=re.escape(result.labels.step(step))):
        result.why("xyzzy")


def test_a_row_has_its_cells_as_attributes_or_names_its_columns(scene: confab.Scene) -> None:
    row = scene.query("SELECT ?object ?place { ?object k:location ?place }")[0]
    assert row.object == row["object"]
    with pytest.raises(AttributeError, match=r"columns: object, place"):
        getattr(row, "subject")  # noqa: B009
    assert copy.deepcopy(row) == pickle.loads(pickle.dumps(row)) == row


def test_a_part_of_a_scene_s_name_names_the_scenes_that_contain_it() -> None:
    with pytest.raises(confab.KnowledgeError, match=r"\(beverage-serving-moved, beverage-serving\)"):
        confab.load("beverage")
    with pytest.raises(confab.KnowledgeError, match=r"no scene 'nosuch\.ttl': there is no such file$"):
        confab.load("nosuch.ttl")


def test_a_query_in_words_and_a_call_without_a_query_name_the_shipped_queries(
    scene: confab.Scene, refused: Refused
) -> None:
    with pytest.raises(confab.KnowledgeError, match="did you mean 'what-is-wanted'"):
        scene.query("what is wanted")
    assert "what-is-wanted" in refused(["query", "beverage-serving-moved"])


@pytest.mark.parametrize("fact", ["cup2 location8", "cup2 at location8", "cup2 is in location8"])
def test_an_object_and_a_value_name_the_fact_if_one_situation_type_has_both(scene: confab.Scene, fact: str) -> None:
    with pytest.raises(confab.KnowledgeError, match="did you mean 'cup2 LOCATION location8'"):
        scene.with_fact(fact)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["verify", "x", "--plan", "p.json"], "give PLAN.json without the name of an option"),
        (["execute", "x", "--video", "v.mp4"], "it is an option of verify"),
        (["plan", "x", "--show"], "did you mean '--report'?"),
        (["plan", "x", "--verify"], "confab verify is a command"),
        (["learn", "x", "--episodes", "e.json"], "did you mean '--episode'?"),
        (["learn", "--scene", "x"], "give SCENE without the name of an option"),
        (["plan", "x", "--xyzzy"], "no such option '--xyzzy'; see confab plan --help"),
        (["film"], "did you mean 'verify --video OUT.mp4'?"),
    ],
)
def test_an_unknown_option_names_another_one_an_argument_or_a_command(
    refused: Refused, line: list[str], said: str
) -> None:
    assert said in refused(line)


def test_values_are_represented_in_one_short_line(things: dict[str, object]) -> None:
    texts = {kind: repr(there) for kind, there in things.items() if kind not in ("plan", "table")}
    assert {kind: text for kind, text in texts.items() if "\n" in text or len(text) > 320} == {}
    assert texts["behaviour"].startswith("Behavior(name='B1_MOVE', level=1, parameters: 2")
    assert texts["domain"].startswith("Domain(situations: 5, behaviors: 12")


def test_a_plan_is_json_that_a_scene_reads(scene: confab.Scene, result: confab.Result, tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    file.write_text(json.dumps(result.plan.json()))
    assert scene.read_plan(file) == result.plan


def test_the_words_of_a_name_are_found_behind_capital_letters_and_beside_unknown_words() -> None:
    names = {
        ("confab", "HTNPlanner"): "plan()",
        ("scene", "getGoals"): "goals",
        ("scene", "object_count"): "objects",
        ("scene", "instances_of_class"): "objects",
        ("scene", "run_physics"): "verify",
    }
    assert {key: first(*key) for key, right in names.items() if right not in first(*key)} == {}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["plan", "x", "--jsno"], "did you mean '--json'?"),
        (["hlep"], "did you mean 'help'?"),
        (["plan", "x", "--goal"], "see confab plan --help"),
        (["plan", "x", "--time-limit", "soon"], "'soon' is no number"),
        (["run", "x", "--noise", "7"], "wanted a number from 0.0 to 0.05"),
        (["run", "x", "-o", "/dev/null/runs"], "'/dev/null' is a file; wanted a folder"),
        (["plan", "two-cups", "--goal", "cup1 LOCATION nowhere"], "values: location1, "),
        (["plan", "two-cups", "--goal", "spoon LOCATION location1"], "LOCATION is of bottle1, cup1, cup2"),
    ],
)
def test_misuse_of_the_command_line_is_reported_in_plain_words(refused: Refused, line: list[str], said: str) -> None:
    assert said in refused(line)


def test_help_with_a_command_is_the_help_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["help", "plan"])
    assert capsys.readouterr().out.startswith("Usage: confab plan")


def test_the_error_on_a_variable_of_a_query_as_parameter_tells_how_to_state_its_value(scene: confab.Scene) -> None:
    with pytest.raises(TypeError, match="takes no 'object'; state the values of a variable in the query: VALUES"):
        scene.query("SELECT ?place { ?object k:location ?place }", object="cup1")  # type: ignore[call-arg]
    where = "SELECT ?place { VALUES ?object { :cup1 } ?object k:location ?place }"
    assert len(scene.query(where)) == 1


@pytest.mark.parametrize("port", ["x", -1, 1.5, 99_999, True])
def test_a_wrong_port_is_refused_with_the_possible_ports(port: object) -> None:
    with pytest.raises(KnowledgeError, match=r"is no port; wanted a whole number from 1 to 65535, or 0"):
        confab.load("beverage-serving").serve(port).__enter__()  # type: ignore[arg-type]


@pytest.mark.parametrize("level", ["x", 1.0, None])
def test_a_level_that_is_no_number_is_refused(level: object) -> None:
    plan = confab.load("beverage-serving").plan().plan
    with pytest.raises(TypeError, match=r"at_level\(\) got level=.*; wanted a whole number"):
        plan.at_level(level)  # type: ignore[arg-type]


def test_a_goal_with_alternatives_is_no_fact_for_with_goal(tmp_path: Path) -> None:
    text = (ontology.ROOT / "scenes" / "wishes-small.ttl").read_text("utf-8")
    old = 'c:Comparison ; c:weight 8.0 ; c:about :store ; c:situationType d:STOCK ; c:sign "=" ; c:amount 0.0'
    same = old.replace("c:weight 8.0 ; ", "")
    new = f"c:AnyOf ; c:alternative :one, :two . :one a {same} . :two a {same} . :order.rest a owl:NamedIndividual"
    (tmp_path / "scene.ttl").write_text(text.replace(old, new), "utf-8")
    scene = confab.load(tmp_path / "scene.ttl")
    with pytest.raises(KnowledgeError, match=r"only facts can be given as goals; with_goal keeps this goal"):
        scene.with_goal("order order.goal3 true")
    assert "order order.goal3 true" in scene.with_goal("glass IN store").goals


def test_a_question_about_a_behavior_without_a_plan_names_the_command_that_tells_why_there_is_none(
    tmp_path: Path,
) -> None:
    text = (ontology.ROOT / "scenes" / "wishes-small.ttl").read_text("utf-8")
    (tmp_path / "scene.ttl").write_text(text.replace("d:weight 7.0", "d:weight 700.0"), "utf-8")
    with pytest.raises(KnowledgeError, match=r"L1_PICK_UP.*there is no plan; ask why there is none \(confab explain"):
        confab.load(tmp_path / "scene.ttl").plan().why_not("L1_PICK_UP")
