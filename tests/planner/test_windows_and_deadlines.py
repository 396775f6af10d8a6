"""Time windows of individuals and deadlines of goals: plans keep them, and the reason is given if no plan is found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import pytest
from click.testing import CliRunner

import confab
import confab.plan_call
import confab.timing
from confab.cli import app
from confab.planner.hierarchical.call import Compiled, compiled
from confab.planner.plan import Limits, Outcome, Plan, Status
from confab.planner.solve import Mode, Request, solve
from confab.planner.timed.crews import crews_of
from confab.planner.timed.plan import TimedPlan
from confab.planning import Result
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol
from confab.timing import Minimise
from tests.reasoner.test_durative import TRUCK, WAY
from worlds.families import family

ROBOTS = '''
@prefix : <https://example.org/robots#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/robots> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Robot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :IN, :CHARGED .
:Room a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :IN ; c:hasSituationType :CLEAN .
:Charger a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
:IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :in .
:CLEAN a owl:Class, owl:NamedIndividual, c:SituationType .
:CHARGED a owl:Class, owl:NamedIndividual, c:SituationType .
:in a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Robot ; rdfs:range :IN .
:stands a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Charger ; rdfs:range :Room .
:GO a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:actor :GO.robot ;
  c:duration "PT2S"^^xsd:dayTimeDuration ; c:update """
  DELETE { ?robot :in ?from } INSERT { ?robot :in ?to }
  WHERE { ?robot a :Robot . ?to a :Room . ?from a :Room . ?robot :in ?from FILTER(?from != ?to) }""" .
:WASH a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:actor :WASH.robot ;
  c:duration "PT10S"^^xsd:dayTimeDuration ; c:update """
  DELETE { ?robot :CHARGED true } INSERT { ?room :CLEAN true }
  WHERE { ?robot a :Robot . ?room a :Room . ?robot :in ?room ; :CHARGED true }""" .
:CHARGE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 3 ; c:actor :CHARGE.robot, :CHARGE.charger ;
  c:duration "PT4S"^^xsd:dayTimeDuration ; c:update """
  INSERT { ?robot :CHARGED true }
  WHERE { ?robot a :Robot . ?charger a :Charger . ?room a :Room . ?robot :in ?room . ?charger :stands ?room }""" .
:GO.robot a owl:NamedIndividual . :WASH.robot a owl:NamedIndividual .
:CHARGE.robot a owl:NamedIndividual . :CHARGE.charger a owl:NamedIndividual .
'''
"""Robots drive to rooms and wash them; washing uses up a charge, which chargers restore."""
EVER = "DELETE { ?robot :CHARGED true }"


def planned(
    folder: Path,
    robots: Mapping[str, str],
    goals: Mapping[str, int | None],
    windows: Sequence[tuple[str, int, int | None]] = (),
    chargers: Mapping[str, str] | None = None,
    minimise: Minimise | None = None,
    soft: Mapping[str, int] | None = None,
    mode: Mode = "guarded",
    more: str = "",
) -> Result:
    """Plan for robots with their rooms, rooms to be washed with deadlines, windows, and chargers with their rooms.

    Without chargers, robots stay charged. `soft` contains the weights of soft goals, and `more` further behaviours.
    """
    given = (ROBOTS if chargers else ROBOTS.replace(EVER, "")) + more
    chargers = chargers or {}
    rooms = dict.fromkeys([*robots.values(), *chargers.values(), *goals])
    lines = [f":{one} a :Room, owl:NamedIndividual ." for one in rooms]
    for one, room in robots.items():
        lines += [
            f":{one} a :Robot, owl:NamedIndividual ; :in :{room} .",
            f":{one}.charged a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :{one} ; c:situationType :CHARGED .",
        ]
    lines += [f":{one} a :Charger, owl:NamedIndividual ; :stands :{room} ." for one, room in chargers.items()]
    every = " ".join(f":{one}" for one in (*rooms, *robots, *chargers))
    lines.append(f"[] a owl:AllDifferent ; owl:distinctMembers ( {every} ) .")
    for number, (one, low, high) in enumerate(windows):
        until = "" if high is None else f' ; c:availableUntil "PT{high}S"^^xsd:dayTimeDuration'
        lines.append(
            f":window{number} a owl:NamedIndividual, c:Window ; c:ofIndividual :{one} ; "
            f'c:availableFrom "PT{low}S"^^xsd:dayTimeDuration{until} .'
        )
    lines.append(f":task a owl:NamedIndividual, c:Task ; c:goal {', '.join(f':{one}.goal' for one in goals)} .")
    for one, by in goals.items():
        deadline = "" if by is None else f' ; c:by "PT{by}S"^^xsd:dayTimeDuration'
        deadline += f" ; c:weight {soft[one]}" if soft and one in soft else ""
        lines.append(
            f":{one}.goal a owl:NamedIndividual, c:ValueCondition ; c:situationType :CLEAN ; c:about :{one}{deadline} ."
        )
    (folder / "robots.ttl").write_text(given + "\n".join(lines), "utf-8")
    return confab.load(folder / "robots.ttl").plan(minimise=minimise, mode=mode)


def said(result: Result) -> str:
    """Return the reason why there is no plan."""
    assert result.outcome.status is Status.GAVE_UP
    assert result.outcome.reason is not None
    return result.outcome.reason.text


def test_a_deadline_that_no_plan_keeps_is_named_with_its_goal(tmp_path: Path) -> None:
    assert "a CLEAN true is a goal by 5 s" in said(planned(tmp_path, {"r1": "hall"}, {"a": 5}))


def test_a_window_that_no_plan_keeps_is_named_with_its_individual(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall"}, {"a": None, "b": None}, [("r1", 0, 9), ("r1", 20, 25)])
    assert "r1 is available only from 0 to 9 s and from 20 to 25 s" in said(result)


def test_windows_without_common_time_are_both_named(tmp_path: Path) -> None:
    windows = [("r1", 0, 9), ("a", 20, None)]
    text = said(planned(tmp_path, {"r1": "hall"}, {"a": None}, windows))
    assert "r1 is available only from 0 to 9 s" in text or "a is available only from 20 s on" in text


def test_a_robot_whose_window_ends_leaves_the_rest_to_another(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall", "r2": "hall"}, {"a": None, "b": None, "c": None}, [("r1", 0, 15)])
    assert result.timed is not None
    assert result.timed.makespan == 24


def test_a_robot_that_is_available_too_late_leaves_the_goal_to_another(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall", "r2": "hall"}, {"a": 13, "b": None}, [("r1", 20, None)])
    assert result.solved


def test_another_robot_takes_over_late_steps_even_if_there_is_no_time_to_plan_the_goals_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bell = """
:BELL a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 9 ; c:duration "PT0S"^^xsd:dayTimeDuration ;
  c:happensAt "PT3S"^^xsd:dayTimeDuration ; c:update "INSERT { :bell :CLEAN true } WHERE {}" .
