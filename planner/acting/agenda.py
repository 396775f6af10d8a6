"""The agenda of an episode: the steps still to be executed, and postponed goals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from confab.planner.plan import Reason, Step, renumbered
from confab.reasoner.symbols import Problem, State, Symbol


@dataclass
class RemainingSteps:
    """The steps still to be executed, with the task for which they were planned; the first step may be partly executed.

    `begun` has the situation before each step in progress. `sound` states whether each step in progress would be applicable in that
    situation, updated with the facts observed since then.
    """

    planned_for: Problem
    steps: tuple[Step, ...] = ()
    begun: dict[tuple[int, ...], State] = field(default_factory=dict)
    sound: bool = True

    def numbered(self, steps: Sequence[Step], done: Mapping[tuple[int, ...], Step]) -> tuple[Step, ...]:
        """Return steps with their paths in the tree of executed steps; a step in progress keeps its path."""
        following = 1 + max((path[0] for path in done), default=-1)
        if steps and self.steps and self.steps[0].path[:1] in {path[:1] for path in done}:
            now, new = self.steps[0], steps[0]
            if [str(s) for s in now.walk()] == [str(s) for s in new.walk()]:
                return (now, *renumbered(steps[1:], following))
        return renumbered(steps, following)


@dataclass
class Postponed:
    """Postponed goals, each with its value and the reason for postponing it.

    The goals `aside` are impossible in the present situation. The goals `put_off` are unreachable without the facts in doubt.
    """

    aside: dict[Symbol, tuple[str, Reason]] = field(default_factory=dict)
    put_off: dict[Symbol, tuple[str, Reason]] = field(default_factory=dict)

    def reasons(self) -> Iterator[Reason]:
        """Yield the reasons for which goals were dropped or postponed."""
        yield from (reason for _, reason in (*self.aside.values(), *self.put_off.values()))

    def forget(self, symbols: Iterable[Symbol]) -> None:
        """Remove the goals of the given symbols from the dropped and the postponed goals."""
        for symbol in symbols:
            self.aside.pop(symbol, None)
            self.put_off.pop(symbol, None)

    def clear(self) -> None:
        """Remove all dropped and all postponed goals."""
        self.aside.clear()
        self.put_off.clear()
