"""Output of plans in a terminal, a pipe or a file."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from confab.planner.plan import Left, Outcome, Plan, Step

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions
    from rich.segment import Segment
    from rich.tree import Tree

STYLES = ("bold cyan", "green", "default")
Notes = Mapping[tuple[int, ...], str]
"""Remarks on steps, such as verdicts, by the step's path."""

FORCING = {"FORCE_COLOR", "TTY_COMPATIBLE"}
"""Environment variables that let rich treat any output as a terminal."""
CONTROL = dict.fromkeys((7, 8, 11, 12, 13))
"""Control characters that a terminal would execute, for `str.translate`."""
UNLIMITED = 100_000
"""Width in columns of an output that isn't a terminal; the width is so large that no line is wrapped or cut."""


def page() -> Console:
    """Return a rich console for stdout with the width of the terminal, or `UNLIMITED` columns in a pipe or a file."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else UNLIMITED)


def show(what: Any) -> None:
    """Print an object that the library rich can show, to stdout; lines are wrapped only in a terminal."""
    shown = what.__rich__() if hasattr(type(what), "__rich__") else what
    if isinstance(shown, PlanTree) and not sys.stdout.isatty() and FORCING.isdisjoint(os.environ):
        sys.stdout.writelines(shown.lines())
        return
    console = page()
    with console.capture() as text:  # rich would end the process with exit code 1 if the reader of a pipe has ended
        console.print(shown, markup=False, highlight=False)
    sys.stdout.write(text.get())


@dataclass(frozen=True)
class PlanTree:
    """A plan as a tree that rich prints, with the ID, the behaviour and the arguments of every step."""

    plan: Plan
    title: str
    notes: Notes

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Tree | Segment]:
        """Yield a rich tree for a terminal. Yield plain text for other outputs, since rich is slow for large plans."""
        if console.is_terminal:
            from rich.text import Text
            from rich.tree import Tree

            tree = Tree(Text(self.title), guide_style="dim")
            for step in self.plan.steps:
                _grow(tree, step, self.notes)
            yield tree
        else:
            from rich.segment import Segment

            # Each line becomes a separate segment, since rich splits a segment of many lines in quadratic time.
            yield from map(Segment, self.lines())

    def lines(self) -> Iterator[str]:
        """Yield the lines of plain text, without control characters."""
        for line in (self.title, *_drawn(self.plan.steps, self.notes, "")):
            yield f"{line.translate(CONTROL)}\n"


def plan_tree(plan: Plan, title: str, notes: Notes | None = None) -> PlanTree:
    """Return a plan as a tree that rich prints, with a title and remarks on steps."""
    return PlanTree(plan, title, notes or {})


def _grow(tree: Tree, step: Step, notes: Notes) -> None:
    from rich.text import Text

    lines = [Text.assemble(*label) for label in (_label(step, notes), *map(_label_of_joined, step.joined))]
    branch = tree.add(Text("\n+ ").join(lines))
    for below in step.steps:
        _grow(branch, below, notes)


def _drawn(steps: Sequence[Step], notes: Notes, indent: str) -> Iterator[str]:
    for count, step in enumerate(steps, 1):
        last = count == len(steps)
        below = indent + ("    " if last else "│   ")
        yield f"{indent}{'└' if last else '├'}── {''.join(text for text, _ in _label(step, notes))}"
        for one in step.joined:
            yield f"{below[:-2]}+ {''.join(text for text, _ in _label_of_joined(one))}"
        yield from _drawn(step.steps, notes, below)


def _label(step: Step, notes: Notes) -> list[tuple[str, str]]:
    """Return the line for one step as pieces of text, each with a style of rich."""
    style = STYLES[min(len(step.path), len(STYLES)) - 1]
    label = [(f"{step.id:>2} ", "dim"), (step.behavior, style), (" " + " ".join(step.arguments), "")]
    if not step.steps:
        label.append((bindings_of(step), "dim italic"))
    if step.path in notes:
        label.append(("  " + notes[step.path], "bold red" if "✗" in notes[step.path] else "green"))
    return label


def bindings_of(step: Step) -> str:
    """Return the values of a step's variables as text, with two spaces before it; the text is empty without variables."""
    return "  " * bool(step.bindings) + ", ".join(f"{name}: {value}" for name, value in step.bindings.items())


