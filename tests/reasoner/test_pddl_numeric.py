"""Numbers in PDDL: random problems are imported, planned, exported and imported again; unified-planning judges both versions."""

from collections import deque
from pathlib import Path
from random import Random

import pytest

from confab.planner.plan import Limits, Status
from confab.planner.solve import Request, solve
from confab.reasoner.graph.knowledge import load
from confab.reasoner.pddl.exporting import plan_of, to_pddl
from confab.reasoner.pddl.importing import Imported, imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.pddl.words import PddlError
from confab.reasoner.problem import Problem
from confab.reasoner.reading.problem import read

FUNCTIONS = ("(level ?x)", "(level ?y)", "(total)")
STATES = 300
"""Maximum number of states of a problem that are examined before the problem counts as too large."""


def amount(rng: Random, own: str, depth: int = 1) -> str:
    """Return a number, a function or a calculation that is linear in the changing amounts."""
    match rng.choice(("number", "function", "size", "sum", "times") if depth else ("number", "function")):
        case "function":
            return rng.choice([f for f in FUNCTIONS if "?y" not in f or "?y" in own])
        case "size":
            return "(size ?x)"
        case "sum":
            return f"({rng.choice('+-')} {amount(rng, own, 0)} {amount(rng, own, 0)})"
        case "times":
            return f"({rng.choice('*/')} {amount(rng, own, 0)} {rng.choice(('2', '0.5', '(size ?x)'))})"
        case _:
            return rng.choice(("0", "1", "2", "0.5", "1.5"))


def pddl(seed: int) -> tuple[str, str]:
    """Return a random numeric domain and problem."""
    rng = Random(seed)
    actions = []
    for i in range(3):
        own = rng.choice(("?x - thing", "?x - thing ?y - thing"))
        needs = [f"({rng.choice(('<', '<=', '=', '>=', '>'))} {amount(rng, own)} {amount(rng, own)})" for _ in "ab"]
        needs = [f"(not {need})" if rng.random() < 0.3 else need for need in needs[: rng.randint(1, 2)]]
        needs.append(rng.choice(("(on ?x)", "(not (on ?x))")))
        changed = rng.choice([f for f in FUNCTIONS if "?y" not in f or "?y" in own])
        head = rng.choice(("increase", "decrease", "increase", "decrease", "assign"))
        does = [f"({head} {changed} {amount(rng, own)})"]
        does.append(rng.choice(("(on ?x)", "(not (on ?x))", "(when (>= (total) 1) (increase (level ?x) 1))")))
        actions.append(
            f"(:action act{i} :parameters ({own}) :precondition (and {' '.join(needs)}) :effect (and {' '.join(does)}))"
        )
    domain = (
        "(define (domain random) (:requirements :typing :numeric-fluents) (:types thing) (:predicates (on ?x - thing))\n"
        "(:functions (level ?x - thing) (total) (size ?x - thing))\n" + "\n".join(actions) + ")"
    )
    facts = [f"(= ({f} {x}) {rng.choice(('1', '2', '0.5'))})" for f in ("level", "size") for x in ("a", "b")]
    facts += ["(= (total) 1)", *(f"(on {x})" for x in ("a", "b") if rng.random() < 0.5)]
    goal = [
        f"({rng.choice(('<=', '>=', '>', '='))} {rng.choice(('(level a)', '(total)', '(level b)'))} {rng.choice('0123')})"
        for _ in range(rng.randint(1, 2))
    ]
    if rng.random() < 0.3:
        goal.append("(>= (+ (level a) (level b)) 3)")
    problem = (
        f"(define (problem p) (:domain random) (:objects a b - thing)\n(:init {' '.join(facts)})\n"
        f"(:goal (and {' '.join(goal)})))"
    )
    return domain, problem


def judged(domain: str, problem: str, plan: list[str]) -> bool:
    """Return whether unified-planning accepts steps as a plan."""
    shortcuts = pytest.importorskip("unified_planning.shortcuts")
    from unified_planning.engines import SequentialPlanValidator
    from unified_planning.io import PDDLReader
    from unified_planning.plans import ActionInstance, SequentialPlan

    task = PDDLReader().parse_problem_string(domain, problem)
    steps = [
        ActionInstance(task.action(name), [shortcuts.ObjectExp(task.object(word)) for word in words])
        for name, *words in map(str.split, plan)
    ]
    return bool(SequentialPlanValidator().validate(task, SequentialPlan(steps)).status.name == "VALID")


