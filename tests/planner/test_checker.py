"""The plan checker's evaluation of each kind of condition and effect, in worlds so small that the answer is obvious."""

from dataclasses import replace
from fractions import Fraction

import pytest

from confab.planner.grounded.best_first import plan_level
from confab.planner.plan import Plan, Step
from confab.planner.validation import BehaviorReader, LoggedState, stretches, successor, validate
from confab.reasoner.amounts import Amount, Quantity
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    ClassCondition,
    Condition,
    EqualityCondition,
    RelationCondition,
    SituationType,
    Symbol,
    ValueCondition,
    Witness,
)
from tests.planner.naive import tabletop
from worlds.writing import becomes, behavior, has, lacks, world


def shelves(*conditions: Condition, variables: str = "", terms: str = "?c:Cup") -> Problem:
    """Return a problem with three cups on two shelves, one of the cups full, and with a behaviour that has the given conditions."""
    return world(
        [
            SituationType("AT", ("Cup",), "Place"),
            SituationType("FULL", ("Cup",), "Truth", boolean=True),
            SituationType("NEAR", ("Cup", "Place"), "Truth", boolean=True),
        ],
        [behavior("DO", 1, terms, conditions, [becomes("FULL", "?c", TRUE)], variables)],
        {"Cup": ("cup1", "cup2", "cup3"), "Place": ("high", "low", "floor"), "Bowl": ("cup3",)},
        {"AT cup1": "high", "AT cup2": "low", "AT cup3": "low", "FULL cup2": TRUE, "NEAR cup1 low": TRUE},
        {},
        {"above": [("high", "low"), ("low", "floor")], "self": [("low", "low")], "likes": [("cup1", "low")]},
    )  # fmt: skip


def done(problem: Problem) -> str:
    """Return the numbers of the cups for which the behaviour is applicable."""
    do = problem.domain.behaviors["DO"]
    rest = tuple(problem.classes[p.kind][0] for p in do.parameters[1:])
    return "".join(
        cup[-1] for cup in problem.classes["Cup"] if successor(problem, do, (cup, *rest), problem.initial) is not None
    )


P, Q = "?p:Place", "?p:Place ?q:Place"


@pytest.mark.parametrize(
    ("conditions", "variables", "cups"),
    [
        ([], "", "123"),
        ([has("AT", "?c", "low")], "", "23"),
        ([lacks("AT", "?c", "low")], "", "1"),
        ([has("FULL", "?c", TRUE)], "", "2"),
        ([has("FULL", "?c", FALSE)], "", "13"),
        ([lacks("FULL", "?c", FALSE)], "", "2"),
        ([has("NEAR", "?c", "low", TRUE)], "", "1"),
        ([has("NEAR", "?c", "?p", TRUE)], P, "1"),
        ([has("NEAR", "?c", "?p", FALSE), has("AT", "?c", "?p")], P, "123"),
        ([has("NEAR", "?c", "cup1", FALSE)], "", ""),  # nothing is true of a nonexistent symbol
        ([lacks("NEAR", "?c", "cup1", FALSE)], "", "123"),
        ([ClassCondition("?c", "Bowl")], "", "3"),
        ([ClassCondition("?c", "Bowl", True)], "", "12"),
        ([ClassCondition("?c", "Pan")], "", ""),
        ([EqualityCondition("?c", "cup2")], "", "2"),
        ([EqualityCondition("?c", "cup2", True)], "", "13"),
        ([has("AT", "?c", "?p"), RelationCondition("above", ("?p", "floor"))], P, "23"),
        ([has("AT", "?c", "?p"), RelationCondition("above", ("?p", "floor"), True)], P, "1"),
        (
            [
                has("AT", "?c", "?p"),
                RelationCondition("above", ("?p", "?q")),
                RelationCondition("above", ("?q", "floor")),
            ],
            Q,
            "1",
        ),
        ([has("AT", "?c", "?p"), RelationCondition("above", ("?q", "?p"))], Q, "23"),
        ([has("AT", "?c", "?p"), RelationCondition("self", ("?p", "?p"))], P, "23"),
        ([RelationCondition("self", ("?p", "?p")), has("AT", "?c", "?p")], P, "23"),
        ([RelationCondition("none", ("?c",))], "", ""),
        ([has("AT", "?c", "?p")], "?p:Bowl", ""),  # the determined individual must belong to the class
        ([has("AT", "?d", "?p"), has("FULL", "?d", TRUE), has("AT", "?c", "?p")], "?d:Cup ?p:Place", "23"),
        ([has("AT", "?d", "high"), EqualityCondition("?d", "?c", True)], "?d:Cup", "23"),
        ([lacks("AT", "?c", "?p"), lacks("AT", "cup1", "?p")], P, "123"),
        ([Witness("?x", "Cup", (has("AT", "?x", "?p"), has("FULL", "?x", TRUE))), has("AT", "?c", "?p")], P, "23"),
        ([Witness("?x", "Cup", (has("AT", "?x", "?p"), has("FULL", "?x", TRUE)), True), has("AT", "?c", "?p")], P, "1"),
        ([Witness("?x", "Bowl", (has("AT", "?x", "?p"), has("AT", "?c", "?p")))], P, "23"),
        ([Witness("?c", "Bowl", ())], "", "123"),  # this ?c is a different variable
        ([AnyOf(((has("FULL", "?c", TRUE),), (has("AT", "?c", "high"),)))], "", "12"),
        ([AnyOf(((has("FULL", "?c", TRUE),), (has("AT", "?c", "high"),)), True)], "", "3"),
        (
            [AnyOf(((has("AT", "?c", "?p"), RelationCondition("above", ("?p", "floor"))), (has("FULL", "?c", TRUE),)))],
            P,
            "23",
        ),
        ([AnyOf(())], "", ""),
        ([AnyOf((), True)], "", "123"),
        ([AnyOf(((),))], "", "123"),
        ([lacks("AT", "?d", "low"), EqualityCondition("?d", "?c")], "?d:Cup", "1"),
        ([has("FULL", "?d", FALSE), EqualityCondition("?d", "?c")], "?d:Cup", "13"),
        ([has("AT", "?d", "low"), EqualityCondition("?d", "?c")], "?d:Cup", "23"),
        ([RelationCondition("likes", ("?d", "?p")), has("AT", "?c", "?p")], "?d:Cup ?p:Place", "23"),
        ([RelationCondition("likes", ("?d", "?p"))], "?d:Cup ?p:Place", "123"),
        ([RelationCondition("likes", ("?d", "?p"))], "?d:Place ?p:Cup", ""),
        # A choice inside a condition has no effect outside the condition.
        ([AnyOf(((has("AT", "?c", "?p"),),)), has("AT", "cup1", "?p")], P, "1"),
    ],
)
def test_a_behaviour_is_applicable_exactly_if_its_conditions_hold(
    conditions: list[Condition], variables: str, cups: str
) -> None:
    assert done(shelves(*conditions, variables=variables)) == cups
    assert done(shelves(*reversed(conditions), variables=variables)) == cups


