"""A running execution on the page: the executed steps, timed by the world's clock, and the remaining steps of the plan."""

from __future__ import annotations

import threading
from dataclasses import replace
from functools import cached_property

from confab.known import Known
from confab.labels import Labels
from confab.page.data import page_labels, timeline_data
from confab.page.results import goals_of
from confab.page.schema import PageData, TimelineRow
from confab.page.timeline import Bar, Timeline, phases_of
from confab.planner.acting.episode import Event
from confab.planner.plan import Step, changed
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Symbol


class Following:
    """The events of a running execution. The number `version` grows with each event. The class is thread-safe."""

    def __init__(self, scene: Known) -> None:
        self.scene, self.version = scene, 0
        self.problem = scene.problem
        self.known: dict[Symbol, str] = dict(self.problem.initial)
        self._changes: list[tuple[float, Symbol, str]] = []
        self._bars: list[Bar] = []
        self._marks: list[tuple[float, str]] = []
        self._event: Event | None = None
        self._wanted = self.problem
        self._begun: tuple[Step, float] | None = None
        self._lock = threading.Lock()

    @cached_property
    def labels(self) -> Labels:
        """The labels of the problem's terms."""
        return page_labels(self.scene, self.problem)

    @property
    def begun(self) -> bool:
        """Whether an execution has begun."""
        return self._event is not None

    def take(self, event: Event) -> None:
        """Record an event."""
        with self._lock:
            self._event, self.version = event, self.version + 1
            if event.belief is not None:
                self._believe(event.belief, event.seconds)
            if event.what == "begin" and event.step is not None:
                self._begun = event.step, event.seconds
            elif event.what == "end" and event.step is not None:
                step, begin = self._begun or (event.step, event.seconds)
                done = event.step.path in event.done
                note = "; ".join(f"{s.symbol}: expected {s.expected}, seen {s.observed}" for s in event.surprises)
                self._bars.append(Bar(step, begin, event.seconds, done, note))
                self._begun = None
            elif event.what in ("intervention", "discovery", "late", "repair", "replan"):
                text = f"{event.what}: {event.text}" if event.what in ("repair", "replan") else event.text
                self._marks.append((event.seconds, text))

    def _believe(self, belief: Problem, now: float) -> None:
        """Record the changed values of symbols, and the goals."""
        self._changes += [(now, fact.symbol, fact.value) for fact in changed(self.known, belief.initial)]
        self.known, self._wanted = dict(belief.initial), belief

    def data(self) -> PageData:
        """Return the JSON object with the present content of the page."""
        with self._lock:
            event, now = self._event, self._event.seconds if self._event is not None else 0.0
            bars, marks = list(self._bars), tuple(self._marks)
            changes = list(self._changes)
            begun, version, wanted = self._begun, self.version, self._wanted
        assert event is not None
        begun_path = None if begun is None else begun[0].path
        left = [s for s in event.plan.primitives if s.path not in event.done]
        length = sum(bar.end - bar.begin for bar in bars) / len(bars) if bars else 1.0
        at = now
        for step in left if event.what != "over" else []:
            running = step.path == begun_path
            start = begun[1] if running and begun is not None else at
            at = max(now, start + length)
            bars.append(Bar(step, start, at, planned=not running))
        phases = phases_of(self.problem.initial, changes, now)
        final = {symbol: periods[-1].value for symbol, periods in phases.items()}
        unit = "steps" if all(bar.end - bar.begin == 1.0 for bar in bars) else "s"
        lived = replace(self.problem, goal=wanted.goal, classes=wanted.classes)
        timeline = Timeline(lived, event.plan, tuple(bars), phases, at, unit, final, marks)
        notes = {begun[0].path: "◀ being done"} if begun is not None else {}
        data = timeline_data(self.scene, timeline, self.labels, notes, reasons=False)
        done = sum(step.path in event.done for step in event.plan.primitives)
        over = event.what == "over"
        data |= {
            "live": True,
            "version": version,
            "now": now,
            "good": event.text == "reached" if over else None,
            "status": event.text if over else "acting",
            "headline": event.text,
            "tiles": [
                {"name": "primitives done", "text": f"{done} of {len(event.plan.primitives)}"},
                {"name": "interventions and changes of plan", "text": str(len(marks))},
            ],
            "rows": data["rows"] if over else [_still_open(row) for row in data["rows"]],
            "goals": goals_of(timeline, self.labels, planned=True),
            "again": "",
        }
        return data


def _still_open(row: TimelineRow) -> TimelineRow:
    """Return a row without the mark of an unmet goal, since the execution isn't finished."""
    return {key: value for key, value in row.items() if key != "met" or value}  # type: ignore[return-value]
