"""Tasks about switches in time: external events, soft goals with a makespan, and values that a step gives only for a while."""

from pathlib import Path

import pytest

import confab
from confab.planner.plan import Status
from confab.timing import headline

HEAD = """
@prefix : <https://example.org/switches#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/switches> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Switch a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :ON .
:Worker a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
:Tank a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :LEVEL .
:ON a owl:Class, owl:NamedIndividual, c:SituationType .
:LEVEL a owl:NamedIndividual, c:SituationType, c:Amount ; c:valueProperty :level .
:level a owl:DatatypeProperty, owl:FunctionalProperty, owl:NamedIndividual ; rdfs:domain :Tank ; rdfs:range xsd:decimal .
:a a owl:NamedIndividual, :Switch . :a2 a owl:NamedIndividual, :Switch .
:b a owl:NamedIndividual, :Switch . :b2 a owl:NamedIndividual, :Switch .
:u a owl:NamedIndividual, :Worker . :v a owl:NamedIndividual, :Worker . :tank a owl:NamedIndividual, :Tank ; :level 0 .
[] a owl:AllDifferent ; owl:distinctMembers ( :a :a2 :b :b2 :u :v :tank ) .
:a.on a owl:NamedIndividual, c:SituatedObjectInstance ; c:about :a ; c:situationType :ON .
"""


def node(name: str, kind: str, about: str = "", more: str = "") -> str:
    said = f" ; c:about :{about} ; c:situationType :ON" if about else ""
    return f":{name} a owl:NamedIndividual, c:{kind}{said}{more} .\n"


def lasts(seconds: int, prop: str = "duration") -> str:
    return f' ; c:{prop} "PT{seconds}S"^^xsd:dayTimeDuration'


def load(folder: Path, *parts: str) -> confab.Scene:
    (folder / "switches.ttl").write_text(HEAD + "".join(parts), "utf-8")
    return confab.load(folder / "switches.ttl")


FIRST = " ; c:level 1 ; c:index 1"
WORK = (
    node("WORK", "Behavior", "", f"{FIRST} ; c:actor :u ; c:precondition :needs ; c:postcondition :works{lasts(10)}")
    + node("needs", "ValueCondition", "a")
    + node("works", "ValueEffect", "b")
)
"""A step of 10 s that turns b on; a must be on throughout."""
DONE = node("task", "Task", "", " ; c:goal :done") + node("done", "ValueCondition", "b")


@pytest.mark.parametrize(("seconds", "status"), [(5, Status.GAVE_UP), (10, Status.SOLVED), (12, Status.SOLVED)])
def test_an_external_event_happens_although_no_goal_needs_it(seconds: int, status: Status, tmp_path: Path) -> None:
    shut = node("SHUT", "Behavior", "", f"{FIRST} ; c:postcondition :off{lasts(0)}{lasts(seconds, 'happensAt')}")
    off = node("off", "ValueEffect", "a", " ; c:negated true")
    outcome = load(tmp_path, WORK, shut.replace("index 1", "index 2"), off, DONE).plan(minimise="makespan").outcome
    assert outcome.status is status
    assert (f"SHUT happens at {seconds} s" in str(outcome.reason)) is (status is Status.GAVE_UP)


@pytest.mark.parametrize("stated", [False, True])
def test_level_1_needs_a_behaviour_that_an_event_refines_if_its_steps_require_the_event(
    stated: bool, tmp_path: Path
) -> None:
    event = node(
        "OPEN", "Behavior", "", f" ; c:level 2 ; c:index 2 ; c:postcondition :opens{lasts(0)}{lasts(4, 'happensAt')}"
    )
    work = WORK.replace("level 1", "level 2") + node("OPENED", "ValueCondition", "b2")
    work = work.replace("c:precondition :needs", "c:precondition :needs, :OPENED")
    upper = node("BEGIN", "Behavior", "", f"{FIRST} ; c:precondition :OPENED ; c:postcondition :begins")
    upper += node("begins", "ValueEffect", "b") + node("opens", "ValueEffect", "b2")
    wait = node("WAIT", "Behavior", "", " ; c:level 1 ; c:index 2 ; c:postcondition :opens") if stated else ""
    result = load(tmp_path, work, upper, event, wait, DONE).plan()
    assert [step.behavior for step in result.plan.primitives] == ["OPEN", "WORK"]
    assert [step.behavior for step in result.plan.steps] == (["WAIT", "BEGIN"] if stated else ["OPEN", "WORK"])


