"""If the fact that a step is needed for is reverted just before it is needed, the checker rejects the plan."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from random import Random

import pytest

import confab
from confab.planner.causal_links import Need, NeedKind, purposes
from confab.planner.contrast import instead_of
from confab.planner.hierarchical.planner import plan as default
from confab.planner.plan import Limits, Plan, Step
from confab.planner.plan_costs import cost_of
from confab.planner.validation import Fault, validate
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Behavior, Symbol, ValueEffect
from tests.planner.small import CASES
from worlds.families import tabletop
from worlds.hierarchies import hierarchy
from worlds.writing import quantified

UNDO = "UNDO"


def undone(problem: Problem, plan: Plan, need: Need) -> list[Fault]:
    """Return the faults of a plan in which an additional step reverts a needed fact before the fact is needed."""
    depth = max(step.level for step in plan.walk())
    effects = tuple(ValueEffect(c.fact.symbol.situation, c.fact.symbol.arguments, c.before) for c in need.gives)
    undo = Behavior(UNDO, depth, (), effects=effects)
    domain = replace(problem.domain, behaviors={**problem.domain.behaviors, UNDO: undo})
    wider = replace(problem, domain=domain)
    step = Step((-1,), wider.id_of(UNDO, ()), depth, UNDO, ())

    def put(steps: Sequence[Step], above: tuple[int, ...]) -> tuple[Step, ...]:
        found: list[Step] = []
        for one in steps:
            found += [step] if need.kind is NeedKind.LATER and one.path == need.by else []
            found.append(replace(one, steps=put(one.steps, one.path)))
        at_its_end = need.kind is not NeedKind.LATER and above == need.by and found
        return (*found, step) if at_its_end else tuple(found)

    return [fault for fault in validate(wider, Plan(put(plan.steps, ()))) if fault.path != step.path]


def check(problem: Problem) -> int:
    """Compare all causal links of a problem's plan with the checker; return the number of links."""
    plan = default(problem).plan
    if plan is None:
        return 0
    links = purposes(problem, plan)
    assert links.keys() == {step.path for step in plan.walk()}
    for path, purpose in links.items():
        for need in purpose.needs:
            faults = undone(problem, plan, need)
            assert faults, (path, need)
            if need.conditions or need.kind in (NeedKind.GOAL, NeedKind.ABOVE):
                assert need.by in {fault.path for fault in faults}, (path, need, faults)
    return sum(len(purpose.needs) for purpose in links.values())


@pytest.mark.parametrize("block", range(3))
def test_a_plan_in_a_random_world_fails_without_the_fact_that_a_step_is_needed_for(block: int) -> None:
    assert sum(check(hierarchy(seed)) for seed in range(1000 + 8 * block, 1008 + 8 * block)) > 60


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_a_plan_of_a_case_with_levels_fails_without_the_fact_that_a_step_is_needed_for(case) -> None:  # type: ignore[no-untyped-def]
    assert check(case().problem) > 0


def test_every_step_of_the_tabletop_plan_is_needed_and_steps_of_level_1_for_a_goal() -> None:
    problem = tabletop()
    plan = default(problem).plan
    assert plan is not None
    links = purposes(problem, plan)
    assert all(purpose.needs for purpose in links.values())
    assert {links[step.path].needs[0].kind for step in plan.steps} == {NeedKind.GOAL}
    assert check(problem) > 60


def test_a_superfluous_step_has_no_purpose() -> None:
    problem = tabletop()
    plan = default(problem).plan
    assert plan is not None
    wanted = plan.steps[0]
    goal = {s: v for s, v in problem.goal.items() if s != Symbol("LOCATION", wanted.arguments[:1])}
    assert purposes(replace(problem, goal=goal), plan)[wanted.path].needs == ()


def test_an_alternative_step_is_in_a_valid_plan_or_has_an_unmet_condition_or_a_reason() -> None:
    told: Counter[str] = Counter()
    for seed in range(5000, 5012):
        problem, rng = hierarchy(seed), Random(seed)
        plan = default(problem).plan
        if plan is None or not plan.steps:
            continue
        for level in problem.domain.levels:
            possible = list(quantified(problem, level))
            for behavior, arguments in rng.sample(possible, min(3, len(possible))):
                given = {p.name: a for p, a in zip(behavior.parameters, arguments, strict=True)}
                found = instead_of(
                    problem, plan, behavior, given, lambda p: default(p, limits=Limits(expansions=20_000))
                )
                if found.plan is not None:
                    assert validate(problem, found.plan) == []
                    assert (behavior.name, arguments) in {(s.behavior, s.arguments) for s in found.plan.walk()}
                    assert found.cost == cost_of(problem, found.plan)
                kind = "plan" if found.plan else "lacks" if found.lacks else "no" if found.reason else "same"
                told[kind] += 1
    assert told["plan"] >= 5
    assert told["lacks"] >= 5
    assert told["no"] <= 0.2 * told.total()


def test_a_step_that_takes_the_last_of_an_amount_serves_a_goal_for_little_of_it() -> None:
    result = confab.load("carts-small").plan()
    taken = [result.why(step) for step in result.plan.steps if step.behavior == "L1_PICK_UP"]
    assert len(taken) == 3
    assert ["the goal requires that store stock 0" in str(one) for one in taken] == [False, False, True]
    assert not [one for one in taken if "no later step" in str(one)]
