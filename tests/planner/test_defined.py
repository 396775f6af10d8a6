"""Defined situation types: all evaluators derive the same facts after each step, and a plan is found if there is one."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from confab.planner.grounded.derived import in_parts
from confab.planner.grounded.derived_arrays import Bit, single, union
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.hierarchical.operators import Program
from confab.planner.plan import Limits, Status
from confab.planner.solve import Request, solve
from confab.planner.transitions import Table, key_of
from confab.planner.validation import LoggedState
from confab.reasoner.amounts import Quantity
from confab.reasoner.closure import closure
from confab.reasoner.graph.knowledge import load
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    Behavior,
    Parameter,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
)
from confab.reasoner.validation.validate import validate
from tests.planner import naive
from worlds.axioms import Plain, axioms
from worlds.language import DEFINED, language
from worlds.writing import becomes, has, world

State = Mapping[Symbol, str]


def unrested(problem: Problem) -> Problem:
    situations = {name: replace(s, rest=None) for name, s in problem.domain.situations.items()}
    return replace(problem, domain=replace(problem.domain, situations=situations))


def stated(state: State) -> dict[Symbol, str]:
    return {symbol: value for symbol, value in state.items() if symbol.situation not in DEFINED}


def walk(problem: Problem, rng: Random, steps: int) -> Iterator[State]:
    """Yield successive states, each with all derived facts."""
    state: State = naive.complete(problem)
    yield state
    for _ in range(steps):
        found = [
            after for b in problem.domain.behaviors.values() for _, after in naive.results(problem, b, dict(state))
        ]
        if not found:
            return
        state = rng.choice(found)
        yield state


@given(seed=st.integers(0, 10**9))
def test_derived_facts_are_right_in_every_state_of_a_random_walk(seed: int) -> None:
    problem = language(seed, defined=True)
    table = Table(problem.domain.situations, problem.initial)
    Program(problem).bind(table)
    task = ground(replace(problem, goal={}))
    assert isinstance(task, Task)
    state, checked = task.initial, LoggedState(problem, problem.initial)
    for truth in walk(problem, Random(seed), 4):
        for symbol, value in stated(truth).items():
            if table.now[symbol.situation].get(key_of(symbol.arguments), FALSE) != value:
                table.put(symbol.situation, key_of(symbol.arguments), value)
            checked.put(symbol.situation, symbol.arguments, value)
        for symbol, value in truth.items():
            if symbol.situation in DEFINED:
                assert table.now[symbol.situation].get(key_of(symbol.arguments)) == value
                assert checked.value(symbol.situation, symbol.arguments) == value
        # After each step, the updated derived bits equal the bits that are computed from scratch.
        for operator in range(len(task)):
            after = task.applied(state, operator)
            if after is not None:
                assert task.derived.completed(after) == after
                state = after


@given(seed=st.integers(0, 10**9))
def test_execution_with_the_needed_derived_facts_equals_execution_with_all_of_them(seed: int) -> None:
    task = ground(replace(language(seed, defined=True), goal={}))
    assert isinstance(task, Task)
    if not len(task):
        return
    plan = Random(seed).choices(range(len(task)), k=30)
    state, kept = task.initial, []
    for operator in plan:
        after = task.applied(state, operator)
        if after is not None:
            state = after
            kept.append(operator)
    assert task.carried_out(task.initial, plan) == (state, kept)


@given(seed=st.integers(0, 10**9))
def test_a_defined_goal_holds_on_the_grounded_level_exactly_if_it_holds(seed: int) -> None:
    problem = language(seed, defined=True)
    truth = naive.complete(problem)
    wanted = Random(seed).sample(sorted(s for s in truth if s.situation in DEFINED), 2)
    for symbol in wanted:
        task = ground(problem, goal={symbol: truth[symbol]})
        assert isinstance(task, Task), symbol
        assert task.initial & task.goal == task.goal, symbol
        contrary = ground(problem, goal={symbol: FALSE if truth[symbol] == TRUE else TRUE})
        assert not isinstance(contrary, Task) or contrary.initial & contrary.goal != contrary.goal, symbol


def reachable(problem: Problem, most: int) -> tuple[list[State], bool]:
    """Return the reachable states, nearest first, and whether these are all."""
    order: list[State] = [naive.complete(problem)]
    seen = {frozenset(order[0].items())}
    for state in order:
        for behavior in problem.domain.behaviors.values():
            for _, after in naive.results(problem, behavior, dict(state)):
                if len(order) >= most:
                    return order, False
                if (key := frozenset(after.items())) not in seen:
                    seen.add(key)
                    order.append(after)
    return order, True


def test_a_derived_fact_that_only_a_conditional_change_of_an_amount_reads_is_derived() -> None:
    """The cart must leave the shade before WET falls below zero; only the change of this amount depends on the shade."""
    cart = Parameter("?c", "Cart")
    shaded = tuple(Rule("SHADED", (cart,), (), (has("AT", "?c", where),)) for where in ("shade", "porch"))
    takes = AmountEffect("WET", ("bed",), "decrease", Fraction(1), (has("SHADED", "cart", "true"),))
    problem = world(
        [
            SituationType("AT", ("Cart",), "AT"),
            SituationType("SHADED", ("Cart",), "Truth", boolean=True),
            SituationType("WET", ("Bed",), "WET", quantity=Quantity(least=Fraction(0))),
            SituationType("DAYS", ("Bed",), "DAYS", quantity=Quantity()),
        ],
        [
            Behavior("ROLL", 1, (cart, Parameter("?p", "AT")), (), (), (becomes("AT", "?c", "?p"),)),
            Behavior("SUN", 1, (), amounts=(takes, AmountEffect("DAYS", ("bed",), "increase", Fraction(1)))),
        ],
        {"Cart": ("cart",), "Bed": ("bed",), "AT": ("shade", "porch", "yard")},
        {"AT cart": "shade", "WET bed": "1", "DAYS bed": "0"},
        {"DAYS bed": ">=3", "WET bed": "0"},
    )
    problem = replace(problem, domain=replace(problem.domain, rules={"SHADED": shaded}))
    task = ground(problem, 1)
    assert isinstance(task, Task)
    steps = {task.describe(o)[:2]: o for o in range(len(task))}
    roll, sun = steps["ROLL", ("cart", "yard")], steps["SUN", ()]
    plan, state = [sun, roll, sun, sun], task.initial
    for operator in plan:
        after = task.applied(state, operator)
        assert after is not None
        state = after
    assert task.carried_out(task.initial, plan) == (state, plan)
    assert solve(Request(problem)).status is Status.SOLVED


@pytest.mark.parametrize("mode", ["guarded", "optimal", "paper"])
@pytest.mark.parametrize("seed", range(8))
def test_a_plan_for_a_defined_goal_is_found_exactly_if_one_exists(seed: int, mode: str) -> None:
    problem, rng = unrested(language(seed, defined=True)), Random(seed)
    states, whole = reachable(problem, 60)
    wanted = rng.choice([symbol for symbol in states[0] if symbol.situation in DEFINED])
    for value in (TRUE, FALSE):
        there = any(state[wanted] == value for state in states)
        if there or whole:
            found = solve(Request(replace(problem, goal={wanted: value}), mode, Limits(100_000, 20)))
            assert (found.status is Status.SOLVED) is there


def test_a_derived_fact_that_supports_only_itself_ends_with_its_cause() -> None:
    assert in_parts({0: Bit(1, (1 | 4, 2))}).after(1 | 4, 1 | 2 | 4) == 4


@pytest.mark.parametrize("seed", [*range(12), 7062, 7099])
def test_plans_with_random_axioms_of_pddl_agree_with_exhaustive_search(seed: int) -> None:
    domain, text = axioms(Random(seed))
    least, problem = Plain(domain).shortest(text), imported(parse(domain, text)).problem
    for mode in ("optimal", "guarded"):
        found = solve(Request(problem, mode, Limits(1_000_000, 30.0)))
        steps = found.plan.steps if found.plan else None
        assert (steps is None) is (least is None)
        assert steps is None or least is None or (len(steps) == least if mode == "optimal" else len(steps) >= least)


def test_all_evaluators_follow_a_chain_of_a_thousand_derived_facts() -> None:
    boxes = tuple(f"box{i}" for i in range(1000))
    inside = SituationType("INSIDE", ("Box", "Box"), "Truth", boolean=True)
    direct = ValueCondition("IN", ("?x",), "?y")
    pair = (Parameter("?x", "Box"), Parameter("?z", "Box"))
    rules = (
        Rule("INSIDE", pair, (), (ValueCondition("IN", ("?x",), "?z"),)),
        Rule("INSIDE", pair, (Parameter("?y", "Box"),), (direct, ValueCondition("INSIDE", ("?y", "?z"), TRUE))),
    )
    situations = {"IN": SituationType("IN", ("Box",), "IN"), "INSIDE": inside}
    initial = {Symbol("IN", (box,)): outer for box, outer in pairwise(boxes)}
    opened = Behavior("OPEN", 1, (Parameter("?x", "Box"),), (), (), (ValueEffect("IN", ("?x",), "?x"),))
    domain = Domain(situations, {"OPEN": opened}, rules={"INSIDE": rules})
    problem = Problem("boxes", domain, {"Box": boxes, "IN": boxes}, {}, initial, {})
    table = Table(situations, initial)
    Program(problem).bind(table)
    facts_ = LoggedState(problem, initial)
    for pair_, held in (((boxes[0], boxes[-1]), TRUE), ((boxes[-1], boxes[0]), FALSE)):
        assert table.now["INSIDE"].get(pair_) == held
        assert facts_.value("INSIDE", pair_) == held


CRANE = """@prefix : <https://example.org/crane#> . @prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> . @prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<https://example.org/crane> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Crane a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :CRANE_AT, :WORKS_IN, :DONE .
:Bay a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :CRANE_AT .
:Zone a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object, :WORKS_IN .
:CRANE_AT a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :craneAt ; c:fromLevel 2 .
:craneAt a owl:ObjectProperty, owl:FunctionalProperty, owl:NamedIndividual .
:inZone a owl:ObjectProperty, owl:NamedIndividual, c:Relation ; rdfs:domain :Bay ; rdfs:range :Zone .
:WORKS_IN a owl:Class, owl:NamedIndividual, c:SituationType ; c:valueProperty :worksIn .
:worksIn a owl:ObjectProperty, owl:NamedIndividual .
:DONE a owl:NamedIndividual, c:SituationType .
:L1_WORK a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:update '''INSERT { ?crane :DONE true }
  WHERE { ?crane a :Crane FILTER NOT EXISTS { ?crane :DONE true } }''' .
