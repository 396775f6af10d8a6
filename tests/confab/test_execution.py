"""Execution from the command line: output, files, and messages about misuse."""

import json
import subprocess
import sys
from io import StringIO
from itertools import combinations, pairwise
from pathlib import Path

import pytest
from rich.console import Console

import confab
from confab import ontology
from confab.cli import main
from confab.execution import carry_out, execute
from confab.interchange import episode_json
from confab.intervening import parse_interventions
from confab.live import View, in_terminal
from confab.planner.acting.episode import End, Event, Intervention, InterventionKind
from confab.planner.acting.retries import RetryPolicy
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.plan import Limits
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, read_into, text
from confab.reasoner.memory.episodes import assert_episode
from confab.reasoner.symbols import Symbol
from confab.reasoner.validation.validate import validate
from confab.reasoner.vocabulary import EPISODES, PROV
from tests.ontology.faults import skeleton

GUESTS = Path(__file__).parent / "cases" / "guests.ttl"

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
FIGURE_8 = ("after=28 cup2 LOCATION location8", "after=28 goal cup2 LOCATION location8")


def command(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-c", "from confab.cli import main; main()", "execute", "beverage-serving", *arguments]
    return subprocess.run(line, capture_output=True, text=True, cwd=cwd, timeout=60, check=False)


def test_figure_8_from_the_command_line_as_json() -> None:
    done = command("--intervene", FIGURE_8[0], "--intervene", FIGURE_8[1], "--json")
    data = json.loads(done.stdout)
    assert done.returncode == 0
    assert data["status"] == "reached"
    assert [[m["id"] for m in step["steps"]] for step in data["steps"] if step["id"] == 39] == [[5, 15, 26]]
    (change,) = data["replans"]
    assert set(change) >= {"after", "kind", "steps", "cost", "dropped", "added"}
    assert change["kind"] == "repair"
    assert [i["text"] for i in data["interventions"]] == list(FIGURE_8)


def test_interventions_come_from_a_file_too(tmp_path: Path) -> None:
    (tmp_path / "day.txt").write_text("# the user\n" + "\n".join(FIGURE_8) + "\n")
    done = command("--intervene", "day.txt", cwd=tmp_path)
    assert done.returncode == 0
    assert "1 change of plan" in done.stdout


def test_a_file_of_interventions_may_name_steps_and_have_comments(tmp_path: Path) -> None:
    file = tmp_path / "day.txt"
    file.write_text(
        "# the user\nafter=L3#28 cup2 LOCATION location8  # moves it\n\t# and takes it\nafter=3 remove cup2 #\n"
    )
    read = parse_interventions(confab.load("beverage-serving").problem, [str(file)])
    assert [(one.after, one.text) for one in read] == [
        ("L3#28", "after=L3#28 cup2 LOCATION location8"),
        (3, "after=3 remove cup2"),
    ]


def test_interventions_whose_step_or_time_never_came_are_reported() -> None:
    never = ["after=999 remove cup2", "at=9999 remove cup2"]
    execution = confab.load("beverage-serving").execute(interventions=never)
    assert execution.reached
    assert execution.json()["never_came"] == never
    assert execution.summary().endswith(
        "the step or time of an intervention wasn't reached: after=999 remove cup2, at=9999 remove cup2 "
        "(after=ID names a step at the top of the plan: 22, 28, 34, 39)"
    )


def test_an_intervention_names_any_step_by_its_name_as_explain_does() -> None:
    scene = confab.load("beverage-serving")
    plan = scene.plan().plan
    for name in ("L1#1", "L2#3", "l3#9"):
        step = plan[name.upper()]
        done = scene.execute(plan=plan, interventions=[f"after={name} cup2 LOCATION location8"])
        assert done.episode.interventions and not done.episode.missed
        before = [event.step.path for event in done.episode.events if event.end <= done.episode.interventions[0][1]]
        assert before[-1][: len(step.path)] == step.path
    with pytest.raises(KnowledgeError, match=r"a name from L1#0 to L3#"):
        scene.execute(interventions=["after=L4#0 cup2 LOCATION location8"])


def test_an_intervention_after_the_id_of_a_lower_step_is_told_the_name_of_the_step() -> None:
    scene = confab.load("beverage-serving")
    plan = scene.plan().plan
    top, lower = {step.id for step in plan.steps}, plan.at_level(3)
    step = next(step for step in lower if step.id not in top)
    done = scene.execute(plan=plan, interventions=[f"after={step.id} cup2 LOCATION location8"])
    assert f"{step.id} is the ID of L" in done.summary()
    name = done.summary().rpartition("after=")[2].split()[0]
    assert plan[name].id == step.id


def test_an_execution_whose_goal_becomes_impossible_exits_with_1_and_the_reason() -> None:
    done = command("--intervene", "after=28 remove cup2")
    assert done.returncode == 1
    assert "cup2" in done.stdout.splitlines()[0]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--intervene", "28 cup2"], "wanted 'after=28"),
        (["--intervene", "after=x cup2 LOCATION location8"], "wanted an ID"),
        (["--intervene", "after=-3 remove cup2"], "wanted an ID"),
        (["--intervene", "at=-5 remove cup2"], "seconds from 0 on"),
        (["--intervene", "at=nan remove cup2"], "seconds from 0 on"),
        (["--intervene", "after=28 goal cup2 COLOUR red"], "unknown situation type 'COLOUR'"),
        (["--intervene", "at=1 cup2 LOCATION in_hand", "--world", "pybullet"], "can't be put at 'in_hand'"),
        (["--intervene", "after=28 left_hand HOLDS cup2", "--world", "pybullet"], "an intervention cannot make"),
        (["--intervene", "after=28 cup9 LOCATION location8"], "did you mean 'cup"),
        (["--intervene", "after=28 remove cup9"], "did you mean 'cup"),
        (["--intervene", "after=28 remove cup1 cup2"], "one object; got 2"),
        (["--intervene", "after=28 goal"], "wanted 'goal object"),
        (["--intervene", "after=28 add Cpu cup9 LOCATION location5"], "did you mean 'Cup'"),
        (["--intervene", "after=28 add Cup cup1 LOCATION location5"], "another name"),
        (["--intervene", "after=28 drop-goal cup2 LOCATOIN"], "did you mean"),
        (["--world", "moon"], "unknown world 'moon'"),
        (["--mode", "magic"], "unknown mode 'magic'"),
        (["--memory", "m.ttl", "--learn", "--save", "./m.ttl"], "one file for two purposes"),
        (["--save", "beverage-serving"], "wanted a name that ends in .ttl or .json"),
    ],
)
def test_misuse_is_one_clear_line(arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["execute", "beverage-serving", *arguments])
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert word in said
    assert said.count("\n") == 1