def test_an_event_that_changes_nothing_is_a_step_of_the_plan_above_any_level(tmp_path: Path) -> None:
    event = node(
        "OPEN", "Behavior", "", f" ; c:level 2 ; c:index 2 ; c:postcondition :opens{lasts(0)}{lasts(4, 'happensAt')}"
    )
    upper = node("BEGIN", "Behavior", "", f"{FIRST} ; c:postcondition :begins") + node("begins", "ValueEffect", "b")
    scene = load(tmp_path, WORK.replace("level 1", "level 2"), upper, event, node("opens", "ValueEffect", "b2"), DONE)
    result = scene.plan(minimise="makespan")
    assert [step.behavior for step in result.plan.primitives] == ["WORK", "OPEN"]
    assert [step.behavior for step in result.plan.steps] == ["BEGIN", "OPEN"]
    assert "undo each other" not in result.dearer()
    assert not result.outcome.left


def happening(name: str, seconds: int, effect: str, about: str, more: str = "") -> str:
    """Return an external event without duration that turns a switch on, or off with `more`."""
    said = f" ; c:level 1 ; c:index {seconds + 2} ; c:postcondition :{effect}{lasts(0)}{lasts(seconds, 'happensAt')}"
    return node(name, "Behavior", "", said) + node(effect, "ValueEffect", about, more)


OFF = " ; c:negated true"


@pytest.mark.parametrize(
    ("first", "second", "order", "makespan"),
    [
        (("b2", ""), ("b2", OFF), ["WORK", "E2", "E4"], 10),  # neither matters to the step
        (("b", OFF), ("b2", ""), ["E2", "WORK", "E4"], 12),  # the step waits for the first event
        (("a", OFF), ("a", ""), ["E2", "E4", "WORK"], 14),  # the step waits until the second event undoes the first
    ],
)
def test_the_steps_of_a_plan_wait_for_external_events_that_it_needs_not(
    first: tuple[str, str], second: tuple[str, str], order: list[str], makespan: int, tmp_path: Path
) -> None:
    events = happening("E2", 2, "two", *first), happening("E4", 4, "four", *second)
    timed = load(tmp_path, WORK, *events, DONE).plan().timed
    assert timed is not None
    assert [slot.step.behavior for slot in timed.slots] == order
    assert timed.makespan == makespan


@pytest.mark.parametrize(("lasting", "begin"), [(1, 2), (3, 9), (10, 14)])
def test_a_step_waits_for_an_event_after_its_end_if_an_earlier_event_ends_what_it_needs(
    lasting: int, begin: int, tmp_path: Path
) -> None:
    """What the step needs holds from 2 to 4 s, from 9 to 12 s, and from 14 s on."""
    times = ((2, ""), (4, OFF), (9, ""), (12, OFF), (14, ""))
    events = (happening(f"E{at}", at, f"e{at}", "a", more) for at, more in times)
    dark = HEAD[: HEAD.index(":a.on")] + WORK.replace("PT10S", f"PT{lasting}S")
    (tmp_path / "switches.ttl").write_text(dark + "".join(events) + DONE, "utf-8")
    timed = confab.load(tmp_path / "switches.ttl").plan().timed
    assert timed is not None
    assert [slot.begin for slot in timed.slots if slot.step.behavior == "WORK"] == [begin]