"""
    robots, windows = {"r1": "hall", "r2": "hall"}, [("r1", 0, 15), ("r2", 30, None)]
    planned(tmp_path, robots, {"a": None, "b": None, "bell": None}, windows, more=bell)
    passed = [0.0]

    def slowly(problem: Problem) -> Compiled:
        passed[0] += 60.0
        return compiled(problem)

    monkeypatch.setattr("confab.planner.timed.sharing.perf_counter", lambda: perf_counter() + passed[0])
    monkeypatch.setattr("confab.planner.timed.sharing.compiled", slowly)
    timed = confab.load(tmp_path / "robots.ttl").plan(time_limit=30.0).timed
    assert timed is not None
    assert "r2" in {actor for actor, _ in timed.lanes()}


def test_a_schedule_that_was_found_before_a_limit_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"MOST_WORK": 30_000, "MOST_TAKEOVERS": 0, "MOST_BARREN": 0, "BARREN_ROUNDS": 0}.items():
        monkeypatch.setattr(f"confab.planner.timed.sharing.{name}", value)
    robots = {f"r{number}": "hall" for number in range(1, 9)}
    assert planned(tmp_path, robots, {"a": None}, [("r1", 0, 9)]).solved


def test_two_robots_in_different_rooms_meet_deadlines_that_one_alone_misses(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall", "r2": "cellar"}, {"a": 13, "b": 13})
    assert result.timed is not None
    assert {actor for actor, _ in result.timed.lanes()} == {"r1", "r2"}


def test_the_goal_with_the_earliest_deadline_is_achieved_first(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall"}, {"a": None, "b": 25, "c": 13})
    assert result.timed is not None
    assert [slot.step.arguments[1] for slot in result.timed.slots if slot.step.behavior == "WASH"] == ["c", "b", "a"]


SLOW_DRIVES = (
    ROBOTS.replace('"PT2S"', '"PT50S"')
    + """
