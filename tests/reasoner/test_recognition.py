"""The part that is read for a task has the same answer as the whole world, and doesn't grow with irrelevant objects."""

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from confab.ontology import ROOT
from confab.planner.paper.astar import mismatches
from confab.planner.paper.hierarchy import plan
from confab.planner.paper.transitions import Model, ground
from confab.planner.plan import Limits, Status
from confab.reasoner.generate import families, generate, write_scene
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, load
from confab.reasoner.language import DomainError
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import with_goals
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.relevance import recognise
from tests.ontology.faults import skeleton
from tests.reasoner.worlds import HEAD, graph_of, worlds


def solvable(problem: Problem, most: int) -> bool | None:
    """Return whether an exhaustive search of level 1 finds the goal, or None if the search is too large."""
    model = Model(problem)
    grounds = ground(problem, 1)
    start = model.values(problem.initial)
    goal = {i: problem.goal[symbol] for i, symbol in enumerate(model.symbols) if symbol in problem.goal}
    seen, waiting = {start}, [start]
    while waiting:
        state = waiting.pop()
        if not mismatches(state, goal):
            return True
        if len(seen) > most:
            return None
        for applied in model.successors(grounds, state):
            if applied.after not in seen:
                seen.add(applied.after)
                waiting.append(applied.after)
    return False


@settings(max_examples=60)
@given(text=worlds())
def test_the_slice_has_a_plan_exactly_if_the_world_has_one(text: str) -> None:
    with TemporaryDirectory() as folder:
        graph = graph_of(text, Path(folder))
        whole, sliced = read(graph).problem, recognise(graph).problem
    try:
        expected = solvable(whole, 300)
        found = solvable(sliced, 300 if expected is None else 10_000)
    except DomainError:
        assume(False)
    assume(expected is not None)
    left_out = len(whole.initial) - len(sliced.initial)
    event(f"{'solvable' if expected else 'unsolvable'}, {'some' if left_out else 'nothing'} left out")
    assert found is expected
    kept = {name for members in sliced.classes.values() for name in members}
    assert sliced.classes == {kind: tuple(m for m in members if m in kept) for kind, members in whole.classes.items()}


def test_an_individual_that_has_to_move_to_a_needed_place_is_in_the_slice(tmp_path: Path) -> None:
    """To color x, an individual must be at the place of x; y can come from s1, which is near s0, but s0 isn't near s1."""
    text = (
        HEAD
        + """
    w:s0 a owl:NamedIndividual, w:Spot .
    w:s1 a owl:NamedIndividual, w:Spot ; w:near w:s0 .
    w:x a owl:NamedIndividual, w:Thing ; w:at w:s0 .
    w:y a owl:NamedIndividual, w:Tool ; w:at w:s1 .
    w:far a owl:NamedIndividual, w:Tool ; w:at w:nowhere .
    w:PAINT a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:PAINT.x ; :precondition w:PAINT.at, w:PAINT.with ;
      :postcondition w:PAINT.blue .
    w:PAINT.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
    w:PAINT.z a owl:NamedIndividual, :Variable ; :termType w:Spot .
    w:PAINT.w a owl:NamedIndividual, :Variable ; :termType w:Tool .
    w:PAINT.at a owl:NamedIndividual, :ValueCondition ; :about w:PAINT.x ; :situationType w:AT ; :value w:PAINT.z .
    w:PAINT.with a owl:NamedIndividual, :Witness ; :witness w:PAINT.w ; :condition w:PAINT.there .
    w:PAINT.there a owl:NamedIndividual, :ValueCondition ; :about w:PAINT.w ; :situationType w:AT ; :value w:PAINT.z .
    w:PAINT.blue a owl:NamedIndividual, :ValueEffect ; :about w:PAINT.x ; :situationType w:COLOR ; :value w:blue .
    w:GO a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:GO.y, w:GO.to ; :precondition w:GO.at, w:GO.near ;
      :postcondition w:GO.there .
    w:GO.y a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Tool .
    w:GO.to a owl:NamedIndividual, :Parameter ; :index 2 ; :termType w:Spot .
    w:GO.from a owl:NamedIndividual, :Variable ; :termType w:Spot .
    w:GO.at a owl:NamedIndividual, :ValueCondition ; :about w:GO.y ; :situationType w:AT ; :value w:GO.from .
    w:GO.near a owl:NamedIndividual, :RelationCondition ; :about w:GO.from ; :relation w:near ; :value w:GO.to .
    w:GO.there a owl:NamedIndividual, :ValueEffect ; :about w:GO.y ; :situationType w:AT ; :value w:GO.to .
    w:task a owl:NamedIndividual, :Task ; :goal w:task.g .
    w:task.g a owl:NamedIndividual, :ValueCondition ; :about w:x ; :situationType w:COLOR ; :value w:blue .
    """
    )
    sliced = recognise(graph_of(text, tmp_path)).problem
    assert sliced.classes["Thing"] == ("x", "y")
    assert solvable(sliced, 100)


