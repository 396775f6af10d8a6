"""The variables that each kind of condition names, binds and contains; all searches rely on these functions."""

from fractions import Fraction

import pytest

from confab.reasoner.amounts import Amount, Calculation, Measure
from confab.reasoner.language import groups, is_variable, measures, mentions, needs, nothing_determines, terms, walk
from confab.reasoner.sentences import said
from confab.reasoner.symbols import (
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    Witness,
)
from worlds.writing import has, lacks

AT, NOT_AT = has("AT", "?c", "?p"), lacks("AT", "?c", "?p")
NEAR, KIND, SAME = RelationCondition("near", ("?p", "door")), ClassCondition("?c", "Cup"), EqualityCondition("?c", "?d")
FULL = Comparison(Calculation("+", Amount("FILL", ("?c",)), Fraction(1)), "<", Measure("size", ("?c", "?d")))
WITNESS = Witness("?o", "Cup", (has("AT", "?o", "?p"), has("IN", "?p", "?room"), lacks("AT", "?o", "?q")), negated=True)
EITHER = AnyOf(((has("AT", "?c", "?p"), NEAR), (KIND, SAME)))


@pytest.mark.parametrize(
    ("condition", "named", "mentioned", "needed"),
    [
        (AT, ("?c", "?p"), {"?c", "?p"}, {"?c"}),
        (NOT_AT, ("?c", "?p"), {"?c", "?p"}, {"?c", "?p"}),
        (has("AT", "cup1", "?p"), ("cup1", "?p"), {"?p"}, set()),
        (NEAR, ("?p", "door"), {"?p"}, {"?p"}),
        (KIND, ("?c",), {"?c"}, {"?c"}),
        (SAME, ("?c", "?d"), {"?c", "?d"}, {"?c", "?d"}),
        (FULL, ("?c", "?c", "?d"), {"?c", "?d"}, {"?c", "?d"}),
        # The condition determines ?p, and with ?p also ?room; but the individuals that aren't at ?q can't be determined without
        # ?q.
        (WITNESS, (), {"?p", "?room", "?q"}, {"?q"}),
        (EITHER, (), {"?c", "?p", "?d"}, {"?c", "?d"}),
        (Witness("?o", "Cup", (NEAR,)), (), {"?p"}, {"?p"}),
        (AnyOf(((WITNESS,), (NEAR,))), (), {"?p", "?room", "?q"}, {"?p", "?q"}),
    ],
)
def test_each_kind_of_condition_has_the_right_terms_mentions_and_needs(
    condition: Condition, named: tuple[str, ...], mentioned: set[str], needed: set[str]
) -> None:
    assert terms(condition) == named
    assert mentions(condition) == mentioned
    assert needs(condition) == needed


def test_variables_begin_with_a_question_mark() -> None:
    assert [is_variable(term) for term in ("?c", "cup1", "c?", "")] == [True, False, False, False]


def test_nested_conditions_are_walked_group_by_group_after_their_parent() -> None:
    assert [groups(c) for c in (AT, NEAR, KIND, SAME, FULL)] == [()] * 5
    assert groups(WITNESS) == (WITNESS.conditions,)
    assert groups(EITHER) == EITHER.alternatives
    nested = AnyOf(((WITNESS, KIND), (SAME,)))
    assert list(walk(nested)) == [nested, WITNESS, *WITNESS.conditions, KIND, SAME]


def test_numeric_relations_are_found_in_all_parts_of_behaviours() -> None:
    size, way, load = (Measure(name, ("?c",)) for name in ("size", "way", "load"))
    one = Behavior("A", 1, (), preconditions=(Witness("?o", "Cup", (Comparison(size, "<", Fraction(1)),)), NEAR))
    two = Behavior("B", 1, (), amounts=(AmountEffect("FILL", ("?c",), "increase", Calculation("*", way, Fraction(2))),))
    other_side = Behavior("C", 1, (), preconditions=(AnyOf(((Comparison(Amount("FILL", ("?c",)), "=", load),),)),))
    assert measures([one, two, other_side]) == {"size", "way", "load"}
    assert measures([one]) == {"size"}
    assert measures([]) == frozenset()


def test_variables_that_no_condition_determines_are_named() -> None:
    error = nothing_determines("B1_MOVE", [NOT_AT, SAME, AT], {"?c", "?room"})
    assert str(error) == "B1_MOVE: nothing determines ?d, ?p; add a value condition that does"


def test_different_individuals_of_one_class_have_different_names_in_a_sentence() -> None:
    def viability(packet: str) -> Measure:
        return Measure("viability", (packet,))

    poorer = Witness("?q", "Packet", (Comparison(viability("?q"), "<", viability("?p")),), negated=True)
    wanted = Witness("?p", "Packet", (has("IN", "?p", "vault"), poorer))
    better = "no Packet viability < the first Packet viability and the first Packet IN vault"
    assert said(wanted) == f"there is some Packet such that {better}"