:FLY a owl:NamedIndividual, c:Behavior ; c:extends :GO ; c:level 1 ; c:index 4 ; c:cost 5 ; c:actor :FLY.robot ;
  c:duration "PT2S"^^xsd:dayTimeDuration .
:FLY.robot a owl:NamedIndividual .
"""
)


@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
@pytest.mark.parametrize(("by", "unmet"), [(12, {"b"}), (30, set())])
def test_a_soft_goal_is_left_unmet_if_no_schedule_meets_its_deadline_too(
    tmp_path: Path, mode: Mode, by: int, unmet: set[str]
) -> None:
    result = planned(tmp_path, {"r1": "a"}, {"a": 12, "b": by}, soft={"b": 5}, mode=mode)
    assert result.outcome.status is Status.SOLVED
    assert {symbol.arguments[0] for symbol in result.outcome.unmet} == unmet


def test_an_individual_that_only_an_actor_names_is_available_in_its_windows(tmp_path: Path) -> None:
    washed = ROBOTS.replace(EVER, "").replace("c:actor :WASH.robot", "c:actor :WASH.robot, :daylight")
    file = tmp_path / "daylight.ttl"
    file.write_text(
        washed
        + """
:Light a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
:daylight a :Light, owl:NamedIndividual . :hall a :Room, owl:NamedIndividual .
:r1 a :Robot, owl:NamedIndividual ; :in :hall .
:r1.charged a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :r1 ; c:situationType :CHARGED .
:day a owl:NamedIndividual, c:Window ; c:ofIndividual :daylight ; c:availableFrom "PT7S"^^xsd:dayTimeDuration .
[ a owl:AllDifferent ; owl:distinctMembers ( :daylight :hall :r1 ) ] .
:task a owl:NamedIndividual, c:Task ; c:goal :task.g .
:task.g a owl:NamedIndividual, c:ValueCondition ; c:about :hall ; c:situationType :CLEAN .
""",
        "utf-8",
    )
    timed = confab.load(file).plan().timed
    assert timed is not None
    (slot,) = timed.slots
    assert (float(slot.begin), float(slot.end), slot.actors) == (7, 17, ("r1", "daylight"))


@pytest.mark.parametrize("minimise", [None, "cost"])
def test_quick_steps_are_chosen_for_deadlines_that_cheap_steps_miss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, minimise: Minimise | None
) -> None:
    monkeypatch.setattr(f"{__name__}.ROBOTS", SLOW_DRIVES)
    result = planned(tmp_path, {"r1": "hall"}, {"a": 15, "b": 30, "c": 90}, minimise=minimise)
    assert result.timed is not None
    assert {"GO", "FLY"} >= {step.behavior for step in result.plan.primitives} - {"WASH"} >= {"FLY"}


def test_shortening_a_plan_for_soft_goals_keeps_their_deadlines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.ROBOTS", SLOW_DRIVES)
    result = planned(tmp_path, {"r1": "hall"}, {"a": 15, "b": 30, "c": 90}, soft={"b": 50, "c": 50})
    assert result.timed is not None
    assert not result.outcome.unmet


def test_no_actor_is_chosen_for_a_class_that_contains_another_class_of_actors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rest = """
:Machine a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :RESTED .
:Robot rdfs:subClassOf :Machine . :Charger rdfs:subClassOf :Machine .
:RESTED a owl:Class, owl:NamedIndividual, c:SituationType .
:REST a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 4 ; c:actor :REST.machine ; c:update \"\"\"
  INSERT { ?machine :RESTED true } WHERE { ?machine a :Machine . ?machine :RESTED false }\"\"\" .