def test_individuals_of_a_defined_class_are_in_the_slice_even_if_it_is_empty_initially(tmp_path: Path) -> None:
    """A behaviour that takes blue things needs the definition of blue; initially, no individual of the world is blue."""
    text = (
        HEAD
        + """
    w:Blue a owl:Class, owl:NamedIndividual ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( w:Thing
      [ a owl:Restriction ; owl:onProperty w:color ; owl:hasValue w:blue ] ) ] .
    w:s0 a owl:NamedIndividual, w:Spot .
    w:x a owl:NamedIndividual, w:Thing ; w:at w:nowhere .
    w:other a owl:NamedIndividual, w:Thing ; w:at w:s0 .
    w:DYE a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:DYE.x ; :postcondition w:DYE.blue .
    w:DYE.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
    w:DYE.blue a owl:NamedIndividual, :ValueEffect ; :about w:DYE.x ; :situationType w:COLOR ; :value w:blue .
    w:PUT a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:PUT.x, w:PUT.z ; :postcondition w:PUT.there .
    w:PUT.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Blue .
    w:PUT.z a owl:NamedIndividual, :Parameter ; :index 2 ; :termType w:Spot .
    w:PUT.there a owl:NamedIndividual, :ValueEffect ; :about w:PUT.x ; :situationType w:AT ; :value w:PUT.z .
    w:task a owl:NamedIndividual, :Task ; :goal w:task.g .
    w:task.g a owl:NamedIndividual, :ValueCondition ; :about w:x ; :situationType w:AT ; :value w:s0 .
    """
    )
    sliced = recognise(graph_of(text, tmp_path)).problem
    assert sliced.classes["Thing"] == ("x",)
    assert solvable(sliced, 100)


@pytest.mark.parametrize("family", families())
def test_irrelevant_objects_are_left_out_of_the_slice_and_all_others_are_kept(tmp_path: Path, family: str) -> None:
    write_scene(tmp_path / "scene.ttl", family, objects=8, hands=3, clutter=30, seed=3)
    write_scene(tmp_path / "bare.ttl", family, objects=8, hands=3, seed=3)
    sliced, bare = recognise(load(tmp_path / "scene.ttl")), read(load(tmp_path / "bare.ttl"))
    assert sliced.problem.domain == bare.problem.domain
    reached = {place for _, place in bare.problem.relations["canReach"]}
    places = reached | {value for symbol, value in bare.problem.goal.items() if symbol.situation == "LOCATION"}
    assert places <= set(sliced.problem.classes["Location"])
    if family != "random":  # an object can be at a place beyond every reach
        for kind in ("Movable", "Hand", "Location", "Beverage"):
            assert sliced.problem.classes[kind] == bare.problem.classes[kind]
        assert sliced.problem.initial == bare.problem.initial
    assert sliced.problem.goal == bare.problem.goal


def test_the_slice_of_the_papers_scene_keeps_the_initial_facts_and_the_ids_of_its_plan() -> None:
    graph = load("beverage-serving")
    whole, sliced = read(graph).problem, recognise(graph).problem
    assert sliced.initial == whole.initial
    assert [str(s) for s in plan(sliced).plan.walk()] == [str(s) for s in plan(whole).plan.walk()]  # type: ignore[union-attr]


