"""Data types of a planning call: a plan as a tree of steps, and the outcome."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from time import perf_counter
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol, overload

from confab.planner.certificates import Certificate
from confab.reasoner.amounts import written
from confab.reasoner.limits import current
from confab.reasoner.names import RightNames, brief, known_as, right_names
from confab.reasoner.problem import Problem
from confab.reasoner.sentences import said
from confab.reasoner.symbols import Condition, Fact, State, Symbol

if TYPE_CHECKING:
    import networkx
    import pandas

    from confab.planner.finding import StepPosition


class Status(Enum):
    """The way in which a planning call ended."""

    SOLVED = "solved"
    UNSOLVABLE = "unsolvable"  # a proof shows that no plan exists
    GAVE_UP = "gave-up"  # a limit was reached before a plan or a proof was found


@brief
@right_names("a step")
@dataclass(frozen=True)
class Step:
    """One behaviour of a plan, with the steps of the next level that refine the behaviour.

    `path` is the position of the step in the tree. `bindings` are the individuals that the situation assigns to the variables of
    the behaviour, for example the object that GRASP grasps. `rank` is the cogency ranking score c_m of eq. (4) at the time when
    the planner chose the behaviour. `rank` is None if the score wasn't computed. `joined` are further steps of the level that
    `steps` refine together with this step, in order (docs/levels.md); they have the path of this step, and no sub-steps.
    """

    path: tuple[int, ...]
    id: int
    level: int
    behavior: str
    arguments: tuple[str, ...]
    bindings: Mapping[str, str] = field(default_factory=dict, hash=False)
    rank: float | None = None
    steps: tuple[Step, ...] = ()
    joined: tuple[Step, ...] = ()

    @property
    def together(self) -> tuple[Step, ...]:
        """The steps that the sub-steps refine together: usually this step alone, otherwise this step and `joined`."""
        return (self, *self.joined)

    def walk(self) -> Iterator[Step]:
        """Yield the step and all steps below it, each before its sub-steps; steps that are refined together are one step."""
        waiting = [self]
        while waiting:
            yield (step := waiting.pop())
            waiting += reversed(step.steps)

    def json(self) -> dict[str, object]:
        """Return the step with its sub-steps as JSON data (docs/command-line.md)."""
        data: dict[str, object] = {
            "path": list(self.path),
            "id": self.id,
            "level": self.level,
            "behavior": self.behavior,
            "arguments": list(self.arguments),
            "bindings": dict(self.bindings),
            "steps": [below.json() for below in self.steps],
        }
        if self.rank is not None:
            data["rank"] = round(self.rank, 6)
        if self.joined:
            data["joined"] = [other.json() for other in self.joined]
        return data

    def __str__(self) -> str:
        """Return the step in the form of the paper's figures, for example ``22 B1_MOVE cup1 location7``.

        A plus sign separates steps that are refined together.
        """
        return " + ".join(" ".join((str(step.id), step.behavior, *step.arguments)) for step in self.together)


@right_names("a plan", "scene.plan() or scene.read_plan(FILE)")
@dataclass(frozen=True, repr=False)
class Plan(Sequence[Step], metaclass=RightNames):
    """A tree of steps that leads from the initial state to the goal.

    As a sequence, a plan contains the steps of its first level.

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
        """Return True, because even a plan without steps is a plan."""
        return True

    @overload
    def __getitem__(self, index: int | str | tuple[int, ...]) -> Step: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Step, ...]: ...

    def __getitem__(self, index: int | str | tuple[int, ...] | slice) -> Step | tuple[Step, ...]:
        """Return a step of the first level or a slice of these steps, or any step by its number, its path or its words.

        Raises
        ------
        IndexError
            The first level has no step with this number.
        confab.planner.finding.UnknownStepError
            No step, or more than one step, has this path or these words.
        """
        if isinstance(index, str | tuple):
            from confab.planner.finding import find

            path = find(self._positions(), index, "walk() yields all steps")
            return next(step for step in self.walk() if step.path == path)
        if isinstance(index, int) and not -len(self.steps) <= index < len(self.steps):
            raise IndexError(f"no step {index}: the first level has {len(self.steps)}, counted from 0")
        return self.steps[index]

    def index(self, value: object, start: int = 0, stop: int | None = None) -> int:
        """Return the position of a step of the first level, which is given as `Step` or in a notation of ``plan[…]``.

        Raises
        ------
        ValueError
            The step isn't in this part of the first level.
        """
        wanted = self[value] if isinstance(value, str | tuple) else value
        for position in range(*slice(start, stop).indices(len(self.steps))):
            if self.steps[position] == wanted:
                return position
        raise ValueError(f"{wanted} is no step of the first level")

    def __repr__(self) -> str:
        """Return the number of steps per level, and the steps of the first level."""
        if not self.steps:
            return "Plan without steps"
        many = " / ".join(map(str, self.length.values()))
        return "\n".join([f"Plan of {many} steps:", *(f"  {step}" for step in self.steps)])

    def walk(self) -> Iterator[Step]:
        """Yield all steps of the plan; each step comes before its sub-steps."""
        for step in self.steps:
            yield from step.walk()

    def at_level(self, level: int) -> tuple[Step, ...]:
        """Return the steps of one level in the order of execution; steps that are refined together follow each other."""
        if not isinstance(level, int):
            raise TypeError(f"at_level({level!r}): wanted the number of a level")
        return tuple(step for node in self.walk() if node.level == level for step in node.together)

    @property
    def primitives(self) -> tuple[Step, ...]:
        """The steps without sub-steps; a robot executes these steps."""
        return tuple(step for step in self.walk() if not step.steps)

    @property
    def length(self) -> dict[int, int]:
        """Number of steps per level; each of several steps that are refined together counts."""
        levels = [step.level for node in self.walk() for step in node.together]
        return {level: levels.count(level) for level in sorted(set(levels))}

    def json(self) -> dict[str, object]:
        """Return the plan as JSON data, which `confab.Scene.read_plan` reads from a file.

        Examples
        --------
        >>> import json, confab
        >>> print(json.dumps(confab.load("beverage-serving").plan().plan.json())[:62])
        {"length": {"1": 4, "2": 10, "3": 32}, "steps": [{"path": [0],
        """
        lengths = {str(level): count for level, count in self.length.items()}
        return {"length": lengths, "steps": [step.json() for step in self.steps]}

    def to_networkx(self) -> networkx.DiGraph[tuple[int, ...]]:
        """Return the plan as a directed graph whose nodes are the paths of the steps.

        Edges lead from each step to its sub-steps and to the next step. Nodes have the attributes ``label``, ``level`` and
        ``id``. The attribute ``kind`` of an edge is ``refines`` or ``then``.
        """
        from confab.planner.forms import digraph

        return digraph(self._positions())

    def to_dot(self) -> str:
        """Return the plan as Graphviz text: sub-steps are drawn below a step, and dashed arrows lead to the next step."""
        from confab.planner.forms import dot

        return dot(self._positions())

    def to_records(self) -> list[dict[str, object]]:
        """Return a record for each step in the order of `walk`; steps that are refined together have the same path."""
        return [
            {
                "path": ".".join(map(str, step.path)),
                "level": step.level,
                "id": step.id,
                "behavior": step.behavior,
                "arguments": " ".join(step.arguments),
                "bindings": " ".join(f"{variable}={individual}" for variable, individual in step.bindings.items()),
            }
            for node in self.walk()
            for step in node.together
        ]

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame whose rows are the records of `to_records`; this needs the extra `notebook`."""
        import pandas

        return pandas.DataFrame(self.to_records())

    def _positions(self) -> list[StepPosition]:
        from confab.planner.finding import StepPosition

        return [StepPosition(step.path, step.level, step.id, (str(step),)) for step in self.walk()]

    def _repr_html_(self) -> str:
        from confab.planner.forms import html

        return html(repr(self).splitlines()[0], self._positions())


@dataclass
class Counts:
    """The effort of a search: the numbers of generated, evaluated (scored) and expanded nodes."""

    generated: int = 0
    evaluated: int = 0
    expanded: int = 0

    def add(self, other: Counts) -> None:
        """Add the counts of another search."""
        self.generated += other.generated
        self.evaluated += other.evaluated
        self.expanded += other.expanded


@known_as("a reason")
@dataclass(frozen=True)
class Reason:
    """The reason why a call returns no plan.

    `text` is a sentence, and `terms` are the facts or terms in the sentence. `states` is the number of states if the planner
    examined all states, otherwise zero.
    """

    text: str
    terms: tuple[str, ...] = ()
    states: int = 0


OUT_OF_MEMORY = Reason("there isn't enough memory to continue planning")


@dataclass(frozen=True)
class Broken:
    """A change that a lower-level step makes, and that no behaviour of the level above could make in the same state.

    `step` is the path of the primitive that makes the change. `behavior` is the behaviour of the level above with the fewest
    failing `conditions`. `behavior` is None if no behaviour of the level has an effect that makes the change. `text` describes the
    violation.
    """

    step: tuple[int, ...]
    change: Fact
    behavior: str | None
    arguments: tuple[str, ...]
    conditions: tuple[Condition, ...]
    text: str

    def __str__(self) -> str:
        """Return the violation as a sentence."""
        return self.text


@dataclass(frozen=True)
class Left:
    """A run of consecutive lower-level steps that replaces steps of a level.

    `first` and `last` are the paths of the first and the last step; `broken` are the violated conditions of the level.
    """

    level: int
    first: tuple[int, ...]
    last: tuple[int, ...]
    broken: tuple[Broken, ...]


class SoftGoal(NamedTuple):
    """A soft goal of a task, with its weight, and whether the goal holds in the end."""

    fact: Fact
    weight: Fraction
    met: bool


@dataclass(frozen=True)
class Forgone:
    """A soft goal that a plan leaves unmet, with the cost `weight` of leaving it unmet.

    `price` is the additional cost of a plan that also meets the goal, or None if no such plan is known; `why` then states why,
    if such a plan was searched. `conditions` are the conditions of a goal with alternatives or quantifiers.
    """

    fact: Fact
    weight: Fraction
    price: Fraction | None
    conditions: tuple[Condition, ...] = ()
    why: str = ""

    def __str__(self) -> str:
        more = f"; {self.why}" if self.why else ""
        more = more if self.price is None else f"; it would cost at most {written(self.price)} more"
        goal = " and ".join(map(said, self.conditions))
        return f"{self.fact}{goal and f', which means {goal}'} (weight {written(self.weight)}{more})"


@known_as("an outcome")
@brief
@dataclass(frozen=True)
class Outcome:
    """The result of a planning call.

    If `status` is solved, the outcome has a `plan`; otherwise the outcome has a `reason`. `search` contains the effort of all
    searches of each level. `fallbacks` counts how often a level had no refinement for the level above. `hits` counts refinements
    found in the cache, and `misses` counts refinements that required a search. `cost` is the cost of the plan if some behaviour has
    a price. `penalty` is the sum of the weights of the unmet soft goals, or None if the task has no soft goals. `bound` is a proved
    lower bound on the sum of cost and penalty of every lowest-level plan for the task. `engine` names the external planner that
    found the plan. `given_up` describes the levels that the planner gave up, each with its goal. `left` contains the runs of
    consecutive lower-level steps in the plan, with the violated conditions of the level above. `saving` states how much cost the
    shortening saved per second in the end; it is None if the plan wasn't shortened. `certificate` proves that the task is
    unsolvable; every unsolvable outcome of `confab.planner.solve` has a certificate. `forgone` contains the unmet soft goals.
    `effort` is the work of finding the plan, in units of about a microsecond.
    """

    status: Status
    plan: Plan | None = None
    reason: Reason | None = None
    search: Mapping[int, Counts] = field(default_factory=dict)
    fallbacks: int = 0
    seconds: float = 0.0
    bound: float | None = None
    cost: float | None = None
    penalty: Fraction | None = None
    hits: int = 0
    misses: int = 0
    engine: str | None = None
    given_up: tuple[str, ...] = ()
    left: tuple[Left, ...] = ()
    saving: float | None = None
    certificate: Certificate | None = None
    forgone: tuple[Forgone, ...] = ()
    effort: int = 0

    @property
    def total(self) -> float:
        """The sum of the plan's cost (without prices, the number of primitives) and the penalty; it is infinite without a plan."""
        if self.plan is None:
            return math.inf
        return float(Fraction(len(self.plan.primitives) if self.cost is None else self.cost) + (self.penalty or 0))

    @property
    def proved(self) -> bool:
        """Whether `bound` proves that no plan has a smaller total than `plan`."""
        return self.plan is not None and self.bound is not None and self.total <= self.bound

    @property
    def unmet(self) -> frozenset[Symbol]:
        """The symbols of the unmet soft goals."""
        return frozenset(one.fact.symbol for one in self.forgone)


