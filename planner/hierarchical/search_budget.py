"""Search budgets: following learned rules, searching for a few relevant steps, and searching scopes of increasing size."""

from __future__ import annotations

from dataclasses import dataclass

MUCH = 1_500_000
"""Maximum work of one search in a large scope; the unit is one operator in one state."""
MOST_OPERATORS = 3_000
"""Maximum number of quantified behaviours of a level for which the whole level is searched."""


@dataclass(frozen=True)
class SearchBudget:
    """The limits of one search for steps that achieve targets.

    Attributes
    ----------
    steps : int
        Maximum number of relevant steps; 0 for the search of a scope.
    most_values : int, optional
        Maximum number of values that are examined for each target to determine the scope; None if the scope is the whole level.
    spares : int
        Number of additional individuals of each symmetry class in the scope.
    work : int
        Maximum work of one search; the unit is one operator in one state.
    rules : bool
        Whether the planner follows learned rules instead of searching.
    """

    steps: int = 0
    most_values: int | None = None
    spares: int = 1
    work: int = 200_000
    rules: bool = False


BY_RULES = SearchBudget(rules=True)
"""Budget for following learned rules; the rules have a separate limit of work."""
ONE_STEP, FEW_STEPS, REFINING = SearchBudget(steps=1), SearchBudget(steps=3), SearchBudget(steps=4)
"""Budgets for one relevant step towards a goal, for a few relevant steps towards a goal, and for a refinement."""
SMALL, WIDER = SearchBudget(most_values=10, spares=0, work=50_000), SearchBudget(most_values=20)
WIDE, WHOLE = SearchBudget(most_values=160, spares=4, work=MUCH), SearchBudget(work=MUCH)
PART = SearchBudget(work=MUCH // 8)
"""Budget for a search of a whole level before a proof of unsolvability is tried."""


def scope_budgets(size: int) -> tuple[SearchBudget, ...]:
    """Return the budgets for searching scopes of a level with `size` quantified behaviours, the cheapest budget first."""
    return (SMALL, WIDER, WHOLE if size <= MOST_OPERATORS else WIDE)
