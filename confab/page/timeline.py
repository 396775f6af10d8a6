"""The timeline of a run: the primitives of a plan and the values of symbols, with their begin and end times.

In the timeline of a plan without a schedule, each primitive takes one unit of time. Rollouts and episodes have the times of the
world's clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import itemgetter
from typing import TYPE_CHECKING

from confab.planner.acting.schedule import worker_of
from confab.planner.plan import Plan, Step, changed
from confab.planner.timed.pieces import workers_of
from confab.planner.validation import successor
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, Span, State, Symbol

if TYPE_CHECKING:
    from confab.planner.acting.episode import Episode
    from confab.planner.timed.plan import TimedPlan
    from confab.sim.verify import Rollout

MOST_HANDS = 8
"""Maximum number of lanes. A lane has all primitives with the same first argument, such as a hand. If the number of different
first arguments exceeds this maximum, all primitives share one lane.
"""


@dataclass(frozen=True)
class Bar:
    """A step with its begin and end times.

    `ok` is the verdict on the step; it is None if there is no verdict. `note` is a remark on the result of the step. `planned` is
    True if the step hasn't begun. In a schedule, `actors` are the actors of the step, and the end of the step may be delayed by
    `slack` without a longer makespan.
    """

    step: Step
    begin: float
    end: float
    ok: bool | None = None
    note: str = ""
    measured: Mapping[str, float] = field(default_factory=dict)
    code: str | None = None
    planned: bool = False
    actors: tuple[str, ...] = ()
    slack: float | None = None


@dataclass(frozen=True)
class Period:
    """A period of time in which a symbol had a value."""

    begin: float
    end: float
    value: str


@dataclass(frozen=True)
class Timeline:
    """The primitives of a run with their times, and the values of symbols by period.

    `marks` are the times and texts of interventions and changes of the plan. `unit` is the unit of time. `final` is the last
    state of the run.
    """

    problem: Problem
    plan: Plan
    bars: tuple[Bar, ...]
    phases: Mapping[Symbol, tuple[Period, ...]]
    end: float
    unit: str
    final: State
    marks: tuple[tuple[float, str], ...] = ()

    @property
    def failed(self) -> Bar | None:
        """The first primitive that failed."""
        return next((bar for bar in self.bars if bar.ok is False), None)

    @property
    def by_path(self) -> dict[tuple[int, ...], Bar]:
        """The bars of all steps that have begun, by path.

        The bar of a step with sub-steps extends over the bars of its primitives.
        """
        found: dict[tuple[int, ...], Bar] = {}
        for bar in self.bars:  # several attempts at a step become one bar with the result of the last attempt
            first = found.get(bar.step.path, bar)
            found[bar.step.path] = Bar(
                bar.step, first.begin, bar.end, bar.ok, bar.note, bar.measured, bar.code, bar.planned
            )

        def above(step: Step) -> Bar | None:
            if not step.steps:
                return found.get(step.path)
            parts = [bar for bar in map(above, step.steps) if bar is not None]
            if parts:
                judged = [bar.ok for bar in parts]
                ok = None if None in judged else all(judged)
                found[step.path] = Bar(
                    step,
                    min(b.begin for b in parts),
                    max(b.end for b in parts),
                    ok,
                    planned=all(b.planned for b in parts),
                )
            return found.get(step.path)

        for step in self.plan.steps:
            above(step)
        return found

    def lanes(self) -> dict[str, list[Bar]]:
        """Return the bars of primitives by actor or worker (`schedule.worker_of`), or by first argument if no step has a worker."""
        workers = workers_of(self.problem)
        found: dict[str, list[Bar]] = {}
        for bar in self.bars:
            for actor in bar.actors or (worker_of(bar.step, workers),):
                found.setdefault(actor, []).append(bar)
        if set(found) == {""}:
            by_first: dict[str, list[Bar]] = {}
            for bar in self.bars:
                by_first.setdefault(next(iter(bar.step.arguments), ""), []).append(bar)
            found = by_first if len(by_first) <= MOST_HANDS else found
        return dict(sorted(found.items()))

    def met(self, symbol: Symbol) -> bool | None:
        """Return whether a symbol has its goal value in the end, or None if the symbol has no goal."""
        wanted = self.problem.goal.get(symbol)
        return None if wanted is None else self.final.get(symbol, FALSE) == wanted


def of_plan(problem: Problem, plan: Plan) -> Timeline:
    """Return the timeline of a plan that was not executed, with one unit of time per primitive."""
    steps = plan.primitives
    bars = tuple(Bar(step, float(i), i + 1.0) for i, step in enumerate(steps))
    return _course(problem, plan, bars, _states(problem, steps), "steps")


def of_schedule(problem: Problem, timed: TimedPlan) -> Timeline:
    """Return the timeline of a scheduled plan.

    Each effect is at the beginning or the end of a primitive, as the behaviour states.
    """
    bars = tuple(
        Bar(slot.step, float(slot.begin), float(slot.end), actors=slot.actors, slack=float(slot.slack))
        for slot in timed.slots
    )

    def at(bar: Bar, symbol: Symbol) -> float:
        timing = problem.domain.behaviors[bar.step.behavior].timing
        made = timing.made(Span.START) if timing is not None else ()
        return bar.begin if any(effect.situation == symbol.situation for effect in made) else bar.end

    return _course(problem, timed.plan, bars, _states(problem, [bar.step for bar in bars]), "s", at)


def of_rollout(problem: Problem, plan: Plan, rollout: Rollout) -> Timeline:
    """Return the timeline of a rollout. The effects of a successful primitive begin at the end of the primitive."""
    now = max(0.0, rollout.simulated_seconds - sum(report.seconds for report in rollout.steps))
    by_path = {step.path: step for step in plan.primitives}
    bars = []
    for report in rollout.steps:
        verdict = report.verdict
        step = by_path.get(report.step.path)
        if step is not None:
            bars.append(Bar(step, now, now + report.seconds, verdict.ok, str(verdict), verdict.measured, verdict.code))
        now += report.seconds
    states: list[State] = _states(problem, [bar.step for bar in bars])
    if rollout.failure is not None:
        states[-1] = states[-2] if len(states) > 1 else problem.initial
    if states:
        states[-1] = {**states[-1], **rollout.state}
    return _course(problem, plan, bars, states, "s")


def of_episode(problem: Problem, episode: Episode) -> Timeline:
    """Return the timeline of an episode, with the values of symbols that the robot perceived."""
    done = {step.path: step for step in episode.done.walk()}
    bars = tuple(
        Bar(
            done.get(event.step.path, event.step),
            event.begin,
            event.end,
            event.ok,
            event.code or "; ".join(f"{s.symbol}: expected {s.expected}, seen {s.observed}" for s in event.surprises),
            code=event.code,
        )
        for event in episode.events
    )
    end = max((bar.end for bar in bars), default=0.0)
    phases = phases_of(episode.initial, [(seen.seconds, seen.symbol, seen.value) for seen in episode.course], end)
    marks = [(at, intervention.text) for intervention, at in episode.interventions]
    ends = {event.step.path: event.end for event in episode.events}
    marks += [(ends.get(r.after, 0.0), f"{r.kind}: {r.because}") for r in episode.replans]
    lived = replace(problem, initial=episode.initial, goal=episode.goal, times=None, weights={})
    unit = "steps" if all(bar.end - bar.begin == 1.0 for bar in bars) else "s"
    return Timeline(lived, episode.done, bars, phases, end, unit, episode.observed, tuple(sorted(marks)))


def _states(problem: Problem, steps: Iterable[Step]) -> list[State]:
    """Return the state after each primitive; an inapplicable primitive doesn't change the state."""
    state, found = problem.initial, []
    for step in steps:
        state = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state) or state
        found.append(state)
    return found


