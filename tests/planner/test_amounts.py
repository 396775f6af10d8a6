"""Amounts: plans reach the amount that a step requires, and the reason for "unsolvable" states the missing amount."""

from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

import confab
from confab.planner.grounded.best_first import plan_level
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.plan import Limits, Outcome, Status
from confab.planner.solve import Request, solve
from confab.reasoner.amounts import Amount, Calculation, Measure, Quantity, bounds_written, meets, written
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    EqualityCondition,
    Parameter,
    SituationType,
    Symbol,
    ValueEffect,
    Witness,
)
from worlds.agreement import solvable
from worlds.writing import becomes, behavior, has, world

JUG, CUP = Parameter("?j", "Jug"), Parameter("?c", "Cup")
TEA = Amount("TEA", ("?j",))


def pouring(there: str, cups: int, portion: Fraction, refill: str | None = "1") -> Problem:
    """A jug and some cups; on level 2, a hand must take the jug before pouring or filling, and put it down afterwards."""
    quantity = Quantity("servings", least=Fraction(0), most=Fraction(4))
    situations = [
        SituationType("TEA", ("Jug",), "TEA", quantity=quantity),
        SituationType("DRINK", ("Cup",), "DRINK"),
        SituationType("HELD", ("Jug",), "HELD", level=2, rest="no"),
    ]
    less = AmountEffect("TEA", ("?j",), "decrease", portion)
    enough, empty, held = Comparison(TEA, ">=", portion), has("DRINK", "?c", "empty"), has("HELD", "?j", "yes")
    full: tuple[ValueEffect, ...] = (becomes("DRINK", "?c", "tea"),)
    behaviors = [
        Behavior("SERVE", 1, (JUG, CUP), (), (empty, enough), full, amounts=(less,)),
        Behavior("TAKE", 2, (JUG,), (), (has("HELD", "?j", "no"),), (becomes("HELD", "?j", "yes"),)),
        Behavior("PUT", 2, (JUG,), (), (held,), (becomes("HELD", "?j", "no"),)),
        Behavior("POUR", 2, (JUG, CUP), (), (held, empty, enough), full, amounts=(less,)),
    ]
    if refill is not None:
        more = AmountEffect("TEA", ("?j",), "increase", Fraction(refill))
        behaviors += [
            Behavior("REFILL", 1, (JUG,), amounts=(more,)),
            Behavior("FILL", 2, (JUG,), preconditions=(held,), amounts=(more,)),
        ]
    names = tuple(f"cup{i}" for i in range(cups))
    return world(
        situations,
        behaviors,
        {"Jug": ("jug",), "Cup": names, "DRINK": ("empty", "tea"), "HELD": ("no", "yes")},
        {"TEA jug": there, "HELD jug": "no", **{f"DRINK {name}": "empty" for name in names}},
        {f"DRINK {name}": "tea" for name in names},
    )


@pytest.mark.parametrize("mode", ["guarded", "paper", "optimal"])
def test_an_amount_that_a_step_requires_is_achieved(mode: str) -> None:
    outcome = solve(Request(pouring("1.5", 3, Fraction(1)), mode))
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    primitives = [step.behavior for step in outcome.plan.primitives]
    assert primitives.count("POUR") == 3
    assert primitives.count("FILL") == 2


def test_amounts_of_thirds_and_tenths_are_exact() -> None:
    for portion in (Fraction(1, 3), Fraction(1, 10)):
        problem = pouring(written(portion * 3), 3, portion, refill=None)
        assert solve(Request(problem)).status is Status.SOLVED  # the last portion takes exactly the remaining amount
        assert plan_level(problem, 2).status is Status.SOLVED


def test_the_reason_for_giving_up_names_the_missing_amount() -> None:
    outcome = solve(Request(pouring("0.5", 2, Fraction(1)), limits=Limits(expansions=3)))
    assert outcome.status is Status.GAVE_UP and outcome.reason is not None
    assert outcome.reason.text.endswith("; TEA of jug: 0.5 servings there, >=1 wanted")


@pytest.mark.parametrize(
    ("there", "cups", "portion", "wanted", "said"),
    [
        ("1.5", 2, "1", {}, "TEA of jug: 1.5 servings are there, 2 are wanted, and nothing gives more"),
        ("2", 2, "0.5", {"jug": ">=1.5"}, "TEA of jug: 2 servings are there, 2.5 are wanted, and nothing gives more"),
        ("2", 0, "1", {"jug": ">=3"}, "jug TEA >=3 can't be reached: no behaviour of level 2 gives more"),
        ("2", 0, "1", {"jug": ">2"}, "jug TEA >2 can't be reached: no behaviour of level 2 gives more"),
        (
            "2",
            0,
            "1",
            {"jug": "<1"},
            "jug TEA <1 can't be reached: POUR requires some Cup DRINK empty, which never holds",
        ),
    ],
)
def test_the_reason_for_unsolvable_states_the_missing_amount(
    there: str, cups: int, portion: str, wanted: dict[str, str], said: str
) -> None:
    problem = pouring(there, cups, Fraction(portion), refill=None)
    problem = replace(problem, goal={**problem.goal, **{Symbol("TEA", (j,)): v for j, v in wanted.items()}})
    outcome = solve(Request(problem))
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None
    assert outcome.reason.text == said