def test_arguments_must_have_the_number_and_classes_of_the_parameters() -> None:
    problem = shelves(terms="?c:Cup ?p:Place")
    do = problem.domain.behaviors["DO"]
    assert successor(problem, do, ("cup1", "low"), problem.initial) is not None
    for wrong in ((), ("cup1",), ("low", "cup1"), ("cup1", "low", "low"), ("cup1", "cup2")):
        assert successor(problem, do, wrong, problem.initial) is None


def test_a_conditional_effect_is_applied_if_its_condition_held_before_the_step() -> None:
    effects = [
        becomes("AT", "?c", "?q", when=(has("AT", "?c", "?p"), RelationCondition("above", ("?p", "?q")))),
        becomes("FULL", "?c", FALSE, when=(has("FULL", "?c", TRUE),)),
        becomes("FULL", "?c", TRUE, when=(has("FULL", "?c", FALSE),)),
        becomes("NEAR", "?c", "cup1", TRUE),
    ]
    problem = shelves()
    fall = behavior("FALL", 1, "?c:Cup", [], effects, "?p:Place ?q:Place")
    for cup, place, full in (("cup1", "low", TRUE), ("cup2", "floor", FALSE)):
        state = successor(problem, fall, (cup,), problem.initial)
        assert state is not None
        assert (state[Symbol("AT", (cup,))], state[Symbol("FULL", (cup,))]) == (place, full)
        assert Symbol("NEAR", (cup, "cup1")) not in state  # the symbol doesn't exist


def test_a_fact_that_a_step_makes_true_and_false_is_true() -> None:
    both = behavior("BOTH", 1, "?c:Cup", [], [becomes("FULL", "?c", TRUE), becomes("FULL", "?c", FALSE)])
    state = successor(shelves(), both, ("cup1",), shelves().initial)
    assert state is not None
    assert state[Symbol("FULL", ("cup1",))] == TRUE


def test_facts_remember_their_overwritten_values() -> None:
    facts = LoggedState(shelves(), shelves().initial)
    assert [facts.value("FULL", (cup,)) for cup in ("cup1", "cup2", "floor")] == [FALSE, TRUE, None]
    assert list(facts.holders("AT", "low")) == [("cup2",), ("cup3",)]
    facts.put("AT", ("cup2",), "high")
    facts.put("AT", ("cup2",), "high")
    facts.put("FULL", ("cup1",), TRUE)
    assert facts.log == [("AT", ("cup2",), "low"), ("FULL", ("cup1",), FALSE)]
    assert (list(facts.holders("AT", "low")), list(facts.holders("AT", "high"))) == (
        [("cup3",)],
        [("cup1",), ("cup2",)],
    )
    assert facts.since(0) == {("AT", ("cup2",)): "low", ("FULL", ("cup1",)): FALSE}
    assert facts.since(1) == {("FULL", ("cup1",)): FALSE}
    facts.put("AT", ("cup2",), "low")
    assert facts.since(0) == {("FULL", ("cup1",)): FALSE}
    assert facts.since(2) == {("AT", ("cup2",)): "high"}
    assert facts.state()[Symbol("AT", ("cup2",))] == "low"


