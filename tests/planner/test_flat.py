"""The search of grounded tasks: limits, proofs and reasons, plans without superfluous steps, and the compiled heuristic."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from time import process_time

import numpy as np
import pytest

import confab
from confab.planner.grounded import best_first, reachability
from confab.planner.grounded.best_first import Search, plan_level, search
from confab.planner.grounded.exploring import SearchOrder, explore, path_to
from confab.planner.grounded.greedy import Greedy
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.hff import Evaluate, Evaluation, cost_left, heuristic
from confab.planner.grounded.landmarks import landmarks
from confab.planner.grounded.lookahead import lookahead
from confab.planner.grounded.novelty import Novelty
from confab.planner.grounded.plan_windows import regrouped, shorter, without_superfluous_steps
from confab.planner.grounded.shortest import AStar, nothing
from confab.planner.grounded.successors import tree
from confab.planner.grounded.task import Task
from confab.planner.hierarchical import planner as fast
from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.call import Compiled
from confab.planner.plan import OUT_OF_MEMORY, Counts, Limits, Plan, Reason, Status, UngroundableError
from confab.planner.solve import MODES, Request, solve
from confab.planner.validation import validate
from confab.reasoner.limits import OutOfTimeError
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import TRUE, Symbol
from tests.planner.naive import tabletop
from tests.planner.test_grounding import corridor


@pytest.fixture(scope="module", name="tabletop")
def tabletop_fixture() -> Problem:
    return tabletop()


@pytest.mark.parametrize("level", [1, 2, 3])
def test_every_level_of_the_tabletop_is_planned_flat(tabletop: Problem, level: int) -> None:
    outcome = plan_level(tabletop, level)
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert validate(tabletop, outcome.plan) == []


@pytest.mark.parametrize("level", [1, 2, 3])
def test_a_search_that_is_interrupted_again_and_again_finds_the_same_plan(tabletop: Problem, level: int) -> None:
    task = ground(tabletop, level)
    assert isinstance(task, Task)
    whole, parts = Search(task).go_on(), Search(task)
    stops = 0
    while (part := parts.go_on(parts.work + 1)).status is Status.GAVE_UP:
        stops += 1
    assert stops > 1
    assert whole.plan and (part.plan, part.work, part.counts) == (whole.plan, whole.work, whole.counts)


def without_reach(problem: Problem, place: str) -> Problem:
    reach = frozenset(pair for pair in problem.relations["canReach"] if pair[1] != place)
    return replace(problem, relations={**problem.relations, "canReach": reach})


@pytest.mark.parametrize("level", [1, 2, 3])
def test_an_unreachable_goal_is_found_on_each_level(tabletop: Problem, level: int) -> None:
    outcome = plan_level(without_reach(tabletop, "location7"), level)
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert outcome.reason.text == "cup1 LOCATION location7 can't be reached"


def test_an_unreachable_goal_is_proved_with_a_reason_in_the_ontologys_terms(tabletop: Problem) -> None:
    outcome = solve(Request(without_reach(tabletop, "location7")))
    assert outcome.certificate is not None and outcome.reason is not None
    assert outcome.reason.text.startswith(
        "cup1 LOCATION location7 can't be reached: B3_REACH_HAND_LOCATION requires a Hand that canReach location7"
    )
    assert {"cup1", "LOCATION", "location7", "canReach"} <= set(outcome.reason.terms)


def test_a_goal_without_an_achiever_is_reported(tabletop: Problem) -> None:
    wrong = replace(tabletop, goal={Symbol("BEVERAGE", ("cup1",)): "nothing"})
    reason = solve(Request(wrong)).reason
    assert reason == Reason(
        "cup1 BEVERAGE nothing can't be reached: no behaviour of level 3 has this effect",
        ("cup1", "BEVERAGE", "nothing"),
    )


def test_an_exhausted_search_proves_that_no_plan_exists() -> None:
    problem = corridor(4)  # a plan back and forth is impossible, because the path is one-way
    places = problem.classes["Place"]
    goal = {Symbol("LIT", (places[3],)): TRUE, Symbol("AT", ("x",)): places[0]}
    outcome = plan_level(replace(problem, goal=goal))
    assert outcome.status is Status.UNSOLVABLE and outcome.reason is not None
    assert "all reachable states were searched" in outcome.reason.text


def test_a_search_at_a_limit_gives_up_and_names_the_limit() -> None:
    problem = corridor(60)
    few = plan_level(problem, limits=Limits(expansions=3))
    assert few.status is Status.GAVE_UP and few.reason is not None and "3 expansions" in few.reason.text
    late = plan_level(problem, limits=Limits(seconds=0.0))
    assert late.status is Status.GAVE_UP and late.reason is not None and "time limit" in late.reason.text


def test_a_join_that_is_too_large_is_refused(tabletop: Problem) -> None:
    with pytest.raises(UngroundableError, match="more than the 10 allowed"):
        ground(tabletop, 1, most=10)


@pytest.mark.parametrize("seconds", [0, 5, 20])
def test_a_search_ends_at_its_time_limit(seconds: int, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated = 0  # the simulated clock: each evaluation takes a second, however busy the machine is

    def slow(task: Task) -> Evaluate:
        fast = heuristic(task)

        def evaluate(state: int) -> Evaluation | None:
            nonlocal evaluated
            evaluated += 1
            return fast(state)

        return evaluate

    monkeypatch.setattr("confab.planner.grounded.best_first.heuristic", slow)
    monkeypatch.setattr("confab.planner.grounded.lookahead.ENABLING", 0)  # otherwise a few evaluations suffice
    for module in (
        "plan",
        "grounded.best_first",
        "grounded.lookahead",
        "grounded.plan_windows",
        "grounded.reachability",
    ):
        monkeypatch.setattr(f"confab.planner.{module}.perf_counter", lambda: float(evaluated))
    problem = carrier(16)
    assert plan_level(problem).status is Status.SOLVED and evaluated > 25
    evaluated = 0
    late = plan_level(problem, limits=Limits(seconds=seconds))
    assert late.status is Status.GAVE_UP and late.reason == Reason("the time limit came first")
    assert seconds < evaluated <= seconds + 5  # a turn is always completed


def test_steps_that_the_goal_does_not_need_are_dropped() -> None:
    problem = corridor(5)
    task = ground(problem)
    assert isinstance(task, Task)
    plan = list(search(task).plan)
    light = next(o for o in plan if task.describe(o)[0] == "LIGHT")
    doubled = [light, *plan] if task.applied(task.initial, light) is not None else [*plan, light]
    assert len(without_superfluous_steps(task, doubled)) <= len(plan)


ORDERS: dict[str, Callable[[Task], SearchOrder]] = {
    "novelty": lambda task: Novelty(task, heuristic(task), 1, landmarks(task), Counts()),
    "h_FF": lambda task: Greedy(task, heuristic(task), lookahead(task), 1, Counts()),
    "cost": lambda task: AStar(task, nothing, math.inf, Counts()),
}


@pytest.mark.parametrize("order", ORDERS)
def test_one_loop_finds_plans_and_exhausts_all_states_in_any_order(order: str) -> None:
    task = ground(carrier(3))
    assert isinstance(task, Task)
    found = ORDERS[order](task)
    list(explore(task, found))
    assert found.best is not None and found.best & task.goal == task.goal
    state, plan = task.initial, path_to(found.reached, found.best)
    for operator in plan:
        state = task.applied(state, operator) or 0
    assert state == found.best
    assert order != "cost" or len(plan) == 9  # two trips there and one back, for three parcels
    me = sum(1 << bit for bit, fact in enumerate(task.facts) if fact.symbol.situation == "ME")
    nowhere = replace(task, goal=task.goal | me)  # at both places at once: possible in the relaxed task
    none = ORDERS[order](nowhere)
    list(explore(nowhere, none))
    assert none.best is None
    # rooms times: no parcel in an arm, one parcel, two parcels
    assert len(none.reached) == 2 * (2**3 + 3 * 2 * 2**2 + 3 * 2 * 2)


def test_the_tree_gives_the_operators_that_are_applicable(tabletop: Problem) -> None:
    for problem in (tabletop, corridor(12), carrier(4)):
        task = ground(problem)
        assert isinstance(task, Task)
        evaluate, choice, state = heuristic(task), random.Random(1), task.initial
        for _ in range(60):
            operators = sorted(task.applicable(state)[0])
            assert operators == [o for o in range(len(task)) if task.applied(state, o) is not None]
            evaluation = evaluate(state)
            assert evaluation is None or operators == evaluation[2]
            if not operators:
                break
            state = task.applied(state, choice.choice(operators)) or 0


def test_the_evaluation_of_a_state_does_not_depend_on_the_states_before_it() -> None:
    domain = """(define (domain haul) (:requirements :typing :numeric-fluents :conditional-effects)
     (:types place cart) (:predicates (way ?p ?q - place) (at ?c - cart ?p - place) (wet ?p - place) (dock ?p - place)
      (done ?p - place))
     (:functions (power ?c - cart) (driven))
     (:action go :parameters (?c - cart ?p ?q - place) :precondition (and (way ?p ?q) (at ?c ?p) (>= (power ?c) 2))
      :effect (and (at ?c ?q) (not (at ?c ?p)) (decrease (power ?c) 1) (increase (driven) 1)
                   (when (wet ?q) (decrease (power ?c) 1))))
     (:action charge :parameters (?c - cart ?p - place) :precondition (and (at ?c ?p) (dock ?p)) :effect (assign (power ?c) 9))
     (:action dry :parameters (?c - cart ?p - place) :precondition (and (at ?c ?p) (>= (power ?c) 1))
      :effect (and (not (wet ?p)) (done ?p) (decrease (power ?c) 1))))"""
    text = """(define (problem p) (:domain haul) (:objects a b c d - place x y - cart)
     (:init (way a b) (way b a) (way b c) (way c b) (way c d) (way d c) (at x a) (at y d) (wet b) (wet c) (dock a) (dock b)
            (= (power x) 9) (= (power y) 4) (= (driven) 0)) (:goal (and (done b) (done c) (at y a) (>= (power y) 3))))"""
    problem = imported(parse(domain, text)).problem
    task, choice = ground(problem), random.Random(3)
    assert isinstance(task, Task) and task.amounts is not None
    evaluate, cost, state, walk = heuristic(task), cost_left(task), task.initial, list[int]()
    for _ in range(30):
        assert evaluate(state) == heuristic(task)(state) and cost(state) == cost_left(task)(state)
        operators = task.applicable(state)[0]
        if not operators:  # no power is left
            state, walk = task.initial, []
            continue
        walk.append(choice.choice(operators))
        after, fresh = task.applied(state, walk[-1]), ground(problem)
        assert after is not None and isinstance(fresh, Task)
        assert task.values(after) == fresh.values(fresh.carried_out(fresh.initial, walk)[0])
        state = after


def test_facts_that_hold_in_every_plan_are_landmarks() -> None:
    task = ground(carrier(1))
    assert isinstance(task, Task)
    names = {str(fact) for bit, fact in enumerate(task.facts) if landmarks(task) >> bit & 1}
    assert names == {"x0 AT here", "x0 AT there", "here ME true", "there ME true"}  # either arm is allowed


def carrier(parcels: int) -> Problem:
    """Two places, a carrier with two arms, and parcels that must be brought from one place to the other."""
    names = " ".join(f"x{i}" for i in range(parcels))
    domain = """(define (domain carry) (:requirements :typing) (:types room parcel arm)
     (:predicates (me ?r - room) (at ?x - parcel ?r - room) (free ?a - arm) (carry ?x - parcel ?a - arm))
     (:action move :parameters (?p ?q - room) :precondition (me ?p) :effect (and (me ?q) (not (me ?p))))
     (:action pick :parameters (?x - parcel ?r - room ?a - arm) :precondition (and (me ?r) (at ?x ?r) (free ?a))
      :effect (and (carry ?x ?a) (not (at ?x ?r)) (not (free ?a))))
     (:action drop :parameters (?x - parcel ?r - room ?a - arm) :precondition (and (me ?r) (carry ?x ?a))
      :effect (and (at ?x ?r) (free ?a) (not (carry ?x ?a)))))"""
    text = f"""(define (problem p) (:domain carry) (:objects here there - room {names} - parcel left right - arm)
     (:init (me here) (free left) (free right) {" ".join(f"(at x{i} here)" for i in range(parcels))})
     (:goal (and {" ".join(f"(at x{i} there)" for i in range(parcels))})))"""
    return imported(parse(domain, text)).problem


def test_shortening_makes_no_other_order_of_the_steps_after_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    task, found = ground(carrier(6)), list[int]()
    assert isinstance(task, Task)
    search(task, found=found.extend)
    monkeypatch.setattr("confab.planner.grounded.plan_windows.regrouped", lambda *_: pytest.fail("another order"))
    assert task.cost_of(shorter(task, found, work=10**7, deadline=0.0)) <= task.cost_of(found)


def test_windows_shorten_a_plan_that_still_achieves_the_goal() -> None:
    task = ground(carrier(6))
    assert isinstance(task, Task)
    number = {task.describe(operator)[:2]: operator for operator in range(len(task))}
    go, back = number["MOVE", ("here", "there")], number["MOVE", ("there", "here")]
    first = [  # one parcel at a time
        step
        for i in range(6)
        for step in (number["PICK", (f"x{i}", "here", "left")], go, number["DROP", (f"x{i}", "there", "left")], back)
    ]
    plan = shorter(task, first, work=10**7)
    assert plan == shorter(task, first, work=10**7)
    assert (
        len(plan) == 17 < len(without_superfluous_steps(task, first))
    )  # three trips with two parcels, and two trips back
    state: int | None = task.initial
    for operator in plan:
        assert state is not None
        state = task.applied(state, operator)
    assert state is not None and state & task.goal == task.goal
    assert shorter(task, first, work=0) == without_superfluous_steps(task, first)


def test_remaining_work_is_spent_on_the_whole_plan_until_no_plan_is_cheaper() -> None:
    problem = confab.load("tour-large").problem
    task, first = ground(problem, 1, goal=problem.goal_on(1)), list[int]()
    assert isinstance(task, Task)
    search(task, found=first.extend)
    assert len(shorter(task, first, work=5_000_000)) == 17 < len(first)  # --optimal proves 17


def test_several_steps_with_the_effect_of_one_step_are_replaced_by_it() -> None:
    """A plan that fetches a bomb from the end of the road for each door is shortened, since doors also open without bombs."""
    domain = """(define (domain mine) (:predicates (at ?x) (road ?x ?y) (store ?x) (bomb) (open ?x) (door ?x ?y))
      (:action go :parameters (?x ?y) :precondition (and (at ?x) (road ?x ?y)) :effect (and (not (at ?x)) (at ?y)))
      (:action take :parameters (?x) :precondition (and (at ?x) (store ?x)) :effect (bomb))
      (:action blast :parameters (?x ?y) :precondition (and (at ?x) (door ?x ?y) (bomb)) :effect (and (open ?y) (not (bomb))))
      (:action fire :parameters (?x ?y) :precondition (and (at ?x) (door ?x ?y)) :effect (open ?y)))"""
    places, doors = [f"p{i}" for i in range(16)], [f"d{i}" for i in range(9)]
    road = " ".join(f"(road p{i} p{i + 1}) (road p{i + 1} p{i})" for i in range(15))
    problem = imported(
        parse(
            domain,
            f"(define (problem m) (:domain mine) (:objects {' '.join(places + doors)}) (:init (at p0) (store p15) {road} "
            f"{' '.join(f'(door p0 {d})' for d in doors)}) (:goal (and {' '.join(f'(open {d})' for d in doors)})))",
        )
    ).problem
    task = ground(problem)
    assert isinstance(task, Task)
    there = [("GO", (f"p{i}", f"p{i + 1}")) for i in range(15)]
    back = [("GO", (f"p{i + 1}", f"p{i}")) for i in reversed(range(15))]
    steps = [step for d in doors for step in (*there, ("TAKE", ("p15",)), *back, ("BLAST", ("p0", d)))]
    plan = task.operators_of(steps)
    assert plan is not None
    assert len(plan) == 32 * len(doors)
    assert len(shorter(task, plan, 200_000)) == len(doors)


def test_windows_shorten_a_plan_of_single_parcels_to_two_parcels_per_trip() -> None:
    task = ground(carrier(40))
    assert isinstance(task, Task)
    number = {task.describe(operator)[:2]: operator for operator in range(len(task))}
    go, back = number["MOVE", ("here", "there")], number["MOVE", ("there", "here")]
    first = [
        step
        for i in range(40)
        for step in (number["PICK", (f"x{i}", "here", "left")], go, number["DROP", (f"x{i}", "there", "left")], back)
    ]
    assert (
        len(shorter(task, first, work=400_000)) == 6 * 20 - 1
    )  # two at a time; picking another parcel in between is useless


def test_regrouped_steps_stand_behind_the_steps_on_which_they_depend(tabletop: Problem) -> None:
    task = ground(tabletop, goal=tabletop.goal_on(3))
    assert isinstance(task, Task)
    plan = list(search(task).plan)
    again = regrouped(task, plan)
    assert sorted(again) == sorted(plan)
    assert validate(tabletop, Plan(task.steps(again))) == []


def test_a_lookahead_drives_back_for_the_remaining_goals() -> None:
    task = ground(carrier(12))
    assert isinstance(task, Task)
    evaluation = heuristic(task)(task.initial)
    assert evaluation is not None
    state, path = lookahead(task)(task.initial, evaluation.plan)
    assert state & task.goal == task.goal
    assert task.carried_out(task.initial, path) == (state, path)
    assert len(path) <= 4 * 12 + 1  # one parcel at a time, there and back


def test_the_tree_of_many_operators_with_a_symbol_each_grows_with_their_number() -> None:
    def seconds(number: int) -> float:
        applicable = tree(np.arange(number + 1), np.arange(number), [1 << bit for bit in range(number)])
        began = process_time()
        assert applicable.of(1 << 7)[0] == [7]
        return process_time() - began

    assert seconds(20_000) < 5


def test_a_lookahead_replaces_a_step_that_is_not_applicable() -> None:
    domain = """(define (domain collect) (:predicates (way ?p ?q) (me ?p) (at ?x ?p) (have ?x))
     (:action go :parameters (?p ?q) :precondition (and (way ?p ?q) (me ?p)) :effect (and (me ?q) (not (me ?p))))
     (:action take :parameters (?x ?p) :precondition (and (me ?p) (at ?x ?p)) :effect (and (have ?x) (not (at ?x ?p)))))"""
    places = "abcd"
    ways = " ".join(f"(way {p} {q})" for p in places for q in places if p != q)
    text = f"""(define (problem p) (:domain collect) (:objects a b c d x y z)
     (:init (me a) {ways} (at x b) (at y c) (at z d)) (:goal (and (have x) (have y) (have z))))"""
    task = ground(imported(parse(domain, text)).problem)
    assert isinstance(task, Task)
    evaluation = heuristic(task)(task.initial)
    assert evaluation is not None and evaluation[0] == 6
    state, path = lookahead(task)(
        task.initial, evaluation[1]
    )  # from a to b, c and d: only one of these moves is applicable in the given form
    assert state & task.goal == task.goal and len(path) == 6
    reached: int | None = task.initial
    for operator in path:
        assert reached is not None
        reached = task.applied(reached, operator)
    assert reached == state


def test_a_search_at_its_memory_limit_gives_up_and_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.planner.grounded.exploring.MOST_BYTES", 0)
    outcome = plan_level(carrier(40))
    assert outcome.status is Status.GAVE_UP and outcome.reason is not None
    assert outcome.reason.text == "there isn't enough memory to continue planning"


def test_the_other_searches_continue_if_one_search_runs_out_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Novelty, "candidates", lambda _: iter(np.empty(1 << 55)))
    outcome = plan_level(carrier(8))
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert not validate(carrier(8), outcome.plan)


@pytest.mark.parametrize("mode", MODES)
def test_a_call_that_runs_out_of_memory_gives_up_with_this_reason(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODES, mode, lambda request: np.empty(1 << 55))
    outcome = solve(Request(carrier(2), mode))
    assert (outcome.status, outcome.plan, outcome.reason) == (Status.GAVE_UP, None, OUT_OF_MEMORY)


def test_a_problem_of_one_level_is_planned_as_a_whole_unless_it_is_too_large(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def series(*_: object) -> bool:
        raise AssertionError("goals in series")

    monkeypatch.setattr(Agenda, "achieve_all", series)
    lift = carrier(8)
    outcome = fast.plan(lift)
    assert outcome.plan is not None
    assert validate(lift, outcome.plan) == []
    monkeypatch.setattr(fast, "FLAT", 0)
    outcome = fast.plan(lift)  # without grounding
    assert outcome.plan is not None
    assert validate(lift, outcome.plan) == []
    monkeypatch.setattr(fast, "TRIALS_AT_FIRST", 0)
    with pytest.raises(AssertionError, match="goals in series"):
        fast.plan(lift)


TURNED = """(define (domain cube) (:predicates (on ?x ?y ?z) (off ?x ?y ?z) (lit ?x))
 (:action turn :parameters () :effect (forall (?x ?y ?z) (when (and (on ?x ?y ?z) (not (lit ?y)))
   (and (not (on ?x ?y ?z)) (on ?y ?x ?z) (off ?z ?x ?y)))))
 (:action light :parameters (?a) :effect (lit ?a)))"""
CORNERS = """(define (problem p) (:domain cube) (:objects a b c d e) (:init (on a b c) (on b d e) (lit d) (off a a b))
 (:goal (and (on b a c) (off c a b))))"""


def test_similar_conditional_effects_are_joined_once_and_keep_their_meaning(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = imported(parse(TURNED, CORNERS)).problem
    assert len(problem.domain.behaviors["TURN"].effects) == 3 * 5**3
    task = ground(problem)
    joins = len(reachability.Reached(problem, 1, problem.initial, 10**6, None).schemas)
    monkeypatch.setattr(reachability, "merged", lambda problem, level: problem)
    singly = ground(problem)
    assert isinstance(task, Task) and isinstance(singly, Task)
    assert joins <= 10 < len(reachability.Reached(problem, 1, problem.initial, 10**6, None).schemas)
    assert reached_by(task, 4) == reached_by(singly, 4)


def test_the_reason_names_the_conditional_effect_that_is_never_applied() -> None:
    reason = solve(Request(imported(parse(TURNED, CORNERS.replace("(off c a b)", "(off e e e)"))).problem)).reason
    assert reason is not None
    assert reason.text == "e OFF e e true can't be reached: TURN requires e ON e e true, which never holds"
    assert not any("/" in term for term in reason.terms)


def reached_by(task: Task, turns: int) -> set[tuple[str, ...]]:
    """Return the states, as facts, that are reachable in at most `turns` steps."""
    seen, new = {task.initial}, {task.initial}
    for _ in range(turns):
        new = {
            after
            for state in new
            for operator in task.applicable(state)[0]
            if (after := task.applied(state, operator)) is not None
        } - seen
        seen |= new
    return {tuple(sorted(str(task.facts[bit]) for bit in range(len(task.facts)) if state >> bit & 1)) for state in seen}


def test_a_task_of_one_level_that_is_planned_as_a_whole_is_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    def compiled(problem: Problem) -> Compiled:
        raise AssertionError("thousands of conditional effects would be compiled for seconds")

    monkeypatch.setattr(fast, "compiled", compiled)
    outcome = solve(Request(imported(parse(TURNED, CORNERS.replace("(off c a b)", "(lit a)"))).problem))
    assert outcome.status is Status.SOLVED and outcome.plan is not None and len(outcome.plan.steps) == 2


def test_a_search_without_memory_for_its_heuristic_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(task: Task) -> Evaluate:
        raise MemoryError

    task = ground(corridor(3))
    assert isinstance(task, Task)
    monkeypatch.setattr(best_first, "heuristic", none)
    going = Search(task)
    for _ in range(2):
        found = going.go_on()
        assert found.status is Status.GAVE_UP and found.reason is OUT_OF_MEMORY


def test_a_plan_is_kept_if_the_time_ends_while_it_is_shortened(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object) -> list[int]:
        raise OutOfTimeError("shortening", 1.0)

    task = ground(corridor(3))
    assert isinstance(task, Task)
    monkeypatch.setattr(best_first, "shorter", late)
    assert search(task).status is Status.SOLVED