def _label_of_joined(step: Step) -> list[tuple[str, str]]:
    """Return the line for a step that is refined together with the step of the previous line."""
    return _label(replace(step, bindings={}), {})


def lengths(plan: Plan) -> str:
    """Return the numbers of steps on all levels as text, such as ``4 / 10 / 32``."""
    return " / ".join(map(str, plan.length.values())) or "no"


def _proved(outcome: Outcome) -> str:
    """Return a text with the cost of a plan (if behaviours have costs) and the proved bound on its length, cost or total cost."""
    cost, bound, penalty = outcome.cost, outcome.bound, outcome.penalty
    said = "" if cost is None else f", costs {cost:g}"
    if bound is None:
        return said
    if penalty is not None and outcome.plan is not None:
        said = said or f", counts {len(outcome.plan.primitives)} for its primitives"
        said += f" and {float(penalty):g} for unmet soft goals" if penalty else " with all soft goals met"
        if outcome.proved:
            return f"{said}, proved cheapest in total on the lowest level"
        least = f": any plan costs at least {bound:g}, unmet soft goals included" if bound > 0 else ""
        return f"{said}; not proved cheapest in total{least}"
    best = "shortest" if cost is None else "cheapest"
    if outcome.proved:
        return f"{said}, proved {best} on the lowest level"
    least = f"has at least {bound:g} primitives" if cost is None else f"costs at least {bound:g}"
    return f"{said}; not proved {best}" + (f": any plan for these goals {least}" if bound > 0 else "")


def summary(outcome: Outcome) -> str:
    """Return a summary of an outcome: a line on the result, and a line for each unmet soft goal and each violated condition."""
    expanded = sum(counts.expanded for counts in outcome.search.values())
    if outcome.plan is None:
        reason = outcome.reason.text if outcome.reason else "no reason given"
        return f"{outcome.status.value}: {reason} ({expanded} expansion{'s' * (expanded != 1)}, {outcome.seconds * 1000:.0f} ms)"
    unmet = [f"leaves a soft goal unmet: {one}" for one in outcome.forgone]
    if not outcome.plan.steps:
        goals = "all goals that must be met" if unmet else "all goals"
        done = f"solved: nothing to do, since {goals} hold ({outcome.seconds * 1000:.0f} ms)"
        return "\n".join([done, *unmet])
    bound = _proved(outcome)
    counts = outcome.plan.length
    on = (
        " per level"
        if not counts or min(counts) == 1
        else f" on level{'s' * (len(counts) > 1)} {' / '.join(map(str, counts))}"
    )
    effort = f", {expanded} expansion{'s' * (expanded != 1)} in all" if outcome.search else ""
    if outcome.hits or outcome.misses:
        effort += f", refinements {outcome.hits} from the cache and {outcome.misses} searched"
    if outcome.seconds:  # a plan from a file wasn't searched
        effort += f", {outcome.seconds * 1000:.0f} ms of planning"
    by = f" by {outcome.engine}" if outcome.engine else ""
    lines = [f"solved{by}: {lengths(outcome.plan)} steps{on}{effort}{bound}"]
    lines += unmet
    lines += remarks_on_levels(outcome)
    return "\n".join(lines)


def remarks_on_levels(outcome: Outcome) -> list[str]:
    """Return the reasons why levels were given up, or else the steps that replace steps of a level, and the violated conditions."""
    replaced = [f"{_steps(one)} of level {one.level}" for one in outcome.left]
    broken = [
        f"the plan violates a condition of the level above: {one.text}" for left in outcome.left for one in left.broken
    ]
    return [*(outcome.given_up or replaced), *broken]


def _steps(left: Left) -> str:
    """Return the text that lower-level steps replace steps; positions are those that ``confab explain`` takes."""
    first, last = (".".join(map(str, path)) for path in (left.first, left.last))
    return f"step {first} replaces steps" if first == last else f"steps {first} to {last} replace steps"
