"""Eqs. (1), (2), (4) and (5) of the paper, with numbers that can be calculated by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from confab.planner.paper.cogency import PAPER, PaperConstants, cogencies, ranking
from confab.planner.paper.learning import reinforce
from confab.reasoner.memory.links import Links
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import SituationType, Symbol

LOCATION = SituationType("LOCATION", ("Cup",), "LOCATION")
CUP = Symbol("LOCATION", ("cup",))
TOY = Problem(
    "toy", Domain({"LOCATION": LOCATION}, {}), {"Cup": ("cup",), "LOCATION": ("a", "b", "c", "d")}, {}, {CUP: "a"}, {}
)
GO = ("GO", ("cup",))
STAY = ("STAY", ("cup",))


def test_uniform_links_give_the_product_of_one_over_k() -> None:
    assert cogencies(Links(), [GO], {CUP: "a"}, TOY, 1)[GO] == pytest.approx(math.log(1 / 4))


def test_equation_2_raises_by_lambda_and_normalises() -> None:
    links = Links()
    reinforce(links, GO, {CUP: "a"}, TOY, 1, 0.1)
    assert links.tables[GO][CUP] == pytest.approx({"a": 0.35 / 1.1, "b": 0.25 / 1.1, "c": 0.25 / 1.1, "d": 0.25 / 1.1})


@given(st.lists(st.sampled_from("abcd"), max_size=30), st.floats(0.01, 2.0))
def test_links_stay_a_probability_distribution_after_learning(seen: list[str], learning: float) -> None:
    links = Links()
    for value in seen:
        reinforce(links, GO, {CUP: value}, TOY, 1, learning)
    table = links.tables[GO][CUP] if seen else dict.fromkeys("abcd", 0.25)
    assert sum(table.values()) == pytest.approx(1.0)
    assert all(0.0 < p <= 1.0 for p in table.values())


def test_a_learned_step_is_more_cogent_in_the_learned_state_and_less_in_others() -> None:
    links = Links()
    reinforce(links, GO, {CUP: "a"}, TOY, 1, PAPER.learning)
    here = cogencies(links, [GO, STAY], {CUP: "a"}, TOY, 1)
    there = cogencies(links, [GO, STAY], {CUP: "b"}, TOY, 1)
    assert here[GO] > here[STAY]
    assert there[GO] < there[STAY]


def test_rank_one_is_the_most_cogent_and_ties_share_the_lowest_rank() -> None:
    assert ranking({GO: -1.0, STAY: -1.0, ("OTHER", ()): -2.0}) == pytest.approx(
        {GO: 1 / 3, STAY: 1 / 3, ("OTHER", ()): 1.0}
    )


def test_the_bonus_of_equation_5_fades_with_depth_and_is_never_a_penalty() -> None:
    constants = PaperConstants(anticipated_length=10)
    assert constants.bonus(0.25, 0) == pytest.approx(-2.25)
    assert constants.bonus(0.25, 5) == pytest.approx(-1.125)
    assert constants.bonus(0.25, 20) == 0.0
    assert constants.bonus(1.0, 0) == 0.0
