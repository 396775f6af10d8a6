"""Constant folding: a folded condition holds in the same states, and decided parts are gone."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

from hypothesis import given, settings
from hypothesis import strategies as st

from confab.reasoner.folding import Folding
from confab.reasoner.language import substituted
from confab.reasoner.symbols import (
    AmountEffect,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    ValueCondition,
    Witness,
)

CLASSES = {"Cup": ("a", "b"), "Lid": ("b",), "Ghost": ()}
TERMS = st.sampled_from(["a", "b", "?x"])
State = dict[str, str]


def holds(condition: Condition, state: State) -> bool:
    """Return whether a condition holds in a state; the state contains the value of ON for each individual."""
    match condition:
        case ValueCondition(_, (about,), value, negated):
            return (state[about] == value) is not negated
        case EqualityCondition(left, right, negated):
            return (left == right) is not negated
        case ClassCondition(term, kind, negated):
            return (term in CLASSES[kind]) is not negated
        case Comparison(left, _, right, negated):
            return (left < right) is not negated  # type: ignore[operator]
        case Witness(variable, kind, inner, negated):
            found = any(all(holds(substituted(c, {variable: one}), state) for c in inner) for one in CLASSES[kind])
            return found is not negated
        case AnyOf(groups, negated):
            return any(all(holds(c, state) for c in group) for group in groups) is not negated
        case _:
            raise AssertionError(condition)


def witness(inner: list[Condition], kind: str, negated: bool) -> Condition:
    return Witness("?y", kind, tuple(substituted(c, {"?x": "?y"}) for c in inner), negated)


SIMPLE: st.SearchStrategy[Condition] = st.one_of(
    st.builds(lambda t, v, n: ValueCondition("ON", (t,), v, n), TERMS, st.sampled_from(["a", "b"]), st.booleans()),
    st.builds(EqualityCondition, TERMS, TERMS, st.booleans()),
    st.builds(ClassCondition, TERMS, st.sampled_from(["Cup", "Lid", "Ghost"]), st.booleans()),
    st.builds(lambda n, m: Comparison(Fraction(n), "<", Fraction(2), m), st.integers(1, 3), st.booleans()),
)
CONDITIONS = st.recursive(
    SIMPLE,
    lambda inner: st.one_of(
        st.builds(witness, st.lists(inner, max_size=2), st.sampled_from(["Cup", "Lid", "Ghost"]), st.booleans()),
        st.builds(
            lambda groups, n: AnyOf(tuple(map(tuple, groups)), n),
            st.lists(st.lists(inner, max_size=2), max_size=3),
            st.booleans(),
        ),
    ),
    max_leaves=8,
)


@settings(max_examples=200, deadline=None)
@given(st.lists(CONDITIONS, max_size=4), st.lists(SIMPLE, max_size=1))
def test_folded_conditions_hold_in_the_same_states_in_which_the_known_ones_hold(
    conditions: list[Condition], known: list[Condition]
) -> None:
    folded = Folding(CLASSES, {"?x": "Cup"}, frozenset(known)).conjunction(conditions)
    for x, on_a, on_b in product("ab", repeat=3):
        state = {"a": on_a, "b": on_b}
        if not all(holds(substituted(condition, {"?x": x}), state) for condition in known):
            continue
        before = all(holds(substituted(condition, {"?x": x}), state) for condition in conditions)
        after = folded is not None and all(holds(substituted(condition, {"?x": x}), state) for condition in folded)
        assert before == after


def test_an_alternative_that_contradicts_another_condition_is_left_out() -> None:
    on = ValueCondition("ON", ("?x",), "a")
    either = AnyOf(((on, EqualityCondition("?x", "b")), (ValueCondition("ON", ("?x",), "b"),)))
    assert Folding(CLASSES, {"?x": "Cup"}).conjunction([on, either]) == (on, EqualityCondition("?x", "b"))


def test_equal_increases_are_added_up_and_impossible_ones_left_out() -> None:
    one = AmountEffect("WEIGHT", ("a",), "increase", Fraction(2), (EqualityCondition("a", "a"),))
    never = AmountEffect("WEIGHT", ("a",), "increase", Fraction(2), (EqualityCondition("a", "b"),))
    (found,) = Folding(CLASSES, {}).effects([one, one, never])
    assert (found.amount, found.when) == (Fraction(4), ())
