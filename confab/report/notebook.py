"""What a notebook shows: the pieces of the report, by value. The planner's own values are shown so as well (`register`)."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from confab.report import pieces
from confab.report.markup import styled, tag
from confab.show import summary
from planner.plan import Outcome, Plan, Step


def _of_outcome(outcome: Outcome) -> str:
    plan = pieces.tree(outcome.plan) if outcome.plan is not None else None
    return styled(tag("p", summary(outcome)), plan)


def _of_plan(plan: Plan) -> str:
    return styled(pieces.tree(plan))


def _of_step(step: Step) -> str:
    return styled(pieces.tree(Plan((step,))))


SHOWN: dict[tuple[str, str], Callable[[Any], str]] = {
    ("planner.plan", "Outcome"): _of_outcome,
    ("planner.plan", "Plan"): _of_plan,
    ("planner.plan", "Step"): _of_step,
    ("sim.verdict", "Verdict"): pieces.verdict,
}
"""What the rooms that know no HTML have: shown in a notebook all the same."""


def register() -> None:
    """Let a notebook that runs show the values of `SHOWN`; elsewhere nothing happens."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None:
        return
    formatter = shell.display_formatter.formatters["text/html"]
    for (module, name), shown in SHOWN.items():
        formatter.for_type_by_name(module, name, shown)