Shortening = Literal["none", "brief", "compared", "once", "repeated"]
"""The work for a shorter plan: see `Limits`."""


@dataclass(frozen=True)
class Limits:
    """Limits of a planning call.

    `seconds` limits the whole call, unless `seconds` is None. In the modes guarded, leading and strict, a first plan must be
    found within the share `finding` of this time; the time after a first plan is for a shorter plan. In the paper's mode,
    `expansions` limits each search. In the other modes, `expansions` limits the sum of all searches for single goals, and
    separately the final search for all goals together. `work` limits searches in grounded levels and parts of levels until a plan
    is found. The unit of `work` is states times operators, about a microsecond each. `shortening` is the work for a shorter plan.
    With "none", there is no round; with "once", there is one round. With "brief", there is one round with little work, or no round
    if `seconds` is given. With "compared", there is always one round with little work, after windows of the lowest level were
    replaced. With "repeated", rounds follow one another until the second half of them has saved nothing, or until `seconds` have
    passed.
    Shortening keeps only plans that `accepts` allows.
    """

    expansions: int = 200_000
    seconds: float | None = None
    work: float = math.inf
    shortening: Shortening = "once"
    accepts: Callable[[Plan], bool] | None = None
    finding: float = 1.0

    def end(self, share: float = 1.0) -> float | None:
        """Return the time at which a share of the remaining time ends, on the clock of `perf_counter`, or None without a limit.

        The remaining time is the smaller of `seconds` and the time to the current deadline (`confab.reasoner.limits`).
        """
        left = min((seconds for seconds in (self.seconds, current().left) if seconds is not None), default=None)
        return None if left is None else perf_counter() + share * left

    def until(self, end: float | None) -> Limits:
        """Return the limits with the seconds from now until the time `end`, for one part of a longer call."""
        return self if end is None else replace(self, seconds=max(end - perf_counter(), 0.0))


