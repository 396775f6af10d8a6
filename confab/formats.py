"""The types of the JSON data that results return and commands print (docs/command-line.md, docs/execution.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

from confab.planner.certificates import CertificateJson

if TYPE_CHECKING:
    from typing import NotRequired


class StepJson(TypedDict):
    """A step with its sub-steps; in paper mode, `rank` is the step's rank by cogency (score).

    If the sub-steps also refine other steps of the same level, `joined` has these other steps.
    """

    path: list[int]
    id: int
    level: int
    behavior: str
    arguments: list[str]
    bindings: dict[str, str]
    steps: list[StepJson]
    rank: NotRequired[float]
    joined: NotRequired[list[StepJson]]


class ReasonJson(TypedDict):
    """The reason why there is no plan, and the terms that the reason mentions."""

    text: str
    terms: list[str]


class CountsJson(TypedDict):
    """The numbers of states that the search on a level generated, evaluated and expanded."""

    generated: int
    evaluated: int
    expanded: int


class BrokenJson(TypedDict):
    """A violated condition of a level, and the path of the step that violates it."""

    step: list[int]
    text: str


LeftJson = TypedDict("LeftJson", {"level": int, "from": list[int], "to": list[int], "breaks": list[BrokenJson]})
"""A part of a plan without steps of one level, from the step at one path to the step at another. `breaks` has the conditions of
this level that the part violates.
"""


class CacheJson(TypedDict):
    """Numbers of hits and misses in the cache of refinements."""

    hits: int
    misses: int


class ScheduledStepJson(TypedDict):
    """A scheduled step, with times in seconds. Only primitives have actors and slack."""

    path: list[int]
    begin: float
    end: float
    actors: NotRequired[list[str]]
    slack: NotRequired[float]


class ScheduleJson(TypedDict):
    """A scheduled plan, with times in seconds."""

    makespan: float
    serial: float
    bound: float
    bounds: str
    bound_of_any_plan: float
    scheduler: str
    steps: list[ScheduledStepJson]


class ForgoneJson(TypedDict):
    """A soft goal that a plan leaves unmet. `price` is the additional cost of a plan that meets the goal, or null if unknown."""

    goal: str
    weight: float
    price: float | None


class OutcomeJson(TypedDict):
    """The result of planning. For a solved task, the JSON object has the steps and the length of a plan.

    For an unsolved task, the object has the reason, and possibly a certificate that the task is unsolvable.
    """

    scene: str
    status: str
    search: dict[str, CountsJson]
    fallbacks: int
    given_up: list[str]
    left: list[LeftJson]
    cache: CacheJson
    seconds: dict[str, float]
    length: NotRequired[dict[str, int]]
    steps: NotRequired[list[StepJson]]
    cost: NotRequired[float]
    penalty: NotRequired[float]
    bound: NotRequired[float]
    engine: NotRequired[str]
    reason: NotRequired[ReasonJson]
    certificate: NotRequired[CertificateJson]
    forgone: NotRequired[list[ForgoneJson]]


class ResultJson(OutcomeJson, total=False):
    """The result of planning in a scene, with the number of queries and, if requested, the schedule."""

    queries: int
    schedule: ScheduleJson


class SurpriseJson(TypedDict):
    """A symbol with its expected value and the different observed value."""

    symbol: str
    expected: str | None
    observed: str | None


class EventJson(TypedDict):
    """An executed primitive."""

    path: list[int]
    id: int
    behavior: str
    arguments: list[str]
    begin: float
    end: float
    ok: bool
    code: str | None
    surprises: list[SurpriseJson]


class InterventionJson(TypedDict):
    """The text of an intervention, and the time at which the intervention took place."""

    text: str
    seconds: float


class ReplanJson(TypedDict):
    """A change of the plan during execution."""

    after: list[int]
    kind: str
    because: str
    cost: float
    dropped: int
    added: int
    seconds: float
    steps: list[StepJson]


class FailureJson(TypedDict):
    """A failed primitive."""

    path: list[int]
    id: int
    code: str
    objects: list[str]
    message: str


class DiscoveryJson(TypedDict):
    """An individual that the robot discovered, and the time of the discovery."""

    individual: str
    classes: list[str]
    text: str
    seconds: float


class SeenJson(TypedDict):
    """A value of a symbol, and the time at which the symbol got the value. The value is None if the symbol is unobservable."""

    seconds: float
    situation: str
    arguments: list[str]
    value: str | None


class SoftGoalJson(TypedDict):
    """A soft goal, and whether it held at the end of an execution."""

    goal: str
    weight: float
    met: bool


class EpisodeJson(TypedDict):
    """The record of the execution of a task.

    `soft_goals` is present if the task has soft goals, `violations` if violations of constraints were observed.
    """

    scene: str
    status: str
    reasons: list[ReasonJson]
    length: dict[str, int]
    planned: list[StepJson]
    steps: list[StepJson]
    events: list[EventJson]
    interventions: list[InterventionJson]
    never_came: list[str]
    replans: list[ReplanJson]
    failures: list[FailureJson]
    discovered: list[DiscoveryJson]
    goal: list[str]
    initial: list[SeenJson]
    course: list[SeenJson]
    seconds: dict[str, float]
    measured: bool
    soft_goals: NotRequired[list[SoftGoalJson]]
    violations: NotRequired[list[str]]


class BecauseJson(TypedDict):
    """The reasons why a step is in a plan."""

    number: str
    path: list[int]
    id: int
    step: str
    what: str
    gives: list[str]
    needs: list[str]


class WhyNotJson(TypedDict):
    """The reasons why an alternative isn't in the plan. `steps` is the plan with the alternative."""

    asked: str
    answer: str
    lacks: list[str]
    breaks: list[str]
    more: float | None
    steps: list[StepJson] | None


class AccountJson(TypedDict):
    """An explanation of a plan, or the reason why there is no plan."""

    headline: str
    steps: list[BecauseJson]
    proof: list[str]
