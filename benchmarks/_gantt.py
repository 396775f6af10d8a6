"""A schedule as a Gantt chart, with a row for each hand and a bar for each primitive."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from confab.planner.acting.schedule import WorkerSlot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from confab.labels import Labels

TALL, LINES = 21, 2.8
"""Maximum number of characters per line of a bar's text, and maximum number of lines per second of the bar's duration."""


def save_gantt(
    slots: Sequence[WorkerSlot], path: str | Path, serial: float | None = None, labels: Labels | None = None
) -> Path:
    """Draw a schedule as a Gantt chart into a picture file, and return the path.

    If `serial` is given, the chart also shows this serial duration.
    """
    from confab.picturing import save, words_as_they_are

    with words_as_they_are():
        return save(_gantt(slots, serial, labels), Path(path), dpi=110)


def _gantt(slots: Sequence[WorkerSlot], serial: float | None, labels: Labels | None) -> Figure:
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    workers = sorted({slot.worker for slot in slots})
    behaviors = list(dict.fromkeys(slot.step.behavior for slot in slots))
    colors = colormaps["Pastel1"]
    figure = Figure(figsize=(15, 1.3 + 1.35 * len(workers)), layout="constrained")
    axes = figure.subplots()
    for slot in slots:
        row, width = workers.index(slot.worker), slot.end - slot.begin
        color = colors(behaviors.index(slot.step.behavior) % 9)
        axes.barh(row, width, left=slot.begin, height=0.8, color=color, edgecolor="#444444", linewidth=0.6)
        words = labels.step(slot.step) if labels else " ".join((slot.step.behavior, *slot.step.arguments))
        lines = fill(f"{slot.step.id} {words}", TALL).splitlines()[: max(1, round(width * LINES))]
        middle = slot.begin + width / 2
        axes.text(middle, row, "\n".join(lines), ha="center", va="center", fontsize=7, rotation=90)
    end = max(slot.end for slot in slots)
    axes.set_yticks(range(len(workers)), [labels.name(worker) if labels else worker for worker in workers])
    axes.invert_yaxis()
    axes.set_xlabel("simulated seconds; numbers are the IDs of the primitives")
    title = f"both hands: {end:.1f} s"
    if serial is not None:
        axes.axvline(serial, color="#cc3333", linestyle="--")
        title += f"; one primitive after the other: {serial:.1f} s (dashed); ratio {end / serial:.2f}"
    axes.set_title(title, fontsize=10)
    handles = [Patch(color=colors(i % 9)) for i in range(len(behaviors))]
    axes.legend(
        handles,
        [labels.words.get(name, name) if labels else name for name in behaviors],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.2),
        ncol=len(behaviors),
        fontsize=7,
        frameon=False,
    )
    return figure
