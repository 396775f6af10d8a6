"""The forms of the JSON data that results return and commands print (docs/command-line.md, docs/execution.md)."""

from __future__ import annotations

from typing import TypedDict

from confab.planner.certificates import CertificateJson


class _Step(TypedDict):
    path: list[int]
    id: int
    level: int
    behavior: str
    arguments: list[str]
    bindings: dict[str, str]
    steps: list[StepJson]


class StepJson(_Step, total=False):
    """A step with all steps below it; `rank` is given by the memory."""

    rank: float


class ReasonJson(TypedDict):
    """Why there is no plan, and the terms that the reason mentions."""

    text: str
    terms: list[str]


class CountsJson(TypedDict):
    """The effort of the search on a level, in states."""

    generated: int
    evaluated: int
    expanded: int


class BrokenJson(TypedDict):
    """A violated condition of a level, and the path of its step."""

    step: list[int]
    text: str


LeftJson = TypedDict("LeftJson", {"level": int, "from": list[int], "to": list[int], "breaks": list[BrokenJson]})
"""A level that the plan leaves between two paths, and the conditions of the level that it violates there."""


class CacheJson(TypedDict):
    """Numbers of hits and misses in the cache of refinements."""

    hits: int
    misses: int


class _ScheduledStep(TypedDict):
    path: list[int]
    begin: float
    end: float


class ScheduledStepJson(_ScheduledStep, total=False):
    """A step in time, in seconds; primitives have actors and slack."""

    actors: list[str]
    slack: float


class ScheduleJson(TypedDict):
    """A plan in time, in seconds."""

    makespan: float
    serial: float
    bound: float
    bounds: str
    scheduler: str
    steps: list[ScheduledStepJson]


class ForgoneJson(TypedDict):
    """A soft goal that a plan leaves unmet; `price` is the additional cost of a plan that meets it, null if none was found."""

    goal: str
    weight: float
    price: float | None


class _Outcome(TypedDict):
    scene: str
    status: str
    search: dict[str, CountsJson]
    fallbacks: int
    given_up: list[str]
    left: list[LeftJson]
    cache: CacheJson
    seconds: dict[str, float]


class OutcomeJson(_Outcome, total=False):
    """The result of planning: the steps and the length of a plan.

    The result for an unsolvable task has a reason and, if available, a certificate.
    """

    length: dict[str, int]
    steps: list[StepJson]
    cost: float
    bound: float
    engine: str
    reason: ReasonJson
    certificate: CertificateJson
    forgone: list[ForgoneJson]


class ResultJson(OutcomeJson, total=False):
    """The result of planning in a scene, with the number of queries and, if requested, the schedule."""

    queries: int
    schedule: ScheduleJson


class SurpriseJson(TypedDict):
    """A symbol with an unexpected value."""

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
    """An intervention as it was written, and when it took place."""

    text: str
    seconds: float


class ReplanJson(TypedDict):
    """A change of the plan."""

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
    """An individual that was discovered, and when."""

    individual: str
    classes: list[str]
    text: str
    seconds: float


class SeenJson(TypedDict):
    """A value of a symbol, with the time from which on the symbol had it; None if it could no longer be observed."""

    seconds: float
    situation: str
    arguments: list[str]
    value: str | None


class EpisodeJson(TypedDict):
    """The execution of a task."""

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


class BecauseJson(TypedDict):
    """Why a step is in a plan."""

    number: str
    path: list[int]
    id: int
    step: str
    what: str
    gives: list[str]
    needs: list[str]


class WhyNotJson(TypedDict):
    """Why an alternative isn't in the plan; `steps` is the plan with it."""

    asked: str
    answer: str
    lacks: list[str]
    breaks: list[str]
    more: float | None
    steps: list[StepJson] | None


class AccountJson(TypedDict):
    """An explanation of a plan, or of why there is none."""

    headline: str
    steps: list[BecauseJson]
    proof: list[str]