def shortest(domain: str, problem: str) -> int | None:
    """Return the length of a shortest plan, computed by unified-planning's simulator; -1 if there is no plan, None if unknown."""
    pytest.importorskip("unified_planning")
    from unified_planning.engines.sequential_simulator import UPSequentialSimulator
    from unified_planning.io import PDDLReader

    task = PDDLReader().parse_problem_string(domain, problem)
    fluents = sorted(task.initial_values, key=str)
    with UPSequentialSimulator(task) as simulator:
        start = simulator.get_initial_state()
        seen = {tuple(str(start.get_value(f)) for f in fluents)}
        waiting = deque([(start, 0)])
        while waiting:
            state, depth = waiting.popleft()
            if simulator.is_goal(state):
                return depth
            for action, parameters in simulator.get_applicable_actions(state):
                after = simulator.apply(state, action, parameters)
                if after is not None and (key := tuple(str(after.get_value(f)) for f in fluents)) not in seen:
                    if len(seen) >= STATES:
                        return None
                    seen.add(key)
                    waiting.append((after, depth + 1))
    return -1


def planned(found: Imported, mode: str = "guarded") -> tuple[Status, list[str]]:
    outcome = solve(Request(found.problem, mode, Limits(20_000, 20)))
    steps = outcome.plan.primitives if outcome.plan else ()
    return outcome.status, [line for step in steps if (line := found.line(step.behavior, step.arguments))]


@pytest.mark.parametrize("seed", range(12))
def test_random_numeric_problems_have_the_answer_of_an_exhaustive_search(seed: int) -> None:
    domain, problem = pddl(seed)
    length = shortest(domain, problem)
    if length is None:
        return
    found = imported(parse(domain, problem))
    status, plan = planned(found, "optimal")
    assert status is (Status.UNSOLVABLE if length < 0 else Status.SOLVED)
    assert length < 0 or (len(plan) == length and judged(domain, problem, plan))
    exported = to_pddl(found.problem)
    again, steps = planned(imported(parse(exported.domain, exported.problem)))
    assert again is status
    assert not steps or judged(exported.domain, exported.problem, steps)
    assert len(plan_of(exported, "\n".join(steps))) == len(steps)


def test_an_imported_numeric_problem_is_read_back_from_turtle(tmp_path: Path) -> None:
    for seed in range(4):
        problem = imported(parse(*pddl(seed))).problem
        path = tmp_path / f"world{seed}.ttl"
        path.write_text(turtle(problem, "random", "A random world."), encoding="utf-8")
        again: Problem = read(load(path)).problem
        assert again.initial == problem.initial
        assert again.goal == problem.goal
        assert again.relations == problem.relations
        assert again.domain.behaviors == problem.domain.behaviors
        assert again.domain.situations == problem.domain.situations


def levels_and_total(effect: str) -> tuple[str, str]:
    """Return a domain with the given effect and another effect that raises levels, and a problem whose goal is a total."""
    return (
        "(define (domain d) (:types thing) (:functions (level ?x - thing) (total))"
        f"(:action go :parameters (?x - thing) :effect {effect})"
        "(:action up :parameters (?x - thing) :effect (increase (level ?x) 1)))",
        "(define (problem p) (:domain d) (:objects a - thing) (:init (= (total) 0) (= (level a) 0)) (:goal (= (total) 7)))",
    )


@pytest.mark.parametrize(
    ("domain", "said"),
    [
        ("(increase (total) much)", "wanted a number, got 'much'"),
        ("(increase (much ?x) 1)", "undefined function 'much'"),
        ("(assign (total) (level ?x ?x))", "takes 1 arguments, got 2"),
    ],
)
def test_invalid_numeric_expressions_are_refused_by_name(domain: str, said: str) -> None:
    with pytest.raises((PddlError, ValueError), match="(?s)" + said.replace("(", r"\(")):
        solve(Request(imported(parse(*levels_and_total(domain))).problem, "optimal"))


def test_a_task_with_a_product_of_changing_amounts_is_solved_without_a_bound() -> None:
    problem = imported(parse(*levels_and_total("(increase (total) (* (level ?x) (level ?x)))"))).problem
    outcomes = {mode: solve(Request(problem, mode)) for mode in ("guarded", "optimal", "paper")}
    assert {outcome.status for outcome in outcomes.values()} == {Status.SOLVED}
    assert not any(outcome.bound for outcome in outcomes.values())