:REST.machine a owl:NamedIndividual .
"""
    monkeypatch.setattr(f"{__name__}.ROBOTS", ROBOTS + rest)
    result = planned(tmp_path, {"r1": "hall", "r2": "hall"}, {"a": None}, chargers={"c1": "hall", "c2": "hall"})
    crews = [[actor for _, actor in crew.chosen] for crew in crews_of(result.scene.problem)]
    assert sorted(crews) == [[], ["r1", "c1"], ["r1", "c2"], ["r2", "c1"], ["r2", "c2"]]


@pytest.mark.parametrize("longer", [True, False])
def test_a_longer_plan_is_scheduled_if_a_cheapest_plan_misses_its_deadlines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, longer: bool
) -> None:
    search, plans = confab.plan_call.search, list[int]()
    more = {Symbol("CLEAN", ("hall",)): "true"} if longer else {}

    def searched(task: Any, problem: Problem, how: confab.plan_call.Searching) -> Outcome:
        return search(
            task, replace(problem, goal={**problem.goal, **more}) if how.shortening == "brief" else problem, how
        )

    def scheduled(problem: Problem, outcome: Outcome, *rest: Any) -> tuple[Outcome, TimedPlan | None]:
        plans.append(len(outcome.plan.primitives) if outcome.plan else 0)
        if len(plans) == 1:
            return replace(outcome, status=Status.GAVE_UP, plan=None), None
        return confab.timing.scheduled(problem, outcome, *rest)

    monkeypatch.setattr("confab.plan_call.search", searched)
    monkeypatch.setattr("confab.plan_call.scheduled", scheduled)
    result = planned(tmp_path, {"r1": "hall"}, {"a": 60}, minimise="cost")
    assert (result.solved, plans[:2]) == ((True, [2, 3]) if longer else (False, [2]))
    assert result.outcome.bound == 2


SOAK = '''
:SOAK a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 4 ; c:actor :SOAK.robot ;
  c:duration "PT60S"^^xsd:dayTimeDuration ; c:update """
  INSERT { ?room :CLEAN true } WHERE { ?robot a :Robot . ?room a :Room . ?room :CLEAN false }""" .
:SOAK.robot a owl:NamedIndividual .
'''
"""A robot soaks a room from anywhere, in one long step."""


@pytest.mark.parametrize("limit", [None, 60.0])
def test_a_plan_is_shortened_as_long_as_its_deadlines_are_kept(tmp_path: Path, limit: float | None) -> None:
    with confab.within(limit):
        result = planned(tmp_path, {"r1": "hall"}, {"a": 20, "b": None}, more=SOAK)
    assert result.solved
    assert sorted(step.behavior for step in result.plan.primitives) == ["GO", "SOAK", "WASH"]


@pytest.mark.parametrize("found", ["nothing", "a late plan"])
def test_a_plan_that_keeps_its_deadlines_is_never_lost_to_shortening(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, found: str
) -> None:
    search = confab.plan_call.search

    def searched(task: Any, problem: Problem, how: confab.plan_call.Searching) -> Outcome:
        if how.shortening != "repeated":
            return search(task, problem, how)
        if found == "nothing":
            raise OutOfTimeError("the time limit")
        return search(task, problem, confab.plan_call.Searching("guarded"))

    monkeypatch.setattr("confab.plan_call.search", searched)
    with confab.within(60):
        assert planned(tmp_path, {"r1": "hall"}, {"a": 20}, more=SOAK).solved


def never(plan: Plan) -> bool:
    return False


def test_shortening_keeps_only_plans_that_are_accepted() -> None:
    problem = family("swap", 6, 1)
    first = solve(Request(problem, limits=Limits(shortening="none")))
    assert first.plan is not None
    for accepts in (None, never):
        found = solve(Request(problem, limits=Limits(shortening="once", accepts=accepts), first=first))
        assert found.plan is not None
        assert (found.plan.primitives != first.plan.primitives) == (accepts is None)


def test_a_charger_with_a_window_that_is_too_short_is_avoided(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall"}, {"a": None, "b": None}, [("k1", 0, 3)], {"k1": "hall", "k2": "cellar"})
    assert result.timed is not None
    assert {"k2"} == {slot.step.arguments[1] for slot in result.timed.slots if slot.step.behavior == "CHARGE"}


def test_a_charging_window_for_one_robot_is_enough_if_the_other_needs_no_charge(tmp_path: Path) -> None:
    robots, goals = {"r1": "hall", "r2": "hall"}, {"a": None, "b": None, "c": 30}
    result = planned(tmp_path, robots, goals, [("k1", 12, 18)], {"k1": "hall"})
    assert result.timed is not None
    assert result.timed.makespan == 30


def test_robots_in_different_rooms_share_the_work_if_the_makespan_is_minimised(tmp_path: Path) -> None:
    goals = dict.fromkeys(("a", "b", "c", "d"))
    result = planned(tmp_path, {"r1": "hall", "r2": "cellar"}, goals, minimise="makespan")
    assert result.timed is not None
    assert result.timed.makespan == 24  # each robot drives to two rooms and washes them


def test_the_same_task_gets_the_same_schedule(tmp_path: Path) -> None:
    robots, goals = {"r1": "hall", "r2": "cellar", "r3": "attic"}, dict.fromkeys(("a", "b", "c", "d"))
    one, other = (planned(tmp_path, robots, goals, minimise="makespan") for _ in range(2))
    assert one.timed == other.timed


def test_a_step_has_no_slack_beyond_its_deadline(tmp_path: Path) -> None:
    result = planned(tmp_path, {"r1": "hall", "r2": "hall"}, {"a": 13, "b": None, "c": None}, [("r1", 0, 14)])
    assert result.timed is not None
    slack = {(slot.step.behavior, slot.step.arguments[1]): slot.slack for slot in result.timed.slots}
    assert {slack["WASH", "a"], slack["GO", "a"]} == {1}


BATTERY = """
:CHARGED a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :charge ; c:leastAmount 0 ; c:mostAmount 3 .
:charge a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Robot ; rdfs:range xsd:integer .
"""
HALL = """
:hall a :Room, owl:NamedIndividual . :yard a :Room, owl:NamedIndividual .
:a a :Room, owl:NamedIndividual . :b a :Room, owl:NamedIndividual .
:r1 a :Robot, owl:NamedIndividual ; :in :yard ; :charge 1 . :k1 a :Charger, owl:NamedIndividual ; :stands :hall .
[] a owl:AllDifferent ; owl:distinctMembers ( :hall :yard :a :b :r1 :k1 ) .
:w a owl:NamedIndividual, c:Window ; c:ofIndividual :k1 ; c:availableUntil "PT10S"^^xsd:dayTimeDuration .
"""


def test_a_battery_is_charged_before_it_is_empty_if_the_charger_is_available_only_then(tmp_path: Path) -> None:
    text = ROBOTS.replace(":CHARGED a owl:Class, owl:NamedIndividual, c:SituationType .", BATTERY)
    text = text.replace(EVER, "DELETE { ?robot :charge ?n }").replace(
        "INSERT { ?room :CLEAN true }", "INSERT { ?room :CLEAN true . ?robot :charge ?m }"
    )
    text = text.replace("; :CHARGED true }", "; :charge ?n . BIND(?n - 1 AS ?m) FILTER(?n >= 1) }")
    text = text.replace("INSERT { ?robot :CHARGED true }", "DELETE { ?robot :charge ?n } INSERT { ?robot :charge ?m }")
    text = text.replace(
        "?charger :stands ?room }", "?charger :stands ?room . ?robot :charge ?n . BIND(?n + 1 AS ?m) FILTER(?n < 3) }"
    )
    (tmp_path / "robots.ttl").write_text(text + HALL, "utf-8")
    result = confab.load(tmp_path / "robots.ttl").plan(["a CLEAN true", "b CLEAN true"])
    assert result.timed is not None
    (charge,) = (slot for slot in result.timed.slots if slot.step.behavior == "CHARGE")
    assert charge.end <= 10


def test_an_export_says_which_times_it_lacks(tmp_path: Path) -> None:
    (tmp_path / "robots.ttl").write_text(ROBOTS, "utf-8")
    done = CliRunner().invoke(app, ["export", str(tmp_path / "robots.ttl"), "-o", str(tmp_path / "pddl")])
    assert done.exit_code == 0 and done.stderr == ""
    bakery = Path(__file__).parents[2] / "docs/examples/bakery/bakery.ttl"
    done = CliRunner().invoke(app, ["export", str(bakery), "-o", str(tmp_path / "bakery")])
    assert "the PDDL has no deadlines" in done.stderr
    levels = Path(__file__).parent / "cases/ovens-in-levels.ttl"
    done = CliRunner().invoke(app, ["export", str(levels), "--level", "1", "-o", str(tmp_path / "upper")])
    assert "the PDDL of an upper level has no durations, deadlines or windows of availability" in done.stderr
    done = CliRunner().invoke(app, ["export", "house-small", "-o", str(tmp_path / "house")])
    assert done.stderr == ""


def test_external_events_of_an_export_happen_at_their_times(tmp_path: Path) -> None:
    problem = imported(parse(TRUCK, WAY)).problem
    (tmp_path / "way.ttl").write_text(turtle(problem, "title", "description"), "utf-8")
    done = CliRunner().invoke(app, ["export", str(tmp_path / "way.ttl"), "-o", str(tmp_path / "pddl")])
    assert done.exit_code == 0 and done.stderr == ""
    assert "(at 10 (open y))" in (tmp_path / "pddl/problem.pddl").read_text()


CUPS = """
@prefix : <https://example.org/cups#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/cups> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Cup a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :AT .
:AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :at .
:at a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Cup ; rdfs:range :AT .
:beside a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :AT ; rdfs:range :AT .
:table a owl:NamedIndividual, :AT ; :beside :shelf . :shelf a owl:NamedIndividual, :AT ; :beside :sink, :table .
:sink a owl:NamedIndividual, :AT ; :beside :shelf .
:cup a owl:NamedIndividual, :Cup ; :at :table .
[] a owl:AllDifferent ; owl:distinctMembers ( :table :shelf :sink :cup ) .
:MOVE a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:duration "PT5S"^^xsd:dayTimeDuration ; c:update '''
  DELETE { ?cup :at ?from } INSERT { ?cup :at ?to }
  WHERE { ?cup a :Cup . ?from a :AT . ?to a :AT . ?from :beside ?to . ?cup :at ?from }''' .
