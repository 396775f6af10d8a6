"""Plans that leave a level, and plans of one level, are shortened on this level and regrouped under the levels above."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import pytest

import confab
from confab.planner.hierarchical.agenda import Agenda
from confab.planner.hierarchical.planner import plan as default_plan
from confab.planner.hierarchical.regrouping import under_the_levels_above
from confab.planner.paper.hierarchy import plan as paper_plan
from confab.planner.plan import Limits, Plan
from confab.planner.solve import Request, solve
from confab.planner.validation import validate
from confab.reasoner.generate import write_scene
from confab.reasoner.problem import Problem
from worlds.agreement import cheapest
from worlds.cups import scene
from worlds.hierarchies import hierarchy

LEFT = (700316, 700359, 700680, 701211, 701609)
"""Seeds of worlds whose plans leave level 1."""
LIMITS = Limits(expansions=20_000)


def lowest(problem: Problem) -> Problem:
    """Return a problem with only the behaviours of the lowest level."""
    level = problem.domain.levels[-1]
    behaviors = {name: replace(b, level=1) for name, b in problem.domain.behaviors.items() if b.level == level}
    situations = {name: replace(s, level=1) for name, s in problem.domain.situations.items()}
    return replace(problem, domain=replace(problem.domain, behaviors=behaviors, situations=situations))


@pytest.mark.parametrize("seed", LEFT)
def test_a_plan_that_leaves_a_level_has_no_more_steps_than_needed(seed: int) -> None:
    problem = hierarchy(seed)
    ours, paper = default_plan(problem, limits=LIMITS), paper_plan(problem, limits=LIMITS)
    assert ours.plan is not None
    assert paper.plan is not None
    assert len(ours.plan.primitives) <= 1.2 * len(paper.plan.primitives)


def test_plans_of_small_worlds_of_one_level_are_nearly_shortest() -> None:
    known = []
    for seed in range(700_000, 700_040):
        problem = lowest(hierarchy(seed))
        least, found = cheapest(problem, most=3_000), default_plan(problem, limits=LIMITS)
        if least is not None and found.plan is not None:
            known.append(len(found.plan.primitives) / max(least, 1))
    assert len(known) > 15
    assert max(known) <= 1.2


def test_primitives_are_grouped_under_steps_of_upper_levels_that_have_their_joint_effect() -> None:
    kept = 0
    for seed in range(700_000, 700_060):
        problem = hierarchy(seed)
        found = default_plan(problem, limits=LIMITS)
        if found.plan is None or not found.plan.steps or found.given_up:
            continue
        flat = Plan(tuple(replace(s, path=(i,), bindings={}) for i, s in enumerate(found.plan.primitives)))
        grouped = under_the_levels_above(problem, flat)
        assert not validate(problem, grouped)
        by_themselves = sum(not step.steps for step in grouped.steps)
        assert by_themselves <= sum(not step.steps for step in found.plan.steps)
        kept += 1
    assert kept > 15


def test_the_last_resort_search_keeps_the_levels_in_most_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Agenda, "achieve_all", lambda agenda: False)
    tops = []
    for seed in range(700_000, 700_030):
        problem = hierarchy(seed)
        found = default_plan(problem, limits=LIMITS)
        if found.plan is not None and found.plan.steps:
            assert not validate(problem, found.plan)
            on_top = all(step.level == problem.domain.levels[0] for step in found.plan.steps)
            assert on_top is not bool(found.given_up)
            tops.append(on_top)
    assert sum(tops) > len(tops) / 2 > 5


def test_a_plan_of_few_steps_is_shortened_by_little_work_on_a_level_of_thousands_of_operators(tmp_path: Path) -> None:
    """Derived bits count as work of the search for a shorter plan; formerly, this search took a minute for a plan of ten steps."""
    path = tmp_path / "cups.ttl"
    path.write_text(scene(66, defined=True), encoding="utf-8")
    problem = confab.load(path).problem
    begin = process_time()
    found = solve(Request(problem))
    assert found.plan is not None
    assert len(found.plan.steps) == 8
    assert process_time() - begin < 20


def test_a_swap_of_twenty_objects_is_planned_and_shortened_within_three_million_calls(tmp_path: Path) -> None:
    """The calls of Python functions stand for CPU time; a part of them varies the order of all steps."""
    path = tmp_path / "swap.ttl"
    write_scene(path, "swap", 20)
    problem = confab.load(path).problem
    calls = 0

    def counted(_: object, event: str, __: object) -> None:
        nonlocal calls
        calls += event == "call"

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        found = solve(Request(problem))
    finally:
        sys.setprofile(before)
    assert found.plan is not None
    assert len(found.plan.primitives) <= 186
    assert calls < 3_000_000
