"""The first calls of a new user work, or their error names the correct call; the list was written before the functions."""

from __future__ import annotations

import copy
import io
import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest
import rdflib

import confab
from confab import ontology
from confab.authoring import new_domain
from confab.history import compared
from confab.reasoner.graph.knowledge import KnowledgeError

SCENE = "beverage-serving-moved"
GOAL = "cup2 LOCATION location8"


@pytest.fixture(scope="module")
def scene() -> confab.Scene:
    return confab.load(SCENE)


@pytest.fixture(scope="module")
def result(scene: confab.Scene) -> confab.Result:
    return scene.plan()


@pytest.fixture
def domain(tmp_path: Path) -> tuple[Path, Path]:
    """Two files of a user that no catalog names: a domain, and a scene that imports it."""
    confab.new_domain("errands", tmp_path)
    files = sorted(tmp_path.glob("*.ttl"))
    scene = next(file for file in files if "scene" in file.stem)
    return next(file for file in files if file != scene), scene


CALLS: dict[str, Callable[[confab.Scene, confab.Result], object]] = {
    "a path": lambda scene, result: confab.load(ontology.scenes()[SCENE]).plan().plan == result.plan,
    "the text of a path": lambda scene, result: confab.load(str(ontology.scenes()[SCENE])).goals == scene.goals,
    "an address of a file": lambda scene, result: confab.load(ontology.scenes()[SCENE].as_uri()).goals == scene.goals,
    "a list of files": lambda scene, result: confab.load([ontology.scenes()[SCENE]]).goals == scene.goals,
    "a graph of rdflib": lambda scene, result: (
        confab.load(rdflib.Graph().parse(ontology.scenes()[SCENE])).goals == scene.goals
    ),
    "steps in a loop": lambda scene, result: [step.behavior for step in result.plan],
    "the number of steps": lambda scene, result: len(result.plan) == result.plan.length[1],
    "the first step, the last, some": lambda scene, result: (result.plan[0], result.plan[-1], result.plan[1:3]),
    "one goal": lambda scene, result: scene.plan(goal=GOAL).solved,
    "goals": lambda scene, result: scene.plan(goals=[GOAL]).solved,
    "a goal in place": lambda scene, result: scene.plan(GOAL).solved,
    "the cost": lambda scene, result: result.cost == len(result.plan.primitives),
    "whether it is solved": lambda scene, result: result.solved,
    "why a step": lambda scene, result: result.why(result.plan[0]),
    "why not something else": lambda scene, result: result.why_not(GOAL),
    "the text of a result": lambda scene, result: "solved" in str(result),
    "HTML of a plan": lambda scene, result: result.plan[0].behavior in result.plan._repr_html_(),
    "networkx": lambda scene, result: result.plan.to_networkx().number_of_nodes() == sum(result.plan.length.values()),
    "Graphviz": lambda scene, result: result.plan.to_dot().startswith("digraph"),
    "rows": lambda scene, result: [row["behavior"] for row in result.plan.to_records()],
    "a DataFrame": lambda scene, result: pytest.importorskip("pandas") and len(result.plan.to_dataframe()),
    "PDDL": lambda scene, result: scene.to_pddl()[0].lstrip("; ").count("(define"),
    "unified-planning": lambda scene, result: (
        pytest.importorskip("unified_planning") and len(scene.to_unified_planning().actions)
    ),
    "behaviours": lambda scene, result: scene.behaviors["B1_MOVE"].parameters,
    "objects, facts, goals": lambda scene, result: scene.objects and scene.facts and scene.goals,
    "a fact more": lambda scene, result: scene.with_fact("cup1 LOCATION location7").plan().solved,
    "a copy": lambda scene, result: copy.deepcopy(scene).plan().plan == result.plan,
    "a pickled scene": lambda scene, result: pickle.loads(pickle.dumps(scene)).plan().plan == result.plan,
    "a pickled result": lambda scene, result: pickle.loads(pickle.dumps(result)).why(0) == result.why(0),
    "a query": lambda scene, result: len(scene.query("SELECT ?o { ?o k:location ?l }")) > 1,
}