def counted(graph: KnowledgeGraph, monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    counts: Counter[str] = Counter()
    ask = KnowledgeGraph.query

    def query(self: KnowledgeGraph, *arguments: object, **named: object) -> object:
        counts["queries"] += 1
        return ask(self, *arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(KnowledgeGraph, "query", query)
    return counts


@pytest.mark.parametrize("sizes", [{"objects": 4}, {"objects": 4, "clutter": 2000}, {"objects": 80, "hands": 30}])
def test_at_most_twelve_queries_at_any_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sizes: dict[str, int]
) -> None:
    path = tmp_path / "scene.ttl"
    write_scene(
        path, "handover", **({"objects": 8} if sizes["objects"] == 4 else sizes) | {"clutter": sizes.get("clutter", 0)}
    )
    graph = load(path)
    counts = counted(graph, monkeypatch)
    sliced = recognise(graph)
    assert counts["queries"] <= 12
    assert len(sliced.problem.classes["Hand"]) == sizes.get("hands", 2)


def test_a_task_on_one_of_two_tables_leaves_the_other_out(tmp_path: Path) -> None:
    """Hands, places and objects of a second table aren't read, although they may have the same beverage or be in a hand."""
    second = "".join(
        f":far_hand a owl:NamedIndividual, c:Hand ; k:canReach :far{i} .\n"
        f":far{i} a owl:NamedIndividual, k:Location .\n"
        f":far_bottle{i} a owl:NamedIndividual, k:Bottle ; k:location :far{i} ; k:beverage :beverage1 .\n"
        f":held{i} a owl:NamedIndividual, k:Cup ; k:location k:in_hand ; k:beverage k:no_beverage .\n"
        for i in range(5)
    )
    path = tmp_path / "scene.ttl"
    path.write_text(generate("served") + second, encoding="utf-8")
    problem = recognise(load(path)).problem
    assert problem.classes["Movable"] == ("bottle1", "bottle2", "cup1", "cup2")
    assert problem.classes["Hand"] == ("hand1", "hand2")


def test_an_object_that_a_changed_goal_names_is_in_the_slice(tmp_path: Path) -> None:
    path = tmp_path / "scene.ttl"
    write_scene(path, "served", clutter=3)
    graph, goals = load(path), ["thing2 LOCATION location7"]
    with pytest.raises(KnowledgeError, match="unknown individual 'thing2'"):
        with_goals(recognise(graph).problem, goals)
    reading = recognise(graph, goals)
    problem = with_goals(reading.problem, goals)
    assert not reading.whole
    assert "thing2" in reading.problem.classes["Cup"]
    assert "thing3" not in reading.problem.classes["Cup"]
    assert str(next(s for s in problem.goal if s.arguments == ("thing2",))) == "<thing2, LOCATION>"


@settings(max_examples=15)
@given(seed=st.integers(0, 10_000), objects=st.sampled_from([2, 4]), hands=st.integers(1, 3))
def test_random_tables_are_solvable_in_the_slice_if_in_the_world(seed: int, objects: int, hands: int) -> None:
    with TemporaryDirectory() as folder:
        write_scene(Path(folder) / "scene.ttl", "random", objects, hands, clutter=1, seed=seed)
        graph = load(Path(folder) / "scene.ttl")
    limits = Limits(expansions=400)
    expected, found = plan(read(graph).problem, limits=limits), plan(recognise(graph).problem, limits=limits)
    assume(Status.GAVE_UP not in (expected.status, found.status))
    assert found.status is expected.status


def test_a_slice_names_its_individuals_as_the_whole_scene_does(tmp_path: Path) -> None:
    """A hand with the name of a role that only physics uses keeps its prefix, even if the role isn't read."""
    for name in ("scenes/one-arm-serving.ttl", "scenes/one-arm-serving.reach.ttl", "robots/one-arm.ttl"):
        text = (ROOT / name).read_text(encoding="utf-8").replace("confab/one-arm", "confab/one-hand")
        text = text.replace("r:gripper", "r:hand").replace("\n:gripper", "\n:hand")
        (tmp_path / Path(name).name.replace("one-arm", "one-hand")).write_text(text, encoding="utf-8")
    graph = load(tmp_path / "one-hand-serving.ttl")
    assert recognise(graph).problem.classes["Hand"] == read(graph).problem.classes["Hand"] == ("one-hand:hand",)


@pytest.mark.parametrize("where", ["prefix", "import", "class"])
def test_an_individual_has_the_same_name_in_the_slice_even_if_an_irrelevant_namesake_exists(
    tmp_path: Path, where: str
) -> None:
    """Another cup1 in a separate namespace is far away and isn't read.

    The cup1 of the task has the name that it has in the whole scene.
    """
    space, text = "<https://example.org/far#{}>", generate("served", clutter=5)
    cup, shelf, cat = map(space.format, ("cup1", "shelf", "cat"))
    more = f"{cup} a owl:NamedIndividual, k:Cup ; k:location {shelf} ; k:beverage k:no_beverage .\n"
    more += f"{shelf} a owl:NamedIndividual, k:Location .\n"
    if where == "class":
        more = f"{cup} a owl:Class . {cat} a owl:NamedIndividual, {cup} .\n"
    if where == "import":
        head = "".join(line for line in text.splitlines(keepends=True) if line.startswith("@prefix"))
        (tmp_path / "far.ttl").write_text(f"{head}<https://example.org/far> a owl:Ontology .\n{more}", encoding="utf-8")
        text = text.replace("owl:imports <https", "owl:imports <https://example.org/far>, <https", 1)
    else:
        text = f"@prefix far: {space.format('')} .\n{text}{more}"
    (tmp_path / "scene.ttl").write_text(text, encoding="utf-8")
    graph = load(tmp_path / "scene.ttl")
    whole, sliced = read(graph), recognise(graph)
    (cup,) = (name for name in sliced.problem.classes["Cup"] if name.endswith("cup1"))
    assert cup == sliced.names.short(sliced.names.iri(cup)) == whole.names.short(sliced.names.iri(cup)) != "cup1"
    assert "cup1" not in whole.names
    assert len(sliced.problem.classes["Cup"]) == 2
    assert plan(sliced.problem).status is Status.SOLVED
    (goal,) = (
        str(s)
        for s in recognise(graph, [f"{cup} LOCATION location3"]).problem.goal
        if "LOC" in str(s) and cup in str(s)
    )
    assert goal == f"<{cup}, LOCATION>"


@pytest.mark.parametrize("word", ["Task", "Level", "Parameter"])
def test_a_class_may_have_the_name_of_a_term_of_the_model(tmp_path: Path, word: str) -> None:
    """The core's own classes of that name have no individuals in the problem, so they change no name."""
    text = generate("served").replace(":cup1 a owl:NamedIndividual, k:Cup", f":cup1 a owl:NamedIndividual, :{word}", 1)
    text += f":{word} a owl:Class ; rdfs:subClassOf k:Cup .\n"
    (tmp_path / "scene.ttl").write_text(text, encoding="utf-8")
    graph = load(tmp_path / "scene.ttl")
    assert recognise(graph).problem.classes[word] == read(graph).problem.classes[word] == ("cup1",)


def test_conditions_on_two_individuals_lead_to_individuals_with_unstated_defaults_too(tmp_path: Path) -> None:
    """Both conditions name their individual alike; only one of the two individuals has a stated value."""
    scene = skeleton(tmp_path)
    scene.write_text(
        scene.read_text(encoding="utf-8")
        + """
:LAMP a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :lamp ; c:defaultValue :off .
:WALL a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :wall ; c:defaultValue :white .
:lamp a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Room ; rdfs:range :LAMP .
:wall a owl:ObjectProperty, owl:FunctionalProperty ; rdfs:domain :Room ; rdfs:range :WALL .
:off a owl:NamedIndividual, :LAMP . :on a owl:NamedIndividual, :LAMP .
:white a owl:NamedIndividual, :WALL . :red a owl:NamedIndividual, :WALL .
:Room a owl:Class ; rdfs:subClassOf c:Object ; c:hasSituationType :LAMP, :WALL .
:hall a owl:NamedIndividual, :Room . :cellar a owl:NamedIndividual, :Room ; :lamp :on ; :wall :red .
:SWITCH a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:parameter :SWITCH.room ; c:postcondition :SWITCH.off ;
  c:precondition :SWITCH.dark, :SWITCH.red .
:SWITCH.room a owl:NamedIndividual, c:Parameter ; c:termType :Room .
:SWITCH.dark a owl:NamedIndividual, c:AbsenceCondition ; c:situationType :LAMP ; c:ofClass :Room ; c:value :off ; c:negated true .
:SWITCH.red a owl:NamedIndividual, c:AbsenceCondition ; c:situationType :WALL ; c:ofClass :Room ; c:value :red ; c:negated true .
:SWITCH.off a owl:NamedIndividual, c:ValueEffect ; c:situationType :LAMP ; c:about :SWITCH.room ; c:value :off .
""",
        encoding="utf-8",
    )
    reading = recognise(load(scene), ["cellar LAMP off"])
    assert reading.problem.classes["Room"] == ("cellar", "hall")


def test_an_individual_may_have_the_name_of_a_property(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    scene.write_text(scene.read_text(encoding="utf-8").replace(":plate1", ":isAt"), encoding="utf-8")
    whole, part = read(load(scene)), recognise(load(scene))
    assert whole.problem.goal == part.problem.goal
    assert "isAt" in whole.names


WET = ":wet a owl:NamedIndividual, d:CLEANLINESS ; c:fromLevel 2 ."
WIPE = """:WIPE a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:parameter :WIPE.it ; c:postcondition :WIPE.wet .
:WIPE.it a owl:NamedIndividual, c:Parameter ; c:termType d:Plate .
:WIPE.wet a owl:NamedIndividual, c:ValueEffect ; c:situationType d:CLEANLINESS ; c:about :WIPE.it ; c:value :wet ."""


@pytest.mark.parametrize(
    ("excluded", "more", "wanted"),
    [
        ("d:CLEANLINESS ; c:value d:clean", "", "dirty"),
        ("d:CLEANLINESS ; c:value d:clean", WET + WIPE, ""),
        ("d:CLEANLINESS ; c:value d:clean", WET, ""),
        ("d:CLEANLINESS ; c:value d:clean", ":wet a owl:NamedIndividual, d:CLEANLINESS .", ""),
        ("d:PLACE ; c:value :table", "", ""),
    ],
)
def test_a_goal_that_excludes_a_value_requires_the_remaining_value_or_any_of_several(
    tmp_path: Path, excluded: str, more: str, wanted: str
) -> None:
    scene = skeleton(tmp_path)
    text = scene.read_text(encoding="utf-8")
    assert excluded in text
    scene.write_text(text.replace(excluded, excluded + " ; c:negated true") + more, encoding="utf-8")
    for reading in (read, recognise):
        if wanted:
            assert wanted in reading(load(scene)).problem.goal.values()
        else:  # the goal is the exclusion itself
            assert ("task",) in [symbol.arguments for symbol in reading(load(scene)).problem.goal]


def test_a_tuple_that_lacks_an_individual_is_refused(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    with scene.open("a", encoding="utf-8") as file:
        for number, places in enumerate(("table :shelf :sink", "table :shelf")):
            roles = " ; ".join(
                f"{role} :{place.strip(':')}"
                for role, place in zip(("c:about", "c:argument2", "c:argument3"), places.split(), strict=False)
            )
            file.write(f":n{number} a owl:NamedIndividual, c:SituatedObjectInstance ; c:relation :near ; {roles} .\n")
        file.write(":near a owl:NamedIndividual, c:Relation .\n")
    with pytest.raises(KnowledgeError, match="names 2 individuals; others name 3") as said:
        read(load(scene))
    assert said.value.node.endswith("#n1")
