"""Every plan that a command returns is valid for the whole scene, although only a part of the scene was read for planning."""

from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

import confab
from confab.checking import refused
from confab.planner.plan import Plan, Status, Step
from confab.planner.solve import Mode
from confab.planner.validation import Fault, carried_out, successor, validate
from confab.reasoner.graph.knowledge import KnowledgeError, load
from confab.reasoner.language import DomainError
from confab.reasoner.problem import Problem
from confab.reasoner.reading import relevance
from confab.reasoner.reading.problem import read
from confab.reasoner.reading.rows import Triple
from confab.reasoner.reading.surroundings import Surroundings
from confab.reasoner.symbols import State
from tests.reasoner.test_recognition_of_totals import SUM, yard
from tests.reasoner.worlds import graph_of, worlds

CASES = Path(__file__).parent / "cases"
MODES = ("guarded", "strict", "optimal", "paper")


@pytest.mark.parametrize("mode", MODES)
def test_an_effect_on_a_class_requires_the_bounds_of_each_of_its_amounts(mode: Mode) -> None:
    result = confab.load(CASES / "lamps.ttl").plan(mode=mode)
    assert [step.behavior for step in result.plan.steps] == ["FILL", "BURN"]
    assert result.outcome.bound in (None, 2)


@pytest.mark.parametrize("mode", MODES)
def test_a_bound_that_no_plan_keeps_makes_the_task_unsolvable(mode: Mode) -> None:
    assert confab.load(CASES / "lamps-without-oil.ttl").plan(mode=mode).outcome.status is Status.UNSOLVABLE


@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
def test_members_of_a_class_that_an_effect_changes_must_come_to_rest_in_stretches_too(mode: Mode) -> None:
    """The goal requires that one member of the class isn't at rest.

    The effect changes the other members, too, and no behaviour restores them.
    """
    scene = confab.load(CASES / "rest-of-a-class.ttl")
    assert scene.plan(mode=mode).outcome.status is Status.UNSOLVABLE
    step = Step((0,), scene.problem.id_of("L2_0", ("b4", "b4")), 2, "L2_0", ("b4", "b4"))
    stretch = f"the stretch from {step} to {step}"
    assert [fault.text for fault in validate(scene.problem, Plan((step,)))] == [
        f"{stretch} touches <{one}, P0> and leaves it true; at rest it is false" for one in ("a2", "a3")
    ]


class Forgetful:
    """Task recognition with a fault: it loses one of the individuals that no goal or behaviour names, or none if `lost` is None."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.lost: int | None = None
        close = relevance._RouteSearch.close

        def closed(
            search: relevance._RouteSearch, fresh: list[Triple], constants: set[str], bounds: relevance.Routes
        ) -> None:
            close(search, fresh, constants, bounds)
            if self.lost is not None and (found := sorted(search.seen - {s for s, _, _ in fresh})):
                search.seen.remove(found[self.lost % len(found)])

        patch.setattr(relevance._RouteSearch, "close", closed)


@pytest.fixture(scope="module")
def forgetful() -> Iterator[Forgetful]:
    """Recognition that leaves out an individual."""
    with pytest.MonkeyPatch.context() as patch:
        yield Forgetful(patch)


def walk(problem: Problem, chance: Random) -> Plan:
    """Return a plan of up to three steps that are applicable one after another."""
    state: State = problem.initial
    steps: list[Step] = []
    behaviors = [*problem.domain.behaviors.values()]
    for _ in range(200):
        behavior = chance.choice(behaviors)
        members = [problem.classes.get(p.kind, ()) for p in behavior.parameters]
        if len(steps) == 3 or not all(members):
            continue
        arguments = tuple(map(chance.choice, members))
        if (after := successor(problem, behavior, arguments, state)) is not None:
            number = problem.id_of(behavior.name, arguments)
            steps.append(Step((len(steps),), number, behavior.level, behavior.name, arguments))
            state = after
    return Plan(tuple(steps))


@settings(max_examples=30)
@given(text=worlds(), seed=st.integers(0, 1000))
def test_a_plan_is_refused_exactly_if_it_is_invalid_in_the_whole_scene(
    forgetful: Forgetful, text: str, seed: int
) -> None:
    """If recognition loses an individual, the scene refuses a plan exactly if the plan is invalid in the whole scene."""
    with TemporaryDirectory() as folder:
        graph = graph_of(text, Path(folder))
    whole = read(graph)
    forgetful.lost = seed
    try:
        part = relevance.recognise(graph)
        plan = walk(part.problem, Random(seed))
    except (KnowledgeError, DomainError):
        return
    finally:
        forgetful.lost = None
    expected = carried_out(whole.problem, plan)
    faults = carried_out(part.problem, plan)
    event("a plan in the slice alone" if expected and not faults else "the same")
    event("can be done" if all(fault.path == () for fault in expected) else "can't be done")
    assert refused(graph, part, plan) == expected


def test_a_refused_plan_is_replaced_by_a_plan_for_the_whole_scene(forgetful: Forgetful) -> None:
    scene = confab.load(CASES / "lamps.ttl")
    forgetful.lost = 0
    try:
        result = scene.plan()
    finally:
        forgetful.lost = None
    assert [step.behavior for step in result.plan.steps] == ["FILL", "BURN"]
    assert not validate(result.problem, result.plan)


def test_a_goal_on_a_class_is_achieved_for_all_members_even_if_recognition_loses_one(
    forgetful: Forgetful, tmp_path: Path
) -> None:
    text = (CASES / "lamps.ttl").read_text(encoding="utf-8").replace("c:about :lamp2 ;", "c:about :Lamp ;")
    (tmp_path / "lamps.ttl").write_text(text.replace(":hours 2 .", ":hours 3 ."), encoding="utf-8")
    forgetful.lost = 1
    try:
        result = confab.load(tmp_path / "lamps.ttl").plan(mode="strict")
    finally:
        forgetful.lost = None
    assert len(result.problem.goal) == 2
    assert not validate(result.problem, result.plan)


def test_another_order_is_checked_in_the_whole_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    result = confab.load("living-room").plan()
    assert result.part is not None and result.in_order(*(step.id for step in result.plan.steps)) == result.plan
    monkeypatch.setattr("confab.planning.refused", lambda *_: [Fault((), "it breaks a bound")])
    with pytest.raises(KnowledgeError, match="it breaks a bound"):
        result.in_order(*(step.id for step in result.plan.steps))


def test_an_alternative_may_name_any_individual_of_the_whole_scene(tmp_path: Path) -> None:
    scene = confab.generate("served", tmp_path / "table.ttl", objects=4, clutter=5, seed=1)
    result = scene.plan()
    assert "thing1" in scene.problem.individuals - result.problem.individuals
    assert "no behaviour that changes" in result.why_not("cup1 LOCATION location7 by thing1").answer
    told = result.why_not("cup1 LOCATION location7 by hand2")
    assert told.plan is not None
    assert not validate(result.in_whole_scene().problem, told.plan)


@pytest.mark.parametrize("mode", MODES)
def test_a_goal_without_a_definition_is_refused_by_name(mode: Mode, tmp_path: Path) -> None:
    text = (CASES / "lamps.ttl").read_text(encoding="utf-8")
    (tmp_path / "lamps.ttl").write_text(text.replace("c:goal :task.g .", "c:goal :task.g, :task.h ."), encoding="utf-8")
    with pytest.raises(KnowledgeError, match=r"task\.h"):
        confab.load(tmp_path / "lamps.ttl").plan(mode=mode)


EMPTIES = """:TOTAL c:mostAmount 1.0 . :train2 a owl:NamedIndividual, :Train ; :pulls :cart2, :cart10 .
:TOTAL.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?train :total ?n } WHERE {
  SELECT ?train (COUNT(?cart) AS ?n) WHERE { ?train a :Train ; :pulls ?cart . ?cart a :Cart
    FILTER NOT EXISTS { ?crate a :Crate ; :in ?cart } } GROUP BY ?train }\"\"\" .
