"""A schedule as a picture: a strip per hand, a bar per primitive."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from planner.acting.schedule import Slot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_gantt(slots: Sequence[Slot], path: str | Path, serial: float | None = None) -> Path:
    """Draw a schedule, and the time that one hand after the other would take, into a picture file; return where."""
    from confab.picturing import save, words_as_they_are

    with words_as_they_are():
        return save(_gantt(slots, serial), Path(path), dpi=110)


def _gantt(slots: Sequence[Slot], serial: float | None) -> Figure:
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    workers = sorted({slot.worker for slot in slots})
    behaviors = list(dict.fromkeys(slot.step.behavior for slot in slots))
    colors = colormaps["Pastel1"]
    figure = Figure(figsize=(15, 1.3 + 0.85 * len(workers)), layout="constrained")
    axes = figure.subplots()
    for slot in slots:
        row, width = workers.index(slot.worker), slot.end - slot.begin
        color = colors(behaviors.index(slot.step.behavior) % 9)
        axes.barh(row, width, left=slot.begin, height=0.8, color=color, edgecolor="#444444", linewidth=0.6)
        rest = [argument for argument in slot.step.arguments if argument != slot.worker]
        text = "\n".join((str(slot.step.id), *rest)) if width > 1.0 else str(slot.step.id)
        axes.text(slot.begin + width / 2, row, text, ha="center", va="center", fontsize=7.5)
    end = max(slot.end for slot in slots)
    axes.set_yticks(range(len(workers)), workers)
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
        behaviors,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.38),
        ncol=len(behaviors),
        fontsize=7,
        frameon=False,
    )
    return figure
