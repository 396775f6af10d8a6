"""A plan in time, as the planner returns it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from confab.planner.plan import Plan, Step

THESE_STEPS = "these steps"
"""A bound on schedules of the same steps: conflicting steps in the order of the plan, turns in any order and by any actor."""


@dataclass(frozen=True)
class Slot:
    """A primitive in time: its begin and end in seconds, its actors, and its slack."""

    step: Step
    begin: Fraction
    end: Fraction
    actors: tuple[str, ...] = ()
    slack: Fraction = Fraction(0)

    @property
    def critical(self) -> bool:
        """Whether any delay of it increases the makespan."""
        return not self.slack


@dataclass(frozen=True)
class TimedPlan:
    """A plan in time.

    Attributes
    ----------
    plan : Plan
        The tree of steps, each level in an order in which its steps could also be executed in sequence.
    slots : tuple of Slot
        Its primitives, in the order of the plan.
    bound : Fraction
        Lower bound of the makespan, in seconds.
    bounds : str
        The schedules that are bounded: `THESE_STEPS`.
    scheduler : str
        The name of the scheduler.
    arcs : tuple of (int, int)
        Pairs of primitives, by number, of which the second waits for the first.
    """

    plan: Plan
    slots: tuple[Slot, ...]
    bound: Fraction = Fraction(0)
    bounds: str = THESE_STEPS
    scheduler: str = "exchanges"
    arcs: tuple[tuple[int, int], ...] = ()

    @cached_property
    def makespan(self) -> Fraction:
        """The end of the last primitive, in seconds."""
        return max((slot.end for slot in self.slots), default=Fraction(0))

    @cached_property
    def serial(self) -> Fraction:
        """The duration of the primitives in sequence, in seconds."""
        return sum((slot.end - slot.begin for slot in self.slots), Fraction(0))

    @cached_property
    def intervals(self) -> Mapping[tuple[int, ...], tuple[Fraction, Fraction]]:
        """The begin and end of every step, by its path: a step with sub-steps lasts from the first of them to the last."""
        found = {slot.step.path: (slot.begin, slot.end) for slot in self.slots}
        for step in reversed(list(self.plan.walk())):
            if step.steps:
                inside = [found[one.path] for one in step.steps]
                found[step.path] = min(begin for begin, _ in inside), max(end for _, end in inside)
        return found

    def lanes(self) -> Iterator[tuple[str, list[Slot]]]:
        """Yield each actor with its primitives in the order of their begins; last, under an empty name, those without an actor."""
        names = sorted({actor for slot in self.slots for actor in slot.actors})
        for name in names:
            yield name, sorted((s for s in self.slots if name in s.actors), key=lambda s: (s.begin, s.end))
        if rest := [slot for slot in self.slots if not slot.actors]:
            yield "", sorted(rest, key=lambda s: (s.begin, s.end))