LATER: dict[str, Callable[[confab.Scene, confab.Result], object]] = {
    "goals as a mapping": lambda scene, result: scene.plan({"cup2 LOCATION": "location8"}).solved,
    "a goal by its words": lambda scene, result: scene.plan(goal=("cup2", "LOCATION", "location8")).solved,
    "a fact by its words": lambda scene, result: scene.with_fact("cup1", "LOCATION", "location7").facts[
        "cup1 LOCATION"
    ],
    "a fact with a sign": lambda scene, result: scene.with_fact("cup1 LOCATION = location7").facts["cup1 LOCATION"],
    "steps of a result": lambda scene, result: (
        [*result] == [*result.plan] and result[0] == result.plan[0] and len(result)
    ),
    "whether there is a result": lambda scene, result: result and not scene.plan([GOAL, "cup1 LOCATION location8"]),
    "a scene that is loaded": lambda scene, result: confab.load(scene) is scene,
    "a query in a file": lambda scene, result: scene.query(ontology.ROOT / "questions" / "where-is-everything.rq"),
    "a cell by its name": lambda scene, result: scene.query("SELECT ?o { ?o k:location ?l }")[0]["o"],
    "a column by its name": lambda scene, result: scene.query("SELECT ?o { ?o k:location ?l }")["?o"],
    "a DataFrame of a table": lambda scene, result: (
        [*pytest.importorskip("pandas").DataFrame(scene.query("SELECT ?o { ?o k:location ?l }"))] == ["o"]
    ),
    "a scene for trials without a file": lambda scene, result: confab.generate("served").plan().solved,
    "facts as a dictionary": lambda scene, result: dict(scene.facts)["cup1 LOCATION"] == scene.facts["cup1 LOCATION"],
    "the position of a step": lambda scene, result: result.plan.index(result[0]) == result.plan.index("0") == 0,
}
SAID: dict[str, tuple[Callable[[confab.Scene, confab.Result], object], str]] = {
    "two goals in place": (lambda scene, result: scene.plan(GOAL, "cup1 LOCATION location7"), "goals=["),
    "a timeout": (lambda scene, result: scene.plan(timeout=3), "did you mean 'time_limit'"),  # type: ignore[call-arg]
    "a seed": (lambda scene, result: scene.plan(seed=3), "the same call gives the same result"),  # type: ignore[call-arg]
    "a negated goal": (lambda scene, result: scene.plan(f"not {GOAL}"), "there is no negation"),
    "two goals in one text": (lambda scene, result: scene.plan(f"{GOAL} and cup1 LOCATION location7"), "by itself"),
    "an update": (lambda scene, result: scene.query("PREFIX : <urn:x>\nINSERT DATA { :a :b :c }"), "is only read"),
    "a film of another format": (lambda scene, result: result.verify(video="film.txt"), "ends in .mp4 or .gif"),
    "negative noise": (lambda scene, result: result.verify(noise=-1), "wanted metres from 0 to 0.05"),
    "noise in an execution": (
        lambda scene, result: scene.execute(world="pybullet", noise=1e308),
        "wanted metres from 0 to 0.05",
    ),
    "half a rollout": (lambda scene, result: result.verify(rollouts=1.5), "wanted 1 or more"),  # type: ignore[arg-type]
    "bindings of a query": (
        lambda scene, result: scene.query("SELECT ?o { ?o k:location ?l }", initBindings={}),  # type: ignore[call-arg]
        "VALUES ?x",
    ),
    "a memory of nothing": (lambda scene, result: confab.Memory(), "use confab.Memory.of"),  # type: ignore[call-arg]
    "a class among objects": (lambda scene, result: scene.objects["Cup"], "problem.classes"),
    "a scene to validate": (lambda scene, result: confab.validate(scene), "names of shipped scenes"),  # type: ignore[arg-type]
    "a shipped scene as a file": (lambda scene, result: confab.load("two-cups.ttl"), "the shipped scene 'two-cups'"),
    "a step that isn't there": (
        lambda scene, result: result.plan.index("0.1"),
        "is no step of the first level",
    ),
    "an alternative in three arguments": (
        lambda scene, result: result.why_not("B1_MOVE", "cup2", "location7"),  # type: ignore[arg-type]
        "the alternative is one text",
    ),
    "a level of a plan": (lambda scene, result: scene.plan(level=2), "plan.at_level(LEVEL)"),
    "three plans": (lambda scene, result: scene.plan(k=3), "why_not"),  # type: ignore[call-arg]
    "PDDL in a folder": (lambda scene, result: scene.to_pddl("out"), "scene.export(FOLDER)"),  # type: ignore[arg-type]
    "a wrong column": (lambda scene, result: scene.query("SELECT ?o { ?o k:location ?l }")["ob"], "columns: o"),
}