def test_a_goal_about_an_added_individual_is_reached_by_an_effect_on_all_members_of_its_class() -> None:
    theatre = confab.load(EXAMPLES / "theatre" / "first-night.ttl")
    first = f"after={theatre.plan().plan[0].id}"
    run = theatre.execute(interventions=[f"{first} add Prop parcel AT stage", f"{first} goal parcel AT store"])
    assert run.episode.status is End.REACHED
    assert run.episode.observed[Symbol("AT", ("parcel",))] == "store"
    assert "parcel" not in {one for step in run.episode.done.steps if step.behavior == "PUSH" for one in step.arguments}


def test_an_individual_may_have_the_name_of_a_form_of_intervention(tmp_path: Path) -> None:
    scene = skeleton(tmp_path)
    scene.write_text(scene.read_text(encoding="utf-8").replace(":plate2", ":box"), encoding="utf-8")
    (moved,) = parse_interventions(confab.load(scene).problem, ["after=1 box PLACE sink"])
    assert moved.change is InterventionKind.WORLD
    assert [str(fact) for fact in moved.facts] == ["box PLACE sink"]


def test_every_form_of_intervention_is_read() -> None:
    problem = confab.load("beverage-serving").problem
    texts = [
        *FIGURE_8,
        "after=0.1.2 drop-goal cup2 LOCATION",
        "at=12.5 remove cup2",
        "after=28 add Cup cup9 LOCATION location5 BEVERAGE no_beverage",
    ]
    read = parse_interventions(problem, texts)
    assert [i.change for i in read] == [
        InterventionKind.WORLD,
        InterventionKind.GOAL,
        InterventionKind.DROP_GOAL,
        InterventionKind.REMOVE,
        InterventionKind.ADD,
    ]
    assert [i.after for i in read] == [28, 28, (0, 1, 2), None, 28]
    assert read[3].at == 12.5
    assert [str(fact) for fact in read[4].facts] == ["cup9 LOCATION location5", "cup9 BEVERAGE no_beverage"]
    hands_on = ["after=22 knock cup2", "after=22 push cup2 6 -3", "after=22 box location7 12x10x20"]
    knock, push, box = parse_interventions(problem, hands_on)
    assert (knock.individual, push.numbers) == ("cup2", (0.06, -0.03))
    assert (box.kind, box.numbers, [str(fact) for fact in box.facts]) == (
        "Movable",
        (0.12, 0.1, 0.2),
        ["box1 LOCATION location7"],
    )
    for wrong in (
        "after=28 push cup2 x 3",
        "after=28 box in_hnd",
        "after=28 box location7 0x1x1",
        "after=28 knock left_hand",
    ):
        with pytest.raises(KnowledgeError):
            parse_interventions(problem, [wrong])
    with pytest.raises(KnowledgeError):
        parse_interventions(problem, ["after=28"])