:L2_ROLL a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ;
  c:update "INSERT { ?crane :craneAt ?bay } WHERE { ?crane a :Crane . ?bay a :Bay }" .
:L2_WORK a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 2 ;
  c:update "INSERT { ?crane :DONE true } WHERE { ?crane a :Crane ; :worksIn :west }" .
:west a owl:NamedIndividual, :Zone ; c:index 1 . :east a owl:NamedIndividual, :Zone ; c:index 2 .
:bay1 a owl:NamedIndividual, :Bay ; c:index 3 ; :inZone :west .
:bay2 a owl:NamedIndividual, :Bay ; c:index 4 ; :inZone :east .
:crane1 a owl:NamedIndividual, :Crane ; c:index 5 ; :craneAt :bay2 .
[ a owl:AllDifferent ; owl:distinctMembers ( :west :east :bay1 :bay2 :crane1 ) ] .
:task a owl:NamedIndividual, c:Task ; c:goal :task.done .
:task.done a owl:NamedIndividual, c:ValueCondition ; c:about :crane1 ; c:situationType :DONE .
"""
BY_CHAIN = ":worksIn owl:propertyChainAxiom ( :craneAt :inZone ) ."
BY_RULE = """:rule a owl:NamedIndividual, c:Rule ; c:situationType :WORKS_IN ;
  c:about :crane ; c:value :zone ; c:condition :at, :in .
