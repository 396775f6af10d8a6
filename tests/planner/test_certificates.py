"""Every "unsolvable" has a certificate that an independent checker accepts; corrupted and forged certificates are rejected."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

import pytest

import confab
from confab.planner import certifying
from confab.planner.certificate_checks import refusal
from confab.planner.certificates import Certificate, certificate_from, certificate_json
from confab.planner.certified import certified
from confab.planner.certifying import WORK, _with_fewer, by_states, certify
from confab.planner.plan import Limits, Outcome, Reason, Status
from confab.planner.possibilities import Lowest
from confab.planner.preferences import preferred
from confab.planner.solve import MODES, Mode, Request, solve
from confab.reasoner.aggregates.compiling import compiled
from confab.reasoner.amounts import Amount, Calculation, Expression, Quantity
from confab.reasoner.effects import spread
from confab.reasoner.generate import write_scene
from confab.reasoner.limits import within
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    Behavior,
    Comparison,
    EqualityCondition,
    Fact,
    Parameter,
    Rule,
    SituationType,
    Symbol,
)
from worlds.agreement import solvable
from worlds.false_certificates import corrupted
from worlds.hierarchies import hierarchy
from worlds.interpreter import Interpreter, TooManyStatesError
from worlds.mixed import mixed
from worlds.scenes import scene
from worlds.writing import becomes, behavior, has, world

CASES = Path(__file__).with_name("cases")
BAYS = ["acid2 IN bay1", "base2 IN bay2", "bleach IN bay3", "fuel IN bay5", "peroxide IN bay4", "solvent IN bay6"]


def answered(case: str, mode: Mode) -> Outcome:
    return confab.load(CASES / case).plan(mode=mode, time_limit=20.0, engine="none").outcome


@pytest.mark.parametrize("mode", ["guarded", "paper", "optimal"])
def test_a_search_that_reaches_its_limit_of_expansions_looks_for_a_certificate(mode: Mode) -> None:
    unsolvable = 0
    for seed in range(4_100_000, 4_100_006):
        problem = hierarchy(seed)
        if solvable(problem, most=3_000) is False:
            outcome = solve(Request(problem, mode, Limits(expansions=1)))
            assert (outcome.status, outcome.certificate is None) == (Status.UNSOLVABLE, False), seed
            unsolvable += 1
    assert unsolvable


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "leading"])
@pytest.mark.parametrize(
    "case",
    [
        "false-unsolvable-1",
        "false-unsolvable-2",
        "no-operators-solvable",
        "equal-to-itself",
        "defined-by-a-type-below-all-levels",
        "rest-value-against-always",
    ],
)
def test_a_task_with_a_short_plan_is_not_called_unsolvable(case: str, mode: Mode) -> None:
    outcome = answered(f"{case}.ttl", mode)
    assert outcome.plan is not None and len(outcome.plan.primitives) <= 2


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "leading"])
def test_a_task_whose_behaviours_change_nothing_is_unsolvable(mode: Mode) -> None:
    outcome = answered("no-operators.ttl", mode)
    assert outcome.certificate is not None and outcome.reason is not None
    assert outcome.reason.text == (
        "a1 D0 true can't be reached: no behaviour of level 1 gives b4 F0 another value; so b4 F0 a1 always holds"
    )


@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_the_reason_is_the_cause_that_no_behaviour_changes(mode: Mode) -> None:
    outcome = answered("reason-key-opens-nothing/ward-small.ttl", mode)
    assert outcome.certificate is not None and outcome.reason is not None
    assert (
        "L2_UNLOCK requires a Key that opens cabinet0, and there is none; so cabinet0 LOCK unlocked"
        in outcome.reason.text
    )


@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_goals_about_one_object_that_exclude_each_other_given_rest_values_are_unsolvable(
    mode: Mode, tmp_path: Path
) -> None:
    """The work of both modes is limited, and not their time, so that the answer is the same on a busy machine."""
    write_scene(tmp_path / "scene.ttl", "served", 2, 1, 0, 0)
    outcome = confab.load(tmp_path / "scene.ttl").plan("hand1 HOLDS cup1", mode=mode).outcome
    assert outcome.status is Status.UNSOLVABLE and outcome.certificate is not None
    goals = {"hand1 HOLDS cup1", "cup1 LOCATION location3", "hand1 HAND_POSITION raised"}
    assert {str(fact) for fact in outcome.certificate.unmet} == goals


def test_a_search_among_few_states_ends() -> None:
    outcome = answered("goals-of-one-rule.ttl", "guarded")
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert "b5 D0 b5 false and b6 D0 b6 false exclude each other" in outcome.reason.text


@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_the_reason_names_the_bound_that_an_amount_would_exceed(mode: Mode) -> None:
    outcome = answered("reason-wrong-sign/depot-small.ttl", mode)
    assert outcome.certificate is not None and outcome.reason is not None
    assert "L3_ROLL would take robot0 BATTERY to 13, more than its maximum, 12; so robot0" in outcome.reason.text


@cache
def certificate_of(seed: int) -> tuple[Problem, Certificate | None]:
    problem = hierarchy(seed)
    return problem, certify(problem)


def unsolvable(seeds: range) -> Iterator[tuple[Problem, Certificate]]:
    for problem, certificate in map(certificate_of, seeds):
        if certificate is not None:
            yield problem, certificate


def test_in_random_worlds_exactly_the_tasks_without_a_plan_have_a_certificate() -> None:
    for seed in range(15):
        problem, certificate = certificate_of(seed)
        assert (certificate is None) == bool(solvable(problem)), seed
        assert certificate is None or refusal(problem, certificate) is None, seed


def test_a_corrupted_certificate_is_refused() -> None:
    kinds = Counter[str]()
    for problem, certificate in unsolvable(range(30)):
        for what, bad in corrupted(problem, certificate, Random(1)):
            assert refusal(problem, bad) is not None, (what, bad)
            kinds[what] += 1
    assert kinds.total() >= 50
    assert {"without a fact that is never true", "without a symbol of told_apart"} <= kinds.keys()


@pytest.mark.parametrize("goal", [BAYS, ["acid1 IN bay6", "base1 IN bay6"], ["bay6 CLASH true"]])
def test_a_certificate_of_a_violated_bound_is_refused_with_fewer_goals_or_another_bound(goal: list[str]) -> None:
    result = confab.load("drums-large").plan(goal=goal)
    certificate = result.outcome.certificate
    assert certificate is not None and certificate.bounded
    drawn = [*corrupted(result.problem, certificate, Random(1))]
    assert [what for what, bad in drawn if refusal(result.problem, bad) is None] == []
    bounds = {"without the violated bound", "with fewer goals beyond a bound"}
    assert len(goal) == 1 or bounds <= {what for what, _ in drawn}
    assert goal != BAYS or "with another bound" in dict(drawn)


@pytest.mark.parametrize("seed", [500_675, 600_054])
def test_an_amount_that_a_conditional_effect_keeps_within_its_bounds_is_certified(seed: int, tmp_path: Path) -> None:
    (tmp_path / "world.ttl").write_text(scene(mixed(seed)))
    outcome = confab.load(tmp_path / "world.ttl").plan().outcome
    assert outcome.status is Status.UNSOLVABLE and outcome.certificate is not None


@pytest.mark.parametrize(
    ("first", "operation", "by", "true", "false"),
    [
        ("2", "decrease", 1, ">=0", ">=1"),  # the least amount is 0
        ("2", "increase", 1, "<=3", "<=2"),  # the most is 3
        ("5", "increase", 1, ">=5", "<=3"),  # an amount beyond its bounds stays as it is, or comes within them
        ("5", "decrease", 3, "<=5", ">=5"),
        ("5", "assign", 1, ">=1", ">=2"),
    ],
)
def test_a_claim_about_an_amount_is_refused_exactly_if_a_conditional_effect_can_break_it(
    first: str, operation: str, by: int, true: str, false: str
) -> None:
    lit = SituationType("LIT", ("Lamp",), "Truth", boolean=True)
    oil = SituationType("OIL", ("Lamp",), "", quantity=Quantity(least=Fraction(0), most=Fraction(3)))
    burn = Behavior("BURN", 1, (Parameter("?l", "Lamp"),), amounts=(
        AmountEffect("OIL", ("?l",), operation, Fraction(by), (has("LIT", "?l", TRUE),)),
    ))  # fmt: skip
    switch = behavior("SWITCH", 1, "?l:Lamp", [], [becomes("LIT", "?l", TRUE)])
    problem = world([lit, oil], [burn, switch], {"Lamp": ("lamp",)}, {"OIL lamp": first}, {"OIL lamp": "9"})
    amount, unmet = Symbol("OIL", ("lamp",)), (Fact(Symbol("OIL", ("lamp",)), "9"),)
    assert refusal(problem, Certificate(always={amount: true}, unmet=unmet)) is None
    assert refusal(problem, Certificate(always={amount: false}, unmet=unmet)) is not None


@pytest.mark.parametrize(
    ("seed", "constrained", "reason"),
    [
        (
            100_227,
            0.0,
            "z3 M1 a2 >3 and z3 D0 true exclude each other, because a2 R2 a1 false never holds: no behaviour",
        ),
        (100_546, 1.0, "a1 D1 z4 true and a1 R0 z4 false exclude each other, because a1 R0 z3 true never holds: no"),
    ],
)
def test_the_reason_why_goals_exclude_each_other_names_the_fact_that_never_holds(
    seed: int, constrained: float, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "world.ttl").write_text(scene(mixed(seed, constrained=constrained)))
    outcome = confab.load(tmp_path / "world.ttl").plan().outcome
    assert outcome.reason is not None and outcome.reason.text.startswith(reason)


@pytest.mark.parametrize("most", [1_000, 3_000])
def test_the_search_for_a_certificate_with_few_goals_keeps_its_work_limit(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = confab.load("drums-large").with_goal(*BAYS).problem
    lowest = Lowest(problem, most)
    monkeypatch.setattr(certifying, "Lowest", lambda *_: lowest)
    found = certify(problem, most)
    assert found is not None and found.bounded
    assert lowest.work <= most


def test_a_certificate_proves_nothing_of_a_task_that_has_a_plan() -> None:
    tried = 0
    for problem, certificate in unsolvable(range(30)):
        for seed in range(6):
            rng = Random(seed)
            symbol = rng.choice(sorted(problem.initial))
            values = [value for value in problem.values(symbol, 9) if value != problem.initial[symbol]]
            if problem.domain.situations[symbol.situation].boolean:
                values = [FALSE if problem.initial[symbol] == TRUE else TRUE]
            other = replace(
                problem, initial={**problem.initial, symbol: rng.choice(values or [problem.initial[symbol]])}
            )
            if solvable(other):
                tried += 1
                assert refusal(other, certificate) is not None
    assert tried > 5


def test_a_rest_value_that_no_plan_has_to_reach_is_no_violation_of_a_constraint() -> None:
    problem = confab.load(CASES / "rest-value-against-always.ttl").problem
    symbol, violations = Symbol("P3", ("z3",)), Symbol("P3.exceptions", ())
    certificate = Certificate(always={symbol: TRUE}, cases=1, unmet=(Fact(symbol, FALSE),), bounded=(violations,))
    assert refusal(problem, certificate) is not None  # a plan leaves the symbol as it is


def test_a_certificate_survives_a_round_trip_and_a_broken_one_is_refused() -> None:
    for _, certificate in unsolvable(range(20)):
        assert certificate_from(json.loads(json.dumps(certificate_json(certificate)))) == certificate
    for broken in (
        "{}",
        "[]",
        '{"format": 2}',
        '{"format": 1, "cases": "1"}',
        '{"format": 1, "cases": 1, "never": [[1]]}',
    ):
        with pytest.raises(ValueError, match=r"certificate|whole number"):
            certificate_from(json.loads(broken))


def test_an_unsolvable_answer_without_an_accepted_certificate_becomes_gave_up() -> None:
    problem = next(hierarchy(seed) for seed in range(100) if solvable(hierarchy(seed)))
    said = certified(problem, Outcome(Status.UNSOLVABLE, reason=Reason("so it seems")))
    assert said.status is Status.GAVE_UP and said.certificate is None and said.reason is not None
    assert said.reason.text == "so it seems; this isn't certified: no certificate was found within the work limit"
    forged = Certificate(unmet=tuple(Fact(symbol, value) for symbol, value in problem.goal.items()))
    said = certified(problem, Outcome(Status.UNSOLVABLE, certificate=forged))
    assert said.status is Status.GAVE_UP and said.reason is not None and "refuses" in said.reason.text


def test_a_certificate_that_is_not_checked_in_time_is_not_called_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.planner.possibilities.LOOKS", 1)
    problem, certificate = next(unsolvable(range(15)))
    with within(0.0):
        said = certified(problem, Outcome(Status.UNSOLVABLE, certificate=certificate))
    assert said.status is Status.GAVE_UP and said.reason is not None
    assert "refuses" not in said.reason.text
    assert "too little time was left to check the certificate; raise the time limit (--time-limit" in said.reason.text


def test_every_mode_answers_unsolvable_with_a_certificate() -> None:
    for problem, _ in unsolvable(range(12)):
        for mode in ("guarded", "optimal", "paper"):
            outcome = solve(Request(problem, mode))
            assert outcome.status is Status.UNSOLVABLE and outcome.certificate is not None


def test_json_has_the_certificate_and_the_checker_accepts_it() -> None:
    result = confab.load(CASES / "reason-key-opens-nothing" / "ward-small.ttl").plan()
    certificate = certificate_from(result.json()["certificate"])
    assert refusal(result.problem, certificate) is None
    assert Fact(Symbol("LOCK", ("cabinet0",)), "unlocked") in certificate.never


def test_the_equality_of_a_variable_with_itself_binds_no_variable() -> None:
    itself = EqualityCondition("?c", "?c")
    move = behavior("MOVE", 1, "?c:Cup", [itself], [becomes("AT", "?c", "sink")])
    at = SituationType("AT", ("Cup",), "Place")
    kinds = {"Cup": ("cup1",), "Place": ("shelf", "sink")}
    problem = world([at], [move], kinds, {"AT cup1": "shelf"}, {"AT cup1": "sink"})
    assert certify(problem) is None
    forged = Certificate(never=frozenset(map(Fact, problem.goal, problem.goal.values())))
    assert refusal(problem, replace(forged, unmet=tuple(forged.never))) is not None


@pytest.mark.parametrize("first", [9_000_270, 9_000_150])
def test_in_mixed_worlds_exactly_the_tasks_without_a_plan_have_a_certificate(tmp_path: Path, first: int) -> None:
    for seed in range(first, first + 20):
        drawn = mixed(seed).problem
        behaviors = {name: spread(one, drawn.classes) for name, one in drawn.domain.behaviors.items()}
        problem = replace(drawn, domain=replace(drawn.domain, behaviors=behaviors))
        try:
            truth = Interpreter(drawn).explored(drawn.domain.levels[-1], 600)
        except TooManyStatesError:
            continue
        if drawn.domain.aggregates:  # the reader of a scene compiles sums and counts
            (tmp_path / "w.ttl").write_text(scene(mixed(seed)), encoding="utf-8")
            problem = confab.load(tmp_path / "w.ttl").problem
        certificate = certify(problem)
        assert (certificate is None) == (truth.least is not None), seed
        assert certificate is None or refusal(problem, certificate) is None, seed


def test_states_that_a_search_has_exhausted_are_the_first_certificate_that_is_tried() -> None:
    doors = ("closet_dining", "closet_office", "closet_trash", "dining_trash", "kitchen_office", "kitchen_trash")
    stuck = confab.load("rooms-battery").with_fact(
        *(f"hall_{door} DOOR_OPEN false" for door in doors),
        *("pantry OPEN true", "bread0 THING_AT rooms-battery:robot"),
        *(f"rooms-battery:robot {fact}" for fact in ("BATTERY 17", "ROBOT_AT pantry_storage", "ROBOT_IN kitchen")),
    )
    found = certify(stuck.problem, 600_000, few_states=True)
    assert found is not None
    assert refusal(stuck.problem, found) is None
    assert certify(stuck.problem, 600_000) is None  # the work doesn't suffice for other proofs


@pytest.mark.parametrize(
    ("scene", "goal", "reason"),
    [
        ("canteen-small", "trolley BATTERY >=25", "trolley BATTERY is at most 20"),
        ("canteen-small", "trolley BATTERY >20", "trolley BATTERY is at most 20"),
        ("canteen-small", "trolley BATTERY 21", "trolley BATTERY is at most 20"),
        ("canteen-small", "trolley BATTERY <0", "trolley BATTERY is at least 0"),
        ("carts-small", "cart LOAD >=14", "cart LOAD is at most 13, the sum of all numbers that may belong to it"),
        (
            "carts-small",
            "shop STOCK >=4",
            "shop STOCK is at most 3, the count of all individuals that may belong to it",
        ),
    ],
)
def test_the_reason_is_the_bound_that_a_goal_lies_beyond(scene: str, goal: str, reason: str) -> None:
    outcome = confab.load(scene).plan(goal).outcome
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.reason is not None and reason in outcome.reason.text


def test_the_reason_why_an_amount_never_changes_names_every_behaviour_that_could_change_the_amount() -> None:
    scene = confab.load("canteen-small").with_fact("trolley TROLLEY_AT table1", "trolley BATTERY 0")
    reason = scene.plan().outcome.reason
    assert reason is not None
    assert (
        "L2_CHARGE requires trolley TROLLEY_AT some Dock, which never holds; so trolley BATTERY 0 always" in reason.text
    )


def test_a_certificate_that_was_found_in_time_is_kept_if_no_time_is_left_to_remove_its_superfluous_symbols(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = ((problem, by_states(Lowest(problem, WORK))) for problem, _ in unsolvable(range(20)))
    problem, certificate = next((problem, one) for problem, one in found if one is not None)
    reads = 0

    def clock() -> float:
        nonlocal reads
        reads += 1
        return float(reads)

    lowest = Lowest(problem)
    lowest.deadline = 4.0  # passes at the second look at the clock
    monkeypatch.setattr("confab.planner.certifying.perf_counter", clock)
    monkeypatch.setattr("confab.planner.possibilities.perf_counter", clock)
    monkeypatch.setattr("confab.planner.possibilities.LOOKS", 1)
    assert _with_fewer(lowest, certificate) == certificate
    assert refusal(problem, certificate) is None


def switching(goal: str | None, rest: str = FALSE) -> Problem:
    """Return a task to warm a lamp, which lights the lamp for good, with a soft goal for its light."""
    light = SituationType("LIT", ("Lamp",), "Truth", boolean=True, rest=rest)
    warm = SituationType("WARM", ("Lamp",), "Truth", boolean=True)
    on = behavior("ON", 1, "?l:Lamp", [], [becomes("LIT", "?l", TRUE), becomes("WARM", "?l", TRUE)])
    soft = {} if goal is None else {"LIT a": goal}
    problem = world([light, warm], [on], {"Lamp": ("a",)}, {"LIT a": FALSE}, {"WARM a": TRUE, **soft})
    return replace(problem, weights=dict.fromkeys((Symbol("LIT", ("a",)),) if soft else (), Fraction(3)))


def test_no_certificate_depends_on_a_goal_that_a_plan_may_leave() -> None:
    lit = SituationType("LIT", ("Lamp",), "Truth", boolean=True)
    on = behavior("ON", 1, "", [], [becomes("LIT", "a", TRUE)])
    hard = world([lit], [on], {"Lamp": ("a", "b")}, {}, {"LIT a": TRUE, "LIT b": TRUE})
    soft = replace(hard, weights={Symbol("LIT", ("b",)): Fraction(3)})
    certificate = certify(hard)
    assert certificate is not None
    assert refusal(hard, certificate) is None
    assert refusal(soft, certificate) == "b LIT true isn't wanted in this task"
    assert certify(soft) is None
    outcome = solve(Request(soft))  # counts soft goals as hard
    assert outcome.certificate is not None
    assert refusal(hard, outcome.certificate) is None


def test_a_symbol_with_a_soft_goal_has_its_rest_value_in_the_end_only_if_the_soft_goal_is_this_value() -> None:
    certificate = certify(switching(None))
    assert certificate is not None
    assert Fact(Symbol("LIT", ("a",)), FALSE) in certificate.unmet
    for goal, proved in ((None, True), (FALSE, True), (TRUE, False)):
        problem = switching(goal)
        assert (refusal(problem, certificate) is None) == proved
        assert (certify(problem) is not None) == proved
        _, outcome = preferred(problem, lambda task: solve(Request(task)))
        assert outcome.status is (Status.UNSOLVABLE if proved else Status.SOLVED)


def test_a_number_beyond_all_floating_point_numbers_is_compared_with_amounts_without_bounds() -> None:
    kinds = [SituationType(name, (), "", quantity=Quantity()) for name in ("OIL", "GAS")]
    oil, gas = Amount("OIL", ()), Amount("GAS", ())
    vast: Expression = Fraction(10) ** 60
    for _ in range(5):
        vast = Calculation("*", vast, Fraction(10) ** 60)
    for left in (Calculation("*", vast, oil), Calculation("+", vast, oil), Calculation("/", oil, vast)):
        asked = Comparison(left, ">", Calculation("-", gas, vast))
        pour = behavior("POUR", 1, "", [asked], [becomes("ON", TRUE)])
        changes = [
            replace(behavior(name, 1, "", [], []), amounts=(AmountEffect(name[1:], (), "decrease", Fraction(1)),))
            for name in ("-OIL", "-GAS")
        ]
        on = SituationType("ON", (), "Truth", boolean=True)
        problem = world([*kinds, on], [pour, *changes], {}, {"OIL": "0", "GAS": "0"}, {"ON": TRUE})
        goal = Fact(Symbol("ON", ()), TRUE)
        assert certify(problem) is None
        assert refusal(problem, Certificate(never=frozenset({goal}), unmet=(goal,))) is not None
        assert solve(Request(problem, limits=Limits(seconds=5.0))).status is not Status.UNSOLVABLE


def test_no_plan_has_to_give_a_derived_situation_its_rest_value() -> None:
    lit = SituationType("LIT", ("Lamp",), "Truth", boolean=True)
    warm = SituationType("WARM", ("Lamp",), "Truth", boolean=True, rest=FALSE)
    on = behavior("ON", 1, "?l:Lamp", [], [becomes("LIT", "?l", TRUE)])
    problem = world([lit, warm], [on], {"Lamp": ("a",)}, {}, {"LIT a": TRUE})
    rule = Rule("WARM", (Parameter("?l", "Lamp"),), (), (has("LIT", "?l", TRUE),))
    problem = replace(problem, domain=replace(problem.domain, rules={"WARM": (rule,)}))
    light, warmth = Symbol("LIT", ("a",)), Symbol("WARM", ("a",))
    certificate = Certificate(told_apart={light: ()}, cases=2, unmet=(Fact(light, TRUE), Fact(warmth, FALSE)))
    assert refusal(problem, certificate) == "a WARM false isn't wanted in this task"


@pytest.mark.parametrize("stated", [{}, {"B c": FALSE}])
def test_the_exhaustive_search_and_the_certificate_agree_on_rest_values_that_arent_stated(
    stated: dict[str, str],
) -> None:
    kinds = [
        SituationType(name, ("Cup",), "Truth", boolean=True, rest=rest) for name, rest in (("A", None), ("B", FALSE))
    ]
    both = behavior("BOTH", 1, "?c:Cup", [], [becomes("A", "?c", TRUE), becomes("B", "?c", TRUE)])
    back = behavior("BACK", 1, "?c:Cup", [], [becomes("B", "?c", FALSE)])
    for behaviors in ([both], [both, back]):
        problem = world(kinds, behaviors, {"Cup": ("c",)}, stated, {"A c": TRUE})
        assert solvable(problem) is (back in behaviors)
        assert (certify(problem) is None) is (back in behaviors)


@pytest.mark.parametrize(("counted", "proved"), [(1, False), (2, False), (3, True)])
def test_a_certificate_rests_on_the_definition_of_a_count_and_not_on_the_effects_that_update_it(
    counted: int, proved: bool
) -> None:
    lit = SituationType("LIT", ("Lamp",), "Truth", boolean=True)
    many = SituationType("MANY", (), "", quantity=Quantity(least=Fraction(0)))
    on = behavior("ON", 1, "?l:Lamp", [has("LIT", "?l", FALSE)], [becomes("LIT", "?l", TRUE)])
    problem = world([lit, many], [on], {"Lamp": ("a", "b")}, {"MANY": "0"}, {"MANY": str(counted)})
    lamps = Aggregate("MANY", "count", Fraction(1), (), (Parameter("?l", "Lamp"),), (has("LIT", "?l", TRUE),))
    domain = compiled(replace(problem.domain, aggregates={"MANY": lamps}), problem.classes)
    problem = replace(problem, domain=domain)
    right = domain.behaviors["ON"]
    for by in range(1, 5):  # if `by` isn't 1, the effect on the count is wrong
        amounts = tuple(replace(effect, amount=Fraction(by)) for effect in right.amounts)
        wrong = replace(domain, behaviors={"ON": replace(right, amounts=amounts)})
        certificate = by_states(Lowest(replace(problem, domain=wrong)))
        assert (certificate is not None) == proved
