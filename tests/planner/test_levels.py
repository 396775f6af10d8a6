"""What a plan of several levels means (docs/levels.md): the planners and the checker agree on it, case by case."""

from collections.abc import Callable, Mapping

import pytest

from planner.paper.hierarchy import plan as paper
from planner.plan import Outcome, Plan, Status
from planner.validation import successor, validate
from reasoner.symbols import FALSE, Problem, Symbol
from tests.planner.small import CASES, Case

MODES: dict[str, Callable[[Problem], Outcome]] = {"paper": paper}
"""The planners that every case is given to."""


def after(problem: Problem, plan: Plan) -> Mapping[Symbol, str]:
    """Return the state in which the primitives of a plan end."""
    state: Mapping[Symbol, str] | None = problem.initial
    for step in plan.primitives:
        assert state is not None
        state = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state)
    assert state is not None
    return state


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_each_case_has_its_plan(case: Callable[[], Case], mode: str) -> None:
    wanted = case()
    outcome = MODES[mode](wanted.problem)
    assert outcome.status is Status.SOLVED
    assert outcome.plan is not None
    assert validate(wanted.problem, outcome.plan) == []
    assert outcome.plan.length == wanted.length
    assert outcome.fallbacks == 0
    end = after(wanted.problem, outcome.plan)
    assert {symbol: end.get(symbol, FALSE) for symbol in wanted.afterwards} == wanted.afterwards
    assert all(end[symbol] != value for symbol, value in wanted.never.items())
