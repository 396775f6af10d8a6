"""Trees of partly executed steps: the next primitives, the remaining steps, and the executed steps."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace

from confab.planner.plan import Step


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