PACKAGE, COMPARED = cast("Any", confab), cast("Any", compared)
WRONG_CALLS: dict[str, Callable[[Any], object]] = {
    "query() lacks sparql; wanted query(sparql, limits=): Return the result": lambda scene: scene.query(),
    "generate() lacks family; wanted generate(family, path=": lambda scene: PACKAGE.generate(),
    "generate() takes no 'n'; did you mean 'objects'?": lambda scene: PACKAGE.generate(n=5),
    "generate() got objects='x'; wanted a whole number": lambda scene: PACKAGE.generate("served", objects="x"),
    "practise() lacks memory; wanted practise(scenes, memory": lambda scene: PACKAGE.practise(scene),
    "of() got scene='two-cups'; wanted a scene: confab.load(SCENE), e.g. confab.load('two-cups')": (
        lambda scene: PACKAGE.Memory.of("two-cups")
    ),
    "compared() lacks other; wanted compared(those, one, other)": lambda scene: COMPARED("001", "002"),
    "got no file; wanted validate(FILE": lambda scene: confab.validate(),
    "got the key 28; wanted 'cup2 LOCATION' as a key": lambda scene: scene.execute(interventions={28: "x"}),
    "plan.pdf: this is written as JSON; wanted a name that ends in .json": lambda scene: scene.plan().save("plan.pdf"),
    "run.txt: this is written as Turtle or JSON": lambda scene: scene.execute().save("run.txt"),
}
"""Calls with missing or wrong arguments, by the beginning of the answer."""


@pytest.mark.parametrize("said", WRONG_CALLS)
def test_a_call_with_missing_or_wrong_arguments_says_what_it_got_and_what_it_wants(said: str) -> None:
    with pytest.raises((TypeError, KnowledgeError)) as error:
        WRONG_CALLS[said](confab.load("two-cups"))
    assert str(error.value).startswith(said)


@pytest.mark.parametrize("call", LATER.values(), ids=LATER)
def test_a_further_first_call_works(
    scene: confab.Scene, result: confab.Result, call: Callable[[confab.Scene, confab.Result], object]
) -> None:
    assert call(scene, result)


@pytest.mark.parametrize(("call", "hint"), SAID.values(), ids=SAID)
def test_a_failing_first_call_names_the_correct_call(
    scene: confab.Scene, result: confab.Result, call: Callable[[confab.Scene, confab.Result], object], hint: str
) -> None:
    with pytest.raises((KnowledgeError, TypeError, KeyError, ValueError)) as told:
        call(scene, result)
    assert hint in str(told.value)


def test_the_list_of_first_calls_has_thirty_calls() -> None:
    assert len(CALLS) == 30


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_first_call_works(
    scene: confab.Scene, result: confab.Result, call: Callable[[confab.Scene, confab.Result], object]
) -> None:
    assert call(scene, result)


def test_a_plan_that_was_saved_is_read(scene: confab.Scene, result: confab.Result, tmp_path: Path) -> None:
    assert scene.read_plan(result.save(tmp_path / "plan.json")) == result.plan


def test_several_files_are_read_together_in_any_order(domain: tuple[Path, Path], tmp_path: Path) -> None:
    apart = [tmp_path / "a" / domain[0].name, tmp_path / "b" / domain[1].name]
    for file, to in zip(domain, apart, strict=True):
        to.parent.mkdir()
        file.rename(to)
    goals = confab.load(apart).goals
    assert goals == confab.load(apart[::-1]).goals
    assert confab.load(apart).plan().solved


