"""Search budgets: learned rules, a few relevant steps, then scopes, each about as expensive as all searches before it."""

from __future__ import annotations

from dataclasses import dataclass

MUCH = 1_500_000
"""Maximum work of one search in a large scope, in states times operators."""
MOST_OPERATORS = 3_000
"""Maximum number of quantified behaviours of a level that is searched as a whole."""


@dataclass(frozen=True)
class SearchBudget:
    """The limits of one search for steps towards some targets.

    Attributes
    ----------
    steps : int
        Maximum number of relevant steps; 0 if a scope is searched instead.
    questions : int, optional
        Maximum number of values on the chains towards one target; None searches the whole level.
    spares : int
        Number of additional individuals of each symmetry class in the scope.
    work : int
        Maximum work of one search, in states times operators.
    rules : bool
        Whether learned rules are followed instead of a search.
    """

    steps: int = 0
    questions: int | None = None
    spares: int = 1
    work: int = 200_000
    rules: bool = False


BY_RULES = SearchBudget(rules=True)
"""Budget for following learned rules, which limit their own work."""
ONE_STEP, FEW_STEPS, REFINING = SearchBudget(steps=1), SearchBudget(steps=3), SearchBudget(steps=4)
"""Budgets for one relevant step towards a goal, for a few steps towards a goal, and for a few steps in a refinement."""
SMALL, WIDER = SearchBudget(questions=10, spares=0, work=50_000), SearchBudget(questions=20)
WIDE, WHOLE = SearchBudget(questions=160, spares=4, work=MUCH), SearchBudget(work=MUCH)


def scopes(size: int) -> tuple[SearchBudget, ...]:
    """Return the budgets for searching scopes of a level with `size` quantified behaviours, cheapest first."""
    return (SMALL, WIDER, WHOLE if size <= MOST_OPERATORS else WIDE)
