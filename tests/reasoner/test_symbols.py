"""The values of a planning problem have their stated meaning: numbers, levels, rest values, and conditions after substitution."""

from dataclasses import FrozenInstanceError, fields, is_dataclass, replace
from fractions import Fraction

import pytest

from confab.reasoner import symbols
from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, Quantity
from confab.reasoner.effects import allowed, spread
from confab.reasoner.language import substituted
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    Fact,
    GroundBehavior,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)
from worlds.writing import becomes, behavior, has, lacks, world

HALF = Fraction(1, 2)


def small() -> Problem:
    """Return two cups, three places (one only on level 2), a door that is at rest when shut, and a lamp at rest when off."""
    return world(
        [
            SituationType("AT", ("Cup",), "Place"),
            SituationType("DOOR", ("Door",), "DOOR", level=2, rest="shut"),
            SituationType("LIT", ("Lamp",), "Truth", rest=FALSE, boolean=True),
            SituationType("HOT", ("Cup",), "Truth", rest=FALSE, boolean=True),
        ],
        [
            behavior("PUT", 2, "?c:Cup ?p:Place", [], [becomes("AT", "?c", "?p")]),
            behavior("BRING", 1, "?c:Cup ?p:Place", [], [becomes("AT", "?c", "?p")]),
            behavior("LIGHT", 2, "?l:Lamp", [], [becomes("LIT", "?l", TRUE)]),
            behavior("WAIT", 1, "", [], []),
        ],
        {"Cup": ("cup1", "cup2"), "Place": ("shelf", "table", "drawer"), "Door": ("door",), "Lamp": ("lamp1", "lamp2"),
         "DOOR": ("open", "shut")},
        {"AT cup1": "shelf", "AT cup2": "shelf", "DOOR door": "shut", "LIT lamp1": TRUE},
        {"AT cup1": "table"},
        value_levels={"drawer": 2},
    )  # fmt: skip


def test_values_of_a_problem_are_immutable_and_have_plain_defaults() -> None:
    kinds = [kind for kind in vars(symbols).values() if isinstance(kind, type) and is_dataclass(kind)]
    assert len(kinds) > 15
    for kind in kinds:
        one = object.__new__(kind)
        with pytest.raises(FrozenInstanceError):
            setattr(one, fields(kind)[0].name, "other")
    plain = (has("A", "x"), RelationCondition("near", ()), ClassCondition("x", "A"), EqualityCondition("x", "y"),
             Witness("?x", "A", ()), AnyOf(()), Comparison(HALF, "<", HALF))  # fmt: skip
    assert not any(condition.negated for condition in plain)
    assert (SituationType("A", (), "A").level, SituationType("A", (), "A").boolean) == (1, False)
    assert Behavior("DO", 1, ()).cost == 1.0


def test_facts_and_steps_are_printed_in_the_notation_of_users() -> None:
    near = Symbol("NEAR", ("cup1", "shelf"))
    assert str(near) == "<cup1, shelf, NEAR>"
    assert str(Fact(near, TRUE)) == "cup1 NEAR shelf true"
    assert str(GroundBehavior(22, "PUT", ("cup1", "table"))) == "22 PUT cup1 table"


def test_ids_count_behaviours_and_arguments_in_declared_order_separately_for_each_level() -> None:
    problem = replace(small(), domain=replace(small().domain, first_ids={2: 7}))
    ids = {
        (name, arguments): problem.id_of(name, arguments)
        for name, arguments in (
            ("BRING", ("cup1", "shelf")),
            ("BRING", ("cup1", "drawer")),
            ("BRING", ("cup2", "shelf")),
            ("WAIT", ()),
            ("PUT", ("cup1", "shelf")),
            ("PUT", ("cup2", "drawer")),
            ("LIGHT", ("lamp2",)),
        )
    }
    assert list(ids.values()) == [0, 2, 3, 6, 7, 12, 14]
    with pytest.raises(ValueError, match="argument"):
        problem.id_of("PUT", ("cup1",))