def _course(
    problem: Problem,
    plan: Plan,
    bars: Sequence[Bar],
    states: Sequence[State],
    unit: str,
    at: Callable[[Bar, Symbol], float] = lambda bar, symbol: bar.end,
) -> Timeline:
    """Return the timeline of primitives and of the states after them; `at` returns the time at which a symbol changes."""
    initial = dict.fromkeys((*problem.goal, *(states[-1] if states else ())), FALSE) | {**problem.initial}
    final = {**initial, **(states[-1] if states else {})}
    changes = [
        (at(bar, fact.symbol), fact.symbol, fact.value)
        for bar, (before, after) in zip(bars, pairwise((initial, *states)), strict=True)
        for fact in changed(before, after)
    ]
    end = max((bar.end for bar in bars), default=0.0)
    phases = phases_of(initial, sorted(changes, key=itemgetter(0)), end)
    return Timeline(problem, plan, tuple(bars), phases, end, unit, final)


def phases_of(
    initial: State, changes: Iterable[tuple[float, Symbol, str | None]], end: float
) -> dict[Symbol, tuple[Period, ...]]:
    """Return the values of symbols by period, from the initial values and the later changes with their times, in order of time.

    A symbol whose value becomes None has no further period until it gets a value.
    """
    found = {symbol: [Period(0.0, end, value)] for symbol, value in initial.items()}
    for at, symbol, value in changes:
        periods = found.setdefault(symbol, [])
        if periods:
            periods[-1] = replace(periods[-1], end=at)
        if value is not None:
            periods.append(Period(at, max(end, at), value))
    return {symbol: tuple(periods) for symbol, periods in found.items()}
