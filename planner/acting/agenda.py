"""The agenda of an episode: the steps still to be executed, and postponed goals; trees of partly executed steps."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from confab.planner.plan import Reason, Step, renumbered
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State, Symbol


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
    """Goals, each with value and reason: `aside` are now impossible, `put_off` are unreachable without the facts in doubt."""

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


def chains_of(steps: Sequence[Step]) -> Iterator[tuple[Step, ...]]:
    """Yield each primitive below the steps, preceded by all its ancestors."""
    for step in steps:
        yield from ((step, *below) for below in chains_of(step.steps)) if step.steps else ((step,),)


def without(steps: Sequence[Step], paths: Container[tuple[int, ...]]) -> tuple[Step, ...]:
    """Return the steps without the primitives at some paths, and without parents that have no other primitive."""
    left = (replace(step, steps=without(step.steps, paths)) if step.steps else step for step in steps)
    return tuple(
        one for step, one in zip(steps, left, strict=True) if one.steps or not (step.steps or step.path in paths)
    )


def tree_of(steps: Mapping[tuple[int, ...], Step]) -> tuple[Step, ...]:
    """Return the trees of steps that are given as a mapping from paths to steps."""
    below: dict[tuple[int, ...], list[Step]] = {}
    for path in sorted(steps, key=lambda p: (-len(p), p)):
        below.setdefault(path[:-1], []).append(replace(steps[path], steps=tuple(below.get(path, ()))))
    return tuple(below.get((), ()))