def test_individuals_that_satisfy_conditions_are_returned() -> None:
    problem = shelves()
    facts, kinds = LoggedState(problem, problem.initial), {"?c": "Cup", "?p": "Place"}
    conditions = [has("AT", "?c", "?p"), has("FULL", "?c", TRUE)]
    assert BehaviorReader(problem).satisfied(conditions, {}, kinds, facts) == {"?c": "cup2", "?p": "low"}
    assert BehaviorReader(problem).satisfied(conditions, {"?c": "cup1"}, kinds, facts) is None
    assert BehaviorReader(problem).satisfied([ValueCondition("AT", ("?c",), "?p")], {"?c": "cup1"}, kinds, facts) == {
        "?c": "cup1",
        "?p": "high",
    }


def test_relations_are_indexed_by_each_argument() -> None:
    problem = shelves()
    assert problem.related("above", 0) == {"high": [("high", "low")], "low": [("low", "floor")]}
    assert problem.related("above", 1) == {"low": [("high", "low")], "floor": [("low", "floor")]}
    assert problem.related("none", 0) == {}


def step(level: int, name: str = "DO", *arguments: str, id: int = 0) -> Step:
    return Step((), id, level, name, arguments or ("cup1",))


def test_steps_of_lower_levels_are_grouped_between_the_steps_of_a_level() -> None:
    one, low, lower = step(1), step(2), step(3)
    assert list(stretches([one, low, lower, one, one, low], 1)) == [[one], [low, lower], [one], [one], [low]]
    assert list(stretches([low, one], 1)) == [[low], [one]]
    assert list(stretches([], 1)) == []


def test_the_checker_reports_each_kind_of_fault_of_a_step() -> None:
    problem = shelves(has("FULL", "?c", FALSE))
    assert validate(problem, Plan((step(1),))) == []
    said = [fault.text for fault in validate(problem, Plan((step(1), step(1))))]
    assert said == ["0 DO cup1: its preconditions don't hold in the state before it"]
    said = [fault.text for fault in validate(problem, Plan((step(1, "DO", "cup3", id=5),)))]
    assert said == ["5 DO cup3: its ID by the numbering of level 1 is 2"]
    for wrong in (step(1, "DONE"), step(1, "DO", "low"), step(1, "DO", "cup1", "cup2")):
        assert (
            "no such behaviour, or its parameters don't take these arguments"
            in validate(problem, Plan((wrong,)))[0].text
        )


def test_no_step_refines_a_step_of_its_own_level() -> None:
    problem = shelves(has("FULL", "?c", FALSE))
    (fault,) = validate(problem, Plan((replace(step(1), steps=(replace(step(1), path=(0, 0)),)),)))
    assert fault.text == "0 DO cup1 of level 1 can't refine 0 DO cup1 of level 1"


def test_the_checker_reports_no_faults_after_a_step_that_is_not_applicable() -> None:
    problem = replace(shelves(has("FULL", "?c", FALSE)), goal={Symbol("AT", ("cup1",)): "floor"})
    for wrong in (step(1, "DONE"), step(1, "DO", "cup2", id=1)):
        assert len(validate(problem, Plan((wrong, wrong)))) == 1
    (fault,) = validate(problem, Plan((step(1),)))
    assert fault.text == "the goal <cup1, AT> = floor isn't reached: it is high in the end"


def test_a_step_changes_amounts_and_values_and_its_price_is_calculated() -> None:
    fill = SituationType("FILL", ("Cup",), "FILL", quantity=Quantity("", least=Fraction(0)))
    pour = replace(
        behavior("POUR", 1, "?c:Cup", [has("AT", "?c", "low")], [becomes("FULL", "?c", FALSE)]),
        amounts=(AmountEffect("FILL", ("?c",), "decrease", Fraction(2)),),
        price=Amount("FILL", ("?c",)),
    )
    old = shelves()
    situations = {**old.domain.situations, "FILL": fill}
    problem = replace(
        old,
        domain=replace(old.domain, situations=situations, behaviors={"POUR": pour}),
        initial={**old.initial, Symbol("FILL", ("cup2",)): "3", Symbol("FILL", ("cup3",)): "1"},
    )
    state = successor(problem, pour, ("cup2",), problem.initial)
    assert state is not None
    assert (state[Symbol("FILL", ("cup2",))], state[Symbol("FULL", ("cup2",))]) == ("1", FALSE)
    assert successor(problem, pour, ("cup3",), problem.initial) is None  # the amount would become negative
    rules, facts = BehaviorReader(problem), LoggedState(problem, problem.initial)
    assert rules.price(pour, ("cup2",), facts) == 3
    assert rules.price(pour, ("cup1",), facts) is None
    assert rules.price(replace(pour, name="FREE", price=None), ("cup2",), facts) is None


def test_a_step_has_the_level_of_its_behaviour() -> None:
    problem = tabletop()
    outcome = plan_level(problem, 3)
    assert outcome.plan is not None
    raised = Plan(tuple(replace(step, level=1) for step in outcome.plan.steps))
    assert "the step is of level 1, but its behaviour of level 3" in validate(problem, raised)[0].text
