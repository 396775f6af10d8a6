"""Timed plans: plans with a begin and an end for each primitive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from confab.planner.plan import Outcome, Plan, Step
from confab.reasoner.names import brief, known_as

THESE_STEPS = "these steps"
"""The name of the lower bound that holds for all schedules of the same steps.

The schedules keep the order of conflicting steps. Turns may have any order and any interchangeable actor.
"""


@dataclass(frozen=True)
class Slot:
    """A primitive of a timed plan, with its begin, end and slack in seconds, and its actors."""

    step: Step
    begin: Fraction
    end: Fraction
    actors: tuple[str, ...] = ()
    slack: Fraction = Fraction(0)

    @property
    def critical(self) -> bool:
        """Whether any delay of the primitive increases the makespan."""
        return not self.slack


@known_as("a schedule")
@brief
@dataclass(frozen=True)
class TimedPlan:
    """A plan with a schedule of its primitives.

    Attributes
    ----------
    plan : Plan
        The tree of steps; the steps of each level could also be executed one after another in this order.
    slots : tuple of Slot
        The primitives in the order of the plan.
    bound : Fraction
        Lower bound on the makespan, in seconds.
    bounds : str
        The schedules to which the bound applies: `THESE_STEPS`.
    least : Fraction
        Lower bound on the makespan of every plan of the problem, whatever its steps, in seconds; 0 if it wasn't computed.
    scheduler : str
        The name of the scheduler.
    arcs : tuple of (int, int)
        Pairs of numbers of primitives; the second primitive waits for the first.
    """

    plan: Plan
    slots: tuple[Slot, ...]
    bound: Fraction = Fraction(0)
    bounds: str = THESE_STEPS
    least: Fraction = Fraction(0)
    scheduler: str = "exchanges"
    arcs: tuple[tuple[int, int], ...] = ()

    @cached_property
    def makespan(self) -> Fraction:
        """The end of the last primitive, in seconds."""
        return max((slot.end for slot in self.slots), default=Fraction(0))

    @cached_property
    def serial(self) -> Fraction:
        """The sum of the durations of all primitives, in seconds."""
        return sum((slot.end - slot.begin for slot in self.slots), Fraction(0))

    @property
    def work(self) -> Fraction:
        """The sum of the times during which the actors are busy, in seconds."""
        return sum(((slot.end - slot.begin) * len(slot.actors) for slot in self.slots), Fraction(0))

    @cached_property
    def intervals(self) -> Mapping[tuple[int, ...], tuple[Fraction, Fraction]]:
        """The begin and the end of every step in seconds, by path.

        A step with sub-steps lasts from the first begin to the last end of its sub-steps.
        """
        found = {slot.step.path: (slot.begin, slot.end) for slot in self.slots}
        for step in reversed(list(self.plan.walk())):
            if step.steps:
                inside = [found[one.path] for one in step.steps]
                found[step.path] = min(begin for begin, _ in inside), max(end for _, end in inside)
        return found

    def lanes(self) -> Iterator[tuple[str, list[Slot]]]:
        """Yield each actor with its primitives in the order of their begins.

        The last pair contains the primitives without an actor, under an empty name.
        """
        names = sorted({actor for slot in self.slots for actor in slot.actors})
        for name in names:
            yield name, sorted((s for s in self.slots if name in s.actors), key=lambda s: (s.begin, s.end))
        if rest := [slot for slot in self.slots if not slot.actors]:
            yield "", sorted(rest, key=lambda s: (s.begin, s.end))


@brief
@dataclass(frozen=True)
class TimedOutcome(Outcome):
    """The outcome of a planning call that found a plan whose steps must overlap, with the schedule of this plan.

    The steps alone needn't be a plan if they are executed one after another.
    """

    timed: TimedPlan | None = None


def schedule_of(outcome: Outcome) -> TimedPlan | None:
    """Return the schedule of a plan whose steps must overlap, or None for other outcomes."""
    return outcome.timed if isinstance(outcome, TimedOutcome) else None