"""
LONG = """:TOTAL.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?train :total ?n } WHERE {
  SELECT ?train (SUM(?load) AS ?n) WHERE { ?train a :Train ; :pulls ?cart . ?cart a :Cart ; :load ?load } GROUP BY ?train }\"\"\" .
:Train c:hasSituationType :LONG . :LONG a owl:Class, owl:NamedIndividual, c:SituationType ; c:never true .
:LONG.rule a owl:NamedIndividual, c:Rule ; c:construct \"\"\"CONSTRUCT { ?train :LONG true }
  WHERE { ?train a :Train ; :total ?n FILTER(?n > 1) }\"\"\" .
"""
FURTHER = "".join(
    f":cart{i}0 a owl:NamedIndividual, :Cart . :train{i}0 a owl:NamedIndividual, :Train ; :pulls :cart{i}0 .\n"
    for i in range(1, 9)
)


@pytest.mark.parametrize(
    ("more", "step", "trains"),
    [
        (SUM, ("crate1", "cart1"), 1),
        (SUM.replace("SUM(?load)", "SUM(2 * ?load)").replace("1.0", "3.0"), ("crate1", "cart1"), 1),
        (EMPTIES, ("crate2", "cart1"), 2),
        (LONG, ("crate1", "cart1"), 9),
    ],
)
def test_bounds_and_constraints_hold_for_the_totals_of_individuals_that_recognition_does_not_read(
    more: str, step: tuple[str, str], trains: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph, close = load(yard(tmp_path, more, FURTHER)), relevance._RouteSearch.close

    def closed(search: relevance._RouteSearch, *rest: Any) -> None:
        close(search, *rest)
        search.seen -= {one for one in search.seen if "train" in one}

    with monkeypatch.context() as patch:
        patch.setattr(relevance._RouteSearch, "close", closed)
        part = relevance.recognise(graph)
    plan = Plan((Step((0,), part.problem.id_of("PUT", step), 1, "PUT", step),))
    read_by_check = set[str]()
    problem = Surroundings.problem

    def read_problem(around: Surroundings) -> Problem:
        found = problem(around)
        read_by_check.update(found.individuals)
        return found

    monkeypatch.setattr(Surroundings, "problem", read_problem)
    assert not [fault for fault in carried_out(part.problem, plan) if fault.path]
    assert refused(graph, part, plan) == carried_out(read(graph).problem, plan)
    assert [fault for fault in refused(graph, part, plan) if fault.path]
    assert len([one for one in read_by_check if "train" in one]) == trains