@pytest.mark.parametrize("given", ["", OFF])
def test_external_events_at_the_same_instant_have_either_order(given: str, tmp_path: Path) -> None:
    """The event that the goal needs is possible before the other event, or after it."""
    first = happening("E1", 5, "one", "b").replace("c:postcondition", "c:precondition :asked ; c:postcondition")
    other = happening("E2", 5, "two", "a", given).replace("index 7", "index 8")
    dark = HEAD if given else HEAD[: HEAD.index(":a.on")]
    (tmp_path / "switches.ttl").write_text(dark + first + other + node("asked", "ValueCondition", "a") + DONE, "utf-8")
    timed = confab.load(tmp_path / "switches.ttl").plan().timed
    assert timed is not None
    assert [slot.step.behavior for slot in timed.slots] == (["E1", "E2"] if given else ["E2", "E1"])


@pytest.mark.parametrize(("seconds", "status"), [(3, Status.GAVE_UP), (7, Status.SOLVED)])
def test_a_plan_that_ends_with_an_external_event_contains_all_earlier_events(
    seconds: int, status: Status, tmp_path: Path
) -> None:
    goals = node("task", "Task", "", " ; c:goal :lit, :given") + node("lit", "ValueCondition", "a")
    goals += node("given", "ValueCondition", "b2")
    events = happening("E5", 5, "five", "b2"), happening("DARK", seconds, "dark", "a", OFF)
    assert load(tmp_path, *events, goals).plan().outcome.status is status


def test_a_soft_goal_that_an_external_event_undoes_is_unmet(tmp_path: Path) -> None:
    goals = node("task", "Task", "", " ; c:goal :done, :soft") + node("done", "ValueCondition", "b")
    soft = node("soft", "ValueCondition", "a2", " ; c:weight 3") + HEAD.splitlines()[-1].replace(":a.", ":a2.").replace(
        ":a ;", ":a2 ;"
    )
    outcome = load(tmp_path, WORK, happening("E5", 5, "five", "a2", OFF), goals, soft).plan().outcome
    assert outcome.status is Status.SOLVED
    assert [str(one.fact) for one in outcome.forgone] == ["a2 ON true"]


REPAIR = node(
    "REPAIR", "Behavior", "", f" ; c:level 1 ; c:index 9 ; c:actor :v ; c:postcondition :repaired{lasts(1)}"
) + node("repaired", "ValueEffect", "a")


def executed(execution: confab.Execution) -> list[tuple[str, float, float, bool]]:
    return [(event.step.behavior, event.begin, event.end, event.ok) for event in execution.episode.events]


def test_an_external_event_stops_a_late_step_that_needs_what_the_event_changes(tmp_path: Path) -> None:
    goals = node("task", "Task", "", " ; c:goal :done, :dark") + node("done", "ValueCondition", "b")
    goals += node("dark", "ValueCondition", "a", OFF)
    scene = load(tmp_path, WORK, happening("E12", 12, "twelve", "a", OFF), goals)
    assert scene.execute().reached
    late = scene.execute(perturb=True, seed=2)
    assert executed(late)[:2] == [("WORK", 0.0, 12.0, False), ("E12", 12.0, 12.0, True)]
    assert not late.reached


def test_an_external_event_after_the_end_of_the_plan_stops_a_late_step(tmp_path: Path) -> None:
    """The plan ends before the event, and doesn't contain it; the late step needs what the event changes."""
    dark = happening("DARK", 12, "dark", "a", OFF)
    scene = load(tmp_path, WORK, dark, DONE)
    assert scene.execute().reached
    late = scene.execute(perturb=True, seed=2)
    assert not late.reached
    assert [(one.step.behavior, one.ok) for one in late.episode.events] == [("WORK", False), ("DARK", True)]
    again = load(tmp_path, WORK, dark, REPAIR, DONE).execute(perturb=True, seed=2)
    assert again.reached
    assert [one.step.behavior for one in again.episode.events if one.ok] == ["DARK", "REPAIR", "WORK"]


def test_an_external_event_after_the_end_of_the_plan_lets_a_late_step_go_on_that_it_doesnt_concern(
    tmp_path: Path,
) -> None:
    late = load(tmp_path, WORK, happening("LIT", 12, "lit", "b2"), DONE).execute(perturb=True, seed=2)
    assert late.reached
    assert [one.step.behavior for one in late.episode.events] == ["WORK", "LIT"]
    assert late.episode.events[0].end > late.episode.events[1].begin == 12