def test_an_episode_is_stored_in_the_terms_of_prov(tmp_path: Path) -> None:
    scene = confab.load("beverage-serving")
    execution = scene.execute(interventions=FIGURE_8)
    path = execution.save(tmp_path / "visit.ttl")
    graph = KnowledgeGraph("")
    read_into(graph, path, "episodes")
    count = "SELECT (COUNT(?x) AS ?n) WHERE { ?x a <%s> }"
    for kind, number in (("Execution", 32), ("Planning", 2), ("Intervention", 2), ("Episode", 1)):
        ((found,),) = graph.select(count % (EPISODES + kind))
        assert int(text(found)) == number, kind
    why = f"""SELECT ?text WHERE {{ ?change <{EPISODES}kind> "repair" ; <{PROV}wasInformedBy> ?person .
      ?person a <{EPISODES}Intervention> ; <{EPISODES}text> ?text }} ORDER BY ?text"""
    assert [text(row[0]) for row in graph.select(why)] == sorted(FIGURE_8)
    assert not validate([path])


@pytest.mark.parametrize("pause", [0.0, 0.25])
def test_a_change_of_plan_is_reported_with_its_intervention_however_slow_the_world_is(pause: float) -> None:
    """In PyBullet, bodies take a quarter of a second to come to rest.

    Formerly the change was then reported with the next primitive.
    """
    scene = confab.load("beverage-serving")

    class Slow(SymbolicWorld):
        def disturb(self, intervention: Intervention) -> None:
            super().disturb(intervention)
            self.seconds += pause

    episode = execute(scene, scene.problem, None, FIGURE_8, Slow(scene.problem)).json()
    assert_episode(scene.knowledge, episode, scene.names)
    rows = scene.query(ready("why-was-the-plan-changed"))
    assert sorted(str(row[3]) for row in rows) == sorted(FIGURE_8)


def ready(name: str) -> str:
    return (ontology.ROOT / "questions" / "episodes" / f"{name}.rq").read_text()


def test_several_saved_episodes_can_be_queried_together(tmp_path: Path) -> None:
    scene = confab.load("beverage-serving")
    scene.execute().save(tmp_path / "calm.ttl")
    scene.execute(interventions=FIGURE_8).save(tmp_path / "visit.ttl")
    both = scene.with_episodes(tmp_path / "calm.ttl", tmp_path / "visit.ttl")
    assert not scene.query(ready("where-was-it"))
    rows = both.query(ready("where-was-it").replace("12.0", "12.5"))
    places = [row[4] for row in rows if row[1] == "cup2" and row[3] == "LOCATION"]
    assert places == ["location5", "location8"]
    assert {"bottle1", "cup1", "left_hand"} <= {str(row[1]) for row in rows}
    late = both.query(ready("where-was-it").replace("12.0", "999.0"))
    assert [row[4] for row in late if row[1] == "cup1" and row[3] == "LOCATION"] == ["location7", "location7"]
    course = [row for row in both.query(ready("how-did-it-go-on")) if row[1] == "cup2" and row[2] == "LOCATION"]
    calm, visit = ["location1", "in_hand", "location5"], ["location1", "in_hand", "location5", "location8"]
    assert [row[5] for row in course] == calm + visit
    assert [str(row[0]).rpartition("#")[2] for row in course] == ["episode_calm"] * len(calm) + ["episode_visit"] * len(
        visit
    )
    assert not both.query(ready("what-failed"))
    with pytest.raises(KnowledgeError, match="both contain"):
        both.with_episodes(tmp_path / "calm.ttl", tmp_path / "calm.ttl")
    with pytest.raises(KnowledgeError, match="has no episode"):
        both.with_episodes(ontology.ROOT / "scenes" / "two-cups.ttl")


