"""What was when: the primitives of a plan on one axis of time, and which value each situated object had from when to when.

A plan alone takes one unit of time per primitive; a rollout and an episode take what the world's clock showed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from planner.acting.schedule import worker_of, workers_of
from planner.plan import Plan, Step
from planner.validation import successor
from reasoner.symbols import FALSE, Problem, State, Symbol

if TYPE_CHECKING:
    from planner.acting.episode import Episode
    from sim.verify import Rollout

MOST_HANDS = 8
"""So many of what does the primitives have a lane each."""


@dataclass(frozen=True)
class Bar:
    """A step in time; `ok` is None where nobody looked, `note` says what is to be said of it."""

    step: Step
    begin: float
    end: float
    ok: bool | None = None
    note: str = ""
    measured: Mapping[str, float] = field(default_factory=dict)
    code: str | None = None


@dataclass(frozen=True)
class Phase:
    """A stretch of time in which a symbol had a value."""

    begin: float
    end: float
    value: str


@dataclass(frozen=True)
class Course:
    """What was done when, and what was so meanwhile.

    `marks` are moments with a text: interventions and changes of plan. `unit` is that of the axis. `final` is the state in the end.
    """

    problem: Problem
    plan: Plan
    bars: tuple[Bar, ...]
    phases: Mapping[Symbol, tuple[Phase, ...]]
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
        """The bar of each step of the tree that was begun; of one above primitives, from its first to its last."""
        found: dict[tuple[int, ...], Bar] = {}
        for bar in self.bars:  # what was tried again is one stretch, and its last try counts
            first = found.get(bar.step.path, bar)
            found[bar.step.path] = Bar(bar.step, first.begin, bar.end, bar.ok, bar.note, bar.measured, bar.code)

        def above(step: Step) -> Bar | None:
            if not step.steps:
                return found.get(step.path)
            parts = [bar for bar in map(above, step.steps) if bar is not None]
            if parts:
                judged = [bar.ok for bar in parts]
                ok = None if None in judged else all(judged)
                found[step.path] = Bar(step, min(b.begin for b in parts), max(b.end for b in parts), ok)
            return found.get(step.path)

        for step in self.plan.steps:
            above(step)
        return found

    def lanes(self) -> dict[str, list[Bar]]:
        """Return the primitives by who does them: each hand, or whatever else has a state of rest; else by their first argument."""
        workers = workers_of(self.problem)
        found: dict[str, list[Bar]] = {}
        for bar in self.bars:
            found.setdefault(worker_of(bar.step, workers), []).append(bar)
        if set(found) == {""}:
            by_first: dict[str, list[Bar]] = {}
            for bar in self.bars:
                by_first.setdefault(next(iter(bar.step.arguments), ""), []).append(bar)
            found = by_first if len(by_first) <= MOST_HANDS else found
        return dict(sorted(found.items()))

    def told(self) -> list[Symbol]:
        """Return the symbols that change, or are wanted: first those that have a goal."""
        goal = self.problem.goal
        symbols = {s for s, phases in self.phases.items() if len(phases) > 1} | set(goal)
        return sorted(symbols & self.phases.keys(), key=lambda s: (s not in goal, s.arguments, s.situation))

    def met(self, symbol: Symbol) -> bool | None:
        """Return whether what is wanted of a symbol is so in the end; None if nothing is."""
        wanted = self.problem.goal.get(symbol)
        return None if wanted is None else self.final.get(symbol, FALSE) == wanted


def of_plan(problem: Problem, plan: Plan) -> Course:
    """Return the course of a plan that nobody carried out: a unit of time for each primitive."""
    steps = plan.primitives
    bars = tuple(Bar(step, float(i), i + 1.0) for i, step in enumerate(steps))
    return _course(problem, plan, bars, _states(problem, steps), "steps")


def of_rollout(problem: Problem, plan: Plan, rollout: Rollout) -> Course:
    """Return the course of a rollout: what each primitive promised is so from its end on if it did what it should."""
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


def of_episode(problem: Problem, episode: Episode) -> Course:
    """Return the course of an episode, as the robot believed it to be."""
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
    phases: dict[Symbol, list[Phase]] = {s: [Phase(0.0, end, v)] for s, v in episode.initial.items()}
    for seen in episode.course:
        before = phases.setdefault(seen.symbol, [])
        if before:
            before[-1] = Phase(before[-1].begin, seen.seconds, before[-1].value)
        if seen.value is not None:
            before.append(Phase(seen.seconds, max(end, seen.seconds), seen.value))
    marks = [(at, intervention.text) for intervention, at in episode.interventions]
    ends = {event.step.path: event.end for event in episode.events}
    marks += [(ends.get(r.after, 0.0), f"{r.kind}: {r.because}") for r in episode.replans]
    lived = Problem(
        problem.scene,
        problem.domain,
        problem.classes,
        problem.relations,
        episode.initial,
        episode.goal,
        problem.parents,
        problem.value_levels,
    )
    found = {symbol: tuple(those) for symbol, those in phases.items()}
    unit = "steps" if all(bar.end - bar.begin == 1.0 for bar in bars) else "s"
    return Course(lived, episode.done, bars, found, end, unit, episode.observed, tuple(sorted(marks)))


def _states(problem: Problem, steps: Iterable[Step]) -> list[State]:
    """Return the state after each of some primitives; where one can't be done, as it was before."""
    state, found = problem.initial, []
    for step in steps:
        state = successor(problem, problem.domain.behaviors[step.behavior], step.arguments, state) or state
        found.append(state)
    return found


def _course(problem: Problem, plan: Plan, bars: Sequence[Bar], states: Sequence[State], unit: str) -> Course:
    end = bars[-1].end if bars else 0.0
    begun: dict[Symbol, tuple[float, str]] = {symbol: (0.0, value) for symbol, value in problem.initial.items()}
    begun |= {symbol: (0.0, FALSE) for symbol in problem.goal if symbol not in begun}
    phases: dict[Symbol, list[Phase]] = {}
    before: State = problem.initial
    for bar, state in zip(bars, states, strict=True):
        for symbol, value in state.items():
            if before.get(symbol) == value or (symbol in begun and begun[symbol][1] == value):
                continue
            since, old = begun.get(symbol, (0.0, FALSE))
            phases.setdefault(symbol, []).append(Phase(since, bar.end, old))
            begun[symbol] = bar.end, value
        before = state
    for symbol, (since, value) in begun.items():
        phases.setdefault(symbol, []).append(Phase(since, end, value))
    final = {symbol: value for symbol, (_, value) in begun.items()}
    return Course(problem, plan, tuple(bars), {s: tuple(p) for s, p in phases.items()}, end, unit, final)