def test_the_reason_names_the_amount_that_is_lacking_if_only_its_user_reaches_its_source() -> None:
    domain = """(define (domain d) (:types place) (:predicates (at ?p - place) (dock ?p - place)) (:functions (charge))
     (:action drive :parameters (?f ?t - place) :precondition (and (at ?f) (>= (charge) 1))
      :effect (and (not (at ?f)) (at ?t) (decrease (charge) 1)))
     (:action load :parameters (?p - place) :precondition (and (at ?p) (dock ?p)) :effect (increase (charge) 4)))"""
    problem = """(define (problem e) (:domain d) (:objects a b c - place) (:init (at a) (dock c) (= (charge) 0)) (:goal (at b)))"""
    outcome = solve(Request(imported(parse(domain, problem)).problem))
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert "DRIVE requires the_world CHARGE >= 1, which never holds" in outcome.reason.text
    assert "LOAD requires some Place AT true and some Place is a Dock, which nothing satisfies" in outcome.reason.text
    assert outcome.reason.text.endswith("so the_world CHARGE 0 always holds")


def test_a_behaviour_that_only_returns_a_consumed_amount_provides_no_additional_amount() -> None:
    problem = pouring("2", 3, Fraction(1), refill=None)

    def given_back(much: str) -> Outcome:
        full, empty = has("DRINK", "?c", "tea"), becomes("DRINK", "?c", "empty")
        more = AmountEffect("TEA", ("?j",), "increase", Fraction(much))
        pour = Behavior("POUR_BACK", 2, (JUG, CUP), (), (has("HELD", "?j", "yes"), full), (empty,), amounts=(more,))
        domain = replace(problem.domain, behaviors={**problem.domain.behaviors, "POUR_BACK": pour})
        return solve(Request(replace(problem, domain=domain)))

    outcome = given_back("1")
    assert outcome.reason is not None
    assert outcome.reason.text == "TEA of jug: 2 servings are there, 3 are wanted, and nothing gives more"
    assert given_back("1.5").status is Status.SOLVED


def test_an_amount_that_a_step_requires_but_does_not_consume_counts_as_missing_too() -> None:
    problem = confab.load("three-cups").problem
    assert solve(Request(problem)).status is Status.SOLVED
    less = {**problem.initial, Symbol("SERVINGS", ("bottle1",)): "3"}  # a pour requires two of these
    outcome = solve(Request(replace(problem, initial=less)))
    assert outcome.reason is not None
    assert (
        outcome.reason.text
        == "SERVINGS of bottle1, bottle2: 4 servings are there, 5 are wanted, and nothing gives more"
    )


def test_a_goal_with_bounds_is_kept_while_other_goals_are_achieved() -> None:
    problem = pouring("1", 2, Fraction(1))
    problem = replace(problem, goal={**problem.goal, Symbol("TEA", ("jug",)): bounds_written(">=2,<3")})
    outcome = solve(Request(problem, leave_levels=False))
    assert outcome.plan is not None
    assert sorted(step.behavior for step in outcome.plan.at_level(1)) == [*["REFILL"] * 3, *["SERVE"] * 2]


def test_the_heuristic_counts_an_operator_as_many_times_as_the_amount_requires() -> None:
    problem = pouring("0", 0, Fraction(1), refill="0.01")
    problem = replace(problem, goal={Symbol("TEA", ("jug",)): ">=3"})
    outcome = plan_level(problem, 2)
    assert outcome.plan is not None
    assert len(outcome.plan.primitives) == 302  # taken, filled three hundred times, and put down
    assert outcome.search[2].expanded < 1000


def test_the_papers_mode_plans_with_a_product_of_changing_amounts() -> None:
    problem = pouring("1", 1, Fraction(1))
    behavior = problem.domain.behaviors["SERVE"]
    squared = replace(
        behavior, preconditions=(*behavior.preconditions, Comparison(Calculation("*", TEA, TEA), ">=", Fraction(4)))
    )
    domain = replace(problem.domain, behaviors={**problem.domain.behaviors, "SERVE": squared})
    outcome = solve(Request(replace(problem, domain=domain), "paper"))
    assert outcome.plan is not None
    assert meets(str(outcome.plan.length[1]), "2")