def test_the_levels_of_a_domain_are_those_with_behaviours() -> None:
    domain = small().domain
    assert domain.levels == (1, 2)
    assert [b.name for b in domain.at_level(1)] == ["BRING", "WAIT"]
    assert domain.at_level(3) == ()


def test_a_level_sees_what_exists_on_it() -> None:
    problem = small()
    at, door, of_drawer = Symbol("AT", ("cup1",)), Symbol("DOOR", ("door",)), Symbol("AT", ("drawer",))
    assert problem.values(at, 1) == ("shelf", "table")
    assert problem.values(at, 2) == ("shelf", "table", "drawer")
    assert [problem.first_level(symbol) for symbol in (at, door, of_drawer)] == [1, 2, 2]
    assert problem.sees(1, at, "table")
    assert not problem.sees(1, at, "drawer")
    assert problem.sees(2, at, "drawer")
    assert not problem.sees(1, door, "shut")
    assert problem.sees(2, door, "shut")
    assert problem.members("Cup") == {"cup1", "cup2"}
    assert problem.members("Plate") == frozenset()


def test_values_at_rest_initially_are_goals_of_their_level_unless_a_goal_requires_another_value() -> None:
    problem = small()
    assert problem.at_rest(1) == {}
    # The second lamp is off although no fact states it, and the level can change that; no behaviour makes cups hot.
    assert problem.at_rest(2) == {Symbol("DOOR", ("door",)): "shut", Symbol("LIT", ("lamp2",)): FALSE}
    wanted = replace(problem, goal={Symbol("DOOR", ("door",)): "open"})
    assert wanted.goal_on(2) == {Symbol("DOOR", ("door",)): "open", Symbol("LIT", ("lamp2",)): FALSE}
    stated = replace(problem, initial={**problem.initial, Symbol("LIT", ("lamp2",)): TRUE})
    assert Symbol("LIT", ("lamp2",)) not in stated.at_rest(2)


def test_effects_are_sorted_in_the_order_in_which_they_are_applied() -> None:
    true, false, other = becomes("LIT", "?l", TRUE), becomes("LIT", "?l", FALSE), becomes("AT", "?c", "?p")
    grow, double, fix = (AmountEffect("FILL", ("?c",), how, HALF) for how in ("increase", "scale", "assign"))
    made = replace(behavior("DO", 1, "?l:Lamp", [], [true, other, false]), amounts=(grow, double, fix))
    assert made.effects == (false, true, other)
    assert made.amounts == (fix, double, grow)
    assert made.every_effect == (false, true, other, fix, double, grow)
    assert made.changes == {"LIT", "AT", "FILL"}


def test_conditions_of_effects_are_conditions_of_the_behaviour() -> None:
    asked, when = has("AT", "?c", "shelf"), lacks("LIT", "?l", TRUE)
    made = behavior("DO", 1, "?c:Cup", [asked], [becomes("AT", "?c", "table", when=(when,))], "?l:Lamp")
    assert made.conditions == (asked, when)
    assert made.kinds == {"?c": "Cup", "?l": "Lamp"}


def test_a_rule_as_a_behaviour_makes_its_situation_type_true() -> None:
    condition = has("AT", "?c", "?p")
    rule = Rule("STANDS", (Parameter("?c", "Cup"),), (Parameter("?p", "Place"),), (condition,))
    made = rule.behavior
    assert (made.name, made.level, made.cost) == ("STANDS", 1, 0.0)
    assert (made.parameters, made.variables, made.preconditions) == (rule.parameters, rule.variables, (condition,))
    assert made.effects == (ValueEffect("STANDS", ("?c",), TRUE),)


def test_the_condition_of_a_price_is_separated_from_the_other_preconditions() -> None:
    free = behavior("DO", 1, "?c:Cup", [has("AT", "?c", "shelf")], [])
    assert free.priced is None
    assert free.asked == free.preconditions
    priced = replace(free, price=Amount("FILL", ("?c",)))
    assert priced.priced == Comparison(Amount("FILL", ("?c",)), ">=", Fraction(0))
    asks = replace(priced, preconditions=(*free.preconditions, priced.priced))
    assert asks.asked == free.preconditions