def test_the_course_of_an_episode_leads_from_the_initial_to_the_observed_state() -> None:
    episode = confab.load("beverage-serving").execute(interventions=FIGURE_8).episode
    state = {**episode.initial}
    for seen in episode.course:
        assert seen.value is not None
        state[seen.symbol] = seen.value
    assert state == episode.observed


def test_an_episode_goes_into_the_scenes_own_graph_of_episodes() -> None:
    scene = confab.load("beverage-serving")
    assert_episode(scene.knowledge, scene.execute().json(), scene.names)
    table = scene.query(f"SELECT ?e WHERE {{ GRAPH <urn:confab:graph:episodes> {{ ?e a <{EPISODES}Execution> }} }}")
    assert len(table) == 32


def test_a_plan_made_in_a_part_of_a_scene_is_carried_out_in_the_whole_scene(tmp_path: Path) -> None:
    """A later plan may need individuals that the first plan didn't need."""
    scene = confab.generate("served", tmp_path / "table.ttl", objects=4, clutter=5, seed=1)
    result = scene.plan()
    run = result.execute()
    assert run.reached
    assert len(result.problem.initial) < len(run.episode.initial) == len(scene.problem.initial)


def test_a_result_is_executed_as_it_was_planned() -> None:
    result = confab.load("beverage-serving").plan()
    execution = result.execute(interventions=FIGURE_8)
    assert execution.episode.planned == result.plan
    assert execution.reached
    assert "repair" in execution._repr_html_()


def test_an_execution_begins_with_the_plan_of_plan_however_short_the_time_for_a_later_plan_is() -> None:
    scene = confab.load("beverage-serving")
    execution = scene.execute(retry_policy=RetryPolicy(planning=Limits(seconds=0.0)))
    assert execution.reached and execution.episode.planned.primitives == scene.plan().plan.primitives


def test_a_result_of_another_scene_is_executed_as_its_plan() -> None:
    scene = confab.load("beverage-serving")
    result, location = scene.plan(), Symbol("LOCATION", ("cup2",))
    other = scene.with_goal("cup2 LOCATION location8").with_fact("cup1 LOCATION location7")
    done = other.execute(result)
    assert done.reached
    assert done.episode.goal == other.problem.goal
    assert done.episode.initial == other.problem.initial
    assert done.episode.observed[location] == "location8"


def test_the_goals_of_an_execution_replace_those_of_its_result() -> None:
    scene = confab.load("wishes-small")
    done = scene.execute(scene.plan("glass IN shop"), goals="paper IN shop")
    assert done.reached
    assert {done.episode.observed[Symbol("IN", (one,))] for one in ("books", "glass", "paper")} == {"shop"}
    assert [str(goal.fact) for goal in done.soft_goals] == ["store STOCK 0"]


def test_a_result_of_another_scene_is_verified_for_the_goals_of_the_scene() -> None:
    scene = confab.load("beverage-serving")
    other = scene.with_goal("cup2 LOCATION location8")
    report = other.verify(scene.plan(), rollouts=1)
    assert not report.verified
    assert "the goal isn't reached: cup2 LOCATION location8 (seen: location5)" in str(report)


def test_any_world_with_observe_and_execute_can_run_an_episode() -> None:
    scene = confab.load("beverage-serving")
    world = SymbolicWorld(scene.problem, {"B3_TILT": 5.0})
    assert execute(scene, scene.problem, world=world).episode.seconds["simulated"] == 40.0


def test_the_live_view_shows_step_expectation_intervention_and_change() -> None:
    scene, view, events = confab.load("beverage-serving"), View(), list[Event]()
    scene.execute(interventions=FIGURE_8, observer=events.append)
    shown = []
    for event in events:
        view.take(event)
        console = Console(file=StringIO(), width=150)
        console.print(view)
        shown.append(console.file.getvalue())  # type: ignore[attr-defined]
    first = next(text for text, event in zip(shown, events, strict=True) if event.what == "begin")
    assert "◀ left_hand HAND_POSITION cup1" in first
    assert "✋ after=28 cup2 LOCATION location8" in "".join(shown)
    assert "↻ repair" in "".join(shown)
    assert "✋" in view._repr_html_()


def test_the_terminal_view_shows_the_events_of_an_episode() -> None:
    console = Console(file=StringIO(), force_terminal=True, width=120)
    with in_terminal(console) as observer:
        confab.load("beverage-serving").execute(interventions=FIGURE_8, observer=observer)
    assert "B1_POUR" in console.file.getvalue()  # type: ignore[attr-defined]


