"""The rows of the page's timeline: steps by level and by actor, and the values of each symbol in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from confab.page.markup import plain
from confab.page.schema import Interval, TimelineRow
from confab.page.timeline import Bar, Timeline
from confab.reasoner.symbols import FALSE, Symbol

if TYPE_CHECKING:
    from confab.labels import Labels

MOST_FIXED = 5000
"""Maximum number of rows for symbols that neither change nor have a goal. If more symbols are constant and without a goal, the
page states only their number.
"""
LAST = 0.04
"""Extension of the time axis after the last primitive, as a share of the plan's duration. The extended axis shows the effects of
the last primitive.
"""


def axis_end(timeline: Timeline) -> float:
    """Return the end of the time axis. If the last primitive has an effect, the axis extends beyond the end of the primitive."""
    late = any(period.begin >= timeline.end for periods in timeline.phases.values() for period in periods[1:])
    return round((timeline.end or 1.0) * (1 + LAST if late else 1), 4)


def rows_of(timeline: Timeline, labels: Labels) -> tuple[list[TimelineRow], int]:
    """Return the rows of the timeline, and the number of symbols that have no row."""
    by_path = timeline.by_path
    rows: list[TimelineRow] = []
    for level in sorted({step.level for step in timeline.plan.walk() if step.steps}):
        on = [s for s in timeline.plan.walk() if s.level == level and s.steps and s.path in by_path]
        rows += _lanes("levels", f"level {level}", [by_path[step.path] for step in on], labels)
    for actor, those in timeline.lanes().items():
        label = labels.name(actor) if actor else "primitives"
        rows += _lanes("actors", label, those, labels)
    end, fixed = axis_end(timeline), 0
    for symbol, periods in sorted(timeline.phases.items()):
        group = "changes" if len(periods) > 1 else "wanted" if symbol in timeline.problem.goal else "fixed"
        fixed += group == "fixed"
        if group == "fixed" and fixed > MOST_FIXED:
            continue
        bars: list[Interval] = [
            {
                "begin": round(period.begin, 3),
                "end": round(end if period.end >= timeline.end and i == len(periods) - 1 else period.end, 3),
                "label": labels.name(period.value),
                "tone": tone_of(timeline, symbol, period.value),
            }
            for i, period in enumerate(periods)
            if i == len(periods) - 1 or period.end > period.begin
        ]
        row: TimelineRow = {"group": group, "label": labels.about(symbol), "bars": bars}
        if (met := timeline.met(symbol)) is not None:
            row["met"] = met
        rows.append(row)
    return rows, max(0, fixed - MOST_FIXED)


def _lanes(group: str, label: str, bars: Sequence[Bar], labels: Labels) -> list[TimelineRow]:
    """Distribute bars over rows in which no two bars overlap; the number of rows is minimal."""
    rows: list[list[Bar]] = []
    for bar in sorted(bars, key=lambda bar: (bar.begin, bar.end)):
        free = next((row for row in rows if row[-1].end <= bar.begin + 1e-6), None)
        if free is None:
            rows.append([bar])
        else:
            free.append(bar)
    return [
        {
            "group": group,
            "label": f"{label}, meanwhile" if number else label,
            "bars": [_interval(bar, labels) for bar in row],
        }
        for number, row in enumerate(rows)
    ]


def _interval(bar: Bar, labels: Labels) -> Interval:
    tone = "failed" if bar.ok is False else "planned" if bar.planned else "action"
    interval: Interval = {
        "begin": round(bar.begin, 3),
        "end": round(bar.end, 3),
        "label": labels.step(bar.step),
        "tone": tone,
        "step": id_of(bar.step.path),
    }
    if bar.ok is False and bar.note:
        interval["note"] = labels.sentence(plain(bar.note))
    if bar.slack:
        interval["slack"] = round(bar.slack, 3)
    return interval


def tone_of(timeline: Timeline, symbol: Symbol, value: str) -> str:
    """Return the meaning of a value's colour: ``wanted`` (goal value), ``start`` (initial value) or ``between``."""
    if timeline.problem.goal.get(symbol) == value:
        return "wanted"
    return "start" if timeline.problem.initial.get(symbol, FALSE) == value else "between"


def id_of(path: Sequence[int]) -> str:
    """Return the ID of a step from its path."""
    return ".".join(map(str, path))