"""
"""A cup that takes 5 s from the table to the shelf, and 10 s to the sink."""


def cups(folder: Path, *goals: str, nodes: str = "") -> confab.Scene:
    """Return a scene with goals about the cup, such as ``:value :shelf``; `nodes` are the nodes that the goals name."""
    said = [f"[] c:about :cup ; c:situationType :AT ; {goal} ." for goal in goals]
    named = [f":g{n} a owl:NamedIndividual, c:ValueCondition ;{one[2:]}" for n, one in enumerate(said)]
    task = ":task a owl:NamedIndividual, c:Task ; c:goal "
    wanted = ", ".join(f":g{n}" for n in range(len(goals)) if not nodes) or ":all"
    (folder / "cups.ttl").write_text("\n".join([CUPS, task + wanted + " .", *named, nodes]), "utf-8")
    return confab.load(folder / "cups.ttl")


def by(seconds: int) -> str:
    return f'c:by "PT{seconds}S"^^xsd:dayTimeDuration'


SOFT_ALL = ":all a owl:NamedIndividual, c:AllOf ; c:weight 2.0 ; c:condition :g0, :g1 ."
HARD_ALL = ":all a owl:NamedIndividual, c:AllOf ; c:condition :g0, :g1 ."
AWAY = "c:value :table ; c:negated true"


def test_a_value_that_must_be_left_by_a_deadline_is_left_by_then_whatever_follows(tmp_path: Path) -> None:
    scene = cups(tmp_path, f"{AWAY} ; {by(5)}", "c:value :sink")
    result = scene.plan()
    assert result.timed is not None
    assert [slot.end for slot in result.timed.slots] == [5, 10]
    assert not result.execute().episode.reasons


def test_a_value_that_cannot_be_left_by_its_deadline_is_named_as_unwanted(tmp_path: Path) -> None:
    assert "not cup AT table is a goal by 4 s" in said(cups(tmp_path, f"{AWAY} ; {by(4)}").plan())


def test_a_part_of_a_conjunction_keeps_its_own_deadline(tmp_path: Path) -> None:
    goals = f"c:value :sink ; {by(9)}", AWAY
    assert "cup AT sink is a goal by 9 s" in said(cups(tmp_path, *goals, nodes=HARD_ALL).plan())


def test_the_deadline_of_a_conjunction_is_the_deadline_of_each_part(tmp_path: Path) -> None:
    goals, nodes = (f"c:value :sink ; {by(20)}", AWAY), HARD_ALL.replace(" .", f" ; {by(9)} .")
    assert "cup AT sink is a goal by 9 s" in said(cups(tmp_path, *goals, nodes=nodes).plan())


@pytest.mark.parametrize("nodes", [SOFT_ALL, SOFT_ALL.replace("c:weight 2.0 ; ", "c:negated true ; ")])
def test_a_deadline_inside_a_goal_that_is_no_conjunction_of_values_is_refused(tmp_path: Path, nodes: str) -> None:
    with pytest.raises(confab.KnowledgeError, match="has a deadline"):
        cups(tmp_path, f"c:value :sink ; {by(20)}", AWAY, nodes=nodes).plan()


def test_two_soft_goals_about_one_symbol_keep_their_own_deadlines(tmp_path: Path) -> None:
    result = cups(
        tmp_path, f"c:value :sink ; c:weight 9.0 ; {by(20)}", f"c:value :shelf ; c:weight 3.0 ; {by(1)}"
    ).plan()
    assert [goal.met for goal in result.soft_goals] == [True, False]
    assert result.plan.primitives[-1].arguments[0] == "cup"


def test_the_deadline_of_a_soft_goal_is_no_deadline_of_a_hard_goal_about_the_same_symbol(tmp_path: Path) -> None:
    result = cups(tmp_path, "c:value :sink", f"c:value :shelf ; c:weight 3.0 ; {by(1)}").plan()
    assert result.solved
    assert [goal.met for goal in result.soft_goals] == [False]


@pytest.mark.parametrize(("seconds", "met"), [(9, False), (10, True)])
def test_a_soft_goal_that_is_reached_after_its_deadline_is_unmet(tmp_path: Path, seconds: int, met: bool) -> None:
    result = cups(tmp_path, "c:value :sink", f"c:value :sink ; c:weight 3.0 ; {by(seconds)}").plan()
    assert [goal.met for goal in result.soft_goals] == [met]
    assert [goal.met for goal in result.execute().soft_goals] == [met]


def test_a_goal_of_a_call_has_no_deadline_from_the_goal_that_it_replaces(tmp_path: Path) -> None:
    assert cups(tmp_path, f"c:value :shelf ; {by(1)}").plan("cup AT sink").solved