def test_an_invalid_source_of_a_scene_is_refused(scene: confab.Scene) -> None:
    with pytest.raises(KnowledgeError, match="got int; wanted the name of a shipped scene, a file or several"):
        confab.load(3)  # type: ignore[arg-type]
    with pytest.raises(KnowledgeError, match="no file is given"):
        confab.load([])


def test_a_pickled_scene_has_the_same_plan_in_another_process(result: confab.Result, tmp_path: Path) -> None:
    (tmp_path / "scene.pickle").write_bytes(pickle.dumps(result.scene))
    code = "import pickle, sys, json; print(json.dumps([str(s) for s in pickle.load(open(sys.argv[1], 'rb')).plan().plan.walk()]))"
    said = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "scene.pickle")], capture_output=True, text=True, check=True
    )
    assert json.loads(said.stdout) == [str(step) for step in result.plan.walk()]


def test_a_copy_of_a_scene_contains_its_changed_facts(scene: confab.Scene) -> None:
    edited = scene.with_fact("cup1 LOCATION location7")
    assert "cup1 LOCATION location7" in copy.deepcopy(edited).facts
    assert copy.deepcopy(edited) is not edited


WRONG: dict[str, dict[str, str]] = {
    "module": {
        "read": "load", "open": "load", "parse": "load", "load_scene": "load", "Graph": "load", "from_file": "load",
        "solve": "plan", "plan": "plan", "Planner": "plan", "OneshotPlanner": "plan", "simulate": "verify",
        "list_scenes": "scenes", "check": "validate", "list_examples": "scenes",
    },
    "scene": {
        "ask": "query", "sparql": "query", "add_fact": "with_fact", "add": "with_fact", "set_fact": "with_fact",
        "add_goal": "with_goal", "set_goal": "with_goal", "goal": "goals", "individuals": "objects", "state": "facts",
        "initial_state": "facts", "actions": "behaviors", "behaviours": "behaviors", "operators": "behaviors",
        "predicates": "situations", "types": "classes", "solve": "plan", "search": "plan", "simulate": "verify",
        "run": "execute", "serialize": "graph", "triples": "graph", "rdf": "graph", "draw": "picture", "show": "picture",
        "write_pddl": "export", "applicable_actions": "affordances", "robot": "embodiment",
    },
    "result": {
        "steps": "plan.steps", "actions": "plan.steps", "status": "outcome.status", "success": "solved",
        "to_dict": "json", "to_json": "json", "graph": "to_networkx", "runtime": "seconds", "statistics": "outcome.search",
        "to_dataframe": "plan.to_dataframe",
    },
    "plan": {"actions": "steps", "to_json": "to_records", "graph": "to_networkx", "leaves": "primitives"},
    "step": {"name": "behavior", "action": "behavior", "parameters": "arguments", "children": "steps"},
}  # fmt: skip
"""Sixty names that users of rdflib, owlready2, unified-planning, pyperplan and pandas would guess, each with Confab's name."""


def test_the_messages_on_sixty_wrong_names_name_the_right_one_except_for_at_most_five(
    scene: confab.Scene, result: confab.Result
) -> None:
    of = {"module": confab, "scene": scene, "result": result, "plan": result.plan, "step": result.plan[0]}
    assert sum(map(len, WRONG.values())) == 60
    missed = []
    for kind, names in WRONG.items():
        for name, right in names.items():
            with pytest.raises(AttributeError) as told:
                getattr(of[kind], name)
            if right not in str(told.value).partition("'; ")[2]:
                missed.append((kind, name, str(told.value)))
    assert len(missed) <= 5, missed


def test_a_step_is_selected_by_its_number_its_path_and_its_words(result: confab.Result) -> None:
    plan = result.plan
    first = plan[0]
    assert plan["L1#0"] == plan[(0,)] == plan[str(first)] == result["pour bottle 2"] == first
    assert plan["L2#1"] == plan[0, 1] == first.steps[1]
    with pytest.raises(LookupError, match=r"'B2_' names 3 steps: L2#0 .*; give one, e.g. L2#0"):
        plan["B2_"]
    with pytest.raises(LookupError, match="no step 'our bottle 2' in the plan"):
        plan["our bottle 2"]  # words begin where the words of the step begin
    with pytest.raises(IndexError, match="the first level has 1, counted from 0"):
        plan[99]


