"""A live view of an execution: plan, current step, unexpected observations, interventions and changes of the plan."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from confab.planner.acting.episode import Event

if TYPE_CHECKING:
    from rich.console import Group

Observer = Callable[[Event], None]
LOG = 6
"""Maximum number of recent events that the view shows."""
SIGNS = {
    "intervention": "✋ ", "discovery": "👁 ", "late": "⌛ ", "repair": "↻ repair: ", "replan": "↻ replan: ", "over": ""
}  # fmt: skip
"""The kinds of events in the log, each with the beginning of its line."""


@dataclass(repr=False)
class View:
    """A view that shows the plan as of the last event, and a log of recent events."""

    event: Event | None = None
    log: list[str] = field(default_factory=list)

    def take(self, event: Event) -> None:
        """Record an event."""
        self.event = event
        if event.what in SIGNS:
            self.log.append(SIGNS[event.what] + event.text)
        for surprise in event.surprises:
            self.log.append(f"≠ {surprise.symbol}: expected {surprise.expected}, observed {surprise.observed}")

    def notes(self) -> dict[tuple[int, ...], str]:
        """Return marks for finished steps and for the primitive in progress; the keys are the paths of the steps."""
        if self.event is None:
            return {}
        notes = {step.path: "✓" for step in self.event.plan.walk() if _is_done(step, self.event)}
        if self.event.what == "begin" and self.event.step is not None:
            notes[self.event.step.path] = "◀ " + "; ".join(map(str, self.event.expected))
        return notes

    def __repr__(self) -> str:
        """Return the state of the execution in one line."""
        return "; ".join((self.headline(), *self.log[-1:]))

    def headline(self) -> str:
        """Return the number of finished primitives and the current step in one line."""
        if self.event is None:
            return "planning"
        primitives = self.event.plan.primitives
        done = sum(step.path in self.event.done for step in primitives)
        return f"{done} of {len(primitives)} primitives" + (f": {self.event.step}" if self.event.step else "")

    def __rich__(self) -> Group:
        """Return the current step with its sub-steps, the later steps, and the recent events."""
        from rich.console import Group
        from rich.text import Text

        from confab.planner.plan import Plan
        from confab.show import plan_tree

        parts: list[Any] = [Text(line) for line in self.log[-LOG:]]
        if self.event is not None:
            now = next((s for s in self.event.plan.steps if not _is_done(s, self.event)), None)
            later = [s for s in self.event.plan.steps if now is not None and s.path > now.path]
            parts.insert(0, plan_tree(Plan((now,) if now else ()), self.headline(), self.notes()))
            parts.insert(1, Text("then " + ", ".join(map(str, later)) if later else "then nothing more", style="dim"))
        return Group(*parts)

    def _repr_html_(self) -> str:
        from confab.page.markup import styled, tag
        from confab.page.pieces import tree

        expected = self.event.expected if self.event is not None else ()
        shall = [" → ", tag("i", "; ".join(map(str, expected)))] if expected else None
        happened = tag("ul", [tag("li", line) for line in self.log[-LOG:]])
        plan = tree(self.event.plan, None, self.notes()) if self.event is not None else None
        return styled(tag("p", self.headline(), shall), happened, plan)


@contextmanager
def spectator(watch: bool = True, other: Observer | None = None) -> Iterator[Observer | None]:
    """Yield an observer that shows an execution in a notebook, or on stderr if stderr is a terminal.

    The observer passes each event to the observer `other`, too. Without `watch`, or if the execution can't be shown, the context
    manager yields `other` itself.
    """
    if watch and _in_notebook():
        with in_notebook() as observer:
            yield both(other, observer)
    elif watch and sys.stderr.isatty():
        with in_terminal() as observer:
            yield both(other, observer)
    else:
        yield other


def both(one: Observer | None, other: Observer) -> Observer:
    """Return an observer that passes each event to two other observers."""

    def observer(event: Event) -> None:
        if one is not None:
            one(event)
        other(event)

    return observer


@contextmanager
def in_terminal(console: Any = None) -> Iterator[Observer]:
    """Yield an observer that shows an execution on a rich console, by default stderr."""
    from rich.console import Console
    from rich.live import Live

    view = View()
    with Live(view, console=console or Console(stderr=True), refresh_per_second=8, transient=True) as live:

        def observer(event: Event) -> None:
            view.take(event)
            live.update(view, refresh=event.what != "end")

        yield observer


@contextmanager
def in_notebook() -> Iterator[Observer]:
    """Yield an observer that shows an execution in the output of a notebook's cell."""
    from IPython.display import display

    view = View()
    handle = display(view, display_id=True)  # type: ignore[no-untyped-call]

    def observer(event: Event) -> None:
        view.take(event)
        handle.update(view)

    yield observer


def _is_done(step: Any, event: Event) -> bool:
    return all(below.path in event.done for below in step.walk() if not below.steps)


def _in_notebook() -> bool:
    """Return whether the process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    running = shell.get_ipython() if shell is not None else None
    return running is not None and hasattr(running, "kernel")
