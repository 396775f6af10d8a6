"""Why a fact can't be reached, in the ontology's terms: which behaviour could bring it about, and what that one lacks."""

from __future__ import annotations

from planner.grounding import Reached
from planner.plan import Reason
from reasoner.symbols import Fact


def unreachable(reached: Reached, goal: Fact) -> Reason:
    """Return why a goal is not reachable even if nothing ever becomes false."""
    return Reason(f"{goal} can't be reached", (*goal.symbol.arguments, goal.symbol.situation, goal.value))
