"""The record of an episode in progress."""

from __future__ import annotations

from dataclasses import dataclass, field

from confab.planner.acting.agenda import tree_of
from confab.planner.acting.discovery import Discovery
from confab.planner.acting.episode import (
    BeliefChange,
    End,
    Episode,
    ExecutedPrimitive,
    Failure,
    Intervention,
    Replan,
    changes,
)
from confab.planner.plan import Plan, Reason, SoftGoal, Step
from confab.reasoner.problem import Problem
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import State


@dataclass
class Record:
    """The record so far: executed steps by path, events, and reasons for unachieved goals."""

    initial: State
    planned: Plan = Plan(())  # noqa: RUF009 - frozen
    status: End = End.REACHED
    reasons: list[Reason] = field(default_factory=list)
    events: list[ExecutedPrimitive] = field(default_factory=list)
    interventions: list[tuple[Intervention, float]] = field(default_factory=list)
    course: list[BeliefChange] = field(default_factory=list)
    replans: list[Replan] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    refuted: dict[Refutation, None] = field(default_factory=dict)
    discovered: list[tuple[Discovery, float]] = field(default_factory=list)
    done: dict[tuple[int, ...], Step] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=lambda: {"planning": 0.0, "repairing": 0.0})

    @property
    def executed(self) -> Plan:
        """The executed steps as a tree."""
        return Plan(tree_of(self.done))

    def changes(self, before: State, after: State, seconds: float) -> None:
        """Record the symbols whose values differ between two situations."""
        self.course += changes(before, after, seconds)

    def reason(self, reason: Reason) -> None:
        """Record a reason, unless it is recorded already."""
        if reason not in self.reasons:
            self.reasons.append(reason)

    def episode(
        self,
        task: Problem,
        clock: float,
        missed: tuple[Intervention, ...],
        measured: bool,
        soft_goals: tuple[SoftGoal, ...] = (),
    ) -> Episode:
        """Return the recorded episode with the final task; `measured` states whether the clock is measured."""
        return Episode(
            task.scene,
            self.status,
            tuple(self.reasons),
            self.planned,
            self.executed,
            self.initial,
            dict(task.initial),
            dict(task.goal),
            tuple(self.events),
            tuple(self.interventions),
            tuple(self.replans),
            tuple(self.failures),
            {**self.seconds, "simulated": clock},
            missed,
            tuple(self.course),
            tuple(self.refuted),
            tuple(self.discovered),
            measured,
            soft_goals,
        )
