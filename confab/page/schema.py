"""The types of the page's JSON object (docs/page.md)."""

from __future__ import annotations

from typing import TypedDict

FORMAT = 1
"""Version of the format of the JSON object. A page can only show objects of the same version."""


class Interval(TypedDict, total=False):
    """A bar in a row of the timeline: a step or a value, its times, and the meaning of its colour (`tone`).

    `step` is the ID of the step. The end of the step may be delayed by `slack` without delaying the end of the plan.
    """

    begin: float
    end: float
    label: str
    tone: str  # for steps: action, planned, failed; for facts: start, between, wanted
    step: str
    note: str
    slack: float


class TimelineRow(TypedDict, total=False):
    """A row of the timeline.

    The row's `group` is ``levels``, ``actors``, ``changes``, ``wanted`` or ``fixed``. For a symbol, `met` tells whether the
    symbol has its goal value in the end.
    """

    group: str
    label: str
    bars: list[Interval]
    met: bool


class StepData(TypedDict, total=False):
    """A step of the plan.

    The step's ID consists of the numbers of its path, joined by dots; it therefore begins with the ID of the parent step.
    """

    id: str
    number: str
    what: str
    name: str
    ok: bool
    note: str
    begin: float
    end: float
    gives: list[str]
    needs: list[str]
    facts: list[tuple[str, str]]


class MapObject(TypedDict):
    """An object on the map.

    Each element of `at` has a time, the object's place (or an empty text), a sentence, and a tone (the meaning of a colour).
    """

    id: str
    label: str
    at: list[tuple[float, str, str, str]]


class AreaData(TypedDict):
    """A polygon of the map."""

    id: str
    label: str
    corners: list[tuple[float, float]]


class Spot(TypedDict):
    """A point of the map."""

    id: str
    label: str
    at: tuple[float, float]


class MapData(TypedDict):
    """The map, whose x axis points to the right and whose y axis points down."""

    areas: list[AreaData]
    ways: list[tuple[str, str]]
    places: list[Spot]
    robots: list[Spot]
    things: list[MapObject]
    metric: bool
    note: str


class Alarm(TypedDict, total=False):
    """A failure: its text, the failed step, and the measured numbers."""

    title: str
    step: str
    lines: list[str]
    measured: list[tuple[str, str]]


class FilmData(TypedDict, total=False):
    """A film of the run.

    `speed` is the ratio of simulated time to the film's time. The page shows the picture `poster` before the film is played.
    """

    source: str
    kind: str
    speed: float
    caption: str
    poster: str


class Tile(TypedDict):
    """A figure of a run with its name."""

    name: str
    text: str


class GoalData(TypedDict, total=False):
    """A goal with the initial and the final value of its symbol."""

    label: str
    before: str
    after: str
    met: bool


class TimelineMark(TypedDict):
    """The time and the text of an intervention or of a change of the plan."""

    at: float
    text: str


class Learned(TypedDict):
    """The content of memory after a run: a summary and the rules by kind of goal."""

    text: str
    rules: list[tuple[str, list[str]]]


class TurnableRow(TypedDict):
    """A symbol whose value the user can change.

    The row has the symbol's key, its label, the name of its list of values, its current value and its goal value.
    """

    key: str
    label: str
    values: str
    now: str
    wanted: str | None


class Turnable(TypedDict):
    """All symbols whose values the user can change, and the lists of their possible values.

    Each list of values has a name, and each value has a label.
    """

    rows: list[TurnableRow]
    values: dict[str, list[tuple[str, str]]]
    hidden: int


class ReadyQuery(TypedDict):
    """A shipped SPARQL query with the question that the query answers."""

    name: str
    question: str
    text: str


class PageData(TypedDict, total=False):
    """The content of the page. If planning failed after a change on the page, `problem` is the reason."""

    format: int
    title: str
    iri: str
    good: bool | None
    status: str
    headline: str
    tiles: list[Tile]
    alarm: Alarm
    film: FilmData
    map: MapData
    end: float
    unit: str
    now: float
    marks: list[TimelineMark]
    rows: list[TimelineRow]
    hidden: int
    steps: list[StepData]
    goals: list[GoalData]
    learned: Learned
    notes: list[str]
    again: str
    live: bool
    version: int
    turnable: Turnable
    queries: list[ReadyQuery]
    problem: str
