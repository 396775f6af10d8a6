"""HTML representations in notebooks (`register`), for values whose own modules contain no HTML."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from confab.page import pieces
from confab.page.markup import styled, tag
from confab.planner.plan import Outcome, Plan
from confab.show import summary


def _of_outcome(outcome: Outcome) -> str:
    plan = pieces.tree(outcome.plan) if outcome.plan is not None else None
    return styled(tag("p", summary(outcome)), plan)


SHOWN: dict[tuple[str, str], Callable[[Any], str]] = {
    ("confab.planner.plan", "Outcome"): _of_outcome,
    ("confab.planner.plan", "Plan"): lambda plan: styled(pieces.tree(plan)),
    ("confab.planner.plan", "Step"): lambda step: styled(pieces.tree(Plan((step,)))),
    ("confab.sim.verdict", "Verdict"): pieces.verdict,
}
"""The function that returns the HTML of a value, by the module and the name of the value's class."""


def register() -> None:
    """Register the representations in `SHOWN` if the process runs a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None:
        return
    formatter = shell.display_formatter.formatters["text/html"]
    for (module, name), shown in SHOWN.items():
        formatter.for_type_by_name(module, name, shown)