def test_the_json_of_an_episode_names_its_surprises() -> None:
    data = episode_json(
        confab.load("beverage-serving").execute(interventions=["at=3.5 cup1 LOCATION location6"]).episode
    )
    surprises = [s for event in data["events"] for s in event["surprises"]]
    assert {"symbol": "<cup1, LOCATION>", "expected": "in_hand", "observed": "location6"} in surprises


@pytest.mark.slow
def test_figure_8_in_pybullet_with_the_cup_really_moved() -> None:
    execution = confab.load("beverage-serving").execute(interventions=FIGURE_8, world="pybullet")
    assert execution.reached
    last = execution.episode.done.steps[-1]
    assert {m.id: [p.id for p in m.steps] for m in last.steps} == {
        5: [9, 29, 33],
        15: [11, 35, 37, 33],
        26: [22, 31, 33],
    }
    assert execution.episode.failures == ()


OVENS = (Path(__file__).parents[1] / "planner" / "cases" / "ovens.ttl").read_text("utf-8")


@pytest.mark.parametrize(("text", "seconds"), [(OVENS, 120), (OVENS.replace("c:never true ; ", ""), 60)])
def test_a_task_with_durations_is_executed_in_time_and_keeps_its_constraints(
    tmp_path: Path, text: str, seconds: float
) -> None:
    (tmp_path / "ovens.ttl").write_text(text, "utf-8")
    scene = confab.load(tmp_path / "ovens.ttl")
    for run in (scene.execute(), scene.execute(scene.plan(minimise="makespan"))):
        assert run.reached
        assert not run.violations
        assert run.summary().endswith(f"in {seconds:g} s")
    varied = [scene.execute(perturb=True, seed=seed).episode.seconds["simulated"] for seed in (1, 2, 2)]
    assert varied[0] != varied[1] == varied[2]


def test_wrong_ids_in_a_plan_file_do_not_change_how_the_plan_is_executed(tmp_path: Path) -> None:
    scene = confab.load(EXAMPLES / "bakery" / "bakery.ttl")
    result = scene.plan()
    (tmp_path / "plan.json").write_text(
        json.dumps({"steps": [{**one, "id": 0} for one in result.json()["steps"]]}), "utf-8"
    )
    right, wrong = (carry_out(scene, plan) for plan in (result.plan, scene.read_plan(tmp_path / "plan.json")))
    assert wrong.reached
    assert wrong.episode.seconds["simulated"] == right.episode.seconds["simulated"]


def test_the_bakery_of_the_guide_is_executed_within_its_window_and_its_deadline() -> None:
    run = confab.load(Path(__file__).parents[2] / "docs" / "examples" / "bakery" / "bakery.ttl").execute()
    assert run.reached
    assert run.episode.seconds["simulated"] <= 5_700
    begins = [event.begin for event in run.episode.events if event.step.behavior == "DELIVER"]
    assert min(begins) >= 1_800


def test_a_missed_deadline_is_the_reason_for_impossible(tmp_path: Path) -> None:
    goal = ":g1 a owl:NamedIndividual, c:ValueCondition ;"
    (tmp_path / "late.ttl").write_text(OVENS.replace(goal, f'{goal} c:by "PT30S"^^xsd:dayTimeDuration ;'), "utf-8")
    run = confab.load(tmp_path / "late.ttl").execute()
    assert not run.reached
    assert (
        run.episode.reasons[0].text == "o1 DONE true is a goal by 30 s, and holds from 60 s on; this was known at 0 s"
    )


@pytest.mark.slow
def test_both_hands_in_pybullet_are_faster_and_never_touch() -> None:
    execution = confab.load("beverage-serving").execute(world="pybullet", both_hands=True)
    episode = execution.episode
    assert execution.reached
    assert episode.failures == ()
    assert episode.done == episode.planned
    assert episode.seconds["simulated"] <= 0.75 * sum(event.end - event.begin for event in episode.events)


@pytest.mark.slow
def test_primitives_during_which_the_arms_touch_fail_and_one_hand_at_a_time_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("confab.sim.together.arms_touch", lambda world: 8.2 < world.seconds < 8.3)
    execution = confab.load("beverage-serving").execute(world="pybullet", both_hands=True)
    events = execution.episode.events
    touching = [event for event in events if event.begin < 8.2 and event.end > 8.3]
    assert execution.reached
    assert len(touching) == 2
    assert {event.code for event in touching} == {"arms touch"} == {one.code for one in execution.episode.failures}
    later = [event for event in events if event.begin > 8.3]
    assert later
    assert all(one.end <= other.begin for one, other in pairwise(later))


