"""Grounding agrees with a naive evaluation of the behaviours in small random domains."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from confab.planner.grounded import meanings, relaxed_changes
from confab.planner.grounded.best_first import plan_level, search
from confab.planner.grounded.formulas import Formulas
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.hff import heuristic
from confab.planner.grounded.task import Task
from confab.planner.plan import Limits, Reason, Status
from confab.reasoner.language import DomainError
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Parameter,
    RelationCondition,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)
from tests.planner.naive import Facts, complete, results, wanted

SITUATIONS = {
    "AT": SituationType("AT", ("Thing",), "Place"),  # a functional situation type
    "LIT": SituationType("LIT", ("Place",), "Truth", boolean=True),
    "NEAR": SituationType("NEAR", ("Thing", "Place"), "Truth", boolean=True),
}
CLASSES = {"Thing": ("a", "b"), "Place": ("p", "q", "r"), "Dark": ("r",)}
TERMS = {"Thing": ("?x", "?y", "a"), "Place": ("?u", "?v", "p")}
KINDS = {"?x": "Thing", "?y": "Thing", "?u": "Place", "?v": "Place", "?w": "Place"}

things, places = st.sampled_from(TERMS["Thing"]), st.sampled_from(TERMS["Place"])
flags = st.booleans()
simple: st.SearchStrategy[Condition] = st.one_of(
    st.builds(lambda o, v, n: ValueCondition("AT", (o,), v, n), things, places, flags),
    st.builds(lambda p, n: ValueCondition("LIT", (p,), TRUE, n), places, flags),
    st.builds(lambda o, p, t: ValueCondition("NEAR", (o, p), t), things, places, st.sampled_from([TRUE, FALSE])),
    st.builds(lambda u, v, n: RelationCondition("road", (u, v), n), places, places, flags),
    st.builds(lambda p, n: ClassCondition(p, "Dark", n), places, flags),
    st.builds(lambda u, v, n: EqualityCondition(u, v, n), places, places, flags),
)
groups = st.lists(simple, min_size=1, max_size=2).map(tuple)
inner = st.sampled_from(["?u", "?v"])
conditions = st.one_of(
    simple,
    st.builds(lambda g, n: AnyOf(tuple(g), n), st.lists(groups, min_size=2, max_size=3), flags),
    st.builds(lambda v, g, n: Witness(v, "Place", g, n), inner, groups, flags),
)
changes = st.one_of(
    st.builds(lambda o, v: ("AT", (o,), v), things, places),
    st.builds(lambda p, t: ("LIT", (p,), t), places, st.sampled_from([TRUE, FALSE])),
    st.builds(lambda o, p, t: ("NEAR", (o, p), t), things, places, st.sampled_from([TRUE, FALSE])),
)
effects = st.builds(
    lambda change, when: ValueEffect(change[0], change[1], change[2], tuple(when)),
    changes,
    st.lists(conditions, max_size=1) | st.just([]),
)
behaviors = st.builds(
    lambda parameters, preconditions, effects: Behavior(
        "DO",
        1,
        tuple(Parameter(name, KINDS[name]) for name in parameters),
        tuple(Parameter(name, kind) for name, kind in KINDS.items() if name not in parameters),
        tuple(preconditions),
        tuple(effects),
    ),
    st.sampled_from([("?x", "?y", "?u", "?v"), ("?x", "?y", "?u", "?v"), ("?x", "?y", "?u")]),
    st.lists(conditions, max_size=2),
    st.lists(effects, min_size=1, max_size=3),
)


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    named = {
        f"DO{i}": Behavior(f"DO{i}", 1, b.parameters, b.variables, b.preconditions, b.effects)
        for i, b in enumerate(draw(st.lists(behaviors, min_size=1, max_size=3)))
    }
    initial = {Symbol("AT", (o,)): draw(st.sampled_from(CLASSES["Place"])) for o in CLASSES["Thing"]}
    initial |= {Symbol("LIT", (p,)): TRUE for p in draw(st.sets(st.sampled_from(CLASSES["Place"])))}
    goals = {Symbol("AT", ("a",)): draw(st.sampled_from(CLASSES["Place"]))}
    goals |= {Symbol("NEAR", ("b", "q")): draw(st.sampled_from([TRUE, FALSE])), Symbol("LIT", ("q",)): TRUE}
    goal = {symbol: goals[symbol] for symbol in draw(st.sets(st.sampled_from(sorted(goals)), min_size=1))}
    road = frozenset(draw(st.sets(st.tuples(st.sampled_from("pqr"), st.sampled_from("pqr")), max_size=4)))
    return Problem("urn:random", Domain(SITUATIONS, named), CLASSES, {"road": road}, initial, goal)


def key(state: Facts) -> frozenset[tuple[Symbol, str]]:
    return frozenset((symbol, value) for symbol, value in state.items() if value != FALSE)


def explore(problem: Problem) -> tuple[set[frozenset[tuple[Symbol, str]]], bool]:
    """Return all states that a naive search reaches, and whether the goal holds in one of them."""
    start = complete(problem)
    seen, waiting, solvable = {key(start)}, [start], False
    while waiting:
        state = waiting.pop()
        solvable = solvable or wanted(problem, state)
        for behavior in problem.domain.behaviors.values():
            for _, after in results(problem, behavior, state):
                if key(after) not in seen:
                    seen.add(key(after))
                    waiting.append(after)
    return seen, solvable


def transitions(task: Task) -> set[frozenset[tuple[Symbol, str]]]:
    seen, waiting = {task.initial}, [task.initial]
    while waiting:
        state = waiting.pop()
        for operator in range(len(task)):
            after = task.applied(state, operator)
            if after is not None and after not in seen:
                seen.add(after)
                waiting.append(after)
    return {key(task.values(state)) for state in seen}


def grounded(problem: Problem, apart: bool = False) -> Task | Reason | None:
    try:
        return ground(problem, apart=apart)
    except DomainError:
        return None


@given(problems(), flags)
@settings(max_examples=40)
def test_grounded_and_naive_reading_reach_the_same_states(problem: Problem, apart: bool) -> None:
    task = grounded(problem, apart)
    if task is None:
        return
    states, solvable = explore(problem)
    if isinstance(task, Reason):
        assert not solvable
        return
    assert transitions(task) == states
    found = search(task)
    assert found.status is (Status.SOLVED if solvable else Status.UNSOLVABLE)
    state = task.initial
    for operator in found.plan:
        after = task.applied(state, operator)
        assert after is not None
        state = after
    if solvable:
        assert wanted(problem, complete(problem) | task.values(state))


@given(problems(), flags)
@settings(max_examples=40)
def test_operators_have_exactly_the_effects_of_the_naive_evaluation(problem: Problem, apart: bool) -> None:
    task = grounded(problem, apart)
    if not isinstance(task, Task):
        return
    start = complete(problem)
    naive = {
        (behavior.name, arguments, key(after))
        for behavior in problem.domain.behaviors.values()
        for arguments, after in results(problem, behavior, start)
    }
    ours = set()
    for operator in range(len(task)):
        after = task.applied(task.initial, operator)
        if after is not None:
            name, arguments, _ = task.describe(operator)
            ours.add((name, arguments, key(task.values(after))))
    assert ours == naive


def test_the_same_budget_gives_the_same_plan() -> None:
    problem = corridor(30)
    first, second = (plan_level(problem, limits=Limits(expansions=500)) for _ in range(2))
    assert first.plan == second.plan
    assert plan_level(problem, limits=Limits(expansions=3)).status is Status.GAVE_UP


def corridor(length: int) -> Problem:
    """An individual walks along a corridor and must light the lamps on its path."""
    places = tuple(f"p{i:03}" for i in range(length))
    situations = {
        "AT": SituationType("AT", ("Thing",), "Place"),
        "LIT": SituationType("LIT", ("Place",), "Truth", boolean=True),
    }
    go = Behavior(
        "GO",
        1,
        (Parameter("?x", "Thing"), Parameter("?v", "Place")),
        (Parameter("?u", "Place"),),
        (ValueCondition("AT", ("?x",), "?u"), RelationCondition("road", ("?u", "?v"))),
        (ValueEffect("AT", ("?x",), "?v"),),
    )
    light = Behavior(
        "LIGHT",
        1,
        (Parameter("?x", "Thing"),),
        (Parameter("?u", "Place"),),
        (ValueCondition("AT", ("?x",), "?u"),),
        (ValueEffect("LIT", ("?u",), TRUE),),
    )
    road = frozenset(itertools.pairwise(places))
    return Problem(
        "urn:corridor",
        Domain(situations, {"GO": go, "LIGHT": light}),
        {"Thing": ("x",), "Place": places},
        {"road": road},
        {Symbol("AT", ("x",)): places[0]},
        {Symbol("LIT", (place,)): TRUE for place in places},
    )


def test_a_condition_on_one_place_is_grounded_once_for_each_place() -> None:
    size = 40
    places, things = tuple(f"p{i:02}" for i in range(size)), tuple(f"x{i:02}" for i in range(size))
    waits = Witness("?x", "Thing", (ValueCondition("AT", ("?x",), "?v"), ValueCondition("LIT", ("?u",), TRUE)))
    go = Behavior(
        "GO",
        1,
        (Parameter("?y", "Thing"), Parameter("?v", "Place")),
        (Parameter("?u", "Place"),),
        (ValueCondition("AT", ("?y",), "?u"), AnyOf(((waits,), (ValueCondition("LIT", ("?v",), TRUE, True),)))),
        (ValueEffect("AT", ("?y",), "?v"), ValueEffect("LIT", ("?u",), FALSE)),
    )
    situations = {name: SITUATIONS[name] for name in ("AT", "LIT")}
    problem = Problem(
        "urn:waits",
        Domain(situations, {"GO": go}),
        {"Thing": things, "Place": places},
        {},
        {Symbol("AT", (x,)): p for x, p in zip(things, places, strict=True)}
        | {Symbol("LIT", (p,)): TRUE for p in places},
        {Symbol("AT", (things[0],)): places[1]},
    )
    asked = 0
    with pytest.MonkeyPatch.context() as patch:
        condition = Formulas.condition

        def counted(*arguments: Any) -> Any:
            nonlocal asked
            asked += 1
            return condition(*arguments)

        patch.setattr(Formulas, "condition", counted)
        task = ground(problem)
    assert isinstance(task, Task) and len(task) > size**2
    assert asked < 8 * size**2  # and not one operator of an individual for each pair of places


def test_a_join_drops_variables_of_existential_conditions_after_their_last_use() -> None:
    places = tuple(f"p{i}" for i in range(30))
    condition: Condition = RelationCondition("beside", ("?w4", "?w5"))
    for i in range(5, 0, -1):
        condition = Witness(f"?w{i}", "Place", (RelationCondition("beside", (f"?w{i - 1}", f"?w{i}")), condition))
    light = Behavior("LIGHT", 1, (Parameter("?w0", "Place"),), (), (condition,), (ValueEffect("LIT", ("?w0",), TRUE),))
    problem = Problem(
        "scene",
        Domain({"LIT": SITUATIONS["LIT"]}, {"LIGHT": light}),
        {"Truth": (FALSE, TRUE), "Place": places},
        {"beside": frozenset(itertools.product(places, places))},
        {},
        {Symbol("LIT", ("p3",)): TRUE},
    )
    task = grounded(problem)  # a single join would have 30 to the power of 6 rows
    assert isinstance(task, Task)
    assert len(task) == len(places)


def parking(things: int, places: int) -> Problem:
    """Things are put at free places; their old places don't matter."""
    nobody = Witness("?y", "Thing", (ValueCondition("AT", ("?y",), "?v"),), True)
    put = Behavior(
        "PUT",
        1,
        (Parameter("?x", "Thing"), Parameter("?v", "Place")),
        (),
        (nobody,),
        (ValueEffect("AT", ("?x",), "?v"),),
    )
    who, where = tuple(f"x{i}" for i in range(things)), tuple(f"p{i}" for i in range(places))
    return Problem(
        "urn:parking",
        Domain({"AT": SITUATIONS["AT"]}, {"PUT": put}),
        {"Thing": who, "Place": where},
        {},
        {Symbol("AT", (x,)): p for x, p in zip(who, where, strict=False)},
        {Symbol("AT", (x,)): p for x, p in zip(who, where[1:], strict=False)},
    )