def test_a_precondition_on_a_quotient_of_changing_amounts_is_planned_with() -> None:
    shelf, box, mean = Parameter("?s", "Shelf"), Parameter("?b", "Box"), Fraction(3)
    weight, one = Measure("weight", ("?b",)), Fraction(1)
    total, count = (Calculation("+", Amount(n, ("?s",)), by) for n, by in (("TOTAL", weight), ("COUNT", one)))
    heavier = Comparison(Calculation("/", total, count), ">", mean)
    light = AnyOf(((Witness("?x", "Shelf", (EqualityCondition("?x", "?s"), AnyOf(((heavier,),)))),),), negated=True)
    more = tuple(AmountEffect(n, ("?s",), "increase", by) for n, by in (("TOTAL", weight), ("COUNT", one)))
    put = Behavior(
        "PUT", 1, (box, shelf), (), (has("ON", "?b", "floor"), light), (becomes("ON", "?b", "?s"),), amounts=more
    )
    problem = world(
        [SituationType("ON", ("Box",), "ON"),
         *(SituationType(n, ("Shelf",), n, quantity=Quantity("")) for n in ("TOTAL", "COUNT"))],
        [put], {"Box": ("iron", "wood"), "Shelf": ("shelf",), "ON": ("shelf", "floor")},
        {"ON iron": "floor", "ON wood": "floor", "TOTAL shelf": "0", "COUNT shelf": "0"}, {"ON iron": "shelf"},
    )  # fmt: skip
    plan = solve(Request(replace(problem, relations={"weight": frozenset({("iron", "4"), ("wood", "2")})}))).plan
    assert plan is not None
    assert [step.arguments[0] for step in plan.primitives] == ["wood", "iron"]


def test_a_plan_with_amounts_is_executed_to_its_goal() -> None:
    execution = confab.load("canteen-small").execute()
    assert execution.reached
    assert not execution.episode.replans


def test_an_amount_beyond_its_bounds_is_proved_unreachable_without_a_search() -> None:
    problem = pouring("1", 2, Fraction(5))  # the jug holds four servings
    outcome = plan_level(problem, 2)
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.search[2].expanded == 0
    assert solve(Request(problem)).status is Status.UNSOLVABLE


def test_an_assignment_of_too_small_an_amount_is_no_achiever() -> None:
    problem = pouring("0.5", 1, Fraction(1), refill=None)
    rinse = Behavior("RINSE", 2, (JUG,), amounts=(AmountEffect("TEA", ("?j",), "assign", Fraction(0)),))
    fill = replace(rinse, name="FILL", amounts=(AmountEffect("TEA", ("?j",), "assign", Fraction(2)),))
    for one, status in ((rinse, Status.UNSOLVABLE), (fill, Status.SOLVED)):
        domain = replace(problem.domain, behaviors={**problem.domain.behaviors, one.name: one})
        outcome = plan_level(replace(problem, domain=domain), 2)
        assert outcome.status is status
        assert outcome.search[2].expanded == 0 or outcome.plan is not None


def test_an_amount_that_changes_under_a_condition_is_not_counted_as_consumed() -> None:
    domain = """(define (domain shelf) (:requirements :typing :numeric-fluents :conditional-effects) (:types book)
      (:predicates (there ?b - book) (out ?b - book) (lent ?b - book)) (:functions (free))
      (:action tidy :parameters (?b - book) :precondition (>= (free) 1) :effect
        (and (decrease (free) 1) (when (out ?b) (and (there ?b) (not (out ?b)))) (when (lent ?b) (increase (free) 1))))
      (:action put :parameters (?b - book) :precondition (and (out ?b) (>= (free) 1))
        :effect (and (there ?b) (decrease (free) 1)))
      (:action lend :parameters (?b - book) :precondition (there ?b)
        :effect (and (not (there ?b)) (lent ?b) (increase (free) 1))))"""
    task = """(define (problem p) (:domain shelf) (:objects b0 b1 - book)
      (:init (out b0) (out b1) (= (free) 1)) (:goal (and (there b0) (there b1))))"""
    assert plan_level(imported(parse(domain, task)).problem).status is Status.SOLVED