:crane a owl:NamedIndividual, c:Variable ; c:termType :Crane . :bay a owl:NamedIndividual, c:Variable ; c:termType :Bay .
:zone a owl:NamedIndividual, c:Variable ; c:termType :Zone .
:at a owl:NamedIndividual, c:ValueCondition ; c:about :crane ; c:situationType :CRANE_AT ; c:value :bay .
:in a owl:NamedIndividual, c:RelationCondition ; c:about :bay ; c:relation :inZone ; c:value :zone ."""


@pytest.mark.parametrize("definition", [BY_CHAIN, BY_RULE])
@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_a_situation_type_that_is_defined_by_a_lower_level_exists_from_this_level_on(
    tmp_path: Path, definition: str, mode: str
) -> None:
    path = tmp_path / "crane.ttl"
    path.write_text(CRANE + definition)
    problem = read(load(path)).problem
    assert problem.domain.situations["WORKS_IN"].level == 2
    outcome = solve(Request(problem, mode))
    assert outcome.plan is not None
    assert [step.behavior for step in outcome.plan.primitives] == ["L2_ROLL", "L2_WORK"]
    assert not [finding for finding in validate([path]) if finding.serious]


def following(rng: Random) -> dict[int, Bit]:
    """Return twelve derived bits that depend on each other and on six stated bits before them."""
    return {
        bit: Bit(1 << bit, tuple(sum({1 << other for other in rng.sample(range(18), rng.randint(1, 3))} - {1 << bit})
                                 for _ in range(rng.randint(0, 4))))
        for bit in range(6, 18)
    }  # fmt: skip


@given(seed=st.integers(0, 10**9))
def test_derivation_with_arrays_and_with_counters_gives_the_same_facts(seed: int) -> None:
    rng = Random(seed)
    first, bits = 6, following(rng)
    changes, above = (
        rng.sample(range(1 << first), 1 << first),
        5 << 20,
    )  # the number of the tuple of amounts is above all bits
    found = []
    for few in (0, 10**6):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("confab.planner.grounded.derived.CALLS", few)
            patch.setattr("confab.planner.grounded.derived.AT_ONCE", 10**9)
            derived = in_parts(bits)
            states = [derived.completed(stated | above) for stated in range(1 << first)]
            after = [derived.after(state ^ change, state) for state, change in zip(states, changes, strict=True)]
            assert after == [states[stated ^ change] for stated, change in enumerate(changes)]
            found.append(states)
    assert found[0] == found[1]


@given(seed=st.integers(0, 10**9))
def test_derived_bits_that_depend_on_each_other_form_a_part_which_comes_after_the_parts_that_it_needs(
    seed: int,
) -> None:
    parts = [{bit.mask: union(bit.alternatives) for bit in part} for part in in_parts(following(Random(seed))).parts]
    needs = {mask: set(single(needed)) for part in parts for mask, needed in part.items()}
    below = {
        mask: closure(its & needs.keys(), lambda other: needs[other] & needs.keys()) for mask, its in needs.items()
    }
    earlier = set[int]()
    for part in parts:
        earlier |= part.keys()
        for mask in part:
            assert below[mask] <= earlier
            assert part.keys() - {mask} == {other for other in below[mask] if mask in below[other]} - {mask}
    assert earlier == needs.keys()