class Planner(Protocol):
    """The interface of a planning function that respects limits."""

    def __call__(self, problem: Problem, /, *, limits: Limits) -> Outcome:
        """Return a plan, or the reason why there is none."""


class UnsolvableError(Exception):
    """The planner has proved that no plan exists; the error has the reason and, if available, the certificate."""

    def __init__(self, reason: Reason, certificate: Certificate | None = None) -> None:
        super().__init__(reason.text)
        self.reason, self.certificate = reason, certificate


class UngroundableError(Exception):
    """A level can't be grounded, because the level is too large or its amounts aren't linear; the message gives the cause."""


@contextmanager
def paused_collection() -> Iterator[None]:
    """Pause the garbage collector of Python while the context is active.

    Reading and planning create no reference cycles, and garbage collection would take a third of their time.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def changed(before: State, after: State) -> list[Fact]:
    """Return the sorted facts of `after` that `before` doesn't contain."""
    return sorted(Fact(symbol, value) for symbol, value in after.items() if before.get(symbol) != value)


def renumbered(steps: Iterable[Step], first: int = 0, above: tuple[int, ...] = ()) -> tuple[Step, ...]:
    """Return steps with new paths; the first step below the path `above` has the number `first`."""
    return tuple(
        replace(
            step,
            path=(*above, i),
            steps=renumbered(step.steps, 0, (*above, i)),
            joined=tuple(replace(one, path=(*above, i)) for one in step.joined),
        )
        for i, step in enumerate(steps, first)
    )
