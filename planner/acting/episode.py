"""The values of execution: interventions, events, and the episode as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from confab.planner.acting.discovery import Discovery
from confab.planner.plan import Plan, Reason, Step
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact, Problem, State, Symbol


class InterventionKind(Enum):
    """What an intervention changes."""

    WORLD = "world"  # an object gets another value: moved, emptied, filled
    REMOVE = "remove"  # an object is taken away
    ADD = "add"  # an object appears
    KNOCK = "knock"  # an object is knocked over
    PUSH = "push"  # an object is pushed off its place
    BOX = "box"  # a box that no fact mentions is put at a place
    GOAL = "goal"  # a goal is added, or replaces that of its symbol
    DROP_GOAL = "drop-goal"


@dataclass(frozen=True)
class Intervention:
    """An intervention by a person during an episode.

    It takes place as soon as a step is done: the step of the most abstract level with the ID `after` (an int), or the step with
    the path `after` (a tuple). Otherwise it takes place when the world's clock shows `at` seconds, possibly during a primitive.

    Attributes
    ----------
    change : InterventionKind
    facts : tuple of Fact
        The facts that hold from then on, or the new goals.
    symbol : Symbol, optional
        The symbol whose goal is dropped.
    individual, kind : str
        The object that is added, removed, pushed or knocked over, and its class.
    numbers : tuple of float
        Metres: the displacement of an object along x and y; or width, depth and height of a box.
    after : int or tuple of int, optional
    at : float, optional
    text : str
        The intervention as it was written.
    """

    change: InterventionKind
    facts: tuple[Fact, ...] = ()
    symbol: Symbol | None = None
    individual: str = ""
    kind: str = ""
    numbers: tuple[float, ...] = ()
    after: int | tuple[int, ...] | None = None
    at: float | None = None
    text: str = ""

    @property
    def of_world(self) -> bool:
        """Whether it changes the world, and not the goal."""
        return self.change not in (InterventionKind.GOAL, InterventionKind.DROP_GOAL)


class End(Enum):
    """How an episode ended."""

    REACHED = "reached"
    IMPOSSIBLE = "impossible"  # proved: the goal has become unreachable
    GAVE_UP = "gave-up"  # a limit came first


@dataclass(frozen=True)
class Surprise:
    """A symbol with an unexpected value. A value is `None` if none was perceived, or none was expected."""

    symbol: Symbol
    expected: str | None
    observed: str | None


@dataclass(frozen=True)
class Seen:
    """A believed change of a symbol; `None` if its value could no longer be observed."""

    seconds: float
    symbol: Symbol
    value: str | None


@dataclass(frozen=True)
class Failure:
    """A failed primitive: the situation, the failure, and the objects that took part."""

    step: Step
    code: str
    objects: tuple[str, ...]
    message: str
    state: State


@dataclass(frozen=True)
class ExecutedPrimitive:
    """An executed primitive: its times, its verdict, and the surprises after it.

    `relied_on` are the static facts (relation and individuals) on which the primitive, or the behaviour above it, relied.
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

    `after` is the path of the last primitive that was begun. `kind` is ``repair`` if valid steps of the old plan were kept,
    otherwise ``replan``. `steps` are the steps to be done from then on, of cost `cost`; `dropped` and `added` count the
    primitives removed from and added to the steps planned before.
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
        """Primitives dropped plus primitives added."""
        return self.dropped + self.added


@dataclass(frozen=True)
class Episode:
    """The plan, the executed steps, the observations, the interventions, and the changes of the plan.

    Attributes
    ----------
    scene : str
    status : End
    reasons : tuple of Reason
        The reasons why goals weren't reached.
    planned : Plan
        The plan before the first step.
    done : Plan
        The executed steps; a failed primitive isn't part of it, unless its effects were observed afterwards.
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
        Experience for the memory.
    missed : tuple of Intervention
        The interventions that didn't take place, because the episode ended before.
    course : tuple of Seen
        The changes of the situation from `initial` to `observed`, in order of time.
    refuted : tuple of Refutation
        Behaviours that motion planning found impossible in a situation and that the executive replaced.
    discovered : tuple of (Discovery, float)
        Individuals that the world found and the scene doesn't have, with the time.
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
    course: tuple[Seen, ...] = ()
    refuted: tuple[Refutation, ...] = ()
    discovered: tuple[tuple[Discovery, float], ...] = ()


@dataclass(frozen=True)
class Event:
    """An event for observers of the execution.

    `seconds` is the time on the world's clock, `belief` the task as the executive believes it to be, with the present situation as
    its initial state.
    """

    what: str  # plan, begin, end, intervention, discovery, repair, replan, over
    plan: Plan
    done: frozenset[tuple[int, ...]]
    step: Step | None = None
    expected: tuple[Fact, ...] = ()
    surprises: tuple[Surprise, ...] = ()
    text: str = ""
    seconds: float = 0.0
    belief: Problem | None = None
