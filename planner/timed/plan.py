"""A plan in time, as it leaves the planner."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from confab.planner.plan import Plan, Step

THESE_STEPS = "these steps"
"""A bound of schedules of the same steps: conflicting ones in the order of the plan, turns in any order, by any of the actors."""


@dataclass(frozen=True)
class Slot:
    """A primitive in time: its begin and end in seconds, its actors, and by how much it could be later."""

    step: Step
    begin: Fraction
    end: Fraction
    actors: tuple[str, ...] = ()
    slack: Fraction = Fraction(0)

    @property
    def critical(self) -> bool:
        """Whether the makespan grows with any delay of it."""
        return not self.slack


@dataclass(frozen=True)
class TimedPlan:
    """A plan in time.

    Attributes
    ----------
    plan : Plan
        The tree of steps, each level in an order in which it could be done one step after the other.
    slots : tuple of Slot
        Its primitives, in the order of the plan.
    bound : Fraction
        Lower bound of the makespan, in seconds.
    bounds : str
        What is bounded: `THESE_STEPS`.
    scheduler : str
        What made the schedule.
    arcs : tuple of (int, int)
        Which primitive waits for which, by their numbers: the edges that the schedule keeps.
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
        """What the primitives take one after the other, in seconds."""
        return sum((slot.end - slot.begin for slot in self.slots), Fraction(0))

    @cached_property
    def intervals(self) -> Mapping[tuple[int, ...], tuple[Fraction, Fraction]]:
        """The begin and end of every step, by its path: of a step with sub-steps, from the first of them to the last."""
        found = {slot.step.path: (slot.begin, slot.end) for slot in self.slots}
        for step in reversed(list(self.plan.walk())):
            if step.steps:
                inside = [found[one.path] for one in step.steps]
                found[step.path] = min(begin for begin, _ in inside), max(end for _, end in inside)
        return found

    def lanes(self) -> Iterator[tuple[str, list[Slot]]]:
        """Yield each actor with its primitives in the order of their begins; last, under no name, those of no actor."""
        names = sorted({actor for slot in self.slots for actor in slot.actors})
        for name in names:
            yield name, sorted((s for s in self.slots if name in s.actors), key=lambda s: (s.begin, s.end))
        if rest := [slot for slot in self.slots if not slot.actors]:
            yield "", sorted(rest, key=lambda s: (s.begin, s.end))
