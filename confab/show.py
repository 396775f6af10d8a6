"""How plans look to people in a terminal; what notebooks and pages show is `confab.report`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from planner.plan import Outcome, Plan, Step

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text
    from rich.tree import Tree

STYLES = ("bold cyan", "green", "default")
Notes = Mapping[tuple[int, ...], str]
"""What to say behind a step, by its path: a verdict, for instance."""

UNLIMITED = 100_000
"""Columns of a page that is no terminal: no line is broken or cut there."""


def page() -> Console:
    """Return stdout as rich writes to it: as wide as the terminal, without limit in a pipe or a file."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else UNLIMITED)


def show(what: Any) -> None:
    """Print what rich can show to stdout, whole: lines wrap in a terminal, and are left as long as they are elsewhere."""
    page().print(what, markup=False, highlight=False)


def plan_tree(plan: Plan, title: str, notes: Notes | None = None) -> Tree:
    """Return the plan as a rich tree: ID, behaviour and arguments of every step."""
    from rich.text import Text
    from rich.tree import Tree

    tree = Tree(Text(title), guide_style="dim")
    for step in plan.steps:
        _grow(tree, step, notes or {})
    return tree


def _grow(tree: Tree, step: Step, notes: Notes) -> None:
    branch = tree.add(_label(step, notes))
    for below in step.steps:
        _grow(branch, below, notes)


def _label(step: Step, notes: Notes) -> Text:
    from rich.text import Text

    style = STYLES[min(len(step.path), len(STYLES)) - 1]
    label = Text.assemble((f"{step.id:>2} ", "dim"), (step.behavior, style), " ", " ".join(step.arguments))
    if step.bindings and not step.steps:
        label.append("  " + ", ".join(f"{name}: {value}" for name, value in step.bindings.items()), "dim italic")
    if step.path in notes:
        label.append("  " + notes[step.path], "bold red" if "✗" in notes[step.path] else "green")
    return label


def lengths(plan: Plan) -> str:
    """Return how many steps a plan has on each level, e.g. ``4 / 10 / 32``."""
    return " / ".join(map(str, plan.length.values())) or "no"


def summary(outcome: Outcome) -> str:
    """Return how a planning call ended: one line, and one more for each level given up and each rule broken by that."""
    expanded = sum(counts.expanded for counts in outcome.search.values())
    if outcome.plan is None:
        reason = outcome.reason.text if outcome.reason else "no reason given"
        return f"{outcome.status.value}: {reason} ({expanded} expansions, {outcome.seconds * 1000:.0f} ms)"
    bound = "" if outcome.cost is None else f", costs {outcome.cost:g}"
    bound += "" if outcome.bound is None else f", at least {outcome.bound:g} proved for the lowest level"
    counts = outcome.plan.length
    on = " per level" if not counts or min(counts) == 1 else f" on levels {' / '.join(map(str, counts))}"
    effort = f"{expanded} expansions in all"
    if outcome.hits or outcome.misses:
        effort += f", refinements {outcome.hits} from the cache and {outcome.misses} searched"
    breaks = [broken.text for left in outcome.left for broken in left.broken]
    by = f" by {outcome.engine}" if outcome.engine else ""
    lines = [
        f"solved{by}: {lengths(outcome.plan)} steps{on}, {effort}, {outcome.seconds * 1000:.0f} ms of search{bound}"
    ]
    lines += outcome.given_up
    lines += [f"the plan breaks what only a level above asks: {text}" for text in breaks]
    return "\n".join(lines)