def working(random: Random | None = None) -> Problem:
    """A behaviour that decreases the load of a box, and increases it for each lamp that is on; lamps can be switched off."""
    lamps = [f"LAMP{number}" for number in range(2 if random is None else random.randint(2, 3))]
    box, load = Parameter("?b", "Box"), Quantity()
    less = AmountEffect("LOAD", ("?b",), "decrease", Fraction(1 if random is None else random.randint(1, 2)))
    more = [AmountEffect("LOAD", ("?b",), "increase", Fraction(1), (has(lamp, "?b", TRUE),)) for lamp in lamps]
    if random is not None:
        load = Quantity(least=Fraction(-3), most=Fraction(3))
        more = [
            replace(
                effect,
                operation=random.choice(("increase", "increase", "decrease")),
                when=(has(random.choice(lamps), "?b", random.choice((TRUE, TRUE, FALSE))),),
            )
            for effect in more * 2
        ]
    off = [behavior(f"OFF{lamp}", 1, "?b:Box", [has(lamp, "?b", TRUE)], [becomes(lamp, "?b", FALSE)]) for lamp in lamps]
    wanted = ">=1" if random is None else random.choice((">=", "<=")) + str(random.randint(-2, 3))
    return world(
        [
            SituationType("LOAD", ("Box",), "LOAD", quantity=load),
            *(SituationType(lamp, ("Box",), "Truth", boolean=True) for lamp in lamps),
        ],
        [Behavior("WORK", 1, (box,), amounts=(less, *more)), *off],
        {"Box": ("box",)},
        {
            "LOAD box": "0",
            **{f"{lamp} box": TRUE if random is None else random.choice((TRUE, FALSE)) for lamp in lamps},
        },
        {"LOAD box": wanted},
    )


@pytest.mark.parametrize("mode", ["guarded", "paper", "optimal"])
def test_several_conditional_changes_of_one_amount_reach_a_goal_that_none_of_them_reaches(mode: str) -> None:
    outcome = solve(Request(working(), mode))
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert [step.behavior for step in outcome.plan.steps] == ["WORK"]


def test_random_conditional_changes_of_amounts_have_the_answers_of_exhaustive_search() -> None:
    answers = []
    for seed in range(300):
        problem = working(Random(seed))
        answers.append(solvable(problem, most=3_000))
        assert (plan_level(problem).status is Status.SOLVED) == answers[-1], seed
    assert answers.count(True) > 50 and answers.count(False) > 50


def test_a_price_is_read_in_the_state_before_its_step_even_if_nothing_is_true_there() -> None:
    load, done = Amount("LOAD", ("?b",)), SituationType("DONE", ("Box",), "Truth", boolean=True)
    box = Parameter("?b", "Box")
    problem = world(
        [SituationType("LOAD", ("Box",), "LOAD", quantity=Quantity(least=Fraction(0), most=Fraction(9))), done],
        [
            Behavior("UP", 1, (box,), amounts=(AmountEffect("LOAD", ("?b",), "increase", Fraction(1)),)),
            Behavior("DOWN", 1, (box,), amounts=(AmountEffect("LOAD", ("?b",), "decrease", Fraction(1)),)),
            Behavior("PAY", 1, (box,), effects=(becomes("DONE", "?b", TRUE),), price=load),
        ],
        {"Box": ("box",)},
        {"LOAD box": "0", "DONE box": FALSE},
        {"DONE box": TRUE},
    )
    task = ground(problem)
    assert isinstance(task, Task)
    plan = task.operators_of([(name, ("box",)) for name in ("UP", "DOWN", "PAY")])
    assert plan is not None and task.cost_of(plan) == 2.0


@pytest.mark.parametrize("first", ["-2", "7"])
@pytest.mark.parametrize("operation", ["increase", "decrease"])
@pytest.mark.parametrize("sign", ["<", "<=", "=", ">=", ">", None])
def test_an_amount_beyond_its_bounds_may_stay_there(first: str, operation: str, sign: str | None) -> None:
    oil = SituationType("OIL", ("Cup",), "", quantity=Quantity(least=Fraction(0), most=Fraction(5)))
    lit = SituationType("LIT", ("Cup",), "Truth", boolean=True)
    change = AmountEffect("OIL", ("?c",), operation, Fraction(1))
    for limit in (Fraction(first), Fraction(0), Fraction(5)):
        asked = [] if sign is None else [Comparison(Amount("OIL", ("?c",)), sign, limit)]
        for negated in (False, True):
            burn = behavior(
                "BURN", 1, "?c:Cup", [replace(one, negated=negated) for one in asked], [becomes("LIT", "?c", TRUE)]
            )
            pour = Behavior("POUR", 1, (CUP,), amounts=(change,))
            problem = world([oil, lit], [pour, burn], {"Cup": ("c",)}, {"OIL c": first}, {"LIT c": TRUE})
            wanted = Status.SOLVED if solvable(problem) else Status.UNSOLVABLE
            assert plan_level(problem).status is wanted
            assert solve(Request(problem)).status is wanted
