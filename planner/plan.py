"""The values of a planning call: a plan as a tree of steps, and the outcome."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from time import perf_counter
from typing import TYPE_CHECKING, Protocol, overload

from confab.planner.certificates import Certificate
from confab.reasoner.amounts import written
from confab.reasoner.limits import current
from confab.reasoner.names import right_names
from confab.reasoner.symbols import Condition, Fact, Problem, State, Symbol

if TYPE_CHECKING:
    import networkx
    import pandas

    from confab.planner.forms import Node


class Status(Enum):
    """How a planning call ended."""

    SOLVED = "solved"
    UNSOLVABLE = "unsolvable"  # proved: no plan exists
    GAVE_UP = "gave-up"  # a limit came first


@right_names("a step", "confab.planner.forms", "STEP")
@dataclass(frozen=True)
class Step:
    """One behaviour of a plan, with the steps of the next level that refine it.

    `path` is the position in the tree; `bindings` are the individuals that the situation assigned to the behaviour's variables
    (the object that GRASP grasps). `rank` is the cogency ranking score c_m of eq. (4) of the behaviour when it was chosen, if
    computed.
    """

    path: tuple[int, ...]
    id: int
    level: int
    behavior: str
    arguments: tuple[str, ...]
    bindings: Mapping[str, str] = field(default_factory=dict)
    rank: float | None = None
    steps: tuple[Step, ...] = ()

    def walk(self) -> Iterator[Step]:
        """Yield this step and all below it, each before its sub-steps."""
        waiting = [self]
        while waiting:
            yield (step := waiting.pop())
            waiting += reversed(step.steps)

    def __str__(self) -> str:
        """Return the step as the paper's figures print it, e.g. ``22 B1_MOVE cup1 location7``."""
        return " ".join((str(self.id), self.behavior, *self.arguments))