@pytest.mark.parametrize("seconds", [8, 12, 20])
def test_new_steps_of_an_episode_take_place_beside_external_events(seconds: int, tmp_path: Path) -> None:
    scene = load(tmp_path, WORK, REPAIR, happening("EVENT", seconds, "b2.on", "b2"), DONE)
    execution = scene.execute(interventions=["at=5 a ON false"])
    assert execution.reached
    happened = [("EVENT", seconds, seconds, True)] if seconds < 16 else []
    worked = [("WORK", 0.0, 5.0, False), ("REPAIR", 5.0, 6.0, True), ("WORK", 6.0, 16.0, True)]
    assert executed(execution) == [*worked, *happened]


LIGHT = """
:LIGHT a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:actor :LIGHT.worker ; c:duration "PT10S"^^xsd:dayTimeDuration ;
  c:update "INSERT { ?switch :ON true } WHERE { ?worker a :Worker . ?switch a :Switch . ?switch :ON false }" .
:day a owl:NamedIndividual, c:Window ; c:ofIndividual :u ; c:availableUntil "PT12S"^^xsd:dayTimeDuration .
:night a owl:NamedIndividual, c:Window ; c:ofIndividual :v ; c:availableFrom "PT20S"^^xsd:dayTimeDuration .
"""


def test_other_actors_are_sought_if_the_steps_of_a_new_plan_have_no_schedule(tmp_path: Path) -> None:
    execution = load(tmp_path, LIGHT, DONE).execute(interventions=["at=3 goal b2 ON true"])
    assert execution.reached
    lit = [(*event.step.arguments, event.begin) for event in execution.episode.events]
    assert lit == [("u", "b", 0), ("v", "b2", 20)]
    assert any(change.because == "the steps had no schedule" for change in execution.episode.replans)


def test_an_episode_begins_no_step_after_it_has_given_up(tmp_path: Path) -> None:
    """The step for the third goal is executed; the event is over when a person has undone what it changed."""
    last = node(
        "LAST",
        "Behavior",
        "",
        f" ; c:level 1 ; c:index 8 ; c:actor :v ; c:precondition :done ; c:postcondition :a2.on{lasts(10)}",
    )
    goals = node("task", "Task", "", " ; c:goal :done, :dark, :last") + node("done", "ValueCondition", "b")
    goals += (
        node("dark", "ValueCondition", "a", OFF)
        + node("last", "ValueCondition", "a2")
        + node("a2.on", "ValueEffect", "a2")
    )
    scene = load(tmp_path, WORK, REPAIR, last, happening("E12", 12, "twelve", "a", OFF), goals)
    execution = scene.execute(interventions=["at=13 a ON true"])
    assert [name for name, *_ in executed(execution)] == ["WORK", "LAST", "E12"]
    assert "it happens only once, at 12 s" in str(execution.episode.reasons[0])


@pytest.mark.parametrize("proved", [False, True])
@pytest.mark.parametrize(("wanted", "status"), [(1, Status.SOLVED), (2, Status.GAVE_UP)])
def test_an_external_event_happens_only_once(wanted: int, status: Status, proved: bool, tmp_path: Path) -> None:
    delivery = node("DELIVERY", "Behavior", "", f"{FIRST} ; c:postcondition :more{lasts(0)}{lasts(5, 'happensAt')}")
    tank = "c:about :tank ; c:situationType :LEVEL"
    more = f":more a owl:NamedIndividual, c:AmountEffect ; {tank} ; c:change 'increase' ; c:amount 1 ."
    goal = f":full a owl:NamedIndividual, c:Comparison ; {tank} ; c:sign '>=' ; c:amount {wanted} ."
    outcome = (
        load(tmp_path, delivery, more, goal, node("task", "Task", "", " ; c:goal :full")).plan(optimal=proved).outcome
    )
    assert outcome.status is status
    assert ("happens only once, at 5 s" in str(outcome.reason)) is (status is Status.GAVE_UP)