# --------------------------------------------------------------------------------------------------------- substituted


@pytest.mark.parametrize("negated", [False, True])
def test_substitution_replaces_terms_in_every_kind_of_condition(negated: bool) -> None:
    put = {"?a": "cup1", "?b": "shelf"}
    fill, way = Amount("FILL", ("?a",)), Measure("way", ("?a", "?b"))
    pairs: list[tuple[Condition, Condition]] = [
        (ValueCondition("AT", ("?a", "?x"), "?b", negated), ValueCondition("AT", ("cup1", "?x"), "shelf", negated)),
        (RelationCondition("near", ("?x", "?a"), negated), RelationCondition("near", ("?x", "cup1"), negated)),
        (ClassCondition("?b", "Place", negated), ClassCondition("shelf", "Place", negated)),
        (EqualityCondition("?a", "?b", negated), EqualityCondition("cup1", "shelf", negated)),
        (EqualityCondition("?x", "?y", negated), EqualityCondition("?x", "?y", negated)),
        (
            Comparison(Calculation("+", fill, HALF), "<", way, negated),
            Comparison(
                Calculation("+", Amount("FILL", ("cup1",)), HALF), "<", Measure("way", ("cup1", "shelf")), negated
            ),
        ),
        (
            AnyOf(((has("AT", "?a", "?b"),), (ClassCondition("?a", "Cup"), lacks("LIT", "?x", TRUE))), negated),
            AnyOf(((has("AT", "cup1", "shelf"),), (ClassCondition("cup1", "Cup"), lacks("LIT", "?x", TRUE))), negated),
        ),
        (
            Witness("?o", "Cup", (has("AT", "?o", "?b"), lacks("AT", "?a", "?b")), negated),
            Witness("?o", "Cup", (has("AT", "?o", "shelf"), lacks("AT", "cup1", "shelf")), negated),
        ),
    ]
    for before, after in pairs:
        assert substituted(before, put) == after


def test_substitution_neither_replaces_nor_captures_the_variable_of_a_witness() -> None:
    free = Witness("?o", "Cup", (has("AT", "?o", "?p"),), negated=True)
    assert substituted(free, {"?o": "cup1"}) == free
    captured = substituted(free, {"?p": "?o"})
    assert isinstance(captured, Witness)
    assert captured.variable != "?o"
    assert captured.conditions == (has("AT", captured.variable, "?o"),)


# -------------------------------------------------------------------------------------------------- spread and allowed


def test_an_effect_on_a_class_becomes_one_effect_for_each_individual() -> None:
    each = Parameter("?x", "Cup")
    moved = ValueEffect("AT", ("?x",), "?p", (has("AT", "?x", "tray"),), each)
    same = ValueEffect("TOLD", ("tray",), "?x", (), each)
    emptied = AmountEffect("FILL", ("?x",), "increase", Measure("size", ("?x",)), (ClassCondition("?x", "Cup"),), each)
    lifted = replace(
        behavior("CARRY", 1, "?p:Place", [], [moved, same, becomes("LIT", "lamp", TRUE)]), amounts=(emptied,)
    )
    found = spread(lifted, {"Cup": ("cup1", "cup2")})
    assert set(found.effects) == {
        ValueEffect("AT", ("cup1",), "?p", (has("AT", "cup1", "tray"),)),
        ValueEffect("AT", ("cup2",), "?p", (has("AT", "cup2", "tray"),)),
        ValueEffect("TOLD", ("tray",), "cup1"),
        ValueEffect("TOLD", ("tray",), "cup2"),
        becomes("LIT", "lamp", TRUE),
    }
    assert set(found.amounts) == {
        AmountEffect("FILL", (c,), "increase", Measure("size", (c,)), (ClassCondition(c, "Cup"),))
        for c in ("cup1", "cup2")
    }
    assert found.spread == {"cup1", "cup2"}
    assert spread(found, {"Cup": ("cup1", "cup2")}) is found
    assert spread(lifted, {}).effects == (becomes("LIT", "lamp", TRUE),)


