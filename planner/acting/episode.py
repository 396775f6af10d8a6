"""The values of execution: interventions, events, and the episode as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from confab.planner.acting.discovery import Discovery
from confab.planner.plan import Plan, Reason, Step
from confab.reasoner.refutations import Refutation
from confab.reasoner.symbols import Fact, State, Symbol


class Change(Enum):
    """What an intervention changes."""

    WORLD = "world"  # an object gets another value: moved, emptied, filled
    REMOVE = "remove"  # an object is taken away
    ADD = "add"  # an object appears
    KNOCK = "knock"  # an object is knocked over
    PUSH = "push"  # an object is pushed off its place
    BOX = "box"  # a box of which no fact speaks is put at a place
    GOAL = "goal"  # a goal is added, or replaces that of its symbol
    DROP_GOAL = "drop-goal"


@dataclass(frozen=True)
class Intervention:
    """An intervention by a person during an episode.

    It happens as soon as the step with the ID `after` (an int: a step of the most abstract level) or the path `after` (a tuple)
    is done, or when the world's clock shows `at` seconds, which may be inside a primitive.

    Attributes
    ----------
    change : Change
    facts : tuple of Fact
        What holds from then on, or is wanted.
    symbol : Symbol, optional
        Whose goal is dropped.
    individual, kind : str
        What is added, taken away, pushed, knocked over; of which class it is.
    numbers : tuple of float
        Metres: by which an object is pushed along x and y; width, depth and height of a box.
    after : int or tuple of int, optional
    at : float, optional
    text : str
        As it was written.
    """

    change: Change
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
        return self.change not in (Change.GOAL, Change.DROP_GOAL)


class End(Enum):
    """How an episode ended."""

    REACHED = "reached"
    IMPOSSIBLE = "impossible"  # proved: what is wanted can't be brought about any more
    GAVE_UP = "gave-up"  # a limit came first


@dataclass(frozen=True)
class Surprise:
    """A symbol with an unexpected value; `None` if nothing was perceived, or nothing expected."""

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
    """A failed primitive: the situation, the failure, and the objects concerned."""

    step: Step
    code: str
    objects: tuple[str, ...]
    message: str
    state: State


@dataclass(frozen=True)
class Event:
    """An executed primitive: its times, its verdict, and the surprises after it.

    `relied_on` are the static facts, as relation and individuals, that it or the behaviour above it relied on.
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

    `after` is the path of the last primitive that was begun. `kind` is ``repair`` where valid steps of the old plan were kept,
    else ``replan``. `steps` is what was to be done from then on, of cost `cost`; `dropped` and `added` count its primitives'
    difference from what was to be done before.
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
        Why not everything that was wanted was reached.
    planned : Plan
        As it was before anything happened.
    done : Plan
        As it was carried out; a primitive that failed isn't part of it, unless what it should bring about was there afterwards.
    initial, observed : State
        The situation in the beginning, and as it was seen in the end.
    goal : State
        What was wanted in the end.
    events : tuple of Event
        Every primitive that was begun, in order.
    interventions : tuple of (Intervention, float)
        Those that happened, with the time when they began to.
    replans : tuple of Replan
    failures : tuple of Failure
        Experience for the memory.
    missed : tuple of Intervention
        Those that never came: the episode was over before.
    course : tuple of Seen
        How the situation changed from `initial` to `observed`, in the order of time.
    refuted : tuple of Refutation
        What planners of motions found to be impossible as things stood, and what was then done otherwise.
    discovered : tuple of (Discovery, float)
        What the world came across that the scene doesn't have, and when.
    """

    scene: str
    status: End
    reasons: tuple[Reason, ...]
    planned: Plan
    done: Plan
    initial: State
    observed: State
    goal: State
    events: tuple[Event, ...] = ()
    interventions: tuple[tuple[Intervention, float], ...] = ()
    replans: tuple[Replan, ...] = ()
    failures: tuple[Failure, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    missed: tuple[Intervention, ...] = ()
    course: tuple[Seen, ...] = ()
    refuted: tuple[Refutation, ...] = ()
    discovered: tuple[tuple[Discovery, float], ...] = ()