def test_interchangeable_agents_do_not_multiply_the_operators() -> None:
    size = 12
    places, cranes = tuple(f"p{i}" for i in range(size)), tuple(f"c{i}" for i in range(size))
    stands = (ValueCondition("AT", ("?x",), "?u"), ValueCondition("NEAR", ("?y", "?u"), TRUE))
    move = Behavior(
        "MOVE",
        1,
        (Parameter("?x", "Thing"), Parameter("?v", "Place")),
        (Parameter("?u", "Place"), Parameter("?y", "Crane")),
        (*stands, ValueCondition("NEAR", ("?y", "?v"), TRUE)),
        (ValueEffect("AT", ("?x",), "?v"),),
    )
    shift = Behavior("SHIFT", 1, (Parameter("?y", "Crane"), Parameter("?v", "Place")), (), (),
                     (ValueEffect("NEAR", ("?y", "?v"), TRUE),))  # fmt: skip
    situations = {"AT": SITUATIONS["AT"], "NEAR": SituationType("NEAR", ("Crane", "Place"), "Truth", boolean=True)}
    problem = Problem(
        "urn:cranes",
        Domain(situations, {"MOVE": move, "SHIFT": shift}),
        {"Truth": (FALSE, TRUE), "Thing": ("x",), "Place": places, "Crane": cranes},
        {},
        {Symbol("AT", ("x",)): places[0]},
        {Symbol("AT", ("x",)): places[1]},
    )
    told, apart = ground(problem), ground(problem, apart=True)
    assert isinstance(told, Task) and isinstance(apart, Task)
    assert len(told) == size**3 + size**2
    assert len(apart) == 2 * size**2
    assert len(search(told).plan) == len(search(apart).plan) == 3


def test_a_shared_condition_of_many_operators_is_represented_once_with_the_same_meaning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = []
    for least in (1_000_000, 0):
        for module in (meanings, relaxed_changes):
            monkeypatch.setattr(module, "SAID_ONCE", least)
        found.append(ground(parking(4, 6)))
    often, once = found
    assert isinstance(often, Task) and isinstance(once, Task)
    assert transitions(often) == transitions(once)
    assert len(once.needs.items) < len(often.needs.items) and len(once.adds.items) < len(often.adds.items)
    relaxed = heuristic(often)(often.initial), heuristic(once)(once.initial)
    assert relaxed[0] is not None and relaxed[1] is not None and relaxed[0][0] == relaxed[1][0]


def test_the_condition_that_a_place_is_free_is_represented_once_for_each_place() -> None:
    task = ground(parking(40, 60))
    assert isinstance(task, Task) and len(task) == 2400
    # otherwise each operator would mention 40 things and 60 places
    assert len(task.needs.items) + len(task.adds.items) < 10 * len(task)
