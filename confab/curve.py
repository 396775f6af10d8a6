"""Learning curves: the number of states that planning expands in each episode while a memory grows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from confab.planner.plan import Status
from confab.planner.solve import Mode
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import LimitError
from confab.reasoner.names import local_name, right_arguments

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from confab.memory import Memory
    from confab.scene import Scene

KINDS = (".png", ".svg", ".pdf")
MODES: dict[Mode, str] = {"guarded": "by default", "paper": "the paper's mode"}
SECONDS = 20.0
"""Time limit of a planning call in seconds. The picture lacks the data points of planning calls that exceed the limit."""
MANY = 12
"""Maximum number of episodes for which the picture shows names and counts."""


@right_arguments
def practise(scenes: Scene | Sequence[Scene], memory: Memory, rounds: int = 1, curve: Curve | None = None) -> Curve:
    """Plan in all scenes and learn from the plans, `rounds` times; return the learning curve.

    Examples
    --------
    >>> import confab
    >>> scene = confab.load("beverage-serving")
    >>> curve = practise(scene, confab.Memory.of(scene), rounds=2)
    >>> curve.with_memory["paper"]
    [171, 62]
    """
    curve = Curve() if curve is None else curve
    for scene in [scenes] * rounds if not isinstance(scenes, Sequence) else list(scenes) * rounds:
        curve.measure(local_name(scene.iri), scene, memory)
        result = scene.plan()
        if result.solved:
            memory.teach(scene, result)
    return curve


@dataclass
class Curve:
    """A learning curve: numbers of expanded states by mode and episode.

    For each episode, `with_memory` has the number of states that planning expands with the memory of the earlier episodes, and
    `without` has the number without memory. A value is None if planning found no plan.
    """

    scenes: list[str] = field(default_factory=list)
    with_memory: dict[Mode, list[int | None]] = field(default_factory=lambda: {mode: [] for mode in MODES})
    without: dict[Mode, list[int | None]] = field(default_factory=lambda: {mode: [] for mode in MODES})

    def measure(self, name: str, scene: Scene, memory: Memory) -> None:
        """Add an episode: plan in a scene with the memory and without memory, and count the expansions."""
        seen = self.scenes.index(name) if name in self.scenes else None
        self.scenes.append(name)
        for mode in MODES:
            alone = _expansions(scene, None, mode) if seen is None else self.without[mode][seen]
            hopeless = seen is not None and alone is None and self.with_memory[mode][seen] is None
            self.with_memory[mode].append(None if hopeless else _expansions(scene, memory, mode))
            self.without[mode].append(alone)

    def save(self, path: Path) -> Path:
        """Draw the curves into a file, and return the file's path."""
        from confab.picturing import save, words_as_they_are

        require_drawable(path)
        with words_as_they_are():
            return save(self._figure(), path, dpi=120)

    def _repr_png_(self) -> bytes:
        """Return the picture of the curves for a notebook."""
        from io import BytesIO

        from confab.picturing import words_as_they_are

        drawn = BytesIO()
        with words_as_they_are():
            self._figure().savefig(drawn, dpi=80, format="png")
        return drawn.getvalue()

    def _figure(self) -> Figure:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 4.6), layout="constrained")
        axes = figure.subplots()
        episodes = range(1, len(self.scenes) + 1)
        few = len(self.scenes) <= MANY
        for mode, color, marker in zip(MODES, ("#0072b2", "#d55e00"), ("o", "s"), strict=True):
            for values, style, what in ((self.without, ":", "without memory"), (self.with_memory, "-", "with memory")):
                shown = [float("nan") if value is None else value for value in values[mode]]
                if any(value is not None for value in values[mode]):
                    face = color if values is self.with_memory else "white"
                    label = f"{MODES[mode]}, {what}"
                    axes.plot(episodes, shown, style, color=color, marker=marker, ms=5, mfc=face, label=label)
                beside = (7, 3) if values is self.with_memory else (0, 5)
                for episode, value in zip(episodes, values[mode], strict=True):
                    if few and value is not None:
                        axes.annotate(f"{value:,}", (episode, value), beside, textcoords="offset points",
                                      ha="left" if beside[0] else "center", fontsize=7, color=color)  # fmt: skip
        axes.margins(x=0.08, y=0.12)
        axes.set_ylim(bottom=0)
        several = len(set(self.scenes)) > 1
        under = [name.replace("-", "\n") if several else "" for name in self.scenes]
        names = [f"{number}\n{name}".strip() for number, name in zip(episodes, under, strict=True)]
        axes.set_xticks(list(episodes) if few else [], names if few else [], fontsize=8)
        axes.set_xlabel("episode, planned with the memory of all earlier ones")
        axes.set_ylabel("expansions")
        axes.set_title("Expansions of planning as memory grows", fontsize=11)
        figure.legend(fontsize=8, ncols=2, loc="outside lower center")
        axes.grid(alpha=0.3)
        return figure


def require_drawable(path: Path) -> None:
    """Raise `KnowledgeError` if the path's suffix isn't a supported picture format."""
    if path.suffix.lower() not in KINDS:
        raise KnowledgeError(f"{path}: can't draw into '{path.suffix}'; wanted {', '.join(KINDS)}")


def _expansions(scene: Scene, memory: Memory | None, mode: Mode) -> int | None:
    """Return the number of expansions of a planning call, or None if the call finds no plan within `SECONDS`."""
    try:
        outcome = scene.plan(memory=memory, mode=mode, time_limit=SECONDS, engine="none").outcome
    except (KnowledgeError, LimitError):
        return None
    if outcome.status is not Status.SOLVED:
        return None
    return sum(counts.expanded for counts in outcome.search.values())