@pytest.mark.parametrize("seconds", [0, -1])
def test_a_time_limit_that_is_not_positive_is_refused(
    scene: confab.Scene, result: confab.Result, seconds: float
) -> None:
    for call in (scene.plan, scene.execute, scene.explain, result.verify, result.execute):
        with pytest.raises(KnowledgeError, match=f"time_limit={seconds}; wanted more than 0 seconds"):
            call(time_limit=seconds)


def test_writing_a_file_creates_no_missing_parent_folder(
    scene: confab.Scene, result: confab.Result, tmp_path: Path
) -> None:
    missing = tmp_path / "typo" / "plan"
    for write, name in (
        (result.save, "p.json"), (result.report, "p.html"), (scene.picture, "p.png"), (scene.execute(result).save, "e.ttl"),
        (confab.Memory.of(scene).save, "m.ttl"),
    ):  # fmt: skip
        with pytest.raises(OSError, match=r"there is no folder '.*typo'; create it, or give another name"):
            write(missing / name)
    assert not missing.parent.exists()
    with pytest.raises(KnowledgeError, match=r"this is written as HTML; wanted a name that ends in \.html"):
        result.report(tmp_path / "p.pdf")


def test_a_call_without_an_effect_is_refused_with_the_effective_call(
    scene: confab.Scene, result: confab.Result
) -> None:
    refused: dict[str, Callable[[], object]] = {
        "scene.with_fact": lambda: scene.facts.append("cup1 LOCATION location7"),
        "is a copy": lambda: scene.objects.update(cup9="Cup"),
        "use with_goal": lambda: setattr(scene, "goals", [GOAL]),
        "that can be set; use with_goal": lambda: setattr(scene, "goal", GOAL),
        "that can be set; use with_fact": lambda: setattr(scene, "state", GOAL),
        r"\*facts": lambda: scene.with_fact(cup1="location7"),  # type: ignore[call-arg]
        "takes source without a name; got 2 values": lambda: confab.load(SCENE, SCENE),  # type: ignore[call-arg]
        "use confab.Memory.of": lambda: confab.Memory(scene),  # type: ignore[call-arg, arg-type]
    }
    for said, call in refused.items():
        with pytest.raises((TypeError, AttributeError), match=said):
            call()


def test_facts_are_accepted_in_every_usual_form(scene: confab.Scene) -> None:
    words = ("cup1", "LOCATION", "location7")
    for given in (words, [words], {("cup1", "LOCATION"): "location7"}, {"cup1 LOCATION": "location7"}):
        assert scene.with_goal(given).goals["cup1", "LOCATION"] == "location7"
    assert scene.with_goal(None).goals() == scene.goals
    with pytest.raises(KeyError, match="cup1 BEVERAGE, cup1 LOCATION"):
        scene.facts["cup1"]
    row = scene.query("where-is-everything")[0]
    assert row.object == row["object"]


def test_a_plan_of_a_scene_with_bodies_needs_no_reach_facts_on_disk(tmp_path: Path) -> None:
    """Python computes missing reach facts as the command line does; without them the task would seem unsolvable."""
    new_domain("plants", tmp_path, bodies=True)
    assert not list(tmp_path.rglob("*.reach.ttl"))
    assert confab.load(tmp_path / "plants-scene.ttl").plan().outcome.status.value == "solved"
    assert list(tmp_path.rglob("*.reach.ttl"))


def test_a_scene_is_loaded_from_an_open_file_and_from_text(scene: confab.Scene) -> None:
    file = ontology.scenes()[SCENE]
    with file.open() as opened, file.open("rb") as raw:
        sources = (opened, raw, io.StringIO(file.read_text()), file.read_text())
        assert all(confab.load(source).goals == scene.goals for source in sources)
