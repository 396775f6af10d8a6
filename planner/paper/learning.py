"""Learning from an executed plan by eq. (2) of the paper.

Eq. (2) is applied to each behaviour of each level, in the situation in which the behaviour was chosen.
"""

from __future__ import annotations

from collections.abc import Sequence

from confab.planner.paper.cogency import PAPER, situation
from confab.planner.paper.transitions import Model, Values
from confab.planner.plan import Plan, Step
from confab.reasoner.limits import check
from confab.reasoner.memory.experience import LearningError
from confab.reasoner.memory.links import Conclusion, Links
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import GroundBehavior, State


def learn(problem: Problem, plan: Plan, links: Links) -> Links:
    """Return the links after one successful execution of a plan from the initial state, without changing the given links.

    A plan without refinements teaches only the level of its steps.

    Raises
    ------
    LearningError
        The preconditions of a step don't hold in the state before the step.
    """
    learned = Links({c: {s: dict(t) for s, t in symbols.items()} for c, symbols in links.tables.items()})
    model = Model(problem)
    _learn_steps(model, plan.steps, model.values(problem.initial), learned)
    return learned


def _learn_steps(model: Model, steps: Sequence[Step], start: Values, links: Links) -> Values:
    state = start
    for step in steps:
        now = state
        for one in step.together:
            applied = model.apply(GroundBehavior(one.id, one.behavior, one.arguments), now)
            if applied is None:
                raise LearningError(
                    f"step {'.'.join(map(str, step.path))} ({step}): its preconditions don't hold there"
                )
            conclusion = (one.behavior, one.arguments)
            reinforce(links, conclusion, model.state(now), model.problem, one.level, PAPER.learning)
            now = applied.after
        state = _learn_steps(model, step.steps, state, links) if step.steps else now
    return state


def reinforce(
    links: Links, conclusion: Conclusion, state: State, problem: Problem, level: int, learning: float
) -> None:
    """Apply eq. (2): raise the probability of each present fact by λ, then normalise the distribution of each symbol.

    The links are changed in place. `state` is the situation in which the behaviour was chosen, which the paper doesn't specify. The
    situation excludes symbols and values below the behaviour's level. `learning` is λ.
    """
    check("learning")
    symbols = links.tables.setdefault(conclusion, {})
    for symbol, value, values in situation(state, problem, level):
        old = symbols.get(symbol) or dict.fromkeys(values, 1.0 / len(values))
        raised = {v: p + (learning if v == value else 0.0) for v, p in old.items()}
        total = sum(raised.values())
        symbols[symbol] = {v: p / total for v, p in raised.items()}