@right_names("a plan", "confab.planner.forms", "PLAN")
@dataclass(frozen=True, repr=False)
class Plan(Sequence[Step]):
    """A tree of steps that leads from one state to the goal; as a sequence, the steps of its first level.

    Examples
    --------
    >>> import confab
    >>> plan = confab.load("beverage-serving").plan().plan
    >>> plan
    Plan of 4 / 10 / 32 steps:
      22 B1_MOVE cup1 location7
      28 B1_MOVE cup2 location5
      34 B1_POUR bottle1 cup1
      39 B1_POUR bottle2 cup2
    >>> len(plan), plan[-1].behavior
    (4, 'B1_POUR')
    """

    steps: tuple[Step, ...]

    def __len__(self) -> int:
        """Return the number of steps of the first level."""
        return len(self.steps)

    def __bool__(self) -> bool:
        """Return True: an empty plan is a plan, too."""
        return True

    @overload
    def __getitem__(self, index: int) -> Step: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Step, ...]: ...

    def __getitem__(self, index: int | slice) -> Step | tuple[Step, ...]:
        """Return one step of the first level, or several."""
        return self.steps[index]

    def __repr__(self) -> str:
        """Return the number of steps per level, and the steps of the first level."""
        if not self.steps:
            return "Plan without steps"
        many = " / ".join(map(str, self.length.values()))
        return "\n".join([f"Plan of {many} steps:", *(f"  {step}" for step in self.steps)])

    def walk(self) -> Iterator[Step]:
        """Yield all steps, each before its sub-steps."""
        for step in self.steps:
            yield from step.walk()

    def at_level(self, level: int) -> tuple[Step, ...]:
        """Return the steps of one level in the order of execution."""
        return tuple(step for step in self.walk() if step.level == level)

    @property
    def primitives(self) -> tuple[Step, ...]:
        """The steps without sub-steps, which a robot executes."""
        return tuple(step for step in self.walk() if not step.steps)

    @property
    def length(self) -> dict[int, int]:
        """Number of steps per level."""
        levels = [step.level for step in self.walk()]
        return {level: levels.count(level) for level in sorted(set(levels))}

    def to_networkx(self) -> networkx.DiGraph[tuple[int, ...]]:
        """Return the plan as a directed graph: a node for each step, by its path; edges to its sub-steps and to the next step.

        Nodes have ``label``, ``level`` and ``id``; an edge has a ``kind``, ``refines`` or ``then``.
        """
        from confab.planner.forms import digraph

        return digraph(self._nodes())

    def to_dot(self) -> str:
        """Return the plan in Graphviz' language: sub-steps below their step, dashed arrows to the next step."""
        from confab.planner.forms import dot

        return dot(self._nodes())

    def to_records(self) -> list[dict[str, object]]:
        """Return one mapping per step, each step before its sub-steps: path, level, id, behavior, arguments, bindings."""
        return [
            {
                "path": ".".join(map(str, step.path)),
                "level": step.level,
                "id": step.id,
                "behavior": step.behavior,
                "arguments": " ".join(step.arguments),
                "bindings": " ".join(f"{variable}={individual}" for variable, individual in step.bindings.items()),
            }
            for step in self.walk()
        ]

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame with a row for each step, as in `to_records` (needs the extra `notebook`)."""
        import pandas

        return pandas.DataFrame(self.to_records())

    def _nodes(self) -> list[Node]:
        from confab.planner.forms import Node

        return [Node(step.path, str(step), step.level, step.id) for step in self.walk()]

    def _repr_html_(self) -> str:
        from confab.planner.forms import html

        return html(repr(self).splitlines()[0], self._nodes())


@dataclass
class Counts:
    """Effort of a search: nodes generated, evaluated (scored) and expanded."""

    generated: int = 0
    evaluated: int = 0
    expanded: int = 0

    def add(self, other: Counts) -> None:
        """Add the counts of another search."""
        self.generated += other.generated
        self.evaluated += other.evaluated
        self.expanded += other.expanded


@dataclass(frozen=True)
class Reason:
    """Why there is no plan: a sentence, its facts or terms, and the number of states if all states were examined."""

    text: str
    terms: tuple[str, ...] = ()
    states: int = 0


OUT_OF_MEMORY = Reason("there isn't enough memory to go on")


@dataclass(frozen=True)
class Broken:
    """A change for which a condition of the level above fails.

    `behavior` is the behaviour of that level that fails the fewest `conditions`.

    `step` is the path of the primitive that makes the change. Without a behaviour: none of that level can make the change. `text`
    is a sentence, e.g. ``cup1 LOCATION location7: B1_MOVE cup1 location7 requires that …``.
    """

    step: tuple[int, ...]
    change: Fact
    behavior: str | None
    arguments: tuple[str, ...]
    conditions: tuple[Condition, ...]
    text: str

    def __str__(self) -> str:
        """Return it as a sentence."""
        return self.text


@dataclass(frozen=True)
class Left:
    """A stretch of a plan below a level: the paths of its first and last steps, and the conditions that it violates."""

    level: int
    first: tuple[int, ...]
    last: tuple[int, ...]
    broken: tuple[Broken, ...]


@dataclass(frozen=True)
class Forgone:
    """A soft goal that a plan leaves unmet.

    Parameters
    ----------
    fact : Fact
    weight : Fraction
        The cost of leaving it unmet.
    price : Fraction, optional
        The additional cost of the plan that meets it, too; None if no such plan was found.
    """

    fact: Fact
    weight: Fraction
    price: Fraction | None

    def __str__(self) -> str:
        more = "no plan that meets it was found" if self.price is None else f"it would cost {written(self.price)} more"
        return f"{self.fact} (weight {written(self.weight)}; {more})"


@dataclass(frozen=True)
class Outcome:
    """The result of a planning call.

    `plan` is present if and only if `status` is solved, `reason` if and only if it isn't. `search` counts per level, summed
    over the calls at that level; `fallbacks` counts how often a level had no refinement for the level above; `hits` and
    `misses` count the refinements found in the cache and those that had to be searched. `cost` is the cost of the plan if some
    behaviour has a price; `bound` a lower bound on the cost of every lowest-level plan for the same goals, if proved; `engine`
    the other planner that found the plan. `given_up` has the levels that were given up, each with its goal. `left` has the runs
    of lower-level steps in the plan, with the conditions of the level above that they violate. `saving` is the cost per second
    by which the plan was still getting cheaper in the end, None if it wasn't shortened. `certificate` proves that a task is
    unsolvable; `confab.planner.solve` returns no such outcome without one. `forgone` has the soft goals that are left unmet.
    """

    status: Status
    plan: Plan | None = None
    reason: Reason | None = None
    search: Mapping[int, Counts] = field(default_factory=dict)
    fallbacks: int = 0
    seconds: float = 0.0
    bound: float | None = None
    cost: float | None = None
    hits: int = 0
    misses: int = 0
    engine: str | None = None
    given_up: tuple[str, ...] = ()
    left: tuple[Left, ...] = ()
    saving: float | None = None
    certificate: Certificate | None = None
    forgone: tuple[Forgone, ...] = ()

    @property
    def unmet(self) -> frozenset[Symbol]:
        """The symbols of the soft goals that are left unmet."""
        return frozenset(one.fact.symbol for one in self.forgone)


@dataclass(frozen=True)
class Limits:
    """Limits of a planning call: seconds for the whole call (None: no limit), expansions, and work.

    In the paper's mode expansions count per search; in the default mode they count over all searches before the last resort, and
    separately for the last resort. Work limits only the last resort, in states times operators (about a microsecond each), and
    only until a plan is found.
    """

    expansions: int = 200_000
    seconds: float | None = None
    work: float = math.inf

    def end(self, share: float = 1.0) -> float | None:
        """Return the time, on the clock of `perf_counter`, at which a share of the remaining time is over; None without a limit.

        The remaining time ends with the seconds of these limits, or with the current deadline (`confab.reasoner.limits`) if
        earlier.
        """
        left = min((seconds for seconds in (self.seconds, current().left) if seconds is not None), default=None)
        return None if left is None else perf_counter() + share * left

    def until(self, end: float | None) -> Limits:
        """Return the same limits with the seconds left until a time, for a step of a longer call."""
        return self if end is None else replace(self, seconds=max(end - perf_counter(), 0.0))


class Planner(Protocol):
    """A planning function within limits."""

    def __call__(self, problem: Problem, /, *, limits: Limits) -> Outcome:
        """Return a plan, or the reason why there is none."""


class UnsolvableError(Exception):
    """A proof that there is no plan was found: the reason, and the certificate if there is one already."""

    def __init__(self, reason: Reason, certificate: Certificate | None = None) -> None:
        super().__init__(reason.text)
        self.reason, self.certificate = reason, certificate


class UngroundableError(Exception):
    """A level can't be grounded: it is larger than allowed, or its amounts aren't linear; the message gives the cause."""


@contextmanager
def paused_collection() -> Iterator[None]:
    """Pause the garbage collector; reading and planning make no reference cycles, and collection took a third of their time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def changed(before: State, after: State) -> list[Fact]:
    """Return the facts of `after` that `before` doesn't have, in order."""
    return sorted(Fact(symbol, value) for symbol, value in after.items() if before.get(symbol) != value)


def renumbered(steps: Iterable[Step], first: int = 0, above: tuple[int, ...] = ()) -> tuple[Step, ...]:
    """Return steps with their paths counted from `first`."""
    return tuple(
        replace(step, path=(*above, i), steps=renumbered(step.steps, 0, (*above, i)))
        for i, step in enumerate(steps, first)
    )