@pytest.mark.parametrize(
    ("preconditions", "effects"),
    [([has("AT", "cup1", "shelf")], []), ([], [becomes("AT", "cup1", "shelf")]), ([], [becomes("ON", "tray", "cup1")])],
)
def test_an_individual_that_another_condition_or_effect_names_is_not_in_the_spread(
    preconditions: list[Condition], effects: list[ValueEffect]
) -> None:
    moved = ValueEffect("AT", ("?x",), "?p", (), Parameter("?x", "Cup"))
    found = spread(behavior("CARRY", 1, "?p:Place", preconditions, [moved, *effects]), {"Cup": ("cup1", "cup2")})
    assert found.spread == {"cup2"}


FILL, SIZE = Amount("FILL", ("?c",)), Measure("size", ("?c",))


@pytest.mark.parametrize(
    ("operation", "by", "after"),
    [
        ("increase", HALF, Calculation("+", FILL, HALF)),
        ("decrease", SIZE, Calculation("-", FILL, SIZE)),
        ("scale", HALF, Calculation("*", FILL, HALF)),
    ],
)
def test_a_behaviour_that_changes_an_amount_requires_that_it_stays_within_its_bounds(
    operation: str, by: Expression, after: Expression
) -> None:
    def asked(least: Fraction | None, most: Fraction | None, when: tuple[Condition, ...] = ()) -> tuple[Condition, ...]:
        kinds = {"FILL": SituationType("FILL", ("Cup",), "FILL", quantity=Quantity("", least=least, most=most))}
        effect = AmountEffect("FILL", ("?c",), operation, by, when)
        return allowed(Behavior("POUR", 1, (Parameter("?c", "Cup"),), amounts=(effect,)), kinds)

    least, most = Comparison(after, "<", Fraction(0), negated=True), Comparison(after, ">", Fraction(9), negated=True)
    assert asked(None, None) == ()
    assert asked(Fraction(0), None) == (least,)
    assert asked(None, Fraction(9)) == (most,)
    assert asked(Fraction(0), Fraction(9)) == (least, most)
    when = (ClassCondition("?c", "Cup"),)
    assert asked(Fraction(0), None, when=when) == (AnyOf(((*when, replace(least, negated=False)),), negated=True),)


def test_an_assigned_amount_has_to_be_within_its_bounds_if_the_amount_exists() -> None:
    kinds = {"FILL": SituationType("FILL", ("Cup",), "FILL", quantity=Quantity("", least=Fraction(0)))}
    (asked,) = allowed(Behavior("FIX", 1, (), amounts=(AmountEffect("FILL", ("?c",), "assign", SIZE),)), kinds)
    there = Comparison(FILL, "=", FILL)
    assert asked == AnyOf(((there, Comparison(SIZE, "<", Fraction(0))),), negated=True)


def test_bounds_that_no_condition_can_express_add_no_precondition() -> None:
    kinds = {
        name: SituationType(name, ("Cup",), name, quantity=Quantity("", least=Fraction(0))) for name in ("FILL", "HEAT")
    }
    twice = tuple(AmountEffect("FILL", (c,), "decrease", HALF) for c in ("?c", "?d"))
    assert allowed(Behavior("POUR", 1, (), amounts=twice), kinds) == ()
    by_another = AmountEffect("FILL", ("?c",), "scale", Amount("HEAT", ("?c",)))
    assert allowed(Behavior("BOIL", 1, (), amounts=(by_another,)), kinds) == ()
    one_of_each = (twice[0], AmountEffect("HEAT", ("?c",), "decrease", HALF))
    assert len(allowed(Behavior("POUR", 1, (), amounts=one_of_each), kinds)) == 2