def test_a_makespan_is_no_bound_of_plans_that_leave_a_soft_goal_unmet(tmp_path: Path) -> None:
    parts = [
        node(name.upper(), "Behavior", "", f" ; c:level 1 ; c:index {n} ; c:postcondition :{name}.on{lasts(9 * n)}")
        + node(f"{name}.on", "ValueEffect", name)
        for n, name in ((1, "b"), (2, "b2"))
    ]
    goals = node("task", "Task", "", " ; c:goal :hard, :soft") + node("hard", "ValueCondition", "b")
    for weight, bounded in (("", True), (" ; c:weight 50", False)):
        timed = (
            load(tmp_path, *parts, goals, node("soft", "ValueCondition", "b2", weight)).plan(minimise="makespan").timed
        )
        assert timed is not None
        assert bool(timed.least) is bounded
        assert ("no plan is shorter" in headline(timed)) is bounded


def blinking(name: str, level: int, more: str = "") -> str:
    """Return a behaviour of 4 s that keeps a switch on and then turns its second switch on."""
    ends = f"{name}.starts, :{name}.ends, :{name}.off"
    return (
        node(
            name.upper(),
            "Behavior",
            "",
            f" ; c:level {level} ; c:index {ord(name) - 96} ; c:postcondition :{ends}{lasts(4)}{more}",
        )
        + node(f"{name}.starts", "ValueEffect", name, " ; c:during c:atStart")
        + node(f"{name}.ends", "ValueEffect", f"{name}2", " ; c:during c:atEnd")
        + node(f"{name}.off", "ValueEffect", name, " ; c:negated true ; c:during c:atEnd")
    )


def test_steps_whose_values_for_a_while_no_other_step_needs_may_have_soft_goals(tmp_path: Path) -> None:
    goals = node("task", "Task", "", " ; c:goal :hard, :soft") + node("hard", "ValueCondition", "a2")
    scene = load(
        tmp_path, blinking("a", 1), blinking("b", 1), goals, node("soft", "ValueCondition", "b2", " ; c:weight 3")
    )
    result = scene.plan()
    assert result.outcome.status is Status.SOLVED
    assert sorted(step.behavior for step in result.plan.primitives) == ["A", "B"]


def test_steps_that_a_constraint_keeps_apart_need_no_overlap(tmp_path: Path) -> None:
    """A constraint on what holds during two steps of the lowest level isn't a need of one step for the other."""
    never = """
:ON c:fromLevel 2 . :versus a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Switch ; rdfs:range :Switch .
:Switch c:hasSituationType :READY, :CLASH . :READY a owl:Class, owl:NamedIndividual, c:SituationType .
:CLASH a owl:Class, owl:NamedIndividual, c:SituationType ; c:fromLevel 2 ; c:never true . :a :versus :b .
:CLASH.rule a owl:NamedIndividual, c:Rule ; c:construct '''
    CONSTRUCT { ?x :CLASH true } WHERE { ?x a :Switch ; :ON true ; :versus ?y . ?y a :Switch ; :ON true }''' .
"""
    steps, goals = "", node("task", "Task", "", " ; c:goal :a.ready, :b.ready")
    for n, name in enumerate("ab", 1):
        made = node(f"{name}.ends", "ValueEffect", f"{name}2", " ; c:during c:atEnd").replace(":ON", ":READY")
        steps += blinking(name, 2).replace(node(f"{name}.ends", "ValueEffect", f"{name}2", " ; c:during c:atEnd"), made)
        steps += node(f"UP{n}", "Behavior", "", f" ; c:level 1 ; c:index {n} ; c:postcondition :{name}.up")
        steps += node(f"{name}.up", "ValueEffect", f"{name}2").replace(":ON", ":READY")
        goals += node(f"{name}.ready", "ValueCondition", f"{name}2").replace(":ON", ":READY")
    (tmp_path / "switches.ttl").write_text(HEAD[: HEAD.index(":a.on")] + never + steps + goals, "utf-8")
    timed = confab.load(tmp_path / "switches.ttl").plan(minimise="makespan").timed
    assert timed is not None
    assert timed.makespan == 8
