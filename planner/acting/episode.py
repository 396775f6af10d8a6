"""Data types of execution: interventions, events, and the episode as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from confab.planner.acting.discovery import Discovery
from confab.planner.plan import Plan, Reason, SoftGoal, Step
from confab.reasoner.amounts import meets
from confab.reasoner.derivation import deciding
from confab.reasoner.names import brief, known_as
from confab.reasoner.problem import Problem
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import FALSE, Fact, State, Symbol


class InterventionKind(Enum):
    """The part of the task that an intervention changes."""

    WORLD = "world"  # an object gets another value: the object is moved, emptied or filled
    REMOVE = "remove"  # an object is taken away
    ADD = "add"  # an object appears
    KNOCK = "knock"  # an object is knocked over
    PUSH = "push"  # an object is pushed off its place
    BOX = "box"  # a box that no fact mentions is put at a place
    GOAL = "goal"  # a goal is added, or replaces the goal of the same symbol
    DROP_GOAL = "drop-goal"


@dataclass(frozen=True)
class Intervention:
    """An intervention by a person during an episode.

    An intervention with `after` takes place when a step is finished: the step at the top of the tree with that ID (an int), the
    step with that path (a tuple), or the step with a name such as ``L3#2`` in the tree of executed and remaining steps. An
    intervention with `at` takes place when the world's clock shows that number of seconds, possibly while a primitive is running.

    Attributes
    ----------
    change : InterventionKind
    facts : tuple of Fact
        The facts that hold after the intervention, or the new goals.
    symbol : Symbol, optional
        The symbol whose goal is dropped.
    individual, kind : str
        The object that is added, removed, pushed or knocked over, and its class.
    numbers : tuple of float
        Numbers in metres: the displacement of an object along x and y, or the width, depth and height of a box.
    after : int or tuple of int or str, optional
    at : float, optional
    text : str
        The original text of the intervention.
    """

    change: InterventionKind
    facts: tuple[Fact, ...] = ()
    symbol: Symbol | None = None
    individual: str = ""
    kind: str = ""
    numbers: tuple[float, ...] = ()
    after: int | tuple[int, ...] | str | None = None
    at: float | None = None
    text: str = ""

    @property
    def of_world(self) -> bool:
        """Whether the intervention changes the world instead of the goal."""
        return self.change not in (InterventionKind.GOAL, InterventionKind.DROP_GOAL)


class End(Enum):
    """The way in which an episode ended."""

    REACHED = "reached"
    IMPOSSIBLE = "impossible"  # a proof shows that a goal is unreachable, or that a rest value can't be restored
    GAVE_UP = "gave-up"  # a limit was reached before the goal


@dataclass(frozen=True)
class Surprise:
    """A symbol with an unexpected value; None stands for no value."""

    symbol: Symbol
    expected: str | None
    observed: str | None


@dataclass(frozen=True)
class BeliefChange:
    """A change of a symbol's value in the executive's belief; the value is None if the symbol is no longer observable."""

    seconds: float
    symbol: Symbol
    value: str | None


def changes(before: State, after: State, seconds: float) -> list[BeliefChange]:
    """Return the changes from a situation to another situation that was observed at a time."""
    changed = (s for s in sorted(before.keys() | after.keys()) if before.get(s) != after.get(s))
    return [BeliefChange(seconds, symbol, after.get(symbol)) for symbol in changed]


def changed(values: State, seconds: float) -> list[BeliefChange]:
    """Return the changes of symbols to new values at a time."""
    return [BeliefChange(seconds, symbol, value) for symbol, value in values.items()]


def holds_from(problem: Problem, goal: Symbol, initial: State, course: Iterable[BeliefChange]) -> float:
    """Return the time from which a goal with a deadline holds, if it holds in the end."""
    wanted, seconds = deciding(problem, goal), 0.0
    symbol = Symbol(wanted.situation, wanted.arguments)
    met = meets(initial.get(symbol, FALSE), wanted.value)
    for change in course:
        if change.symbol == symbol and meets(change.value or FALSE, wanted.value) is not met:
            met, seconds = not met, change.seconds
    return seconds


def situation(initial: State, course: Iterable[BeliefChange], seconds: float = math.inf) -> dict[Symbol, str]:
    """Return the situation at a time: the initial situation with the changes that were observed until this time."""
    state = dict(initial)
    for seen in course:
        if seen.seconds > seconds:
            continue
        if seen.value is None:
            state.pop(seen.symbol, None)
        else:
            state[seen.symbol] = seen.value
    return state


@dataclass(frozen=True)
class Failure:
    """A failed primitive with the situation before the primitive, the kind of failure, and the objects involved."""

    step: Step
    code: str
    objects: tuple[str, ...]
    message: str
    state: State


@dataclass(frozen=True)
class ExecutedPrimitive:
    """An executed primitive with its begin and end, the world's verdict, and the unexpected values observed after the primitive.

    `relied_on` lists the static facts (relation and individuals) on which the primitive, or an ancestor of the primitive,
    relied.
    """

    step: Step
    begin: float
    end: float
    ok: bool
    code: str | None = None
    surprises: tuple[Surprise, ...] = ()
    relied_on: tuple[tuple[str, tuple[str, ...]], ...] = ()


@dataclass(frozen=True)
class Replan:
    """A change of the plan.

    `after` is the path of the last primitive that was begun before the change. `kind` is ``repair`` if steps of the old
    plan were kept, otherwise ``replan``. `steps` are the new remaining steps, and `cost` is their cost; `dropped` and
    `added` count the primitives that the change removed from the plan and added to the plan.
    """

    after: tuple[int, ...]
    kind: str
    because: str
    steps: tuple[Step, ...]
    cost: float
    dropped: int
    added: int
    seconds: float

    @property
    def distance(self) -> int:
        """Number of dropped primitives plus number of added primitives."""
        return self.dropped + self.added


@known_as("an episode")
@brief
@dataclass(frozen=True)
class Episode:
    """An episode: the plan, the executed steps, the observations, the interventions, and the changes of the plan.

    Attributes
    ----------
    scene : str
    status : End
    reasons : tuple of Reason
        The reasons why goals weren't reached, and why rest values weren't restored.
    planned : Plan
        The plan before the first step.
    done : Plan
        The executed steps; a failed primitive isn't among them, unless its effects were observed afterwards.
    initial, observed : State
        The situation in the beginning, and the situation that was observed in the end.
    goal : State
        The goal in the end.
    events : tuple of ExecutedPrimitive
        Every primitive that was begun, in order.
    interventions : tuple of (Intervention, float)
        The interventions that took place, with the times of their beginning.
    replans : tuple of Replan
    failures : tuple of Failure
        The failed primitives, from which the memory learns.
    missed : tuple of Intervention
        The interventions that didn't take place, because the episode ended earlier.
    course : tuple of BeliefChange
        The changes of the situation from `initial` to `observed`, in order of time.
    refuted : tuple of Refutation
        Behaviours that motion planning found impossible in a situation and that the executive replaced.
    discovered : tuple of (Discovery, float)
        Individuals that the world found and the scene doesn't contain, with the time of discovery.
    measured : bool
        Whether the world's clock is measured; the durations of a symbolic world are assumed.
    soft_goals : tuple of SoftGoal
        The goals that a plan may leave unmet and that no intervention dropped or replaced, the heaviest first.
    """

    scene: str
    status: End
    reasons: tuple[Reason, ...]
    planned: Plan
    done: Plan
    initial: State
    observed: State
    goal: State
    events: tuple[ExecutedPrimitive, ...] = ()
    interventions: tuple[tuple[Intervention, float], ...] = ()
    replans: tuple[Replan, ...] = ()
    failures: tuple[Failure, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    missed: tuple[Intervention, ...] = ()
    course: tuple[BeliefChange, ...] = ()
    refuted: tuple[Refutation, ...] = ()
    discovered: tuple[tuple[Discovery, float], ...] = ()
    measured: bool = True
    soft_goals: tuple[SoftGoal, ...] = ()


@dataclass(frozen=True)
class Event:
    """An event for observers, with the time on the world's clock, and the executive's task (`belief`) in the present situation."""

    what: str  # plan, begin, end, intervention, discovery, late, repair, replan, over
    plan: Plan
    done: frozenset[tuple[int, ...]]
    step: Step | None = None
    expected: tuple[Fact, ...] = ()
    surprises: tuple[Surprise, ...] = ()
    text: str = ""
    seconds: float = 0.0
    belief: Problem | None = None
