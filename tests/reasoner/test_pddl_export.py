"""An export has the same meaning as the scene, for every reader."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import confab
from confab.pddl_commands import import_pddl
from confab.planner.grounded.best_first import plan_level
from confab.planner.plan import Status
from confab.reasoner.aggregates.compiling import compiled
from confab.reasoner.aggregates.dependencies import unfolded
from confab.reasoner.aggregates.totals import with_totals
from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, Quantity
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.pddl.exporting import to_pddl
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse, parse_files
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    Behavior,
    Comparison,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Span,
    Symbol,
    Timing,
    ValueCondition,
    ValueEffect,
    Witness,
)
from confab.reasoner.validation.validate import validate
from worlds.interpreter import Interpreter, TooManyStatesError
from worlds.mixed import mixed
from worlds.writing import behavior, world

CASES = Path(__file__).with_name("cases")
MOST = 2_000


def read_by_unified_planning(domain: str, problem: str) -> None:
    io = pytest.importorskip("unified_planning.io")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings of pyparsing
        io.PDDLReader().parse_problem_string(domain, problem)


def least(problem: Problem, level: int | None = None, most: int = MOST) -> float | None:
    level = max(problem.domain.levels, default=1) if level is None else level
    found = Interpreter(replace(problem, goal=problem.goal_on(level))).explored(level, most, rests=False).least
    return None if found is None else float(found)


def round_trip(problem: Problem, level: int | None = None) -> Problem:
    exported = to_pddl(problem, level)
    if ":derived " not in exported.domain:  # the reader doesn't support derived predicates
        read_by_unified_planning(exported.domain, exported.problem)
    return imported(parse(exported.domain, exported.problem)).problem


@pytest.mark.parametrize("seed", range(7_000_001, 7_000_009))
def test_a_random_world_costs_the_same_behind_its_export_on_every_level(seed: int) -> None:
    meant = mixed(seed).problem
    aggregates = {
        name: unfolded(one, meant.domain.rules, meant.domain.situations)
        for name, one in meant.domain.aggregates.items()
    }
    domain = compiled(replace(meant.domain, aggregates=aggregates), meant.classes)
    initial = with_totals(domain, meant.classes, meant.relations, meant.initial)
    problem = replace(meant, scene="x/d/p", domain=domain, initial=initial)
    for level in problem.domain.levels:
        try:
            again = round_trip(problem, level)
        except KnowledgeError as refused:
            assert "a fraction, which its whole numbers forbid and PDDL can't" in str(refused)
            continue
        try:
            assert least(again, most=4 * MOST) == pytest.approx(least(problem, level))
        except TooManyStatesError:
            continue


@pytest.mark.parametrize(
    ("name", "status"),
    [("export-both-signs", Status.UNSOLVABLE), ("export-undeclared-constant", Status.SOLVED)],
)
def test_a_domain_keeps_its_meaning_when_it_is_imported_and_exported(tmp_path: Path, name: str, status: Status) -> None:
    files = CASES / name / "d.pddl", CASES / name / "p.pddl"
    found = imported(parse_files(*files)).problem
    assert plan_level(found).status is plan_level(round_trip(found)).status is status
    import_pddl(*files, tmp_path / "scene.ttl")
    assert all(finding.severity == "remark" for finding in validate([tmp_path / "scene.ttl"]))


def test_an_import_that_planning_could_not_use_is_refused_and_writes_no_file(tmp_path: Path) -> None:
    files = CASES / "import-unusable" / "d.pddl", CASES / "import-unusable" / "p.pddl"
    with pytest.raises(KnowledgeError) as refused:
        import_pddl(*files, tmp_path / "scene.ttl")
    assert str(refused.value) == (
        f"{files[1]}:4:18: 'north' is of type object; predicate 'at' takes a quay there; "
        "is there no '-' before 'quay' in (:objects …)?"
    )
    assert list(tmp_path.iterdir()) == []


PATHS = """(:predicates (way ?x ?y) (path ?x ?y)) (:constants a b)
 (:derived (path ?x ?y) (or (way ?x ?y) (exists (?z) (and (way ?x ?z) (path ?z ?y)))))
 (:action build :parameters (?x ?y) :effect (way ?x ?y))"""
FUEL = """(:predicates (full ?t)) (:functions (fuel ?t) (total-cost))
 (:action fill :parameters (?t) :effect (and ({} (fuel ?t) 1) (full ?t) (increase (total-cost) {})))"""
FUELLED = "(:objects t m) (:init (= (fuel t) 0) {}) (:goal (full t)) (:metric minimize (total-cost))"
NO_NUMBER = "(fuel m) has no number in :init, but actions change 'fuel'"


@pytest.mark.parametrize(
    ("domain", "problem", "said"),
    [
        (FUEL.format("increase", 1), FUELLED.format(""), NO_NUMBER),
        (FUEL.format("assign", 1), FUELLED.format(""), NO_NUMBER),
        (FUEL.format("increase", 10**10), FUELLED.format("(= (fuel m) 0)"), "c:cost is '10000000000'"),
        *(
            (f"{PATHS} (:constraints {one})", "(:init) (:goal (way b a))", "'path' is derived from itself")
            for one in (
                "(always (not (path a a)))",
                "(sometime (path a b))",
                "(at-most-once (path a b))",
                "(sometime-before (way b a) (path a b))",
            )
        ),
    ],
)
def test_an_import_whose_scene_would_be_refused_is_refused_and_writes_no_file(
    domain: str, problem: str, said: str, tmp_path: Path
) -> None:
    files = tmp_path / "d.pddl", tmp_path / "p.pddl"
    for file, text in zip(
        files, (f"(define (domain d) {domain})", f"(define (problem e) (:domain d) {problem})"), strict=True
    ):
        file.write_text(text)
    with pytest.raises(KnowledgeError) as refused:
        import_pddl(*files, tmp_path / "scene.ttl")
    assert said in str(refused.value)
    assert set(tmp_path.iterdir()) == {*files}


# ---------------------------------------------------------------------------------------------------------- messages

AT = SituationType("AT", ("Thing",), "Place")
LIT = SituationType("LIT", ("Thing",), "Truth", default=FALSE, boolean=True)
LOAD = SituationType("LOAD", ("Thing",), "LOAD", quantity=Quantity())


def at(thing: str, place: str, negated: bool = False) -> ValueCondition:
    return ValueCondition("AT", (thing,), place, negated)


def problem_of(
    *behaviors: Behavior, rules: dict[str, tuple[Rule, ...]] | None = None, names: Callable[[str], str] = str
) -> Problem:
    situations = {one.name: one for one in (AT, LIT, LOAD)}
    situations |= {name: SituationType(name, ("Thing",), "Truth", boolean=True) for name in rules or {}}
    classes = {
        "Thing": (names("a"), names("b")),
        "Place": (names("m"), names("n"), names("o")),
        "Empty": (),
        "Edge": (names("o"),),
        "Truth": (TRUE, FALSE),
    }
    initial = {Symbol("AT", (names("a"),)): names("m"), Symbol("AT", (names("b"),)): names("n")}
    initial[Symbol("LOAD", (names("a"),))] = "1"
    domain = Domain(situations, {one.name: one for one in behaviors}, rules=rules or {})
    goal = {Symbol("AT", (names("a"),)): names("n"), Symbol("AT", (names("b"),)): names("m")}
    return Problem("x/d/p", domain, classes, {}, initial, goal)


THING, OTHER, PLACE = Parameter("?x", "Thing"), Parameter("?y", "Thing"), Parameter("?p", "Place")
PLACE_IS_FREE = Witness("?z", "Thing", (at("?z", "?p"),), negated=True)
LIGHT = ValueEffect("LIT", ("?x",), TRUE)
MOVE = Behavior("MOVE", 1, (THING, PLACE), (), (PLACE_IS_FREE,), (ValueEffect("AT", ("?x",), "?p"),))
ANY_PLACE = Behavior(
    "ANY_PLACE",
    1,
    (),
    variables=(Parameter("?p", "Place"),),
    effects=(
        ValueEffect("LIT", ("b",), TRUE, (at("b", "?p"),)),
        ValueEffect("AT", ("a",), "n", (at("a", "?p"),)),
        ValueEffect("AT", ("b",), "m", (at("b", "?p"),)),
    ),
)
NONE_AT_AN_EDGE = Witness("?z", "Thing", (at("?z", "?e"),), negated=True)
JUMP = Behavior("JUMP", 1, (THING, PLACE), (), (), (ValueEffect("AT", ("?x",), "?p"),))
EMPTY = AmountEffect("LOAD", ("a",), "assign", Fraction(0))
SWAP = Behavior(
    "SWAP",
    1,
    (THING, OTHER),
    (Parameter("?p", "Place"), Parameter("?q", "Place")),
    (at("?x", "?p"), at("?y", "?q"), EqualityCondition("?x", "?y", True)),
    (ValueEffect("AT", ("?x",), "?q"), ValueEffect("AT", ("?y",), "?p")),
)


@pytest.mark.parametrize(
    ("behaviors", "cost"),
    [
        ([MOVE], 3.0),
        ([JUMP], 2.0),
        ([SWAP], 1.0),
        ([MOVE, JUMP], 2.0),  # two objects may be at one place, so the predicate "free" isn't maintained by itself
        ([replace(MOVE, preconditions=(PLACE_IS_FREE, at("?x", "?p", negated=True)))], 3.0),
        # the later effect takes precedence
        ([replace(JUMP, effects=(*JUMP.effects, ValueEffect("AT", ("b",), "m")))], 1.0),
        ([replace(JUMP, effects=(ValueEffect("AT", ("b",), "m"), *JUMP.effects))], 1.0),
        ([replace(SWAP, preconditions=SWAP.preconditions[:2])], 1.0),
        ([replace(SWAP, effects=(ValueEffect("AT", ("?x",), "?q", (at("?y", "?q"),)), *SWAP.effects[1:]))], 1.0),
        ([ANY_PLACE], 1.0),  # each effect has a variable of its own
        ([JUMP, replace(MOVE, name="NEVER", parameters=(Parameter("?x", "Empty"), PLACE))], 2.0),
        ([JUMP, replace(SWAP, preconditions=(*SWAP.preconditions, Witness("?e", "Empty", ())))], 2.0),
        ([replace(JUMP, preconditions=(ValueCondition("LIT", ("?x",), FALSE),), effects=(*JUMP.effects, LIGHT))], 2.0),
        ([replace(JUMP, amounts=(AmountEffect("LOAD", ("?x",), "assign", Amount("LOAD", ("a",))),))], 2.0),
        ([replace(JUMP, variables=(Parameter("?e", "Edge"),), preconditions=(NONE_AT_AN_EDGE,))], 2.0),
        ([replace(JUMP, amounts=(replace(EMPTY, when=(PLACE_IS_FREE,)), replace(EMPTY, operation="scale")))], 2.0),
    ],
)  # fmt: skip
def test_an_exported_behaviour_keeps_its_meaning(behaviors: list[Behavior], cost: float) -> None:
    problem = problem_of(*behaviors)
    assert least(problem) == least(round_trip(problem)) == cost


INCREASED = AmountEffect("LOAD", ("?y",), "increase", Fraction(2))
ALWAYS, HEAVY = EqualityCondition("?x", "?x"), Comparison(Amount("LOAD", ("?x",)), ">=", Fraction(1))


@pytest.mark.parametrize(
    ("amounts", "load"),
    [
        ((AmountEffect("LOAD", ("?x",), "assign", Fraction(0)), INCREASED), 2),
        ((INCREASED, AmountEffect("LOAD", ("?x",), "assign", Fraction(0))), 2),  # assignments come first
        ((AmountEffect("LOAD", ("?x",), "assign", Fraction(5)), replace(INCREASED, operation="decrease")), 3),
        ((AmountEffect("LOAD", ("?x",), "scale", Fraction(3)), INCREASED), 5),
        ((AmountEffect("LOAD", ("?x",), "assign", Fraction(0), (HEAVY,)), INCREASED), 2),
        ((AmountEffect("LOAD", ("?x",), "assign", Fraction(0), (ALWAYS,)), replace(INCREASED, arguments=("?x",))), 2),
        ((AmountEffect("LOAD", ("?x",), "assign", Fraction(0), (HEAVY,)), replace(INCREASED, arguments=("?x",))), 2),
        ((AmountEffect("LOAD", ("?x",), "increase", Fraction(1)), INCREASED), 4),
    ],
)
def test_effects_that_may_change_one_amount_are_one_effect_of_an_exported_action(
    amounts: tuple[AmountEffect, ...], load: int
) -> None:
    io = pytest.importorskip("unified_planning.io")
    engines = pytest.importorskip("unified_planning.engines.sequential_simulator")
    problem = problem_of(Behavior("POUR", 1, (THING, OTHER), (), (), (), amounts=amounts))
    exported = to_pddl(replace(problem, goal={Symbol("LOAD", ("a",)): str(load)}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings of pyparsing
        task = io.PDDLReader().parse_problem_string(exported.domain, exported.problem)
        with engines.UPSequentialSimulator(task) as simulator:
            first = simulator.get_initial_state()
            (one,) = [found for found in simulator.get_applicable_actions(first) if {*map(str, found[1])} == {"a"}]
            after = simulator.apply(first, *one)
    assert {str(symbol): after.get_value(symbol).constant_value() for symbol in task.initial_values}["load(a)"] == load


FARE = Measure("fare", ("?p",))
HERE, ANY_HERE = at("?x", "?p"), Witness("?z", "Place", (at("?x", "?z"),))


@pytest.mark.parametrize(("by", "when"), [(FARE, HERE), (Fraction(1), ANY_HERE)])
def test_the_bounds_of_an_amount_limit_the_sum_of_effects_with_one_condition(
    by: Fraction | Measure, when: Condition
) -> None:
    pay = AmountEffect("LOAD", ("?x",), "increase", by, (when,))
    problem = problem_of(
        Behavior("PAY", 1, (THING,), (Parameter("?p", "Place"),), (), (LIGHT,), amounts=(pay, replace(pay)))
    )
    problem = replace(problem, relations={"fare": frozenset({("m", "1"), ("n", "1")})})
    for most, cost in ((2, None), (3, 1.0)):
        kinds = {**problem.domain.situations, "LOAD": replace(LOAD, quantity=Quantity(most=Fraction(most)))}
        limited = replace(problem, domain=replace(problem.domain, situations=kinds), goal={Symbol("LIT", ("a",)): TRUE})
        assert least(limited) == least(round_trip(limited)) == cost


def test_an_exported_behaviour_needs_its_calculated_duration() -> None:
    far = Measure("far", ("?x", "?p"))
    condition = Comparison(far, ">=", Fraction(0))
    drive = replace(JUMP, preconditions=(condition,), timing=Timing(far, (), ((Span.START, condition),), ()))
    problem = replace(problem_of(drive), relations={"far": frozenset({("a", "n", "1"), ("b", "m", "-1")})})
    assert least(problem) is least(round_trip(problem)) is None
    problem = replace(problem, relations={"far": frozenset({("a", "n", "1"), ("b", "m", "0")})})
    assert least(problem) == least(round_trip(problem)) == 2.0


def test_many_conditional_effects_become_a_limited_number_of_actions() -> None:
    things = tuple(f"t{i}" for i in range(8))
    fall = behavior("FALL", 1, "", [], [ValueEffect("AT", (one,), "o", (at(one, "m"),)) for one in things])
    classes = {"Thing": things, "Place": ("m", "n", "o")}
    problem = world([AT], [fall], classes, {f"AT {one}": "m" for one in things}, {f"AT {one}": "o" for one in things})
    assert len(to_pddl(problem).actions) <= 64
    assert least(problem) == least(round_trip(problem)) == 1.0


def test_an_exported_amount_has_a_value_for_each_object_that_its_function_accepts() -> None:
    fill = AmountEffect("LOAD", ("?x",), "increase", Fraction(1))  # b has no LOAD, which stays as it is
    problem = problem_of(replace(JUMP, amounts=(fill,)))
    exported = to_pddl(problem)
    assert "(= (load b) 0)" in exported.problem
    assert "(has_load b)" not in exported.problem
    assert least(problem) == least(round_trip(problem)) == 2.0


@pytest.mark.parametrize(("most", "cost"), [(5, None), (6, 3.0)])
def test_an_amount_that_an_amount_scales_keeps_its_bounds_in_an_export(most: int, cost: float | None) -> None:
    grow = replace(behavior("GROW", 1, "", [], []), amounts=(AmountEffect("RATE", (), "increase", Fraction(1)),))
    scale = replace(behavior("SCALE", 1, "", [], []), amounts=(AmountEffect("N", (), "scale", Amount("RATE", ())),))
    kinds = [SituationType(name, (), name, quantity=Quantity(most=Fraction(most))) for name in ("N", "RATE")]
    problem = world(kinds, [grow, scale], {}, {"N": "2", "RATE": "1"}, {"N": ">=6"})
    assert least(problem) == least(round_trip(problem)) == cost


@pytest.mark.parametrize(
    ("divisor", "negated", "cost"),
    [
        (Fraction(0), False, None),
        (Fraction(0), True, 1.0),
        (Amount("RATE", ()), False, 2.0),
        (Amount("RATE", ()), True, 1.0),
        (Calculation("-", Amount("RATE", ()), Amount("RATE", ())), False, None),
    ],
)
def test_a_comparison_of_a_division_by_zero_is_false_in_an_export(
    divisor: Expression, negated: bool, cost: float | None
) -> None:
    grow = replace(behavior("GROW", 1, "", [], []), amounts=(AmountEffect("RATE", (), "increase", Fraction(1)),))
    small = Comparison(Calculation("/", Amount("RATE", ()), divisor), "<=", Fraction(5), negated)
    end = behavior("END", 1, "", [small], [ValueEffect("ENDED", (), TRUE)])
    ended = SituationType("ENDED", (), "Truth", boolean=True, default=FALSE)
    kinds = [SituationType("RATE", (), "RATE", quantity=Quantity(least=Fraction(0), most=Fraction(3))), ended]
    problem = world(kinds, [grow, end], {}, {"RATE": "0"}, {"ENDED": TRUE})
    exported = to_pddl(problem)
    read_by_unified_planning(exported.domain, exported.problem)
    assert "/ (rate) 0" not in exported.domain
    assert least(problem) == least(round_trip(problem)) == cost


def test_an_export_with_an_initial_amount_that_no_decimal_number_states_is_refused() -> None:
    kinds = [SituationType("N", (), "N", quantity=Quantity())]
    more = replace(behavior("MORE", 1, "", [], []), amounts=(AmountEffect("N", (), "increase", Fraction(1, 3)),))
    problem = world(kinds, [more], {}, {"N": "1/4"}, {"N": ">=1"})
    assert least(problem) == least(round_trip(problem)) == 3.0
    with pytest.raises(KnowledgeError, match=r"\(n\) is 1/3 initially"):
        to_pddl(replace(problem, initial={Symbol("N", ()): "1/3"}))


def test_rules_are_written_in_place_of_their_facts_unless_they_are_recursive() -> None:
    rule = Rule(
        "NEAR",
        (Parameter("?p", "Thing"),),
        (),
        (
            Witness(
                "?x",
                "Place",
                (at("?p", "?x"), at("b", "?x")),
            ),
        ),
    )
    asked = replace(JUMP, preconditions=(ValueCondition("NEAR", ("?x",), FALSE), at("?x", "o", True)))
    problem = problem_of(JUMP, replace(asked, name="ASK"), rules={"NEAR": (rule,)})
    assert ":derived" not in to_pddl(problem).domain
    assert least(problem) == least(round_trip(problem))
    own = replace(rule, conditions=(*rule.conditions, ValueCondition("NEAR", ("?p",), TRUE)))
    recursive = problem_of(JUMP, replace(asked, name="ASK"), rules={"NEAR": (rule, own)})
    assert "(:derived (near" in to_pddl(recursive).domain
    assert least(recursive) == least(round_trip(recursive))


@pytest.mark.parametrize(
    "names",
    [
        lambda name: name.upper() if name in "am" else f"{name.upper()}_",
        lambda name: {"a": "and", "b": "NOT", "m": "object", "n": "define", "o": "total-cost"}[name],
        lambda name: {"a": "Tasse ä", "b": "Tasse ö", "m": "1", "n": "-2", "o": "茶"}[name],
        lambda name: {"a": "AT", "b": "at", "m": "Jump", "n": "thing", "o": "Place"}[name],
        lambda name: {"a": "d", "b": "p", "m": "?", "n": "()", "o": ";"}[name],
    ],
)
def test_names_that_pddl_can_not_distinguish_or_read_are_changed(names: Callable[[str], str]) -> None:
    problem = problem_of(JUMP, names=names)
    exported = to_pddl(problem)
    assert set(exported.objects.values()) == {names(name) for name in "abmno"}
    assert least(round_trip(problem)) == 2.0


def test_an_exported_effect_may_give_a_value_of_a_wider_class() -> None:
    leave = Behavior("LEAVE", 1, (Parameter("?v", "Wide"),), effects=(ValueEffect("AT", ("a",), "?v"),))
    lit = Behavior("LIT", 1, (THING,), (), (at("?x", "m", negated=True), at("?x", "n", negated=True)), (LIGHT,))
    problem = replace(problem_of(leave, lit), goal={Symbol("LIT", ("a",)): TRUE})
    problem = replace(problem, classes={**problem.classes, "Place": ("m", "n"), "Wide": ("n", "away")})
    assert least(problem) == least(round_trip(problem)) == 2.0


@pytest.mark.parametrize(("the_world", "cost"), [("a", 1.0), ("w", None)])
def test_a_fact_about_the_world_is_not_about_other_individuals(the_world: str, cost: float | None) -> None:
    sunny = ValueCondition("SKY", ("?x",), "m")
    problem = problem_of(Behavior("LIGHT", 1, (Parameter("?x", "Any"),), (), (sunny,), (LIGHT,)))
    kinds = {**problem.domain.situations, "SKY": SituationType("SKY", ("World",), "Place")}
    problem = replace(
        problem,
        domain=replace(problem.domain, situations=kinds),
        classes={**problem.classes, "World": (the_world,), "Any": ("a", "b", "w")},
        initial={**problem.initial, Symbol("SKY", (the_world,)): "m"},
        goal={Symbol("LIT", ("a",)): TRUE},
    )
    assert least(problem) == least(round_trip(problem)) == cost


def test_a_relation_with_the_name_of_the_predicate_for_different_individuals_keeps_its_meaning() -> None:
    related = RelationCondition("different", ("?x", "?p"))
    behaviors = [
        replace(JUMP, name=f"JUMP{i}", preconditions=(related, at("?x", one, True))) for i, one in enumerate("mn")
    ]
    problem = replace(problem_of(*behaviors), relations={"different": frozenset({("a", "n"), ("b", "m"), ("a", "m")})})
    problem = replace(problem, goal={Symbol("AT", ("b",)): "m"})
    assert least(problem) == least(round_trip(problem)) == 1.0


def test_an_export_ends_by_the_deadline() -> None:
    problem = confab.load("two-cups").problem
    with confab.within(0.0), pytest.raises(OutOfTimeError, match="exporting the facts"):
        to_pddl(problem)