@pytest.mark.slow
def test_an_intervention_while_both_hands_move_stops_only_the_hand_of_its_object_and_both_hands_go_on() -> None:
    run = confab.load("beverage-serving").execute(
        interventions="at=8.2 cup2 LOCATION location8", world="pybullet", both_hands=True
    )
    episode = run.episode
    ((_, at),) = episode.interventions
    moving = [event for event in episode.events if event.begin < at <= event.end]
    assert run.reached
    assert [event.code for event in moving if "cup2" in event.step.arguments] == ["interrupted"]
    assert [event.ok for event in moving if "cup2" not in event.step.arguments] == [True]
    later = [event for event in episode.events if event.begin > at]
    assert any(one.begin < other.end and other.begin < one.end for one, other in combinations(later, 2))


@pytest.mark.parametrize(
    "interventions",
    ["guest1 AT hall", "add Guest guest3 AT hall, goal guest3 AT salon", "guest2 AT salon", "remove guest2"],
)
def test_the_order_of_executed_primitives_is_known_after_an_intervention_too(interventions: str) -> None:
    texts = [f"after=L1#0 {one}" for one in interventions.split(", ")]
    run = confab.load(GUESTS).execute(interventions=texts)
    assert len(run.episode.interventions) == len(texts)
    moved = [step.arguments[0] for step in run.plan.primitives]
    assert {*run.graph().edges} == {(i, j) for j in range(len(moved)) for i in range(j) if moved[i] == moved[j]}
    assert [*run.graph()] == [*range(len(moved))]


def test_an_object_all_of_whose_facts_are_false_can_be_removed() -> None:
    run = confab.load(GUESTS).execute(goals="anna CALLED true", interventions="after=L1#0 remove anna")
    assert run.episode.status is End.IMPOSSIBLE
    assert "CALL" not in {step.behavior for step in run.plan.primitives}
    assert "anna CALLED true" in {reason.text[:16] for reason in run.episode.reasons}


def test_no_step_uses_a_removed_object() -> None:
    goals = ["guest2 AT hall", "guest1 KNOWS guest2"]
    run = confab.load(GUESTS).execute(goals=goals, interventions="at=0.5 remove guest2")
    assert run.episode.status is End.IMPOSSIBLE
    assert not any("guest2" in step.arguments for step in run.plan.primitives)
    assert not any("guest2" in symbol.arguments for symbol in run.episode.observed)


@pytest.mark.parametrize(
    ("goal", "greeted"), [("c:ValueCondition ; c:about :Guest ; c:situationType :GREETED", 2), ("none", 3)]
)
def test_a_goal_with_a_quantifier_and_no_goal_about_a_class_is_about_added_objects(
    goal: str, greeted: int, tmp_path: Path
) -> None:
    whole = GUESTS.read_text(encoding="utf-8").replace("c:goal :here, :there, :greeted", "c:goal :all")
    ungreeted = "c:ValueCondition ; c:about :all.x ; c:situationType :GREETED ; c:negated true"
    none = f"c:Witness ; c:negated true ; c:witness :all.x ; c:condition [ a {ungreeted} ]"
    whole += f":all a owl:NamedIndividual, {none if goal == 'none' else goal} .\n"
    (tmp_path / "all.ttl").write_text(f"{whole}:all.x a owl:NamedIndividual, c:Variable ; c:termType :Guest .\n")
    run = confab.load(tmp_path / "all.ttl").execute(interventions="after=L1#0 add Guest guest3 AT hall")
    assert run.reached
    assert [step.behavior for step in run.plan.primitives] == ["GREET"] * greeted


@pytest.mark.parametrize("steps", [0, 2])
def test_an_intervention_at_the_beginning_takes_place_before_the_first_primitive(steps: int) -> None:
    scene = confab.load(GUESTS) if steps else confab.load(GUESTS).without_goal("guest1", "guest2 AT")
    run = scene.execute(interventions=["at=0 guest1 AT salon", "at=0 goal guest1 AT hall"])
    assert not run.episode.missed
    assert not run.episode.failures
    assert run.reached
    assert [at for _, at in run.episode.interventions] == [0, 0]
