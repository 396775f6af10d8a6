"""What a caller may hand over where a plan, a memory or some facts are wanted: itself, what has it, or a file's name."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol, TypeAlias

from confab.interchange import read_plan
from planner.plan import Plan
from reasoner.graph.knowledge import KnowledgeError
from reasoner.symbols import Problem


class HasPlan(Protocol):
    """What has a plan in it: a result, an execution, a report."""

    @property
    def plan(self) -> Plan:
        """The plan."""


AnyPlan: TypeAlias = "Plan | HasPlan | str | Path"
"""A plan, what has one in it, or the file that ``confab plan --json`` wrote."""
Facts: TypeAlias = "str | Iterable[str]"
"""One fact or several, each like ``cup2 LOCATION location8``."""


def plan_of(given: AnyPlan, problem: Problem) -> Plan:
    """Return the plan that is meant; one in a file is read for a problem.

    Raises
    ------
    KnowledgeError
        There is none in it.
    """
    if isinstance(given, Plan):
        return given
    if isinstance(given, str | Path):
        return read_plan(Path(given), problem)
    found = getattr(given, "plan", None)
    if not isinstance(found, Plan):
        raise KnowledgeError(
            f"wanted a plan, what has one in it (a result, an execution) or a file's name; got {type(given).__name__}"
        )
    return found


def several(given: Facts) -> list[str]:
    """Return texts that are given one or many.

    >>> several("cup2 LOCATION location8"), several(("a", "b"))
    (['cup2 LOCATION location8'], ['a', 'b'])
    """
    return [given] if isinstance(given, str) else list(given)
